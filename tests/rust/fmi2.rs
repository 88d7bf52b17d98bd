//! A small FMI 2.0 importer: safe calls on an instance, and its handle for unsafe ones.
#![allow(clippy::not_unsafe_ptr_arg_deref, reason = "saved states are opaque: a correct library never follows them")]

use std::ffi::CString;
use std::path::Path;

use crate::api::{Fmi2Api, Fmi2Callbacks, Instance, State};
use crate::scene::Resources;
use crate::{Journal, OK, WARNING, journal2};

/// What the instantiation is given; change a field to try something else.
#[derive(Debug, Clone)]
pub struct Arguments {
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

impl Arguments {
    /// Proper ones.
    pub fn new(resources: &Resources) -> Self {
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
pub struct Slave<'a> {
    /// The functions.
    pub api: &'a Fmi2Api,
    /// The instance.
    pub handle: Instance,
    journal: *mut Journal,
}

/// Load the library.
#[track_caller]
pub fn load(path: &Path) -> Fmi2Api {
    Fmi2Api::load(path)
}

fn pointer(text: &Option<CString>) -> *const std::ffi::c_char {
    text.as_ref().map_or(std::ptr::null(), |text| text.as_ptr())
}

impl<'a> Slave<'a> {
    /// Instantiate; on failure the messages.
    ///
    /// # Errors
    /// All messages logged.
    pub fn try_new(api: &'a Fmi2Api, arguments: &Arguments) -> Result<Self, String> {
        let journal = Box::into_raw(Box::new(Journal::default()));
        let callbacks = Fmi2Callbacks {
            logger: journal2 as *const _,
            allocateMemory: std::ptr::null(),
            freeMemory: std::ptr::null(),
            stepFinished: std::ptr::null(),
            componentEnvironment: journal.cast(),
        };
        let Arguments { name, kind, token, location, logging_on } = arguments;
        // SAFETY: all pointers are valid for the call or NULL, which the library must bear.
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
        let slave = Self { api, handle, journal };
        if handle.is_null() { Err(slave.log()) } else { Ok(slave) }
    }

    /// Instantiate the scene of the tests.
    #[track_caller]
    pub fn new(api: &'a Fmi2Api, resources: &Resources) -> Self {
        Self::try_new(api, &Arguments::new(resources)).unwrap_or_else(|log| panic!("{log}"))
    }

    /// Instantiate and initialise, start time 0, no stop time.
    #[track_caller]
    pub fn initialised(api: &'a Fmi2Api, resources: &Resources) -> Self {
        let slave = Self::new(api, resources);
        slave.initialise();
        slave
    }

    /// From instantiated to ready for steps.
    #[track_caller]
    pub fn initialise(&self) {
        self.expect(self.enter());
        self.expect(self.exit());
    }

    /// `fmi2EnterInitializationMode`.
    pub fn enter(&self) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2EnterInitializationMode)(self.handle) }
    }

    /// `fmi2ExitInitializationMode`.
    pub fn exit(&self) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2ExitInitializationMode)(self.handle) }
    }

    /// `fmi2SetupExperiment`.
    pub fn setup(&self, start: f64, stop: Option<f64>) -> i32 {
        // SAFETY: the instance is alive.
        unsafe {
            (self.api.fmi2SetupExperiment)(self.handle, 0, 0.0, start, i32::from(stop.is_some()), stop.unwrap_or(0.0))
        }
    }

    /// `fmi2Reset`.
    pub fn reset(&self) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2Reset)(self.handle) }
    }

    /// `fmi2Terminate`.
    pub fn terminate(&self) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2Terminate)(self.handle) }
    }

    /// `fmi2DoStep`.
    pub fn step(&self, time: f64, size: f64) -> i32 {
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi2DoStep)(self.handle, time, size, 1) }
    }

    /// `fmi2GetReal`.
    #[track_caller]
    pub fn reals(&self, references: &[u32]) -> Vec<f64> {
        let mut values = vec![0.0; references.len()];
        // SAFETY: arrays of that length.
        let status =
            unsafe { (self.api.fmi2GetReal)(self.handle, references.as_ptr(), references.len(), values.as_mut_ptr()) };
        self.expect(status);
        values
    }

    /// `fmi2SetReal`.
    pub fn set_reals(&self, references: &[u32], values: &[f64]) -> i32 {
        // SAFETY: arrays of that length.
        unsafe { (self.api.fmi2SetReal)(self.handle, references.as_ptr(), references.len(), values.as_ptr()) }
    }

    /// `fmi2SetRealInputDerivatives`, all of the given order.
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

    /// `fmi2GetFMUstate` into a new state.
    #[track_caller]
    pub fn save(&self) -> State {
        let mut state = std::ptr::null_mut();
        // SAFETY: a place for the state.
        self.expect(unsafe { (self.api.fmi2GetFMUstate)(self.handle, &raw mut state) });
        state
    }

    /// `fmi2SetFMUstate`.
    pub fn restore(&self, state: State) -> i32 {
        // SAFETY: the instance is alive; the library must bear any state.
        unsafe { (self.api.fmi2SetFMUstate)(self.handle, state) }
    }

    /// The bytes of a state.
    #[track_caller]
    pub fn serialise(&self, state: State) -> Vec<u8> {
        let mut size = 0;
        // SAFETY: a place for the size.
        self.expect(unsafe { (self.api.fmi2SerializedFMUstateSize)(self.handle, state, &raw mut size) });
        let mut bytes = vec![0; size];
        // SAFETY: an array of that size.
        self.expect(unsafe { (self.api.fmi2SerializeFMUstate)(self.handle, state, bytes.as_mut_ptr(), size) });
        bytes
    }

    /// `fmi2DeSerializeFMUstate` into a new state.
    pub fn deserialise(&self, bytes: &[u8]) -> (i32, State) {
        let mut state = std::ptr::null_mut();
        // SAFETY: an array of that size, a place for the state.
        let status =
            unsafe { (self.api.fmi2DeSerializeFMUstate)(self.handle, bytes.as_ptr(), bytes.len(), &raw mut state) };
        (status, state)
    }

    /// Messages so far; the journal is empty afterwards.
    pub fn log(&self) -> String {
        // SAFETY: the journal lives as long as this importer, and is only touched between calls.
        std::mem::take(unsafe { &mut *self.journal }).text()
    }

    /// Require OK or Warning.
    #[track_caller]
    pub fn expect(&self, status: i32) {
        assert!(status == OK || status == WARNING, "status {status}: {}", self.log());
    }
}

impl Drop for Slave<'_> {
    fn drop(&mut self) {
        // SAFETY: the instance is NULL or alive and not used any more; the journal came from a box.
        unsafe {
            (self.api.fmi2FreeInstance)(self.handle);
            drop(Box::from_raw(self.journal));
        }
    }
}
