//! Rejected steps and friction coefficients, their warnings, and the soundness of accepted ones.

use crate::blades::{crowded, energy, on_a_ring, round, with_step};
use nalgebra::DMatrix;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::ExcitationSettings;
use tiprub_core::{CoSimulation, Error, Scene, Simulation};
use tiprub_cosim::warning::Topic;
use tiprub_test_models::{self as models, bits, disk, go, real, reference, saved, set, try_started};

/// Returns the largest usable step that an error contains (s).
fn usable_step(scene: Scene) -> f64 {
    let message = try_started(&with_step(scene, 1e-3)).unwrap_err().to_string();
    let number = message.split("`internal_step_max`) below ").nth(1).and_then(|text| text.split(' ').next());
    number.and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{message}"))
}

#[test]
fn massless_boundary_limit_uses_the_stiffest_blade() {
    let tuned = usable_step(round(Scheme::MasslessBoundary));
    let mut scene = round(Scheme::MasslessBoundary);
    scene.settings.structures[0].frequency_factors = vec![1.0; 12];
    scene.settings.structures[0].frequency_factors[7] = 1.3;
    let mistuned = usable_step(scene);
    assert!((mistuned * 1.3 / tuned - 1.0).abs() < 1e-4, "{mistuned:e} of {tuned:e}");
}

/// Communication steps may become longer than the one expected at the start.
#[test]
fn rejects_a_later_step_beyond_massless_boundary() {
    let usable = usable_step(round(Scheme::MasslessBoundary));
    let mut scene = with_step(round(Scheme::MasslessBoundary), 1e-4);
    scene.settings.experiment.communication_step = 0.2 * usable;
    let mut simulation = try_started(&scene).unwrap();
    for share in [0.2, 0.99] {
        go(&mut simulation, share * usable);
    }
    let reported = simulation.do_step(simulation.time(), 1.01 * usable).unwrap_err().to_string();
    assert!(reported.contains("too long for massless-boundary"), "{reported}");
    go(&mut simulation, 0.99 * usable);
}

#[test]
fn pressed_blades_gain_no_energy_at_the_massless_limit() {
    for factor in [1.0, 1.3] {
        let mut scene = round(Scheme::MasslessBoundary);
        scene.settings.structures[0].frequency_factors = vec![factor; 12];
        scene.settings.structures[0].damping_ratio = Some(1e-3);
        let step = 0.999 * usable_step(scene.clone());
        let mut simulation = try_started(&with_step(scene, step)).unwrap();
        assert!(simulation.warnings().iter().any(|text| text.contains("gain energy")), "{:?}", simulation.warnings());
        let mut most: f64 = 0.0;
        for index in 0..10_000 {
            set(&mut simulation, "casing_radius_change", -4.2e-4 * (f64::from(index) * step / 2e-3).min(1.0));
            go(&mut simulation, step);
            most = most.max(energy(&simulation));
        }
        let (gained, supplied) = (-real(&simulation, "impact_loss"), real(&simulation, "external_work"));
        println!(
            "factor {factor}, h = {step:.3e} s: largest energy {most:.3} J, {supplied:.3} J supplied, {gained:.1e} J by impacts"
        );
        assert!(gained < 0.01 * supplied && most < 1.01 * supplied);
    }
}

