//! State of the modes as plain arrays, for a scheme that integrates sectors or whole structures over a span.

use super::ModalBank;

impl ModalBank {
    /// Makes the current displacements the previous ones.
    pub(crate) fn begin_span(&mut self) {
        self.state.displacement_before.copy_from_slice(&self.state.displacement);
    }

    /// Reads q and q̇ of the modes with inertia of an uncoupled sector.
    pub(crate) fn read_sector(&self, sector: usize, position: &mut [f64], velocity: &mut [f64]) {
        for (mode, (q, v)) in position.iter_mut().zip(velocity).enumerate() {
            let (now, increment) = self.modal_state(mode, sector);
            (*q, *v) = (now, increment / self.step);
        }
    }

    /// Writes q and q̇ of an uncoupled sector, its quasi-static modes under the forces `forces` on the rows (N), and the displacements
    /// of the rows (m).
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
        let is_loaded = forces.iter().any(|force| *force != 0.0);
        for mode in position.len()..self.modes {
            let shapes = &self.contact_modes[mode * self.rows..][..self.rows];
            let forces = shapes.iter().zip(if is_loaded { forces } else { &[] });
            let force: f64 = forces.map(|(shape, force)| shape * force).fold(0.0, |sum, term| sum + term);
            let (index, frequency) = (self.index(mode, sector), self.frequency(mode, sector));
            self.state.position[index] = force / (frequency * frequency);
        }
        for (row, moved) in rows.iter().enumerate() {
            self.state.displacement[row * self.lanes + sector] = *moved;
        }
    }

    /// Reads q and q̇ of all modes in the order of the state; velocities of modes without inertia are not 0.
    pub(crate) fn read_all(&self, [position, velocity]: [&mut [f64]; 2]) {
        position.copy_from_slice(&self.state.position);
        for (to, increment) in velocity.iter_mut().zip(&self.state.increment) {
            *to = increment / self.step;
        }
    }

    /// Writes q and q̇ of all modes of a disk or of a single structure, in the order of the state. The displacements of a disk follow;
    /// those of a single structure are `rows` (m).
    pub fn write_all(&mut self, position: &[f64], velocity: &[f64], rows: &[f64]) {
        self.state.position.copy_from_slice(position);
        let increments = self.state.increment.iter_mut().zip(velocity);
        increments.for_each(|(increment, v)| *increment = v * self.step);
        match &mut self.disk {
            Some(disk) => disk.rows_of(position, &mut self.state.displacement),
            None => self.state.displacement.copy_from_slice(rows),
        }
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
}
