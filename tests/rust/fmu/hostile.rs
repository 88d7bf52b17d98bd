//! Callers that break every rule of the standards short of passing dangling pointers. Each case ends in Error (or NULL)
//! with a message that names the cause, changes nothing, and leaves the instance usable.

#![allow(clippy::float_cmp, reason = "values are compared for being untouched")]

use std::ffi::{CString, c_void};

use tiprub_core::CoSimulation;
use tiprub_fmi_host::api::{Fmi3Api, LogMessage};
use tiprub_tests::refusals::{count, refused, summary};
use tiprub_tests::scene::{SCENE, UnpackedResources, reference, rom};
use tiprub_tests::{DISCARD, ERROR, OK, fmi2, fmi3, shipped};

fn text(text: &str) -> Option<CString> {
    Some(CString::new(text).expect("no NUL"))
}

#[test]
fn fmi2_instantiation_is_rejected_with_reason() {
    let (api2, resources) = (fmi2::load(&shipped()), UnpackedResources::new(true));
    let empty = tempfile::tempdir().expect("a temporary directory");
    let good = fmi2::Fmi2Arguments::new(&resources);
    let uri = |path: &std::path::Path| text(&format!("file://{}", path.display()));
    let cases2 = [
        (fmi2::Fmi2Arguments { name: None, ..good.clone() }, "instanceName is NULL"),
        (fmi2::Fmi2Arguments { kind: 0, ..good.clone() }, "fmuType = 0"),
        (fmi2::Fmi2Arguments { kind: -7, ..good.clone() }, "fmuType = -7"),
        (fmi2::Fmi2Arguments { token: None, ..good.clone() }, "fmuGUID is NULL"),
        (fmi2::Fmi2Arguments { token: text("{wrong}"), ..good.clone() }, "\"{wrong}\" does not match"),
        (fmi2::Fmi2Arguments { token: text(""), ..good.clone() }, "does not match"),
        (fmi2::Fmi2Arguments { location: None, ..good.clone() }, "fmuResourceLocation is NULL"),
        (fmi2::Fmi2Arguments { location: text(""), ..good.clone() }, "fmuResourceLocation is empty"),
        (fmi2::Fmi2Arguments { location: text("http://example.org/r"), ..good.clone() }, "not a file: URI"),
        (fmi2::Fmi2Arguments { location: text("file:///no/such/place"), ..good.clone() }, "/no/such/place"),
        (fmi2::Fmi2Arguments { location: uri(empty.path()), ..good }, "scene.toml"),
    ];
    for (arguments, reason) in cases2 {
        // The journal checks the instance name; NULL arrives as "".
        if arguments.name.is_none() {
            // SAFETY: NULL is the tested case.
            let handle = unsafe {
                let null = std::ptr::null();
                (api2.fmi2Instantiate)(null, 1, null, null, std::ptr::null(), 0, 0)
            };
            assert!(handle.is_null(), "{reason}");
            count(1);
            continue;
        }
        let log = fmi2::Fmi2TestSlave::try_new(&api2, &arguments).expect_err("must be refused");
        refused(ERROR, &log, reason);
    }
    let token = &resources.token;
    let log = fmi2::Fmi2TestSlave::try_new(
        &api2,
        &fmi2::Fmi2Arguments { token: text("{x}"), ..fmi2::Fmi2Arguments::new(&resources) },
    );
    assert!(log.expect_err("refused").contains(token), "the message names both tokens");
    summary("instantiation, FMI 2.0");
}

