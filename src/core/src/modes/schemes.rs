//! Time-stepping coefficients per mode, and the energy each scheme conserves.
//!
//! Schemes with fixed steps are the two-step recurrence q⁺ = a q + b q⁻ + c f. It is stepped in summed form,
//!
//! ```text
//! d⁺ = β d − κ q + c f,   q⁺ = q + d⁺,   with d = q − q⁻, β = −b, κ = 1 − a − b = c ω²,
//! ```
//!
//! which needs the same work and does not lose the small restoring term κ q in the rounding of a ≈ 2.
//!
//! * central differences (eq. 9 of the paper): β = (1 − ξωh)/(1 + ξωh), κ = ω²h²/(1 + ξωh), c = h²/(1 + ξωh), stable
//!   for ωh < 2;
//! * modal-exact, which is exact in free vibration and at rest under a constant force: β = e^(−2ξωh), κ = 1 − 2e^(−ξωh)
//!   cos ω_d h + e^(−2ξωh), c = κ/ω².
//!
//! Either recurrence is m̃ (q⁺ − 2q + q⁻)/h² + d̃ (q⁺ − q⁻)/(2h) + ω² q = f with m̃ = h²(1 + β)/(2c) and d̃ = h(1 − β)/c.
//! Multiplication by (q⁺ − q⁻)/2 gives the energy balance, which closes to rounding: E = ½ m̃ (d/h)² + ½ ω² q q⁻ changes by f (q⁺
//! − q⁻)/2 − d̃ h ((q⁺ − q⁻)/2h)². Modal-exact is thus central differences with the modal mass that makes the discrete frequency
//! exact.
//!
//! * massless-boundary (A. Monjaraz-Tec, J. Gross, M. Krack, Computers & Structures 260, 2022, arXiv 2111.07693): the highest modes are
//!   quasi-static, q = φᵀf/ω² (β = 0, κ = 1, c = 1/ω²), so that contact acts through their residual flexibility alone; the
//!   other modes are stepped by modal-exact and take the contact force one step later, which makes them explicit. The
//!   force f of time n does the work f (u⁺ − u⁻)/2, known with q(n+1), which changes the same E; a static mode contributes only ½ ω² q q⁻.
//! * continuous Galerkin ([`crate::time::galerkin`]) stores (q, d) with d = hq̇; the energies are ½(d/h)² and ½ω²q².

use crate::scene::method::Scheme;

/// q⁺ = q + d⁺, d⁺ = β d − κ q + c f of one mode.
struct Recurrence {
    beta: f64,
    kappa: f64,
    compliance: f64,
}

impl Recurrence {
    fn central_difference(frequency: f64, damping_ratio: f64, step: f64) -> Self {
        let divisor = 1.0 + damping_ratio * frequency * step;
        let square = frequency * step;
        Self {
            beta: (1.0 - damping_ratio * frequency * step) / divisor,
            kappa: square * square / divisor,
            compliance: step * step / divisor,
        }
    }

    fn modal_exact(frequency: f64, damping_ratio: f64, step: f64) -> Self {
        if frequency <= 0.0 {
            return Self { beta: 1.0, kappa: 0.0, compliance: step * step };
        }
        let decay = damping_ratio * frequency * step;
        let beta = libm::exp(-2.0 * decay);
        // 1 − 2e^(−x) cos θ + e^(−2x) without cancellation.
        let fallen = libm::expm1(-decay);
        let sine = libm::sin(0.5 * damped_frequency(frequency, damping_ratio) * step);
        let kappa = fallen * fallen + 4.0 * libm::exp(-decay) * sine * sine;
        // Written with (ωh)² so that neither tiny nor huge frequencies overflow.
        let angle = frequency * step;
        Self { beta, kappa, compliance: step * step * (kappa / (angle * angle)) }
    }
}

