//! Products of a symmetric matrix of 3 × 3 node blocks with a vector.

use tiprub_model::sparse::SparseMatrix;

/// Symmetric matrix, stored by rows of blocks; the caller can omit clamped dofs.
#[derive(Debug, Clone)]
pub(super) struct BlockMatrix {
    starts: Vec<usize>,
    /// First dof of each block's columns.
    columns: Vec<u32>,
    /// Blocks by rows.
    blocks: Vec<[f64; 9]>,
}

impl BlockMatrix {
    pub(super) fn new(matrix: &SparseMatrix) -> Self {
        let pattern = &matrix.pattern;
        let nodes = matrix.order() / 3;
        let (mut starts, mut columns, mut blocks) = (vec![0], Vec::new(), Vec::new());
        for node in 0..nodes {
            // Column 3·node + j is row 3·node + j: the matrix is symmetric.
            let begin = [0, 1, 2].map(|j| pattern.starts[3 * node + j]);
            let count = pattern.starts[3 * node + 1] - begin[0];
            for place in (0..count).step_by(3) {
                columns.push(u32::try_from(pattern.rows[begin[0] + place]).expect("fewer than 2³² dofs"));
                blocks.push(core::array::from_fn(|k| matrix.values[begin[k / 3] + place + k % 3]));
            }
            starts.push(blocks.len());
        }
        Self { starts, columns, blocks }
    }

    /// Computes result = A x.
    pub(super) fn times(&self, x: &[f64], result: &mut [f64]) {
        for (row, out) in result.chunks_exact_mut(3).enumerate() {
            let mut sum = [0.0; 3];
            for entry in self.starts[row]..self.starts[row + 1] {
                let (block, column) = (&self.blocks[entry], self.columns[entry] as usize);
                let x = &x[column..column + 3];
                sum[0] += block[0] * x[0] + block[1] * x[1] + block[2] * x[2];
                sum[1] += block[3] * x[0] + block[4] * x[1] + block[5] * x[2];
                sum[2] += block[6] * x[0] + block[7] * x[1] + block[8] * x[2];
            }
            out.copy_from_slice(&sum);
        }
    }
}
