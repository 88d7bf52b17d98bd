//! Symmetric sparse matrices with a shared pattern, and their Cholesky factors.
//!
//! Both triangles are stored: a column is then also a row, products are independent dot products, and a principal
//! submatrix is a copy. The factorisation is the supernodal LLᵀ of faer.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::matmul::matmul;
use faer::perm::PermRef;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Accum, Conj, Mat, MatMut, MatRef, Par, Side, Spec};
use rayon::prelude::*;

use crate::ordering::{Ordering, elimination_order};
pub use crate::pattern::Pattern;
use crate::{Error, Result};

/// Number of columns of a dense matrix that a sparse one is multiplied with together.
const WIDTH: usize = 8;
/// Number of rows of a tall matrix that form one piece. Sums add the pieces in order, whichever thread computed them,
/// so that bits do not depend on the number of threads.
const ROWS: usize = 4096;

/// Computes AᵀB of two tall matrices, in parallel.
pub(crate) fn tall_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    assert_eq!(a.nrows(), b.nrows(), "the product's inner dimensions must agree");
    let pieces = a.nrows().div_ceil(ROWS);
    // A few pieces at a time, so that not all of their products are stored together.
    let mut product = Mat::zeros(a.ncols(), b.ncols());
    for group in (0..pieces).collect::<Vec<_>>().chunks(16) {
        let parts: Vec<Mat<f64>> = group
            .par_iter()
            .map(|&piece| {
                let rows = piece * ROWS..((piece + 1) * ROWS).min(a.nrows());
                let mut part = Mat::zeros(a.ncols(), b.ncols());
                let (left, right) = (a.get(rows.clone(), ..).transpose(), b.get(rows, ..));
                matmul(part.as_mut(), Accum::Replace, left, right, 1.0, PAR);
                part
            })
            .collect();
        for part in parts {
            product += part;
        }
    }
    product
}

/// Computes target + factor · A C for a tall A and a small C, in parallel.
pub(crate) fn add_tall(target: MatMut<'_, f64>, factor: f64, a: MatRef<'_, f64>, c: MatRef<'_, f64>) {
    let chunks: Vec<_> = target.par_row_chunks_mut(ROWS).collect();
    chunks.into_par_iter().enumerate().for_each(|(piece, rows)| {
        let part = a.get(piece * ROWS..piece * ROWS + rows.nrows(), ..);
        matmul(rows, Accum::Add, part, c, factor, PAR);
    });
}

/// Symmetric sparse matrix.
#[derive(Debug, Clone)]
pub struct SparseMatrix {
    /// Positions of the entries.
    pub pattern: Arc<Pattern>,
    /// Entries in the order of the pattern.
    pub values: Vec<f64>,
}

impl SparseMatrix {
    /// Returns the number of rows and columns.
    pub fn order(&self) -> usize {
        self.pattern.order()
    }

    /// Returns the product with a dense matrix, n × m.
    pub fn times(&self, dense: MatRef<'_, f64>) -> Mat<f64> {
        assert_eq!(dense.nrows(), self.order(), "the product's inner dimensions must agree");
        let mut product = Mat::zeros(self.order(), dense.ncols());
        for first in (0..dense.ncols()).step_by(WIDTH) {
            let width = WIDTH.min(dense.ncols() - first);
            // Some columns side by side, so that an entry of the matrix is read once for all of them.
            let mut packed = vec![[0.0; WIDTH]; self.order()];
            for j in 0..width {
                packed.iter_mut().zip(dense.col(first + j).iter()).for_each(|(row, value)| row[j] = *value);
            }
            let columns = product.get_mut(.., first..first + width);
            let chunks: Vec<_> = columns.par_row_chunks_mut(ROWS).collect();
            chunks.into_par_iter().enumerate().for_each(|(chunk, mut rows)| {
                for i in 0..rows.nrows() {
                    let sums = self.row_times(chunk * ROWS + i, &packed);
                    (0..width).for_each(|j| rows[(i, j)] = sums[j]);
                }
            });
        }
        product
    }

    fn row_times(&self, row: usize, packed: &[[f64; WIDTH]]) -> [f64; WIDTH] {
        let range = self.pattern.starts[row]..self.pattern.starts[row + 1];
        let mut sums = [0.0; WIDTH];
        for (&i, value) in self.pattern.rows[range.clone()].iter().zip(&self.values[range]) {
            for (sum, x) in sums.iter_mut().zip(&packed[i]) {
                *sum += value * x;
            }
        }
        sums
    }

