//! What held nodes feel: the rows of the full matrices there, which a reduction leaves out, summed to force and moment.

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::rom::{SUPPORT_ROWS, SupportRows};

use super::modal_form::ModalForm;
use crate::assembly::Assembled;
use crate::craig_bampton::CraigBampton;
use crate::sparse::{SparseMatrix, tall_product};

/// Rows of K, M and thermal loads of the held nodes, summed to three forces and three moments about the origin: over the free
/// dofs × 6, and patches × 6.
pub(super) struct HeldRows {
    stiffness: Mat<f64>,
    mass: Mat<f64>,
    thermal: Mat<f64>,
}

impl HeldRows {
    /// Makes the rows of the `held` nodes of a model; `loads` of all dofs.
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

    /// In the coordinates of the reduced model.
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

/// Rigid motions of the held nodes alone: along x, y, z, and about them through the origin; 3·nodes × 6.
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
