//! Results of a trial: forces, gaps and displacements of the nodes at the points, and the state at the end.

use super::{ForceInterpolation, Trial};
use crate::geometry::Gap;
use crate::math::vector::{Vector3, set_vector3_at, vector3_at};
use crate::time::galerkin::basis::{MOST, TimeBasis};
use crate::time::galerkin::rows::{ContactRows, Sums};
use crate::time::galerkin::state::SectorState;
use nalgebra::DMatrix;

/// Bounds of the displacements of the nodes of a sector from their current positions, over a limited time without contact.
pub(crate) struct TravelBounds<'a> {
    /// Velocities of the rows by slow modes (m/s), in the first set.
    slow: &'a Sums<2>,
    /// Bounds of the other displacements of the rows (m).
    rest: &'a Sums<1>,
    /// Number of nodes.
    nodes: usize,
}

impl TravelBounds<'_> {
    /// Bounds of the displacement components of a node (m) over up to `time` (s), which must not exceed the time for which the bounds hold.
    pub fn of_node(&self, node: usize, time: f64) -> Vector3 {
        time * self.slow.vector3(0, node, self.nodes).abs() + self.rest.vector3(0, node, self.nodes)
    }
}

impl Trial {
    /// Returns the largest displacement of each row from rest (m) without contact.
    pub(crate) fn largest_displacements(&mut self, rows: &ContactRows, state: &SectorState) -> &[f64] {
        let (sums, reach) = &mut self.reach;
        rows.unresolved_amplitudes(f64::INFINITY, state, sums);
        let nodes = self.lanes.nodes;
        (0..nodes).for_each(|node| set_vector3_at(reach, node, sums.vector3(0, node, nodes)));
        reach
    }

