//! Times, communication step and phase of a simulation.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter};
use tiprub_cosim::{bounds, persist_fields, shown, shown_time};

use crate::{Error, Result};

/// Allowed difference between communication points and the simulation's own time as a fraction of H (rounding in the importer).
const TIME_TOLERANCE: f64 = 1e-3;
/// Step sizes within this fraction of each other are the same step (1/60 computed in several ways).
pub(crate) const SAME_STEP: f64 = 1e-9;
/// Rounding errors of a time that may be in the difference of two times, in units of its last place.
const TIME_ROUNDINGS: f64 = 4.0;
/// Largest number of internal steps of one communication step.
const MOST_STEPS: f64 = 1e9;

/// Tolerance for equal internal steps of a communication step of length `length` (s) at `time` (s): a length is not known better than
/// rounding of the times.
pub(crate) fn same_step(time: f64, length: f64) -> f64 {
    SAME_STEP.max(TIME_ROUNDINGS * f64::EPSILON * time.abs() / length)
}

/// Phase in the life cycle of the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum SimulationPhase {
    /// Values can be set; nothing has been computed.
    #[default]
    Created,
    /// At a communication point.
    Ready,
    /// Between two communication points.
    Stepping,
    /// A step failed; only reset and restore are possible.
    Failed,
}

/// The current communication step (or the last one).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Communication {
    /// Start (s).
    pub start: f64,
    /// Length H (s).
    pub length: f64,
    /// Number of internal steps N.
    pub count: u64,
    /// Number of finished internal steps.
    pub done: u64,
    /// Number of steps tried before ([`crate::system::System::steps_tried`]).
    pub tried: u64,
    /// Largest number of steps to try, 0 for any number.
    pub most: u64,
    /// True if it may end early.
    pub partial: bool,
}

/// Times, communication step and phase.
#[derive(Debug, Clone, Default)]
pub struct Clock {
    pub phase: SimulationPhase,
    /// Last communication point (s).
    pub time: f64,
    /// Start of the run (s), from which shapes grow.
    pub initial_time: f64,
    pub step: Communication,
    /// Length of the step before the last (s), 0 if there was none.
    pub previous_length: f64,
    /// Largest number of internal steps tried within a communication step since the start.
    pub most_tried: u64,
}

persist_fields!(Communication { start, length, count, done, tried, most, partial });
persist_fields!(Clock { phase, time, initial_time, step, previous_length, most_tried });

impl Persist for SimulationPhase {
    fn save(&self, writer: &mut StateWriter) {
        (*self as u64).save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        let mut code = 0_u64;
        code.restore(reader);
        *self = match code {
            0 => Self::Created,
            1 => Self::Ready,
            2 => Self::Stepping,
            3 => Self::Failed,
            _ => return reader.refuse("its phase is unknown"),
        };
    }
    fn check(&self, reader: &mut StateReader) {
        (*self).clone().restore(reader);
    }
}

impl Communication {
    /// Offset of the internal point `index` from the start, from integer counts (s).
    pub fn offset(&self, index: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
        let fraction = index as f64 / self.count as f64;
        self.length * fraction
    }

    /// Time of the internal point `index` (s); the last one is start + H exactly.
    pub fn time(&self, index: u64) -> f64 {
        if index == self.count { self.start + self.length } else { self.start + self.offset(index) }
    }

    /// Offset and time of the internal point `index` (s).
    pub fn point(&self, index: u64) -> [f64; 2] {
        [self.offset(index), self.time(index)]
    }

    /// Offset and time of the internal point reached (s).
    pub fn reached(&self) -> [f64; 2] {
        self.point(self.done)
    }
}

impl Clock {
    /// Clock at the start of a run (s), before its phase is known.
    pub fn at(start: f64) -> Self {
        let step = Communication { start, count: 1, done: 1, ..Communication::default() };
        Self { time: start, initial_time: start, step, ..Self::default() }
    }

    pub(crate) fn is_created(&self) -> bool {
        self.phase == SimulationPhase::Created
    }

    pub fn is_stepping(&self) -> bool {
        self.phase == SimulationPhase::Stepping
    }

    /// Offset of the internal point reached from the last communication point (s).
    pub(crate) fn offset_now(&self) -> f64 {
        if self.is_stepping() { self.step.offset(self.step.done) } else { 0.0 }
    }

