//! Functions common to Model Exchange and Co-Simulation.

use std::ffi::{CString, c_char};

use super::Boolean;
use crate::boundary::{
    self, Environment, Fmi2Logger, Handle, In, Instantiation, Out, Sink, StateHandle, Text, guard, instantiate,
    refuse_instantiation, release, state,
};
use crate::location;
use crate::slave::order::fmi2 as order;
use crate::slave::{Dialect, Experiment, Refusal, Status};
use crate::unit::Load;

/// `fmi2CallbackFunctions`. Memory functions and `stepFinished` are never called.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct CallbackFunctions {
    logger: Option<Fmi2Logger>,
    allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> Environment>,
    free_memory: Option<unsafe extern "C" fn(Environment)>,
    step_finished: Option<unsafe extern "C" fn(Environment, Status)>,
    component_environment: Environment,
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
    c: Handle,
    loggingOn: Boolean,
    nCategories: usize,
    categories: In<Text>,
) -> Status {
    boundary::set_debug_logging(c, &order::SET_DEBUG_LOGGING, loggingOn != 0, (categories, nCategories))
}

/// `fmi2Instantiate` of a library: makes its unit by `load`. The library exports it, see [`crate::library`].
pub fn instantiate_unit(
    load: Load,
    instanceName: Text,
    fmuType: i32,
    fmuGUID: Text,
    fmuResourceLocation: Text,
    functions: In<CallbackFunctions>,
    loggingOn: Boolean,
) -> Handle {
    let function = "fmi2Instantiate";
    let name = instanceName.read("instanceName").ok().flatten().unwrap_or_default();
    let callbacks = functions.single().copied();
    let sink = Sink::Fmi2 {
        logger: callbacks.and_then(|functions| functions.logger),
        environment: callbacks.map_or(std::ptr::null_mut(), |functions| functions.component_environment),
        name: CString::new(name).unwrap_or_default(),
    };
    if fmuType != CO_SIMULATION {
        let reason = format!("fmuType = {fmuType}, but this FMU is for Co-Simulation only. Pass fmi2CoSimulation (1)");
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
pub(super) extern "C" fn fmi2FreeInstance(c: Handle) {
    release(c, &order::FREE_INSTANCE);
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetupExperiment(
    c: Handle,
    _toleranceDefined: Boolean,
    _tolerance: f64,
    startTime: f64,
    stopTimeDefined: Boolean,
    stopTime: f64,
) -> Status {
    guard(c, &order::SETUP_EXPERIMENT, |slave| {
        slave.set_experiment(Experiment::new(startTime, (stopTimeDefined != 0).then_some(stopTime))?);
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2EnterInitializationMode(c: Handle) -> Status {
    guard(c, &order::ENTER_INITIALIZATION_MODE, |slave| {
        slave.enter_initialisation(None);
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2ExitInitializationMode(c: Handle) -> Status {
    guard(c, &order::EXIT_INITIALIZATION_MODE, |slave| slave.exit_initialisation())
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2Terminate(c: Handle) -> Status {
    guard(c, &order::TERMINATE, |slave| {
        slave.terminate();
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2Reset(c: Handle) -> Status {
    guard(c, &order::RESET, |slave| {
        slave.reset();
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetReal(c: Handle, vr: In<u32>, nvr: usize, value: Out<f64>) -> Status {
    boundary::get((c, &order::GET_REAL, "Real"), (vr, nvr), (value, nvr), |value: f64| value)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetInteger(c: Handle, vr: In<u32>, nvr: usize, value: Out<i32>) -> Status {
    boundary::get((c, &order::GET_INTEGER, "Integer"), (vr, nvr), (value, nvr), |value: i32| value)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetBoolean(c: Handle, vr: In<u32>, nvr: usize, value: Out<Boolean>) -> Status {
    boundary::get((c, &order::GET_BOOLEAN, "Boolean"), (vr, nvr), (value, nvr), |value: bool| Boolean::from(value))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetString(c: Handle, vr: In<u32>, nvr: usize, value: Out<*const c_char>) -> Status {
    boundary::strings((c, &order::GET_STRING), (vr, nvr), (value, nvr))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetReal(c: Handle, vr: In<u32>, nvr: usize, value: In<f64>) -> Status {
    boundary::set((c, &order::SET_REAL, "Real"), (vr, nvr), (value, nvr), |value: &f64| Ok(*value))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetInteger(c: Handle, vr: In<u32>, nvr: usize, value: In<i32>) -> Status {
    boundary::set((c, &order::SET_INTEGER, "Integer"), (vr, nvr), (value, nvr), |value: &i32| Ok(*value))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetBoolean(c: Handle, vr: In<u32>, nvr: usize, value: In<Boolean>) -> Status {
    boundary::set((c, &order::SET_BOOLEAN, "Boolean"), (vr, nvr), (value, nvr), |value: &Boolean| Ok(*value != 0))
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetString(c: Handle, vr: In<u32>, nvr: usize, value: In<Text>) -> Status {
    boundary::set((c, &order::SET_STRING, "String"), (vr, nvr), (value, nvr), |value: &Text| {
        value.required("value").map(str::to_owned)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetFMUstate(c: Handle, FMUstate: Out<StateHandle>) -> Status {
    state::save(c, &order::GET_FMU_STATE, FMUstate)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetFMUstate(c: Handle, FMUstate: StateHandle) -> Status {
    state::restore(c, &order::SET_FMU_STATE, FMUstate)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2FreeFMUstate(c: Handle, FMUstate: Out<StateHandle>) -> Status {
    state::free(c, &order::FREE_FMU_STATE, FMUstate)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SerializedFMUstateSize(c: Handle, FMUstate: StateHandle, size: Out<usize>) -> Status {
    state::size(c, &order::SERIALIZED_FMU_STATE_SIZE, FMUstate, size)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SerializeFMUstate(
    c: Handle,
    FMUstate: StateHandle,
    serializedState: Out<u8>,
    size: usize,
) -> Status {
    state::serialise(c, &order::SERIALIZE_FMU_STATE, FMUstate, serializedState, size)
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2DeSerializeFMUstate(
    c: Handle,
    serializedState: In<u8>,
    size: usize,
    FMUstate: Out<StateHandle>,
) -> Status {
    state::deserialise(c, &order::DESERIALIZE_FMU_STATE, serializedState, size, FMUstate)
}

/// Answer of `fmi2CancelStep`: there is never an asynchronous step.
#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2CancelStep(c: Handle) -> Status {
    guard(c, &order::CANCEL_STEP, |_| {
        Err(Refusal::error("no step is pending: steps of this FMU are never asynchronous"))
    })
}
