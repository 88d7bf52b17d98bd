//! Lowest modes of K φ = ω² M φ by block Lanczos on the shift-inverted pencil.
//!
//! The operator A = (K - σM)⁻¹ M is symmetric in the M inner product; its largest eigenvalues θ = 1/(ω² - σ) belong to
//! the lowest modes. The basis is kept M-orthonormal by two passes of block Gram-Schmidt against all of it (Grimes,
//! Lewis, Simon, SIAM J. Matrix Anal. Appl. 1994, with full instead of partial reorthogonalisation), so that no
//! spurious copies appear.

use faer::{Mat, MatRef, Side};

use crate::progress::{Listener, Stage, report};
use crate::sparse::{Factor, SparseMatrix};
use crate::{Error, Result};

/// Relative accuracy of the returned pairs: ‖Aφ - θφ‖_M ≤ `TOLERANCE` θ, which bounds the relative error of ω² - σ.
pub const TOLERANCE: f64 = 1e-10;
/// The explicitly formed residual is allowed this much, since it also contains the solve's round-off.
const CHECKED_TOLERANCE: f64 = 1e-8;
const BLOCK: usize = 6;

/// Modes of a pencil.
#[derive(Debug, Clone)]
pub struct Modes {
    /// ω² (rad²/s²), ascending.
    pub eigenvalues: Vec<f64>,
    /// M-orthonormal shapes, n × modes (1/√kg).
    pub shapes: Mat<f64>,
    /// ‖Aφ - θφ‖_M / θ of each pair, formed explicitly.
    pub residuals: Vec<f64>,
}

impl Modes {
    /// Natural frequencies (Hz); 0 where round-off made ω² negative.
    pub fn frequencies(&self) -> Vec<f64> {
        self.eigenvalues.iter().map(|square| square.max(0.0).sqrt() / core::f64::consts::TAU).collect()
    }
}

/// A growing M-orthonormal basis Q with M Q beside it.
struct Basis {
    vectors: Mat<f64>,
    mass_vectors: Mat<f64>,
    size: usize,
}

impl Basis {
    fn new(order: usize, capacity: usize) -> Self {
        Self { vectors: Mat::zeros(order, capacity), mass_vectors: Mat::zeros(order, capacity), size: 0 }
    }

    fn used(&self) -> MatRef<'_, f64> {
        self.vectors.get(.., ..self.size)
    }

    fn used_mass(&self) -> MatRef<'_, f64> {
        self.mass_vectors.get(.., ..self.size)
    }

    /// Remove the basis from `block` and `mass_block` = M·block; returns the coefficients QᵀM·block.
    fn project_out(&self, block: &mut Mat<f64>, mass_block: &mut Mat<f64>) -> Mat<f64> {
        let mut coefficients = Mat::zeros(self.size, block.ncols());
        for _pass in 0..2 {
            let part = self.used_mass().transpose() * &*block;
            *block -= self.used() * &part;
            *mass_block -= self.used_mass() * &part;
            coefficients += part;
        }
        coefficients
    }

    /// Orthonormalise `block` within itself and append it; returns R of block = Q_new R (rows: new vectors).
    /// Columns that depend on the others are left out.
    fn append(&mut self, block: &mut Mat<f64>, mass_block: &mut Mat<f64>, scale: f64) -> Mat<f64> {
        let (first, width) = (self.size, block.ncols());
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for j in 0..width {
            if self.size == self.vectors.ncols() {
                break;
            }
            let mut row = vec![0.0; width];
            // Once against the new vectors, and once more against the whole basis to wipe out cancellation.
            for from in [first, 0] {
                let size = self.size;
                let (q, mq) = (self.vectors.get(.., from..size), self.mass_vectors.get(.., from..size));
                let h = mq.transpose() * block.col(j);
                let (change, mass_change) = (q * &h, mq * &h);
                let mut column = block.col_mut(j);
                column -= change;
                let mut mass_column = mass_block.col_mut(j);
                mass_column -= mass_change;
                for (i, existing) in rows.iter_mut().enumerate() {
                    existing[j] += h[first - from + i];
                }
            }
            let norm = (block.col(j).transpose() * mass_block.col(j)).max(0.0).sqrt();
            if norm <= 1e-12 * scale {
                continue;
            }
            row[j] = norm;
            for i in 0..block.nrows() {
                self.vectors[(i, self.size)] = block[(i, j)] / norm;
                self.mass_vectors[(i, self.size)] = mass_block[(i, j)] / norm;
            }
            self.size += 1;
            rows.push(row);
        }
        Mat::from_fn(rows.len(), width, |i, j| rows[i][j])
    }
}

