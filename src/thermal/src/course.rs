//! Course of an input over time.

use tiprub_cosim::persist_fields;

/// Input between communication points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct InputCourse {
    /// Set value.
    pub(crate) value: f64,
    /// Time derivative, 0 if not given.
    pub(crate) slope: f64,
    /// Time since the input was set (s), if a derivative was given.
    since: f64,
    /// Value at the end of the last step.
    pub(crate) reached: f64,
}

persist_fields!(InputCourse { value, slope, since, reached });

impl InputCourse {
    /// Sets a value and ends a previous derivative.
    pub(crate) fn set(&mut self, value: f64) {
        (self.value, self.slope, self.since) = (value, 0.0, 0.0);
    }

    /// Sets a derivative, valid from now.
    pub(crate) fn set_slope(&mut self, slope: f64) {
        self.value += self.slope * self.since;
        (self.slope, self.since) = (slope, 0.0);
    }

    /// Starts at the set value, since at the start of the simulation there is no previous one.
    pub(crate) fn start(&mut self) {
        self.reached = self.value;
    }

    /// Returns the values at the beginning and the end of a step of `length` (s). A ramp begins at the value at the
    /// end of the last step.
    pub(crate) fn over(&self, length: f64, ramp: bool) -> [f64; 2] {
        let asked = |time: f64| self.value + self.slope * (self.since + time);
        [if ramp { self.reached } else { asked(0.0) }, asked(length)]
    }

    /// Ends the step.
    pub(crate) fn shift(&mut self, length: f64) {
        self.reached = self.value + self.slope * (self.since + length);
        if self.slope != 0.0 {
            self.since += length;
        }
    }
}
