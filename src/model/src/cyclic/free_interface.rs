//! Free-interface modes of one nodal diameter with exact residual flexibility: [`crate::free_interface`] for coupled
//! sectors, including free ones.
//!
//! The constraint modes Ψ span the static responses K_n⁻¹B to contact forces; those of an unsupported disk include
//! its rigid-body motions. For the modes Φ with free contact, D = Φ − ΨΦ_c moves no contact and is K_n-orthogonal to
//! Ψ. It is the static response, with the contact held, to their inertia forces: K_hh D_h = (M_nΦ)_h Λ. For a
//! rigid-body motion Φ − ΨΦ_c vanishes, but K_hh⁻¹(M_nΦ)_h does not, and it is what the basis needs: a force on the
//! contact of a free disk accelerates it, and the response to force and inertia together, Pᴴ K_n⁺ P B with P = I −
//! M_nΦΦᴴ over the rigid-body motions (inertia relief), is then in the space.

use faer::{Mat, MatRef, Side, c64};

use super::lanczos::ComplexModes;
use super::operator::CyclicPencil;
use crate::free_interface::LEAST_RESIDUAL;
use crate::{Error, Result};

/// Fraction of the shift σ below which an ω² is that of a rigid-body motion.
const RIGID: f64 = 1e-5;

/// Motions with the contact held.
pub(super) struct Inner {
    /// ω² of the modes from which the motions were derived.
    pub squares: Vec<f64>,
    /// (interior, face) × modes.
    pub shapes: Mat<c64>,
    /// K̂ of these motions.
    pub stiffness: Mat<c64>,
}

/// Returns the part of the modes `found` of `full` that moves no contact.
///
/// # Errors
/// [`Error::Invalid`] for so many modes that no residual flexibility remains.
pub(super) fn free_interface(
    at_rest: &CyclicPencil<'_>,
    full: &CyclicPencil<'_>,
    static_stiffness: &Mat<c64>,
    found: &ComplexModes,
) -> Result<Inner> {
    let parts = at_rest.parts();
    let held = parts.order() - parts.contact;
    let seen = found.shapes.get(held.., ..);
    let floor = RIGID * full.condensed.shift.abs();
    let rigid = found.eigenvalues.iter().take_while(|square| **square < floor).count();
    check_residual(static_stiffness, &seen.get(.., rigid..).to_owned(), &found.eigenvalues[rigid..])?;
    let inertia = full.mass(found.shapes.as_ref());
    let mut shapes = at_rest.solve(inertia.get(..held, ..));
    let mass = full.mass(shapes.as_ref());
    for k in 0..shapes.ncols() {
        let norm = (shapes.col(k).adjoint() * mass.col(k)).re.sqrt();
        shapes.col_mut(k).iter_mut().for_each(|value| *value /= norm);
    }
    let stiffness = hermitian((shapes.adjoint() * at_rest.shifted(shapes.as_ref())).as_ref());
    Ok(Inner { squares: found.eigenvalues.clone(), shapes, stiffness })
}

/// Checks that K̂_cc⁻¹ minus the flexibility of the modes is positive definite relative to the total flexibility.
fn check_residual(static_stiffness: &Mat<c64>, seen: &Mat<c64>, squares: &[f64]) -> Result<()> {
    let scaled = Mat::from_fn(seen.nrows(), seen.ncols(), |i, k| seen[(i, k)] / squares[k].sqrt());
    let shares = hermitian((scaled.adjoint() * (static_stiffness * &scaled)).as_ref());
    let eigen = shares.self_adjoint_eigen(Side::Lower).map_err(|_| {
        Error::invalid("residual flexibility", "the eigenvalue problem did not converge", "Check the mesh and material")
    })?;
    let largest = (0..seen.ncols()).map(|k| eigen.S()[k].re).fold(0.0, f64::max);
    if largest <= 1.0 - LEAST_RESIDUAL {
        return Ok(());
    }
    let problem = format!("with {} modes, some static response has no residual flexibility", squares.len());
    Err(Error::invalid("number of modes", problem, "Request fewer modes or refine the mesh"))
}

/// Returns ½(A + Aᴴ).
pub(super) fn hermitian(matrix: MatRef<'_, c64>) -> Mat<c64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| (matrix[(i, j)] + matrix[(j, i)].conj()) * 0.5)
}
