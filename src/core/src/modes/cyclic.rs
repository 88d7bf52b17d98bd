//! Modes of a disk of coupled sectors, nodal diameter by nodal diameter.
//!
//! Every nodal diameter n has its Hermitian pencil K_n φ = ω² M_n φ (see [`Harmonic`](crate::scene::rom::Harmonic)). With the mass-normalised modes,
//! z_n = Φ_n q_n, the equations are q̈ + 2ξω q̇ + ω² q = p for each complex amplitude q, and the displacement of sector s is
//! u_s = Σ_n Re(Ψ_n q_n e^(2πi n s/N)) with the weighted contact modes Ψ_n = w_n C_n Φ_n. Virtual work gives the modal
//! force p_n = Ψ_nᴴ Σ_s f_s e^(−2πi n s/N) of forces f_s on the sectors; its imaginary part is omitted for n = 0 and 2n = N,
//! whose modes are real.

use nalgebra::{Complex, DMatrix};
use tiprub_cosim::shown;

use crate::math::real;
use crate::modes::modal::{ModalModel, ModeNumber, eigenmodes, fill_ratios};
use crate::{Error, Result, Rom};

/// Entries of a mode shape this close to the largest count as equally large when the phase is chosen.
const SAME_SIZE: f64 = 1e-6;

/// Frequencies of one mode, computed by the reduction and from the matrices of the ROM, agree to this fraction.
const SAME_FREQUENCY: f64 = 1e-3;
/// Frequencies of rigid-body modes agree to this fraction of the highest frequency.
const RIGID_FREQUENCY: f64 = 1e-5;

/// Modes of one nodal diameter. `contact_modes` are Ψ_n = w_n C_n Φ_n, the displacements of the contact rows of sector 0 per unit
/// amplitude; `shapes` are Φ_n, with a real and positive largest entry (the first of equals) in every column.
pub type DiameterModes = ModalModel<Complex<f64>>;

/// Modes of all nodal diameters 0 ..= ⌊N/2⌋ of N coupled sectors.
#[derive(Debug, Clone, PartialEq)]
pub struct CyclicModel {
    /// Number of sectors N.
    pub sectors: usize,
    /// Nodal diameters in ascending order, from 0.
    pub diameters: Vec<DiameterModes>,
}

impl CyclicModel {
    /// Solves the eigenproblem of every nodal diameter and assigns one damping ratio to all modes.
    ///
    /// # Errors
    /// The ROM is invalid, or a stiffness is not positive semidefinite; the message names the array.
    pub fn from_rom(rom: &Rom, damping_ratio: f64) -> Result<Self> {
        Self::with_zero(rom, damping_ratio, ModalModel::from_rom(rom, damping_ratio)?)
    }

