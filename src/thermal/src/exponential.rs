//! Functions φ(−λH) of exponential integrators, and exact integration of one coordinate over a step.
//!
//! φ₀(x) = eˣ, φ₁(x) = (φ₀ − 1)/x, φ₂(x) = (φ₁ − 1)/x, φ₃(x) = (φ₂ − ½)/x (Hochbruck and Ostermann, Acta Numerica 2010).

use libm::{exp, expm1};

/// Bound of |x| below which a series is used, and above it the recurrence, which loses two digits at most.
const NEAR: f64 = 1.0;
/// Number of terms of the series of φ₃: the last is below 1/22!.
const TERMS: u32 = 20;

/// φ₀ to φ₃ of one coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Phi(pub [f64; 4]);

impl Phi {
    /// Computes the functions at x = −λH; x is not positive except for rounding.
    pub(crate) fn new(x: f64) -> Self {
        if x.abs() < NEAR {
            // φ₃ = Σ xᵏ/(k+3)!; the others by the upward recurrence, which loses no accuracy.
            let (mut term, mut third) = (1.0 / 6.0, 1.0 / 6.0);
            for k in 1..TERMS {
                term *= x / f64::from(k + 3);
                third += term;
            }
            let second = 0.5 + x * third;
            let first = 1.0 + x * second;
            return Self([1.0 + x * first, first, second, third]);
        }
        let first = expm1(x) / x;
        let second = (first - 1.0) / x;
        Self([exp(x), first, second, (second - 0.5) / x])
    }

    /// Returns the value at the end of a step of length H and the integral over it, from `start`, under a load that
    /// changes linearly from `load` by `change`: ẋ = −λx + load + change t/H.
    pub(crate) fn step(&self, length: f64, start: f64, load: f64, change: f64) -> [f64; 2] {
        let [decay, first, second, third] = self.0;
        [
            decay * start + length * (first * load + second * change),
            length * (first * start + length * (second * load + third * change)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes ∫₀¹ e^{(1−t)x} t^{k−1}/(k−1)! dt by Gauss-Legendre on many parts.
    fn integral(k: i32, x: f64) -> f64 {
        let parts = 2000;
        let weights = [5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0];
        let points = [0.5 - 0.5 * 0.6_f64.sqrt(), 0.5, 0.5 + 0.5 * 0.6_f64.sqrt()];
        let factorial = [1.0, 1.0, 1.0, 2.0][usize::try_from(k).unwrap()];
        let mut sum = 0.0;
        for part in 0..parts {
            for (point, weight) in points.iter().zip(weights) {
                let t = (f64::from(part) + point) / f64::from(parts);
                sum += weight / f64::from(parts) * ((1.0 - t) * x).exp() * t.powi(k - 1) / factorial;
            }
        }
        sum
    }

    #[test]
    fn phi_functions_match_their_integrals() {
        for x in [0.0, -1e-12, -1e-3, -0.4, -0.999, -1.0, -1.001, -3.0, -40.0, 0.1] {
            let Phi(phi) = Phi::new(x);
            assert!((phi[0] - f64::exp(x)).abs() < 4e-16, "{x}");
            for k in 1..4 {
                let expected = integral(k, x);
                let found = phi[usize::try_from(k).unwrap()];
                assert!((found - expected).abs() < 1e-13 * expected, "phi_{k}({x}): {found} against {expected}");
            }
        }
    }

    /// Compares the integral with the integrated equation of the coordinate.
    #[test]
    fn integral_and_end_value_match_closed_form() {
        let (rate, length, start, load, change) = (3.0, 0.7, 2.0, -1.0, 5.0);
        let [end, integral] = Phi::new(-rate * length).step(length, start, load, change);
        // d/dt: x(H) − x(0) = −λ∫x + ∫load.
        let balance = end - start + rate * integral - (load + 0.5 * change) * length;
        assert!(balance.abs() < 1e-14);
        let closed = |t: f64| {
            let slope = change / length;
            let particular = load / rate - slope / (rate * rate) + slope / rate * t;
            (start - load / rate + slope / (rate * rate)) * (-rate * t).exp() + particular
        };
        assert!((end - closed(length)).abs() < 1e-14);
    }
}
