//! Lowest modes of K φ = ω² M φ by block Lanczos on the shift-inverted pencil.
//!
//! The operator A = (K - σM)⁻¹ M is symmetric in the M inner product; its largest eigenvalues θ = 1/(ω² - σ) belong
//! to the lowest modes. The basis is kept M-orthonormal by two passes of block Gram-Schmidt against all its vectors
//! (Grimes, Lewis, Simon, SIAM J. Matrix Anal. Appl. 1994, with full instead of partial reorthogonalisation), so that
//! no spurious copies appear.

use faer::{Mat, MatRef, Side};

use crate::progress::{Listener, ReductionStage, report};
use crate::sparse::{Factor, SparseMatrix, add_tall, tall_product};
use crate::{Error, Result};

/// Relative accuracy of the returned pairs: ‖Aφ - θφ‖_M ≤ `TOLERANCE` θ, which bounds the relative error of ω² - σ.
pub(crate) const TOLERANCE: f64 = 1e-10;
/// Largest accepted residual; it includes the round-off of the solution.
const CHECKED_TOLERANCE: f64 = 1e-8;
/// Fraction of the largest norm of a block below which the remainder of a vector depends on the basis.
const DEPENDENT: f64 = 1e-13;
/// Fraction of its norm below which a column is projected against the whole basis again after the projection in its
/// block.
const CANCELLED: f64 = 1e-2;
const BLOCK: usize = 8;
/// Number of vectors of the basis that are stored together.
const PART: usize = 64;
/// Convergence is checked again when the basis has grown by its size divided by this number, since a check solves a
/// dense eigenvalue problem.
const LOOK: usize = 12;
/// Number of modes whose residuals are formed together.
const CHECKED_TOGETHER: usize = 64;
/// Fraction of tr K / tr M below which an ω² is round-off of a rigid-body motion.
const MECHANISM: f64 = 1e-14;

/// Modes of a pencil.
#[derive(Debug, Clone)]
pub struct EigenModes {
    /// ω² (rad²/s²), ascending.
    pub eigenvalues: Vec<f64>,
    /// M-orthonormal shapes, n × modes (1/√kg).
    pub shapes: Mat<f64>,
    /// ‖Aφ - θφ‖_M / θ of each pair, formed explicitly.
    pub residuals: Vec<f64>,
}

impl EigenModes {
    /// Returns the first `count` modes, or all if there are fewer.
    pub(crate) fn lowest(&self, count: usize) -> Self {
        let count = count.min(self.eigenvalues.len());
        Self {
            eigenvalues: self.eigenvalues[..count].to_vec(),
            shapes: self.shapes.get(.., ..count).to_owned(),
            residuals: self.residuals[..count].to_vec(),
        }
    }

    /// Returns the natural frequencies (Hz); 0 if round-off made ω² negative.
    pub fn frequencies(&self) -> Vec<f64> {
        self.eigenvalues.iter().map(|square| square.max(0.0).sqrt() / core::f64::consts::TAU).collect()
    }
}

/// Growing M-orthonormal basis Q.
///
/// The basis is stored in parts, so that it grows without being copied. M Q is not stored: recomputing it costs less
/// than the memory.
struct KrylovBasis<'a> {
    mass: &'a SparseMatrix,
    parts: Vec<Mat<f64>>,
    size: usize,
    /// Largest size of the basis.
    capacity: usize,
}

impl<'a> KrylovBasis<'a> {
    fn new(mass: &'a SparseMatrix, capacity: usize) -> Self {
        Self { mass, parts: Vec::new(), size: 0, capacity }
    }

    fn push(&mut self, column: &Mat<f64>, norm: f64) {
        let place = self.size % PART;
        if place == 0 {
            self.parts.push(Mat::zeros(column.nrows(), PART.min(self.capacity - self.size)));
        }
        let target = self.parts[self.size / PART].col_mut(place);
        target.iter_mut().zip(column.col(0).iter()).for_each(|(target, value)| *target = value / norm);
        self.size += 1;
    }

    /// Iterates over the vectors from `first` on, part by part, each with its number.
    fn from(&self, first: usize) -> impl Iterator<Item = (usize, MatRef<'_, f64>)> {
        self.parts.iter().enumerate().filter_map(move |(index, part)| {
            let start = first.max(index * PART);
            let end = self.size.min((index + 1) * PART);
            (start < end).then(|| (start, part.get(.., start - index * PART..end - index * PART)))
        })
    }

    /// Returns the vectors from `first` on.
    fn block(&self, first: usize) -> Mat<f64> {
        Mat::from_fn(self.mass.order(), self.size - first, |i, j| {
            self.parts[(first + j) / PART][(i, (first + j) % PART)]
        })
    }

    /// Returns Q C of the first vectors.
    fn combined(&self, coefficients: MatRef<'_, f64>) -> Mat<f64> {
        let mut sum = Mat::zeros(self.mass.order(), coefficients.ncols());
        for (start, part) in self.from(0) {
            let end = coefficients.nrows().min(start + part.ncols());
            if start < end {
                let rows = coefficients.get(start..end, ..);
                add_tall(sum.as_mut(), 1.0, part.get(.., ..end - start), rows);
            }
        }
        sum
    }