    /// Solves the eigenproblems of a valid ROM except that of nodal diameter 0, whose modes are `zero`.
    ///
    /// # Errors
    /// A stiffness that is not positive semidefinite.
    pub(crate) fn with_zero(rom: &Rom, damping_ratio: f64, zero: ModalModel) -> Result<Self> {
        let (sectors, complex) = (rom.sectors, |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0)));
        let modes_of = |n: usize, map: &DMatrix<Complex<f64>>, squares: &[f64], shapes: DMatrix<Complex<f64>>| {
            let contact_modes = map * &shapes * Complex::new(weight(n, sectors), 0.0);
            DiameterModes::new(squares, damping_ratio, contact_modes, shapes)
        };
        let mut first = modes_of(0, &complex(&rom.contact_map), &zero.frequencies, complex(&zero.shapes));
        // The frequencies are not computed from their squares, which would add a rounding error.
        first.frequencies = zero.frequencies;
        let mut diameters = vec![first];
        for (index, harmonic) in rom.extras.harmonics.iter().enumerate() {
            let (n, suffix) = (index + 1, format!("_{}", index + 1));
            diameters.push(if 2 * n == sectors {
                let real = |matrix: &DMatrix<Complex<f64>>| matrix.map(|value| value.re);
                let (squares, shapes) = eigenmodes(&real(&harmonic.mass), &real(&harmonic.stiffness), &suffix)?;
                modes_of(n, &complex(&real(&harmonic.contact_map)), &squares, complex(&shapes))
            } else {
                let (squares, shapes) = eigenmodes(&harmonic.mass, &harmonic.stiffness, &suffix)?;
                modes_of(n, &harmonic.contact_map, &squares, shapes)
            });
        }
        let model = Self { sectors, diameters };
        model.check_frequencies(rom)?;
        Ok(model)
    }

    /// Checks that the harmonics have the frequencies that the ROM states, which detects exchanged harmonics. (The complex
    /// conjugate of a harmonic has the same frequencies; its waves travel in the other direction.)
    fn check_frequencies(&self, rom: &Rom) -> Result<()> {
        let checks = &rom.checks;
        if checks.nodal_diameters.len() != checks.reduced_frequencies.len() {
            return Ok(());
        }
        for (n, diameter) in self.diameters.iter().enumerate() {
            let stored = checks.nodal_diameters.iter().zip(&checks.reduced_frequencies);
            let stored = stored.filter(|(number, _)| usize::try_from(**number) == Ok(n));
            let largest = diameter.frequencies.last().map_or(0.0, |most| most / std::f64::consts::TAU);
            for ((_, stored), found) in stored.zip(&diameter.frequencies) {
                let found = found / std::f64::consts::TAU;
                if (found - stored).abs() > SAME_FREQUENCY * stored + RIGID_FREQUENCY * largest {
                    return Err(Error::invalid(
                        "ROM harmonics",
                        format!(
                            "nodal diameter {n} has a mode at {} Hz, but the checks stored in the ROM give {} Hz",
                            shown(found),
                            shown(*stored)
                        ),
                        "Store the harmonics in the order of their nodal diameters, or regenerate the ROM with `tiprub \
                         reduce`",
                    ));
                }
            }
        }
        Ok(())
    }

    /// Contact rows per sector (3 per contact node).
    pub fn rows(&self) -> usize {
        self.diameters[0].contact_modes.nrows()
    }

    /// Largest number of modes of a nodal diameter.
    pub(crate) fn most_modes(&self) -> usize {
        self.diameters.iter().map(DiameterModes::len).max().unwrap_or(0)
    }

    /// Returns whether the modes of a nodal diameter are real, so that no wave can travel.
    pub(crate) fn is_real(&self, nodal_diameter: usize) -> bool {
        nodal_diameter == 0 || 2 * nodal_diameter == self.sectors
    }

    /// Sets one damping ratio for all modes; the first modes of each nodal diameter have their `own`.
    /// Returns whether any has changed.
    pub(crate) fn set_damping_ratio(&mut self, damping_ratio: f64, own: &[f64]) -> bool {
        let changes = self.diameters.iter_mut().map(|of| fill_ratios(&mut of.damping_ratios, damping_ratio, own, 1));
        changes.fold(false, |any, has_changed| any | has_changed)
    }

    /// Largest undamped angular frequency (rad/s).
    pub fn largest_frequency(&self) -> f64 {
        self.diameters.iter().map(DiameterModes::largest_frequency).fold(0.0, f64::max)
    }

    /// w_n: displacement of a sector per unit amplitude of a nodal diameter that moves every reduced coordinate by one.
    pub fn weight(&self, nodal_diameter: usize) -> f64 {
        weight(nodal_diameter, self.sectors)
    }

    /// Returns one nodal diameter as a real structure: real and imaginary parts of the amplitudes are modes, those of the
    /// displacement pattern are contact nodes (first all real, then all imaginary parts). Contact that is closed on all sectors
    /// decouples into these structures. A nodal diameter with real modes has only real parts.
    pub fn paired(&self, nodal_diameter: usize) -> ModalModel {
        let diameter = &self.diameters[nodal_diameter];
        let (rows, modes) = diameter.contact_modes.shape();
        let copies = if self.is_real(nodal_diameter) { 1 } else { 2 };
        let double = |values: &[f64]| values.iter().flat_map(|value| vec![*value; copies]).collect();
        let contact_modes = DMatrix::from_fn(copies * rows, copies * modes, |row, mode| {
            let value = diameter.contact_modes[(row % rows, mode / copies)];
            match (row / rows, mode % copies) {
                (0, 0) | (1, 1) => value.re,
                (0, _) => -value.im,
                _ => value.im,
            }
        });
        ModalModel {
            frequencies: double(&diameter.frequencies),
            damping_ratios: double(&diameter.damping_ratios),
            contact_modes,
            shapes: DMatrix::identity(copies * modes, copies * modes),
            quasi_static: copies * diameter.quasi_static,
        }
    }
}

