//! Functions for Model Exchange: exported because importers look all of them up, refused because this FMU has none.

use super::Boolean;
use crate::boundary::{Handle, In, Out, unsupported};
use crate::slave::Status;

const CAPABILITY: &str = "Model Exchange interface";

/// `fmi2EventInfo`.
#[repr(C)]
#[derive(Clone, Copy)]
pub(crate) struct EventInfo {
    new_discrete_states_needed: Boolean,
    terminate_simulation: Boolean,
    nominals_of_continuous_states_changed: Boolean,
    values_of_continuous_states_changed: Boolean,
    next_event_time_defined: Boolean,
    next_event_time: f64,
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterEventMode(c: Handle) -> Status {
    unsupported(c, "fmi2EnterEventMode", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2NewDiscreteStates(c: Handle, _fmi2eventInfo: Out<EventInfo>) -> Status {
    unsupported(c, "fmi2NewDiscreteStates", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterContinuousTimeMode(c: Handle) -> Status {
    unsupported(c, "fmi2EnterContinuousTimeMode", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2CompletedIntegratorStep(
    c: Handle,
    _noSetFMUStatePriorToCurrentPoint: Boolean,
    _enterEventMode: Out<Boolean>,
    _terminateSimulation: Out<Boolean>,
) -> Status {
    unsupported(c, "fmi2CompletedIntegratorStep", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetTime(c: Handle, _time: f64) -> Status {
    unsupported(c, "fmi2SetTime", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetContinuousStates(c: Handle, _x: In<f64>, _nx: usize) -> Status {
    unsupported(c, "fmi2SetContinuousStates", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetDerivatives(c: Handle, _derivatives: Out<f64>, _nx: usize) -> Status {
    unsupported(c, "fmi2GetDerivatives", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetEventIndicators(c: Handle, _eventIndicators: Out<f64>, _ni: usize) -> Status {
    unsupported(c, "fmi2GetEventIndicators", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetContinuousStates(c: Handle, _x: Out<f64>, _nx: usize) -> Status {
    unsupported(c, "fmi2GetContinuousStates", CAPABILITY)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetNominalsOfContinuousStates(c: Handle, _x_nominal: Out<f64>, _nx: usize) -> Status {
    unsupported(c, "fmi2GetNominalsOfContinuousStates", CAPABILITY)
}
