//! Extreme cases: each ends in a right answer or in a refusal that says why.

mod common;
#[path = "common/features.rs"]
mod features;

use tiprub_core::settings::{LoadSettings, Scheme, Shape};
use tiprub_core::{Scene, Simulation};

fn reference(simulation: &Simulation, name: &str) -> u32 {
    simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference
}

fn real(simulation: &Simulation, name: &str) -> f64 {
    simulation.real(reference(simulation, name)).unwrap()
}

fn started(scene: &Scene) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.initialise(0.0).unwrap();
    simulation
}

/// What a scene of a hundred steps of 0.1 ms is refused with.
fn refusal(scene: &Scene) -> String {
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

#[test]
fn a_rotor_that_skips_over_the_lobes_is_refused_and_can_go_on_slower() {
    let mut scene = common::scene(12);
    for speed in [1e6, -1e6, 1e300] {
        scene.settings.structures[0].speed = speed;
        let message = refusal(&scene);
        assert!(message.contains("speed") && message.contains("internal_step_max"), "{message}");
        assert!(message.len() < 250, "a number is written out: {message}");
    }
    let mut simulation = started(&scene);
    assert!(simulation.do_step(0.0, 1e-4).is_err());
    simulation.set_real(reference(&simulation, "speed"), 1300.0).unwrap();
    simulation.do_step(0.0, 1e-4).unwrap();
    scene.settings.structures[0].speed = 1300.0;
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4e-4, order: 100_000, phase: 0.0 };
    assert!(refusal(&scene).contains("speed"));
}

#[test]
fn casings_that_small_displacements_cannot_describe_are_refused() {
    let mut scene = common::scene(12);
    for depth in [100.0, 1e6, 1e300] {
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
        let message = refusal(&scene);
        assert!(message.contains("surface.shape") && message.contains("metres"), "{depth}: {message}");
    }
    // Each length within its limit, together far too deep.
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 30.0, width: 0.15, phase: 0.0 };
    let mut simulation = started(&scene);
    simulation.set_real(reference(&simulation, "gap_offset"), -0.02).unwrap();
    let outcome = (0..100).try_for_each(|_| simulation.do_step(simulation.time(), 1e-4));
    let message = outcome.unwrap_err().to_string();
    assert!(message.contains("tenth of") && message.contains("sector"), "{message}");
    // Millimetres for metres.
    let mut scene = common::scene(12);
    scene.settings.contacts[0].gap = 0.356;
    assert!(refusal(&scene).contains("metres"));
    // Teeth: 4 mm high, 0.9 mm apart.
    let mut scene = common::scene(12);
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4e-3, order: 300, phase: 0.0 };
    let message = refusal(&scene);
    assert!(message.contains("45°") || message.contains("displaced by"), "{message}");
}

#[test]
fn a_load_that_is_too_large_at_the_start_is_named_and_not_the_surface_it_folds() {
    let mut scene = common::scene(12);
    features::flexible(&mut scene);
    for amplitude in [1e9, 1e12, 1e100, 1e200, 1e308] {
        scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude, phase: 0.0 });
        let message = refusal(&scene);
        assert!(message.contains("initial state") && message.contains("loads"), "{amplitude:e}: {message}");
    }
}

#[test]
fn refusals_write_numbers_of_any_size_in_short() {
    let mut scene = common::scene(12);
    scene.settings.structures[0].damping_ratio = Some(1e308);
    let message = refusal(&scene);
    assert!(message.contains("damping_ratio: 1e308. Give"), "{message}");
    scene.settings.structures[0].damping_ratio = None;
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4e-4, order: 100_000, phase: 0.0 };
    let message = refusal(&scene);
    assert!(message.contains("features of the casing shape 1.000e-5 rad wide"), "{message}");
    // What is wrong is that entries are too far apart, not that stiffness is negative.
    scene = common::scene(12);
    scene.roms[0].mass[(2, 2)] = 1e-310;
    let message = refusal(&scene);
    assert!(message.contains("`mass` and `stiffness`") && message.contains("orders of magnitude"), "{message}");
}

