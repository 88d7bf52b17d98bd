//! Derivatives of outputs at the end of a communication step with respect to inputs over it: against central
//! differences from saved and restored states, out of contact, near its onset and in contact, for all stepping methods;
//! their side effects; errors.

use std::collections::BTreeMap;

use crate::guide;
use crate::guide::print_row;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{LoadSettings, SplineSettings, TimeSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::{Causality, DataType, Variability};
use tiprub_test_models::{self as models, bits, coating, disk, flexible, go, real, reference, saved, set};

/// Communication step (s).
const H: f64 = 1e-4;

fn switched_on(scene: &Scene) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|error| panic!("{error}"));
    let switch = reference(&simulation, "step_derivatives");
    simulation.set_integer(switch, 2).unwrap();
    simulation.initialise(0.0).unwrap_or_else(|error| panic!("{error}"));
    simulation
}

fn references(simulation: &Simulation, causality: Causality) -> Vec<u32> {
    let continuous = |row: &&tiprub_cosim::variables::Variable| {
        row.name != "energy_residual_relative"
            && row.causality == causality
            && row.kind == DataType::Real
            && row.variability == Variability::Continuous
    };
    let rows = simulation.table().variables().iter().filter(continuous);
    rows.flat_map(|row| (row.reference..).take(row.len())).collect()
}

fn rotor(change: fn(&mut Scene)) -> Scene {
    let mut scene = models::rub(6);
    scene.roms[0] = models::rich_blade(6);
    let rotor = &mut scene.settings.structures[0];
    (rotor.whirl, rotor.axial_shift) = (true, true);
    change(&mut scene);
    scene
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let galerkin = |scene: &mut Scene| {
        scene.settings.time =
            TimeSettings { scheme: Scheme::Galerkin, step: 4e-5, tolerance: Some(1e-3), ..TimeSettings::default() };
    };
    let mut alone = rotor(|_| {});
    galerkin(&mut alone);
    let mut shared = rotor(flexible);
    galerkin(&mut shared);
    let mut coupled = disk::with_rotor(disk::TestDisk::random(6, 2, 9, 0.25, 5).cyclic());
    coupled.settings.structures[0].whirl = true;
    vec![
        ("galerkin", alone),
        ("galerkin, elastic casing", shared),
        ("modal-exact", rotor(|_| {})),
        ("massless-boundary", rotor(|scene| scene.settings.time.scheme = Scheme::MasslessBoundary)),
        ("film", rotor(|scene| scene.settings.contacts[0].solver = Solver::Film)),
        ("coulomb", rotor(|scene| scene.settings.contacts[0].solver = Solver::Coulomb)),
        ("spline", rotor(|scene| scene.settings.surfaces[0].spline = Some(SplineSettings::default()))),
        (
            "coating on a loaded ring",
            rotor(|scene| {
                flexible(scene);
                coating(scene);
                scene.settings.structures[1].thermal = true;
                scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 3e3, phase: 0.2 });
            }),
        ),
        ("coupled sectors", coupled),
    ]
}

/// A small offset of the casing, so that no two blades have the same gap.
const OFF: [(&str, f64); 2] = [("whirl_x", 1.3e-5), ("whirl_y", -0.7e-5)];

/// Returns the step by which a test moves an input, different from the one that the product uses.
fn small(name: &str) -> f64 {
    let kinds = [
        ("speed", 3e-4),
        ("amplitude", 0.3),
        ("temperature", 3e-3),
        ("factor", 1e-6),
        ("rotation", 3e-7),
        ("phase", 1e-5),
    ];
    kinds.iter().find(|(kind, _)| name.contains(kind)).map_or(1e-9, |(_, small)| *small)
}

/// Computes central differences from states saved before the step.
fn central(
    simulation: &Simulation,
    state: &[u8],
    (input, by): (u32, f64),
    outputs: &[u32],
    length: f64,
) -> (Vec<f64>, Vec<f64>) {
    let [up, down] = [by, -by].map(|by| {
        let mut other = simulation.clone();
        other.restore_state(state).unwrap();
        let value = other.real(input).unwrap();
        other.set_real(input, value + by).unwrap();
        go(&mut other, length);
        outputs.iter().map(|output| other.real(*output).unwrap()).collect::<Vec<_>>()
    });
    (up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * by)).collect(), up)
}

