//! Explicit central differences (eq. 9 of the paper): β = (1 − ξωh)/(1 + ξωh), κ = ω²h²/(1 + ξωh), c = h²/(1 + ξωh). Stable for
//! ωh < 2.

use super::Recurrence;

pub(super) fn recurrence(frequency: f64, damping_ratio: f64, step: f64) -> Recurrence {
    let divisor = 1.0 + damping_ratio * frequency * step;
    let square = frequency * step;
    Recurrence {
        beta: (1.0 - damping_ratio * frequency * step) / divisor,
        kappa: square * square / divisor,
        compliance: step * step / divisor,
    }
}
