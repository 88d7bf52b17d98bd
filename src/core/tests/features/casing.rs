//! Optional features: a ledger that closes, states that continue, laws of mechanics.

use crate::checks::{allocates_nothing, disturb, ledger_closes, state_continues};
use tiprub_core::geometry::{Geometry, PrescribedMotion};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{LoadSettings, PatchSettings, Shape, SplineSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{self as models, coating, element, flexible, go, real, saved, set, started, try_started};

/// Twelve blades that rub the two-lobe casing, with one feature added.
type Feature = (&'static str, fn(&mut Scene));

fn spinning(scene: &mut Scene) {
    let order = scene.roms[0].order();
    scene.roms[0].extras.spin = Some(models::spin(order));
}

const FEATURES: [Feature; 13] = [
    ("plain", |_| {}),
    ("no friction", |scene| scene.settings.contacts[0].friction = 0.0),
    ("undamped", |scene| scene.settings.structures[0].damping_ratio = Some(0.0)),
    ("mistuned", |scene| {
        scene.settings.structures[0].frequency_factors = (0..12).map(|i| 1.0 + 0.03 * f64::from(i).sin()).collect();
    }),
    ("stiffening and growth", |scene| {
        spinning(scene);
        scene.settings.structures[0].spin.stiffening = true;
        scene.settings.structures[0].spin.growth = true;
    }),
    ("coriolis", |scene| {
        spinning(scene);
        scene.settings.structures[0].spin.coriolis = true;
    }),
    ("whirl and shift", |scene| {
        scene.settings.structures[0].whirl = true;
        scene.settings.structures[0].axial_shift = true;
    }),
    ("spline", |scene| scene.settings.surfaces[0].spline = Some(SplineSettings::default())),
    ("flexible casing", flexible),
    ("thermal, loaded casing", |scene| {
        flexible(scene);
        scene.settings.structures[1].thermal = true;
        scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 3e3, phase: 0.2 });
    }),
    ("coating", coating),
    ("coating, flexible casing", |scene| {
        flexible(scene);
        coating(scene);
    }),
    ("all together", |scene| {
        flexible(scene);
        spinning(scene);
        let rotor = &mut scene.settings.structures[0];
        rotor.spin.stiffening = true;
        rotor.spin.growth = true;
        rotor.whirl = true;
        rotor.frequency_factors = (0..12).map(|i| 1.0 + 0.03 * f64::from(i).sin()).collect();
        scene.settings.structures[1].thermal = true;
    }),
];

fn scene_with(feature: Feature, scheme: Scheme, solver: Solver) -> Scene {
    let mut scene = models::rub(12);
    scene.roms[0] = models::rich_blade(12);
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].solver = solver;
    scene.settings.surfaces[0].patches = Some(PatchSettings { around: 8, along: 2 });
    feature.1(&mut scene);
    scene
}

/// Returns whether a combination is rejected, as documented: every other combination of scheme, solver and feature
/// runs.
fn is_refused(feature: &str, scheme: Scheme, solver: Solver) -> bool {
    (feature.contains("coating") && solver != Solver::Lcp)
        || (scheme == Scheme::MasslessBoundary && (feature == "coriolis" || solver == Solver::Film))
}

/// Runs `check` on every accepted combination, with its name; rejected ones must fail immediately.
fn every_combination(mut check: impl FnMut(&str, Scene)) {
    for feature in FEATURES {
        for (scheme, solver) in
            Scheme::RECURRENCES.into_iter().flat_map(|scheme| Solver::ALL.map(|solver| (scheme, solver)))
        {
            let (name, scene) =
                (format!("{} | {scheme:?} | {solver:?}", feature.0), scene_with(feature, scheme, solver));
            if is_refused(feature.0, scheme, solver) {
                assert!(try_started(&scene).is_err(), "{name} was not refused");
            } else {
                check(&name, scene);
            }
        }
    }
}

#[test]
fn energy_balance_closes_for_every_combination() {
    every_combination(|name, scene| ledger_closes(name, started(&scene), 1e-13));
}

