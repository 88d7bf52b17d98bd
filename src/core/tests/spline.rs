//! The surface spline: what it is by definition, exact transfer of forces, and the closest point.

#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

use std::f64::consts::TAU;

use tiprub_core::contact::gap::dot;
use tiprub_core::contact::spline::{Evaluation, Place, Projection, SurfaceSpline};
use tiprub_core::settings::{Closure, Interpolation};

#[path = "../examples/facets_and_spline/sliding.rs"]
mod sliding;

const RADIUS: f64 = 0.25;
const EPS: f64 = f64::EPSILON;

/// Random numbers that are the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn vector(&mut self, size: f64) -> [f64; 3] {
        [(); 3].map(|()| self.within(-size, size))
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.next() * count as f64) as usize).min(count - 1)
    }

    fn place(&mut self, surface: &SurfaceSpline) -> Place {
        Place { patch: [self.below(surface.around()), self.below(surface.along() - 1)], s: self.next(), t: self.next() }
    }
}

/// Rings of a casing, unevenly spaced in z, from a radius r(θ, z).
fn data(around: usize, along: usize, radius: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
    let axial = |ring: usize| {
        let x = ring as f64 / (along - 1) as f64;
        -0.03 + 0.06 * (x + 0.08 * (TAU * x).sin())
    };
    (0..around * along)
        .map(|index| {
            let (angle, z) = (0.3 + TAU * (index % around) as f64 / around as f64, axial(index / around));
            let r = radius(angle, z);
            [r * angle.cos(), r * angle.sin(), z]
        })
        .collect()
}

type Casing = fn(f64, f64) -> f64;

fn round(_angle: f64, _z: f64) -> f64 {
    RADIUS
}

fn conical(_angle: f64, z: f64) -> f64 {
    RADIUS - 0.3 * z
}

fn lobed(angle: f64, z: f64) -> f64 {
    RADIUS - 0.2 * z - 1.5e-3 * (3.0 * angle + 10.0 * z).cos() + 2.0 * z * z
}

/// A casing with random dents of 20 µm.
fn rough(around: usize, along: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = Random(seed);
    let mut points = data(around, along, lobed);
    points.iter_mut().for_each(|point| {
        let dent = random.vector(2e-5);
        *point = std::array::from_fn(|i| point[i] + dent[i]);
    });
    points
}

const KINDS: [(Closure, Interpolation); 3] = [
    (Closure::Smooth, Interpolation::Spline),
    (Closure::FreeEnds, Interpolation::Spline),
    (Closure::Smooth, Interpolation::Facets),
];
const GRIDS: [(usize, usize); 6] = [(4, 2), (5, 3), (7, 4), (36, 5), (72, 2), (144, 9)];

fn every_surface() -> Vec<(SurfaceSpline, Vec<[f64; 3]>)> {
    let mut surfaces = Vec::new();
    for (around, along) in GRIDS {
        for (closure, interpolation) in KINDS {
            let points = rough(around, along, 7 + around as u64);
            surfaces.push((SurfaceSpline::new(&points, around, along, closure, interpolation).unwrap(), points));
        }
    }
    surfaces
}

fn spline(points: &[[f64; 3]], around: usize, along: usize) -> SurfaceSpline {
    SurfaceSpline::new(points, around, along, Closure::Smooth, Interpolation::Spline).unwrap()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let apart: [f64; 3] = std::array::from_fn(|i| a[i] - b[i]);
    dot(apart, apart).sqrt()
}

fn place(p: usize, q: usize, s: f64, t: f64) -> Place {
    Place { patch: [p, q], s, t }
}

/// The larger of two errors and an absolute bound on it, reported when it fails.
#[track_caller]
fn assert_below(name: &str, error: f64, bound: f64) {
    println!("{name}: {error:.2e} (bound {bound:.1e})");
    assert!(error <= bound, "{name}: {error:e} > {bound:e}");
}

#[test]
fn weights_sum_to_one_and_are_the_derivative_of_the_point() {
    let mut random = Random(1);
    let (mut unity, mut derivative): (f64, f64) = (0.0, 0.0);
    for (surface, _) in every_surface() {
        for _ in 0..500 {
            let place = random.place(&surface);
            let weights = surface.weights(place);
            unity = unity.max((weights.values[..weights.len].iter().sum::<f64>() - 1.0).abs());
            let mut sum = [0.0; 3];
            for (index, weight) in weights.iter() {
                sum = std::array::from_fn(|i| sum[i] + weight * surface.control_points()[index][i]);
            }
            derivative = derivative.max(distance(sum, surface.evaluate(place).point) / RADIUS);
            let mut indices = weights.indices[..weights.len].to_vec();
            indices.sort_unstable();
            indices.dedup();
            assert_eq!(indices.len(), weights.len, "a control point appears twice");
        }
    }
    assert_below("partition of unity", unity, 4.0 * EPS);
    assert_below("weights against the point, relative", derivative, 8.0 * EPS);
}

