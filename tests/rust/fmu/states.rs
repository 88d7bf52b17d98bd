//! Saved states: bit for bit, in the same instance, in another one and in another process; and states that must not be
//! restored.

use std::process::Command;

use tiprub_core::{CoSimulation, Simulation};
use tiprub_tests::scene::{UnpackedResources, scene};
use tiprub_tests::{ERROR, OK, fmi2, fmi3, shipped};

const H: f64 = 1.0137e-4;

fn references() -> Vec<u32> {
    let mut simulation = Simulation::new(scene()).expect("the scene is valid");
    simulation.initialise(0.0).expect("the scene can be initialised");
    let count = u32::try_from(simulation.table().references()).expect("few variables");
    (0..count).filter(|reference| simulation.real(*reference).is_ok()).collect()
}

/// Steps from `first` to `last` with a varying step size; returns all reals at every point, as bits.
fn march(slave: &fmi2::Fmi2TestSlave<'_>, references: &[u32], first: u32, last: u32) -> Vec<Vec<u64>> {
    let size = |step: u32| H * (1.0 + 0.5 * f64::from(step % 3));
    let mut time: f64 = (0..first).fold(0.0, |time, step| time + size(step));
    (first..last)
        .map(|step| {
            slave.expect(slave.step(time, size(step)));
            time += size(step);
            slave.reals(references).into_iter().map(f64::to_bits).collect()
        })
        .collect()
}

fn contact(slave: &fmi2::Fmi2TestSlave<'_>) -> bool {
    let simulation = Simulation::new(scene()).expect("the scene is valid");
    let count = simulation.table().find("contact_count").expect("there is a count").reference;
    let mut value = 0;
    // SAFETY: arrays of one element.
    slave.expect(unsafe { (slave.api.fmi2GetInteger)(slave.handle, &raw const count, 1, &raw mut value) });
    value > 0
}

/// Steps until a blade touches at a communication point; returns the number of steps.
#[track_caller]
fn march_into_contact(slave: &fmi2::Fmi2TestSlave<'_>, references: &[u32]) -> u32 {
    for step in 0..2000 {
        if step > 50 && contact(slave) {
            return step;
        }
        march(slave, references, step, step + 1);
    }
    panic!("no contact at any communication point");
}

#[test]
fn rerun_from_state_saved_in_contact_is_bit_identical() {
    let api = fmi2::load(&shipped());
    let (resources, references) = (UnpackedResources::new(false), references());
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let begin = march_into_contact(&slave, &references);
    let state = slave.save();
    let first = march(&slave, &references, begin, begin + 150);
    slave.expect(slave.restore(state));
    assert_eq!(march(&slave, &references, begin, begin + 150), first, "after restoring");
    // Deserialised in another instance that was never initialised.
    let other = fmi2::Fmi2TestSlave::new(&api, &resources);
    let (status, copy) = other.deserialise(&slave.serialise(state));
    other.expect(status);
    other.expect(other.restore(copy));
    assert_eq!(march(&other, &references, begin, begin + 150), first, "in another instance");
    // Saving again reuses the state object.
    let mut again = state;
    // SAFETY: a state of this instance.
    slave.expect(unsafe { (api.fmi2GetFMUstate)(slave.handle, &raw mut again) });
    assert_eq!(again, state);
    // SAFETY: as before; the second call passes the NULL that the first one wrote.
    unsafe {
        slave.expect((api.fmi2FreeFMUstate)(slave.handle, &raw mut again));
        assert!(again.is_null());
        slave.expect((api.fmi2FreeFMUstate)(slave.handle, &raw mut again));
    }
    assert_eq!(slave.restore(state), ERROR, "a freed state");
    assert!(slave.log().contains("not a saved state of this instance"));
}

/// Has an effect only when the test below runs this binary again.
#[test]
fn child_continues_from_a_file() {
    let Some(file) = std::env::var_os("TIPRUB_TEST_STATE") else { return };
    let directory = std::path::PathBuf::from(file);
    let bytes = std::fs::read(directory.join("state")).expect("the parent wrote the state");
    let begin: u32 = std::fs::read_to_string(directory.join("begin")).expect("written").parse().expect("a number");
    let api = fmi2::load(&shipped());
    let (resources, references) = (UnpackedResources::new(false), references());
    let slave = fmi2::Fmi2TestSlave::new(&api, &resources);
    let (status, state) = slave.deserialise(&bytes);
    slave.expect(status);
    slave.expect(slave.restore(state));
    let result = format!("{:?}", march(&slave, &references, begin, begin + 100));
    std::fs::write(directory.join("result"), result).expect("the directory can be written");
}

