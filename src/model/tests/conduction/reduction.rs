//! Reduction of a casing against its full model: steady states, transients by another method, heat through the
//! surfaces.

use std::f64::consts::PI;

use faer::Mat;
use tiprub_core::CoSimulation;
use tiprub_model::casing::{ContactRings, InnerContour, RingCounts, RingGeometry, RingSupport, supported_ring};
use tiprub_model::conduction::{
    ConductionOptions, Conductor, FullConduction, reduce_conduction, reduce_ring_conduction,
};
use tiprub_model::progress::silent;
use tiprub_model::sparse::SparseMatrix;
use tiprub_model::thermal::equal_patches;
use tiprub_model::{CasingOptions, Mesh};
use tiprub_thermal::ThermalSimulation;

use super::{get, options, set, wall, whole};
use crate::common::casing::coarse;

fn casing() -> CasingOptions {
    CasingOptions { patches: [12, 1], ..coarse(RingSupport::Low) }
}

fn of_casing(modes: usize) -> ConductionOptions {
    options([500.0, 25.0], CasingOptions::default().rings.axial, modes)
}

#[test]
fn steady_states_match_full_model() {
    let reduced = reduce_ring_conduction(&casing(), &of_casing(20), &silent).unwrap();
    println!("{} coordinates; {:?}", reduced.model.order(), reduced.checks);
    for check in &reduced.checks {
        let most = if check.factors.iter().all(|factor| (factor - 1.0).abs() < 1e-12) { 1e-9 } else { 4e-3 };
        assert!(check.patches < most && check.surfaces < 5.0 * most, "{check:?}");
    }
    // The patches of a ring are equal.
    let means = &reduced.model.patch_means * &reduced.model.heat_loads;
    assert!((means[(0, 0)] / means[(7, 7)] - 1.0).abs() < 1e-6);
}

/// A titanium cylinder conducts so badly along its axis that its slowest rates nearly coincide: the smaller basis of
/// fewer modes also finds them.
#[test]
fn reduces_a_casing_with_nearly_equal_decay_rates() {
    let cylinder = CasingOptions {
        name: "cylinder".into(),
        geometry: RingGeometry {
            contour: InnerContour::new(&[[0.0, 0.25], [0.1, 0.25]]).unwrap(),
            thickness: 4e-3,
            flanges: [None, None],
        },
        counts: RingCounts { around: 24, through: 1, along: 6, flange: 1 },
        rings: ContactRings { around: 24, along: 3, axial: [0.01, 0.09] },
        patches: [12, 1],
        ..CasingOptions::default()
    };
    let reduced = [5, 20, 60].map(|modes| {
        let options = ConductionOptions {
            density: 4430.0,
            conductor: Conductor::titanium(),
            ..options([700.0, 40.0], [0.01, 0.09], modes)
        };
        reduce_ring_conduction(&cylinder, &options, &silent).unwrap()
    });
    let [few, some, many] = reduced.map(|reduced| reduced.time_constants);
    println!("{:?}", &many[..20]);
    assert!(many[0] / many[1] < 1.001, "{:?}", &many[..2]);
    for own in [&few, &some] {
        for (found, expected) in own.iter().zip(&many) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }
}

/// Areas, capacity and conductance against those of a cylinder with flanges: the mesh is round.
#[test]
fn casing_has_correct_heat_capacity_areas_and_conductance() {
    let options = CasingOptions::default();
    let reduced = reduce_ring_conduction(&options, &of_casing(4), &silent).unwrap();
    let [low, high] = options.geometry.contour.axial();
    let slices = 4000;
    let along = |from: f64, to: f64, of: &dyn Fn(f64) -> f64| -> f64 {
        let step = (to - from) / f64::from(slices);
        (0..slices).map(|i| of(from + (f64::from(i) + 0.5) * step) * step).sum()
    };
    let radius = |z: f64| options.geometry.contour.radius(z);
    let inner = along(low, high, &|z| 2.0 * PI * radius(z) * (1.0 + options.geometry.contour.slope(z).powi(2)).sqrt());
    assert!((reduced.areas[0] / inner - 1.0).abs() < 1e-4, "{} against {inner}", reduced.areas[0]);
    let [first, last] = options.rings.axial;
    let heated =
        along(first, last, &|z| 2.0 * PI * radius(z) * (1.0 + options.geometry.contour.slope(z).powi(2)).sqrt());
    assert!((reduced.areas[2] / heated - 1.0).abs() < 1e-4, "{} against {heated}", reduced.areas[2]);
    let ring = |inner: f64, height: f64| PI * ((inner + height).powi(2) - inner * inner);
    let shell = along(low, high, &|z| ring(radius(z), options.geometry.thickness));
    let flange =
        |from: f64, to: f64, height: f64| along(from, to, &|z| ring(radius(z) + options.geometry.thickness, height));
    let [one, other] = options.geometry.flanges.map(|flange| flange.unwrap());
    let volume =
        shell + flange(low, low + one.thickness, one.height) + flange(high - other.thickness, high, other.height);
    let capacity = volume * 7850.0 * 439.8;
    assert!(
        (reduced.model.heat_capacity / capacity - 1.0).abs() < 1e-4,
        "{} against {capacity}",
        reduced.model.heat_capacity
    );
    assert!((reduced.model.gas_conductance() / (500.0 * reduced.areas[0]) - 1.0).abs() < 1e-12);
}

