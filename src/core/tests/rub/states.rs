//! Restored states continue as if nothing had happened; states with invalid content are rejected without any change, or
//! run to an end.

use std::collections::BTreeMap;

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{LoadSettings, Shape, SplineSettings};
use tiprub_core::{CoSimulation, Error, Scene, Simulation};
use tiprub_cosim::persist::fingerprint;
use tiprub_cosim::variables::{Causality, Variability};
use tiprub_test_models::{self as models, bits, coating, disk, flexible, go, lattice, real, reference, saved, started};

/// Magic, format version and fingerprint of the scene, before the bytes that are damaged here.
const HEADER: usize = 24;

fn scenes() -> Vec<(&'static str, Scene)> {
    let rotor = |change: fn(&mut Scene)| {
        let mut scene = models::rub(12);
        scene.roms[0] = models::rich_blade(12);
        change(&mut scene);
        scene
    };
    let disk = disk::TestDisk::random(6, 2, 9, 0.25, 5).cyclic();
    let mut coupled = disk::with_rotor(disk);
    flexible(&mut coupled);
    coupled.settings.contacts[0].solver = Solver::Coulomb;
    vec![
        ("revolution", rotor(|scene| scene.settings.contacts[0].solver = Solver::Film)),
        ("spline", rotor(|scene| scene.settings.surfaces[0].spline = Some(SplineSettings::default()))),
        (
            "coating on a loaded ring",
            rotor(|scene| {
                flexible(scene);
                coating(scene);
                scene.settings.structures[1].thermal = true;
                scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 3e3, phase: 0.2 });
            }),
        ),
        (
            "coulomb, stiffening",
            rotor(|scene| {
                flexible(scene);
                scene.settings.contacts[0].solver = Solver::Coulomb;
                scene.roms[0].extras.spin = Some(models::spin(scene.roms[0].order()));
                scene.settings.structures[0].spin.stiffening = true;
            }),
        ),
        ("coupled sectors", coupled),
        ("free", lattice::with(lattice::squeezed(), 0.15, Solver::Coulomb, Scheme::ModalExact)),
    ]
}

fn sealed(mut state: Vec<u8>) -> Vec<u8> {
    let end = state.len() - 8;
    let checksum = fingerprint(&state[..end], 0);
    state[end..].copy_from_slice(&checksum.to_le_bytes());
    state
}

/// Returns states before the start, at the start, in contact between two steps, and within one.
fn moments(scene: &Scene, length: f64) -> Vec<Vec<u8>> {
    let mut simulation = Simulation::new(scene).unwrap();
    let mut states = vec![saved(&simulation)];
    simulation.initialise(0.0).unwrap();
    states.push(saved(&simulation));
    let mut contacts = 0;
    for _ in 0..400 {
        go(&mut simulation, length);
        contacts += simulation.system().events().len();
        if contacts > 20 && !simulation.system().events().is_empty() {
            break;
        }
    }
    assert!(contacts > 0, "never touched");
    states.push(saved(&simulation));
    simulation.begin_step(simulation.time(), length).unwrap();
    simulation.advance().unwrap();
    states.push(saved(&simulation));
    states
}

/// A small random generator, so that every run tries the same cases.
struct Dice(u64);

impl Dice {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 >> 11).unwrap() % limit
    }
}

/// Returns the state with one to three bits, bytes or words changed after the header.
fn damage(state: &[u8], dice: &mut Dice) -> Vec<u8> {
    let words: [u64; 12] = [
        0,
        1,
        u64::MAX,
        1 << 40,
        1 << 63,
        f64::NAN.to_bits(),
        f64::INFINITY.to_bits(),
        1e300_f64.to_bits(),
        (-1.0_f64).to_bits(),
        1e-300_f64.to_bits(),
        1e20_f64.to_bits(),
        1.0_f64.to_bits(),
    ];
    let mut damaged = state.to_vec();
    // The data that determine the rest are at the front and short.
    let end = if dice.below(3) == 0 { (HEADER + 400).min(state.len() - 16) } else { state.len() - 16 };
    for _ in 0..=dice.below(3) {
        let at = HEADER + dice.below(end - HEADER);
        match dice.below(3) {
            0 => damaged[at] ^= 1 << dice.below(8),
            1 => damaged[at] = u8::try_from(dice.below(256)).unwrap(),
            _ => {
                let at = HEADER + 8 * ((at - HEADER) / 8);
                damaged[at..at + 8].copy_from_slice(&words[dice.below(words.len())].to_le_bytes());
            }
        }
    }
    sealed(damaged)
}

