//! Loops over columns and lanes, compiled for every instruction set.

use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use nalgebra::DMatrix;
use std::ops::{AddAssign, Mul};

/// Column lengths are multiples of this number of entries, padded with zeros.
pub(crate) const PADDED: usize = 8;

/// A floating-point number in single or double precision.
pub(crate) trait Real: Copy + Default + AddAssign + Mul<Output = Self> {}

impl Real for f32 {}
impl Real for f64 {}

/// `sums[a][i]` = Σ_t `coefficients[a][t]` · `table[columns[t]·stride + i]` for `N` sets of coefficients, in the order of t.
pub(crate) struct Combine<'a, const N: usize, T = f64> {
    /// Columns, one after the other.
    pub table: &'a [T],
    /// Length of a column, a multiple of [`PADDED`].
    pub stride: usize,
    /// Indices of the columns.
    pub columns: &'a [usize],
    /// Coefficients of the columns, for each set.
    pub coefficients: [&'a [T]; N],
    /// One sum of columns for each set.
    pub sums: [&'a mut [T]; N],
}

impl<const N: usize, T: Real> Combine<'_, N, T> {
    /// Computes `K` registers of all sums from entry `from` on. Loops of fixed length over arrays stay in registers.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "iterators over these arrays do not stay in registers")]
    fn registers<const K: usize>(&mut self, from: usize) {
        let mut sums = [[[T::default(); PADDED]; K]; N];
        for place in 0..self.columns.len() {
            let entries = self.table[self.columns[place] * self.stride + from..].as_chunks::<PADDED>().0;
            let entries: &[[T; PADDED]; K] = entries.first_chunk().expect("every column holds K registers");
            for k in 0..K {
                for a in 0..N {
                    let coefficient = self.coefficients[a][place];
                    for i in 0..PADDED {
                        sums[a][k][i] += entries[k][i] * coefficient;
                    }
                }
            }
        }
        for (target, sums) in self.sums.iter_mut().zip(&sums) {
            target[from..from + K * PADDED].copy_from_slice(sums.as_flattened());
        }
    }
}

impl<const N: usize, T: Real> Kernel for Combine<'_, N, T> {
    #[inline(always)]
    fn run(mut self) {
        let mut from = 0;
        while from + 4 * PADDED <= self.stride {
            self.registers::<4>(from);
            from += 4 * PADDED;
        }
        while from < self.stride {
            self.registers::<1>(from);
            from += PADDED;
        }
    }
}

/// Rounds a number to single precision.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the caller needs no more than single precision")]
pub(crate) fn to_f32(value: f64) -> f32 {
    value as f32
}

/// `to` = `base` − n·u for every lane.
pub(crate) struct Withdraw<'a> {
    pub(super) base: &'a [f64],
    pub(super) normals: &'a [f64],
    pub(super) moved: &'a [f64],
    pub(super) to: &'a mut [f64],
}

/// Splits three rows of lanes.
#[inline(always)]
fn split(values: &[f64], width: usize) -> [&[f64]; 3] {
    [0, 1, 2].map(|component| &values[component * width..][..width])
}

impl Kernel for Withdraw<'_> {
    #[inline(always)]
    fn run(self) {
        let width = self.to.len();
        let ([n0, n1, n2], [u0, u1, u2]) = (split(self.normals, width), split(self.moved, width));
        let base = &self.base[..width];
        for i in 0..width {
            self.to[i] = base[i] - (n0[i] * u0[i] + n1[i] * u1[i] + n2[i] * u2[i]);
        }
    }
}

/// Displacements of all lanes per λ of one lane, from those per force: column = Σ d_c Z_c and closing = n·column.
pub(crate) struct ClosingColumn<'a> {
    pub(super) parts: [&'a [f64]; 3],
    pub(super) direction: Vector3,
    pub(super) normals: &'a [f64],
    pub(super) column: &'a mut [f64],
    pub(super) closing: &'a mut [f64],
}

impl Kernel for ClosingColumn<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { parts: [x, y, z], direction, normals, column, closing } = self;
        let [a, b, c] = direction.into();
        for (column, ((x, y), z)) in column.iter_mut().zip(x.iter().zip(y).zip(z)) {
            *column = a * x + b * y + c * z;
        }
        let width = closing.len();
        let ([n0, n1, n2], [u0, u1, u2]) = (split(normals, width), split(column, width));
        for i in 0..width {
            closing[i] = n0[i] * u0[i] + n1[i] * u1[i] + n2[i] * u2[i];
        }
    }
}

/// y += A x, using only the nonzero entries of x.
pub(crate) struct AddProduct<'a> {
    pub(super) matrix: &'a DMatrix<f64>,
    pub(super) x: &'a [f64],
    pub(super) y: &'a mut [f64],
}

impl Kernel for AddProduct<'_> {
    #[inline(always)]
    fn run(self) {
        let rows = self.matrix.nrows();
        for (column, value) in self.matrix.as_slice().chunks_exact(rows).zip(self.x) {
            if *value != 0.0 {
                for (y, entry) in self.y[..rows].iter_mut().zip(column) {
                    *y += entry * value;
                }
            }
        }
    }
}

/// Computes `sum` = Σ_m `weight(m)`·φ_m φ_mᵀ over the columns φ_m of `shapes`, in the order of m.
pub(crate) struct SumOuterProducts<'a, F> {
    pub(super) shapes: &'a DMatrix<f64>,
    pub(super) weight: F,
    /// Square matrix with as many rows as `shapes`.
    pub(super) sum: &'a mut DMatrix<f64>,
}

