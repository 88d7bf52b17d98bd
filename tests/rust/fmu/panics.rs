//! A panic inside the library: caught, logged, nothing printed, the instance unusable, the host and other instances
//! alive. The library is built with the feature that makes one magic step size panic.

use std::process::Command;

use tiprub_tests::scene::UnpackedResources;
use tiprub_tests::{ERROR, OK, fmi2, fmi3, library, shipped};

/// The magic step size of the feature `test-panic`.
const PANIC: f64 = 1.234_567_890_123e-5;

/// Runs in the child process: panics in both versions, in two threads simultaneously, with all checks.
fn abuse() {
    let path = library("release", &["test-panic"]);
    let (api2, api3) = (fmi2::load(&path), fmi3::load(&path));
    let resources = UnpackedResources::new(false);

    let (slave, other) =
        (fmi2::Fmi2TestSlave::initialised(&api2, &resources), fmi2::Fmi2TestSlave::initialised(&api2, &resources));
    slave.expect(slave.step(0.0, 1e-4));
    let state = slave.save();
    assert_eq!(slave.step(1e-4, PANIC), ERROR, "Error, not Fatal");
    let log = slave.log();
    assert!(log.contains("panic requested by the panic test") && log.contains("stepping.rs:"), "{log}");
    let mut value = 0.0;
    // SAFETY: arrays of one element; the library must reject all of this.
    unsafe {
        assert_eq!((api2.fmi2GetReal)(slave.handle, &raw const value as *const u32, 1, &raw mut value), ERROR);
        assert_eq!((api2.fmi2GetRealStatus)(slave.handle, 2, &raw mut value), ERROR);
        assert_eq!((api2.fmi2SetDebugLogging)(slave.handle, 1, 0, std::ptr::null()), ERROR);
    }
    for status in [slave.step(1e-4, 1e-4), slave.reset(), slave.restore(state), slave.terminate(), slave.enter()] {
        assert_eq!(status, ERROR);
    }
    assert!(slave.log().contains("unusable after an internal error"));
    drop(slave);
    other.expect(other.step(0.0, 1e-4));

    // The same through FMI 3.0, from two threads simultaneously.
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let slave = fmi3::Fmi3TestSlave::new(&api3, &resources);
                slave.initialise();
                let answer = slave.step(0.0, PANIC);
                assert_eq!((answer.status, answer.event, answer.terminate, answer.early), (ERROR, false, false, false));
                assert_eq!(answer.time.to_bits(), 0.0_f64.to_bits());
                assert!(slave.log().contains("internal error"));
                assert_eq!(slave.step(0.0, 1e-4).status, ERROR);
            });
        }
    });
    let fresh = fmi3::Fmi3TestSlave::new(&api3, &resources);
    fresh.initialise();
    assert_eq!(fresh.step(0.0, 1e-4).status, OK);
}

/// Has an effect only when the test below runs this binary again.
#[test]
fn child() {
    if std::env::var_os("TIPRUB_TEST_PANIC").is_some() {
        abuse();
    }
}

#[test]
fn forced_panic_neither_kills_the_host_nor_prints() {
    let path = library("release", &["test-panic"]);
    assert!(path.exists());
    let mut child = Command::new(std::env::current_exe().expect("this binary"));
    child.args(["--exact", "panics::child", "--nocapture", "--test-threads=1"]).env("TIPRUB_TEST_PANIC", "1");
    let output = child.output().expect("this binary can be run");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
    assert_eq!(err.trim(), "", "printed on standard error");
    let own = ["running 1 test", "test panics::child ... ok", "test result: ok."];
    let foreign: Vec<_> =
        out.lines().filter(|line| !line.is_empty() && !own.iter().any(|own| line.starts_with(own))).collect();
    assert!(foreign.is_empty(), "printed on standard output: {foreign:?}");
}

#[test]
fn release_library_ignores_the_panic_test_step_size() {
    let api = fmi2::load(&shipped());
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &UnpackedResources::new(false));
    slave.expect(slave.step(0.0, PANIC));
}
