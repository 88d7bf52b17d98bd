//! Bounds on the motion of a surface, from its control points alone.
//!
//! Around, a point of the surface is a mean of control points with weights ≥ 0. Along the axis, the weights of phantoms and of the
//! extension beyond the first and last ring have both signs: with Q₋₁ = 2 Q₀ − Q₁, the sum of their magnitudes is at most 1 + 2 (r³ + s³)/6
//! ≤ 4/3, and the extension adds at most `reach` · |Q₁ − Q₀| ≤ 2 `reach` · max |Q|. So |Σ w Q| ≤ Λ max |Q| with Λ = 4/3 + 2 `reach`.

use super::{Ends, SurfaceSpline};
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

    /// Allocates memory for [`SurfaceSpline::patch_motions`].
    pub(crate) fn motions(&self) -> PatchMotions {
        PatchMotions::new(self.around)
    }

    /// Bounds the motion of the surface in every patch around, for control points that move from `before` to `now` (m, three each), while the
    /// rotor turns by up to `turn` (rad) over the surface that `before` displaces.
    ///
    /// Around, a point depends on the control points of four columns, and S_s is a mean of differences of neighbouring columns. So the
    /// displacement `before` changes [`SurfaceSpline::turning_rates`] by at most Λ (n/2π · largest difference + largest displacement).
    /// The bounds do not contain `turn` times the turning rates of the surface without displacement; add them.
    pub(crate) fn patch_motions(&self, [now, before]: [&[f64]; 2], turn: f64, motions: &mut PatchMotions) {
        motions.set_bounds(self.around, self.amplification(), |column| {
            let last = (column + self.around - 1) % self.around;
            let mut largest_squares = [0.0_f64; 3];
            for ring in 0..self.along {
                let first = ring * self.around;
                let [at, neighbour] = [column, last].map(|column| vector3_at(before, first + column));
                let moved = vector3_at(now, first + column) - at;
                let squares = [moved, at, at - neighbour].map(|vector| vector.norm_squared());
                largest_squares.iter_mut().zip(squares).for_each(|(largest, square)| *largest = largest.max(square));
            }
            let [moved, size, difference] = largest_squares.map(f64::sqrt);
            [moved + turn * size, turn * difference / self.spacing()]
        });
    }

    /// Bounds the displacement of the surface in every patch around. `square_of` returns the largest squared displacement of the control
    /// point with an index (m²).
    pub(crate) fn patch_displacements(&self, square_of: impl Fn(usize) -> f64, motions: &mut PatchMotions) {
        motions.set_bounds(self.around, self.amplification(), |column| {
            let squares = (0..self.along).map(|ring| square_of(ring * self.around + column));
            [squares.fold(0.0, f64::max).sqrt(), 0.0]
        });
    }
}

/// Bounds of the motion of a surface in every patch around; allocated for the largest surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct PatchMotions {
    /// For each column of control points (m): a bound of their motion, and, while the rotor turns, a bound of the effect of the difference
    /// between their displacements and those of the previous column.
    columns: Vec<[f64; 2]>,
    /// Bound for each patch around (m).
    patches: Vec<f64>,
}

impl PatchMotions {
    /// Allocates bounds for surfaces with at most `around` patches around.
    pub(crate) fn new(around: usize) -> Self {
        Self { columns: vec![[0.0; 2]; around], patches: vec![0.0; around] }
    }

    /// Bound for a patch (m).
    pub(crate) fn bound(&self, patch: usize) -> f64 {
        self.patches[patch]
    }

