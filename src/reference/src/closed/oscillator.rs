//! Oscillators with one stop: rigid without restitution, elastic (bilinear), and a mass that bounces under gravity.

use std::f64::consts::PI;

/// Mass on a spring (ω), released at rest at x = A, with a rigid, fully inelastic stop at x = −d.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeadStop {
    /// Angular frequency without the stop (rad/s).
    pub omega: f64,
    /// A (m).
    pub amplitude: f64,
    /// d (m), 0 < d < A.
    pub distance: f64,
}

impl DeadStop {
    /// Returns the time of the only impact: cos ωt = −d/A (s).
    pub fn touch(&self) -> f64 {
        (-self.distance / self.amplitude).acos() / self.omega
    }

    /// Returns the position (m): A cos ωt, then −d cos ω(t − t₁), which only grazes the stop once per period.
    pub fn position(&self, time: f64) -> f64 {
        let touch = self.touch();
        if time < touch {
            self.amplitude * (self.omega * time).cos()
        } else {
            -self.distance * (self.omega * (time - touch)).cos()
        }
    }

    /// Returns the fraction of the energy that the impact dissipates: 1 − d²/A².
    pub fn loss(&self) -> f64 {
        1.0 - (self.distance / self.amplitude).powi(2)
    }
}

/// Mass on a spring (ω) that meets a second spring at x = d: ω_c² = (k + k_c)/m while it touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bilinear {
    /// Angular frequency away from the stop (rad/s).
    pub omega: f64,
    /// Stiffness of the stop over that of the spring, k_c/k.
    pub ratio: f64,
    /// d (m).
    pub distance: f64,
    /// Largest |x| on the free side (m), above d; it grazes if equal to d.
    pub amplitude: f64,
}

impl Bilinear {
    /// Returns ω_c (rad/s).
    pub(crate) fn closed_omega(&self) -> f64 {
        self.omega * (1.0 + self.ratio).sqrt()
    }

    /// Returns the middle of the oscillation in contact: d k_c/(k + k_c) (m).
    fn middle(&self) -> f64 {
        self.distance * self.ratio / (1.0 + self.ratio)
    }

    fn touch_speed(&self) -> f64 {
        self.omega * (self.amplitude * self.amplitude - self.distance * self.distance).sqrt()
    }

    /// Returns the time in contact: 2/ω_c · atan(v/(ω_c (d − x_m))) (s).
    pub(crate) fn closed_time(&self) -> f64 {
        let omega = self.closed_omega();
        2.0 * (self.touch_speed() / (omega * (self.distance - self.middle()))).atan() / omega
    }

    /// Returns the time out of contact: 2/ω · (π − acos(d/A)) (s).
    pub(crate) fn open_time(&self) -> f64 {
        2.0 * (PI - (self.distance / self.amplitude).acos()) / self.omega
    }

    /// Returns the period (s).
    pub fn period(&self) -> f64 {
        self.open_time() + self.closed_time()
    }

    /// Returns the position at a time after the free extreme x = −A (m).
    pub fn position(&self, time: f64) -> f64 {
        let time = time.rem_euclid(self.period());
        let half = 0.5 * self.open_time();
        if time <= half || time >= half + self.closed_time() {
            let back = if time <= half { time } else { self.period() - time };
            return -self.amplitude * (self.omega * back).cos();
        }
        let (angle, omega) = (self.closed_omega() * (time - half), self.closed_omega());
        self.middle() + (self.distance - self.middle()) * angle.cos() + self.touch_speed() / omega * angle.sin()
    }

    /// Returns the largest force of the stop per unit of k (m): k_c/k · (x_max − d).
    pub fn force_per_stiffness(&self) -> f64 {
        let reach = (self.distance - self.middle()).hypot(self.touch_speed() / self.closed_omega());
        self.ratio * (self.middle() + reach - self.distance)
    }
}

/// Mass that is dropped on a massless spring and bounces periodically.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// √(k/m) (rad/s).
    pub omega: f64,
    /// Gravity (m/s²).
    pub gravity: f64,
    /// Height of the drop (m).
    pub height: f64,
}

impl Ball {
    /// Returns the speed at the touch: √(2gH) (m/s).
    pub(crate) fn speed(&self) -> f64 {
        (2.0 * self.gravity * self.height).sqrt()
    }

    /// Returns the time of the drop: √(2H/g) (s).
    pub fn fall(&self) -> f64 {
        (2.0 * self.height / self.gravity).sqrt()
    }

    /// Returns the time in contact: 2/ω · (π − atan(vω/g)) (s).
    pub(crate) fn contact(&self) -> f64 {
        2.0 * (PI - (self.speed() * self.omega / self.gravity).atan()) / self.omega
    }

    /// Returns the time from one release at the top to the next (s).
    pub fn period(&self) -> f64 {
        2.0 * self.fall() + self.contact()
    }

    /// Returns the largest force over weight: 1 + √(1 + v²ω²/g²).
    pub fn force_over_weight(&self) -> f64 {
        1.0 + 1.0_f64.hypot(self.speed() * self.omega / self.gravity)
    }

    /// Returns the height (m) at a time after the release.
    pub fn position(&self, time: f64) -> f64 {
        let time = time.rem_euclid(self.period());
        let (fall, contact) = (self.fall(), self.contact());
        if time < fall || time > fall + contact {
            let since_top = if time < fall { time } else { self.period() - time };
            return self.height - 0.5 * self.gravity * since_top * since_top;
        }
        let angle = self.omega * (time - fall);
        let sag = self.gravity / (self.omega * self.omega);
        -sag * (1.0 - angle.cos()) - self.speed() / self.omega * angle.sin()
    }
}
