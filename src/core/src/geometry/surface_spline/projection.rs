//! Closest point of the surface to a node.
//!
//! Newton iteration on f = ½|x − S|², r = x − S, with gradient −(S_s·r, S_t·r) and Hessian [S_s·S_s − r·S_ss, S_s·S_t − r·S_st; …], or the
//! first fundamental form if the Hessian is not positive definite. Steps are cut until f falls, so that iterations never cycle. Patch
//! borders can be crossed where the surface is smooth. At free edges, and at creases (borders of facets, the seam of free ends), the step
//! is projected onto the sheet between them; neighbouring sheets are then searched for a closer point.

use super::foot::{CONVEX, DEGENERATE, FootPoint, HeldBound, Room, noise, solve};
use super::{ClosestPoint, EDGE_TOLERANCE, Ends, SurfaceSpline};
use crate::geometry::Gap;
use crate::math::real;
use crate::math::vector::{Vector3, length};
use crate::scene::settings::Interpolation;

/// Result of a projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// The closest point lies on the surface.
    Found {
        /// (x − S)·n, with the unit normal from the casing towards the axis. On a crease it is that of the facet whose normal is nearest
        /// to the direction of the node. The next projection of this node starts at the foot.
        gap: Gap,
        /// The closest point S (m).
        point: Vector3,
    },
    /// The node has left the surface: in z beyond the extension of the last ring, or over any of the four edges of an open surface.
    BeyondEdge {
        /// The closest point of the edge; start of the next projection of this node.
        place: ClosestPoint,
    },
    /// No closest point: the coordinates are not finite, or the surface is folded.
    Lost,
}

/// Newton steps below this (in patches) end the iteration.
const STEP_TOLERANCE: f64 = 1e-11;
/// Rounding of the coordinates of x − S, relative to |x| (and |x − S|).
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Largest number of corrections near a good start; one or two are usual.
const MAX_CORRECTIONS: usize = 6;
/// Largest number of iterations, far above the need of starts on the opposite side of the casing (about 30).
const MAX_ITERATIONS: usize = 100;
/// Largest number of halvings of a step.
const MAX_HALVINGS: usize = 40;

impl SurfaceSpline {
    /// Finds the closest point to `x` (m) from `guess`: the place of the last step, possibly moved by [`SurfaceSpline::advance`], or the
    /// result of [`SurfaceSpline::locate`].
    ///
    /// # Panics
    /// If the patch of the guess does not exist.
    pub fn project(&self, x: Vector3, guess: ClosestPoint) -> Projection {
        if let Some(projection) = self.project_nearby(x, guess) {
            return projection;
        }
        if !x.iter().all(|value| value.is_finite()) {
            return Projection::Lost;
        }
        let loose = |value: f64| value.clamp(-EDGE_TOLERANCE, 1.0 + EDGE_TOLERANCE);
        let s = if self.ends == Ends::Open { loose(guess.s) } else { guess.s.clamp(0.0, 1.0) };
        let [low, high] = self.span(guess.patch[1]);
        let Some(mut foot) = self.descend(x, ClosestPoint { s, t: guess.t.clamp(low, high), ..guess }) else {
            return Projection::Lost;
        };
        if self.has_creases() {
            match self.search_sheets(x, foot) {
                Some(closest) => foot = closest,
                None => return Projection::Lost,
            }
        }
        if self.is_over_edge(&foot) {
            return Projection::BeyondEdge { place: foot.place };
        }
        foot.found()
    }

    /// Takes a Newton step that stays in its patch, then corrections with the same Hessian until the next one is within the tolerance:
    /// sufficient for nearly every projection of a run. Returns `None` in all other cases.
    #[inline]
    fn project_nearby(&self, x: Vector3, guess: ClosestPoint) -> Option<Projection> {
        if self.interpolation == Interpolation::Facets {
            return None;
        }
        let mut foot = FootPoint::seen(x, guess, self.evaluate_bicubic::<true>(guess));
        let metric = foot.metric();
        let (hessian, determinant) = foot.hessian(metric);
        let area = metric[0] * metric[2] - metric[1] * metric[1];
        if !(area > DEGENERATE * metric[0] * metric[2] && hessian[0] > 0.0 && determinant > CONVEX * area) {
            return None;
        }
        let inverse = 1.0 / determinant;
        let [low, high] = self.span(guess.patch[1]);
        for _ in 0..MAX_CORRECTIONS {
            let step = solve(hessian, inverse, foot.gradient());
            let is_within = |limit: f64| step[0].abs() <= limit && step[1].abs() <= limit;
            if is_within(STEP_TOLERANCE) {
                let is_inside = (low..=high).contains(&foot.place.t)
                    && (self.ends != Ends::Open || (0.0..=1.0).contains(&foot.place.s));
                return (is_inside && self.is_far_from_seam(&foot, metric[0])).then(|| foot.found());
            }
            let place = ClosestPoint { s: foot.place.s + step[0], t: foot.place.t + step[1], ..guess };
            let stays = (0.0..1.0).contains(&place.s) && (low..high).contains(&place.t);
            if !(stays && is_within(0.1)) {
                return None;
            }
            foot = FootPoint::seen(x, place, self.evaluate_bicubic::<false>(place));
        }
        None
    }