/// Runs until an error or with finite outputs.
fn run_on(simulation: &mut Simulation, created: bool, length: f64) -> Result<(), Error> {
    if created {
        simulation.initialise(0.0)?;
    }
    // Possibly within a communication step already.
    simulation.advance().map(drop).or_else(|_| simulation.begin_step(simulation.time(), length))?;
    // The first internal step may have ended the communication step.
    let under_way = |simulation: &mut Simulation| while simulation.advance().is_ok_and(|now| !now.finished) {};
    for _ in 0..3 {
        under_way(simulation);
        simulation.begin_step(simulation.time(), length)?;
    }
    while !simulation.advance()?.finished {}
    for reference in 0..u32::try_from(simulation.table().references()).unwrap() {
        let value = simulation.real(reference).unwrap_or(0.0);
        assert!(value.is_finite(), "{} is {value}", simulation.table().locate(reference).unwrap().0.name);
    }
    Ok(())
}

#[test]
fn survives_damage_under_a_valid_checksum() {
    let tries = 12;
    for (name, scene) in scenes() {
        let length = scene.settings.experiment.communication_step;
        let states = moments(&scene, length);
        let mut twin = Simulation::new(&scene).unwrap();
        let (mut dice, mut counts) = (Dice(0x9e37_79b9_7f4a_7c15), [0; 3]);
        for (moment, state) in states.iter().enumerate() {
            for attempt in 0..tries {
                twin.restore_state(&states[attempt % states.len()]).unwrap();
                let before = saved(&twin);
                match twin.restore_state(&damage(state, &mut dice)) {
                    Err(error) => {
                        assert!(matches!(error, Error::State(_)), "{name}, moment {moment}: {error}");
                        assert!(saved(&twin) == before, "{name}, moment {moment}: {error}, and changed all the same");
                        counts[0] += 1;
                    }
                    Ok(()) => counts[1 + usize::from(run_on(&mut twin, moment == 0, length).is_ok())] += 1,
                }
            }
        }
        println!("{name}: {} refused, {} ended with an error, {} ran on", counts[0], counts[1], counts[2]);
        assert!(counts[0] > 0 && counts[2] > 0, "{name}: {counts:?}");
    }
}

/// Every undamaged state of every scene is accepted at any other moment.
#[test]
fn saved_state_restores_from_any_other_state() {
    for (name, scene) in scenes() {
        let states = moments(&scene, scene.settings.experiment.communication_step);
        let mut twin = Simulation::new(&scene).unwrap();
        for (from, first) in states.iter().enumerate() {
            for (to, second) in states.iter().enumerate() {
                twin.restore_state(first).unwrap_or_else(|error| panic!("{name}, {from}: {error}"));
                assert!(saved(&twin)[HEADER..HEADER + 64] == first[HEADER..HEADER + 64], "{name}, {from}");
                twin.restore_state(second).unwrap_or_else(|error| panic!("{name}, {from} to {to}: {error}"));
                assert!(to == 0 || saved(&twin) == *second, "{name}, {from} to {to}");
            }
        }
    }
}

/// Returns the scenes with shapes that are present from the start, too shallow to reach the blades, or ramped.
fn ramped() -> impl Iterator<Item = (&'static str, Scene)> {
    let with = |(name, scene): (&'static str, Scene), ramp: f64| {
        let mut scene = scene;
        for surface in &mut scene.settings.surfaces {
            surface.ramp_time *= ramp;
            if let Shape::TwoLobe { depth, .. } = &mut surface.shape {
                *depth = 0.1;
            }
        }
        (name, scene)
    };
    scenes().into_iter().flat_map(move |(name, scene)| [0.0, 1.0].map(|ramp| with((name, scene.clone()), ramp)))
}

