//! Threads that share the blades of a rotor: results, saved states and errors do not depend on their number.

use super::scene;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{bits, go, real, reference, rich_blade, saved, set};

const BLADES: usize = 11;
/// Largest number of bytes that the number of threads itself changes in a saved state: two in its value now and at the
/// previous communication point, and the checksum.
const OWN_BYTES: usize = 12;

fn rub() -> Scene {
    let mut scene = scene(Scheme::Galerkin, 4e-5, 1e-3);
    scene.roms[0] = rich_blade(BLADES);
    scene.settings.outputs.watched_sectors = vec![2, 7];
    scene
}

fn heavy() -> Scene {
    let mut scene = rub();
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.3, width: 0.15, phase: 0.0 };
    scene
}

fn mistuned() -> Scene {
    let mut scene = rub();
    let factor = |blade: usize| 1.0 + 0.03 * (1.7 * blade as f64).sin();
    scene.settings.structures[0].frequency_factors = (0..BLADES).map(factor).collect();
    scene
}

fn started_with(scene: &Scene, threads: i32) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.set_integer(reference(&simulation, "threads"), threads).unwrap();
    simulation.initialise(0.0).unwrap();
    simulation
}

/// Returns the values after every communication step, and saved states. Inputs rest, change and rest again.
/// Several times, the run continues from a state that was saved before.
fn run(scene: &Scene, threads: i32) -> (Vec<Vec<u64>>, Vec<Vec<u8>>) {
    let mut simulation = started_with(scene, threads);
    let (mut values, mut states) = (Vec::new(), Vec::new());
    for n in 0..160 {
        let length = match n {
            0..60 => 1e-5,
            60..80 => 1e-4,
            _ => [1e-4, 1e-5, 2.3e-5][n % 3],
        };
        if n >= 100 && n % 10 < 3 {
            set(&mut simulation, "casing_radius_change", 1e-5 * (n as f64).sin());
        }
        if n % 40 == 25 {
            let state = saved(&simulation);
            go(&mut simulation, 1.7e-5);
            simulation.restore_state(&state).unwrap();
            states.push(state);
        }
        go(&mut simulation, length);
        values.push(bits(&simulation));
    }
    assert!(simulation.system().ledger().friction_loss.value() > 0.0, "no contact");
    states.push(saved(&simulation));
    (values, states)
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    for scene in [rub(), heavy(), mistuned()] {
        let (values, states) = run(&scene, 1);
        for threads in [2, 4, 64] {
            let (found, saved) = run(&scene, threads);
            assert!(found == values, "{threads} threads: outputs");
            for (found, expected) in saved.iter().zip(&states) {
                let differ = found.iter().zip(expected).filter(|(found, expected)| found != expected).count();
                assert!(found.len() == expected.len() && differ <= OWN_BYTES, "{threads} threads: {differ} bytes");
            }
        }
    }
}

#[test]
fn errors_do_not_depend_on_the_number_of_threads() {
    let failed = |threads: i32| {
        let mut simulation = started_with(&rub(), threads);
        (0..40).for_each(|_| go(&mut simulation, 4e-5));
        set(&mut simulation, "casing_shape_factor", 55.0);
        simulation.do_step(simulation.time(), 4e-5).unwrap_err().to_string()
    };
    let expected = failed(1);
    println!("{expected}");
    [2, 4].into_iter().for_each(|threads| assert_eq!(failed(threads), expected, "{threads}"));
}

#[test]
fn discarded_steps_do_not_depend_on_the_number_of_threads() {
    let prepared = |threads: i32, most: i32| {
        let mut simulation = started_with(&heavy(), threads);
        simulation.set_integer(reference(&simulation, "max_internal_steps"), 1_000_000).unwrap();
        (0..40).for_each(|_| go(&mut simulation, 4e-5));
        simulation.set_integer(reference(&simulation, "max_internal_steps"), most).unwrap();
        simulation
    };
    let mut free = prepared(1, 1_000_000);
    let before = free.system().steps_tried();
    go(&mut free, 1e-4);
    let needed = i32::try_from(free.system().steps_tried() - before).unwrap();
    for threads in [1, 2, 4] {
        for most in [1, needed / 2, needed - 1] {
            let mut simulation = prepared(threads, most);
            let before = bits(&simulation);
            let error = simulation.do_step(simulation.time(), 1e-4).unwrap_err();
            assert!(matches!(error, tiprub_core::Error::Exhausted(_)), "{threads}, {most}: {error}");
            assert_eq!(bits(&simulation), before);
        }
        let mut simulation = prepared(threads, needed);
        go(&mut simulation, 1e-4);
        for name in ["torque", "internal_trials", "clearance_minimum"] {
            assert_eq!(real(&simulation, name).to_bits(), real(&free, name).to_bits(), "{threads}: {name}");
        }
    }
}

/// Neither a copy nor the computation of derivatives uses further threads.
#[test]
fn copies_and_derivatives_do_not_depend_on_threads() {
    let values = |threads: i32| {
        let mut simulation = Simulation::new(rub()).unwrap();
        simulation.set_integer(reference(&simulation, "threads"), threads).unwrap();
        simulation.set_integer(reference(&simulation, "step_derivatives"), 2).unwrap();
        simulation.initialise(0.0).unwrap();
        (0..40).for_each(|_| go(&mut simulation, 4e-5));
        let [torque, change] = ["torque", "casing_radius_change"].map(|name| reference(&simulation, name));
        let mut sensitivity = [0.0];
        simulation.step_derivative(&[torque], &[change], &[1.0], &mut sensitivity).unwrap();
        let mut copy = simulation.clone();
        go(&mut copy, 4e-5);
        go(&mut simulation, 4e-5);
        assert_eq!(bits(&copy), bits(&simulation));
        (sensitivity[0].to_bits(), bits(&copy))
    };
    assert!(values(1) == values(3));
}

#[test]
fn rejects_other_numbers_of_threads() {
    let mut simulation = Simulation::new(rub()).unwrap();
    let threads = reference(&simulation, "threads");
    for number in [0, 65, -1] {
        let message = simulation.set_integer(threads, number).unwrap_err().to_string();
        assert!(message.contains("threads") && message.contains("64"), "{message}");
    }
    simulation.initialise(0.0).unwrap();
    assert!(simulation.set_integer(threads, 2).unwrap_err().to_string().contains("threads"));
}