impl Scheme {
    /// Factor on the amplitude of a harmonic force that turns by x = `turn` (rad) per step: (x/2)/tan(x/2).
    ///
    /// The modal-exact recurrence multiplies the force at the start of a step by c = 2(1 − cos ωh)/ω², as if it were constant.
    /// The exact coefficient of a force cos Ωt is 2(cos Ωh − cos ωh)/(ω² − Ω²). Their ratio at resonance, ω = Ω, is this factor,
    /// about 1 − x²/12. Modes far below Ω need sin²(x/2)/(x/2)², which differs from it by x⁴/240. The factor is also used beyond
    /// one radian, where a step does not resolve the force, and is set to 1 where it differs from 1 by less than 4e-7. Central
    /// differences get no factor, because their error belongs to the recurrence.
    pub fn harmonic_factor(self, turn: f64) -> f64 {
        const SMALL: f64 = 2e-3;
        let turn = turn.abs().min(crate::scene::ranges::EXCITED_ANGLE);
        if self.properties().holds_loads && turn > SMALL { 0.5 * turn / libm::tan(0.5 * turn) } else { 1.0 }
    }

    /// Second part of the state of a mode with angular frequency ω (rad/s) and damping ratio ξ at a position q and velocity q̇, without force:
    /// its increment over the last step h (s), or hq̇.
    pub fn increment(self, frequency: f64, damping_ratio: f64, position: f64, velocity: f64, step: f64) -> f64 {
        if self.properties().stores_velocity {
            velocity * step
        } else {
            free_increment(frequency, damping_ratio, position, velocity, step)
        }
    }

    /// Coefficients of the velocity of a mode with inertia.
    pub fn velocity(self, frequency: f64, damping_ratio: f64, step: f64) -> Velocity {
        if self.properties().stores_velocity {
            Velocity::of_state(step)
        } else {
            Velocity::new(frequency, damping_ratio, step)
        }
    }

    /// Share of the increment by which the second position of the strain energy is earlier than the first: q (q − share · d).
    pub(crate) fn strain_lag(self) -> f64 {
        if self.properties().stores_velocity { 0.0 } else { 1.0 }
    }
}

/// Coefficients of one mode at one step size.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ModeCoefficients {
    /// β = −b.
    pub beta: f64,
    /// κ = 1 − a − b = c ω².
    pub kappa: f64,
    /// c: displacement per unit modal force held for one step (s²), for contact forces of the same step.
    pub compliance: f64,
    /// c for contact forces that act one step after they were found (massless-boundary), otherwise 0.
    pub delayed: f64,
    /// (1 − β)/(4c): damping loss per (d⁺ + d)².
    pub loss: f64,
    /// (1 + β)/(4c): kinetic energy per d².
    pub inertia: f64,
    /// ω²/2: strain energy per q·q⁻.
    pub spring: f64,
}

impl ModeCoefficients {
    /// Coefficients for angular frequency ω (rad/s, 0 for a rigid-body mode), damping ratio 0 ≤ ξ < 1 and step h (s).
    pub fn new(scheme: Scheme, frequency: f64, damping_ratio: f64, step: f64) -> Self {
        let spring = 0.5 * frequency * frequency;
        let Recurrence { beta, kappa, compliance } = match scheme {
            // In this scheme only [`crate::time::galerkin`] applies forces to the modes.
            Scheme::Galerkin => {
                return Self { beta: 1.0, inertia: 0.5 / (step * step), spring, ..Self::default() };
            }
            Scheme::CentralDifference => Recurrence::central_difference(frequency, damping_ratio, step),
            // Massless-boundary: its modes with inertia.
            Scheme::ModalExact | Scheme::MasslessBoundary => Recurrence::modal_exact(frequency, damping_ratio, step),
        };
        Self {
            beta,
            kappa,
            compliance,
            loss: (1.0 - beta) / (4.0 * compliance),
            inertia: (1.0 + beta) / (4.0 * compliance),
            spring,
            ..Self::default()
        }
    }

