//! The closest point of a surface spline to a node: its definition, from every start, over seams, edges and creases.

#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

#[path = "common/casings.rs"]
mod casings;
#[path = "common/counting.rs"]
mod counting;
#[path = "../examples/facets_and_spline/sliding.rs"]
mod sliding;

use std::f64::consts::TAU;

use casings::*;
use tiprub_core::geometry::Vector3;
use tiprub_core::geometry::surface_spline::{ClosestPoint, Evaluation, Projection, REACH, SurfaceSpline};
use tiprub_core::scene::settings::{Closure, Interpolation};

/// Returns a node at a signed distance inside a point of the surface, with its closest point known by construction.
fn node(surface: &SurfaceSpline, at: ClosestPoint, gap: f64) -> Vector3 {
    let Evaluation { point, d_s, d_t, .. } = surface.evaluate(at);
    point + gap * d_t.cross(&d_s).normalize()
}

#[track_caller]
fn found(projection: Projection) -> (ClosestPoint, Vector3, Vector3, f64) {
    match projection {
        Projection::Found { gap, point } => (gap.foot, point, gap.normal, gap.distance),
        other => panic!("{other:?}"),
    }
}

#[test]
fn finds_the_closest_point_from_any_start() {
    let mut random = SeededRandom(6);
    for (name, casing) in [("round", round as CasingShape), ("conical", conical), ("lobed", lobed)] {
        for (around, along) in [(36, 5), (72, 3), (7, 4), (12, 2)] {
            let surface = spline(&data(around, along, casing), around, along);
            let (mut offset, mut gradient, mut away): (f64, f64, f64) = (0.0, 0.0, 0.0);
            for _ in 0..100 {
                let at = ClosestPoint { t: random.within(0.05, 0.95), ..anywhere(&mut random, &surface) };
                let gap = random.within(-5e-3, 5e-3);
                let x = node(&surface, at, gap);
                for _ in 0..20 {
                    let (place, point, normal, value) = found(surface.project(x, anywhere(&mut random, &surface)));
                    let r = x - point;
                    let evaluation = surface.evaluate(place);
                    for tangent in [evaluation.d_s, evaluation.d_t] {
                        gradient = gradient.max(r.dot(&tangent).abs() / tangent.norm());
                    }
                    away = away.max(distance(point, surface.evaluate(at).point));
                    offset = offset.max((value - gap).abs());
                    assert!((normal.norm_squared() - 1.0).abs() < 4.0 * EPS);
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

/// Returns the smallest distance over a fine sampling.
fn brute_force(surface: &SurfaceSpline, x: Vector3, per_patch: usize) -> f64 {
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
    let mut random = SeededRandom(8);
    for (around, along) in [(36, 3), (12, 4), (5, 2)] {
        for (closure, interpolation) in KINDS {
            let points = data(around, along, lobed);
            let surface = SurfaceSpline::new(&points, around, along, closure, interpolation).unwrap();
            let (mut closer, mut farther): (f64, f64) = (0.0, 0.0);
            let samples = 1500 / around;
            for index in 0..40 {
                let mut at = ClosestPoint { t: random.within(0.05, 0.95), ..anywhere(&mut random, &surface) };
                // Half of the nodes are next to a border of patches, where facets and free ends have kinks.
                if index % 2 == 0 {
                    (at.patch[0], at.s) = (if index % 4 == 0 { 0 } else { at.patch[0] }, 1e-3 * random.unit());
                }
                let x = node(&surface, at, random.within(-3e-3, 3e-3));
                let guess = ClosestPoint { t: 0.5, ..anywhere(&mut random, &surface) };
                let (_, point, _, _) = found(surface.project(x, guess));
                let (least, found) = (brute_force(&surface, x, samples), distance(point, x));
                closer = closer.max(found - least);
                farther = farther.max(least - found);
            }
            let name = format!("{around} x {along}, {closure:?}, {interpolation:?}");
            assert_below(&format!("{name}: closer sampled point (m)"), closer, 1e-16);
            // Samples lie half a spacing along both directions from the closest point, relative to the distance.
            let (half_s, half_t) = (TAU * 0.26 / around as f64 / samples as f64, 0.06 / samples as f64);
            assert_below(&format!("{name}: samples are at most this much farther (m)"), farther, half_s + half_t);
        }
    }
}

#[test]
fn seam_of_a_smooth_surface_has_no_effect() {
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
fn projection_started_on_opposite_side_converges() {
    let grids = [4, 36, 500].map(|around| [(around, round as CasingShape), (around, conical)]);
    for ((around, casing), (closure, interpolation)) in
        grids.into_iter().flatten().flat_map(|grid| KINDS.map(|kind| (grid, kind)))
    {
        let surface = SurfaceSpline::new(&data(around, 3, casing), around, 3, closure, interpolation).unwrap();
        for p in [0, 1, around / 2, around - 1] {
            for s in [0.0, 1e-12, 0.4, 1.0] {
                // On the exact opposite side f has its maximum.
                let guess = place(p, 1, s, 0.5);
                let across = surface.evaluate(guess).point;
                let scale = (RADIUS - 1e-3) / RADIUS;
                let x = Vector3::new(-scale * across[0], -scale * across[1], across[2]);
                let (_, point, _, _) = found(surface.project(x, guess));
                let direct = found(surface.project(x, surface.locate(x))).1;
                assert!((distance(point, x) - distance(direct, x)).abs() < 1e-15, "{around}, {guess:?}");
            }
        }
    }
}

#[test]
fn finds_the_closer_side_of_a_kinked_seam() {
    let around = 36;
    let points = data(around, 3, round);
    let surface = SurfaceSpline::new(&points, around, 3, Closure::FreeEnds, Interpolation::Spline).unwrap();
    for (s, at, other) in [(2e-4, 0, around - 1), (1.0 - 2e-4, around - 1, 0)] {
        // Inwards from here the node crosses the bisector of the kink.
        let start = place(at, 1, s, 0.3);
        let x = node(&surface, start, 2e-3);
        let (place, _, _, gap) = found(surface.project(x, start));
        assert!(place.patch[0] == other && gap < 2e-3 - 1e-6, "{gap} at {place:?}");
    }
}

#[test]
fn inner_ring_corner_of_facets_is_not_an_edge() {
    let points = data(12, 3, |_, z| RADIUS - 5.0 * z * z);
    let surface = SurfaceSpline::new(&points, 12, 3, Closure::Smooth, Interpolation::Facets).unwrap();
    let corner = surface.evaluate(place(3, 1, 0.0, 0.0)).point;
    for (aside, ring) in [(-1e-5, 0), (1e-5, 1)] {
        let x = Vector3::new(1.004 * corner[0], 1.004 * corner[1], corner[2] + aside);
        for guess in [place(3, 0, 0.5, 0.5), place(2, 1, 0.5, 0.5), place(9, 0, 0.1, 0.0)] {
            let (at, point, _, gap) = found(surface.project(x, guess));
            assert!(distance(point, corner) < 1e-15 && gap < 0.0 && at.patch[1] == ring, "{gap} at {at:?}");
        }
    }
}

#[test]
fn projection_succeeds_only_within_the_axial_extension() {
    for (closure, interpolation) in KINDS {
        let points = data(36, 3, conical);
        let surface = SurfaceSpline::new(&points, 36, 3, closure, interpolation).unwrap();
        let mut random = SeededRandom(9);
        for _ in 0..200 {
            let (p, s, gap) = (random.below(36), random.within(0.1, 0.9), random.within(0.0, 1e-3));
            for (q, t, outwards) in [(0, 0.0, -1.0), (1, 1.0, 1.0)] {
                let edge = place(p, q, s, t);
                let x = node(&surface, edge, gap);
                let guess = ClosestPoint { t: random.unit(), patch: [p, random.below(2)], s: random.unit() };
                let (at, _, _, value) = found(surface.project(x, guess));
                assert!((value - gap).abs() < 4e-16 && (at.t - t).abs() < 1e-9, "{at:?} for {edge:?}");
                // Anywhere on the continuation, at its distance, on either side of it.
                let reach = 2.0 * REACH;
                let out = t + outwards * reach * random.within(0.0, 0.999);
                let beyond = ClosestPoint { t: out, ..edge };
                for gap in [gap, -gap] {
                    let (at, _, _, value) = found(surface.project(node(&surface, beyond, gap), guess));
                    assert!((value - gap).abs() < 4e-16, "{value} for {gap} at {at:?}");
                    assert!((at.t - out).abs() < 1e-9 && at.patch == [p, q], "{at:?} for {beyond:?}");
                }
                // The surface continues along the tangent of the edge.
                let (first, last) = (surface.evaluate(edge), surface.evaluate(beyond));
                let tangent = first.point + (out - t) * first.d_t;
                assert!(distance(tangent, last.point) < 4e-16 && distance(first.d_t, last.d_t) < 4e-16);
                // Further out the point is lost, and it is found again from the last one.
                let gone = x + outwards * (reach + 1e-6) * last.d_t;
                let Projection::BeyondEdge { place: last } = surface.project(gone, guess) else {
                    panic!("{:?} is out of reach", surface.project(gone, guess));
                };
                assert!((last.t - t - outwards * reach).abs() < 1e-8 && last.patch == [p, q], "{last:?} for {edge:?}");
                found(surface.project(x, last));
            }
        }
    }
}

#[test]
fn facets_project_to_flats_and_corners() {
    let around = 12;
    let facets = |radius: CasingShape| {
        let points = data(around, 3, radius);
        SurfaceSpline::new(&points, around, 3, Closure::Smooth, Interpolation::Facets).unwrap()
    };
    // Inside a convex polygon the nearest of two flats is closest, never the corner between them.
    let surface = facets(round);
    let corner = surface.evaluate(place(3, 0, 0.0, 0.5)).point;
    let inwards = Vector3::new(-corner[0] / RADIUS, -corner[1] / RADIUS, 0.0);
    let half = TAU / 24.0;
    for guess in 0..around {
        let x = corner + 1e-3 * inwards;
        let (at, _, normal, gap) = found(surface.project(x, place(guess, 1, 0.2, 0.9)));
        assert!((gap - 1e-3 * half.cos()).abs() < 4e-16, "{gap}");
        assert!((normal.dot(&inwards) - half.cos()).abs() < 4e-15 && at.patch[0].abs_diff(2) <= 1);
        // Outside, the corner is the closest point.
        let x = corner - 1e-3 * inwards;
        let (at, point, normal, gap) = found(surface.project(x, place(guess, 1, 0.2, 0.9)));
        assert!(distance(point, corner) < 1e-15 && (gap + 1e-3 * half.cos()).abs() < 4e-16, "{gap} at {at:?}");
        assert!((normal.dot(&inwards) - half.cos()).abs() < 4e-15);
    }
    // Turned slightly around the corner, the facet on that side faces the node more directly.
    let tangent = Vector3::new(-inwards[1], inwards[0], 0.0);
    for side in [-1.0, 1.0] {
        let x = corner - 1e-3 * inwards - side * 1e-4 * tangent;
        let (at, point, _, _) = found(surface.project(x, place(8, 1, 0.2, 0.9)));
        assert!(distance(point, corner) < 1e-15);
        assert_eq!(at.patch[0], if side > 0.0 { 3 } else { 2 });
    }
    // A ridge towards the axis: inside, its edge is closest over a whole wedge.
    let surface = facets(|angle, _| if (angle - 0.3 - TAU / 4.0).abs() < 1e-9 { 0.75 * RADIUS } else { RADIUS });
    let ridge = surface.evaluate(place(3, 1, 0.0, 0.5)).point;
    let x = Vector3::new(0.99 * ridge[0], 0.99 * ridge[1], ridge[2]);
    for guess in [1, 2, 3, 4] {
        let (_, point, normal, gap) = found(surface.project(x, place(guess, 0, 0.6, 0.2)));
        assert!(distance(point, ridge) < 1e-15, "{point:?} {ridge:?}");
        assert!(gap > 0.0 && gap < distance(x, ridge) && normal.dot(&ridge) < 0.0);
    }
}

#[test]
fn initial_guess_from_angle_and_axial_position_is_close() {
    for (surface, _) in every_surface() {
        let mut random = SeededRandom(10);
        for _ in 0..100 {
            let at = anywhere(&mut random, &surface);
            let (guess, far) = (surface.locate(surface.evaluate(at).point), surface.around());
            let [found, expected] = [guess, at].map(|place| place.patch[0] as f64 + place.s);
            let apart = (found - expected).rem_euclid(far as f64);
            assert!(apart.min(far as f64 - apart) < 0.3, "{guess:?} for {at:?}");
            let axial = |place: ClosestPoint| surface.evaluate(place).point[2];
            assert!((axial(guess) - axial(at)).abs() < 0.3 * 0.06 / (surface.along() - 1) as f64);
            let turned = surface.advance(at, 1.25);
            let expected = (expected + 0.25 * far as f64).rem_euclid(far as f64);
            assert!(
                (turned.patch[0] as f64 + turned.s - expected).abs() < 1e-9 && turned.t.to_bits() == at.t.to_bits()
            );
        }
        let nowhere = surface.locate(Vector3::new(f64::NAN, 0.1, f64::NAN));
        surface.evaluate(nowhere);
    }
}

#[test]
fn unprojectable_nodes_are_reported_without_panic() {
    for (surface, _) in every_surface() {
        let start = place(0, 0, 0.5, 0.5);
        for x in [[f64::NAN, 0.0, 0.0], [0.1, f64::INFINITY, 0.0], [0.1, 0.1, f64::NEG_INFINITY]] {
            assert_eq!(surface.project(x.into(), start), Projection::Lost);
        }
        let inside = Vector3::new(0.2, 0.1, 0.0);
        assert_eq!(surface.project(inside, place(0, 0, f64::NAN, 0.5)), Projection::Lost);
        let x = node(&surface, start, 1e-4);
        for (s, t) in [(7.3, 0.5), (0.5, -40.0), (f64::INFINITY, f64::NEG_INFINITY), (1.01, 1.01)] {
            let gap = found(surface.project(x, place(0, 0, s, t))).3;
            assert!((gap - 1e-4).abs() < 4e-16, "started from a place that is none: {gap:e}");
        }
        let mut folded = surface.clone();
        folded.set_control_points(|_| Vector3::new(0.1, 0.2, 0.3));
        assert_eq!(folded.project(inside, start), Projection::Lost);
        folded.set_control_points(|_| Vector3::repeat(f64::NAN));
        assert_eq!(folded.project(inside, start), Projection::Lost);
        // Far away and on the axis either a point is found or the node is over an edge.
        for x in [[1e6, 0.0, 0.0], [0.0, 0.0, 0.0], [-1e-300, 0.0, 0.0], [1.0, 2.0, -1e9], [1e200, 1e200, 0.0]] {
            surface.project(x.into(), start);
        }
    }
}

#[test]
fn warm_start_finds_the_same_solution() {
    let mut random = SeededRandom(11);
    for (closure, interpolation) in KINDS {
        let (around, along, turn) = (36, 5, 1e-3);
        let surface = SurfaceSpline::new(&data(around, along, lobed), around, along, closure, interpolation).unwrap();
        let (mut normals, mut gaps): (f64, f64) = (0.0, 0.0);
        let mut guess = place(34, 1, 0.2, 0.5);
        for step in 0..2500 {
            let (angle, z) = (TAU * f64::from(step) * turn - 0.1, 0.02 * (0.01 * f64::from(step)).sin());
            let r = lobed(angle - 0.3, z) - 4e-4 + 5e-4 * (0.3 * f64::from(step)).sin();
            let x = Vector3::new(r * angle.cos(), r * angle.sin(), z);
            let warm = found(surface.project(x, surface.advance(guess, turn)));
            let located = found(surface.project(x, surface.locate(x)));
            let cold = found(surface.project(x, ClosestPoint { t: 0.5, ..anywhere(&mut random, &surface) }));
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
fn facets_kick_a_sliding_node_and_splines_do_not() {
    use sliding::{AROUND, INTERFERENCE, MASS, SPEED, STEP, STIFFNESS, casing, slide};
    let largest = |history: &sliding::SlidingHistory| history.changes().into_iter().fold(0.0, f64::max);
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
    // The spline reproduces the force of the spring, up to its deviation from the circle.
    let [least, most] = smooth.range();
    let ripple = 1.5 * STIFFNESS * 6.1e-7;
    assert!(least > STIFFNESS * INTERFERENCE - ripple && most < STIFFNESS * INTERFERENCE + ripple, "{least}..{most}");
    println!("largest changes: {:.3e} {:.3e} {:.3e} N", largest(&facets), largest(&free), largest(&smooth));
    assert!(largest(&smooth) < 1e-2 && largest(&facets) > 6e4 && largest(&free) > 3e4);
    // Far from the seam both closures agree.
    let far = |history: &sliding::SlidingHistory| history.changes()[100..5000].iter().copied().fold(0.0, f64::max);
    assert!(far(&free) < 2e-2, "{:e}", far(&free));
}

#[test]
fn allocates_only_during_construction() {
    for (mut surface, points) in every_surface() {
        let mut values = surface.control_points().to_vec();
        let mut random = SeededRandom(12);
        let starts: Vec<ClosestPoint> = (0..50).map(|_| anywhere(&mut random, &surface)).collect();
        let allocations = counting::allocations_of(|| {
            surface.interpolate(&mut values);
            surface.set_control_points(|index| values[index]);
            surface.set_data(&points).unwrap();
            for start in &starts {
                let x = 0.998 * surface.evaluate(*start).point;
                for guess in [*start, starts[0], surface.locate(x), surface.advance(*start, 0.01)] {
                    if let Projection::Found { gap, .. } = surface.project(x, guess) {
                        values[0][0] += surface.weights(gap.foot).values[0];
                    }
                }
            }
        });
        assert_eq!(allocations, 0);
    }
}
