//! Closest point of the surface to a node.
//!
//! Newton on f = ½|x − S|², r = x − S: gradient −(S_s·r, S_t·r), Hessian [S_s·S_s − r·S_ss, S_s·S_t − r·S_st; …], and
//! the first fundamental form in its place where it is not positive definite. Steps are cut until f falls, so iterations
//! never cycle. Patch borders are crossed freely where the surface is smooth. At the edges in z, and at creases (borders
//! of facets, the seam of free ends), the step is projected onto the sheet between them; neighbouring sheets are then
//! searched for a closer point.

use super::{Evaluation, Place, SurfaceSpline};
use crate::contact::gap::dot;
use crate::settings::{Closure, Interpolation};

/// Result of a projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// The closest point lies on the surface.
    Found {
        /// Where it is; start of the next projection of this node.
        place: Place,
        /// The closest point S (m).
        point: [f64; 3],
        /// Unit normal from the casing towards the axis. On a crease it is that of the facet which faces the node
        /// most squarely.
        normal: [f64; 3],
        /// (x − S)·n (m), negative outside the casing.
        gap: f64,
    },
    /// The node has left the surface over a free edge in z.
    BeyondEdge {
        /// The closest point of the edge; start of the next projection of this node.
        place: Place,
    },
    /// No closest point: the coordinates are not finite, or the surface is folded beyond use.
    Lost,
}

/// A node this far (in patches) beyond an edge in z is still on the surface, so that rounding does not decide for nodes
/// that stand exactly on it.
const EDGE_TOLERANCE: f64 = 1e-9;
/// Newton steps below this (in patches) end the iteration.
const STEP_TOLERANCE: f64 = 1e-11;
/// Tangents closer to parallel than this (squared sine) are no surface.
const DEGENERATE: f64 = 1e-24;
/// Curvature of f, relative to that for a plane, below which Newton steps are not trusted.
const CONVEX: f64 = 1e-3;
/// Rounding of the coordinates of x − S, relative to |x|.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Evaluations near a good start: the Hessian of the start makes each correction a hundredth of the one before, or less.
const MAX_CORRECTIONS: usize = 6;
/// Far beyond what starts on the opposite side of the casing need (about 20).
const MAX_ITERATIONS: usize = 100;
/// Halvings of a step before giving up.
const MAX_HALVINGS: usize = 40;

/// Which bound of a sheet a coordinate is held at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Held {
    No,
    Low,
    High,
}

/// A point of the surface as seen from the node.
#[derive(Clone, Copy)]
struct Foot {
    place: Place,
    evaluation: Evaluation,
    /// x − S.
    residual: [f64; 3],
    /// ½|x − S|².
    half_square: f64,
    held: [Held; 2],
}

/// Range of the parameters of a patch that lies on the same smooth sheet, [[low, high] of s, of t].
type Room = [[f64; 2]; 2];

impl Foot {
    fn at(surface: &SurfaceSpline, x: [f64; 3], place: Place) -> Self {
        Self::seen(x, place, surface.evaluate(place))
    }

    #[inline(always)]
    fn seen(x: [f64; 3], place: Place, evaluation: Evaluation) -> Self {
        let residual: [f64; 3] = std::array::from_fn(|i| x[i] - evaluation.point[i]);
        Self { place, evaluation, residual, half_square: 0.5 * dot(residual, residual), held: [Held::No; 2] }
    }

    #[inline]
    fn gradient(&self) -> [f64; 2] {
        [-dot(self.residual, self.evaluation.d_s), -dot(self.residual, self.evaluation.d_t)]
    }

    /// First fundamental form [S_s·S_s, S_s·S_t, S_t·S_t].
    #[inline]
    fn metric(&self) -> [f64; 3] {
        let Evaluation { d_s, d_t, .. } = &self.evaluation;
        [dot(*d_s, *d_s), dot(*d_s, *d_t), dot(*d_t, *d_t)]
    }

    /// Second derivatives of f [ss, st, tt] and their determinant.
    #[inline]
    fn hessian(&self, metric: [f64; 3]) -> ([f64; 3], f64) {
        let Evaluation { d_ss, d_st, d_tt, .. } = &self.evaluation;
        let bend = [dot(self.residual, *d_ss), dot(self.residual, *d_st), dot(self.residual, *d_tt)];
        let hessian: [f64; 3] = std::array::from_fn(|i| metric[i] - bend[i]);
        (hessian, hessian[0] * hessian[2] - hessian[1] * hessian[1])
    }

