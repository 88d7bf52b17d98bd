//! All functions of both standards as an importer declares them: names and types from `fmi2FunctionTypes.h` (FMI 2.0.4)
//! and `fmi3FunctionTypes.h` (FMI 3.0.2). Written apart from the library's own declarations.
//! A boolean that a library writes is read as a byte: one that is neither 0 nor 1 is no `bool`.
#![allow(non_snake_case, reason = "names of the standards")]
#![allow(missing_docs, reason = "the standards document them")]

use std::ffi::{c_char, c_int, c_void};
use std::path::Path;

use libloading::Library;
use tiprub_shell::{Failure, Result};

/// Instance.
pub type Instance = *mut c_void;
/// Saved state.
pub type State = *mut c_void;
/// Text.
pub(crate) type Text = *const c_char;
/// Value references.
pub(crate) type References = *const u32;

/// Structs of function pointers, loaded by name, and the list of the names.
macro_rules! api {
    ($(#[$doc:meta])* $type:ident { $($name:ident($($argument:ty),*) -> $result:ty;)* }) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $type {
            $(pub $name: unsafe extern "C" fn($($argument),*) -> $result,)*
            /// Keeps the functions in memory.
            _library: Library,
        }

        impl $type {
            /// Names of all functions.
            pub const NAMES: &[&str] = &[$(stringify!($name)),*];

            /// Load a library and look up every function.
            ///
            /// # Errors
            /// The file is no library of this platform, or a function is missing.
            pub fn load(path: &Path) -> Result<Self> {
                // SAFETY: loading runs the library's initialisers; that is what importing an FMU means, and the user named it.
                let library = unsafe { Library::new(path) }.map_err(|error| {
                    Failure::new(path.display(), format!("cannot be loaded: {error}"), "Is it for this machine?")
                })?;
                Ok(Self {
                    // SAFETY: the types are those of the standard's header; the library is kept as long as the functions.
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
        fmi2GetTypesPlatform() -> Text;
        fmi2GetVersion() -> Text;
        fmi2SetDebugLogging(Instance, c_int, usize, *const Text) -> i32;
        fmi2Instantiate(Text, c_int, Text, Text, *const Fmi2Callbacks, c_int, c_int) -> Instance;
        fmi2FreeInstance(Instance) -> ();
        fmi2SetupExperiment(Instance, c_int, f64, f64, c_int, f64) -> i32;
        fmi2EnterInitializationMode(Instance) -> i32;
        fmi2ExitInitializationMode(Instance) -> i32;
        fmi2Terminate(Instance) -> i32;
        fmi2Reset(Instance) -> i32;
        fmi2GetReal(Instance, References, usize, *mut f64) -> i32;
        fmi2GetInteger(Instance, References, usize, *mut c_int) -> i32;
        fmi2GetBoolean(Instance, References, usize, *mut c_int) -> i32;
        fmi2GetString(Instance, References, usize, *mut Text) -> i32;
        fmi2SetReal(Instance, References, usize, *const f64) -> i32;
        fmi2SetInteger(Instance, References, usize, *const c_int) -> i32;
        fmi2SetBoolean(Instance, References, usize, *const c_int) -> i32;
        fmi2SetString(Instance, References, usize, *const Text) -> i32;
        fmi2GetFMUstate(Instance, *mut State) -> i32;
        fmi2SetFMUstate(Instance, State) -> i32;
        fmi2FreeFMUstate(Instance, *mut State) -> i32;
        fmi2SerializedFMUstateSize(Instance, State, *mut usize) -> i32;
        fmi2SerializeFMUstate(Instance, State, *mut u8, usize) -> i32;
        fmi2DeSerializeFMUstate(Instance, *const u8, usize, *mut State) -> i32;
        fmi2GetDirectionalDerivative(Instance, References, usize, References, usize, *const f64, *mut f64) -> i32;
        fmi2EnterEventMode(Instance) -> i32;
        fmi2NewDiscreteStates(Instance, *mut c_void) -> i32;
        fmi2EnterContinuousTimeMode(Instance) -> i32;
        fmi2CompletedIntegratorStep(Instance, c_int, *mut c_int, *mut c_int) -> i32;
        fmi2SetTime(Instance, f64) -> i32;
        fmi2SetContinuousStates(Instance, *const f64, usize) -> i32;
        fmi2GetDerivatives(Instance, *mut f64, usize) -> i32;
        fmi2GetEventIndicators(Instance, *mut f64, usize) -> i32;
        fmi2GetContinuousStates(Instance, *mut f64, usize) -> i32;
        fmi2GetNominalsOfContinuousStates(Instance, *mut f64, usize) -> i32;
        fmi2SetRealInputDerivatives(Instance, References, usize, *const c_int, *const f64) -> i32;
        fmi2GetRealOutputDerivatives(Instance, References, usize, *const c_int, *mut f64) -> i32;
        fmi2DoStep(Instance, f64, f64, c_int) -> i32;
        fmi2CancelStep(Instance) -> i32;
        fmi2GetStatus(Instance, c_int, *mut c_int) -> i32;
        fmi2GetRealStatus(Instance, c_int, *mut f64) -> i32;
        fmi2GetIntegerStatus(Instance, c_int, *mut c_int) -> i32;
        fmi2GetBooleanStatus(Instance, c_int, *mut c_int) -> i32;
        fmi2GetStringStatus(Instance, c_int, *mut Text) -> i32;
    }
}

/// `fmi3LogMessageCallback`.
pub type LogMessage = unsafe extern "C" fn(*mut c_void, i32, Text, Text);
/// `fmi3IntermediateUpdateCallback`.
pub type Update = unsafe extern "C" fn(*mut c_void, f64, bool, bool, bool, bool, *mut bool, *mut f64);

api! {
    /// FMI 3.0.
    Fmi3Api {
        fmi3GetVersion() -> Text;
        fmi3SetDebugLogging(Instance, bool, usize, *const Text) -> i32;
        fmi3InstantiateModelExchange(Text, Text, Text, bool, bool, *mut c_void, Option<LogMessage>) -> Instance;
        fmi3InstantiateCoSimulation(Text, Text, Text, bool, bool, bool, bool, References, usize, *mut c_void,
            Option<LogMessage>, Option<Update>) -> Instance;
        fmi3InstantiateScheduledExecution(Text, Text, Text, bool, bool, *mut c_void, Option<LogMessage>,
            *const c_void, *const c_void, *const c_void) -> Instance;
        fmi3FreeInstance(Instance) -> ();
        fmi3EnterInitializationMode(Instance, bool, f64, f64, bool, f64) -> i32;
        fmi3ExitInitializationMode(Instance) -> i32;
        fmi3EnterEventMode(Instance) -> i32;
        fmi3Terminate(Instance) -> i32;
        fmi3Reset(Instance) -> i32;
        fmi3GetFloat32(Instance, References, usize, *mut f32, usize) -> i32;
        fmi3GetFloat64(Instance, References, usize, *mut f64, usize) -> i32;
        fmi3GetInt8(Instance, References, usize, *mut i8, usize) -> i32;
        fmi3GetUInt8(Instance, References, usize, *mut u8, usize) -> i32;
        fmi3GetInt16(Instance, References, usize, *mut i16, usize) -> i32;
        fmi3GetUInt16(Instance, References, usize, *mut u16, usize) -> i32;
        fmi3GetInt32(Instance, References, usize, *mut i32, usize) -> i32;
        fmi3GetUInt32(Instance, References, usize, *mut u32, usize) -> i32;
        fmi3GetInt64(Instance, References, usize, *mut i64, usize) -> i32;
        fmi3GetUInt64(Instance, References, usize, *mut u64, usize) -> i32;
        fmi3GetBoolean(Instance, References, usize, *mut u8, usize) -> i32;
        fmi3GetString(Instance, References, usize, *mut Text, usize) -> i32;
        fmi3GetBinary(Instance, References, usize, *mut usize, *mut *const u8, usize) -> i32;
        fmi3GetClock(Instance, References, usize, *mut bool) -> i32;
        fmi3SetFloat32(Instance, References, usize, *const f32, usize) -> i32;
        fmi3SetFloat64(Instance, References, usize, *const f64, usize) -> i32;
        fmi3SetInt8(Instance, References, usize, *const i8, usize) -> i32;
        fmi3SetUInt8(Instance, References, usize, *const u8, usize) -> i32;
        fmi3SetInt16(Instance, References, usize, *const i16, usize) -> i32;
        fmi3SetUInt16(Instance, References, usize, *const u16, usize) -> i32;
        fmi3SetInt32(Instance, References, usize, *const i32, usize) -> i32;
        fmi3SetUInt32(Instance, References, usize, *const u32, usize) -> i32;
        fmi3SetInt64(Instance, References, usize, *const i64, usize) -> i32;
        fmi3SetUInt64(Instance, References, usize, *const u64, usize) -> i32;
        fmi3SetBoolean(Instance, References, usize, *const bool, usize) -> i32;
        fmi3SetString(Instance, References, usize, *const Text, usize) -> i32;
        fmi3SetBinary(Instance, References, usize, *const usize, *const *const u8, usize) -> i32;
        fmi3SetClock(Instance, References, usize, *const bool) -> i32;
        fmi3GetNumberOfVariableDependencies(Instance, u32, *mut usize) -> i32;
        fmi3GetVariableDependencies(Instance, u32, *mut usize, *mut u32, *mut usize, *mut i32, usize) -> i32;
        fmi3GetFMUState(Instance, *mut State) -> i32;
        fmi3SetFMUState(Instance, State) -> i32;
        fmi3FreeFMUState(Instance, *mut State) -> i32;
        fmi3SerializedFMUStateSize(Instance, State, *mut usize) -> i32;
        fmi3SerializeFMUState(Instance, State, *mut u8, usize) -> i32;
        fmi3DeserializeFMUState(Instance, *const u8, usize, *mut State) -> i32;
        fmi3GetDirectionalDerivative(Instance, References, usize, References, usize, *const f64, usize, *mut f64, usize)
            -> i32;
        fmi3GetAdjointDerivative(Instance, References, usize, References, usize, *const f64, usize, *mut f64, usize)
            -> i32;
        fmi3EnterConfigurationMode(Instance) -> i32;
        fmi3ExitConfigurationMode(Instance) -> i32;
        fmi3GetIntervalDecimal(Instance, References, usize, *mut f64, *mut i32) -> i32;
        fmi3GetIntervalFraction(Instance, References, usize, *mut u64, *mut u64, *mut i32) -> i32;
        fmi3GetShiftDecimal(Instance, References, usize, *mut f64) -> i32;
        fmi3GetShiftFraction(Instance, References, usize, *mut u64, *mut u64) -> i32;
        fmi3SetIntervalDecimal(Instance, References, usize, *const f64) -> i32;
        fmi3SetIntervalFraction(Instance, References, usize, *const u64, *const u64) -> i32;
        fmi3SetShiftDecimal(Instance, References, usize, *const f64) -> i32;
        fmi3SetShiftFraction(Instance, References, usize, *const u64, *const u64) -> i32;
        fmi3EvaluateDiscreteStates(Instance) -> i32;
        fmi3UpdateDiscreteStates(Instance, *mut bool, *mut bool, *mut bool, *mut bool, *mut bool, *mut f64) -> i32;
        fmi3EnterContinuousTimeMode(Instance) -> i32;
        fmi3CompletedIntegratorStep(Instance, bool, *mut bool, *mut bool) -> i32;
        fmi3SetTime(Instance, f64) -> i32;
        fmi3SetContinuousStates(Instance, *const f64, usize) -> i32;
        fmi3GetContinuousStateDerivatives(Instance, *mut f64, usize) -> i32;
        fmi3GetEventIndicators(Instance, *mut f64, usize) -> i32;
        fmi3GetContinuousStates(Instance, *mut f64, usize) -> i32;
        fmi3GetNominalsOfContinuousStates(Instance, *mut f64, usize) -> i32;
        fmi3GetNumberOfEventIndicators(Instance, *mut usize) -> i32;
        fmi3GetNumberOfContinuousStates(Instance, *mut usize) -> i32;
        fmi3EnterStepMode(Instance) -> i32;
        fmi3GetOutputDerivatives(Instance, References, usize, *const i32, *mut f64, usize) -> i32;
        fmi3DoStep(Instance, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> i32;
        fmi3ActivateModelPartition(Instance, u32, f64) -> i32;
    }
}
