//! Time of the surface spline per contact node and step: closest point from the last one, weights, and the control points of a moving
//! casing. `cargo bench -p tiprub-core --bench spline` prints one table of medians.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use tiprub_core::geometry::Vector3;
use tiprub_core::geometry::surface_spline::{ClosestPoint, Projection, SurfaceSpline};
use tiprub_core::scene::settings::{Closure, Interpolation};

const RADIUS: f64 = 0.25;
const NODES: usize = 108;
const STEPS: usize = 2000;
/// Rotor 37 at design speed.
const SPEED: f64 = 1800.0;

fn data(around: usize, along: usize) -> Vec<[f64; 3]> {
    let point = |index: usize| {
        let angle = TAU * (index % around) as f64 / around as f64;
        let z = -0.03 + 0.06 * (index / around) as f64 / (along - 1) as f64;
        let r = RADIUS - 0.25 * z - 2e-4 * (2.0 * angle).cos();
        [r * angle.cos(), r * angle.sin(), z]
    };
    (0..around * along).map(point).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Measures nanoseconds per projection of nodes that turn by Ω h per step and vibrate; with `advanced` the start moves along.
fn projections(surface: &SurfaceSpline, h: f64, advanced: bool) -> f64 {
    let node = |index: usize, step: usize| {
        let phase = index as f64;
        let time = step as f64 * h;
        let angle = TAU * (index / 3) as f64 / 36.0 + 0.05 * (index % 3) as f64 + SPEED * time;
        let z = -0.02 + 0.02 * (index % 3) as f64;
        let r = RADIUS - 0.25 * z - 1e-3 + 1e-4 * (12_000.0 * time + phase).sin();
        let angle = angle + 4e-4 * (9_000.0 * time + 2.0 * phase).sin();
        Vector3::new(r * angle.cos(), r * angle.sin(), z)
    };
    let turns = if advanced { SPEED * h / TAU } else { 0.0 };
    let mut places: Vec<ClosestPoint> = (0..NODES).map(|index| surface.locate(node(index, 0))).collect();
    let mut points = vec![Vector3::zeros(); NODES];
    let mut times = Vec::new();
    for step in 0..STEPS {
        points.iter_mut().enumerate().for_each(|(index, point)| *point = node(index, step));
        let start = Instant::now();
        let mut sum = 0.0;
        for (point, place) in points.iter().zip(&mut places) {
            let guess = if advanced { surface.advance(*place, turns) } else { *place };
            match surface.project(*point, guess) {
                Projection::Found { gap, .. } => {
                    sum += gap.distance;
                    *place = gap.foot;
                }
                other => panic!("{other:?}"),
            }
        }
        black_box(sum);
        times.push(start.elapsed().as_secs_f64() / NODES as f64 * 1e9);
    }
    median(times)
}

fn per_call(count: usize, mut call: impl FnMut(usize)) -> f64 {
    let mut times = Vec::new();
    for _ in 0..200 {
        let start = Instant::now();
        (0..count).for_each(&mut call);
        times.push(start.elapsed().as_secs_f64() / count as f64 * 1e9);
    }
    median(times)
}

fn main() {
    let (around, along) = (72, 5);
    let points = data(around, along);
    let of = |closure, interpolation| SurfaceSpline::new(&points, around, along, closure, interpolation).unwrap();
    let spline = of(Closure::Smooth, Interpolation::Spline);
    println!("{around} x {along} data points, {NODES} nodes at {SPEED} rad/s, medians");
    for h in [1e-7, 1e-6] {
        for advanced in [true, false] {
            let time = projections(&spline, h, advanced);
            println!("project, h = {h:e} s, start moved with the rotor: {advanced}: {time:.0} ns per node");
        }
    }
    let time = projections(&of(Closure::FreeEnds, Interpolation::Spline), 1e-7, true);
    println!("project, free ends: {time:.0} ns per node");
    let time = projections(&of(Closure::Smooth, Interpolation::Facets), 1e-7, true);
    println!("project, facets: {time:.0} ns per node");
    let places: Vec<ClosestPoint> =
        (0..NODES).map(|index| spline.locate(points[(index * 7) % points.len()].into())).collect();
    let time = per_call(NODES, |index| {
        black_box(spline.evaluate(black_box(places[index])));
    });
    println!("evaluate: {time:.0} ns");
    let time = per_call(NODES, |index| {
        black_box(spline.weights(black_box(places[index])));
    });
    println!("weights: {time:.0} ns");
    let time = per_call(NODES, |index| {
        black_box(spline.locate(black_box(points[index].into())));
    });
    println!("locate: {time:.0} ns");
    let mut moved = spline.clone();
    let control = spline.control_points().to_vec();
    let time = per_call(50, |_| moved.set_control_points(|index| black_box(&control)[index]));
    println!("set_control_points, {} points: {time:.0} ns", control.len());
    let mut values = control.clone();
    let time = per_call(20, |_| spline.interpolate(black_box(&mut values)));
    println!("interpolate, {} points: {time:.0} ns", values.len());
}