#[test]
fn fmi3_instantiation_is_rejected_with_reason() {
    let (api3, resources) = (fmi3::load(&shipped()), UnpackedResources::new(true));
    let good = fmi3::Fmi3Arguments::new(&resources);
    let cases3 = [
        (fmi3::Fmi3Arguments { name: None, ..good.clone() }, "instanceName is NULL"),
        (fmi3::Fmi3Arguments { name: text(" \t"), ..good.clone() }, "instanceName is empty"),
        (fmi3::Fmi3Arguments { token: text("{wrong}"), ..good.clone() }, "does not match"),
        (fmi3::Fmi3Arguments { path: None, ..good.clone() }, "resourcePath is NULL"),
        (fmi3::Fmi3Arguments { path: text(""), ..good.clone() }, "resourcePath is empty"),
        (fmi3::Fmi3Arguments { path: text("resources"), ..good.clone() }, "not absolute"),
        (fmi3::Fmi3Arguments { event_mode: true, ..good.clone() }, "Event Mode"),
        (fmi3::Fmi3Arguments { intermediate: vec![99_999], ..good.clone() }, "99999"),
        (
            fmi3::Fmi3Arguments { intermediate: vec![reference("gap_offset")], ..good.clone() },
            "neither an input nor an output",
        ),
    ];
    for (arguments, reason) in cases3 {
        refused(ERROR, &fmi3::Fmi3TestSlave::try_new(&api3, &arguments).expect_err("must be refused"), reason);
    }
    // A trailing slash, none, and a URI are all accepted.
    let path = resources.path().display().to_string();
    for form in [path.clone(), format!("{path}/"), format!("file://{path}")] {
        let arguments = fmi3::Fmi3Arguments { path: text(&form), ..good.clone() };
        assert!(fmi3::Fmi3TestSlave::try_new(&api3, &arguments).is_ok(), "{form}");
    }
    other_interfaces(&api3);
    summary("instantiation, FMI 3.0");
}

fn other_interfaces(api3: &Fmi3Api) {
    let mut context = tiprub_tests::Journal::default();
    let environment: *mut c_void = (&raw mut context).cast();
    let (null, none) = (std::ptr::null(), std::ptr::null());
    // SAFETY: NULL texts must be handled; the environment is a journal.
    unsafe {
        let logger = Some(tiprub_tests::journal3 as LogMessage);
        assert!((api3.fmi3InstantiateModelExchange)(null, null, null, false, false, environment, logger).is_null());
        let scheduled = api3.fmi3InstantiateScheduledExecution;
        assert!(scheduled(null, null, null, false, false, environment, logger, none, none, none).is_null());
    }
    refused(ERROR, &context.text(), "no Model Exchange interface");
    refused(ERROR, &context.text(), "no Scheduled Execution interface");
}

#[test]
fn rejects_damaged_resources() {
    let api = fmi2::load(&shipped());
    for (name, content, reason) in [
        ("scene.toml", b"name = \"x\"\nwrong = 1\n".to_vec(), "wrong"),
        ("scene.toml", SCENE.replace("step = 2e-6", "step = nan").into_bytes(), "step"),
        ("scene.toml", SCENE.replace("gap = 4e-4", "gap = inf").into_bytes(), "gap"),
        ("scene.toml", b"\xff\xfe".to_vec(), "UTF-8"),
        ("package.toml", Vec::new(), "package.toml"),
    ] {
        let resources = UnpackedResources::new(false);
        std::fs::write(resources.path().join(name), content).expect("writable");
        let log =
            fmi2::Fmi2TestSlave::try_new(&api, &fmi2::Fmi2Arguments::new(&resources)).expect_err("must be refused");
        refused(ERROR, &log, reason);
    }
    let resources = UnpackedResources::new(false);
    let rom_file = std::fs::read_dir(resources.path()).expect("readable").flatten().map(|entry| entry.path());
    let rom_file = rom_file.into_iter().find(|path| path.to_string_lossy().ends_with("safetensors")).expect("a ROM");
    let bytes = std::fs::read(&rom_file).expect("readable");
    for length in [0, 7, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&rom_file, &bytes[..length]).expect("writable");
        let log =
            fmi2::Fmi2TestSlave::try_new(&api, &fmi2::Fmi2Arguments::new(&resources)).expect_err("must be refused");
        refused(ERROR, &log, "safetensors");
    }
    let mut broken = rom();
    broken.mass[(0, 0)] = f64::NAN;
    std::fs::write(&rom_file, tiprub_format::write_rom(&broken)).expect("writable");
    let log = fmi2::Fmi2TestSlave::try_new(&api, &fmi2::Fmi2Arguments::new(&resources)).expect_err("must be refused");
    refused(ERROR, &log, "mass");
    summary("resources");
}

