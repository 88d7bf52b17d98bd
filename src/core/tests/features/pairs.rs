//! Scenes of several structures and pairs: each behaves as it does alone, and together they close the energy balance.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{BodyMotion, Shape, StructureSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::{Causality, DataType};
use tiprub_test_models::{lattice, real, rich_blade, rub, several, spin};

const SCHEMES: [Scheme; Scheme::RECURRENCES.len()] = Scheme::RECURRENCES;

/// Sets every input and parameter whose name ends with `name`.
fn set_all(simulation: &mut Simulation, name: &str, value: f64) {
    let rows = simulation.table().variables().iter().filter(|row| row.is_settable() && row.name.ends_with(name));
    let references: Vec<u32> = rows.map(|row| row.reference).collect();
    assert!(!references.is_empty(), "no {name}");
    for reference in references {
        simulation.set_real(reference, value).unwrap();
    }
}

/// Returns the real outputs with their names.
fn outputs(simulation: &Simulation) -> Vec<(String, f64)> {
    let rows = simulation.table().variables().iter();
    let rows = rows.filter(|row| row.causality == Causality::Output && row.kind == DataType::Real);
    let elements = rows.flat_map(|row| (0..row.len()).map(move |element| (row, element)));
    let value = |row: &tiprub_cosim::variables::Variable, element: usize| {
        simulation.real(row.reference + u32::try_from(element).unwrap()).unwrap()
    };
    elements.map(|(row, element)| (row.element_name(element), value(row, element))).collect()
}

/// Performs steps of 31 µs while the casing closes; `each` sees every internal step, and whether it ends a
/// communication step.
fn run(scene: &Scene, steps: u32, each: impl FnMut(&Simulation, bool)) -> Simulation {
    run_closing(scene, steps, 5e-5, each)
}

/// Closes by `length` (m) instead.
fn run_closing(scene: &Scene, steps: u32, length: f64, mut each: impl FnMut(&Simulation, bool)) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.initialise(0.0).unwrap();
    for step in 0..steps {
        if step == 20 {
            set_all(&mut simulation, "casing_radius_change", -length);
        }
        simulation.begin_step(simulation.time(), 3.1e-5).unwrap();
        let mut finished = false;
        while !finished {
            finished = simulation.advance().unwrap().finished;
            each(&simulation, finished);
        }
    }
    simulation
}

#[test]
fn splitting_a_contact_pair_keeps_bit_identical_results() {
    for scheme in SCHEMES {
        for solver in Solver::ALL {
            let mut whole = rub(6);
            (whole.settings.time.scheme, whole.settings.contacts[0].solver) = (scheme, solver);
            // massless-boundary would make nine of the eight modes quasi-static here.
            if scheme == Scheme::MasslessBoundary {
                continue;
            }
            let (one, three) = (run(&whole, 60, |_, _| ()), run(&several::split(&whole), 60, |_, _| ()));
            assert!(one.system().factorisations() > 20, "{scheme:?}, {solver:?}: nothing touched");
            let (found, mut compared) = (outputs(&three), 0);
            for (name, value) in outputs(&one) {
                let Some((_, other)) = found.iter().find(|(other, _)| *other == name) else { panic!("no {name}") };
                assert_eq!(value.to_bits(), other.to_bits(), "{scheme:?}, {solver:?}, {name}: {value} and {other}");
                compared += 1;
            }
            assert!(compared > 60, "{compared} outputs");
        }
    }
}

#[test]
fn rotors_in_rigid_casings_are_independent() {
    let slower = |rear: &mut StructureSettings| rear.speed = -900.0;
    let mut scene = several::two_rotors(rub(6), 0.1, slower);
    scene.settings.surfaces[1].shape = Shape::Lobes { amplitude: 4.5e-4, order: 3, phase: 0.3 };
    let alone = |index: usize| {
        let mut alone = scene.clone();
        alone.settings.structures = vec![scene.settings.structures[index].clone()];
        alone.settings.surfaces = vec![scene.settings.surfaces[index].clone()];
        alone.settings.contacts = vec![scene.settings.contacts[index].clone()];
        alone.roms = vec![scene.roms[index].clone()];
        run(&alone, 60, |_, _| ())
    };
    let both = run(&scene, 60, |_, _| ());
    let found = outputs(&both);
    for (index, name) in ["front", "rear"].into_iter().enumerate() {
        let alone = alone(index);
        assert!(alone.system().factorisations() > 20, "{name} touches nothing");
        let mut compared = 0;
        for (output, value) in outputs(&alone) {
            let Some((_, other)) = found.iter().find(|(other, _)| *other == format!("{name}.{output}")) else {
                continue;
            };
            assert_eq!(value.to_bits(), other.to_bits(), "{name}.{output}: {value} and {other}");
            compared += 1;
        }
        assert!(compared > 30, "{compared} outputs of {name}");
    }
    assert!(real(&both, "front.torque").abs() > 0.0 && real(&both, "rear.blade[1].clearance_minimum") < 1.0);
    assert!(real(&both, "energy_residual_relative").abs() < 1e-12);
}

