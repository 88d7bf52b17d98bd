//! Smallest gaps between the points of a step, for nodes that stay open.
//!
//! The polynomial through F at the points shows which nodes may come closer between the points. For these nodes, all
//! modes are evaluated exactly at the ends of equal parts of the step. Polynomials through these gaps give the smallest
//! gap. The amplitudes of the modes determine the number of parts.

use super::columns::{displace, sum};
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::trial::{BladeTrial, StartContacts};
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::system::structure::UNKNOWN_GAP;
use crate::time::galerkin::basis::{MOST, PLACES, POINTS};
use crate::time::galerkin::parts::FOLLOW_FRACTION;
use crate::time::galerkin::trial::{FALLING, NEAR};

impl BladeTrial {
    /// Bounds the interpolation error (m) of all modes between points at a distance `length` (s). If forces act, `length` must
    /// be the length of the step.
    pub(super) fn find_interpolation_error(&mut self, rows: &BladeRows, length: f64) -> f64 {
        let forced_step = self.pushes.then_some(length);
        self.unresolved = None;
        self.instructions.run_octets(FindInterpolationError { trial: self, rows, length, forced_step })
    }
}

/// Selects the nodes that stay open and may come closer between the points than at the points, if their smallest gap is
/// needed. Returns whether there are such nodes.
pub(super) struct SelectFollowed<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    /// Gaps below which the smallest gaps are needed (m).
    pub thresholds: &'a [Eight],
    /// Largest displacement error of a step (m), and largest error of the motion between the points (m).
    pub tolerance: f64,
    pub unresolved: f64,
    /// Ends of the part of the step that is searched, as fractions of the step.
    pub ends: [f64; 2],
    /// Nodes that are searched.
    pub search: Search,
}

/// Nodes whose smallest gap within a step is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Search {
    /// Nodes that stay open.
    Open,
    /// All nodes.
    All,
}

impl OctetKernel for SelectFollowed<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, level, thresholds, tolerance, unresolved, ends, search } = self;
        // A coarse test with one bound for all nodes excludes most steps.
        let bounds = &mut trial.path_moved[0];
        bounds[..rows.blocks].fill(Eight([unresolved; 8]));
        let mut candidates = 0;
        for block in 0..rows.blocks {
            trial.followed[block] = 0;
            let gaps = BlockGaps::<L>::new(trial, rows, level, block).searched(search, rows, block);
            candidates |= gaps.may_be_below(L::load(&thresholds[block]));
        }
        if candidates == 0 {
            return false;
        }
        displace::<L, 1, 1>([&rows.magnitudes[0]], rows.blocks, [&trial.mode_bounds], [&mut trial.path_moved[0]]);
        let mut found = 0;
        for block in 0..rows.blocks {
            let gaps = BlockGaps::<L>::new(trial, rows, level, block).searched(search, rows, block);
            let threshold = L::load(&thresholds[block]);
            let candidates = gaps.may_be_below(threshold);
            if candidates != 0 {
                trial.followed[block] = candidates & gaps.select_nodes(level, threshold, tolerance, ends);
                found |= trial.followed[block];
            }
        }
        found != 0
    }
}

/// Records the gaps of all nodes at the end of the step. At the other points, only the nodes that are not followed count.
pub(super) struct RecordPoints<'a> {
    pub trial: &'a BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    /// Smallest gaps so far (m).
    pub lowest: &'a mut [Eight],
    /// Ends of the part of the step whose gaps are recorded, as fractions of the step.
    pub ends: [f64; 2],
}

impl OctetKernel for RecordPoints<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { trial, rows, level, lowest, ends } = self;
        for block in 0..rows.blocks {
            let (followed, last) = (trial.followed[block], level.points() - 1);
            let mut least = L::load(&lowest[block]);
            for point in 0..level.points() {
                if !(ends[0]..=ends[1]).contains(&level.place(point)) {
                    continue;
                }
                let lane = point * rows.blocks + block;
                let (steepness, sigma) = (L::load(&rows.steepness[block]), L::load(&trial.sigma[lane]));
                let gap = L::load(&trial.gaps[lane]) / (steepness * steepness + sigma * sigma).sqrt();
                let exact = if point == last { 0xff } else { !followed };
                least = L::select(exact, least.min(gap), least);
            }
            least.store(&mut lowest[block]);
        }
    }
}

