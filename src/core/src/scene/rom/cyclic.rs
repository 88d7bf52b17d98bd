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
use tiprub_cosim::{bounds, shown};

use super::{Rom, refuse};
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
        let refuse = |array: &str, problem: String| refuse(format!("ROM array `{array}_{nodal_diameter}`"), problem);
        let order = harmonic.mass.nrows();
        let arrays = [
            ("mass", &harmonic.mass, (order, order)),
            ("stiffness", &harmonic.stiffness, (order, order)),
            ("contact_map", &harmonic.contact_map, (3 * self.contact_nodes.len(), order)),
        ];
        for (name, matrix, expected) in arrays {
            if order == 0 || matrix.shape() != expected {
                return refuse(name, format!("shape {:?} found, {expected:?} expected", matrix.shape()));
            }
            if let Some(index) = matrix.iter().position(|value| !(value.re.is_finite() && value.im.is_finite())) {
                let (row, column) = (index % matrix.nrows(), index / matrix.nrows());
                return refuse(name, format!("non-finite entry at ({row}, {column})"));
            }
            let largest = largest_entry(matrix);
            let most = if name == "contact_map" { ranges::MAP } else { bounds::MATRIX };
            if largest > most {
                return refuse(name, format!("an entry of magnitude {} exceeds {}", shown(largest), shown(most)));
            }
            // With half a turn of phase from sector to sector there is no travelling wave.
            let imaginary = matrix.iter().fold(0.0, |most: f64, value| most.max(value.im.abs()));
            if 2 * nodal_diameter == self.sectors && imaginary > 1e-8 * largest {
                return refuse(
                    name,
                    format!("imaginary part {imaginary:.3e}, but the arrays of nodal diameter sectors/2 must be real"),
                );
            }
        }
        for (name, matrix) in [("mass", &harmonic.mass), ("stiffness", &harmonic.stiffness)] {
            let asymmetry = largest_entry(&(matrix - matrix.adjoint()));
            let largest = largest_entry(matrix);
            if asymmetry > 1e-8 * largest {
                return refuse(name, format!("not Hermitian: deviation {asymmetry:.3e}, largest entry {largest:.3e}"));
            }
        }
        if cholesky(&harmonic.mass).is_none() {
            return refuse("mass", "not positive definite".to_owned());
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

fn largest_entry(matrix: &DMatrix<Complex<f64>>) -> f64 {
    matrix.iter().fold(0.0, |most: f64, value| most.max(libm::hypot(value.re, value.im)))
}
