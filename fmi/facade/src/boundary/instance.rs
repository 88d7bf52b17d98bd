//! Instances as the importer holds them, and the guard around every call to one.

use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Mutex, TryLockError};

use tiprub_cosim::shown_time;

use super::float_environment::StandardFloats;
use super::log::{Log, Sink};
use super::{ImporterEnvironment, IntermediateUpdate, TextArgument, panics};
use crate::Load;
use crate::slave::order::{self, CallRule};
use crate::slave::{Dialect, FmiStatus, InstancePhase, Refusal, Result, Slave};

/// Callbacks and flags of FMI 3.0 for stepping.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Callbacks {
    /// `intermediateUpdate`, may be NULL.
    pub update: Option<IntermediateUpdate>,
    /// `earlyReturnAllowed`.
    pub early_return_allowed: bool,
    /// `instanceEnvironment`.
    pub environment: ImporterEnvironment,
}

/// Target of a handle. The mutex costs about twenty nanoseconds per call and settles two cases that the standard leaves
/// open: a call to an instance that another thread is using is rejected, and a panic inside the slave poisons the
/// instance permanently.
pub(crate) struct Instance {
    dialect: Dialect,
    slave: Mutex<Slave>,
    /// Messages are sent after the lock is released, so that a logger may call functions of the instance.
    pub(super) log: Log,
    /// Set at instantiation.
    pub callbacks: Option<Callbacks>,
}

/// `fmi2Component`, `fmi3Instance`: NULL, or a pointer that `instantiate` returned and `release` has not yet freed.
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub struct InstanceHandle(*mut Instance);

impl InstanceHandle {
    const NULL: Self = Self(std::ptr::null_mut());

    fn instance(&self) -> Option<&Instance> {
        // SAFETY: null is handled by `as_ref`; otherwise the importer passes a pointer that `instantiate` returned and
        // `release` has not freed (the contract of both standards). Only shared borrows of an instance are ever
        // created, so that calls from callbacks are sound; the mutex inside gives exclusive access to the slave.
        unsafe { Some(self.0).filter(|pointer| pointer.is_aligned())?.as_ref() }
    }
}

/// Arguments of the instantiation functions.
pub(crate) struct Instantiation<'a> {
    /// Version of the standard, which determines how the location is read.
    pub dialect: Dialect,
    /// Name of the exported function, for messages.
    pub function: &'static str,
    /// `instanceName`.
    pub name: TextArgument,
    /// `fmuGUID`, `instantiationToken`.
    pub token: TextArgument,
    /// `fmuResourceLocation`, `resourcePath`.
    pub location: TextArgument,
    /// Loads the unit.
    pub load: Load,
    /// Reads the location.
    pub locate: fn(&str) -> Result<PathBuf, String>,
    /// Destination of messages.
    pub sink: Sink,
    /// `loggingOn`.
    pub logging_on: bool,
    /// FMI 3.0 only.
    pub callbacks: Option<Callbacks>,
    /// Further checks of this version of the standard.
    pub check: &'a dyn Fn(&Slave) -> Result<()>,
}

/// Creates an instance; returns NULL with a message if that is not possible.
pub(crate) fn instantiate(request: Instantiation<'_>) -> InstanceHandle {
    panics::silence();
    let function = request.function;
    let log = Log::new(request.sink, request.logging_on);
    let built = catch_unwind(AssertUnwindSafe(|| {
        let _floats = StandardFloats::enter();
        let name = request.name.required("instanceName")?;
        if name.trim().is_empty() {
            return Err(Refusal::error("instanceName is empty. Pass a name with at least one visible character"));
        }
        let (token, location) = match request.dialect {
            Dialect::Fmi2 => ("fmuGUID", "fmuResourceLocation"),
            Dialect::Fmi3 => ("instantiationToken", "resourcePath"),
        };
        let token = request.token.required(token)?;
        let unlocated = || {
            format!(
                "{location} is NULL, but this FMU reads its model from there. Pass the location of the unpacked \
                 resources"
            )
        };
        let location = request.location.read(location)?.ok_or_else(|| Refusal::error(unlocated()))?;
        let directory = (request.locate)(location).map_err(Refusal::error)?;
        let slave = Slave::new(request.dialect, &directory, token, request.load)?;
        (request.check)(&slave)?;
        Ok(slave)
    }));
    match built.unwrap_or_else(|payload| Err(Refusal::error(panics::describe(&*payload)))) {
        Ok(slave) => {
            log.emit(FmiStatus::Ok, &format!("{function}: instantiated from its resources, waiting for start values"));
            let instance =
                Instance { dialect: request.dialect, slave: Mutex::new(slave), log, callbacks: request.callbacks };
            InstanceHandle(Box::into_raw(Box::new(instance)))
        }
        Err(refusal) => {
            log.emit(FmiStatus::Error, &format!("{function}: {refusal}"));
            InstanceHandle::NULL
        }
    }
}

