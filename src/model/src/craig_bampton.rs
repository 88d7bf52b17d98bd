//! Craig-Bampton reduction of a general structure (Craig and Bampton, AIAA Journal 6(7), 1968).
//!
//! u = T z with z = (u_b, η): interface displacements as they are, fixed-interface modes Φ (K_ii Φ = M_ii Φ Ω²,
//! ΦᵀM_iiΦ = I) and constraint modes Ψ = -K_ii⁻¹ K_ib:
//! T = \[I 0; Ψ Φ\], K̂ = blkdiag(K_bb + K_bi Ψ, Ω²), M̂ = TᵀMT.

use faer::Mat;
use nalgebra::DMatrix;

use crate::eigen::{Modes, lowest_modes, positive_factor};
use crate::progress::{Listener, Stage, report};
use crate::sparse::{SparseMatrix, principal_pair};
use crate::{Error, Result};

/// A reduced pencil and the way back to the full one.
#[derive(Debug, Clone)]
pub struct CraigBampton {
    /// M̂, (interface + modes)², kg for the interface part.
    pub mass: DMatrix<f64>,
    /// K̂, (interface + modes)², N/m for the interface part.
    pub stiffness: DMatrix<f64>,
    /// T, full dofs × (interface + modes).
    pub transformation: Mat<f64>,
    /// Natural frequencies with the interface held (Hz).
    pub fixed_interface_frequencies: Vec<f64>,
}

/// Reduce (K, M) to the dofs `interface` (any order, kept) and `modes` fixed-interface modes.
///
/// # Errors
/// [`Error::Invalid`] when the interface is empty, repeats a dof or leaves fewer inner dofs than modes;
/// [`Error::NotPositiveDefinite`] when the structure can still move with the interface held.
pub fn craig_bampton(
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    interface: &[usize],
    modes: usize,
    listener: Listener<'_>,
) -> Result<CraigBampton> {
    let interior = interior_dofs(stiffness.order(), interface)?;
    if modes > interior.len() {
        return Err(Error::invalid(
            "number of fixed-interface modes",
            format!("{modes} asked, but only {} degrees of freedom are not interface", interior.len()),
            "Ask for fewer modes or refine the mesh",
        ));
    }
    let (inner_stiffness, inner_mass) = principal_pair(stiffness, mass, &interior);
    let factor = positive_factor(
        &inner_stiffness,
        &inner_mass,
        "K_ii (stiffness with the interface held)",
        "Clamp the structure, or choose at least three contact nodes that are not on one line",
    )?;
    let fixed = lowest_modes(&inner_mass, &factor, 0.0, modes, Stage::FixedInterfaceModes, listener)?;
    report(listener, Stage::ConstraintModes, 0, 1);
    let coupling = stiffness.block(&interior, interface);
    let mut constraint = factor.solve(coupling.clone());
    constraint *= faer::Scale(-1.0);
    let static_stiffness = stiffness.block(interface, interface) + coupling.transpose() * &constraint;
    let transformation = transformation(stiffness.order(), &interior, interface, &constraint, &fixed);
    let reduced_mass = transformation.transpose() * mass.times(transformation.as_ref());
    report(listener, Stage::ConstraintModes, 1, 1);
    Ok(CraigBampton {
        mass: symmetrised(reduced_mass.nrows(), |i, j| reduced_mass[(i, j)]),
        stiffness: reduced_stiffness(&static_stiffness, &fixed.eigenvalues),
        transformation,
        fixed_interface_frequencies: fixed.frequencies(),
    })
}

fn interior_dofs(order: usize, interface: &[usize]) -> Result<Vec<usize>> {
    let mut held = vec![false; order];
    for &dof in interface {
        if core::mem::replace(&mut held[dof], true) {
            let remedy = "Name every contact node once";
            return Err(Error::invalid("interface", format!("degree of freedom {dof} appears twice"), remedy));
        }
    }
    if interface.is_empty() {
        return Err(Error::invalid("interface", "it is empty", "Name at least one contact node"));
    }
    Ok((0..order).filter(|&dof| !held[dof]).collect())
}

fn transformation(
    order: usize,
    interior: &[usize],
    interface: &[usize],
    constraint: &Mat<f64>,
    fixed: &Modes,
) -> Mat<f64> {
    let boundary = interface.len();
    let mut matrix = Mat::zeros(order, boundary + fixed.eigenvalues.len());
    for (j, &dof) in interface.iter().enumerate() {
        matrix[(dof, j)] = 1.0;
    }
    for (i, &dof) in interior.iter().enumerate() {
        for j in 0..boundary {
            matrix[(dof, j)] = constraint[(i, j)];
        }
        for k in 0..fixed.eigenvalues.len() {
            matrix[(dof, boundary + k)] = fixed.shapes[(i, k)];
        }
    }
    matrix
}

fn reduced_stiffness(boundary: &Mat<f64>, squares: &[f64]) -> DMatrix<f64> {
    let size = boundary.nrows();
    let mut matrix = DMatrix::zeros(size + squares.len(), size + squares.len());
    matrix.view_mut((0, 0), (size, size)).copy_from(&symmetrised(size, |i, j| boundary[(i, j)]));
    for (k, &square) in squares.iter().enumerate() {
        matrix[(size + k, size + k)] = square;
    }
    matrix
}

fn symmetrised(order: usize, entry: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(order, order, |i, j| 0.5 * (entry(i, j) + entry(j, i)))
}

/// Eigenvalues ω² (ascending) and M̂-orthonormal vectors (columns) of a small dense pencil.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] when the mass matrix is not.
pub fn dense_modes(stiffness: &DMatrix<f64>, mass: &DMatrix<f64>) -> Result<(Vec<f64>, DMatrix<f64>)> {
    let cholesky = mass.clone().cholesky().ok_or_else(|| Error::NotPositiveDefinite {
        matrix: "M (reduced mass)".into(),
        remedy: "Remove contact nodes that coincide".into(),
    })?;
    let lower = cholesky.l();
    let singular = || Error::NotPositiveDefinite {
        matrix: "M (reduced mass)".into(),
        remedy: "Remove contact nodes that coincide".into(),
    };
    let half = lower.solve_lower_triangular(stiffness).ok_or_else(singular)?;
    let standard = lower.solve_lower_triangular(&half.transpose()).ok_or_else(singular)?;
    let eigen = (0.5 * (&standard + standard.transpose())).symmetric_eigen();
    let mut order: Vec<usize> = (0..stiffness.nrows()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let sorted = DMatrix::from_fn(order.len(), order.len(), |i, k| eigen.eigenvectors[(i, order[k])]);
    let vectors = lower.transpose().solve_upper_triangular(&sorted).ok_or_else(singular)?;
    Ok((order.iter().map(|&k| eigen.eigenvalues[k]).collect(), vectors))
}
