//! Structures that do not feel each other: what concerns one is judged and told without the others.

use tiprub_core::settings::{Scheme, Shape};
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::{real, rich_blade, rub, several, started, try_started};

/// Rotors `front` and `rear`, each in a rigid casing of its own.
fn two(change: impl Fn(&mut Scene)) -> Scene {
    let mut scene = rub(6);
    scene.roms[0] = rich_blade(6);
    let mut scene = several::two_rotors(scene, 0.1, |rear| rear.speed = -900.0);
    change(&mut scene);
    scene
}

/// The first rotor by itself.
fn alone(scene: &Scene) -> Scene {
    let mut alone = scene.clone();
    alone.settings.structures.truncate(1);
    alone.settings.surfaces.truncate(1);
    alone.settings.contacts.truncate(1);
    alone.roms.truncate(1);
    alone
}

/// Why a run ends before its end (s).
fn end(scene: &Scene, stop: f64) -> Option<String> {
    let mut simulation = started(scene);
    let length = scene.settings.experiment.communication_step;
    while simulation.time() < stop {
        if let Err(error) = simulation.do_step(simulation.time(), length) {
            return Some(error.to_string());
        }
    }
    println!("{:?}", simulation.system().ledger());
    None
}

#[test]
fn explore() {
    for order in [100, 200, 300, 400] {
        for h in [1e-6, 2e-6] {
            let scene = two(|scene| {
                scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 3.6e-4, order, phase: 0.0 };
                scene.settings.contacts[0].friction = 0.0;
                scene.settings.time.step = h;
                scene.settings.experiment.communication_step = 24.0 * h;
                scene.settings.surfaces[1].shape = Shape::Lobes { amplitude: 4.2e-4, order: 3, phase: 0.0 };
            });
            println!("{order} {h:e}: {:?}", end(&alone(&scene), 3e-3));
            println!("   both {:?}", end(&scene, 3e-3));
        }
    }
    for h in [4e-6, 6e-6, 8e-6] {
        for width in [0.05, 0.02] {
            let scene = two(|scene| {
                scene.settings.structures[0].damping_ratio = Some(0.0);
                scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.0, width, phase: 0.0 };
                scene.settings.contacts[0].friction = 0.0;
                scene.settings.time.step = h;
                scene.settings.experiment.communication_step = h;
                scene.settings.surfaces[1].shape = Shape::Lobes { amplitude: 4.2e-4, order: 3, phase: 0.0 };
            });
            println!("instant {width} {h:e}: {:?}", end(&alone(&scene), 2e-3));
            println!("   both {:?}", end(&scene, 2e-3));
        }
    }
}