/// Rejects an instantiation; the message is sent to the importer.
pub(crate) fn refuse_instantiation(sink: Sink, function: &str, reason: &str) -> InstanceHandle {
    Log::new(sink, false).emit(FmiStatus::Error, &format!("{function}: {reason}"));
    InstanceHandle::NULL
}

/// Frees an instance. NULL is legal. A call from within an intermediate update is rejected, because the step in
/// progress needs the instance.
pub(crate) fn release(handle: InstanceHandle, rule: &CallRule) {
    let Some(instance) = handle.instance() else { return };
    if instance.dialect != rule.dialect() {
        return instance.log.emit(FmiStatus::Error, &format!("{}: {}", rule.name, other_version(instance)));
    }
    let under_way = match instance.slave.try_lock() {
        Ok(slave) => matches!(slave.phase(), InstancePhase::Updating { .. }),
        Err(TryLockError::Poisoned(_)) => false,
        Err(TryLockError::WouldBlock) => true,
    };
    if under_way {
        let message = "the instance is not freed because a step is in progress. Free it after the step has returned";
        return instance.log.emit(FmiStatus::Error, &format!("{}: {message}", rule.name));
    }
    // SAFETY: the handle came from `Box::into_raw` in `instantiate`, and by the contract of both standards this is its
    // last use; no borrow is alive, because the shared one above is no longer used and no call is in progress.
    let instance = unsafe { Box::from_raw(handle.0) };
    // A panicking destructor must not reach the importer; there is no state to save any more.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(instance)));
}

fn other_version(instance: &Instance) -> String {
    format!("the instance was created by the functions of {:?}. Call the functions of that version", instance.dialect)
}

/// Runs a call to an instance behind the guard, which every call passes. It checks that the instance exists and is not
/// faulted and that the call is allowed now; it saves the caller's floating-point environment (callbacks run with it
/// again), catches panics, sends messages to the importer and returns the status. `None` if the call was not carried
/// out.
pub(crate) fn enter<T>(
    handle: InstanceHandle,
    rule: &CallRule,
    action: impl FnOnce(&mut Slave, &Instance) -> Result<(FmiStatus, T)>,
) -> (FmiStatus, Option<T>) {
    let Some(instance) = handle.instance() else { return (FmiStatus::Error, None) };
    let call = catch_unwind(AssertUnwindSafe(|| {
        let _floats = StandardFloats::enter();
        let mut slave = instance.slave.try_lock().map_err(|error| {
            Refusal::error(match error {
                TryLockError::Poisoned(_) => "the instance is unusable after an internal error. Free it",
                TryLockError::WouldBlock => {
                    "another call on this instance is in progress. Use an instance from one thread only"
                }
            })
        })?;
        if instance.dialect != rule.dialect() {
            return Err(Refusal::error(other_version(instance)));
        }
        let outcome = rule.check(slave.phase()).and_then(|()| action(&mut slave, instance));
        Ok((outcome, slave.take_notes(), slave.time()))
    }));
    let (outcome, notes, time) = match call {
        Ok(Ok((outcome, notes, time))) => (outcome, notes, Some(time)),
        Ok(Err(refusal)) => (Err(refusal), Vec::new(), None),
        Err(payload) => (Err(Refusal::error(panics::describe(&*payload))), Vec::new(), None),
    };
    // Calls without a message allocate nothing. The text is formatted in the standard environment, because formatting
    // is arithmetic too; the callback runs in the caller's.
    let emit = |status, message: &dyn Display| {
        let text = {
            let _floats = StandardFloats::enter();
            let at = time.map_or(String::new(), |time| format!(" (t = {} s)", shown_time(time)));
            format!("{}{at}: {message}", rule.name)
        };
        instance.log.emit(status, &text);
    };
    notes.iter().for_each(|(status, message)| emit(*status, message));
    match outcome {
        Ok((status, value)) => (status, Some(value)),
        Err(refusal) => {
            emit(refusal.status, &refusal);
            (refusal.status, None)
        }
    }
}

/// Runs a call whose only result is its status, by default `Ok`, behind the guard.
pub(crate) fn guard<S: Into<FmiStatus>>(
    handle: InstanceHandle,
    rule: &CallRule,
    action: impl FnOnce(&mut Slave) -> Result<S>,
) -> FmiStatus {
    enter(handle, rule, |slave, _| Ok((action(slave)?.into(), ()))).0
}

/// Returns the status of a function whose capability this FMU does not have.
pub(crate) fn unsupported(handle: InstanceHandle, name: &'static str, capability: &str) -> FmiStatus {
    guard(handle, &order::unsupported(name), |_| {
        Err::<(), _>(Refusal::error(format!(
            "this FMU has no {capability} (see its modelDescription.xml). Do not call this function"
        )))
    })
}
