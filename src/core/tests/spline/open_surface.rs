//! Open surfaces: interpolation, free edges on all sides, closest points, against an independent implementation.

#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

use crate::casings::{SeededRandom, assert_below, distance};
use tiprub_core::geometry::Vector3;
use tiprub_core::geometry::surface_spline::{ClosestPoint, Projection, SurfaceSpline};
use tiprub_core::scene::settings::Interpolation;
use tiprub_reference::surface::{SplineSurface, SurfaceKind};

const KINDS: [Interpolation; 2] = [Interpolation::Spline, Interpolation::Facets];
const GRIDS: [(usize, usize); 6] = [(2, 2), (2, 5), (3, 3), (4, 2), (9, 41), (12, 7)];

/// Returns a bent and twisted sheet with random dents, far from the origin.
fn sheet(around: usize, along: usize) -> Vec<[f64; 3]> {
    let mut random = SeededRandom(5 + (around * along) as u64);
    let share = |index: usize, count: usize| index as f64 / (count - 1) as f64 - 0.5;
    (0..around * along)
        .map(|index| {
            let (u, v) = (share(index % around, around), share(index / around, along));
            let dent = random.vector(2e-5);
            let point =
                [0.4 + 0.1 * u + 0.01 * v, -0.3 + 0.2 * v - 0.01 * u, 0.03 * v * v + 0.02 * u * u + 0.02 * u * v];
            std::array::from_fn(|i| point[i] + dent[i])
        })
        .collect()
}

fn open(around: usize, along: usize, kind: Interpolation) -> (SurfaceSpline, Vec<[f64; 3]>) {
    let points = sheet(around, along);
    (SurfaceSpline::open(&points, around, along, kind).unwrap(), points)
}

fn place(p: usize, q: usize, s: f64, t: f64) -> ClosestPoint {
    ClosestPoint { patch: [p, q], s, t }
}

/// Returns the surface point of a data point.
fn at(index: usize, around: usize, along: usize) -> ClosestPoint {
    let (i, j) = (index % around, index / around);
    let (p, q) = (i.min(around - 2), j.min(along - 2));
    place(p, q, (i - p) as f64, (j - q) as f64)
}

