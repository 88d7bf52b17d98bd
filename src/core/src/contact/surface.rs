//! Rigid surfaces of revolution with a shape around the circumference (the slave side).
//!
//! The surface runs parallel to the tip contour at the radial distance `gap`. Its shape adds s(θ), the change of
//! the casing radius, in the fixed frame; positive s opens the clearance. What the kernels need per contact
//! node is s and its slope ds/dθ.

use crate::settings::Shape;
use crate::{Error, Result};

/// Shape compiled for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub enum Surface {
    /// s = 0.
    Circular,
    /// s = −A cos(kθ − φ).
    Lobes {
        /// A (m).
        amplitude: f64,
        /// k.
        order: f64,
        /// φ (rad).
        phase: f64,
    },
    /// s = −2 c·depth·exp(−((mod(θ − φ, π)/π − ½)/w)²).
    TwoLobe {
        /// 2 c·depth (m).
        height: f64,
        /// π w (rad).
        width: f64,
        /// φ (rad).
        phase: f64,
    },
    /// Periodic cubic spline through equally spaced values.
    Table {
        /// Values at the knots and their slopes ds/dθ (m, m/rad).
        knots: Vec<[f64; 2]>,
    },
}

impl Surface {
    /// Compile a shape; `gap` is the nominal clearance that the two-lobe law refers to (m).
    ///
    /// # Errors
    /// A table too short or not finite.
    pub fn new(shape: &Shape, gap: f64) -> Result<Self> {
        Ok(match shape {
            Shape::Circular {} => Self::Circular,
            Shape::Lobes { amplitude, order, phase } => {
                Self::Lobes { amplitude: *amplitude, order: f64::from(*order), phase: *phase }
            }
            Shape::TwoLobe { depth, width, phase } => {
                Self::TwoLobe { height: 2.0 * gap * depth, width: std::f64::consts::PI * width, phase: *phase }
            }
            Shape::Table { radius_change } => Self::Table { knots: periodic_spline(radius_change)? },
        })
    }

    /// Change of radius s (m) and slope ds/dθ (m/rad) at the fixed-frame angle θ (rad).
    #[inline]
    pub fn evaluate(&self, angle: f64) -> (f64, f64) {
        match self {
            Self::Circular => (0.0, 0.0),
            Self::Lobes { amplitude, order, phase } => {
                let (sine, cosine) = libm::sincos(order * angle - phase);
                (-amplitude * cosine, amplitude * order * sine)
            }
            Self::TwoLobe { height, width, phase } => {
                let turned = angle - phase;
                let half_turn = turned - (turned * std::f64::consts::FRAC_1_PI).floor() * std::f64::consts::PI;
                let distance = (half_turn - std::f64::consts::FRAC_PI_2) / width;
                let bump = -height * libm::exp(-distance * distance);
                (bump, -2.0 * distance / width * bump)
            }
            Self::Table { knots } => evaluate_spline(knots, angle),
        }
    }
}

/// Value and slope of a periodic cubic (Hermite form) at `angle`.
fn evaluate_spline(knots: &[[f64; 2]], angle: f64) -> (f64, f64) {
    #[expect(clippy::cast_precision_loss, reason = "tables are far shorter than 2^52")]
    let count = knots.len() as f64;
    let spacing = std::f64::consts::TAU / count;
    let place = angle / spacing;
    let floor = place.floor();
    let t = place - floor;
    // rem_euclid keeps the index in range whatever the angle; the cast cannot then truncate.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value < len")]
    let index = (floor.rem_euclid(count) as usize).min(knots.len() - 1);
    let [a, slope_a] = knots[index];
    let [b, slope_b] = knots[(index + 1) % knots.len()];
    let (p, q) = (slope_a * spacing, slope_b * spacing);
    let (quadratic, cubic) = (3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q);
    let value = a + t * (p + t * (quadratic + t * cubic));
    let slope = (p + t * (2.0 * quadratic + 3.0 * t * cubic)) / spacing;
    (value, slope)
}

