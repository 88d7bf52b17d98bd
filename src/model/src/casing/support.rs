//! Reactions of clamped nodes: the rows of the full matrices that a reduction omits, summed to force and moment.

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::scene::rom::{SUPPORT_ROWS, SupportRows};

use super::modal_form::ModalForm;
use crate::assembly::Assembled;
use crate::craig_bampton::CraigBampton;
use crate::sparse::{SparseMatrix, tall_product};

/// Rows of K, M and thermal loads of the clamped nodes, summed to three forces and three moments about the origin:
/// (free dofs × 6) and (patches × 6).
pub(super) struct HeldRows {
    stiffness: Mat<f64>,
    mass: Mat<f64>,
    thermal: Mat<f64>,
}

impl HeldRows {
    /// Sums the rows of the `held` nodes of a model; `loads` covers all dofs.
    pub(super) fn new(full: &Assembled, nodes: &[[f64; 3]], held: &[usize], free: &[usize], loads: &Mat<f64>) -> Self {
        let motions = motions(nodes, held);
        // K_fs r: K and M are symmetric.
        let rows = |matrix: &SparseMatrix| {
            let felt = matrix.times(motions.as_ref());
            Mat::from_fn(free.len(), SUPPORT_ROWS, |i, k| felt[(free[i], k)])
        };
        Self {
            stiffness: rows(&full.stiffness),
            mass: rows(&full.mass),
            thermal: tall_product(loads.as_ref(), motions.as_ref()),
        }
    }

    /// Transforms the rows to the coordinates of the reduced model.
    pub(super) fn reduced(&self, reduced: &CraigBampton, modes: &ModalForm) -> SupportRows {
        let seen = |rows: &Mat<f64>| {
            let rows = tall_product(reduced.transformation.as_ref(), rows.as_ref());
            DMatrix::from_fn(SUPPORT_ROWS, rows.nrows(), |k, i| rows[(i, k)]) * &modes.shapes
        };
        SupportRows {
            stiffness: seen(&self.stiffness),
            mass: seen(&self.mass),
            thermal: DMatrix::from_fn(SUPPORT_ROWS, self.thermal.nrows(), |k, patch| self.thermal[(patch, k)]),
        }
    }
}

/// Returns the rigid motions of the clamped nodes alone: translations along x, y, z and rotations about these axes
/// through the origin; 3·nodes × 6.
fn motions(nodes: &[[f64; 3]], held: &[usize]) -> Mat<f64> {
    let mut motions = Mat::zeros(3 * nodes.len(), SUPPORT_ROWS);
    for &node in held {
        for axis in 0..3 {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            motions[(3 * node + axis, axis)] = 1.0;
            // e_axis x position.
            motions[(3 * node + next, 3 + axis)] = -nodes[node][last];
            motions[(3 * node + last, 3 + axis)] = nodes[node][next];
        }
    }
    motions
}