#[test]
fn saved_state_is_bit_identical_with_every_feature() {
    every_combination(|name, scene| {
        let richest = if name.contains("coating") { Solver::Lcp } else { Solver::Coulomb };
        if scene.settings.contacts[0].solver == richest && scene.settings.time.scheme != Scheme::CentralDifference {
            state_continues(name, &|| started(&scene));
        }
    });
}

#[test]
fn step_does_not_allocate_with_any_feature() {
    every_combination(|name, scene| allocates_nothing(name, started(&scene)));
}

#[test]
fn rejects_casing_load_that_the_grid_cannot_resolve() {
    let with = |order| {
        let mut scene = scene_with(("flexible casing", flexible), Scheme::ModalExact, Solver::Lcp);
        scene.settings.structures[1].load = Some(LoadSettings { order, amplitude: 0.0, phase: 0.0 });
        Simulation::new(&scene)
    };
    // 36 nodes around the circumference distinguish nodal diameters up to 17: 18 has no phase, 34 would be 2.
    with(17).unwrap();
    for order in [18, 34, u32::MAX] {
        let message = with(order).unwrap_err().to_string();
        assert!(message.contains("casing_load_order") && message.contains("resolves only 0 to 17"), "{message}");
    }
}

#[test]
fn rejects_state_with_any_bit_changed_without_changes() {
    let (name, all) = FEATURES[FEATURES.len() - 1];
    let mut scene = scene_with((name, all), Scheme::ModalExact, Solver::Lcp);
    coating(&mut scene);
    scene.settings.contacts[0].coating.as_mut().unwrap().cells_around = 40;
    let mut simulation = started(&scene);
    // Saved within a communication step, after contact.
    for index in 0..40 {
        disturb(&mut simulation, index);
        go(&mut simulation, 5e-5);
    }
    simulation.begin_step(simulation.time(), 5e-5).unwrap();
    for _ in 0..20 {
        assert!(!simulation.advance().unwrap().finished);
    }
    let state = saved(&simulation);
    let mut twin = Simulation::new(&scene).unwrap();
    let untouched = saved(&twin);
    let mut again = untouched.clone();
    for byte in (0..state.len()).step_by(1 + state.len() / 997).chain([0, 8, 16, 24, state.len() - 1]) {
        let mut damaged = state.clone();
        damaged[byte] ^= 1 << (byte % 8);
        assert!(twin.restore_state(&damaged).is_err(), "byte {byte}");
    }
    for length in [0, 7, 8, state.len() - 1, state.len() + 8] {
        assert!(twin.restore_state(&vec![0; length]).is_err());
    }
    twin.save_state(&mut again).unwrap();
    assert!(again == untouched);
    // A reset clears everything, including wear.
    assert!(real(&simulation, "worn_volume") > 0.0);
    simulation.reset();
    simulation.initialise(0.0).unwrap();
    let mut fresh = started(&scene);
    let ends = [&mut simulation, &mut fresh].map(|simulation| {
        simulation.do_step(0.0, 5e-5).unwrap();
        saved(simulation)
    });
    assert!(ends[0] == ends[1]);
    assert_eq!(real(&simulation, "worn_volume").to_bits(), 0.0_f64.to_bits());
}

