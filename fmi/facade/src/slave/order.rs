//! The call order of both standards as data: the phases in which each exported function that takes an instance is
//! allowed. All functions that read values share one row, and all functions that set values share another.
//!
//! Sources: FMI 2.0.4, section 4.2.4 (state machine of calling sequence, table of functions against states) and FMI
//! 3.0.2, sections 2.3 and 4.2. Functions such as `fmi3EnterEventMode` belong to capabilities that this FMU does not
//! have; they are never allowed ([`NOWHERE`] produces the message) or rejected with their own message.
//!
//! One deviation from the standard is tolerated because importers rely on it: in FMI 2.0, variables with a start value
//! can be read while the instance is still `Instantiated` (FMI 3.0 allows that). One row is stricter than the standard:
//! `fmi3GetOutputDerivatives` is rejected during an intermediate update, because derivatives belong to communication
//! points.

use super::phase::{ANY, FAILED, INITIALISING, INSTANTIATED, STEPPING, States, TERMINATED, UPDATING, names};
use super::{Dialect, InstancePhase, Refusal, Result};

/// One row of a call-order table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CallRule {
    /// Name of the exported function.
    pub name: &'static str,
    /// Phases in which the function may be called.
    pub states: States,
}

impl CallRule {
    /// Returns the version of the standard, from the prefix of the name.
    pub(crate) fn dialect(&self) -> Dialect {
        if self.name.starts_with("fmi2") { Dialect::Fmi2 } else { Dialect::Fmi3 }
    }

    /// Rejects a call that is out of order.
    ///
    /// # Errors
    /// A call in a phase in which it is not allowed; the message contains the phase and the allowed phases.
    pub(crate) fn check(&self, phase: &InstancePhase) -> Result<()> {
        if self.states & phase.state() != 0 {
            return Ok(());
        }
        let now = names(phase.state());
        Err(Refusal::error(if self.states == NOWHERE {
            format!("not allowed in state {now} or in any other state of this FMU")
        } else {
            format!("not allowed in state {now}. Allowed in: {}", names(self.states))
        }))
    }
}

/// No phase.
pub(crate) const NOWHERE: States = 0;
/// Phases in which the whole state can be saved and restored.
const SETTABLE: States = INSTANTIATED | INITIALISING | STEPPING | FAILED | TERMINATED;

/// Defines the rows of a version: one for all getters, one for all setters, and one `const` for each other function.
macro_rules! table {
    (getters $getters:expr; setters $setters:expr; $($constant:ident $name:literal $states:expr;)*) => {
        /// Returns the row of a function that reads values of one type.
        pub(crate) const fn getter(name: &'static str) -> CallRule {
            CallRule { name, states: $getters }
        }

        /// Returns the row of a function that sets values of one type.
        pub(crate) const fn setter(name: &'static str) -> CallRule {
            CallRule { name, states: $setters }
        }

        $(pub(crate) const $constant: CallRule = CallRule { name: $name, states: $states };)*
    };
}

/// FMI 2.0. Phases: stepComplete is `STEPPING`, stepFailed and error are `FAILED`; stepInProgress and stepCanceled do not
/// exist in a slave that never steps asynchronously.
pub(crate) mod fmi2 {
    use super::*;

    table! {
        getters SETTABLE;
        setters INSTANTIATED | INITIALISING | STEPPING;
        SET_DEBUG_LOGGING "fmi2SetDebugLogging" ANY;
        FREE_INSTANCE "fmi2FreeInstance" ANY;
        SETUP_EXPERIMENT "fmi2SetupExperiment" INSTANTIATED;
        ENTER_INITIALIZATION_MODE "fmi2EnterInitializationMode" INSTANTIATED;
        EXIT_INITIALIZATION_MODE "fmi2ExitInitializationMode" INITIALISING;
        TERMINATE "fmi2Terminate" STEPPING | FAILED;
        RESET "fmi2Reset" SETTABLE;
        GET_FMU_STATE "fmi2GetFMUstate" SETTABLE;
        SET_FMU_STATE "fmi2SetFMUstate" SETTABLE;
        FREE_FMU_STATE "fmi2FreeFMUstate" SETTABLE;
        SERIALIZED_FMU_STATE_SIZE "fmi2SerializedFMUstateSize" SETTABLE;
        SERIALIZE_FMU_STATE "fmi2SerializeFMUstate" SETTABLE;
        DESERIALIZE_FMU_STATE "fmi2DeSerializeFMUstate" SETTABLE;
        SET_REAL_INPUT_DERIVATIVES "fmi2SetRealInputDerivatives" INSTANTIATED | INITIALISING | STEPPING;
        GET_REAL_OUTPUT_DERIVATIVES "fmi2GetRealOutputDerivatives" STEPPING | FAILED | TERMINATED;
        DO_STEP "fmi2DoStep" STEPPING;
        CANCEL_STEP "fmi2CancelStep" NOWHERE;
        GET_STATUS "fmi2GetStatus" STEPPING | FAILED | TERMINATED;
        GET_REAL_STATUS "fmi2GetRealStatus" STEPPING | FAILED | TERMINATED;
        GET_INTEGER_STATUS "fmi2GetIntegerStatus" STEPPING | FAILED | TERMINATED;
        GET_BOOLEAN_STATUS "fmi2GetBooleanStatus" STEPPING | FAILED | TERMINATED;
        GET_STRING_STATUS "fmi2GetStringStatus" STEPPING | FAILED | TERMINATED;
    }
}

/// FMI 3.0 Co-Simulation without Event Mode.
pub(crate) mod fmi3 {
    use super::*;

    table! {
        getters SETTABLE | UPDATING;
        setters INSTANTIATED | INITIALISING | STEPPING | UPDATING;
        SET_DEBUG_LOGGING "fmi3SetDebugLogging" ANY;
        FREE_INSTANCE "fmi3FreeInstance" SETTABLE;
        ENTER_INITIALIZATION_MODE "fmi3EnterInitializationMode" INSTANTIATED;
        EXIT_INITIALIZATION_MODE "fmi3ExitInitializationMode" INITIALISING;
        TERMINATE "fmi3Terminate" STEPPING | FAILED;
        RESET "fmi3Reset" SETTABLE;
        GET_FMU_STATE "fmi3GetFMUState" SETTABLE;
        SET_FMU_STATE "fmi3SetFMUState" SETTABLE;
        FREE_FMU_STATE "fmi3FreeFMUState" SETTABLE;
        SERIALIZED_FMU_STATE_SIZE "fmi3SerializedFMUStateSize" SETTABLE;
        SERIALIZE_FMU_STATE "fmi3SerializeFMUState" SETTABLE;
        DESERIALIZE_FMU_STATE "fmi3DeserializeFMUState" SETTABLE;
        GET_OUTPUT_DERIVATIVES "fmi3GetOutputDerivatives" STEPPING | FAILED | TERMINATED;
        DO_STEP "fmi3DoStep" STEPPING;
        CONTINUE_STEP "fmi3DoStep" UPDATING;
    }
}

/// Returns the row of a function whose capability this FMU does not have; it has a separate message in every phase.
pub(crate) const fn unsupported(name: &'static str) -> CallRule {
    CallRule { name, states: ANY }
}
