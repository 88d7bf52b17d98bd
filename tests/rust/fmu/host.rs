//! Hosts with hostile surroundings: loggers and callbacks that misbehave, steps that fail, threads, the floating-point
//! environment.

#![allow(clippy::float_cmp, reason = "values are compared for being untouched")]

use std::ffi::{CString, c_void};

use tiprub_core::CoSimulation;
use tiprub_fmi_host::api::Fmi3Api;
use tiprub_tests::refusals::{count, refused, summary};
use tiprub_tests::scene::{UnpackedResources, reference};
use tiprub_tests::{ERROR, OK, fmi2, fmi3, shipped};

#[test]
fn log_categories_control_the_logger() {
    let path = shipped();
    let (api, resources) = (fmi2::load(&path), UnpackedResources::new(false));
    let slave = fmi2::Fmi2TestSlave::new(&api, &resources);
    let names = ["logStatusWarning", "nonsense"].map(|name| CString::new(name).expect("no NUL"));
    let list = [names[0].as_ptr(), names[1].as_ptr()];
    // SAFETY: arrays of the lengths given.
    unsafe {
        refused(
            (api.fmi2SetDebugLogging)(slave.handle, 1, 2, list.as_ptr()),
            &slave.log(),
            "\"nonsense\" does not exist",
        );
        refused((api.fmi2SetDebugLogging)(slave.handle, 1, 1, std::ptr::null()), &slave.log(), "categories is NULL");
        refused((api.fmi2SetDebugLogging)(slave.handle, 1, usize::MAX, list.as_ptr()), &slave.log(), "categories");
        slave.expect((api.fmi2SetDebugLogging)(slave.handle, 1, 1, list.as_ptr()));
        assert_eq!(slave.exit(), ERROR);
        assert_eq!(slave.log(), "", "errors were not asked for");
        slave.expect((api.fmi2SetDebugLogging)(slave.handle, 0, 0, std::ptr::null()));
        assert_eq!(slave.exit(), ERROR);
        assert!(slave.log().contains("fmi2ExitInitializationMode"), "without a choice, errors are explained");
    }
    // "#r3#" would represent the variable of value reference 3; an importer shows "##" as the character itself.
    let named = CString::new("a#r3# of mine").expect("no NUL");
    let api3 = fmi3::load(&path);
    let third = fmi3::Fmi3TestSlave::new(&api3, &resources);
    // SAFETY: one text each.
    unsafe {
        let list = named.as_ptr();
        refused((api.fmi2SetDebugLogging)(slave.handle, 1, 1, &raw const list), &slave.log(), "\"a##r3## of mine\"");
        refused(
            (api3.fmi3SetDebugLogging)(third.handle, true, 1, &raw const list),
            &third.log(),
            "\"a##r3## of mine\"",
        );
    }
    // No callbacks at all, and callbacks without a logger: everything works without messages.
    let good = fmi2::Fmi2Arguments::new(&resources);
    let (name, token, place) = (good.name.expect("set"), good.token.expect("set"), good.location.expect("set"));
    let none = tiprub_fmi_host::api::Fmi2Callbacks {
        logger: std::ptr::null(),
        allocateMemory: std::ptr::null(),
        freeMemory: std::ptr::null(),
        stepFinished: std::ptr::null(),
        componentEnvironment: std::ptr::null_mut(),
    };
    for callbacks in [std::ptr::null(), &raw const none] {
        // SAFETY: all texts are alive; callbacks are NULL or contain NULL.
        unsafe {
            let handle = (api.fmi2Instantiate)(name.as_ptr(), 1, token.as_ptr(), place.as_ptr(), callbacks, 0, 1);
            assert!(!handle.is_null());
            assert_eq!((api.fmi2DoStep)(handle, 0.0, 1e-4, 1), ERROR);
            assert_eq!((api.fmi2EnterInitializationMode)(handle), OK);
            (api.fmi2FreeInstance)(handle);
        }
    }
    // The callback struct and the texts are copied: those of `Slave::new` no longer exist, and messages still contain
    // the instance name, which the journal checks.
    assert_eq!(slave.step(0.0, 1.0), ERROR);
    assert!(slave.log().contains("not allowed in state Instantiated"));
    summary("loggers");
}