/// Knots and slopes of the C² periodic cubic spline: (m_{i−1} + 4 m_i + m_{i+1})/6 = (s_{i+1} − s_{i−1})/(2Δ).
fn periodic_spline(values: &[f64]) -> Result<Vec<[f64; 2]>> {
    let count = values.len();
    if count < 4 || values.iter().any(|value| !value.is_finite()) {
        return Err(Error::invalid(
            "surface.shape.radius_change",
            format!("{count} values; at least 4 finite ones are needed"),
            "Give the radius change (m) at equally spaced angles around the circumference",
        ));
    }
    #[expect(clippy::cast_precision_loss, reason = "tables are far shorter than 2^52")]
    let spacing = std::f64::consts::TAU / count as f64;
    let right: Vec<f64> =
        (0..count).map(|i| 3.0 * (values[(i + 1) % count] - values[(i + count - 1) % count]) / spacing).collect();
    // Diagonally dominant: Gauss-Seidel converges by a factor of 4 a sweep; 60 sweeps are far below rounding.
    let mut slopes = vec![0.0; count];
    for _ in 0..60 {
        for i in 0..count {
            slopes[i] = (right[i] - slopes[(i + count - 1) % count] - slopes[(i + 1) % count]) / 4.0;
        }
    }
    Ok(values.iter().zip(slopes).map(|(value, slope)| [*value, slope]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<Shape> {
        let table = (0..32).map(|i| 1e-4 * (f64::from(i) * 0.7).sin()).collect();
        vec![
            Shape::Circular {},
            Shape::Lobes { amplitude: 2e-4, order: 3, phase: 0.4 },
            Shape::TwoLobe { depth: 1.0, width: 0.15, phase: 0.2 },
            Shape::Table { radius_change: table },
        ]
    }

    #[test]
    fn slope_is_the_derivative_and_shape_is_periodic() {
        for shape in shapes() {
            let surface = Surface::new(&shape, 3.56e-4).unwrap();
            for i in 0..500 {
                let angle = -7.0 + 0.031 * f64::from(i);
                let (value, slope) = surface.evaluate(angle);
                let (after, before) = (surface.evaluate(angle + 1e-6).0, surface.evaluate(angle - 1e-6).0);
                let difference = (after - before) / 2e-6;
                // The two-lobe law has a kink of relative size e^(−1/(4w²)) where the bumps meet.
                assert!((slope - difference).abs() < 3e-8, "{shape:?} at {angle}: {slope} vs {difference}");
                let turned = surface.evaluate(angle + std::f64::consts::TAU).0;
                assert!((turned - value).abs() < 1e-16, "{shape:?} at {angle}");
            }
        }
    }

    #[test]
    fn two_lobe_law_matches_its_formula() {
        let gap = 3.56e-4;
        let surface = Surface::new(&Shape::TwoLobe { depth: 1.0, width: 0.15, phase: 0.0 }, gap).unwrap();
        for i in 0..100 {
            let angle: f64 = 0.1 * f64::from(i);
            let x = (angle % std::f64::consts::PI / std::f64::consts::PI - 0.5) / 0.15;
            let clearance = gap * (1.0 - 2.0 * (-x * x).exp());
            assert!((gap + surface.evaluate(angle).0 - clearance).abs() < 1e-17);
        }
        assert!((gap + surface.evaluate(std::f64::consts::FRAC_PI_2).0 + gap).abs() < 1e-17);
    }

    #[test]
    fn a_table_of_a_sine_is_fourth_order_accurate() {
        let error = |count: u32| {
            let values = (0..count).map(|i| (std::f64::consts::TAU * f64::from(i) / f64::from(count)).sin()).collect();
            let surface = Surface::new(&Shape::Table { radius_change: values }, 1.0).unwrap();
            (0..1000)
                .map(|i| 0.0123 * f64::from(i))
                .map(|x| (surface.evaluate(x).0 - x.sin()).abs())
                .fold(0.0, f64::max)
        };
        let rate = (error(16) / error(32)).log2();
        assert!((rate - 4.0).abs() < 0.2, "rate {rate}");
    }
}