/// A state contains its times: the start time of the receiving instance is irrelevant.
#[test]
fn restores_a_state_in_an_instance_with_another_start_time() {
    for (name, scene) in ramped() {
        let length = scene.settings.experiment.communication_step;
        let mut simulation = started(&scene);
        let mut states = vec![saved(&simulation)];
        go(&mut simulation, length);
        states.push(saved(&simulation));
        simulation.begin_step(simulation.time(), length).unwrap();
        simulation.advance().unwrap();
        states.push(saved(&simulation));
        for start in [0.5 * length, 7.0, -7.0] {
            let mut other = Simulation::new(&scene).unwrap();
            for (moment, state) in states.iter().enumerate() {
                other.initialise(start).unwrap();
                let restored = other.restore_state(state);
                restored.unwrap_or_else(|error| panic!("{name}, moment {moment}, started at {start} s: {error}"));
                assert!(saved(&other) == *state, "{name}, moment {moment}, started at {start} s");
            }
        }
    }
}

fn run(simulation: &mut Simulation, steps: u32, length: f64) {
    for _ in 0..steps {
        go(simulation, length);
    }
}

/// Returns the derivative (1/s) of every element of every continuous output, as bits.
fn derivatives(simulation: &Simulation) -> BTreeMap<u32, u64> {
    let rows = simulation.table().variables().iter();
    let rows = rows.filter(|row| row.causality == Causality::Output && row.variability == Variability::Continuous);
    rows.flat_map(|row| (0..row.len()).map(|i| row.reference + u32::try_from(i).unwrap()))
        .map(|reference| (reference, simulation.output_derivative(reference, 1).unwrap().to_bits()))
        .collect()
}

/// The receiving instance has made steps of other lengths before: none of them counts.
#[test]
fn restored_state_reproduces_step_derivatives() {
    let scene = models::rub(12);
    let names = ["force_x", "torque", "kinetic_energy", "external_work"];
    let read = |simulation: &Simulation| names.map(|name| real(simulation, name));
    let mut simulation = started(&scene);
    run(&mut simulation, 40, 5e-5);
    run(&mut simulation, 1, 3e-5);
    let before = read(&simulation);
    run(&mut simulation, 1, 7e-5);
    let now = read(&simulation);
    let state = saved(&simulation);
    let at_save = derivatives(&simulation);
    // Means belong to the middle of their steps.
    for (index, length) in [5e-5, 5e-5, 7e-5, 7e-5].into_iter().enumerate() {
        let exact = (now[index] - before[index]) / length;
        let found = simulation.output_derivative(reference(&simulation, names[index]), 1).unwrap();
        assert!(exact != 0.0 && (found / exact - 1.0).abs() < 1e-12, "{}: {found}, exactly {exact}", names[index]);
    }
    run(&mut simulation, 1, 4e-5);
    let after = derivatives(&simulation);
    for lengths in [&[][..], &[9e-5], &[1.1e-5, 6e-5], &[5e-5, 2e-5, 8e-5]] {
        let mut other = started(&scene);
        for length in lengths {
            run(&mut other, 1, *length);
        }
        other.restore_state(&state).unwrap();
        assert_eq!(derivatives(&other), at_save, "after steps of {lengths:?}");
        run(&mut other, 1, 4e-5);
        assert_eq!(derivatives(&other), after, "a step after steps of {lengths:?}");
        // And into an instance that has continued since, or was never started.
        other.restore_state(&state).unwrap();
        assert_eq!(derivatives(&other), at_save);
    }
    let mut fresh = Simulation::new(&scene).unwrap();
    fresh.restore_state(&state).unwrap();
    assert_eq!(derivatives(&fresh), at_save);
}

#[test]
fn rejects_states_of_another_scene_without_changes() {
    let mut simulation = started(&models::rub(12));
    run(&mut simulation, 30, 5e-5);
    let (mut state, before) = (saved(&simulation), bits(&simulation));
    assert!(simulation.restore_state(&state[1..]).is_err());
    assert!(simulation.save_state(&mut state[1..]).is_err());
    let mut foreign_scene = models::rub(12);
    foreign_scene.settings.contacts[0].gap = 4e-4;
    let message = simulation.restore_state(&saved(&started(&foreign_scene))).unwrap_err().to_string();
    assert!(message.contains("a different scene"), "{message}");
    assert_eq!(bits(&simulation), before);
}

#[test]
fn a_thousand_resets_give_identical_bits() {
    let scene = models::rub(6);
    let mut simulation = Simulation::new(&scene).unwrap();
    let mut first = None;
    for _ in 0..1000 {
        simulation.initialise(0.0).unwrap();
        run(&mut simulation, 3, 4e-4);
        let now = bits(&simulation);
        assert_eq!(*first.get_or_insert_with(|| now.clone()), now);
        simulation.set_real(reference(&simulation, "speed"), 77.0).unwrap();
        simulation.reset();
    }
}

