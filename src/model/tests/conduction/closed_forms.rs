//! Walls, cylinders and lumped bodies with closed-form solutions.

use std::f64::consts::PI;

use tiprub_core::CoSimulation;
use tiprub_model::casing::{ContactRings, InnerContour, RingCounts, RingGeometry};
use tiprub_model::conduction::{
    ConductionOptions, ConductionReduction, Conductor, reduce_conduction, reduce_ring_conduction,
};
use tiprub_model::progress::silent;
use tiprub_model::{CasingOptions, Mesh};
use tiprub_thermal::ThermalSimulation;

use super::{get, options, set, wall, whole};

fn reduced(mesh: &Mesh, options: &ConductionOptions) -> ConductionReduction {
    reduce_conduction(mesh, &whole(), options, &silent).unwrap()
}

fn hot(model: tiprub_thermal::ConductionModel, temperature: f64) -> ThermalSimulation {
    let mut simulation = ThermalSimulation::new(model).unwrap();
    set(&mut simulation, "initial_temperature", temperature);
    simulation.initialise(0.0).unwrap();
    simulation
}

/// Returns the mean and gas-side temperature of a wall of thickness L that starts at 1 K and loses heat to a gas of 0
/// K on one side: Σ C exp(−ζ² Fo) with ζ tan ζ = Bi (Carslaw and Jaeger, Conduction of Heat in Solids, 3.11).
fn series(biot: f64, fourier: f64) -> [f64; 2] {
    let (mut mean, mut surface) = (0.0, 0.0);
    for n in 0..60 {
        let (mut low, mut high) = (f64::from(n) * PI, f64::from(n) * PI + 0.5 * PI);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            // ζ sin ζ − Bi cos ζ changes sign there, without the pole of the tangent.
            let value = (middle * middle.sin() - biot * middle.cos()) * if n % 2 == 0 { 1.0 } else { -1.0 };
            if value < 0.0 { low = middle } else { high = middle }
        }
        let zeta = 0.5 * (low + high);
        let factor = 4.0 * zeta.sin() / (2.0 * zeta + (2.0 * zeta).sin()) * (-zeta * zeta * fourier).exp();
        mean += factor * zeta.sin() / zeta;
        surface += factor * zeta.cos();
    }
    [mean, surface]
}

/// Returns the largest deviation of mean and surface from the series over the given Fourier numbers.
fn deviation(elements: usize, modes: usize, fouriers: &[f64]) -> f64 {
    let (thickness, biot) = (0.02, 1.0);
    let Conductor { conductivity, specific_heat } = Conductor::steel();
    let mesh = wall(thickness, elements);
    let model = reduced(&mesh, &options([biot * conductivity / thickness, 0.0], [-1.0, 1.0], modes)).model;
    let mut simulation = hot(model, 1.0);
    let per_second = conductivity / (7850.0 * specific_heat * thickness * thickness);
    let (mut time, mut worst) = (0.0, 0.0_f64);
    for fourier in fouriers {
        let next = fourier / per_second;
        simulation.do_step(time, next - time).unwrap();
        time = next;
        let [mean, surface] = series(biot, *fourier);
        worst = worst.max((get(&simulation, "temperature_mean") - mean).abs());
        worst = worst.max((get(&simulation, "gas_surface_temperature") - surface).abs());
    }
    // Fast rates over long steps amplify rounding in the relative residual.
    let residual = get(&simulation, "energy_residual_relative");
    assert!(residual.abs() < 1e-11, "{residual}");
    worst
}

#[test]
fn wall_cooling_matches_series_solution() {
    let times = [0.1, 0.3, 1.0, 3.0];
    let meshes = [1, 2, 4, 8].map(|elements| deviation(elements, 3 * elements, &times));
    println!("wall, by elements: {meshes:?}");
    // Quadratic elements: eigenvalues converge with h⁴.
    assert!(meshes[3] < 2e-6, "{meshes:?}");
    assert!(meshes[1] / meshes[2] > 8.0 && meshes[2] / meshes[3] > 8.0, "{meshes:?}");
    let modes = [1, 2, 4, 8].map(|modes| deviation(8, modes, &times));
    println!("wall, by modes: {modes:?}");
    // The basis already contains growing responses.
    assert!(modes.iter().all(|worst| *worst < 1e-4) && modes[3] < 2e-6, "{modes:?}");
}

