//! The C ABIs of FMI 2.0 (44 functions) and FMI 3.0 (75 functions) over one version-independent slave, for any
//! [`CoSimulationUnit`].
//!
//! ```text
//! fmi2/  fmi3/     one expression per exported function, no unsafe block
//!      \  /
//!    boundary/     the only unsafe code: pointers to slices and back, callbacks, the guard around every call
//!       |
//!     slave/       safe: phase of life, call order, variable access, stepping, saved states
//!       |
//!     unit         what a simulation offers to be driven so
//! ```
//!
//! A shared library is a crate that implements [`CoSimulationUnit`] and calls [`library`] with the function that loads
//! it. That crate exports the functions of the standards: all of them are defined here except the two that create an
//! instance, because only these depend on the unit. Several such libraries can be loaded in one process without
//! interfering.
//!
//! Invariants, stated as absences: no unsafe code outside `boundary` (except the `no_mangle` attributes of the
//! façades), no global mutable state (except the silent panic hook of this library's copy of the standard library), no
//! threads, no output, no panic across the ABI, no value returned by a call that did not succeed.
#![warn(unreachable_pub)]
#![deny(unsafe_op_in_unsafe_fn)]

mod boundary;
mod fmi2;
mod fmi3;
#[forbid(unsafe_code)]
mod location;
#[forbid(unsafe_code)]
mod slave;
#[forbid(unsafe_code)]
mod unit;

pub use unit::{CoSimulationUnit, Load, Loaded};

/// Types of the two functions that a library exports itself, for [`library`] alone.
#[doc(hidden)]
pub mod abi {
    pub use tiprub_core::{Result, VariableTable, simulation::StepProgress};

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

/// Implements the methods of [`CoSimulationUnit`] that a simulation `self.0` has under the same names, which are all
/// methods that do not differ between units. `$courses` is the type of its inputs over time.
#[macro_export]
macro_rules! delegate {
    ($courses:ty) => {
        fn table(&self) -> &$crate::abi::VariableTable {
            self.0.table()
        }

        fn real(&self, reference: u32) -> $crate::abi::Result<f64> {
            self.0.real(reference)
        }

        fn integer(&self, reference: u32) -> $crate::abi::Result<i32> {
            self.0.integer(reference)
        }

        fn boolean(&self, reference: u32) -> $crate::abi::Result<bool> {
            self.0.boolean(reference)
        }

        fn string(&self, reference: u32) -> $crate::abi::Result<&str> {
            self.0.string(reference)
        }

        fn set_real(&mut self, reference: u32, value: f64) -> $crate::abi::Result<()> {
            self.0.set_real(reference, value)
        }

        fn set_integer(&mut self, reference: u32, value: i32) -> $crate::abi::Result<()> {
            self.0.set_integer(reference, value)
        }

        fn set_boolean(&mut self, reference: u32, value: bool) -> $crate::abi::Result<()> {
            self.0.set_boolean(reference, value)
        }

        fn set_string(&mut self, reference: u32, value: &str) -> $crate::abi::Result<()> {
            self.0.set_string(reference, value)
        }

        fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> $crate::abi::Result<()> {
            self.0.set_input_derivative(reference, order, value)
        }

        fn output_derivative(&self, reference: u32, order: i32) -> $crate::abi::Result<f64> {
            self.0.output_derivative(reference, order)
        }

        fn courses(&self) -> Box<dyn std::any::Any> {
            Box::new(self.0.courses())
        }

        fn restore_courses(&mut self, courses: Box<dyn std::any::Any>) {
            if let Ok(courses) = courses.downcast::<$courses>() {
                self.0.restore_courses(*courses);
            }
        }

        fn initialise(&mut self, start_time: f64) -> $crate::abi::Result<()> {
            self.0.initialise(start_time)
        }

        fn reset(&mut self) {
            self.0.reset();
        }

        fn time(&self) -> f64 {
            self.0.time()
        }

        fn advance(&mut self) -> $crate::abi::Result<$crate::abi::StepProgress> {
            self.0.advance()
        }

        fn is_stepping(&self) -> bool {
            self.0.is_stepping()
        }

        fn state_size(&self) -> usize {
            self.0.state_size()
        }

        fn save_state(&self, buffer: &mut [u8]) -> $crate::abi::Result<()> {
            self.0.save_state(buffer)
        }

        fn restore_state(&mut self, buffer: &[u8]) -> $crate::abi::Result<()> {
            self.0.restore_state(buffer)
        }

        fn step_derivative(
            &mut self,
            outputs: &[u32],
            inputs: &[u32],
            seed: &[f64],
            sensitivity: &mut [f64],
        ) -> $crate::abi::Result<()> {
            self.0.step_derivative(outputs, inputs, seed, sensitivity)
        }
    };
}
