//! Inputs over time: held, or linear where the importer gave derivatives, and the rotor angle as their integral.

use crate::persist::persist_fields;

/// One real input: value at `since` and first derivative from there on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Input {
    /// Value at the time `since`.
    pub value: f64,
    /// First time derivative.
    pub slope: f64,
    /// Time of the value, as an offset from the start of the communication step (s).
    pub since: f64,
}

persist_fields!(Input { value, slope, since });

impl Input {
    /// Value at the offset `offset` from the start of the communication step (s).
    pub fn at(&self, offset: f64) -> f64 {
        if self.slope == 0.0 { self.value } else { self.value + self.slope * (offset - self.since) }
    }

    /// Give a new value from `offset` on; a derivative given earlier ends.
    pub fn set(&mut self, value: f64, offset: f64) {
        *self = Self { value, slope: 0.0, since: offset };
    }

    /// Give a derivative from `offset` on.
    pub fn set_slope(&mut self, slope: f64, offset: f64) {
        *self = Self { value: self.at(offset), slope, since: offset };
    }

    /// The communication step of length `length` is over: offsets count from its end now.
    pub fn shift(&mut self, length: f64) {
        self.since -= length;
    }
}

/// Rotor angle θ_r = ∫Ω dt, exact for piecewise linear Ω; whole turns are counted apart to keep the phase exact.
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
    /// Start at `angle` (rad).
    pub fn new(angle: f64) -> Self {
        let mut rotor = Self { angle, turns: 0.0, since: 0.0 };
        rotor.wrap();
        rotor
    }

    /// The remainder of a division is exact, however many turns.
    fn wrap(&mut self) {
        let turn = std::f64::consts::TAU;
        let rest = self.angle % turn;
        let rest = if rest < 0.0 { rest + turn } else { rest };
        self.turns += ((self.angle - rest) / turn).round();
        self.angle = rest;
    }

    /// Angle at `offset`, less whole turns at the last rebase (rad): the phase for trigonometry.
    pub fn phase(&self, speed: &Input, offset: f64) -> f64 {
        let elapsed = offset - self.since;
        self.angle + elapsed * (speed.at(self.since) + 0.5 * speed.slope * elapsed)
    }

    /// Total angle at `offset` (rad).
    pub fn total(&self, speed: &Input, offset: f64) -> f64 {
        self.phase(speed, offset) + self.turns * std::f64::consts::TAU
    }

    /// Make `offset` the new origin of integration (before the speed changes).
    pub fn rebase(&mut self, speed: &Input, offset: f64) {
        self.angle = self.phase(speed, offset);
        self.since = offset;
        self.wrap();
    }

    /// The communication step of length `length` is over.
    pub fn shift(&mut self, length: f64) {
        self.since -= length;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_of_a_ramp_is_exact_over_many_steps() {
        let (start, slope, length) = (100.0, 2000.0, 1e-3);
        let mut speed = Input { value: start, slope: 0.0, since: 0.0 };
        let mut rotor = RotorAngle::new(7.0);
        for _ in 0..1000 {
            speed.set_slope(slope, 0.0);
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
        let speed = Input { value: 10.0, slope: 0.0, since: 0.0 };
        for angle in [1e9, -1e9, 1e20, -1e154, 1e308] {
            let rotor = RotorAngle::new(angle);
            let (phase, rest) = (rotor.phase(&speed, 0.0), angle % std::f64::consts::TAU);
            assert!((0.0..=std::f64::consts::TAU).contains(&phase), "{angle:e}: {phase:e}");
            let expected = if rest < 0.0 { rest + std::f64::consts::TAU } else { rest };
            assert_eq!(phase.to_bits(), expected.to_bits(), "{angle:e}");
            // It turns on from there.
            assert!((rotor.phase(&speed, 0.1) - phase - 1.0).abs() < 1e-14, "{angle:e}");
        }
    }

    #[test]
    fn a_speed_change_within_the_step_counts_from_there() {
        let mut speed = Input { value: 10.0, slope: 0.0, since: 0.0 };
        let mut rotor = RotorAngle::new(0.0);
        rotor.rebase(&speed, 0.25);
        speed.set(-2.0, 0.25);
        assert!((rotor.total(&speed, 1.0) - (2.5 - 1.5)).abs() < 1e-14);
    }
}
