//! Craig-Bampton reduction of one nodal diameter, and the small matrices that its checks need.
//!
//! T = [Ψ Φ] with the constraint modes Ψ of the contact and the fixed-interface modes Φ; K̂ = blkdiag(K̂_cc, Ω²), M̂ = TᴴM_nT.
//!
//! Eq. 12 asks for r = x - (ω² - σ) A_n⁻¹M_n x of x = Tz for every number of modes. Split A_n⁻¹M_nT = TX + F
//! with F orthogonal to T in A_n: then r = T(z - λXz) - λFz, λ = ω² - σ, and rᴴA_nr = dᴴÂd + λ² zᴴF̂z with d = z - λXz, Â = TᴴA_nT and
//! F̂ = FᴴA_nF. Both terms are squares, so nothing cancels, and leaving out modes is leaving out rows of z.

use faer::linalg::solvers::{Llt, Solve};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, MatRef, Par, Side, c64};

use super::lanczos::{ComplexModes, hermitian_eigen, lowest_modes};
use super::operator::Operator;
use crate::{Error, Result};

/// One reduced nodal diameter, with all the modes that were computed.
#[derive(Debug)]
pub(super) struct Component {
    /// Everything is real.
    pub real: bool,
    /// Contact dofs.
    pub contact: usize,
    /// ω² with the contact held.
    pub squares: Vec<f64>,
    /// M̂.
    pub mass: Mat<c64>,
    /// K̂.
    pub stiffness: Mat<c64>,
    /// σ of A_n.
    shift: f64,
    /// X.
    inner: Mat<c64>,
    /// F̂.
    defect: Mat<c64>,
}

/// Quality of the lowest modes of a reduced nodal diameter.
#[derive(Debug, Clone)]
pub(super) struct Quality {
    /// ω², ascending.
    pub squares: Vec<f64>,
    /// Eq. 12 (%).
    pub residual_criterion: Vec<f64>,
}

/// Which fixed-interface modes are computed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Wanted {
    Count(usize),
    /// All with ω² up to this, and the next one.
    UpTo(f64),
}

impl Component {
    /// Reduce. `at_rest` has no shift, `full` is the operator of the modes with free contact.
    ///
    /// # Errors
    /// Those of [`lowest_modes`]; [`Error::NotPositiveDefinite`] when the reduced mass is not.
    pub(super) fn new(at_rest: &Operator<'_>, full: &Operator<'_>, wanted: Wanted) -> Result<Self> {
        let parts = at_rest.parts();
        let fixed = fixed_interface_modes(at_rest, wanted)?;
        let (constraint, static_stiffness) = at_rest.constraint_modes();
        let (held, contact, count) = (parts.order() - parts.contact, parts.contact, fixed.eigenvalues.len());
        let mut transformation = Mat::zeros(parts.order(), contact + count);
        transformation.get_mut(.., ..contact).copy_from(&constraint);
        transformation.get_mut(..held, contact..).copy_from(&fixed.shapes);
        let mass_transformation = full.mass(transformation.as_ref());
        let mass = hermitian((transformation.adjoint() * &mass_transformation).as_ref());
        let mut stiffness = Mat::zeros(contact + count, contact + count);
        stiffness.get_mut(..contact, ..contact).copy_from(&hermitian(static_stiffness.as_ref()));
        for (k, &square) in fixed.eigenvalues.iter().enumerate() {
            stiffness[(contact + k, contact + k)] = c64::new(square, 0.0);
        }
        let shift = full.condensed.shift;
        let shifted = &stiffness - &mass * faer::Scale(c64::new(shift, 0.0));
        let factor = Llt::new(shifted.as_ref(), Side::Lower)
            .map_err(|_| super::operator::not_positive(full.nodal_diameter, false))?;
        let inner = factor.solve(&mass);
        let outside = full.solve(mass_transformation.as_ref()) - &transformation * &inner;
        let defect = hermitian((outside.adjoint() * full.shifted(outside.as_ref())).as_ref());
        Ok(Self { real: at_rest.real, contact, squares: fixed.eigenvalues, mass, stiffness, shift, inner, defect })
    }

