//! Extreme cases: each gives a correct answer or an error that states the reason.

use proptest::prelude::*;
use tiprub_core::geometry::Vector3;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{LoadSettings, Shape, SplineSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::{Causality, DataType, Variability};
use tiprub_test_models::{self as models, disk, go, lattice, real, reference, started};

use crate::blades::refusal;

#[test]
fn rejects_a_rotor_that_skips_over_the_lobes() {
    let mut scene = models::rub(12);
    scene.settings.accept_implausible = true;
    for speed in [5e5, -1e6, 1e6] {
        scene.settings.structures[0].speed = speed;
        let message = refusal(&scene);
        assert!(message.contains("speed") && message.contains("internal_step_max"), "{message}");
        let digits = message.split(|letter: char| !letter.is_ascii_digit()).map(str::len).max();
        assert!(digits < Some(20), "a number is written out: {message}");
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
fn rejects_casing_shapes_too_large_for_small_displacements() {
    let mut scene = models::rub(12);
    for depth in [100.0, 1e6, 1e12] {
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
        let message = refusal(&scene);
        assert!(message.contains("surface[1].shape") && message.contains("metres"), "{depth}: {message}");
    }
    // Each length is within its limit, but together they are far too deep.
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 30.0, width: 0.15, phase: 0.0 };
    let mut simulation = started(&scene);
    simulation.set_real(reference(&simulation, "gap_offset"), -0.02).unwrap();
    let outcome = (0..100).try_for_each(|_| simulation.do_step(simulation.time(), 1e-4));
    let message = outcome.unwrap_err().to_string();
    assert!(message.contains("tenth of") && message.contains("sector"), "{message}");
    // Millimetres instead of metres.
    let mut scene = models::rub(12);
    scene.settings.contacts[0].gap = 0.356;
    assert!(refusal(&scene).contains("metres"));
    // Teeth: 4 mm high, 0.9 mm apart.
    let mut scene = models::rub(12);
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4e-3, order: 300, phase: 0.0 };
    let message = refusal(&scene);
    assert!(message.contains("45°") || message.contains("displaced by"), "{message}");
}

#[test]
fn names_a_load_that_is_too_large_at_the_start() {
    let mut scene = models::rub(12);
    models::flexible(&mut scene);
    for amplitude in [1e9, 1e12] {
        scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude, phase: 0.0 });
        let message = refusal(&scene);
        assert!(message.contains("initial state") && message.contains("loads"), "{amplitude:e}: {message}");
    }
}

#[test]
fn rejects_a_derivative_that_leaves_the_range_within_the_step() {
    let mut scene = models::rub(12);
    scene.settings.surfaces[0].moving = true;
    let (mut refused, mut other) = (started(&scene), started(&scene));
    let radius = reference(&refused, "casing_radius_change");
    for (slope, said) in [(1e6, "outside"), (-1e6, "outside"), (1e308, "1e308")] {
        refused.set_input_derivative(radius, 1, slope).unwrap();
        let error = refused.do_step(0.0, 1e-4).unwrap_err().to_string();
        assert!(error.contains("casing_radius_change") && error.contains(said) && error.contains("smaller"), "{error}");
    }
    // Exactly to the bound, in steps whose sum is rounded.
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
fn rejects_a_speed_beyond_the_fitted_one() {
    let mut scene = models::rub(12);
    let order = scene.roms[0].order();
    scene.roms[0].extras.spin = Some(models::spin(order));
    scene.settings.structures[0].spin.stiffening = true;
    let mut simulation = started(&scene);
    simulation.do_step(0.0, 1e-5).unwrap();
    let speed = reference(&simulation, "speed");
    let (mut before, mut after) = (vec![0; simulation.state_size()], vec![0; simulation.state_size()]);
    simulation.set_input_derivative(speed, 1, 1e8).unwrap();
    simulation.save_state(&mut before).unwrap();
    let error = simulation.do_step(simulation.time(), 2.35e-5).unwrap_err().to_string();
    assert!(error.contains("were fitted"), "{error}");
    simulation.save_state(&mut after).unwrap();
    assert_eq!(before, after);
}

#[test]
fn checks_the_actual_step_rather_than_the_maximum_step() {
    // Central differences far above their limit by internal_step_max, far below it by the communication step.
    let mut scene = models::rub(12);
    scene.settings.time.scheme = Scheme::CentralDifference;
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.time.step = 1e-3;
    scene.settings.experiment.communication_step = 1e-6;
    let mut simulation = started(&scene);
    for _ in 0..10 {
        go(&mut simulation, 1e-6);
    }
    let time = simulation.time();
    let message = simulation.do_step(time, 1e-4).unwrap_err().to_string();
    assert!(message.contains("ω_max"), "{message}");
    // A rejected step changes nothing.
    simulation.do_step(time, 1e-6).unwrap();
}

#[test]
fn growth_warning_names_node_and_sense_of_rotation() {
    let mut scene = models::rub(12);
    scene.settings.time.scheme = Scheme::CentralDifference;
    scene.settings.time.step = 7.2e-6;
    scene.settings.experiment.communication_step = 5e-5;
    let reported = |scene: &Scene| started(scene).warnings().join("\n");
    let text = reported(&scene);
    assert!(text.contains("trailing_edge") && text.contains("+θ") && !text.contains("−θ"), "{text}");
    // The same physical step, selected by the communication step alone.
    scene.settings.time.step = 1.0;
    scene.settings.experiment.communication_step = 5e-5 / 7.0;
    assert_eq!(reported(&scene), text);
    scene.settings.structures[0].speed *= -1.0;
    assert!(!reported(&scene).contains("+θ"), "{}", reported(&scene));
}

#[test]
fn accepts_the_friction_proposed_by_the_error_message() {
    let mut scene = models::rub(12);
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
fn a_blade_keeps_its_energy_over_ten_million_undamped_steps() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        let mut scene = models::rub(1);
        scene.settings.time.scheme = scheme;
        scene.settings.contacts[0].friction = 0.0;
        scene.settings.structures[0].damping_ratio = Some(0.0);
        scene.settings.outputs.watched_sectors = vec![1];
        scene.settings.outputs.nodal_diameters = None;
        let mut simulation = started(&scene);
        for _ in 0..40 {
            go(&mut simulation, 5e-5);
        }
        let (factor, offset) = (reference(&simulation, "casing_shape_factor"), reference(&simulation, "gap_offset"));
        simulation.set_real(factor, 0.0).unwrap();
        simulation.set_real(offset, 1e-2).unwrap();
        let energy = |simulation: &Simulation| real(simulation, "scheme_energy");
        go(&mut simulation, 5e-5);
        let before = energy(&simulation);
        for _ in 0..100 {
            go(&mut simulation, 0.1);
        }
        let drift = energy(&simulation) / before - 1.0;
        println!("{scheme:?}: relative energy drift {drift:.1e} over 1e7 steps");
        assert!(before > 1e-3 && drift.abs() < 1e-11, "{scheme:?}: {drift:e} of {before} J");
    }
}

