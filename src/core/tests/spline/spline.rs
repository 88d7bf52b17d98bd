//! The surface spline: its definition, its end conditions, and exact transfer of forces.

#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

use std::f64::consts::TAU;

use crate::casings::*;
use crate::guide::print_row;
use tiprub_core::geometry::Vector3;
use tiprub_core::geometry::surface_spline::{ClosestPoint, Evaluation, REACH, SurfaceSpline};
use tiprub_core::scene::settings::{Closure, Interpolation};

#[test]
fn weights_sum_to_one_and_are_the_derivative_of_the_point() {
    let mut random = SeededRandom(1);
    let (mut unity, mut derivative): (f64, f64) = (0.0, 0.0);
    for (surface, _) in every_surface() {
        for _ in 0..500 {
            let place = anywhere(&mut random, &surface);
            let weights = surface.weights(place);
            unity = unity.max((weights.values[..weights.len].iter().sum::<f64>() - 1.0).abs());
            let sum: Vector3 = weights.iter().map(|(index, weight)| weight * surface.control_points()[index]).sum();
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
fn number_of_control_points_depends_on_the_place() {
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
    let mut random = SeededRandom(2);
    let mut error: f64 = 0.0;
    for _ in 0..2000 {
        let (p, q, s, t) = (random.below(around), 1 + random.below(along - 3), random.unit(), random.unit());
        let (a, b) = (basis(s), basis(t));
        let mut point = Vector3::zeros();
        for i in 0..4 {
            for j in 0..4 {
                let control = surface.control_points()[(q + j - 1) * around + (p + i + around - 1) % around];
                point += a[i] * b[j] * control;
            }
        }
        error = error.max(distance(point, surface.evaluate(place(p, q, s, t)).point) / RADIUS);
    }
    assert_below("patch against S H Q Hᵀ Tᵀ, relative", error, 8.0 * EPS);
}

#[test]
fn surface_interpolates_its_data() {
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

fn derivatives(evaluation: &Evaluation) -> [Vector3; 6] {
    let Evaluation { point, d_s, d_t, d_ss, d_st, d_tt } = *evaluation;
    [point, d_s, d_t, d_ss, d_st, d_tt]
}

/// Returns the largest difference of point, first and second derivatives between two points, relative to the radius.
fn jumps(surface: &SurfaceSpline, a: ClosestPoint, b: ClosestPoint) -> [f64; 3] {
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
fn second_derivative_vanishes_at_edges_and_free_ends() {
    let (mut edge, mut seam): (f64, f64) = (0.0, 0.0);
    for (surface, _) in every_surface().into_iter().step_by(3).chain(every_surface().into_iter().skip(1).step_by(3)) {
        let last = surface.along() - 2;
        for p in 0..surface.around() {
            for s in [0.0, 0.4, 0.9] {
                for (q, t) in [(0, 0.0), (last, 1.0)] {
                    let second = surface.evaluate(place(p, q, s, t)).d_tt;
                    edge = edge.max(second.norm() / RADIUS);
                }
            }
        }
    }
    assert_below("S_tt at the free edges, relative", edge, 8.0 * EPS);
    let (beyond, weights) = beyond_the_edges();
    for (order, error) in beyond.into_iter().enumerate() {
        assert_below(&format!("jump of derivatives of order {order} over the edge, relative"), error, 16.0 * EPS);
    }
    assert_below("weights of what goes on, against its points, relative", weights, 16.0 * EPS);
    let points = data(36, 5, lobed);
    let surface = SurfaceSpline::new(&points, 36, 5, Closure::FreeEnds, Interpolation::Spline).unwrap();
    let mut kink: f64 = 0.0;
    for t in [0.0, 0.3, 0.8] {
        let ends = [place(0, 2, 0.0, t), place(35, 2, 1.0, t)];
        let [first, last] = ends.map(|end| surface.evaluate(end));
        seam = seam.max(distance(first.point, last.point) / RADIUS);
        for second in [first.d_ss, last.d_ss] {
            seam = seam.max(second.norm() / RADIUS);
        }
        kink = kink.max(first.d_s.angle(&last.d_s));
    }
    assert_below("gap of the seam and S_ss there, free ends, relative", seam, 8.0 * EPS);
    println!("kink of the seam with free ends, 36 points: {:.3}°", kink.to_degrees());
    assert!(kink > 0.01, "free ends do not join smoothly");
}

/// Returns the largest jumps of derivatives over the edges, and the difference of Σ weight · control point and the
/// point on the continuation.
fn beyond_the_edges() -> ([f64; 3], f64) {
    let (mut worst, mut weights) = ([0.0_f64; 3], 0.0_f64);
    for (surface, _) in every_surface() {
        let last = surface.along() - 2;
        for p in 0..surface.around() {
            for (q, t, outwards) in [(0, 0.0, -1.0), (last, 1.0, 1.0)] {
                let found = jumps(&surface, place(p, q, 0.4, t), place(p, q, 0.4, t + 1e-17_f64.copysign(outwards)));
                let over = jumps(&surface, place(p, q, 0.4, t), place(p, q, 0.4, t + 1e-15 * outwards));
                worst = std::array::from_fn(|i| worst[i].max(found[i]).max(over[i]));
                let out = place(p, q, 0.4, t + outwards * REACH * (surface.along() - 1) as f64);
                let points = surface.control_points();
                let terms = surface.weights(out);
                let sum: Vector3 = terms.iter().map(|(index, weight)| weight * points[index]).sum();
                weights = weights.max(distance(sum, surface.evaluate(out).point) / RADIUS);
            }
        }
    }
    (worst, weights)
}

#[test]
fn derivatives_match_the_surface_point() {
    let mut random = SeededRandom(3);
    for (surface, _) in every_surface() {
        let step = 1e-3;
        let mut worst: f64 = 0.0;
        for _ in 0..100 {
            let at = ClosestPoint {
                s: random.within(0.1, 0.9),
                t: random.within(0.1, 0.9),
                ..anywhere(&mut random, &surface)
            };
            let point =
                |i: f64, j: f64| surface.evaluate(ClosestPoint { s: at.s + i * step, t: at.t + j * step, ..at }).point;
            // Third derivatives are constant along a parameter, so two step sizes eliminate the truncation error.
            let first = |one: Vector3, other: Vector3, two: Vector3, opposite: Vector3| {
                (8.0 * (one - other) - (two - opposite)) / (12.0 * step)
            };
            let second = |one: Vector3, other: Vector3| (one - 2.0 * point(0.0, 0.0) + other) / (step * step);
            let far =
                |k: f64| (point(k, k) - point(k, -k) - point(-k, k) + point(-k, -k)) / (4.0 * k * k * step * step);
            let mixed = (4.0 * far(1.0) - far(2.0)) / 3.0;
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
fn virtual_work_agrees_on_surface_and_control_points() {
    let mut random = SeededRandom(4);
    let mut worst: f64 = 0.0;
    for (surface, _) in every_surface() {
        let count = surface.around() * surface.along();
        for _ in 0..20 {
            let mut control: Vec<Vector3> = (0..count).map(|_| random.vector(1.0).into()).collect();
            surface.interpolate(&mut control);
            let mut moved = surface.clone();
            moved.set_control_points(|index| control[index]);
            let (mut forces, mut work, mut size) = (vec![Vector3::zeros(); count], 0.0, 0.0);
            for index in 0..30 {
                let (mut place, force) = (anywhere(&mut random, &surface), Vector3::from(random.vector(1.0)));
                if index % 3 == 0 && place.patch[1] == 0 {
                    // Before the first ring.
                    place.t *= -REACH * (surface.along() - 1) as f64;
                }
                let done = force.dot(&moved.evaluate(place).point);
                work += done;
                size += done.abs();
                for (index, weight) in surface.weights(place).iter() {
                    forces[index] += weight * force;
                }
            }
            let on_control: f64 = forces.iter().zip(&control).map(|(force, by)| force.dot(by)).sum();
            worst = worst.max((on_control - work).abs() / size);
        }
    }
    assert_below("virtual work on the surface less that on control points, relative", worst, 16.0 * EPS);
}

#[test]
fn control_points_are_linear_in_the_data() {
    for (mut surface, points) in every_surface() {
        let mut random = SeededRandom(5);
        let modes: Vec<Vec<[f64; 3]>> = (0..3).map(|_| points.iter().map(|_| random.vector(1e-3)).collect()).collect();
        let amplitudes = [0.7, -1.1, 0.4];
        let mut control = surface.control_points().to_vec();
        let mut moved = points.clone();
        for (mode, amplitude) in modes.iter().zip(amplitudes) {
            let mut image: Vec<Vector3> = mode.iter().map(|moved| (*moved).into()).collect();
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

#[test]
fn spline_converges_to_round_casing_at_fourth_order() {
    let error = |around| off_the_circle(around, Closure::Smooth, Interpolation::Spline);
    let errors: Vec<f64> = [24, 36, 72, 144, 288].into_iter().map(error).collect();
    for (count, error) in [24, 36, 72, 144, 288].into_iter().zip(&errors) {
        let facets = off_the_circle(count, Closure::Smooth, Interpolation::Facets);
        print_row!("| {count} | {:.3e} | {:.3e} |", 1e6 * error, 1e6 * facets);
    }
    let rates = [(0, 1, 1.5_f64), (1, 2, 2.0), (2, 3, 2.0), (3, 4, 2.0)]
        .map(|(a, b, ratio)| (errors[a] / errors[b]).ln() / ratio.ln());
    println!("  rates {rates:.3?}");
    assert!(rates.iter().all(|rate| (rate - 4.0).abs() < 0.05), "{rates:?}");
    crate::guide::hold("cargo test -p tiprub-core --test spline");
}

/// Returns the largest distance from the circle over all patches.
fn off_the_circle(around: usize, closure: Closure, interpolation: Interpolation) -> f64 {
    let surface = SurfaceSpline::new(&data(around, 3, round), around, 3, closure, interpolation).unwrap();
    let radius = |index: usize| {
        let point = surface.evaluate(place(index % around, 1, (index / around) as f64 / 100.0, 0.4)).point;
        libm::hypot(point[0], point[1])
    };
    (0..100 * around).map(|index| (radius(index) - RADIUS).abs()).fold(0.0, f64::max)
}

#[test]
fn free_ends_and_facets_converge_at_second_order() {
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
fn rejects_invalid_data_with_its_position() {
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
    assert!(make(&swapped, 8, 3).unwrap_err().contains("ring 3 is not at a larger z than ring 2"));
    let mut surface = make(&good, 8, 3).unwrap();
    let before = surface.clone();
    assert!(surface.set_data(&spoilt(9, [0.1, f64::NAN, 0.0])).is_err());
    assert_eq!(surface, before, "a refused set of data changes nothing");
}