#[test]
fn energy_balance_of_two_rotors_in_one_casing_closes() {
    for (solver, friction) in [(Solver::Lcp, 0.15), (Solver::Coulomb, 0.15), (Solver::Film, 0.1), (Solver::Lcp, 0.0)] {
        let mut scene = several::in_one_casing(rub(6), solver, friction);
        scene.settings.surfaces.iter_mut().for_each(|surface| surface.shape = Shape::Circular {});
        let (mut off, mut largest, mut together) = (0.0_f64, 0.0_f64, 0);
        let simulation = run_closing(&scene, 80, 3.7e-4, |simulation, finished| {
            let system = simulation.system();
            // Modal forces on the ring equal those of the contacts at their points.
            let bank = system.structures()[2].modes();
            let mut expected = vec![0.0; bank.modes()];
            for event in system.events() {
                let (pair, structure) = (&system.pairs()[event.pair], &system.structures()[event.structure]);
                let place = structure.geometry().places[structure.index(event.node, event.sector)];
                let first = pair.carrier().unwrap().first_row;
                for (point, weight) in pair.gap().spline().unwrap().weights(place).iter() {
                    for component in 0..3 {
                        let force = -weight * event.wrench.force[component];
                        let shapes = bank.contact_row(first + 3 * point + component);
                        expected.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum += force * shape);
                    }
                }
            }
            let structures: Vec<usize> = system.events().iter().map(|event| event.structure).collect();
            together += usize::from(structures.contains(&0) && structures.contains(&1));
            for (found, expected) in system.structures()[2].contact_force().iter().zip(&expected) {
                off = off.max((found - expected).abs());
                largest = largest.max(expected.abs());
            }
            assert!(!finished || real(simulation, "energy_residual_relative").abs() < 1e-11);
        });
        assert!(together > 3, "{solver:?}: the rotors touch at the same time in {together} steps");
        assert!(off < 1e-12 * largest, "{solver:?}: modal forces are off by {off:e} of {largest:e}");
        // Torque times speed is the work of the shafts.
        let ledger = simulation.system().ledger();
        assert!(friction == 0.0 || ledger.friction_loss.value() > 0.1, "{solver:?}: {ledger:?}");
    }
}

/// The torque of each rotor times its speed, summed over the run, is the work of the shafts.
#[test]
fn torques_of_two_rotors_match_their_shaft_work() {
    let scene = several::in_one_casing(rub(6), Solver::Lcp, 0.15);
    let mut work = 0.0;
    let simulation = run(&scene, 80, |simulation, finished| {
        let finished = f64::from(u8::from(finished));
        work -=
            finished * 3.1e-5 * (1300.0 * real(simulation, "front.torque") - 1100.0 * real(simulation, "rear.torque"));
    });
    let shaft = simulation.system().ledger().shaft_work.value();
    assert!(shaft > 0.1 && (work / shaft - 1.0).abs() < 1e-12, "{work} and {shaft} J");
    // Forces on the rotors are reported by structure and by surface.
    for (rotor, surface) in [("front", "front_casing"), ("rear", "rear_casing")] {
        let [own, of] = [rotor, surface].map(|name| real(&simulation, &format!("{name}.force_x")));
        assert_eq!(own.to_bits(), of.to_bits(), "{rotor}");
    }
}

/// The effect of one rotor on the casing is felt by the other one; much less with a casing a hundred times as stiff.
#[test]
fn rub_affects_the_other_rotor_through_the_casing() {
    let felt = |stiffness: f64| {
        let mut scene = several::in_one_casing(rub(6), Solver::Lcp, 0.15);
        scene.roms[2].stiffness *= stiffness;
        // The rear rotor never touches.
        scene.settings.contacts[1].gap = 2e-3;
        scene.settings.surfaces[1].shape = Shape::Circular {};
        let (mut changed, mut first) = (0.0_f64, None);
        run(&scene, 60, |simulation, finished| {
            if !finished {
                return;
            }
            // Along the normal, inclined by 0.2.
            let closed = real(simulation, "rear_casing.casing_radius_change") / (1.0_f64 + 0.04).sqrt();
            let now = real(simulation, "rear.blade[1].clearance") - closed;
            changed = changed.max((now - *first.get_or_insert(now)).abs());
        });
        changed
    };
    let (soft, stiff) = (felt(1.0), felt(100.0));
    assert!(soft > 1e-6 && stiff < 0.1 * soft, "{soft:e} m, {stiff:e} m");
}

