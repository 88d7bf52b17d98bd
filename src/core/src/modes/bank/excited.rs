//! Effects of an excitation and of an initial motion on the modes of each sector.

use super::ModalBank;

impl ModalBank {
    /// Sets the engine order of the excitation, if any.
    pub(crate) fn set_excitation_order(&mut self, order: u32) {
        if let Some(loads) = &mut self.excitation {
            loads.set_order(order);
        }
    }

    /// Sets the excitation of the next step, before [`ModalBank::predict`]: amplitude (N) and phase ψ (rad).
    pub fn excite(&mut self, amplitude: f64, phase: f64) {
        if let Some(loads) = &mut self.excitation {
            loads.set(amplitude, phase);
        }
    }

    /// Adds the effect of the excitation to the predicted step.
    pub(super) fn act_excited(&mut self) {
        let Some(loads) = self.excitation.take() else { return };
        for (sector, force) in loads.now.iter().enumerate().filter(|(_, force)| **force != 0.0) {
            self.act_on_modes(sector, &loads.load, *force);
        }
        self.excitation = Some(loads);
    }

    /// Adds the effect of `factor` times prescribed modal loads to the predicted step of one sector.
    pub(super) fn act_on_modes(&mut self, sector: usize, loads: &[f64], factor: f64) {
        let (modes, set) = (self.modes(), self.set_of(sector));
        let coefficients = &self.coefficients[set * modes..][..modes];
        for ((correction, load), k) in self.correction.iter_mut().zip(loads).zip(coefficients) {
            *correction = k.load_compliance() * load * factor;
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.transform(set, &mut self.correction);
        }
        self.move_modes(sector);
        self.move_rows(sector);
    }

    /// Returns the work of the excitation over the last step (J), after the contact correction; for quasi-static modes see
    /// [`ModalBank::finish_loads`].
    pub(crate) fn finish_excitation(&mut self) -> f64 {
        let Some(mut loads) = self.excitation.take() else { return 0.0 };
        let (mut work, dynamic) = (0.0, self.model.dynamic_modes(self.scheme));
        for sector in 0..self.sectors {
            for (mode, load) in loads.load.iter().enumerate().filter(|(_, load)| **load != 0.0) {
                let force = if mode < dynamic { loads.now[sector] } else { loads.before[sector] };
                let index = self.index(mode, sector);
                work += 0.5 * load * force * (self.state.increment[index] + self.increment_before[index]);
            }
        }
        loads.before.copy_from_slice(&loads.now);
        self.excitation = Some(loads);
        work
    }

    /// Adds a free motion to that of a mode with inertia, at the start.
    pub(crate) fn add_modal_state(&mut self, mode: usize, sector: usize, position: f64, velocity: f64) {
        let (frequency, ratio, step) = (self.frequency(mode, sector), self.model.damping_ratios[mode], self.step);
        let index = self.index(mode, sector);
        self.state.position[index] += position;
        self.state.increment[index] += self.scheme.increment(frequency, ratio, position, velocity, step);
    }
}
