//! Reduction of one nodal diameter, with the small matrices that its checks need.
//!
//! T = [Ψ Φ] with the constraint modes Ψ of the contact and the fixed-interface modes Φ; K̂ = blkdiag(K̂_cc, Ω²), M̂ =
//! TᴴM_nT. For [free-interface modes](super::free_interface), Φ is replaced by the parts that move no contact; the
//! second block of K̂ is then full.
//!
//! Eq. 12 needs r = x - (ω² - σ) A_n⁻¹M_n x of x = Tz for every number of modes. Split A_n⁻¹M_nT = TX + F with F
//! orthogonal to T in A_n: then r = T(z - λXz) - λFz, λ = ω² - σ, and rᴴA_nr = dᴴÂd + λ² zᴴF̂z with d = z - λXz, Â =
//! TᴴA_nT and F̂ = FᴴA_nF. Both terms are squares, so nothing cancels, and omitting modes means omitting rows of z.

use faer::linalg::solvers::{Llt, Solve};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, MatRef, Par, Side, c64};

use super::free_interface::{Inner, free_interface, hermitian};
use super::lanczos::{ComplexModes, hermitian_eigen, lowest_modes};
use super::operator::CyclicPencil;
use crate::reduce::ReductionKind;
use crate::{Error, Result};

/// Reduced nodal diameter with all computed modes.
#[derive(Debug)]
pub(super) struct Component {
    /// True if all matrices are real.
    pub real: bool,
    /// Contact dofs.
    pub contact: usize,
    /// ω² of the computed modes: with the contact held, or of free-interface modes.
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
    kind: ReductionKind,
    /// T; empty once it has been taken.
    pub transformation: Mat<c64>,
}

/// Modes of one nodal diameter that are kept in a reduction.
pub(super) struct ComponentModes {
    /// M̂.
    pub mass: Mat<c64>,
    /// K̂ = blkdiag(K̂_cc, Ω²).
    pub stiffness: Mat<c64>,
    /// Ω² with the contact held.
    pub squares: Vec<f64>,
    /// Reduced coordinates in terms of the computed ones, unless they are the first of these.
    pub turn: Option<Mat<c64>>,
}

/// Quality of the lowest modes of a reduced nodal diameter.
#[derive(Debug, Clone)]
pub(super) struct ModeQuality {
    /// ω², ascending.
    pub squares: Vec<f64>,
    /// Eq. 12 (%).
    pub residual_criterion: Vec<f64>,
}

/// Modes to compute.
#[derive(Debug, Clone, Copy)]
pub(super) enum RequestedModes {
    Count(usize),
    /// All modes with ω² up to this value, and the next one.
    UpTo(f64),
}

impl Component {
    /// Reduces to fixed-interface modes. `at_rest` has no shift, `full` is the operator of the modes with free
    /// contact.
    ///
    /// # Errors
    /// The errors of [`lowest_modes`]; [`Error::NotPositiveDefinite`] if the reduced mass is not positive definite.
    pub(super) fn fixed_interface(
        at_rest: &CyclicPencil<'_>,
        full: &CyclicPencil<'_>,
        wanted: RequestedModes,
    ) -> Result<Self> {
        let parts = at_rest.parts();
        let ComplexModes { eigenvalues, shapes } = modes(at_rest, parts.order() - parts.contact, wanted)?;
        let mut stiffness = Mat::zeros(eigenvalues.len(), eigenvalues.len());
        eigenvalues.iter().enumerate().for_each(|(k, &square)| stiffness[(k, k)] = c64::new(square, 0.0));
        let inner = Inner { squares: eigenvalues, shapes, stiffness };
        Self::new((at_rest, full), at_rest.constraint_modes(), inner, ReductionKind::FixedInterface)
    }

    /// Reduces to modes with free contact, the modes `found` of `full`.
    ///
    /// # Errors
    /// The errors of [`free_interface`]; [`Error::NotPositiveDefinite`] if the reduced mass is not positive definite.
    pub(super) fn free_interface(
        at_rest: &CyclicPencil<'_>,
        full: &CyclicPencil<'_>,
        found: &ComplexModes,
    ) -> Result<Self> {
        let constraint = at_rest.constraint_modes();
        let inner = free_interface(at_rest, full, &constraint.1, found)?;
        Self::new((at_rest, full), constraint, inner, ReductionKind::FreeInterface)
    }