#[test]
fn sixteen_control_points_act_inside_fewer_at_free_ends_and_four_on_a_facet() {
    let points = rough(36, 5, 3);
    let surface = |closure, interpolation| SurfaceSpline::new(&points, 36, 5, closure, interpolation).unwrap();
    let smooth = surface(Closure::Smooth, Interpolation::Spline);
    assert_eq!(smooth.weights(place(0, 1, 0.3, 0.4)).len, 16);
    assert_eq!(smooth.weights(place(35, 3, 0.3, 0.4)).len, 12);
    let free = surface(Closure::FreeEnds, Interpolation::Spline);
    assert_eq!(free.weights(place(0, 1, 0.3, 0.4)).len, 12);
    assert_eq!(free.weights(place(0, 0, 0.3, 0.4)).len, 9);
    assert_eq!(surface(Closure::Smooth, Interpolation::Facets).weights(place(35, 3, 0.3, 0.4)).len, 4);
}

#[test]
fn a_patch_is_the_matrix_form_of_equation_7() {
    let (around, along) = (9, 6);
    let surface = spline(&rough(around, along, 5), around, along);
    let h = [[-1.0, 3.0, -3.0, 1.0], [3.0, -6.0, 3.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [1.0, 4.0, 1.0, 0.0]];
    let basis = |s: f64| {
        let powers = [s * s * s, s * s, s, 1.0];
        [0, 1, 2, 3].map(|column| (0..4).map(|row| powers[row] * h[row][column] / 6.0).sum::<f64>())
    };
    let mut random = Random(2);
    let mut error: f64 = 0.0;
    for _ in 0..2000 {
        let (p, q, s, t) = (random.below(around), 1 + random.below(along - 3), random.next(), random.next());
        let (a, b) = (basis(s), basis(t));
        let mut point = [0.0; 3];
        for i in 0..4 {
            for j in 0..4 {
                let control = surface.control_points()[(q + j - 1) * around + (p + i + around - 1) % around];
                point = std::array::from_fn(|c| point[c] + a[i] * b[j] * control[c]);
            }
        }
        error = error.max(distance(point, surface.evaluate(place(p, q, s, t)).point) / RADIUS);
    }
    assert_below("patch against S H Q Hᵀ Tᵀ, relative", error, 8.0 * EPS);
}

#[test]
fn the_surface_passes_through_its_data() {
    let mut error: f64 = 0.0;
    for (surface, points) in every_surface() {
        let (around, along) = (surface.around(), surface.along());
        for (index, point) in points.iter().enumerate() {
            let (i, ring) = (index % around, index / around);
            for (p, s) in [(i, 0.0), ((i + around - 1) % around, 1.0)] {
                for (q, t) in [(ring, 0.0), (ring.wrapping_sub(1), 1.0)] {
                    if q < along - 1 {
                        error = error.max(distance(surface.evaluate(place(p, q, s, t)).point, *point) / RADIUS);
                    }
                }
            }
        }
    }
    assert_below("interpolation of the data, relative", error, 8.0 * EPS);
}

fn derivatives(evaluation: &Evaluation) -> [[f64; 3]; 6] {
    let Evaluation { point, d_s, d_t, d_ss, d_st, d_tt } = *evaluation;
    [point, d_s, d_t, d_ss, d_st, d_tt]
}

/// Largest difference of point, first and second derivatives between two places, relative to the radius.
fn jumps(surface: &SurfaceSpline, a: Place, b: Place) -> [f64; 3] {
    let (a, b) = (derivatives(&surface.evaluate(a)), derivatives(&surface.evaluate(b)));
    let jump = |from: usize, to: usize| (from..to).map(|i| distance(a[i], b[i])).fold(0.0, f64::max) / RADIUS;
    [jump(0, 1), jump(1, 3), jump(3, 6)]
}

#[test]
fn the_smooth_surface_is_c2_across_every_border_and_the_seam() {
    let mut worst = [0.0_f64; 3];
    for (around, along) in GRIDS {
        let surface = spline(&rough(around, along, 11), around, along);
        for p in 0..around {
            for q in 0..along - 1 {
                for x in [0.0, 0.21, 0.5, 0.83, 1.0] {
                    let sides = jumps(&surface, place(p, q, 1.0, x), place((p + 1) % around, q, 0.0, x));
                    let ends = if q + 2 < along {
                        jumps(&surface, place(p, q, x, 1.0), place(p, q + 1, x, 0.0))
                    } else {
                        [0.0; 3]
                    };
                    worst = std::array::from_fn(|i| worst[i].max(sides[i]).max(ends[i]));
                }
            }
        }
    }
    for (order, error) in worst.into_iter().enumerate() {
        assert_below(&format!("jump of derivatives of order {order}, relative"), error, 16.0 * EPS);
    }
}

#[test]
fn edges_and_free_ends_have_no_second_derivative_and_the_seam_of_free_ends_kinks() {
    let (mut edge, mut seam): (f64, f64) = (0.0, 0.0);
    for (surface, _) in every_surface().into_iter().step_by(3).chain(every_surface().into_iter().skip(1).step_by(3)) {
        let last = surface.along() - 2;
        for p in 0..surface.around() {
            for s in [0.0, 0.4, 0.9] {
                for (q, t) in [(0, 0.0), (last, 1.0)] {
                    let second = surface.evaluate(place(p, q, s, t)).d_tt;
                    edge = edge.max(dot(second, second).sqrt() / RADIUS);
                }
            }
        }
    }
    assert_below("S_tt at the free edges, relative", edge, 8.0 * EPS);
    let points = data(36, 5, lobed);
    let surface = SurfaceSpline::new(&points, 36, 5, Closure::FreeEnds, Interpolation::Spline).unwrap();
    let mut kink: f64 = 0.0;
    for t in [0.0, 0.3, 0.8] {
        let ends = [place(0, 2, 0.0, t), place(35, 2, 1.0, t)];
        let [first, last] = ends.map(|end| surface.evaluate(end));
        seam = seam.max(distance(first.point, last.point) / RADIUS);
        for second in [first.d_ss, last.d_ss] {
            seam = seam.max(dot(second, second).sqrt() / RADIUS);
        }
        let cosine = dot(first.d_s, last.d_s) / (dot(first.d_s, first.d_s) * dot(last.d_s, last.d_s)).sqrt();
        kink = kink.max(cosine.acos());
    }
    assert_below("gap of the seam and S_ss there, free ends, relative", seam, 8.0 * EPS);
    println!("kink of the seam with free ends, 36 points: {:.3}°", kink.to_degrees());
    assert!(kink > 0.01, "free ends do not join smoothly");
}

#[test]
fn derivatives_are_those_of_the_point() {
    let mut random = Random(3);
    for (surface, _) in every_surface() {
        let step = 1e-3;
        let mut worst: f64 = 0.0;
        for _ in 0..100 {
            let at = Place { s: random.within(0.1, 0.9), t: random.within(0.1, 0.9), ..random.place(&surface) };
            let point = |i: f64, j: f64| surface.evaluate(Place { s: at.s + i * step, t: at.t + j * step, ..at }).point;
            // Third derivatives are constant along a parameter: two step sizes leave no truncation error.
            let first = |one: [f64; 3], other: [f64; 3], two: [f64; 3], opposite: [f64; 3]| -> [f64; 3] {
                std::array::from_fn(|c| (8.0 * (one[c] - other[c]) - (two[c] - opposite[c])) / (12.0 * step))
            };
            let second = |one: [f64; 3], other: [f64; 3]| -> [f64; 3] {
                std::array::from_fn(|c| (one[c] - 2.0 * point(0.0, 0.0)[c] + other[c]) / (step * step))
            };
            let mixed: [f64; 3] = std::array::from_fn(|c| {
                let far = |k: f64| {
                    (point(k, k)[c] - point(k, -k)[c] - point(-k, k)[c] + point(-k, -k)[c])
                        / (4.0 * k * k * step * step)
                };
                (4.0 * far(1.0) - far(2.0)) / 3.0
            });
            let expected = [
                surface.evaluate(at).point,
                first(point(1.0, 0.0), point(-1.0, 0.0), point(2.0, 0.0), point(-2.0, 0.0)),
                first(point(0.0, 1.0), point(0.0, -1.0), point(0.0, 2.0), point(0.0, -2.0)),
                second(point(1.0, 0.0), point(-1.0, 0.0)),
                mixed,
                second(point(0.0, 1.0), point(0.0, -1.0)),
            ];
            let found = derivatives(&surface.evaluate(at));
            worst = (0..6).map(|i| distance(expected[i], found[i])).fold(worst, f64::max);
        }
        // Rounding of the second differences: 4 ε R/step².
        assert!(worst < 4.0 * EPS * 0.3 / (step * step), "{worst:e}");
    }
}

#[test]
fn virtual_work_is_the_same_on_the_surface_and_on_the_data() {
    let mut random = Random(4);
    let mut worst: f64 = 0.0;
    for (surface, _) in every_surface() {
        let count = surface.around() * surface.along();
        for _ in 0..20 {
            let displacement: Vec<[f64; 3]> = (0..count).map(|_| random.vector(1.0)).collect();
            let mut control = displacement.clone();
            surface.interpolate(&mut control);
            let mut moved = surface.clone();
            moved.set_control_points(&control);
            let (mut forces, mut work, mut size) = (vec![[0.0; 3]; count], 0.0, 0.0);
            for _ in 0..30 {
                let (place, force) = (random.place(&surface), random.vector(1.0));
                let done = dot(force, moved.evaluate(place).point);
                work += done;
                size += done.abs();
                for (index, weight) in surface.weights(place).iter() {
                    forces[index] = std::array::from_fn(|i| forces[index][i] + weight * force[i]);
                }
            }
            surface.transfer(&mut forces);
            let on_data: f64 = forces.iter().zip(&displacement).map(|(force, by)| dot(*force, *by)).sum();
            worst = worst.max((on_data - work).abs() / size);
        }
    }
    assert_below("virtual work on the surface less that on the data, relative", worst, 16.0 * EPS);
}

#[test]
fn control_points_are_linear_in_the_data() {
    for (mut surface, points) in every_surface() {
        let mut random = Random(5);
        let modes: Vec<Vec<[f64; 3]>> = (0..3).map(|_| points.iter().map(|_| random.vector(1e-3)).collect()).collect();
        let amplitudes = [0.7, -1.1, 0.4];
        let mut control = surface.control_points().to_vec();
        let mut moved = points.clone();
        for (mode, amplitude) in modes.iter().zip(amplitudes) {
            let mut image = mode.clone();
            surface.interpolate(&mut image);
            for index in 0..points.len() {
                for i in 0..3 {
                    control[index][i] += amplitude * image[index][i];
                    moved[index][i] += amplitude * mode[index][i];
                }
            }
        }
        surface.set_data(&moved).unwrap();
        let worst = surface.control_points().iter().zip(&control).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max);
        assert!(worst < 8.0 * EPS * RADIUS, "{worst:e}");
    }
}

