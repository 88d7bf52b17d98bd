//! Craig-Bampton reduction of a general structure (Craig and Bampton, AIAA Journal 6(7), 1968).
//!
//! u = T z with z = (u_b, η): interface displacements, fixed-interface modes Φ (K_ii Φ = M_ii Φ Ω², ΦᵀM_iiΦ = I) and
//! constraint modes Ψ = -K_ii⁻¹ K_ib: T = \[I 0; Ψ Φ\], K̂ = blkdiag(K_bb + K_bi Ψ, Ω²), M̂ = TᵀMT.
//!
//! The static response to interface forces is exact. For loads on the interior it is exact if the static responses of
//! the interior to them, K_ii⁻¹ f_i, are added to Φ: residual vectors (Dickens, Nakagawa, Wittbrodt, Computers &
//! Structures 62(6), 1997). The space of both is then expressed in its own modes, so that K̂ keeps its form.

use faer::{Mat, MatRef, Side};
use nalgebra::DMatrix;

use crate::eigen::{EigenModes, lowest_modes, positive_factor};
use crate::progress::{Listener, ReductionStage, report};
use crate::sparse::{Factor, SparseMatrix, add_tall, principal_pair, tall_product};
use crate::{Error, Result};

/// Reduced pencil with the transformation to the full one.
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

/// Reduces (K, M) to the dofs `interface` (any order, kept) and `modes` fixed-interface modes.
///
/// # Errors
/// [`Error::Invalid`] if the interface is empty, repeats a dof or there are fewer inner dofs than modes;
/// [`Error::NotPositiveDefinite`] if the structure can still move with the interface held.
pub fn craig_bampton(
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    interface: &[usize],
    modes: usize,
    listener: Listener<'_>,
) -> Result<CraigBampton> {
    let inner = InnerBasis { modes, whole_pairs: false, loads: None };
    craig_bampton_with(stiffness, mass, interface, &inner, listener)
}

/// Choice of the basis of the interior with the interface held.
#[derive(Debug, Clone, Copy)]
pub struct InnerBasis<'a> {
    /// Number of fixed-interface modes.
    pub modes: usize,
    /// True to keep one mode less if the last would be half of a double mode, which would split the double modes of
    /// the reduced model.
    pub whole_pairs: bool,
    /// Loads, full dofs × loads (N), whose static responses, and all combinations of them, the reduced model
    /// reproduces exactly.
    pub loads: Option<MatRef<'a, f64>>,
}

/// Reduces (K, M) as [`craig_bampton`] does, with the given basis of the interior. A load whose static response is
/// already in the basis adds nothing.
///
/// # Errors
/// The errors of [`craig_bampton`].
pub fn craig_bampton_with(
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    interface: &[usize],
    inner: &InnerBasis<'_>,
    listener: Listener<'_>,
) -> Result<CraigBampton> {
    let modes = inner.modes;
    let interior = interior_dofs(stiffness.order(), interface)?;
    if modes > interior.len() {
        return Err(Error::invalid(
            "number of fixed-interface modes",
            format!("{modes} requested, but there are only {} interior degrees of freedom", interior.len()),
            "Request fewer modes or refine the mesh",
        ));
    }
    let (inner_stiffness, inner_mass) = principal_pair(stiffness, mass, &interior);
    let factor = positive_factor(
        &inner_stiffness,
        &inner_mass,
        "K_ii (stiffness with the interface fixed)",
        "Clamp the structure, or choose at least three contact nodes that are not on one line",
    )?;
    let searched = if inner.whole_pairs { (modes + 1).min(interior.len()) } else { modes };
    let fixed = lowest_modes(&inner_mass, &factor, 0.0, searched, ReductionStage::FixedInterfaceModes, listener)?;
    let fixed = lowest_of(fixed, modes);
    let fixed_interface_frequencies = fixed.frequencies();
    let inner = match inner.loads {
        Some(loads) if loads.ncols() > 0 => {
            let responses = factor.solve(Mat::from_fn(interior.len(), loads.ncols(), |i, j| loads[(interior[i], j)]));
            with_static_responses(fixed, &inner_stiffness, &inner_mass, &responses)?
        }
        _ => fixed,
    };
    let mut transformation = Mat::zeros(stiffness.order(), interface.len() + inner.eigenvalues.len());
    for (k, mut column) in transformation.as_mut().col_iter_mut().skip(interface.len()).enumerate() {
        interior.iter().zip(inner.shapes.col(k).iter()).for_each(|(&dof, shape)| column[dof] = *shape);
    }
    let eigenvalues = inner.eigenvalues;
    // The transformation now contains the shapes.
    drop(inner.shapes);
    let static_stiffness = constraint_modes(stiffness, &factor, &interior, interface, &mut transformation, listener);
    drop(factor);
    let reduced_mass = projected(mass, &transformation);
    report(listener, ReductionStage::ConstraintModes, 1, 1);
    Ok(CraigBampton {
        mass: symmetrised(reduced_mass.nrows(), |i, j| reduced_mass[(i, j)]),
        stiffness: reduced_stiffness(&static_stiffness, &eigenvalues),
        transformation,
        fixed_interface_frequencies,
    })
}