    /// Coefficients of a mode that has inertia under the scheme (`dynamic`) or is quasi-static.
    pub(crate) fn of_mode(scheme: Scheme, dynamic: bool, frequency: f64, damping_ratio: f64, step: f64) -> Self {
        if !dynamic {
            let square = frequency * frequency;
            return Self { kappa: 1.0, compliance: 1.0 / square, spring: 0.5 * square, ..Self::default() };
        }
        let mode = Self::new(scheme, frequency, damping_ratio, step);
        let delays = scheme.properties().delays_contact;
        if delays { Self { compliance: 0.0, delayed: mode.compliance, ..mode } } else { mode }
    }

    /// Coefficients of a mode whose stiffness, inertia and damping are multiplied by `share`.
    #[must_use]
    pub(crate) fn with_stiffness(self, share: f64) -> Self {
        Self {
            compliance: self.compliance / share,
            delayed: self.delayed / share,
            loss: self.loss * share,
            inertia: self.inertia * share,
            spring: self.spring * share,
            ..self
        }
    }

    /// Displacement per unit of a prescribed modal force (s²).
    pub(crate) fn load_compliance(&self) -> f64 {
        self.compliance + self.delayed
    }
}

/// ω_d = ω √(1 − ξ²).
pub(crate) fn damped_frequency(frequency: f64, damping_ratio: f64) -> f64 {
    frequency * libm::sqrt(1.0 - damping_ratio * damping_ratio)
}

/// Increment q(t) − q(t − h') at a new step size h' = `new_step` of the motion that passes through q(t) = `now` with
/// `increment` = q(t) − q(t − h) under the constant modal force `force`.
///
/// This converts the state (q, d) from one h to another without loss of order. Beyond ω_d h ≈ π two samples no longer determine
/// the motion; the sine is then bounded away from zero, which reduces the energy of modes that the step does not resolve.
pub fn resample(
    frequency: f64,
    damping_ratio: f64,
    now: f64,
    increment: f64,
    force: f64,
    step: f64,
    new_step: f64,
) -> f64 {
    if frequency <= 0.0 {
        let velocity = increment / step + 0.5 * force * step;
        return velocity * new_step - 0.5 * force * new_step * new_step;
    }
    let damped = damped_frequency(frequency, damping_ratio);
    let rate = damping_ratio * frequency;
    let offset = now - force / (frequency * frequency);
    let grown = libm::exp(-rate * step);
    // offset·cos θ − y e^(−σh), with y = offset − increment, written for small θ.
    let half = libm::sin(0.5 * damped * step);
    let numerator = increment * grown - offset * (libm::expm1(-rate * step) + 2.0 * half * half);
    increment_of(damped, rate, offset, numerator / sine_of(damped * step), new_step)
}

/// Velocity of a mode at the time of its position, q̇ = `increment` d + `position` q + `force` f, for the motion that passes
/// through q and q − d under the constant modal force f.
///
/// It is exact where the recurrence is exact (modal-exact) and second-order accurate in h for central differences. Beyond ω_d h ≈
/// π the samples do not determine the velocity; it is bounded as in [`resample`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Velocity {
    /// Per increment of the last step (1/s).
    increment: f64,
    /// Per position (1/s).
    position: f64,
    /// Per modal force (s).
    force: f64,
}

impl Velocity {
    /// Coefficients for angular frequency ω (rad/s, 0 for a rigid-body mode), damping ratio 0 ≤ ξ < 1 and step h (s).
    pub fn new(frequency: f64, damping_ratio: f64, step: f64) -> Self {
        if frequency <= 0.0 {
            return Self { increment: 1.0 / step, position: 0.0, force: 0.5 * step };
        }
        let (damped, rate) = (damped_frequency(frequency, damping_ratio), damping_ratio * frequency);
        let per_sine = damped / sine_of(damped * step);
        let half = libm::sin(0.5 * damped * step);
        let position = -rate - per_sine * (libm::expm1(-rate * step) + 2.0 * half * half);
        Self { increment: per_sine * libm::exp(-rate * step), position, force: -position / frequency / frequency }
    }