/// A thick wall from 0 K under a constant flux q, in single steps: T = 2q/k √(αt/π) at its surface (Carslaw and
/// Jaeger, 2.9). Elements resolve it from their diffusion time on; shorter steps cause one warning.
#[test]
fn warns_of_steps_below_the_diffusion_time_of_an_element() {
    let (thickness, elements) = (0.04, 8);
    let Conductor { conductivity, specific_heat } = Conductor::steel();
    let diffusivity = conductivity / (7850.0 * specific_heat);
    let model = reduced(&wall(thickness, elements), &options([1.0, 0.0], [-1.0, 1.0], 3 * elements)).model;
    let depth = thickness / elements as f64;
    assert!((model.element_time * diffusivity / (depth * depth) - 1.0).abs() < 1e-9, "{}", model.element_time);
    let (flux, area) = (1e5, 1e-4);
    println!("| step, of the diffusion time of an element | surface, against the closed form | warned |");
    let low = [1e-3, 1e-2, 0.1, 0.99, 1.01, 4.0].map(|share| {
        let step = share * model.element_time;
        let mut simulation = ThermalSimulation::new(model.clone()).unwrap();
        set(&mut simulation, "casing_heat", flux * area);
        simulation.initialise(0.0).unwrap();
        simulation.do_step(0.0, step).unwrap();
        let expected = 2.0 * flux / conductivity * (diffusivity * step / PI).sqrt();
        let off = get(&simulation, "surface_temperature") / expected - 1.0;
        let notes = simulation.take_notes();
        println!("| {share} | {off:.3} | {} |", notes.len());
        assert_eq!(notes.len(), usize::from(share < 1.0), "{notes:?}");
        if let Some(note) = notes.first() {
            for part in ["wall: the communication step of", "surface_temperature", "--mesh"] {
                assert!(note.contains(part), "{part:?} is not in {note:?}");
            }
        }
        simulation.do_step(step, step).unwrap();
        simulation.reset();
        simulation.initialise(0.0).unwrap();
        simulation.do_step(0.0, step).unwrap();
        assert!(simulation.take_notes().is_empty(), "once for an instance");
        off
    });
    assert!(low[0] < -0.5 && low[4].abs() < 0.1 && low[5].abs() < 0.05, "{low:?}");
}

/// Returns a casing without flanges: a cylinder of radii a and b with adiabatic end faces.
fn cylinder(around: usize, through: usize) -> CasingOptions {
    let contour = InnerContour::new(&[[0.0, 0.05], [0.02, 0.05]]).unwrap();
    CasingOptions {
        name: "cylinder".into(),
        geometry: RingGeometry { contour, thickness: 0.05, flanges: [None, None] },
        counts: RingCounts { around, through, along: 2, flange: 1 },
        rings: ContactRings { around: 4, along: 2, axial: [0.005, 0.015] },
        patches: [4, 1],
        ..CasingOptions::default()
    }
}

