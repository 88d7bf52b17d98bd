//! The version-independent slave: an FMU instance, regardless of the version of the standard that drives it.

mod access;
mod life;
pub(crate) mod order;
mod phase;
mod snapshot;
mod stepping;
mod tangent;

use std::ffi::CString;
use std::fmt;
use std::path::Path;

use tiprub_cosim::warning::Severity;
use tiprub_cosim::{CoSimulation, Diagnostic, Warning};

use crate::Load;

pub(crate) use access::{AccessRequest, FmiValue};
pub(crate) use phase::{ExperimentTimes, InstancePhase};

/// Status of a call. The numbers are those of `fmi2Status` and `fmi3Status`; `Fatal` (4) is never returned, because in
/// FMI 2.0 it would invalidate all instances of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i32)]
pub enum FmiStatus {
    /// Success.
    Ok = 0,
    /// Success, with a logged message that deserves attention.
    Warning = 1,
    /// Nothing was done, and the simulation can continue.
    Discard = 2,
    /// Rejected or failed, with a logged message that states the reason.
    Error = 3,
}

impl From<()> for FmiStatus {
    fn from((): ()) -> Self {
        Self::Ok
    }
}

/// Version of the standard by which an instance was created: names of types and arguments differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Dialect {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

/// A call that was not carried out, with the message that explains it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// `Error` or `Discard`.
    pub status: FmiStatus,
    /// Problem, place and remedy.
    pub message: String,
}

impl Refusal {
    /// Creates a refusal with the status `Error`.
    pub(crate) fn error(message: impl Into<String>) -> Self {
        Self { status: FmiStatus::Error, message: message.into() }
    }

    /// Creates a refusal with the status `Discard`.
    pub(crate) fn discard(message: impl Into<String>) -> Self {
        Self { status: FmiStatus::Discard, message: message.into() }
    }
}

impl From<tiprub_cosim::Error> for Refusal {
    fn from(error: tiprub_cosim::Error) -> Self {
        match error {
            // Nothing is lost: the importer can continue.
            tiprub_cosim::Error::Exhausted(_) => Self::discard(error.to_string()),
            _ => Self::error(error.to_string()),
        }
    }
}

impl From<Diagnostic> for Refusal {
    fn from(diagnostic: Diagnostic) -> Self {
        Self::error(diagnostic.to_string())
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

/// Result of the slave's own calls.
pub(crate) type Result<T, E = Refusal> = std::result::Result<T, E>;

/// One FMU instance without its callbacks.
pub(crate) struct Slave {
    dialect: Dialect,
    unit: Box<dyn CoSimulation>,
    token: String,
    arrays: bool,
    phase: InstancePhase,
    /// Saved states in use: the importer holds the address of a box as an opaque handle, which is only compared and
    /// never dereferenced. They are freed with the instance at the latest.
    ///
    /// The box is required: its address is the handle, and must not move when the list grows.
    #[expect(clippy::vec_box)]
    snapshots: Vec<Box<snapshot::SavedState>>,
    /// Strings returned by the last call that returns strings.
    strings: Vec<CString>,
    /// Messages for the importer that do not belong to a refusal.
    notes: Vec<(FmiStatus, String)>,
}

impl Slave {
    /// Loads the unit from the FMU's resources directory.
    ///
    /// # Errors
    /// Unreadable or damaged resources, a token that does not belong to them, or a model that the unit rejects.
    pub(crate) fn new(dialect: Dialect, resources: &Path, token: &str, load: Load) -> Result<Self> {
        let loaded = load(resources)?;
        if loaded.token != token {
            let (name, file) = match dialect {
                Dialect::Fmi2 => ("fmuGUID", "attribute guid"),
                Dialect::Fmi3 => ("instantiationToken", "attribute instantiationToken"),
            };
            return Err(Refusal::error(format!(
                "{name} \"{token}\" does not match the resources in {}, whose token is \"{}\". Pass the {file} from \
                 modelDescription.xml of the same FMU, and unpack the FMU completely (this is {})",
                resources.display(),
                loaded.token,
                loaded.release
            )));
        }
        Ok(Self {
            dialect,
            unit: (loaded.unit)()?,
            token: loaded.token,
            arrays: loaded.fmi3_arrays && dialect == Dialect::Fmi3,
            phase: InstancePhase::Instantiated { experiment: ExperimentTimes::default() },
            snapshots: Vec::new(),
            strings: Vec::new(),
            notes: Vec::new(),
        })
    }

    /// Returns the version of the standard by which this instance was created.
    pub(crate) fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Returns the current phase.
    pub(crate) fn phase(&self) -> &InstancePhase {
        &self.phase
    }

    /// Returns the time of the instance (s), which the importer would call the current time, in any phase.
    pub(crate) fn time(&self) -> f64 {
        match self.phase {
            InstancePhase::Instantiated { experiment } | InstancePhase::Initialising { experiment, .. } => {
                experiment.start
            }
            InstancePhase::Stepping { .. } => self.unit.time(),
            InstancePhase::Updating { reached, .. } => reached,
            InstancePhase::Failed { last_good: time } | InstancePhase::Terminated { time } => time,
        }
    }

    /// Stores strings that are returned by pointer.
    pub(crate) fn keep(&mut self, texts: Vec<CString>) -> &[CString] {
        self.strings = texts;
        &self.strings
    }

    /// Returns the messages that do not belong to a refusal, in order; the list is empty afterwards.
    pub(crate) fn take_notes(&mut self) -> Vec<(FmiStatus, String)> {
        std::mem::take(&mut self.notes)
    }

    /// Collects the messages of the unit since the last call.
    pub(super) fn collect_notes(&mut self) {
        self.notes.extend(self.unit.take_notes().iter().map(logged));
    }

    /// Adds a message that is sent to the importer after the call.
    pub(crate) fn note(&mut self, status: FmiStatus, message: impl Into<String>) {
        self.notes.push((status, message.into()));
    }
}

/// Converts a warning to a log message: notes have the status `Ok`.
fn logged(warning: &Warning) -> (FmiStatus, String) {
    let status = match warning.level() {
        Severity::Note => FmiStatus::Ok,
        Severity::Warning => FmiStatus::Warning,
    };
    (status, warning.logged())
}
