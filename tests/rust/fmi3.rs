//! A small FMI 3.0 importer: safe calls on an instance, and its handle for unsafe ones.
#![allow(clippy::not_unsafe_ptr_arg_deref, reason = "saved states are opaque: a correct library never follows them")]

use std::ffi::{CString, c_void};
use std::path::Path;

use crate::scene::UnpackedResources;
use crate::{Journal, OK, journal3, pointer};
use tiprub_fmi_host::api::{Fmi3Api, InstancePointer, StatePointer, Update};

/// Arguments of the instantiation; tests change single fields.
#[derive(Debug, Clone)]
pub struct Fmi3Arguments {
    /// `instanceName`.
    pub name: Option<CString>,
    /// `instantiationToken`.
    pub token: Option<CString>,
    /// `resourcePath`.
    pub path: Option<CString>,
    /// `eventModeUsed`.
    pub event_mode: bool,
    /// `earlyReturnAllowed`.
    pub early_return: bool,
    /// `requiredIntermediateVariables`.
    pub intermediate: Vec<u32>,
    /// `intermediateUpdate`; it receives the importer's [`CallbackContext`].
    pub update: Option<Update>,
}

impl Fmi3Arguments {
    /// Returns valid arguments.
    pub fn new(resources: &UnpackedResources) -> Self {
        let text = |text: String| Some(CString::new(text).expect("no NUL"));
        Self {
            name: text("rub".into()),
            token: text(resources.token.clone()),
            path: text(format!("{}/", resources.path().display())),
            event_mode: false,
            early_return: false,
            intermediate: Vec::new(),
            update: None,
        }
    }
}

/// Target of `instanceEnvironment`; begins with the journal, so that the logger finds it.
#[derive(Debug)]
#[repr(C)]
pub struct CallbackContext {
    /// Messages.
    pub journal: Journal,
    /// The functions, for callbacks.
    pub api: *const Fmi3Api,
    /// The instance, for callbacks.
    pub handle: InstancePointer,
    /// Values recorded by the callback of a test.
    pub notes: Vec<f64>,
    /// Value passed to the callback of a test.
    pub wish: f64,
}

/// Results of `fmi3DoStep`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Status.
    pub status: i32,
    /// `eventHandlingNeeded`.
    pub event: bool,
    /// `terminateSimulation`.
    pub terminate: bool,
    /// `earlyReturn`.
    pub early: bool,
    /// `lastSuccessfulTime`.
    pub time: f64,
}

/// One instance; freed when dropped.
#[derive(Debug)]
pub struct Fmi3TestSlave<'a> {
    /// The functions.
    pub api: &'a Fmi3Api,
    /// The instance.
    pub handle: InstancePointer,
    /// Target of the environment pointer of callbacks.
    pub context: *mut CallbackContext,
}

/// Loads the library.
#[track_caller]
pub fn load(path: &Path) -> Fmi3Api {
    Fmi3Api::load(path).unwrap_or_else(|failure| panic!("{failure}"))
}

calls_of_both! {
    slave: Fmi3TestSlave, exit: fmi3ExitInitializationMode, reset: fmi3Reset, terminate: fmi3Terminate, free: fmi3FreeInstance,
    save: fmi3GetFMUState, restore: fmi3SetFMUState,
    size: fmi3SerializedFMUStateSize, serialise: fmi3SerializeFMUState, deserialise: fmi3DeserializeFMUState,
}

impl AsMut<Journal> for CallbackContext {
    fn as_mut(&mut self) -> &mut Journal {
        &mut self.journal
    }
}

