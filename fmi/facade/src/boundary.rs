//! The only unsafe code of the library: conversion of C pointers to Rust values and back, callbacks, and the guard
//! around every call.

mod calls;
mod float_environment;
mod instance;
mod log;
mod panics;
mod pointers;

pub(crate) use calls::{ADJOINT, DIRECTIONAL, StateHandle, derivatives, get, set, set_debug_logging, state, strings};
pub use instance::InstanceHandle;
pub(crate) use instance::{
    Callbacks, Instantiation, enter, guard, instantiate, refuse_instantiation, release, unsupported,
};
pub(crate) use log::Sink;
pub use log::{Fmi2Logger, Fmi3Logger};
pub(crate) use pointers::Out;
pub use pointers::{ImporterEnvironment, In, TextArgument};

/// `fmi3IntermediateUpdateCallback`.
pub type IntermediateUpdate = unsafe extern "C" fn(
    environment: ImporterEnvironment,
    intermediate_update_time: f64,
    set_requested: u8,
    get_allowed: u8,
    step_finished: u8,
    can_return_early: u8,
    early_return_requested: *mut u8,
    early_return_time: *mut f64,
);

/// Calls the importer's intermediate update; returns the time at which the importer requests an early end of the step,
/// if it does.
pub(crate) fn intermediate_update(
    callback: IntermediateUpdate,
    environment: ImporterEnvironment,
    time: f64,
    set_requested: bool,
    can_return_early: bool,
) -> Option<f64> {
    let (mut requested, mut at) = (0u8, time);
    // SAFETY: the importer passed this function at instantiation for exactly this use (FMI 3.0.2, section 4.2.2), the
    // two pointers are to locals that outlive the call, and no borrow of the instance is held, so that the callback may
    // call get and set functions on it.
    unsafe {
        callback(
            environment,
            time,
            u8::from(set_requested),
            1,
            1,
            u8::from(can_return_early),
            &raw mut requested,
            &raw mut at,
        );
    }
    (requested != 0).then_some(at)
}

/// Exported functions with their arguments after the instance, and the capability they require.
macro_rules! refused {
    ($($name:ident ($($argument:ident: $type:ty),*) $capability:expr;)*) => {$(
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn $name(instance: $crate::boundary::InstanceHandle $(, $argument: $type)*) -> $crate::slave::FmiStatus {
            $crate::boundary::unsupported(instance, stringify!($name), $capability)
        }
    )*};
}
pub(crate) use refused;