/// Integrates the full model under heat of patch 1 by the trapezoidal rule, from 0 K; returns the temperatures of all
/// patches and surfaces at the given times, and the heat through its films from the means of their surfaces.
fn full_run(full: &FullConduction, times: &[f64], step: f64) -> (Vec<Vec<f64>>, f64) {
    let operator = full.operator([1.0; 2]);
    let left: SparseMatrix = full.capacity.plus_scaled(0.5 * step, &operator);
    let factor = left.factor("C + A h/2", "").unwrap();
    let nodes = full.capacity.order();
    let mut temperatures = Mat::<f64>::zeros(nodes, 1);
    let (mut results, mut time, mut lost) = (Vec::new(), 0.0, 0.0);
    let mean =
        |columns: &Mat<f64>, k: usize, t: &Mat<f64>| -> f64 { (0..nodes).map(|i| columns[(i, k)] * t[(i, 0)]).sum() };
    let conductances = [500.0 * full.areas[0], 25.0 * full.areas[1]];
    let flow = |t: &Mat<f64>| -> f64 { (0..2).map(|side| conductances[side] * mean(&full.wetted, side, t)).sum() };
    for until in times {
        while time < until - 0.5 * step {
            let before = flow(&temperatures);
            let stored = full.capacity.times(temperatures.as_ref());
            let out = operator.times(temperatures.as_ref());
            let right = Mat::from_fn(nodes, 1, |i, _| {
                stored[(i, 0)] - 0.5 * step * out[(i, 0)] + step * 100.0 * full.heat[(i, 0)]
            });
            temperatures = factor.solve(right);
            lost += 0.5 * step * (before + flow(&temperatures));
            time += step;
        }
        let patches = full.heat.ncols();
        results.push(
            (0..patches)
                .map(|k| mean(&full.patch_means, k, &temperatures))
                .chain((0..patches).map(|k| mean(&full.heat, k, &temperatures)))
                .collect(),
        );
    }
    (results, lost)
}

/// The exact step of few coordinates agrees with another method on all nodes, from the start of the transient on.
#[test]
fn transients_match_the_full_model() {
    let casing = casing();
    let mesh = supported_ring(&casing).unwrap().mesh;
    let patches = equal_patches(12, 1, casing.geometry.contour.axial());
    let full = FullConduction::new(&mesh, &patches, &of_casing(1)).unwrap();
    let times = [0.2, 1.0, 4.0, 16.0];
    let (coarser, _) = full_run(&full, &times, 0.02);
    let (finer, lost) = full_run(&full, &times, 0.01);
    // Second order: the error of the steps is a third of the difference.
    let largest = finer.iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
    let steps = coarser.iter().flatten().zip(finer.iter().flatten()).fold(0.0_f64, |a, (b, c)| a.max((b - c).abs()));
    let mut deviations = Vec::new();
    for modes in [5, 20, 60] {
        let model = reduce_conduction(&mesh, &patches, &of_casing(modes), &silent).unwrap().model;
        let mut simulation = ThermalSimulation::new(model).unwrap();
        set(&mut simulation, "casing_heat", 100.0);
        simulation.initialise(0.0).unwrap();
        let (mut time, mut worst) = (0.0, 0.0_f64);
        for (until, expected) in times.iter().zip(&finer) {
            simulation.do_step(time, until - time).unwrap();
            time = *until;
            for (name, part) in [("casing_temperature", &expected[..12]), ("surface_temperature", &expected[12..])] {
                let first = simulation.table().find(name).unwrap().reference;
                for (reference, value) in (first..).zip(part) {
                    worst = worst.max((simulation.real(reference).unwrap() - value).abs() / largest);
                }
            }
        }
        let out = -get(&simulation, "gas_heat") - get(&simulation, "ambient_heat");
        println!(
            "{modes} modes: {worst:.1e} of {largest:.3} K; steps of the rule {:.1e}; heat {out:.6} against {lost:.6} J",
            steps / largest / 3.0
        );
        deviations.push(worst);
        assert!((out / lost - 1.0).abs() < 2e-4, "{out} against {lost}");
        assert!(get(&simulation, "energy_residual_relative").abs() < 1e-13);
    }
    // Growing responses represent the start, modes the end: few are enough.
    assert!(deviations.iter().all(|worst| *worst < 2e-3) && deviations[2] <= 1.01 * deviations[0], "{deviations:?}");
}

#[test]
fn rejects_invalid_options_by_name() {
    let refused = |mesh: &Mesh, options: &ConductionOptions, what: &str| {
        let error = reduce_conduction(mesh, &whole(), options, &silent).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    let mesh = wall(0.02, 2);
    let good = options([500.0, 25.0], [-1.0, 1.0], 2);
    assert!(reduce_conduction(&mesh, &whole(), &good, &silent).is_ok());
    refused(&mesh, &ConductionOptions { films: [0.0, 0.0], ..good.clone() }, "no steady state");
    refused(&mesh, &ConductionOptions { films: [-1.0, 2.0], ..good.clone() }, "non-negative values");
    refused(&mesh, &ConductionOptions { films: [f64::NAN, 2.0], ..good.clone() }, "film coefficients");
    refused(&mesh, &ConductionOptions { density: 0.0, ..good.clone() }, "density");
    refused(&mesh, &ConductionOptions { heated: [3.0, 4.0], ..good.clone() }, "heated surface");
    refused(&mesh, &ConductionOptions { modes: 100_000, ..good.clone() }, "number of modes");
    let error = reduce_conduction(&mesh, &[], &good, &silent).unwrap_err().to_string();
    assert!(error.contains("patches"), "{error}");
    // Two rows, one of which lies beyond the heated part.
    let casing = CasingOptions { patches: [12, 8], ..casing() };
    let error = reduce_ring_conduction(&casing, &of_casing(4), &silent).unwrap_err().to_string();
    assert!(error.contains("no heated face lies in it"), "{error}");
}
