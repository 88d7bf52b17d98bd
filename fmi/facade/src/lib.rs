//! The C ABIs of FMI 2.0 (44 functions) and FMI 3.0 (75 functions) over one version-independent slave, for any
//! [`CoSimulation`].
//!
//! ```text
//! fmi2/  fmi3/     one expression per exported function, no unsafe block; shared.rs defines functions of both versions
//!      \  /
//!    boundary/     the only unsafe code: pointers to slices and back, callbacks, the guard around every call
//!       |
//!     slave/       safe: phase of life, call order, variable access, stepping, saved states
//!       |
//!  CoSimulation    what a simulation offers to be driven so
//! ```
//!
//! A shared library is a crate that calls [`library`] with the function that loads its unit. That crate exports the functions of the standards: all of them are defined here except the two that create an
//! instance, because only these depend on the unit. Several such libraries can be loaded in one process without
//! interfering.
//!
//! Invariants, stated as absences: no unsafe code outside `boundary` (except the `no_mangle` attributes of the
//! façades), no global mutable state (except the silent panic hook of this library's copy of the standard library, and the
//! place of its last panic), no threads of its own, no output, no panic across the ABI, no value returned by a call that did not succeed.
#![warn(unreachable_pub)]
#![deny(unsafe_op_in_unsafe_fn)]

mod boundary;
mod fmi2;
mod fmi3;
#[forbid(unsafe_code)]
mod location;
mod shared;
#[forbid(unsafe_code)]
mod slave;

use std::path::Path;

use tiprub_cosim::{CoSimulation, Diagnostic, Result};

/// Content of the resources of an FMU.
pub struct Loaded {
    /// Creates the unit, with start values set and nothing computed. Called after the token has been checked.
    pub unit: Box<dyn FnOnce() -> Result<Box<dyn CoSimulation>>>,
    /// Instantiation token that belongs to the resources.
    pub token: String,
    /// True if the FMI 3.0 description has arrays, otherwise scalars as in FMI 2.0.
    pub fmi3_arrays: bool,
    /// Name and version of the library for messages; a program that packages the library searches its bytes for this
    /// text.
    pub release: &'static str,
}

/// Reads the unit of a library from the unpacked directory `resources/`.
pub type Load = fn(&Path) -> Result<Loaded, Diagnostic>;

/// Types of the two functions that a library exports itself, for [`library`] alone.
#[doc(hidden)]
pub mod abi {
    pub use crate::boundary::{
        Fmi2Logger, Fmi3Logger, ImporterEnvironment, In, InstanceHandle, IntermediateUpdate, TextArgument,
    };
    pub use crate::fmi2::Boolean as Boolean2;
    pub use crate::fmi2::common::{CallbackFunctions, instantiate_unit as fmi2_instantiate};
    pub use crate::fmi3::Boolean as Boolean3;
    pub use crate::fmi3::common::instantiate_unit as fmi3_instantiate;
    pub use crate::slave::FmiStatus;
}

/// Makes the crate an FMI library: exports the functions that create an instance with a function of type [`Load`].
#[macro_export]
macro_rules! library {
    ($load:expr) => {
        #[unsafe(no_mangle)]
        #[allow(non_snake_case, clippy::too_many_arguments, reason = "the standard's")]
        extern "C" fn fmi2Instantiate(
            instanceName: $crate::abi::TextArgument,
            fmuType: i32,
            fmuGUID: $crate::abi::TextArgument,
            fmuResourceLocation: $crate::abi::TextArgument,
            functions: $crate::abi::In<$crate::abi::CallbackFunctions>,
            _visible: $crate::abi::Boolean2,
            loggingOn: $crate::abi::Boolean2,
        ) -> $crate::abi::InstanceHandle {
            $crate::abi::fmi2_instantiate(
                $load,
                instanceName,
                fmuType,
                fmuGUID,
                fmuResourceLocation,
                functions,
                loggingOn,
            )
        }

        #[unsafe(no_mangle)]
        #[allow(non_snake_case, clippy::too_many_arguments, reason = "the standard's")]
        extern "C" fn fmi3InstantiateCoSimulation(
            instanceName: $crate::abi::TextArgument,
            instantiationToken: $crate::abi::TextArgument,
            resourcePath: $crate::abi::TextArgument,
            _visible: $crate::abi::Boolean3,
            loggingOn: $crate::abi::Boolean3,
            eventModeUsed: $crate::abi::Boolean3,
            earlyReturnAllowed: $crate::abi::Boolean3,
            requiredIntermediateVariables: $crate::abi::In<u32>,
            nRequiredIntermediateVariables: usize,
            instanceEnvironment: $crate::abi::ImporterEnvironment,
            logMessage: Option<$crate::abi::Fmi3Logger>,
            intermediateUpdate: Option<$crate::abi::IntermediateUpdate>,
        ) -> $crate::abi::InstanceHandle {
            $crate::abi::fmi3_instantiate(
                $load,
                instanceName,
                instantiationToken,
                resourcePath,
                loggingOn,
                eventModeUsed,
                earlyReturnAllowed,
                requiredIntermediateVariables,
                nRequiredIntermediateVariables,
                instanceEnvironment,
                logMessage,
                intermediateUpdate,
            )
        }
    };
}
