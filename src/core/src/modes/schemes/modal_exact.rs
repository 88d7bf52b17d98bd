//! The recurrence that is exact in free flight and at rest under a constant force: β = e^(−2ξωh), κ = 1 − 2e^(−ξωh) cos ω_d h +
//! e^(−2ξωh), c = κ/ω².

use super::{Recurrence, damped_frequency};

pub(super) fn recurrence(frequency: f64, damping_ratio: f64, step: f64) -> Recurrence {
    if frequency <= 0.0 {
        return Recurrence { beta: 1.0, kappa: 0.0, compliance: step * step };
    }
    let decay = damping_ratio * frequency * step;
    let beta = libm::exp(-2.0 * decay);
    // 1 − 2e^(−x) cos θ + e^(−2x) without cancellation.
    let fallen = libm::expm1(-decay);
    let sine = libm::sin(0.5 * damped_frequency(frequency, damping_ratio) * step);
    let kappa = fallen * fallen + 4.0 * libm::exp(-decay) * sine * sine;
    // Written with (ωh)² so that neither tiny nor huge frequencies overflow.
    let angle = frequency * step;
    Recurrence { beta, kappa, compliance: step * step * (kappa / (angle * angle)) }
}
