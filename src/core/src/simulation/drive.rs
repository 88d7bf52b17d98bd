//! Rotor angle as the integral of an input.

pub(super) use tiprub_cosim::Input;
use tiprub_cosim::persist_fields;

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

    /// Sets the time since the origin to `elapsed` (s) if both agree within a fraction of it.
    pub(super) fn correct_elapsed(&mut self, elapsed: f64, fraction: f64) {
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
        input.request(value, 0.0);
        input.act_immediately();
        input
    }

    #[test]
    fn the_angle_of_a_ramp_is_exact_over_many_steps() {
        let (start, slope, length) = (100.0, 2000.0, 1e-3);
        let mut speed = held(start);
        let mut rotor = RotorAngle::new(7.0);
        for _ in 0..1000 {
            speed.request_slope(slope, 0.0);
            speed.act_immediately();
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
        speed.request(-2.0, 0.25);
        speed.act_immediately();
        assert!((rotor.total(&speed, 1.0) - (2.5 - 1.5)).abs() < 1e-14);
    }
}