/// w_n: 1/√N for real amplitudes, √(2/N) for complex ones.
fn weight(nodal_diameter: usize, sectors: usize) -> f64 {
    let share = if nodal_diameter == 0 || 2 * nodal_diameter == sectors { 1.0 } else { 2.0 };
    libm::sqrt(share / real(sectors))
}

impl ModeNumber for Complex<f64> {
    const ROUNDING: f64 = 32.0;

    /// Makes the largest entry of each eigenvector real and positive.
    fn fix_phases(shapes: &mut DMatrix<Self>) {
        let size = |value: &Self| libm::hypot(value.re, value.im);
        for mut column in shapes.column_iter_mut() {
            let largest = column.iter().fold(0.0, |most: f64, value| most.max(size(value)));
            let Some(chosen) = column.iter().position(|value| size(value) >= (1.0 - SAME_SIZE) * largest) else {
                continue;
            };
            let turn = column[chosen].conj() / size(&column[chosen]);
            column.iter_mut().for_each(|value| *value *= turn);
            column[chosen].im = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::rom::Harmonic;

    fn number(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(*seed >> 33).unwrap()) / f64::from(1_u32 << 30) - 1.0
    }

    fn pencil(order: usize, seed: u64) -> Harmonic {
        let mut seed = seed;
        let mut random =
            |rows, columns| DMatrix::from_fn(rows, columns, |_, _| Complex::new(number(&mut seed), number(&mut seed)));
        let (a, b, contact_map) = (random(order, order), random(order, order), random(3, order));
        let hermitian = |matrix: DMatrix<Complex<f64>>| (&matrix + matrix.adjoint()) * Complex::new(0.5, 0.0);
        Harmonic {
            mass: hermitian(&a * a.adjoint() * Complex::new(0.1, 0.0) + DMatrix::identity(order, order)),
            stiffness: hermitian(&b * b.adjoint() * Complex::new(1e6, 0.0)),
            contact_map,
        }
    }

    #[test]
    fn modes_are_orthonormal_and_diagonalise_the_pencil_to_rounding() {
        for (order, seed) in [(1, 1), (3, 2), (14, 3), (34, 4), (60, 5)] {
            let harmonic = pencil(order, seed);
            let (squares, shapes) = eigenmodes(&harmonic.mass, &harmonic.stiffness, "_1").unwrap();
            let size =
                |matrix: DMatrix<Complex<f64>>| matrix.iter().fold(0.0, |most: f64, z| most.max(z.re.hypot(z.im)));
            let error = size(shapes.adjoint() * &harmonic.mass * &shapes - DMatrix::identity(order, order));
            let diagonal =
                DMatrix::from_fn(order, order, |i, j| Complex::new(if i == j { squares[i] } else { 0.0 }, 0.0));
            let off = size(shapes.adjoint() * &harmonic.stiffness * &shapes - diagonal) / squares[order - 1];
            println!("n = {order}: orthonormality {error:.1e}, diagonality {off:.1e}");
            assert!(error < 1e-13 && off < 1e-13, "n = {order}: {error:e}, {off:e}");
            assert!(squares.windows(2).all(|pair| pair[0] <= pair[1]));
        }
    }

    #[test]
    fn phases_are_independent_of_eigenvector_choice() {
        let mut seed = 9;
        let mut shapes = DMatrix::from_fn(7, 5, |_, _| Complex::new(number(&mut seed), number(&mut seed)));
        let mut turned = shapes.clone();
        for (column, angle) in [0.3, 1.9, -2.5, 3.1, 0.0_f64].into_iter().enumerate() {
            turned.column_mut(column).iter_mut().for_each(|value| *value *= Complex::new(angle.cos(), angle.sin()));
        }
        ModeNumber::fix_phases(&mut shapes);
        ModeNumber::fix_phases(&mut turned);
        let off = shapes.iter().zip(turned.iter()).fold(0.0_f64, |most, (a, b)| most.max((a - b).norm_sqr().sqrt()));
        assert!(off < 1e-15, "{off:e}");
    }

    /// u = Ψq and p = Ψᴴf for arbitrary amplitudes and forces.
    #[test]
    fn paired_nodal_diameter_equals_the_complex_one() {
        let (sectors, modes) = (5, 4);
        let of = |nodal_diameter: usize| {
            let Harmonic { contact_map, .. } = pencil(modes, 8);
            let Harmonic { mass, stiffness, .. } = pencil(modes, 9);
            let (squares, shapes) = eigenmodes(&mass, &stiffness, "_1").unwrap();
            let weight = Complex::new(weight(nodal_diameter, sectors), 0.0);
            DiameterModes::new(&squares, 0.01, contact_map * &shapes * weight, shapes)
        };
        let disk = CyclicModel { sectors, diameters: vec![of(0), of(1)] };
        let (paired, own) = (disk.paired(1), &disk.diameters[1]);
        let mut seed = 10;
        let mut random =
            |count: usize| DMatrix::from_fn(count, 1, |_, _| Complex::new(number(&mut seed), number(&mut seed)));
        // Amplitudes as pairs; patterns with all real parts first.
        let in_pairs = |z: &DMatrix<Complex<f64>>| z.iter().flat_map(|z| [z.re, z.im]).collect::<Vec<_>>();
        let in_parts =
            |z: &DMatrix<Complex<f64>>| z.iter().map(|z| z.re).chain(z.iter().map(|z| z.im)).collect::<Vec<_>>();
        let near = |found: &DMatrix<f64>, expected: &[f64]| {
            let off = found.iter().zip(expected).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(found.len() == expected.len() && off < 1e-14, "{off:e}");
        };
        let (amplitudes, forces) = (random(modes), random(3));
        let moved = &paired.contact_modes * DMatrix::from_vec(2 * modes, 1, in_pairs(&amplitudes));
        near(&moved, &in_parts(&(&own.contact_modes * &amplitudes)));
        let pushed = paired.contact_modes.transpose() * DMatrix::from_vec(6, 1, in_parts(&forces));
        near(&pushed, &in_pairs(&(own.contact_modes.adjoint() * &forces)));
        for (mode, frequency) in own.frequencies.iter().enumerate() {
            let alike = [0, 1].map(|part| paired.frequencies[2 * mode + part].to_bits());
            assert_eq!(alike, [frequency.to_bits(); 2]);
        }
        assert_eq!((paired.quasi_static, disk.paired(0).contact_modes.shape()), (2 * own.quasi_static, (3, modes)));
    }

    #[test]
    fn a_rigid_rotation_of_a_free_pair_is_exactly_rigid() {
        // Two masses connected by a spring of complex direction: the stiffness has rank one, so one mode is rigid.
        let direction = [Complex::new(1.0, 0.0), Complex::new(-0.6, 0.8)];
        let stiffness = DMatrix::from_fn(2, 2, |i, j| direction[i] * direction[j].conj() * Complex::new(3e7, 0.0));
        let mass =
            DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&[2.0, 0.7])).map(|m| Complex::new(m, 0.0));
        let harmonic = Harmonic { mass, stiffness, contact_map: DMatrix::zeros(3, 2) };
        let (squares, _) = eigenmodes(&harmonic.mass, &harmonic.stiffness, "_1").unwrap();
        assert!(squares[0] == 0.0, "{squares:?}");
        assert!((squares[1] / (3e7 * (1.0 / 2.0 + 1.0 / 0.7)) - 1.0).abs() < 1e-13, "{squares:?}");
    }
}
