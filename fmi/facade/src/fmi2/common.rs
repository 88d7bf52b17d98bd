//! Functions common to Model Exchange and Co-Simulation.

use std::ffi::{CString, c_char};

use super::Boolean;
use crate::Load;
use crate::boundary::{
    self, Fmi2Logger, ImporterEnvironment, In, InstanceHandle, Instantiation, Out, Sink, StateHandle, TextArgument,
    guard, instantiate, refuse_instantiation, release, state,
};
use crate::location;
use crate::shared::{accessors, shared_functions};
use crate::slave::order::fmi2 as order;
use crate::slave::{Dialect, ExperimentTimes, FmiStatus, Refusal, Slave};

/// `fmi2CallbackFunctions`. Memory functions and `stepFinished` are never called.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CallbackFunctions {
    logger: Option<Fmi2Logger>,
    allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> ImporterEnvironment>,
    free_memory: Option<unsafe extern "C" fn(ImporterEnvironment)>,
    step_finished: Option<unsafe extern "C" fn(ImporterEnvironment, FmiStatus)>,
    component_environment: ImporterEnvironment,
}

/// `fmi2CoSimulation` of `fmi2Type`.
const CO_SIMULATION: i32 = 1;

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Implements `fmi2Instantiate` of a library with a unit created by `load`. The library exports it, see
/// [`crate::library`].
pub fn instantiate_unit(
    load: Load,
    instanceName: TextArgument,
    fmuType: i32,
    fmuGUID: TextArgument,
    fmuResourceLocation: TextArgument,
    functions: In<CallbackFunctions>,
    loggingOn: Boolean,
) -> InstanceHandle {
    let function = "fmi2Instantiate";
    let name = instanceName.read("instanceName").ok().flatten().unwrap_or_default();
    let callbacks = functions.single().copied();
    let sink = Sink::Fmi2 {
        logger: callbacks.and_then(|functions| functions.logger),
        environment: callbacks.map_or(std::ptr::null_mut(), |functions| functions.component_environment),
        name: CString::new(name).unwrap_or_default(),
    };
    if fmuType != CO_SIMULATION {
        let reason =
            format!("fmuType = {fmuType}, but this FMU supports Co-Simulation only. Pass fmi2CoSimulation (1)");
        return refuse_instantiation(sink, function, &reason);
    }
    instantiate(Instantiation {
        dialect: Dialect::Fmi2,
        load,
        function,
        name: instanceName,
        token: fmuGUID,
        location: fmuResourceLocation,
        locate: location::from_uri,
        sink,
        logging_on: loggingOn != 0,
        callbacks: None,
        check: &|_| Ok(()),
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetupExperiment(
    c: InstanceHandle,
    _toleranceDefined: Boolean,
    _tolerance: f64,
    startTime: f64,
    stopTimeDefined: Boolean,
    stopTime: f64,
) -> FmiStatus {
    guard(c, &order::SETUP_EXPERIMENT, |slave| {
        let experiment = ExperimentTimes::new(startTime, (stopTimeDefined != 0).then_some(stopTime))?;
        slave.set_experiment(experiment);
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2EnterInitializationMode(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::ENTER_INITIALIZATION_MODE, |slave| {
        slave.enter_initialisation(None);
        Ok(())
    })
}

shared_functions! {
    Boolean; fmi2SetDebugLogging fmi2FreeInstance fmi2ExitInitializationMode fmi2Terminate fmi2Reset
    fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate
    fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate
}

accessors! {
    [] fmi2GetString fmi2SetString "value";
    fmi2GetReal fmi2SetReal "Real" f64, f64, |value| value, |value| *value;
    fmi2GetInteger fmi2SetInteger "Integer" i32, i32, |value| value, |value| *value;
    fmi2GetBoolean fmi2SetBoolean "Boolean" Boolean, bool, Boolean::from, |value| *value != 0;
}

/// Implements `fmi2CancelStep`: there is never an asynchronous step.
#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2CancelStep(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::CANCEL_STEP, |_| {
        Err::<(), _>(Refusal::error("no step is pending: steps of this FMU are never asynchronous"))
    })
}
