//! Impacts of rigid bodies: on a spring, and of a sphere (H. Hertz 1882; K. L. Johnson, Contact Mechanics, 1985, sections 4.2 and 11.4).

use std::f64::consts::PI;

/// Rebound of a mass from a massless spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounce {
    /// Time in contact (s).
    pub duration: f64,
    /// Largest force (N).
    pub force: f64,
    /// Largest compression (m).
    pub depth: f64,
    /// Impulse: twice the momentum (N·s).
    pub impulse: f64,
}

/// Returns the half period in contact: π√(m/k), v√(km), v√(m/k), 2mv for a mass (kg), spring (N/m) and speed (m/s).
pub fn rigid_bounce(mass: f64, stiffness: f64, speed: f64) -> Bounce {
    let omega = (stiffness / mass).sqrt();
    Bounce {
        duration: PI / omega,
        force: speed * (stiffness * mass).sqrt(),
        depth: speed / omega,
        impulse: 2.0 * mass * speed,
    }
}

/// Two elastic spheres, or a sphere and a half-space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hertz {
    /// Effective radius: 1/R = 1/R₁ + 1/R₂ (m).
    pub radius: f64,
    /// Effective modulus: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂ (Pa).
    pub modulus: f64,
}

impl Hertz {
    /// Returns the force for an approach (m): F = 4/3 E* √R δ^{3/2} (N).
    pub fn force(&self, approach: f64) -> f64 {
        4.0 / 3.0 * self.modulus * self.radius.sqrt() * approach.max(0.0).powf(1.5)
    }

    /// Returns the contact radius for a force: a³ = 3FR/4E* (m).
    pub fn contact_radius(&self, force: f64) -> f64 {
        (0.75 * force * self.radius / self.modulus).cbrt()
    }

    /// Returns the largest pressure: p₀ = 3F/2πa² (Pa).
    pub fn pressure(&self, force: f64) -> f64 {
        1.5 * force / (PI * self.contact_radius(force).powi(2))
    }

    /// Returns the pressure at a distance from the centre (m): p₀ √(1 − r²/a²) (Pa).
    pub fn pressure_at(&self, force: f64, distance: f64) -> f64 {
        let share = distance / self.contact_radius(force);
        self.pressure(force) * (1.0 - share * share).max(0.0).sqrt()
    }

    /// Returns the impact of a mass (kg) at a speed (m/s): δ_max from ½mv² = 8/15 E*√R δ^{5/2}, duration 2.9432
    /// δ_max/v.
    pub fn impact(&self, mass: f64, speed: f64) -> Bounce {
        let depth = (15.0 * mass * speed * speed / (16.0 * self.modulus * self.radius.sqrt())).powf(0.4);
        Bounce { duration: 2.943_275 * depth / speed, force: self.force(depth), depth, impulse: 2.0 * mass * speed }
    }
}