/// Contact of the blades over a step, compared with the step before.
#[derive(Clone, Copy, PartialEq)]
enum Contact {
    None,
    Onset,
    Lasting,
}

/// Returns the errors of all derivatives over a step, relative to the largest derivative among outputs of one unit.
fn errors(simulation: &mut Simulation, state: &[u8], [inputs, outputs]: [&[u32]; 2]) -> Vec<f64> {
    let mut errors = Vec::new();
    for &input in inputs {
        let mut own = vec![0.0; outputs.len()];
        simulation.step_derivative(outputs, &[input], &[1.0], &mut own).unwrap();
        let by = small(&simulation.table().locate(input).unwrap().0.name);
        let (central, values) = central(simulation, state, (input, by), outputs, H);
        let unit = |output: u32| simulation.table().locate(output).unwrap().0.unit.map_or("1", |unit| unit.name);
        let mut scales = BTreeMap::<&str, [f64; 2]>::new();
        for (i, output) in outputs.iter().enumerate() {
            let [change, value] = scales.entry(unit(*output)).or_default();
            (*change, *value) = (change.max(central[i].abs()), value.max(values[i].abs()));
        }
        for (i, output) in outputs.iter().enumerate() {
            let [change, value] = scales[unit(*output)];
            // Rounding error of the difference of two values.
            let scale = change.max(1e-9 * value / by);
            if scale > 0.0 {
                errors.push((own[i] - central[i]).abs() / scale);
            }
        }
    }
    errors
}

#[test]
fn step_derivatives_match_central_differences() {
    let mut lines = Vec::new();
    for (name, scene) in scenes() {
        let mut simulation = switched_on(&scene);
        for (name, value) in OFF {
            set(&mut simulation, name, value);
        }
        let inputs = references(&simulation, Causality::Input);
        let outputs = references(&simulation, Causality::Output);
        let mut found = [Vec::new(), Vec::new(), Vec::new()];
        let mut touched = false;
        for _ in 0..40 {
            let state = saved(&simulation);
            go(&mut simulation, H);
            let touches = real(&simulation, "normal_force_peak") > 0.0;
            let kind = match (touched, touches) {
                (false, false) => Contact::None,
                (true, true) => Contact::Lasting,
                _ => Contact::Onset,
            };
            touched = touches;
            found[kind as usize].extend(errors(&mut simulation, &state, [&inputs, &outputs]));
        }
        let mut line = name.to_owned();
        for (errors, most) in found.iter_mut().zip([0.05, 0.05, 0.06]) {
            errors.sort_by(f64::total_cmp);
            assert!(errors.len() > 500, "{name}: {}", errors.len());
            let (middle, high, last) =
                (errors[errors.len() / 2], errors[errors.len() * 99 / 100], errors[errors.len() - 1]);
            assert!(middle < 1e-7 && high < 1e-3 && last < most, "{name}: {middle:.1e}, {high:.1e}, {last:.1e}");
            line += &format!(" | {high:.0e} | {last:.0e}");
        }
        lines.push(line);
    }
    lines.into_iter().for_each(|line| print_row!("{line}"));
    guide::hold("cargo test -p tiprub-core --test rub");
}

#[test]
fn a_rigid_casing_moves_clearances_by_the_cosine_of_its_slope() {
    let mut scene = models::round(models::blade(6));
    scene.settings.structures[0].whirl = true;
    scene.settings.outputs.watched_sectors = vec![1];
    let mut simulation = switched_on(&scene);
    go(&mut simulation, H);
    let [angle, change, whirl] = ["speed", "casing_radius_change", "whirl_x"].map(|name| reference(&simulation, name));
    let outputs = [reference(&simulation, "rotor_angle"), reference(&simulation, "blade[1].clearance")];
    let node = &models::blade(6).contact_nodes[0];
    let cosine = node.meridional_slope.atan().cos();
    let turned = real(&simulation, "rotor_angle") + node.position[1];
    // The input moved, the output read, and the value that follows from geometry.
    let expected = [(angle, [H, 0.0]), (change, [0.0, cosine]), (whirl, [0.0, -cosine * turned.cos()])];
    for (input, expected) in expected {
        let mut found = [0.0; 2];
        simulation.step_derivative(&outputs, &[input], &[1.0], &mut found).unwrap();
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5 * H.max(expected.abs()), "{found} {expected}");
        }
    }
}

