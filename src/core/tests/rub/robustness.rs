//! Combinations that users may choose without a second thought: every case once gave wrong results silently.

use crate::blades::{crowded, energy, on_a_ring, round, with_step};
use nalgebra::DMatrix;
use proptest::prelude::*;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{CoatingSettings, SplineSettings};
use tiprub_core::{CoSimulation, Result, Scene, Simulation};
use tiprub_test_models::{self as models, bits, go, real, reference, saved, set, try_started};

/// Returns a blade that stiffens with the speed by 3Ω².
fn stiffening(scheme: Scheme, step: f64) -> Scene {
    let mut scene = with_step(models::rub(12), step);
    let order = scene.roms[0].order();
    let mut spin = models::spin(order);
    spin.stiffness_speed2 = DMatrix::identity(order, order) * 3.0;
    spin.stiffness_speed4.fill(0.0);
    scene.roms[0].extras.spin = Some(spin);
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.structures[0].spin.stiffening = true;
    scene.settings.structures[0].speed = 1.0;
    scene.settings.structures[0].damping_ratio = Some(1e-3);
    scene
}

/// Rubs for 1000 steps while accelerating to 1300 rad/s, then runs without contact.
fn run_up(simulation: &mut Simulation, step: f64) -> Result<()> {
    for index in 0..6000 {
        set(simulation, "speed", 1300.0 * (f64::from(index) / 2000.0).min(1.0));
        if index == 1000 {
            set(simulation, "casing_shape_factor", 0.0);
        }
        simulation.do_step(simulation.time(), step)?;
    }
    Ok(())
}

#[test]
fn stiffening_does_not_make_unresolved_modes_grow() {
    // ωh of the highest mode is an odd multiple of π, where the smallest explicit stiffness is unstable.
    let highest = std::f64::consts::TAU * 40_000.0;
    for turns in [1.0, 1.001, 3.0] {
        let step = turns * std::f64::consts::PI / highest;
        let mut scene = stiffening(Scheme::ModalExact, step);
        // This test is about a resonance of the step, not about the bound on energies.
        scene.settings.outputs.energies = false;
        let mut simulation = try_started(&scene).unwrap();
        run_up(&mut simulation, step).unwrap();
        let left = simulation.system().bank().modal_state(7, 0).0.abs();
        println!("ωh = {turns} π: highest mode left at {left:.1e} m·√kg");
        assert!(left < 1e-9, "{left:e}");
    }
}

#[test]
fn rejects_central_differences_beyond_stiffened_limit() {
    let step = 1.99995 / (std::f64::consts::TAU * 40_000.0);
    let all = stiffening(Scheme::CentralDifference, step);
    // The highest mode alone.
    let mut one = all.clone();
    let (order, spin) = (one.roms[0].order(), one.roms[0].extras.spin.as_mut().unwrap());
    spin.stiffness_speed2 = DMatrix::from_fn(order, order, |i, j| if i == j && i + 1 == order { 3.0 } else { 0.0 });
    for scene in [all, one] {
        let mut simulation = try_started(&scene).unwrap();
        let message = run_up(&mut simulation, step).unwrap_err().to_string();
        assert!(message.contains("ω_max"), "{message}");
        // At a lower speed it continues.
        set(&mut simulation, "speed", 500.0);
        go(&mut simulation, step);
    }
}

#[test]
fn step_change_keeps_pressed_casing_at_rest() {
    for scheme in [Scheme::ModalExact, Scheme::MasslessBoundary] {
        let mut scene = on_a_ring(round(scheme));
        scene.settings.structures[0].damping_ratio = Some(0.3);
        let mut simulation = try_started(&scene).unwrap();
        for index in 0..8000 {
            set(&mut simulation, "casing_radius_change", -5e-4 * (f64::from(index) / 4000.0).min(1.0));
            go(&mut simulation, 1e-6);
        }
        let (before, booked) = (energy(&simulation), real(&simulation, "step_change_energy"));
        for index in 0..400 {
            go(&mut simulation, if index % 2 == 0 { 2.5e-7 } else { 1e-6 });
        }
        let share = (real(&simulation, "step_change_energy") - booked).abs() / before;
        println!("{scheme:?}: 400 changes of step book {share:.1e} of the energy");
        assert!(share < 2e-5, "{scheme:?}: {share:e}");
    }
}