/// An FMU with stored checks gives the same messages as one without them. A damaged file has no effect.
#[test]
fn stored_checks_change_no_message() {
    let api = fmi2::load(&shipped());
    let resources = UnpackedResources::new(false);
    let log = || fmi2::Fmi2TestSlave::initialised(&api, &resources).log();
    let without = log();
    let loaded = tiprub_format::load_resources(resources.path()).expect("valid resources");
    let mut simulation = tiprub_core::Simulation::new(loaded.scene).expect("a valid scene");
    simulation.initialise(0.0).expect("a valid scene");
    let file = tiprub_format::write_checks(&simulation.checks());
    for content in [file.clone(), file[..file.len() / 2].to_vec(), b"damaged".to_vec()] {
        std::fs::write(resources.path().join(tiprub_format::CHECKS_FILE), content).expect("writable");
        assert_eq!(log(), without);
    }
}

#[test]
fn every_function_rejects_a_null_instance() {
    let path = shipped();
    let (api2, api3) = (fmi2::load(&path), fmi3::load(&path));
    let null = std::ptr::null_mut();
    let (mut value, reference) = (0.0, 0_u32);
    // SAFETY: NULL is the tested case; arrays have one element.
    unsafe {
        (api2.fmi2FreeInstance)(null);
        (api3.fmi3FreeInstance)(null);
        let reference = &raw const reference;
        assert_eq!((api2.fmi2GetReal)(null, reference, 1, &raw mut value), ERROR);
        assert_eq!((api2.fmi2SetReal)(null, reference, 1, &raw const value), ERROR);
        assert_eq!((api2.fmi2DoStep)(null, 0.0, 1e-4, 1), ERROR);
        assert_eq!((api2.fmi2Reset)(null), ERROR);
        assert_eq!((api2.fmi2Terminate)(null), ERROR);
        assert_eq!((api2.fmi2EnterEventMode)(null), ERROR);
        assert_eq!((api2.fmi2GetFMUstate)(null, std::ptr::null_mut()), ERROR);
        assert_eq!((api3.fmi3GetFloat64)(null, reference, 1, &raw mut value, 1), ERROR);
        assert_eq!((api3.fmi3EnterStepMode)(null), ERROR);
        let (mut one, mut two, mut three, mut last) = (true, true, true, f64::NAN);
        let status =
            (api3.fmi3DoStep)(null, 0.5, 1e-4, true, &raw mut one, &raw mut two, &raw mut three, &raw mut last);
        assert_eq!((status, one, two, three, last), (ERROR, false, false, false, 0.5));
    }
    count(11);
    summary("NULL instance");
}

