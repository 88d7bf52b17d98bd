//! Blades that cut a coating, against closed forms: kinematics alone determines the depth of cut, and with it force,
//! torque and volume.

use std::f64::consts::TAU;

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{CoatingSettings, CuttingSettings, Shape};
use tiprub_core::{CoSimulation, Rom, Scene};
use tiprub_test_models::{self as models, element, go, move_on, real, started};

/// Specific cutting energy (J/m³), and ratio of normal to tangential force.
const ENERGY: f64 = 5e7;
const RATIO: f64 = 0.8;
/// Length along the axis (m).
const LENGTH: f64 = 0.03;
const SPEED: f64 = 1000.0;
const GAP: f64 = 2e-5;
const BLADES: usize = 2;
/// Stiffness of the most flexible modes, the radial ones (N/m).
const STIFFNESS: f64 = 4e8;

/// Returns a blade of two contact nodes, each with a radial and a tangential mode.
fn blade() -> Rom {
    let frequencies = [20_000.0, 20_000.0, 31_000.0, 31_000.0];
    let size = TAU * 20_000.0 / STIFFNESS.sqrt();
    let shape = move |row: usize, mode: usize| {
        let (node, component) = (row / 3, row % 3);
        if mode % 2 == node && mode / 2 == component { size } else { 0.0 }
    };
    let nodes = ["low", "high"].into_iter().zip([0.0, LENGTH]);
    let nodes = nodes.map(|(name, z)| models::node(name, [models::RADIUS, 0.0, z], 0.0)).collect();
    Rom { sectors: BLADES, damping_ratio: 0.05, ..models::modal("cutter", &frequencies, shape, nodes) }
}

fn scene([cells_around, cells_along]: [usize; 2], step: f64) -> Scene {
    let mut scene = models::round(blade());
    let settings = &mut scene.settings;
    settings.structures[0].speed = SPEED;
    settings.contacts[0].gap = GAP;
    settings.contacts[0].coating = Some(CoatingSettings {
        thickness: 1e-3,
        modulus: 0.0,
        yield_stress: 0.0,
        hardening: 0.0,
        cells_around,
        cells_along,
        contact_width: None,
        cutting: Some(CuttingSettings { specific_energy: ENERGY, normal_ratio: RATIO }),
    });
    settings.time.step = step;
    settings.outputs.wear = true;
    scene
}

/// The casing closes at a steady rate: every blade takes the same depth of cut, regardless of its flexibility.
#[test]
fn steady_incursion_follows_its_kinematics() {
    println!("| cells | step (s) | torque | volume | work/(u V) | shaft work | cutting/shaft work | residual |");
    let (rate, turn) = (5e-3, TAU / SPEED);
    let depth = rate * turn / BLADES as f64;
    let cases = [([200, 1], 2e-6), ([400, 3], 2e-6), ([400, 3], 1e-6), ([800, 7], 5e-7)];
    // The last one turns in the opposite direction.
    for (cells, step, speed) in
        cases.map(|(cells, step)| (cells, step, SPEED)).into_iter().chain([(cases[1].0, 2e-6, -SPEED)])
    {
        let mut scene = scene(cells, step);
        scene.settings.structures[0].speed = speed;
        let mut run = started(&scene);
        move_on(&mut run, "casing_radius_change", 0.0, -rate);
        let (length, steps) = (turn / 20.0, 20 * 12);
        let (mut shaft, mut torque) = (0.0, 0.0);
        for index in 0..steps {
            go(&mut run, length);
            shaft -= real(&run, "torque") * speed * length;
            if index >= steps / 2 {
                torque += real(&run, "torque") / f64::from(steps / 2);
            }
        }
        // Volume per time 2πR L v, reduced by half a depth of cut in front of the blades and by their deflection.
        let flow = TAU * models::RADIUS * LENGTH;
        let torque = torque / (-ENERGY * flow * rate / speed) - 1.0;
        let yielded = 0.5 * RATIO * ENERGY * LENGTH * depth / STIFFNESS;
        let volume = real(&run, "worn_volume") / (flow * (rate * run.time() - GAP - 0.5 * depth - yielded)) - 1.0;
        let (work, booked) = (real(&run, "cutting_work"), real(&run, "shaft_work"));
        let ratio = work / (ENERGY * real(&run, "worn_volume")) - 1.0;
        let residual = real(&run, "energy_residual_relative");
        let (shaft, cutting) = (shaft / booked - 1.0, work / booked - 1.0);
        println!(
            "| {cells:?} | {step:.1e} | {torque:.1e} | {volume:.1e} | {ratio:.1e} | {shaft:.1e} | {cutting:.1e} | {residual:.1e} |"
        );
        assert!(torque.abs() < 1e-5 && volume.abs() < 2e-4, "{torque:e} {volume:e}");
        assert!(
            ratio.abs() < 1e-12 && shaft.abs() < 1e-12 && residual.abs() < 1e-12,
            "{ratio:e} {shaft:e} {residual:e}"
        );
        // The rest is heat of the tangential vibration.
        assert!(cutting.abs() < 1e-7, "{cutting:e}");
        assert!((real(&run, "wear_energy") / work - 1.0).abs() < 1e-12);
    }
}

