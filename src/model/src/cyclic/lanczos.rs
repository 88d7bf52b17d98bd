//! Lowest modes of one nodal diameter, K_n φ = ω² M_n φ, by block Lanczos in complex arithmetic.
//!
//! As in [`crate::eigen`], A_n⁻¹M_n is self-adjoint in the M_n inner product, the basis is kept M_n-orthonormal
//! against all its vectors, and the residual of every returned pair is formed explicitly. A block is orthonormalised
//! by the Cholesky factor of its Gram matrix, twice, each time after projecting out the basis; a block that is nearly
//! dependent is orthonormalised column by column.

use faer::linalg::solvers::Llt;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Mat, MatRef, Par, Side, c64};

use super::operator::CyclicPencil;
use crate::eigen::TOLERANCE;
use crate::{Error, Result};

const BLOCK: usize = 6;
/// Largest accepted residual, as in [`crate::eigen`].
const CHECKED_TOLERANCE: f64 = 1e-8;
const DEPENDENT: f64 = 1e-13;
/// Threshold of the Gram factor below which a block is orthonormalised column by column.
const NEARLY_DEPENDENT: f64 = 1e-4;
/// Fraction of tr K / tr M below which an ω² is round-off of a rigid-body motion.
const MECHANISM: f64 = 1e-14;

/// Modes of one nodal diameter.
#[derive(Debug, Clone)]
pub(super) struct ComplexModes {
    /// ω² (rad²/s²), ascending.
    pub eigenvalues: Vec<f64>,
    /// M_n-orthonormal shapes, for the requested rows; the largest entry of each is real and positive.
    pub shapes: Mat<c64>,
}

impl ComplexModes {
    /// Returns the first `count` modes.
    pub(super) fn lowest(&self, count: usize) -> Self {
        Self { eigenvalues: self.eigenvalues[..count].to_vec(), shapes: self.shapes.get(.., ..count).to_owned() }
    }
}

/// Growing M-orthonormal basis Q, stored with M Q.
struct LanczosBasis<'a> {
    operator: &'a CyclicPencil<'a>,
    vectors: Mat<c64>,
    mass_vectors: Mat<c64>,
    size: usize,
    capacity: usize,
}

impl<'a> LanczosBasis<'a> {
    fn new(operator: &'a CyclicPencil<'a>, order: usize, capacity: usize) -> Self {
        Self { operator, vectors: Mat::zeros(order, 0), mass_vectors: Mat::zeros(order, 0), size: 0, capacity }
    }

    fn push(&mut self, columns: &Mat<c64>, mass_columns: &Mat<c64>) {
        let end = self.size + columns.ncols();
        if end > self.vectors.ncols() {
            let room = (2 * end).clamp(8 * BLOCK, self.capacity.max(8 * BLOCK));
            let order = columns.nrows();
            self.vectors.resize_with(order, room.max(end), |_, _| c64::new(0.0, 0.0));
            self.mass_vectors.resize_with(order, room.max(end), |_, _| c64::new(0.0, 0.0));
        }
        self.vectors.get_mut(.., self.size..end).copy_from(columns);
        self.mass_vectors.get_mut(.., self.size..end).copy_from(mass_columns);
        self.size = end;
    }