/// One blade presses on a ring whose modes are raised until the step that the blade allows no longer resolves them:
/// they count.
#[test]
fn stiff_casing_gains_no_energy_at_the_massless_limit() {
    for (raised, seen) in [(1.0, 1.0), (10.0, 1.0), (10.0, 4.0), (60.0, 10.0)] {
        let mut scene = on_a_ring(round(Scheme::MasslessBoundary));
        scene.settings.contacts[0].sector_gaps = vec![2e-3; 12];
        scene.settings.contacts[0].sector_gaps[0] = 3.56e-4;
        scene.settings.structures.iter_mut().for_each(|structure| structure.damping_ratio = Some(1e-3));
        scene.roms[1].stiffness *= raised * raised;
        scene.roms[1].contact_map *= seen;
        let step = 0.999 * usable_step(scene.clone());
        let mut simulation = try_started(&with_step(scene, step)).unwrap();
        let (mut most, mut supplied) = (0.0_f64, 0.0_f64);
        for index in 0..5000 {
            set(&mut simulation, "casing_radius_change", -4.2e-4 * (f64::from(index) * step / 2e-3).min(1.0));
            go(&mut simulation, step);
            most = most.max(energy(&simulation));
            supplied = supplied.max(real(&simulation, "external_work"));
        }
        let gained = -real(&simulation, "impact_loss");
        println!(
            "{raised}, {seen}: h = {step:.3e} s, {most:.3} J at most, {supplied:.3} J supplied, {gained:.1e} J by impacts"
        );
        assert!(gained < 0.01 * supplied && most < 1.01 * supplied, "{raised}, {seen}");
    }
}

#[test]
fn flutter_warning_agrees_for_massless_and_modal_exact() {
    let rate = |scheme| {
        let mut scene = with_step(round(scheme), 2e-7);
        scene.settings.contacts[0].friction = 0.15;
        let warnings = try_started(&scene).unwrap().warnings().to_vec();
        let number =
            warnings.iter().find_map(|text| text.split("grows at ").nth(1)?.split(' ').next()).map(str::to_owned);
        let number = number.unwrap_or_else(|| panic!("{scheme:?}: {warnings:?}"));
        assert_eq!(warnings.iter().filter(|text| text.contains("flutter")).count(), 1, "{warnings:?}");
        number.parse::<f64>().unwrap()
    };
    let (massless, exact) = (rate(Scheme::MasslessBoundary), rate(Scheme::ModalExact));
    println!("growth rates {massless} and {exact} 1/s");
    assert!((massless / exact - 1.0).abs() < 0.02);
}

#[test]
fn restored_state_uses_the_limits_of_its_parameters() {
    let mut scene = with_step(round(Scheme::CentralDifference), 1e-3);
    scene.settings.experiment.communication_step = 1e-6;
    scene.settings.contacts[0].solver = Solver::Lcp;
    let mut simulation = try_started(&scene).unwrap();
    simulation.do_step(0.0, 1e-6).unwrap();
    let state = saved(&simulation);
    let expected = simulation.do_step(1e-6, 1e-4).unwrap_err().to_string();
    assert!(expected.contains("ω_max"), "{expected}");
    let mut fresh = Simulation::new(&scene).unwrap();
    let mut other = Simulation::new(&scene).unwrap();
    other.set_integer(reference(&other, "scheme"), 2).unwrap();
    other.initialise(0.0).unwrap();
    for instance in [&mut fresh, &mut other] {
        instance.restore_state(&state).unwrap();
        let found = instance.do_step(1e-6, 1e-4).map_err(|error| error.to_string());
        assert_eq!(found, Err(expected.clone()));
    }
}

#[test]
fn rejected_friction_keeps_the_current_limits() {
    // Growth by friction forbids steps above 2.3e-5 s.
    let (short, long) = (1e-6, 3e-5);
    let mut scene = with_step(models::rub(3), 1e-4);
    scene.settings.experiment.communication_step = short;
    let mut simulation = try_started(&scene).unwrap();
    let mut twin = simulation.clone();
    let friction = reference(&simulation, "friction_coefficient");
    let refused =
        [0.9, 1.4, 1.9, 2.0].into_iter().filter(|value| simulation.set_real(friction, *value).is_err()).count();
    assert!(refused == 4, "a friction is accepted: the test would show nothing");
    for length in [short, long, short, long, 0.5 * short] {
        let outcomes = [&mut simulation, &mut twin].map(|one| one.do_step(one.time(), length));
        assert_eq!(outcomes[0], outcomes[1]);
        let grows = outcomes[1].as_ref().is_err_and(|error| error.to_string().contains("grows"));
        assert_eq!(grows, length > short, "{:?}", outcomes[1]);
    }
    assert_eq!(bits(&simulation), bits(&twin));
}

