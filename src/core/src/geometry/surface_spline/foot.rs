//! A point of the surface as seen from a node, and the step towards the closest one.
//!
//! f = ½|x − S|², r = x − S: gradient −(S_s·r, S_t·r), Hessian [S_s·S_s − r·S_ss, S_s·S_t − r·S_st; …].

use super::{ClosestPoint, Evaluation, Projection, SurfaceSpline};
use crate::geometry::Gap;
use crate::math::octet::Numbers;
use crate::math::vector::{Vector3, length};

/// The surface is degenerate if its tangents are closer to parallel than this (squared sine).
pub(super) const DEGENERATE: f64 = 1e-24;
/// Newton steps are not trusted if the curvature of f, relative to that for a plane, is below this.
pub(super) const CONVEX: f64 = 1e-3;

/// Gauss-Newton steps below this (in patches) count as zero if f is not convex, as at the top of a hill.
const STATIONARY: f64 = 1e-9;

/// Bound of a sheet at which a coordinate is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HeldBound {
    No,
    Low,
    High,
}

/// A point of the surface relative to the node.
#[derive(Clone, Copy)]
pub(super) struct FootPoint {
    pub place: ClosestPoint,
    pub evaluation: Evaluation,
    /// x − S.
    pub residual: Vector3,
    /// ½|x − S|².
    pub half_square: f64,
    pub held: [HeldBound; 2],
}

/// Range of the parameters of a patch that lies on the same smooth sheet, [[low, high] of s, of t].
pub(super) type Room = [[f64; 2]; 2];

impl FootPoint {
    pub fn at(surface: &SurfaceSpline, x: Vector3, place: ClosestPoint) -> Self {
        Self::seen(x, place, surface.evaluate(place))
    }

    #[inline(always)]
    pub fn seen(x: Vector3, place: ClosestPoint, evaluation: Evaluation) -> Self {
        let residual = x - evaluation.point;
        Self { place, evaluation, residual, half_square: 0.5 * residual.dot(&residual), held: [HeldBound::No; 2] }
    }

    #[inline(always)]
    pub fn gradient(&self) -> [f64; 2] {
        [-self.residual.dot(&self.evaluation.d_s), -self.residual.dot(&self.evaluation.d_t)]
    }

    /// First fundamental form [S_s·S_s, S_s·S_t, S_t·S_t].
    #[inline(always)]
    pub(crate) fn metric(&self) -> [f64; 3] {
        let Evaluation { d_s, d_t, .. } = &self.evaluation;
        [d_s.dot(d_s), d_s.dot(d_t), d_t.dot(d_t)]
    }

    /// Second derivatives of f [ss, st, tt] and their determinant.
    #[inline(always)]
    pub(crate) fn hessian(&self, metric: [f64; 3]) -> ([f64; 3], f64) {
        let Evaluation { d_ss, d_st, d_tt, .. } = &self.evaluation;
        let bend = [d_ss, d_st, d_tt].map(|second| self.residual.dot(second));
        let hessian: [f64; 3] = std::array::from_fn(|i| metric[i] - bend[i]);
        (hessian, hessian[0] * hessian[2] - hessian[1] * hessian[1])
    }

    /// Derivative of f along a step.
    pub fn slope(&self, step: [f64; 2]) -> f64 {
        let gradient = self.gradient();
        gradient[0] * step[0] + gradient[1] * step[1]
    }

