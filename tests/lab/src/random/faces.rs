//! The FMU library compared with the native run: the same bits, the same rejections, states that are moved between
//! instances.

use std::path::Path;

use tiprub_fmi_host::api::{Fmi2Api, Fmi3Api};
use tiprub_shell::Result;
use tiprub_tests::scene::UnpackedResources;
use tiprub_tests::{OK, WARNING, fmi2, fmi3};

use super::march::{OutputRecord, RandomPlan, SteppedInstance};
use super::oracles::Finding;
use super::scenes::{RandomScene, numbers};
use super::states::LATER;

/// Both interfaces of the library.
#[derive(Debug)]
pub(crate) struct LibraryFaces {
    two: Fmi2Api,
    three: Fmi3Api,
}

/// Native result of a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Native<'a> {
    /// Rejected with this message.
    Rejected(&'a str),
    /// Completed.
    Ran(&'a RandomPlan, &'a OutputRecord),
}

/// An instance whose states can be moved to another one.
trait PortableInstance: SteppedInstance {
    fn state(&self) -> Vec<u8>;
    fn resume(&self, bytes: &[u8]) -> std::result::Result<(), String>;
}

macro_rules! instance {
    ($slave:ty) => {
        impl PortableInstance for $slave {
            fn state(&self) -> Vec<u8> {
                self.serialise(self.save())
            }

            fn resume(&self, bytes: &[u8]) -> std::result::Result<(), String> {
                let (status, state) = self.deserialise(bytes);
                let taken = status == OK && is_good(self.restore(state));
                if taken { Ok(()) } else { Err(self.log()) }
            }
        }
    };
}

instance!(fmi2::Fmi2TestSlave<'_>);
instance!(fmi3::Fmi3TestSlave<'_>);

fn is_good(status: i32) -> bool {
    status == OK || status == WARNING
}

impl LibraryFaces {
    /// Loads a library.
    ///
    /// # Errors
    /// A library that cannot be loaded.
    pub(crate) fn load(path: &Path) -> Result<Self> {
        Ok(Self { two: Fmi2Api::load(path)?, three: Fmi3Api::load(path)? })
    }

    /// Runs a scene through both versions and compares it with the native result.
    pub(crate) fn compare(&self, trial: &RandomScene, native: Native) -> Vec<Finding> {
        let resources = UnpackedResources::of(&trial.scene, false);
        let two = |time: f64| {
            let slave = fmi2::Fmi2TestSlave::try_new(&self.two, &fmi2::Fmi2Arguments::new(&resources))?;
            let good = is_good(slave.setup(time, None)) && is_good(slave.enter()) && is_good(slave.exit());
            if good { Ok(slave) } else { Err(slave.log()) }
        };
        let three = |time: f64| {
            let slave = fmi3::Fmi3TestSlave::try_new(&self.three, &fmi3::Fmi3Arguments::new(&resources))?;
            let good = is_good(slave.enter(time, None)) && is_good(slave.exit());
            if good { Ok(slave) } else { Err(slave.log()) }
        };
        let mut texts = vec![difference("FMI 2.0", two, trial, native)];
        // FMI 3.0 has no derivatives of inputs.
        if !trial.slopes || matches!(native, Native::Rejected(_)) {
            texts.push(difference("FMI 3.0", three, trial, native));
        }
        texts.into_iter().flatten().map(|text| Finding { oracle: "FMU", text }).collect()
    }
}

/// Returns the difference of an FMI version from the native run, if there is one.
fn difference<I: PortableInstance>(
    name: &str,
    start: impl Fn(f64) -> std::result::Result<I, String>,
    trial: &RandomScene,
    native: Native,
) -> Option<String> {
    let (plan, record) = match native {
        Native::Rejected(message) => {
            return match start(0.0) {
                Ok(_) => Some(format!("{name} accepts a scene that the core rejects: {message}")),
                Err(log) if log.contains(message) => None,
                Err(log) => Some(format!("{name} rejects the scene with {log:?}, the core with {message:?}")),
            };
        }
        Native::Ran(plan, record) => (plan, record),
    };
    let mut slave = match start(0.0) {
        Ok(slave) => slave,
        Err(log) => return Some(format!("{name} rejects a scene that the core runs: {log}")),
    };
    let mut random = numbers(trial.seed, 4);
    let at = random.below(record.points.len() + 1);
    let mut own = OutputRecord::default();
    for index in 0..at {
        match plan.step(&mut slave, index) {
            Ok(point) => own.points.push(point),
            Err(end) => return Some(format!("{name} ends after communication step {index}: {end}")),
        }
    }
    let bytes = slave.state();
    let rest = plan.march(&mut slave, at, |_, _| ());
    own.points.extend(rest.points);
    own.end = rest.end;
    if let Some(off) = own.differs(record, plan, 0) {
        return Some(format!("{name}: {off}"));
    }
    // A scene whose shape has finished growing may not start later.
    let (began, mut other) = match start(LATER) {
        Ok(other) if random.unit() < 0.6 => (LATER, other),
        _ => (0.0, start(0.0).ok()?),
    };
    if let Err(log) = other.resume(&bytes) {
        return Some(format!(
            "{name}: an instance started at {began} s rejects the state of communication point {at}: {log}"
        ));
    }
    let after = plan.march(&mut other, at, |_, _| ());
    let off = after.differs(&record.from(at), plan, at)?;
    Some(format!("{name}, state of communication point {at} in an instance started at {began} s: {off}"))
}