/// Returns small scenes of every kind: rigid, elastic and coated casings, coupled sectors, all schemes, a free body.
fn kinds() -> Vec<Scene> {
    let mut scenes = Vec::new();
    for scheme in [Scheme::ModalExact, Scheme::CentralDifference, Scheme::MasslessBoundary] {
        let mut scene = models::rub(4);
        scene.roms[0] = models::rich_blade(4);
        scene.settings.time.scheme = scheme;
        scene.settings.time.step = 1e-7;
        scene.settings.contacts[0].friction = 0.1;
        scenes.push(scene);
    }
    let mut scene = models::rub(3);
    models::flexible(&mut scene);
    scene.settings.structures[1].thermal = true;
    scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 1e3, phase: 0.2 });
    scene.settings.contacts[0].slave_heat_fraction = Some(0.3);
    scenes.push(scene);
    let mut scene = models::rub(3);
    models::coating(&mut scene);
    scenes.push(scene);
    scenes.push(disk::with_rotor(disk::TestDisk::random(6, 2, 5, 0.2, 7).cyclic()));
    scenes.push(lattice::squeezed_by(-1e-3, [-10.0, 1.0, 0.0]));
    scenes
}

/// Returns the names of outputs that are not finite.
fn unbounded(simulation: &Simulation) -> Vec<String> {
    let outputs = simulation.table().variables().iter().filter(|row| row.causality == Causality::Output);
    let mut found = Vec::new();
    for row in outputs.filter(|row| row.kind == DataType::Real) {
        for (element, reference) in (0..row.len()).zip(row.reference..) {
            let continuous = row.variability == Variability::Continuous;
            let derivative = if continuous { simulation.output_derivative(reference, 1).unwrap_or(0.0) } else { 0.0 };
            if !(simulation.real(reference).unwrap().is_finite() && derivative.is_finite()) {
                found.push(row.element_name(element));
            }
        }
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn outputs_are_always_finite_numbers(
        starts in prop::collection::vec((-320.0..15.0_f64, any::<bool>()), 2),
        lengths in prop::collection::vec((-320.0..300.0_f64, any::<bool>()), 6),
    ) {
        for mut simulation in kinds().iter().map(|scene| Simulation::new(scene).unwrap()) {
            let (mut taken, mut refused) = (0, 0);
            for (exponent, negative) in &starts {
                let start = 10_f64.powf(*exponent) * if *negative { -1.0 } else { 1.0 };
                simulation.reset();
                if simulation.initialise(start).is_err() {
                    refused += 1;
                    continue;
                }
                prop_assert!(unbounded(&simulation).is_empty(), "start {start:e}: {:?}", unbounded(&simulation));
                for (exponent, usual) in &lengths {
                    // Half of the steps have acceptable lengths; none takes long.
                    let length = if *usual { 10_f64.powf(-12.0 + exponent.abs() / 60.0) } else { 10_f64.powf(*exponent) };
                    let long = length > 1e3 * simulation_step(&simulation) && length < 1e9 * simulation_step(&simulation);
                    if long {
                        continue;
                    }
                    let outcome = simulation.do_step(simulation.time(), length);
                    if outcome.is_ok() {
                        taken += 1;
                        prop_assert!(length >= 1e-12, "H = {length:e}");
                        let found = unbounded(&simulation);
                        prop_assert!(found.is_empty(), "start {start:e}, H = {length:e}: {found:?}");
                    } else {
                        refused += 1;
                    }
                }
            }
            prop_assert!(taken + refused > 0);
        }
    }
}

fn simulation_step(simulation: &Simulation) -> f64 {
    real(simulation, "internal_step_max")
}

#[test]
fn rejects_steps_at_the_level_of_rounding() {
    for scene in kinds() {
        for start in [0.0, -0.0, 1e-300, -3e-6] {
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.initialise(start).unwrap();
            for length in [5e-324, 1e-310, 1e-200, 1e-40, 1e-17, 9.99e-13] {
                let message = simulation.do_step(start, length).unwrap_err().to_string();
                assert!(message.contains("communicationStepSize") && message.contains("1e-12"), "{message}");
            }
            simulation.do_step(start, 1e-12).unwrap();
            assert!(unbounded(&simulation).is_empty(), "{:?}", unbounded(&simulation));
        }
        // Far from zero the resolution of the time is too coarse.
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.initialise(1e6).unwrap();
        let message = simulation.do_step(1e6, 1e-9).unwrap_err().to_string();
        assert!(message.contains("double precision"), "{message}");
        assert!(simulation.initialise(1e10).unwrap_err().to_string().contains("start time"));
    }
}

/// Returns the SI value of one unit, and its exponents of kg, m, s, rad, K: products of powers of prefixed units.
fn in_si(name: &str) -> (f64, [i32; 5]) {
    const UNITS: [(&str, f64, [i32; 5]); 11] = [
        ("kg", 1.0, [1, 0, 0, 0, 0]),
        ("m", 1.0, [0, 1, 0, 0, 0]),
        ("s", 1.0, [0, 0, 1, 0, 0]),
        ("rad", 1.0, [0, 0, 0, 1, 0]),
        ("K", 1.0, [0, 0, 0, 0, 1]),
        ("N", 1.0, [1, 1, -2, 0, 0]),
        ("J", 1.0, [1, 2, -2, 0, 0]),
        ("W", 1.0, [1, 2, -3, 0, 0]),
        ("deg", std::f64::consts::PI / 180.0, [0, 0, 0, 1, 0]),
        ("rev", std::f64::consts::TAU, [0, 0, 0, 1, 0]),
        ("rpm", std::f64::consts::TAU / 60.0, [0, 0, -1, 1, 0]),
    ];
    let (mut value, mut exponents, mut sign) = (1.0, [0; 5], 1);
    for part in name.split_inclusive(['.', '/']) {
        let word = part.trim_end_matches(['.', '/']);
        let unit = word.trim_end_matches(char::is_numeric);
        let power = sign * word[unit.len()..].parse().unwrap_or(1);
        let known = |unit: &str| UNITS.into_iter().find(|known| known.0 == unit);
        let prefixed = || {
            let prefix = [('k', 1e3), ('m', 1e-3), ('u', 1e-6), ('M', 1e6)]
                .into_iter()
                .find(|known| unit.starts_with(known.0))?;
            known(&unit[1..]).map(|known| (known.0, prefix.1 * known.1, known.2))
        };
        let (_, size, own) = known(unit).or_else(prefixed).unwrap_or_else(|| panic!("unit {unit} of {name}"));
        value *= size.powi(power);
        (0..5).for_each(|i| exponents[i] += power * own[i]);
        sign = if part.ends_with('/') { -1 } else { 1 };
    }
    (value, exponents)
}

#[test]
fn unit_definitions_match_their_names() {
    let mut seen = std::collections::BTreeSet::new();
    for scene in kinds() {
        for row in Simulation::new(&scene).unwrap().table().variables() {
            let Some(unit) = row.unit else { continue };
            assert_eq!(in_si(unit.name), (1.0, unit.exponents), "{}", unit.name);
            for (name, factor) in unit.display {
                let (value, exponents) = in_si(name);
                assert!((factor * value - 1.0).abs() < 1e-15, "1 {} = {factor} {name}", unit.name);
                assert_eq!(exponents, unit.exponents, "{name}");
                seen.insert(*name);
            }
        }
    }
    let all = ["deg", "kN", "kN.m", "kN/m", "kW", "mJ", "mN.s", "mm", "mm3", "ms", "rev", "rpm", "um", "us"];
    assert!(seen.iter().eq(&all), "{seen:?}");
}

/// Flanks of teeth by their slope: 44° is accepted and rubbed, 46° is rejected, both by its angle in a step and as a
/// contact.
#[test]
fn rejects_flanks_steeper_than_45_degrees() {
    let mut scene = models::rub(4);
    let mut through_points = scene.clone();
    through_points.settings.surfaces[0].spline = Some(SplineSettings::default());
    for (simulation, kind) in [(started(&scene), "revolution"), (started(&through_points), "spline")] {
        let law = simulation.system().pairs()[0].gap();
        for (degrees, answered) in [(0.0_f64, true), (44.9, true), (45.1, false), (80.0, false), (100.0, false)] {
            for sense in [1.0, -1.0] {
                let (sine, cosine) = degrees.to_radians().sin_cos();
                assert_eq!(
                    law.is_plausible(0, -1e-6, Vector3::new(-cosine, sense * sine, 0.0)),
                    answered,
                    "{kind}, {degrees}°"
                );
            }
        }
        // A tenth of the radius deep.
        let normal = -Vector3::x();
        assert!(law.is_plausible(0, -0.0249, normal) && !law.is_plausible(0, -0.0251, normal), "{kind}");
    }
    // A node moves around the circumference and meets a tooth where its height is the clearance, 0.356 mm: 60 % of the
    // height, where the slope is 0.8 of the largest.
    scene.settings.contacts[0].friction = 0.0;
    scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.position[1] = 0.0);
    scene.settings.structures[0].speed = 5.0;
    for (slope, answered) in [(0.9_f64, true), (1.2, false)] {
        let height = 3.56e-4 / 0.6;
        let order = (slope / 0.8 * 0.25 / height).round();
        // The rotor starts between two teeth.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some hundreds")]
        let shape =
            Shape::Lobes { amplitude: height, order: 4 * (order / 4.0).round() as u32, phase: std::f64::consts::PI };
        scene.settings.surfaces[0].shape = shape;
        scene.settings.surfaces[0].ramp_time = 0.0;
        let mut simulation = started(&scene);
        let outcome = (0..2000).try_for_each(|_| {
            let touching = !simulation.system().events().is_empty();
            if touching { Ok(()) } else { simulation.do_step(simulation.time(), 1e-6) }
        });
        if answered {
            assert!(outcome.is_ok() && !simulation.system().events().is_empty(), "{slope}: {outcome:?}");
        } else {
            let message = outcome.unwrap_err().to_string();
            assert!(message.contains("steeper than 45°"), "{slope}: {message}");
        }
    }
}