#[test]
fn derivatives_are_linear_in_the_seeds() {
    let (_, scene) = scenes().swap_remove(0);
    let mut simulation = switched_on(&scene);
    let outputs = ["torque", "force_x", "force_y", "friction_power"].map(|name| reference(&simulation, name));
    let inputs = ["whirl_x", "whirl_y", "speed"].map(|name| reference(&simulation, name));
    let seed = [0.7, -1.3, 1e3];
    for (name, value) in OFF {
        set(&mut simulation, name, value);
    }
    (0..12).for_each(|_| go(&mut simulation, H));
    assert!(real(&simulation, "torque") < -1.0);
    let mut by = |inputs: &[u32], seed: &[f64]| {
        let mut found = [0.0; 4];
        simulation.step_derivative(&outputs, inputs, seed, &mut found).unwrap();
        found
    };
    let (together, nothing) = (by(&inputs, &seed), by(&inputs, &[0.0; 3]));
    assert!(nothing.iter().all(|value| *value == 0.0));
    let each = inputs.map(|input| by(&[input], &[1.0]));
    for (i, value) in together.iter().enumerate() {
        let terms: Vec<f64> = each.iter().zip(seed).map(|(each, seed)| each[i] * seed).collect();
        let (sum, scale) = (terms.iter().sum::<f64>(), terms.iter().fold(0.0, |most: f64, term| most.max(term.abs())));
        assert!((value - sum).abs() < 1e-4 * scale, "{value} {sum}");
    }
}

#[test]
fn derivatives_do_not_change_the_simulation() {
    let mut scenes = scenes();
    // Open nodes are skipped.
    scenes.push(("modal-exact, elastic casing", rotor(flexible)));
    for (name, scene) in scenes {
        let (mut plain, mut asked) = (models::started(&scene), switched_on(&scene));
        // A limit on internal steps makes steps end at communication points, as derivatives do.
        if name.contains("galerkin") {
            let limit = plain.table().find("max_internal_steps").unwrap().reference;
            for simulation in [&mut plain, &mut asked] {
                simulation.set_integer(limit, 1_000_000).unwrap();
            }
        }
        let (inputs, outputs) = (references(&plain, Causality::Input), references(&plain, Causality::Output));
        let seed = vec![1e-3; inputs.len()];
        let mut first = vec![0.0; outputs.len()];
        for step in 0..14 {
            let length = if step == 9 { 0.5 * H } else { H };
            for simulation in [&mut plain, &mut asked] {
                set(simulation, "speed", 1300.0 + f64::from(step));
                if step == 5 && name != "coupled sectors" {
                    set(simulation, "friction_coefficient", 0.1);
                }
                go(simulation, length);
            }
            let before = saved(&asked);
            asked.step_derivative(&outputs, &inputs, &seed, &mut first).unwrap();
            assert_eq!(bits(&plain), bits(&asked), "{name}");
            assert!(before == saved(&asked), "{name}");
            // Repeated, and after a return to the start of a step, the result is the same.
            let mut again = vec![0.0; outputs.len()];
            asked.step_derivative(&outputs, &inputs, &seed, &mut again).unwrap();
            assert!(first.iter().zip(&again).all(|(first, again)| first.to_bits() == again.to_bits()), "{name}");
        }
    }
}

#[test]
fn a_step_repeated_from_a_saved_state_has_the_same_derivatives() {
    for (name, scene) in scenes() {
        let mut simulation = switched_on(&scene);
        let (inputs, outputs) = (references(&simulation, Causality::Input), references(&simulation, Causality::Output));
        (0..11).for_each(|_| go(&mut simulation, H));
        let state = saved(&simulation);
        let mut found = Vec::new();
        for _ in 0..2 {
            simulation.restore_state(&state).unwrap();
            let refusal =
                simulation.step_derivative(&outputs, &inputs[..1], &[1.0], &mut vec![0.0; outputs.len()]).unwrap_err();
            assert!(refusal.to_string().contains("a state was restored"), "{refusal}");
            set(&mut simulation, "speed", 1310.0);
            go(&mut simulation, H);
            let mut values = vec![0.0; outputs.len()];
            simulation.step_derivative(&outputs, &inputs, &vec![1e-2; inputs.len()], &mut values).unwrap();
            found.push(values.iter().map(|value| value.to_bits()).collect::<Vec<_>>());
        }
        assert!(found[0] == found[1] && found[0].iter().any(|value| *value != 0), "{name}");
    }
}

