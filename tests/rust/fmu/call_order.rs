//! The call order of both standards, pair by pair: every function in every state, through the C ABI.
//!
//! The expected tables are written from the text of the standards, independently of those in the library: FMI 2.0.4
//! section 4.2.4 (table of allowed calls against states) and FMI 3.0.2 sections 2.3 and 4.2 (text of each state).
//! Letters are states in which a function is allowed; "-" is a function whose capability this FMU does not claim, which
//! must return Error with a message in every state.

mod tables;

use std::ffi::{CString, c_void};
use std::path::PathBuf;
use std::ptr::{null, null_mut};

use tables::{FMI2, FMI2_APART, FMI3, FMI3_APART, rows};
use tiprub_core::CoSimulation;
use tiprub_fmi_host::api::{Fmi2Api, Fmi3Api};
use tiprub_tests::scene::UnpackedResources;
use tiprub_tests::{ERROR, fmi2, fmi3, shipped};

#[track_caller]
fn complete(table: &'static str, apart: &str, names: &[&str]) {
    let mut listed: Vec<_> = rows(table).into_iter().map(|(name, _)| name).chain(apart.split_whitespace()).collect();
    let mut names = names.to_vec();
    listed.sort_unstable();
    names.sort_unstable();
    assert_eq!(listed, names, "the expected table has every function once");
}

/// Compares a status with the expected row.
#[track_caller]
fn judge(name: &str, allowed: &str, state: char, status: i32, log: &str) {
    let out_of_order = log.contains("not allowed in state");
    if allowed == "-" {
        assert!(status == ERROR && log.contains("this FMU has no"), "{name} in {state}: status {status}, {log}");
    } else if allowed.contains(state) {
        assert!(!out_of_order, "{name} must be allowed in {state}: {log}");
        assert!(status != ERROR, "{name} in {state} with proper arguments: status {status}, {log}");
    } else {
        assert!(status == ERROR && out_of_order, "{name} must be refused in {state}: status {status}, {log}");
    }
    if status != 0 {
        assert!(log.contains(name), "{name} in {state}: every answer other than OK has a message: {log}");
    }
}

/// The called unit: contact or heat conduction.
struct Subject {
    path: PathBuf,
    resources: UnpackedResources,
    known: CallReferences,
}

/// References: input, input that makes the step fail, text, enumeration, output with derivative.
#[derive(Clone, Copy)]
struct CallReferences {
    input: u32,
    /// Uniform change of radius and gap offset: together they can close the casing far too deep. Conduction cannot fail.
    closing: Option<[u32; 2]>,
    text: u32,
    choice: u32,
    output: u32,
}

/// Functions of the tables that this unit supports and the contact unit of the tests does not.
const DERIVATIVES: [&str; 3] =
    ["fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative", "fmi3GetAdjointDerivative"];

/// Returns a scene whose casing an importer can drive to infinity, so that a step fails, or a casing that conducts
/// heat.
fn subject(thermal: bool) -> Subject {
    if thermal {
        return Subject {
            path: tiprub_tests::thermal(),
            resources: UnpackedResources::of_thermal(&crate::thermal::model(), false),
            known: references(true),
        };
    }
    let mut scene = tiprub_tests::scene::scene();
    scene.settings.surfaces[0].moving = true;
    Subject { path: shipped(), resources: UnpackedResources::of(&scene, false), known: references(false) }
}

fn references(thermal: bool) -> CallReferences {
    if thermal {
        let simulation = tiprub_thermal::ThermalSimulation::new(crate::thermal::model()).expect("valid");
        let find = |name: &str| simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference;
        return CallReferences {
            input: find("gas_temperature"),
            closing: None,
            text: find("model_name"),
            choice: find("initial_state"),
            output: find("casing_temperature"),
        };
    }
    let mut scene = tiprub_tests::scene::scene();
    scene.settings.surfaces[0].moving = true;
    let simulation = tiprub_core::Simulation::new(&scene).expect("valid");
    let find = |name: &str| simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference;
    CallReferences {
        input: find("speed"),
        closing: Some(["casing_radius_change", "gap_offset"].map(find)),
        text: find("scene"),
        choice: find("scheme"),
        output: find("rotor_angle"),
    }
}

/// Returns the rows of a table that apply to the unit.
fn rows_of(table: &'static str, known: CallReferences) -> Vec<(&'static str, &'static str)> {
    let asked = |name: &str| known.closing.is_some() || !DERIVATIVES.contains(&name);
    rows(table).into_iter().filter(|(name, _)| asked(name)).collect()
}

