//! Smallest gaps of the nodes within a tried step.

use super::follow::Follow;
use super::minima::{RecordPoints, Search};
use super::span::{Blade, BladeInSpan, BladePlace, RecordScope, centred_drive_at, drive_at};
use super::surface::{DriveRate, PointDrive};
use super::tables::BladeTables;
use super::trial::BladeTrial;
use crate::math::octet::Eight;
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::parts::{FOLLOW_FRACTION, MINIMUM_FRACTION};
use crate::time::galerkin::span::SpanStep;
use crate::time::galerkin::tables::HALVINGS;
use crate::time::galerkin::trial::{ForceInterpolation, TrialResult};

/// Safety factor of bounds for an off-centre shaft. It covers the smaller effect of the eccentricity at twice the rotor angle.
const SAFETY: f64 = 2.0;

/// Rates of the prescribed motion are differences over this fraction of a span.
const RATE_FRACTION: f64 = 1.0 / 64.0;

impl BladeInSpan<'_> {
    /// Records the smallest gaps between two fractions of a tried step. If the step does not resolve the motion, only the gaps
    /// at the points are recorded.
    pub(super) fn record_gaps(&mut self, step: SpanStep, kind: ForceInterpolation, is_resolved: bool, ends: [f64; 2]) {
        let Blade { trial, tally, floors, thresholds, .. } = &mut *self.blade;
        let (rows, level) = (&self.tables.rows, self.tables.level(step.level, kind));
        trial.followed.fill(0);
        find_thresholds(thresholds, floors, &tally.lowest);
        let found =
            is_resolved && trial.select_followed((rows, level), thresholds, self.goal.tolerance, (Search::Open, ends));
        let instructions = trial.instructions;
        instructions.run_octets(RecordPoints { trial, rows, level, lowest: &mut tally.lowest, ends });
        if found {
            self.follow(step, kind, ends);
        }
    }

    /// Records the smallest gaps of the followed nodes between two fractions of a step.
    pub(super) fn follow(&mut self, step: SpanStep, kind: ForceInterpolation, ends: [f64; 2]) {
        let Blade { trial, tally, floors, .. } = &mut *self.blade;
        let (tolerance, refine_below) = (self.goal.tolerance, f64::NEG_INFINITY);
        let path = FollowedPath { place: &self.place, drives: &self.drives, step, kind, tolerance, refine_below };
        path.follow(trial, self.tables, [&mut tally.lowest, floors], ends);
    }

    /// Finds the smallest gaps between the points of a tried step. Writes the largest penetration to `result` if it exceeds the
    /// tolerance. Gaps above that limit are found only if the step may be recorded.
    pub(super) fn find_step_minima(&mut self, step: SpanStep, kind: ForceInterpolation, result: &mut TrialResult) {
        let (tolerance, whole) = (self.goal.tolerance, [0.0, 1.0]);
        let may_be_recorded = self.recorded != RecordScope::WorkOnly && self.ends_within(step);
        let (tables, Blade { trial, tally, floors, thresholds, step_minima, .. }) = (self.tables, &mut *self.blade);
        step_minima.fill(Eight([f64::INFINITY; 8]));
        trial.followed.fill(0);
        if !result.solved || !result.resolves_motion(kind, tolerance) {
            return;
        }
        // Recording must not change the penetrations that are found.
        let depth_threshold = (MINIMUM_FRACTION + FOLLOW_FRACTION - 1.0) * tolerance;
        thresholds.fill(Eight([f64::NEG_INFINITY; 8]));
        if may_be_recorded {
            find_thresholds(thresholds, floors, &tally.lowest);
        }
        let limits = thresholds.iter_mut().flat_map(|block| &mut block.0);
        limits.for_each(|threshold| *threshold = threshold.max(depth_threshold));
        if trial.pushes() {
            trial.find_modal_forces(&tables.rows, tables.level(step.level, kind));
        }
        let level = tables.level(step.level, kind);
        trial.limit_closed((&tables.rows, level), thresholds, depth_threshold, tolerance);
        if trial.select_followed((&tables.rows, level), thresholds, tolerance, (Search::All, whole)) {
            let refine_below = depth_threshold - FOLLOW_FRACTION * tolerance;
            let path = FollowedPath { place: &self.place, drives: &self.drives, step, kind, tolerance, refine_below };
            path.follow(trial, tables, [step_minima, thresholds], whole);
            let lowest = step_minima.iter().flat_map(|block| block.0).fold(f64::INFINITY, f64::min);
            // The recorded gaps of nodes in contact are those at the points.
            trial.forget_closed((&tables.rows, level), step_minima);
            if lowest < -tolerance && step.level < HALVINGS {
                result.depth = result.depth.max(-lowest);
            }
        }
    }

    /// Records the smallest gaps of the tried step, as found by [`find_step_minima`](Self::find_step_minima), and the gaps at its
    /// points.
    pub(super) fn record_step_minima(&mut self, step: SpanStep, kind: ForceInterpolation) {
        let Blade { trial, tally, step_minima, .. } = &mut *self.blade;
        let (rows, level) = (&self.tables.rows, self.tables.level(step.level, kind));
        let (instructions, lowest) = (trial.instructions, &mut tally.lowest);
        include(lowest, step_minima);
        instructions.run_octets(RecordPoints { trial, rows, level, lowest, ends: [0.0, 1.0] });
    }
}

