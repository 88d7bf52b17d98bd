//! Head-on impact of two identical elastic bars: data and exact solution.
//!
//! N. J. Carpenter, R. L. Taylor, M. G. Katona, Int. J. Numer. Meth. Engng 32 (1991) 103-128, section 5.

/// Young's modulus (Pa).
pub const YOUNG: f64 = 206.8e9;
/// Density (kg/m³).
pub const DENSITY: f64 = 7844.066;
/// Cross-section (m²).
pub const AREA: f64 = 6.4516e-4;
/// Length of each bar (m).
pub const LENGTH: f64 = 0.254;
/// Speed of each bar (m/s).
pub const SPEED: f64 = 5.13588;
/// Initial gap between the bars (m).
pub const GAP: f64 = 0.508e-3;

/// Exact solution of one-dimensional elasticity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exact {
    /// Contact force while touching (N).
    pub force: f64,
    /// First touch (s).
    pub touch: f64,
    /// Release (s).
    pub release: f64,
    /// Impulse (N·s).
    pub impulse: f64,
    /// Energy, constant (J).
    pub energy: f64,
}

/// Returns the wave speed √(E/ρ) (m/s).
pub fn wave_speed() -> f64 {
    (YOUNG / DENSITY).sqrt()
}

/// Returns the plane-wave solution: force ρcvA for the time 2L/c of a wave to the free end and back.
pub fn exact() -> Exact {
    let force = DENSITY * wave_speed() * SPEED * AREA;
    let touch = GAP / (2.0 * SPEED);
    let duration = 2.0 * LENGTH / wave_speed();
    let mass = DENSITY * AREA * LENGTH;
    Exact { force, touch, release: touch + duration, impulse: force * duration, energy: mass * SPEED * SPEED }
}

#[cfg(test)]
mod tests {
    #[test]
    fn exact_solution_matches_published_values() {
        // Values as stated for this benchmark: 133,452.9 N, 49.46 µs, 148.39 µs, 13.203 N·s, 33.906 J.
        let exact = super::exact();
        assert!((exact.force - 133_452.9).abs() < 1.0, "{}", exact.force);
        assert!((exact.touch - 49.46e-6).abs() < 0.01e-6);
        assert!((exact.release - 148.39e-6).abs() < 0.01e-6);
        assert!((exact.impulse - 13.203).abs() < 1e-3);
        assert!((exact.energy - 33.906).abs() < 1e-3);
    }
}
