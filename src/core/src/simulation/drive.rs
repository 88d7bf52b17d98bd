//! One input over time, and the rotor angle as the integral of another.

use tiprub_cosim::persist_fields;

/// One real input: the line requested by the importer, and the acting line.
///
/// Both are the same if a value acts immediately. Otherwise the acting line goes from the value reached to the value of the requested line
/// at the end of the communication step: it is always continuous. Times are offsets from the start of the communication step (s).
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
    /// Acting value at the time `until`, to the last bit.
    end: f64,
    until: f64,
}

persist_fields!(Input { value, slope, since, reached, rate, from, end, until });

impl Input {
    /// Requests a value at `offset`; a derivative requested earlier ends.
    pub fn ask(&mut self, value: f64, offset: f64) {
        (self.value, self.slope, self.since) = (value, 0.0, offset);
    }

    /// Requests a derivative from `offset` on.
    pub(crate) fn ask_slope(&mut self, slope: f64, offset: f64) {
        (self.value, self.slope, self.since) = (self.requested_value(offset), slope, offset);
    }

    /// Copies the requested line of another input.
    pub fn follow(&mut self, other: &Self) {
        (self.value, self.slope, self.since) = (other.value, other.slope, other.since);
    }

    /// Requested value at `offset`.
    pub(crate) fn requested_value(&self, offset: f64) -> f64 {
        if self.slope == 0.0 { self.value } else { self.value + self.slope * (offset - self.since) }
    }

    /// Makes the requested line act immediately.
    pub fn take(&mut self) {
        (self.reached, self.rate, self.from) = (self.value, self.slope, self.since);
        self.until = f64::INFINITY;
    }

    /// Ramps from the value reached at `offset` to the requested value at `until`.
    pub(crate) fn aim(&mut self, offset: f64, until: f64) {
        let (reached, end) = (self.at(offset), self.requested_value(until));
        (self.reached, self.from) = (reached, offset);
        (self.end, self.until) = (end, until);
        self.rate = (end - reached) / (until - offset);
    }

    /// Acting value at `offset`.
    pub fn at(&self, offset: f64) -> f64 {
        if offset >= self.until {
            self.end
        } else if self.rate == 0.0 {
            self.reached
        } else {
            self.reached + self.rate * (offset - self.from)
        }
    }

    /// First time derivative of the acting line.
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Ends the communication step of length `length`: times now count from its end, where a ramp ends.
    pub fn shift(&mut self, length: f64) {
        if self.until < f64::INFINITY {
            (self.reached, self.rate, self.from) = (self.at(length), 0.0, length);
            self.until = f64::INFINITY;
        }
        self.since -= length;
        self.from -= length;
    }
}

/// Rotor angle θ_r = ∫Ω dt, exact for piecewise linear Ω; whole turns are counted separately to keep the phase exact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RotorAngle {
    /// Angle within one turn at `since` (rad).
    angle: f64,
    /// Whole turns at `since`.
    turns: f64,
    /// Offset from the start of the communication step (s).
    since: f64,
}

persist_fields!(RotorAngle { angle, turns, since });

impl RotorAngle {
    /// Starts at `angle` (rad).
    pub fn new(angle: f64) -> Self {
        let mut rotor = Self { angle, turns: 0.0, since: 0.0 };
        rotor.wrap();
        rotor
    }

    /// Moves whole turns to their counter. The remainder of a division is exact for any number of turns.
    fn wrap(&mut self) {
        let turn = std::f64::consts::TAU;
        let rest = self.angle % turn;
        let rest = if rest < 0.0 { rest + turn } else { rest };
        self.turns += ((self.angle - rest) / turn).round();
        self.angle = rest;
    }

    /// Angle at `offset` minus the whole turns at the last rebase (rad): the phase for trigonometry.
    pub fn phase(&self, speed: &Input, offset: f64) -> f64 {
        let elapsed = offset - self.since;
        self.angle + elapsed * (speed.at(self.since) + 0.5 * speed.rate() * elapsed)
    }

    /// Total angle at `offset` (rad).
    pub fn total(&self, speed: &Input, offset: f64) -> f64 {
        self.phase(speed, offset) + self.turns * std::f64::consts::TAU
    }

