//! Closest points near good guesses by one Newton step, for one node or for eight nodes together.
//!
//! The end of the step is extrapolated to second order instead of evaluated. See [`super::projection`] for gradient and Hessian.

use super::foot::{CONVEX, DEGENERATE, solve};
use super::patch::{SplineBasis, cubic, cubic_and_beyond};
use super::{ClosestPoint, Evaluation, SurfaceSpline};
use crate::geometry::Gap;
use crate::math::octet::{Eight, Numbers, Octet};
use crate::math::vector::Vector3;

/// Longest Newton step whose end is used as the next guess (in patches).
const LONGEST_STEP: f64 = 0.5;

/// Coordinates of a vector, or of eight vectors.
type Vectors<N> = [N; 3];

/// Point and derivatives of the surface (see [`Evaluation`]).
#[derive(Clone, Copy)]
struct SurfaceDerivatives<N> {
    point: Vectors<N>,
    d_s: Vectors<N>,
    d_t: Vectors<N>,
    d_ss: Vectors<N>,
    d_st: Vectors<N>,
    d_tt: Vectors<N>,
}

impl From<Evaluation> for SurfaceDerivatives<f64> {
    #[inline(always)]
    fn from(Evaluation { point, d_s, d_t, d_ss, d_st, d_tt }: Evaluation) -> Self {
        let [point, d_s, d_t, d_ss, d_st, d_tt] = [point, d_s, d_t, d_ss, d_st, d_tt].map(Into::into);
        Self { point, d_s, d_t, d_ss, d_st, d_tt }
    }
}

/// End of a Newton step.
struct StepEnd<N> {
    /// The step is valid if `area` (squared, m⁴) exceeds `min_area`, the first entry of the Hessian (`curvature`, m²) exceeds 0, and its
    /// `determinant` (m⁴) exceeds `min_determinant`.
    area: N,
    min_area: N,
    curvature: N,
    determinant: N,
    min_determinant: N,
    /// Step around and along (in patches).
    step: [N; 2],
    /// Distance from the surface along the normal at the end of the step (m).
    distance: N,
    normal: Vectors<N>,
}

