//! Steps of a blade in a steady phase, which do not end at communication points.
//!
//! At a communication point, a blade is usually within an open step: a step that is accepted but has not ended. The modes
//! stay at the start of the open step, and the state at the communication point is evaluated within the step.

use super::dense::{DenseOutput, ModeResponse};
use super::follow::CubicMinima;
use super::gaps::{drive_and_rate_at, include};
use super::rows::BladeRows;
use super::skipped::NO_BOUND;
use super::span::{Blade, BladeInSpan, RecordScope};
use super::surface::PointDrive;
use super::tally::Sums;
use super::trial::BladeTrial;
use crate::math::octet::Eight;
use crate::system::Effort;
use crate::system::work::ContactWork;
use crate::time::SteadyInterval;
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::record::MotionCourse;
use crate::time::galerkin::span::{SpanStep, Stopped, UNITS_PER_SPAN, integrate, take_step, units_per_step};
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::trial::ForceInterpolation;

/// Number of cached responses of the modes. The sectors that share a response have steps of the same age, and few ages occur.
pub(super) const CACHED_RESPONSES: usize = 8;
/// Fraction of a span below which a step is too short to be integrated (rounding of times).
const NEGLIGIBLE_LENGTH: f64 = 1e-9;

/// An accepted step that has not ended. The modes are those at its start.
#[derive(Debug, Clone, Copy)]
pub(super) struct OpenStep {
    pub step: SpanStep,
    /// Interpolation of the forces; `None` in a flight without a trial.
    pub kind: Option<ForceInterpolation>,
    /// True if the polynomials of the step describe the motion between its points.
    pub is_resolved: bool,
    /// Work of the whole step (J).
    pub work: ContactWork,
    /// Kinetic and strain energy at its start (J).
    pub energy: f64,
    /// Energy that it has added to the bank (J).
    pub banked: f64,
}

/// Progress of a blade since the start of the steady phase.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SpanProgress {
    /// Number of completed spans.
    pub spans: u64,
    /// Completed units of the current span, of which there are [`UNITS_PER_SPAN`].
    pub done: u64,
    /// Effort of the open step, which is counted when it ends.
    pub effort: Effort,
}

impl OpenStep {
    /// Returns whether this is a flight without an end: no contact is possible until an input changes.
    pub(super) fn is_unbounded(&self) -> bool {
        self.step.length == f64::INFINITY
    }
}

