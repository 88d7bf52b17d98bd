//! Modal form of a reduced pencil, M = I and K = Λ, without loss of its static response.
//!
//! The problem solved is M φ = µ K φ, whose largest eigenvalues µ = 1/ω² belong to the lowest modes: with K = LLᵀ and
//! the orthonormal vectors v of L⁻¹ML⁻ᵀ, φ = L⁻ᵀv/√µ, and the flexibility Σ φφᵀ/ω² = L⁻ᵀ(Σ vvᵀ)L⁻¹ is K⁻¹ to the
//! rounding of the triangular solves, even for soft modes beside stiff ones. Rigid-body modes are known beforehand:
//! they are given a stiffness and deprived of their mass, so that they are the eigenvectors of µ = 0, and are
//! restored unchanged, with ω = 0.

use nalgebra::DMatrix;

use crate::{Error, Result};

/// Modes of a reduced pencil.
#[derive(Debug, Clone)]
pub struct ModalForm {
    /// ω² (rad²/s²), ascending after the rigid-body modes, which come first and are exactly zero.
    pub squares: Vec<f64>,
    /// Mass-normalised modes in reduced coordinates, n × modes.
    pub shapes: DMatrix<f64>,
    /// Number of modes that are modes of the original pencil if the others only represent static responses.
    pub condensed_from: Option<usize>,
}

/// Computes the modes of the pencil; `rigid` holds the rigid-body motions in reduced coordinates, n × number of
/// motions, in any scale.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] if the mass is not positive definite, the rigid-body motions are not independent,
/// or the structure has more of them than given.
pub fn modal_form(stiffness: &DMatrix<f64>, mass: &DMatrix<f64>, rigid: &DMatrix<f64>) -> Result<ModalForm> {
    let (order, loose) = (stiffness.nrows(), rigid.ncols());
    let rigid = orthonormal(mass, rigid)?;
    let carried = mass * &rigid;
    let held = stiffness + (stiffness.trace() / mass.trace()) * &carried * carried.transpose();
    let elastic_mass = mass - &carried * carried.transpose();
    let lower = held.cholesky().ok_or_else(|| mechanism("K (reduced stiffness)"))?.l();
    let half = lower.solve_lower_triangular(&elastic_mass).ok_or_else(|| mechanism("K (reduced stiffness)"))?;
    let full = lower.solve_lower_triangular(&half.transpose()).ok_or_else(|| mechanism("K (reduced stiffness)"))?;
    let eigen = (0.5 * (&full + full.transpose())).symmetric_eigen();
    let mut sequence: Vec<usize> = (0..order).collect();
    sequence.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let elastic = &sequence[..order - loose];
    if elastic.iter().any(|&k| eigen.eigenvalues[k] <= 0.0) {
        return Err(mechanism("M (reduced mass)"));
    }
    let scaled = DMatrix::from_fn(order, elastic.len(), |i, k| {
        eigen.eigenvectors[(i, elastic[k])] / eigen.eigenvalues[elastic[k]].sqrt()
    });
    let shapes = lower.transpose().solve_upper_triangular(&scaled).ok_or_else(|| mechanism("K (reduced stiffness)"))?;
    let mut all = DMatrix::zeros(order, order);
    all.columns_mut(0, loose).copy_from(&rigid);
    all.columns_mut(loose, order - loose).copy_from(&shapes);
    let rigid_squares = core::iter::repeat_n(0.0, loose);
    let squares = rigid_squares.chain(elastic.iter().map(|&k| 1.0 / eigen.eigenvalues[k])).collect();
    Ok(ModalForm { squares, shapes: all, condensed_from: None })
}

/// Returns a basis of the same space whose columns are orthonormal with respect to the mass.
fn orthonormal(mass: &DMatrix<f64>, vectors: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let mut vectors = vectors.clone();
    // The second pass removes the errors that are caused by the conditioning of the first.
    for _pass in 0..2 {
        if vectors.ncols() == 0 {
            break;
        }
        let gram = vectors.transpose() * (mass * &vectors);
        let factor = gram.cholesky().ok_or_else(|| mechanism("M (mass of the rigid-body motions)"))?;
        let transposed = factor.l().solve_lower_triangular(&vectors.transpose());
        vectors = transposed.ok_or_else(|| mechanism("M (mass of the rigid-body motions)"))?.transpose();
    }
    Ok(vectors)
}

fn mechanism(matrix: &str) -> Error {
    Error::NotPositiveDefinite {
        matrix: matrix.into(),
        remedy:
            "Clamp the casing, or leave it completely free as one connected part whose contact nodes do not coincide"
                .into(),
    }
}
