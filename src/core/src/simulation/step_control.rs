//! Internal steps of a communication step: a bound on their number, missed tolerances, and free flight over many steps.

use tiprub_cosim::variables::Quantity;
use tiprub_cosim::warning::Topic;
use tiprub_cosim::{Diagnostic, shown, shown_time};

use super::Simulation;
use super::clock::Communication;
use super::limits::Parameters;
use crate::limits::finding::Subject;
use crate::time::galerkin::tables::shortest;
use crate::{Error, Result, Warning};

/// Error of the shortest steps as a fraction of the clearance per length (1/s), below which errors stop following the tolerance. A rubbing
/// blade with 18 modes (`core/tests/galerkin/main.rs`) stays at 1.1e-7, 3.2e-8 and 4.5e-9 with longest steps of 80, 40 and 20 µs.
const LEFT: f64 = 6.0;

impl Simulation {
    /// Returns whether sectors take adaptive steps.
    pub(super) fn is_marched(&self) -> bool {
        self.stepper.is_adaptive()
    }

    /// Largest number of internal steps of a communication step, 0 for any number.
    pub(super) fn max_internal_steps(&self) -> u64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value ≤ 1e9")]
        let most = self.state.values.value_of(Quantity::MaxInternalSteps, 0) as u64;
        most
    }

    /// Creates the threads that the parameter `threads` requests, and ends others.
    ///
    /// # Errors
    /// If the system cannot create a thread.
    pub(super) fn use_threads(&mut self) -> Result<()> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value ≤ 64")]
        let threads = self.state.values.value_of(Quantity::Threads, 0).max(1.0) as usize;
        self.stepper.use_threads(threads).map_err(|error| {
            let problem = format!("the system cannot create {threads} threads: {error}");
            Error::invalid("variable `threads`", problem, "Use fewer threads; 1 creates none")
        })
    }

    /// Ends all threads.
    pub(super) fn end_threads(&mut self) {
        // Ending threads does not fail.
        drop(self.stepper.use_threads(1));
    }

    /// Allocates the state to return to, if it may be needed: the number of fixed steps is known beforehand.
    pub(super) fn make_room(&mut self) {
        if self.max_internal_steps() > 0 && self.is_marched() && self.mark.is_empty() {
            self.mark = vec![0; self.state_size];
        }
    }

    /// Checks the number of steps before an internal step.
    pub(super) fn allow_steps(&mut self) -> Result<()> {
        let Communication { length, done, tried, most, .. } = self.state.clock.step;
        if most == 0 {
            self.stepper.allow(u64::MAX);
        } else if self.is_marched() {
            self.stepper.allow(tried + most);
        } else if done >= most {
            return Err(self.exhausted(length, most));
        }
        Ok(())
    }

    /// Returns the error for a communication step of length `length` (s) that takes too many internal steps.
    pub(super) fn exhausted(&self, length: f64, most: u64) -> Error {
        let (of_whom, other) = if self.is_marched() {
            (" (trial steps of all blades together)", "a larger tolerance")
        } else {
            ("", "a larger internal_step_max")
        };
        let problem = format!(
            "the communication step of {} s from t = {} s needs more internal steps{of_whom} than max_internal_steps = {most}, \
             so it was discarded",
            shown(length),
            shown_time(self.state.clock.time)
        );
        let remedy = format!(
            "Repeat it with a shorter communication step, a larger max_internal_steps (0: no limit) or {other}"
        );
        Error::Exhausted(Diagnostic::new("", problem, remedy))
    }

    /// Returns to the last state from which the run can continue, if no more steps are allowed in the middle of an internal step.
    pub(super) fn abandon_step(&mut self) -> Error {
        let (length, most) = (self.state.clock.step.length, self.state.clock.step.most);
        self.withdraw();
        self.exhausted(length, most)
    }

    /// Warns of a tolerance that the shortest steps cannot keep when contacts open and close.
    pub(super) fn warn_of_tolerance(&mut self, parameters: &Parameters) {
        let step = self.compiled.expected_step(parameters.step);
        let left = LEFT * shortest(step);
        if parameters.scheme.properties().adaptive && parameters.tolerance < left {
            let problem = format!(
                "the tolerance {} cannot be reached: galerkin steps are at least {} s long, 1/4096 of the \
                 longest step, which causes errors of about {left:.0e} where contacts open and close",
                shown(parameters.tolerance),
                shown(shortest(step)),
            );
            let remedy = "Use a smaller internal_step_max (time.step) or communication step, or a larger tolerance";
            self.diagnostics.warnings.push(Warning::new(Topic::ToleranceLimit, problem, remedy));
        }
    }

    /// Warns of the first communication step in which a shortest step missed the tolerance.
    pub(super) fn note_missed(&mut self, time: f64) {
        let effort = self.system.effort();
        if effort.missed == 0 || !self.diagnostics.reported.is_first(Topic::ToleranceMissed, Subject::Scene) {
            return;
        }
        let problem = format!(
            "up to t = {} s, {} of {} steps have missed the tolerance of {}: the shortest steps of {} s, 1/4096 \
             of the longest, were accepted anyway",
            shown_time(time),
            effort.missed,
            effort.steps,
            shown(self.state.values.value_of(Quantity::Tolerance, 0)),
            shown(shortest(self.system.step_size())),
        );
        let remedy = format!(
            "Use an internal_step_max (time.step) below {} s or a larger tolerance; missed_steps counts all such steps",
            shown(self.state.values.value_of(Quantity::StepMax, 0).min(self.system.step_size()))
        );
        self.note(Warning::new(Topic::ToleranceMissed, problem, remedy));
    }
}