    /// Bounds the displacements of the nodes from their current positions over up to `max_time` (s) without contact.
    pub(crate) fn travel(&mut self, rows: &ContactRows, state: &SectorState, max_time: f64) -> TravelBounds<'_> {
        let ((rest, _), now) = (&mut self.reach, &mut self.now);
        rows.travel(max_time, state, now, rest);
        TravelBounds { slow: now, rest, nodes: self.lanes.nodes }
    }

    /// Number of points at which forces are unknown: s, or 1 if the force is constant.
    pub fn points(&self) -> usize {
        self.lanes.points
    }

    /// Number of contact nodes.
    pub fn nodes(&self) -> usize {
        self.lanes.nodes
    }

    /// λ of a node at point 0 … s (N).
    pub fn multiplier(&self, point: usize, node: usize) -> f64 {
        if point == 0 { self.start_contacts.multipliers[node] } else { self.multipliers[self.lanes.at(point, node)] }
    }

    /// Force on a node at point 0 … s (N).
    pub fn force(&self, point: usize, node: usize) -> Vector3 {
        if point == 0 { vector3_at(&self.start_contacts.forces, node) } else { self.lane(&self.forces, point, node) }
    }

    /// Sets the gap (m) and the normal of a node at point 1 … s.
    pub(crate) fn set_gap(&mut self, point: usize, node: usize, gap: &Gap) {
        let lane = self.lanes.at(point, node);
        self.gaps[lane] = gap.distance;
        self.lanes.set(&mut self.normals, lane, gap.normal);
    }

    /// Returns the gap of a node (m).
    pub fn gap(&self, point: usize, node: usize) -> f64 {
        if point == 0 { self.start_contacts.gaps[node] } else { self.gaps[self.lanes.at(point, node)] }
    }

    /// Gap of a node (m), 0 where there is nothing to touch (beyond a free edge), because no force does work there.
    pub(crate) fn finite_gap(&self, point: usize, node: usize) -> f64 {
        let gap = self.gap(point, node);
        if gap == f64::INFINITY { 0.0 } else { gap }
    }

    /// Returns the unit normal of a node.
    pub fn normal(&self, point: usize, node: usize) -> Vector3 {
        if point == 0 { vector3_at(&self.start_contacts.normals, node) } else { self.lane(&self.normals, point, node) }
    }

    /// Unit normal for which the force of a node was found: force − λ · normal is friction.
    fn solved_normal(&self, point: usize, node: usize) -> Vector3 {
        if point == 0 {
            vector3_at(&self.start_contacts.normals, node)
        } else {
            self.lane(&self.solved_normals, point, node)
        }
    }

    /// Friction force on a node (N).
    pub(crate) fn friction_force(&self, point: usize, node: usize) -> Vector3 {
        self.force(point, node) - self.multiplier(point, node) * self.solved_normal(point, node)
    }

    /// Returns the displacement of a node (m); at the start only if the displacements there were found or set.
    pub fn displacement(&self, point: usize, node: usize) -> Vector3 {
        if point == 0 { vector3_at(&self.start, node) } else { self.lane(&self.moved, point, node) }
    }

    fn lane(&self, values: &[f64], point: usize, node: usize) -> Vector3 {
        self.lanes.vector3(values, self.lanes.at(point, node))
    }

    /// Returns a node that had nothing to touch at the start of the step and now penetrates.
    pub fn entered(&self) -> Option<usize> {
        let inside = |node: &usize| (1..=self.points()).any(|point| self.gap(point, *node) < 0.0);
        (0..self.nodes()).find(|node| self.start_contacts.gaps[*node] == f64::INFINITY && inside(node))
    }

    /// Returns the smallest gap and the largest gap of an active contact.
    pub fn extremes(&self) -> (f64, f64) {
        let lanes = self.lanes;
        let (mut lowest, mut largest) = (f64::INFINITY, 0.0_f64);
        for (gap, multiplier) in self.gaps[..lanes.len()].iter().zip(&self.multipliers) {
            lowest = if gap.is_nan() || lowest.is_nan() { f64::NAN } else { lowest.min(*gap) };
            if *multiplier > 0.0 {
                largest = largest.max(gap.abs());
            }
        }
        (lowest, largest)
    }

    /// Returns whether no contact is active.
    pub fn rests(&self) -> bool {
        self.multipliers[..self.lanes.len()].iter().all(|value| *value == 0.0)
    }

    /// Coefficients of θᵃ of the force on a node (N), projected on degree s − 1; `None` without a force.
    pub fn polynomial(&self, basis: &TimeBasis, kind: ForceInterpolation, node: usize) -> Option<[Vector3; MOST]> {
        let mut sums = [Vector3::zeros(); MOST];
        if kind == ForceInterpolation::Constant {
            sums[0] = self.force(1, node);
            return (self.multiplier(1, node) > 0.0).then_some(sums);
        }
        let mut pushed = false;
        for point in (0..basis.count()).filter(|point| self.multiplier(*point, node) > 0.0) {
            pushed = true;
            let force = self.force(point, node);
            for (sum, weights) in sums.iter_mut().zip(&basis.projection) {
                *sum += weights[point] * force;
            }
        }
        pushed.then_some(sums)
    }

    /// ½ΔfᵀGΔf, the energy lost by the change to a constant force (J), with G of all rows (m/N).
    pub fn dropped(&self, residual: &DMatrix<f64>, state: &SectorState) -> f64 {
        let change = |row: usize| self.force(1, row / 3)[row % 3] - state.forces[row];
        let rows = 0..residual.nrows();
        0.5 * rows
            .clone()
            .map(|i| change(i) * rows.clone().map(|k| residual[(i, k)] * change(k)).sum::<f64>())
            .sum::<f64>()
    }

    /// Returns the energy that contacts lose when they close under a constant force: λ times the gap before (J).
    pub fn closed(&self) -> f64 {
        let lost = |node: usize| self.multiplier(1, node) * (self.finite_gap(0, node) - self.finite_gap(1, node));
        (0..self.nodes()).filter(|node| self.multiplier(1, *node) > 0.0).map(lost).sum()
    }

    /// Sets forces, gaps and normals of the state to those at the end of the step.
    pub fn leave(&mut self, state: &mut SectorState) {
        let points = self.points();
        for node in 0..self.nodes() {
            let pushes = self.multiplier(points, node) > 0.0;
            let normal = if pushes { self.solved_normal(points, node) } else { Vector3::zeros() };
            let force = self.force(points, node);
            set_vector3_at(&mut state.forces, node, force);
            set_vector3_at(&mut state.normals, node, normal);
            if self.sticks() {
                let slope = match points {
                    1 => (force - vector3_at(&self.start_contacts.forces, node)) * self.per_step,
                    _ => (0..=points).map(|point| self.end_slopes[point] * self.force(point, node)).sum(),
                };
                set_vector3_at(&mut state.slopes, node, slope);
            }
            state.multipliers[node] = self.multiplier(points, node);
            state.gaps[node] = self.gap(points, node);
        }
        state.gaps_known = true;
        self.forget();
    }
}
