//! Assesses a solved step of a blade: its error, the energy of contacts that open or close, and nodes that nearly touch
//! between the points of the step (near misses).

use super::columns::{sum, values_at_points};
use super::solve::Attempt;
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, both};
use crate::time::galerkin::basis::{POINTS, TimeBasis};
use crate::time::galerkin::trial::{KINK, NEAR, TrialResult};

impl Attempt<'_> {
    /// Computes the error, and finds contacts that open or close (switches) and near misses.
    #[inline(always)]
    pub(super) fn judge<L: Octet>(&mut self, result: &mut TrialResult) {
        let (basis, blocks) = (&self.level.basis, self.rows.blocks);
        let count = basis.count();
        let mut switched = L::zero();
        self.trial.impulses.fill(Eight::ZERO);
        self.trial.error_rows.clear();
        for block in 0..blocks {
            let valid = self.rows.valid(block);
            let trial = &mut *self.trial;
            let multipliers = values_at_points::<L>(&trial.start.multipliers, &trial.multipliers, block, count);
            let gaps = values_at_points::<L>(&trial.start.gaps, &trial.gaps, block, count);
            let (mut any, mut all) = (0, valid);
            if trial.pushes {
                for multiplier in &multipliers[..count] {
                    let pushes = L::zero().less(*multiplier) & valid;
                    (any, all) = (any | pushes, all & pushes);
                }
            }
            if any != valid {
                let (near, depth) = comes_near(basis, &gaps, valid & !any);
                result.near |= near;
                result.depth = result.depth.max(depth);
            }
            if any == 0 {
                continue;
            }
            let mixed = any & !all;
            for along in [0, 1] {
                let forces = values_at_points::<L>(&trial.start.forces[along], &trial.forces[along], block, count);
                let left = sum(&forces[..count], &basis.left_out) * L::splat(self.level.step);
                let mut impulse = left;
                if mixed != 0 {
                    let kink = kink(basis, &forces) * L::splat(KINK * self.level.step);
                    let most = left.abs().max(kink);
                    // Radial, tangential and axial errors of a contact that switches do not cancel.
                    let signed = if along == 0 { L::zero() - most } else { most };
                    impulse = L::select(mixed, signed, left);
                }
                let impulses = &mut trial.impulses[along * blocks + block];
                L::select(any, impulse, L::zero()).store(impulses);
                let mut nodes = any;
                while nodes != 0 {
                    let i = nodes.trailing_zeros() as usize;
                    nodes &= nodes - 1;
                    trial.error_rows.push(((along * self.rows.nodes + 8 * block + i) * 2 * blocks, impulses.0[i]));
                }
            }
            if mixed != 0 {
                result.switches = true;
                let mut energy = L::zero();
                for (multiplier, weights) in multipliers[..count].iter().zip(&basis.work) {
                    energy = energy + *multiplier * sum(&gaps[..count], weights);
                }
                switched = switched + L::select(mixed, energy, L::zero());
            }
        }
        result.switched = if result.switches { switched.total() } else { 0.0 };
        if self.trial.pushes {
            result.error = self.error::<L>();
        }
    }

    /// Displacement error that the impulse errors cause (m).
    #[inline(always)]
    fn error<L: Octet>(&mut self) -> f64 {
        let (rows, BladeTrial { impulses, error_rows, .. }) = (self.rows, &mut *self.trial);
        let width = 2 * rows.blocks;
        let mut terms = L::zero();
        let mut first = 0;
        while first + 3 <= width {
            terms = terms + quadratic_form::<L, 3>(&rows.error_form[first..], error_rows, &impulses[first..]);
            first += 3;
        }
        while first < width {
            terms = terms + quadratic_form::<L, 1>(&rows.error_form[first..], error_rows, &impulses[first..]);
            first += 1;
        }
        let square = terms.total();
        square.max(0.0).sqrt()
    }
}

/// Returns the part of the quadratic form of the impulse errors that the first `B` blocks of columns contribute. `form` starts at
/// the first of these columns. `error_rows` lists the rows with an error, as in [`BladeTrial`].
#[inline(always)]
fn quadratic_form<L: Octet, const B: usize>(form: &[Eight], error_rows: &[(usize, f64)], impulses: &[Eight]) -> L {
    let mut sums = [L::zero(); B];
    for (row, impulse) in error_rows {
        let (entries, impulse) = (&form[*row..][..B], L::splat(*impulse));
        for b in 0..B {
            sums[b] = sums[b] + L::load(&entries[b]) * impulse;
        }
    }
    let mut terms = L::zero();
    for b in 0..B {
        terms = terms + sums[b] * L::load(&impulses[b]);
    }
    terms
}

/// Returns whether a gap of the selected nodes comes near zero between the points, and the largest penetration there
/// (m).
#[inline(always)]
fn comes_near<L: Octet>(basis: &TimeBasis, gaps: &[L; POINTS], nodes: u8) -> (bool, f64) {
    let gaps = &gaps[..basis.count()];
    let left = sum(gaps, &basis.left_out).abs() * L::splat(NEAR);
    let inner = both(|of| sum(gaps, &basis.inner[of]));
    let candidates = gaps[0].min(gaps[basis.degree]).min(inner[0].min(inner[1])).less(left) & nodes;
    if candidates == 0 {
        return (false, 0.0);
    }
    let mut lowest = L::splat(f64::INFINITY);
    for place in &basis.between {
        lowest = lowest.min(sum(gaps, place));
    }
    let depth = L::select(candidates, L::zero() - lowest, L::zero()).max(L::zero());
    (lowest.less(left) & candidates != 0, depth.array().into_iter().fold(0.0, f64::max))
}

/// Largest change of the slope of values at the points. Values that are zero at an end of the step stay zero beyond it.
#[inline(always)]
fn kink<L: Octet>(basis: &TimeBasis, values: &[L; POINTS]) -> L {
    let last = basis.degree;
    let slope = |i: usize| (values[i + 1] - values[i]) * L::splat(1.0 / (basis.points[i + 1] - basis.points[i]));
    let is_zero = |value: L| !(L::zero().less(value) | value.less(L::zero()));
    let mut before = L::select(is_zero(values[0]), L::zero(), slope(0));
    let mut most = L::zero();
    for i in 0..=last {
        let after = if i < last { slope(i) } else { L::select(is_zero(values[last]), L::zero(), slope(last - 1)) };
        most = most.max((after - before).abs());
        before = after;
    }
    most
}