impl BladeInSpan<'_> {
    /// Opens a flight; its length is infinite if no contact is possible until an input changes.
    pub(super) fn open_flight(&mut self, step: SpanStep) {
        let (work, energy, start) = (ContactWork::default(), self.energy_at_start(), &mut self.blade.trial.start);
        if !self.known {
            // Unknown values must not be part of a saved state.
            let [closing, around] = &mut start.moved;
            [closing, around, &mut start.gaps, &mut start.sigma]
                .into_iter()
                .for_each(|blocks| blocks.fill(Eight::ZERO));
        }
        self.blade.trial.pushes = false;
        if step.length == f64::INFINITY {
            self.blade.trial.gap_bounds.fill(NO_BOUND);
        }
        self.open = Some(OpenStep { step, kind: None, is_resolved: true, work, energy, banked: 0.0 });
    }

    /// Takes steps until one of them contains the end of an interval of the steady phase. `course` returns the prescribed
    /// motion over a span, by its number.
    ///
    /// # Errors
    /// [`Stopped`] if a step is not solved.
    pub(crate) fn integrate_steady_interval(
        &mut self,
        interval: SteadyInterval,
        course: impl Fn(u64) -> MotionCourse,
        effort: &mut Effort,
    ) -> Result<(), Stopped> {
        loop {
            if let Some(open) = self.open.filter(OpenStep::is_unbounded) {
                let begun = (to_real(self.progress.spans) + open.step.from) * interval.span;
                self.record_unbounded_flight(SteadyInterval { from: interval.from.max(begun), ..interval }, course);
                return Ok(());
            }
            self.place.course = course(self.progress.spans);
            let begun = to_real(self.progress.spans) * interval.span;
            let ends = [interval.from, interval.to].map(|time| (time - begun) / interval.span);
            self.recorded = RecordScope::Interval(ends);
            while self.progress.done < UNITS_PER_SPAN {
                if let Some(open) = self.open {
                    if open.is_unbounded() {
                        break;
                    }
                    let end = open.step.from + open.step.length;
                    let is_last = end > ends[1];
                    // The interval may be within a step without contact that was already open before.
                    self.is_in_recalled_flight = is_last && !self.has_changed && !self.pushes();
                    if !self.is_in_recalled_flight {
                        self.record_part(open, [ends[0].max(open.step.from), ends[1].min(end)]);
                    }
                    if is_last {
                        return Ok(());
                    }
                    self.finish_open_step(open, effort);
                    continue;
                }
                let mut tried = Effort::default();
                let done = take_step(self, self.progress.done, &mut tried)?;
                if self.open.is_some() {
                    self.progress.effort = tried;
                } else {
                    effort.add(&tried);
                    self.progress.done = done;
                }
            }
            if self.open.is_none() {
                (self.progress.spans, self.progress.done) = (self.progress.spans + 1, 0);
            }
        }
    }

    /// Ends the open step: adds its work and effort, and advances the modes to its end.
    fn finish_open_step(&mut self, open: OpenStep, effort: &mut Effort) {
        (self.open, self.has_changed) = (None, true);
        effort.add(&self.progress.effort);
        self.progress.done += units_per_step(open.step.level);
        self.blade.tally.work.add(&open.work);
        self.advance(open.step, open.kind);
    }

    /// Records the contacts and smallest gaps of a part of the open step; `ends` are fractions of the span.
    fn record_part(&mut self, open: OpenStep, ends: [f64; 2]) {
        let OpenStep { step, kind, .. } = open;
        let within = ends.map(|end| ((end - step.from) / step.length).clamp(0.0, 1.0));
        if within[0] >= within[1] {
            return;
        }
        let Some(kind) = kind else {
            if self.needs_gaps() {
                self.follow(step, ForceInterpolation::Polynomial, within);
            }
            return;
        };
        let weights = self.tables.level(step.level, kind).part(within);
        self.find_drives(step, kind, &weights);
        self.add(step, kind, &weights, Sums::SpanOnly);
        self.record_gaps(step, kind, open.is_resolved, within);
    }

    /// Records the smallest gaps in an interval of a flight without an end.
    fn record_unbounded_flight(&mut self, interval: SteadyInterval, course: impl Fn(u64) -> MotionCourse) {
        let first = (interval.from / interval.span).floor();
        self.place.course = course(to_count(first));
        let [from, to] = [interval.from, interval.to].map(|time| self.drive_at(time / interval.span - first).0);
        let (gap, rows) = (self.place.gap, &self.tables.rows);
        let Blade { trial, floors, tally, .. } = &mut *self.blade;
        let turns = (to.turned - from.turned).abs() >= std::f64::consts::TAU;
        for node in 0..rows.nodes {
            let of = |blocks: &[Eight]| blocks[node / 8].0[node % 8];
            let (least, steepness) = (from.clearance - of(&trial.reach[0]), of(&rows.steepness));
            let lowest = (least + from.factor * gap.surface.least()) / steepness;
            if lowest >= of(floors).min(of(&tally.lowest)) {
                continue;
            }
            let (angle, around) = (of(&trial.angles), of(&trial.reach[1]) * of(&rows.per_radius));
            let ends = [from.turned.min(to.turned) - around, from.turned.max(to.turned) + around];
            let passed = || gap.surface.lowest_between(angle + ends[0], angle + ends[1]);
            let lowest = if turns { lowest } else { (least + from.factor * passed()) / steepness };
            let target = &mut tally.lowest[node / 8].0[node % 8];
            *target = target.min(lowest);
        }
    }

    /// Returns whether no contact is possible in the steady phase, and the vibration is smaller than the tolerance. The
    /// reach must be known.
    pub(super) fn stays_clear(&self) -> bool {
        if self.place.course.is_off_centre() {
            // The smallest gap of an eccentric rotor depends on its angle, so each step is bounded separately.
            return false;
        }
        let (rows, trial) = (&self.tables.rows, &self.blade.trial);
        let reach = |along: usize, node: usize| trial.reach[along][node / 8].0[node % 8];
        let is_still = |node: usize| reach(0, node).max(reach(1, node)) <= self.goal.tolerance;
        if !(0..rows.nodes).all(is_still) {
            return false;
        }
        let (drive, least) = (self.drive_at(0.0).0, self.place.gap.surface.least());
        let left = drive.clearance + drive.factor * least;
        drive.factor >= 0.0 && (0..rows.nodes).all(|node| left > reach(0, node))
    }

    /// Evaluates the open step at a time (s since the start of the steady phase) for spans of length `span` (s). `course`
    /// returns the prescribed motion over the span with a given number. Returns the time as a fraction of the last span.
    fn sample(&mut self, time: f64, span: f64, course: impl Fn(u64) -> MotionCourse) -> f64 {
        let Some(OpenStep { step, kind, .. }) = self.open else { return 0.0 };
        let elapsed = self.time_in_step(time, span);
        let is_unbounded = self.open.is_some_and(|open| open.is_unbounded());
        let last = if is_unbounded { to_count((time / span).floor()) } else { self.progress.spans };
        self.place.course = course(last);
        let mut drives = [PointDrive::default(); POINTS];
        let theta = (time - to_real(last) * span) / span;
        let (drive, rate) = drive_and_rate_at(&self.place, theta, span);
        drives[0] = drive;
        let faced = self.place.faced_surface(&drives);
        let interpolation = kind.unwrap_or(ForceInterpolation::Polynomial);
        let (blade, tables) = (&mut *self.blade, self.tables);
        let place = blade.find_response(&tables.rows, self.place.kind, elapsed);
        let (instructions, pushes) = (blade.trial.instructions, kind.is_some() && blade.trial.pushes());
        instructions.run_octets(DenseOutput {
            trial: &mut blade.trial,
            rows: &tables.rows,
            level: tables.level(step.level, interpolation),
            response: &blade.responses[place],
            time: elapsed,
            faced: &faced,
            rate,
            pushes,
        });
        theta
    }

    /// Converts a time since the start of the steady phase to a time since the start of the open step (s).
    pub(super) fn time_in_step(&self, time: f64, span: f64) -> f64 {
        let from = self.open.map_or(0.0, |open| open.step.from);
        ((time - to_real(self.progress.spans) * span) - from * span).max(0.0)
    }

    /// Finds the gaps at the start of an interval of the steady phase. The recalled open step must contain this time.
    pub(crate) fn sample_start(&mut self, interval: SteadyInterval, course: impl Fn(u64) -> MotionCourse) {
        self.sample(interval.from, interval.span, course);
        let Blade { trial, begun, tally, .. } = &mut *self.blade;
        for (block, begun) in begun.iter_mut().enumerate() {
            for (i, gap) in begun.0.iter_mut().enumerate().take(self.tables.rows.nodes.saturating_sub(8 * block)) {
                let (sigma, steepness) = (trial.sample.sigma[block].0[i], self.tables.rows.steepness[block].0[i]);
                *gap = trial.sample.gaps[block].0[i] / (steepness * steepness + sigma * sigma).sqrt();
            }
        }
        trial.rates_before.copy_from_slice(&trial.rates);
        include(&mut tally.lowest, begun);
    }

    /// Writes the whole state at the end of an interval of the steady phase. The open step must contain this time.
    pub(crate) fn write_whole_sample(
        &mut self,
        interval: SteadyInterval,
        course: impl Fn(u64) -> MotionCourse,
        state: &mut SectorState,
    ) {
        self.sample(interval.to, interval.span, course);
        BladeTrial::write(&self.tables.rows, &self.blade.trial.sample, state);
    }

    /// Writes the gaps at the end of an interval of the steady phase to `state`, and also modes and contacts if `whole` is
    /// true. The open step must contain this time.
    pub(crate) fn write_sample(
        &mut self,
        interval: SteadyInterval,
        course: impl Fn(u64) -> MotionCourse,
        whole: bool,
        state: &mut SectorState,
    ) {
        let theta = self.sample(interval.to, interval.span, course);
        let (rows, sample) = (&self.tables.rows, &self.blade.trial.sample);
        if whole {
            BladeTrial::write(rows, sample, state);
        } else {
            BladeTrial::write_gaps(rows, sample, state);
        }
        let is_needed = self.is_in_recalled_flight && !self.gaps_are_unneeded();
        let Some(OpenStep { step, kind, .. }) = self.open.filter(|_| is_needed) else { return };
        let (length, shape_ends) =
            (interval.to - interval.from, [theta - (interval.to - interval.from) / interval.span, theta]);
        let shape_error = self.place.shape_errors(shape_ends).iter().sum();
        if self.record_cubic_minima(length, shape_error) {
            let begun = (to_real(self.progress.spans) * interval.span) + step.from * interval.span;
            let length = step.length * interval.span;
            let ends = [interval.from, interval.to].map(|time| ((time - begun) / length).clamp(0.0, 1.0));
            self.follow(step, kind.unwrap_or(ForceInterpolation::Polynomial), ends);
        }
    }

    /// Records the smallest gaps over an interval with a length (s). They follow from cubics through the gaps and their rates
    /// at both ends, if the error is small enough. `shape_error` (m) is the error that the shape of the surface causes.
    /// Returns whether the error is too large for some nodes, which must be followed.
    fn record_cubic_minima(&mut self, length: f64, shape_error: f64) -> bool {
        let Blade { trial, tally, floors, begun, .. } = &mut *self.blade;
        let (rows, tolerance) = (&self.tables.rows, self.goal.tolerance);
        // No forces act in a flight.
        trial.pushes = false;
        let error = trial.find_interpolation_error(rows, length) + shape_error;
        let instructions = trial.instructions;
        instructions.run_octets(CubicMinima {
            trial,
            rows,
            lowest: &mut tally.lowest,
            floors,
            begun,
            length,
            error,
            tolerance,
        })
    }

    /// Returns whether forces act in the open step.
    pub(super) fn pushes(&self) -> bool {
        self.open.is_some_and(|open| open.kind.is_some()) && self.blade.trial.pushes
    }

    /// Integrates from the start of the open step to the end of `interval` within it, with steps that end there, and
    /// writes the state. `course` returns the prescribed motion between two times (s since the start of the steady
    /// phase). Unless the open step is a flight, the tables must be those of a bounded span that begins at
    /// [`stored_start`](super::stored::stored_start).
    ///
    /// # Errors
    /// [`Stopped`] if a step is not solved.
    pub fn close(
        &mut self,
        interval: SteadyInterval,
        course: impl Fn([f64; 2]) -> MotionCourse,
        effort: &mut Effort,
        state: &mut SectorState,
    ) -> Result<(), Stopped> {
        let flight = self.open.filter(|open| open.kind.is_none());
        if let Some(OpenStep { energy, .. }) = flight {
            // The state within a flight is exact, so no new steps are needed.
            self.write_sample(
                interval,
                |spans| course([to_real(spans) * interval.span, to_real(spans + 1) * interval.span]),
                true,
                state,
            );
            effort.add(&self.progress.effort);
            let trial = &mut self.blade.trial;
            trial.start.modes.clone_from(&trial.sample.modes);
            self.blade.tally.damping += energy - self.energy_at_start();
            return Ok(());
        }
        if let Some(OpenStep { step, banked, .. }) = self.open.take() {
            // This step is discarded.
            self.control.bank -= banked;
            let begun = (to_real(self.progress.spans) + step.from) * interval.span;
            if interval.to - begun > NEGLIGIBLE_LENGTH * interval.span {
                self.place.course = course([begun, interval.to]);
                (self.recorded, self.control.level) = (RecordScope::WorkOnly, 0);
                integrate(self, effort)?;
            }
        }
        BladeTrial::write(&self.tables.rows, &self.blade.trial.start, state);
        Ok(())
    }

    /// Rate of the gap of a node at the end of the interval (m/s).
    pub fn gap_rate(&self, node: usize) -> f64 {
        self.blade.trial.rates[node / 8].0[node % 8]
    }

    /// Energy at the start of the open step (J).
    pub fn energy(&self) -> f64 {
        self.open.map_or(0.0, |open| open.energy)
    }
}

/// Converts a count to a real number.
#[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
pub(super) fn to_real(value: u64) -> f64 {
    value as f64
}

/// Converts a stored real number to a count.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "conversion saturates, and NaN becomes 0")]
pub(super) fn to_count(value: f64) -> u64 {
    value as u64
}

impl Blade {
    /// Finds the response of the modes of a kind of sectors after a time (s). Returns its index among the cached responses.
    pub(super) fn find_response(&mut self, rows: &BladeRows, kind: usize, time: f64) -> usize {
        let place = self.responses.iter().position(|response| response.matches(kind, time));
        place.unwrap_or_else(|| {
            self.next_response = (self.next_response + 1) % CACHED_RESPONSES;
            self.responses[self.next_response].compute(rows, kind, time);
            self.next_response
        })
    }
}

impl ModeResponse {
    /// Allocates the cached responses of the modes.
    pub(crate) fn allocate_cache(rows: &BladeRows) -> Vec<Self> {
        vec![Self::new(rows); CACHED_RESPONSES]
    }
}
