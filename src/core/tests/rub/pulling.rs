//! FILM on contact nodes that push each other apart: it produces tensile forces at some of them, which is reported, and
//! ends a run if they are too large.

use nalgebra::DMatrix;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_core::scene::settings::Preset;
use tiprub_core::{CoSimulation, Result, Scene, Simulation, Warning};
use tiprub_test_models::{self as models, reference, saved, set, try_started};

/// Depth by which the casing closes on the tips (m).
const DEPTH: f64 = 2e-5;
/// Steps in which the casing closes, and in which it then stays closed.
const STEPS: u32 = 400;
/// Flexibility of the first node (m/N); that of the second is three times as large.
const FLEXIBILITY: f64 = 1e-7;

/// Returns a blade with two nodes; pressing one moves the other by `coupling` times its flexibility: if `coupling`
/// exceeds 1, pressing both equally opens the second. The step has ω_max h = `product`. If `whole`, the masses are
/// proportional to the stiffness and a step of any length sees the static flexibility; otherwise each node has its
/// mass.
fn scene(coupling: f64, whole: bool, scheme: Scheme, product: f64) -> Scene {
    let flexibility = DMatrix::from_row_slice(2, 2, &[1.0, coupling, coupling, 3.0]) * FLEXIBILITY;
    let stiffness = flexibility.try_inverse().unwrap();
    let mass = if whole { stiffness.scale(1e-8) } else { DMatrix::identity(2, 2) * 0.1 };
    let map = DMatrix::from_fn(6, 2, |row, column| f64::from(u8::from(row == 3 * column)));
    let place = |name: &str, axial: f64| models::node(name, [models::RADIUS, 0.0, axial], 0.0);
    let mut rom = models::structure("pair", mass, stiffness, map, vec![place("front", 0.0), place("rear", 0.01)]);
    (rom.frame, rom.sectors, rom.damping_ratio) = (DisplacementFrame::Cylindrical, 2, 0.3);
    let fastest = ModalModel::from_rom(&rom, 0.3).unwrap().largest_frequency();
    let mut scene = models::round(rom);
    scene.settings.contacts[0].solver = Solver::Film;
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = product / fastest;
    scene.settings.experiment.communication_step = scene.settings.time.step;
    scene
}

/// Closes the casing on both nodes and keeps it closed.
fn press(simulation: &mut Simulation, steps: std::ops::Range<u32>) -> Result<()> {
    let step = simulation.real(reference(simulation, "internal_step_max"))?;
    for index in steps {
        let share = (f64::from(index + 1) / f64::from(STEPS)).min(1.0);
        set(simulation, "casing_radius_change", -(models::GAP + DEPTH) * share);
        simulation.do_step(f64::from(index) * step, step)?;
    }
    Ok(())
}

fn pressed(scene: &Scene) -> (Simulation, Result<()>) {
    let mut simulation = try_started(scene).unwrap();
    let outcome = press(&mut simulation, 0..2 * STEPS);
    (simulation, outcome)
}

fn about_film(notes: Vec<Warning>) -> Vec<Warning> {
    notes.into_iter().filter(|text| text.contains("film has applied a tensile impulse")).collect()
}

/// Steps in which each node acts by its mass alone leave the second one open, as in statics. Longer ones would close
/// both, with a tensile force at the second of a third of the force at the first. So would all steps if masses couple
/// the nodes as springs do.
#[test]
fn run_fails_only_when_film_forces_are_tensile() {
    for (whole, scheme, product, pulls) in [
        (false, Scheme::ModalExact, 0.5, false),
        (false, Scheme::ModalExact, 1.9, false),
        (false, Scheme::ModalExact, 3.0, true),
        (false, Scheme::ModalExact, 5.0, true),
        (false, Scheme::CentralDifference, 0.5, false),
        (false, Scheme::CentralDifference, 1.9, false),
        (true, Scheme::ModalExact, 0.5, true),
        (true, Scheme::CentralDifference, 0.5, true),
    ] {
        let mut scene = scene(1.5, whole, scheme, product);
        let (mut simulation, outcome) = pressed(&scene);
        let case = format!("{whole} {scheme:?} {product}: {outcome:?}");
        if pulls {
            let reported = outcome.unwrap_err().to_string();
            let named = ["contact node rear", ", 33 % of the impulse", "solver = \"lcp\""];
            assert!(named.iter().all(|part| reported.contains(part)), "{reported}");
            assert_eq!(reported.contains("`time.step`"), product > 2.0, "{reported}");
        } else {
            assert!(outcome.is_ok(), "{case}");
            let [front, rear] = [0, 1].map(|node| simulation.system().multiplier(node, 0));
            assert!((front * FLEXIBILITY / DEPTH - 1.0).abs() < 1e-9 && rear.abs() < 1e-9 * front, "{case}");
        }
        assert_eq!(about_film(simulation.take_notes()), Vec::<Warning>::new(), "{case}");
        // The complementarity solver is iterative.
        scene.settings.contacts[0].solver = Solver::Lcp;
        let (simulation, outcome) = pressed(&scene);
        assert!(outcome.is_ok() && simulation.system().multiplier(1, 0) >= 0.0, "{outcome:?}");
    }
}

/// The λ of equally pressed nodes are as 3 − c and 1 − c, with the coupling c. The method of the paper is used
/// unchanged.
#[test]
fn warns_once_of_small_tensile_forces_and_paper_preset() {
    for (coupling, preset, expected) in
        [(1.02, Preset::None, None), (1.1, Preset::None, Some(", 5 %")), (1.5, Preset::Paper, Some(", 33 %"))]
    {
        let mut scene = scene(coupling, true, Scheme::CentralDifference, 1.0);
        scene.settings.preset = preset;
        let (mut simulation, outcome) = pressed(&scene);
        assert!(outcome.is_ok(), "{outcome:?}");
        let reported = about_film(simulation.take_notes());
        assert_eq!(reported.len(), usize::from(expected.is_some()), "{reported:?}");
        for (text, share) in reported.iter().zip(expected) {
            assert!(text.contains(share) && text.contains("contact node rear"), "{text}");
            let paper = preset == Preset::Paper;
            assert!(text.contains("The run ends") != paper && text.contains("Remove `preset`") == paper, "{text}");
        }
    }
}

/// The tensile impulse so far is part of a state, and a new start resets it.
#[test]
fn saved_state_includes_tensile_impulses() {
    let scene = scene(1.5, true, Scheme::ModalExact, 1.0);
    let (mut simulation, outcome) = pressed(&scene);
    let expected = outcome.unwrap_err().to_string();
    simulation.reset();
    simulation.initialise(0.0).unwrap();
    press(&mut simulation, 0..STEPS + 20).unwrap();
    let mut other = try_started(&scene).unwrap();
    other.restore_state(&saved(&simulation)).unwrap();
    for one in [&mut simulation, &mut other] {
        assert_eq!(press(one, STEPS + 20..2 * STEPS).unwrap_err().to_string(), expected);
    }
}
