//! Rotor 37 with massless contact nodes, compared with contact nodes with mass, and in an elastic casing.

#[path = "../../tests/guide.rs"]
mod guide;

use std::collections::BTreeSet;

use guide::print_row;
use tiprub_core::geometry::Vector3;
use tiprub_core::limits::{central_difference_limit, massless::MasslessCheck};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_gallery::rom_cache::RomCache;
use tiprub_gallery::scene_source;
use tiprub_model::{Rotor37Options, reduce_rotor37};
use tiprub_shell::console::Console;

/// Returns the displacements (m) of all contact rows at common times, the total normal impulse (N·s), and the impact loss (J).
fn run(scene: &Scene, scheme: Scheme, step: f64) -> (Vec<f64>, f64, f64) {
    let mut scene = scene.clone();
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = step;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let (mut displacements, mut impulse) = (Vec::new(), 0.0);
    let reference = simulation.table().find("normal_impulse").unwrap().reference;
    // Only the first impacts of a light rub; later, single impacts fall into different steps.
    for _ in 0..50 {
        let time = simulation.time();
        simulation.do_step(time, 3e-5).unwrap();
        displacements.extend_from_slice(simulation.system().bank().displacement());
        impulse += simulation.real(reference).unwrap();
    }
    (displacements, impulse, simulation.system().ledger().impact_loss.value())
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().map(|a| a * a).sum();
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / square).sqrt()
}

#[test]
fn massless_contact_nodes_agree_and_allow_longer_steps() {
    let rom = reduce_rotor37(&Rotor37Options::paper(), &|_| {}).unwrap().rom;
    let model = ModalModel::from_rom(&rom, rom.damping_ratio).unwrap();
    let normals = rom.contact_nodes.iter().map(|node| {
        let length = (1.0 + node.meridional_slope * node.meridional_slope).sqrt();
        Vector3::new(-1.0 / length, 0.0, node.meridional_slope / length)
    });
    let check = MasslessCheck { model: &model, normals: normals.collect(), carriers: Vec::new() };
    let (limit, central) = (check.limit(1e-3).unwrap().closed, central_difference_limit(&model));
    print_row!("| limit of massless-boundary in closed contact | {:.2} |", 1e6 * limit);
    print_row!("| of which 0.8 is accepted | {:.2} |", 0.8e6 * limit);
    print_row!("| limit of central differences | {:.4} |", 1e6 * central);
    assert!(limit > central);

    let mut scene = tiprub_gallery::scene_source::rotor37_scene_with(rom).unwrap();
    scene.settings.contacts[0].friction = 0.1;
    for (share, accepted) in [(0.79, true), (0.81, false)] {
        let mut scene = scene.clone();
        (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::MasslessBoundary, share * limit);
        scene.settings.experiment.communication_step = share * limit;
        let started = Simulation::new(&scene).and_then(|mut simulation| simulation.initialise(0.0));
        assert_eq!(started.is_ok(), accepted, "{share} of the limit: {started:?}");
    }
    let fine = run(&scene, Scheme::ModalExact, 1e-7);
    for (scheme, step) in [
        (Scheme::ModalExact, 1e-6),
        (Scheme::MasslessBoundary, 1e-7),
        (Scheme::MasslessBoundary, 1e-6),
        (Scheme::MasslessBoundary, 1.5e-5),
    ] {
        let found = run(&scene, scheme, step);
        print_row!(
            "| {scheme:?} | {} | {:.2} % | {:+.2} % | {:.3} mJ, of {:.1} mJ with mass |",
            1e6 * step,
            100.0 * apart(&fine.0, &found.0),
            100.0 * (found.1 / fine.1 - 1.0),
            1e3 * found.2,
            1e3 * fine.2
        );
        assert!(apart(&fine.0, &found.0) < 0.05);
    }
    guide::hold("cargo test -p tiprub --test massless");
}

/// Runs a scene in which the casing shrinks onto all blades. Returns the largest vibration energy (J) in the last quarter of
/// the run, and the largest number of blades in contact in one communication step.
fn run_with_shrinking_casing(scene: &Scene, step: f64) -> (f64, usize) {
    let (ramp, length) = (2e-3, 1e-5);
    let mut scene = scene.clone();
    scene.settings.time.step = step;
    let mut simulation = Simulation::new(&scene).unwrap();
    let reference = |name: &str| simulation.table().find(name).unwrap().reference;
    let (friction, radius_change) = (reference("friction_coefficient"), reference("casing_radius_change"));
    simulation.set_real(friction, 0.0).unwrap();
    simulation.initialise(0.0).unwrap();
    assert!(!simulation.warnings().iter().any(|warning| warning.to_string().contains("simultaneous contact")));
    let (mut largest, mut touching) = (0.0_f64, 0);
    for index in 0..800_u32 {
        let time = simulation.time();
        simulation.set_real(radius_change, -4e-4 * (f64::from(index + 1) * length / ramp).min(1.0)).unwrap();
        simulation.do_step(time, length).unwrap();
        if index >= 600 {
            let (kinetic, strain) = simulation.system().energies();
            largest = largest.max(kinetic + strain);
            let sectors: BTreeSet<usize> = simulation.system().events().iter().map(|event| event.sector).collect();
            touching = touching.max(sectors.len());
        }
    }
    (largest, touching)
}

/// With one blade in contact, steps up to 2.5 µs are stable. The simple bound, the number of blades times the eigenvalue of one blade,
/// proves stability of only 15 blades at 1 µs.
#[test]
fn all_blades_on_an_elastic_casing_gain_no_energy() {
    let cache = RomCache::at(env!("CARGO_TARGET_TMPDIR"));
    let mut scene = scene_source::load("builtin:flexible-casing", &cache, &Console::new(true, false)).unwrap();
    scene.settings.surfaces[0].shape = Shape::Circular {};
    let [fine, coarse] = [5e-7, 1.7e-6].map(|step| run_with_shrinking_casing(&scene, step));
    println!("{:.4} J and {} blades at 0.5 µs, {:.4} J and {} blades at 1.7 µs", fine.0, fine.1, coarse.0, coarse.1);
    assert!((coarse.0 / fine.0 - 1.0).abs() < 0.05, "{} J, but {} J with short steps", coarse.0, fine.0);
    assert!(fine.1 > 18 && coarse.1 > 18, "{} and {} blades touch", fine.1, coarse.1);
}
