//! A span of time in steps as long as the tolerance and the energy allow, of one sector or of all that step together.

use super::sector::{Effort, HALVINGS, StepGoal, Stopped};
use super::trial::{ForceInterpolation, TrialResult};

/// Below this share of the tolerance the next step is twice as long.
const LENGTHEN: f64 = 1.0 / 32.0;
/// Steps that would pay into a bank which is not spent are halved down to this level.
const SAVED: usize = 3;
/// The bank is full with this share of the largest energy there was: steps that would pay into it are halved down to the shortest then.
const FULL: f64 = 0.01;
/// Nearness between points is looked at down to this step (s).
const SHORTEST_LOOK: f64 = 2.5e-6;

/// A step within a span: its level, and where it begins and how long it is as shares of the span.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpanStep {
    /// Number of times that the span is halved.
    pub level: usize,
    /// Start.
    pub from: f64,
    /// Length.
    pub length: f64,
}

/// A system that is integrated with adaptive steps.
pub trait AdaptiveStepper {
    /// Energy left by contacts that opened and closed (J), and level of the next step; both go on from step to step.
    fn step_control(&mut self) -> (&mut f64, &mut usize);

    /// Largest energy up to now, that of the start of the step included (J).
    fn largest_energy(&mut self) -> f64;

    /// Length of steps of a level (s).
    fn length(&self, level: usize) -> f64;

    /// Returns the number of sectors.
    fn count(&self) -> u64;

    /// Take the step without a trial, if nothing can touch on the way.
    fn fly(&mut self, step: SpanStep) -> bool;

    /// Try a step.
    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult;

    /// Take the step that was tried last; what contacts leave to those to come (J).
    fn take(&mut self, step: SpanStep, kind: ForceInterpolation, verdict: &TrialResult) -> f64;
}

/// March over a span.
///
/// # Errors
/// [`Stopped`]; the state is then where the last step taken left it.
pub fn march(body: &mut impl AdaptiveStepper, demand: StepGoal, effort: &mut Effort) -> Result<(), Stopped> {
    const WHOLE: u64 = 1 << HALVINGS;
    let (count, mut done) = (body.count(), 0_u64);
    while done < WHOLE {
        let level = *body.step_control().1;
        // The shortest may take two.
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

/// Whether the bank would hold more than it may with `paid` (J) paid in. Where there was no energy yet, nobody knows what is much.
fn overflows(body: &mut impl AdaptiveStepper, paid: f64) -> bool {
    let largest = body.largest_energy();
    largest > 0.0 && *body.step_control().0 + paid > FULL * largest
}

/// Try one step; the shortest with a constant force where a polynomial cannot be taken.
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

/// Small counts as a share.
#[expect(clippy::cast_precision_loss, reason = "below 2^HALVINGS")]
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole as f64
}
