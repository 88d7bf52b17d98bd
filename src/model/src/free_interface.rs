//! Reduction of a supported structure with free-interface modes and exact residual flexibility (R. H. MacNeal, Computers &
//! Structures 1, 1971; S. Rubin, AIAA Journal 13(8), 1975).
//!
//! The basis consists of the lowest modes Φ of the structure as it is supported and its static responses K⁻¹B to unit
//! forces on the contact coordinates u_c = Bᵀu. The static response to contact forces is exact for any number of
//! modes, and forced responses converge faster than with modes of the held interface, since Φ needs no correction for
//! the interface. If the highest modes of the reduced model, as many as contact coordinates, are quasi-static
//! (`massless-boundary`), this is MacNeal's model; with their mass, it is Rubin's.
//!
//! The reduced coordinates are those of Craig and Bampton: C = K⁻¹B(BᵀK⁻¹B)⁻¹ moves one contact coordinate by one and
//! no other, and is K-orthogonal to everything that moves none. The remainder of the modes, D = Φ − C BᵀΦ, moves
//! none. Its modes under K and M replace the fixed-interface modes, so that M̂, K̂ and T keep their form.

use faer::{Mat, MatRef};
use nalgebra::DMatrix;

use crate::craig_bampton::{CraigBampton, dense_modes, projected, reduced_stiffness, symmetrised};
use crate::eigen::{lowest_modes, positive_factor};
use crate::progress::{Listener, ReductionStage, report};
use crate::sparse::{SparseMatrix, add_tall, tall_product};
use crate::{Error, Result};

/// Smallest fraction of the flexibility, in any direction, that the static responses must add to the modes: below it
/// both describe the same motion, and only rounding distinguishes them.
pub(crate) const LEAST_RESIDUAL: f64 = 1e-6;

/// Reduces (K, M) to the contact coordinates Bᵀu, with `contact` as B (full dofs × contact coordinates), and `modes`
/// modes of the supported structure.
///
/// # Errors
/// [`Error::Invalid`] for more modes than degrees of freedom besides the contact coordinates, and for so many that no
/// residual flexibility remains; [`Error::NotPositiveDefinite`] for an unsupported structure or contact coordinates
/// that depend on each other.
pub fn free_interface(
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    contact: MatRef<'_, f64>,
    modes: usize,
    listener: Listener<'_>,
) -> Result<CraigBampton> {
    let (order, boundary) = (stiffness.order(), contact.ncols());
    if boundary == 0 {
        return Err(Error::invalid("contact nodes", "none given", "Give at least one contact node or patch"));
    }
    if modes + boundary > order {
        return Err(Error::invalid(
            "number of modes",
            format!(
                "{modes} requested, but only {} are possible besides {boundary} contact coordinates",
                order.saturating_sub(boundary)
            ),
            "Request fewer modes or refine the mesh",
        ));
    }
    let factor = positive_factor(
        stiffness,
        mass,
        "K (stiffness of the supported structure)",
        "Clamp at least three nodes that are not on one line, to prevent rigid-body motion",
    )?;
    let found = lowest_modes(mass, &factor, 0.0, modes, ReductionStage::FullModes, listener)?;
    report(listener, ReductionStage::ConstraintModes, 0, 1);
    let responses = factor.solve(contact.to_owned());
    drop(factor);
    let flexibility = dense(&tall_product(contact, responses.as_ref()));
    let seen = dense(&tall_product(contact, found.shapes.as_ref()));
    check_residual(&flexibility, &seen, &found.eigenvalues)?;
    let stiff = flexibility.cholesky().map(|factor| factor.inverse()).ok_or_else(dependent)?;
    // C, then D = Φ − C BᵀΦ.
    let mut transformation = Mat::zeros(order, boundary + modes);
    add_tall(transformation.get_mut(.., ..boundary), 1.0, responses.as_ref(), faer_form(&stiff).as_ref());
    let constraint = transformation.get(.., ..boundary).to_owned();
    let mut left = found.shapes.clone();
    add_tall(left.as_mut(), -1.0, constraint.as_ref(), faer_form(&seen).as_ref());
    // DᵀKD = Λ − (BᵀΦ)ᵀ(BᵀK⁻¹B)⁻¹BᵀΦ: constraint modes are K-orthogonal to D.
    let mut inner_stiffness = -(seen.transpose() * &stiff * &seen);
    for (mode, square) in found.eigenvalues.iter().enumerate() {
        inner_stiffness[(mode, mode)] += square;
    }
    let (squares, turn) = match modes {
        0 => (Vec::new(), DMatrix::zeros(0, 0)),
        _ => dense_modes(&symmetric(&inner_stiffness), &symmetric(&dense(&projected(mass, &left))))?,
    };
    add_tall(transformation.get_mut(.., boundary..), 1.0, left.as_ref(), faer_form(&turn).as_ref());
    let reduced_mass = projected(mass, &transformation);
    report(listener, ReductionStage::ConstraintModes, 1, 1);
    Ok(CraigBampton {
        mass: symmetrised(reduced_mass.nrows(), |i, j| reduced_mass[(i, j)]),
        stiffness: reduced_stiffness(&faer_form(&stiff), &squares),
        transformation,
        fixed_interface_frequencies: squares
            .iter()
            .map(|square| square.max(0.0).sqrt() / std::f64::consts::TAU)
            .collect(),
    })
}

/// Checks that the residual flexibility BᵀK⁻¹B − BᵀΦΛ⁻¹ΦᵀB is positive definite relative to the total flexibility.
fn check_residual(flexibility: &DMatrix<f64>, seen: &DMatrix<f64>, squares: &[f64]) -> Result<()> {
    let lower = flexibility.clone().cholesky().ok_or_else(dependent)?.l();
    if squares.is_empty() {
        return Ok(());
    }
    let scaled = DMatrix::from_fn(seen.nrows(), squares.len(), |i, k| seen[(i, k)] / squares[k].sqrt());
    let share = lower
        .solve_lower_triangular(&scaled)
        .map_or(1.0, |part| (&part * part.transpose()).symmetric_eigenvalues().iter().copied().fold(0.0, f64::max));
    if share <= 1.0 - LEAST_RESIDUAL {
        return Ok(());
    }
    let problem = format!("with {} modes, some static response has no residual flexibility", squares.len());
    Err(Error::invalid("number of modes", problem, "Request fewer modes or refine the mesh"))
}

fn dependent() -> Error {
    Error::NotPositiveDefinite {
        matrix: "flexibility of the contact coordinates".into(),
        remedy: "Remove contact nodes or patches that coincide".into(),
    }
}

fn dense(matrix: &Mat<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
}

fn faer_form(matrix: &DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
}

fn symmetric(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (matrix + matrix.transpose())
}