#[test]
fn interpolation_is_exact_and_weights_add_up_to_one() {
    let (mut off, mut partition) = (0.0_f64, 0.0_f64);
    for (around, along) in GRIDS {
        for kind in KINDS {
            let (surface, points) = open(around, along, kind);
            for (index, point) in points.iter().enumerate() {
                off = off.max(distance(surface.evaluate(at(index, around, along)).point, *point));
            }
            let mut random = SeededRandom(3);
            for _ in 0..200 {
                let place = place(random.below(around - 1), random.below(along - 1), random.unit(), random.unit());
                let weights = surface.weights(place);
                partition = partition.max((weights.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs());
            }
        }
    }
    assert_below("interpolation (m)", off, 4e-16);
    assert_below("partition of unity", partition, 2e-15);
}

#[test]
fn the_second_derivative_vanishes_across_all_four_edges() {
    for (around, along) in [(3, 3), (9, 41), (12, 7)] {
        let (surface, points) = open(around, along, Interpolation::Spline);
        let bend = distance(points[0], points[1]) + distance(points[0], points[around]);
        let mut off = 0.0_f64;
        for index in 0..5 {
            let x = 0.2 * f64::from(index);
            for q in 0..along - 1 {
                for (p, s) in [(0, 0.0), (around - 2, 1.0)] {
                    off = off.max(surface.evaluate(place(p, q, s, x)).d_ss.norm());
                }
            }
            for p in 0..around - 1 {
                for (q, t) in [(0, 0.0), (along - 2, 1.0)] {
                    off = off.max(surface.evaluate(place(p, q, x, t)).d_tt.norm());
                }
            }
        }
        assert_below(&format!("{around} x {along}: second derivative at the edges, relative"), off / bend, 1e-13);
    }
}

#[test]
fn patches_join_with_two_continuous_derivatives() {
    let (surface, _) = open(9, 41, Interpolation::Spline);
    let mut off = 0.0_f64;
    for (p, q) in (0..7).flat_map(|p| (0..39).map(move |q| (p, q))) {
        let pairs =
            [(place(p, q, 1.0, 0.3), place(p + 1, q, 0.0, 0.3)), (place(p, q, 0.6, 1.0), place(p, q + 1, 0.6, 0.0))];
        for (a, b) in pairs.map(|(a, b)| (surface.evaluate(a), surface.evaluate(b))) {
            for (a, b) in [
                (a.point, b.point),
                (a.d_s, b.d_s),
                (a.d_t, b.d_t),
                (a.d_ss, b.d_ss),
                (a.d_tt, b.d_tt),
                (a.d_st, b.d_st),
            ] {
                off = off.max(distance(a, b));
            }
        }
    }
    assert_below("jump at borders of patches (m)", off, 5e-16);
}

/// Returns the parameters of a surface point over the whole grid.
fn parameters(place: ClosestPoint) -> [f64; 2] {
    [place.patch[0] as f64 + place.s, place.patch[1] as f64 + place.t]
}

#[test]
fn closest_points_and_gaps_match_the_reference() {
    for (kind, reference) in
        [(Interpolation::Spline, SurfaceKind::Spline), (Interpolation::Facets, SurfaceKind::Facets)]
    {
        let (around, along) = (9, 41);
        let (surface, points) = open(around, along, kind);
        // The rows of the reference are those of the core, but it has its own S_s × S_t, with s from row to row.
        let other = SplineSurface::new(reference, along, around, 1.0);
        let carriers = other.carriers(&points);
        let (mut gaps, mut normals, mut found) = (0.0_f64, 0.0_f64, 0);
        let mut random = SeededRandom(11);
        for _ in 0..3000 {
            let start = place(random.below(around - 1), random.below(along - 1), random.unit(), random.unit());
            let foot = surface.evaluate(start);
            let Projection::Found { gap, .. } = surface.project(foot.point, start) else { panic!("on the surface") };
            let height = random.within(-1e-3, 1e-3);
            let x = foot.point + height * gap.normal;
            let cold = surface.locate(x);
            let Projection::Found { gap, .. } = surface.project(x, cold) else { continue };
            let [s, t] = parameters(gap.foot);
            let Some(theirs) = other.foot(x.into(), &carriers, [t, s]) else { continue };
            found += 1;
            gaps = gaps.max((gap.distance - theirs.gap).abs());
            // On a crease between facets both normals are correct.
            let on_crease =
                kind == Interpolation::Facets && [gap.foot.s, gap.foot.t].iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9);
            if !on_crease {
                normals = normals.max(distance(gap.normal, theirs.normal));
            }
        }
        println!("{kind:?}: {found} of 3000 places");
        assert!(found > 2500);
        assert_below(&format!("{kind:?}: gaps apart (m)"), gaps, 1e-15);
        assert_below(&format!("{kind:?}: normals apart"), normals, 1e-9);
    }
}

#[test]
fn normal_direction_follows_grid_orientation() {
    // s along x, t along y: S_t × S_s points to −z.
    let points: Vec<[f64; 3]> = (0..12).map(|index| [f64::from(index % 4), f64::from(index / 4), 0.0]).collect();
    for kind in KINDS {
        let surface = SurfaceSpline::open(&points, 4, 3, kind).unwrap();
        for z in [-0.2, 0.3] {
            let x = Vector3::new(1.3, 0.8, z);
            let Projection::Found { point, gap } = surface.project(x, surface.locate(x)) else { panic!() };
            assert!(distance(point, [1.3, 0.8, 0.0]) < 1e-14 && distance(gap.normal, -Vector3::z()) < 1e-15);
            assert!((gap.distance + z).abs() < 1e-15, "{gap:?}");
        }
    }
}

