//! Contacts of a sector, as read and written by the steps of an island.

use crate::math::vector::{set_strided_vector3, set_vector3_at, vector3_at};
use crate::system::Structure;
use crate::time::galerkin::state::SectorState;

impl Structure {
    /// Reads the contacts of a sector before a span.
    pub(crate) fn read_contacts(&self, sector: usize, state: &mut SectorState) {
        for node in 0..self.nodes() {
            let index = self.index(node, sector);
            state.multipliers[node] = self.history.multiplier[index];
            state.gaps[node] = self.history.gap.before[index];
            let (normals, slopes) = (&self.step_control.normals, &self.step_control.slopes);
            set_vector3_at(&mut state.normals, node, self.vector3(normals, node, sector));
            set_vector3_at(&mut state.slopes, node, self.vector3(slopes, node, sector));
            set_vector3_at(&mut state.forces, node, self.vector3(&self.history.force.now, node, sector));
        }
        state.gaps_known = true;
    }

    /// Returns whether a contact of a sector pushes.
    pub(super) fn is_loaded(&self, sector: usize) -> bool {
        (0..self.nodes()).any(|node| self.history.multiplier[self.index(node, sector)] != 0.0)
    }

    /// Writes the smallest gap of each node of a sector during the span (m).
    pub(super) fn write_lowest(&mut self, sector: usize, lowest: impl Fn(usize) -> f64) {
        for node in 0..self.nodes() {
            let index = self.index(node, sector);
            self.lowest_in_span[index] = lowest(node);
        }
    }

    /// Writes the contacts of a sector after a span, and the smallest gap of each node during the span (m).
    pub(crate) fn write_contacts(&mut self, sector: usize, state: &SectorState, lowest: impl Fn(usize) -> f64) {
        let lanes = self.lanes();
        for node in 0..self.nodes() {
            let index = self.index(node, sector);
            self.history.multiplier[index] = state.multipliers[node];
            self.lowest_in_span[index] = lowest(node);
            let first = 3 * node * lanes + sector;
            set_strided_vector3(&mut self.history.force.now, first, lanes, vector3_at(&state.forces, node));
            set_strided_vector3(&mut self.step_control.normals, first, lanes, vector3_at(&state.normals, node));
            set_strided_vector3(&mut self.step_control.slopes, first, lanes, vector3_at(&state.slopes, node));
        }
    }
}
