//! Forces that act on some sectors after the prediction: contact forces, delayed forces, modal loads.

use super::ModalBank;
use super::predict::{Accumulate, AddColumns, used_len};
use crate::modes::schemes::ModeCoefficients;

impl ModalBank {
    /// Adds `correction` to the modes of one sector.
    pub(super) fn move_modes(&mut self, sector: usize) {
        let correction = std::mem::take(&mut self.correction);
        self.move_each(sector, correction.iter(), |_, correction| *correction);
        self.correction = correction;
    }

    /// Adds c φᵀf to the modes of one sector.
    fn respond_and_move(&mut self, sector: usize) {
        let modal_force = std::mem::take(&mut self.modal_force);
        self.move_each(sector, modal_force.iter(), |k, force| k.compliance * force);
        self.modal_force = modal_force;
    }

    #[inline(always)]
    fn move_each<'a>(
        &mut self,
        sector: usize,
        values: impl Iterator<Item = &'a f64>,
        correction: impl Fn(&ModeCoefficients, &f64) -> f64,
    ) {
        let (modes, width, set) = (self.modes, self.width, self.set_of(sector));
        let coefficients = &self.coefficients[set * modes..][..modes];
        let (block, lane) = (sector / width * modes * width, sector % width);
        let position = self.state.position[block..][..modes * width].chunks_exact_mut(width);
        let increment = self.state.increment[block..][..modes * width].chunks_exact_mut(width);
        let before = self.increment_before[block..][..modes * width].chunks_exact(width);
        let mut loss = 0.0;
        for ((((position, increment), before), value), coefficients) in
            position.zip(increment).zip(before).zip(values).zip(coefficients)
        {
            let correction = correction(coefficients, value);
            if self.with_loss {
                let predicted = increment[lane] + before[lane];
                loss += coefficients.loss * correction * (2.0 * predicted + correction);
            }
            position[lane] += correction;
            increment[lane] += correction;
        }
        self.state.loss[sector] += loss;
    }

    /// Adds the displacement of the contact rows by `correction`.
    pub(super) fn move_rows(&mut self, sector: usize) {
        let lanes = self.lanes;
        // Quasi-static modes, which come last, do not respond to delayed forces.
        let used = used_len(&self.correction);
        // Sums over whole groups of four modes have the same bits as sums over all modes.
        let values = &self.correction[..used.next_multiple_of(4).min(self.modes)];
        let matrix = &self.contact_modes[..values.len() * self.rows];
        if lanes == 1 {
            let sums = &mut self.state.displacement;
            self.instruction_set.run(Accumulate { sums, matrix, values });
            return;
        }
        let mut moved = std::mem::take(&mut self.row_values);
        let rows = || self.state.displacement.chunks_exact(lanes);
        moved.iter_mut().zip(rows()).for_each(|(moved, row)| *moved = row[sector]);
        self.instruction_set.run(AddColumns { sums: &mut moved, matrix, values });
        let rows = self.state.displacement.chunks_exact_mut(lanes);
        rows.zip(&moved).for_each(|(row, moved)| row[sector] = *moved);
        self.row_values = moved;
    }

    /// Writes φᵀf of one sector, for the force on its rows (N), to the scratch array `modal_force`.
    fn project(&mut self, force: &[f64]) {
        self.modal_force.fill(0.0);
        let (sums, matrix) = (&mut self.modal_force, &self.contact_rows);
        self.instruction_set.run(AddColumns { sums, matrix, values: force });
    }

    /// Corrects one sector for the contact `force` on its rows (N), eq. 11 of the paper.
    pub fn correct(&mut self, sector: usize, force: &[f64]) {
        self.project(force);
        if self.coupling.is_some() {
            let modal_force = std::mem::take(&mut self.modal_force);
            self.respond(sector, &modal_force, |k, force| k.compliance * force);
            self.modal_force = modal_force;
            self.move_modes(sector);
        } else {
            self.respond_and_move(sector);
        }
        let lanes = self.lanes;
        let flexibility = self.flexibility[self.set_of(sector)].as_slice();
        self.moved.fill(0.0);
        for (column, value) in flexibility.chunks_exact(self.rows).zip(force) {
            for (moved, entry) in self.moved.iter_mut().zip(column) {
                *moved += entry * value;
            }
        }
        for (row, moved) in self.state.displacement.chunks_exact_mut(lanes).zip(&self.moved) {
            row[sector] += moved;
        }
    }

    /// `correction` ← T c f for modal forces f, with the response c f of each mode.
    pub(super) fn respond(&mut self, sector: usize, forces: &[f64], response: impl Fn(&ModeCoefficients, f64) -> f64) {
        let (modes, set) = (self.modes, self.set_of(sector));
        let coefficients = &self.coefficients[set * modes..][..modes];
        for ((correction, force), k) in self.correction.iter_mut().zip(forces).zip(coefficients) {
            *correction = response(k, *force);
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.transform(set, &mut self.correction);
        }
    }

    /// Moves one uncoupled sector after the prediction by the response to modal forces.
    pub(super) fn act_on_modes(
        &mut self,
        sector: usize,
        forces: &[f64],
        response: impl Fn(&ModeCoefficients, f64) -> f64,
    ) {
        self.respond(sector, forces, response);
        self.move_modes(sector);
        self.move_rows(sector);
    }

    /// Writes φᵀf of one sector to the scratch array `modal_force`, for the forces on all rows (`forces[row · lanes + sector]`, N; none
    /// for an empty slice). Returns whether a force differs from 0.
    pub(super) fn project_sector(&mut self, sector: usize, forces: &[f64]) -> bool {
        let mut force = std::mem::take(&mut self.moved);
        force.fill(0.0);
        force.iter_mut().zip(forces.chunks_exact(self.lanes)).for_each(|(force, row)| *force = row[sector]);
        let acts = force.iter().any(|force| *force != 0.0);
        if acts {
            self.project(&force);
        } else {
            self.modal_force.fill(0.0);
        }
        self.moved = force;
        acts
    }

    /// Applies contact forces of the previous step (`forces[row · lanes + sector]`, N) after the prediction (massless-boundary).
    pub(crate) fn act_delayed(&mut self, forces: &[f64]) {
        for sector in 0..self.sectors {
            if self.project_sector(sector, forces) {
                let modal_force = std::mem::take(&mut self.modal_force);
                self.act_delayed_modal(sector, &modal_force);
                self.modal_force = modal_force;
            }
        }
    }

    /// Applies modal forces of the previous step to one sector after the prediction.
    pub(crate) fn act_delayed_modal(&mut self, sector: usize, modal_force: &[f64]) {
        self.act_on_modes(sector, modal_force, |k, force| k.delayed * force);
    }
}
