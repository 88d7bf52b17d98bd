//! Condensation of a sector onto its faces and contact nodes, once for all nodal diameters.
//!
//! With A = K - σM of the sector, interior I and boundary B = (low face, high face, contact), only B depends on the
//! nodal diameter: the real Schur complement S = A_BB - A_BI A_II⁻¹ A_IB is formed once, and the complex operator of
//! nodal diameter n needs only the small factor of S_n = WᴴSW.

use faer::{Mat, MatRef};
use rayon::prelude::*;

use super::sector::{DofCounts, Sector};
use crate::Result;
use crate::eigen::positive_factor;
use crate::progress::{Listener, ReductionStage, report};
use crate::sparse::{Factor, SparseMatrix, principal_pair};

/// Columns of A_IB that are solved together: wide enough for matrix products, narrow enough for the memory.
const PANEL: usize = 32;
/// Number of panels between two progress reports.
const WAVE: usize = 8;

/// Sector condensed for one shift σ.
#[derive(Debug)]
pub(super) struct Condensed<'a> {
    pub sector: &'a Sector,
    /// σ (rad²/s²).
    pub shift: f64,
    /// A = K - σM, with both faces.
    pub shifted: SparseMatrix,
    /// Factor of A_II; `None` without an interior.
    interior: Option<Factor>,
    /// S, (2 face + contact)².
    pub schur: Mat<f64>,
}

impl<'a> Condensed<'a> {
    /// Factors the interior and forms the Schur complement.
    ///
    /// # Errors
    /// [`crate::Error::NotPositiveDefinite`] if the interior can move with the faces and the contact nodes held.
    pub(super) fn new(sector: &'a Sector, shift: f64, listener: Listener<'_>) -> Result<Self> {
        let shifted =
            if shift == 0.0 { sector.stiffness.clone() } else { sector.stiffness.plus_scaled(-shift, &sector.mass) };
        let interior = if sector.parts.interior == 0 {
            None
        } else {
            let keep: Vec<usize> = (0..sector.parts.interior).collect();
            let (inner, mass) = principal_pair(&shifted, &sector.mass, &keep);
            Some(positive_factor(
                &inner,
                &mass,
                "K_II (stiffness of the sector with faces and contact nodes fixed)",
                "Check the mesh for parts that are connected neither to a cyclic face nor to a clamped node",
            )?)
        };
        let mut condensed = Self { sector, shift, shifted, interior, schur: Mat::zeros(0, 0) };
        condensed.schur = condensed.schur_complement(listener);
        Ok(condensed)
    }

    fn schur_complement(&self, listener: Listener<'_>) -> Mat<f64> {
        let interior = self.sector.parts.interior;
        let boundary: Vec<usize> = (interior..self.shifted.order()).collect();
        let mut schur = self.shifted.block(&boundary, &boundary);
        let panels: Vec<&[usize]> = boundary.chunks(PANEL).collect();
        for (wave, group) in panels.chunks(WAVE).enumerate() {
            report(listener, ReductionStage::ConstraintModes, wave * WAVE, panels.len());
            let parts: Vec<Mat<f64>> = group.par_iter().map(|columns| self.panel(columns)).collect();
            for (columns, part) in group.iter().zip(&parts) {
                for (j, &column) in columns.iter().enumerate() {
                    for i in 0..boundary.len() {
                        schur[(i, column - interior)] -= part[(i, j)];
                    }
                }
            }
        }
        report(listener, ReductionStage::ConstraintModes, 1, 1);
        Mat::from_fn(boundary.len(), boundary.len(), |i, j| 0.5 * (schur[(i, j)] + schur[(j, i)]))
    }

    /// Returns A_BI A_II⁻¹ A_IB of some columns.
    fn panel(&self, columns: &[usize]) -> Mat<f64> {
        let interior = self.sector.parts.interior;
        let mut right = Mat::zeros(interior, columns.len());
        for (j, &column) in columns.iter().enumerate() {
            for entry in self.shifted.pattern.starts[column]..self.shifted.pattern.starts[column + 1] {
                let row = self.shifted.pattern.rows[entry];
                if row < interior {
                    right[(row, j)] = self.shifted.values[entry];
                }
            }
        }
        self.solve_interior(&mut right);
        self.boundary_rows(right.as_ref())
    }

    /// Applies A_II⁻¹ in place.
    pub(crate) fn solve_interior(&self, right: &mut Mat<f64>) {
        if let Some(factor) = &self.interior {
            factor.solve_in_place(right.as_mut());
        }
    }

    /// Returns A_BI t.
    pub(crate) fn boundary_rows(&self, inner: MatRef<'_, f64>) -> Mat<f64> {
        let (interior, order) = (self.sector.parts.interior, self.shifted.order());
        let mut product = Mat::zeros(order - interior, inner.ncols());
        for j in 0..inner.ncols() {
            let column = inner.col(j).try_as_col_major().expect("columns of a dense matrix are contiguous").as_slice();
            for row in interior..order {
                let mut sum = 0.0;
                for entry in self.shifted.pattern.starts[row]..self.shifted.pattern.starts[row + 1] {
                    let i = self.shifted.pattern.rows[entry];
                    if i >= interior {
                        break;
                    }
                    sum += self.shifted.values[entry] * column[i];
                }
                product[(row - interior, j)] = sum;
            }
        }
        product
    }

    /// Returns A_IB u for the boundary displacements u.
    pub(crate) fn interior_columns(&self, boundary: MatRef<'_, f64>) -> Mat<f64> {
        let interior = self.sector.parts.interior;
        let mut product = Mat::zeros(interior, boundary.ncols());
        for j in 0..boundary.ncols() {
            let column = product.col_mut(j).try_as_col_major_mut().expect("columns are contiguous").as_slice_mut();
            for b in 0..boundary.nrows() {
                let factor = boundary[(b, j)];
                for entry in self.shifted.pattern.starts[interior + b]..self.shifted.pattern.starts[interior + b + 1] {
                    let i = self.shifted.pattern.rows[entry];
                    if i >= interior {
                        break;
                    }
                    column[i] += self.shifted.values[entry] * factor;
                }
            }
        }
        product
    }

    /// Returns the numbers of dofs.
    pub(super) fn parts(&self) -> DofCounts {
        self.sector.parts
    }
}