/// Calls the function of that name, from a list of `function(arguments after the instance);`, otherwise evaluates the
/// last expression.
macro_rules! call {
    ($name:expr, $api:expr, $handle:expr, $other:expr; $($function:ident($($argument:expr),*);)*) => {
        match $name {
            $(stringify!($function) => ($api.$function)($handle $(, $argument)*),)*
            _ => $other,
        }
    };
}

/// Calls one function with arguments that are valid where it is allowed.
fn call2(api: &Fmi2Api, slave: &fmi2::Fmi2TestSlave<'_>, name: &str, known: CallReferences) -> i32 {
    let (h, value, mut real, mut integer) = (slave.handle, 300.0, 0.0, 0);
    let (mut text, mut flag, mut state, order) = (null(), 0, null_mut(), 1);
    let (mut size, mut saved, mut bytes) = (0, null_mut(), Vec::new());
    if name.contains("FMUstate") && !name.contains("Free") && !name.contains("Get") {
        saved = slave.save();
        bytes = slave.serialise(saved);
    }
    let (input, output, string, choice) = (&known.input, &known.output, &known.text, &known.choice);
    // SAFETY: all pointers are to single values, or NULL with a count of zero.
    unsafe {
        call! { name, api, h, panic!("{name} is not called");
            fmi2SetDebugLogging(0, 0, null());
            fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0);
            fmi2EnterInitializationMode();
            fmi2ExitInitializationMode();
            fmi2Terminate();
            fmi2Reset();
            fmi2GetReal(input, 1, &raw mut real);
            fmi2GetInteger(choice, 1, &raw mut integer);
            fmi2GetBoolean(null(), 0, null_mut());
            fmi2GetString(string, 1, &raw mut text);
            fmi2SetReal(input, 1, &raw const value);
            fmi2SetInteger(null(), 0, null());
            fmi2SetBoolean(null(), 0, null());
            fmi2SetString(null(), 0, null());
            fmi2GetFMUstate(&raw mut state);
            fmi2FreeFMUstate(&raw mut state);
            fmi2SetFMUstate(saved);
            fmi2SerializedFMUstateSize(saved, &raw mut size);
            fmi2SerializeFMUstate(saved, bytes.as_mut_ptr(), bytes.len());
            fmi2DeSerializeFMUstate(bytes.as_ptr(), bytes.len(), &raw mut state);
            fmi2SetRealInputDerivatives(input, 1, &raw const order, &raw const real);
            fmi2GetRealOutputDerivatives(output, 1, &raw const order, &raw mut real);
            fmi2DoStep(1e-4, 1e-4, 1);
            fmi2CancelStep();
            fmi2GetStatus(0, &raw mut integer);
            fmi2GetRealStatus(2, &raw mut real);
            fmi2GetIntegerStatus(0, &raw mut integer);
            fmi2GetBooleanStatus(3, &raw mut integer);
            fmi2GetStringStatus(1, &raw mut text);
            fmi2GetDirectionalDerivative(output, 1, input, 1, &raw const value, &raw mut real);
            fmi2EnterEventMode();
            fmi2NewDiscreteStates(null_mut());
            fmi2EnterContinuousTimeMode();
            fmi2CompletedIntegratorStep(1, &raw mut integer, &raw mut flag);
            fmi2SetTime(0.0);
            fmi2SetContinuousStates(&raw const value, 1);
            fmi2GetDerivatives(&raw mut real, 1);
            fmi2GetEventIndicators(&raw mut real, 1);
            fmi2GetContinuousStates(&raw mut real, 1);
            fmi2GetNominalsOfContinuousStates(&raw mut real, 1);
        }
    }
}

#[test]
fn fmi2_call_pairs_respect_the_state_machine() {
    complete(FMI2, FMI2_APART, Fmi2Api::NAMES);
    fmi2_pairs(&subject(false));
    fmi2_pairs(&subject(true));
}

