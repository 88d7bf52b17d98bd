//! What an input does over time.

use tiprub_core::persist_fields;

/// An input between communication points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct InputCourse {
    /// As set.
    pub(crate) value: f64,
    /// Time derivative, 0 unless given.
    pub(crate) slope: f64,
    /// Time since it was set (s), where a derivative was given.
    since: f64,
    /// Value at the end of the last step.
    pub(crate) reached: f64,
}

persist_fields!(InputCourse { value, slope, since, reached });

impl InputCourse {
    /// Take a value; a derivative given before is over.
    pub(crate) fn set(&mut self, value: f64) {
        (self.value, self.slope, self.since) = (value, 0.0, 0.0);
    }

    /// Take a derivative, valid from now.
    pub(crate) fn set_slope(&mut self, slope: f64) {
        self.value += self.slope * self.since;
        (self.slope, self.since) = (slope, 0.0);
    }

    /// At the start of the simulation there is nothing to come from.
    pub(crate) fn start(&mut self) {
        self.reached = self.value;
    }

    /// Values at the beginning and the end of a step of `length` (s). A ramp begins where the last step ended.
    pub(crate) fn over(&self, length: f64, ramp: bool) -> [f64; 2] {
        let asked = |time: f64| self.value + self.slope * (self.since + time);
        [if ramp { self.reached } else { asked(0.0) }, asked(length)]
    }

    /// The step is over.
    pub(crate) fn shift(&mut self, length: f64) {
        self.reached = self.value + self.slope * (self.since + length);
        if self.slope != 0.0 {
            self.since += length;
        }
    }
}