/// A node at a signed distance inside a place, with its closest point known by construction.
fn node(surface: &SurfaceSpline, at: Place, gap: f64) -> [f64; 3] {
    let Evaluation { point, d_s, d_t, .. } = surface.evaluate(at);
    let cross =
        [d_t[1] * d_s[2] - d_t[2] * d_s[1], d_t[2] * d_s[0] - d_t[0] * d_s[2], d_t[0] * d_s[1] - d_t[1] * d_s[0]];
    let length = dot(cross, cross).sqrt();
    std::array::from_fn(|i| point[i] + gap * cross[i] / length)
}

#[track_caller]
fn found(projection: Projection) -> (Place, [f64; 3], [f64; 3], f64) {
    match projection {
        Projection::Found { place, point, normal, gap } => (place, point, normal, gap),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_closest_point_is_found_from_anywhere_around() {
    let mut random = Random(6);
    for (name, casing) in [("round", round as Casing), ("conical", conical), ("lobed", lobed)] {
        for (around, along) in [(36, 5), (72, 3), (7, 4), (12, 2)] {
            let surface = spline(&data(around, along, casing), around, along);
            let (mut offset, mut gradient, mut away): (f64, f64, f64) = (0.0, 0.0, 0.0);
            for _ in 0..100 {
                let at = Place { t: random.within(0.05, 0.95), ..random.place(&surface) };
                let gap = random.within(-5e-3, 5e-3);
                let x = node(&surface, at, gap);
                for _ in 0..20 {
                    let (place, point, normal, value) = found(surface.project(x, random.place(&surface)));
                    let r: [f64; 3] = std::array::from_fn(|i| x[i] - point[i]);
                    let evaluation = surface.evaluate(place);
                    for tangent in [evaluation.d_s, evaluation.d_t] {
                        gradient = gradient.max(dot(r, tangent).abs() / dot(tangent, tangent).sqrt());
                    }
                    away = away.max(distance(point, surface.evaluate(at).point));
                    offset = offset.max((value - gap).abs());
                    assert!((dot(normal, normal) - 1.0).abs() < 4.0 * EPS);
                    assert!(normal[0] * x[0] + normal[1] * x[1] < -0.9 * RADIUS, "the normal points to the axis");
                }
            }
            let name = format!("{name} casing of {around} x {along}");
            assert_below(&format!("{name}: (x − S)·tangent (m)"), gradient, 4e-12);
            assert_below(&format!("{name}: closest point off its place (m)"), away, 4e-12);
            assert_below(&format!("{name}: gap (m)"), offset, 4e-16);
        }
    }
}

/// Smallest distance over a fine sampling, for whatever lies between.
fn brute_force(surface: &SurfaceSpline, x: [f64; 3], per_patch: usize) -> f64 {
    let mut least = f64::INFINITY;
    for p in 0..surface.around() {
        for q in 0..surface.along() - 1 {
            for i in 0..=per_patch {
                for j in 0..=per_patch {
                    let at = place(p, q, i as f64 / per_patch as f64, j as f64 / per_patch as f64);
                    least = least.min(distance(surface.evaluate(at).point, x));
                }
            }
        }
    }
    least
}

#[test]
fn no_sampled_point_is_closer() {
    let mut random = Random(8);
    for (around, along) in [(36, 3), (12, 4), (5, 2)] {
        for (closure, interpolation) in KINDS {
            let points = data(around, along, lobed);
            let surface = SurfaceSpline::new(&points, around, along, closure, interpolation).unwrap();
            let (mut closer, mut farther): (f64, f64) = (0.0, 0.0);
            let samples = 1500 / around;
            for index in 0..40 {
                let mut at = Place { t: random.within(0.05, 0.95), ..random.place(&surface) };
                // Half of the nodes stand next to a border of patches, where facets and free ends kink.
                if index % 2 == 0 {
                    (at.patch[0], at.s) = (if index % 4 == 0 { 0 } else { at.patch[0] }, 1e-3 * random.next());
                }
                let x = node(&surface, at, random.within(-3e-3, 3e-3));
                let guess = Place { t: 0.5, ..random.place(&surface) };
                let (_, point, _, _) = found(surface.project(x, guess));
                let (least, found) = (brute_force(&surface, x, samples), distance(point, x));
                closer = closer.max(found - least);
                farther = farther.max(least - found);
            }
            let name = format!("{around} x {along}, {closure:?}, {interpolation:?}");
            assert_below(&format!("{name}: closer sampled point (m)"), closer, 1e-16);
            // Samples lie half a spacing along both directions from the closest point, seen under the distance.
            let (half_s, half_t) = (TAU * 0.26 / around as f64 / samples as f64, 0.06 / samples as f64);
            assert_below(&format!("{name}: samples are at most this much farther (m)"), farther, half_s + half_t);
        }
    }
}

#[test]
fn the_seam_of_a_smooth_surface_is_no_special_place() {
    let around = 36;
    let surface = spline(&data(around, 5, conical), around, 5);
    let mut at = place(around - 2, 2, 0.5, 0.3);
    let mut guess = at;
    let mut worst: f64 = 0.0;
    for step in 0..400 {
        at.s = 0.5 + 0.01 * f64::from(step % 100);
        if at.s >= 1.0 {
            at.s -= 1.0;
        }
        at.patch[0] = (around - 2 + (50 + step as usize) / 100) % around;
        let x = node(&surface, at, 3e-4);
        let (place, _, _, gap) = found(surface.project(x, guess));
        assert_eq!(place.patch[1], at.patch[1]);
        worst = worst.max((gap - 3e-4).abs());
        guess = place;
    }
    assert_below("gap along a path over the seam (m)", worst, 4e-16);
}

#[test]
fn starts_on_the_opposite_side_lead_back() {
    for (closure, interpolation) in KINDS {
        for around in [4, 36, 500] {
            let points = data(around, 3, conical);
            let surface = SurfaceSpline::new(&points, around, 3, closure, interpolation).unwrap();
            for p in [0, 1, around / 2, around - 1] {
                for s in [0.0, 1e-12, 0.4, 1.0] {
                    // Next to the exact opposite, where f has its maximum, and on it.
                    let guess = place(p, 1, s, 0.5);
                    let across = surface.evaluate(guess).point;
                    let scale = (RADIUS - 1e-3) / RADIUS;
                    let x = [-scale * across[0], -scale * across[1], across[2]];
                    let (_, point, _, _) = found(surface.project(x, guess));
                    let direct = found(surface.project(x, surface.locate(x))).1;
                    assert!((distance(point, x) - distance(direct, x)).abs() < 1e-15, "{around}, {guess:?}");
                }
            }
        }
    }
}

#[test]
fn a_node_on_the_edge_is_in_and_one_beyond_it_is_out() {
    for (closure, interpolation) in KINDS {
        let points = data(36, 3, conical);
        let surface = SurfaceSpline::new(&points, 36, 3, closure, interpolation).unwrap();
        let mut random = Random(9);
        for _ in 0..200 {
            let (p, s, gap) = (random.below(36), random.within(0.1, 0.9), random.within(0.0, 1e-3));
            for (q, t, outwards) in [(0, 0.0, -1.0), (1, 1.0, 1.0)] {
                let edge = place(p, q, s, t);
                let x = node(&surface, edge, gap);
                let guess = Place { t: random.next(), patch: [p, random.below(2)], s: random.next() };
                let (at, _, _, value) = found(surface.project(x, guess));
                assert!((value - gap).abs() < 4e-16 && (at.t - t).abs() < 1e-9, "{at:?} for {edge:?}");
                let tangent = surface.evaluate(edge).d_t;
                let beyond: [f64; 3] = std::array::from_fn(|i| x[i] + outwards * 1e-6 * tangent[i]);
                let Projection::BeyondEdge { place: last } = surface.project(beyond, guess) else {
                    panic!("{:?} is beyond the edge", surface.project(beyond, guess));
                };
                assert!((last.t - t).abs() < 1e-8 && last.patch == [p, q], "{last:?} for {edge:?}");
                let inside: [f64; 3] = std::array::from_fn(|i| x[i] - outwards * 1e-6 * tangent[i]);
                found(surface.project(inside, last));
            }
        }
    }
}

#[test]
fn a_round_casing_is_met_to_fourth_order() {
    let error = |around| off_the_circle(around, Closure::Smooth, Interpolation::Spline);
    let errors: Vec<f64> = [24, 36, 72, 144, 288].into_iter().map(error).collect();
    for (count, error) in [24, 36, 72, 144, 288].into_iter().zip(&errors) {
        println!("  {count:>3} points: {:.3e} m = {:.3e} R", error, error / RADIUS);
    }
    let rates = [(0, 1, 1.5_f64), (1, 2, 2.0), (2, 3, 2.0), (3, 4, 2.0)]
        .map(|(a, b, ratio)| (errors[a] / errors[b]).ln() / ratio.ln());
    println!("  rates {rates:.3?}");
    assert!(rates.iter().all(|rate| (rate - 4.0).abs() < 0.05), "{rates:?}");
}

/// Largest distance from the circle, of all patches.
fn off_the_circle(around: usize, closure: Closure, interpolation: Interpolation) -> f64 {
    let surface = SurfaceSpline::new(&data(around, 3, round), around, 3, closure, interpolation).unwrap();
    let radius = |index: usize| {
        let point = surface.evaluate(place(index % around, 1, (index / around) as f64 / 100.0, 0.4)).point;
        libm::hypot(point[0], point[1])
    };
    (0..100 * around).map(|index| (radius(index) - RADIUS).abs()).fold(0.0, f64::max)
}

#[test]
fn free_ends_and_facets_miss_a_circle_by_the_second_order() {
    let kinds = [(Closure::FreeEnds, Interpolation::Spline), (Closure::Smooth, Interpolation::Facets)];
    for (closure, interpolation) in kinds {
        let errors = [36, 72].map(|around| off_the_circle(around, closure, interpolation));
        println!("{closure:?}, {interpolation:?}: {:.3e} m with 36 points, {:.3e} m with 72", errors[0], errors[1]);
        assert!(((errors[0] / errors[1]).log2() - 2.0).abs() < 0.02);
    }
    let (sagitta, facets) = (RADIUS * (1.0 - (TAU / 72.0).cos()), off_the_circle(36, kinds[1].0, kinds[1].1));
    assert!((facets - sagitta).abs() < 1e-15, "{facets} is the height of the arc, {sagitta}");
}

#[test]
fn facets_meet_a_node_on_the_flat_and_at_corners() {
    let around = 12;
    let facets = |radius: Casing| {
        let points = data(around, 3, radius);
        SurfaceSpline::new(&points, around, 3, Closure::Smooth, Interpolation::Facets).unwrap()
    };
    // Inside a convex polygon: the nearest of two flats, never the corner between them.
    let surface = facets(round);
    let corner = surface.evaluate(place(3, 0, 0.0, 0.5)).point;
    let inwards = [-corner[0] / RADIUS, -corner[1] / RADIUS, 0.0];
    let half = TAU / 24.0;
    for guess in 0..around {
        let x: [f64; 3] = std::array::from_fn(|i| corner[i] + 1e-3 * inwards[i]);
        let (at, _, normal, gap) = found(surface.project(x, place(guess, 1, 0.2, 0.9)));
        assert!((gap - 1e-3 * half.cos()).abs() < 4e-16, "{gap}");
        assert!((dot(normal, inwards) - half.cos()).abs() < 4e-15 && at.patch[0].abs_diff(2) <= 1);
        // Outside the corner it is the closest point.
        let x: [f64; 3] = std::array::from_fn(|i| corner[i] - 1e-3 * inwards[i]);
        let (at, point, normal, gap) = found(surface.project(x, place(guess, 1, 0.2, 0.9)));
        assert!(distance(point, corner) < 1e-15 && (gap + 1e-3 * half.cos()).abs() < 4e-16, "{gap} at {at:?}");
        assert!((dot(normal, inwards) - half.cos()).abs() < 4e-15);
    }
    // Turned a little around the corner, the facet on that side faces the node more squarely.
    let tangent = [-inwards[1], inwards[0], 0.0];
    for side in [-1.0, 1.0] {
        let x: [f64; 3] = std::array::from_fn(|i| corner[i] - 1e-3 * inwards[i] - side * 1e-4 * tangent[i]);
        let (at, point, _, _) = found(surface.project(x, place(8, 1, 0.2, 0.9)));
        assert!(distance(point, corner) < 1e-15);
        assert_eq!(at.patch[0], if side > 0.0 { 3 } else { 2 });
    }
    // A ridge towards the axis: inside, its edge is closest over a whole wedge.
    let surface = facets(|angle, _| if (angle - 0.3 - TAU / 4.0).abs() < 1e-9 { 0.75 * RADIUS } else { RADIUS });
    let ridge = surface.evaluate(place(3, 1, 0.0, 0.5)).point;
    let x = [0.99 * ridge[0], 0.99 * ridge[1], ridge[2]];
    for guess in [1, 2, 3, 4] {
        let (_, point, normal, gap) = found(surface.project(x, place(guess, 0, 0.6, 0.2)));
        assert!(distance(point, ridge) < 1e-15, "{point:?} {ridge:?}");
        assert!(gap > 0.0 && gap < distance(x, ridge) && dot(normal, ridge) < 0.0);
    }
}

#[test]
fn places_from_angle_and_axial_position_are_near() {
    for (surface, _) in every_surface() {
        let mut random = Random(10);
        for _ in 0..100 {
            let at = random.place(&surface);
            let (guess, far) = (surface.locate(surface.evaluate(at).point), surface.around());
            let [found, expected] = [guess, at].map(|place| place.patch[0] as f64 + place.s);
            let apart = (found - expected).rem_euclid(far as f64);
            assert!(apart.min(far as f64 - apart) < 0.3, "{guess:?} for {at:?}");
            let axial = |place: Place| surface.evaluate(place).point[2];
            assert!((axial(guess) - axial(at)).abs() < 0.3 * 0.06 / (surface.along() - 1) as f64);
            let turned = surface.advance(at, 1.25);
            let expected = (expected + 0.25 * far as f64).rem_euclid(far as f64);
            assert!(
                (turned.patch[0] as f64 + turned.s - expected).abs() < 1e-9 && turned.t.to_bits() == at.t.to_bits()
            );
        }
        let nowhere = surface.locate([f64::NAN, 0.1, f64::NAN]);
        surface.evaluate(nowhere);
    }
}

#[test]
fn hopeless_nodes_are_lost_without_panic() {
    for (surface, _) in every_surface() {
        let start = place(0, 0, 0.5, 0.5);
        for x in [[f64::NAN, 0.0, 0.0], [0.1, f64::INFINITY, 0.0], [0.1, 0.1, f64::NEG_INFINITY]] {
            assert_eq!(surface.project(x, start), Projection::Lost);
        }
        assert_eq!(surface.project([0.2, 0.1, 0.0], place(0, 0, f64::NAN, 0.5)), Projection::Lost);
        let x = node(&surface, start, 1e-4);
        for (s, t) in [(7.3, 0.5), (0.5, -40.0), (f64::INFINITY, f64::NEG_INFINITY), (1.01, 1.01)] {
            let gap = found(surface.project(x, place(0, 0, s, t))).3;
            assert!((gap - 1e-4).abs() < 4e-16, "started from a place that is none: {gap:e}");
        }
        let mut folded = surface.clone();
        folded.set_control_points(&vec![[0.1, 0.2, 0.3]; surface.around() * surface.along()]);
        assert_eq!(folded.project([0.2, 0.1, 0.0], start), Projection::Lost);
        folded.set_control_points(&vec![[f64::NAN; 3]; surface.around() * surface.along()]);
        assert_eq!(folded.project([0.2, 0.1, 0.0], start), Projection::Lost);
        // Far away and on the axis something is found, or the node is over an edge.
        for x in [[1e6, 0.0, 0.0], [0.0, 0.0, 0.0], [-1e-300, 0.0, 0.0], [1.0, 2.0, -1e9], [1e200, 1e200, 0.0]] {
            surface.project(x, start);
        }
    }
}

#[test]
fn bad_data_is_refused_with_its_place() {
    let make = |points: &[[f64; 3]], around: usize, along: usize| {
        SurfaceSpline::new(points, around, along, Closure::Smooth, Interpolation::Spline).map_err(|e| e.to_string())
    };
    let good = data(8, 3, round);
    assert!(make(&data(4, 2, round), 4, 2).is_ok());
    assert!(make(&data(8, 3, round)[..16], 8, 1).unwrap_err().contains("8 points around and 1 rings"));
    assert!(make(&data(8, 3, round)[..9], 3, 3).unwrap_err().contains("at least 4 points around"));
    assert!(make(&good[..23], 8, 3).unwrap_err().contains("23 data points"));
    assert!(make(&[], usize::MAX, usize::MAX).unwrap_err().contains("0 data points"));
    let spoilt = |index: usize, point: [f64; 3]| {
        let mut points = good.clone();
        points[index] = point;
        points
    };
    for value in [f64::NAN, f64::INFINITY] {
        assert!(make(&spoilt(9, [0.1, value, 0.0]), 8, 3).unwrap_err().contains("data point 10"));
    }
    assert!(make(&spoilt(2, good[3]), 8, 3).unwrap_err().contains("data point 3"));
    assert!(make(&spoilt(2, [0.0; 3]), 8, 3).unwrap_err().contains("data point 3"));
    let mut swapped = good.clone();
    swapped.rotate_left(8);
    assert!(make(&swapped, 8, 3).unwrap_err().contains("ring 3 does not lie beyond ring 2"));
    let mut surface = make(&good, 8, 3).unwrap();
    let before = surface.clone();
    assert!(surface.set_data(&spoilt(9, [0.1, f64::NAN, 0.0])).is_err());
    assert_eq!(surface, before, "a refused set of data changes nothing");
}

#[test]
fn a_start_from_the_last_step_ends_where_a_start_from_elsewhere_does() {
    let mut random = Random(11);
    for (closure, interpolation) in KINDS {
        let (around, along, turn) = (36, 5, 1e-3);
        let surface = SurfaceSpline::new(&data(around, along, lobed), around, along, closure, interpolation).unwrap();
        let (mut normals, mut gaps): (f64, f64) = (0.0, 0.0);
        let mut guess = place(34, 1, 0.2, 0.5);
        for step in 0..2500 {
            let (angle, z) = (TAU * f64::from(step) * turn - 0.1, 0.02 * (0.01 * f64::from(step)).sin());
            let r = lobed(angle - 0.3, z) - 4e-4 + 5e-4 * (0.3 * f64::from(step)).sin();
            let x = [r * angle.cos(), r * angle.sin(), z];
            let warm = found(surface.project(x, surface.advance(guess, turn)));
            let located = found(surface.project(x, surface.locate(x)));
            let cold = found(surface.project(x, Place { t: 0.5, ..random.place(&surface) }));
            for other in [located, cold] {
                gaps = gaps.max((warm.3 - other.3).abs());
                // Two facets or two sides of the seam may be equally far away.
                if (warm.3 - other.3).abs() > 0.0 || distance(warm.1, other.1) < 1e-9 {
                    normals = normals.max(distance(warm.2, other.2));
                }
            }
            guess = warm.0;
        }
        assert_below(&format!("{closure:?}, {interpolation:?}: gaps apart (m)"), gaps, 4e-16);
        assert_below(&format!("{closure:?}, {interpolation:?}: normals apart"), normals, 1e-10);
    }
}

#[test]
fn a_sliding_node_is_kicked_at_every_border_of_facets_and_nowhere_on_the_spline() {
    use sliding::{AROUND, INTERFERENCE, MASS, SPEED, STEP, STIFFNESS, casing, slide};
    let largest = |history: &sliding::History| history.changes().into_iter().fold(0.0, f64::max);
    let facets = slide(&casing(Closure::Smooth, Interpolation::Facets));
    let free = slide(&casing(Closure::FreeEnds, Interpolation::Spline));
    let smooth = slide(&casing(Closure::Smooth, Interpolation::Spline));
    // Once per border: the radial velocity turns from +v tan(π/n) to −v tan(π/n).
    let kicks = facets.force.iter().filter(|force| **force > 1e4).count();
    assert!((AROUND - 1..=2 * AROUND).contains(&kicks), "{kicks} kicks");
    let half = TAU / (2 * AROUND) as f64;
    let impulse: f64 = facets.force.iter().filter(|force| **force > 5e3).map(|force| force * STEP).sum();
    let expected = 2.0 * MASS * SPEED * sliding::RADIUS * half.tan() / half.cos();
    let relative = impulse / expected / AROUND as f64 - 1.0;
    println!("impulse per border {expected:.4e} N·s; found {relative:+.2e} relative to it");
    assert!(relative.abs() < 0.05, "{relative}");
    // The spline leaves the force of the spring, to the depth that it is off the circle.
    let [least, most] = smooth.range();
    let ripple = 1.5 * STIFFNESS * 6.1e-7;
    assert!(least > STIFFNESS * INTERFERENCE - ripple && most < STIFFNESS * INTERFERENCE + ripple, "{least}..{most}");
    println!("largest changes: {:.3e} {:.3e} {:.3e} N", largest(&facets), largest(&free), largest(&smooth));
    assert!(largest(&smooth) < 1e-2 && largest(&facets) > 6e4 && largest(&free) > 3e4);
    // Far from the seam both closures are the same.
    let far = |history: &sliding::History| history.changes()[100..5000].iter().copied().fold(0.0, f64::max);
    assert!(far(&free) < 2e-2, "{:e}", far(&free));
}