    /// Returns self + factor · other, for matrices with the same pattern.
    #[must_use]
    pub fn plus_scaled(&self, factor: f64, other: &Self) -> Self {
        assert_eq!(self.pattern, other.pattern, "the two matrices must have the same sparsity pattern");
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a + factor * b).collect();
        Self { pattern: Arc::clone(&self.pattern), values }
    }

    /// Returns the dense block of some rows and columns.
    pub fn block(&self, rows: &[usize], columns: &[usize]) -> Mat<f64> {
        let mut position = vec![usize::MAX; self.order()];
        for (new, &old) in rows.iter().enumerate() {
            position[old] = new;
        }
        let mut dense = Mat::zeros(rows.len(), columns.len());
        for (j, &column) in columns.iter().enumerate() {
            for entry in self.pattern.starts[column]..self.pattern.starts[column + 1] {
                let i = position[self.pattern.rows[entry]];
                if i != usize::MAX {
                    dense[(i, j)] = self.values[entry];
                }
            }
        }
        dense
    }

    /// Sets the matrix to a diagonal matrix, in the same pattern.
    ///
    /// # Panics
    /// If the pattern lacks a diagonal entry, which no assembled matrix does.
    pub fn set_diagonal(&mut self, entry: impl Fn(usize) -> f64) {
        self.values.fill(0.0);
        for dof in 0..self.order() {
            let start = self.pattern.starts[dof];
            let rows = &self.pattern.rows[start..self.pattern.starts[dof + 1]];
            self.values[start + rows.binary_search(&dof).expect("the pattern contains the diagonal")] = entry(dof);
        }
    }

    /// Returns the sum of the diagonal.
    pub fn trace(&self) -> f64 {
        let diagonal = |column: usize| {
            let range = self.pattern.starts[column]..self.pattern.starts[column + 1];
            let found = self.pattern.rows[range.clone()].binary_search(&column);
            found.map_or(0.0, |offset| self.values[range.start + offset])
        };
        (0..self.order()).map(diagonal).sum()
    }

    /// Computes the Cholesky factor; `name` and `remedy` appear in the error.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn factor(&self, name: &str, remedy: &str) -> Result<Factor> {
        let fail = || Error::NotPositiveDefinite { matrix: name.into(), remedy: remedy.into() };
        let symbolic = SymbolicFactor::new(&self.pattern, Ordering::Automatic).ok_or_else(fail)?;
        self.factor_with(&symbolic).ok_or_else(fail)
    }

    /// Computes the Cholesky factor with the given structure of the pattern; `None` if it is not positive definite or
    /// memory does not suffice.
    pub fn factor_with(&self, symbolic: &SymbolicFactor) -> Option<Factor> {
        let matrix = SparseColMatRef::new(self.pattern.as_faer(), self.values.as_slice());
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.inner.len_val()).ok()?;
        values.resize(symbolic.inner.len_val(), 0.0);
        let scratch = symbolic.inner.factorize_numeric_llt_scratch::<f64>(PAR, Spec::default());
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        symbolic
            .inner
            .factorize_numeric_llt(
                &mut values,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                PAR,
                MemStack::new(&mut memory),
                Spec::default(),
            )
            .ok()?;
        Some(Factor { symbolic: symbolic.clone(), values })
    }
}

/// Restricts two matrices to the same rows and columns; the results share one pattern.
pub fn principal_pair(first: &SparseMatrix, second: &SparseMatrix, keep: &[usize]) -> (SparseMatrix, SparseMatrix) {
    assert_eq!(first.pattern, second.pattern, "the two matrices must have the same sparsity pattern");
    let (pattern, entries) = first.pattern.principal(keep);
    let pattern = Arc::new(pattern);
    let pick = |matrix: &SparseMatrix| SparseMatrix {
        pattern: Arc::clone(&pattern),
        values: entries.iter().map(|&entry| matrix.values[entry]).collect(),
    };
    (pick(first), pick(second))
}

/// Threads of faer would split sums by the number of threads, but the bits of a ROM must not depend on it.
const PAR: Par = Par::Seq;

/// Structure of the Cholesky factor of every matrix with the same pattern.
#[derive(Debug, Clone)]
pub struct SymbolicFactor {
    inner: Arc<SymbolicCholesky<usize>>,
}

impl SymbolicFactor {
    /// Finds an order of elimination and the resulting structure; `None` if memory does not suffice.
    pub fn new(pattern: &Pattern, ordering: Ordering) -> Option<Self> {
        let order = elimination_order(pattern, ordering);
        let inverse = order.as_ref().map(|order| {
            let mut inverse = vec![0; order.len()];
            for (new, &old) in order.iter().enumerate() {
                inverse[old] = new;
            }
            inverse
        });
        let custom = match (&order, &inverse) {
            (Some(order), Some(inverse)) => {
                SymmetricOrdering::Custom(PermRef::new_checked(order, inverse, pattern.order()))
            }
            _ => SymmetricOrdering::Amd,
        };
        let found =
            factorize_symbolic_cholesky(pattern.as_faer(), Side::Lower, custom, CholeskySymbolicParams::default());
        Some(Self { inner: Arc::new(found.ok()?) })
    }

    /// Returns the number of stored entries of the factor, including the zeros in its blocks.
    pub fn entries(&self) -> usize {
        self.inner.len_val()
    }
}

/// Number of columns that are solved together if there are few, as in a block of the Lanczos iteration.
const SHARE: usize = 4;
/// Number of columns that are solved together if there are many.
const WIDE_SHARE: usize = 16;
/// Number of columns from which there are many.
const MANY: usize = 32;

/// Sparse Cholesky factor.
#[derive(Debug, Clone)]
pub struct Factor {
    symbolic: SymbolicFactor,
    values: Vec<f64>,
}

impl Factor {
    /// Solves A x = b for every column of `right`, n × m.
    pub fn solve(&self, mut right: Mat<f64>) -> Mat<f64> {
        // Columns are independent: groups of them are faster than threads inside the triangular solves. The width of
        // a group is fixed, because the kernels round differently for different widths, and a ROM must not depend on
        // the number of threads.
        let share = if right.ncols() < MANY { SHARE } else { WIDE_SHARE };
        let chunks: Vec<_> = right.as_mut().par_col_chunks_mut(share).collect();
        chunks.into_par_iter().for_each(|chunk| self.solve_in_place(chunk));
        right
    }

    /// Solves as [`Self::solve`] does, all columns together in the calling thread, for callers that are parallel
    /// themselves.
    pub(crate) fn solve_in_place(&self, right: MatMut<'_, f64>) {
        let scratch = self.symbolic.inner.solve_in_place_scratch::<f64>(right.ncols(), PAR);
        let mut memory = MemBuffer::new(scratch);
        let factor = LltRef::new(&self.symbolic.inner, &self.values);
        factor.solve_in_place_with_conj(Conj::No, right, PAR, MemStack::new(&mut memory));
    }
}
