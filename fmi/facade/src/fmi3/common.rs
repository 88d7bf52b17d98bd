//! Life cycle of an instance, saved states, logging.

use std::ffi::c_char;

use super::Boolean;
use crate::Load;
use crate::boundary::{
    self, Callbacks, Fmi3Logger, ImporterEnvironment, In, InstanceHandle, Instantiation, IntermediateUpdate, Out, Sink,
    StateHandle, TextArgument, guard, instantiate, refuse_instantiation, release, state,
};
use crate::location;
use crate::shared::shared_functions;
use crate::slave::order::fmi3 as order;
use crate::slave::{Dialect, ExperimentTimes, FmiStatus, Refusal, Slave};

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3InstantiateModelExchange(
    _instanceName: TextArgument,
    _instantiationToken: TextArgument,
    _resourcePath: TextArgument,
    _visible: Boolean,
    _loggingOn: Boolean,
    instanceEnvironment: ImporterEnvironment,
    logMessage: Option<Fmi3Logger>,
) -> InstanceHandle {
    refuse_instantiation(
        Sink::Fmi3 { logger: logMessage, environment: instanceEnvironment },
        "fmi3InstantiateModelExchange",
        "this FMU has no Model Exchange interface. Call fmi3InstantiateCoSimulation",
    )
}

/// Implements `fmi3InstantiateCoSimulation` of a library with a unit created by `load`. The library exports it, see
/// [`crate::library`].
pub fn instantiate_unit(
    load: Load,
    instanceName: TextArgument,
    instantiationToken: TextArgument,
    resourcePath: TextArgument,
    loggingOn: Boolean,
    eventModeUsed: Boolean,
    earlyReturnAllowed: Boolean,
    requiredIntermediateVariables: In<u32>,
    nRequiredIntermediateVariables: usize,
    instanceEnvironment: ImporterEnvironment,
    logMessage: Option<Fmi3Logger>,
    intermediateUpdate: Option<IntermediateUpdate>,
) -> InstanceHandle {
    instantiate(Instantiation {
        dialect: Dialect::Fmi3,
        load,
        function: "fmi3InstantiateCoSimulation",
        name: instanceName,
        token: instantiationToken,
        location: resourcePath,
        locate: location::from_native,
        sink: Sink::Fmi3 { logger: logMessage, environment: instanceEnvironment },
        logging_on: loggingOn != 0,
        callbacks: Some(Callbacks {
            update: intermediateUpdate,
            early_return_allowed: earlyReturnAllowed != 0,
            environment: instanceEnvironment,
        }),
        check: &|slave| {
            if eventModeUsed != 0 {
                return Err(Refusal::error(
                    "eventModeUsed is true, but this FMU has no Event Mode (hasEventMode is false). Pass fmi3False",
                ));
            }
            let (count, limit) = (nRequiredIntermediateVariables, slave.reference_limit());
            slave.check_intermediate_variables(requiredIntermediateVariables.array(
                count,
                limit,
                "requiredIntermediateVariables",
            )?)
        },
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3InstantiateScheduledExecution(
    _instanceName: TextArgument,
    _instantiationToken: TextArgument,
    _resourcePath: TextArgument,
    _visible: Boolean,
    _loggingOn: Boolean,
    instanceEnvironment: ImporterEnvironment,
    logMessage: Option<Fmi3Logger>,
    _clockUpdate: Option<unsafe extern "C" fn(ImporterEnvironment)>,
    _lockPreemption: Option<unsafe extern "C" fn()>,
    _unlockPreemption: Option<unsafe extern "C" fn()>,
) -> InstanceHandle {
    refuse_instantiation(
        Sink::Fmi3 { logger: logMessage, environment: instanceEnvironment },
        "fmi3InstantiateScheduledExecution",
        "this FMU has no Scheduled Execution interface. Call fmi3InstantiateCoSimulation",
    )
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3EnterInitializationMode(
    instance: InstanceHandle,
    _toleranceDefined: Boolean,
    _tolerance: f64,
    startTime: f64,
    stopTimeDefined: Boolean,
    stopTime: f64,
) -> FmiStatus {
    guard(instance, &order::ENTER_INITIALIZATION_MODE, |slave| {
        let experiment = ExperimentTimes::new(startTime, (stopTimeDefined != 0).then_some(stopTime))?;
        slave.enter_initialisation(Some(experiment));
        Ok(())
    })
}

shared_functions! {
    Boolean; fmi3SetDebugLogging fmi3FreeInstance fmi3ExitInitializationMode fmi3Terminate fmi3Reset
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState
    fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState
}