impl<'a> Fmi3TestSlave<'a> {
    /// Creates an instance, or returns the messages.
    ///
    /// # Errors
    /// A failed instantiation, with all messages logged.
    pub fn try_new(api: &'a Fmi3Api, arguments: &Fmi3Arguments) -> Result<Self, String> {
        let context = Box::into_raw(Box::new(CallbackContext {
            journal: Journal::default(),
            api,
            handle: std::ptr::null_mut(),
            notes: Vec::new(),
            wish: 0.0,
        }));
        let Fmi3Arguments { name, token, path, event_mode, early_return, intermediate, update } = arguments;
        // SAFETY: all pointers are valid for the call or NULL, which the library must handle.
        let handle = unsafe {
            (api.fmi3InstantiateCoSimulation)(
                pointer(name),
                pointer(token),
                pointer(path),
                false,
                false,
                *event_mode,
                *early_return,
                intermediate.as_ptr(),
                intermediate.len(),
                context.cast::<c_void>(),
                Some(journal3),
                *update,
            )
        };
        // SAFETY: the context came from a box just now.
        unsafe { (*context).handle = handle };
        let slave = Self { api, handle, context };
        if handle.is_null() { Err(slave.log()) } else { Ok(slave) }
    }

    /// Creates an instance of the scene of the tests.
    #[track_caller]
    pub fn new(api: &'a Fmi3Api, resources: &UnpackedResources) -> Self {
        Self::try_new(api, &Fmi3Arguments::new(resources)).unwrap_or_else(|log| panic!("{log}"))
    }

    /// Goes from instantiated to ready for steps.
    #[track_caller]
    pub fn initialise(&self) {
        self.expect(self.enter(0.0, None));
        self.expect(self.exit());
    }

    /// Calls `fmi3EnterInitializationMode`.
    pub fn enter(&self, start: f64, stop: Option<f64>) -> i32 {
        let (defined, stop) = (stop.is_some(), stop.unwrap_or(0.0));
        // SAFETY: the instance is alive.
        unsafe { (self.api.fmi3EnterInitializationMode)(self.handle, false, 0.0, start, defined, stop) }
    }

    /// Calls `fmi3DoStep`; the outputs hold invalid values before the call.
    pub fn step(&self, time: f64, size: f64) -> Step {
        let (mut event, mut terminate, mut early, mut last) = (true, true, true, f64::NAN);
        // SAFETY: valid locations for the four outputs.
        let status = unsafe {
            (self.api.fmi3DoStep)(
                self.handle,
                time,
                size,
                true,
                &raw mut event,
                &raw mut terminate,
                &raw mut early,
                &raw mut last,
            )
        };
        Step { status, event, terminate, early, time: last }
    }

    /// Calls `fmi3GetFloat64`; returns the status if it fails.
    pub fn try_reals(&self, references: &[u32], count: usize) -> Result<Vec<f64>, i32> {
        let mut values = vec![0.0; count];
        // SAFETY: arrays of that length.
        let status = unsafe {
            (self.api.fmi3GetFloat64)(self.handle, references.as_ptr(), references.len(), values.as_mut_ptr(), count)
        };
        if status == OK { Ok(values) } else { Err(status) }
    }

    /// Calls `fmi3GetFloat64`.
    #[track_caller]
    pub fn reals(&self, references: &[u32], count: usize) -> Vec<f64> {
        self.try_reals(references, count).unwrap_or_else(|status| panic!("status {status}: {}", self.log()))
    }

    /// Calls `fmi3SetFloat64`.
    pub fn set_reals(&self, references: &[u32], values: &[f64]) -> i32 {
        let (count, n) = (references.len(), values.len());
        // SAFETY: arrays of that length.
        unsafe { (self.api.fmi3SetFloat64)(self.handle, references.as_ptr(), count, values.as_ptr(), n) }
    }

    /// Returns the notes of the test's callback.
    pub fn notes(&self) -> Vec<f64> {
        // SAFETY: as in `log`.
        std::mem::take(unsafe { &mut (*self.context).notes })
    }

    /// Passes a value to the callback of the test.
    pub fn wish(&self, value: f64) {
        // SAFETY: as in `log`.
        unsafe { (*self.context).wish = value };
    }
}