    /// Begins a communication step.
    pub fn begin(&mut self, step: Communication) {
        self.previous_length = self.step.length;
        self.step = step;
        self.phase = SimulationPhase::Stepping;
    }

    /// Ends the communication step at `time` (s).
    pub fn finish(&mut self, time: f64) {
        self.time = time;
        self.phase = SimulationPhase::Ready;
    }

    /// Rejects a communication step in the wrong phase.
    pub(crate) fn check_ready(&self) -> Result<()> {
        let (problem, remedy) = match self.phase {
            SimulationPhase::Ready => return Ok(()),
            SimulationPhase::Failed => {
                ("an earlier step of this instance failed", "Restore a saved state or reset the instance")
            }
            SimulationPhase::Created | SimulationPhase::Stepping => {
                ("called before initialisation or within a communication step", "Initialise the instance first")
            }
        };
        Err(Error::invalid("doStep", problem, remedy))
    }

    /// Checks begin and length (s) of a communication step, with internal steps of up to `step_max` (s).
    pub fn check_step(&self, current_time: f64, step_size: f64, step_max: f64) -> Result<()> {
        let invalid_length =
            |problem: String, remedy: &str| Err(Error::invalid("communicationStepSize", problem, remedy));
        if !(step_size.is_finite() && step_size > 0.0) {
            let problem = format!("{} s at t = {} s", shown(step_size), shown_time(self.time));
            return invalid_length(problem, "Give a finite communication step > 0");
        }
        if !current_time.is_finite() || (current_time - self.time).abs() > TIME_TOLERANCE * step_size {
            return Err(Error::invalid(
                "currentCommunicationPoint",
                format!("{} s, but this instance is at t = {} s", shown(current_time), shown(self.time)),
                "Continue from the end of the last step, or restore a saved state",
            ));
        }
        if step_size < bounds::SHORTEST_STEP {
            let problem = format!(
                "{} s at t = {} s is below the minimum of {} s, where rounding errors of positions would count as \
                 motion",
                shown(step_size),
                shown_time(self.time),
                shown(bounds::SHORTEST_STEP)
            );
            let remedy =
                "Use a longer communication step; skip remainders that are caused by rounding in a sum of steps";
            return invalid_length(problem, remedy);
        }
        // Length of the step after rounding of the time.
        let rounded = (current_time + step_size) - current_time;
        if (rounded - step_size).abs() > TIME_TOLERANCE * step_size {
            let problem = format!(
                "{} s cannot be added accurately to the time {} s in double precision",
                shown(step_size),
                shown_time(current_time)
            );
            return invalid_length(problem, "Use a longer communication step or a start time closer to 0");
        }
        let ratio = step_size / step_max;
        if ratio > MOST_STEPS {
            let problem = format!("{} s would need {ratio:.3e} internal steps", shown(step_size));
            return invalid_length(problem, "Use a shorter communication step or a larger internal_step_max");
        }
        Ok(())
    }

    /// Returns whether restored times, counts and the internal step (s) are consistent; internal steps have up to `largest` (s).
    pub(crate) fn is_consistent(&self, internal_step: f64, largest: f64) -> bool {
        let Communication { start, length, count, done, .. } = self.step;
        #[expect(clippy::cast_precision_loss, reason = "checked to be at most 2^53")]
        let number = count as f64;
        let (ends, within) = match self.phase {
            SimulationPhase::Created => return self.time.is_finite(),
            SimulationPhase::Ready => (done == count, self.time.to_bits() == self.step.time(count).to_bits()),
            phase => {
                (done < count || phase == SimulationPhase::Failed, (self.time - start).abs() <= TIME_TOLERANCE * length)
            }
        };
        // A first step may begin before the start by this tolerance.
        let started = self.initial_time.is_finite() && self.initial_time <= self.time + TIME_TOLERANCE * length;
        let counted = started && self.time.is_finite() && (1.0..=MOST_STEPS).contains(&number) && done <= count && ends;
        let step = if length > 0.0 { length / number } else { largest };
        let same = if length > 0.0 { same_step(start, length) } else { SAME_STEP };
        let divided = (0.0..=f64::MAX).contains(&length)
            && (internal_step - step).abs() <= 2.0 * same * step
            && internal_step <= largest * (1.0 + 2.0 * same);
        counted && within && divided
    }
}