#[test]
fn another_process_continues_with_the_same_bits() {
    let api = fmi2::load(&shipped());
    let (resources, references) = (UnpackedResources::new(false), references());
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let begin = march_into_contact(&slave, &references);
    let directory = tempfile::tempdir().expect("a temporary directory");
    std::fs::write(directory.path().join("state"), slave.serialise(slave.save())).expect("writable");
    std::fs::write(directory.path().join("begin"), begin.to_string()).expect("writable");
    let expected = format!("{:?}", march(&slave, &references, begin, begin + 100));
    let program = std::env::current_exe().expect("this binary");
    let mut child = Command::new(program);
    child.args(["--exact", "states::child_continues_from_a_file"]).env("TIPRUB_TEST_STATE", directory.path());
    let output = child.output().expect("this binary can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let result = std::fs::read_to_string(directory.path().join("result")).expect("the child wrote its result");
    assert!(result == expected, "the other process came to other values");
}

#[test]
fn a_thousand_resets_give_the_same_bits() {
    let api = fmi2::load(&shipped());
    let (resources, references) = (UnpackedResources::new(false), references());
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let begin = march_into_contact(&slave, &references);
    let run = || {
        slave.expect(slave.reset());
        slave.initialise();
        march(&slave, &references, 0, 12)
    };
    let first = run();
    for cycle in 1..1000 {
        assert!(run() == first, "cycle {cycle}");
    }
    // And once up to contact.
    slave.expect(slave.reset());
    slave.initialise();
    let touching = march(&slave, &references, 0, begin);
    let fresh = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    assert!(march(&fresh, &references, 0, begin) == touching, "a reset instance is as a fresh one, in contact too");
}

#[test]
fn fmi_phase_is_part_of_the_saved_state() {
    let api = fmi3::load(&shipped());
    let resources = UnpackedResources::new(true);
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    let instantiated = slave.save();
    slave.expect(slave.enter(0.25, Some(1.0)));
    let initialising = slave.save();
    slave.expect(slave.exit());
    let ready = slave.save();
    assert_eq!(slave.step(0.25, 1e-4).status, OK);
    slave.expect(slave.terminate());
    let terminated = slave.save();

    slave.expect(slave.restore(ready));
    assert_eq!(slave.reals(&[0], 1), [0.25]);
    assert_eq!(slave.step(0.25, 1e-4).status, OK, "steps again after terminate");
    assert_eq!(slave.step(0.2501, 2.0).status, ERROR, "the stop time is part of the state");
    slave.expect(slave.restore(initialising));
    assert_eq!(slave.step(0.25, 1e-4).status, ERROR);
    slave.expect(slave.exit());
    assert_eq!(slave.reals(&[0], 1), [0.25], "the start time too");
    slave.expect(slave.restore(instantiated));
    assert_eq!(slave.exit(), ERROR);
    slave.expect(slave.enter(0.0, None));
    slave.expect(slave.restore(terminated));
    assert_eq!(slave.step(0.2501, 1e-4).status, ERROR);
    assert_eq!(slave.reals(&[0], 1), [0.2501]);
}

#[test]
fn rejects_invalid_damaged_and_foreign_states() {
    let path = shipped();
    let (api2, api3) = (fmi2::load(&path), fmi3::load(&path));
    let (scalars, arrays) = (UnpackedResources::new(false), UnpackedResources::new(true));
    let slave = fmi2::Fmi2TestSlave::initialised(&api2, &scalars);
    slave.expect(slave.step(0.0, H));
    let bytes = slave.serialise(slave.save());
    let refused = |bytes: &[u8], reason: &str| {
        let (status, state) = slave.deserialise(bytes);
        let log = slave.log();
        assert!(status == ERROR && state.is_null() && log.contains(reason), "{status} {log}");
    };
    refused(&bytes[..bytes.len() - 1], "size = ");
    refused(&[], "size = 0");
    refused(&[bytes.as_slice(), &[0]].concat(), "size = ");
    let mut flips = 0;
    for position in (0..bytes.len()).step_by(bytes.len() / 97) {
        for bit in [0x01, 0x80] {
            let mut damaged = bytes.clone();
            damaged[position] ^= bit;
            refused(&damaged, "cannot be used");
            flips += 1;
        }
    }
    println!("{flips} single flipped bits found");
    // The same scene with other packaging options is another FMU.
    let other = fmi3::Fmi3TestSlave::new(&api3, &arrays);
    let foreign = other.serialise(other.save());
    assert_eq!(foreign.len(), bytes.len());
    refused(&foreign, "belongs to the FMU with token");
    let before = slave.serialise(slave.save());
    for state in [std::ptr::null_mut(), other.save(), (&raw const bytes).cast_mut().cast()] {
        assert_eq!(slave.restore(state), ERROR);
    }
    assert!(slave.serialise(slave.save()) == before, "a refused restore changes nothing");
    slave.expect(slave.step(H, H));
}

/// Reading outputs in Initialization Mode changes nothing in a saved state: values set after restoring it are the start
/// values of the run.
#[test]
fn reading_in_initialization_mode_leaves_the_state() {
    let api = fmi3::load(&shipped());
    let resources = UnpackedResources::new(true);
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    let [clearance, offset] = ["clearance_minimum", "gap_offset"].map(tiprub_tests::scene::reference);
    slave.expect(slave.enter(0.0, None));
    let unread = slave.serialise(slave.save());
    let at_first = slave.reals(&[clearance], 1)[0];
    let read = slave.save();
    assert!(slave.serialise(read) == unread, "reading is not a change");
    for opened in [1.5e-4, -5e-5] {
        slave.expect(slave.restore(read));
        slave.expect(slave.set_reals(&[offset], &[opened]));
        let found = slave.reals(&[clearance], 1)[0] - at_first;
        // Except for the flanks of the shape, 1.5e-5 of it.
        assert!((found / opened - 1.0).abs() < 1e-4, "{found} m for {opened} m");
    }
    slave.expect(slave.restore(read));
    slave.expect(slave.exit());
    assert_eq!(slave.reals(&[clearance], 1)[0].to_bits(), at_first.to_bits());
}

#[test]
fn derivatives_of_inputs_are_part_of_the_state() {
    let api = fmi2::load(&shipped());
    let (resources, references) = (UnpackedResources::new(false), references());
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let speed = tiprub_tests::scene::reference("speed");
    slave.expect(slave.set_derivatives(&[speed], 1, &[5e4]));
    let state = slave.save();
    let first = march(&slave, &references, 0, 30);
    slave.expect(slave.restore(state));
    slave.expect(slave.set_reals(&[speed], &[300.0]));
    assert!(march(&slave, &references, 0, 30) != first, "setting the input ends its derivative");
    slave.expect(slave.restore(state));
    assert_eq!(march(&slave, &references, 0, 30), first);
}