    /// Improves `guess`, an estimate of the closest point to `x` (m) on a smooth surface around an axis, by a Gauss-Newton step. The step multiplies
    /// the error by about the ratio of distance to radius of curvature.
    #[inline(always)]
    pub(crate) fn step_closer(&self, x: Vector3, guess: ClosestPoint) -> ClosestPoint {
        let foot = FootPoint::seen(x, guess, self.evaluate_bicubic::<false>(guess));
        let metric = foot.metric();
        let area = metric[0] * metric[2] - metric[1] * metric[1];
        let [s, t] = solve(metric, 1.0 / area, foot.gradient());
        self.settle(ClosestPoint { s: guess.s + s, t: guess.t + t, ..guess })
    }

    /// Returns whether the seam of free ends is too far away for a closer point on its other side.
    fn is_far_from_seam(&self, foot: &FootPoint, length_s: f64) -> bool {
        let column = foot.place.patch[0];
        self.ends != Ends::Meeting || (column > 0 && column + 1 < self.around && 8.0 * foot.half_square < length_s)
    }

    fn has_creases(&self) -> bool {
        self.interpolation == Interpolation::Facets || self.ends == Ends::Meeting
    }

    fn is_over_edge(&self, foot: &FootPoint) -> bool {
        let ([column, ring], smooth) = (foot.place.patch, self.interpolation == Interpolation::Spline);
        let over = |held: HeldBound, first: bool, last: bool| match held {
            HeldBound::No => false,
            HeldBound::Low => smooth || first,
            HeldBound::High => smooth || last,
        };
        over(foot.held[1], ring == 0, ring + 2 == self.along)
            || (self.ends == Ends::Open && over(foot.held[0], column == 0, column + 2 == self.around))
    }

    /// Range of t in the patches of a ring, including the extension beyond the first and the last ring.
    #[inline]
    pub(super) fn span(&self, ring: usize) -> [f64; 2] {
        let low = if ring == 0 { -self.reach } else { 0.0 };
        [low, if ring + 2 == self.along { 1.0 + self.reach } else { 1.0 }]
    }

    /// Returns the sheet around a place: a facet, or everything up to the edges and the seam.
    #[inline]
    pub(super) fn room(&self, place: ClosestPoint) -> Room {
        let [p, q] = place.patch.map(real);
        if self.interpolation == Interpolation::Facets {
            let side = |patch: usize, count: usize| {
                let low = if patch == 0 { -EDGE_TOLERANCE } else { 0.0 };
                [low, if patch + 2 == count { 1.0 + EDGE_TOLERANCE } else { 1.0 }]
            };
            let around = if self.ends == Ends::Open { side(place.patch[0], self.around) } else { [0.0, 1.0] };
            return [around, self.span(place.patch[1])];
        }
        let around = match self.ends {
            Ends::Smooth => [f64::NEG_INFINITY, f64::INFINITY],
            Ends::Meeting => [-p, real(self.around) - p],
            Ends::Open => [-p - EDGE_TOLERANCE, real(self.around - 1) - p + EDGE_TOLERANCE],
        };
        [around, [-q - self.reach, real(self.along - 1) - q + self.reach]]
    }