#[test]
fn warns_of_fast_rotor_with_stiffness_at_rest() {
    let mut scene = models::rub(3);
    let model = ModalModel::from_rom(&scene.roms[0], 1e-3).unwrap();
    let lowest = model.frequencies.iter().copied().fold(f64::INFINITY, f64::min);
    let warned = |scene: &Scene| {
        let simulation = try_started(scene).unwrap();
        simulation.warnings().iter().any(|warning| warning.topic() == Topic::StiffnessAtRest)
    };
    for (share, expected) in [(0.19, false), (-0.19, false), (0.21, true), (-0.21, true)] {
        scene.settings.structures[0].speed = share * lowest;
        assert_eq!(warned(&scene), expected, "{share}");
    }
    scene.settings.silence = vec![Topic::StiffnessAtRest.id().to_owned()];
    assert!(!warned(&scene));
    // The remedy depends on the ROM, and stiffening ends the warning.
    let remedy = |scene: &Scene| {
        let simulation = try_started(scene).unwrap();
        let warning = simulation.warnings().iter().find(|warning| warning.topic() == Topic::StiffnessAtRest);
        warning.map(|warning| warning.lines()[1].clone())
    };
    scene.settings.silence.clear();
    scene.settings.time.scheme = Scheme::ModalExact;
    assert!(remedy(&scene).unwrap().contains("option `--spin "));
    scene.roms[0].extras.spin = Some(models::spin(scene.roms[0].order()));
    assert!(remedy(&scene).unwrap().starts_with("In the scene, set `spin"));
    scene.settings.structures[0].spin.growth = true;
    assert!(remedy(&scene).is_some(), "growth alone does not include stiffening");
    scene.settings.structures[0].spin.stiffening = true;
    assert_eq!(remedy(&scene), None);
    let mut coupled = disk::with_rotor(disk::TestDisk::random(4, 2, 6, 0.3, 5).cyclic());
    coupled.settings.structures[0].speed = 2e3;
    assert!(remedy(&coupled).unwrap().contains("coupled sectors do not support spin effects"));
}

#[test]
fn warnings_refer_to_the_actual_step_and_appear_once() {
    let mut scene = with_step(models::rub(3), 8e-6);
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.silence = vec![Topic::StiffnessAtRest.id().to_owned()];
    // ω_max·h = 2 lies at 7.96e-6 s.
    scene.settings.experiment.communication_step = 5e-6;
    let mut simulation = try_started(&scene).unwrap();
    assert!(simulation.warnings().is_empty(), "{:?}", simulation.warnings());
    let mut reported = Vec::new();
    for length in [5e-6, 7.9e-6, 8e-6, 8e-6, 4e-6, 1.6e-5] {
        go(&mut simulation, length);
        reported.push(simulation.take_notes().join("; "));
    }
    assert!(reported[2].contains("8.000e-6"), "{reported:?}");
    assert_eq!(reported.iter().filter(|text| !text.is_empty()).count(), 1, "{reported:?}");
    // Reported at the start for the expected step, the warning is repeated when the step is materially longer.
    let mut scene = with_step(scene, 2e-5);
    scene.settings.experiment.communication_step = 1e-5;
    let mut simulation = try_started(&scene).unwrap();
    assert!(simulation.warnings().join(" ").contains("1.000e-5"), "{:?}", simulation.warnings());
    let steps = [1e-5, 1.1e-5, 2e-5, 1e-5, 2e-5];
    let reported = steps.map(|length| {
        go(&mut simulation, length);
        simulation.take_notes().len()
    });
    assert_eq!(reported, [0, 0, 1, 0, 0]);
}

