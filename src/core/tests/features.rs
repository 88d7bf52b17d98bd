//! Everything that is off unless a scene asks for it: a ledger that closes, states that continue, laws of mechanics.

mod common;
#[path = "common/features.rs"]
mod common_features;
#[path = "common/counting.rs"]
mod counting;

use common_features::{coating, flexible};
use tiprub_core::contact::gap::{Drive, GapLaw};
use tiprub_core::settings::{LoadSettings, PatchSettings, Scheme, Shape, Solver, SplineSettings};
use tiprub_core::{Scene, Simulation};

fn real(simulation: &Simulation, name: &str) -> f64 {
    let reference = simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference;
    simulation.real(reference).unwrap()
}

fn set(simulation: &mut Simulation, name: &str, element: u32, value: f64) {
    let reference = simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference;
    simulation.set_real(reference + element, value).unwrap();
}

/// Twelve blades that rub the two-lobe casing, with one thing added.
type Feature = (&'static str, fn(&mut Scene));

fn spinning(scene: &mut Scene) {
    let order = scene.roms[0].order();
    scene.roms[0].extras.spin = Some(common::spin(order));
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

/// Inputs that change from step to step, wherever the scene has them.
fn disturb(simulation: &mut Simulation, index: u32) {
    let x = f64::from(index);
    let inputs: [(&str, f64); 6] = [
        ("speed", 1300.0 + 40.0 * (0.2 * x).sin()),
        ("whirl_x", 2e-5 * (0.3 * x).sin()),
        ("whirl_y", 2e-5 * (0.3 * x).cos()),
        ("axial_shift", 1e-5 * (0.1 * x).sin()),
        ("casing_load_amplitude", 3e3 * (0.05 * x).cos()),
        ("casing_load_phase", 0.05 * x),
    ];
    for (name, value) in inputs {
        let Some(reference) = simulation.table().find(name).map(|row| row.reference) else { continue };
        simulation.set_real(reference, value).unwrap();
        simulation.set_input_derivative(reference, 1, 0.1 * value).unwrap();
    }
    if simulation.table().find("casing_temperature").is_some() {
        for patch in 0..4 {
            set(simulation, "casing_temperature", patch, (0.1 * x + f64::from(patch)).sin());
        }
    }
}

fn scene_with(feature: Feature, scheme: Scheme, solver: Solver) -> Scene {
    let mut scene = common::scene(12);
    scene.roms[0] = common::rich_rom(12);
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].solver = solver;
    scene.settings.surfaces[0].patches = Some(PatchSettings { around: 8, along: 2 });
    feature.1(&mut scene);
    scene
}

/// What is refused, as documented: every other combination of scheme, solver and feature runs.
fn is_refused(feature: &str, scheme: Scheme, solver: Solver) -> bool {
    (feature.contains("coating") && solver != Solver::Lcp)
        || (feature == "coriolis" && scheme == Scheme::MasslessBoundary)
}

#[test]
fn the_energy_ledger_closes_for_every_combination() {
    println!("| feature | scheme | solver | contact steps | residual / energy |\n|---|---|---|---|---|");
    let mut worst: f64 = 0.0;
    for feature in FEATURES {
        for scheme in [Scheme::CentralDifference, Scheme::ModalExact, Scheme::MasslessBoundary] {
            for solver in [Solver::Film, Solver::Lcp, Solver::Coulomb] {
                let scene = scene_with(feature, scheme, solver);
                let started = Simulation::new(&scene).and_then(|mut simulation| {
                    simulation.initialise(0.0)?;
                    Ok(simulation)
                });
                if is_refused(feature.0, scheme, solver) {
                    assert!(started.is_err(), "{} {scheme:?} {solver:?} was not refused", feature.0);
                    continue;
                }
                let mut simulation =
                    started.unwrap_or_else(|error| panic!("{} {scheme:?} {solver:?}: {error}", feature.0));
                let mut contact = 0;
                for index in 0..60 {
                    disturb(&mut simulation, index);
                    let (time, step) = (simulation.time(), if index % 7 == 0 { 6.3e-5 } else { 5e-5 });
                    simulation
                        .do_step(time, step)
                        .unwrap_or_else(|error| panic!("{} {scheme:?} {solver:?} step {index}: {error}", feature.0));
                    contact += simulation.system().events().len();
                }
                let residual = real(&simulation, "energy_residual_relative");
                println!("| {} | {scheme:?} | {solver:?} | {contact} | {residual:.1e} |", feature.0);
                assert!(contact > 0, "{} {scheme:?} {solver:?} never touched", feature.0);
                assert!(residual.abs() < 1e-13, "{} {scheme:?} {solver:?}: {residual:e}", feature.0);
                worst = worst.max(residual.abs());
            }
        }
    }
    println!("worst {worst:.1e}");
}

#[test]
fn a_load_that_the_contact_grid_cannot_carry_is_refused() {
    let with = |order| {
        let mut scene = scene_with(("flexible casing", flexible), Scheme::ModalExact, Solver::Lcp);
        scene.settings.structures[1].load = Some(LoadSettings { order, amplitude: 0.0, phase: 0.0 });
        Simulation::new(&scene)
    };
    // 36 nodes around tell nodal diameters up to 17 apart: 18 has no phase, 34 would be 2.
    with(17).unwrap();
    for order in [18, 34, u32::MAX] {
        let message = with(order).unwrap_err().to_string();
        assert!(message.contains("casing_load_order") && message.contains("resolves 0 to 17"), "{message}");
    }
}

#[test]
fn a_saved_state_continues_with_identical_bits_whatever_is_on() {
    for feature in FEATURES {
        for scheme in [Scheme::ModalExact, Scheme::MasslessBoundary] {
            let solver = if feature.0.contains("coating") { Solver::Lcp } else { Solver::Coulomb };
            if is_refused(feature.0, scheme, solver) {
                continue;
            }
            let scene = scene_with(feature, scheme, solver);
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.initialise(0.0).unwrap();
            let advance = |simulation: &mut Simulation, from: u32| {
                for index in from..from + 15 {
                    disturb(simulation, index);
                    let time = simulation.time();
                    simulation.do_step(time, if index % 4 == 0 { 6.1e-5 } else { 5e-5 }).unwrap();
                }
                let mut state = vec![0; simulation.state_size()];
                simulation.save_state(&mut state).unwrap();
                state
            };
            advance(&mut simulation, 0);
            advance(&mut simulation, 15);
            let middle = advance(&mut simulation, 30);
            let end = advance(&mut simulation, 45);
            // Into another instance, which has been elsewhere in between.
            let mut other = Simulation::new(&scene).unwrap();
            set(&mut other, "speed", 0, 900.0);
            other.initialise(0.0).unwrap();
            let time = other.time();
            other.do_step(time, 5e-5).unwrap();
            other.restore_state(&middle).unwrap();
            assert!(advance(&mut other, 45) == end, "{} {scheme:?}", feature.0);
        }
    }
}

#[test]
fn a_step_asks_for_no_memory_whatever_is_on() {
    for feature in FEATURES {
        for scheme in [Scheme::CentralDifference, Scheme::ModalExact, Scheme::MasslessBoundary] {
            for solver in [Solver::Film, Solver::Lcp, Solver::Coulomb] {
                if is_refused(feature.0, scheme, solver) {
                    continue;
                }
                let mut simulation = Simulation::new(&scene_with(feature, scheme, solver)).unwrap();
                simulation.initialise(0.0).unwrap();
                let mut state = vec![0; simulation.state_size()];
                let (mut contacts, mut allocations) = (0, 0);
                for index in 0..40 {
                    disturb(&mut simulation, index);
                    let (time, step) = (simulation.time(), if index % 7 == 0 { 6.3e-5 } else { 5e-5 });
                    allocations += counting::allocations_of(|| simulation.do_step(time, step).unwrap());
                    contacts += simulation.system().events().len();
                }
                allocations += counting::allocations_of(|| simulation.save_state(&mut state).unwrap());
                assert!(contacts > 0, "{} {scheme:?} {solver:?} never touched", feature.0);
                assert_eq!(allocations, 0, "{} {scheme:?} {solver:?}", feature.0);
            }
        }
    }
}

#[test]
fn a_state_with_any_bit_changed_is_refused_and_changes_nothing() {
    let (name, all) = FEATURES[FEATURES.len() - 1];
    let mut scene = scene_with((name, all), Scheme::ModalExact, Solver::Lcp);
    coating(&mut scene);
    scene.settings.contacts[0].coating.as_mut().unwrap().cells_around = 40;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.initialise(0.0).unwrap();
    // Saved in the middle of a communication step, after contact.
    for index in 0..40 {
        disturb(&mut simulation, index);
        simulation.do_step(simulation.time(), 5e-5).unwrap();
    }
    simulation.begin_step(simulation.time(), 5e-5).unwrap();
    for _ in 0..20 {
        assert!(!simulation.advance().unwrap().finished);
    }
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    let mut twin = Simulation::new(&scene).unwrap();
    let mut untouched = vec![0; twin.state_size()];
    twin.save_state(&mut untouched).unwrap();
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
    // The twin continues in the middle of the step; neither disturbs the other.
    twin.restore_state(&state).unwrap();
    let finish = |simulation: &mut Simulation| {
        while !simulation.advance().unwrap().finished {}
        disturb(simulation, 41);
        simulation.do_step(simulation.time(), 6.1e-5).unwrap();
        let mut end = vec![0; simulation.state_size()];
        simulation.save_state(&mut end).unwrap();
        end
    };
    let (first, second) = (finish(&mut twin), finish(&mut simulation));
    assert!(first == second);
    // Reset forgets everything, wear included.
    assert!(real(&simulation, "worn_volume") > 0.0);
    simulation.reset();
    simulation.initialise(0.0).unwrap();
    let mut fresh = Simulation::new(&scene).unwrap();
    fresh.initialise(0.0).unwrap();
    let ends = [&mut simulation, &mut fresh].map(|simulation| {
        simulation.do_step(0.0, 5e-5).unwrap();
        let mut state = vec![0; simulation.state_size()];
        simulation.save_state(&mut state).unwrap();
        state
    });
    assert!(ends[0] == ends[1]);
    assert_eq!(real(&simulation, "worn_volume").to_bits(), 0.0_f64.to_bits());
}

#[test]
fn action_equals_reaction_and_angular_momentum_is_kept() {
    for (name, feature) in [
        ("flexible casing", flexible as fn(&mut Scene)),
        ("rigid spline", |scene: &mut Scene| {
            scene.settings.surfaces[0].spline = Some(SplineSettings::default());
        }),
    ] {
        for (scheme, solver) in [
            (Scheme::CentralDifference, Solver::Film),
            (Scheme::ModalExact, Solver::Lcp),
            (Scheme::ModalExact, Solver::Coulomb),
            (Scheme::MasslessBoundary, Solver::Lcp),
        ] {
            let mut scene = scene_with((name, feature), scheme, solver);
            scene.settings.structures[0].whirl = true;
            scene.settings.structures[0].axial_shift = true;
            let [force, moment, modal] = balance(&scene);
            println!(
                "{name} {scheme:?} {solver:?}: forces {force:.1e}, moments {moment:.1e}, modal forces {modal:.1e}"
            );
            assert!(force < 1e-14 && moment < 1e-13 && modal < 1e-12, "{force:e}, {moment:e}, {modal:e}");
        }
    }
}

/// Largest residuals over a rub: of force and moment on master and on control points about the origin, relative to |F| and |F| r, and
/// of the modal forces on the casing against those of the control points.
fn balance(scene: &Scene) -> [f64; 3] {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let (mut worst, mut contacts) = ([0.0_f64; 3], 0);
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    for index in 0..150 {
        disturb(&mut simulation, index);
        let time = simulation.time();
        simulation.begin_step(time, 1e-5).unwrap();
        while !simulation.advance().unwrap().finished {
            let system = simulation.system();
            let GapLaw::Spline(law) = system.pairs()[0].gap() else { panic!("no spline") };
            let (mut sums, mut scale) = ([[0.0; 3]; 2], 0.0);
            let mut modal = vec![0.0; system.structures().get(1).map_or(0, |slave| slave.contact_force().len())];
            for event in system.events() {
                let force = event.wrench.force;
                // About the origin: the shaft's centre is at `shaft`.
                let lever = cross(system.pairs()[0].drive_now().shaft, force);
                for i in 0..3 {
                    sums[0][i] += force[i];
                    sums[1][i] += event.wrench.moment[i] + lever[i];
                }
                scale += event.normal;
                let place = system.structures()[0].geometry().places[event.node * system.bank().lanes() + event.sector];
                for (index, weight) in law.surface.weights(place).iter() {
                    let acts = force.map(|value| -weight * value);
                    let moment = cross(law.surface.control_points()[index], acts);
                    for i in 0..3 {
                        sums[0][i] += acts[i];
                        sums[1][i] += moment[i];
                        if let Some(slave) = system.structures().get(1) {
                            let shapes = slave.modes().uncoupled().unwrap().contact_row(3 * index + i);
                            modal.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum += acts[i] * shape);
                        }
                    }
                }
                contacts += 1;
            }
            if scale > 0.0 {
                let largest = |sum: [f64; 3]| sum.iter().fold(0.0, |worst: f64, value| worst.max(value.abs()));
                worst[0] = worst[0].max(largest(sums[0]) / scale);
                worst[1] = worst[1].max(largest(sums[1]) / (0.25 * scale));
                let own = system.structures().get(1).map_or(&[][..], |slave| slave.contact_force());
                let most = modal.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
                let off = own.iter().zip(&modal).map(|(own, modal)| (own - modal).abs() / most);
                worst[2] = off.fold(worst[2], f64::max);
            }
        }
    }
    assert!(contacts > 100, "{contacts} contacts");
    worst
}