    fn used(&self) -> MatRef<'_, c64> {
        self.vectors.get(.., ..self.size)
    }

    /// Projects the basis out of `block`; returns QᴴM·block.
    fn project_out(&self, block: &mut Mat<c64>) -> Mat<c64> {
        let part = self.mass_vectors.get(.., ..self.size).adjoint() * &*block;
        *block -= self.used() * &part;
        part
    }

    /// Appends the part of `block` outside the basis. Returns C and R of block = Q C + Q_new R.
    fn append(&mut self, mut block: Mat<c64>) -> (Mat<c64>, Mat<c64>) {
        let (first, width) = (self.size, block.ncols());
        let mut coefficients = self.project_out(&mut block);
        let mut upper = Mat::<c64>::identity(width, width);
        // The second pass removes the rounding errors of the first.
        for last in [false, true] {
            let mut mass_block = self.operator.mass(block.as_ref());
            let fits = first + width <= self.capacity;
            let Some(lower) = fits.then(|| gram_factor(block.as_ref(), mass_block.as_ref())).flatten() else { break };
            divide(&lower, &mut block);
            upper = lower.adjoint() * &upper;
            if last {
                // This factor is near the identity, so that nothing cancels in M Q.
                divide(&lower, &mut mass_block);
                self.push(&block, &mass_block);
                return (coefficients, upper);
            }
            coefficients += self.project_out(&mut block) * &upper;
        }
        let (more, new) = self.append_columns(&block);
        (coefficients + more * &upper, new * &upper)
    }

    /// Appends as [`Self::append`] does, column by column; omits columns that depend on the previous ones.
    fn append_columns(&mut self, block: &Mat<c64>) -> (Mat<c64>, Mat<c64>) {
        let (first, width) = (self.size, block.ncols());
        let norms = column_norms(block.as_ref(), self.operator.mass(block.as_ref()).as_ref());
        let scale = norms.iter().copied().fold(0.0, f64::max);
        let mut coefficients = Mat::zeros(first + width, width);
        for j in 0..width {
            if self.size == self.capacity {
                break;
            }
            let mut column = block.get(.., j..j + 1).to_owned();
            let (mut before, mut norm) = (norms[j], 0.0);
            let mut mass_column = Mat::zeros(0, 0);
            // Repeat until a pass changes nothing (Kahan: one repetition is enough, unless the vector is round-off).
            for _pass in 0..6 {
                let part = self.project_out(&mut column);
                for i in 0..self.size {
                    coefficients[(i, j)] += part[(i, 0)];
                }
                mass_column = self.operator.mass(column.as_ref());
                norm = column_norms(column.as_ref(), mass_column.as_ref())[0];
                if norm > 0.5 * before || norm <= DEPENDENT * scale {
                    break;
                }
                before = norm;
            }
            if norm <= DEPENDENT * scale {
                continue;
            }
            coefficients[(self.size, j)] = c64::new(norm, 0.0);
            let unit = faer::Scale(c64::new(1.0 / norm, 0.0));
            self.push(&(column * unit), &(mass_column * unit));
        }
        let old = coefficients.get(..first, ..).to_owned();
        (old, coefficients.get(first..self.size, ..).to_owned())
    }
}

/// Returns the lower factor of the Gram matrix; `None` if the columns are nearly dependent.
fn gram_factor(block: MatRef<'_, c64>, mass_block: MatRef<'_, c64>) -> Option<Mat<c64>> {
    let gram = block.adjoint() * mass_block;
    let factor = Llt::new(gram.as_ref(), Side::Lower).ok()?;
    let lower = factor.L().to_owned();
    // NaN compares as false and selects the column-by-column path.
    let independent = (0..gram.ncols()).all(|k| lower[(k, k)].re > NEARLY_DEPENDENT * gram[(k, k)].re.sqrt());
    independent.then_some(lower)
}

/// Computes B ← B L⁻ᴴ.
fn divide(lower: &Mat<c64>, block: &mut Mat<c64>) {
    // Lᵀ-free form: (B L⁻ᴴ)ᴴ = L⁻¹Bᴴ.
    let mut turned = block.adjoint().to_owned();
    solve_lower_triangular_in_place(lower.as_ref(), turned.as_mut(), Par::Seq);
    block.copy_from(turned.adjoint());
}

/// Returns √(columnᴴ M column) of every column.
fn column_norms(block: MatRef<'_, c64>, mass_block: MatRef<'_, c64>) -> Vec<f64> {
    (0..block.ncols()).map(|j| (block.col(j).adjoint() * mass_block.col(j)).re.max(0.0).sqrt()).collect()
}

