//! Functions common to Model Exchange and Co-Simulation.

use std::ffi::{CString, c_char};

use super::Boolean;
use crate::boundary::{
    self, Fmi2Logger, ImporterEnvironment, In, InstanceHandle, Instantiation, Out, Sink, StateHandle, TextArgument,
    guard, instantiate, refuse_instantiation, release, state,
};
use crate::load::Load;
use crate::location;
use crate::slave::order::fmi2 as order;
use crate::slave::{Dialect, ExperimentTimes, FmiStatus, Refusal};

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

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetDebugLogging(
    c: InstanceHandle,
    loggingOn: Boolean,
    nCategories: usize,
    categories: In<TextArgument>,
) -> FmiStatus {
    boundary::set_debug_logging(c, &order::SET_DEBUG_LOGGING, loggingOn != 0, (categories, nCategories))
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
pub(super) extern "C" fn fmi2FreeInstance(c: InstanceHandle) {
    release(c, &order::FREE_INSTANCE);
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
        slave.set_experiment(ExperimentTimes::new(startTime, (stopTimeDefined != 0).then_some(stopTime))?);
        Ok(FmiStatus::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2EnterInitializationMode(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::ENTER_INITIALIZATION_MODE, |slave| {
        slave.enter_initialisation(None);
        Ok(FmiStatus::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2ExitInitializationMode(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::EXIT_INITIALIZATION_MODE, |slave| slave.exit_initialisation())
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2Terminate(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::TERMINATE, |slave| {
        slave.terminate();
        Ok(FmiStatus::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2Reset(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::RESET, |slave| {
        slave.reset();
        Ok(FmiStatus::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetReal(c: InstanceHandle, vr: In<u32>, nvr: usize, value: Out<f64>) -> FmiStatus {
    boundary::get((c, &order::GET_REAL, "Real"), (vr, nvr), (value, nvr), |value: f64| value)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetInteger(c: InstanceHandle, vr: In<u32>, nvr: usize, value: Out<i32>) -> FmiStatus {
    boundary::get((c, &order::GET_INTEGER, "Integer"), (vr, nvr), (value, nvr), |value: i32| value)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetBoolean(c: InstanceHandle, vr: In<u32>, nvr: usize, value: Out<Boolean>) -> FmiStatus {
    boundary::get((c, &order::GET_BOOLEAN, "Boolean"), (vr, nvr), (value, nvr), |value: bool| Boolean::from(value))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetString(
    c: InstanceHandle,
    vr: In<u32>,
    nvr: usize,
    value: Out<*const c_char>,
) -> FmiStatus {
    boundary::strings((c, &order::GET_STRING), (vr, nvr), (value, nvr))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetReal(c: InstanceHandle, vr: In<u32>, nvr: usize, value: In<f64>) -> FmiStatus {
    boundary::set((c, &order::SET_REAL, "Real"), (vr, nvr), (value, nvr), |value: &f64| Ok(*value))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetInteger(c: InstanceHandle, vr: In<u32>, nvr: usize, value: In<i32>) -> FmiStatus {
    boundary::set((c, &order::SET_INTEGER, "Integer"), (vr, nvr), (value, nvr), |value: &i32| Ok(*value))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetBoolean(c: InstanceHandle, vr: In<u32>, nvr: usize, value: In<Boolean>) -> FmiStatus {
    boundary::set((c, &order::SET_BOOLEAN, "Boolean"), (vr, nvr), (value, nvr), |value: &Boolean| Ok(*value != 0))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetString(
    c: InstanceHandle,
    vr: In<u32>,
    nvr: usize,
    value: In<TextArgument>,
) -> FmiStatus {
    boundary::set((c, &order::SET_STRING, "String"), (vr, nvr), (value, nvr), |value: &TextArgument| {
        value.required("value").map(str::to_owned)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetFMUstate(c: InstanceHandle, FMUstate: Out<StateHandle>) -> FmiStatus {
    state::save(c, &order::GET_FMU_STATE, FMUstate)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetFMUstate(c: InstanceHandle, FMUstate: StateHandle) -> FmiStatus {
    state::restore(c, &order::SET_FMU_STATE, FMUstate)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2FreeFMUstate(c: InstanceHandle, FMUstate: Out<StateHandle>) -> FmiStatus {
    state::free(c, &order::FREE_FMU_STATE, FMUstate)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SerializedFMUstateSize(
    c: InstanceHandle,
    FMUstate: StateHandle,
    size: Out<usize>,
) -> FmiStatus {
    state::size(c, &order::SERIALIZED_FMU_STATE_SIZE, FMUstate, size)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SerializeFMUstate(
    c: InstanceHandle,
    FMUstate: StateHandle,
    serializedState: Out<u8>,
    size: usize,
) -> FmiStatus {
    state::serialise(c, &order::SERIALIZE_FMU_STATE, FMUstate, serializedState, size)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2DeSerializeFMUstate(
    c: InstanceHandle,
    serializedState: In<u8>,
    size: usize,
    FMUstate: Out<StateHandle>,
) -> FmiStatus {
    state::deserialise(c, &order::DESERIALIZE_FMU_STATE, serializedState, size, FMUstate)
}

/// Implements `fmi2CancelStep`: there is never an asynchronous step.
#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2CancelStep(c: InstanceHandle) -> FmiStatus {
    guard(c, &order::CANCEL_STEP, |_| {
        Err(Refusal::error("no step is pending: steps of this FMU are never asynchronous"))
    })
}