impl<F: Fn(usize) -> f64> SumOuterProducts<'_, F> {
    /// Computes the `R` × `C` block of `sum` that begins at `row` and `column`.
    #[inline(always)]
    fn compute_block<const R: usize, const C: usize>(&mut self, row: usize, column: usize) {
        let count = self.shapes.nrows();
        let mut sums = [[0.0; R]; C];
        for (mode, shape) in self.shapes.as_slice().chunks_exact(count).enumerate() {
            let weight = (self.weight)(mode);
            let rows: &[f64; R] = shape[row..].first_chunk().expect("the block is inside the matrix");
            let columns: &[f64; C] = shape[column..].first_chunk().expect("the block is inside the matrix");
            let weighted = rows.map(|entry| weight * entry);
            for c in 0..C {
                for r in 0..R {
                    sums[c][r] += weighted[r] * columns[c];
                }
            }
        }
        let entries = self.sum.as_mut_slice();
        for (c, sums) in sums.iter().enumerate() {
            entries[(column + c) * count + row..][..R].copy_from_slice(sums);
        }
    }
}

impl<F: Fn(usize) -> f64> Kernel for SumOuterProducts<'_, F> {
    #[inline(always)]
    fn run(mut self) {
        const COLUMNS: usize = 4;
        let count = self.shapes.nrows();
        if count < PADDED {
            for column in 0..count {
                (column..count).for_each(|row| self.compute_block::<1, 1>(row, column));
            }
        } else {
            // Blocks on and below the diagonal. The last block of a row or column overlaps the one before it.
            for row in (0..count).step_by(PADDED) {
                let row = row.min(count - PADDED);
                for column in (0..row + PADDED).step_by(COLUMNS) {
                    self.compute_block::<PADDED, COLUMNS>(row, column.min(count - COLUMNS));
                }
            }
        }
        self.sum.fill_upper_triangle_with_lower_triangle();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::InstructionSet;

    /// Numbers whose sum depends on the order of summation.
    fn numbers(count: usize) -> Vec<f64> {
        (0..count).map(|i| f64::from(u32::try_from(i * 7919 % 1009).unwrap()).sqrt() - 15.0).collect()
    }

    #[test]
    fn column_sums_are_correct_with_every_instruction_set() {
        let (stride, columns) = (5 * PADDED, [3, 0, 7, 7, 2]);
        let (table, coefficients) = (numbers(8 * stride), [numbers(5), numbers(9)[4..].to_vec()]);
        let run = |instructions: InstructionSet| {
            let mut sums = [vec![f64::NAN; stride], vec![f64::NAN; stride]];
            let [a, b] = &mut sums;
            let coefficients = [&coefficients[0][..], &coefficients[1][..]];
            instructions.run(Combine { table: &table, stride, columns: &columns, coefficients, sums: [a, b] });
            sums
        };
        let found = run(InstructionSet::Baseline);
        assert_eq!(found, run(InstructionSet::detect()));
        for (sums, coefficients) in found.iter().zip(&coefficients) {
            for (i, sum) in sums.iter().enumerate() {
                let terms = columns.iter().zip(coefficients).map(|(column, c)| table[column * stride + i] * c);
                assert_eq!(sum.to_bits(), terms.fold(0.0, |sum: f64, term| sum + term).to_bits());
            }
        }
    }

    #[test]
    fn force_free_gaps_and_columns_are_normal_projections() {
        let width = 2 * PADDED;
        let (parts, normals) = ([0, 1, 2].map(|i| numbers(3 * width + i)[i..].to_vec()), numbers(3 * width));
        let run = |instructions: InstructionSet| {
            let (mut column, mut closing, mut to) = (vec![0.0; 3 * width], vec![0.0; width], vec![0.0; width]);
            let parts = [&parts[0][..], &parts[1][..], &parts[2][..]];
            let direction = Vector3::new(0.3, -1.1, 0.7);
            instructions.run(ClosingColumn {
                parts,
                direction,
                normals: &normals,
                column: &mut column,
                closing: &mut closing,
            });
            instructions.run(Withdraw { base: &parts[0][..width], normals: &normals, moved: &column, to: &mut to });
            (column, closing, to)
        };
        let (column, closing, to) = run(InstructionSet::Baseline);
        assert_eq!((column.clone(), closing.clone(), to.clone()), run(InstructionSet::detect()));
        for lane in 0..width {
            let along: f64 = (0..3).map(|c| normals[c * width + lane] * column[c * width + lane]).sum();
            assert!((closing[lane] - along).abs() < 1e-12 && (to[lane] - (parts[0][lane] - along)).abs() < 1e-12);
            let expected = 0.3 * parts[0][lane] - 1.1 * parts[1][lane] + 0.7 * parts[2][lane];
            assert!((column[lane] - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn sums_of_outer_products_are_correct_for_all_sizes() {
        for rows in [1, 3, 7, 8, 9, 12, 27, 54] {
            let shapes = DMatrix::from_vec(rows, 5, numbers(5 * rows));
            let weights = numbers(5);
            let run = |instructions: InstructionSet| {
                let mut sum = DMatrix::from_element(rows, rows, f64::NAN);
                instructions.run(SumOuterProducts { shapes: &shapes, weight: |mode| weights[mode], sum: &mut sum });
                sum
            };
            let (found, expected) = (run(InstructionSet::Baseline), {
                let weights = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(weights.clone()));
                &shapes * weights * shapes.transpose()
            });
            assert_eq!(found, run(InstructionSet::detect()));
            assert_eq!(found, found.transpose());
            assert!((&found - &expected).amax() < 1e-13 * expected.amax(), "{rows}");
        }
    }
}