/// An eccentric shaft cuts a sickle: e cos θ − g deep, 2RL(√(e² − g²) − g arccos(g/e)) in volume.
#[test]
fn displaced_shaft_cuts_a_crescent_and_then_runs_free() {
    println!("| cells | step (s) | largest error of depth / deepest | volume | (shaft + whirl) work / losses |");
    let (eccentricity, turn) = (8.0 * GAP, TAU / SPEED);
    let deepest = eccentricity - GAP;
    let mut errors = Vec::new();
    for (around, step) in [(100, 8e-6), (200, 4e-6), (400, 2e-6)] {
        let mut scene = scene([around, 2], step);
        scene.settings.structures[0].whirl = true;
        scene.settings.outputs.wear_profile = true;
        let mut run = started(&scene);
        for index in 0..160 {
            if index < 100 {
                move_on(&mut run, "whirl_x", eccentricity * f64::from(index) / 100.0, eccentricity / (5.0 * turn));
            } else {
                move_on(&mut run, "whirl_x", eccentricity, 0.0);
            }
            go(&mut run, turn / 20.0);
        }
        let count = u32::try_from(around).unwrap();
        let depth = |angle: f64| (eccentricity * angle.cos() - GAP).max(0.0);
        let error = |place: u32| {
            let angle = (f64::from(place) + 0.5) * TAU / f64::from(count);
            (element(&run, "wear_profile_around", place) - depth(angle)).abs() / deepest
        };
        let worst = (0..count).map(error).fold(0.0, f64::max);
        let edge = (GAP / eccentricity).acos();
        let sickle = 2.0 * models::RADIUS * LENGTH * (eccentricity * edge.sin() - GAP * edge);
        let volume = real(&run, "worn_volume") / sickle - 1.0;
        let paid = real(&run, "shaft_work") + real(&run, "whirl_work");
        let lost = real(&run, "cutting_work") + real(&run, "wear_work") + real(&run, "damping_loss");
        println!("| {around} x 2 | {step:.0e} | {worst:.1e} | {volume:.1e} | {:.1e} |", paid / lost - 1.0);
        assert!((paid / lost - 1.0).abs() < 1e-3, "{paid} {lost}");
        errors.push((worst, volume.abs()));
        // The same value from the profile along the axis, and from the wear of every cell.
        let along: f64 = (0..2).map(|row| element(&run, "wear_profile_along", row)).sum::<f64>() * 0.5;
        assert!((along * TAU * models::RADIUS * LENGTH / real(&run, "worn_volume") - 1.0).abs() < 1e-12);
        let peak = real(&run, "torque");
        assert!(peak.abs() < 1e-2 * ENERGY * LENGTH * deepest * models::RADIUS, "it runs free: {peak} N m");
    }
    let (first, last) = (errors[0], errors[2]);
    assert!(last.0 < 8e-3 && last.1 < 6e-3, "{errors:?}");
    // First order in the width of a cell, which ends as deep as the deepest pass in it.
    assert!(last.0 < 0.3 * first.0 && last.1 < 0.3 * first.1, "{errors:?}");
}

/// The force of a cut does not depend on the width of cells; pressing follows another law, and the hard casing has a
/// separate friction coefficient.
#[test]
fn hard_casing_with_friction_acts_beyond_the_coating() {
    let mut scene = scene([200, 2], 2e-6);
    let contact = &mut scene.settings.contacts[0];
    contact.friction = 0.1;
    contact.coating.as_mut().unwrap().thickness = 2e-6;
    let mut run = started(&scene);
    move_on(&mut run, "casing_radius_change", 0.0, -5e-3);
    let turn = TAU / SPEED;
    for _ in 0..40 {
        go(&mut run, turn / 20.0);
    }
    // The coating is removed around the whole circumference.
    let volume = TAU * models::RADIUS * LENGTH * 2e-6;
    assert!((real(&run, "worn_volume") / volume - 1.0).abs() < 2e-2, "{:e}", real(&run, "worn_volume") / volume - 1.0);
    let (friction, cut) = (real(&run, "friction_loss"), real(&run, "cutting_work"));
    assert!((cut / (ENERGY * real(&run, "worn_volume")) - 1.0).abs() < 1e-12);
    assert!(friction > cut, "{friction} J {cut} J");
    assert!(real(&run, "energy_residual_relative").abs() < 1e-12);
}

