//! Meridional contour r(z) of a ring: piecewise cubic through given points, without overshoot.
//!
//! Slopes at inner points are the weighted harmonic means of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5(2),
//! 1984), slopes at the ends those of the outer segments. Two points give an exact cylinder or cone.

use tiprub_cosim::shown;

use crate::{Error, Result};

/// Contour of an inner surface.
#[derive(Debug, Clone, PartialEq)]
pub struct InnerContour {
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
}

impl InnerContour {
    /// Creates the contour through the points (z, r) in m, by ascending z.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than two points, radii that are not positive, or z that does not ascend.
    pub fn new(points: &[[f64; 2]]) -> Result<Self> {
        let refuse = |problem: String| {
            let remedy = "Give at least two points (z, r) in m with increasing z";
            Err(Error::invalid("contour of the casing", problem, remedy))
        };
        if points.len() < 2 {
            return refuse(format!("it has fewer than two points ({})", points.len()));
        }
        if let Some([z, r]) = points.iter().find(|[z, r]| !(z.is_finite() && r.is_finite() && *r > 0.0)) {
            return refuse(format!(
                "the point z = {} m, r = {} m is not finite or its radius is not positive",
                shown(*z),
                shown(*r)
            ));
        }
        if let Some(pair) = points.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
            let [previous, next] = [pair[0][0], pair[1][0]].map(shown);
            return refuse(format!("z = {next} m is not greater than the previous z = {previous} m"));
        }
        let secants: Vec<f64> =
            points.windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).collect();
        let last = secants.len() - 1;
        let slopes = (0..points.len()).map(|i| match i {
            0 => secants[0],
            i if i > last => secants[last],
            i => inner_slope(
                secants[i - 1],
                secants[i],
                points[i][0] - points[i - 1][0],
                points[i + 1][0] - points[i][0],
            ),
        });
        let slopes = slopes.collect();
        Ok(Self { points: points.to_vec(), slopes })
    }

    /// Returns the first and the last axial position (m).
    pub fn axial(&self) -> [f64; 2] {
        [self.points[0][0], self.points[self.points.len() - 1][0]]
    }

    /// Returns the radius (m) at the axial position z (m); the outer polynomials extend beyond the ends.
    pub fn radius(&self, z: f64) -> f64 {
        let (i, h, t) = self.place(z);
        let ([_, a], [_, b]) = (self.points[i], self.points[i + 1]);
        let (s, rest) = (t * t * (3.0 - 2.0 * t), 1.0 - t);
        a + (b - a) * s + h * t * rest * (rest * self.slopes[i] - t * self.slopes[i + 1])
    }

    /// Returns the slope dr/dz at the axial position z (m).
    pub fn slope(&self, z: f64) -> f64 {
        let (i, h, t) = self.place(z);
        let secant = (self.points[i + 1][1] - self.points[i][1]) / h;
        let rest = 1.0 - t;
        6.0 * t * rest * secant + rest * (rest - 2.0 * t) * self.slopes[i] + t * (t - 2.0 * rest) * self.slopes[i + 1]
    }

    /// Returns the segment, its length, and the position in it from 0 to 1.
    fn place(&self, z: f64) -> (usize, f64, f64) {
        let inner = &self.points[1..self.points.len() - 1];
        let i = inner.iter().take_while(|point| point[0] <= z).count();
        let h = self.points[i + 1][0] - self.points[i][0];
        (i, h, (z - self.points[i][0]) / h)
    }
}

/// Returns the slope at a point between segments of slopes `before` and `after` and lengths `from` and `to`.
fn inner_slope(before: f64, after: f64, from: f64, to: f64) -> f64 {
    if before * after <= 0.0 {
        return 0.0;
    }
    let (a, b) = (from + 2.0 * to, 2.0 * from + to);
    (a + b) / (a / after + b / before).abs() * before.signum()
}