#[inline(always)]
fn dot<N: Numbers>(a: Vectors<N>, b: Vectors<N>) -> N {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn add<N: Numbers>(a: Vectors<N>, b: Vectors<N>) -> Vectors<N> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn subtract<N: Numbers>(a: Vectors<N>, b: Vectors<N>) -> Vectors<N> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn scaled<N: Numbers>(factor: N, a: Vectors<N>) -> Vectors<N> {
    [factor * a[0], factor * a[1], factor * a[2]]
}

/// Takes a Newton step towards the closest point to `x` from a place where the surface has these derivatives.
#[inline(always)]
fn newton_step<N: Numbers>(x: Vectors<N>, surface: SurfaceDerivatives<N>) -> StepEnd<N> {
    let SurfaceDerivatives { point, d_s, d_t, d_ss, d_st, d_tt } = surface;
    let n = N::from_number;
    let residual = subtract(x, point);
    let metric = [dot(d_s, d_s), dot(d_s, d_t), dot(d_t, d_t)];
    let hessian = [metric[0] - dot(residual, d_ss), metric[1] - dot(residual, d_st), metric[2] - dot(residual, d_tt)];
    let determinant = hessian[0] * hessian[2] - hessian[1] * hessian[1];
    let area = metric[0] * metric[2] - metric[1] * metric[1];
    let gradient = [n(0.0) - dot(residual, d_s), n(0.0) - dot(residual, d_t)];
    let [s, t] = solve(hessian, n(1.0) / determinant, gradient);
    let half = n(0.5);
    let around = add(add(d_s, scaled(half * s, d_ss)), scaled(t, d_st));
    let moved = add(scaled(s, around), scaled(t, add(d_t, scaled(half * t, d_tt))));
    let tangent_t = add(add(d_t, scaled(s, d_st)), scaled(t, d_tt));
    let tangent_s = add(add(d_s, scaled(s, d_ss)), scaled(t, d_st));
    let across = [
        tangent_t[1] * tangent_s[2] - tangent_t[2] * tangent_s[1],
        tangent_t[2] * tangent_s[0] - tangent_t[0] * tangent_s[2],
        tangent_t[0] * tangent_s[1] - tangent_t[1] * tangent_s[0],
    ];
    let normal = scaled(n(1.0) / dot(across, across).square_root(), across);
    StepEnd {
        area,
        min_area: n(DEGENERATE) * metric[0] * metric[2],
        curvature: hessian[0],
        determinant,
        min_determinant: n(CONVEX) * area,
        step: [s, t],
        distance: dot(subtract(x, add(point, moved)), normal),
        normal,
    }
}

/// Up to eight nodes and guesses of their closest points.
pub(crate) struct EightNodes {
    /// Positions (m).
    pub x: [Eight; 3],
    /// Guesses of the closest points; the patches of the first `count` must exist.
    pub guesses: [ClosestPoint; 8],
    /// Number of nodes. The results of other entries have no meaning.
    pub count: usize,
}

/// Gaps of eight nodes.
pub(crate) struct EightGaps {
    /// Mask of the nodes whose closest points were found; `distances` and `normals` are valid for these only.
    pub found: u8,
    /// Mask of the nodes with a valid step of at most [`LONGEST_STEP`], including those in `found`; `s` and `t` are valid for these only.
    pub near: u8,
    /// Distances (m).
    pub distances: [f64; 8],
    /// Unit normals.
    pub normals: [[f64; 8]; 3],
    /// Parameters of the ends of the steps, in the patches of the guesses.
    pub s: [f64; 8],
    pub t: [f64; 8],
}

impl EightGaps {
    /// Returns the gap of a node, whose guess was `guess`, if its closest point was found.
    #[inline(always)]
    pub fn gap(&self, node: usize, guess: ClosestPoint) -> Option<Gap> {
        let normal = self.normals.each_ref().map(|normals| normals[node]).into();
        let foot = self.end(node, guess);
        (self.found >> node & 1 == 1).then_some(Gap { distance: self.distances[node], normal, foot })
    }

    /// Returns the end of the step of a node, whose guess was `guess`.
    #[inline(always)]
    pub fn end(&self, node: usize, guess: ClosestPoint) -> ClosestPoint {
        ClosestPoint { s: self.s[node], t: self.t[node], ..guess }
    }
}

impl SurfaceSpline {
    /// Finds the closest point to `x` (m) on a smooth surface around an axis, by one Newton step from `guess`.
    ///
    /// # Errors
    /// Returns the end of the step, in the patch that contains it, if the step is longer than `longest` (in patches) or leaves the patch of the
    /// guess. Returns `None` if the step is longer than [`LONGEST_STEP`], the surface is degenerate, the Hessian is not positive definite, or a
    /// coordinate is NaN.
    #[inline(always)]
    pub(crate) fn project_close(
        &self,
        x: Vector3,
        guess: ClosestPoint,
        longest: f64,
    ) -> Result<Gap, Option<ClosestPoint>> {
        let end = newton_step(x.into(), self.evaluate_bicubic::<true>(guess).into());
        let is_regular = end.area > end.min_area && end.curvature > 0.0 && end.determinant > end.min_determinant;
        if !is_regular {
            return Err(None);
        }
        let [s, t] = end.step;
        let ([low, high], place) =
            (self.span(guess.patch[1]), ClosestPoint { s: guess.s + s, t: guess.t + t, ..guess });
        let stays = (0.0..1.0).contains(&place.s) && (low..high).contains(&place.t);
        if !(stays && s.abs() <= longest && t.abs() <= longest) {
            let is_near = s.abs() <= LONGEST_STEP && t.abs() <= LONGEST_STEP;
            return Err(is_near.then(|| self.settle(place)));
        }
        Ok(Gap { distance: end.distance, normal: end.normal.into(), foot: place })
    }

    /// Takes the Newton step of [`SurfaceSpline::project_close`] for up to eight nodes, with the same bits. Ends of rejected steps stay in the
    /// patches of the guesses.
    ///
    /// # Panics
    /// If the patch of a guess does not exist.
    #[inline(always)]
    pub(crate) fn project_eight<L: Octet>(&self, nodes: &EightNodes, longest: f64) -> EightGaps {
        let EightNodes { x, guesses, count } = nodes;
        let mut guess = [Eight::ZERO; 2];
        let mut ends = [Eight::ZERO; 2];
        for (node, place) in guesses.iter().enumerate() {
            (guess[0].0[node], guess[1].0[node]) = (place.s, place.t);
            (ends[0].0[node], ends[1].0[node]) = self.span(place.patch[1]).into();
        }
        let [start_s, start_t] = [L::load(&guess[0]), L::load(&guess[1])];
        let (zero, one, longest) = (L::zero(), L::splat(1.0), L::splat(longest));
        let bases = [store_basis(cubic(start_s)), store_basis(cubic_and_beyond(start_t, start_t.max(zero).min(one)))];
        let mut columns = [[Eight::ZERO; 3]; 6];
        for (node, place) in guesses[..*count].iter().enumerate() {
            self.assert_exists(*place);
            let [around, along] = [node_basis(&bases[0], node), node_basis(&bases[1], node)];
            let Evaluation { point, d_s, d_t, d_ss, d_st, d_tt } = self.blend::<true>(place.patch, &around, &along);
            for (column, vector) in columns.iter_mut().zip([point, d_s, d_t, d_ss, d_st, d_tt]) {
                for component in 0..3 {
                    column[component].0[node] = vector[component];
                }
            }
        }
        let vectors = |of: &[Eight; 3]| [L::load(&of[0]), L::load(&of[1]), L::load(&of[2])];
        let [point, d_s, d_t, d_ss, d_st, d_tt] = &columns;
        let end = newton_step(
            vectors(x),
            SurfaceDerivatives {
                point: vectors(point),
                d_s: vectors(d_s),
                d_t: vectors(d_t),
                d_ss: vectors(d_ss),
                d_st: vectors(d_st),
                d_tt: vectors(d_tt),
            },
        );
        let [step_s, step_t] = end.step;
        let (s, t, low, high) = (start_s + step_s, start_t + step_t, L::load(&ends[0]), L::load(&ends[1]));
        let is_regular =
            end.min_area.less(end.area) & zero.less(end.curvature) & end.min_determinant.less(end.determinant);
        let stays = s.less(one) & !s.less(zero) & t.less(high) & !t.less(low);
        let within = |limit: L| !limit.less(step_s.abs()) & !limit.less(step_t.abs());
        EightGaps {
            found: is_regular & stays & within(longest),
            near: is_regular & within(L::splat(LONGEST_STEP)),
            distances: end.distance.array(),
            normals: [end.normal[0].array(), end.normal[1].array(), end.normal[2].array()],
            s: s.array(),
            t: t.array(),
        }
    }
}

/// Writes basis functions of eight nodes to memory.
#[inline(always)]
fn store_basis<L: Octet>(basis: SplineBasis<L>) -> [[Eight; 4]; 3] {
    let mut out = [[Eight::ZERO; 4]; 3];
    for order in 0..3 {
        for i in 0..4 {
            basis[order][i].store(&mut out[order][i]);
        }
    }
    out
}

/// Basis functions of one of eight nodes.
#[inline(always)]
fn node_basis(basis: &[[Eight; 4]; 3], node: usize) -> SplineBasis<f64> {
    let mut out = [[0.0; 4]; 3];
    for order in 0..3 {
        for i in 0..4 {
            out[order][i] = basis[order][i].0[node];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::octet::OctetKernel;
    use crate::math::simd::InstructionSet;
    use crate::scene::settings::{Closure, Interpolation};
    use tiprub_test_models::SeededRandom;

    struct Search<'a> {
        surface: &'a SurfaceSpline,
        nodes: &'a EightNodes,
        longest: f64,
    }

    impl OctetKernel for Search<'_> {
        type Output = EightGaps;
        fn run<L: Octet>(self) -> EightGaps {
            self.surface.project_eight::<L>(self.nodes, self.longest)
        }
    }

    /// Searching eight nodes together gives the same bits as searching them one by one. Some nodes lie beyond an edge or need steps that are too
    /// long.
    #[test]
    fn eight_node_search_matches_single_searches() {
        let ring = |ring: u32| {
            (0..20).map(move |i| {
                let angle = std::f64::consts::TAU * f64::from(i) / 20.0;
                let (sine, cosine) = libm::sincos(angle);
                let radius = 0.25 + 2e-3 * libm::cos(3.0 * angle) + 1e-3 * f64::from(ring);
                [radius * cosine, radius * sine, 0.01 * f64::from(ring)]
            })
        };
        let points: Vec<[f64; 3]> = (0..4).flat_map(ring).collect();
        let surface = SurfaceSpline::new(&points, 20, 4, Closure::Smooth, Interpolation::Spline).unwrap();
        let mut random = SeededRandom(3);
        let (mut found, mut missed) = (0, 0);
        for case in 0..400 {
            let mut nodes =
                EightNodes { x: [Eight::ZERO; 3], guesses: [ClosestPoint::default(); 8], count: 1 + random.below(8) };
            let count = nodes.count;
            for node in 0..count {
                let patch = [random.below(20), random.below(3)];
                let guess = ClosestPoint { patch, s: random.within(0.0, 1.0), t: random.within(-0.2, 1.2) };
                let near = surface.evaluate(guess).point + Vector3::from(random.vector(1e-4));
                near.iter().zip(&mut nodes.x).for_each(|(value, x)| x.0[node] = *value);
                nodes.guesses[node] = guess;
            }
            if case % 10 == 0 {
                nodes.x[1].0[0] = f64::NAN;
            }
            let search = |instructions: InstructionSet| {
                instructions.run_octets(Search { surface: &surface, nodes: &nodes, longest: 4e-3 })
            };
            let mut instruction_sets = vec![InstructionSet::Baseline, InstructionSet::detect()];
            #[cfg(target_arch = "x86_64")]
            if std::is_x86_feature_detected!("avx2") {
                instruction_sets.push(InstructionSet::Avx2);
            }
            for gaps in instruction_sets.into_iter().map(search) {
                for (node, guess) in nodes.guesses[..count].iter().enumerate() {
                    let x = Vector3::from(nodes.x.map(|x| x.0[node]));
                    let expected = surface.project_close(x, *guess, 4e-3);
                    let [is_found, is_near] = [gaps.found, gaps.near].map(|mask| mask >> node & 1 == 1);
                    assert_eq!(is_found, expected.is_ok(), "{guess:?}: {expected:?}");
                    let Ok(Gap { distance, normal, foot }) = expected else {
                        missed += 1;
                        let next = ClosestPoint { s: gaps.s[node], t: gaps.t[node], ..*guess };
                        assert_eq!(Err(is_near.then(|| surface.settle(next))), expected);
                        continue;
                    };
                    found += 1;
                    assert_eq!(gaps.distances[node].to_bits(), distance.to_bits());
                    assert_eq!([gaps.s[node].to_bits(), gaps.t[node].to_bits()], [foot.s.to_bits(), foot.t.to_bits()]);
                    for (own, normal) in gaps.normals.iter().zip(&normal) {
                        assert_eq!(own[node].to_bits(), normal.to_bits());
                    }
                }
            }
        }
        assert!(found > 1000 && missed > 300, "{found} {missed}");
    }
}
