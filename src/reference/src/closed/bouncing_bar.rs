//! Exact solution of an elastic bar that bounces on rigid ground under gravity periodically.
//!
//! Problem of D. Doyen, A. Ern, S. Piperno, SIAM J. Sci. Comput. 33 (2011) 223-249. The bar falls from rest, touches
//! with v₀ = √(2 g h₀), stays in contact for one wave return, 2L/c, and leaves with +v₀ at every point and twice its
//! static shortening. With the data here its flight takes three periods of the elastic wave, so that it touches again
//! in the same state, and its second contact reverses the shortening: then it rises as a rigid body and everything
//! repeats.

use std::f64::consts::PI;

/// Length (m).
pub const LENGTH: f64 = 10.0;
/// Young's modulus (Pa).
pub const YOUNG: f64 = 900.0;
/// Density (kg/m³).
pub const DENSITY: f64 = 1.0;
/// Gravity (m/s²).
pub const GRAVITY: f64 = 10.0;
/// Height of the bottom at the start (m).
pub const HEIGHT: f64 = 5.0;
/// Period of the motion (s).
pub const PERIOD: f64 = 16.0 / 3.0;
/// Times of contact within the first period (s).
pub const CONTACTS: [[f64; 2]; 2] = [[1.0, 5.0 / 3.0], [11.0 / 3.0, 13.0 / 3.0]];

/// Terms of the series; the last one is below 1e-8 of the first.
const TERMS: u32 = 4000;

/// Returns the wave speed √(E/ρ) (m/s).
pub fn wave_speed() -> f64 {
    (YOUNG / DENSITY).sqrt()
}

fn touch_speed() -> f64 {
    (2.0 * GRAVITY * HEIGHT).sqrt()
}

/// Returns the static displacement under its weight on the ground: −(g/c²)(Lx − x²/2).
fn standing(x: f64) -> f64 {
    -GRAVITY / (YOUNG / DENSITY) * (LENGTH * x - 0.5 * x * x)
}

/// Returns the displacement in contact at a time τ after the touch, from `initial` times the static displacement and
/// −v₀.
fn in_contact(x: f64, tau: f64, initial: f64) -> f64 {
    let mut sum = standing(x);
    for n in 1..=TERMS {
        let k = (f64::from(n) - 0.5) * PI / LENGTH;
        let omega = k * wave_speed();
        // Sine coefficients of the static displacement and of 1: −2g/(c² L k³) and 2/(L k).
        let shape = -2.0 * GRAVITY / (YOUNG / DENSITY) / (LENGTH * k * k * k);
        let one = 2.0 / (LENGTH * k);
        let swing = (initial - 1.0) * shape * (omega * tau).cos() - touch_speed() * one / omega * (omega * tau).sin();
        sum += swing * (k * x).sin();
    }
    sum
}

/// Returns the displacement in flight at a time τ after the release, from +v₀ and twice the static displacement: mean
/// −2gL²/3c², cosine coefficients 4g/(c² k²).
fn in_flight(x: f64, tau: f64) -> f64 {
    let compliance = GRAVITY / (YOUNG / DENSITY);
    let mut sum = -2.0 * compliance * LENGTH * LENGTH / 3.0 + touch_speed() * tau - 0.5 * GRAVITY * tau * tau;
    for n in 1..=TERMS {
        let k = f64::from(n) * PI / LENGTH;
        sum += 4.0 * compliance / (k * k) * (k * x).cos() * (k * wave_speed() * tau).cos();
    }
    sum
}

/// Returns the displacement (m) at x above the bottom at a time ≥ 0 (s); the bottom is at height u(0, t).
pub fn displacement(x: f64, time: f64) -> f64 {
    let time = time.rem_euclid(PERIOD);
    let [[first, leaves], [second, ends]] = CONTACTS;
    if time < first {
        HEIGHT - 0.5 * GRAVITY * time * time
    } else if time < leaves {
        in_contact(x, time - first, 0.0)
    } else if time < second {
        in_flight(x, time - leaves)
    } else if time < ends {
        in_contact(x, time - second, 2.0)
    } else {
        let tau = PERIOD - time;
        HEIGHT - 0.5 * GRAVITY * tau * tau
    }
}

/// Returns the pressure on the ground (Pa). First contact: ρcv₀ at the touch, increasing at ρcg, since the static
/// displacement has to build up from zero; second contact: decreasing from ρcv₀ + 2ρgL at the same rate.
pub fn pressure(time: f64) -> f64 {
    let time = time.rem_euclid(PERIOD);
    let impedance = DENSITY * wave_speed();
    let [[first, leaves], [second, ends]] = CONTACTS;
    if time > first && time < leaves {
        impedance * (touch_speed() + GRAVITY * (time - first))
    } else if time > second && time < ends {
        impedance * (touch_speed() - GRAVITY * (time - second)) + 2.0 * DENSITY * GRAVITY * LENGTH
    } else {
        0.0
    }
}

/// Returns the energy per cross-section (J/m²), which is constant: potential energy at the start, relative to the
/// unstrained bar on the ground.
pub fn energy() -> f64 {
    DENSITY * LENGTH * GRAVITY * HEIGHT
}
