//! Loops over the contacts on a surface and the rows of the structure that carries it.

use super::Touch;
use crate::math::octet::{Octet, OctetKernel};
use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use crate::modes::bank::LANES;
use nalgebra::DMatrix;

/// Columns that are computed together, so that flexibilities are loaded once for all of them.
const TOGETHER: usize = 4;
/// Largest number of rows of the control points around a contact.
const ROWS: usize = 48;

/// Displacements of all rows of a structure per unit force along the columns of contacts with the same control points.
pub(super) struct MoveSurface<'a> {
    pub touches: &'a [Touch],
    /// Fixed directions of the columns, `per` for each contact.
    pub columns: &'a [Vector3],
    pub per: usize,
    /// Columns of the flexibility (m/N), `stride` rows each.
    pub flexibility: &'a [f64],
    pub stride: usize,
    /// `[column][row]`.
    pub moved: &'a mut [f64],
}

impl OctetKernel for MoveSurface<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(mut self) {
        let mut column = 0;
        while column < self.columns.len() {
            column += match self.columns.len() - column {
                4.. => self.fill::<L, TOGETHER>(column),
                3 => self.fill::<L, 3>(column),
                2 => self.fill::<L, 2>(column),
                _ => self.fill::<L, 1>(column),
            };
        }
    }
}

impl MoveSurface<'_> {
    /// Fills `COUNT` columns from `first` on. Returns `COUNT`.
    #[inline(always)]
    fn fill<L: Octet, const COUNT: usize>(&mut self, first: usize) -> usize {
        let (stride, points) = (self.stride, self.touches[0].weights.len);
        let mut forces = [[0.0; ROWS]; COUNT];
        for offset in 0..COUNT {
            let (touch, direction) = (&self.touches[(first + offset) / self.per], self.columns[first + offset]);
            for (point, weight) in touch.weights.values[..points].iter().enumerate() {
                for component in 0..3 {
                    forces[offset][3 * point + component] = weight * direction[component];
                }
            }
        }
        let firsts = &self.touches[0].firsts[..points];
        for block in 0..stride / LANES {
            let mut sums = [L::zero(); COUNT];
            for (point, first) in firsts.iter().enumerate() {
                for component in 0..3 {
                    let start = (first + component) * stride + block * LANES;
                    let Some(flexibility) = self.flexibility[start..].first_chunk::<LANES>() else { continue };
                    let flexibility = L::read(flexibility);
                    for offset in 0..COUNT {
                        sums[offset] = sums[offset] + flexibility * L::splat(forces[offset][3 * point + component]);
                    }
                }
            }
            for offset in 0..COUNT {
                let (blocks, _) = self.moved[(first + offset) * stride..][..stride].as_chunks_mut::<LANES>();
                sums[offset].write(&mut blocks[block]);
            }
        }
        COUNT
    }
}

/// Adds the displacements at the contacts to the Delassus matrix.
pub(super) struct AddDelassus<'a> {
    pub touches: &'a [Touch],
    /// Fixed directions of the rows, `per` for each contact.
    pub rows: &'a [Vector3],
    pub per: usize,
    /// Displacements of control points per unit force along the columns (m/N), `[position][component][column]`.
    pub seen: &'a [f64],
    /// Number of columns, padded.
    pub width: usize,
    pub matrix: &'a mut DMatrix<f64>,
}

impl Kernel for AddDelassus<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { touches, rows, per, seen, width, matrix } = self;
        let (order, columns) = (matrix.nrows(), rows.len());
        let entries = matrix.as_mut_slice();
        for (touch, rows) in touches.iter().zip(rows.chunks_exact(per)) {
            for (along, direction) in rows.iter().enumerate() {
                let row = per * touch.member + along;
                for start in (0..columns).step_by(LANES) {
                    let mut sums = [0.0; LANES];
                    for (slot, weight) in touch.slots.iter().zip(&touch.weights.values).take(touch.weights.len) {
                        for component in 0..3 {
                            let value = weight * direction[component];
                            let moved = &seen[(3 * slot + component) * width + start..][..LANES];
                            for lane in 0..LANES {
                                sums[lane] += value * moved[lane];
                            }
                        }
                    }
                    for (column, sum) in (start..columns).zip(sums) {
                        let column = per * touches[column / per].member + column % per;
                        entries[column * order + row] += sum;
                    }
                }
            }
        }
    }
}