    /// Sets the bounds of the columns, and finds those of the patches. Patch p depends on the columns p − 1 … p + 2.
    fn set_bounds(&mut self, around: usize, amplification: f64, column_bounds: impl Fn(usize) -> [f64; 2]) {
        let (columns, patches) = (&mut self.columns[..around], &mut self.patches[..around]);
        columns.iter_mut().enumerate().for_each(|(index, column)| *column = column_bounds(index));
        let patch_bound = |[[a, _], [b, db], [c, dc], [d, dd]]: [[f64; 2]; 4]| {
            amplification * (a.max(b).max(c.max(d)) + db.max(dc).max(dd))
        };
        for (bound, four) in patches[1..].iter_mut().zip(columns.windows(4)) {
            *bound = patch_bound([four[0], four[1], four[2], four[3]]);
        }
        for patch in [0, around - 2, around - 1] {
            patches[patch] = patch_bound(std::array::from_fn(|offset| columns[(patch + around - 1 + offset) % around]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Projection, SurfaceSpline};
    use super::*;
    use crate::math::real;
    use crate::scene::settings::{Closure, Interpolation};
    use std::f64::consts::TAU;
    use tiprub_test_models::SeededRandom;

    /// Returns a ring through points whose radii deviate from 1 m by up to 1 % at random.
    fn ring(around: usize, along: usize, random: &mut SeededRandom) -> SurfaceSpline {
        let data: Vec<[f64; 3]> = (0..along)
            .flat_map(|ring| (0..around).map(move |column| (ring, column)))
            .map(|(ring, column)| {
                let (angle, radius) = (TAU * real(column) / real(around), 1.0 + 0.01 * random.signed());
                [radius * angle.cos(), radius * angle.sin(), 0.1 * real(ring)]
            })
            .collect();
        SurfaceSpline::new(&data, around, along, Closure::Smooth, Interpolation::Spline).unwrap()
    }

    /// Returns the distance of a point from a surface, and the patch around of the closest point.
    fn distance(surface: &SurfaceSpline, point: Vector3) -> (f64, usize) {
        match surface.project(point, surface.locate(point)) {
            Projection::Found { gap, .. } => (gap.distance, gap.foot.patch[0]),
            other => panic!("{other:?}"),
        }
    }

    /// A point turns about the axis of a ring while two columns of control points move. Its distance changes by no more than the bounds of
    /// the patches that it faces. The patch on the opposite side does not move.
    #[test]
    fn patch_motions_bound_change_of_distance() {
        let (mut random, mut tightest) = (SeededRandom(36), 0.0_f64);
        for case in 0..60 {
            let (around, along) = (8 + random.below(20), 2 + random.below(3));
            let mut surface = ring(around, along, &mut random);
            let round = surface.control_points().to_vec();
            let rates = surface.turning_rates(&round);
            let moving = random.below(around);
            let mut rows = [(); 2].map(|()| vec![0.0; 3 * round.len()]);
            for row in &mut rows {
                for (index, value) in row.iter_mut().enumerate() {
                    let column = (index / 3 + around - moving) % around;
                    *value = if column < 2 { 1e-3 * random.signed() } else { 0.0 };
                }
            }
            let [now, before] = &rows;
            let (turn, mut motions) = (1e-3 * random.signed(), surface.motions());
            surface.patch_motions([now, before], turn.abs(), &mut motions);
            let at = |random: &mut SeededRandom| {
                let angle = TAU * random.unit();
                let (radius, axial) = (0.97, 0.1 * real(along - 1) * random.unit());
                Vector3::new(radius * angle.cos(), radius * angle.sin(), axial)
            };
            let points: Vec<Vector3> = (0..60).map(|_| at(&mut random)).collect();
            let [first, second] = [(before, 0.0), (now, turn)].map(|(rows, turn): (&Vec<f64>, f64)| {
                surface.set_control_points(|index| round[index] + vector3_at(rows, index));
                let turned = |point: &Vector3| {
                    let (sin, cos) = turn.sin_cos();
                    Vector3::new(cos * point[0] - sin * point[1], sin * point[0] + cos * point[1], point[2])
                };
                points.iter().map(|point| distance(&surface, turned(point))).collect::<Vec<_>>()
            });
            for ((before, patch), (now, _)) in first.iter().zip(&second) {
                let faced = [*patch + around - 1, *patch, *patch + 1].map(|patch| patch % around);
                let bound = |patch: usize| turn.abs() * rates[patch] + motions.bound(patch);
                let bound = faced.map(bound).into_iter().fold(0.0, f64::max);
                let change = (now - before).abs();
                assert!(change <= bound * (1.0 + 1e-9) + 1e-14, "case {case}: {change:e} beyond {bound:e}");
                tightest = tightest.max(change / bound);
            }
            let opposite = motions.bound((moving + around / 2) % around);
            assert!(opposite < 1e-12, "case {case}: {opposite:e}");
        }
        assert!(tightest > 0.2, "{tightest}");
    }
}
