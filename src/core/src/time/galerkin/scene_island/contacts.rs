//! Contacts of a sector, as read and written by the steps of an island.

use super::blade_sectors::{Sampled, SectorResult};
use crate::math::vector::{set_strided_vector3, set_vector3_at, vector3_at};
use crate::system::structure::{Structure, UNKNOWN_GAP};
use crate::time::galerkin::island::StepControl;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::HALVINGS;

impl Structure {
    /// Reads the contacts of a sector before a span.
    pub(crate) fn read_contacts(&self, sector: usize, state: &mut SectorState) {
        self.read_gaps(sector, state);
        for node in 0..self.nodes() {
            let index = self.index(node, sector);
            state.multipliers[node] = self.history.multiplier[index];
            let (normals, slopes) = (&self.step_control.normals, &self.step_control.slopes);
            set_vector3_at(&mut state.normals, node, self.vector3(normals, node, sector));
            set_vector3_at(&mut state.slopes, node, self.vector3(slopes, node, sector));
            set_vector3_at(&mut state.forces, node, self.vector3(&self.history.force.now, node, sector));
        }
        state.gaps_known = true;
    }

    /// Reads the gaps of a sector before a span.
    pub(super) fn read_gaps(&self, sector: usize, state: &mut SectorState) {
        for (node, gap) in state.gaps.iter_mut().enumerate() {
            *gap = self.history.gap.before[self.index(node, sector)];
        }
    }

    /// Returns the step control of a sector.
    pub(super) fn step_control_of(&self, sector: usize) -> StepControl {
        let control = &self.step_control;
        StepControl {
            bank: control.bank[sector],
            largest: control.largest[sector],
            level: usize::try_from(control.level[sector]).unwrap_or(HALVINGS).min(HALVINGS),
        }
    }

    /// Writes the step control of a sector.
    pub(super) fn write_step_control(&mut self, sector: usize, of: StepControl) {
        let control = &mut self.step_control;
        (control.bank[sector], control.largest[sector]) = (of.bank, of.largest);
        control.level[sector] = of.level as u64;
    }

    /// Returns whether a contact of a sector pushes.
    fn is_loaded(&self, sector: usize) -> bool {
        (0..self.nodes()).any(|node| self.history.multiplier[self.index(node, sector)] != 0.0)
    }

    /// Writes the smallest gap of each node of a sector during the span (m).
    fn write_lowest(&mut self, sector: usize, lowest: impl Fn(usize) -> f64) {
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

    /// Writes the gaps at the end of an interval of a steady phase; see [`UNKNOWN_GAP`].
    pub(super) fn write_gaps(&mut self, sector: usize, result: &SectorResult) {
        if result.sampled == Sampled::Energies {
            for node in 0..self.nodes() {
                let index = self.index(node, sector);
                (self.history.gap.now[index], self.history.gap.before[index]) = (UNKNOWN_GAP, UNKNOWN_GAP);
            }
            return;
        }
        let step = self.modes().step();
        for (node, (gap, rate)) in result.state.gaps.iter().zip(&result.gap_rates).enumerate() {
            let index = self.index(node, sector);
            (self.history.gap.now[index], self.history.gap.before[index]) = (*gap, gap - step * rate);
        }
    }

    /// Writes the state of a sector that faces a surface of revolution after a span.
    pub(super) fn write_result(&mut self, sector: usize, result: &SectorResult) {
        let SectorResult { state, tally, control, displacements, sampled, .. } = result;
        let is_known = *sampled == Sampled::State;
        if is_known && (state.is_loaded() || self.is_loaded(sector)) {
            self.write_contacts(sector, state, |node| tally.lowest(node));
        } else {
            self.write_lowest(sector, |node| tally.lowest(node));
        }
        self.write_step_control(sector, *control);
        if is_known {
            self.modes.write_sector(sector, &state.position, &state.velocity, &state.forces, displacements);
        }
        self.modes.lose(sector, tally.damping);
    }
}
