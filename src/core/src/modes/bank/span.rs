//! State of single sectors, for a scheme that integrates them one by one over a span.

use super::ModalBank;

impl ModalBank {
    /// Number of sets of coefficients: one, or one per sector with mistuning.
    pub fn sets(&self) -> usize {
        if self.options.frequency_factors.is_empty() { 1 } else { self.sectors }
    }

    /// The set of a sector.
    pub(crate) fn set_number(&self, sector: usize) -> usize {
        self.set_of(sector)
    }

    /// Angular frequency of a mode of a sector (rad/s).
    pub(crate) fn frequency_of(&self, mode: usize, sector: usize) -> f64 {
        self.frequency(mode, sector)
    }

    /// Makes the current displacements the previous ones.
    pub(crate) fn begin_span(&mut self) {
        self.state.displacement_before.copy_from_slice(&self.state.displacement);
    }

    /// Reads q and q̇ of the modes with inertia of a sector.
    pub(crate) fn read_sector(&self, sector: usize, position: &mut [f64], velocity: &mut [f64]) {
        for (mode, (q, v)) in position.iter_mut().zip(velocity).enumerate() {
            let (now, increment) = self.modal_state(mode, sector);
            (*q, *v) = (now, increment / self.step);
        }
    }

    /// Writes q and q̇ of a sector, its quasi-static modes under the forces `forces` on the rows (N), and the displacements of the rows (m).
    pub(crate) fn write_sector(
        &mut self,
        sector: usize,
        position: &[f64],
        velocity: &[f64],
        forces: &[f64],
        rows: &[f64],
    ) {
        for (mode, (q, v)) in position.iter().zip(velocity).enumerate() {
            let index = self.index(mode, sector);
            (self.state.position[index], self.state.increment[index]) = (*q, v * self.step);
        }
        for mode in position.len()..self.modes() {
            let shapes = &self.contact_modes[mode * self.rows..][..self.rows];
            let force: f64 = shapes.iter().zip(forces).map(|(shape, force)| shape * force).sum();
            let (index, frequency) = (self.index(mode, sector), self.frequency(mode, sector));
            self.state.position[index] = force / (frequency * frequency);
        }
        let lanes = self.lanes();
        for (row, moved) in rows.iter().enumerate() {
            self.state.displacement[row * lanes + sector] = *moved;
        }
    }

    /// Writes q and q̇ of all modes of a single structure, including those without inertia, and the displacements of the rows (m).
    pub fn write_all(&mut self, position: &[f64], velocity: &[f64], rows: &[f64]) {
        for (mode, (q, v)) in position.iter().zip(velocity).enumerate() {
            let index = self.index(mode, 0);
            (self.state.position[index], self.state.increment[index]) = (*q, v * self.step);
        }
        let lanes = self.lanes();
        rows.iter().enumerate().for_each(|(row, moved)| self.state.displacement[row * lanes] = *moved);
    }

    /// Returns whether there are modal loads in addition to contact forces.
    pub fn is_loaded(&self) -> bool {
        self.options.loads
    }

    /// Makes the current modal loads those at the start of a span.
    pub(crate) fn begin_loads(&mut self) {
        if self.options.loads {
            self.state.modal_load_before.copy_from_slice(&self.modal_load);
        }
    }

    /// Reads the loads at the start and at the end of the span; reads nothing if there are no loads.
    pub(crate) fn read_loads(&self, [start, end]: &mut [Vec<f64>; 2]) {
        if self.options.loads {
            start.copy_from_slice(&self.state.modal_load_before);
            end.copy_from_slice(&self.modal_load);
        }
    }

    /// Adds to the damping loss of a sector (J).
    pub fn lose(&mut self, sector: usize, loss: f64) {
        self.state.loss[sector] += loss;
    }
}