#[test]
fn a_derivative_that_leaves_the_range_within_the_step_is_refused_and_changes_nothing() {
    let mut scene = common::scene(12);
    scene.settings.surfaces[0].moving = true;
    let (mut refused, mut other) = (started(&scene), started(&scene));
    let radius = reference(&refused, "casing_radius_change");
    for (slope, said) in [(1e6, "outside"), (-1e6, "outside"), (1e308, "1e308")] {
        refused.set_input_derivative(radius, 1, slope).unwrap();
        let error = refused.do_step(0.0, 1e-4).unwrap_err().to_string();
        assert!(error.contains("casing_radius_change") && error.contains(said) && error.contains("smaller"), "{error}");
    }
    // To the bound and not beyond, in steps whose sum is rounded.
    let most = refused.table().find("casing_radius_change").unwrap().max.unwrap();
    for count in [3, 7, 10, 11, 30, 49] {
        let mut ramp = started(&scene);
        for index in 0..count {
            ramp.set_input_derivative(radius, 1, most / f64::from(count) / 1e-4).unwrap();
            ramp.do_step(ramp.time(), 1e-4).unwrap_or_else(|error| panic!("{index} of {count}: {error}"));
        }
    }
    for simulation in [&mut refused, &mut other] {
        simulation.set_real(radius, 0.0).unwrap();
        simulation.set_input_derivative(radius, 1, 0.01).unwrap();
        simulation.do_step(0.0, 1e-4).unwrap();
    }
    assert_eq!(real(&refused, "rotor_angle").to_bits(), real(&other, "rotor_angle").to_bits());
    assert_eq!(real(&refused, "clearance_minimum").to_bits(), real(&other, "clearance_minimum").to_bits());
}

#[test]
fn a_speed_beyond_the_fitted_one_is_refused_before_anything_changes() {
    let mut scene = common::scene(12);
    let order = scene.roms[0].order();
    scene.roms[0].extras.spin = Some(common::spin(order));
    scene.settings.structures[0].spin.stiffening = true;
    let mut simulation = started(&scene);
    simulation.do_step(0.0, 1e-5).unwrap();
    let speed = reference(&simulation, "speed");
    let (mut before, mut after) = (vec![0; simulation.state_size()], vec![0; simulation.state_size()]);
    simulation.set_input_derivative(speed, 1, 1e8).unwrap();
    simulation.save_state(&mut before).unwrap();
    let error = simulation.do_step(simulation.time(), 2.35e-5).unwrap_err().to_string();
    assert!(error.contains("fitted for"), "{error}");
    simulation.save_state(&mut after).unwrap();
    assert_eq!(before, after);
}

#[test]
fn what_counts_is_the_step_in_use_not_the_largest_allowed() {
    // Central differences far beyond their limit by internal_step_max, well within it by the communication step.
    let mut scene = common::scene(12);
    scene.settings.time.scheme = Scheme::CentralDifference;
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.time.step = 1e-3;
    scene.settings.experiment.communication_step = 1e-6;
    let mut simulation = started(&scene);
    for _ in 0..10 {
        simulation.do_step(simulation.time(), 1e-6).unwrap();
    }
    let time = simulation.time();
    let message = simulation.do_step(time, 1e-4).unwrap_err().to_string();
    assert!(message.contains("ω_max"), "{message}");
    // A refused step changes nothing.
    simulation.do_step(time, 1e-6).unwrap();
}

