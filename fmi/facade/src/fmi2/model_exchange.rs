//! Functions for Model Exchange: exported because importers look all of them up, rejected because this FMU does not
//! support it.

use super::Boolean;
use crate::boundary::{In, Out, refused};

const CAPABILITY: &str = "Model Exchange interface";

/// `fmi2EventInfo`, which is never accessed.
#[repr(C)]
pub(crate) struct EventInfo {
    _private: [u8; 0],
}

refused! {
    fmi2EnterEventMode() CAPABILITY;
    fmi2NewDiscreteStates(_fmi2eventInfo: Out<EventInfo>) CAPABILITY;
    fmi2EnterContinuousTimeMode() CAPABILITY;
    fmi2CompletedIntegratorStep(
        _noSetFMUStatePriorToCurrentPoint: Boolean, _enterEventMode: Out<Boolean>, _terminateSimulation: Out<Boolean>
    ) CAPABILITY;
    fmi2SetTime(_time: f64) CAPABILITY;
    fmi2SetContinuousStates(_x: In<f64>, _nx: usize) CAPABILITY;
    fmi2GetDerivatives(_derivatives: Out<f64>, _nx: usize) CAPABILITY;
    fmi2GetEventIndicators(_eventIndicators: Out<f64>, _ni: usize) CAPABILITY;
    fmi2GetContinuousStates(_x: Out<f64>, _nx: usize) CAPABILITY;
    fmi2GetNominalsOfContinuousStates(_x_nominal: Out<f64>, _nx: usize) CAPABILITY;
}
