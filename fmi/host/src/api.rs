//! All functions of both standards as an importer declares them: names and types from `fmi2FunctionTypes.h` (FMI 2.0.4)
//! and `fmi3FunctionTypes.h` (FMI 3.0.2), written independently of the library's declarations. A boolean that a library
//! writes is read as a byte, because a byte other than 0 or 1 is not a valid `bool`.
#![allow(non_snake_case, reason = "names of the standards")]
#![allow(missing_docs, reason = "the standards document them")]

use std::ffi::{c_char, c_int, c_void};
use std::path::Path;

use libloading::Library;
use tiprub_shell::{Failure, Result};

/// Instance.
pub type InstancePointer = *mut c_void;
/// Saved state.
pub type StatePointer = *mut c_void;
/// Text.
pub(crate) type TextPointer = *const c_char;
/// Value references.
pub(crate) type ReferencePointer = *const u32;

/// Defines structs of function pointers, loaded by name, and the list of the names.
macro_rules! api {
    ($(#[$doc:meta])* $type:ident { $($name:ident($($argument:ty),*) -> $result:ty;)* }) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $type {
            $(pub $name: unsafe extern "C" fn($($argument),*) -> $result,)*
            /// Keeps the library loaded.
            _library: Library,
        }

        impl $type {
            /// Names of all functions.
            pub const NAMES: &[&str] = &[$(stringify!($name)),*];

            /// Loads a library and looks up every function.
            ///
            /// # Errors
            /// A file that is not a library of this platform, or a missing function.
            pub fn load(path: &Path) -> Result<Self> {
                // SAFETY: loading runs the library's initialisers, which importing an FMU implies, and the user chose
                // the file.
                let library = unsafe { Library::new(path) }.map_err(|error| {
                    let remedy = "Check that the library was built for this machine";
                    Failure::new(path.display(), format!("cannot be loaded: {error}"), remedy)
                })?;
                Ok(Self {
                    // SAFETY: the types are those of the standard's header; the library stays loaded as long as the
                    // functions are used.
                    $($name: *unsafe { library.get(stringify!($name)) }.map_err(|error| {
                        Failure::new("FMU library", format!("does not export {}: {error}", stringify!($name)), "")
                    })?,)*
                    _library: library,
                })
            }
        }
    };
}

/// `fmi2CallbackFunctions`.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Fmi2Callbacks {
    pub logger: *const c_void,
    pub allocateMemory: *const c_void,
    pub freeMemory: *const c_void,
    pub stepFinished: *const c_void,
    pub componentEnvironment: *mut c_void,
}

api! {
    /// FMI 2.0.
    Fmi2Api {
        fmi2GetTypesPlatform() -> TextPointer;
        fmi2GetVersion() -> TextPointer;
        fmi2SetDebugLogging(InstancePointer, c_int, usize, *const TextPointer) -> i32;
        fmi2Instantiate(TextPointer, c_int, TextPointer, TextPointer, *const Fmi2Callbacks, c_int, c_int) -> InstancePointer;
        fmi2FreeInstance(InstancePointer) -> ();
        fmi2SetupExperiment(InstancePointer, c_int, f64, f64, c_int, f64) -> i32;
        fmi2EnterInitializationMode(InstancePointer) -> i32;
        fmi2ExitInitializationMode(InstancePointer) -> i32;
        fmi2Terminate(InstancePointer) -> i32;
        fmi2Reset(InstancePointer) -> i32;
        fmi2GetReal(InstancePointer, ReferencePointer, usize, *mut f64) -> i32;
        fmi2GetInteger(InstancePointer, ReferencePointer, usize, *mut c_int) -> i32;
        fmi2GetBoolean(InstancePointer, ReferencePointer, usize, *mut c_int) -> i32;
        fmi2GetString(InstancePointer, ReferencePointer, usize, *mut TextPointer) -> i32;
        fmi2SetReal(InstancePointer, ReferencePointer, usize, *const f64) -> i32;
        fmi2SetInteger(InstancePointer, ReferencePointer, usize, *const c_int) -> i32;
        fmi2SetBoolean(InstancePointer, ReferencePointer, usize, *const c_int) -> i32;
        fmi2SetString(InstancePointer, ReferencePointer, usize, *const TextPointer) -> i32;
        fmi2GetFMUstate(InstancePointer, *mut StatePointer) -> i32;
        fmi2SetFMUstate(InstancePointer, StatePointer) -> i32;
        fmi2FreeFMUstate(InstancePointer, *mut StatePointer) -> i32;
        fmi2SerializedFMUstateSize(InstancePointer, StatePointer, *mut usize) -> i32;
        fmi2SerializeFMUstate(InstancePointer, StatePointer, *mut u8, usize) -> i32;
        fmi2DeSerializeFMUstate(InstancePointer, *const u8, usize, *mut StatePointer) -> i32;
        fmi2GetDirectionalDerivative(InstancePointer, ReferencePointer, usize, ReferencePointer, usize, *const f64, *mut f64) -> i32;
        fmi2EnterEventMode(InstancePointer) -> i32;
        fmi2NewDiscreteStates(InstancePointer, *mut c_void) -> i32;
        fmi2EnterContinuousTimeMode(InstancePointer) -> i32;
        fmi2CompletedIntegratorStep(InstancePointer, c_int, *mut c_int, *mut c_int) -> i32;
        fmi2SetTime(InstancePointer, f64) -> i32;
        fmi2SetContinuousStates(InstancePointer, *const f64, usize) -> i32;
        fmi2GetDerivatives(InstancePointer, *mut f64, usize) -> i32;
        fmi2GetEventIndicators(InstancePointer, *mut f64, usize) -> i32;
        fmi2GetContinuousStates(InstancePointer, *mut f64, usize) -> i32;
        fmi2GetNominalsOfContinuousStates(InstancePointer, *mut f64, usize) -> i32;
        fmi2SetRealInputDerivatives(InstancePointer, ReferencePointer, usize, *const c_int, *const f64) -> i32;
        fmi2GetRealOutputDerivatives(InstancePointer, ReferencePointer, usize, *const c_int, *mut f64) -> i32;
        fmi2DoStep(InstancePointer, f64, f64, c_int) -> i32;
        fmi2CancelStep(InstancePointer) -> i32;
        fmi2GetStatus(InstancePointer, c_int, *mut c_int) -> i32;
        fmi2GetRealStatus(InstancePointer, c_int, *mut f64) -> i32;
        fmi2GetIntegerStatus(InstancePointer, c_int, *mut c_int) -> i32;
        fmi2GetBooleanStatus(InstancePointer, c_int, *mut c_int) -> i32;
        fmi2GetStringStatus(InstancePointer, c_int, *mut TextPointer) -> i32;
    }
}

