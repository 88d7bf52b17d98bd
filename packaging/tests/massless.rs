//! Rotor 37 with massless contact nodes against contact nodes with mass.

use tiprub_core::dynamics::modal::ModalModel;
use tiprub_core::settings::Scheme;
use tiprub_core::stability::{central_difference_limit, massless::MasslessCheck};
use tiprub_core::{Scene, Simulation};
use tiprub_model::{Rotor37Options, reduce_rotor37};

/// Displacements (m) of all contact rows at common times, the total normal impulse (N.s), and the impact loss (J).
fn run(scene: &Scene, scheme: Scheme, step: f64) -> (Vec<f64>, f64, f64) {
    let mut scene = scene.clone();
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = step;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let (mut displacements, mut impulse) = (Vec::new(), 0.0);
    let reference = simulation.table().find("normal_impulse").unwrap().reference;
    // The first impacts of a light rub: later, single impacts fall into different steps.
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
fn massless_contact_nodes_agree_and_take_longer_steps() {
    let rom = reduce_rotor37(&Rotor37Options::default(), &|_| {}).unwrap().rom;
    let model = ModalModel::from_rom(&rom, rom.damping_ratio).unwrap();
    let normals = rom.contact_nodes.iter().map(|node| {
        let length = (1.0 + node.meridional_slope * node.meridional_slope).sqrt();
        [-1.0 / length, 0.0, node.meridional_slope / length]
    });
    let check = MasslessCheck { model: &model, normals: normals.collect(), slave: None };
    let (limit, central) = (check.limit(1e-3).unwrap().closed, central_difference_limit(&model));
    println!(
        "largest step: massless-boundary {limit:.3e} s, central differences {central:.3e} s, ratio {:.2}",
        limit / central
    );
    assert!(limit > central);

    let mut scene = tiprub_packaging::scene_source::rotor37_scene_with(rom).unwrap();
    scene.settings.contacts[0].friction = 0.1;
    let fine = run(&scene, Scheme::ModalExact, 1e-7);
    for (scheme, step) in [
        (Scheme::ModalExact, 1e-6),
        (Scheme::MasslessBoundary, 1e-7),
        (Scheme::MasslessBoundary, 1e-6),
        (Scheme::MasslessBoundary, 1.5e-5),
    ] {
        let found = run(&scene, scheme, step);
        println!(
            "{scheme:?} h = {step:.2e} s: displacements {:.2e}, impulse {:.2e} off; impact loss {:.2e} J (with mass {:.2e} J)",
            apart(&fine.0, &found.0),
            found.1 / fine.1 - 1.0,
            found.2,
            fine.2
        );
        assert!(apart(&fine.0, &found.0) < 0.05);
    }
}