#[test]
fn nodes_beyond_any_edge_are_off_the_surface() {
    let points: Vec<[f64; 3]> = (0..12).map(|index| [f64::from(index % 4), f64::from(index / 4), 0.0]).collect();
    for kind in KINDS {
        let surface = SurfaceSpline::open(&points, 4, 3, kind).unwrap();
        let beyond =
            |x: Vector3, start: ClosestPoint| matches!(surface.project(x, start), Projection::BeyondEdge { .. });
        for (x, y) in
            [(-0.1, 1.0), (3.1, 1.0), (1.5, -0.1), (1.5, 2.1), (-0.1, -0.1), (3.2, 2.2), (40.0, 1.0), (1.0, -70.0)]
        {
            let node = Vector3::new(x, y, 0.1);
            for start in [surface.locate(node), place(1, 1, 0.5, 0.5)] {
                assert!(beyond(node, start), "{kind:?}: ({x}, {y}) from {start:?}");
            }
        }
        // A point exactly on an edge is still on the surface.
        for (x, y) in [(0.0, 1.0), (3.0, 0.4), (1.2, 0.0), (2.9, 2.0), (0.0, 0.0), (3.0, 2.0)] {
            let node = Vector3::new(x, y, 0.1);
            assert!(!beyond(node, surface.locate(node)), "{kind:?}: ({x}, {y})");
        }
    }
}

#[test]
fn warm_starts_follow_a_node_across_the_surface_and_off_it() {
    for kind in KINDS {
        let (surface, points) = open(9, 41, kind);
        let [first, last] = [4, 40 * 9 + 4].map(|index| Vector3::from(points[index]));
        let mut place = surface.locate(first);
        let (mut found, mut left) = (0, 0);
        for step in 0..2000 {
            let x = -0.5 + f64::from(step) * 1e-3;
            let point = first + x * (last - first) + 2e-3 * Vector3::z();
            let cold = surface.project(point, surface.locate(point));
            match (surface.project(point, place), cold) {
                (Projection::Found { gap, .. }, Projection::Found { gap: cold, .. }) => {
                    assert!((gap.distance - cold.distance).abs() < 1e-14, "{kind:?} at {x}: {gap:?} and {cold:?}");
                    (place, found) = (gap.foot, found + 1);
                }
                (Projection::BeyondEdge { place: next }, Projection::BeyondEdge { .. }) => {
                    (place, left) = (next, left + 1);
                }
                other => panic!("{kind:?} at {x}: {other:?}"),
            }
        }
        assert!(found > 900 && left > 900, "{found} on, {left} off");
    }
}

#[test]
fn projects_onto_distant_surfaces() {
    for kind in KINDS {
        let (surface, _) = open(9, 41, kind);
        let mut random = SeededRandom(23);
        let mut off = 0.0_f64;
        for _ in 0..2000 {
            let x = Vector3::from(random.vector(30.0));
            match surface.project(x, surface.locate(x)) {
                Projection::Lost => panic!("{kind:?}: lost {x:?}"),
                Projection::BeyondEdge { .. } => {}
                // On a crease between facets the node is not on the normal.
                Projection::Found { point, gap } => {
                    let (gap, distance) = (gap.distance.abs(), distance(x, point));
                    if kind == Interpolation::Facets {
                        assert!(gap <= distance * (1.0 + 1e-14), "{gap} m, {distance} m");
                    } else {
                        off = off.max((distance - gap).abs() / gap);
                    }
                }
            }
        }
        // The residual is parallel to the normal.
        assert_below(&format!("{kind:?}: distance and gap, relative"), off, 1e-12);
    }
}

#[test]
fn rejects_invalid_grids() {
    let refused = |points: &[[f64; 3]], around, along| {
        SurfaceSpline::open(points, around, along, Interpolation::Spline).unwrap_err().to_string()
    };
    let points = sheet(4, 3);
    assert!(refused(&points, 12, 1).contains("2 x 2"));
    assert!(refused(&points, 4, 4).contains("12 data points"));
    let mut broken = points.clone();
    broken[5][1] = f64::NAN;
    assert!(refused(&broken, 4, 3).contains("data point 6"));
}
