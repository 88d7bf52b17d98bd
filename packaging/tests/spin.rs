//! Compares rotor 37 at speed in the whole simulation with CalculiX 2.20 (nonlinear static step with centrifugal load, same mesh; the tests of the
//! reduction document the reference values and their origin).

use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_gallery::scene_source::rotor37_scene_with;
use tiprub_model::{Rotor37Options, reduce_rotor37};

/// Growth at the leading edge at 1800 rad/s (m): radial, tangential, axial.
const LEADING_EDGE: [f64; 3] = [58.088e-6, -192.490e-6, -353.188e-6];

fn scene() -> Scene {
    let options = Rotor37Options { spin: Some(1800.0), ..Rotor37Options::paper() };
    let rom = reduce_rotor37(&options, &|_| {}).unwrap().rom;
    let mut scene = rotor37_scene_with(rom).unwrap();
    scene.settings.structures[0].spin.stiffening = true;
    scene.settings.structures[0].spin.growth = true;
    scene.settings.structures[0].damping_ratio = Some(0.05);
    // A round casing with a clearance that excludes contact.
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.contacts[0].gap = 2e-3;
    scene
}

fn leading_edge(simulation: &Simulation) -> [f64; 3] {
    std::array::from_fn(|row| simulation.system().bank().row(row, 7))
}

fn off(found: [f64; 3]) -> f64 {
    (0..3).map(|i| (found[i] - LEADING_EDGE[i]).abs()).fold(0.0, f64::max) / LEADING_EDGE[2].abs()
}

#[test]
fn blade_stretch_follows_the_rotor_speed() {
    let scene = scene();
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let start = leading_edge(&simulation);
    println!("start at 1800 rad/s: {:.3?} um, off by {:.1e}", start.map(|u| 1e6 * u), off(start));
    assert!(off(start) < 1e-3);
    // It stays there: the static shape is an equilibrium of the steps.
    for _ in 0..100 {
        let time = simulation.time();
        simulation.do_step(time, 1e-5).unwrap();
    }
    assert!(off(leading_edge(&simulation)) < 1e-3);

    // Starting from 1300 rad/s, whose modes are then those of the steps, up to 1800 rad/s: the shape is the same.
    let mut simulation = Simulation::new(&scene).unwrap();
    let speed = simulation.table().find("speed").unwrap().reference;
    simulation.set_real(speed, 1300.0).unwrap();
    simulation.initialise(0.0).unwrap();
    for index in 0..4000 {
        let time = simulation.time();
        simulation.set_real(speed, (1300.0 + 0.25 * f64::from(index)).min(1800.0)).unwrap();
        simulation.do_step(time, 1e-5).unwrap();
    }
    let end = leading_edge(&simulation);
    println!("from 1300 to 1800 rad/s: {:.3?} um, off by {:.1e}", end.map(|u| 1e6 * u), off(end));
    assert!(off(end) < 1e-3);
    let (kinetic, strain) = simulation.system().energies();
    let residual = simulation.system().ledger().residual(kinetic + strain) / simulation.system().ledger().scale();
    println!("ledger {residual:.1e}");
    assert!(residual.abs() < 1e-9);
    // Speeds beyond the fitted range of the matrices are rejected without a change of the state.
    simulation.set_real(speed, 2500.0).unwrap();
    let time = simulation.time();
    let refusal = simulation.do_step(time, 1e-5).unwrap_err().to_string();
    assert!(refusal.contains("2500") && refusal.contains("--spin"), "{refusal}");
    simulation.set_real(speed, 1700.0).unwrap();
    simulation.do_step(time, 1e-5).unwrap();
}
