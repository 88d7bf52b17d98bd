//! The highest modes, three per contact node, are quasi-static, q = φᵀf/ω² (β = 0, κ = 1, c = 1/ω²): contact acts through their
//! residual flexibility alone. The other modes are stepped by modal-exact and take the contact force one step later, which makes
//! them explicit (A. Monjaraz-Tec, J. Gross, M. Krack, Computers & Structures 260, 2022).

use super::ModeCoefficients;

/// A mode without inertia, q = f/ω².
pub(super) fn quasi_static(frequency: f64) -> ModeCoefficients {
    let square = frequency * frequency;
    ModeCoefficients { kappa: 1.0, compliance: 1.0 / square, spring: 0.5 * square, ..ModeCoefficients::default() }
}

/// Delays the contact forces by one step.
pub(super) fn delay(mode: ModeCoefficients) -> ModeCoefficients {
    ModeCoefficients { compliance: 0.0, delayed: mode.compliance, ..mode }
}
