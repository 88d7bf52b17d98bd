//! Coordinates of a disk as a plain array, in the order of the state of its modes; entries without a mode stay 0.

use super::pass::{Combination, TwoCombinations, TwoModalForces};
use super::{Disk, LANES, complexes};
use crate::math::vector::Vector3;
use crate::modes::coordinates::Coordinates;
use nalgebra::DMatrix;

impl Disk {
    /// Number of coordinates.
    fn coordinates(&self) -> usize {
        self.coefficients.len() * 2 * LANES
    }

    /// Index of the real or imaginary part of a mode.
    pub(in crate::modes::bank) fn coordinate(&self, n: usize, mode: usize, part: usize) -> usize {
        (2 * (n / LANES * self.modes + mode) + part) * LANES + n % LANES
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
                let place = self.coordinate(n, mode, part);
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

    /// Computes displacements or velocities of the contact rows of all sectors, `[row][lane of sector]`, from given coordinates or their rates.
    pub(crate) fn rows_of(&mut self, coordinates: &[f64], values: &mut [f64]) {
        self.instruction_set.run_octets(Combination {
            columns: self.modes,
            rows: self.rows,
            matrix: &self.shapes,
            values: complexes(coordinates),
            touched: None,
            spectrum: &mut self.spectrum,
        });
        self.synthesise(values);
    }

    /// Computes the displacements of the contact rows of all sectors for two sets of coordinates; see [`Disk::rows_of`].
    pub(crate) fn rows_of_two(&mut self, coordinates: [&[f64]; 2], values: [&mut [f64]; 2]) {
        self.instruction_set.run_octets(TwoCombinations {
            columns: self.modes,
            rows: self.rows,
            matrix: &self.shapes,
            values: coordinates.map(complexes),
            spectra: [&mut self.spectrum, &mut self.other_spectrum],
        });
        for values in values {
            self.synthesise(values);
            std::mem::swap(&mut self.spectrum, &mut self.other_spectrum);
        }
    }

    /// Computes the forces on all coordinates for two sets of contact forces; see [`Disk::modal_forces`].
    pub(crate) fn modal_forces_of_two(
        &mut self,
        [first, second]: [impl Iterator<Item = (usize, usize, Vector3)>; 2],
        to: [&mut [f64]; 2],
    ) {
        self.gather(first);
        std::mem::swap(&mut self.asked_force, &mut self.other_force);
        std::mem::swap(&mut self.asked_nodes, &mut self.other_nodes);
        self.gather(second);
        self.asked_nodes.iter_mut().zip(&self.other_nodes).for_each(|(asked, other)| *asked |= other);
        if !self.asked_nodes.contains(&true) {
            return to.into_iter().for_each(|to| to.fill(0.0));
        }
        let Self { modes, rows, shapes, asked_force, other_force, asked_nodes: touched, .. } = self;
        let forces = [&other_force[..], &asked_force[..]];
        self.instruction_set.run_octets(TwoModalForces { modes: *modes, rows: *rows, shapes, forces, touched, to });
    }

    /// Computes the forces on all coordinates that contact forces (sector, node, N) cause.
    pub(crate) fn modal_forces(&mut self, forces: impl Iterator<Item = (usize, usize, Vector3)>, to: &mut [f64]) {
        let mut forces = forces.peekable();
        if forces.peek().is_none() {
            return to.fill(0.0);
        }
        self.gather(forces);
        self.find_modal_forces(to);
    }

    /// Returns |Ψ| of all rows for pairs of coordinates (rows × coordinates/2), from the `shapes` of sector 0.
    pub(crate) fn sizes(&self, shapes: &DMatrix<f64>) -> Vec<f64> {
        let pairs = (0..self.coordinates() / 2).map(|pair| pair / LANES * 2 * LANES + pair % LANES);
        let sizes = pairs.flat_map(|real| {
            let size = move |row: usize| shapes[(row, real)].hypot(shapes[(row, real + LANES)]);
            (0..self.rows).map(size)
        });
        sizes.collect()
    }

    /// Finds the largest displacement of each contact row of any sector (m) for coordinates of these amplitudes, with [`Disk::sizes`].
    pub(crate) fn reach(&self, amplitudes: &[f64], sizes: &[f64], reach: &mut [f64]) {
        reach.fill(0.0);
        for (pair, sizes) in sizes.chunks_exact(self.rows).enumerate() {
            let real = pair / LANES * 2 * LANES + pair % LANES;
            let (a, b) = (amplitudes[real], amplitudes[real + LANES]);
            let amplitude = (a * a + b * b).sqrt();
            reach.iter_mut().zip(sizes).for_each(|(reach, size)| *reach += size * amplitude);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modes::bank::disk::tests::model;
    use crate::modes::bank::{BankOptions, ModalBank, SectorModel};

    /// Each sector sees the coordinates as sector 0 does, but rotated; the map of forces is the transpose of the map of displacements.
    #[test]
    fn force_and_displacement_maps_are_transposes() {
        for sectors in [2, 5, 12] {
            let model = model(sectors, 2);
            let mut bank = ModalBank::new(SectorModel::Coupled(&model), BankOptions::default());
            bank.set_step(crate::scene::method::Scheme::Galerkin, 1e-5);
            let (lanes, rows, disk) = (bank.lanes(), bank.rows(), bank.disk_mut().unwrap());
            let ((coordinates, shapes), count) = (disk.coordinates_of(), disk.coordinates());
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
            disk.rows_of(&at, &mut values);
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
            disk.modal_forces(all.into_iter(), &mut modal);
            let other: f64 = modal.iter().zip(&at).map(|(p, q)| p * q).sum();
            assert!((work - other).abs() < 1e-11 * (1.0 + work.abs()), "{sectors}: {work} {other}");
            // Two sets together give the same results as each set alone, also if one of them has no forces.
            let turned: Vec<f64> = at.iter().map(|value| -3.0 * value).collect();
            let (mut one, mut two, mut alone) = (values.clone(), values.clone(), values.clone());
            disk.rows_of_two([&at, &turned], [&mut one, &mut two]);
            assert_eq!(one, values);
            disk.rows_of(&turned, &mut alone);
            assert_eq!(two, alone);
            let some = |share: usize| (0..sectors).step_by(share).map(|s| (s, s % (rows / 3), force(s, 1)));
            for shares in [[1, 2], [2, 1], [sectors + 1, 1]] {
                let mut both = [modal.clone(), modal.clone()];
                let [first, second] = &mut both;
                disk.modal_forces_of_two(shares.map(some), [first, second]);
                for (share, both) in shares.into_iter().zip(&both) {
                    disk.modal_forces(some(share), &mut modal);
                    assert_eq!(*both, modal, "{sectors}, every {share}. sector");
                }
            }
            let mut both = [modal.clone(), modal.clone()];
            let [first, second] = &mut both;
            disk.modal_forces_of_two([some(1).take(0), some(1).take(0)], [first, second]);
            assert!(both.iter().flatten().all(|value| *value == 0.0));
        }
    }
}