/// Restoring keeps valid tables. In this test they belong to another damping ratio, speed or internal step.
#[test]
fn restored_state_replaces_tables_of_other_parameters() {
    for (name, scene) in scenes() {
        let length = scene.settings.experiment.communication_step;
        let mut simulation = started(&scene);
        if let Some(speed) = simulation.table().find("speed").map(|row| row.reference) {
            simulation.set_real(speed, 1.02 * simulation.real(speed).unwrap()).unwrap();
        }
        run(&mut simulation, 2, length);
        let state = saved(&simulation);
        run(&mut simulation, 2, length);
        let expected = saved(&simulation);
        let changes = [("damping_ratio", 1.5), ("speed", 0.9)].into_iter();
        // The last communication step has internal steps of the same length, or shorter ones.
        for ((variable, factor), last) in changes.flat_map(|change| [1.0, 0.37].map(|last| (change, last))) {
            let Some(reference) = simulation.table().find(variable).map(|row| row.reference) else { continue };
            let mut other = Simulation::new(&scene).unwrap();
            let value = f64::max(factor * other.real(reference).unwrap(), 1e-3);
            let is_input = variable == "speed";
            if is_input {
                other.initialise(0.0).unwrap();
            }
            other.set_real(reference, value).unwrap();
            if !is_input {
                other.initialise(0.0).unwrap();
            }
            run(&mut other, 1, length);
            go(&mut other, last * length);
            for _ in 0..2 {
                other.restore_state(&state).unwrap();
                run(&mut other, 2, length);
                assert!(saved(&other) == expected, "{name}, `{variable}`");
            }
        }
    }
}

/// The search for closest points begins at the saved nodes, not where trials of an earlier span ended.
#[test]
fn adaptive_steps_continue_from_states_with_the_same_bits() {
    const LENGTH: f64 = 2e-5;
    let side = 0.5 * lattice::SIDE;
    let plates = [(lattice::BlockSide::Left, side + 2e-5), (lattice::BlockSide::Right, side + 4e-5)];
    let mut scene = lattice::scene(lattice::faces([0.0, 0.01, 0.0]), &plates, true, [-6.0, 1.0, 2.0]);
    scene = lattice::with(scene, 0.2, Solver::Coulomb, Scheme::Galerkin);
    scene.settings.time.step = LENGTH;
    scene.settings.surfaces.iter_mut().for_each(|surface| surface.rigid = true);
    let mut simulation = started(&scene);
    let (mut states, mut expected) = (Vec::new(), Vec::new());
    for _ in 0..12 {
        states.push(saved(&simulation));
        go(&mut simulation, LENGTH);
        expected.push(saved(&simulation));
    }
    assert!(simulation.system().ledger().contact_work.value() > 0.0, "it has touched");
    for (index, state) in states.iter().enumerate() {
        // The state is restored from the end of the run.
        for other in [&mut simulation, &mut started(&scene)] {
            other.restore_state(state).unwrap();
            go(other, LENGTH);
            assert!(saved(other) == expected[index], "after communication step {}", index + 1);
        }
    }
}

/// The contact of a free body begins in its first internal step, whose length differs from the one that the scene
/// proposes.
#[test]
fn energy_balance_of_free_body_closes_from_the_first_step() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        for share in [1.0, 0.6, 0.41] {
            let side = 0.5 * lattice::SIDE;
            let plates = [(lattice::BlockSide::Left, side + 1e-6)];
            let mut scene = lattice::scene(lattice::faces([0.0, 0.0, 0.0]), &plates, false, [-8.0, 1.0, 0.5]);
            scene = lattice::with(scene, 0.2, Solver::Lcp, scheme);
            scene.settings.outputs.energies = true;
            scene.settings.surfaces[0].rigid = true;
            let mut simulation = started(&scene);
            go(&mut simulation, share * 1e-6);
            assert!(!simulation.system().events().is_empty(), "{scheme:?}: it touches in the first step");
            let residual = real(&simulation, "energy_residual_relative");
            println!("{}, first step {share} of the one proposed: residual {residual:.1e}", scheme.name());
            assert!(residual.abs() < 1e-12, "{scheme:?}, {share}: {residual:e}");
        }
    }
}