#[test]
fn warns_of_reverse_rotation_when_the_rotor_reverses() {
    // Slip in one direction only makes this blade flutter.
    let mut scene = with_step(models::rub(3), 1e-6);
    let flutters = |scene: &Scene| {
        let warnings = try_started(scene).unwrap().warnings().to_vec();
        warnings.iter().filter(|text| text.contains("flutter")).count()
    };
    scene.settings.structures[0].speed = -1300.0;
    let backwards = flutters(&scene);
    scene.settings.structures[0].speed = 1300.0;
    let forwards = flutters(&scene);
    assert!(backwards > 0, "{backwards} {forwards}");
    let mut simulation = try_started(&scene).unwrap();
    let other = simulation.if_reversed();
    assert_eq!(other.len(), backwards);
    simulation.do_step(0.0, 1e-6).unwrap();
    assert!(simulation.take_notes().is_empty());
    for (speed, expected) in [(-1300.0, backwards), (1300.0, 0), (-1300.0, 0)] {
        set(&mut simulation, "speed", speed);
        go(&mut simulation, 1e-6);
        assert_eq!(simulation.take_notes().len(), expected, "{speed}");
    }
}

/// Structures that are too large for the check are reported, and only if friction makes it relevant.
#[test]
fn warns_when_growth_was_not_checked() {
    let reported = |scheme: Scheme, modes: usize, friction: f64| {
        let mut scene = models::rub(2);
        scene.settings.time.scheme = scheme;
        let own = scene.roms[0].order();
        let rom = &mut scene.roms[0];
        let frequency = |mode: usize| 2e4 + 50.0 * mode as f64;
        let entry = |row: usize| if row < own { rom.stiffness[(row, row)] } else { frequency(row).powi(2) };
        let stiffness = DMatrix::from_fn(modes, modes, |i, j| if i == j { entry(i) } else { 0.0 });
        rom.contact_map = rom.contact_map.clone().resize_horizontally(modes, 0.0);
        rom.mass = rom.mass.clone().resize(modes, modes, 0.0);
        (own..modes).for_each(|mode| rom.mass[(mode, mode)] = 1.0);
        rom.stiffness = stiffness;
        scene.settings.contacts[0].friction = friction;
        let simulation = models::started(&scene);
        simulation.warnings().iter().any(|text| text.contains("is not checked: the model has"))
    };
    for scheme in [Scheme::ModalExact, Scheme::Galerkin] {
        let found = [reported(scheme, 151, 0.1), reported(scheme, 151, 0.0), reported(scheme, 150, 0.1)];
        assert_eq!(found, [true, false, false], "{scheme:?}");
    }
}

/// If a shorter step is rejected, so is a longer one; the step that the error contains is accepted.
#[test]
fn rejects_all_steps_above_the_growth_limit() {
    let mut named = 0;
    for (seed, nodes) in (1..13).zip([2, 3, 1].into_iter().cycle()) {
        let plain = crowded(nodes, 12, seed);
        let highest = ModalModel::from_rom(&plain.roms[0], 0.0).unwrap().largest_frequency();
        for scheme in [Scheme::ModalExact, Scheme::CentralDifference] {
            let at = |step: f64| {
                let mut scene = with_step(plain.clone(), step);
                scene.settings.time.scheme = scheme;
                scene.settings.contacts[0].friction = 0.3;
                scene.settings.structures[0].damping_ratio = Some(1e-3);
                try_started(&scene).map(drop).map_err(|error| error.to_string())
            };
            let mut refused = None;
            // Steps of all lengths, not only those that the check evaluates.
            for place in 0..30 {
                let outcome = at(0.1 / highest * 1.27_f64.powi(place));
                assert!(refused.is_none() || outcome.is_err(), "{seed}, {scheme:?}: {refused:?}");
                let Err(message) = outcome else { continue };
                if let Some((_, rest)) = message.split_once("too long for friction") {
                    let step = rest.split("`internal_step_max`) to ").nth(1).and_then(|text| text.split(' ').next());
                    if let Some(step) = step {
                        named += 1;
                        assert_eq!(at(step.parse().unwrap()), Ok(()), "{message}");
                    }
                    refused = Some(message);
                }
            }
        }
    }
    assert!(named > 0);
}

