//! Functions for Co-Simulation.

use std::ffi::c_char;

use super::Boolean;
use crate::boundary::{DIRECTIONAL, In, InstanceHandle, Out, derivatives, guard};
use crate::slave::order::fmi2 as order;
use crate::slave::{AccessRequest, FmiStatus, InstancePhase, Refusal, Result, Slave};

/// Kind of `fmi2StatusKind` for the last successful time; this and the next one are the only kinds with information.
const LAST_SUCCESSFUL_TIME: i32 = 2;
/// `fmi2Terminated`.
const TERMINATED: i32 = 3;

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2SetRealInputDerivatives(
    c: InstanceHandle,
    vr: In<u32>,
    nvr: usize,
    order: In<i32>,
    value: In<f64>,
) -> FmiStatus {
    guard(c, &order::SET_REAL_INPUT_DERIVATIVES, |slave| {
        let limit = slave.reference_limit();
        let references = vr.array(nvr, limit, "vr")?;
        let (orders, values) = (order.array(nvr, limit, "order")?, value.array(nvr, limit, "value")?);
        slave.elements(&AccessRequest { type_name: "Real", references, values: nvr })?;
        slave.set_input_derivatives(references, orders, values)
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetRealOutputDerivatives(
    c: InstanceHandle,
    vr: In<u32>,
    nvr: usize,
    order: In<i32>,
    value: Out<f64>,
) -> FmiStatus {
    guard(c, &order::GET_REAL_OUTPUT_DERIVATIVES, |slave| {
        let limit = slave.reference_limit();
        let references = vr.array(nvr, limit, "vr")?;
        let orders = order.array(nvr, limit, "order")?;
        let window = value.window(nvr, "value")?;
        let elements = slave.elements(&AccessRequest { type_name: "Real", references, values: nvr })?;
        slave.output_derivatives(&elements, orders).map(|values| window.fill(&values))
    })
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2DoStep(
    c: InstanceHandle,
    currentCommunicationPoint: f64,
    communicationStepSize: f64,
    _noSetFMUStatePriorToCurrentPoint: Boolean,
) -> FmiStatus {
    guard(c, &order::DO_STEP, |slave| {
        slave.begin_step(currentCommunicationPoint, communicationStepSize, false)?;
        slave.finish_step().map(drop)
    })
}

/// Answers a status request. No step is ever pending, so most status kinds have no information and return `fmi2Discard`
/// (FMI 2.0.4, section 4.2.3).
fn status<T: Copy>(kind: i32, value: &Out<T>, answer: Option<T>) -> Result<()> {
    let window = value.single("value")?;
    let nothing = || {
        Refusal::discard(format!(
            "status kind {kind} is not available: steps of this FMU are never pending. Call fmi2GetRealStatus with \
             fmi2LastSuccessfulTime (2), or fmi2GetBooleanStatus with fmi2Terminated (3)"
        ))
    };
    answer.ok_or_else(nothing).map(|answer| window.fill(&[answer]))
}

/// Returns whether the slave requests the end of the simulation, which it does only after its state became non-finite.
fn wants_to_terminate(slave: &Slave) -> Boolean {
    Boolean::from(matches!(slave.phase(), InstancePhase::Failed { .. }))
}

/// Defines status requests: name, rule, C type of the answer, and the answer to a kind of status.
macro_rules! status_requests {
    ($($function:ident $rule:ident $type:ty, |$slave:ident, $kind:ident| $answer:expr;)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $function(c: InstanceHandle, $kind: i32, value: Out<$type>) -> FmiStatus {
            guard(c, &order::$rule, |$slave| status($kind, &value, $answer))
        }
    )*};
}

status_requests! {
    fmi2GetStatus GET_STATUS i32, |_slave, kind| None;
    fmi2GetRealStatus GET_REAL_STATUS f64, |slave, kind| (kind == LAST_SUCCESSFUL_TIME).then(|| slave.time());
    fmi2GetIntegerStatus GET_INTEGER_STATUS i32, |_slave, kind| None;
    fmi2GetBooleanStatus GET_BOOLEAN_STATUS Boolean, |slave, kind| (kind == TERMINATED).then(|| wants_to_terminate(slave));
    fmi2GetStringStatus GET_STRING_STATUS *const c_char, |_slave, kind| None;
}

/// Derivatives with respect to inputs over the last communication step, which require the parameter `step_derivatives`.
#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi2GetDirectionalDerivative(
    c: InstanceHandle,
    vUnknown_ref: In<u32>,
    nUnknown: usize,
    vKnown_ref: In<u32>,
    nKnown: usize,
    dvKnown: In<f64>,
    dvUnknown: Out<f64>,
) -> FmiStatus {
    derivatives(
        (c, "fmi2GetDirectionalDerivative", DIRECTIONAL),
        (vUnknown_ref, nUnknown, nUnknown, "vUnknown_ref"),
        (vKnown_ref, nKnown, nKnown, "vKnown_ref"),
        (dvKnown, nKnown, "dvKnown"),
        (dvUnknown, nUnknown, "dvUnknown"),
    )
}
