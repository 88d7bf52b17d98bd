//! Advances modes and contacts to the end of an accepted step.

use super::columns::sum;
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, OctetKernel};
use crate::time::galerkin::basis::{MOST, POINTS};
use crate::time::galerkin::response::TERMS;
use crate::time::galerkin::trial::ForceInterpolation;

/// Advances the modes over a step and returns the damping loss (J).
pub(super) struct Advance<'a> {
    pub trial: &'a mut BladeTrial,
    pub level: &'a BladeLevel,
    /// True if the modal forces act in the step.
    pub pushes: bool,
}

impl OctetKernel for Advance<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<L: Octet>(mut self) -> f64 {
        match (self.pushes, self.level.basis.degree) {
            (false, _) => self.finish::<L, 2>(),
            (true, 2) => self.finish::<L, { TERMS - 1 }>(),
            _ => self.finish::<L, TERMS>(),
        }
    }
}

/// Computes the modal forces of the tried step, as polynomials.
pub(super) struct FindModalForces<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
}

impl OctetKernel for FindModalForces<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { trial, rows, level } = self;
        let BladeTrial { start, multipliers, forces, modal_forces, loaded_rows, .. } = trial;
        loaded_rows.clear();
        let is_constant = level.kind == ForceInterpolation::Constant;
        for block in 0..rows.blocks {
            let mut any = if is_constant { 0 } else { L::zero().less(L::load(&start.multipliers[block])) };
            for point in 0..level.points() {
                any |= L::zero().less(L::load(&multipliers[point * rows.blocks + block]));
            }
            if any == 0 {
                continue;
            }
            for along in [0, 1] {
                let mut values = [L::zero(); POINTS];
                values[0] = L::load(&start.forces[along][block]);
                for point in 1..=level.points() {
                    values[point] = L::load(&forces[along][(point - 1) * rows.blocks + block]);
                }
                let mut terms = [Eight::ZERO; MOST];
                if is_constant {
                    values[1].store(&mut terms[0]);
                } else {
                    for (term, weights) in terms.iter_mut().zip(&level.basis.projection) {
                        sum(&values, weights).store(term);
                    }
                }
                let mut nodes = any;
                while nodes != 0 {
                    let i = nodes.trailing_zeros() as usize;
                    nodes &= nodes - 1;
                    let first = (along * rows.nodes + 8 * block + i) * rows.mode_blocks;
                    loaded_rows.push((first, std::array::from_fn(|term| terms[term].0[i])));
                }
            }
        }
        match level.basis.degree {
            2 => project_forces::<L, 2>(rows, loaded_rows, modal_forces),
            _ => project_forces::<L, MOST>(rows, loaded_rows, modal_forces),
        }
    }
}

/// Projects the polynomials of the nodal forces onto the modes: Σ over loaded rows of shape times force, for each power of θ.
#[inline(always)]
fn project_forces<L: Octet, const TERMS: usize>(
    rows: &BladeRows,
    loaded_rows: &[(usize, [f64; MOST])],
    modal_forces: &mut [Vec<Eight>; MOST],
) {
    for k in 0..rows.mode_blocks {
        let mut sums = [L::zero(); TERMS];
        for (first, terms) in loaded_rows {
            let shape = L::load(&rows.by_row[first + k]);
            for term in 0..TERMS {
                sums[term] = sums[term] + shape * L::splat(terms[term]);
            }
        }
        for (term, sum) in sums.iter().enumerate() {
            sum.store(&mut modal_forces[term][k]);
        }
    }
    modal_forces[TERMS..].iter_mut().for_each(|modal| modal.fill(Eight::ZERO));
}

impl Advance<'_> {
    #[inline(always)]
    fn finish<L: Octet, const COUNT: usize>(&mut self) -> f64 {
        let Self { trial, level, .. } = self;
        let BladeTrial { start, modal_forces, .. } = &mut **trial;
        let [position, velocity] = &mut start.modes;
        let blocks = position.len();
        let mut lost = L::zero();
        for k in 0..blocks {
            let mut terms = [L::zero(); COUNT];
            (terms[0], terms[1]) = (L::load(&position[k]), L::load(&velocity[k]));
            for term in 2..COUNT {
                terms[term] = L::load(&modal_forces[term - 2][k]);
            }
            if level.damped {
                let mut place = 0;
                for row in 0..TERMS {
                    let mut sum = L::zero();
                    for term in row..TERMS {
                        if row < COUNT && term < COUNT {
                            sum = sum + L::load(&level.loss[place * blocks + k]) * terms[term];
                        }
                        place += 1;
                    }
                    if row < COUNT {
                        lost = lost + terms[row] * sum;
                    }
                }
            }
            let mut ends = [L::zero(); 2];
            for (end, table) in ends.iter_mut().zip(&level.end) {
                for (term, row) in terms.iter().zip(table) {
                    *end = *end + L::load(&row[k]) * *term;
                }
            }
            ends[0].store(&mut position[k]);
            ends[1].store(&mut velocity[k]);
        }
        if level.damped { lost.total() } else { 0.0 }
    }
}

/// Makes the contacts at the end of a step the contacts at the start of the next step.
pub(super) struct BeginNextStep<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
}

impl OctetKernel for BeginNextStep<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { trial, rows, level } = self;
        let BladeTrial { start, moved, gaps, sigma, multipliers, forces, .. } = trial;
        let (last, before) = ((level.points() - 1) * rows.blocks, level.points().saturating_sub(2) * rows.blocks);
        let points = &level.basis.points;
        let degree = level.basis.degree;
        let per_second = match level.kind {
            ForceInterpolation::Polynomial => 1.0 / ((points[degree] - points[degree - 1]) * level.step),
            ForceInterpolation::Constant => 0.0,
        };
        start.pushed = false;
        for block in 0..rows.blocks {
            let multiplier = L::load(&multipliers[last + block]);
            let change = multiplier - L::load(&multipliers[before + block]);
            (change * L::splat(per_second)).store(&mut start.slopes[block]);
            start.pushed |= L::zero().less(multiplier) != 0;
            start.multipliers[block] = multipliers[last + block];
            start.gaps[block] = gaps[last + block];
            start.sigma[block] = sigma[last + block];
            for along in [0, 1] {
                start.forces[along][block] = forces[along][last + block];
                start.moved[along][block] = moved[along][last + block];
            }
        }
    }
}