fn fmi2_pairs(subject: &Subject) {
    let (api, known) = (fmi2::load(&subject.path), subject.known);
    let slave = fmi2::Fmi2TestSlave::new(&api, &subject.resources);
    let mut states = vec![('I', slave.save())];
    slave.expect(slave.enter());
    states.push(('N', slave.save()));
    slave.expect(slave.exit());
    slave.expect(slave.step(0.0, 1e-4));
    states.push(('S', slave.save()));
    if let Some(closing) = known.closing {
        slave.expect(slave.set_reals(&closing, &[-0.024; 2]));
        assert_eq!(slave.step(1e-4, 1e-4), ERROR);
        states.push(('F', slave.save()));
    }
    slave.expect(slave.terminate());
    states.push(('T', slave.save()));
    let mut pairs = 0;
    for (name, allowed) in rows_of(FMI2, known) {
        for (state, saved) in &states {
            slave.expect(slave.restore(*saved));
            let _ = slave.log();
            let status = call2(&api, &slave, name, known);
            judge(name, allowed, *state, status, &slave.log());
            pairs += 1;
        }
    }
    println!("FMI 2.0: {pairs} pairs of function and state");
}

/// Calls one function with arguments that are valid where it is allowed. Works on the bare handle, so that it can be
/// used from within an intermediate update.
unsafe fn call3(api: &Fmi3Api, h: *mut c_void, saved: (*mut c_void, &[u8]), name: &str, known: CallReferences) -> i32 {
    let (value, mut real, mut long, order) = (300.0, 0.0, 0_i64, 1);
    let (mut text, mut state, (saved, bytes)) = (null(), null_mut(), saved);
    let (input, output, string, choice) = (&known.input, &known.output, &known.text, &known.choice);
    let (mut a, mut b, mut c, mut size, mut copy) = (false, false, false, 0, bytes.to_vec());
    // SAFETY: all pointers are to single values, or NULL with a count of zero, or not accessed by functions that reject
    // the call.
    unsafe {
        call! { name, api, h, refused3(api, h, name, input);
            fmi3SetDebugLogging(false, 0, null());
            fmi3EnterInitializationMode(false, 0.0, 0.0, false, 0.0);
            fmi3ExitInitializationMode();
            fmi3Terminate();
            fmi3Reset();
            fmi3GetFloat64(input, 1, &raw mut real, 1);
            fmi3GetInt64(choice, 1, &raw mut long, 1);
            fmi3GetString(string, 1, &raw mut text, 1);
            fmi3SetFloat64(input, 1, &raw const value, 1);
            fmi3GetFloat32(null(), 0, null_mut(), 0);
            fmi3GetInt8(null(), 0, null_mut(), 0);
            fmi3GetUInt8(null(), 0, null_mut(), 0);
            fmi3GetInt16(null(), 0, null_mut(), 0);
            fmi3GetUInt16(null(), 0, null_mut(), 0);
            fmi3GetInt32(null(), 0, null_mut(), 0);
            fmi3GetUInt32(null(), 0, null_mut(), 0);
            fmi3GetUInt64(null(), 0, null_mut(), 0);
            fmi3GetBoolean(null(), 0, null_mut(), 0);
            fmi3SetFloat32(null(), 0, null_mut(), 0);
            fmi3SetInt8(null(), 0, null_mut(), 0);
            fmi3SetUInt8(null(), 0, null_mut(), 0);
            fmi3SetInt16(null(), 0, null_mut(), 0);
            fmi3SetUInt16(null(), 0, null_mut(), 0);
            fmi3SetInt32(null(), 0, null_mut(), 0);
            fmi3SetUInt32(null(), 0, null_mut(), 0);
            fmi3SetInt64(null(), 0, null_mut(), 0);
            fmi3SetUInt64(null(), 0, null_mut(), 0);
            fmi3SetBoolean(null(), 0, null_mut(), 0);
            fmi3SetString(null(), 0, null_mut(), 0);
            fmi3GetBinary(null(), 0, &raw mut size, null_mut(), 0);
            fmi3SetBinary(null(), 0, &raw const size, null(), 0);
            fmi3GetClock(null(), 0, null_mut());
            fmi3SetClock(null(), 0, null());
            fmi3GetFMUState(&raw mut state);
            fmi3FreeFMUState(&raw mut state);
            fmi3SetFMUState(saved);
            fmi3SerializedFMUStateSize(saved, &raw mut size);
            fmi3SerializeFMUState(saved, copy.as_mut_ptr(), copy.len());
            fmi3DeserializeFMUState(bytes.as_ptr(), bytes.len(), &raw mut state);
            fmi3GetOutputDerivatives(output, 1, &raw const order, &raw mut real, 1);
            fmi3DoStep(1e-4, 1e-4, true, &raw mut a, &raw mut b, &raw mut c, &raw mut real);
            fmi3GetNumberOfVariableDependencies(known.output, &raw mut size);
            fmi3GetVariableDependencies(known.output, null_mut(), null_mut(), null_mut(), null_mut(), 0);
            fmi3GetDirectionalDerivative(output, 1, input, 1, &raw const value, 1, &raw mut real, 1);
            fmi3GetAdjointDerivative(output, 1, input, 1, &raw const value, 1, &raw mut real, 1);
        }
    }
}

