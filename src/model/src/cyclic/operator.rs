//! Pencil of one nodal diameter as an operator: products with M_n and A_n, solutions with A_n = K_n - σM_n.
//!
//! Blocks of vectors are complex, n × columns, over (interior, face, contact), or without the contact rows if the
//! contact is held. Real sparse products and solutions treat real and imaginary parts as separate columns.

use faer::linalg::solvers::Llt;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, MatRef, Par, Side, c64};

use super::condense::Condensed;
use super::sector::DofCounts;
use crate::sparse::SparseMatrix;
use crate::{Error, Result};

/// Pencil of one nodal diameter.
#[derive(Debug)]
pub(super) struct CyclicPencil<'a> {
    pub condensed: &'a Condensed<'a>,
    /// Nodal diameter n.
    pub nodal_diameter: usize,
    /// e^(2πin/N).
    pub phase: c64,
    /// True for n = 0 or 2n = N, where all matrices are real.
    pub real: bool,
    /// Lower factor of S_n over (face, contact), or of its face part alone.
    lower: Mat<c64>,
    /// Number of factored rows of `lower`.
    factored: usize,
    /// Columns of S_n that belong to the contact: (face + contact) × contact.
    contact_columns: Mat<c64>,
}

/// Returns e^(2πin/N), exactly real for n = 0 and 2n = N.
#[expect(clippy::cast_precision_loss, reason = "sectors are far fewer than 2^52")]
pub(super) fn phase(nodal_diameter: usize, sectors: usize) -> c64 {
    let half_turns = 2 * nodal_diameter % (2 * sectors);
    if half_turns == 0 {
        return c64::new(1.0, 0.0);
    }
    if half_turns == sectors {
        return c64::new(-1.0, 0.0);
    }
    let angle = core::f64::consts::TAU * nodal_diameter as f64 / sectors as f64;
    c64::new(angle.cos(), angle.sin())
}

impl<'a> CyclicPencil<'a> {
    /// Factors the boundary of nodal diameter `nodal_diameter`; with `held` only for problems with held contact.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the structure can move as a rigid body.
    pub(super) fn new(condensed: &'a Condensed<'a>, nodal_diameter: usize, sectors: usize, held: bool) -> Result<Self> {
        let parts = condensed.parts();
        let phase = phase(nodal_diameter, sectors);
        let schur = boundary_pencil(&condensed.schur, parts, phase);
        let factored = if held { parts.face } else { parts.face + parts.contact };
        let contact_columns = schur.get(.., parts.face..).to_owned();
        let lower = if factored == 0 {
            Mat::zeros(0, 0)
        } else {
            let factor = Llt::new(schur.get(..factored, ..factored), Side::Lower);
            factor.map_err(|_| not_positive(nodal_diameter, held))?.L().to_owned()
        };
        let real = phase.im == 0.0;
        let operator = Self { condensed, nodal_diameter, phase, real, lower, factored, contact_columns };
        Ok(operator)
    }

    pub(super) fn parts(&self) -> DofCounts {
        self.condensed.parts()
    }

    /// Returns W x as real columns: real parts, then, unless all is real, imaginary parts. Missing contact rows are
    /// zero.
    pub(super) fn expand(&self, x: MatRef<'_, c64>) -> Mat<f64> {
        self.expand_from(x, self.parts().interior)
    }

    /// Returns W of (inner, face, contact), with the given number of inner rows.
    fn expand_from(&self, x: MatRef<'_, c64>, inner: usize) -> Mat<f64> {
        let (face, width) = (self.parts().face, x.ncols());
        let mut u = Mat::zeros(inner + 2 * face + self.parts().contact, if self.real { width } else { 2 * width });
        let mut put = |row: usize, j: usize, value: c64| {
            u[(row, j)] = value.re;
            if !self.real {
                u[(row, width + j)] = value.im;
            }
        };
        for j in 0..width {
            for i in 0..x.nrows() {
                put(if i < inner + face { i } else { i + face }, j, x[(i, j)]);
                if (inner..inner + face).contains(&i) {
                    put(i + face, j, self.phase * x[(i, j)]);
                }
            }
        }
        u
    }

    /// Returns the first `rows` rows of Wᴴ f for forces f in real columns in the layout of [`Self::expand`].
    fn contract_from(&self, f: MatRef<'_, f64>, inner: usize, rows: usize) -> Mat<c64> {
        let face = self.parts().face;
        let width = if self.real { f.ncols() } else { f.ncols() / 2 };
        let value = |row: usize, j: usize| c64::new(f[(row, j)], if self.real { 0.0 } else { f[(row, width + j)] });
        let back = self.phase.conj();
        Mat::from_fn(rows, width, |i, j| {
            if i < inner {
                value(i, j)
            } else if i < inner + face {
                value(i, j) + back * value(i + face, j)
            } else {
                value(i + face, j)
            }
        })
    }

    fn product(&self, matrix: &SparseMatrix, x: MatRef<'_, c64>) -> Mat<c64> {
        self.contract_from(times(matrix, &self.expand(x)).as_ref(), self.parts().interior, x.nrows())
    }

    /// Returns M_n x.
    pub(super) fn mass(&self, x: MatRef<'_, c64>) -> Mat<c64> {
        self.product(&self.condensed.sector.lean_mass, x)
    }

    /// Returns A_n x.
    pub(super) fn shifted(&self, x: MatRef<'_, c64>) -> Mat<c64> {
        self.product(&self.condensed.shifted, x)
    }