#[test]
fn complementarity_holds_over_a_long_rub_of_the_whole_casing() {
    let plain = ("plain", (|_| {}) as fn(&mut Scene));
    let elastic = ("flexible casing", flexible as fn(&mut Scene));
    for (name, feature) in [("rigid", plain), ("flexible", elastic), ("flexible, skipping open nodes", elastic)] {
        let mut scene = scene_with(feature, Scheme::ModalExact, Solver::Lcp);
        let is_skipping = name.contains("skipping");
        if !is_skipping {
            // The gaps of watched sectors are evaluated in every step.
            scene.settings.outputs.watched_sectors = (1..=12).collect();
        }
        // A round casing: gaps are affine in the displacements, so that they can be recomputed independently.
        scene.settings.surfaces[0].shape = Shape::Circular {};
        let mut simulation = started(&scene);
        let (mut adhesion, mut penetration, mut product, mut again, mut most) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64, 0);
        for index in 0..20_000 {
            // The casing closes on all blades and opens again.
            let closing = -9e-4 * (std::f64::consts::PI * f64::from(index) / 20_000.0).sin();
            set(&mut simulation, "casing_radius_change", closing);
            go(&mut simulation, 1e-6);
            let system = simulation.system();
            let lanes = system.bank().lanes();
            let largest = system.events().iter().fold(0.0, |a: f64, event| a.max(event.normal));
            let drive = PrescribedMotion {
                rotor_angle: real(&simulation, "rotor_angle"),
                radius_change: closing,
                shape_factor: 1.0,
                ..PrescribedMotion::default()
            };
            let (mut law, mut gaps) = (system.pairs()[0].gap().clone(), system.structures()[0].gaps().to_vec());
            let mut geometry = Geometry::new(law.nodes() * lanes, law.spline().is_some());
            let moved = system.structures().get(1).map_or(&[][..], |slave| slave.modes().displacement());
            law.evaluate(&drive, system.bank().displacement(), moved, None, &mut geometry, &mut gaps);
            let off = gaps.iter().zip(system.gaps()).filter(|(gap, _)| gap.is_finite());
            // A gap that is not evaluated is a lower bound.
            let error = |gap: f64, booked: f64| if is_skipping { booked - gap } else { (booked - gap).abs() };
            again = off.fold(again, |a, (gap, booked)| a.max(error(*gap, *booked) / 3.56e-4));
            most = most.max(system.events().len());
            for (place, gap) in system.gaps().enumerate().filter(|(place, _)| place % lanes < 12) {
                let multiplier = system.multiplier(place / lanes, place % lanes);
                penetration = penetration.max(-gap / 3.56e-4);
                if largest > 0.0 {
                    adhesion = adhesion.max(-multiplier / largest);
                    product = product.max((multiplier * gap).abs() / (largest * 3.56e-4));
                }
            }
        }
        println!(
            "{name}: up to {most} of 36 nodes, adhesion {adhesion:.1e}, penetration {penetration:.1e}, product {product:.1e}, gaps evaluated again {again:.1e}"
        );
        assert_eq!(most, 36, "{name}");
        assert!(adhesion <= 1e-10 && penetration <= 1e-10 && product <= 1e-10, "{name}");
        // On the flexible casing the normal turns within the step, which the linear gap of the step neglects.
        assert!(again <= if name == "rigid" { 1e-10 } else { 1e-3 }, "{name}: {again:e}");
    }
}

#[test]
fn the_order_of_the_casing_load_is_a_parameter() {
    let mut scene = scene_with(("flexible casing", flexible), Scheme::ModalExact, Solver::Lcp);
    scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 0.0, phase: 0.0 });
    scene.settings.contacts[0].gap = 2e-2;
    scene.settings.outputs.slave_displacement = true;
    let displacement = |order: i32, phase: f64| {
        let mut simulation = Simulation::new(&scene).unwrap();
        let reference = simulation.table().find("casing_load_order").unwrap().reference;
        simulation.set_integer(reference, order).unwrap();
        set(&mut simulation, "casing_load_amplitude", 1e3);
        set(&mut simulation, "casing_load_phase", phase);
        simulation.initialise(0.0).map(|()| {
            let first = simulation.table().find("casing_displacement").unwrap().reference;
            (0..36).map(|i| simulation.real(first + i).unwrap()).collect::<Vec<f64>>()
        })
    };
    for order in [2, 3, 4] {
        for phase in [0.0, 0.7] {
            let found = displacement(order, phase).unwrap();
            let angle = |i: usize| f64::from(order) * std::f64::consts::TAU * i as f64 / 36.0 - phase;
            let amplitude = found.iter().enumerate().map(|(i, u)| u * angle(i).cos()).sum::<f64>() / 18.0;
            // One pair of modes responds: u = A cos(nθ − φ), outwards where the load is.
            let off = found.iter().enumerate().map(|(i, u)| (u - amplitude * angle(i).cos()).abs()).fold(0.0, f64::max);
            assert!(amplitude > 0.0 && off < 1e-12 * amplitude, "order {order}: {amplitude:e}, {off:e}");
            // 1000 N/m cos² over the circumference, on modes of amplitude 0.5 with ω = 2πf.
            let omega = std::f64::consts::TAU * [0.0, 0.0, 400.0, 1100.0, 2100.0][usize::try_from(order).unwrap()];
            let expected = 1e3 * std::f64::consts::PI * 0.25 * 0.5 * 0.5 / (omega * omega);
            assert!((amplitude / expected - 1.0).abs() < 1e-12, "order {order}: {amplitude:e} for {expected:e}");
        }
    }
    let refusal = displacement(18, 0.0).unwrap_err().to_string();
    assert!(refusal.contains("casing_load_order") && refusal.contains("0 to 17"), "{refusal}");
}

