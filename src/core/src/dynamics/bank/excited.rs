//! What an excitation, and a motion at the start, do to the modes of each sector.

use super::ModalBank;
use crate::schemes::free_increment;
use crate::settings::Scheme;

impl ModalBank {
    /// Engine order of the excitation, where there is one.
    pub fn set_excitation_order(&mut self, order: u32) {
        if let Some(loads) = &mut self.excitation {
            loads.set_order(order);
        }
    }

    /// Excitation of the next step, to be set before [`ModalBank::predict`]: amplitude (N) and phase ψ (rad).
    pub fn excite(&mut self, amplitude: f64, phase: f64) {
        if let Some(loads) = &mut self.excitation {
            loads.set(amplitude, phase);
        }
    }

    /// Add what it does to the step predicted.
    pub(super) fn act_excited(&mut self, with_loss: bool) {
        let Some(loads) = self.excitation.take() else { return };
        for (sector, force) in loads.now.iter().enumerate().filter(|(_, force)| **force != 0.0) {
            self.act_on_modes(sector, &loads.load, *force, with_loss);
        }
        self.excitation = Some(loads);
    }

    /// Add what `factor` times modal loads that are known beforehand do to the step predicted of one sector.
    pub(super) fn act_on_modes(&mut self, sector: usize, loads: &[f64], factor: f64, with_loss: bool) {
        let (modes, set) = (self.modes(), self.set_of(sector));
        let coefficients = &self.coefficients[set * modes..][..modes];
        for ((correction, load), k) in self.correction.iter_mut().zip(loads).zip(coefficients) {
            *correction = k.load_compliance() * load * factor;
        }
        if let Some(coupling) = &mut self.coupling {
            coupling.transform(set, &mut self.correction);
        }
        self.move_modes(sector, with_loss);
        self.move_rows(sector);
    }

    /// Work of the excitation over the step just done (J), once contact has corrected it; of quasi-static modes as that of the
    /// modal loads ([`ModalBank::finish_loads`]).
    pub fn finish_excitation(&mut self) -> f64 {
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

    /// Add a free motion to that of a mode with inertia, at the start.
    pub fn add_modal_state(&mut self, mode: usize, sector: usize, position: f64, velocity: f64) {
        let (frequency, ratio, step) = (self.frequency(mode, sector), self.model.damping_ratios[mode], self.step);
        let index = self.index(mode, sector);
        self.state.position[index] += position;
        self.state.increment[index] += match self.scheme {
            Scheme::Galerkin => velocity * step,
            _ => free_increment(frequency, ratio, position, velocity, step),
        };
    }
}