/// If a fixed step is rejected, the remedy names adaptive steps first, provided that the scene allows them.
#[test]
fn rejected_steps_suggest_adaptive_steps_first() {
    let remedy = |change: &dyn Fn(&mut Scene)| {
        let mut scene = with_step(round(Scheme::CentralDifference), 1e-3);
        scene.roms[0] = models::rich_blade(12);
        change(&mut scene);
        let Err(Error::Unstable(diagnostic)) = try_started(&scene).map(drop) else { panic!("accepted") };
        diagnostic.remedy
    };
    let adaptive = "Use adaptive steps (set `time.scheme = \"galerkin\"`), or set `time.step` (in the FMU";
    for scheme in Scheme::RECURRENCES {
        let found = remedy(&|scene| {
            (scene.settings.time.scheme, scene.settings.contacts[0].solver) = (scheme, Solver::Lcp);
        });
        assert!(found.starts_with(adaptive), "{scheme:?}: {found}");
    }
    let film = remedy(&|scene| scene.settings.contacts[0].solver = Solver::Film);
    assert!(film.contains("\"galerkin\"` and `contact.solver = \"lcp\"`), or set `time.step`"), "{film}");
    // Too few modes, and features that its tables do not support.
    let few = remedy(&|scene| scene.roms[0] = models::blade(12));
    let excited = remedy(&|scene| {
        scene.settings.structures[0].excitation = Some(ExcitationSettings {
            order: 2,
            mode: Some(1),
            node: None,
            direction: None,
            amplitude: 1.0,
            phase: 0.0,
        })
    });
    assert!([few, excited].iter().all(|remedy| remedy.starts_with("Set `time.step`")));
}

/// Remedies work under the preset, and name the keys of the scene.
#[test]
fn remedies_are_compatible_with_the_preset() {
    let mut scene = with_step(round(Scheme::CentralDifference), 1e-5);
    let reported = |scene: &Scene| try_started(scene).unwrap_err().to_string();
    let plain = reported(&scene);
    assert!(plain.contains("`time.step`") && plain.contains("modal-exact"), "{plain}");
    scene.settings.preset = tiprub_core::scene::settings::Preset::Paper;
    scene.settings.contacts[0].solver = Solver::Film;
    let paper = reported(&scene);
    assert!(paper.contains("remove `preset`") && !paper.contains("modal-exact"), "{paper}");
}

/// For a blade that friction bends into the casing, a single warning contains the lock-up friction µ*.
#[test]
fn lock_up_warning_names_its_friction() {
    // A node on one inclined spring: w_nn/w_nt = cot of its inclination.
    let place = models::node("tip", [models::RADIUS, 0.0, 0.0], 0.0);
    let shape =
        |row: usize, mode: usize| [[0.5, 1.0, 0.0], [1.0, -0.5, 0.0], [0.0, 0.0, 1.0], [0.1, 0.1, 0.0]][mode][row];
    let mut rom = models::modal("leaning", &[1000.0, 4000.0, 5000.0, 9000.0], shape, vec![place]);
    rom.damping_ratio = 0.005;
    let mut reported = Vec::new();
    for speed in [1300.0, -1300.0] {
        let mut scene = with_step(models::round(rom.clone()), 1e-7);
        scene.settings.structures[0].speed = speed;
        scene.settings.contacts[0].friction = 0.9;
        scene.settings.silence = vec![Topic::StiffnessAtRest.id().to_owned()];
        let warnings = try_started(&scene).unwrap().warnings().to_vec();
        assert!(warnings.len() <= 1, "{warnings:?}");
        reported.extend(warnings);
    }
    // Σ φ_r²/ω² over Σ φ_r φ_θ/ω², in units of the first.
    let [along, across] = [(0.25 + 1.0 / 16.0 + 0.01 / 81.0), (0.5 - 0.5 / 16.0 + 0.01 / 81.0)];
    let expected = format!("µ* = {:.3}", along / across);
    // It locks up without oscillation, and nothing else grows.
    let reported = reported.iter().filter(|text| text.contains("locks up")).collect::<Vec<_>>();
    assert!(reported.len() == 1 && reported[0].contains(&expected), "{expected}: {reported:?}");
    assert!(reported[0].contains("1/s without oscillation") && !reported[0].contains("flutter"), "{reported:?}");
}

