//! Casings through data points, and random points on them.

#![allow(dead_code, reason = "each test binary uses its part")]

use std::f64::consts::TAU;

use tiprub_core::geometry::Vector3;
use tiprub_core::geometry::surface_spline::{ClosestPoint, SurfaceSpline};
use tiprub_core::scene::settings::{Closure, Interpolation};
pub use tiprub_test_models::SeededRandom;

pub const RADIUS: f64 = 0.25;
pub const EPS: f64 = f64::EPSILON;

/// Returns a random point on a surface.
pub fn anywhere(random: &mut SeededRandom, surface: &SurfaceSpline) -> ClosestPoint {
    ClosestPoint {
        patch: [random.below(surface.around()), random.below(surface.along() - 1)],
        s: random.unit(),
        t: random.unit(),
    }
}

/// Returns the rings of a casing, unevenly spaced in z, from a radius r(θ, z).
pub fn data(around: usize, along: usize, radius: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
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

pub type CasingShape = fn(f64, f64) -> f64;

pub fn round(_angle: f64, _z: f64) -> f64 {
    RADIUS
}

pub fn conical(_angle: f64, z: f64) -> f64 {
    RADIUS - 0.3 * z
}

pub fn lobed(angle: f64, z: f64) -> f64 {
    RADIUS - 0.2 * z - 1.5e-3 * (3.0 * angle + 10.0 * z).cos() + 2.0 * z * z
}

/// Returns a casing with random dents of 20 µm.
pub fn rough(around: usize, along: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = SeededRandom(seed);
    let mut points = data(around, along, lobed);
    points.iter_mut().for_each(|point| {
        let dent = random.vector(2e-5);
        *point = std::array::from_fn(|i| point[i] + dent[i]);
    });
    points
}

pub const KINDS: [(Closure, Interpolation); 3] = [
    (Closure::Smooth, Interpolation::Spline),
    (Closure::FreeEnds, Interpolation::Spline),
    (Closure::Smooth, Interpolation::Facets),
];
pub const GRIDS: [(usize, usize); 6] = [(4, 2), (5, 3), (7, 4), (36, 5), (72, 2), (144, 9)];

pub fn every_surface() -> Vec<(SurfaceSpline, Vec<[f64; 3]>)> {
    let mut surfaces = Vec::new();
    for (around, along) in GRIDS {
        for (closure, interpolation) in KINDS {
            let points = rough(around, along, 7 + around as u64);
            surfaces.push((SurfaceSpline::new(&points, around, along, closure, interpolation).unwrap(), points));
        }
    }
    surfaces
}

pub fn spline(points: &[[f64; 3]], around: usize, along: usize) -> SurfaceSpline {
    SurfaceSpline::new(points, around, along, Closure::Smooth, Interpolation::Spline).unwrap()
}

pub fn distance(a: impl Into<Vector3>, b: impl Into<Vector3>) -> f64 {
    (a.into() - b.into()).norm()
}

pub fn place(p: usize, q: usize, s: f64, t: f64) -> ClosestPoint {
    ClosestPoint { patch: [p, q], s, t }
}

/// Asserts that an error is below an absolute bound, and reports both otherwise.
#[track_caller]
pub fn assert_below(name: &str, error: f64, bound: f64) {
    println!("{name}: {error:.2e} (bound {bound:.1e})");
    assert!(error <= bound, "{name}: {error:e} > {bound:e}");
}