    fn new(
        (at_rest, full): (&CyclicPencil<'_>, &CyclicPencil<'_>),
        (constraint, static_stiffness): (Mat<c64>, Mat<c64>),
        basis: Inner,
        kind: ReductionKind,
    ) -> Result<Self> {
        let parts = at_rest.parts();
        let (held, contact, count) = (parts.order() - parts.contact, parts.contact, basis.squares.len());
        let mut transformation = Mat::zeros(parts.order(), contact + count);
        transformation.get_mut(.., ..contact).copy_from(&constraint);
        transformation.get_mut(..held, contact..).copy_from(&basis.shapes);
        let mass_transformation = full.mass(transformation.as_ref());
        let mass = hermitian((transformation.adjoint() * &mass_transformation).as_ref());
        let mut stiffness = Mat::zeros(contact + count, contact + count);
        stiffness.get_mut(..contact, ..contact).copy_from(&hermitian(static_stiffness.as_ref()));
        stiffness.get_mut(contact.., contact..).copy_from(&basis.stiffness);
        let shift = full.condensed.shift;
        let shifted = &stiffness - &mass * faer::Scale(c64::new(shift, 0.0));
        let factor = Llt::new(shifted.as_ref(), Side::Lower)
            .map_err(|_| super::operator::not_positive(full.nodal_diameter, false))?;
        let inner = factor.solve(&mass);
        let outside = full.solve(mass_transformation.as_ref()) - &transformation * &inner;
        let defect = hermitian((outside.adjoint() * full.shifted(outside.as_ref())).as_ref());
        let squares = basis.squares;
        let real = at_rest.real;
        Ok(Self { real, contact, squares, mass, stiffness, shift, inner, defect, kind, transformation })
    }

    /// Returns the reduced model with the first `modes` modes.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the reduced mass is not positive definite.
    pub(super) fn kept(&self, modes: usize) -> Result<ComponentModes> {
        let (contact, size) = (self.contact, self.contact + modes);
        let mut mass = self.mass.get(..size, ..size).to_owned();
        let mut stiffness = self.stiffness.get(..size, ..size).to_owned();
        if self.kind == ReductionKind::FixedInterface || modes == 0 {
            return Ok(ComponentModes { mass, stiffness, squares: self.squares[..modes].to_vec(), turn: None });
        }
        // The contact-free parts of free-interface modes are expressed in their own modes.
        let (squares, own) =
            dense_modes(stiffness.get(contact.., contact..), mass.get(contact.., contact..), self.real)?;
        let mut turn = Mat::identity(size, size);
        turn.get_mut(contact.., contact..).copy_from(&own);
        mass = hermitian((turn.adjoint() * mass * &turn).as_ref());
        stiffness.get_mut(contact.., contact..).fill(c64::new(0.0, 0.0));
        squares
            .iter()
            .enumerate()
            .for_each(|(k, &square)| stiffness[(contact + k, contact + k)] = c64::new(square, 0.0));
        Ok(ComponentModes { mass, stiffness, squares, turn: Some(turn) })
    }

    /// Returns the lowest `count` modes of the reduced model with the first `modes` fixed-interface modes, and their
    /// residuals.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the reduced mass is not positive definite.
    pub(super) fn quality(&self, modes: usize, count: usize) -> Result<ModeQuality> {
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
        Ok(ModeQuality { squares: squares[..count].to_vec(), residual_criterion })
    }
}

/// Computes modes of an operator over its first `order` rows: with free contact if these are all rows.
///
/// # Errors
/// The errors of [`lowest_modes`].
pub(super) fn modes(operator: &CyclicPencil<'_>, order: usize, wanted: RequestedModes) -> Result<ComplexModes> {
    match wanted {
        RequestedModes::Count(count) => lowest_modes(operator, order, count),
        RequestedModes::UpTo(square) => {
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

/// Returns xᴴAx of every column.
fn energies(matrix: &Mat<c64>, columns: MatRef<'_, c64>) -> Vec<f64> {
    let forces = matrix * columns;
    (0..columns.ncols()).map(|k| (columns.col(k).adjoint() * forces.col(k)).re.max(0.0)).collect()
}

/// Computes ω² (ascending) and M̂-orthonormal vectors of a small Hermitian pencil.
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