#[test]
fn growth_is_judged_in_the_sense_of_rotation_and_named_by_node() {
    let mut scene = common::scene(12);
    scene.settings.time.scheme = Scheme::CentralDifference;
    scene.settings.time.step = 7.2e-6;
    scene.settings.experiment.communication_step = 5e-5;
    let refused = |scene: &Scene| Simulation::new(scene).unwrap().initialise(0.0).unwrap_err().to_string();
    let message = refused(&scene);
    assert!(
        message.contains("trailing_edge") && message.contains("+θ") && message.contains("h = 7.143e-6"),
        "{message}"
    );
    // The same physical step, asked for through the communication step alone.
    scene.settings.time.step = 1.0;
    scene.settings.experiment.communication_step = 5e-5 / 7.0;
    assert_eq!(refused(&scene), message);
    // Expected to be stepped finely, then stepped coarsely.
    scene.settings.experiment.communication_step = 1e-6;
    let mut simulation = started(&scene);
    simulation.do_step(0.0, 1e-6).unwrap();
    let message = simulation.do_step(1e-6, 5e-5 / 7.0).unwrap_err().to_string();
    assert!(message.contains("grows"), "{message}");
}

#[test]
fn the_friction_a_refusal_proposes_is_accepted() {
    let mut scene = common::scene(12);
    for friction in [0.5, 1.0, 2.0] {
        scene.settings.contacts[0].friction = friction;
        let message = refusal(&scene);
        let proposed: f64 =
            message.split("µ below ").nth(1).and_then(|text| text.split(' ').next()).unwrap().parse().unwrap();
        scene.settings.contacts[0].friction = 0.999 * proposed;
        started(&scene);
    }
}

#[test]
fn a_whole_casing_closing_in_presses_every_blade() {
    let mut scene = common::scene(12);
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    let mut simulation = started(&scene);
    let radius = reference(&simulation, "casing_radius_change");
    let rate = -0.2;
    for _ in 0..1000 {
        let time = simulation.time();
        simulation.set_real(radius, (rate * time).max(-4e-4)).unwrap();
        simulation.set_input_derivative(radius, 1, if rate * time > -4e-4 { rate } else { 0.0 }).unwrap();
        simulation.do_step(time, 1e-5).unwrap();
    }
    // At rest: no slope, no friction, no torque; all blades alike; work done equals strain energy and losses.
    let system = simulation.system();
    assert!(system.events().len() >= 12 && real(&simulation, "torque").abs() < 1e-9);
    for sector in 1..12 {
        assert_eq!(system.multiplier(0, sector).to_bits(), system.multiplier(0, 0).to_bits());
    }
    let force = real(&simulation, "force_x").hypot(real(&simulation, "force_y"));
    let total: f64 = system.events().iter().map(|event| event.normal).sum();
    assert!(force < 1e-12 * total, "resultant {force} of {total} N");
    assert!(real(&simulation, "kinetic_energy") < 1e-6 * real(&simulation, "strain_energy"));
}

#[test]
fn a_blade_keeps_its_energy_over_ten_million_undamped_steps() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        let mut scene = common::scene(1);
        scene.settings.time.scheme = scheme;
        scene.settings.contacts[0].friction = 0.0;
        scene.settings.structures[0].damping_ratio = Some(0.0);
        scene.settings.outputs.watched_sectors = vec![1];
        scene.settings.outputs.nodal_diameters = None;
        let mut simulation = started(&scene);
        for _ in 0..40 {
            simulation.do_step(simulation.time(), 5e-5).unwrap();
        }
        let (factor, offset) = (reference(&simulation, "casing_shape_factor"), reference(&simulation, "gap_offset"));
        simulation.set_real(factor, 0.0).unwrap();
        simulation.set_real(offset, 1e-2).unwrap();
        let energy = |simulation: &Simulation| real(simulation, "scheme_energy");
        simulation.do_step(simulation.time(), 5e-5).unwrap();
        let before = energy(&simulation);
        for _ in 0..100 {
            simulation.do_step(simulation.time(), 0.1).unwrap();
        }
        let drift = energy(&simulation) / before - 1.0;
        println!("{scheme:?}: relative energy drift {drift:.1e} over 1e7 steps");
        assert!(before > 1e-3 && drift.abs() < 1e-11, "{scheme:?}: {drift:e} of {before} J");
    }
}
