//! Coefficients that depend on step size, scheme, damping and speed, and the conversion of the state when one of them changes.

use super::{BankCoefficients, ModalBank};
use crate::modes::modal::fill_ratios;
use crate::modes::schemes::{Velocity, resample};
use crate::scene::method::Scheme;

impl ModalBank {
    /// Sets a new step size: coefficients and flexibility. The state is unchanged (see [`ModalBank::resample`]).
    pub fn set_step(&mut self, scheme: Scheme, step: f64) {
        (self.scheme, self.step) = (scheme, step);
        let modes = self.modes();
        for (index, coefficients) in self.coefficients.iter_mut().enumerate() {
            let factor = self.options.frequency_factors.get(index / modes).copied().unwrap_or(1.0);
            *coefficients = self.model.coefficient(index % modes, factor, scheme, step);
            let (frequency, ratio) = (self.model.frequencies[index % modes], self.model.damping_ratios[index % modes]);
            let dynamic = index % modes < self.model.dynamic_modes(scheme);
            self.velocities[index] =
                if dynamic { scheme.velocity(factor * frequency, ratio, step) } else { Velocity::default() };
        }
        if !self.lane_coefficients.is_empty() {
            self.spread_coefficients();
        }
        self.refresh_coupling();
    }

    pub(super) fn spread_coefficients(&mut self) {
        for sector in 0..self.sectors {
            for mode in 0..self.modes() {
                let k = self.coefficients(sector)[mode];
                let lane = BankCoefficients { beta: k.beta, kappa: k.kappa, load: k.load_compliance(), loss: k.loss };
                let index = self.index(mode, sector);
                self.lane_coefficients[index] = lane;
            }
        }
    }

    pub(super) fn refresh_coupling(&mut self) {
        if let Some(coupling) = &mut self.coupling {
            let dynamic = self.model.dynamic_modes(self.scheme);
            let state = [self.state.speed, self.state.temperature];
            coupling.refresh(state, self.step, dynamic, &self.model.frequencies);
        }
        self.relax();
        if let Some(coupling) = &mut self.coupling {
            coupling.invert_all(&self.coefficients);
        }
        self.fill_heat();
        for set in 0..self.flexibility.len() {
            self.fill_flexibility(set);
        }
    }

    fn fill_flexibility(&mut self, set: usize) {
        let (modes, rows) = (self.modes(), self.rows);
        for column in 0..rows {
            for mode in 0..modes {
                let compliance = self.coefficients[set * modes + mode].compliance;
                self.correction[mode] = compliance * self.contact_modes[mode * rows + column];
            }
            if let Some(coupling) = &mut self.coupling {
                coupling.transform(set, &mut self.correction);
            }
            for row in 0..rows {
                let terms = self.correction.iter().enumerate();
                let sum = terms.map(|(mode, value)| self.contact_modes[mode * rows + row] * value).sum();
                self.flexibility[set][(row, column)] = sum;
            }
        }
    }

    /// Adds the modal forces of spin on one sector, at its current velocity, to `modal_force`.
    fn add_coupling_force(&mut self, sector: usize) {
        let Some(coupling) = self.coupling.take() else { return };
        for mode in 0..self.modes() {
            (self.gathered[0][mode], self.gathered[1][mode]) = self.modal_state(mode, sector);
        }
        let set = self.set_of(sector);
        coupling.force(set, &self.gathered[0], &self.gathered[1], &mut self.correction);
        // q̇ = d/h + ½hq̈: the velocity in the middle of the step would cause an error that accumulates.
        for mode in 0..self.modes() {
            let square = self.frequency(mode, sector) * self.frequency(mode, sector);
            let force = self.modal_force[mode] + self.correction[mode] - square * self.gathered[0][mode];
            self.gathered[1][mode] += (0.5 * self.step * self.step).min(2.0 / square) * force;
        }
        coupling.force(set, &self.gathered[0], &self.gathered[1], &mut self.correction);
        self.modal_force.iter_mut().zip(&self.correction).for_each(|(force, spin)| *force += spin);
        self.coupling = Some(coupling);
    }

    /// Sets the rotor speed (rad/s) and temperature (K) if they couple the modes; only between steps. Returns the change of
    /// energy (J), which is work of the shaft and of heat.
    pub fn set_speed(&mut self, speed: f64, temperature: f64) -> f64 {
        let Some(coupling) = &self.coupling else { return 0.0 };
        let same = |one: f64, other: f64| one.to_bits() == other.to_bits();
        if same(coupling.speed(), speed) && same(coupling.temperature(), temperature) {
            return 0.0;
        }
        let before = self.energies();
        self.count_stiffness(-1.0);
        (self.state.speed, self.state.temperature) = (speed, temperature);
        self.refresh_coupling();
        self.count_stiffness(1.0);
        let now = self.energies();
        (now.1 - before.1) + (now.0 - before.0)
    }

    /// Sets the modal damping ratio of all modes; the first modes have their `own` (takes effect with the next [`ModalBank::set_step`]).
    pub(crate) fn set_damping_ratio(&mut self, damping_ratio: f64, own: &[f64]) {
        fill_ratios(&mut self.model.damping_ratios, damping_ratio, own, 1);
    }

    /// Collects the modal forces on one sector that persist over the step: contact forces (`forces[row · lanes + sector]`, N;
    /// none for an empty slice), modal loads and spin.
    pub(super) fn gather_forces(&mut self, sector: usize, forces: &[f64]) {
        let lanes = self.lanes();
        let of_row = |row: usize| forces.get(row * lanes + sector).copied().unwrap_or(0.0);
        let touched = (0..self.rows).any(|row| of_row(row) != 0.0);
        for mode in 0..self.modes() {
            let shapes = &self.contact_modes[mode * self.rows..][..self.rows];
            let contact: f64 =
                if touched { shapes.iter().enumerate().map(|(row, shape)| shape * of_row(row)).sum() } else { 0.0 };
            self.modal_force[mode] = contact + self.state.modal_load_before.get(mode).copied().unwrap_or(0.0);
            if let Some(loads) = &self.excitation {
                self.modal_force[mode] += loads.load[mode] * loads.before[sector];
            }
            if self.heat.is_some() {
                self.modal_force[mode] += self.heat_before(mode, sector);
            }
        }
        self.add_coupling_force(sector);
        if let Some(coupling) = self.coupling.as_ref().filter(|coupling| coupling.softens()) {
            // Converted to forces on the cold mode, which cause the same motion.
            self.modal_force.iter_mut().enumerate().for_each(|(mode, force)| *force /= coupling.share(mode));
        }
    }

    /// Converts the state from the current step size to `new_step`, each sector under its last contact force
    /// (`forces[row · lanes + sector]`, N; none for an empty slice) and the modal loads, then uses the new coefficients.
    pub fn resample(&mut self, scheme: Scheme, new_step: f64, forces: &[f64]) {
        let dynamic = self.model.dynamic_modes(self.scheme);
        if scheme.properties().stores_velocity {
            let ratio = new_step / self.step;
            self.state.increment.iter_mut().for_each(|increment| *increment *= ratio);
            return self.set_step(scheme, new_step);
        }
        for sector in 0..self.sectors {
            self.gather_forces(sector, forces);
            for mode in 0..dynamic {
                let (force, index) = (self.modal_force[mode], self.index(mode, sector));
                self.state.increment[index] = resample(
                    self.frequency(mode, sector),
                    self.model.damping_ratios[mode],
                    self.state.position[index],
                    self.state.increment[index],
                    force,
                    self.step,
                    new_step,
                );
            }
        }
        self.set_step(scheme, new_step);
        self.recover();
    }
}
