//! Elimination with diagonal pivoting; every entry undergoes the same operations in the same order as in the textbook algorithm.
//!
//! Large systems update the trailing block only after a panel of pivots, so that each pass does more work; until then only the diagonal,
//! from which the next pivot is chosen, and the row and column of the pivot are updated.

use super::{ContactSolver, LARGE, REDUNDANT_PIVOT};
use crate::math::simd::Kernel;

/// Pivots per pass.
const PANEL: usize = 8;

impl ContactSolver {
    /// Eliminates the system of the first `count` entries of `members`; returns its rank. Pivots and right-hand side are then reduced, and
    /// `members` is in the order of the pivots.
    #[inline]
    pub(super) fn eliminate(&mut self, count: usize) -> usize {
        for row in 0..count {
            self.remaining[row] = self.factor[(row, row)];
            self.diagonal[row] = self.remaining[row].abs();
        }
        let (mut start, mut rank) = (0, 0);
        while rank < count {
            let Some(pivot) = self.next_pivot(rank, count) else { break };
            self.exchange_members(rank, pivot, count);
            if count < LARGE {
                self.reduce(rank, count);
                rank += 1;
                continue;
            }
            if start < rank {
                self.catch_up(start, rank, count);
            }
            self.divide(rank, count);
            rank += 1;
            if rank - start == PANEL {
                self.update_trailing(start, rank, count);
                start = rank;
            }
        }
        rank
    }

    /// Reduces the first `count` entries of the right-hand side with the stored factor, by the operations of [`ContactSolver::eliminate`].
    pub(super) fn reduce_right(&mut self, count: usize) {
        let order = self.factor.nrows();
        for (rank, column) in self.factor.as_slice().chunks_exact(order).take(count).enumerate() {
            let (known, below) = self.right[..count].split_at_mut(rank + 1);
            for (right, ratio) in below.iter_mut().zip(&column[rank + 1..count]) {
                *right = reduced(*right, *ratio, known[rank]);
            }
        }
    }

    /// Returns the node with the largest remaining fraction of its own flexibility, since nodes may differ by many orders of magnitude.
    /// `None` if the others are redundant.
    #[inline]
    fn next_pivot(&self, rank: usize, count: usize) -> Option<usize> {
        let fraction = |row: usize| self.remaining[row].abs() / self.diagonal[row];
        let larger = |best: (usize, f64), row: usize| if fraction(row) > best.1 { (row, fraction(row)) } else { best };
        let (pivot, largest) = (rank + 1..count).fold((rank, fraction(rank)), larger);
        // Also false for a node without any flexibility (0/0).
        (largest > REDUNDANT_PIVOT).then_some(pivot)
    }

    /// Applies one pivot of a small system immediately.
    #[inline]
    fn reduce(&mut self, rank: usize, count: usize) {
        let order = self.factor.nrows();
        let (left, trailing) = self.factor.as_mut_slice().split_at_mut((rank + 1) * order);
        let column = &mut left[rank * order..rank * order + count];
        let (pivot, ratios) = (column[rank], &mut column[rank + 1..]);
        let (head, below) = self.right[..count].split_at_mut(rank + 1);
        let mut dense = true;
        for (ratio, right) in ratios.iter_mut().zip(below) {
            *ratio /= pivot;
            dense &= *ratio != 0.0;
            *right = reduced(*right, *ratio, head[rank]);
        }
        for (column, local) in trailing.chunks_exact_mut(order).zip(0..ratios.len()) {
            let (value, entries) = (column[rank], &mut column[rank + 1..count]);
            for (entry, ratio) in entries.iter_mut().zip(&*ratios) {
                *entry = if dense { *entry - ratio * value } else { reduced(*entry, *ratio, value) };
            }
            self.remaining[rank + 1 + local] = entries[local];
        }
    }

    #[inline]
    fn exchange_members(&mut self, a: usize, b: usize, count: usize) {
        if a == b {
            return;
        }
        self.members.swap(a, b);
        self.right.swap(a, b);
        self.diagonal.swap(a, b);
        self.remaining.swap(a, b);
        for other in 0..count {
            self.factor.swap((a, other), (b, other));
        }
        for other in 0..count {
            self.factor.swap((other, a), (other, b));
        }
    }

    /// Applies the pivots from `start` to the column and the row of pivot `rank`.
    fn catch_up(&mut self, start: usize, rank: usize, count: usize) {
        for p in start..rank {
            let value = self.factor[(p, rank)];
            for row in rank..count {
                self.factor[(row, rank)] = reduced(self.factor[(row, rank)], self.factor[(row, p)], value);
            }
        }
        for column in rank + 1..count {
            for p in start..rank {
                self.factor[(rank, column)] =
                    reduced(self.factor[(rank, column)], self.factor[(rank, p)], self.factor[(p, column)]);
            }
        }
    }

    /// Computes the multipliers of a pivot, and updates the right-hand side and the diagonal.
    fn divide(&mut self, rank: usize, count: usize) {
        let (pivot, known) = (self.factor[(rank, rank)], self.right[rank]);
        for row in rank + 1..count {
            let ratio = self.factor[(row, rank)] / pivot;
            self.factor[(row, rank)] = ratio;
            self.right[row] = reduced(self.right[row], ratio, known);
            self.remaining[row] = reduced(self.remaining[row], ratio, self.factor[(rank, row)]);
        }
    }

    fn update_trailing(&mut self, start: usize, rank: usize, count: usize) {
        let order = self.factor.nrows();
        let (left, trailing) = self.factor.as_mut_slice().split_at_mut(rank * order);
        let update = Trailing { order, multipliers: &left[start * order..], trailing, start, rank, count };
        self.instructions.run(update);
    }
}

/// Returns `value − ratio · factor`; a zero ratio ignores infinite factors.
#[inline(always)]
fn reduced(value: f64, ratio: f64, factor: f64) -> f64 {
    if ratio == 0.0 { value } else { value - ratio * factor }
}

/// Application of the pivots `start..rank` to the trailing block, column by column.
struct Trailing<'a> {
    order: usize,
    /// Columns of the pivots.
    multipliers: &'a [f64],
    /// Trailing columns.
    trailing: &'a mut [f64],
    start: usize,
    rank: usize,
    count: usize,
}

impl Kernel for Trailing<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { order, multipliers, trailing, start, rank, count } = self;
        if count == rank {
            return;
        }
        let ratios = |p: usize| &multipliers[p * order + rank..p * order + count];
        let full = rank - start == PANEL && !(0..PANEL).any(|p| ratios(p).contains(&0.0));
        for column in trailing.chunks_exact_mut(order).take(count - rank) {
            let (above, below) = column[..count].split_at_mut(rank);
            if full {
                let factors: [f64; PANEL] = std::array::from_fn(|p| above[start + p]);
                let ratios: [&[f64]; PANEL] = std::array::from_fn(|p| &ratios(p)[..below.len()]);
                for row in 0..below.len() {
                    let mut value = below[row];
                    for p in 0..PANEL {
                        value -= ratios[p][row] * factors[p];
                    }
                    below[row] = value;
                }
            } else {
                for p in 0..rank - start {
                    for (entry, ratio) in below.iter_mut().zip(ratios(p)) {
                        *entry = reduced(*entry, *ratio, above[start + p]);
                    }
                }
            }
        }
    }
}
