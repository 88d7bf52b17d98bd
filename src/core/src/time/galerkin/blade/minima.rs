//! Smallest gaps between the points of a step, for nodes that stay open.
//!
//! The polynomial through F at the points shows which nodes may come closer between the points. For these nodes, all
//! modes are evaluated exactly at the ends of equal parts of the step. Polynomials through these gaps give the smallest
//! gap. The amplitudes of the modes determine the number of parts.

use super::columns::{displace, sum};
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::tally::BladeTally;
use super::trial::{BladeTrial, StartContacts};
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::basis::{PLACES, POINTS};
use crate::time::galerkin::trial::{FALLING, NEAR};

/// Smallest and largest number of halvings of a step into the parts at whose ends the motion is evaluated.
pub(super) const MIN_HALVINGS: usize = 2;
pub(super) const MAX_HALVINGS: usize = 7;
/// Largest number of parts of a step.
pub(super) const PARTS: usize = 1 << MAX_HALVINGS;
/// Nodes are followed if they may come closer between the points by more than this fraction of the tolerance.
const FOLLOW_FRACTION: f64 = 0.1;
/// Largest bound on the interpolation error between the ends of parts, as a fraction of the tolerance.
pub(super) const PARTS_FRACTION: f64 = 0.3;

/// Largest error of the interpolated motion of a mode relative to its amplitude. Neither the motion nor its
/// interpolation exceeds the amplitude, so the error is at most twice as large.
const UNRESOLVED: f64 = 2.0;
/// Coefficients of x⁴ and x⁵ in the interpolation error near the middle one of five gaps at equal distances. The
/// neglected fourth derivative causes the x⁴ term, and the error of the third derivative the x⁵ term. Near the first and
/// the last gap, the second coefficient is at most half as large again.
const PART_ERROR: [f64; 2] = [1.0 / 384.0, 1.0 / 48.0];
/// Coefficient of x⁴ in the error of the cubic through the points of a step. It holds for the parabola as well, because
/// the points of a step follow the moments of the motion.
pub(super) const STEP_ERROR: [f64; 2] = [1.0 / 384.0, 0.0];

impl BladeTrial {
    /// Returns the largest interpolation error of the closing displacement of a node between the points of the tried
    /// step (m).
    pub(super) fn unresolved_motion(&mut self, rows: &BladeRows, level: &BladeLevel) -> f64 {
        self.find_interpolation_error(rows, level.step, STEP_ERROR)
    }

    /// Returns how often the tried step is halved into the parts in which nodes are followed. Between the ends of these
    /// parts, the bound on the interpolation error is below a fraction of `tolerance` (m).
    pub(super) fn find_halvings(&mut self, rows: &BladeRows, level: &BladeLevel, tolerance: f64) -> usize {
        let is_fine = |halvings: &usize| {
            let length = level.step * fraction(1, 1 << halvings);
            self.find_interpolation_error(rows, length, PART_ERROR) <= PARTS_FRACTION * tolerance
        };
        (MIN_HALVINGS..MAX_HALVINGS).find(is_fine).unwrap_or(MAX_HALVINGS)
    }
}

/// Finds the nodes that may come closer between the points than at the points, and whose smallest gap an output needs.
/// Returns whether there are such nodes. Records the gaps of all other nodes at the points, and the gaps of all nodes
/// at the end of the step.
pub(super) struct FindMinima<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    pub tally: &'a mut BladeTally,
    /// Gaps below which the smallest gaps are needed (m).
    pub floors: &'a [Eight],
    /// Largest displacement error of a step (m), and largest error of the motion between the points (m).
    pub tolerance: f64,
    pub unresolved: f64,
    /// Ends of the part of the step whose gaps are recorded, as fractions of the step.
    pub ends: [f64; 2],
}

impl OctetKernel for FindMinima<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, level, tally, floors, tolerance, unresolved, ends } = self;
        let mut found = false;
        // The first round uses one bound for all nodes. The second uses a bound for each node, and drops most of the
        // nodes.
        let bounds = &mut trial.path_moved[0];
        bounds.fill(Eight([unresolved; 8]));
        for look in 0..2 {
            found = false;
            for block in 0..rows.blocks {
                trial.followed[block] = choose::<L>(trial, (rows, level, block), tally, floors[block], tolerance, ends);
                found |= trial.followed[block] != 0;
            }
            if !found || look == 1 {
                break;
            }
            displace::<L, 1>(&rows.magnitudes[0], rows.blocks, [&trial.path_modes[0]], &mut trial.path_moved[0]);
        }
        for block in 0..rows.blocks {
            let (followed, last) = (trial.followed[block], level.points() - 1);
            let mut lowest = L::load(&tally.lowest[block]);
            for point in 0..level.points() {
                if !(ends[0]..=ends[1]).contains(&level.place(point)) {
                    continue;
                }
                let lane = point * rows.blocks + block;
                let (steepness, sigma) = (L::load(&rows.steepness[block]), L::load(&trial.sigma[lane]));
                let gap = L::load(&trial.gaps[lane]) / (steepness * steepness + sigma * sigma).sqrt();
                let exact = if point == last { 0xff } else { !followed };
                lowest = L::select(exact, lowest.min(gap), lowest);
            }
            lowest.store(&mut tally.lowest[block]);
        }
        found
    }
}