/// The leading edge touches a casing, the trailing edge a seal of smaller radius with another friction coefficient.
#[test]
fn tip_and_seal_on_one_blade_have_separate_friction() {
    for solver in [Solver::Lcp, Solver::Film] {
        let scene = several::tip_and_seal(rub(6), solver);
        let mut seen = [0; 2];
        let simulation = run(&scene, 60, |simulation, finished| {
            for event in simulation.system().events() {
                seen[event.pair] += 1;
                assert_eq!(event.pair, usize::from(event.node == 2));
                let friction = [0.1, 0.05][event.pair];
                assert!((event.tangential / event.normal / friction - 1.0).abs() < 1e-9 || event.normal < 1e-9);
            }
            if !finished {
                return;
            }
            let torque = real(simulation, "casing.moment_z") + real(simulation, "seal.moment_z");
            assert!((torque - real(simulation, "torque")).abs() <= 1e-12 * torque.abs(), "{solver:?}");
        });
        assert!(seen.iter().all(|seen| *seen > 5), "{solver:?}: {seen:?} contacts");
        assert!(real(&simulation, "energy_residual_relative").abs() < 1e-12);
        assert!(
            real(&simulation, "seal.friction_coefficient").to_bits() == 0.05_f64.to_bits()
                && real(&simulation, "casing.gap_offset").to_bits() == 0
        );
    }
}

/// Two blocks between two pairs of plates, in one scene or in two.
#[test]
fn free_bodies_are_independent() {
    let one = lattice::squeezed();
    let mut both = one.clone();
    let renamed = |name: &str| format!("other_{name}");
    for (structure, rom) in one.settings.structures.iter().zip(&one.roms) {
        let mut structure = structure.clone();
        structure.name = renamed(&structure.name);
        structure.velocity[1] += if structure.motion == BodyMotion::Free { 0.4 } else { 0.0 };
        both.settings.structures.push(structure);
        both.roms.push(rom.clone());
    }
    for surface in &one.settings.surfaces {
        let mut surface = surface.clone();
        (surface.name, surface.structure) = (renamed(&surface.name), surface.structure.as_deref().map(renamed));
        both.settings.surfaces.push(surface);
    }
    for contact in &one.settings.contacts {
        let mut contact = contact.clone();
        (contact.master, contact.slave) = (renamed(&contact.master), renamed(&contact.slave));
        both.settings.contacts.push(contact);
    }
    let run = |scene: &Scene| {
        let mut simulation = Simulation::new(scene).unwrap();
        simulation.initialise(0.0).unwrap();
        let length = scene.settings.experiment.communication_step;
        (0..60).for_each(|_| simulation.do_step(simulation.time(), length).unwrap());
        simulation
    };
    let (alone, together) = (run(&one), run(&both));
    assert!(alone.system().factorisations() > 0, "nothing touched");
    let name = &one.settings.structures[0].name;
    let (found, mut compared) = (outputs(&together), 0);
    for (output, value) in outputs(&alone).into_iter().filter(|(output, _)| output.starts_with(&format!("{name}."))) {
        let Some((_, other)) = found.iter().find(|(other, _)| *other == output) else { panic!("no {output}") };
        assert_eq!(value.to_bits(), other.to_bits(), "{output}: {value} and {other}");
        compared += 1;
    }
    assert!(compared > 50, "{compared} outputs");
    let [first, second] = ["", "other_"].map(|prefix| real(&together, &format!("{prefix}{name}.displacement_y")));
    assert!((first - second).abs() > 1e-9, "they fly differently");
    assert!(real(&together, "energy_residual_relative").abs() < 1e-11);
}

/// States of several structures continue with the same bits, in another instance and after a change of the step.
#[test]
fn a_saved_state_of_two_rotors_continues_with_the_same_bits() {
    let scene = several::in_one_casing(rub(6), Solver::Coulomb, 0.15);
    let mut simulation = run(&scene, 30, |_, _| ());
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    let mut elsewhere = Simulation::new(&scene).unwrap();
    elsewhere.restore_state(&state).unwrap();
    for simulation in [&mut simulation, &mut elsewhere] {
        for length in [3.1e-5, 2e-5, 1e-4, 5e-4] {
            simulation.do_step(simulation.time(), length).unwrap();
        }
    }
    assert!(simulation.system().ledger().friction_loss.value() > 0.01);
    for ((name, value), (_, other)) in outputs(&simulation).into_iter().zip(outputs(&elsewhere)) {
        assert_eq!(value.to_bits(), other.to_bits(), "{name}");
    }
}

