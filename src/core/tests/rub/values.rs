//! Implausible values of a scene and of a ROM: rejected by name, or questioned.

use nalgebra::DMatrix;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{self as models, started};

use crate::blades::refusal;

/// Covers every number of a scene and its ROM that the table of ranges does not include.
#[test]
fn rejects_out_of_range_values_by_name() {
    type Change = fn(&mut Scene, f64);
    let changes: [(&str, f64, Change); 21] = [
        ("speed", 2e6, |scene, value| scene.settings.structures[0].speed = value),
        ("damping_ratio", 1.0, |scene, value| scene.settings.structures[0].damping_ratio = Some(value)),
        ("frequency_factors", 2.1, |scene, value| scene.settings.structures[0].frequency_factors = vec![value; 4]),
        ("contact[1].gap", 2e3, |scene, value| scene.settings.contacts[0].gap = value),
        ("contact[1].sector_gaps", 2e3, |scene, value| scene.settings.contacts[0].sector_gaps = vec![value; 4]),
        ("friction", 2.1, |scene, value| scene.settings.contacts[0].friction = value),
        ("ramp_time", 2e9, |scene, value| scene.settings.surfaces[0].ramp_time = value),
        ("time.step", 9e-13, |scene, value| scene.settings.time.step = value),
        ("experiment.start", -2e9, |scene, value| scene.settings.experiment.start = value),
        ("experiment.stop", 2e9, |scene, value| scene.settings.experiment.stop = value),
        ("experiment.communication_step", 9e-13, |scene, value| scene.settings.experiment.communication_step = value),
        ("experiment.communication_step", 2e9, |scene, value| scene.settings.experiment.communication_step = value),
        ("shape.phase", 2e6, |scene, value| {
            scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 1e-4, order: 2, phase: value };
        }),
        ("shape.order", 2e6, |scene, value| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "two million")]
            let order = value as u32;
            scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 1e-4, order, phase: 0.0 };
        }),
        ("shape.depth", 2e12, |scene, value| {
            scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: value, width: 0.15, phase: 0.0 };
        }),
        ("`mass`", 2e30, |scene, value| scene.roms[0].mass[(2, 2)] = value),
        ("`stiffness`", 2e30, |scene, value| scene.roms[0].stiffness[(2, 2)] = value),
        ("`contact_map`", -2e15, |scene, value| scene.roms[0].contact_map[(2, 2)] = value),
        ("`contact_positions`, node 2", 2.5e199, |scene, value| scene.roms[0].contact_nodes[1].position[0] = value),
        ("`contact_positions`, node 2", 1e-6, |scene, value| scene.roms[0].contact_nodes[1].position[0] = value),
        ("`contact_meridional_slopes`, node 3", 2e3, |scene, value| {
            scene.roms[0].contact_nodes[2].meridional_slope = value
        }),
    ];
    for (named, value, change) in changes {
        let mut scene = models::rub(4);
        change(&mut scene, value);
        let message = match scene.roms[0].validate() {
            Err(refusal) => refusal.to_string(),
            Ok(()) => refusal(&scene),
        };
        assert!(message.contains(named) && message.len() < 300, "{named} = {value:e}: {message}");
    }
}