#[test]
fn node_returning_over_the_edge_rubs_as_on_a_wide_surface() {
    // A cylinder, whose extension beyond the edge is again the cylinder; a surface of revolution has no edge.
    let run = |spline: Option<SplineSettings>, reach: f64| {
        let mut scene = round(Scheme::ModalExact);
        scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.meridional_slope = 0.0);
        scene.settings.contacts[0].friction = 0.1;
        scene.settings.surfaces[0].spline = spline;
        scene.settings.structures[0].axial_shift = true;
        let mut simulation = try_started(&scene).unwrap();
        let mut peak = 0.0_f64;
        for index in 0..3000 {
            let x = f64::from(index);
            set(&mut simulation, "casing_radius_change", -3.7e-4 * (x / 1000.0).min(1.0));
            set(&mut simulation, "axial_shift", reach * (x / 300.0).sin());
            simulation.do_step(simulation.time(), 1e-6)?;
            peak = peak.max(real(&simulation, "normal_force_peak"));
            if index % 100 == 0 {
                simulation.restore_state(&saved(&simulation))?;
            }
        }
        assert!(real(&simulation, "energy_residual_relative").abs() < 1e-12);
        Ok::<_, tiprub_core::Error>(
            ["impact_loss", "friction_loss", "external_work"].map(|name| real(&simulation, name)),
        )
        .map(|work| (peak, work))
    };
    // Rings reach 7.5 mm beyond the contact nodes, and the surface 11.25 mm further.
    let (peak, work) = run(None, 0.018).unwrap();
    let (found, done) = run(Some(SplineSettings::default()), 0.018).unwrap();
    println!("peak {found:.4e} N for {peak:.4e} N; impact, friction, external {done:.4?} J for {work:.4?} J");
    // A spline uses full positions, a surface of revolution the radial displacement alone: 0.7 %.
    assert!((found - peak).abs() < 0.01 * peak && peak > 100.0, "{found:e} for {peak:e}");
    for (found, expected) in done.into_iter().zip(work) {
        assert!((found - expected).abs() < 0.02 * expected, "{found:e} for {expected:e}");
    }
    let refusal = run(Some(SplineSettings::default()), 0.022).unwrap_err().to_string();
    for word in ["edge of sector", "has left the casing surface", "at t = ", "Use a casing whose contact grid"] {
        assert!(refusal.contains(word), "{refusal}");
    }
}

#[test]
fn node_over_the_casing_edge_respects_the_energy_bound() {
    for slope in [0.0, -0.2] {
        let mut scene = on_a_ring(round(Scheme::ModalExact));
        for node in &mut scene.roms[0].contact_nodes {
            (node.meridional_slope, node.position[2]) = (slope, node.position[2] - 0.02);
        }
        scene.settings.structures[0].axial_shift = true;
        let mut simulation = try_started(&scene).unwrap();
        for index in 0..3000 {
            let x = f64::from(index);
            set(&mut simulation, "casing_radius_change", -4e-4 * (x / 1000.0).min(1.0));
            set(&mut simulation, "axial_shift", 0.015 * (x / 300.0).sin());
            go(&mut simulation, 1e-6);
        }
        let (loss, work) = (real(&simulation, "impact_loss"), real(&simulation, "external_work"));
        println!("slope {slope}: impact loss {loss:.3e} J, external work {work:.3e} J");
        assert!(real(&simulation, "energy_residual_relative").abs() < 1e-12);
        assert!(loss > 0.0 && loss < work, "{loss:e}, {work:e}");
    }
}

#[test]
fn rejects_a_node_that_starts_beyond_the_surface() {
    let mut scene = on_a_ring(round(Scheme::ModalExact));
    // Rings from z = -20 mm to 50 mm, which continue for 17.5 mm.
    scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.position[2] -= 0.015);
    scene.settings.structures[0].axial_shift = true;
    let mut simulation = Simulation::new(&scene).unwrap();
    for (shift, refused) in [(-0.022, false), (-0.023, true)] {
        set(&mut simulation, "axial_shift", shift);
        let outcome = simulation.initialise(0.0);
        assert_eq!(outcome.is_err(), refused, "{outcome:?}");
        if let Err(error) = outcome {
            assert!(
                error.to_string().contains("leading_edge of sector 1 starts beyond the first or last ring"),
                "{error}"
            );
        }
        simulation.reset();
    }
}

#[test]
fn rejects_casing_displacements_that_are_too_large() {
    let mut scene = on_a_ring(round(Scheme::ModalExact));
    scene.settings.structures[1].thermal = true;
    // Radial forces outwards on every node: the casing moves away from the blades.
    let map = &scene.roms[1].contact_map;
    let load = DMatrix::from_fn(map.ncols(), 4, |mode, _| (0..map.nrows() / 3).map(|node| map[(3 * node, mode)]).sum());
    for (scale, refused) in [(1e3, false), (4e3, true)] {
        scene.roms[1].extras.thermal.as_mut().unwrap().loads = &load * scale;
        let mut simulation = try_started(&scene).unwrap();
        let first = reference(&simulation, "casing_temperature");
        for patch in 0..4 {
            simulation.set_real(first + patch, 300.0).unwrap();
        }
        let outcome = (0..20).try_for_each(|_| simulation.do_step(simulation.time(), 5e-5));
        assert_eq!(outcome.is_err(), refused, "{outcome:?}");
        if let Err(error) = outcome {
            assert!(error.to_string().contains("casing is displaced by more than a tenth"), "{error}");
        }
        for bad in [f64::NAN, f64::INFINITY, 3001.0, -1e300] {
            assert!(simulation.set_real(first, bad).is_err());
        }
    }
}

