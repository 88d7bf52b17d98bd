//! State of the disk as plain arrays, for a scheme that integrates it over a span: coordinates in the order of the lanes,
//! `[block · modes + mode][re, im][lane]`; entries without a mode stay 0.

use super::fourier::Synthesis;
use super::pass::{Complexes, Gather, Recover, modal_force};
use super::{CyclicBank, LANES};
use crate::math::vector::Vector3;
use crate::modes::coordinates::Coordinates;
use nalgebra::DMatrix;

/// Converts a flat array to complex lanes.
fn complexes(values: &[f64]) -> &[Complexes] {
    values.as_chunks::<LANES>().0.as_chunks::<2>().0
}

impl CyclicBank {
    /// Number of coordinates.
    pub fn coordinates(&self) -> usize {
        self.state.position.len() * 2 * LANES
    }

    /// Index of the real or imaginary part of a mode.
    fn place(&self, nodal_diameter: usize, mode: usize, part: usize) -> usize {
        let (index, lane) = self.index(nodal_diameter, mode);
        (2 * index + part) * LANES + lane
    }

    /// Returns the coordinates, whose highest modes are quasi-static, and the displacement of the contact rows of sector 0 per
    /// coordinate (rows × coordinates).
    pub(crate) fn coordinates_of(&self) -> (Coordinates, DMatrix<f64>) {
        let count = self.coordinates();
        let nothing = || vec![0.0; count];
        let mut found =
            Coordinates { frequencies: nothing(), damping_ratios: nothing(), inertia: nothing(), softness: nothing() };
        let mut shapes = DMatrix::zeros(self.rows, count);
        for (n, diameter) in self.model.diameters.iter().enumerate() {
            let dynamic = diameter.inertial_modes();
            let parts = if self.model.is_real(n) { 1 } else { 2 };
            for (mode, part) in (0..diameter.len()).flat_map(|mode| (0..parts).map(move |part| (mode, part))) {
                let place = self.place(n, mode, part);
                let frequency = diameter.frequencies[mode];
                if mode < dynamic {
                    (found.frequencies[place], found.inertia[place]) = (frequency, 1.0);
                    found.damping_ratios[place] = diameter.damping_ratios[mode];
                } else {
                    found.softness[place] = 1.0 / (frequency * frequency);
                }
                for (row, value) in diameter.contact_modes.column(mode).iter().enumerate() {
                    shapes[(row, place)] = if part == 0 { value.re } else { -value.im };
                }
            }
        }
        (found, shapes)
    }

    /// Makes the current displacements the previous ones.
    pub(crate) fn begin_span(&mut self) {
        self.state.displacement_before.copy_from_slice(&self.state.displacement);
    }

    /// Reads q and q̇; those of modes without inertia are not 0.
    pub(crate) fn read_all(&self, [position, velocity]: [&mut [f64]; 2]) {
        position.copy_from_slice(self.state.position.as_flattened().as_flattened());
        for (to, increment) in velocity.iter_mut().zip(self.state.increment.as_flattened().as_flattened()) {
            *to = increment / self.step;
        }
    }

    /// Writes q and q̇, and the resulting contact displacements.
    pub fn write_all(&mut self, position: &[f64], velocity: &[f64]) {
        self.state.position.as_flattened_mut().as_flattened_mut().copy_from_slice(position);
        let increments = self.state.increment.as_flattened_mut().as_flattened_mut();
        increments.iter_mut().zip(velocity).for_each(|(increment, v)| *increment = v * self.step);
        let mut displacement = std::mem::take(&mut self.state.displacement);
        self.rows_of(position, &mut displacement);
        self.state.displacement = displacement;
    }