    /// Returns the Newton step on the coordinates that are not held; `None` if the surface is degenerate.
    #[inline]
    pub(crate) fn newton_step(&mut self, room: &Room, metric: [f64; 3]) -> Option<[f64; 2]> {
        let gradient = self.gradient();
        let (hessian, determinant) = self.hessian(metric);
        let area = metric[0] * metric[2] - metric[1] * metric[1];
        // NaN counts as degenerate.
        let is_regular = area > DEGENERATE * metric[0] * metric[2];
        if !is_regular {
            return None;
        }
        let position = [self.place.s, self.place.t];
        for axis in 0..2 {
            self.held[axis] = if position[axis] <= room[axis][0] && gradient[axis] > 0.0 {
                HeldBound::Low
            } else if position[axis] >= room[axis][1] && gradient[axis] < 0.0 {
                HeldBound::High
            } else {
                HeldBound::No
            };
        }
        let alone = |axis: usize| {
            let (curvature, length) = (hessian[2 * axis], metric[2 * axis]);
            let mut step = [0.0; 2];
            step[axis] = -gradient[axis] / if curvature > CONVEX * length { curvature } else { length };
            if curvature < 0.0 && step[axis].abs() < STATIONARY {
                step[axis] = if position[axis] + 0.5 > room[axis][1] { -0.5 } else { 0.5 };
            }
            step
        };
        match self.held.map(|held| held == HeldBound::No) {
            [false, false] => return Some([0.0; 2]),
            [true, false] => return Some(alone(0)),
            [false, true] => return Some(alone(1)),
            [true, true] => {}
        }
        let is_convex = hessian[0] > 0.0 && determinant > CONVEX * area;
        if !is_convex && let Some(step) = escape(gradient, hessian, metric, determinant) {
            // A sheet is at least one patch wide: half a patch fits on one side.
            let leads_out = |axis: usize| position[axis] + step[axis] > room[axis][1];
            return Some(if leads_out(0) || leads_out(1) { step.map(|value| -value) } else { step });
        }
        let step =
            if is_convex { solve(hessian, 1.0 / determinant, gradient) } else { solve(metric, 1.0 / area, gradient) };
        // The other coordinate may push this one over a bound that it would leave inwards by itself.
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
    pub fn normal(&self) -> Vector3 {
        let across = self.evaluation.d_t.cross(&self.evaluation.d_s);
        across * (1.0 / length(across))
    }

    #[inline]
    pub fn found(&self) -> Projection {
        let normal = self.normal();
        let gap = Gap { distance: self.residual.dot(&normal), normal, foot: self.place };
        Projection::Found { gap, point: self.evaluation.point }
    }
}

/// −matrix⁻¹ gradient.
#[inline(always)]
pub(super) fn solve<N: Numbers>([a, b, c]: [N; 3], per_determinant: N, gradient: [N; 2]) -> [N; 2] {
    [(b * gradient[1] - c * gradient[0]) * per_determinant, (b * gradient[0] - a * gradient[1]) * per_determinant]
}

/// Returns half a patch along the lowest curvature, for a maximum or a saddle of f, where the gradient vanishes.
fn escape(gradient: [f64; 2], hessian: [f64; 3], metric: [f64; 3], determinant: f64) -> Option<[f64; 2]> {
    let size = gradient[0] * gradient[0] * metric[2] + gradient[1] * gradient[1] * metric[0];
    let [a, b, c] = hessian;
    let leads_down = a < 0.0 || c < 0.0 || determinant < 0.0;
    if size > STATIONARY * STATIONARY * metric[0] * metric[0] * metric[2] || !leads_down {
        return None;
    }
    let lowest = 0.5 * (a + c) - libm::hypot(0.5 * (a - c), b);
    let step = if lowest < c { [c - lowest, -b] } else { [0.0, 1.0] };
    let largest = step[0].abs().max(step[1].abs());
    Some(step.map(|value| 0.5 * value / largest))
}

/// Rounding error of ½|x − S|² for an error of the coordinates.
pub(super) fn noise(foot: &FootPoint, rounding: f64) -> f64 {
    rounding * ((2.0 * foot.half_square).sqrt() + rounding)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All signs of the second derivatives, zeros included: half a patch along a descending direction, if there is one.
    #[test]
    fn escape_descends_from_maxima_and_saddles_only() {
        let metric = [2.0, 0.3, 0.7];
        let values = [-3.0, -0.4, 0.0, 0.4, 3.0];
        let all = values.iter().flat_map(|a| values.iter().flat_map(move |b| values.map(|c| [*a, *b, c])));
        for hessian @ [a, b, c] in all {
            let determinant = a * c - b * b;
            let step = escape([1e-12, -1e-12], hessian, metric, determinant);
            let leads_down = a < 0.0 || c < 0.0 || determinant < 0.0;
            assert_eq!(step.is_some(), leads_down, "{hessian:?}");
            if let Some([s, t]) = step {
                let bend = a * s * s + 2.0 * b * s * t + c * t * t;
                assert!(bend < 0.0 && (s.abs().max(t.abs()) - 0.5).abs() < 1e-15, "{hessian:?}: {s}, {t}, {bend}");
            }
            assert_eq!(escape([1e-3, 0.0], hessian, metric, determinant), None, "{hessian:?} on a slope");
        }
    }
}
