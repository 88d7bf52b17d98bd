//! Sectors that are tried together: they move each other, or a surface that all of them touch.

use super::Trial;
use crate::galerkin::state::SectorState;

impl Trial {
    /// Displacements (m) and velocities (m/s) of the rows at the start, which somebody else knows.
    pub fn start_at(&mut self, of_row: impl Fn(usize) -> [f64; 2]) {
        for (row, (moved, velocity)) in self.start.iter_mut().zip(&mut self.velocities).enumerate() {
            [*moved, *velocity] = of_row(row);
        }
        self.known = true;
    }

    /// Gaps at the start where nobody has looked; `gap` of a node displaced so (m).
    pub fn find_start_gaps(&mut self, state: &SectorState, mut gap: impl FnMut(usize, [f64; 3]) -> f64) {
        if !state.gaps_known {
            for node in 0..self.nodes() {
                self.start_contacts.gaps[node] = gap(node, super::vector3_at(&self.start, node));
            }
        }
    }

    /// Somebody else knows displacements under the forces of now (m), of a node at point 1 … s: those of others are what is left.
    pub fn carry(&mut self, of: impl Fn(usize, usize) -> [f64; 3]) {
        for lane in 0..self.lanes.len() {
            let (point, node) = self.lanes.place(lane);
            let (all, own) = (of(point, node), self.lanes.vector3(&self.pushed, lane));
            self.lanes.set(&mut self.free, lane, [0, 1, 2].map(|i| all[i] - own[i]));
        }
    }

    /// Gaps (m) and normals at point 1 … s, of nodes at their displacements of now (m).
    pub fn find_gaps_at(&mut self, point: usize, mut gap: impl FnMut(usize, [f64; 3]) -> (f64, [f64; 3])) {
        for node in 0..self.nodes() {
            let lane = self.lanes.at(point, node);
            let (gap, normal) = gap(node, self.lanes.vector3(&self.moved, lane));
            self.gaps[lane] = gap;
            self.lanes.set(&mut self.normals, lane, normal);
        }
    }

    /// Impulses that the step leaves out on the rows of a node (N·s), once it is judged.
    pub fn impulse(&self, node: usize) -> [f64; 3] {
        super::vector3_at(&self.impulses, node)
    }
}
