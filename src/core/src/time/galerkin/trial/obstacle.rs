//! Surfaces that a sector may touch.

use crate::contact::ContactParameters;
use crate::geometry::{Gap, Sliding, Vector3};
use crate::time::galerkin::compliance::Lanes;

/// Surfaces that the nodes of a sector may touch, at the points of the tried step.
pub trait Obstacle {
    /// Returns the gap of the node displaced by `moved` (m) at a point of the step.
    fn gap(&mut self, node: usize, point: usize, moved: Vector3) -> Gap;

    /// Returns the gap (m) of the node displaced by `moved` (m) at the start of the step, on surfaces that are bent as there.
    fn gap_at_start(&mut self, node: usize, moved: Vector3) -> f64 {
        self.gap(node, 0, moved).distance
    }

    /// Finds gaps (m) and normals at all points but the first; arrays of [`Lanes`].
    fn gaps(&mut self, lanes: Lanes, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        node_by_node(self, lanes, moved, gaps, normals);
    }

    /// Finds gaps (m) and normals of the nodes at one point, except for those whose gaps
    /// [`Surroundings::find_ring_gaps`](crate::time::galerkin::surroundings::Surroundings::find_ring_gaps) finds. Surfaces must have their
    /// shape at this point. The arrays have the layout of [`Lanes`].
    fn gaps_at(&mut self, point: usize, lanes: Lanes, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        for node in 0..lanes.nodes {
            let lane = lanes.at(point, node);
            let gap = self.gap(node, point, lanes.vector3(moved, lane));
            gaps[lane] = gap.distance;
            lanes.set(normals, lane, gap.normal);
        }
    }

    /// Gap (m) of a node displaced by `moved` (m) at the fraction `theta` of the step; `None` if it is known at the points only.
    fn gap_within(&self, _node: usize, _theta: f64, _moved: Vector3) -> Option<f64> {
        None
    }

    /// Returns the displacement of a node (m) at which a run ends. Infinite if there is no limit.
    fn largest_displacement(&self, _node: usize) -> f64 {
        f64::INFINITY
    }

    /// Returns whether sliding directions turn within a step, so that [`SlidingState::sliding_distance`] is needed.
    fn turns(&self) -> bool {
        false
    }

    /// Parameters of the contact law of a node.
    fn parameters(&self, node: usize) -> &ContactParameters;

    /// Returns the sliding of a node relative to the surface; called only with friction.
    fn sliding(&mut self, node: usize, point: usize, state: &SlidingState) -> Sliding;

    /// Sector of the nodes.
    fn sector(&self) -> usize;

    /// Angle on the surface (rad, fixed frame) of a node displaced by `moved` (m); 0 on surfaces without an axis.
    fn angle(&self, node: usize, point: usize, moved: Vector3) -> f64;

    /// Begins the solution of a contact problem.
    fn begin_solution(&mut self) {}

    /// Prepares the compliance of the obstacle at the chosen lanes with these normals. Returns false if the obstacle is rigid.
    fn prepare_compliance(&mut self, _lanes: Lanes, _chosen: &[bool], _normals: &[f64]) -> bool {
        false
    }

    /// Adds the displacement of the obstacle at all lanes (m, along their normals, away from the node) per λ of one lane, whose
    /// force per λ is `direction`. Valid only after [`Obstacle::prepare_compliance`] has returned true.
    fn add_normal_compliance(&mut self, _lane: usize, _direction: Vector3, _given: &mut [f64]) {}

    /// Returns whether the sector exchanges forces with other sectors on the obstacle.
    fn is_coupled(&self) -> bool {
        false
    }

    /// Adds a change of λ (N) of a lane since the last evaluation of the gaps. The compliance at this lane must have been prepared.
    fn add_force_change(&mut self, _lane: usize, _change: f64) {}

    /// Finds the motion of the obstacle caused by all changes of the forces of all sectors.
    fn apply_force_changes(&mut self) {}

    /// Returns the change of the gap of a lane caused by this motion (m).
    fn gap_change(&self, _lane: usize) -> f64 {
        0.0
    }

    /// Adds the displacement of the obstacle in all three directions of each lane, under a `force` on one lane (N).
    fn add_compliance(&mut self, _lane: usize, _force: Vector3, _given: &mut [f64]) {}

    /// Returns the sliding (m) of a node up to a point of the step that prescribed motion and the motion of the surface cause;
    /// the node is displaced by `moved` (m).
    fn drift(&self, _node: usize, _point: usize, _moved: Vector3) -> Vector3 {
        Vector3::zeros()
    }
}

/// Sliding motion of a node at a point of the step.
#[derive(Debug, Clone, Copy)]
pub struct SlidingState {
    /// Displacement of the node (m).
    pub moved: Vector3,
    /// Vibration velocity of the node at the start of the step (m/s).
    pub velocity: Vector3,
    /// Sliding distance over which a force at this point does work, Σ_k S_ik ũ_k (m), by modes with inertia; 0 unless [`Obstacle::turns`].
    pub sliding_distance: Vector3,
    /// Time for which a force at this point acts (s).
    pub duration: f64,
    /// Unit normal at the point.
    pub normal: Vector3,
}

/// Evaluates [`Obstacle::gaps`] by [`Obstacle::gap`] of every lane.
pub(crate) fn node_by_node(
    obstacle: &mut (impl Obstacle + ?Sized),
    lanes: Lanes,
    moved: &[f64],
    gaps: &mut [f64],
    normals: &mut [f64],
) {
    for lane in 0..lanes.len() {
        let (point, node) = lanes.place(lane);
        let gap = obstacle.gap(node, point, lanes.vector3(moved, lane));
        gaps[lane] = gap.distance;
        lanes.set(normals, lane, gap.normal);
    }
}