    /// Makes `offset` the new origin of integration (before the speed changes).
    pub(crate) fn rebase(&mut self, speed: &Input, offset: f64) {
        self.angle = self.phase(speed, offset);
        self.since = offset;
        self.wrap();
    }

    /// Ends the communication step of length `length`.
    pub fn shift(&mut self, length: f64) {
        self.since -= length;
    }

    /// Corrects the time since the origin to `elapsed` (s) if it is the same within a fraction.
    pub(super) fn keep_elapsed(&mut self, elapsed: f64, fraction: f64) {
        if (self.since + elapsed).abs() <= fraction * elapsed {
            self.since = -elapsed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(value: f64) -> Input {
        let mut input = Input::default();
        input.ask(value, 0.0);
        input.take();
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
            input.ask(value, 0.0);
            assert_eq!(input.at(0.0).to_bits(), before.to_bits(), "nothing jumps");
            input.aim(0.0, length);
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
            input.ask(start, 0.0);
            input.ask_slope(slope, 0.0);
            input.aim(0.0, length);
            same([input.at(0.0), input.at(0.0625), input.rate()], [start, start + slope * 0.0625, slope]);
            input.shift(length);
        }
        // The input continues along that line until another value is requested, also after a step that ended early.
        input.aim(0.0, length);
        input.shift(0.0625);
        input.aim(0.0, 0.0625);
        same([input.at(0.0625)], [1.0 + slope * length * 5.0]);
    }

    #[test]
    fn value_set_within_a_ramp_redirects_the_ramp() {
        let mut input = held(0.0);
        input.ask(1.0, 0.0);
        input.aim(0.0, 1.0);
        input.ask(-1.0, 0.25);
        input.aim(0.25, 1.0);
        same([input.at(0.25), input.at(0.625), input.at(1.0)], [0.25, -0.375, -1.0]);
        // Ended early: the remaining change is distributed over the whole next step.
        input.shift(0.625);
        same([input.at(0.0)], [-0.375]);
        input.aim(0.0, 2.0);
        same([input.at(1.0), input.at(2.0)], [-0.6875, -1.0]);
    }

    #[test]
    fn the_angle_of_a_ramp_is_exact_over_many_steps() {
        let (start, slope, length) = (100.0, 2000.0, 1e-3);
        let mut speed = held(start);
        let mut rotor = RotorAngle::new(7.0);
        for _ in 0..1000 {
            speed.ask_slope(slope, 0.0);
            speed.take();
            rotor.rebase(&speed, length);
            rotor.shift(length);
            speed.shift(length);
        }
        let exact = 7.0 + start + 0.5 * slope;
        assert!((rotor.total(&speed, 0.0) - exact).abs() < 1e-9, "{} vs {exact}", rotor.total(&speed, 0.0));
        assert!((0.0..std::f64::consts::TAU).contains(&rotor.phase(&speed, 0.0)));
    }

    #[test]
    fn an_angle_of_many_turns_keeps_its_phase() {
        let speed = held(10.0);
        for angle in [1e9, -1e9, 1e20, -1e154, 1e308] {
            let rotor = RotorAngle::new(angle);
            let (phase, rest) = (rotor.phase(&speed, 0.0), angle % std::f64::consts::TAU);
            assert!((0.0..=std::f64::consts::TAU).contains(&phase), "{angle:e}: {phase:e}");
            let expected = if rest < 0.0 { rest + std::f64::consts::TAU } else { rest };
            assert_eq!(phase.to_bits(), expected.to_bits(), "{angle:e}");
            // It continues to turn from there.
            assert!((rotor.phase(&speed, 0.1) - phase - 1.0).abs() < 1e-14, "{angle:e}");
        }
    }

    #[test]
    fn speed_change_within_the_step_acts_from_that_time() {
        let mut speed = held(10.0);
        let mut rotor = RotorAngle::new(0.0);
        rotor.rebase(&speed, 0.25);
        speed.ask(-2.0, 0.25);
        speed.take();
        assert!((rotor.total(&speed, 1.0) - (2.5 - 1.5)).abs() < 1e-14);
    }
}
