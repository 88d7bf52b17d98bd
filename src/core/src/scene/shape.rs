//! Rigid surfaces of revolution with a shape around the circumference (the slave side).
//!
//! The surface runs parallel to the tip contour at the radial distance `gap`. Its shape adds s(θ), the change of the casing radius, in the
//! fixed frame; positive s opens the clearance. The kernels need s and its slope ds/dθ for each contact node.

use crate::math::cubic::{evaluate, interior_minimum};
use crate::math::octet::{INVERSE_FACTORIALS, LN2_HIGH, LN2_LOW, ROUNDER};
use crate::math::real;
use crate::scene::settings::Shape;
use crate::{Error, Result};

/// Shape, compiled for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub enum CompiledShape {
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
        /// Largest magnitude of d²s/dθ² (m/rad²).
        curvature: f64,
        /// Smallest value (m).
        lowest: f64,
        /// Values at the knots and their slopes ds/dθ (m, m/rad).
        knots: Vec<[f64; 2]>,
    },
}

impl CompiledShape {
    /// Compiles a shape; `gap` is the nominal clearance to which the two-lobe law refers (m).
    ///
    /// # Errors
    /// Table too short or not finite.
    pub fn new(shape: &Shape, gap: f64) -> Result<Self> {
        Ok(match shape {
            Shape::Circular {} => Self::Circular,
            Shape::Lobes { amplitude, order, phase } => {
                Self::Lobes { amplitude: *amplitude, order: f64::from(*order), phase: *phase }
            }
            Shape::TwoLobe { depth, width, phase } => {
                Self::TwoLobe { height: 2.0 * gap * depth, width: std::f64::consts::PI * width, phase: *phase }
            }
            Shape::Table { radius_change } => {
                let knots = periodic_spline(radius_change)?;
                let lowest = lowest_of_spline(&knots, 0.0, std::f64::consts::TAU);
                Self::Table { curvature: largest_curvature(&knots), lowest, knots }
            }
        })
    }

    /// Largest change of radius, up or down (m).
    pub(crate) fn largest_change(&self) -> f64 {
        match self {
            Self::Circular => 0.0,
            Self::Lobes { amplitude, .. } => amplitude.abs(),
            Self::TwoLobe { height, .. } => height.abs(),
            Self::Table { knots, .. } => knots.iter().fold(0.0, |largest, knot| largest.max(knot[0].abs())),
        }
    }

    /// Minimum of s (m).
    pub fn least(&self) -> f64 {
        match self {
            Self::Circular => 0.0,
            Self::Lobes { amplitude, .. } => -amplitude.abs(),
            Self::TwoLobe { height, .. } if *height >= 0.0 => -height,
            Self::TwoLobe { phase, .. } => self.evaluate(*phase).0,
            Self::Table { lowest, .. } => *lowest,
        }
    }

    /// Minimum of s between two angles (m).
    pub(crate) fn lowest_between(&self, from: f64, to: f64) -> f64 {
        let ends = self.evaluate(from).0.min(self.evaluate(to).0);
        // Checks whether one of the angles `first` + n·`period` is in between.
        let passes = |first: f64, period: f64| ((to - first) / period).floor() > ((from - first) / period).floor();
        match self {
            Self::Circular => 0.0,
            Self::Lobes { amplitude, order, phase } => {
                let crest = if *amplitude >= 0.0 { *phase } else { *phase + std::f64::consts::PI };
                if passes(crest / order, std::f64::consts::TAU / order) { -amplitude.abs() } else { ends }
            }
            // For bumps the crest; for dents the ridge between two.
            Self::TwoLobe { height, phase, .. } => {
                let (half, whole) = (std::f64::consts::FRAC_PI_2, std::f64::consts::PI);
                let crest = if *height >= 0.0 { *phase + half } else { *phase };
                if passes(crest, whole) { self.evaluate(crest).0 } else { ends }
            }
            Self::Table { knots, .. } => lowest_of_spline(knots, from, to).min(ends),
        }
    }

