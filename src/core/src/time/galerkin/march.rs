//! Integrates a sector, or sectors that step together, over a span with steps that the tolerance and the energy balance allow.

use super::sector::{Effort, HALVINGS, StepGoal, Stopped};
use super::trial::{ForceInterpolation, TrialResult};

/// The next step is twice as long if the error is below this fraction of the tolerance.
const LENGTHEN: f64 = 1.0 / 32.0;
/// Steps that would add to a bank that still holds energy are halved down to this level.
const SAVED: usize = 3;
/// The bank is full at this fraction of the largest energy so far; steps that would add to a full bank are halved down to the shortest.
const FULL: f64 = 0.01;
/// Shortest step that is halved because a node comes near between the points (s).
const SHORTEST_LOOK: f64 = 2.5e-6;

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

/// A system that is integrated with adaptive steps.
pub trait AdaptiveStepper {
    /// Returns the energy bank of contacts that opened and closed (J) and the level of the next step; both persist from step to step.
    fn step_control(&mut self) -> (&mut f64, &mut usize);

    /// Largest energy so far, including the start of the step (J).
    fn largest_energy(&mut self) -> f64;

    /// Length of the steps of a level (s).
    fn length(&self, level: usize) -> f64;

    /// Returns the number of sectors.
    fn count(&self) -> u64;

    /// Takes the step without a trial if no contact is possible during the step, and returns whether it did.
    fn fly(&mut self, step: SpanStep) -> bool;

    /// Tries a step.
    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult;

    /// Accepts the step of the last trial and returns the energy that its contacts add to the bank (J).
    fn take(&mut self, step: SpanStep, kind: ForceInterpolation, verdict: &TrialResult) -> f64;
}

/// Integrates over a span.
///
/// # Errors
/// [`Stopped`]; the state is then that after the last accepted step.
pub fn march(body: &mut impl AdaptiveStepper, demand: StepGoal, effort: &mut Effort) -> Result<(), Stopped> {
    const WHOLE: u64 = 1 << HALVINGS;
    let (count, mut done) = (body.count(), 0_u64);
    while done < WHOLE {
        let level = *body.step_control().1;
        // A shortest step may need two trials.
        let next = count * if level == HALVINGS { 2 } else { 1 };
        if effort.tried().saturating_add(next) > demand.most {
            return Err(Stopped::Exhausted);
        }
        let units = WHOLE >> level;
        let step = SpanStep { level, from: share(done, WHOLE), length: share(units, WHOLE) };
        if body.fly(step) {
            (effort.steps, effort.flights, done) = (effort.steps + count, effort.flights + count, done + units);
            *body.step_control().1 -= usize::from(level > 0 && done.is_multiple_of(2 * units));
            continue;
        }
        let (verdict, kind) = attempt(body, step, effort);
        let refused = !verdict.solved
            || (kind == ForceInterpolation::Polynomial
                && (verdict.misses(demand.tolerance)
                    || (verdict.near && body.length(level) > SHORTEST_LOOK)
                    || (verdict.switches && verdict.switched > *body.step_control().0)
                    || (verdict.switched < 0.0
                        && (level < SAVED && *body.step_control().0 > 0.0 || overflows(body, -verdict.switched)))));
        if refused && level < HALVINGS {
            *body.step_control().1 += 1;
            continue;
        }
        if !verdict.solved {
            return Err(Stopped::Unsolved);
        }
        effort.missed += count * u64::from(verdict.misses(demand.tolerance));
        let left = body.take(step, kind, &verdict);
        *body.step_control().0 += left;
        (effort.steps, done) = (effort.steps + count, done + units);
        let even = done.is_multiple_of(2 * units);
        if level > 0 && even && kind == ForceInterpolation::Polynomial && verdict.error < LENGTHEN * demand.tolerance {
            *body.step_control().1 -= 1;
        }
    }
    Ok(())
}

/// Returns whether the bank would exceed its limit if `paid` (J) were added. Without any energy so far there is no limit.
fn overflows(body: &mut impl AdaptiveStepper, paid: f64) -> bool {
    let largest = body.largest_energy();
    largest > 0.0 && *body.step_control().0 + paid > FULL * largest
}

/// Tries one step; a shortest step is tried with a constant force if the polynomial is rejected.
fn attempt(body: &mut impl AdaptiveStepper, step: SpanStep, effort: &mut Effort) -> (TrialResult, ForceInterpolation) {
    let count = body.count();
    let mut run = |body: &mut _, kind: ForceInterpolation| {
        let verdict = AdaptiveStepper::attempt(body, step, kind);
        effort.trials += count;
        effort.factorisations += verdict.factorisations as u64;
        effort.unsolved += u64::from(!verdict.solved);
        verdict
    };
    let verdict = run(body, ForceInterpolation::Polynomial);
    let affordable = verdict.solved && !(verdict.switches && verdict.switched > *body.step_control().0);
    if step.level < HALVINGS || affordable {
        return (verdict, ForceInterpolation::Polynomial);
    }
    let verdict = run(body, ForceInterpolation::Constant);
    effort.constant += count;
    (verdict, ForceInterpolation::Constant)
}

/// Returns a fraction of small integers.
#[expect(clippy::cast_precision_loss, reason = "below 2^HALVINGS")]
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole as f64
}