#[test]
fn rejects_invalid_arguments_of_get_and_set() {
    let path = shipped();
    let (api, resources) = (fmi2::load(&path), UnpackedResources::new(false));
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let handle = slave.handle;
    let (null_in, null_out) = (std::ptr::null(), std::ptr::null_mut());
    let (speed, friction, output) = ([reference("speed")], reference("friction_coefficient"), reference("rotor_angle"));
    let mut out = [7.5_f64; 4];
    // SAFETY: every pointer is NULL or to an array of at least the elements that a correct library accesses.
    unsafe {
        // An empty request is legal, also with NULL arrays.
        assert_eq!((api.fmi2GetReal)(handle, std::ptr::null(), 0, null_out), OK);
        assert_eq!((api.fmi2SetReal)(handle, std::ptr::null(), 0, null_in), OK);
        assert_eq!((api.fmi2GetString)(handle, std::ptr::null(), 0, std::ptr::null_mut()), OK);
        let get = |references: *const u32, count, values| {
            let status = (api.fmi2GetReal)(handle, references, count, values);
            (status, slave.log())
        };
        let (status, log) = get(std::ptr::null(), 1, out.as_mut_ptr());
        refused(status, &log, "argument vr is NULL");
        let (status, log) = get(speed.as_ptr(), 1, null_out);
        refused(status, &log, "argument value is NULL");
        for count in [usize::MAX, usize::MAX / 8, 1 << 40, 1 << 20] {
            let (status, log) = get(speed.as_ptr(), count, out.as_mut_ptr());
            refused(status, &log, "exceed the limit of this FMU");
        }
        let (status, log) = get(speed.as_ptr().byte_add(1), 1, out.as_mut_ptr());
        refused(status, &log, "not aligned");
        let unknown = [speed[0], 4_000_000_000];
        let (status, log) = get(unknown.as_ptr(), 2, out.as_mut_ptr());
        refused(status, &log, "4000000000 does not exist");
        assert!(out.iter().all(|value| *value == 7.5), "a failing get writes nothing: {out:?}");
        // Wrong type.
        let mut integer = 5;
        refused((api.fmi2GetInteger)(handle, speed.as_ptr(), 1, &raw mut integer), &slave.log(), "of type Real");
        refused((api.fmi2GetBoolean)(handle, speed.as_ptr(), 1, &raw mut integer), &slave.log(), "of type Real");
        refused((api.fmi2SetInteger)(handle, speed.as_ptr(), 1, &raw const integer), &slave.log(), "of type Real");
        assert_eq!(integer, 5);
        refused((api.fmi2SetReal)(handle, speed.as_ptr(), 1, null_in), &slave.log(), "argument value is NULL");
        // The first is valid, the second is not: neither is set.
        for (second, value, reason) in [
            (friction, f64::NAN, "friction_coefficient"),
            (friction, f64::INFINITY, "not finite"),
            (friction, -0.1, "outside the range 0 to"),
            (0, 1.0, "time"),
            (output, 1.0, "cannot be set"),
        ] {
            let (references, values) = ([speed[0], second], [310.0, value]);
            let status = (api.fmi2SetReal)(handle, references.as_ptr(), 2, values.as_ptr());
            refused(status, &slave.log(), reason);
            assert_eq!(slave.reals(&speed), [300.0], "nothing is set");
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            refused(slave.set_reals(&speed, &[value]), &slave.log(), "variable `speed`");
            refused(slave.set_derivatives(&speed, 1, &[value]), &slave.log(), "not finite");
        }
        for order in [0, 2, -1, i32::MAX] {
            refused(slave.set_derivatives(&speed, order, &[1.0]), &slave.log(), "order");
        }
        refused(slave.set_derivatives(&[friction], 1, &[1.0]), &slave.log(), "not a continuous real input");
    }
    slave.expect(slave.step(0.0, 1e-4));
    summary("get and set");
}

#[test]
fn fmi3_array_arguments_are_validated() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(true));
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    slave.initialise();
    let simulation = tiprub_core::Simulation::new(tiprub_tests::scene::scene()).expect("valid");
    let array = simulation.table().find("blade[1].clearance").expect("watched").reference;
    assert_eq!(slave.reals(&[array], 3).len(), 3, "one reference, three values");
    assert_eq!(slave.reals(&[0, array, 1], 5).len(), 5);
    for (references, count, reason) in [
        (vec![array], 1, "cover 3 values"),
        (vec![array], 4, "cover 3 values"),
        (vec![array, array], 3, "cover 6 values"),
        (vec![array + 1], 3, "lies inside the array"),
        (vec![1], 0, "cover 1 values"),
        (vec![], 2, "cover 0 values"),
        (vec![1], usize::MAX, "nValues"),
    ] {
        let mut values = [0.0; 8];
        // SAFETY: a correct library accesses no more than the number of values in its message.
        let status = unsafe {
            (api.fmi3GetFloat64)(slave.handle, references.as_ptr(), references.len(), values.as_mut_ptr(), count)
        };
        let log = slave.log();
        refused(status, &log, if count == usize::MAX { "" } else { reason });
    }
    // Scalars if packaged as such.
    let scalars = UnpackedResources::new(false);
    let scalar = fmi3::Fmi3TestSlave::new(&api, &scalars);
    scalar.initialise();
    assert_eq!(scalar.reals(&[array + 1], 1).len(), 1);
    // Types that no variable has.
    let mut byte = [0_u8];
    // SAFETY: arrays of one element.
    unsafe {
        let reference = &raw const array;
        refused((api.fmi3GetUInt8)(slave.handle, reference, 1, byte.as_mut_ptr(), 1), &slave.log(), "of type Float64");
        assert_eq!((api.fmi3GetUInt8)(slave.handle, std::ptr::null(), 0, std::ptr::null_mut(), 0), OK);
        refused((api.fmi3SetClock)(slave.handle, reference, 1, std::ptr::null()), &slave.log(), "of type Float64");
    }
    summary("arrays");
}

