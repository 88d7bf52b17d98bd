//! The neutral slave: what an FMU instance is, whichever version of the standard it is driven through.

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

use tiprub_core::Warning;
use tiprub_core::warning::Severity;

use crate::unit::{CoSimulationUnit, Load};

pub(crate) use access::{AccessRequest, Value};
pub(crate) use phase::{ExperimentTimes, InstancePhase};

/// Answer of a call. The numbers are those of `fmi2Status` and `fmi3Status`; `Fatal` (4) is never answered, because in
/// FMI 2.0 it would condemn all instances of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i32)]
pub enum FmiStatus {
    /// All well.
    Ok = 0,
    /// Done, and the message logged deserves attention.
    Warning = 1,
    /// Nothing done, the simulation can go on.
    Discard = 2,
    /// Refused or failed, the message logged says why.
    Error = 3,
}

/// Which version of the standard an instance was made by: names of types and arguments differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Dialect {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

/// A call that was not carried out, and the message that explains it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// `Error` or `Discard`.
    pub status: FmiStatus,
    /// What, where, and the remedy.
    pub message: String,
}

impl Refusal {
    /// A refusal that answers `Error`.
    pub(crate) fn error(message: impl Into<String>) -> Self {
        Self { status: FmiStatus::Error, message: message.into() }
    }

    /// A refusal that answers `Discard`.
    pub(crate) fn discard(message: impl Into<String>) -> Self {
        Self { status: FmiStatus::Discard, message: message.into() }
    }
}

impl From<tiprub_core::Error> for Refusal {
    fn from(error: tiprub_core::Error) -> Self {
        match error {
            // Nothing is lost: the importer may go on.
            tiprub_core::Error::Exhausted { .. } => Self::discard(error.to_string()),
            _ => Self::error(error.to_string()),
        }
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
    unit: Box<dyn CoSimulationUnit>,
    token: String,
    arrays: bool,
    phase: InstancePhase,
    /// Saved states handed out: the importer holds the address of a box as an opaque handle, which is only ever
    /// compared, never followed. They are freed with the instance at the latest.
    ///
    /// The box is needed: its address is the handle, and must not move when the list grows.
    #[expect(clippy::vec_box)]
    snapshots: Vec<Box<snapshot::SavedState>>,
    /// Texts handed out by the last call that returned texts.
    strings: Vec<CString>,
    /// Messages for the importer that do not come with a refusal.
    notes: Vec<(FmiStatus, String)>,
}

impl Slave {
    /// Load the unit from the FMU's resources directory.
    ///
    /// # Errors
    /// Unreadable or damaged resources, a token that does not belong to them, a model that the unit refuses.
    pub(crate) fn new(dialect: Dialect, resources: &Path, token: &str, load: Load) -> Result<Self> {
        let loaded = load(resources).map_err(Refusal::error)?;
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

    /// Version of the standard this instance was made by.
    pub(crate) fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Phase of life.
    pub(crate) fn phase(&self) -> &InstancePhase {
        &self.phase
    }

    /// Time of the instance (s): what the importer would call the current time, in any phase.
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

    /// Keep texts that are handed out by pointer.
    pub(crate) fn keep(&mut self, texts: Vec<CString>) -> &[CString] {
        self.strings = texts;
        &self.strings
    }

    /// Messages that do not come with a refusal, in order; the list is empty afterwards.
    pub(crate) fn take_notes(&mut self) -> Vec<(FmiStatus, String)> {
        std::mem::take(&mut self.notes)
    }

    /// Hand on what the unit has to say since it was last asked.
    pub(super) fn collect_notes(&mut self) {
        self.notes.extend(self.unit.take_notes().iter().map(logged));
    }

    /// Add a message to be handed to the importer after the call.
    pub(crate) fn note(&mut self, status: FmiStatus, message: impl Into<String>) {
        self.notes.push((status, message.into()));
    }
}

/// A warning as a message of the log: notes have the status `Ok`.
fn logged(warning: &Warning) -> (FmiStatus, String) {
    let status = match warning.level() {
        Severity::Note => FmiStatus::Ok,
        Severity::Warning => FmiStatus::Warning,
    };
    (status, warning.logged())
}
