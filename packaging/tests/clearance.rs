//! Smallest clearances of rotor 37, whose fast modes vibrate between the points of a step.

use tiprub_core::scene::method::Scheme;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_gallery::scene_source::rotor37_scene_with;
use tiprub_model::{Rotor37Options, reduce_rotor37};

/// Communication step (s), and number of communication steps.
const STEP: f64 = 8e-5;
const STEPS: u32 = 131;

/// Smallest clearance (m) of each node of the first blade in each communication step. Each step is divided into
/// `parts`.
fn minima(scene: &Scene, parts: u32) -> Vec<f64> {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let variable = simulation.table().find("blade[1].clearance_minimum").unwrap();
    let (first, nodes) = (variable.reference, u32::try_from(variable.len()).unwrap());
    let mut found = Vec::new();
    for step in 0..STEPS {
        let mut lowest = vec![f64::INFINITY; nodes as usize];
        for part in 0..parts {
            let time = STEP * (f64::from(step) + f64::from(part) / f64::from(parts));
            simulation.do_step(time, STEP / f64::from(parts)).unwrap();
            for (lowest, reference) in lowest.iter_mut().zip(first..) {
                *lowest = lowest.min(simulation.real(reference).unwrap());
            }
        }
        found.extend(lowest);
    }
    found
}

/// Long and short communication steps give the same smallest clearances: each is within the tolerance of 10⁻³ of the
/// clearance.
#[test]
fn smallest_clearances_do_not_depend_on_the_communication_step() {
    let rom = reduce_rotor37(&Rotor37Options::default(), &|_| {}).unwrap().rom;
    let mut scene = rotor37_scene_with(rom).unwrap();
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, STEP);
    scene.settings.time.tolerance = Some(1e-3);
    scene.settings.outputs.watched_sectors = vec![1];
    let gap = scene.settings.contacts[0].gap;
    let (long, short) = (minima(&scene, 1), minima(&scene, 16));
    let error = long.iter().zip(&short).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("{:.1e} of the clearance", error / gap);
    assert!(error < 2e-3 * gap, "{error:e} m");
}