#[test]
fn string_enumeration_and_boolean_access_is_validated() {
    let path = shipped();
    let (api2, api3, resources) = (fmi2::load(&path), fmi3::load(&path), UnpackedResources::new(false));
    let simulation = tiprub_core::Simulation::new(tiprub_tests::scene::scene()).expect("valid");
    let find = |name: &str| simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference;
    let (scheme, scene, touching) = (find("scheme"), find("scene"), find("in_contact"));
    let (two, three) = (fmi2::Fmi2TestSlave::new(&api2, &resources), fmi3::Fmi3TestSlave::new(&api3, &resources));
    let (mut name, mut number, mut long, mut flag) = (std::ptr::null(), 0_i32, 0_i64, 1_u8);
    // SAFETY: arrays of one element.
    unsafe {
        two.expect((api2.fmi2GetString)(two.handle, &raw const scene, 1, &raw mut name));
        two.expect((api2.fmi2GetInteger)(two.handle, &raw const scheme, 1, &raw mut number));
        // The text stays valid during other calls until texts are requested again.
        assert_eq!(std::ffi::CStr::from_ptr(name).to_str(), Ok("toy_rub"));
        assert_eq!(number, 2, "modal-exact");
        three.expect((api3.fmi3GetInt64)(three.handle, &raw const scheme, 1, &raw mut long, 1));
        assert_eq!(long, 2);
        for value in [0_i64, 5, -1, i64::MAX] {
            let status = (api3.fmi3SetInt64)(three.handle, &raw const scheme, 1, &raw const value, 1);
            refused(status, &three.log(), "not an item of Scheme");
        }
        for value in [0, 5, i32::MIN] {
            let status = (api2.fmi2SetInteger)(two.handle, &raw const scheme, 1, &raw const value);
            refused(status, &two.log(), "1 = central-difference");
        }
        let status = (api3.fmi3GetInt32)(three.handle, &raw const scheme, 1, &raw mut number, 1);
        refused(status, &three.log(), "of type Int64");
        let status = (api2.fmi2SetString)(two.handle, &raw const scene, 1, &raw const name);
        refused(status, &two.log(), "cannot be set");
        let status = (api2.fmi2SetString)(two.handle, &raw const scene, 1, &std::ptr::null());
        refused(status, &two.log(), "NULL");
        let status = (api3.fmi3GetBoolean)(three.handle, &raw const touching, 1, &raw mut flag, 1);
        refused(status, &three.log(), "no value before initialisation");
        three.initialise();
        three.expect((api3.fmi3GetBoolean)(three.handle, &raw const touching, 1, &raw mut flag, 1));
        assert_eq!(flag, 0);
    }
    summary("types");
}

