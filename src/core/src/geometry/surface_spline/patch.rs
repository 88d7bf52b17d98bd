//! One patch: point, derivatives, and the weights of the control points.

use super::{ClosestPoint, Ends, SurfaceSpline};
use crate::math::octet::Numbers;
use crate::math::vector::Vector3;
use crate::scene::settings::Interpolation;

/// Point and derivatives with respect to the parameters of the patch (all in m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluation {
    /// S.
    pub point: Vector3,
    /// ∂S/∂s, around.
    pub d_s: Vector3,
    /// ∂S/∂t, along the axis.
    pub d_t: Vector3,
    /// ∂²S/∂s².
    pub d_ss: Vector3,
    /// ∂²S/∂s∂t.
    pub d_st: Vector3,
    /// ∂²S/∂t².
    pub d_tt: Vector3,
}

/// Control points that influence a place: S = Σ `values[k]` · Q of `indices[k]`, k < `len`, for every Q.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Control points, each at most once.
    pub indices: [u32; 16],
    /// Their weights; the sum is 1.
    pub values: [f64; 16],
    /// Number of control points: 16 inside, 12 or fewer next to a free end, 4 on a facet.
    pub len: usize,
}

impl Weights {
    /// Iterates over pairs of control point and weight.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.indices[..self.len].iter().zip(&self.values).map(|(index, value)| (*index as usize, *value))
    }
}

/// Basis functions of the control points −1..=2 of a direction: values, first and second derivatives.
pub(super) type SplineBasis<N> = [[N; 4]; 3];

const SIXTH: f64 = 1.0 / 6.0;

/// Evaluates the columns of (s³, s², s, 1) H and their derivatives.
#[inline(always)]
pub(super) fn cubic<N: Numbers>(s: N) -> SplineBasis<N> {
    let n = N::from_number;
    let (one, two, sixth) = (n(1.0), n(2.0), n(SIXTH));
    let r = one - s;
    let (ss, rr) = (s * s, r * r);
    let middle = |square: N, s: N| n(2.0 / 3.0) - square * (one - n(0.5) * s);
    [
        [rr * r * sixth, middle(ss, s), middle(rr, r), ss * s * sixth],
        [n(-0.5) * rr, s * (n(1.5) * s - two), r * (two - n(1.5) * r), n(0.5) * ss],
        [r, n(3.0) * s - two, n(3.0) * r - two, s],
    ]
}

/// Evaluates [`cubic`] along the axis at t; `edge` is t clamped to [0, 1]. Beyond this range the surface continues along its tangent, S(s, t) =
/// S(s, 1) + (t − 1) S_t(s, 1). At a free edge, the only end of a patch of this kind, S_tt = 0: the surface stays twice continuously differentiable.
#[inline(always)]
pub(super) fn cubic_and_beyond<N: Numbers>(t: N, edge: N) -> SplineBasis<N> {
    let mut basis = cubic(edge);
    let [values, slopes, _] = &mut basis;
    for i in 0..4 {
        values[i] = values[i] + (t - edge) * slopes[i];
    }
    basis
}

/// Evaluates [`cubic_and_beyond`] at a single t.
#[inline(always)]
fn along_axis(t: f64) -> SplineBasis<f64> {
    cubic_and_beyond(t, t.clamp(0.0, 1.0))
}

/// Σ weight · point.
#[inline(always)]
fn combine(weights: &[f64; 4], points: &[[f64; 4]; 4]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for i in 0..4 {
        sum[i] = (weights[0] * points[0][i] + weights[1] * points[1][i])
            + (weights[2] * points[2][i] + weights[3] * points[3][i]);
    }
    sum
}

#[inline(always)]
fn sum_of_three(value: [f64; 4]) -> Vector3 {
    Vector3::new(value[0], value[1], value[2])
}

/// Independent control points that replace a window of four in one direction, with their weights.
#[derive(Default)]
struct Fold {
    indices: [usize; 4],
    values: [f64; 4],
    len: usize,
}

impl Fold {
    fn add(&mut self, index: usize, value: f64) {
        let known = self.indices[..self.len].iter().position(|candidate| *candidate == index);
        let slot = known.unwrap_or(self.len);
        self.len = self.len.max(slot + 1);
        self.indices[slot] = index;
        self.values[slot] += value;
    }

    /// Adds a phantom: twice the end minus its neighbour.
    fn add_phantom(&mut self, end: usize, inner: usize, value: f64) {
        self.add(end, 2.0 * value);
        self.add(inner, -value);
    }
}

impl SurfaceSpline {
    /// Evaluates point and derivatives at a place.
    ///
    /// # Panics
    /// If the patch does not exist.
    #[inline]
    pub fn evaluate(&self, place: ClosestPoint) -> Evaluation {
        match self.interpolation {
            Interpolation::Spline => self.evaluate_bicubic::<true>(place),
            Interpolation::Facets => self.evaluate_bilinear(place),
        }
    }

    #[inline(always)]
    pub(super) fn assert_exists(&self, place: ClosestPoint) {
        assert!(self.has_patch(place), "no such patch");
    }

    /// Evaluates a bicubic patch; without `SECOND` the second derivatives stay zero.
    #[inline(always)]
    pub(super) fn evaluate_bicubic<const SECOND: bool>(&self, place: ClosestPoint) -> Evaluation {
        self.assert_exists(place);
        self.blend::<SECOND>(place.patch, &cubic(place.s), &along_axis(place.t))
    }