/// A casing that turns as it yields: under one blade its part of W is the rank-one matrix c(1 − µτ), for any angle.
#[test]
fn unsolvable_contact_on_casing_names_its_position() {
    let reported = |turned: f64, friction: f64| {
        let mut ring = models::ring(36, 3);
        let shape = |row: usize, _: usize| [1.0, turned, 0.0][row % 3];
        let turning = models::modal("ring", &[3000.0], shape, ring.contact_nodes.clone());
        (ring.mass, ring.stiffness, ring.contact_map) = (turning.mass, turning.stiffness, turning.contact_map);
        ring.extras.thermal = None;
        let mut scene = round(Scheme::ModalExact);
        models::on_ring(&mut scene, ring, 0.01);
        scene.settings.contacts[0].friction = friction;
        let warnings = try_started(&scene).unwrap().warnings().to_vec();
        warnings.into_iter().filter(|text| text.contains("contribution of the casing")).collect::<Vec<_>>()
    };
    for (turned, friction) in [(6.0, 0.15), (0.0, 0.15), (1e3, 0.0)] {
        assert!(reported(turned, friction).is_empty(), "{:?}", reported(turned, friction));
    }
    for turned in [7.0, -7.0] {
        let reported = reported(turned, 0.15);
        assert!(
            reported.len() == 1 && reported[0].contains("-1.00e0 times the largest, at θ = 0.00 rad"),
            "{reported:?}"
        );
    }
}

/// For blades of four nodes, some with further blades, the warning of the largest growth with all nodes closed covers
/// all of them.
#[test]
fn growth_warning_lists_all_participating_nodes() {
    let (mut alone, mut together) = (0, 0);
    for seed in 1..12 {
        let mut scene = with_step(crowded(4, 16, seed), 1e-7);
        scene.settings.contacts[0].friction = 0.5;
        let Ok(simulation) = try_started(&scene) else { continue };
        for text in simulation.warnings().iter().filter(|text| text.contains("flutter")) {
            *(if text.contains("closed at node_1 to node_4") { &mut together } else { &mut alone }) += 1;
        }
    }
    assert!(together > 0 && alone > 0, "{together}, {alone}");
}

/// The reported number of blades may press on the casing simultaneously, each adding as much as the first.
#[test]
fn massless_boundary_reports_the_stable_number_of_blades() {
    let reported = |blades: usize, factors: &[f64]| {
        let mut scene = on_a_ring(round(Scheme::MasslessBoundary));
        scene.roms[0] = models::rich_blade(blades);
        scene.roms[1].contact_map *= 2.0;
        scene.settings.structures[0].frequency_factors = factors.to_vec();
        let step = 0.9 * usable_step(scene.clone());
        models::stable_blades(&try_started(&with_step(scene, step)).unwrap())
    };
    let many = reported(200, &[]).unwrap();
    assert!((2..100).contains(&many), "{many}");
    assert_eq!(reported(many, &[]), None);
    // All blades of a mistuned rotor count as the stiffest one.
    let stiff = [1.3; 200];
    let mistuned = std::array::from_fn::<_, 200, _>(|blade| if blade == 7 { 1.3 } else { 1.0 });
    assert_eq!(reported(200, &mistuned), reported(200, &stiff));
    assert_ne!(reported(200, &stiff), None);
}

/// For coupled sectors only the direction of rotation at the start is checked, because the other takes as long again.
#[test]
fn warns_that_reverse_rotation_of_a_disk_is_unchecked() {
    let mut simulation = models::started(&disk::with_rotor(disk::TestDisk::random(6, 1, 9, 0.25, 6).cyclic()));
    assert!(simulation.if_reversed().is_empty(), "{:?}", simulation.if_reversed());
    for (speed, expected) in [(1300.0, 0), (-1300.0, 1), (1300.0, 0), (-1300.0, 0)] {
        set(&mut simulation, "speed", speed);
        go(&mut simulation, 1e-6);
        let reported = simulation.take_notes();
        assert_eq!(reported.iter().filter(|text| text.contains("was not checked")).count(), expected, "{reported:?}");
    }
}