/// Makes calls that are not allowed within an intermediate update.
unsafe extern "C" fn misbehave(
    environment: *mut c_void,
    _time: f64,
    _set_requested: bool,
    _get_allowed: bool,
    _finished: bool,
    _can_return: bool,
    requested: *mut bool,
    at: *mut f64,
) {
    let context: *mut fmi3::CallbackContext = environment.cast();
    // SAFETY: the context outlives the instance; logging writes to its journal during these calls, hence no long borrows.
    unsafe {
        let (api, handle): (&Fmi3Api, _) = (&*(*context).api, (*context).handle);
        let (mut a, mut b, mut c, mut d) = (false, false, false, 0.0);
        let mut state = std::ptr::null_mut();
        let (friction, value) = (reference("friction_coefficient"), 0.5);
        let statuses = [
            (api.fmi3DoStep)(handle, 0.0, 1e-6, true, &raw mut a, &raw mut b, &raw mut c, &raw mut d),
            (api.fmi3Reset)(handle),
            (api.fmi3Terminate)(handle),
            (api.fmi3GetFMUState)(handle, &raw mut state),
            (api.fmi3SetFMUState)(handle, state),
            (api.fmi3DeserializeFMUState)(handle, std::ptr::null(), 0, &raw mut state),
            (api.fmi3EnterInitializationMode)(handle, false, 0.0, 0.0, false, 0.0),
            (api.fmi3SetFloat64)(handle, &raw const friction, 1, &raw const value, 1),
        ];
        (api.fmi3FreeInstance)(handle);
        (*context).notes.extend(statuses.map(f64::from));
        (*requested, *at) = (true, f64::NAN);
    }
}

#[test]
fn forbidden_calls_within_intermediate_update_are_rejected() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(false));
    for early_return in [false, true] {
        let arguments =
            fmi3::Fmi3Arguments { update: Some(misbehave), early_return, ..fmi3::Fmi3Arguments::new(&resources) };
        let slave = fmi3::Fmi3TestSlave::try_new(&api, &arguments).unwrap_or_else(|log| panic!("{log}"));
        slave.initialise();
        let answer = slave.step(0.0, 1e-5);
        let notes = slave.notes();
        assert_eq!(notes.len(), 5 * 8, "five internal steps of eight forbidden calls");
        assert!(notes.iter().all(|status| *status == f64::from(ERROR)), "{notes:?}");
        let log = slave.log();
        assert!(log.contains("the instance is not freed because a step is in progress"), "{log}");
        assert!(log.contains("not a continuous input"), "{log}");
        // A request that is not allowed returns Warning; a request to return at NaN is not fulfilled.
        assert_eq!((answer.status, answer.early), (i32::from(!early_return), false), "{log}");
        assert_eq!(answer.time.to_bits(), 1e-5_f64.to_bits());
        count(9);
    }
    summary("intermediate updates");
}

#[test]
fn a_step_that_fails_ends_in_error_with_the_last_good_time() {
    let path = shipped();
    let api = fmi2::load(&path);
    let mut moving = tiprub_tests::scene::scene();
    moving.settings.surfaces[0].moving = true;
    let resources = UnpackedResources::of(&moving, false);
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    slave.expect(slave.step(0.0, 1e-4));
    let good = slave.save();
    let simulation = tiprub_core::Simulation::new(&moving).expect("valid");
    let closing = ["casing_radius_change", "gap_offset"]
        .map(|name| simulation.table().find(name).expect("a variable of this scene").reference);
    // Each is within its range, together they are a tenth of the radius and more.
    slave.expect(slave.set_reals(&closing, &[-0.024; 2]));
    refused(slave.step(1e-4, 1e-4), &slave.log(), "last good time 0.0001 s");
    let (mut last, mut terminated) = (0.0, 0);
    // SAFETY: valid locations for one value.
    unsafe {
        slave.expect((api.fmi2GetRealStatus)(slave.handle, 2, &raw mut last));
        slave.expect((api.fmi2GetBooleanStatus)(slave.handle, 3, &raw mut terminated));
    }
    assert_eq!((last, terminated), (1e-4, 1));
    refused(slave.step(1e-4, 1e-4), &slave.log(), "not allowed in state Step Failed");
    slave.expect(slave.restore(good));
    slave.expect(slave.step(1e-4, 1e-4));
    slave.expect(slave.reset());
    slave.initialise();
    slave.expect(slave.step(0.0, 1e-4));
    summary("failed steps");
}

/// An instance that two threads use simultaneously, against the rules.
struct Shared(*mut c_void);
// SAFETY: the library under test rejects concurrent calls to an instance.
unsafe impl Sync for Shared {}

