//! Motion of the modes: setting and reading states, states of rest, and recovery of displacements.

use super::{FLUSH_BELOW, LANES, ModalBank};
use crate::math::scan::AllFinite;

impl ModalBank {
    /// Modal position and increment of one mode of a sector, or of the real part of a nodal diameter.
    pub fn modal_state(&self, mode: usize, group: usize) -> (f64, f64) {
        let [position, increment] = self.amplitudes(mode, group);
        (position[0], increment[0])
    }

    /// Modal position and increment (re, im) of one mode of a group, including contact forces that have not been applied yet.
    pub fn amplitudes(&self, mode: usize, group: usize) -> [[f64; 2]; 2] {
        self.amplitudes_at(self.index(mode, group), mode, group)
    }

    /// Returns the weighted sum of the modal positions of a sector, or of their real parts for a nodal diameter.
    pub(crate) fn weigh_positions(&self, group: usize, weight: impl Fn(usize) -> f64) -> f64 {
        // The empty sum is −0, as in the standard library.
        let mut sum = -0.0;
        self.each_part(group, |mode, part, position, _| {
            if part == 0 {
                sum += weight(mode) * position;
            }
        });
        sum
    }

    /// Calls `each` with mode, part, position and increment of every part of the amplitudes of a group, in the order of
    /// the modes.
    #[inline(always)]
    pub(super) fn each_part(&self, group: usize, mut each: impl FnMut(usize, usize, f64, f64)) {
        let (first, stride) = (self.index(0, group), self.parts * self.width);
        for mode in 0..self.modes {
            let [position, increment] = self.amplitudes_at(first + mode * stride, mode, group);
            (0..self.parts).for_each(|part| each(mode, part, position[part], increment[part]));
        }
    }

    #[inline(always)]
    fn amplitudes_at(&self, index: usize, mode: usize, group: usize) -> [[f64; 2]; 2] {
        let (position, increment) = (&self.state.position, &self.state.increment);
        let Some(disk) = &self.disk else { return [[position[index], 0.0], [increment[index], 0.0]] };
        let mut found = [position, increment].map(|values| [values[index], values[index + LANES]]);
        if disk.state.unapplied {
            let compliance = self.coefficients(group)[mode].compliance;
            let force = disk.modal_force(mode, group, &disk.state.touched, &disk.state.force);
            for values in &mut found {
                values.iter_mut().zip(force).for_each(|(value, force)| *value += compliance * force);
            }
        }
        found
    }

    /// Sets modal position q and velocity q̇ of a mode of a sector, or of the real part of a nodal diameter (see
    /// [`ModalBank::set_amplitude`]).
    pub fn set_modal_state(&mut self, mode: usize, group: usize, position: f64, velocity: f64) {
        self.set_amplitude(mode, group, [position, 0.0], [velocity, 0.0]);
    }

    /// Sets position and velocity (re, im) of a mode of a group. The increment is computed from free motion without
    /// force. A quasi-static mode and the imaginary part of a real mode stay 0.
    pub fn set_amplitude(&mut self, mode: usize, group: usize, position: [f64; 2], velocity: [f64; 2]) {
        if !self.oscillator(mode, group).is_some_and(|of| of.is_dynamic(self.scheme)) {
            return;
        }
        if let Some(disk) = &mut self.disk {
            disk.state.unapplied = false;
        }
        for part in 0..self.moving_parts(group) {
            let index = self.index(mode, group) + part * self.width;
            (self.state.position[index], self.state.increment[index]) = (0.0, 0.0);
        }
        self.add_amplitude(mode, group, position, velocity);
    }

    /// Adds a free motion (re, im) to the motion of a mode with inertia. The imaginary part of a real mode stays 0.
    pub(crate) fn add_amplitude(&mut self, mode: usize, group: usize, position: [f64; 2], velocity: [f64; 2]) {
        let Some(of) = self.oscillator(mode, group) else { return };
        for part in 0..self.moving_parts(group) {
            let index = self.index(mode, group) + part * self.width;
            self.state.position[index] += position[part];
            self.state.increment[index] +=
                self.scheme.increment(of.frequency, of.damping_ratio, position[part], velocity[part], self.step);
        }
    }

    /// Number of parts of the amplitudes of a group that can differ from 0.
    fn moving_parts(&self, group: usize) -> usize {
        self.disk.as_ref().map_or(1, |disk| if disk.model().is_real(group) { 1 } else { 2 })
    }

    /// Sets the static equilibrium under the modal loads `modal_load` of every sector, or of nodal diameter 0: q = L/ω², rigid-body
    /// modes at 0.
    pub fn settle(&mut self, modal_load: &[f64]) {
        self.rest();
        self.state.modal_load_before.copy_from_slice(modal_load);
        for group in 0..self.loaded_groups() {
            for (mode, load) in modal_load.iter().enumerate() {
                let (frequency, index) = (self.frequency(mode, group), self.index(mode, group));
                self.state.position[index] = if frequency > 0.0 { load / (frequency * frequency) } else { 0.0 };
            }
        }
        self.recover();
    }

    /// Recomputes the contact displacements from the modal state (after setting it). Losses of a disk that have not been added yet
    /// are dropped.
    pub fn recover(&mut self) {
        if self.disk.is_some() {
            return self.recover_disk();
        }
        let lanes = self.lanes;
        self.state.displacement.fill(0.0);
        self.state.displacement_before.fill(0.0);
        for sector in 0..self.sectors {
            for mode in 0..self.modes {
                let (position, increment) = self.modal_state(mode, sector);
                for row in 0..self.rows {
                    let shape = self.contact_modes[mode * self.rows + row];
                    self.state.displacement[row * lanes + sector] += shape * position;
                    self.state.displacement_before[row * lanes + sector] += shape * (position - increment);
                }
            }
        }
    }

    /// Sets the undeformed state of rest.
    pub fn rest(&mut self) {
        let state = &mut self.state;
        for values in [
            &mut state.position,
            &mut state.increment,
            &mut state.displacement,
            &mut state.displacement_before,
            &mut state.loss,
            &mut state.modal_load_before,
            &mut state.excited_before,
            &mut state.heat_before,
            &mut state.stiffened,
            &mut self.modal_load,
            &mut self.increment_before,
        ] {
            values.fill(0.0);
        }
        if let Some((spin, ..)) = &self.options.coupling {
            state.speed = spin.reference_speed;
            state.temperature = spin.reference_temperature;
        }
        if let Some(excitation) = &mut self.excitation {
            excitation.now.fill(0.0);
        }
        if let Some(heat) = &mut self.heat {
            heat.now.fill(0.0);
        }
        if let Some(disk) = &mut self.disk {
            disk.state.rest();
        }
    }

    /// Sets amplitudes that have decayed almost to zero to exactly zero, so that no denormals arise.
    pub fn flush(&mut self) {
        for values in [&mut self.state.position, &mut self.state.increment, &mut self.increment_before] {
            for value in values.iter_mut().filter(|value| value.abs() < FLUSH_BELOW) {
                *value = 0.0;
            }
        }
    }

    /// Returns whether every modal coordinate is finite.
    pub fn is_finite(&self) -> bool {
        let mut all = true;
        for values in [&self.state.position, &self.state.increment] {
            self.instruction_set.run(AllFinite { values, all: &mut all });
        }
        all && self.disk.as_ref().is_none_or(|disk| disk.state.is_finite())
    }
}
