//! Polynomials of degree s = 1, 2, 3 through the Lobatto points of a step, on 0 ≤ θ ≤ 1.

use crate::math::cubic;

/// Largest degree.
pub const MOST: usize = 3;
/// Number of points of the largest degree.
pub const POINTS: usize = MOST + 1;
/// Number of positions between the points at which a gap is evaluated.
pub const PLACES: usize = 9;

/// Points, weights and polynomials of one degree. Entries beyond `degree` are 0.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeBasis {
    /// Degree s.
    pub degree: usize,
    /// Points c₀ = 0 … c_s = 1.
    pub points: [f64; POINTS],
    /// `[i][a]`: coefficient of θᵃ of the polynomial L_i that is 1 at point i and 0 at the others.
    pub monomials: [[f64; POINTS]; POINTS],
    /// b_i = ∫L_i dθ.
    pub weights: [f64; POINTS],
    /// S_ik = ∫L_i L_k′ dθ: forces f and displacements u at the points do the work Σ f_i S_ik u_k.
    pub work: [[f64; POINTS]; POINTS],
    /// `[a][i]`: coefficient of θᵃ of the L2 projection of L_i on degree s − 1.
    pub projection: [[f64; POINTS]; MOST],
    /// Weights of the values at the points that estimate the part of an integral that the highest divided difference misses.
    pub left_out: [f64; POINTS],
    /// `[place][i]`: L_i at positions between the points.
    pub between: [[f64; POINTS]; PLACES],
    /// Weights of the values at the points in the two inner Bézier coefficients of the polynomial, written as a cubic. Its
    /// values at both ends are the other two coefficients, and the smallest coefficient is a lower bound of the polynomial.
    pub inner: [[f64; POINTS]; 2],
}

impl TimeBasis {
    /// Creates the basis of degree s.
    ///
    /// # Panics
    /// If `degree` is not 1, 2 or 3.
    pub fn new(degree: usize) -> Self {
        let points = match degree {
            1 => [0.0, 1.0, 0.0, 0.0],
            2 => [0.0, 0.5, 1.0, 0.0],
            3 => [0.0, 0.5 - 0.1 * 5.0_f64.sqrt(), 0.5 + 0.1 * 5.0_f64.sqrt(), 1.0],
            _ => panic!("unsupported degree {degree}"),
        };
        let count = degree + 1;
        let mut monomials = [[0.0; POINTS]; POINTS];
        for (i, row) in monomials[..count].iter_mut().enumerate() {
            row[0] = 1.0;
            for (order, other) in (0..count).filter(|other| *other != i).enumerate() {
                let scale = 1.0 / (points[i] - points[other]);
                for a in (0..=order + 1).rev() {
                    let lower = if a > 0 { row[a - 1] } else { 0.0 };
                    row[a] = (lower - points[other] * row[a]) * scale;
                }
            }
        }
        let mut basis = Self {
            degree,
            points,
            monomials,
            weights: [0.0; POINTS],
            work: [[0.0; POINTS]; POINTS],
            projection: projection(degree, &monomials),
            left_out: left_out(degree, &points),
            between: [[0.0; POINTS]; PLACES],
            inner: [
                monomials.map(|row| row[0] + row[1] / 3.0),
                monomials.map(|row| row[0] + (2.0 * row[1] + row[2]) / 3.0),
            ],
        };
        for i in 0..count {
            basis.weights[i] = (0..count).map(|a| monomials[i][a] / real(a + 1)).sum();
            // Quadrature at the points is exact for L_i L_k′: S_ik = b_i L_k′(c_i).
            let slopes = slopes_at(i, &points[..count]);
            basis.work[i] = slopes.map(|slope| basis.weights[i] * slope);
        }
        for (place, row) in basis.between.iter_mut().enumerate() {
            let theta = (real(place) + 0.5) / real(PLACES);
            for i in 0..count {
                row[i] = (0..count).rev().fold(0.0, |sum, a| sum * theta + monomials[i][a]);
            }
        }
        basis
    }

