//! Twelve blades in a round casing, and helpers for tests.

use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{Shape, TimeSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{self as models, real};

/// Returns twelve blades in a round casing, without friction.
pub fn round(scheme: Scheme) -> Scene {
    let mut scene = models::rub(12);
    scene.roms[0] = models::rich_blade(12);
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene
}

pub fn with_step(mut scene: Scene, step: f64) -> Scene {
    scene.settings.time = TimeSettings { step, ..scene.settings.time };
    scene.settings.experiment.communication_step = step;
    scene
}

pub fn on_a_ring(mut scene: Scene) -> Scene {
    models::on_ring(&mut scene, models::ring(36, 3), 0.3);
    scene
}

pub fn energy(simulation: &Simulation) -> f64 {
    real(simulation, "strain_energy") + real(simulation, "kinetic_energy")
}

/// Returns a blade with contact nodes whose mode shapes are random, except for one mode that moves all of them out of
/// the casing.
pub fn crowded(nodes: usize, modes: usize, seed: u64) -> Scene {
    let mut random = models::SeededRandom(seed);
    let shapes = random.matrix(3 * nodes, modes);
    let shape =
        |row: usize, mode: usize| if mode == 0 && row.is_multiple_of(3) { -1.0 } else { 3.0 * shapes[(row, mode)] };
    let frequencies: Vec<f64> = (0..modes).map(|mode| 500.0 + 37_000.0 * mode as f64 / modes as f64).collect();
    let place = |node: usize| [models::RADIUS, 2e-3 * node as f64, 1e-3 * node as f64];
    let nodes = (0..nodes).map(|node| models::node(format!("node_{}", node + 1), place(node), 0.0)).collect();
    let mut rom = models::modal("crowded", &frequencies, shape, nodes);
    rom.damping_ratio = 0.005;
    let mut scene = models::round(rom);
    scene.settings.experiment.communication_step = 1e-5;
    scene
}

/// Returns the error of a scene that runs a hundred steps of 0.1 ms.
pub fn refusal(scene: &Scene) -> String {
    let run = || {
        let mut simulation = Simulation::new(scene)?;
        simulation.initialise(0.0)?;
        for _ in 0..100 {
            simulation.do_step(simulation.time(), 1e-4)?;
        }
        Ok::<_, tiprub_core::Error>(())
    };
    run().expect_err("it was not refused").to_string()
}
