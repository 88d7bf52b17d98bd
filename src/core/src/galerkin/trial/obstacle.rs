//! What a sector may touch.

use crate::galerkin::compliance::Lanes;

/// Surfaces that the nodes of a sector may touch, at the points of the tried step.
pub trait Obstacle {
    /// Gap (m; infinite where there is nothing to touch) and unit normal to the node displaced by `moved` (m), at a point of the step.
    fn gap(&mut self, node: usize, point: usize, moved: [f64; 3]) -> (f64, [f64; 3]);

    /// Gaps (m) and normals at all points but the first; arrays of [`Lanes`].
    fn gaps(&mut self, lanes: Lanes, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        node_by_node(self, lanes, moved, gaps, normals);
    }

    /// Gap (m) of a node displaced by `moved` (m) at the fraction `theta` of the step. `None` if it is known at the points only.
    fn gap_within(&self, _node: usize, _theta: f64, _moved: [f64; 3]) -> Option<f64> {
        None
    }

    /// Whether directions of sliding turn within a step, and ask for [`SlidingState::sliding_distance`].
    fn turns(&self) -> bool {
        false
    }

    /// Force per unit of λ on the node, friction included.
    fn direction(&mut self, node: usize, point: usize, sliding: &SlidingState) -> [f64; 3];

    /// Contacts at the lanes chosen are about to be solved, with these normals: get ready to tell how what is touched gives way there.
    /// False where it does not.
    fn prepare_compliance(&mut self, _lanes: Lanes, _chosen: &[bool], _normals: &[f64]) -> bool {
        false
    }

    /// By how much what is touched gives way at all lanes (m, along their normals, away from the node) per λ of one with the force
    /// `direction` per λ; only after [`Obstacle::prepare_compliance`] has said that it does.
    fn add_normal_compliance(&mut self, _lane: usize, _direction: [f64; 3], _given: &mut [f64]) {}

    /// The same in all three directions of each lane, under a `force` on one (N).
    fn add_compliance(&mut self, _lane: usize, _force: [f64; 3], _given: &mut [f64]) {}

    /// Coefficient µ of a node that may stick.
    fn friction(&self, _node: usize) -> f64 {
        0.0
    }

    /// Returns the sliding (m) of a node up to a point of the step that prescribed motion and the motion of the surface cause; the node is displaced
    /// by `moved` (m).
    fn drift(&self, _node: usize, _point: usize, _moved: [f64; 3]) -> [f64; 3] {
        [0.0; 3]
    }
}

/// Sliding motion of a node at a point of the step.
#[derive(Debug, Clone, Copy)]
pub struct SlidingState {
    /// Displacement of the node (m).
    pub moved: [f64; 3],
    /// Velocity of its vibration at the start of the step (m/s).
    pub velocity: [f64; 3],
    /// Sliding distance that a force at this point works on, Σ_k S_ik ũ_k (m), by modes with inertia; 0 unless [`Obstacle::turns`].
    pub sliding_distance: [f64; 3],
    /// Unit normal at the point.
    pub normal: [f64; 3],
}

/// [`Obstacle::gaps`] by [`Obstacle::gap`] of every lane.
pub fn node_by_node(
    obstacle: &mut (impl Obstacle + ?Sized),
    lanes: Lanes,
    moved: &[f64],
    gaps: &mut [f64],
    normals: &mut [f64],
) {
    for lane in 0..lanes.len() {
        let (point, node) = lanes.place(lane);
        let (gap, normal) = obstacle.gap(node, point, lanes.vector3(moved, lane));
        gaps[lane] = gap;
        lanes.set(normals, lane, normal);
    }
}