    /// Coefficients of θᵃ of the polynomial with the given values at the points.
    pub fn coefficients(&self, values: &[f64; POINTS]) -> [f64; POINTS] {
        let mut sums = [0.0; POINTS];
        for (value, row) in values[..self.count()].iter().zip(&self.monomials) {
            sums.iter_mut().zip(row).for_each(|(sum, coefficient)| *sum += value * coefficient);
        }
        sums
    }

    /// L_i at θ.
    pub(crate) fn weights_at(&self, theta: f64) -> [f64; POINTS] {
        self.monomials.map(|row| cubic::evaluate(&row, theta))
    }

    /// L_i′ at θ.
    pub(crate) fn slopes_at(&self, theta: f64) -> [f64; POINTS] {
        self.monomials.map(|row| row[1] + theta * (2.0 * row[2] + theta * 3.0 * row[3]))
    }

    /// Weights with which values at the points after the start extrapolate to the start.
    pub(crate) fn weights_before(&self) -> [f64; POINTS] {
        let points = 1..self.count();
        let weight = |i: usize| {
            let others = points.clone().filter(|k| *k != i);
            others.map(|k| self.points[k] / (self.points[k] - self.points[i])).product()
        };
        std::array::from_fn(|i| if points.contains(&i) { weight(i) } else { 0.0 })
    }

    /// Number of points including the start.
    pub fn count(&self) -> usize {
        self.degree + 1
    }
}

/// Forces over a step: a polynomial through all points, or a constant force and the end alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceInterpolation {
    /// The force is a polynomial of degree s.
    Polynomial,
    /// The force is constant over the step, with its value at the end. Contacts that open or close then always
    /// dissipate energy.
    Constant,
}

impl ForceInterpolation {
    /// Number of points of a step at which forces are unknown.
    pub(crate) fn points(self, basis: &TimeBasis) -> usize {
        match self {
            Self::Polynomial => basis.degree,
            Self::Constant => 1,
        }
    }

    /// Indices of these points among all after the start.
    pub(crate) fn last_points(self, basis: &TimeBasis) -> std::ops::Range<usize> {
        basis.degree - self.points(basis)..basis.degree
    }

    /// Weights of the work of forces at point i: S_ik, or those of a constant force.
    pub(crate) fn work_weights(self, basis: &TimeBasis, i: usize) -> [f64; POINTS] {
        match self {
            Self::Polynomial => basis.work[i],
            Self::Constant if i == 1 => [-1.0, 1.0, 0.0, 0.0],
            Self::Constant => [0.0; POINTS],
        }
    }

    /// Fraction of the step for which a force at point i acts: b_i, or 1 for a constant force.
    pub(crate) fn weight(self, basis: &TimeBasis, i: usize) -> f64 {
        match self {
            Self::Polynomial => basis.weights[i],
            Self::Constant => f64::from(u8::from(i == 1)),
        }
    }
}

/// L_k′ at point i, in barycentric form.
fn slopes_at(i: usize, points: &[f64]) -> [f64; POINTS] {
    let weight = |k: usize| -> f64 {
        let others = points.iter().enumerate().filter(|(other, _)| *other != k);
        1.0 / others.map(|(_, point)| points[k] - point).product::<f64>()
    };
    let mut slopes = [0.0; POINTS];
    for k in (0..points.len()).filter(|k| *k != i) {
        slopes[k] = weight(k) / weight(i) / (points[i] - points[k]);
        slopes[i] -= slopes[k];
    }
    slopes
}

/// Converts a small integer to a real number.
#[expect(clippy::cast_precision_loss, reason = "far below 2^52")]
pub(super) fn real(value: usize) -> f64 {
    value as f64
}

/// Σ_b H_ab c_bi = ∫θᵃ L_i with the Hilbert matrix H of order s, by elimination.
fn projection(degree: usize, monomials: &[[f64; POINTS]; POINTS]) -> [[f64; POINTS]; MOST] {
    let hilbert = nalgebra::DMatrix::from_fn(degree, degree, |a, b| 1.0 / real(a + b + 1));
    let right = nalgebra::DMatrix::from_fn(degree, degree + 1, |a, i| {
        (0..=degree).map(|b| monomials[i][b] / real(a + b + 1)).sum::<f64>()
    });
    let solved = hilbert.lu().solve(&right).unwrap_or(right);
    std::array::from_fn(|a| std::array::from_fn(|i| if a < degree && i <= degree { solved[(a, i)] } else { 0.0 }))
}