/// `fmi3LogMessageCallback`.
pub type LogMessage = unsafe extern "C" fn(*mut c_void, i32, TextPointer, TextPointer);
/// `fmi3IntermediateUpdateCallback`.
pub type Update = unsafe extern "C" fn(*mut c_void, f64, bool, bool, bool, bool, *mut bool, *mut f64);

api! {
    /// FMI 3.0.
    Fmi3Api {
        fmi3GetVersion() -> TextPointer;
        fmi3SetDebugLogging(InstancePointer, bool, usize, *const TextPointer) -> i32;
        fmi3InstantiateModelExchange(TextPointer, TextPointer, TextPointer, bool, bool, *mut c_void, Option<LogMessage>) -> InstancePointer;
        fmi3InstantiateCoSimulation(TextPointer, TextPointer, TextPointer, bool, bool, bool, bool, ReferencePointer, usize, *mut c_void,
            Option<LogMessage>, Option<Update>) -> InstancePointer;
        fmi3InstantiateScheduledExecution(TextPointer, TextPointer, TextPointer, bool, bool, *mut c_void, Option<LogMessage>,
            *const c_void, *const c_void, *const c_void) -> InstancePointer;
        fmi3FreeInstance(InstancePointer) -> ();
        fmi3EnterInitializationMode(InstancePointer, bool, f64, f64, bool, f64) -> i32;
        fmi3ExitInitializationMode(InstancePointer) -> i32;
        fmi3EnterEventMode(InstancePointer) -> i32;
        fmi3Terminate(InstancePointer) -> i32;
        fmi3Reset(InstancePointer) -> i32;
        fmi3GetFloat32(InstancePointer, ReferencePointer, usize, *mut f32, usize) -> i32;
        fmi3GetFloat64(InstancePointer, ReferencePointer, usize, *mut f64, usize) -> i32;
        fmi3GetInt8(InstancePointer, ReferencePointer, usize, *mut i8, usize) -> i32;
        fmi3GetUInt8(InstancePointer, ReferencePointer, usize, *mut u8, usize) -> i32;
        fmi3GetInt16(InstancePointer, ReferencePointer, usize, *mut i16, usize) -> i32;
        fmi3GetUInt16(InstancePointer, ReferencePointer, usize, *mut u16, usize) -> i32;
        fmi3GetInt32(InstancePointer, ReferencePointer, usize, *mut i32, usize) -> i32;
        fmi3GetUInt32(InstancePointer, ReferencePointer, usize, *mut u32, usize) -> i32;
        fmi3GetInt64(InstancePointer, ReferencePointer, usize, *mut i64, usize) -> i32;
        fmi3GetUInt64(InstancePointer, ReferencePointer, usize, *mut u64, usize) -> i32;
        fmi3GetBoolean(InstancePointer, ReferencePointer, usize, *mut u8, usize) -> i32;
        fmi3GetString(InstancePointer, ReferencePointer, usize, *mut TextPointer, usize) -> i32;
        fmi3GetBinary(InstancePointer, ReferencePointer, usize, *mut usize, *mut *const u8, usize) -> i32;
        fmi3GetClock(InstancePointer, ReferencePointer, usize, *mut bool) -> i32;
        fmi3SetFloat32(InstancePointer, ReferencePointer, usize, *const f32, usize) -> i32;
        fmi3SetFloat64(InstancePointer, ReferencePointer, usize, *const f64, usize) -> i32;
        fmi3SetInt8(InstancePointer, ReferencePointer, usize, *const i8, usize) -> i32;
        fmi3SetUInt8(InstancePointer, ReferencePointer, usize, *const u8, usize) -> i32;
        fmi3SetInt16(InstancePointer, ReferencePointer, usize, *const i16, usize) -> i32;
        fmi3SetUInt16(InstancePointer, ReferencePointer, usize, *const u16, usize) -> i32;
        fmi3SetInt32(InstancePointer, ReferencePointer, usize, *const i32, usize) -> i32;
        fmi3SetUInt32(InstancePointer, ReferencePointer, usize, *const u32, usize) -> i32;
        fmi3SetInt64(InstancePointer, ReferencePointer, usize, *const i64, usize) -> i32;
        fmi3SetUInt64(InstancePointer, ReferencePointer, usize, *const u64, usize) -> i32;
        fmi3SetBoolean(InstancePointer, ReferencePointer, usize, *const bool, usize) -> i32;
        fmi3SetString(InstancePointer, ReferencePointer, usize, *const TextPointer, usize) -> i32;
        fmi3SetBinary(InstancePointer, ReferencePointer, usize, *const usize, *const *const u8, usize) -> i32;
        fmi3SetClock(InstancePointer, ReferencePointer, usize, *const bool) -> i32;
        fmi3GetNumberOfVariableDependencies(InstancePointer, u32, *mut usize) -> i32;
        fmi3GetVariableDependencies(InstancePointer, u32, *mut usize, *mut u32, *mut usize, *mut i32, usize) -> i32;
        fmi3GetFMUState(InstancePointer, *mut StatePointer) -> i32;
        fmi3SetFMUState(InstancePointer, StatePointer) -> i32;
        fmi3FreeFMUState(InstancePointer, *mut StatePointer) -> i32;
        fmi3SerializedFMUStateSize(InstancePointer, StatePointer, *mut usize) -> i32;
        fmi3SerializeFMUState(InstancePointer, StatePointer, *mut u8, usize) -> i32;
        fmi3DeserializeFMUState(InstancePointer, *const u8, usize, *mut StatePointer) -> i32;
        fmi3GetDirectionalDerivative(InstancePointer, ReferencePointer, usize, ReferencePointer, usize, *const f64, usize, *mut f64, usize)
            -> i32;
        fmi3GetAdjointDerivative(InstancePointer, ReferencePointer, usize, ReferencePointer, usize, *const f64, usize, *mut f64, usize)
            -> i32;
        fmi3EnterConfigurationMode(InstancePointer) -> i32;
        fmi3ExitConfigurationMode(InstancePointer) -> i32;
        fmi3GetIntervalDecimal(InstancePointer, ReferencePointer, usize, *mut f64, *mut i32) -> i32;
        fmi3GetIntervalFraction(InstancePointer, ReferencePointer, usize, *mut u64, *mut u64, *mut i32) -> i32;
        fmi3GetShiftDecimal(InstancePointer, ReferencePointer, usize, *mut f64) -> i32;
        fmi3GetShiftFraction(InstancePointer, ReferencePointer, usize, *mut u64, *mut u64) -> i32;
        fmi3SetIntervalDecimal(InstancePointer, ReferencePointer, usize, *const f64) -> i32;
        fmi3SetIntervalFraction(InstancePointer, ReferencePointer, usize, *const u64, *const u64) -> i32;
        fmi3SetShiftDecimal(InstancePointer, ReferencePointer, usize, *const f64) -> i32;
        fmi3SetShiftFraction(InstancePointer, ReferencePointer, usize, *const u64, *const u64) -> i32;
        fmi3EvaluateDiscreteStates(InstancePointer) -> i32;
        fmi3UpdateDiscreteStates(InstancePointer, *mut bool, *mut bool, *mut bool, *mut bool, *mut bool, *mut f64) -> i32;
        fmi3EnterContinuousTimeMode(InstancePointer) -> i32;
        fmi3CompletedIntegratorStep(InstancePointer, bool, *mut bool, *mut bool) -> i32;
        fmi3SetTime(InstancePointer, f64) -> i32;
        fmi3SetContinuousStates(InstancePointer, *const f64, usize) -> i32;
        fmi3GetContinuousStateDerivatives(InstancePointer, *mut f64, usize) -> i32;
        fmi3GetEventIndicators(InstancePointer, *mut f64, usize) -> i32;
        fmi3GetContinuousStates(InstancePointer, *mut f64, usize) -> i32;
        fmi3GetNominalsOfContinuousStates(InstancePointer, *mut f64, usize) -> i32;
        fmi3GetNumberOfEventIndicators(InstancePointer, *mut usize) -> i32;
        fmi3GetNumberOfContinuousStates(InstancePointer, *mut usize) -> i32;
        fmi3EnterStepMode(InstancePointer) -> i32;
        fmi3GetOutputDerivatives(InstancePointer, ReferencePointer, usize, *const i32, *mut f64, usize) -> i32;
        fmi3DoStep(InstancePointer, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> i32;
        fmi3ActivateModelPartition(InstancePointer, u32, f64) -> i32;
    }
}
