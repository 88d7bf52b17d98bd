//! Effects of forces on a structure with many contact rows, such as a casing: columns of its flexibility, computed when needed.

use super::ModalBank;
use super::predict::Accumulate;
use crate::math::simd::Kernel;
use crate::modes::bank::LANES;

/// Columns of G = Φ diag(c) Φᵀ: displacements of all contact rows per unit force on one row, held for one step (m/N).
#[derive(Debug, Clone, Default)]
pub(super) struct FlexibilityColumns {
    /// `[column][row]`, padded to whole blocks of rows.
    values: Vec<f64>,
    /// True for columns that have been computed with the current coefficients.
    known: Vec<bool>,
}

impl FlexibilityColumns {
    pub fn new(rows: usize) -> Self {
        Self { values: vec![0.0; rows * padded(rows)], known: vec![false; rows] }
    }

    pub fn forget(&mut self) {
        self.known.fill(false);
    }
}

/// Number of rows, rounded up to whole blocks.
pub(crate) fn padded(rows: usize) -> usize {
    rows.next_multiple_of(LANES)
}

impl ModalBank {
    /// Computes the columns of the flexibility of the three rows of a control point, unless they are known.
    pub(crate) fn find_columns(&mut self, first: usize) {
        for row in first..first + 3 {
            if !std::mem::replace(&mut self.columns.known[row], true) {
                let shapes = &self.contact_rows[row * self.modes..][..self.modes];
                for ((moved, shape), k) in self.correction.iter_mut().zip(shapes).zip(&self.coefficients) {
                    *moved = k.compliance * shape;
                }
                let sums = &mut self.columns.values[row * padded(self.rows)..][..self.rows];
                sums.fill(0.0);
                self.instruction_set.run(Accumulate { sums, matrix: &self.contact_modes, values: &self.correction });
            }
        }
    }

    /// Columns of the flexibility (m/N), see [`ModalBank::find_columns`]; `[column][row]`, rows padded to whole blocks.
    pub(crate) fn columns(&self) -> &[f64] {
        &self.columns.values
    }

    /// Computes the modal force of a load on the rows of some control points (N), three rows from each row of `firsts` on.
    pub(crate) fn modal_force_of(&self, load: &[f64], firsts: &[usize], modal_force: &mut [f64]) {
        let contact_rows = &self.contact_rows;
        self.instruction_set.run(PointForces { load, firsts, contact_rows, modal_force });
    }

    /// Moves a single structure by contact forces given as modal forces; `response` is the response of its rows to them (m).
    pub(crate) fn correct_modal(&mut self, modal_force: &[f64], response: &[f64]) {
        self.respond(0, modal_force, |k, force| k.compliance * force);
        self.move_modes(0);
        for (displacement, response) in self.state.displacement.iter_mut().zip(response) {
            *displacement += response;
        }
    }
}

/// Modal force of forces on control points.
struct PointForces<'a> {
    load: &'a [f64],
    firsts: &'a [usize],
    /// `[row][mode]`.
    contact_rows: &'a [f64],
    modal_force: &'a mut [f64],
}

impl Kernel for PointForces<'_> {
    #[inline(always)]
    fn run(self) {
        let modes = self.modal_force.len();
        self.modal_force.fill(0.0);
        for first in self.firsts {
            let [x, y, z] = [0, 1, 2].map(|component| self.load[first + component]);
            let (a, rest) = self.contact_rows[first * modes..][..3 * modes].split_at(modes);
            let (b, c) = rest.split_at(modes);
            for (((sum, a), b), c) in self.modal_force.iter_mut().zip(a).zip(b).zip(c) {
                *sum += (x * a + y * b) + z * c;
            }
        }
    }
}