#[test]
fn rejects_coating_cells_that_blades_would_skip() {
    let narrow = [(4800, 1e-4, false), (5000, 1e-4, true), (100_000, 1e-4, true)];
    // The tips turn by 0.325 mm in a step.
    for (cells, width, refused) in narrow.into_iter().chain([(100_000, 3.0e-4, true), (100_000, 3.5e-4, false)]) {
        let mut scene = round(Scheme::ModalExact);
        let coating = models::coating_of(1e-3, [cells, 3]);
        scene.settings.contacts[0].coating = Some(CoatingSettings { contact_width: Some(width), ..coating });
        let mut simulation = try_started(&scene).unwrap();
        let outcome = simulation.do_step(0.0, 1e-6);
        assert_eq!(outcome.is_err(), refused, "{cells}, {width}: {outcome:?}");
        if let Err(error) = outcome {
            assert!(error.to_string().contains("cells_around"), "{error}");
            set(&mut simulation, "speed", 30.0);
            simulation.do_step(0.0, 1e-6).unwrap();
        }
    }
}

#[test]
fn checks_speed_set_within_a_communication_step() {
    let mut simulation = try_started(&models::rub(12)).unwrap();
    let speed = reference(&simulation, "speed");
    simulation.begin_step(0.0, 5e-5).unwrap();
    simulation.advance().unwrap();
    for (value, slope) in [(9e5, 0.0), (1300.0, 1e10)] {
        let outcome = simulation.set_real(speed, value).and_then(|()| simulation.set_input_derivative(speed, 1, slope));
        let message = outcome.unwrap_err().to_string();
        assert!(message.contains("internal_step_max"), "{message}");
    }
    while !simulation.advance().unwrap().finished {}
    let turned = real(&simulation, "rotor_angle");
    assert!((turned - 1300.0 * 5e-5).abs() < 1e-12, "{turned}");
}

/// Behaves as the FMU does when an output is requested in Initialization Mode: on an error it restores the state
/// before.
fn tried(simulation: &mut Simulation) -> bool {
    let state = saved(simulation);
    let outcome = simulation.initialise(0.0);
    if outcome.is_err() {
        simulation.restore_state(&state).unwrap();
    }
    outcome.is_ok()
}

/// Returns scenes with parameters that are rejected for many reasons.
fn refusing() -> Vec<Scene> {
    let small = models::rub(3);
    let mut elastic = on_a_ring(models::rub(3));
    elastic.settings.contacts[0].friction = 0.1;
    let mut stiffened = stiffening(Scheme::ModalExact, 1e-6);
    stiffened.roms[0].sectors = 3;
    stiffened.settings.contacts[0].friction = 0.1;
    [small, round(Scheme::ModalExact), elastic, stiffened]
        .map(|mut scene| {
            scene.settings.contacts[0].friction = scene.settings.contacts[0].friction.max(0.05);
            scene
        })
        .into()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn rejected_calls_change_nothing(
        scene in 0..4_usize,
        asked in prop::collection::vec((0..9_u8, 1..4_i32, 0.0..1.0_f64), 14),
    ) {
        let scene = &refusing()[scene];
        let mut simulation = Simulation::new(scene).unwrap();
        let mut states: Vec<Vec<u8>> = Vec::new();
        let (mut started, mut history) = (false, Vec::new());
        for (kind, choice, share) in asked {
            let name = ["friction_coefficient", "damping_ratio", "internal_step_max", "speed"];
            let value = [2.0 * share, 0.99 * share, 10_f64.powf(-8.0 + 5.0 * share), 2000.0 * (share - 0.5)];
            match kind {
                0..=2 => {
                    let which = usize::try_from(choice).unwrap();
                    let _ = simulation.set_real(reference(&simulation, name[which]), value[which]);
                }
                3 => {
                    let _ = simulation.set_real(reference(&simulation, name[0]), value[0]);
                }
                4 => {
                    let _ = simulation.set_integer(reference(&simulation, "scheme"), choice);
                }
                5 if !started => started = tried(&mut simulation),
                5 | 6 if started => {
                    let _ = simulation.do_step(simulation.time(), 10_f64.powf(-7.0 + 3.0 * share));
                }
                7 => {
                    let state = saved(&simulation);
                    states.push(state);
                    history.push(started);
                }
                8 if !states.is_empty() => {
                    let index = usize::try_from(choice).unwrap() % states.len();
                    simulation.restore_state(&states[index]).unwrap();
                    started = history[index];
                }
                _ => {
                    simulation.reset();
                    started = false;
                }
            }
        }
        // After a reset the instance behaves like a new one: with rejected parameters, and with those of the scene.
        for scheme in [3, 1, scene.settings.time.scheme.number()] {
            simulation.reset();
            let mut fresh = Simulation::new(scene).unwrap();
            let mut outcomes = Vec::new();
            for one in [&mut simulation, &mut fresh] {
                one.set_integer(reference(one, "scheme"), scheme).unwrap();
                let outcome = one.initialise(0.0);
                let run = outcome.and_then(|()| {
                    (0..20).try_for_each(|index| one.do_step(one.time(), [3e-6, 7e-7][index % 2]))
                });
                outcomes.push((run.map_err(|error| error.to_string()), one.warnings().to_vec()));
            }
            prop_assert_eq!(&outcomes[0], &outcomes[1]);
            if outcomes[0].0.is_ok() {
                prop_assert_eq!(bits(&simulation), bits(&fresh));
            }
        }
    }
}