#[test]
fn wear_energy_is_at_least_yield_stress_times_volume() {
    let mut simulation = started(&scene_with(("coating", coating), Scheme::ModalExact, Solver::Lcp));
    let mut before = 0.0;
    for _ in 0..60 {
        go(&mut simulation, 5e-5);
        let energy = real(&simulation, "wear_energy");
        assert!(energy >= before);
        before = energy;
    }
    // Y V for no hardening, (Y + K e) V with e the largest plastic strain for full hardening everywhere.
    let (volume, strain) = (real(&simulation, "worn_volume"), real(&simulation, "wear_depth_maximum") / 1.5e-4);
    assert!(volume > 0.0);
    assert!(before >= 1e6 * volume * (1.0 - 1e-12) && before <= (1e6 + 2e7 * strain) * volume, "{before:e} J");
}

/// Friction heat goes into the patches of the casing and into the blades as the scene prescribes, without loss.
#[test]
fn friction_power_is_shared_between_blades_and_patches() {
    let (share, length) = (0.3, 5e-5);
    let mut scene = scene_with(("plain", |_| {}), Scheme::ModalExact, Solver::Lcp);
    scene.settings.contacts[0].slave_heat_fraction = Some(share);
    let mut simulation = started(&scene);
    let mut before = 0.0;
    for _ in 0..40 {
        go(&mut simulation, length);
        let loss = real(&simulation, "friction_loss");
        let (power, blades) = ((loss - before) / length, real(&simulation, "blade_friction_power"));
        let patches: f64 = (0..16).map(|patch| element(&simulation, "casing_friction_power", patch)).sum();
        let scale = 1e-12 * power.max(1.0);
        assert!((blades - (1.0 - share) * power).abs() < scale, "{blades} of {power} W");
        assert!((patches - share * power).abs() < scale, "{patches} of {power} W");
        before = loss;
    }
    assert!(before > 0.01, "{before} J");
}

/// Friction forces exist with friction, forces of the last step if they are requested.
#[test]
fn blade_has_the_outputs_requested_by_its_scene() {
    let of = |friction: f64, instantaneous: bool| {
        let mut scene = scene_with(("plain", |_| {}), Scheme::ModalExact, Solver::Lcp);
        scene.settings.contacts[0].friction = friction;
        scene.settings.outputs.instantaneous_forces = instantaneous;
        let simulation = Simulation::new(&scene).unwrap();
        [
            "clearance",
            "clearance_minimum",
            "normal_force",
            "tangential_force",
            "normal_force_instantaneous",
            "tangential_force_instantaneous",
        ]
        .map(|name| simulation.table().find(&format!("blade[1].{name}")).is_some())
    };
    assert_eq!(of(0.0, false), [true, true, true, false, false, false]);
    assert_eq!(of(0.15, false), [true, true, true, true, false, false]);
    assert_eq!(of(0.0, true), [true, true, true, false, true, false]);
    assert_eq!(of(0.15, true), [true; 6]);
}
