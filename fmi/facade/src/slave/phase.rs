//! Phases of an instance's life; the data of a phase exists only in it.

/// Start and stop time given by the importer.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ExperimentTimes {
    /// Start time (s).
    pub start: f64,
    /// Stop time (s), where defined: steps beyond it are refused.
    pub stop: Option<f64>,
}

/// Where an instance is in the state machines of the standards.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum InstancePhase {
    /// Instantiated: start values can be set.
    Instantiated {
        /// Set by `fmi2SetupExperiment`; the default starts at 0 without a stop.
        experiment: ExperimentTimes,
    },
    /// Initialization Mode.
    Initialising {
        /// As given.
        experiment: ExperimentTimes,
        /// `None` if a value was set after outputs were last computed; else the core's state from before they were, to go
        /// back to when the next value is set.
        before: Option<Vec<u8>>,
    },
    /// FMI 2.0 stepComplete, FMI 3.0 Step Mode.
    Stepping {
        /// Stop time (s).
        stop: Option<f64>,
    },
    /// FMI 3.0 Intermediate Update Mode: between two internal steps of a `fmi3DoStep` under way.
    Updating {
        /// Stop time (s).
        stop: Option<f64>,
        /// Internal time reached (s).
        reached: f64,
        /// Whether the outputs are those of that time.
        fresh: bool,
    },
    /// FMI 2.0 stepFailed: the state became non-finite. Reset or restore a saved state.
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
    /// The phase as a set of one.
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

/// Names of the phases in a set, for messages.
pub(super) fn names(states: States) -> String {
    let named = NAMES.iter().enumerate().filter(|(bit, _)| states & (1 << bit) != 0);
    named.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
}
