//! Integrates an island over a span with steps that the tolerance and the energy balance allow.

use super::island::StepControl;
use super::tables::HALVINGS;
use super::trial::{ForceInterpolation, TrialResult};
use crate::system::Effort;

/// The next step is twice as long if the error is below this fraction of the tolerance.
const LENGTHEN: f64 = 1.0 / 32.0;
/// Steps that would add to a bank that still holds energy are halved down to this fraction of the longest step.
const SAVING: f64 = 0.125;
/// The bank is full at this fraction of the largest energy so far; steps that would add to a full bank are halved down to the shortest.
const FULL: f64 = 0.01;
/// Longest step (s) that is accepted although an open node comes near zero between its points.
pub(crate) const LONGEST_NEAR_STEP: f64 = 4e-6;

/// A step within a span: its level, and its start and length as fractions of the span.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpanStep {
    /// Number of halvings of the span.
    pub level: usize,
    /// Start, as a fraction of the span.
    pub from: f64,
    /// Length, as a fraction of the span.
    pub length: f64,
}

impl SpanStep {
    /// Returns the step of a level after `done` units of the span, of which there are [`UNITS_PER_SPAN`].
    pub(crate) fn new(level: usize, done: u64) -> Self {
        Self { level, from: share(done, UNITS_PER_SPAN), length: share(units_per_step(level), UNITS_PER_SPAN) }
    }
}

/// Number of units in a span; a unit is a shortest step.
pub(crate) const UNITS_PER_SPAN: u64 = 1 << HALVINGS;

/// Number of units in a step of a level.
pub(crate) fn units_per_step(level: usize) -> u64 {
    UNITS_PER_SPAN >> level
}

/// Tolerance and limits of the steps of a sector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepGoal {
    /// Largest displacement error of a step (m).
    pub tolerance: f64,
    /// Largest gap of a contact that counts as closed (m).
    pub precision: f64,
    /// Longest step (s); spans may be shorter.
    pub longest: f64,
    /// Largest number of attempted steps ([`Effort::tried`]).
    pub most: u64,
}

/// Reason why a span was not integrated to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// Even the shortest step has no solution of the contact problem.
    Unsolved,
    /// The limit of attempted steps is exceeded.
    Exhausted,
}

/// Outcome of an attempt to take a step without a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flight {
    /// No contact is possible during the step, and the step has been accepted.
    Accepted,
    /// Contact may be possible; a shorter step gives tighter bounds.
    TooLong,
    /// The step needs a trial.
    NeedsTrial,
}

/// Steps within a span, of an island or of a blade.
pub trait SpanSteps {
    /// Tolerance and limits.
    fn goal(&self) -> StepGoal;

    /// Step control.
    fn control(&mut self) -> &mut StepControl;

    /// Largest energy so far, including the start of the step (J).
    fn largest_energy(&mut self) -> f64;

    /// Length of the steps of a level (s).
    fn length(&self, level: usize) -> f64;

    /// Returns the number of sectors.
    fn count(&self) -> u64;

    /// Fraction of the largest energy so far that a step may add to a bank that still holds energy.
    fn bank_allowance(&self) -> f64 {
        0.0
    }

    /// Takes the step without a trial if no contact is possible during the step.
    fn fly(&mut self, step: SpanStep) -> Flight;

    /// Tries a step.
    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult;

    /// Accepts the step of the last trial and returns the energy that its contacts add to the bank (J).
    fn accept(&mut self, step: SpanStep, kind: ForceInterpolation, result: &TrialResult) -> f64;
}

/// Integrates over a span.
///
/// # Errors
/// [`Stopped`] if the span is not integrated to its end; the state is then the state after the last accepted step.
pub(crate) fn integrate(steps: &mut impl SpanSteps, effort: &mut Effort) -> Result<(), Stopped> {
    let mut done = 0;
    while done < UNITS_PER_SPAN {
        done = take_step(steps, done, effort)?;
    }
    Ok(())
}

/// Takes the next step after `done` units of a span, and returns the number of units at its end.
///
/// # Errors
/// [`Stopped`] if no step is accepted.
pub(crate) fn take_step(steps: &mut impl SpanSteps, done: u64, effort: &mut Effort) -> Result<u64, Stopped> {
    StepChoice { steps }.take(done, effort)
}

/// Choice of the steps of a span.
struct StepChoice<'a, S> {
    steps: &'a mut S,
}