/// Computes the `count` lowest modes over `order` rows: all rows, or all but those of the contact.
///
/// # Errors
/// [`Error::Invalid`] if more modes are requested than there are dofs, [`Error::NotConverged`], and
/// [`Error::NotPositiveDefinite`] for a mechanism that is stiff only by round-off.
pub(super) fn lowest_modes(operator: &CyclicPencil<'_>, order: usize, count: usize) -> Result<ComplexModes> {
    if count > order {
        return Err(Error::invalid(
            "number of modes",
            format!(
                "{count} modes requested, but there are only {order} degrees of freedom at nodal diameter {}",
                operator.nodal_diameter
            ),
            "Request fewer modes or refine the mesh",
        ));
    }
    let capacity = (6 * count + 20 * BLOCK).min(order);
    let mut basis = LanczosBasis::new(operator, order, capacity);
    let mut projected = Mat::<c64>::zeros(0, 0);
    let mut seed = 0;
    let mut random = |columns: usize| random_block(order, columns, operator.real, &mut seed);
    if count == 0 {
        return Ok(ComplexModes { eigenvalues: Vec::new(), shapes: Mat::zeros(order, 0) });
    }
    // A first application of the operator makes the random start rich in low modes.
    let start_block = operator.solve(operator.mass(random(BLOCK.min(order)).as_ref()).as_ref());
    basis.append(start_block);
    let mut start = 0;
    loop {
        let end = basis.size;
        let next = operator.solve(basis.mass_vectors.get(.., start..end));
        let (coefficients, mut coupling) = basis.append(next);
        projected.resize_with(end, end, |_, _| c64::new(0.0, 0.0));
        projected.get_mut(..end, start..end).copy_from(&coefficients);
        if basis.size == end && end < capacity {
            // An invariant subspace: continue with directions it does not contain.
            basis.append(random(BLOCK.min(capacity - end)));
            coupling = Mat::zeros(0, end - start);
        }
        let exhausted = basis.size == end;
        if end >= count && (exhausted || end >= count + BLOCK) {
            let ritz = ritz_pairs(projected.as_ref(), coupling.as_ref(), count, order == end, operator.real)?;
            let converged = ritz.bounds.iter().filter(|&&bound| bound <= TOLERANCE).count();
            if converged == count {
                return checked(operator, &ritz.values, basis.vectors.get(.., ..end) * &ritz.vectors, end);
            }
            if exhausted {
                return Err(Error::NotConverged { wanted: count, converged, basis: end, tolerance: TOLERANCE });
            }
        }
        start = end;
    }
}

struct ComplexRitz {
    values: Vec<f64>,
    vectors: Mat<c64>,
    bounds: Vec<f64>,
}

/// Computes the largest eigenpairs of the projected operator, with residual bounds ‖R s_last‖ / θ.
fn ritz_pairs(
    projected: MatRef<'_, c64>,
    coupling: MatRef<'_, c64>,
    count: usize,
    complete: bool,
    real: bool,
) -> Result<ComplexRitz> {
    let size = projected.nrows();
    let scale = projected.norm_max();
    // The block columns are filled from the left, so the entry of the later column is the complete one of a pair.
    let entry = |i: usize, j: usize| {
        if i < j {
            projected[(i, j)] / scale
        } else if i > j {
            projected[(j, i)].conj() / scale
        } else {
            c64::new(projected[(i, i)].re / scale, 0.0)
        }
    };
    let (values, vectors) = hermitian_eigen(size, real, entry)?;
    let values: Vec<f64> = (0..count).map(|k| scale * values[size - 1 - k]).collect();
    let vectors = Mat::from_fn(size, count, |i, k| vectors[(i, size - 1 - k)]);
    let residuals = coupling * vectors.get(size - coupling.ncols().., ..);
    let bounds =
        (0..count).map(|k| if complete { 0.0 } else { residuals.col(k).norm_l2() / values[k].abs() }).collect();
    Ok(ComplexRitz { values, vectors, bounds })
}