#[test]
fn complementarity_holds_over_a_long_rub_of_the_whole_casing() {
    for (name, feature) in
        [("rigid", ("plain", (|_| {}) as fn(&mut Scene))), ("flexible", ("flexible casing", flexible))]
    {
        let mut scene = scene_with(feature, Scheme::ModalExact, Solver::Lcp);
        // A round casing: gaps are affine in the displacements, so that they can be evaluated again independently.
        scene.settings.surfaces[0].shape = Shape::Circular {};
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.initialise(0.0).unwrap();
        let (mut adhesion, mut penetration, mut product, mut again, mut most) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64, 0);
        for index in 0..20_000 {
            // The casing closes on all blades and opens again.
            let closing = -9e-4 * (std::f64::consts::PI * f64::from(index) / 20_000.0).sin();
            set(&mut simulation, "casing_radius_change", 0, closing);
            let time = simulation.time();
            simulation.do_step(time, 1e-6).unwrap();
            let system = simulation.system();
            let lanes = system.bank().lanes();
            let largest = system.events().iter().fold(0.0, |a: f64, event| a.max(event.normal));
            let drive = Drive {
                rotor_angle: real(&simulation, "rotor_angle"),
                radius_change: closing,
                shape_factor: 1.0,
                ..Drive::default()
            };
            let (mut law, mut gaps) = (system.pairs()[0].gap().clone(), system.structures()[0].gaps().to_vec());
            let mut geometry = law.geometry(lanes);
            let moved = system.structures().get(1).map_or(&[][..], |slave| slave.modes().displacement());
            law.evaluate(&drive, system.bank().displacement(), moved, None, &mut geometry, &mut gaps);
            let off = gaps.iter().zip(system.gaps()).filter(|(gap, _)| gap.is_finite());
            again = off.fold(again, |a, (gap, booked)| a.max((gap - booked).abs() / 3.56e-4));
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
        // On the flexible casing the normal turns within the step, which the step's linear gap does not follow.
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
        set(&mut simulation, "casing_load_amplitude", 0, 1e3);
        set(&mut simulation, "casing_load_phase", 0, phase);
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
            // One pair of modes answers: u = A cos(nθ − φ), outwards where the load is.
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
fn wearing_takes_at_least_the_yield_stress_times_the_worn_volume() {
    let mut simulation = Simulation::new(&scene_with(("coating", coating), Scheme::ModalExact, Solver::Lcp)).unwrap();
    simulation.initialise(0.0).unwrap();
    let mut before = 0.0;
    for _ in 0..60 {
        let time = simulation.time();
        simulation.do_step(time, 5e-5).unwrap();
        let energy = real(&simulation, "wear_energy");
        assert!(energy >= before);
        before = energy;
    }
    // Y V for no hardening, (Y + K e) V with e the largest plastic strain for full hardening everywhere.
    let (volume, strain) = (real(&simulation, "worn_volume"), real(&simulation, "wear_depth_maximum") / 1.5e-4);
    assert!(volume > 0.0);
    assert!(before >= 1e6 * volume * (1.0 - 1e-12) && before <= (1e6 + 2e7 * strain) * volume, "{before:e} J");
}