/// Writes the gaps below which smallest gaps are needed (m): the floor or, if smaller, the smallest gap so far.
fn find_thresholds(thresholds: &mut [Eight], floors: &[Eight], lowest: &[Eight]) {
    thresholds.copy_from_slice(floors);
    include(thresholds, lowest);
}

/// Replaces each number by the other one if that is smaller.
pub(super) fn include(numbers: &mut [Eight], others: &[Eight]) {
    for (number, other) in numbers.iter_mut().zip(others) {
        number.0.iter_mut().zip(other.0).for_each(|(number, other)| *number = number.min(other));
    }
}

impl BladePlace<'_> {
    /// Bounds the error (m) of the cubic through the shape of the surface and its rate at two fractions of the span:
    /// the parts that are proportional to the length of the interval, its square, and its cube or higher powers.
    pub(super) fn shape_errors(&self, ends: [f64; 2]) -> [f64; 3] {
        let [from, to] = ends.map(|end| drive_at(self, end).0);
        let (surface, mut turn) = (&self.gap.surface, (to.turned - from.turned).abs());
        let mut eccentric = 0.0;
        if self.course.is_off_centre() {
            let (shaft, per_radius) = (self.course.shaft_bounds(ends), &self.gap.layout.per_radius);
            turn += SAFETY * shaft.swing * per_radius.iter().fold(0.0, |most, value| value.max(most));
            eccentric = SAFETY * shaft.fourth_derivative / 384.0;
        }
        let factor = from.factor.abs().max(to.factor.abs());
        let [square, higher] = self.course.growth().cubic_errors(ends).map(|error| error * surface.largest_change());
        // The slope is at most √(2 A c) for changes up to A and a curvature c.
        let [first, second, third] = self.course.growth().largest_derivatives(ends);
        let (part, curvature) = (turn / surface.angular_scale(), surface.largest_curvature() * turn * turn);
        let slope = (2.0 * surface.largest_change() * curvature).sqrt();
        let kink = surface.largest_kink() * factor * turn / 8.0;
        if part >= 1.0 {
            // A cubic differs from a function by at most 1/32 of the largest second derivative.
            let bend = factor * curvature + 2.0 * first * slope + second * surface.largest_change();
            return [kink, square, bend / 32.0 + eccentric];
        }
        // The third derivative of a spline jumps by up to 4 times its curvature per spacing of its knots. The fourth
        // derivative of a bump exp(−x²) is 6 times its curvature.
        let bend = surface.largest_curvature() * factor * turn * turn * part / 48.0;
        // The other terms of the fourth derivative of a factor times the shape, which is seen at a changing angle.
        let mixed = 16.0 * first * curvature * part + 6.0 * second * curvature + 4.0 * third * slope;
        [kink, square, higher + bend + eccentric + mixed / 384.0]
    }
}

/// Finds the smallest gaps of the followed nodes from their exact motion within a tried step.
struct FollowedPath<'a> {
    place: &'a BladePlace<'a>,
    drives: &'a [PointDrive; POINTS],
    step: SpanStep,
    kind: ForceInterpolation,
    /// Largest displacement error of a step (m).
    tolerance: f64,
    /// See [`Follow::refine_below`].
    refine_below: f64,
}

impl FollowedPath<'_> {
    /// Records the smallest gaps between two fractions of the step in `lowest` (m). Gaps above `floors` (m) are not needed.
    fn follow(
        &self,
        trial: &mut BladeTrial,
        tables: &BladeTables,
        [lowest, floors]: [&mut [Eight]; 2],
        ends: [f64; 2],
    ) {
        let Self { place, step, kind, .. } = *self;
        let level = tables.level(step.level, kind);
        let span = level.step / step.length;
        let (instructions, pushes) = (trial.instructions, trial.pushes);
        instructions.run_octets(Follow {
            trial,
            rows: &tables.rows,
            level,
            tables,
            step_level: step.level,
            faced: &place.faced_surface(self.drives),
            drive_at: |theta| drive_and_rate_at(place, step.from + step.length * theta, span),
            shape_errors: place.shape_errors([step.from, step.from + step.length]),
            lowest,
            floors,
            refine_below: self.refine_below,
            tolerance: self.tolerance,
            pushes,
            ends,
        });
    }
}

/// Returns the prescribed motion of a sector and its rates at the fraction `theta` of a span with this length (s).
pub(super) fn drive_and_rate_at(place: &BladePlace, theta: f64, span: f64) -> (PointDrive, DriveRate) {
    let (now, before) = (drive_at(place, theta).0, centred_drive_at(place, theta - RATE_FRACTION).0);
    let rate = now.rate_since(&before, RATE_FRACTION * span);
    (now, DriveRate { factor: place.course.growth().rate_at(theta) / span, ..rate })
}