impl<S: SpanSteps> StepChoice<'_, S> {
    fn take(&mut self, done: u64, effort: &mut Effort) -> Result<u64, Stopped> {
        let (goal, count) = (self.steps.goal(), self.steps.count());
        loop {
            let level = self.steps.control().level;
            self.check_effort(effort)?;
            let (step, end) = (SpanStep::new(level, done), done + units_per_step(level));
            let is_even = end.is_multiple_of(2 * units_per_step(level));
            match self.steps.fly(step) {
                Flight::Accepted => {
                    (effort.steps, effort.flights) = (effort.steps + count, effort.flights + count);
                    self.steps.control().level -= usize::from(level > 0 && is_even);
                    return Ok(end);
                }
                Flight::TooLong => {
                    effort.trials += count;
                    self.steps.control().level += 1;
                    continue;
                }
                Flight::NeedsTrial => {}
            }
            let (result, kind) = self.try_step(step, effort)?;
            if self.is_too_long(step, kind, &result, goal.tolerance) && level < HALVINGS {
                self.steps.control().level += 1;
                continue;
            }
            if !result.solved {
                return Err(Stopped::Unsolved);
            }
            effort.missed += count * u64::from(result.misses(goal.tolerance));
            let left = self.steps.accept(step, kind, &result);
            self.steps.control().bank += left;
            effort.steps += count;
            let is_accurate = kind == ForceInterpolation::Polynomial && result.error < LENGTHEN * goal.tolerance;
            if level > 0 && is_even && is_accurate {
                self.steps.control().level -= 1;
            }
            return Ok(end);
        }
    }

    /// Returns whether a step has no solution, misses the tolerance or a contact between its points, or needs more energy than the
    /// bank holds or can take.
    fn is_too_long(&mut self, step: SpanStep, kind: ForceInterpolation, result: &TrialResult, tolerance: f64) -> bool {
        if !result.solved || kind == ForceInterpolation::Constant {
            return !result.solved;
        }
        // Small gaps of closed contacts can overdraw the bank slightly. Steps that lose energy fill it again.
        let bank = self.steps.control().bank.max(0.0);
        result.misses(tolerance)
            || (result.near && self.steps.length(step.level) > LONGEST_NEAR_STEP)
            || (result.switches && result.switched > bank)
            || (result.switched < 0.0 && self.adds_too_much(step, -result.switched))
    }

    /// Returns whether a step that adds `paid` (J) to the bank is rejected: it exceeds the limit of the bank, or it adds more than the
    /// allowance to a bank that still holds energy and is longer than [`SAVING`] times the longest step.
    fn adds_too_much(&mut self, step: SpanStep, paid: f64) -> bool {
        let (allowance, holds) = (self.steps.bank_allowance(), self.steps.control().bank > 0.0);
        let must_save = holds && self.steps.length(step.level) > SAVING * self.steps.goal().longest;
        let is_negligible = allowance > 0.0 && paid <= allowance * self.steps.largest_energy();
        (must_save && !is_negligible) || self.overflows_bank(paid)
    }

    /// Returns whether the bank would exceed its limit if `paid` (J) were added. Without any energy so far there is no limit.
    fn overflows_bank(&mut self, paid: f64) -> bool {
        let largest = self.steps.largest_energy();
        largest > 0.0 && self.steps.control().bank + paid > FULL * largest
    }

    /// Checks that one more step may be tried.
    fn check_effort(&self, effort: &Effort) -> Result<(), Stopped> {
        let is_allowed = effort.tried().saturating_add(self.steps.count()) <= self.steps.goal().most;
        if is_allowed { Ok(()) } else { Err(Stopped::Exhausted) }
    }

    /// Tries one step; a shortest step is tried with a constant force if the polynomial is rejected.
    fn try_step(&mut self, step: SpanStep, effort: &mut Effort) -> Result<(TrialResult, ForceInterpolation), Stopped> {
        let result = self.run_trial(step, ForceInterpolation::Polynomial, effort);
        let affordable = result.solved && !(result.switches && result.switched > self.steps.control().bank.max(0.0));
        if step.level < HALVINGS || affordable {
            return Ok((result, ForceInterpolation::Polynomial));
        }
        self.check_effort(effort)?;
        let result = self.run_trial(step, ForceInterpolation::Constant, effort);
        effort.constant += self.steps.count();
        Ok((result, ForceInterpolation::Constant))
    }

    fn run_trial(&mut self, step: SpanStep, kind: ForceInterpolation, effort: &mut Effort) -> TrialResult {
        let result = self.steps.attempt(step, kind);
        effort.trials += self.steps.count();
        effort.factorisations += result.factorisations as u64;
        effort.unsolved += u64::from(!result.solved);
        result
    }
}

/// Returns a fraction of small integers.
#[expect(clippy::cast_precision_loss, reason = "below 2^HALVINGS")]
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole as f64
}