#[test]
fn rejects_too_fast_tips_unless_the_scene_accepts_them() {
    let mut scene = models::rub(4);
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.surfaces[0].shape = Shape::Circular {};
    for sense in [1.0, -1.0] {
        scene.settings.structures[0].speed = sense * 1300.0;
        scene.settings.silence = vec!["stiffness-at-rest".to_owned()];
        let mut simulation = started(&scene);
        assert!(simulation.take_notes().is_empty() && simulation.warnings().is_empty(), "{:?}", simulation.warnings());
        let outcomes = |simulation: &mut Simulation| {
            [1300.0, 5990.0, 6010.0, 17_188.0, 1300.0, 17_188.0].map(|speed| {
                simulation.set_real(reference(simulation, "speed"), sense * speed).unwrap();
                let outcome = simulation.do_step(simulation.time(), 1e-6);
                (outcome.map_err(|error| error.to_string()), simulation.take_notes().len())
            })
        };
        let refused = outcomes(&mut simulation);
        assert_eq!(refused.each_ref().map(|(outcome, _)| outcome.is_ok()), [true, true, false, false, true, false]);
        let message = refused[2].0.clone().unwrap_err();
        assert!(
            message.starts_with("`speed` at t = 2e-6 s: at a speed of") && message.contains("accept_implausible"),
            "{message}"
        );
        scene.settings.accept_implausible = true;
        let accepted = outcomes(&mut started(&scene));
        assert!(accepted.iter().all(|(outcome, _)| outcome.is_ok()));
        assert_eq!(accepted.map(|(_, reported)| reported), [0, 0, 1, 0, 0, 0], "{sense}");
        scene.settings.silence = vec!["implausible".into()];
        assert_eq!(outcomes(&mut started(&scene)).map(|(_, reported)| reported), [0; 6], "{sense}");
        (scene.settings.accept_implausible, scene.settings.silence) = (false, Vec::new());
    }
}