#[test]
fn cutting_state_is_restored_without_allocation() {
    let start = || {
        let mut scene = scene([300, 3], 2e-6);
        scene.settings.contacts[0].friction = 0.1;
        scene.settings.structures[0].whirl = true;
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.5, width: 0.15, phase: 0.0 };
        started(&scene)
    };
    crate::checks::state_continues("cutting", &start);
    crate::checks::allocates_nothing("cutting", start());
    crate::checks::ledger_closes("cutting", start(), 1e-11);
}

/// A normal mode that bends along the sliding direction, into the coating for one sign: the error that ends the run
/// names the cause.
#[test]
fn warns_of_growth_under_a_cut_when_it_ends_a_run() {
    let mut scene = scene([200, 2], 1e-6);
    let rom = &mut scene.roms[0];
    for node in 0..2 {
        // The radial mode of each node also moves it in the sliding direction.
        rom.contact_map[(3 * node + 1, node)] = -3.0 * rom.contact_map[(3 * node, node)];
    }
    let cutting = &mut scene.settings.contacts[0].coating.as_mut().unwrap().cutting;
    *cutting = Some(CuttingSettings { specific_energy: 1e12, normal_ratio: 0.5 });
    for speed in [SPEED, -SPEED, 0.0] {
        scene.settings.structures[0].speed = speed;
        let mut run = started(&scene);
        let reported = |part: &str| run.warnings().iter().any(|warning| warning.contains(part));
        assert!(reported("cutting is physically unstable") && !reported("0.0000 kHz"), "{:?}", run.warnings());
        assert_eq!(
            reported("with a coating that the blades cut: the sliding law"),
            speed.abs() < 1.0,
            "{:?}",
            run.warnings()
        );
        move_on(&mut run, "casing_radius_change", 0.0, -0.5);
        let ended = (0..400).find_map(|_| run.do_step(run.time(), 1e-5).err()).unwrap().to_string();
        assert!(
            ended.contains("cutting is physically unstable") && ended.contains("deflection in one direction"),
            "{ended}"
        );
    }
}

#[test]
fn rejects_features_incompatible_with_cutting() {
    let refused = |change: &dyn Fn(&mut Scene), parts: &[&str]| {
        let mut scene = scene([200, 1], 2e-6);
        change(&mut scene);
        let message = tiprub_test_models::try_started(&scene).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    let coating = |change: fn(&mut CoatingSettings)| {
        move |scene: &mut Scene| change(scene.settings.contacts[0].coating.as_mut().unwrap())
    };
    let cutting = |change: fn(&mut CuttingSettings)| {
        move |scene: &mut Scene| {
            change(scene.settings.contacts[0].coating.as_mut().unwrap().cutting.as_mut().unwrap());
        }
    };
    refused(
        &coating(|c| c.modulus = 1e9),
        &["contact[1].coating.modulus: cannot be combined with `contact.coating.cutting`"],
    );
    refused(&coating(|c| c.yield_stress = 1e6), &["contact[1].coating.yield_stress: cannot be combined with"]);
    refused(&coating(|c| c.hardening = 1e6), &["contact[1].coating.hardening: cannot be combined with"]);
    refused(
        &cutting(|c| c.specific_energy = 0.0),
        &["contact[1].coating.cutting.specific_energy: 0", "between 1000 and 1e12"],
    );
    refused(
        &cutting(|c| c.normal_ratio = f64::NAN),
        &["contact[1].coating.cutting.normal_ratio", "between 0.05 and 20"],
    );
    let scheme = |scheme| move |scene: &mut Scene| scene.settings.time.scheme = scheme;
    refused(
        &scheme(Scheme::MasslessBoundary),
        &["`massless-boundary` cannot be combined with `contact.coating.cutting`"],
    );
    refused(&scheme(Scheme::Galerkin), &["`galerkin` cannot be combined with `contact.coating`"]);
    refused(
        &|scene| scene.settings.contacts[0].solver = Solver::Coulomb,
        &["a solver other than `lcp` cannot be combined with a coating"],
    );
}
