//! Communication points, computed from their index instead of accumulated.

use tiprub_core::Warning;
use tiprub_core::scene::settings::ExperimentSettings;
use tiprub_cosim::warning::Topic;
use tiprub_cosim::{bounds, shown};

use crate::{Failure, Result};

/// Largest number of communication points of one run; the table of results would not fit in memory otherwise.
const MOST_STEPS: f64 = 50e6;

/// Equally spaced communication points from start to stop; the last step is shorter if the step does not divide the interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Start time (s).
    pub start: f64,
    /// Stop time (s).
    pub stop: f64,
    /// Communication step H (s).
    pub step: f64,
    /// Number of communication steps.
    pub count: usize,
}

impl Schedule {
    /// Creates the schedule of the experiment of the scene, with an optional other stop time and step.
    ///
    /// # Errors
    /// The stop is not after the start, the step is not positive, or there are too many communication points.
    pub fn new(experiment: &ExperimentSettings, stop: Option<f64>, step: Option<f64>) -> Result<Self> {
        let start = experiment.start;
        let (stop_option, stop) = (stop.is_some(), stop.unwrap_or(experiment.stop));
        let (step_option, step) = (step.is_some(), step.unwrap_or(experiment.communication_step));
        let name = |given: bool, option: &str, field: &str| if given { option.to_string() } else { field.to_string() };
        if !(stop.is_finite() && stop > start) {
            return Err(Failure::usage(
                name(stop_option, "--stop", "experiment.stop"),
                format!("{} s is not after the start time {} s", shown(stop), shown(start)),
                "Give a later time in seconds",
            ));
        }
        if !(bounds::SHORTEST_STEP..=bounds::TIME).contains(&step) {
            return Err(Failure::usage(
                name(step_option, "--step", "experiment.communication_step"),
                format!("{} s is outside the range from 1e-12 s to 1e9 s", shown(step)),
                "Give the communication step H in seconds, for example 1e-5",
            ));
        }
        let steps = (stop - start) / step;
        if steps > MOST_STEPS {
            return Err(Failure::usage(
                name(step_option, "--step", "experiment.communication_step"),
                format!(
                    "{steps:.3e} communication points between {} s and {} s are too many",
                    shown(start),
                    shown(stop)
                ),
                format!("Choose a longer step that gives at most {MOST_STEPS:.0e} points"),
            ));
        }
        Ok(Self { start, stop, step, count: count_steps(steps) })
    }

    /// Returns a warning for a communication step longer than the whole run, which is legal but rarely meant.
    pub fn warnings(&self) -> Vec<Warning> {
        let length = self.stop - self.start;
        let one_step = self.step > length && !is_close(self.step, length);
        let warning = || {
            let problem = format!(
                "the communication step {} s is longer than the run of {} s, so the run is a single step",
                shown(self.step),
                shown(length)
            );
            Warning::new(Topic::CommunicationStep, problem, "Choose a shorter communication step")
        };
        one_step.then(warning).into_iter().collect()
    }

    /// Returns communication point `index` (0 is the start, `count` the stop): start + index·H.
    ///
    /// Points on the grid are never moved to the stop time because of rounding, so that importers that count in the same way (such as FMPy) request
    /// exactly these times.
    pub fn time(&self, index: usize) -> f64 {
        let regular = self.start + index as f64 * self.step;
        if index == self.count && regular > self.stop && !is_close(regular, self.stop) { self.stop } else { regular }
    }
}

/// Returns whether two times are close to each other (relative), as in Python's `math.isclose`.
fn is_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 < steps ≤ MOST_STEPS, checked")]
fn count_steps(steps: f64) -> usize {
    // A quotient such as 1000.0000000001 means 1000 steps, not 1001.
    ((steps - 1e-9 * steps).ceil() as usize).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(start: f64, stop: f64, step: f64) -> Schedule {
        Schedule::new(&ExperimentSettings { start, stop, communication_step: step }, None, None).unwrap()
    }

    #[test]
    fn times_are_multiples_of_the_step_without_accumulation() {
        let schedule = schedule(0.0, 1.0, 0.1);
        assert_eq!(schedule.count, 10);
        assert_eq!(schedule.time(3).to_bits(), (3.0_f64 * 0.1).to_bits());
        assert_eq!(schedule.time(10).to_bits(), 1.0_f64.to_bits());
    }

    #[test]
    fn last_step_is_shortened_to_reach_the_stop_time() {
        let schedule = schedule(2.0, 2.25, 0.1);
        assert_eq!(schedule.count, 3);
        assert_eq!(schedule.time(3).to_bits(), 2.25_f64.to_bits());
    }

    #[test]
    fn a_step_longer_than_the_run_is_one_step() {
        let schedule = schedule(0.0, 1e-3, 1.0);
        assert_eq!((schedule.count, schedule.time(1).to_bits()), (1, 1e-3_f64.to_bits()));
    }

    #[test]
    fn invalid_times_name_the_option_or_field() {
        let experiment = ExperimentSettings { start: 0.0, stop: 1.0, communication_step: 1e-3 };
        let stop = Schedule::new(&experiment, Some(-1.0), None).unwrap_err();
        assert_eq!((stop.what.as_str(), stop.usage), ("--stop", true));
        assert_eq!(Schedule::new(&experiment, None, Some(f64::NAN)).unwrap_err().what, "--step");
        assert_eq!(Schedule::new(&experiment, None, Some(1e-12)).unwrap_err().what, "--step");
        let wrong = ExperimentSettings { stop: 0.0, ..experiment };
        assert_eq!(Schedule::new(&wrong, None, None).unwrap_err().what, "experiment.stop");
    }
}
