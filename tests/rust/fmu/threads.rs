//! Threads of an instance: none unless the parameter `threads` requests them, and none after the run.

use std::path::Path;

use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::TimeSettings;
use tiprub_core::{CoSimulation, Simulation};
use tiprub_tests::scene::{UnpackedResources, scene};
use tiprub_tests::{OK, fmi2, fmi3, shipped};

/// Number of threads of this process that a library has created. No other test of this program requests threads.
fn count() -> usize {
    let tasks = std::fs::read_dir("/proc/self/task").expect("a folder of threads");
    // A thread may have ended in the meantime.
    let name = |task: &Path| std::fs::read_to_string(task.join("comm")).unwrap_or_default();
    tasks.filter(|task| name(&task.as_ref().expect("a thread").path()).trim() == "tiprub").count()
}

/// Runs instances of one version of the standard; `$set` sets the parameter `threads` to 4.
macro_rules! test_version {
    ($version:ident, $slave:ident, $set:expr) => {{
        let api = $version::load(&shipped());
        let mut scene = scene();
        scene.settings.time = TimeSettings { scheme: Scheme::Galerkin, step: 4e-5, ..TimeSettings::default() };
        let threads =
            Simulation::new(&scene).expect("a valid scene").table().find("threads").expect("a parameter").reference;
        let resources = UnpackedResources::of(&scene, false);
        let alone = $version::$slave::new(&api, &resources);
        alone.initialise();
        assert!(alone.step(0.0, 1e-4).is_ok() && count() == 0, "one thread needs no other");
        drop(alone);
        let new = || {
            let slave = $version::$slave::new(&api, &resources);
            $set(&api, slave.handle, threads);
            assert_eq!(count() % 3, 0, "no thread before initialisation");
            slave.initialise();
            slave
        };
        let one = new();
        assert_eq!(count(), 3);
        let other = new();
        assert_eq!(count(), 6);
        for step in 0..20 {
            let time = 1e-4 * f64::from(step);
            assert!(one.step(time, 1e-4).is_ok() && other.step(time, 1e-4).is_ok());
        }
        assert_eq!(count(), 6);
        one.expect(one.terminate());
        assert_eq!(count(), 3, "terminated");
        one.expect(one.reset());
        other.expect(other.reset());
        assert_eq!(count(), 0, "reset");
        $set(&api, other.handle, threads);
        other.initialise();
        assert!(count() == 3 && other.step(0.0, 1e-4).is_ok());
        drop(other);
        assert_eq!(count(), 0, "freed");
    }};
}

/// Result of a step in either version.
trait Status {
    fn is_ok(&self) -> bool;
}

impl Status for i32 {
    fn is_ok(&self) -> bool {
        *self <= 1
    }
}

impl Status for fmi3::Step {
    fn is_ok(&self) -> bool {
        self.status <= 1
    }
}

#[test]
fn threads_exist_only_while_an_instance_runs_with_them() {
    let (number, long) = (4_i32, 4_i64);
    test_version!(fmi2, Fmi2TestSlave, |api: &tiprub_fmi_host::api::Fmi2Api, handle, threads: u32| {
        // SAFETY: the instance is alive; arrays of one element.
        assert_eq!(unsafe { (api.fmi2SetInteger)(handle, &raw const threads, 1, &raw const number) }, OK);
    });
    test_version!(fmi3, Fmi3TestSlave, |api: &tiprub_fmi_host::api::Fmi3Api, handle, threads: u32| {
        // SAFETY: the instance is alive; arrays of one element.
        assert_eq!(unsafe { (api.fmi3SetInt64)(handle, &raw const threads, 1, &raw const long, 1) }, OK);
    });
}