/// Gaps of a block of eight nodes at the start and at the points of a step.
pub(super) struct BlockGaps<L> {
    /// F (m), its smallest value, and a lower bound of the polynomial through all values.
    gaps: [L; POINTS],
    low: L,
    least: L,
    /// Steepness M of the surface and the largest |σ|.
    steepness: L,
    steepest: L,
    /// Bound of the interpolation error of the polynomial through `gaps` between the points (m).
    error_bound: L,
    /// Nodes that stay open.
    open: u8,
}

impl<L: Octet> BlockGaps<L> {
    /// Reads the gaps of a block. Its interpolation errors must be in `path_moved`.
    #[inline(always)]
    pub fn new(trial: &BladeTrial, rows: &BladeRows, level: &BladeLevel, block: usize) -> Self {
        let count = level.points() + 1;
        let mut gaps = [L::zero(); POINTS];
        gaps[0] = L::load(&trial.start.gaps[block]);
        let mut pushes = L::zero().less(L::load(&trial.start.multipliers[block]));
        let mut low = gaps[0];
        let mut steepest = L::load(&trial.start.sigma[block]).abs();
        for point in 1..count {
            let lane = (point - 1) * rows.blocks + block;
            gaps[point] = L::load(&trial.gaps[lane]);
            pushes |= L::zero().less(L::load(&trial.multipliers[lane]));
            low = low.min(gaps[point]);
            steepest = steepest.max(L::load(&trial.sigma[lane]).abs());
        }
        let unresolved = L::load(&trial.path_moved[0][block]);
        let error_bound = sum(&gaps[..count], &level.basis.left_out).abs() * L::splat(NEAR) + unresolved;
        let inner = both(|of| sum(&gaps[..count], &level.basis.inner[of]));
        let least = inner[0].min(inner[1]).min(low);
        let (steepness, open) = (L::load(&rows.steepness[block]), !pushes & rows.valid(block));
        Self { gaps, low, least, steepness, steepest, error_bound, open }
    }

    /// Replaces the nodes that stay open by those that are searched.
    #[inline(always)]
    fn searched(self, search: Search, rows: &BladeRows, block: usize) -> Self {
        let open = if search == Search::All { rows.valid(block) } else { self.open };
        Self { open, ..self }
    }

    /// Returns the nodes whose smallest gap may be below `threshold` (m).
    #[inline(always)]
    fn may_be_below(&self, threshold: L) -> u8 {
        // The gap is F/N with M ≤ N ≤ M + |σ|.
        let is_negative = threshold.less(L::zero());
        let size = L::select(is_negative, self.steepness, self.steepness + self.steepest);
        (self.least - self.error_bound).less(threshold * size) & self.open
    }

    /// Returns lower bounds of the gaps of the nodes (m); `-UNKNOWN_GAP` for nodes that may touch.
    #[inline(always)]
    pub fn lower_bound(&self) -> L {
        let smallest = self.least - self.error_bound;
        let is_positive = L::zero().less(smallest) & self.open;
        L::select(is_positive, smallest / (self.steepness + self.steepest), L::splat(-UNKNOWN_GAP))
    }

    /// Selects the nodes that may come closer between the points of the step, and below `threshold` (m).
    #[inline(always)]
    fn select_nodes(&self, level: &BladeLevel, threshold: L, tolerance: f64, range: [f64; 2]) -> u8 {
        let (basis, count) = (&level.basis, level.points() + 1);
        let slopes = both(|end| basis.slopes_at(range[end]));
        let gaps = &self.gaps[..count];
        let mut within = L::splat(f64::INFINITY);
        for (place, weights) in basis.between.iter().enumerate() {
            let theta = (fraction(place, 1) + 0.5) / fraction(PLACES, 1);
            if (range[0]..=range[1]).contains(&theta) {
                within = within.min(sum(gaps, weights));
            }
        }
        let (mut low, mut ends) = (self.low, [gaps[0], gaps[count - 1]]);
        if range[0] > 0.0 || range[1] < 1.0 {
            (low, ends) = (L::splat(f64::INFINITY), [L::zero(); 2]);
            for (end, theta) in ends.iter_mut().zip(range) {
                *end = sum(gaps, &basis.weights_at(theta));
                low = low.min(*end);
            }
            for (gap, point) in gaps.iter().zip(basis.points) {
                if (range[0]..=range[1]).contains(&point) {
                    low = low.min(*gap);
                }
            }
        }
        let deeper = low - within;
        let at_end = ends[1].less(ends[0]);
        let slope = L::select(at_end, sum(gaps, &slopes[1]), sum(gaps, &slopes[0])).abs();
        let falls = !L::zero().less(deeper) & (self.error_bound * L::splat(FALLING)).less(slope);
        let comes = L::splat(FOLLOW_FRACTION * tolerance).less(deeper.max(L::zero()) + self.error_bound);
        let size = (self.steepness * self.steepness + self.steepest * self.steepest).sqrt();
        let matters = ((low.min(within) - self.error_bound) / size).less(threshold);
        comes & matters & !falls & self.open
    }
}