#[test]
fn rejects_variables_without_derivatives() {
    let (_, scene) = scenes().swap_remove(2);
    let off = &mut models::started(&scene);
    let on = &mut switched_on(&scene);
    let (speed, torque) = (reference(on, "speed"), reference(on, "torque"));
    let ask = |simulation: &mut Simulation, output: u32, input: u32, seed: f64| {
        simulation.step_derivative(&[output], &[input], &[seed], &mut [0.0]).unwrap_err().to_string()
    };
    go(off, H);
    assert!(ask(off, torque, speed, 1.0).contains("step_derivatives"));
    assert!(ask(on, torque, speed, 1.0).contains("none has been completed"));
    go(on, H);
    let (friction, steps) = (reference(on, "friction_coefficient"), reference(on, "internal_steps"));
    assert!(ask(on, speed, speed, 1.0).contains("not a continuous real output"));
    assert!(ask(on, steps, speed, 1.0).contains("`internal_steps`"));
    assert!(ask(on, torque, friction, 1.0).contains("not a continuous real input"));
    assert!(ask(on, torque, speed, f64::NAN).contains("seed"));
    assert!(ask(on, u32::MAX, speed, 1.0).contains("does not exist"));
    // A step that is not complete.
    on.begin_partial_step(on.time(), H).unwrap();
    on.advance().unwrap();
    assert!(ask(on, torque, speed, 1.0).contains("none has been completed"));
    on.end_step_early().unwrap();
    assert!(ask(on, torque, speed, 1.0).contains("ended early"));
    on.begin_step(on.time(), H).unwrap();
    on.advance().unwrap();
    set(on, "speed", 1301.0);
    while !on.advance().unwrap().finished {}
    assert!(ask(on, torque, speed, 1.0).contains("a variable was set within it"));
    go(on, H);
    on.step_derivative(&[torque], &[speed], &[1.0], &mut [0.0]).unwrap();
}

/// Steps far shorter than those before: ramps act only in part, inputs are moved by more, and contacts open or close
/// nearby.
#[test]
fn derivatives_stay_one_sided_near_a_kink() {
    for solver in [Solver::Lcp, Solver::Film] {
        let (_, mut scene) = scenes().swap_remove(2);
        scene.settings.contacts[0].solver = solver;
        let mut simulation = switched_on(&scene);
        for (name, value) in OFF {
            set(&mut simulation, name, value);
        }
        let outputs = ["force_x", "force_y", "torque"].map(|name| reference(&simulation, name));
        let inputs = ["whirl_x", "whirl_y", "casing_radius_change"].map(|name| reference(&simulation, name));
        let (mut compared, mut touching) = (0, 0);
        for step in 0..200 {
            let length = [H, 1e-6, 1e-7, 1e-8][step % 4];
            let state = saved(&simulation);
            go(&mut simulation, length);
            touching += usize::from(real(&simulation, "normal_force_peak") > 0.0);
            for input in inputs {
                let mut own = [0.0; 3];
                simulation.step_derivative(&outputs, &[input], &[1.0], &mut own).unwrap();
                let at = |by: f64| central(&simulation, &state, (input, by), &outputs, length).0;
                let (coarse, fine) = (at(1e-10), at(1e-11));
                let largest = |all: &[f64]| all.iter().fold(0.0, |most: f64, one| most.max(one.abs()));
                let apart = |one: &[f64]| largest(&one.iter().zip(&fine).map(|(a, b)| a - b).collect::<Vec<_>>());
                // If differences disagree, there is a kink between them or only rounding.
                if largest(&fine) < 1.0 || apart(&coarse) > 1e-4 * largest(&fine) {
                    continue;
                }
                compared += 1;
                assert!(apart(&own) < 1e-3 * largest(&fine), "{solver:?}, step {step}, {own:?}, {fine:?}");
            }
        }
        assert!(compared > 50 && touching > 20, "{compared} compared, {touching} steps touched");
    }
}