#[test]
fn heat_flow_through_a_cylinder_is_logarithmic() {
    let (a, b, length, k) = (0.05, 0.1, 0.02, 5.0_f64);
    let films = [400.0, 60.0];
    let resistances = [
        1.0 / (films[0] * 2.0 * PI * a * length),
        (b / a).ln() / (2.0 * PI * k * length),
        1.0 / (films[1] * 2.0 * PI * b * length),
    ];
    let [gas, ambient] = [300.0, 20.0];
    let flow = (gas - ambient) / resistances.iter().sum::<f64>();
    let deviations = [(8, 1), (16, 2), (32, 4)].map(|(around, through)| {
        let options = ConductionOptions {
            conductor: Conductor { conductivity: k, ..Conductor::steel() },
            ..options(films, [0.0, length], 8)
        };
        let model = reduce_ring_conduction(&cylinder(around, through), &options, &silent).unwrap().model;
        let mut simulation = ThermalSimulation::new(model).unwrap();
        let state = simulation.table().find("initial_state").unwrap().reference;
        simulation.set_integer(state, 2).unwrap();
        set(&mut simulation, "gas_temperature", gas);
        set(&mut simulation, "ambient_temperature", ambient);
        simulation.initialise(0.0).unwrap();
        simulation.do_step(0.0, 1000.0).unwrap();
        // The heat flows in and out are equal.
        let [inside, outside] = ["gas_power", "ambient_power"].map(|name| get(&simulation, name));
        assert!((inside + outside).abs() < 1e-9 * flow, "{inside} {outside}");
        let surfaces = [gas - flow * resistances[0], ambient + flow * resistances[2]];
        let found = ["gas_surface_temperature", "ambient_surface_temperature"].map(|name| get(&simulation, name));
        [inside / flow - 1.0, found[0] / surfaces[0] - 1.0, found[1] / surfaces[1] - 1.0]
            .into_iter()
            .fold(0.0, |worst: f64, value| worst.max(value.abs()))
    });
    println!("cylinder, by elements: {deviations:?}");
    assert!(deviations[2] < 4e-6, "{deviations:?}");
    assert!(deviations[0] / deviations[1] > 8.0 && deviations[1] / deviations[2] > 8.0, "{deviations:?}");
}

/// At small Biot numbers the wall is a lumped body; the error is of the order of the Biot number.
#[test]
fn wall_at_small_biot_number_behaves_as_lumped_mass() {
    let thickness = 0.02;
    let Conductor { conductivity, specific_heat } = Conductor::steel();
    let deviations = [1e-2, 1e-3, 1e-4].map(|biot: f64| {
        let film = biot * conductivity / thickness;
        let mut simulation = hot(reduced(&wall(thickness, 4), &options([film, 0.0], [-1.0, 1.0], 6)).model, 100.0);
        let rate = film / (7850.0 * specific_heat * thickness);
        simulation.do_step(0.0, 1.0 / rate).unwrap();
        (get(&simulation, "temperature_mean") - 100.0 * (-1.0_f64).exp()).abs() / 100.0
    });
    println!("lump, by Biot number: {deviations:?}");
    for (found, biot) in deviations.into_iter().zip([1e-2, 1e-3, 1e-4]) {
        // The first eigenvalue is Bi (1 − Bi/3).
        assert!((found / (biot / 3.0 * (-1.0_f64).exp()) - 1.0).abs() < 0.02, "{found} at {biot}");
    }
}

/// Heating for a while, then soak-back without convection of the gas: the decay is that of the air alone.
#[test]
fn after_shutdown_heat_decays_exponentially_to_ambient() {
    let mesh = wall(0.02, 4);
    let films = [500.0, 30.0];
    let model = reduced(&mesh, &options(films, [-1.0, 1.0], 8)).model;
    let (capacity, air) = (model.heat_capacity, model.ambient_conductance());
    let mut simulation = ThermalSimulation::new(model).unwrap();
    set(&mut simulation, "casing_heat", 40.0);
    simulation.initialise(0.0).unwrap();
    simulation.do_step(0.0, 600.0).unwrap();
    set(&mut simulation, "casing_heat", 0.0);
    set(&mut simulation, "gas_convection_factor", 0.0);
    simulation.do_step(600.0, 60.0).unwrap();
    let before = ["stored_heat", "ambient_heat", "ambient_surface_temperature"].map(|name| get(&simulation, name));
    simulation.do_step(660.0, 120.0).unwrap();
    let after = ["stored_heat", "ambient_heat"].map(|name| get(&simulation, name));
    assert!(get(&simulation, "gas_power").abs() < 1e-12);
    // Lumped except for Bi = h V/(A k) = 0.1 %.
    let rate = (before[0] / after[0]).ln() / 120.0;
    assert!((rate / (air / capacity) - 1.0).abs() < 3e-3, "{rate} against {}", air / capacity);
    // The loss of stored heat equals the heat to the air.
    assert!((after[0] - before[0] - (after[1] - before[1])).abs() < 1e-10 * before[0]);
    let residual = get(&simulation, "energy_residual_relative");
    assert!(residual.abs() < 1e-11, "{residual}");
}
