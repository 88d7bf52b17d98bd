//! A block on a belt, held by a spring: stick-slip with two coefficients (J. P. den Hartog 1931).

/// Block, spring, belt and friction forces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belt {
    /// Mass (kg).
    pub mass: f64,
    /// Spring (N/m).
    pub stiffness: f64,
    /// Speed of the belt (m/s).
    pub speed: f64,
    /// Largest friction force while sticking F_s (N).
    pub sticking: f64,
    /// Friction force while sliding F_k (N).
    pub sliding: f64,
}

impl Belt {
    /// ω = √(k/m) (rad/s).
    pub(crate) fn omega(&self) -> f64 {
        (self.stiffness / self.mass).sqrt()
    }

    /// a = (F_s − F_k)/k (m).
    pub(crate) fn offset(&self) -> f64 {
        (self.sticking - self.sliding) / self.stiffness
    }

    /// Amplitude about F_k/k: √(a² + v²/ω²) (m).
    pub fn amplitude(&self) -> f64 {
        self.offset().hypot(self.speed / self.omega())
    }

    /// Time of sliding: (2π − 2 atan(aω/v))/ω (s).
    pub fn slide_time(&self) -> f64 {
        (std::f64::consts::TAU - 2.0 * (self.offset() * self.omega() / self.speed).atan()) / self.omega()
    }

    /// Time of sticking: 2a/v (s).
    pub fn stick_time(&self) -> f64 {
        2.0 * self.offset() / self.speed
    }
}