#[test]
fn threads_use_separate_instances_but_cannot_share_one() {
    let path = shipped();
    let (api2, api3, resources) = (fmi2::load(&path), fmi3::load(&path), UnpackedResources::new(false));
    let references =
        ["time", "rotor_angle", "clearance_minimum", "force_x", "normal_impulse", "blade[1].clearance"].map(reference);
    let run2 = || {
        let slave = fmi2::Fmi2TestSlave::initialised(&api2, &resources);
        for step in 0..300 {
            slave.expect(slave.step(f64::from(step) * 1e-4, 1e-4));
        }
        let reals: Vec<_> = slave.reals(&references).into_iter().map(f64::to_bits).collect();
        reals
    };
    let run3 = || {
        let slave = fmi3::Fmi3TestSlave::new(&api3, &resources);
        slave.initialise();
        for step in 0..300 {
            assert_eq!(slave.step(f64::from(step) * 1e-4, 1e-4).status, OK);
        }
        let reals: Vec<_> = slave.reals(&references, references.len()).into_iter().map(f64::to_bits).collect();
        reals
    };
    let alone = run2();
    std::thread::scope(|scope| {
        let threads = [scope.spawn(run2), scope.spawn(run3), scope.spawn(run2), scope.spawn(run3)];
        for thread in threads {
            assert_eq!(thread.join().expect("no thread fails"), alone);
        }
    });
    // Two threads on one instance are against the rules: some calls are rejected, none is undefined.
    let slave = fmi2::Fmi2TestSlave::initialised(&api2, &resources);
    let shared = Shared(slave.handle);
    let reset = || {
        let Shared(handle) = &shared;
        // SAFETY: a live instance; the library serialises access itself.
        unsafe { (api2.fmi2Reset)(*handle) }
    };
    // Two threads would write messages to one journal: switch them off by selecting a category that never occurs.
    let fatal = CString::new("logStatusFatal").expect("no NUL");
    let list = [fatal.as_ptr()];
    // SAFETY: an array of one text.
    slave.expect(unsafe { (api2.fmi2SetDebugLogging)(slave.handle, 1, 1, list.as_ptr()) });
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                for _ in 0..2000 {
                    assert!([OK, ERROR].contains(&reset()));
                }
            });
        }
    });
    slave.expect(slave.reset());
    count(1);
    summary("threads");
}

/// Floating-point control of the host, as `fenv.h` and the compilers' intrinsics set it, without its flags.
#[cfg(target_arch = "x86_64")]
mod control {
    /// All but the six sticky flags.
    const CONTROL: u32 = !0x3F;

    pub fn get() -> u32 {
        let mut value = 0_u32;
        // SAFETY: writes the given four bytes.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack)) };
        value
    }

    pub fn set(value: u32) {
        // SAFETY: reads the given four bytes; only existing bits are ever set.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack)) };
    }

    /// Runs `action` under another control word, and checks that the word is unchanged afterwards and no flag is
    /// raised.
    pub fn under<T>(word: u32, action: impl FnOnce() -> T) -> T {
        let before = get();
        set(word);
        let answer = action();
        let after = get();
        set(before);
        assert_eq!(after & CONTROL, word, "the host's control word changed");
        assert_eq!(after & !CONTROL, 0, "a floating-point exception leaked into the host");
        answer
    }
}

/// An unmasked exception terminates this process with SIGFPE, and then all tests of this file fail.
#[test]
#[cfg(target_arch = "x86_64")]
fn host_floating_point_environment_has_no_effect() {
    const MASKED: u32 = 0x1F80;
    let traps = MASKED & !(0x0080 | 0x0200 | 0x0400 | 0x0800); // Invalid operation, division by zero, overflow, underflow.
    let (path, resources) = (shipped(), UnpackedResources::new(false));
    let (api2, api3) = (fmi2::load(&path), fmi3::load(&path));
    let references =
        ["rotor_angle", "clearance_minimum", "force_x", "normal_impulse", "energy_residual"].map(reference);
    let run = |word: u32| {
        let slave = control::under(word, || fmi2::Fmi2TestSlave::new(&api2, &resources));
        let third = control::under(word, || fmi3::Fmi3TestSlave::new(&api3, &resources));
        slave.expect(control::under(word, || slave.enter()));
        slave.expect(control::under(word, || slave.exit()));
        third.expect(control::under(word, || third.enter(0.0, None)));
        third.expect(control::under(word, || third.exit()));
        let mut values = Vec::new();
        for step in 0..300 {
            let time = f64::from(step) * 1e-4;
            slave.expect(control::under(word, || slave.step(time, 1e-4)));
            assert_eq!(control::under(word, || third.step(time, 1e-4)).status, OK);
            let reals = control::under(word, || slave.reals(&references));
            assert_eq!(control::under(word, || third.reals(&references, references.len())), reals);
            values.extend(reals.into_iter().map(f64::to_bits));
        }
        values
    };
    let expected = run(MASKED);
    for (name, word) in [
        ("traps", traps),
        ("round down", MASKED | 0x2000),
        ("round up", MASKED | 0x4000),
        ("round to zero", MASKED | 0x6000),
        ("denormals to zero", MASKED | 0x8040),
    ] {
        assert_eq!(run(word), expected, "{name}");
        count(1);
    }
    summary("floating-point environment");
}