#[test]
fn rejects_steps_with_wrong_time_or_size() {
    let path = shipped();
    let (api, resources) = (fmi2::load(&path), UnpackedResources::new(false));
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    slave.expect(slave.step(0.0, 1e-4));
    let before = slave.serialise(slave.save());
    for (time, size, reason) in [
        (0.0, 1e-4, "currentCommunicationPoint"),
        (1e-3, 1e-4, "currentCommunicationPoint"),
        (-1e-4, 1e-4, "currentCommunicationPoint"),
        (f64::NAN, 1e-4, "currentCommunicationPoint"),
        (f64::INFINITY, 1e-4, "currentCommunicationPoint"),
        (1e-4, 0.0, "communicationStepSize"),
        (1e-4, -1e-4, "communicationStepSize"),
        (1e-4, f64::NAN, "communicationStepSize"),
        (1e-4, f64::INFINITY, "communicationStepSize"),
        (1e-4, 1e-300, "communicationStepSize"),
        (1e-4, 1e300, "communicationStepSize"),
    ] {
        refused(slave.step(time, size), &slave.log(), reason);
        assert!(slave.serialise(slave.save()) == before, "a refused step changes nothing");
    }
    slave.expect(slave.step(1e-4, 1e-4));
    // Status of the last step.
    let (mut real, mut boolean) = (0.0, 7);
    // SAFETY: valid locations for one value.
    unsafe {
        slave.expect((api.fmi2GetRealStatus)(slave.handle, 2, &raw mut real));
        slave.expect((api.fmi2GetBooleanStatus)(slave.handle, 3, &raw mut boolean));
        assert!((real - 2e-4).abs() < 1e-18 && boolean == 0);
        for kind in [0, 1, -5, 99] {
            assert_eq!((api.fmi2GetStatus)(slave.handle, kind, &raw mut boolean), DISCARD);
            assert_eq!((api.fmi2GetRealStatus)(slave.handle, kind, &raw mut real), DISCARD);
            assert!(slave.log().contains("is not available"));
        }
        refused((api.fmi2GetRealStatus)(slave.handle, 2, std::ptr::null_mut()), &slave.log(), "argument value is NULL");
    }
    let three = fmi3::load(&path);
    let third = fmi3::Fmi3TestSlave::new(&three, &resources);
    for (start, stop, reason) in [
        (f64::NAN, None, "startTime"),
        (f64::NEG_INFINITY, None, "startTime"),
        (1.0, Some(0.5), "stopTime"),
        (0.0, Some(f64::NAN), "stopTime"),
        (0.0, Some(f64::INFINITY), "stopTime"),
    ] {
        refused(slave.setup(start, stop), &slave.log(), "not allowed in state");
        refused(third.enter(start, stop), &third.log(), reason);
    }
    third.initialise();
    // A missing output location is rejected before anything changes; the other three outputs are written.
    let (mut event, mut early, mut last) = (true, true, f64::NAN);
    // SAFETY: NULL is the tested case.
    let status = unsafe {
        let null = std::ptr::null_mut();
        (three.fmi3DoStep)(third.handle, 0.0, 1e-4, true, &raw mut event, null, &raw mut early, &raw mut last)
    };
    refused(status, &third.log(), "argument terminateSimulation is NULL");
    assert_eq!((event, early, last), (false, false, 0.0));
    assert_eq!(third.step(0.0, 1e-4).status, OK);
    summary("steps");
}

#[test]
fn rejects_repeated_calls_and_wrong_version() {
    let path = shipped();
    let (api2, api3, resources) = (fmi2::load(&path), fmi3::load(&path), UnpackedResources::new(false));
    let slave = fmi2::Fmi2TestSlave::initialised(&api2, &resources);
    slave.expect(slave.step(0.0, 1e-4));
    slave.expect(slave.reset());
    slave.expect(slave.reset());
    refused(slave.exit(), &slave.log(), "not allowed in state Instantiated");
    slave.initialise();
    refused(slave.enter(), &slave.log(), "not allowed in state Step Mode");
    slave.expect(slave.terminate());
    refused(slave.terminate(), &slave.log(), "not allowed in state Terminated");
    refused(slave.step(0.0, 1e-4), &slave.log(), "not allowed in state Terminated");
    slave.expect(slave.reset());
    slave.initialise();
    slave.expect(slave.step(0.0, 1e-4));
    // SAFETY: a live instance, of the other version.
    let status = unsafe { (api3.fmi3Reset)(slave.handle) };
    refused(status, &slave.log(), "functions of Fmi2");
    // SAFETY: as before; it must not be freed.
    unsafe { (api3.fmi3FreeInstance)(slave.handle) };
    assert!(slave.log().contains("functions of Fmi2"));
    slave.expect(slave.step(1e-4, 1e-4));
    summary("order");
}