    /// Change of f along a step, to first order.
    fn slope(&self, step: [f64; 2]) -> f64 {
        let gradient = self.gradient();
        gradient[0] * step[0] + gradient[1] * step[1]
    }

    /// Newton step on the coordinates that are not held; None where the surface is degenerate.
    #[inline]
    fn newton_step(&mut self, room: &Room, metric: [f64; 3]) -> Option<[f64; 2]> {
        let gradient = self.gradient();
        let (hessian, determinant) = self.hessian(metric);
        let area = metric[0] * metric[2] - metric[1] * metric[1];
        // NaN counts as degenerate.
        if !(area > DEGENERATE * metric[0] * metric[2]) {
            return None;
        }
        let position = [self.place.s, self.place.t];
        for axis in 0..2 {
            self.held[axis] = if position[axis] <= room[axis][0] && gradient[axis] > 0.0 {
                Held::Low
            } else if position[axis] >= room[axis][1] && gradient[axis] < 0.0 {
                Held::High
            } else {
                Held::No
            };
        }
        let alone = |axis: usize| {
            let (curvature, length) = (hessian[2 * axis], metric[2 * axis]);
            let mut step = [0.0; 2];
            step[axis] = -gradient[axis] / if curvature > CONVEX * length { curvature } else { length };
            step
        };
        match self.held.map(|held| held == Held::No) {
            [false, false] => return Some([0.0; 2]),
            [true, false] => return Some(alone(0)),
            [false, true] => return Some(alone(1)),
            [true, true] => {}
        }
        let is_convex = hessian[0] > 0.0 && determinant > CONVEX * area;
        if !is_convex && let Some(step) = escape(gradient, hessian, metric, determinant) {
            return Some(step);
        }
        let step =
            if is_convex { solve(hessian, 1.0 / determinant, gradient) } else { solve(metric, 1.0 / area, gradient) };
        // The other coordinate may push this one over a bound that it would leave inwards alone.
        let blocked = |axis: usize| {
            (position[axis] <= room[axis][0] && step[axis] < 0.0)
                || (position[axis] >= room[axis][1] && step[axis] > 0.0)
        };
        Some(match (blocked(0), blocked(1)) {
            (true, _) => alone(1),
            (_, true) => alone(0),
            _ => step,
        })
    }

    /// Unit normal S_t × S_s/|S_t × S_s|: around × axial points away from the axis.
    #[inline]
    fn normal(&self) -> [f64; 3] {
        let ([a, b, c], [d, e, f]) = (self.evaluation.d_t, self.evaluation.d_s);
        let cross = [b * f - c * e, c * d - a * f, a * e - b * d];
        let per_length = 1.0 / dot(cross, cross).sqrt();
        cross.map(|value| value * per_length)
    }

    #[inline]
    fn found(&self) -> Projection {
        let normal = self.normal();
        Projection::Found { place: self.place, point: self.evaluation.point, normal, gap: dot(self.residual, normal) }
    }
}

/// −matrix⁻¹ gradient.
#[inline(always)]
fn solve([a, b, c]: [f64; 3], per_determinant: f64, gradient: [f64; 2]) -> [f64; 2] {
    [(b * gradient[1] - c * gradient[0]) * per_determinant, (b * gradient[0] - a * gradient[1]) * per_determinant]
}

/// On top of a maximum or a saddle of f, where the gradient vanishes: half a patch along the negative curvature.
fn escape(gradient: [f64; 2], hessian: [f64; 3], metric: [f64; 3], determinant: f64) -> Option<[f64; 2]> {
    let size = gradient[0] * gradient[0] * metric[2] + gradient[1] * gradient[1] * metric[0];
    if size > 1e-18 * metric[0] * metric[0] * metric[2] || !(hessian[0] < 0.0 || determinant < 0.0) {
        return None;
    }
    if hessian[0] < 0.0 {
        return Some([0.5, 0.0]);
    }
    if hessian[2] < 0.0 {
        return Some([0.0, 0.5]);
    }
    // Both curvatures are positive and the mixed one exceeds them.
    let step = [hessian[2], -hessian[1]];
    let largest = step[0].abs().max(step[1].abs());
    Some(step.map(|value| 0.5 * value / largest))
}