    /// Angle over which the shape changes noticeably (rad): a step of the rotor must stay below it.
    pub(crate) fn angular_scale(&self) -> f64 {
        match self {
            Self::Circular => std::f64::consts::PI,
            Self::Lobes { order, .. } => 1.0 / order,
            Self::TwoLobe { width, .. } => *width,
            Self::Table { knots, .. } => spacing(knots.len()),
        }
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
            Self::TwoLobe { height, width, phase } => two_lobe(*height, *width, *phase, angle),
            Self::Table { knots, .. } => evaluate_spline(knots, angle),
        }
    }

    /// Change of radius s (m), slope ds/dθ (m/rad) and curvature d²s/dθ² (m/rad²) at an angle (rad).
    pub(crate) fn evaluate_twice(&self, angle: f64) -> [f64; 3] {
        let (value, slope) = self.evaluate(angle);
        let curvature = match self {
            Self::Circular => 0.0,
            Self::Lobes { order, .. } => -order * order * value,
            Self::TwoLobe { height, width, phase } => {
                let (bump, slope) = two_lobe(*height, *width, *phase, angle);
                let distance = if bump == 0.0 { 0.0 } else { -0.5 * slope * width / bump };
                (4.0 * distance * distance - 2.0) / (width * width) * bump
            }
            Self::Table { knots, .. } => {
                let (cubic, t, spacing) = spline_part(knots, angle);
                (2.0 * cubic[2] + 6.0 * t * cubic[3]) / (spacing * spacing)
            }
        };
        [value, slope, curvature]
    }

    /// Returns the largest magnitude of the curvature of s (m/rad²).
    pub(crate) fn largest_curvature(&self) -> f64 {
        match self {
            Self::TwoLobe { height, width, .. } => 2.0 * height.abs() / (width * width),
            _ => self.bumpiness().unwrap_or(0.0),
        }
    }

    /// Returns the largest jump of the slope of s (m/rad).
    pub(crate) fn largest_kink(&self) -> f64 {
        match self {
            // Where the bumps meet.
            Self::TwoLobe { phase, .. } => 2.0 * self.evaluate(*phase).1.abs(),
            _ => 0.0,
        }
    }

    /// Returns the largest curvature with which s may bend below its chord (m/rad²), or `None` if s is never negative.
    pub(crate) fn bumpiness(&self) -> Option<f64> {
        match self {
            Self::Circular => None,
            Self::Lobes { amplitude, order, .. } => Some(amplitude.abs() * order * order),
            // A bump of negative height only opens the clearance. Between two bumps, s is concave and lies above its
            // chords.
            Self::TwoLobe { height, .. } if *height < 0.0 => None,
            Self::TwoLobe { .. } => Some(self.largest_curvature()),
            Self::Table { curvature, .. } => Some(*curvature),
        }
    }

    /// Lower bound of s between two angles (m): the lower end value, minus the largest deviation that the curvature
    /// allows.
    pub(crate) fn least_between(&self, from: f64, to: f64) -> f64 {
        let Some(curvature) = self.bumpiness() else { return 0.0 };
        let width = to - from;
        self.evaluate(from).0.min(self.evaluate(to).0) - 0.125 * curvature * width * width
    }

    /// Evaluates [`CompiledShape::evaluate`] for a row of angles, in a form that the compiler can vectorise.
    #[inline(always)]
    pub(crate) fn evaluate_row(&self, angles: &[f64], shape: &mut [f64], slope: &mut [f64]) {
        let places = angles.iter().zip(shape).zip(slope);
        match self {
            Self::Circular => places.for_each(|((_, shape), slope)| (*shape, *slope) = (0.0, 0.0)),
            Self::TwoLobe { height, width, phase } => {
                let (height, width, phase) = (*height, *width, *phase);
                places.for_each(|((angle, shape), slope)| (*shape, *slope) = two_lobe(height, width, phase, *angle));
            }
            Self::Lobes { .. } | Self::Table { .. } => {
                places.for_each(|((angle, shape), slope)| (*shape, *slope) = self.evaluate(*angle));
            }
        }
    }
}

#[inline(always)]
fn two_lobe(height: f64, width: f64, phase: f64, angle: f64) -> (f64, f64) {
    // mod(x, 1) − ½ is the distance of x − ½ from its nearest integer.
    let turned = (angle - phase) * std::f64::consts::FRAC_1_PI - 0.5;
    let distance = (turned - ((turned + ROUNDER) - ROUNDER)) * std::f64::consts::PI / width;
    let bump = -height * exp_of_negative(-distance * distance);
    (bump, -2.0 * distance / width * bump)
}