    /// Computes displacements or velocities of the contact rows of all sectors, `[row][lane of sector]`, from given coordinates or their rates.
    pub fn rows_of(&mut self, coordinates: &[f64], values: &mut [f64]) {
        let (modes, rows, shapes, position) = (self.modes, self.rows, &self.shapes[..], complexes(coordinates));
        self.instruction_set.run(Recover { modes, rows, shapes, position, spectrum: &mut self.spectrum });
        let (fourier, spectrum, lanes) = (&self.fourier, &self.spectrum, self.lanes);
        self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values });
    }

    /// Computes the forces on all coordinates that contact forces (sector, node, N) cause.
    pub(crate) fn modal_forces(&mut self, forces: impl Iterator<Item = (usize, usize, Vector3)>, to: &mut [f64]) {
        self.asked.clear();
        self.asked.extend(forces);
        if self.asked.is_empty() {
            return to.fill(0.0);
        }
        self.asked_nodes.fill(false);
        for (_, node, _) in &self.asked {
            self.asked_nodes[*node] = true;
        }
        let (fourier, rows, forces) = (&self.fourier, self.rows, &self.asked[..]);
        self.instruction_set.run(Gather { fourier, rows, forces, spectrum: &mut self.asked_force });
        for (place, to) in to.chunks_exact_mut(2 * LANES).enumerate() {
            let force = &self.asked_force[place / self.modes * rows..][..rows];
            let shapes = &self.shapes[place * rows..][..rows];
            to.copy_from_slice(modal_force(&self.asked_nodes, shapes, force).as_flattened());
        }
    }

    /// Returns |Ψ| of all rows for pairs of coordinates (rows × coordinates/2), from the `shapes` of sector 0.
    pub fn sizes(&self, shapes: &DMatrix<f64>) -> Vec<f64> {
        let pairs = (0..self.coordinates() / 2).map(|pair| pair / LANES * 2 * LANES + pair % LANES);
        let sizes = pairs.flat_map(|real| {
            let size = move |row: usize| shapes[(row, real)].hypot(shapes[(row, real + LANES)]);
            (0..self.rows).map(size)
        });
        sizes.collect()
    }

    /// Finds the largest displacement of each contact row of any sector (m) for coordinates of these amplitudes, with [`CyclicBank::sizes`].
    pub fn reach(&self, amplitudes: &[f64], sizes: &[f64], reach: &mut [f64]) {
        reach.fill(0.0);
        for (pair, sizes) in sizes.chunks_exact(self.rows).enumerate() {
            let real = pair / LANES * 2 * LANES + pair % LANES;
            let (a, b) = (amplitudes[real], amplitudes[real + LANES]);
            let amplitude = (a * a + b * b).sqrt();
            reach.iter_mut().zip(sizes).for_each(|(reach, size)| *reach += size * amplitude);
        }
    }

    /// Adds to the damping loss (J).
    pub fn lose(&mut self, loss: f64) {
        self.state.loss[0] += loss;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modes::cyclic::tests::model;

    /// Each sector sees the coordinates as sector 0 does, but rotated; the map of forces is the transpose of the map of displacements.
    #[test]
    fn force_and_displacement_maps_are_transposes() {
        for sectors in [2, 5, 12] {
            let model = model(sectors, 2);
            let mut bank = CyclicBank::new(&model, false);
            bank.set_step(crate::scene::method::Scheme::Galerkin, 1e-5);
            let (coordinates, shapes) = bank.coordinates_of();
            let (count, lanes, rows) = (bank.coordinates(), bank.lanes(), bank.rows());
            let at: Vec<f64> =
                (0..count)
                    .map(|i| {
                        if coordinates.inertia[i] + coordinates.softness[i] > 0.0 {
                            (1.7 * i as f64).sin()
                        } else {
                            0.0
                        }
                    })
                    .collect();
            let mut values = vec![0.0; rows * lanes];
            bank.rows_of(&at, &mut values);
            for row in 0..rows {
                let seen: f64 = shapes.row(row).iter().zip(&at).map(|(shape, q)| shape * q).sum();
                assert!((seen - values[row * lanes]).abs() < 1e-12 * (1.0 + seen.abs()));
            }
            let force = |sector: usize, node: usize| {
                Vector3::from([0, 1, 2].map(|c| (sector as f64 + 2.3 * node as f64 + f64::from(c)).cos()))
            };
            let all: Vec<_> =
                (0..sectors).flat_map(|s| (0..rows / 3).map(move |node| (s, node, force(s, node)))).collect();
            let work: f64 = all
                .iter()
                .map(|(s, node, f)| (0..3).map(|c| f[c] * values[(3 * node + c) * lanes + s]).sum::<f64>())
                .sum();
            let mut modal = vec![0.0; count];
            bank.modal_forces(all.into_iter(), &mut modal);
            let other: f64 = modal.iter().zip(&at).map(|(p, q)| p * q).sum();
            assert!((work - other).abs() < 1e-11 * (1.0 + work.abs()), "{sectors}: {work} {other}");
        }
    }
}