impl SurfaceSpline {
    /// Closest point to `x` (m), found from `guess`: the place of the last step, moved along by
    /// [`SurfaceSpline::advance`] or not, or [`SurfaceSpline::locate`].
    ///
    /// # Panics
    /// A guess on a patch that does not exist.
    pub fn project(&self, x: [f64; 3], guess: Place) -> Projection {
        if let Some(projection) = self.project_nearby(x, guess) {
            return projection;
        }
        if !x.iter().all(|value| value.is_finite()) {
            return Projection::Lost;
        }
        let Some(mut foot) = self.descend(x, guess) else { return Projection::Lost };
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

    /// A Newton step that stays in its patch, then corrections with the same Hessian until the next one is within the
    /// tolerance: nearly every projection of a run. None where anything is out of the ordinary.
    #[inline]
    fn project_nearby(&self, x: [f64; 3], guess: Place) -> Option<Projection> {
        if self.interpolation == Interpolation::Facets {
            return None;
        }
        let mut foot = Foot::seen(x, guess, self.evaluate_bicubic::<true>(guess));
        let metric = foot.metric();
        let (hessian, determinant) = foot.hessian(metric);
        let area = metric[0] * metric[2] - metric[1] * metric[1];
        if !(area > DEGENERATE * metric[0] * metric[2] && hessian[0] > 0.0 && determinant > CONVEX * area) {
            return None;
        }
        let inverse = 1.0 / determinant;
        for _ in 0..MAX_CORRECTIONS {
            let step = solve(hessian, inverse, foot.gradient());
            let is_within = |limit: f64| step[0].abs() <= limit && step[1].abs() <= limit;
            if is_within(STEP_TOLERANCE) {
                let is_inside = foot.place.t >= 0.0 && foot.place.t <= 1.0;
                return (is_inside && self.is_far_from_seam(&foot, metric[0])).then(|| foot.found());
            }
            let place = Place { s: foot.place.s + step[0], t: foot.place.t + step[1], ..guess };
            let stays = (0.0..1.0).contains(&place.s) && (0.0..1.0).contains(&place.t);
            if !(stays && is_within(0.1)) {
                return None;
            }
            foot = Foot::seen(x, place, self.evaluate_bicubic::<false>(place));
        }
        None
    }

    /// Whether the seam of free ends is too far away to hold a closer point on its other side.
    fn is_far_from_seam(&self, foot: &Foot, length_s: f64) -> bool {
        let column = foot.place.patch[0];
        self.closure == Closure::Smooth || (column > 0 && column + 1 < self.around && 8.0 * foot.half_square < length_s)
    }

    fn has_creases(&self) -> bool {
        self.interpolation == Interpolation::Facets || self.closure == Closure::FreeEnds
    }

    fn is_over_edge(&self, foot: &Foot) -> bool {
        let ring = foot.place.patch[1];
        match foot.held[1] {
            Held::No => false,
            Held::Low => ring == 0 || self.interpolation == Interpolation::Spline,
            Held::High => ring + 2 == self.along || self.interpolation == Interpolation::Spline,
        }
    }

    /// The sheet around a place: a facet, or everything up to the edges and the seam.
    #[inline]
    fn room(&self, place: Place) -> Room {
        let [p, q] = place.patch.map(super::real);
        if self.interpolation == Interpolation::Facets {
            let low = if place.patch[1] == 0 { -EDGE_TOLERANCE } else { 0.0 };
            let high = if place.patch[1] + 2 == self.along { 1.0 + EDGE_TOLERANCE } else { 1.0 };
            return [[0.0, 1.0], [low, high]];
        }
        let around = match self.closure {
            Closure::Smooth => [f64::NEG_INFINITY, f64::INFINITY],
            Closure::FreeEnds => [-p, super::real(self.around) - p],
        };
        [around, [-q - EDGE_TOLERANCE, super::real(self.along - 1) - q + EDGE_TOLERANCE]]
    }

    /// A place with parameters beyond its patch, expressed in the patch where it lies.
    #[inline]
    fn settle(&self, patch: [usize; 2], s: f64, t: f64) -> Place {
        if self.interpolation == Interpolation::Facets || (0.0 <= s && s < 1.0 && 0.0 <= t && t < 1.0) {
            return Place { patch, s, t };
        }
        let [p, q] = patch.map(super::real);
        let whole = super::real(self.around);
        let mut column = p + s.floor();
        if self.closure == Closure::Smooth {
            column -= whole * (column / whole).floor();
        }
        let column = column.clamp(0.0, whole - 1.0);
        let ring = (q + t.floor()).clamp(0.0, super::real(self.along - 2));
        let s = match self.closure {
            Closure::Smooth => s - s.floor(),
            Closure::FreeEnds => s - (column - p),
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the patches")]
        let patch = [column as usize, ring as usize];
        Place { patch, s, t: t - (ring - q) }
    }

    /// Minimum of f on the sheet of `start`.
    fn descend(&self, x: [f64; 3], start: Place) -> Option<Foot> {
        let rounding = ROUNDING * dot(x, x).sqrt();
        let longest = (0.125 * super::real(self.around)).max(1.0);
        let mut foot = Foot::at(self, x, start);
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

    /// The first of the halved steps that lowers f enough (Armijo's condition on the projected step).
    #[inline]
    fn search_line(&self, x: [f64; 3], from: &Foot, step: [f64; 2], room: &Room, rounding: f64) -> Option<Foot> {
        let mut factor = 1.0;
        for _ in 0..MAX_HALVINGS {
            let s = (from.place.s + factor * step[0]).clamp(room[0][0], room[0][1]);
            let t = (from.place.t + factor * step[1]).clamp(room[1][0], room[1][1]);
            let foot = Foot::at(self, x, self.settle(from.place.patch, s, t));
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

    /// The closest of the minima of this sheet and, where a crease is near, of those beside it.
    ///
    /// A sheet across a crease at the distance b along this one can only hold a closer point if b < |r| tan(φ/2) for a
    /// fold of angle φ: b ≤ 2|r| covers folds up to 126°.
    fn search_sheets(&self, x: [f64; 3], start: Foot) -> Option<Foot> {
        let rounding = ROUNDING * dot(x, x).sqrt();
        let mut best = start;
        // Every round lowers f, and a start on the opposite side has half the facets to walk over.
        for _ in 0..self.around + self.along {
            let from = best;
            for sides in NEIGHBOURS {
                let Some(place) = self.across(&from, sides) else { continue };
                let candidate = self.descend(x, place)?;
                if candidate.half_square < best.half_square - noise(&best, rounding) {
                    best = candidate;
                }
            }
            if best.place == from.place {
                return Some(self.face_squarely(x, best));
            }
        }
        None
    }

    /// The place across the creases on these sides, where they are near.
    fn across(&self, foot: &Foot, sides: [i8; 2]) -> Option<Place> {
        let (room, [length_s, _, length_t]) = (self.room(foot.place), foot.metric());
        let Place { patch: [p, q], s, t } = foot.place;
        let near = |side: i8, position: f64, [low, high]: [f64; 2], length: f64| {
            let distance = if side < 0 { position - low } else { high - position };
            side == 0 || distance * distance * length <= 8.0 * foot.half_square || distance <= 0.0
        };
        if !(near(sides[0], s, room[0], length_s) && near(sides[1], t, room[1], length_t)) {
            return None;
        }
        let (column, s) = match (sides[0], self.interpolation) {
            (0, _) => (p, s),
            (-1, Interpolation::Facets) => ((p + self.around - 1) % self.around, 1.0),
            (-1, Interpolation::Spline) => (self.around - 1, 1.0),
            (_, Interpolation::Facets) => ((p + 1) % self.around, 0.0),
            (_, Interpolation::Spline) => (0, 0.0),
        };
        let (ring, t) = match sides[1] {
            0 => (q, t),
            -1 if self.interpolation == Interpolation::Facets && q > 0 => (q - 1, 1.0),
            1 if self.interpolation == Interpolation::Facets && q + 2 < self.along => (q + 1, 0.0),
            _ => return None,
        };
        Some(Place { patch: [column, ring], s, t: if sides[0] == 0 { t } else { t.clamp(0.0, 1.0) } })
    }

    /// On a crease, the sheet whose normal is nearest to the direction of the node.
    fn face_squarely(&self, x: [f64; 3], foot: Foot) -> Foot {
        let mut best = foot;
        let squareness = |foot: &Foot| dot(foot.residual, foot.normal()).abs();
        for sides in NEIGHBOURS {
            let stays = |axis: usize| match (sides[axis], foot.held[axis]) {
                (0, _) | (-1, Held::Low) | (1, Held::High) => true,
                _ => false,
            };
            if !(stays(0) && stays(1)) {
                continue;
            }
            let Some(place) = self.across(&foot, sides) else { continue };
            let held = std::array::from_fn(|axis| if sides[axis] == 0 { foot.held[axis] } else { Held::No });
            let candidate = Foot { held, ..Foot::at(self, x, place) };
            if squareness(&candidate) > squareness(&best) {
                best = candidate;
            }
        }
        best
    }
}

/// The eight sheets around one.
const NEIGHBOURS: [[i8; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, -1], [-1, 1], [1, 1]];

/// Rounding error of ½|x − S|² for an error of the coordinates.
fn noise(foot: &Foot, rounding: f64) -> f64 {
    rounding * ((2.0 * foot.half_square).sqrt() + rounding)
}