    /// Projects the vectors from `first` on out of `block`, once; returns the coefficients QᵀM·block.
    fn project_once(&self, first: usize, block: &mut Mat<f64>) -> Mat<f64> {
        let mut coefficients = Mat::zeros(self.size - first, block.ncols());
        let mass_block = self.mass.times(block.as_ref());
        for (start, part) in self.from(first) {
            let rows = start - first..start - first + part.ncols();
            coefficients.get_mut(rows, ..).copy_from(tall_product(part, mass_block.as_ref()));
        }
        for (start, part) in self.from(first) {
            let rows = start - first..start - first + part.ncols();
            add_tall(block.as_mut(), -1.0, part, coefficients.get(rows, ..));
        }
        coefficients
    }

    /// Projects the basis out of `block`; returns the coefficients QᵀM·block.
    fn project_out(&self, block: &mut Mat<f64>) -> Mat<f64> {
        let first = self.project_once(0, block);
        first + self.project_once(0, block)
    }

    /// Orthonormalises the columns of `block`, from which the basis has been removed, and appends them; returns R of
    /// block = Q_new R (rows: new vectors). Columns that depend on the others are omitted.
    fn append(&mut self, block: &Mat<f64>) -> Mat<f64> {
        let (first, width) = (self.size, block.ncols());
        let norms = column_norms(block, &self.mass.times(block.as_ref()));
        let scale = norms.iter().copied().fold(0.0, f64::max);
        let mut upper = Mat::zeros(width, width);
        for j in 0..width {
            if self.size == self.capacity {
                break;
            }
            let mut column = block.get(.., j..j + 1).to_owned();
            let mut before = norms[j];
            let mut norm = 0.0;
            // Repeat until a pass changes nothing (Kahan: one repetition is enough, unless the vector is round-off).
            for _pass in 0..6 {
                // Cancellation inside the block restores components along the older vectors in proportion.
                let from = if before < CANCELLED * norms[j] { 0 } else { first };
                let part = self.project_once(from, &mut column);
                for i in first..self.size {
                    upper[(i - first, j)] += part[(i - from, 0)];
                }
                norm = column_norms(&column, &self.mass.times(column.as_ref()))[0];
                let again = norm < CANCELLED * norms[j] && from == first && first > 0;
                if (norm > 0.5 * before && !again) || norm <= DEPENDENT * scale {
                    break;
                }
                before = norm;
            }
            if norm <= DEPENDENT * scale {
                continue;
            }
            upper[(self.size - first, j)] = norm;
            self.push(&column, norm);
        }
        upper.get(..self.size - first, ..).to_owned()
    }
}

/// Returns √(columnᵀ M column) of every column.
fn column_norms(block: &Mat<f64>, mass_block: &Mat<f64>) -> Vec<f64> {
    (0..block.ncols()).map(|j| (block.col(j).transpose() * mass_block.col(j)).max(0.0).sqrt()).collect()
}

/// Factors K - σM and rejects a mechanism that is stiff only by round-off.
///
/// Round-off may make the last pivots just positive. Two inverse iterations then find an ω² at the level of
/// round-off.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] with the given name and remedy.
pub(crate) fn positive_factor(shifted: &SparseMatrix, mass: &SparseMatrix, name: &str, remedy: &str) -> Result<Factor> {
    let factor = shifted.factor(name, remedy)?;
    if mass.order() == 0 {
        return Ok(factor);
    }
    let start = factor.solve(mass.times(random_block(mass.order(), 1, &mut 0).as_ref()));
    let mass_start = mass.times(start.as_ref());
    let next = factor.solve(mass_start.clone());
    let largest = column_norms(&next, &mass.times(next.as_ref()))[0] / column_norms(&start, &mass_start)[0];
    // NaN compares as false and is rejected, too.
    let supported = 1.0 / largest > MECHANISM * shifted.trace() / mass.trace();
    if supported { Ok(factor) } else { Err(Error::NotPositiveDefinite { matrix: name.into(), remedy: remedy.into() }) }
}