/// The divided difference over all points times |∫Π(θ − c)|, where Π omits the last point before the end.
fn left_out(degree: usize, points: &[f64; POINTS]) -> [f64; POINTS] {
    let kept = (0..=degree).filter(|i| degree == 1 && *i == 0 || degree > 1 && *i + 1 != degree);
    // Coefficients of the product, lowest first.
    let mut product = [1.0, 0.0, 0.0, 0.0, 0.0];
    for (order, i) in kept.enumerate() {
        for a in (0..=order + 1).rev() {
            let lower = if a > 0 { product[a - 1] } else { 0.0 };
            product[a] = lower - points[i] * product[a];
        }
    }
    let integral: f64 = product.iter().enumerate().map(|(a, c)| c / real(a + 1)).sum();
    std::array::from_fn(|i| {
        if i > degree {
            return 0.0;
        }
        let others = (0..=degree).filter(|other| *other != i);
        integral.abs() / others.map(|other| points[i] - points[other]).product::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(basis: &TimeBasis, i: usize, theta: f64) -> f64 {
        basis.monomials[i].iter().rev().fold(0.0, |sum, c| sum * theta + c)
    }

    #[test]
    fn polynomials_and_lobatto_weights_are_exact() {
        let weights = [
            vec![0.5, 0.5],
            vec![1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0],
            vec![1.0 / 12.0, 5.0 / 12.0, 5.0 / 12.0, 1.0 / 12.0],
        ];
        for degree in 1..=MOST {
            let basis = TimeBasis::new(degree);
            for i in 0..=degree {
                for k in 0..=degree {
                    let expected = f64::from(u8::from(i == k));
                    assert!((at(&basis, i, basis.points[k]) - expected).abs() < 1e-14);
                }
                assert!((basis.weights[i] - weights[degree - 1][i]).abs() < 1e-15);
            }
        }
    }

    /// S + Sᵀ contains only the end values of a product; S of a constant is 0.
    #[test]
    fn force_work_and_displacement_work_share_one_product() {
        for degree in 1..=MOST {
            let basis = TimeBasis::new(degree);
            for i in 0..=degree {
                for k in 0..=degree {
                    let ends = f64::from(u8::from(i == degree && k == degree)) - f64::from(u8::from(i == 0 && k == 0));
                    assert!((basis.work[i][k] + basis.work[k][i] - ends).abs() < 1e-14, "{degree} {i} {k}");
                }
                assert!(basis.work[i].iter().sum::<f64>().abs() < 1e-14);
            }
        }
    }

    #[test]
    fn projection_preserves_moments_and_lower_degrees() {
        for degree in 1..=MOST {
            let basis = TimeBasis::new(degree);
            for i in 0..=degree {
                for moment in 0..degree {
                    let of = |coefficients: &[f64]| -> f64 {
                        coefficients.iter().enumerate().map(|(a, c)| c / real(a + moment + 1)).sum()
                    };
                    let projected: Vec<f64> = (0..degree).map(|a| basis.projection[a][i]).collect();
                    assert!((of(&projected) - of(&basis.monomials[i])).abs() < 1e-13, "{degree} {i} {moment}");
                }
            }
        }
    }

    #[test]
    fn omitted_term_vanishes_for_lower_degrees() {
        for degree in 1..=MOST {
            let basis = TimeBasis::new(degree);
            for power in 0..=degree {
                let sum: f64 =
                    (0..=degree).map(|i| basis.left_out[i] * basis.points[i].powi(i32::try_from(power).unwrap())).sum();
                assert_eq!(sum.abs() > 1e-14, power == degree, "{degree}, {power}: {sum}");
            }
        }
    }
}
