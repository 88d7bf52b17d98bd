//! Bounds on the motion of a surface, from its control points alone.
//!
//! Around, a point of the surface is a mean of control points with weights ≥ 0. Along the axis, the weights of phantoms and of the
//! extension beyond the first and last ring have both signs: with Q₋₁ = 2 Q₀ − Q₁, the sum of their magnitudes is at most 1 + 2 (r³ + s³)/6
//! ≤ 4/3, and the extension adds at most `reach` · |Q₁ − Q₀| ≤ 2 `reach` · max |Q|. So |Σ w Q| ≤ Λ max |Q| with Λ = 4/3 + 2 `reach`.

use super::{Ends, SurfaceSpline, real};
use crate::math::vector::{Vector3, vector3_at};
use crate::scene::settings::Interpolation;

impl SurfaceSpline {
    /// Returns whether the surface is a smooth one around an axis, for which the bounds of this module hold.
    pub(crate) fn is_smooth_ring(&self) -> bool {
        self.ends == Ends::Smooth && self.interpolation == Interpolation::Spline
    }

    /// Λ: no point of the surface moves by more than this times the largest motion of a control point.
    pub(crate) fn amplification(&self) -> f64 {
        4.0 / 3.0 + 2.0 * self.reach
    }

    /// Length of the extension beyond the first and last ring (m), undeformed: the shorter one. A closest point moves along the surface
    /// about as far as its node, so a third of the inner half of the extension keeps it far from the outer half.
    pub(crate) fn extension(&self) -> f64 {
        let last = self.along - 1;
        self.reach * (self.rings[1] - self.rings[0]).min(self.rings[last] - self.rings[last - 1])
    }

    /// Returns whether a place is on a patch or on the inner half of an extension.
    #[inline(always)]
    pub(crate) fn is_far_from_edges(&self, place: super::ClosestPoint) -> bool {
        let half = 0.5 * self.reach;
        let low = if place.patch[1] == 0 { -half } else { f64::NEG_INFINITY };
        place.t >= low && (place.patch[1] + 2 < self.along || place.t <= 1.0 + half)
    }

    /// Bounds, for every patch around, of the distance (m) of the surface with control points `control` from itself, turned about z, per
    /// angle (rad).
    ///
    /// The point at (s, t) of the turned surface is compared with the one at s + n turn/2π, which rotation carries along: their distance
    /// grows at the rate E = (n/2π) S_s − e_z × S. Around, E is a cubic in every patch and a mean of its Bézier coefficients, so that the
    /// largest coefficient bounds it; along, Λ does. E vanishes for a surface of revolution, up to the error of interpolation.
    pub(crate) fn turning_rates(&self, control: &[Vector3]) -> Vec<f64> {
        let per_angle = 1.0 / self.spacing();
        let mut largest = vec![0.0_f64; self.around];
        for ring in control.chunks_exact(self.around) {
            for i in 0..self.around {
                let q: [Vector3; 4] = std::array::from_fn(|offset| ring[(i + offset) % self.around]);
                let b = [
                    (q[0] + 4.0 * q[1] + q[2]) / 6.0,
                    (2.0 * q[1] + q[2]) / 3.0,
                    (q[1] + 2.0 * q[2]) / 3.0,
                    (q[1] + 4.0 * q[2] + q[3]) / 6.0,
                ];
                let d = [3.0 * (b[1] - b[0]), 3.0 * (b[2] - b[1]), 3.0 * (b[3] - b[2])];
                let slope = [d[0], (d[0] + 2.0 * d[1]) / 3.0, (2.0 * d[1] + d[2]) / 3.0, d[2]];
                let patch = &mut largest[(i + 1) % self.around];
                for (slope, point) in slope.iter().zip(&b) {
                    let turned = Vector3::new(-point[1], point[0], 0.0);
                    *patch = patch.max((per_angle * slope - turned).norm_squared());
                }
            }
        }
        largest.iter().map(|square| self.amplification() * square.sqrt()).collect()
    }

    /// Patches around that a node at an angle about z (rad) may face, whose closest point is at most `margin` (rad) away: first and last,
    /// not reduced to one turn.
    pub(crate) fn patches_at(&self, [low, high]: [f64; 2], margin: f64) -> [f64; 2] {
        let position = |angle: f64| ((angle - self.first_angle) / self.spacing()).floor();
        [position(low - margin) - 1.0, position(high + margin) + 1.0]
    }

    /// Bound as [`SurfaceSpline::turning_rates`], for displacements of the control points (m, three each): S_s is a mean of differences of
    /// neighbours. Less tight, but fast.
    pub(crate) fn turning_rate_of_displacement(&self, moved: &[f64]) -> f64 {
        let (mut size, mut change) = (0.0_f64, 0.0_f64);
        for ring in moved.chunks_exact(3 * self.around) {
            let mut before = vector3_at(ring, self.around - 1);
            for point in 0..self.around {
                let now = vector3_at(ring, point);
                size = size.max(now.norm_squared());
                change = change.max((now - before).norm_squared());
                before = now;
            }
        }
        self.amplification() * (real(self.around) / std::f64::consts::TAU * change.sqrt() + size.sqrt())
    }
}

/// Largest difference of two sets of vectors (m, three components each).
pub(crate) fn largest_difference(now: &[f64], before: &[f64]) -> f64 {
    let pairs = now.chunks_exact(3).zip(before.chunks_exact(3));
    let square = |(a, b): (&[f64], &[f64])| {
        (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2])
    };
    pairs.map(square).fold(0.0, f64::max).sqrt()
}

/// Largest length of vectors (m, three components each).
pub(crate) fn largest_length(vectors: &[f64]) -> f64 {
    vectors.chunks_exact(3).map(|v| v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).fold(0.0, f64::max).sqrt()
}