/// Number of columns that are processed together, which bounds the memory beyond that of the transformation.
const COLUMNS: usize = 64;

/// Writes the constraint modes, and the unit displacements of the interface, into the first columns of the
/// transformation; returns K_bb + K_bi Ψ.
fn constraint_modes(
    stiffness: &SparseMatrix,
    factor: &Factor,
    interior: &[usize],
    interface: &[usize],
    transformation: &mut Mat<f64>,
    listener: Listener<'_>,
) -> Mat<f64> {
    let mut static_stiffness = Mat::zeros(interface.len(), interface.len());
    for (chunk, part) in interface.chunks(COLUMNS).enumerate() {
        let first = chunk * COLUMNS;
        report(listener, ReductionStage::ConstraintModes, first, interface.len());
        let constraint = factor.solve(stiffness.block(interior, part));
        let mut columns = transformation.get_mut(.., first..first + part.len());
        for (j, &dof) in part.iter().enumerate() {
            columns[(dof, j)] = 1.0;
            interior.iter().zip(constraint.col(j).iter()).for_each(|(&dof, value)| columns[(dof, j)] = -value);
        }
        let forces = stiffness.times(columns.as_ref());
        for j in 0..part.len() {
            for (i, &dof) in interface.iter().enumerate() {
                static_stiffness[(i, first + j)] = forces[(dof, j)];
            }
        }
    }
    static_stiffness
}

/// Returns TᵀAT.
pub(crate) fn projected(matrix: &SparseMatrix, transformation: &Mat<f64>) -> Mat<f64> {
    let size = transformation.ncols();
    let mut product = Mat::zeros(size, size);
    for first in (0..size).step_by(COLUMNS) {
        let columns = first..(first + COLUMNS).min(size);
        let part = matrix.times(transformation.get(.., columns.clone()));
        product.get_mut(.., columns).copy_from(tall_product(transformation.as_ref(), part.as_ref()));
    }
    product
}

/// Relative difference of ω² below which two modes form a double mode.
const DOUBLE: f64 = 1e-6;

/// Returns the lowest `count` modes, or one fewer if the next mode forms a double mode with the last.
fn lowest_of(modes: EigenModes, count: usize) -> EigenModes {
    let squares = &modes.eigenvalues;
    if squares.len() <= count {
        return modes;
    }
    let kept =
        if count > 0 && squares[count] - squares[count - 1] < DOUBLE * squares[count] { count - 1 } else { count };
    EigenModes {
        eigenvalues: squares[..kept].to_vec(),
        shapes: modes.shapes.get(.., ..kept).to_owned(),
        residuals: modes.residuals[..kept].to_vec(),
    }
}

/// A static response whose remainder without the modes is below this fraction of its size is round-off.
const DEPENDENT: f64 = 1e-10;

