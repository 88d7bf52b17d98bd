//! One input over time.

use crate::persist_fields;

/// One real input over time: the line requested by the importer, and the line that acts on the model (acting line).
///
/// Both are the same if a value acts immediately. Otherwise the acting line is a ramp from the value reached to the
/// requested value at the end of the communication step, so it is continuous. Times are offsets from the start of the
/// communication step (s). Values have the unit of the input.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Input {
    /// Requested value at the time `since`.
    pub value: f64,
    /// Requested first time derivative.
    pub slope: f64,
    /// Time of the requested value.
    pub since: f64,
    /// Acting value at the time `from`.
    reached: f64,
    /// First time derivative between `from` and `until`.
    rate: f64,
    from: f64,
    /// Acting value at and after the time `until`.
    end: f64,
    until: f64,
}

persist_fields!(Input { value, slope, since, reached, rate, from, end, until });

impl Input {
    /// Requests a value from `offset` on, and a derivative of 0.
    pub fn request(&mut self, value: f64, offset: f64) {
        // Subnormal numbers lack full precision.
        let value = if value.is_subnormal() { 0.0 } else { value };
        (self.value, self.slope, self.since) = (value, 0.0, offset);
    }

    /// Requests a derivative from `offset` on.
    pub fn request_slope(&mut self, slope: f64, offset: f64) {
        (self.value, self.slope, self.since) = (self.requested_value(offset), slope, offset);
    }

    /// Copies the requested line of another input.
    pub fn copy_request(&mut self, other: &Self) {
        (self.value, self.slope, self.since) = (other.value, other.slope, other.since);
    }

    /// Requested value at `offset`.
    pub fn requested_value(&self, offset: f64) -> f64 {
        if self.slope == 0.0 { self.value } else { self.value + self.slope * (offset - self.since) }
    }

    /// Makes the requested line act immediately.
    pub fn act_immediately(&mut self) {
        (self.reached, self.rate, self.from) = (self.value, self.slope, self.since);
        self.until = f64::INFINITY;
    }

    /// Ramps from the value reached at `offset` to the requested value at `until`.
    pub fn ramp(&mut self, offset: f64, until: f64) {
        let (reached, end) = (self.at(offset), self.requested_value(until));
        (self.reached, self.from) = (reached, offset);
        (self.end, self.until) = (end, until);
        self.rate = (end - reached) / (until - offset);
    }

    /// Acting value at `offset`.
    #[inline]
    pub fn at(&self, offset: f64) -> f64 {
        if offset >= self.until {
            self.end
        } else if self.rate == 0.0 {
            self.reached
        } else {
            self.reached + self.rate * (offset - self.from)
        }
    }

    /// Returns whether the acting line ends at a given time.
    pub fn is_ramp(&self) -> bool {
        self.until < f64::INFINITY
    }

    /// Returns whether the input rests from an offset (s) on, at the requested value.
    #[inline]
    pub fn rests_from(&self, offset: f64) -> bool {
        self.slope == 0.0 && self.rate == 0.0 && self.at(offset).to_bits() == self.value.to_bits()
    }

    /// First time derivative of the acting line.
    #[inline]
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Ends a communication step of length `length` (s): times now count from its end. A ramp that has not ended stops there.
    pub fn shift(&mut self, length: f64) {
        if self.is_ramp() {
            (self.reached, self.rate, self.from) = (self.at(length), 0.0, length);
            self.until = f64::INFINITY;
        }
        self.since -= length;
        self.from -= length;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(value: f64) -> Input {
        let mut input = Input::default();
        input.request(value, 0.0);
        input.act_immediately();
        input
    }

    /// Asserts that numbers agree to the last bit.
    #[track_caller]
    fn same<const N: usize>(found: [f64; N], expected: [f64; N]) {
        assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "{found:?} {expected:?}");
    }

    #[test]
    fn ramp_ends_exactly_at_the_requested_value() {
        let mut input = held(0.1);
        for (value, length) in [(0.7, 1e-3), (-1.0 / 3.0, 3e-7), (-1.0 / 3.0, 1e-4), (0.2, 7.0)] {
            let before = input.at(0.0);
            input.request(value, 0.0);
            assert_eq!(input.at(0.0).to_bits(), before.to_bits(), "nothing jumps");
            input.ramp(0.0, length);
            assert_eq!(input.at(0.0).to_bits(), before.to_bits(), "nothing jumps");
            assert!((input.at(0.5 * length) - 0.5 * (before + value)).abs() < 1e-15);
            assert_eq!(input.at(length).to_bits(), value.to_bits());
            input.shift(length);
            same([input.at(0.0), input.rate()], [value, 0.0]);
        }
    }

    #[test]
    fn consistent_derivative_gives_linear_interpolation() {
        let (mut input, slope, length) = (held(1.0), 2.5, 0.125);
        for step in 0..4 {
            let start = 1.0 + slope * length * f64::from(step);
            input.request(start, 0.0);
            input.request_slope(slope, 0.0);
            input.ramp(0.0, length);
            same([input.at(0.0), input.at(0.0625), input.rate()], [start, start + slope * 0.0625, slope]);
            input.shift(length);
        }
        // The input continues along that line until another value is requested, also after a step that ended early.
        input.ramp(0.0, length);
        input.shift(0.0625);
        input.ramp(0.0, 0.0625);
        same([input.at(0.0625)], [1.0 + slope * length * 5.0]);
    }

    #[test]
    fn value_set_within_a_ramp_redirects_the_ramp() {
        let mut input = held(0.0);
        input.request(1.0, 0.0);
        input.ramp(0.0, 1.0);
        input.request(-1.0, 0.25);
        input.ramp(0.25, 1.0);
        same([input.at(0.25), input.at(0.625), input.at(1.0)], [0.25, -0.375, -1.0]);
        // Ended early: the remaining change is distributed over the whole next step.
        input.shift(0.625);
        same([input.at(0.0)], [-0.375]);
        input.ramp(0.0, 2.0);
        same([input.at(1.0), input.at(2.0)], [-0.6875, -1.0]);
    }
}
