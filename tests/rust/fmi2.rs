//! A small FMI 2.0 importer: safe calls on an instance, and its handle for unsafe ones.
#![allow(clippy::not_unsafe_ptr_arg_deref, reason = "saved states are opaque: a correct library never follows them")]

use std::ffi::CString;
use std::path::Path;

use crate::scene::UnpackedResources;
use crate::{Journal, journal2, pointer};
use tiprub_fmi_host::api::{Fmi2Api, Fmi2Callbacks, InstancePointer, StatePointer};

/// Arguments of the instantiation; tests change single fields.
#[derive(Debug, Clone)]
pub struct Fmi2Arguments {
    /// `instanceName`.
    pub name: Option<CString>,
    /// `fmuType`.
    pub kind: i32,
    /// `fmuGUID`.
    pub token: Option<CString>,
    /// `fmuResourceLocation`.
    pub location: Option<CString>,
    /// `loggingOn`.
    pub logging_on: i32,
}

impl Fmi2Arguments {
    /// Returns valid arguments.
    pub fn new(resources: &UnpackedResources) -> Self {
        let text = |text: String| Some(CString::new(text).expect("no NUL"));
        Self {
            name: text("rub".into()),
            kind: 1,
            token: text(resources.token.clone()),
            location: text(format!("file://{}", resources.path().display())),
            logging_on: 0,
        }
    }
}

/// One instance; freed when dropped.
#[derive(Debug)]
pub struct Fmi2TestSlave<'a> {
    /// The functions.
    pub api: &'a Fmi2Api,
    /// The instance.
    pub handle: InstancePointer,
    context: *mut Journal,
}

/// Loads the library.
#[track_caller]
pub fn load(path: &Path) -> Fmi2Api {
    Fmi2Api::load(path).unwrap_or_else(|failure| panic!("{failure}"))
}

calls_of_both! {
    slave: Fmi2TestSlave, exit: fmi2ExitInitializationMode, reset: fmi2Reset, terminate: fmi2Terminate, free: fmi2FreeInstance,
    save: fmi2GetFMUstate, restore: fmi2SetFMUstate,
    size: fmi2SerializedFMUstateSize, serialise: fmi2SerializeFMUstate, deserialise: fmi2DeSerializeFMUstate,
}

impl<'a> Fmi2TestSlave<'a> {
    /// Creates an instance, or returns the messages.
    ///
    /// # Errors
    /// A failed instantiation, with all messages logged.
    pub fn try_new(api: &'a Fmi2Api, arguments: &Fmi2Arguments) -> Result<Self, String> {
        let context = Box::into_raw(Box::new(Journal::default()));
        let callbacks = Fmi2Callbacks {
            logger: journal2 as *const _,
            allocateMemory: std::ptr::null(),
            freeMemory: std::ptr::null(),
            stepFinished: std::ptr::null(),
            componentEnvironment: context.cast(),
        };
        let Fmi2Arguments { name, kind, token, location, logging_on } = arguments;
        // SAFETY: all pointers are valid for the call or NULL, which the library must handle.
        let handle = unsafe {
            (api.fmi2Instantiate)(
                pointer(name),
                *kind,
                pointer(token),
                pointer(location),
                &raw const callbacks,
                0,
                *logging_on,
            )
        };
        let slave = Self { api, handle, context };
        if handle.is_null() { Err(slave.log()) } else { Ok(slave) }
    }

    /// Creates an instance of the scene of the tests.
    #[track_caller]
    pub fn new(api: &'a Fmi2Api, resources: &UnpackedResources) -> Self {
        Self::try_new(api, &Fmi2Arguments::new(resources)).unwrap_or_else(|log| panic!("{log}"))
    }

    /// Creates and initialises an instance, start time 0, no stop time.
    #[track_caller]
    pub fn initialised(api: &'a Fmi2Api, resources: &UnpackedResources) -> Self {
        let slave = Self::new(api, resources);
        slave.initialise();
        slave
    }

    /// Goes from instantiated to ready for steps.
    #[track_caller]
    pub fn initialise(&self) {
        self.expect(self.enter());
        self.expect(self.exit());
    }

    /// Calls `fmi2EnterInitializationMode`.
    pub fn enter(&self) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2EnterInitializationMode)(self.handle) }
    }

    /// Calls `fmi2SetupExperiment`.
    pub fn setup(&self, start: f64, stop: Option<f64>) -> i32 {
        // SAFETY: the instance is alive.
        unsafe {
            (self.api.fmi2SetupExperiment)(self.handle, 0, 0.0, start, i32::from(stop.is_some()), stop.unwrap_or(0.0))
        }
    }

    /// Calls `fmi2DoStep`.
    pub fn step(&self, time: f64, size: f64) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2DoStep)(self.handle, time, size, 1) }
    }

    /// Calls `fmi2GetReal`.
    #[track_caller]
    pub fn reals(&self, references: &[u32]) -> Vec<f64> {
        let mut values = vec![0.0; references.len()];
        // SAFETY: arrays of that length.
        let status =
            unsafe { (self.api.fmi2GetReal)(self.handle, references.as_ptr(), references.len(), values.as_mut_ptr()) };
        self.expect(status);
        values
    }

    /// Calls `fmi2SetReal`.
    pub fn set_reals(&self, references: &[u32], values: &[f64]) -> i32 {
        // SAFETY: arrays of that length.
        unsafe { (self.api.fmi2SetReal)(self.handle, references.as_ptr(), references.len(), values.as_ptr()) }
    }

    /// Calls `fmi2SetRealInputDerivatives`, with one order for all references.
    pub fn set_derivatives(&self, references: &[u32], order: i32, values: &[f64]) -> i32 {
        let orders = vec![order; references.len()];
        // SAFETY: arrays of that length.
        unsafe {
            (self.api.fmi2SetRealInputDerivatives)(
                self.handle,
                references.as_ptr(),
                references.len(),
                orders.as_ptr(),
                values.as_ptr(),
            )
        }
    }
}