/// Expresses the space of modes and static responses in its own modes.
pub(crate) fn with_static_responses(
    fixed: EigenModes,
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    responses: &Mat<f64>,
) -> Result<EigenModes> {
    let mut basis = fixed.shapes.clone();
    for j in 0..responses.ncols() {
        if let Some(column) = independent_part(&basis, mass, responses.get(.., j..j + 1).to_owned()) {
            let size = basis.ncols();
            basis.resize_with(column.nrows(), size + 1, |i, _| column[(i, 0)]);
        }
    }
    if basis.ncols() == fixed.shapes.ncols() {
        return Ok(fixed);
    }
    // The basis is M-orthonormal, so that its modes follow from the projected stiffness alone.
    let projected = projected(stiffness, &basis);
    let size = projected.nrows();
    let scale = projected.norm_max();
    let symmetric = Mat::from_fn(size, size, |i, j| 0.5 * (projected[(i, j)] + projected[(j, i)]) / scale);
    let eigen = symmetric.self_adjoint_eigen(Side::Lower).map_err(|_| {
        Error::invalid("static responses", "the eigenvalue problem did not converge", "Check the loads and material")
    })?;
    let eigenvalues = (0..size).map(|k| scale * eigen.S()[k]).collect();
    let mut shapes = Mat::zeros(basis.nrows(), size);
    add_tall(shapes.as_mut(), 1.0, basis.as_ref(), eigen.U());
    Ok(EigenModes { eigenvalues, shapes, residuals: fixed.residuals })
}

/// Returns `column` without its part in the M-orthonormal `basis`, scaled to unit mass; `None` if nothing remains.
fn independent_part(basis: &Mat<f64>, mass: &SparseMatrix, mut column: Mat<f64>) -> Option<Mat<f64>> {
    let norm =
        |column: &Mat<f64>, mass_column: &Mat<f64>| (column.col(0).transpose() * mass_column.col(0)).max(0.0).sqrt();
    let mut mass_column = mass.times(column.as_ref());
    let first = norm(&column, &mass_column);
    let mut before = first;
    // Repeated until a pass changes nothing, as in the Lanczos iteration.
    for _pass in 0..6 {
        let part = tall_product(basis.as_ref(), mass_column.as_ref());
        add_tall(column.as_mut(), -1.0, basis.as_ref(), part.as_ref());
        mass_column = mass.times(column.as_ref());
        let after = norm(&column, &mass_column);
        // `<=`, so that a load of zeros is omitted, too.
        if after <= DEPENDENT * first {
            return None;
        }
        if after > 0.5 * before {
            return Some(column * faer::Scale(1.0 / after));
        }
        before = after;
    }
    None
}

fn interior_dofs(order: usize, interface: &[usize]) -> Result<Vec<usize>> {
    let mut held = vec![false; order];
    for &dof in interface {
        if core::mem::replace(&mut held[dof], true) {
            let remedy = "List every contact node only once";
            return Err(Error::invalid("interface", format!("degree of freedom {dof} appears twice"), remedy));
        }
    }
    if interface.is_empty() {
        return Err(Error::invalid("interface", "it is empty", "Give at least one contact node"));
    }
    Ok((0..order).filter(|&dof| !held[dof]).collect())
}

pub(crate) fn reduced_stiffness(boundary: &Mat<f64>, squares: &[f64]) -> DMatrix<f64> {
    let size = boundary.nrows();
    let mut matrix = DMatrix::zeros(size + squares.len(), size + squares.len());
    matrix.view_mut((0, 0), (size, size)).copy_from(&symmetrised(size, |i, j| boundary[(i, j)]));
    for (k, &square) in squares.iter().enumerate() {
        matrix[(size + k, size + k)] = square;
    }
    matrix
}

pub(crate) fn symmetrised(order: usize, entry: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    DMatrix::from_fn(order, order, |i, j| 0.5 * (entry(i, j) + entry(j, i)))
}

/// Computes the eigenvalues ω² (ascending) and M̂-orthonormal vectors (columns) of a small dense pencil.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] if the mass matrix is not positive definite.
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