    /// Coefficients for states (q, hq̇).
    pub(crate) fn of_state(step: f64) -> Self {
        Self { increment: 1.0 / step, position: 0.0, force: 0.0 }
    }

    /// Returns q̇ of a mode with position `now` = q and last increment `increment` = d under the modal force `force`.
    pub fn of(&self, now: f64, increment: f64, force: f64) -> f64 {
        self.increment * increment + self.position * now + self.force * force
    }
}

/// Sine of the phase angle of a step, bounded away from zero where two samples no longer determine the motion.
fn sine_of(angle: f64) -> f64 {
    let sine = libm::sin(angle);
    if angle > 2.0 && sine.abs() < 0.3 { 0.3_f64.copysign(sine) } else { sine }
}

/// Increment q(0) − q(−h) of the free motion (without force) with the given position and velocity at time 0.
pub fn free_increment(frequency: f64, damping_ratio: f64, position: f64, velocity: f64, step: f64) -> f64 {
    if frequency <= 0.0 {
        return velocity * step;
    }
    let damped = damped_frequency(frequency, damping_ratio);
    let rate = damping_ratio * frequency;
    increment_of(damped, rate, position, (velocity + rate * position) / damped, step)
}

/// x(0) − x(−h) for x(t) = e^(−σt)(x₀ cos ω_d t + B sin ω_d t), without cancellation for small ω_d h.
fn increment_of(damped: f64, rate: f64, offset: f64, amplitude: f64, step: f64) -> f64 {
    let half = libm::sin(0.5 * damped * step);
    let growth = libm::expm1(rate * step);
    amplitude * libm::sin(damped * step) * (1.0 + growth)
        - offset * (growth * libm::cos(damped * step) - 2.0 * half * half)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASES: [(f64, f64); 5] = [(0.0, 0.0), (1e-3, 0.01), (1.0, 0.0), (700.0, 0.005), (3e4, 0.3)];

    /// Free damped motion of a modal coordinate from (q, v) under constant force.
    fn exact(frequency: f64, ratio: f64, q: f64, v: f64, force: f64, t: f64) -> f64 {
        if frequency == 0.0 {
            return q + v * t + 0.5 * force * t * t;
        }
        let damped = damped_frequency(frequency, ratio);
        let rest = force / (frequency * frequency);
        let rate = ratio * frequency;
        let x = q - rest;
        rest + (-rate * t).exp() * (x * (damped * t).cos() + (v + rate * x) / damped * (damped * t).sin())
    }

    /// A force whose static displacement does not cause large rounding errors in [`exact`].
    fn force_for(frequency: f64) -> f64 {
        if frequency == 0.0 { 5.0 } else { 1e-3 * frequency * frequency }
    }

    #[test]
    fn modal_exact_follows_the_exact_motion_under_constant_force() {
        let step = 1e-5;
        for (frequency, ratio) in CASES {
            let (q0, v0, force) = (1e-4, 0.3, force_for(frequency));
            let at = |n: f64| exact(frequency, ratio, q0, v0, force, n * step);
            let k = ModeCoefficients::new(Scheme::ModalExact, frequency, ratio, step);
            let (mut q, mut d) = (q0, q0 - at(-1.0));
            for n in 1..=1000 {
                d = k.beta * d - k.kappa * q + k.compliance * force;
                q += d;
                let error = (q - at(f64::from(n))).abs();
                assert!(error < 1e-12, "ω {frequency}, ξ {ratio}, step {n}: error {error:e}");
            }
        }
    }

    #[test]
    fn resampling_continues_the_exact_motion() {
        for (frequency, ratio) in CASES {
            for (step, new_step) in [(1e-5, 2.5e-6), (1e-6, 1e-5), (3e-5, 3e-5 * (1.0 + 1e-9))] {
                let (q, v, force) = (1e-4, 0.3, force_for(frequency));
                let at = |t: f64| exact(frequency, ratio, q, v, force, t);
                let increment = resample(frequency, ratio, q, q - at(-step), force, step, new_step);
                let expected = q - at(-new_step);
                let error = (increment - expected).abs() / expected.abs();
                assert!(error < 1e-9, "ω {frequency}, ξ {ratio}, {step} -> {new_step}: {increment} vs {expected}");
            }
        }
    }

    #[test]
    fn instantaneous_velocity_matches_exact_motion() {
        for (frequency, ratio) in CASES {
            for step in [1e-6, 1e-5, 4e-5] {
                let (q, v, force) = (1e-4, 0.3, force_for(frequency));
                let before = exact(frequency, ratio, q, v, force, -step);
                let found = Velocity::new(frequency, ratio, step).of(q, q - before, force);
                // Rounding of q − q⁻ over h.
                let bound = 1e-9 * v + 4.0 * f64::EPSILON * (q + before.abs()) / step;
                assert!((found - v).abs() < bound, "ω {frequency}, ξ {ratio}, h {step}: {found} vs {v}");
                // At rest under a constant force.
                if frequency == 0.0 {
                    continue;
                }
                let rest = force / (frequency * frequency);
                let still = Velocity::new(frequency, ratio, step).of(rest, 0.0, force);
                assert!(still.abs() < 1e-14 * frequency * rest, "ω {frequency}, ξ {ratio}, h {step}: {still:e}");
            }
        }
    }

    #[test]
    fn central_difference_velocity_is_second_order() {
        let (frequency, ratio) = (3e4_f64, 0.01);
        let error = |step: f64| {
            let k = ModeCoefficients::new(Scheme::CentralDifference, frequency, ratio, step);
            let (mut q, mut d) = (1e-4, free_increment(frequency, ratio, 1e-4, 0.3, step));
            let steps = (1e-3 / step).round();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some thousands")]
            let count = steps as u32;
            for _ in 0..count {
                d = k.beta * d - k.kappa * q;
                q += d;
            }
            let at = |t: f64| exact(frequency, ratio, 1e-4, 0.3, 0.0, t);
            let time = steps * step;
            let slope = (8.0 * (at(time + 1e-7) - at(time - 1e-7)) - (at(time + 2e-7) - at(time - 2e-7))) / 1.2e-6;
            (Velocity::new(frequency, ratio, step).of(q, d, 0.0) - slope).abs()
        };
        let order = (error(1e-6) / error(5e-7)).log2();
        assert!((order - 2.0).abs() < 0.1, "order {order}");
    }

    #[test]
    fn energy_balance_closes_to_rounding() {
        for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
            for (frequency, ratio) in CASES {
                let k = ModeCoefficients::new(scheme, frequency, ratio, 2e-5);
                let (mut q, mut d): (f64, f64) = (1e-4, 2e-6);
                let energy = |q: f64, d: f64| k.inertia * d * d + k.spring * q * (q - d);
                for n in 0..50 {
                    let force = 10.0 * f64::from(n).sin();
                    let next = k.beta * d - k.kappa * q + k.compliance * force;
                    let balance = energy(q + next, next) - energy(q, d) - 0.5 * force * (next + d)
                        + k.loss * (next + d) * (next + d);
                    let scale = energy(q + next, next).abs() + energy(q, d).abs();
                    assert!(balance.abs() < 1e-12 * scale.max(1e-12), "{scheme:?} ω {frequency}: {balance:e}");
                    q += next;
                    d = next;
                }
            }
        }
    }

    #[test]
    fn compliance_is_never_negative() {
        for exponent in -6..12 {
            let k = ModeCoefficients::new(Scheme::ModalExact, 10_f64.powi(exponent), 0.0, 1e-5);
            assert!(k.compliance >= 0.0 && k.compliance.is_finite());
        }
    }
}