/// e^x for x ≤ 0 without branches or calls, so that a loop over it vectorises (the library function does not).
///
/// Cody-Waite reduction x = k ln 2 + r with |r| ≤ ½ ln 2, Taylor polynomial of degree 13 (truncation 4e-18), scaling by
/// exponent bits. Below −700 it stays at e^(−700).
#[inline(always)]
fn exp_of_negative(x: f64) -> f64 {
    let x = if x > -700.0 { x } else { -700.0 };
    let shifted = x * std::f64::consts::LOG2_E + ROUNDER;
    let k = shifted - ROUNDER;
    let r = (x - k * LN2_HIGH) - k * LN2_LOW;
    let mut sum = INVERSE_FACTORIALS[13];
    for coefficient in INVERSE_FACTORIALS[..13].iter().rev() {
        sum = sum * r + coefficient;
    }
    // The low bits of `shifted` are k; moved to the exponent field they multiply by 2^k.
    let scale = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1023 << 52));
    sum * scale
}

/// Angle between the knots of a table (rad).
fn spacing(count: usize) -> f64 {
    std::f64::consts::TAU / real(count)
}

/// Smallest value between two angles of a periodic cubic spline, at a knot or between two; infinite if it has no minimum there.
fn lowest_of_spline(knots: &[[f64; 2]], from: f64, to: f64) -> f64 {
    let (count, spacing) = (real(knots.len()), spacing(knots.len()));
    let (first, last) = ((from / spacing).floor(), (to / spacing).floor());
    let mut lowest = f64::INFINITY;
    let mut place = first;
    while place <= last.min(first + count) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value < len")]
        let index = (place.rem_euclid(count) as usize).min(knots.len() - 1);
        let cubic = hermite(knots, index, spacing);
        if place > first {
            lowest = lowest.min(cubic[0]);
        }
        if let Some(t) = interior_minimum(&cubic).filter(|t| (place + t) * spacing > from && (place + t) * spacing < to)
        {
            lowest = lowest.min(evaluate(&cubic, t));
        }
        place += 1.0;
    }
    lowest
}

/// Coefficients of the cubic after a knot, in terms of the fraction of the spacing.
fn hermite(knots: &[[f64; 2]], index: usize, spacing: f64) -> [f64; 4] {
    let [a, slope_a] = knots[index];
    let [b, slope_b] = knots[(index + 1) % knots.len()];
    let (p, q) = (slope_a * spacing, slope_b * spacing);
    [a, p, 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q]
}

/// Largest |d²s/dθ²| (m/rad²): at a knot, from either side.
fn largest_curvature(knots: &[[f64; 2]]) -> f64 {
    let spacing = spacing(knots.len());
    let next = knots.iter().cycle().skip(1);
    let both = knots.iter().zip(next).map(|([a, slope_a], [b, slope_b])| {
        let rise = 6.0 * (b - a) / spacing;
        (rise - 4.0 * slope_a - 2.0 * slope_b).abs().max((4.0 * slope_b + 2.0 * slope_a - rise).abs()) / spacing
    });
    both.fold(0.0, f64::max)
}

/// Returns the segment of a periodic cubic (Hermite form) at `angle`: its coefficients, the position of the angle as a
/// fraction of the segment, and the length of the segment (rad).
fn spline_part(knots: &[[f64; 2]], angle: f64) -> ([f64; 4], f64, f64) {
    let (count, spacing) = (real(knots.len()), spacing(knots.len()));
    let place = angle / spacing;
    let floor = place.floor();
    // rem_euclid keeps the index in range for any angle, so that the cast cannot truncate.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value < len")]
    let index = (floor.rem_euclid(count) as usize).min(knots.len() - 1);
    (hermite(knots, index, spacing), place - floor, spacing)
}