/// Selects the nodes of a block that may come closer between the points of the step.
#[inline(always)]
fn choose<L: Octet>(
    trial: &BladeTrial,
    (rows, level, block): (&BladeRows, &BladeLevel, usize),
    tally: &BladeTally,
    floor: Eight,
    tolerance: f64,
    range: [f64; 2],
) -> u8 {
    let (basis, count) = (&level.basis, level.points() + 1);
    let slopes = both(|end| basis.slopes_at(range[end]));
    let mut gaps = [L::zero(); POINTS];
    gaps[0] = L::load(&trial.start.gaps[block]);
    let mut pushes = L::zero().less(L::load(&trial.start.multipliers[block]));
    let (mut low, mut ends) = (gaps[0], [gaps[0]; 2]);
    let mut steepest = L::load(&trial.start.sigma[block]).abs();
    for point in 1..count {
        let lane = (point - 1) * rows.blocks + block;
        gaps[point] = L::load(&trial.gaps[lane]);
        pushes |= L::zero().less(L::load(&trial.multipliers[lane]));
        low = low.min(gaps[point]);
        ends[1] = gaps[point];
        steepest = steepest.max(L::load(&trial.sigma[lane]).abs());
    }
    let unresolved = L::load(&trial.path_moved[0][block]);
    let left = sum(&gaps[..count], &basis.left_out).abs() * L::splat(NEAR) + unresolved;
    let mut within = L::splat(f64::INFINITY);
    for (place, weights) in basis.between.iter().enumerate() {
        let theta = (fraction(place, 1) + 0.5) / fraction(PLACES, 1);
        if (range[0]..=range[1]).contains(&theta) {
            within = within.min(sum(&gaps[..count], weights));
        }
    }
    if range[0] > 0.0 || range[1] < 1.0 {
        (low, ends) = (L::splat(f64::INFINITY), [L::zero(); 2]);
        for (end, theta) in ends.iter_mut().zip(range) {
            *end = sum(&gaps[..count], &basis.weights_at(theta));
            low = low.min(*end);
        }
        for (gap, point) in gaps[..count].iter().zip(basis.points) {
            if (range[0]..=range[1]).contains(&point) {
                low = low.min(*gap);
            }
        }
    }
    let deeper = low - within;
    let at_end = ends[1].less(ends[0]);
    let slope = L::select(at_end, sum(&gaps[..count], &slopes[1]), sum(&gaps[..count], &slopes[0])).abs();
    let falls = !L::zero().less(deeper) & (left * L::splat(FALLING)).less(slope);
    let comes = L::splat(FOLLOW_FRACTION * tolerance).less(deeper.max(L::zero()) + left);
    let steepness = L::load(&rows.steepness[block]);
    let size = (steepness * steepness + steepest * steepest).sqrt();
    let bar = L::load(&floor).min(L::load(&tally.lowest[block]));
    let matters = ((low.min(within) - left) / size).less(bar);
    comes & matters & !falls & !pushes & rows.valid(block)
}

/// Bounds the interpolation error of the motion of all modes between points at equal distances: returns the largest
/// bound for the closing displacement of a node (m). The modal forces must be known and the modes not yet advanced.
pub(super) struct FindInterpolationError<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    /// Distance of the points (s), and coefficients of x⁴ and x⁵ in the error of a mode relative to its amplitude. x is
    /// ω times the distance. The error of a mode is at most [`UNRESOLVED`] times its amplitude.
    pub length: f64,
    pub terms: [f64; 2],
    /// True if forces act in the step.
    pub pushes: bool,
}

impl OctetKernel for FindInterpolationError<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<L: Octet>(self) -> f64 {
        let Self { trial, rows, length, terms, pushes } = self;
        let BladeTrial { start: StartContacts { modes: [q, v], .. }, modal_forces, path_modes, .. } = trial;
        let [rates, per_frequency, squares] = &rows.rates;
        let mut error = L::zero();
        for (k, largest) in rows.largest.iter().enumerate() {
            let (q, v, per_frequency) = (L::load(&q[k]), L::load(&v[k]), L::load(&per_frequency[k]));
            let turned = (v + L::load(&rates[k]) * q) * per_frequency;
            let mut amplitude = (q * q + turned * turned).sqrt();
            if pushes {
                let [a, b, c] = modal_forces.each_ref().map(|force| L::load(&force[k]).abs());
                amplitude = amplitude + (a + b + c) * per_frequency * per_frequency * L::splat(2.0);
            }
            let square = L::load(&squares[k]) * L::splat(length * length);
            let share = square * square * (L::splat(terms[0]) + square.sqrt() * L::splat(terms[1]));
            let mode_error = amplitude * share.min(L::splat(UNRESOLVED));
            mode_error.store(&mut path_modes[0][k]);
            error = error + L::load(largest) * mode_error;
        }
        error.total()
    }
}

/// Returns the quotient of two small integers.
#[expect(clippy::cast_precision_loss, reason = "few parts")]
pub(super) fn fraction(part: usize, parts: usize) -> f64 {
    part as f64 / parts as f64
}
