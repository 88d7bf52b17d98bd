//! Coefficients that depend on step size, scheme and damping, and the conversion of the state to another step size.

use super::fourier::Synthesis;
use super::pass::{Gather, modal_force};
use super::{Complexes, CyclicBank, CyclicCoefficients, LANES, NOTHING};
use crate::math::vector::strided_vector3;
use crate::modes::schemes::{Velocity, resample};
use crate::scene::method::Scheme;

impl CyclicBank {
    /// Sets a new step size: coefficients and flexibility. The state is unchanged (see [`CyclicBank::resample`]).
    pub fn set_step(&mut self, scheme: Scheme, step: f64) {
        // The contact forces of the last step act with the coefficients they were found with.
        self.finish();
        (self.scheme, self.step) = (scheme, step);
        self.lane_coefficients.fill(CyclicCoefficients::NONE);
        for (n, diameter) in self.model.diameters.iter().enumerate() {
            for mode in 0..diameter.len() {
                let k = diameter.coefficient(mode, 1.0, scheme, step);
                self.coefficients[n * self.modes + mode] = k;
                let (frequency, ratio) = (diameter.frequencies[mode], diameter.damping_ratios[mode]);
                let dynamic = mode < diameter.dynamic_modes(scheme);
                self.velocities[n * self.modes + mode] =
                    if dynamic { scheme.velocity(frequency, ratio, step) } else { Velocity::default() };
                let (lane, lanes) = (n % LANES, &mut self.lane_coefficients[n / LANES * self.modes + mode]);
                (lanes.beta[lane], lanes.kappa[lane], lanes.loss[lane]) = (k.beta, k.kappa, k.loss);
                (lanes.compliance[lane], lanes.delayed[lane]) = (k.compliance, k.delayed);
            }
        }
        self.fill_spectral_flexibility();
        self.fill_flexibility();
    }

    /// Ĝ_n = Ψ_n diag(c) Ψ_nᴴ.
    fn fill_spectral_flexibility(&mut self) {
        let (modes, rows) = (self.modes, self.rows);
        self.spectral_flexibility.fill(NOTHING);
        for (block, target) in self.spectral_flexibility.chunks_exact_mut(rows * rows).enumerate() {
            for mode in 0..modes {
                let shapes = &self.shapes[(block * modes + mode) * rows..][..rows];
                let compliance = &self.lane_coefficients[block * modes + mode].compliance;
                for (column, entries) in shapes.iter().zip(target.chunks_exact_mut(rows)) {
                    add_outer(entries, shapes, column, compliance);
                }
            }
        }
    }

    /// Computes G of every difference of sectors: the columns of Ĝ are spectra.
    fn fill_flexibility(&mut self) {
        let (rows, lanes) = (self.rows, self.lanes);
        let nodes = rows / 3;
        for column in 0..rows {
            for (block, spectrum) in self.spectrum.chunks_exact_mut(rows).enumerate() {
                spectrum.copy_from_slice(&self.spectral_flexibility[(block * rows + column) * rows..][..rows]);
            }
            let (fourier, spectrum, values) = (&self.fourier, &self.spectrum, &mut self.moved);
            self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values });
            for difference in 0..self.model.sectors {
                for row in 0..rows {
                    let pair = (difference * nodes + column / 3) * nodes + row / 3;
                    self.flexibility[pair][column % 3][row % 3] = self.moved[row * lanes + difference];
                }
            }
        }
    }

    /// Sets the modal damping ratio of all modes; the first modes of each nodal diameter have their `own` (takes effect with the
    /// next [`CyclicBank::set_step`]).
    pub(crate) fn set_damping_ratio(&mut self, damping_ratio: f64, own: &[f64]) {
        self.model.set_damping_ratio(damping_ratio, own);
    }

    /// Converts the state from the current step size to `new_step` under the last contact forces (`forces[row · lanes + sector]`,
    /// N) and the modal loads, then uses the new coefficients.
    pub fn resample(&mut self, scheme: Scheme, new_step: f64, forces: &[f64]) {
        if scheme.properties().stores_velocity {
            let ratio = new_step / self.step;
            self.state.increment.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|d| *d *= ratio);
            return self.set_step(scheme, new_step);
        }
        self.gather_forces(forces);
        for nodal_diameter in 0..self.model.diameters.len() {
            for mode in 0..self.model.diameters[nodal_diameter].dynamic_modes(self.scheme) {
                self.resample_mode(nodal_diameter, mode, new_step);
            }
        }
        self.set_step(scheme, new_step);
        self.recover();
    }

    /// Computes the spectrum of the persistent contact forces (`forces[row · lanes + sector]`, N), after those of the last step
    /// have been applied.
    pub(super) fn gather_forces(&mut self, forces: &[f64]) {
        self.finish();
        self.asked.clear();
        let (lanes, nodes) = (self.lanes, self.rows / 3);
        for sector in 0..self.model.sectors {
            for node in 0..nodes {
                let force = strided_vector3(forces, 3 * node * lanes + sector, lanes);
                self.asked.push((sector, node, force));
            }
        }
        let (fourier, rows, forces) = (&self.fourier, self.rows, &self.asked[..]);
        self.instruction_set.run(Gather { fourier, rows, forces, spectrum: &mut self.asked_force });
        self.asked_nodes.fill(true);
    }

    /// Modal force (re, im) on a mode from the collected contact forces and the loads.
    pub(super) fn gathered_force(&self, nodal_diameter: usize, mode: usize) -> [f64; 2] {
        let (index, lane) = self.index(nodal_diameter, mode);
        let force = &self.asked_force[nodal_diameter / LANES * self.rows..][..self.rows];
        let shapes = &self.shapes[index * self.rows..][..self.rows];
        let mut force = modal_force(&self.asked_nodes, shapes, force).map(|part| part[lane]);
        if nodal_diameter == 0 {
            force[0] += self.state.modal_load_before.get(mode).copied().unwrap_or(0.0);
        }
        if let Some(loads) = self.excitation.as_ref().filter(|loads| loads.diameter == nodal_diameter) {
            let excited = loads.of_mode_before(mode);
            force.iter_mut().zip(excited).for_each(|(force, excited)| *force += excited);
        }
        force
    }

    fn resample_mode(&mut self, nodal_diameter: usize, mode: usize, new_step: f64) {
        let (index, lane) = self.index(nodal_diameter, mode);
        let force = self.gathered_force(nodal_diameter, mode);
        let diameter = &self.model.diameters[nodal_diameter];
        let (frequency, ratio, step) = (diameter.frequencies[mode], diameter.damping_ratios[mode], self.step);
        for part in 0..2 {
            let (now, increment) = (self.state.position[index][part][lane], self.state.increment[index][part][lane]);
            self.state.increment[index][part][lane] =
                resample(frequency, ratio, now, increment, force[part], step, new_step);
        }
    }
}

/// entries += c · shapes · conj(column), lane by lane.
fn add_outer(entries: &mut [Complexes], shapes: &[Complexes], column: &Complexes, compliance: &[f64; LANES]) {
    let mut scaled = *column;
    for part in &mut scaled {
        part.iter_mut().zip(compliance).for_each(|(value, compliance)| *value *= compliance);
    }
    let [real, imaginary] = &scaled;
    for (entry, shape) in entries.iter_mut().zip(shapes) {
        for lane in 0..LANES {
            entry[0][lane] += shape[0][lane] * real[lane] + shape[1][lane] * imaginary[lane];
            entry[1][lane] += shape[1][lane] * real[lane] - shape[0][lane] * imaginary[lane];
        }
    }
}