#[test]
fn rejects_a_scheme_without_modes_and_continues() {
    // Eight modes, three contact nodes: massless-boundary would make all of them quasi-static.
    let scene = models::rub(3);
    let mut simulation = Simulation::new(&scene).unwrap();
    let scheme = reference(&simulation, "scheme");
    simulation.set_integer(scheme, 3).unwrap();
    assert!(!tried(&mut simulation));
    simulation.set_integer(scheme, 2).unwrap();
    assert!(tried(&mut simulation));
    simulation.do_step(0.0, 1e-6).unwrap();
}

#[test]
fn runs_with_more_contact_nodes_than_modes() {
    for (nodes, seed) in [(9, 1), (9, 2), (16, 3), (16, 4), (25, 5), (33, 6)] {
        for scheme in Scheme::RECURRENCES {
            for (solver, coated) in
                [(Solver::Film, false), (Solver::Lcp, false), (Solver::Coulomb, false), (Solver::Lcp, true)]
            {
                if scheme == Scheme::MasslessBoundary && solver == Solver::Film {
                    continue;
                }
                let modes = if scheme == Scheme::MasslessBoundary { 3 * nodes + 4 } else { nodes / 2 };
                let mut scene = crowded(nodes, modes, seed);
                scene.settings.time.scheme = scheme;
                scene.settings.contacts[0].solver = solver;
                if coated {
                    models::coating(&mut scene);
                }
                let name = format!("{nodes} nodes, {modes} modes, {scheme:?}, {solver:?}, coated: {coated}");
                let mut simulation = try_started(&scene).unwrap_or_else(|error| panic!("{name}: {error}"));
                let mut peak: f64 = 0.0;
                for index in 1..=60 {
                    let inward = 5e-4 * (0.5 - 0.5 * (f64::from(index) / 10.0).cos());
                    set(&mut simulation, "casing_radius_change", -inward);
                    if let Err(error) = simulation.do_step(simulation.time(), 1e-5) {
                        // A solution exists, but with a tensile force.
                        let pulled =
                            solver == Solver::Film && error.to_string().contains("film has applied a tensile impulse");
                        assert!(pulled, "{name}, {index}: {error}");
                        break;
                    }
                    peak = peak.max(real(&simulation, "normal_force_peak"));
                }
                assert!(peak > 0.0, "{name} does not touch");
            }
        }
    }
}

/// Two contact nodes whose only mode moves one out of the casing by as much as it moves the other in.
#[test]
fn reports_nodes_that_no_mode_can_separate() {
    let shape = |row: usize, _: usize| if row.is_multiple_of(3) { 1.0 - 2.0 * (row / 3) as f64 } else { 0.0 };
    let place = |node: usize| [models::RADIUS, 0.02 * node as f64, 0.015 * node as f64];
    let nodes = (0..2).map(|node| models::node(format!("node_{}", node + 1), place(node), 0.0)).collect();
    let rom = models::modal("rocker", &[800.0], shape, nodes);
    for (solver, coated) in [(Solver::Lcp, false), (Solver::Coulomb, false), (Solver::Lcp, true)] {
        let mut scene = models::round(rom.clone());
        scene.settings.contacts[0].solver = solver;
        if coated {
            models::coating(&mut scene);
        }
        let mut simulation = try_started(&scene).unwrap();
        let error = (0..40).find_map(|index| {
            set(&mut simulation, "casing_radius_change", -4e-5 * f64::from(index));
            simulation.do_step(simulation.time(), 5e-5).err()
        });
        let message = error.expect("both nodes cannot leave the casing").to_string();
        assert!(message.contains("no motion of the modes") && !message.contains("friction"), "{solver:?}: {message}");
    }
}
