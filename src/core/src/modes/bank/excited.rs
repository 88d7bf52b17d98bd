//! Effects of an excitation on the modes of sectors or of a nodal diameter.

use super::{Disk, ModalBank};

impl ModalBank {
    /// Sets the engine order of the excitation, if any.
    pub(crate) fn set_excitation_order(&mut self, order: u32) {
        if let Some(excitation) = &mut self.excitation {
            excitation.set_order(order, self.disk.as_ref().map(Disk::model));
        }
    }

    /// Sets the excitation of the next step, before [`ModalBank::predict`]: amplitude (N) and phase ψ (rad).
    pub fn excite(&mut self, amplitude: f64, phase: f64) {
        if let Some(excitation) = &mut self.excitation {
            excitation.set(amplitude, phase);
        }
    }

    /// Adds the effect of the excitation to the predicted step of uncoupled sectors.
    pub(super) fn act_excited(&mut self) {
        let Some(excitation) = self.excitation.take() else { return };
        for (sector, force) in excitation.now.iter().enumerate().filter(|(_, force)| **force != 0.0) {
            self.act_on_modes(sector, &excitation.load, |k, load| k.load_compliance() * load * force);
        }
        self.excitation = Some(excitation);
    }

    /// Adds the effect of the excitation to the predicted step of a nodal diameter and to the spectrum of its displacements.
    pub(super) fn act_excited_disk(&mut self) {
        let (Some(excitation), Some(disk)) = (&self.excitation, &mut self.disk) else { return };
        let group = excitation.groups.start;
        for mode in 0..disk.model().diameters[group].len() {
            let compliance = self.coefficients[group * self.modes + mode].load_compliance();
            let moved = excitation.on_mode(mode, group, &excitation.now).map(|force| compliance * force);
            disk.add_to_spectrum(mode, group, moved);
            for (part, moved) in moved.into_iter().enumerate() {
                let index = disk.coordinate(group, mode, part);
                self.state.position[index] += moved;
                self.state.increment[index] += moved;
            }
        }
    }

    /// Returns the work of the excitation over the last step (J), after the contact correction; for quasi-static modes see
    /// [`ModalBank::finish_loads`].
    pub(crate) fn finish_excitation(&mut self) -> f64 {
        let Some(excitation) = &self.excitation else { return 0.0 };
        let mut work = 0.0;
        for group in excitation.groups.clone() {
            for mode in 0..self.modes {
                let Some(of) = self.oscillator(mode, group) else { continue };
                let forces = if of.is_dynamic(self.scheme) { &excitation.now } else { &self.state.excited_before };
                let force = excitation.on_mode(mode, group, forces);
                if force.iter().all(|part| *part == 0.0) {
                    continue;
                }
                let ([_, increment], index) = (self.amplitudes(mode, group), self.index(mode, group));
                for part in 0..self.parts {
                    work += 0.5 * force[part] * (increment[part] + self.increment_before[index + part * self.width]);
                }
            }
        }
        self.state.excited_before.copy_from_slice(&excitation.now);
        work
    }
}
