//! Symmetric sparse matrices with a shared pattern, and their Cholesky factors.
//!
//! Both triangles are stored: a column is then also a row, products are independent dot products, and a principal
//! submatrix is a copy. The factorisation is faer's supernodal LLᵀ.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, MatMut, MatRef, Par, Side, Spec};
use rayon::prelude::*;

use crate::ordering::{Ordering, elimination_order};

use crate::{Error, Result};

/// Where the entries of a symmetric matrix are: compressed columns, rows ascending, both triangles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    /// Start of each column in `rows`, and the end of the last one.
    pub starts: Vec<usize>,
    /// Row index of each entry.
    pub rows: Vec<usize>,
}

impl Pattern {
    /// Number of rows and columns.
    pub fn order(&self) -> usize {
        self.starts.len() - 1
    }

    fn as_faer(&self) -> SymbolicSparseColMatRef<'_, usize> {
        SymbolicSparseColMatRef::new_checked(self.order(), self.order(), &self.starts, None, &self.rows)
    }

    /// Pattern of the rows and columns `keep` (ascending), and for each of its entries the entry it is here.
    pub fn principal(&self, keep: &[usize]) -> (Self, Vec<usize>) {
        let mut position = vec![usize::MAX; self.order()];
        for (new, &old) in keep.iter().enumerate() {
            position[old] = new;
        }
        let mut starts = Vec::with_capacity(keep.len() + 1);
        let (mut rows, mut entries) = (Vec::new(), Vec::new());
        starts.push(0);
        for &column in keep {
            for entry in self.starts[column]..self.starts[column + 1] {
                let row = position[self.rows[entry]];
                if row != usize::MAX {
                    rows.push(row);
                    entries.push(entry);
                }
            }
            starts.push(rows.len());
        }
        (Self { starts, rows }, entries)
    }
}

/// A symmetric sparse matrix.
#[derive(Debug, Clone)]
pub struct SparseMatrix {
    /// Where the entries are.
    pub pattern: Arc<Pattern>,
    /// The entries, in the order of the pattern.
    pub values: Vec<f64>,
}

impl SparseMatrix {
    /// Number of rows and columns.
    pub fn order(&self) -> usize {
        self.pattern.order()
    }

    /// Product with a dense matrix, n × m.
    pub fn times(&self, dense: MatRef<'_, f64>) -> Mat<f64> {
        assert_eq!(dense.nrows(), self.order(), "the product's inner dimensions must agree");
        let columns: Vec<Vec<f64>> = (0..dense.ncols())
            .into_par_iter()
            .map(|column| {
                let x: Vec<f64> = dense.col(column).iter().copied().collect();
                (0..self.order()).map(|row| self.row_times(row, &x)).collect()
            })
            .collect();
        Mat::from_fn(self.order(), dense.ncols(), |i, j| columns[j][i])
    }

    fn row_times(&self, row: usize, x: &[f64]) -> f64 {
        let range = self.pattern.starts[row]..self.pattern.starts[row + 1];
        self.pattern.rows[range.clone()].iter().zip(&self.values[range]).map(|(&i, value)| value * x[i]).sum()
    }

    /// self + factor · other, for matrices of one pattern.
    #[must_use]
    pub fn plus_scaled(&self, factor: f64, other: &Self) -> Self {
        assert_eq!(self.pattern, other.pattern, "the two matrices must share their pattern");
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a + factor * b).collect();
        Self { pattern: Arc::clone(&self.pattern), values }
    }

    /// Dense block of some rows and columns.
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

    /// Sum of the diagonal.
    pub fn trace(&self) -> f64 {
        let diagonal = |column: usize| {
            let range = self.pattern.starts[column]..self.pattern.starts[column + 1];
            let found = self.pattern.rows[range.clone()].binary_search(&column);
            found.map_or(0.0, |offset| self.values[range.start + offset])
        };
        (0..self.order()).map(diagonal).sum()
    }

    /// The Cholesky factor; `name` and `remedy` go into the error.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn factor(&self, name: &str, remedy: &str) -> Result<Factor> {
        let fail = || Error::NotPositiveDefinite { matrix: name.into(), remedy: remedy.into() };
        let symbolic = SymbolicFactor::new(&self.pattern, Ordering::Automatic).ok_or_else(fail)?;
        self.factor_with(&symbolic).ok_or_else(fail)
    }

    /// The Cholesky factor, with the structure that was found for this pattern; `None` when it is not positive definite
    /// or memory does not suffice.
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

/// Two matrices restricted to the same rows and columns; the result shares one pattern.
pub fn principal_pair(first: &SparseMatrix, second: &SparseMatrix, keep: &[usize]) -> (SparseMatrix, SparseMatrix) {
    assert_eq!(first.pattern, second.pattern, "the two matrices must share their pattern");
    let (pattern, entries) = first.pattern.principal(keep);
    let pattern = Arc::new(pattern);
    let pick = |matrix: &SparseMatrix| SparseMatrix {
        pattern: Arc::clone(&pattern),
        values: entries.iter().map(|&entry| matrix.values[entry]).collect(),
    };
    (pick(first), pick(second))
}

/// The library's own threads split sums by their number, and a ROM must have the same bits on every number of threads.
const PAR: Par = Par::Seq;

/// Structure of the Cholesky factor of every matrix of one pattern.
#[derive(Debug, Clone)]
pub struct SymbolicFactor {
    inner: Arc<SymbolicCholesky<usize>>,
}

impl SymbolicFactor {
    /// Find an order of elimination and the structure that comes of it; `None` when memory does not suffice.
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

    /// Number of stored entries of the factor, the zeros that blocks include counted.
    pub fn entries(&self) -> usize {
        self.inner.len_val()
    }
}

/// Columns solved together.
const SHARE: usize = 8;

/// Sparse Cholesky factor.
#[derive(Debug, Clone)]
pub struct Factor {
    symbolic: SymbolicFactor,
    values: Vec<f64>,
}

impl Factor {
    /// Solution of A x = b for every column of `right`, n × m.
    pub fn solve(&self, mut right: Mat<f64>) -> Mat<f64> {
        // Columns are independent: shares of them beat threads inside the triangular solves. The width of a share is fixed,
        // because the kernels round differently for different widths, and a ROM must not depend on the number of threads.
        let chunks: Vec<_> = right.as_mut().par_col_chunks_mut(SHARE).collect();
        chunks.into_par_iter().for_each(|chunk| self.solve_in_place(chunk));
        right
    }

    /// As [`Self::solve`], all columns together in the calling thread: for callers that are parallel themselves.
    pub fn solve_in_place(&self, right: MatMut<'_, f64>) {
        let scratch = self.symbolic.inner.solve_in_place_scratch::<f64>(right.ncols(), PAR);
        let mut memory = MemBuffer::new(scratch);
        let factor = LltRef::new(&self.symbolic.inner, &self.values);
        factor.solve_in_place_with_conj(Conj::No, right, PAR, MemStack::new(&mut memory));
    }

    /// Number of stored entries, the zeros that blocks include counted.
    pub fn entries(&self) -> usize {
        self.values.len()
    }
}