/// Computes the `count` lowest modes of the pencil.
///
/// The `shift` σ must lie below the lowest eigenvalue (0 for a supported structure, negative for a free one), and
/// `factor` must be that of K - σM.
///
/// # Errors
/// [`Error::Invalid`] if more modes are requested than there are dofs, [`Error::NotConverged`].
pub fn lowest_modes(
    mass: &SparseMatrix,
    factor: &Factor,
    shift: f64,
    count: usize,
    stage: ReductionStage,
    listener: Listener<'_>,
) -> Result<EigenModes> {
    let order = mass.order();
    if count > order {
        return Err(Error::invalid(
            "number of modes",
            format!("{count} modes requested, but there are only {order} free degrees of freedom"),
            "Request fewer modes or refine the mesh",
        ));
    }
    if count == 0 {
        return Ok(EigenModes { eigenvalues: Vec::new(), shapes: Mat::zeros(order, 0), residuals: Vec::new() });
    }
    let capacity = (6 * count + 20 * BLOCK).min(order);
    let mut basis = KrylovBasis::new(mass, capacity);
    let mut projected = Mat::<f64>::zeros(0, 0);
    let mut seed = 0;
    // A first application of the operator makes the random start rich in low modes.
    let block = factor.solve(mass.times(random_block(order, BLOCK.min(order), &mut seed).as_ref()));
    let (mut start, mut look) = (0, count + BLOCK);
    basis.append(&block);
    loop {
        let end = basis.size;
        let mut next = factor.solve(mass.times(basis.block(start).as_ref()));
        let coefficients = basis.project_out(&mut next);
        projected.resize_with(end, end, |_, _| 0.0);
        projected.get_mut(..end, start..end).copy_from(&coefficients);
        let mut coupling = basis.append(&next);
        if basis.size == end && end < capacity {
            // An invariant subspace: continue with directions it does not contain.
            let mut fresh = random_block(order, BLOCK, &mut seed);
            basis.project_out(&mut fresh);
            basis.append(&fresh);
            coupling = Mat::zeros(0, end - start);
        }
        let exhausted = basis.size == end;
        if end >= count && (exhausted || end >= look) {
            look = end + (end / LOOK).max(BLOCK);
            let ritz = ritz_pairs(projected.as_ref(), coupling.as_ref(), count, order == end)?;
            let converged = ritz.bounds.iter().filter(|&&bound| bound <= TOLERANCE).count();
            report(listener, stage, converged, count);
            if converged == count {
                let shapes = basis.combined(ritz.vectors.as_ref());
                return checked((mass, factor), shift, &ritz.values, shapes, end);
            }
            if exhausted {
                return Err(Error::NotConverged { wanted: count, converged, basis: end, tolerance: TOLERANCE });
            }
        }
        start = end;
    }
}

struct RitzValues {
    values: Vec<f64>,
    vectors: Mat<f64>,
    bounds: Vec<f64>,
}

/// Computes the largest eigenpairs of the projected operator, with residual bounds ‖R s_last‖ / θ.
fn ritz_pairs(
    projected: MatRef<'_, f64>,
    coupling: MatRef<'_, f64>,
    count: usize,
    complete: bool,
) -> Result<RitzValues> {
    let size = projected.nrows();
    // The eigenvalue solver deflates against 1, not against the norm of the matrix, so the matrix is scaled. The
    // block columns are filled from the left, so the entry of the later column is the complete one of a pair.
    let scale = projected.norm_max();
    let symmetric = Mat::from_fn(size, size, |i, j| projected[(i.min(j), i.max(j))] / scale);
    let eigen = symmetric.self_adjoint_eigen(Side::Lower).map_err(|_| {
        Error::invalid("projected eigenvalue problem", "it did not converge", "Check the mesh and the material")
    })?;
    let order: Vec<usize> = (0..count).map(|k| size - 1 - k).collect();
    let vectors = Mat::from_fn(size, count, |i, k| eigen.U()[(i, order[k])]);
    let values: Vec<f64> = order.iter().map(|&k| scale * eigen.S()[k]).collect();
    let last = vectors.get(size - coupling.ncols().., ..);
    let residuals = coupling * last;
    let bounds =
        (0..count).map(|k| if complete { 0.0 } else { residuals.col(k).norm_l2() / values[k].abs() }).collect();
    Ok(RitzValues { values, vectors, bounds })
}

/// Forms the residual of every pair explicitly and rejects inaccurate pairs: the bounds are meaningless for a basis
/// that has reached its capacity. `basis` is its size.
fn checked(
    (mass, factor): (&SparseMatrix, &Factor),
    shift: f64,
    thetas: &[f64],
    shapes: Mat<f64>,
    basis: usize,
) -> Result<EigenModes> {
    let mut residuals = Vec::with_capacity(thetas.len());
    for (part, some) in thetas.chunks(CHECKED_TOGETHER).enumerate() {
        let some_shapes = shapes.get(.., part * CHECKED_TOGETHER..part * CHECKED_TOGETHER + some.len());
        let mut residual = factor.solve(mass.times(some_shapes));
        for (k, theta) in some.iter().enumerate() {
            for i in 0..shapes.nrows() {
                residual[(i, k)] -= theta * some_shapes[(i, k)];
            }
        }
        let norms = column_norms(&residual, &mass.times(residual.as_ref()));
        residuals.extend(norms.iter().zip(some).map(|(norm, theta)| norm / theta.abs()));
    }
    // NaN must count as failure, hence the direction of the comparison.
    let converged = residuals.iter().filter(|&&residual| residual <= CHECKED_TOLERANCE).count();
    if converged < thetas.len() {
        let wanted = thetas.len();
        return Err(Error::NotConverged { wanted, converged, basis, tolerance: CHECKED_TOLERANCE });
    }
    let eigenvalues = thetas.iter().map(|theta| shift + 1.0 / theta).collect();
    Ok(EigenModes { eigenvalues, shapes, residuals })
}

/// Returns entries in [-1, 1) from a fixed sequence (splitmix64), so that results are reproducible.
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