/// Computes eigenvalues (ascending) and vectors of a small Hermitian matrix given by its entries; exactly real for a
/// real matrix.
///
/// # Errors
/// [`Error::Invalid`] if the iteration does not converge.
pub(super) fn hermitian_eigen(
    size: usize,
    real: bool,
    entry: impl Fn(usize, usize) -> c64,
) -> Result<(Vec<f64>, Mat<c64>)> {
    let failed =
        |_| Error::invalid("projected eigenvalue problem", "it did not converge", "Check the mesh and the material");
    if real {
        let eigen = Mat::from_fn(size, size, |i, j| entry(i, j).re).self_adjoint_eigen(Side::Lower).map_err(failed)?;
        let vectors = Mat::from_fn(size, size, |i, j| c64::new(eigen.U()[(i, j)], 0.0));
        return Ok(((0..size).map(|k| eigen.S()[k]).collect(), vectors));
    }
    let eigen = Mat::from_fn(size, size, entry).self_adjoint_eigen(Side::Lower).map_err(failed)?;
    Ok(((0..size).map(|k| eigen.S()[k].re).collect(), eigen.U().to_owned()))
}

/// Forms the residual of every pair explicitly and rejects inaccurate pairs: the bounds are meaningless for a basis
/// that has reached its capacity. `basis` is its size.
fn checked(operator: &CyclicPencil<'_>, thetas: &[f64], mut shapes: Mat<c64>, basis: usize) -> Result<ComplexModes> {
    let sector = operator.condensed.sector;
    // NaN compares as false and is rejected, too.
    let supported = 1.0 / thetas[0] > MECHANISM * operator.condensed.shifted.trace() / sector.mass.trace();
    if !supported {
        let held = shapes.nrows() < operator.parts().order();
        return Err(super::operator::not_positive(operator.nodal_diameter, held));
    }
    let mut residual = operator.solve(operator.mass(shapes.as_ref()).as_ref());
    for (k, &theta) in thetas.iter().enumerate() {
        for i in 0..shapes.nrows() {
            residual[(i, k)] -= shapes[(i, k)] * theta;
        }
    }
    let norms = column_norms(residual.as_ref(), operator.mass(residual.as_ref()).as_ref());
    let converged = norms.iter().zip(thetas).filter(|(norm, theta)| **norm <= CHECKED_TOLERANCE * theta.abs()).count();
    if converged < thetas.len() {
        let wanted = thetas.len();
        return Err(Error::NotConverged { wanted, converged, basis, tolerance: CHECKED_TOLERANCE });
    }
    fix_phases(&mut shapes);
    Ok(ComplexModes {
        eigenvalues: thetas.iter().map(|theta| operator.condensed.shift + 1.0 / theta).collect(),
        shapes,
    })
}

/// Scales every column so that its largest entry is real and positive: the phase of a mode is arbitrary.
fn fix_phases(shapes: &mut Mat<c64>) {
    for k in 0..shapes.ncols() {
        let mut largest = c64::new(0.0, 0.0);
        for i in 0..shapes.nrows() {
            if shapes[(i, k)].norm_sqr() > largest.norm_sqr() {
                largest = shapes[(i, k)];
            }
        }
        let turn = if largest.im == 0.0 {
            c64::new(1.0_f64.copysign(largest.re), 0.0)
        } else {
            largest.conj() / largest.norm_sqr().sqrt()
        };
        for i in 0..shapes.nrows() {
            shapes[(i, k)] *= turn;
        }
    }
}

/// Returns entries with real and imaginary part in [-1, 1) from a fixed sequence (splitmix64), so that results are
/// reproducible.
fn random_block(rows: usize, columns: usize, real: bool, seed: &mut u64) -> Mat<c64> {
    let mut number = || {
        *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = *seed;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    Mat::from_fn(rows, columns, |_, _| c64::new(number(), if real { 0.0 } else { number() }))
}
