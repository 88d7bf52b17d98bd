//! Coefficients that depend on step size, scheme, damping and speed, and the conversion of the state when one of them changes.

use super::{BankCoefficients, ModalBank};
use crate::modes::modal::fill_ratios;
use crate::modes::schemes::resample;
use crate::scene::method::Scheme;

impl ModalBank {
    /// Sets a new step size: coefficients and flexibility. The state is unchanged (see [`ModalBank::resample`]).
    pub fn set_step(&mut self, scheme: Scheme, step: f64) {
        // The contact forces of the last step act on a disk with the coefficients for which they were computed.
        self.finish();
        (self.scheme, self.step, self.coefficients_outdated) = (scheme, step, false);
        for set in 0..self.sets {
            for mode in 0..self.modes {
                let (Some(of), index) = (self.oscillator(mode, set), set * self.modes + mode) else { continue };
                self.coefficients[index] = of.coefficients(scheme, step);
                self.velocities[index] = of.velocity(scheme, step);
            }
        }
        if !self.lane_coefficients.is_empty() {
            self.spread_coefficients();
        }
        if let Some(disk) = &mut self.disk {
            disk.fill(&self.coefficients, scheme);
        }
        self.refresh_coupling();
    }

    /// Sets the step size, like [`ModalBank::set_step`], before a state is restored. Keeps valid coefficients.
    pub(crate) fn prepare_restore(&mut self, scheme: Scheme, step: f64) {
        if self.coefficients_outdated || self.scheme != scheme || self.step.to_bits() != step.to_bits() {
            self.set_step(scheme, step);
        }
    }

    pub(super) fn spread_coefficients(&mut self) {
        for sector in 0..self.sectors {
            for mode in 0..self.modes {
                let k = self.coefficients(sector)[mode];
                let lane = BankCoefficients { beta: k.beta, kappa: k.kappa, load: k.load_compliance(), loss: k.loss };
                let index = self.index(mode, sector);
                self.lane_coefficients[index] = lane;
            }
        }
    }

    pub(super) fn refresh_coupling(&mut self) {
        self.columns.forget();
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
        let (modes, rows) = (self.modes, self.rows);
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
        for mode in 0..self.modes {
            (self.gathered[0][mode], self.gathered[1][mode]) = self.modal_state(mode, sector);
        }
        let set = self.set_of(sector);
        coupling.force(set, &self.gathered[0], &self.gathered[1], &mut self.correction);
        // q̇ = d/h + ½hq̈: the velocity in the middle of the step would cause an error that accumulates.
        for mode in 0..self.modes {
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
        if coupling.matches(speed, temperature) {
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

    /// Sets the modal damping ratio of all modes; the first modes of a sector or nodal diameter get the ratios `own`
    /// (takes effect with the next [`ModalBank::set_step`]).
    pub(crate) fn set_damping_ratio(&mut self, damping_ratio: f64, own: &[f64]) {
        self.coefficients_outdated |= fill_ratios(&mut self.model.damping_ratios, damping_ratio, own, 1);
        if let Some(disk) = &mut self.disk {
            self.coefficients_outdated |= disk.model.set_damping_ratio(damping_ratio, own);
        }
    }

    /// Collects the persistent contact forces on a disk (`forces[row · lanes + sector]`, N), before [`ModalBank::gather_forces`].
    pub(super) fn gather_disk(&mut self, forces: &[f64]) {
        self.finish();
        let lanes = self.lanes;
        if let Some(disk) = &mut self.disk {
            disk.gather_rows(forces, lanes);
        }
    }

    /// Collects the modal forces on one group that persist over the step: contact forces (`forces[row · lanes + sector]`, N;
    /// none for an empty slice), modal loads and spin.
    pub(super) fn gather_forces(&mut self, group: usize, forces: &[f64]) {
        if self.disk.is_none() {
            self.project_sector(group, forces);
        }
        let load = if group < self.loaded_groups() { &self.state.modal_load_before[..] } else { &[] };
        for mode in 0..self.modes {
            let mut force = match &self.disk {
                Some(disk) => disk.asked_modal_force(mode, group),
                None => [self.modal_force[mode], 0.0],
            };
            force[0] += load.get(mode).copied().unwrap_or(0.0);
            if let Some(excitation) = &self.excitation {
                let excited = excitation.on_mode(mode, group, &self.state.excited_before);
                force.iter_mut().zip(excited).for_each(|(force, excited)| *force += excited);
            }
            if self.heat.is_some() {
                force[0] += self.heat_before(mode, group);
            }
            self.modal_force[mode * self.parts] = force[0];
            if self.parts == 2 {
                self.modal_force[mode * self.parts + 1] = force[1];
            }
        }
        self.add_coupling_force(group);
        if let Some(coupling) = self.coupling.as_ref().filter(|coupling| coupling.softens()) {
            // Converted to forces on the cold mode, which cause the same motion.
            self.modal_force.iter_mut().enumerate().for_each(|(mode, force)| *force /= coupling.share(mode));
        }
    }

    /// Converts the state from the current step size to `new_step` under the last contact forces (`forces[row · lanes + sector]`, N;
    /// none for an empty slice) and the modal loads, then uses the new coefficients.
    pub fn resample(&mut self, scheme: Scheme, new_step: f64, forces: &[f64]) {
        if scheme.properties().stores_velocity {
            let ratio = new_step / self.step;
            self.state.increment.iter_mut().for_each(|increment| *increment *= ratio);
            return self.set_step(scheme, new_step);
        }
        self.gather_disk(forces);
        for group in 0..self.groups {
            self.gather_forces(group, forces);
            for mode in 0..self.modes {
                let Some(of) = self.oscillator(mode, group).filter(|of| of.is_dynamic(self.scheme)) else { continue };
                for part in 0..self.parts {
                    let index = self.index(mode, group) + part * self.width;
                    let (now, increment) = (self.state.position[index], self.state.increment[index]);
                    let force = self.modal_force[mode * self.parts + part];
                    self.state.increment[index] =
                        resample(of.frequency, of.damping_ratio, now, increment, force, self.step, new_step);
                }
            }
        }
        self.set_step(scheme, new_step);
        self.recover();
    }
}
