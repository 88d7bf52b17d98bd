//! Continuous Galerkin in time ([`crate::time::galerkin`]): coefficients for the state in the bank of modes.

use super::ModeCoefficients;

/// State (q, d) with d = h q̇; the energies are ½(d/h)² and ½ω²q². Only [`crate::time::galerkin`] moves these modes by forces.
pub(super) fn state(frequency: f64, step: f64) -> ModeCoefficients {
    ModeCoefficients {
        beta: 1.0,
        inertia: 0.5 / (step * step),
        spring: 0.5 * frequency * frequency,
        ..ModeCoefficients::default()
    }
}