/// The `count` lowest modes of the pencil.
///
/// `shift` σ must lie below the lowest eigenvalue (0 for a supported structure, negative for a free one), and
/// `factor` be that of K - σM.
///
/// # Errors
/// [`Error::Invalid`] when more modes are asked for than there are dofs, [`Error::NotConverged`].
pub fn lowest_modes(
    mass: &SparseMatrix,
    factor: &Factor,
    shift: f64,
    count: usize,
    stage: Stage,
    listener: Listener<'_>,
) -> Result<Modes> {
    let order = mass.order();
    if count > order {
        return Err(Error::invalid(
            "number of modes",
            format!("{count} modes asked of {order} free degrees of freedom"),
            "Ask for fewer modes or refine the mesh",
        ));
    }
    if count == 0 {
        return Ok(Modes { eigenvalues: Vec::new(), shapes: Mat::zeros(order, 0), residuals: Vec::new() });
    }
    let capacity = (6 * count + 20 * BLOCK).min(order);
    let mut basis = Basis::new(order, capacity);
    let mut projected = Mat::<f64>::zeros(capacity, capacity);
    let mut seed = 0;
    // A first application of the operator makes the random start rich in low modes.
    let mut block = factor.solve(mass.times(random_block(order, BLOCK.min(order), &mut seed).as_ref()).clone());
    let mut mass_block = mass.times(block.as_ref());
    let scale = largest_norm(&block, &mass_block);
    let mut start = 0;
    basis.append(&mut block, &mut mass_block, scale);
    loop {
        let end = basis.size;
        let mut next = factor.solve(basis.mass_vectors.get(.., start..end).to_owned());
        let mut mass_next = mass.times(next.as_ref());
        let scale = largest_norm(&next, &mass_next);
        let coefficients = basis.project_out(&mut next, &mut mass_next);
        projected.get_mut(..end, start..end).copy_from(&coefficients);
        let mut coupling = basis.append(&mut next, &mut mass_next, scale);
        if basis.size == end && end < capacity {
            // An invariant subspace: continue with directions it does not contain.
            let mut fresh = random_block(order, BLOCK, &mut seed);
            let mut mass_fresh = mass.times(fresh.as_ref());
            let scale = largest_norm(&fresh, &mass_fresh);
            basis.project_out(&mut fresh, &mut mass_fresh);
            basis.append(&mut fresh, &mut mass_fresh, scale);
            coupling = Mat::zeros(0, end - start);
        }
        let exhausted = basis.size == end;
        if end >= count && (exhausted || end >= count + BLOCK) {
            let ritz = ritz_pairs(projected.get(..end, ..end), coupling.as_ref(), count, order == end)?;
            let converged = ritz.bounds.iter().filter(|&&bound| bound <= TOLERANCE).count();
            report(listener, stage, converged, count);
            if converged == count {
                let shapes = basis.vectors.get(.., ..end) * &ritz.vectors;
                return checked(mass, factor, shift, &ritz.values, shapes);
            }
            if exhausted {
                return Err(Error::NotConverged { wanted: count, converged, basis: end, tolerance: TOLERANCE });
            }
        }
        start = end;
    }
}

struct Ritz {
    values: Vec<f64>,
    vectors: Mat<f64>,
    bounds: Vec<f64>,
}

/// Largest eigenpairs of the projected operator, with residual bounds ‖R s_last‖ / θ.
fn ritz_pairs(projected: MatRef<'_, f64>, coupling: MatRef<'_, f64>, count: usize, complete: bool) -> Result<Ritz> {
    let size = projected.nrows();
    let symmetric = Mat::from_fn(size, size, |i, j| {
        // The block columns are filled from the left, so the entry of the later column is the complete one.
        if i <= j { projected[(i, j)] } else { projected[(j, i)] }
    });
    let eigen = symmetric.self_adjoint_eigen(Side::Lower).map_err(|_| {
        Error::invalid("projected eigenvalue problem", "it did not converge", "Check the mesh and the material")
    })?;
    let order: Vec<usize> = (0..count).map(|k| size - 1 - k).collect();
    let vectors = Mat::from_fn(size, count, |i, k| eigen.U()[(i, order[k])]);
    let values: Vec<f64> = order.iter().map(|&k| eigen.S()[k]).collect();
    let last = vectors.get(size - coupling.ncols().., ..);
    let residuals = coupling * last;
    let bounds =
        (0..count).map(|k| if complete { 0.0 } else { residuals.col(k).norm_l2() / values[k].abs() }).collect();
    Ok(Ritz { values, vectors, bounds })
}

/// Form the residual of every pair explicitly and refuse what does not hold.
fn checked(mass: &SparseMatrix, factor: &Factor, shift: f64, thetas: &[f64], shapes: Mat<f64>) -> Result<Modes> {
    let mut residual = factor.solve(mass.times(shapes.as_ref()));
    for (k, theta) in thetas.iter().enumerate() {
        for i in 0..shapes.nrows() {
            residual[(i, k)] -= theta * shapes[(i, k)];
        }
    }
    let mass_residual = mass.times(residual.as_ref());
    let norm = |k: usize| (residual.col(k).transpose() * mass_residual.col(k)).max(0.0).sqrt();
    let residuals: Vec<f64> = thetas.iter().enumerate().map(|(k, theta)| norm(k) / theta.abs()).collect();
    // NaN must count as failure, hence the comparison's direction.
    let converged = residuals.iter().filter(|&&residual| residual <= CHECKED_TOLERANCE).count();
    if converged < thetas.len() {
        let (wanted, basis) = (thetas.len(), shapes.ncols());
        return Err(Error::NotConverged { wanted, converged, basis, tolerance: CHECKED_TOLERANCE });
    }
    let eigenvalues = thetas.iter().map(|theta| shift + 1.0 / theta).collect();
    Ok(Modes { eigenvalues, shapes, residuals })
}

fn largest_norm(block: &Mat<f64>, mass_block: &Mat<f64>) -> f64 {
    (0..block.ncols()).map(|j| (block.col(j).transpose() * mass_block.col(j)).max(0.0).sqrt()).fold(0.0, f64::max)
}

/// Entries in [-1, 1) of a fixed sequence (splitmix64), so that results repeat from run to run.
fn random_block(rows: usize, columns: usize, seed: &mut u64) -> Mat<f64> {
    Mat::from_fn(rows, columns, |_, _| {
        *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = *seed;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    })
}