/// Calls functions that a unit for co-simulation without events does not support.
unsafe fn refused3(api: &Fmi3Api, h: *mut c_void, name: &str, input: *const u32) -> i32 {
    let (value, mut real, mut size) = (300.0, 0.0, 0);
    let (mut a, mut b, mut c) = (false, false, false);
    // SAFETY: all pointers are to single values, or not accessed by functions that reject the call.
    unsafe {
        call! { name, api, h, panic!("{name} is not called");
            fmi3EnterConfigurationMode();
            fmi3ExitConfigurationMode();
            fmi3EnterEventMode();
            fmi3EnterStepMode();
            fmi3EvaluateDiscreteStates();
            fmi3UpdateDiscreteStates(&raw mut a, &raw mut b, &raw mut c, &raw mut a, &raw mut b, &raw mut real);
            fmi3GetIntervalDecimal(input, 0, null_mut(), null_mut());
            fmi3GetIntervalFraction(input, 0, null_mut(), null_mut(), null_mut());
            fmi3GetShiftDecimal(input, 0, null_mut());
            fmi3GetShiftFraction(input, 0, null_mut(), null_mut());
            fmi3SetIntervalDecimal(input, 0, null_mut());
            fmi3SetIntervalFraction(input, 0, null(), null());
            fmi3SetShiftDecimal(input, 0, null_mut());
            fmi3SetShiftFraction(input, 0, null(), null());
            fmi3EnterContinuousTimeMode();
            fmi3CompletedIntegratorStep(true, &raw mut a, &raw mut b);
            fmi3SetTime(0.0);
            fmi3SetContinuousStates(&raw const value, 1);
            fmi3GetContinuousStateDerivatives(&raw mut real, 1);
            fmi3GetEventIndicators(&raw mut real, 1);
            fmi3GetContinuousStates(&raw mut real, 1);
            fmi3GetNominalsOfContinuousStates(&raw mut real, 1);
            fmi3GetNumberOfEventIndicators(&raw mut size);
            fmi3GetNumberOfContinuousStates(&raw mut size);
            fmi3ActivateModelPartition(0, 0.0);
        }
    }
}

/// Calls, in an intermediate update, the function whose row number is the wish, and records the status.
unsafe extern "C" fn call_inside<const THERMAL: bool>(
    environment: *mut c_void,
    _time: f64,
    _set_requested: bool,
    _get_allowed: bool,
    finished: bool,
    _can_return: bool,
    _requested: *mut bool,
    _at: *mut f64,
) {
    let context: *mut fmi3::CallbackContext = environment.cast();
    // SAFETY: the context outlives the instance; the journal is written to during the call, hence no long borrows.
    unsafe {
        let (api, handle, wish) = (&*(*context).api, (*context).handle, (*context).wish);
        if finished && wish >= 0.0 {
            let known = references(THERMAL);
            let row = (0_u32..).zip(rows_of(FMI3, known)).find(|(row, _)| (f64::from(*row) - wish).abs() < 0.5);
            let Some((_, (name, _))) = row else { return };
            let status = call3(api, handle, (null_mut(), &[]), name, known);
            (*context).notes.push(f64::from(status));
            (*context).wish = -1.0;
        }
    }
}

#[test]
fn fmi3_call_pairs_respect_the_state_machine() {
    complete(FMI3, FMI3_APART, Fmi3Api::NAMES);
    fmi3_pairs::<false>();
    fmi3_pairs::<true>();
}

