//! Effects of an excitation and of an initial motion on the modes of nodal diameters.

use super::{CyclicBank, LANES};
use crate::modes::excitation::{DiskLoads, Excitation};

impl CyclicBank {
    /// Adds an excitation.
    #[must_use]
    pub fn excited(mut self, excitation: Option<Excitation>) -> Self {
        self.excitation = excitation.map(|excitation| DiskLoads::new(excitation, &self.model));
        self
    }

    /// Sets the engine order of the excitation, if any.
    pub(crate) fn set_excitation_order(&mut self, order: u32) {
        if let Some(loads) = &mut self.excitation {
            loads.set_order(order, &self.model);
        }
    }

    /// Sets the excitation of the next step, before [`CyclicBank::predict`]: amplitude (N) and phase ψ (rad).
    pub fn excite(&mut self, amplitude: f64, phase: f64) {
        if let Some(loads) = &mut self.excitation {
            let is_real = self.model.is_real(loads.diameter);
            loads.set(amplitude, phase, is_real);
        }
    }

    /// Adds the effect of the excitation to the predicted step and to the spectrum of its displacements.
    pub(super) fn act_excited(&mut self) {
        let Some(loads) = &self.excitation else { return };
        let (n, rows) = (loads.diameter, self.rows);
        let (block, lane) = (n / LANES, n % LANES);
        for mode in 0..self.model.diameters[n].len() {
            let index = block * self.modes + mode;
            let compliance = self.coefficients[n * self.modes + mode].load_compliance();
            let moved = loads.of_mode(mode).map(|force| compliance * force);
            for (part, moved) in moved.into_iter().enumerate() {
                self.state.position[index][part][lane] += moved;
                self.state.older[index][part][lane] += moved;
            }
            let spectrum = &mut self.spectrum[block * rows..][..rows];
            for (sum, shape) in spectrum.iter_mut().zip(&self.shapes[index * rows..][..rows]) {
                let shape = shape.map(|part| part[lane]);
                sum[0][lane] += shape[0] * moved[0] - shape[1] * moved[1];
                sum[1][lane] += shape[0] * moved[1] + shape[1] * moved[0];
            }
        }
    }

    /// Returns the work of the excitation over the last step (J), after the contact correction; for quasi-static modes see
    /// [`CyclicBank::finish_loads`].
    pub(crate) fn finish_excitation(&mut self) -> f64 {
        let Some(loads) = &self.excitation else { return 0.0 };
        let (n, mut work) = (loads.diameter, 0.0);
        let (diameter, lane) = (&self.model.diameters[n], n % LANES);
        let dynamic = diameter.dynamic_modes(self.scheme);
        for mode in 0..diameter.len() {
            let force = if mode < dynamic { loads.of_mode(mode) } else { loads.of_mode_before(mode) };
            let (_, increment) = self.modal_state(n, mode);
            let older = &self.state.older[n / LANES * self.modes + mode];
            for part in 0..2 {
                work += 0.5 * force[part] * (increment[part] + older[part][lane]);
            }
        }
        if let Some(loads) = &mut self.excitation {
            loads.keep();
        }
        work
    }

    /// Adds a free motion to that of a mode with inertia (re, im), at the start; the imaginary part of a real mode stays 0.
    pub(crate) fn add_modal_state(
        &mut self,
        nodal_diameter: usize,
        mode: usize,
        position: [f64; 2],
        velocity: [f64; 2],
    ) {
        let diameter = &self.model.diameters[nodal_diameter];
        let (frequency, ratio) = (diameter.frequencies[mode], diameter.damping_ratios[mode]);
        let (index, lane) = self.index(nodal_diameter, mode);
        for part in 0..if self.model.is_real(nodal_diameter) { 1 } else { 2 } {
            self.state.position[index][part][lane] += position[part];
            self.state.increment[index][part][lane] +=
                self.scheme.increment(frequency, ratio, position[part], velocity[part], self.step);
        }
    }
}