    /// Returns A_n⁻¹ b; with the contact held if b has no contact rows.
    pub(super) fn solve(&self, b: MatRef<'_, c64>) -> Mat<c64> {
        let parts = self.parts();
        let inner = parts.interior;
        let boundary = b.nrows() - inner;
        assert!(boundary <= self.factored, "this operator was factorised for fixed contact nodes only");
        let mut half = self.split(b.get(..inner, ..));
        self.condensed.solve_interior(&mut half);
        let lift = self.contract_from(self.condensed.boundary_rows(half.as_ref()).as_ref(), 0, boundary);
        let mut edge = Mat::from_fn(boundary, b.ncols(), |i, j| b[(inner + i, j)] - lift[(i, j)]);
        self.solve_boundary(&mut edge);
        let mut correction = self.condensed.interior_columns(self.expand_from(edge.as_ref(), 0).as_ref());
        self.condensed.solve_interior(&mut correction);
        half -= correction;
        self.joined(&half, &edge)
    }

    /// Applies S_n⁻¹ in place.
    fn solve_boundary(&self, edge: &mut Mat<c64>) {
        let size = edge.nrows();
        if size == 0 {
            return;
        }
        let lower = self.lower.get(..size, ..size);
        solve_lower_triangular_in_place(lower, edge.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(lower.adjoint(), edge.as_mut(), Par::Seq);
    }

    /// Computes the constraint modes (interior, face, contact) × contact, with unit displacements of one contact dof
    /// while the others are held, and the corresponding stiffness of the contact. These are the constraint modes of K
    /// if the shift is 0.
    pub(crate) fn constraint_modes(&self) -> (Mat<c64>, Mat<c64>) {
        let parts = self.parts();
        let (face, contact) = (parts.face, parts.contact);
        let mut edge = self.contact_columns.get(..face, ..).to_owned();
        self.solve_boundary(&mut edge);
        edge *= faer::Scale(c64::new(-1.0, 0.0));
        let static_stiffness =
            self.contact_columns.get(face.., ..) + self.contact_columns.get(..face, ..).adjoint() * &edge;
        let mut boundary = Mat::zeros(face + contact, contact);
        boundary.get_mut(..face, ..).copy_from(&edge);
        for k in 0..contact {
            boundary[(face + k, k)] = c64::new(1.0, 0.0);
        }
        let mut inner = self.condensed.interior_columns(self.expand_from(boundary.as_ref(), 0).as_ref());
        self.condensed.solve_interior(&mut inner);
        inner *= faer::Scale(-1.0);
        (self.joined(&inner, &boundary), static_stiffness)
    }

    fn split(&self, b: MatRef<'_, c64>) -> Mat<f64> {
        let width = b.ncols();
        let columns = if self.real { width } else { 2 * width };
        Mat::from_fn(b.nrows(), columns, |i, j| if j < width { b[(i, j)].re } else { b[(i, j - width)].im })
    }

    fn joined(&self, inner: &Mat<f64>, edge: &Mat<c64>) -> Mat<c64> {
        let (interior, width) = (inner.nrows(), edge.ncols());
        Mat::from_fn(interior + edge.nrows(), width, |i, j| {
            if i >= interior {
                edge[(i - interior, j)]
            } else {
                c64::new(inner[(i, j)], if self.real { 0.0 } else { inner[(i, width + j)] })
            }
        })
    }
}

/// Computes S_n = WᴴSW over (face, contact).
fn boundary_pencil(schur: &Mat<f64>, parts: DofCounts, phase: c64) -> Mat<c64> {
    let (face, size) = (parts.face, parts.face + parts.contact);
    let back = phase.conj();
    Mat::from_fn(size, size, |i, j| {
        let (row, column) = (i + face, j + face);
        match (i < face, j < face) {
            (true, true) => {
                phase * schur[(i, column)] + back * schur[(row, j)] + (schur[(i, j)] + schur[(row, column)])
            }
            (true, false) => back * schur[(row, column)] + schur[(i, column)],
            (false, true) => phase * schur[(row, column)] + schur[(row, j)],
            (false, false) => c64::new(schur[(row, column)], 0.0),
        }
    })
}

pub(super) fn not_positive(nodal_diameter: usize, held: bool) -> Error {
    let remedy = if held {
        "Clamp the structure, or choose at least three contact nodes per sector that are not on one line"
    } else {
        "Clamp more nodes to prevent rigid-body motion, or none for a free structure"
    };
    Error::NotPositiveDefinite { matrix: format!("K of nodal diameter {nodal_diameter}"), remedy: remedy.into() }
}

/// Multiplies a sparse matrix by a dense one, all columns in few sweeps over the sparse matrix.
pub(super) fn times(matrix: &SparseMatrix, dense: &Mat<f64>) -> Mat<f64> {
    let mut product = Mat::zeros(matrix.order(), dense.ncols());
    let mut first = 0;
    while first < dense.ncols() {
        first += match dense.ncols() - first {
            12.. => sweep::<12>(matrix, dense, first, &mut product),
            4.. => sweep::<4>(matrix, dense, first, &mut product),
            2.. => sweep::<2>(matrix, dense, first, &mut product),
            _ => sweep::<1>(matrix, dense, first, &mut product),
        };
    }
    product
}

fn sweep<const W: usize>(matrix: &SparseMatrix, dense: &Mat<f64>, first: usize, product: &mut Mat<f64>) -> usize {
    let rows: Vec<[f64; W]> = (0..dense.nrows()).map(|i| core::array::from_fn(|c| dense[(i, first + c)])).collect();
    for row in 0..matrix.order() {
        let range = matrix.pattern.starts[row]..matrix.pattern.starts[row + 1];
        let mut sum = [0.0; W];
        for (&i, &value) in matrix.pattern.rows[range.clone()].iter().zip(&matrix.values[range]) {
            let x = &rows[i];
            for c in 0..W {
                sum[c] += value * x[c];
            }
        }
        for c in 0..W {
            product[(row, first + c)] = sum[c];
        }
    }
    W
}