    /// Modes of the reduced model with the first `modes` fixed-interface modes, the lowest `count` of them, and their residuals.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] when the reduced mass is not.
    pub(super) fn quality(&self, modes: usize, count: usize) -> Result<Quality> {
        let size = self.contact + modes;
        let (mass, stiffness) = (self.mass.get(..size, ..size), self.stiffness.get(..size, ..size));
        let (squares, vectors) = dense_modes(stiffness, mass, self.real)?;
        let count = count.min(size);
        let z = vectors.get(.., ..count);
        let xz = self.inner.get(.., ..size) * z;
        let whole = |k: usize, i: usize| if i < size { z[(i, k)] } else { c64::new(0.0, 0.0) };
        let missing =
            Mat::from_fn(self.mass.nrows(), count, |i, k| whole(k, i) - xz[(i, k)] * (squares[k] - self.shift));
        let shifted = &self.stiffness - &self.mass * faer::Scale(c64::new(self.shift, 0.0));
        let inside = energies(&shifted, missing.as_ref());
        let outside = energies(&self.defect.get(..size, ..size).to_owned(), z);
        let strain = energies(&shifted.get(..size, ..size).to_owned(), z);
        let criterion = |k: usize| {
            let factor = squares[k] - self.shift;
            (inside[k] + factor * factor * outside[k]) / strain[k] * 100.0
        };
        let residual_criterion = (0..count).map(criterion).collect();
        Ok(Quality { squares: squares[..count].to_vec(), residual_criterion })
    }
}

fn fixed_interface_modes(operator: &Operator<'_>, wanted: Wanted) -> Result<ComplexModes> {
    let parts = operator.parts();
    let order = parts.order() - parts.contact;
    match wanted {
        Wanted::Count(count) => lowest_modes(operator, order, count),
        Wanted::UpTo(square) => {
            let mut count = 12.min(order);
            loop {
                let modes = lowest_modes(operator, order, count)?;
                let beyond = modes.eigenvalues.last().is_none_or(|&last| last > square);
                if beyond || count == order {
                    return Ok(modes);
                }
                count = (2 * count).min(order);
            }
        }
    }
}

/// ½(A + Aᴴ).
fn hermitian(matrix: MatRef<'_, c64>) -> Mat<c64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| (matrix[(i, j)] + matrix[(j, i)].conj()) * 0.5)
}

/// xᴴAx of every column.
fn energies(matrix: &Mat<c64>, columns: MatRef<'_, c64>) -> Vec<f64> {
    let forces = matrix * columns;
    (0..columns.ncols()).map(|k| (columns.col(k).adjoint() * forces.col(k)).re.max(0.0)).collect()
}

/// ω² (ascending) and M̂-orthonormal vectors of a small Hermitian pencil.
fn dense_modes(stiffness: MatRef<'_, c64>, mass: MatRef<'_, c64>, real: bool) -> Result<(Vec<f64>, Mat<c64>)> {
    let factor = Llt::new(mass, Side::Lower).map_err(|_| Error::NotPositiveDefinite {
        matrix: "M (reduced mass)".into(),
        remedy: "Remove contact nodes that coincide".into(),
    })?;
    let lower = factor.L();
    let mut half = stiffness.to_owned();
    solve_lower_triangular_in_place(lower, half.as_mut(), Par::Seq);
    let mut standard = half.adjoint().to_owned();
    solve_lower_triangular_in_place(lower, standard.as_mut(), Par::Seq);
    let scale = standard.norm_max();
    let symmetric = hermitian(standard.as_ref());
    let (values, mut vectors) = hermitian_eigen(symmetric.nrows(), real, |i, j| symmetric[(i, j)] / scale)?;
    solve_upper_triangular_in_place(lower.adjoint(), vectors.as_mut(), Par::Seq);
    Ok((values.into_iter().map(|value| scale * value).collect(), vectors))
}
