//! Energies of the modes, damping losses, and the work of loads.

use super::ModalBank;

impl ModalBank {
    /// Kinetic and strain energy of all sectors (J), in the form that the scheme conserves (see [`crate::modes::schemes`]).
    pub fn energies(&self) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for group in 0..self.groups {
            if self.disk.is_some() {
                let (kinetic, strain) = self.group_energies(group, (0.0, 0.0));
                sums = (sums.0 + kinetic, sums.1 + strain);
            } else {
                sums = self.group_energies(group, sums);
            }
        }
        sums
    }

    /// Adds kinetic and strain energy of one sector or nodal diameter (J) to `sums`.
    pub fn group_energies(&self, group: usize, sums: (f64, f64)) -> (f64, f64) {
        let (mut kinetic, mut strain) = sums;
        // The strain energy belongs to one time, or to two.
        let lag = self.scheme.strain_lag();
        let coefficients = self.coefficients(group);
        self.each_part(group, |mode, _, position, increment| {
            let k = &coefficients[mode];
            kinetic += k.inertia * (increment * increment);
            strain += k.spring * (position * (position - lag * increment));
        });
        if let Some(coupling) = &self.coupling {
            let position = |mode| self.modal_state(mode, group).0;
            let before = |mode| position(mode) - self.modal_state(mode, group).1;
            strain += coupling.strain(self.set_of(group), position, before);
        }
        (kinetic, strain)
    }

    /// Instantaneous kinetic and strain energy of all sectors (J), ½q̇² and ½ω²q² of every mode, under the persistent contact forces
    /// (`forces[row · lanes + sector]`, N) and the modal loads.
    pub(crate) fn energies_now(&mut self, forces: &[f64]) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        let needs_forces = !self.scheme.properties().stores_velocity;
        if needs_forces {
            self.gather_disk(forces);
        }
        for group in 0..self.groups {
            if needs_forces {
                self.gather_forces(group, forces);
            }
            let (velocities, coefficients) =
                (&self.velocities[self.set_of(group) * self.modes..], self.coefficients(group));
            self.each_part(group, |mode, part, position, increment| {
                let velocity = velocities[mode].of(position, increment, self.modal_force[mode * self.parts + part]);
                kinetic += 0.5 * velocity * velocity;
                strain += coefficients[mode].spring * (position * position);
            });
            if let Some(coupling) = &self.coupling {
                let position = |mode| self.modal_state(mode, group).0;
                strain += coupling.strain(self.set_of(group), position, position);
            }
        }
        (kinetic, strain)
    }

    /// Damping loss since the last call (J).
    pub(crate) fn collect_loss(&mut self) -> f64 {
        self.finish();
        let loss = self.state.loss[..self.groups].iter().sum();
        self.state.loss.fill(0.0);
        loss
    }

    /// Adds `loss` to the damping loss of a group (J).
    pub(crate) fn lose(&mut self, group: usize, loss: f64) {
        self.state.loss[group] += loss;
    }

    /// Returns the work of the modal loads over the last step (J), after the contact correction. On a quasi-static
    /// mode, which follows its current load instantaneously, the load of the previous step does the work.
    pub(crate) fn finish_loads(&mut self) -> f64 {
        if !self.options.loads {
            return 0.0;
        }
        let (mut work, dynamic) = (0.0, self.model.dynamic_modes(self.scheme));
        for mode in 0..self.modal_load.len() {
            let load = if mode < dynamic { self.modal_load[mode] } else { self.state.modal_load_before[mode] };
            if load != 0.0 {
                let twice: f64 = (0..self.loaded_groups())
                    .map(|group| self.modal_state(mode, group).1 + self.increment_before[self.index(mode, group)])
                    .sum();
                work += 0.5 * load * twice;
            }
        }
        self.state.modal_load_before.copy_from_slice(&self.modal_load);
        work + self.finish_heat()
    }
}