    /// Expresses a place with parameters beyond its patch in the patch that contains it.
    #[inline]
    pub(crate) fn settle(&self, ClosestPoint { patch, s, t }: ClosestPoint) -> ClosestPoint {
        if self.interpolation == Interpolation::Facets || ((0.0..1.0).contains(&s) && (0.0..1.0).contains(&t)) {
            return ClosestPoint { patch, s, t };
        }
        let [p, q] = patch.map(real);
        let whole = real(self.around);
        let mut column = p + s.floor();
        if self.ends == Ends::Smooth {
            column -= whole * (column / whole).floor();
        }
        let column = column.clamp(0.0, real(self.columns() - 1));
        let ring = (q + t.floor()).clamp(0.0, real(self.along - 2));
        let s = match self.ends {
            Ends::Smooth => s - s.floor(),
            Ends::Meeting | Ends::Open => s - (column - p),
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the patches")]
        let patch = [column as usize, ring as usize];
        ClosestPoint { patch, s, t: t - (ring - q) }
    }

    /// Rounding of the coordinates of x − S (m), and of the place of S. A node inside a casing is near the surface and about as far from
    /// the axis. A node that faces an open surface may be anywhere, and so may the surface: rounding of the tangents, which is that of the
    /// coordinates over a patch, moves the closest point in proportion to the distance.
    pub(super) fn rounding(&self, x: Vector3, foot: &FootPoint) -> f64 {
        let size = length(x);
        if self.ends != Ends::Open {
            return ROUNDING * size;
        }
        let (distance, metric) = ((2.0 * foot.half_square).sqrt(), foot.metric());
        ROUNDING * (size + distance) * (1.0 + distance / metric[0].min(metric[2]).sqrt())
    }

    /// Finds the minimum of f on the sheet of `start`.
    pub(super) fn descend(&self, x: Vector3, start: ClosestPoint) -> Option<FootPoint> {
        let longest = (0.125 * real(self.around)).max(1.0);
        let mut foot = FootPoint::at(self, x, start);
        let rounding = self.rounding(x, &foot);
        for _ in 0..MAX_ITERATIONS {
            let room = self.room(foot.place);
            let metric = foot.metric();
            let step = foot.newton_step(&room, metric)?;
            let floor = rounding * rounding;
            let is_small = |axis: usize| {
                let length = metric[2 * axis];
                step[axis] * step[axis] * length <= (STEP_TOLERANCE * STEP_TOLERANCE * length).max(floor)
            };
            if is_small(0) && is_small(1) {
                return Some(foot);
            }
            let largest = step[0].abs().max(step[1].abs());
            let limit = if largest > longest { longest / largest } else { 1.0 };
            foot = self.search_line(x, &foot, step.map(|value| value * limit), &room, rounding)?;
        }
        None
    }

    /// Returns the first of the halved steps that lowers f enough (Armijo's condition on the projected step).
    #[inline]
    fn search_line(
        &self,
        x: Vector3,
        from: &FootPoint,
        step: [f64; 2],
        room: &Room,
        rounding: f64,
    ) -> Option<FootPoint> {
        let mut factor = 1.0;
        for _ in 0..MAX_HALVINGS {
            let s = (from.place.s + factor * step[0]).clamp(room[0][0], room[0][1]);
            let t = (from.place.t + factor * step[1]).clamp(room[1][0], room[1][1]);
            let foot = FootPoint::at(self, x, self.settle(ClosestPoint { s, t, ..from.place }));
            let gain = 1e-4 * from.slope([s - from.place.s, t - from.place.t]).min(0.0);
            if foot.half_square <= from.half_square + gain
                || foot.half_square <= from.half_square + noise(from, rounding)
            {
                return Some(foot);
            }
            factor *= 0.5;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::settings::Closure;
    use tiprub_test_models::SeededRandom;

    /// Newton steps up to this (in patches) end at the closest point within about [`STEP_TOLERANCE`], because errors are squared.
    const CLOSE: f64 = 1e-5;

    /// Nodes of a run start from their places of the previous step: the short search ends at the same place as the long one.
    #[test]
    fn nearly_stationary_nodes_use_the_fast_projection() {
        let ring = |ring: u32| {
            (0..24).map(move |i| {
                let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(i) / 24.0);
                [0.25 * cosine, 0.25 * sine, 0.01 * f64::from(ring)]
            })
        };
        let points: Vec<[f64; 3]> = (0..4).flat_map(ring).collect();
        let surface = SurfaceSpline::new(&points, 24, 4, Closure::Smooth, Interpolation::Spline).unwrap();
        let mut random = SeededRandom(4);
        let mut worst = 0.0_f64;
        for _ in 0..500 {
            let patch = [random.below(24), random.below(3)];
            let mut within = || random.within(0.1, 0.9);
            let guess = ClosestPoint { patch, s: within(), t: within() };
            let foot = FootPoint::at(&surface, Vector3::zeros(), guess);
            let x = foot.evaluation.point + 3e-4 * foot.normal() + Vector3::from(random.vector(2e-4));
            let Some(Projection::Found { gap, .. }) = surface.project_nearby(x, guess) else { panic!("{guess:?}") };
            let slowly = surface.descend(x, guess).unwrap().found();
            let Projection::Found { gap: expected, .. } = slowly else { panic!("{slowly:?}") };
            assert!((gap.distance - expected.distance).abs() < 1e-16, "{gap:?}, {expected:?}");
            let mut near = || 0.7 * random.within(-CLOSE, CLOSE);
            let guess = ClosestPoint { s: expected.foot.s + near(), t: expected.foot.t + near(), ..expected.foot };
            let closely = surface.project_close(x, guess, CLOSE).unwrap();
            // Coordinates of 0.25 m are rounded to 3e-17 m.
            assert!((closely.distance - expected.distance).abs() < 4e-16, "{closely:?}, {expected:?}");
            assert!((closely.normal - expected.normal).norm() < 1e-11, "{closely:?}, {expected:?}");
            let mut nearby = || 280.0 * near();
            let guess_nearby =
                ClosestPoint { s: expected.foot.s + nearby(), t: expected.foot.t + nearby(), ..expected.foot };
            let found = surface.project_close(x, guess_nearby, 200.0 * CLOSE).unwrap();
            worst = worst.max((found.distance - expected.distance).abs());
            let beyond = ClosestPoint { s: guess.s + 3.0 * CLOSE, ..guess };
            let next = surface.project_close(x, beyond, CLOSE).unwrap_err().unwrap();
            assert_eq!(next.patch, expected.foot.patch);
            let error = (next.s - expected.foot.s).abs().max((next.t - expected.foot.t).abs());
            assert!(error < 1e-9, "{next:?}, {expected:?}");
        }
        // An error of 2e-3 patches causes an error of the gap of third order.
        assert!((1e-14..1e-12).contains(&worst), "{worst:e}");
    }
}
