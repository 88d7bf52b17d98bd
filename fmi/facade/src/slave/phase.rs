//! Phases of an instance; the data of a phase exists only in that phase.

/// Start and stop time given by the importer.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ExperimentTimes {
    /// Start time (s).
    pub start: f64,
    /// Stop time (s), if defined; longer steps are rejected.
    pub stop: Option<f64>,
}

/// Phase of an instance in the state machines of the standards.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum InstancePhase {
    /// Instantiated: start values can be set.
    Instantiated {
        /// Set by `fmi2SetupExperiment`; the default starts at 0 without a stop.
        experiment: ExperimentTimes,
    },
    /// Initialization Mode.
    Initialising {
        /// Experiment as given.
        experiment: ExperimentTimes,
        /// `None` if a value was set after the outputs were last computed; otherwise the core's state before their
        /// computation, which is restored when the next value is set.
        before: Option<Vec<u8>>,
    },
    /// FMI 2.0 stepComplete, FMI 3.0 Step Mode.
    Stepping {
        /// Stop time (s).
        stop: Option<f64>,
    },
    /// FMI 3.0 Intermediate Update Mode: between two internal steps of a `fmi3DoStep` in progress.
    Updating {
        /// Stop time (s).
        stop: Option<f64>,
        /// Internal time reached (s).
        reached: f64,
        /// True if the outputs belong to that time.
        fresh: bool,
    },
    /// FMI 2.0 stepFailed: the state became non-finite. Reset the instance or restore a saved state.
    Failed {
        /// Last communication point with a good state (s).
        last_good: f64,
    },
    /// Terminated: values can still be read.
    Terminated {
        /// Time at which it was terminated (s).
        time: f64,
    },
}

/// Set of phases, one bit each.
pub(crate) type States = u8;

/// [`InstancePhase::Instantiated`].
pub(crate) const INSTANTIATED: States = 1;
/// [`InstancePhase::Initialising`].
pub(crate) const INITIALISING: States = 2;
/// [`InstancePhase::Stepping`].
pub(crate) const STEPPING: States = 4;
/// [`InstancePhase::Updating`].
pub(crate) const UPDATING: States = 8;
/// [`InstancePhase::Failed`].
pub(crate) const FAILED: States = 16;
/// [`InstancePhase::Terminated`].
pub(crate) const TERMINATED: States = 32;
/// Every phase.
pub(crate) const ANY: States = 63;

/// Names for messages, in the order of the bits.
const NAMES: [&str; 6] =
    ["Instantiated", "Initialization Mode", "Step Mode", "Intermediate Update Mode", "Step Failed", "Terminated"];

impl InstancePhase {
    /// Returns the set that contains only this phase.
    pub(crate) fn state(&self) -> States {
        match self {
            Self::Instantiated { .. } => INSTANTIATED,
            Self::Initialising { .. } => INITIALISING,
            Self::Stepping { .. } => STEPPING,
            Self::Updating { .. } => UPDATING,
            Self::Failed { .. } => FAILED,
            Self::Terminated { .. } => TERMINATED,
        }
    }
}

/// Returns the names of the phases in a set, for messages.
pub(super) fn names(states: States) -> String {
    let named = NAMES.iter().enumerate().filter(|(bit, _)| states & (1 << bit) != 0);
    named.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
}