fn fmi3_pairs<const THERMAL: bool>() {
    let subject = &subject(THERMAL);
    let (api, known) = (fmi3::load(&subject.path), subject.known);
    let arguments =
        fmi3::Fmi3Arguments { update: Some(call_inside::<THERMAL>), ..fmi3::Fmi3Arguments::new(&subject.resources) };
    let slave = fmi3::Fmi3TestSlave::try_new(&api, &arguments).unwrap_or_else(|log| panic!("{log}"));
    slave.wish(-1.0);
    let mut states = vec![('I', slave.save())];
    slave.expect(slave.enter(0.0, None));
    states.push(('N', slave.save()));
    slave.expect(slave.exit());
    assert_eq!(slave.step(0.0, 1e-4).status, 0);
    let ready = slave.save();
    states.push(('S', ready));
    if let Some(closing) = known.closing {
        slave.expect(slave.set_reals(&closing, &[-0.024; 2]));
        assert_eq!(slave.step(1e-4, 1e-4).status, ERROR);
        states.push(('F', slave.save()));
    }
    slave.expect(slave.terminate());
    states.push(('T', slave.save()));
    let bytes = slave.serialise(ready);
    let mut pairs = 0;
    for (row, (name, allowed)) in rows_of(FMI3, known).into_iter().enumerate() {
        for (state, saved) in &states {
            slave.expect(slave.restore(*saved));
            let _ = slave.log();
            // SAFETY: the instance is alive.
            let status = unsafe { call3(&api, slave.handle, (*saved, &bytes), name, known) };
            judge(name, allowed, *state, status, &slave.log());
            pairs += 1;
        }
        slave.expect(slave.restore(ready));
        let _ = (slave.log(), slave.notes());
        slave.wish(f64::from(u32::try_from(row).expect("few rows")));
        let answer = slave.step(1e-4, 1e-4);
        let (log, notes) = (slave.log(), slave.notes());
        assert_eq!((answer.status, notes.len()), (0, 1), "{name}: the step itself goes on: {log}");
        judge(name, allowed, 'U', if notes[0] == 0.0 { 0 } else { ERROR }, &log);
        pairs += 1;
    }
    println!("FMI 3.0: {pairs} pairs of function and state");
}

#[test]
fn reset_after_calls_in_any_order_restores_initial_state() {
    [false, true].into_iter().for_each(|thermal| random_calls(&subject(thermal)));
}

fn random_calls(subject: &Subject) {
    let (api, resources, known) = (fmi2::load(&subject.path), &subject.resources, subject.known);
    let run = |slave: &fmi2::Fmi2TestSlave<'_>| -> Vec<u64> {
        slave.expect(slave.setup(0.0, None));
        slave.initialise();
        for step in 0..40 {
            slave.expect(slave.step(f64::from(step) * 1e-4, 1e-4));
        }
        slave.reals(&[0, known.output, known.output + 1, known.output + 2]).into_iter().map(f64::to_bits).collect()
    };
    let fresh = run(&fmi2::Fmi2TestSlave::new(&api, resources));
    let names: Vec<_> = rows(FMI2).into_iter().map(|(name, _)| name).collect();
    // A linear congruential generator (Knuth's MMIX constants): the same calls every time.
    let mut seed = 42_u64;
    let mut next = |count: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(seed >> 33).expect("31 bits") % count
    };
    let mut visited = [0_u32; 4];
    for _ in 0..20 {
        let slave = fmi2::Fmi2TestSlave::new(&api, resources);
        for _ in 0..400 {
            // Some calls are more frequent than others, so that every phase is reached.
            let name = match next(6) {
                0 => "fmi2EnterInitializationMode",
                1 => "fmi2ExitInitializationMode",
                _ => names[next(names.len())],
            };
            if next(50) == 0
                && let Some(closing) = known.closing
            {
                let _ = slave.set_reals(&closing, &[-0.024; 2]);
            }
            let status = call2(&api, &slave, name, known);
            visited[usize::try_from(status).expect("a status")] += 1;
            let log = slave.log();
            assert!(status == 0 || log.contains(name), "{name}: {status} without a message: {log}");
        }
        slave.expect(slave.reset());
        assert_eq!(run(&slave), fresh);
    }
    println!("statuses OK, Warning, Discard, Error of {} random calls: {visited:?}", 20 * 400);
}

#[test]
fn reports_fmi_versions_and_platform() {
    let path = shipped();
    let (two, three) = (fmi2::load(&path), fmi3::load(&path));
    // SAFETY: static texts.
    let read = |text| unsafe { std::ffi::CStr::from_ptr(text) }.to_owned();
    // SAFETY: no arguments.
    let texts =
        unsafe { [read((two.fmi2GetVersion)()), read((two.fmi2GetTypesPlatform)()), read((three.fmi3GetVersion)())] };
    assert_eq!(texts, ["2.0", "default", "3.0"].map(|text| CString::new(text).expect("no NUL")));
}