    /// Evaluates a bicubic patch from the basis functions; without `SECOND` the second derivatives stay zero.
    #[inline(always)]
    pub(super) fn blend<const SECOND: bool>(
        &self,
        [p, q]: [usize; 2],
        around: &SplineBasis<f64>,
        along: &SplineBasis<f64>,
    ) -> Evaluation {
        let width = self.around + 3;
        let orders = if SECOND { 3 } else { 2 };
        let mut rows = [[[0.0; 4]; 4]; 3];
        for ring in 0..4 {
            let start = (q + ring) * width + p;
            let window = self.mesh[start..].first_chunk().expect("the mesh has three more columns than patches");
            for order in 0..orders {
                rows[order][ring] = combine(&around[order], window);
            }
        }
        let sum = |t: usize, s: usize| sum_of_three(combine(&along[t], &rows[s]));
        let second = |t: usize, s: usize| if SECOND { sum(t, s) } else { Vector3::zeros() };
        Evaluation {
            point: sum(0, 0),
            d_s: sum(0, 1),
            d_t: sum(1, 0),
            d_ss: second(0, 2),
            d_st: second(1, 1),
            d_tt: second(2, 0),
        }
    }

    fn evaluate_bilinear(&self, place: ClosestPoint) -> Evaluation {
        let (width, s, t) = (self.around + 3, place.s, place.t);
        self.assert_exists(place);
        let start = (place.patch[1] + 1) * width + place.patch[0] + 1;
        let at = |slot: usize| sum_of_three(self.mesh[start + slot]);
        let (a, b, c, d) = (at(0), at(1), at(width), at(width + 1));
        let r = 1.0 - s;
        Evaluation {
            point: (1.0 - t) * (r * a + s * b) + t * (r * c + s * d),
            d_s: (1.0 - t) * (b - a) + t * (d - c),
            d_t: r * (c - a) + s * (d - b),
            d_ss: Vector3::zeros(),
            d_st: (d - c) - (b - a),
            d_tt: Vector3::zeros(),
        }
    }

    /// Returns the weights of the control points at a place: the derivative of S with respect to Q.
    ///
    /// # Panics
    /// If the patch does not exist.
    pub fn weights(&self, place: ClosestPoint) -> Weights {
        self.assert_exists(place);
        let (around, along) = match self.interpolation {
            Interpolation::Spline => (self.fold_around(place), self.fold_along(place)),
            Interpolation::Facets => self.fold_facet(place),
        };
        let mut weights = Weights { indices: [0; 16], values: [0.0; 16], len: 0 };
        for (ring, factor) in along.indices[..along.len].iter().zip(along.values) {
            for (column, value) in around.indices[..around.len].iter().zip(around.values) {
                #[expect(clippy::cast_possible_truncation, reason = "`new` refuses grids beyond u32")]
                let index = (ring * self.around + column) as u32;
                weights.indices[weights.len] = index;
                weights.values[weights.len] = factor * value;
                weights.len += 1;
            }
        }
        weights
    }

    fn fold_around(&self, place: ClosestPoint) -> Fold {
        let (count, p, values) = (self.around, place.patch[0], cubic(place.s)[0]);
        if self.ends == Ends::Smooth {
            let wrapped = |index: usize| if index < count { index } else { index - count };
            let indices = [0, 1, 2, 3].map(|offset| wrapped(p + offset + count - 1));
            return Fold { indices: indices.map(wrapped), values, len: 4 };
        }
        let mut fold = Fold::default();
        for (offset, value) in values.into_iter().enumerate() {
            // Control point p + offset − 1.
            match (self.ends, p + offset) {
                (Ends::Meeting | Ends::Open, 0) => fold.add_phantom(0, 1, value),
                (Ends::Meeting, slot) if slot == count + 2 => fold.add_phantom(0, count - 1, value),
                (Ends::Open, slot) if slot == count + 1 => fold.add_phantom(count - 1, count - 2, value),
                (_, slot) => fold.add((slot + count - 1) % count, value),
            }
        }
        fold
    }

    fn fold_along(&self, place: ClosestPoint) -> Fold {
        let (count, q, [a, b, c, d]) = (self.along, place.patch[1], along_axis(place.t)[0]);
        // A phantom beyond a free end is twice the end minus its neighbour.
        let (first, values, len) = match (q == 0, q + 2 == count) {
            (false, false) => (q - 1, [a, b, c, d], 4),
            (true, false) => (0, [2.0 * a + b, c - a, d, 0.0], 3),
            (false, true) => (q - 1, [a, b - d, c + 2.0 * d, 0.0], 3),
            (true, true) => (0, [2.0 * a + b - d, c - a + 2.0 * d, 0.0, 0.0], 2),
        };
        Fold { indices: [first, first + 1, first + 2, first + 3], values, len }
    }

    fn fold_facet(&self, place: ClosestPoint) -> (Fold, Fold) {
        let [p, q] = place.patch;
        let (mut around, mut along) = (Fold::default(), Fold::default());
        around.add(p, 1.0 - place.s);
        around.add((p + 1) % self.around, place.s);
        along.add(q, 1.0 - place.t);
        along.add(q + 1, place.t);
        (around, along)
    }
}
