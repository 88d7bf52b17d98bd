//! `fmi3DoStep` with intermediate updates, and output derivatives.
//!
//! With a callback the communication step is computed one internal step at a time, each in a separate call of the
//! guard. While the callback runs, the instance is not borrowed, so the callback may get and set variables.
//!
//! If the maximum number of internal steps is reached, the step returns early if the importer allows it, otherwise it
//! is discarded.

use tiprub_cosim::StepProgress;

use super::Boolean;
use crate::boundary::{Callbacks, In, InstanceHandle, IntermediateUpdate, Out, enter, guard, intermediate_update};
use crate::slave::order::fmi3 as order;
use crate::slave::{AccessRequest, FmiStatus, Refusal, Result, Slave};

/// End of a step.
struct StepOutcome {
    status: FmiStatus,
    early: bool,
    time: Option<f64>,
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3DoStep(
    instance: InstanceHandle,
    currentCommunicationPoint: f64,
    communicationStepSize: f64,
    _noSetFMUStatePriorToCurrentPoint: Boolean,
    eventHandlingNeeded: Out<Boolean>,
    terminateSimulation: Out<Boolean>,
    earlyReturn: Out<Boolean>,
    lastSuccessfulTime: Out<f64>,
) -> FmiStatus {
    let names = ["eventHandlingNeeded", "terminateSimulation", "earlyReturn", "lastSuccessfulTime"];
    let absent = [
        eventHandlingNeeded.is_null(),
        terminateSimulation.is_null(),
        earlyReturn.is_null(),
        lastSuccessfulTime.is_null(),
    ];
    let missing = absent.iter().position(|absent| *absent).map(|index| names[index]);
    let outcome = step(instance, currentCommunicationPoint, communicationStepSize, missing);
    eventHandlingNeeded.offer(0);
    terminateSimulation.offer(0);
    earlyReturn.offer(Boolean::from(outcome.early));
    lastSuccessfulTime.offer(outcome.time.unwrap_or(currentCommunicationPoint));
    outcome.status
}

fn step(instance: InstanceHandle, current: f64, size: f64, missing: Option<&str>) -> StepOutcome {
    let mut before = None;
    let (status, begun) = enter(instance, &order::DO_STEP, |slave, instance| {
        before = Some(slave.time());
        if let Some(name) = missing {
            return Err(Refusal::error(format!("argument {name} is NULL. Pass a pointer to a variable for it")));
        }
        slave.begin_step(current, size, instance.callbacks.is_some_and(|callbacks| callbacks.early_return_allowed))?;
        let Some(callbacks @ Callbacks { update: Some(update), .. }) = instance.callbacks else {
            return Ok((FmiStatus::Ok, (None, slave.finish_step()?, slave.time())));
        };
        Ok((FmiStatus::Ok, (Some((callbacks, update)), false, slave.time())))
    });
    match begun {
        Some((Some((callbacks, update)), _, start)) => march(instance, callbacks, update, start),
        Some((None, early, time)) => StepOutcome { status, early, time: Some(time) },
        None => StepOutcome { status, early: false, time: before },
    }
}

/// Decides how to continue after an internal step.
fn settle(slave: &mut Slave, progress: StepProgress, return_at: Option<f64>) -> Result<bool> {
    let early = !progress.finished && return_at.is_some_and(|time| progress.time >= time);
    if progress.finished || early {
        slave.end_step(early)?;
    }
    Ok(early)
}

fn march(instance: InstanceHandle, callbacks: Callbacks, update: IntermediateUpdate, start: f64) -> StepOutcome {
    let mut return_at: Option<f64> = None;
    let mut worst = FmiStatus::Ok;
    loop {
        let (status, advanced) = enter(instance, &order::CONTINUE_STEP, |slave, _| {
            let progress = slave.advance_partially()?;
            Ok((FmiStatus::Ok, (progress, slave.time())))
        });
        let progress = match advanced {
            None => return StepOutcome { status, early: false, time: Some(start) },
            Some((None, time)) => return StepOutcome { status: worst.max(status), early: true, time: Some(time) },
            Some((Some(progress), _)) => progress,
        };
        let may_return = callbacks.early_return_allowed && !progress.finished;
        let request = intermediate_update(update, callbacks.environment, progress.time, !progress.finished, may_return);
        let (status, settled) = enter(instance, &order::CONTINUE_STEP, |slave, _| {
            let mut status = FmiStatus::Ok;
            match request {
                Some(time) if may_return => return_at = Some(time),
                Some(_) if !progress.finished => {
                    slave.note(
                        FmiStatus::Warning,
                        "early return requested, but earlyReturnAllowed was false at instantiation",
                    );
                    status = FmiStatus::Warning;
                }
                _ => {}
            }
            let early = settle(slave, progress, return_at)?;
            Ok((status, (early, slave.time())))
        });
        worst = worst.max(status);
        match settled {
            None => return StepOutcome { status, early: false, time: Some(start) },
            Some((early, time)) if early || progress.finished => {
                return StepOutcome { status: worst, early, time: Some(time) };
            }
            Some(_) => {}
        }
    }
}

#[unsafe(no_mangle)]
pub(super) extern "C" fn fmi3GetOutputDerivatives(
    instance: InstanceHandle,
    valueReferences: In<u32>,
    nValueReferences: usize,
    orders: In<i32>,
    values: Out<f64>,
    nValues: usize,
) -> FmiStatus {
    guard(instance, &order::GET_OUTPUT_DERIVATIVES, |slave| {
        let limit = slave.reference_limit();
        let references = valueReferences.array(nValueReferences, limit, "valueReferences")?;
        let orders = orders.array(nValueReferences, limit, "orders")?;
        let window = values.window(nValues, "values")?;
        let elements = slave.elements(&AccessRequest { type_name: "Float64", references, values: nValues })?;
        let orders = slave.orders_of_elements(references, orders);
        slave.output_derivatives(&elements, &orders).map(|values| window.fill(&values))
    })
}