/// Bounds the interpolation error of the motion of all modes between points at equal distances: returns the largest
/// bound for the closing displacement of a node (m). The modal forces must be known and the modes not yet advanced.
pub(super) struct FindInterpolationError<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    /// Distance of the points (s).
    pub length: f64,
    /// Length of the step (s) if forces act in it.
    pub forced_step: Option<f64>,
}

impl OctetKernel for FindInterpolationError<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<L: Octet>(self) -> f64 {
        let Self { trial, rows, length, forced_step } = self;
        let BladeTrial { start, modal_forces, mode_bounds, amplitudes, .. } = trial;
        let mut error = L::zero();
        for (k, largest) in rows.largest.iter().enumerate() {
            let relative = relative_error(L::load(&rows.rates[3][k]) * L::splat(length));
            let amplitude = amplitude::<L>(rows, start, modal_forces, k, forced_step);
            let (mode_error, largest) = (amplitude * relative, L::load(largest));
            mode_error.store(&mut mode_bounds[k]);
            (largest * amplitude).store(&mut amplitudes[k]);
            error = error + largest * mode_error;
        }
        error.total()
    }
}

/// Returns the steady motion of eight modes under the modal forces of a step of length `step` (s), as coefficients of powers
/// of the time since its start.
#[inline(always)]
pub(super) fn steady_motion<L: Octet>(
    rows: &BladeRows,
    modal_forces: &[Vec<Eight>],
    block: usize,
    step: f64,
) -> [L; MOST] {
    let (per_step, twice_rate) = (1.0 / step, L::load(&rows.rates[0][block]) * L::splat(2.0));
    let per_square = L::load(&rows.rates[4][block]);
    let [one, two] = both(|term| L::load(&modal_forces[term][block]));
    let square = L::load(&modal_forces[2][block]) * L::splat(per_step * per_step) * per_square;
    let linear = (two * L::splat(per_step) - L::splat(2.0) * twice_rate * square) * per_square;
    [(one - twice_rate * linear - L::splat(2.0) * square) * per_square, linear, square]
}

/// Bounds the amplitudes with which eight modes vibrate about their steady motion in a step.
#[inline(always)]
pub(super) fn amplitude<L: Octet>(
    rows: &BladeRows,
    start: &StartContacts,
    modal_forces: &[Vec<Eight>],
    block: usize,
    forced_step: Option<f64>,
) -> L {
    let [rates, per_frequency, ..] = &rows.rates;
    let [mut q, mut v] = both(|of| L::load(&start.modes[of][block]));
    if let Some(step) = forced_step {
        let [position, velocity, _] = steady_motion::<L>(rows, modal_forces, block, step);
        (q, v) = (q - position, v - velocity);
    }
    let turned = ((v + L::load(&rates[block]) * q) * L::load(&per_frequency[block])).abs();
    let position = q.abs();
    // At most 8 % above √(position² + turned²), but without a square root.
    position.max(turned) + L::splat(std::f64::consts::SQRT_2 - 1.0) * position.min(turned)
}

/// Bounds the error of the cubic between two times, relative to the amplitude of a mode. `x` is the frequency of the mode
/// times the time between them. The bound also holds for the cubic and the parabola through the points of a step, because
/// these points preserve the moments of the motion.
#[inline(always)]
pub(super) fn relative_error<L: Octet>(x: L) -> L {
    let square = x * x;
    // The motion is bounded by the amplitude, and a cubic with its rates at both ends exceeds the amplitude only a little.
    (square * square * L::splat(1.0 / 384.0)).min(L::splat(2.0) + L::splat(0.3) * x)
}

/// Returns the quotient of two small integers.
#[expect(clippy::cast_precision_loss, reason = "few parts")]
pub(super) fn fraction(part: usize, parts: usize) -> f64 {
    part as f64 / parts as f64
}
