//! Control points of a uniform cubic spline through given points, one direction after the other.

use nalgebra::DMatrix;

use super::add_scaled;

/// Linear map from nodes to carriers of a grid: A₁⁻¹ ⊗ A₂⁻¹.
#[derive(Debug, Clone)]
pub(super) struct Tensor {
    /// A₁⁻¹, rows × rows.
    along: DMatrix<f64>,
    /// A₂⁻¹, columns × columns.
    across: DMatrix<f64>,
}

/// Returns the inverse of the matrix that maps control points to points: (Q_{i−1} + 4 Q_i + Q_{i+1})/6, and Q itself
/// at the ends, where the second derivative Q_{−1} − 2 Q₀ + Q₁ is zero.
fn inverse(count: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::identity(count, count);
    for i in 1..count - 1 {
        matrix[(i, i - 1)] = 1.0 / 6.0;
        matrix[(i, i)] = 4.0 / 6.0;
        matrix[(i, i + 1)] = 1.0 / 6.0;
    }
    matrix.try_inverse().expect("the matrix is diagonally dominant")
}

impl Tensor {
    pub(super) fn interpolating(rows: usize, columns: usize) -> Self {
        Self { along: inverse(rows), across: inverse(columns) }
    }

    pub(super) fn identity(rows: usize, columns: usize) -> Self {
        Self { along: DMatrix::identity(rows, rows), across: DMatrix::identity(columns, columns) }
    }

    pub(super) fn apply(&self, values: &[[f64; 3]]) -> Vec<[f64; 3]> {
        product(&self.along, &self.across, values)
    }

    pub(super) fn apply_transposed(&self, values: &[[f64; 3]]) -> Vec<[f64; 3]> {
        product(&self.along.transpose(), &self.across.transpose(), values)
    }
}

fn product(along: &DMatrix<f64>, across: &DMatrix<f64>, values: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let (rows, columns) = (along.nrows(), across.nrows());
    let mut half = vec![[0.0; 3]; values.len()];
    for i in 0..rows {
        for j in 0..columns {
            let sum = &mut half[i * columns + j];
            for k in (0..columns).filter(|k| across[(j, *k)] != 0.0) {
                add_scaled(sum, values[i * columns + k], across[(j, k)]);
            }
        }
    }
    let mut full = vec![[0.0; 3]; values.len()];
    for i in 0..rows {
        for k in (0..rows).filter(|k| along[(i, *k)] != 0.0) {
            for j in 0..columns {
                add_scaled(&mut full[i * columns + j], half[k * columns + j], along[(i, k)]);
            }
        }
    }
    full
}
