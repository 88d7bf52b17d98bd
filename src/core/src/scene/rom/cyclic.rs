//! A structure of identical sectors that are coupled: one small pencil per nodal diameter (cyclic symmetry).
//!
//! The displacement of sector s of N, in its own directions, is the sum over the nodal diameters n = 0 ..= ⌊N/2⌋ of
//!
//! ```text
//! u_s = w_n Re(C_n z_n e^(2πi n s / N)),   w_n = 1/√N for n = 0 and 2n = N (z real), else √(2/N) (z complex),
//! ```
//!
//! with the contact map C_n and the Hermitian matrices M_n, K_n of one sector. The factors w_n make the transformation unitary: kinetic and
//! strain energy of the whole disk are the sums of ½ żᴴM_nż and ½ zᴴK_nz (D. L. Thomas, Int. J. Num. Meth. Eng. 14, 1979). Sector s + 1 is
//! sector s turned by +2π/N about z; n > 0 is a wave e^(i n 2π s/N).

use nalgebra::{Complex, ComplexField, DMatrix};
use tiprub_cosim::bounds;

use super::{Rom, largest, refuse, symmetric};
use crate::Result;
use crate::scene::ranges;

/// Reduced matrices of one nodal diameter above 0 (those of diameter 0 are the ROM's own).
#[derive(Debug, Clone, PartialEq)]
pub struct Harmonic {
    /// M_n, m × m, Hermitian positive definite (kg for physical coordinates).
    pub mass: DMatrix<Complex<f64>>,
    /// K_n, m × m, Hermitian positive semidefinite (N/m).
    pub stiffness: DMatrix<Complex<f64>>,
    /// C_n, 3·nodes × m: displacement of the contact nodes per unit of each reduced coordinate.
    pub contact_map: DMatrix<Complex<f64>>,
}

impl Rom {
    /// Returns whether the sectors are coupled, with a pencil per nodal diameter.
    pub fn is_cyclic(&self) -> bool {
        !self.extras.harmonics.is_empty()
    }

    /// Largest nodal diameter of `sectors` sectors.
    pub fn largest_nodal_diameter(&self) -> usize {
        self.sectors / 2
    }

    /// Number of real degrees of freedom of the whole reduced structure.
    pub fn total_order(&self) -> usize {
        if !self.is_cyclic() {
            return self.sectors * self.order();
        }
        let harmonics = self.extras.harmonics.iter().enumerate();
        let real = |(index, harmonic): (usize, &Harmonic)| {
            harmonic.mass.nrows() * if 2 * (index + 1) == self.sectors { 1 } else { 2 }
        };
        self.order() + harmonics.map(real).sum::<usize>()
    }

    pub(super) fn validate_harmonics(&self) -> Result<()> {
        let harmonics = &self.extras.harmonics;
        if harmonics.is_empty() {
            return Ok(());
        }
        if harmonics.len() != self.largest_nodal_diameter() {
            let problem = format!(
                "{} harmonics above nodal diameter 0, but {} are required for {} sectors",
                harmonics.len(),
                self.largest_nodal_diameter(),
                self.sectors
            );
            return refuse("ROM harmonics", problem);
        }
        for (index, harmonic) in harmonics.iter().enumerate() {
            self.validate_harmonic(index + 1, harmonic)?;
        }
        Ok(())
    }

    fn validate_harmonic(&self, nodal_diameter: usize, harmonic: &Harmonic) -> Result<()> {
        let name = |array: &str| format!("{array}_{nodal_diameter}");
        let Harmonic { mass, stiffness, contact_map } = harmonic;
        let (order, rows) = (mass.nrows(), 3 * self.contact_nodes.len());
        if order == 0 {
            return refuse(format!("ROM array `{}`", name("mass")), format!("shape {:?} is empty", mass.shape()));
        }
        for (array, matrix, height, most) in [
            (name("mass"), mass, order, bounds::MATRIX),
            (name("stiffness"), stiffness, order, bounds::MATRIX),
            (name("contact_map"), contact_map, rows, ranges::MAP),
        ] {
            super::array(&array, matrix, (height, order), most)?;
            // With half a turn of phase from sector to sector there is no travelling wave.
            let imaginary = matrix.iter().fold(0.0, |most: f64, value| most.max(value.im.abs()));
            if 2 * nodal_diameter == self.sectors && imaginary > 1e-8 * largest(matrix) {
                let problem =
                    format!("imaginary part {imaginary:.3e}, but the arrays of nodal diameter sectors/2 must be real");
                return refuse(format!("ROM array `{array}`"), problem);
            }
        }
        symmetric(&name("mass"), mass, "Hermitian", 1.0)?;
        symmetric(&name("stiffness"), stiffness, "Hermitian", 1.0)?;
        if cholesky(mass).is_none() {
            return refuse(format!("ROM array `{}`", name("mass")), "not positive definite");
        }
        Ok(())
    }
}

/// Cholesky factor L of a Hermitian matrix L Lᴴ; `None` unless it is positive definite. (Every complex number has a square root, so that
/// the factorisation of a complex matrix alone does not detect this.)
pub(crate) fn cholesky<T: ComplexField<RealField = f64>>(matrix: &DMatrix<T>) -> Option<DMatrix<T>> {
    let lower = matrix.clone().cholesky()?.l();
    let real = |index: usize| {
        let pivot: &T = &lower[(index, index)];
        let (real, imaginary) = (pivot.clone().real(), pivot.clone().imaginary());
        real > 0.0 && imaginary.abs() <= 1e-8 * real
    };
    (0..lower.nrows()).all(real).then_some(lower)
}