#[test]
fn rejects_inconsistent_thermal_loads() {
    let heated = |change: fn(&mut nalgebra::DMatrix<f64>)| {
        let mut rom = models::ring(8, 2);
        change(&mut rom.extras.thermal.as_mut().expect("it is heated").loads);
        rom.validate().map_err(|refusal| refusal.to_string())
    };
    assert_eq!(heated(|_| {}), Ok(()));
    type Change = (fn(&mut nalgebra::DMatrix<f64>), &'static str);
    let changes: [Change; 3] = [
        (|loads| loads[(1, 0)] = f64::NAN, "non-finite entry at (1, 0)"),
        (|loads| *loads = loads.clone().insert_row(0, 1.0), "expected"),
        (|loads| *loads = loads.clone().insert_column(0, 1.0), "expected"),
    ];
    for (change, problem) in changes {
        let reported = heated(change).unwrap_err();
        assert!(reported.contains("`thermal_loads`") && reported.contains(problem), "{reported}");
    }
}

#[test]
fn rejects_values_that_do_not_match_the_sector_count() {
    type Change = fn(&mut Scene);
    let changes: [(&[&str], Change); 7] = [
        (&["frequency_factors", "3 values for 4"], |scene| {
            scene.settings.structures[0].frequency_factors = vec![1.0; 3]
        }),
        (&["frequency_factors", "5 values for 4"], |scene| {
            scene.settings.structures[0].frequency_factors = vec![1.0; 5]
        }),
        (&["sector_gaps", "3 values for 4"], |scene| scene.settings.contacts[0].sector_gaps = vec![3e-4; 3]),
        (&["watched_sectors", "twice"], |scene| scene.settings.outputs.watched_sectors = vec![2, 1, 2]),
        (&["watched_sectors", "twice"], |scene| scene.settings.outputs.watched_sectors = vec![4, 4]),
        (&["watched_sectors", "Count sectors from 1"], |scene| scene.settings.outputs.watched_sectors = vec![1, 0]),
        (&["watched_sectors", "5"], |scene| scene.settings.outputs.watched_sectors = vec![1, 5]),
    ];
    for (words, change) in changes {
        let mut scene = models::rub(4);
        change(&mut scene);
        let message = refusal(&scene);
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    }
    let mut scene = models::rub(4);
    scene.settings.structures[0].frequency_factors = vec![1.0, 0.99, 1.01, 1.0];
    scene.settings.outputs.watched_sectors = vec![4, 1, 3];
    started(&scene);
}

#[test]
fn error_messages_print_short_numbers_of_any_size() {
    let mut scene = models::rub(12);
    scene.settings.structures[0].damping_ratio = Some(1e308);
    let message = refusal(&scene);
    assert!(message.contains("damping_ratio: 1e308 is out of range. Give"), "{message}");
    scene.settings.structures[0].damping_ratio = None;
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4e-4, order: 100_000, phase: 0.0 };
    let message = refusal(&scene);
    assert!(message.contains("features of the casing shape that are 1.000e-5 rad wide"), "{message}");
    // The problem is that entries differ too much, not that stiffness is negative.
    scene = models::rub(12);
    scene.roms[0].mass[(2, 2)] = 1e-310;
    let message = refusal(&scene);
    assert!(message.contains("`mass` and `stiffness`") && message.contains("orders of magnitude"), "{message}");
}

#[test]
fn rejects_suspect_units_and_axes_unless_explicitly_accepted() {
    type Change = fn(&mut Scene);
    let slips: [(&str, Change); 6] = [
        ("rpm", |scene| scene.settings.structures[0].speed = 17_188.0),
        ("millimetres", |scene| {
            scene.settings.contacts[0].gap = 0.356;
            scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.position[0] *= 1000.0);
        }),
        ("axis", |scene| {
            scene.settings.contacts[0].gap = 5e-5;
            scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.position[0] = 0.9e-3);
        }),
        ("12 sectors", |scene| scene.roms[0].contact_nodes[2].position[1] = 1.6),
        ("crosses", |scene| {
            let mut nodes = scene.roms[0].contact_nodes.clone();
            nodes.push(nodes[2].clone());
            nodes.iter_mut().zip([[0.0, 0.0], [0.9, 0.01], [0.9, 0.0], [0.0, 0.01]]).for_each(|(node, [angle, z])| {
                (node.position[1], node.position[2]) = (angle, z);
            });
            nodes[3].name = "fourth".into();
            scene.roms[0].contact_map = DMatrix::from_fn(12, 8, |row, mode| 1.0 + (row * 8 + mode) as f64 % 5.0);
            scene.roms[0].contact_nodes = nodes;
        }),
        ("Hz", |scene| scene.roms[0].stiffness *= 1e-10),
    ];
    let plain = started(&models::rub(12));
    assert!(plain.warnings().iter().all(|text| !text.contains('?')), "{:?}", plain.warnings());
    for (word, change) in slips {
        let mut scene = models::rub(12);
        scene.settings.contacts[0].friction = 0.0;
        scene.settings.surfaces[0].shape = Shape::Circular {};
        scene.settings.surfaces[0].moving = false;
        change(&mut scene);
        let start = |accept: bool| {
            let mut scene = scene.clone();
            scene.settings.accept_implausible = accept;
            let mut simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{word}: {error}"));
            let outcome = simulation.initialise(0.0);
            (simulation, outcome)
        };
        let refusal = start(false).1.unwrap_err().to_string();
        assert!(refusal.contains(word) && refusal.contains("--accept-implausible"), "{word}: {refusal}");
        let (simulation, outcome) = start(true);
        let reported = simulation.warnings().join("; ");
        assert!(reported.contains(word) && reported.contains('?'), "{word}: {reported} {outcome:?}");
    }
}
