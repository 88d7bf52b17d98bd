//! Friction coefficients, speeds and internal steps of the stability study.

use tiprub_shell::{Failure, Result};

use super::scene::{OperatingPoint, SceneStart};
use crate::arguments::{NumberRange, StabilityArguments};

/// Smallest upper end of the default range of friction coefficients.
const FRICTION: f64 = 1.0;
/// Speeds relative to the scene's.
const SPEEDS: [f64; 4] = [-1.0, 0.5, 1.0, 1.5];
const QUICK_SPEEDS: [f64; 2] = [-1.0, 1.0];
/// Internal steps relative to the scene's.
const STEPS: [f64; 9] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
const QUICK_STEPS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
/// Internal steps for coupled sectors, relative to the scene's; there, every answer takes long.
const COUPLED_STEPS: [f64; 3] = [0.5, 1.0, 2.0];

/// Requested values; if the scene has no variable for a value, its list is a single `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct StabilityGrid {
    /// Friction coefficients, ascending.
    pub frictions: Vec<Option<f64>>,
    /// Speeds, ascending (rad/s).
    pub speeds: Vec<Option<f64>>,
    /// Internal steps, ascending (s).
    pub steps: Vec<f64>,
}

impl StabilityGrid {
    /// Makes the grid of the command line, which always includes the scene's own values; if the largest `usable` step (s) lies below, steps go down
    /// to half of it.
    ///
    /// # Errors
    /// A range was given for a value for which the scene has no variable.
    pub fn new(arguments: &StabilityArguments, own: &SceneStart, coupled: bool, usable: Option<f64>) -> Result<Self> {
        let quick = arguments.common.quick;
        let refuse = |option: &str, what: &str| {
            Err(Failure::usage(option, format!("the scene has no {what} that can be changed"), "Leave it out"))
        };
        let frictions = match (own.friction, arguments.friction) {
            (None, Some(_)) => return refuse("--friction", "friction coefficient"),
            (None, None) => vec![None],
            (Some(own), Some(range)) => with(range.values(), own),
            (Some(own), None) if coupled => with(vec![0.0, 2.0 * own], own),
            (Some(own), None) => {
                let to = FRICTION.max(2.0 * own);
                with(NumberRange { from: 0.0, to, count: if quick { 5 } else { 11 } }.values(), own)
            }
        };
        let speeds = match (own.speed, arguments.speeds) {
            (None, Some(_)) => return refuse("--speeds", "speed"),
            (None, None) => vec![None],
            (Some(own), Some(range)) => with(range.values(), own),
            (Some(own), None) => {
                let factors = if coupled {
                    &[1.0][..]
                } else if quick {
                    &QUICK_SPEEDS[..]
                } else {
                    &SPEEDS[..]
                };
                with(factors.iter().map(|factor| factor * own).collect(), own)
            }
        };
        let factors = if coupled {
            &COUPLED_STEPS[..]
        } else if quick {
            &QUICK_STEPS[..]
        } else {
            &STEPS[..]
        };
        let steps = match (arguments.steps, usable.map(|step| 0.5 * step)) {
            (Some(range), _) => range.geometric(),
            (None, Some(from)) if from < factors[0] * own.step => {
                NumberRange { from, to: factors[factors.len() - 1] * own.step, count: factors.len() + 2 }.geometric()
            }
            _ => factors.iter().map(|factor| factor * own.step).collect(),
        };
        let steps = with(steps, own.step).into_iter().flatten().collect();
        Ok(Self { frictions, speeds, steps })
    }

    /// Returns all pairs of friction and speed, speed by speed.
    pub fn places(&self) -> Vec<OperatingPoint> {
        let at = |speed: Option<f64>| {
            self.frictions.iter().map(move |friction| OperatingPoint { friction: *friction, speed })
        };
        self.speeds.iter().flat_map(|speed| at(*speed)).collect()
    }
}

/// Returns the values in ascending order together with the scene's own value; values that differ by rounding are merged.
fn with(mut values: Vec<f64>, own: f64) -> Vec<Option<f64>> {
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
    values.retain(|value| !same(*value, own));
    values.push(own);
    values.sort_by(f64::total_cmp);
    values.dedup_by(|a, b| same(*a, *b));
    values.into_iter().map(Some).collect()
}

#[cfg(test)]
mod tests {
    use super::with;

    #[test]
    fn grid_contains_the_value_of_the_scene_exactly_once() {
        let own = 0.3;
        assert_eq!(with(vec![0.1 + 0.2, 0.0], own), [Some(0.0), Some(own)]);
        assert_eq!(with(vec![0.0, 0.0], 0.0), [Some(0.0)]);
        assert_eq!(with(vec![-2.0, 2.0], -1.0), [Some(-2.0), Some(-1.0), Some(2.0)]);
    }
}