/// Bytes with a correct checksum that one of two rotors rejects: its speed exceeds the range for which its stiffness
/// was fitted. The other rotor would accept its part.
#[test]
fn state_rejected_by_one_rotor_changes_nothing() {
    let mut scene = rub(6);
    scene.roms[0] = rich_blade(6);
    scene.roms[0].extras.spin = Some(spin(scene.roms[0].order()));
    let mut scene = several::two_rotors(scene, 0.1, |rear| rear.speed = -1100.0);
    scene.settings.structures.iter_mut().for_each(|structure| structure.spin.stiffening = true);
    let mut simulation = run(&scene, 25, |_, _| ());
    let mut own = vec![0; simulation.state_size()];
    simulation.save_state(&mut own).unwrap();
    let mut refused = 0;
    // Reference speed and temperature of one rotor, and reference speed of the other.
    let references = |front: f64, rear: f64| [front, 0.0, rear].map(f64::to_le_bytes).concat();
    for at in 0..own.len() - 32 {
        if own[at..at + 24] != references(1300.0, -1100.0)[..] {
            continue;
        }
        let mut damaged = own.clone();
        damaged[at..at + 24].copy_from_slice(&references(1200.0, -1e5));
        let end = damaged.len() - 8;
        let checksum = tiprub_cosim::persist::fingerprint(&damaged[..end], 0);
        damaged[end..].copy_from_slice(&checksum.to_le_bytes());
        let error = simulation.restore_state(&damaged).unwrap_err();
        assert!(error.to_string().contains("were fitted"), "{error}");
        refused += 1;
        let mut now = vec![0; own.len()];
        simulation.save_state(&mut now).unwrap();
        assert!(now == own, "the refused state has changed the instance");
    }
    assert_eq!(refused, 1);
}

#[test]
fn step_does_not_allocate() {
    for scene in [
        several::in_one_casing(rub(6), Solver::Lcp, 0.15),
        several::in_one_casing(rub(6), Solver::Coulomb, 0.15),
        several::split(&rub(6)),
    ] {
        let mut simulation = run(&scene, 25, |_, _| ());
        let before = simulation.system().factorisations();
        let asked = crate::counting::allocations_of(|| {
            (0..40).for_each(|_| simulation.do_step(simulation.time(), 3.1e-5).unwrap());
        });
        assert!(asked == 0 && simulation.system().factorisations() > before, "{asked} allocations");
    }
}

#[test]
fn rejects_incompatible_combinations_by_name() {
    let refused = |scene: &Scene, part: &str| {
        let message = Simulation::new(scene).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    };
    let both = several::in_one_casing(rub(6), Solver::Lcp, 0.15);
    let mut scene = both.clone();
    scene.settings.contacts[1].solver = Solver::Film;
    refused(
        &scene,
        "contact[2].solver: requires the solver of contact[1]: all contacts of a scene use the same solver",
    );
    let mut scene = both.clone();
    scene.settings.contacts[1].coating = Some(tiprub_core::scene::settings::CoatingSettings {
        thickness: 1e-4,
        modulus: 2e8,
        yield_stress: 1e6,
        hardening: 2e7,
        cells_around: 500,
        cells_along: 3,
        contact_width: Some(3e-3),
        cutting: None,
    });
    refused(&scene, "contact[2].coating: cannot be combined with a contact that is solved together");
    let mut scene = both.clone();
    scene.settings.contacts[1].slave = "front_casing".into();
    refused(&scene, "surface[1].name: `front_casing` is named by 2 contacts");
    let mut scene = both.clone();
    scene.settings.contacts.pop();
    scene.settings.surfaces.pop();
    refused(&scene, "structure[2].name: `rear` is not part of any contact");
    let mut scene = several::split(&rub(6));
    scene.settings.contacts[1].nodes = None;
    refused(&scene, "contact[2].master: a structure with several contacts requires `contact.nodes`");
    scene.settings.contacts[1].nodes = Some("leading".into());
    refused(&scene, "the node `leading_edge` already belongs to contact[1]");
    scene.settings.contacts[1].nodes = Some("tip".into());
    refused(&scene, "no contact node of ROM `blade` has a name that starts with \"tip\"");
    let mut scene = both;
    scene.settings.time.scheme = Scheme::MasslessBoundary;
    scene.roms[..2].iter_mut().for_each(|rom| *rom = rich_blade(6));
    scene.roms[1].contact_nodes.iter_mut().for_each(|node| node.position[2] += 0.01);
    let message = match Simulation::new(&scene).and_then(|mut simulation| simulation.initialise(0.0)) {
        Err(error) => error.to_string(),
        Ok(()) => String::new(),
    };
    assert!(
        message.contains(
            "`massless-boundary` cannot be combined with several surfaces on one flexible structure: the largest stable step is unknown"
        ),
        "{message}"
    );
}