/// Value and slope of a periodic cubic (Hermite form) at `angle`.
fn evaluate_spline(knots: &[[f64; 2]], angle: f64) -> (f64, f64) {
    let ([a, p, quadratic, cubic], t, spacing) = spline_part(knots, angle);
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
            format!("{count} values; at least 4 are required, and all must be finite"),
            "Give the radius change (m) at equally spaced angles around the circumference",
        ));
    }
    let spacing = spacing(count);
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
    fn lower_bound_holds_between_two_angles() {
        for shape in shapes().into_iter().chain([Shape::TwoLobe { depth: -0.7, width: 0.4, phase: 0.1 }]) {
            let surface = CompiledShape::new(&shape, 3.56e-4).unwrap();
            let (mut tightest, mut lowest) = (f64::INFINITY, 0.0_f64);
            for i in 0..400 {
                let (from, width) = (-4.0 + 0.023 * f64::from(i), 0.01 * f64::from(1 + i % 17));
                let bound = surface.least_between(from, from + width);
                let values = (0..=40).map(|k| surface.evaluate(from + width * f64::from(k) / 40.0).0);
                let least = values.fold(f64::INFINITY, f64::min);
                assert!(bound <= least + 1e-15, "{shape:?}, {from}, {width}: {bound} {least}");
                (tightest, lowest) = (tightest.min(least - bound), lowest.min(least));
            }
            // The bound is not trivial.
            let dent = matches!(shape, Shape::TwoLobe { depth, .. } if depth < 0.0);
            assert!(dent || tightest < 1e-6 && lowest <= 0.0);
        }
    }

    #[test]
    fn minimum_values_match_the_shape() {
        let dents = Shape::TwoLobe { depth: -0.7, width: 0.4, phase: 0.1 };
        let turned = Shape::Lobes { amplitude: -1e-4, order: 2, phase: 0.3 };
        for shape in shapes().into_iter().chain([dents, turned]) {
            let surface = CompiledShape::new(&shape, 3.56e-4).unwrap();
            let sampled = |from: f64, width: f64| {
                let values = (0..=2000).map(|k| surface.evaluate(from + width * f64::from(k) / 2000.0).0);
                values.fold(f64::INFINITY, f64::min)
            };
            let steepest = 3e-3;
            let holds = |found: f64, from: f64, width: f64| {
                let sampled = sampled(from, width);
                let close = found <= sampled + 1e-18 && found > sampled - steepest * width / 4000.0;
                assert!(close, "{shape:?} at {from}, {width}: {found:e}, {sampled:e}");
            };
            for i in 0..300 {
                let (from, width) = (-4.0 + 0.031 * f64::from(i), 0.011 * f64::from(1 + i % 190));
                holds(surface.lowest_between(from, from + width), from, width);
            }
            holds(surface.least(), -1.0, std::f64::consts::TAU);
        }
    }

    #[test]
    fn slope_is_the_derivative_and_shape_is_periodic() {
        for shape in shapes() {
            let surface = CompiledShape::new(&shape, 3.56e-4).unwrap();
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
    fn the_exponential_is_within_two_ulp_of_the_library() {
        for i in 0..200_000 {
            let x = -f64::from(i) * 3.49e-3;
            let (found, expected) = (exp_of_negative(x), libm::exp(x));
            assert!((found - expected).abs() <= 2.0 * f64::EPSILON * expected, "e^{x}: {found:e} vs {expected:e}");
        }
        assert!(exp_of_negative(-1e9) < 1e-300 && (exp_of_negative(0.0) - 1.0).abs() < 1e-16);
    }

    #[test]
    fn row_evaluation_equals_single_evaluations() {
        for shape in shapes() {
            let surface = CompiledShape::new(&shape, 3.56e-4).unwrap();
            let angles: Vec<f64> = (0..40).map(|i| 0.37 * f64::from(i) - 5.0).collect();
            let (mut values, mut slopes) = (vec![1.0; 40], vec![1.0; 40]);
            surface.evaluate_row(&angles, &mut values, &mut slopes);
            for (index, angle) in angles.iter().enumerate() {
                let (value, slope) = surface.evaluate(*angle);
                assert_eq!((value.to_bits(), slope.to_bits()), (values[index].to_bits(), slopes[index].to_bits()));
            }
        }
    }

    #[test]
    fn two_lobe_law_matches_its_formula() {
        let gap = 3.56e-4;
        let surface = CompiledShape::new(&Shape::TwoLobe { depth: 1.0, width: 0.15, phase: 0.0 }, gap).unwrap();
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
            let surface = CompiledShape::new(&Shape::Table { radius_change: values }, 1.0).unwrap();
            (0..1000)
                .map(|i| 0.0123 * f64::from(i))
                .map(|x| (surface.evaluate(x).0 - x.sin()).abs())
                .fold(0.0, f64::max)
        };
        let rate = (error(16) / error(32)).log2();
        assert!((rate - 4.0).abs() < 0.2, "rate {rate}");
    }
}
