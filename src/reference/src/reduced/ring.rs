//! Closed bicubic B-spline through a grid of data points on a ring, computed from its equations with dense matrices.
//!
//! Control points Q satisfy (Q₋ + 4Q + Q₊)/6 = P around, cyclically, and along the axis with zero second derivative
//! at both edges; the surface is Σ B(ξ − i) B(η − j) Q_ij with the cardinal cubic B-spline B and points mirrored
//! beyond the edges.

use nalgebra::{DMatrix, DVector, Vector3};

/// Returns the value, first and second derivative of the cardinal cubic B-spline (support −2 … 2).
fn basis(x: f64) -> [f64; 3] {
    let (a, sign) = (x.abs(), x.signum());
    if a >= 2.0 {
        [0.0; 3]
    } else if a >= 1.0 {
        [(2.0 - a).powi(3) / 6.0, -sign * (2.0 - a).powi(2) / 2.0, 2.0 - a]
    } else {
        [2.0 / 3.0 - a * a + 0.5 * a.powi(3), sign * (1.5 * a * a - 2.0 * a), 3.0 * a - 2.0]
    }
}

/// Point, derivatives along ξ and η, and ξξ, ξη, ηη at a position.
pub(crate) type SurfaceDerivatives = [Vector3<f64>; 6];

/// Interpolation problem of a grid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ring {
    around: usize,
    along: usize,
    /// Control points = interpolation · data points.
    interpolation: DMatrix<f64>,
}

impl Ring {
    /// Creates the problem for `around` points on each of `along` rings, ring by ring; `None` for grids without a
    /// solution.
    pub(crate) fn new(around: usize, along: usize) -> Option<Self> {
        let ring = DMatrix::from_fn(around, around, |i, j| match (i + around - j) % around {
            0 => 4.0 / 6.0,
            1 => 1.0 / 6.0,
            turned if turned == around - 1 => 1.0 / 6.0,
            _ => 0.0,
        });
        let line = DMatrix::from_fn(along, along, |i, j| match (i.abs_diff(j), i == 0 || i == along - 1) {
            (0, true) => 1.0,
            (0, false) => 4.0 / 6.0,
            (1, false) => 1.0 / 6.0,
            _ => 0.0,
        });
        let interpolation = line.try_inverse()?.kronecker(&ring.try_inverse()?);
        Some(Self { around, along, interpolation })
    }

    /// Returns the control points of data points.
    pub(crate) fn control(&self, data: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let columns = DMatrix::from_fn(data.len(), 3, |i, k| data[i][k]);
        (&self.interpolation * columns).row_iter().map(|row| Vector3::new(row[0], row[1], row[2])).collect()
    }

    /// Returns the control points with an influence at a position in grid steps, with value and derivatives of their
    /// weight as in [`SurfaceDerivatives`].
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "indices of small grids"
    )]
    fn local(&self, xi: f64, eta: f64) -> Vec<(usize, [f64; 6])> {
        let (first, last) = (xi.floor() as i64 - 1, self.along as i64 - 1);
        // The last patch continues beyond an edge.
        let low = (eta.floor() as i64 - 1).clamp(-1, last - 2);
        let mut found = Vec::with_capacity(24);
        for j in low..low + 4 {
            let up = basis(eta - j as f64);
            let shares: &[(i64, f64)] = match j {
                -1 => &[(0, 2.0), (1, -1.0)],
                j if j > last => &[(last, 2.0), (last - 1, -1.0)],
                j => &[(j, 1.0)],
            };
            for i in first..first + 4 {
                let place = i.rem_euclid(self.around as i64) as usize;
                let b = basis(xi - i as f64);
                for (row, share) in shares {
                    let weights = [b[0] * up[0], b[1] * up[0], b[0] * up[1], b[2] * up[0], b[1] * up[1], b[0] * up[2]];
                    found.push((*row as usize * self.around + place, weights.map(|weight| share * weight)));
                }
            }
        }
        found
    }

    /// Evaluates the surface at a position in grid steps.
    pub(crate) fn at(&self, control: &[Vector3<f64>], xi: f64, eta: f64) -> SurfaceDerivatives {
        let mut place = [Vector3::zeros(); 6];
        for (index, weights) in self.local(xi, eta) {
            for (part, weight) in place.iter_mut().zip(weights) {
                *part += control[index] * weight;
            }
        }
        place
    }

    /// Returns the weights of the data points at a position.
    pub(crate) fn weights(&self, xi: f64, eta: f64) -> DVector<f64> {
        let mut control = DVector::zeros(self.around * self.along);
        for (index, weights) in self.local(xi, eta) {
            control[index] += weights[0];
        }
        self.interpolation.tr_mul(&control)
    }

    /// Returns the closest position to a point by Newton's method from a guess; `None` if it does not converge.
    pub(crate) fn closest(
        &self,
        control: &[Vector3<f64>],
        point: Vector3<f64>,
        guess: [f64; 2],
    ) -> Option<([f64; 2], SurfaceDerivatives)> {
        let [mut xi, mut eta] = guess;
        for _ in 0..30 {
            let place = self.at(control, xi, eta);
            let [foot, a, b, aa, ab, bb] = place;
            let apart = point - foot;
            let (f, g) = (apart.dot(&a), apart.dot(&b));
            let (p, q, r) = (apart.dot(&aa) - a.dot(&a), apart.dot(&ab) - a.dot(&b), apart.dot(&bb) - b.dot(&b));
            let determinant = p * r - q * q;
            let (u, v) = ((f * r - g * q) / determinant, (p * g - q * f) / determinant);
            (xi, eta) = (xi - u, eta - v);
            if u.abs().max(v.abs()) < 1e-12 {
                return Some(([xi, eta], self.at(control, xi, eta)));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(around: usize, along: usize) -> Vec<Vector3<f64>> {
        let point = |i: usize, j: usize| {
            let angle = std::f64::consts::TAU * i as f64 / around as f64;
            Vector3::new(0.3 * angle.cos(), 0.3 * angle.sin(), 0.02 * j as f64)
        };
        (0..along).flat_map(|j| (0..around).map(move |i| point(i, j))).collect()
    }

    #[test]
    fn surface_interpolates_and_projection_is_perpendicular() {
        let ring = Ring::new(28, 3).unwrap();
        let data = round(28, 3);
        let control = ring.control(&data);
        for (index, point) in data.iter().enumerate() {
            let place = [(index % 28) as f64, (index / 28) as f64];
            assert!((ring.at(&control, place[0], place[1])[0] - point).norm() < 1e-14);
            assert!((ring.weights(place[0], place[1])[index] - 1.0).abs() < 1e-13);
        }
        let x = Vector3::new(0.2, -0.2, 0.013);
        let (place, [foot, a, b, ..]) = ring.closest(&control, x, [24.0, 0.6]).unwrap();
        assert!((x - foot).dot(&a).abs() < 1e-14 && (x - foot).dot(&b).abs() < 1e-14);
        assert!((place[0] - 24.5).abs() < 1e-6 && (place[1] - 0.65).abs() < 1e-6, "{place:?}");
        // Second derivatives are compared with differences.
        let d = 1e-5;
        let [_, right, ..] = ring.at(&control, place[0] + d, place[1]);
        let [_, left, ..] = ring.at(&control, place[0] - d, place[1]);
        assert!(((right - left) / (2.0 * d) - ring.at(&control, place[0], place[1])[3]).norm() < 1e-8);
    }
}
