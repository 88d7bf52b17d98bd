//! The simulation as a WebAssembly module, for the page of the guide that runs a rub in the browser.
//!
//! The module imports nothing. Its functions use one session. The caller writes texts and files to a buffer that
//! [`tiprub_input`] provides. It reads texts and numbers from two buffers, whose addresses [`tiprub_text`] and
//! [`tiprub_row`] return. A function that can fail returns 0 on success, or 1 and stores the error as the text. A panic
//! stores its message as the text, and traps.
#![warn(unreachable_pub)]

mod session;

use std::cell::RefCell;

use session::{Result, Session};

/// Buffers of the module, and its session.
#[derive(Default)]
struct Module {
    input: Vec<u8>,
    /// Scene, ROM and names of outputs; empty once they are used for a session.
    files: Vec<Vec<u8>>,
    row: Vec<f64>,
    session: Option<Session>,
}

thread_local! {
    static MODULE: RefCell<Module> = RefCell::default();
    /// Message of an error or a panic, or warnings.
    static TEXT: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Calls a function of the module. Returns 1 and stores the error as the text if it fails, otherwise 0.
fn call(function: impl FnOnce(&mut Module) -> Result<()>) -> u32 {
    let result = MODULE.with_borrow_mut(function);
    let status = u32::from(result.is_err());
    TEXT.set(result.err().unwrap_or_default());
    status
}

/// Calls a function of the session with the input and the row.
fn with_session(function: impl FnOnce(&mut Session, &[u8], &mut Vec<f64>) -> Result<()>) -> u32 {
    call(|module| match &mut module.session {
        Some(session) => function(session, &module.input, &mut module.row),
        None => Err("session: no scene is loaded. Call `tiprub_create` first.".to_owned()),
    })
}

/// Returns bytes as text.
fn text(bytes: &[u8]) -> Result<&str> {
    std::str::from_utf8(bytes).map_err(|error| format!("input: {error}. Encode the text as UTF-8."))
}

/// Installs a hook that stores the message of a panic as the text. Call this function first.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_start() {
    std::panic::set_hook(Box::new(|panic| TEXT.set(panic.to_string())));
}

/// Returns the address of an input buffer of `length` bytes, which the caller then fills.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_input(length: usize) -> *mut u8 {
    MODULE.with_borrow_mut(|module| {
        module.input = vec![0; length];
        module.input.as_mut_ptr()
    })
}

/// Adds the input as the next file: the scene, its ROM, and the names of the outputs to read, one per line.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_add_file() {
    MODULE.with_borrow_mut(|module| module.files.push(std::mem::take(&mut module.input)));
}

/// Creates the session from the three files.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_create() -> u32 {
    call(|module| {
        module.session = None;
        let files = std::mem::take(&mut module.files);
        let [scene, rom, names] = files.as_slice() else {
            return Err(format!(
                "session: {} files were added. Add the scene, its ROM and the names of outputs.",
                files.len()
            ));
        };
        module.session = Some(Session::new(text(scene)?, rom, text(names)?)?);
        Ok(())
    })
}

/// Returns the number of communication steps of the scene; 0 without a session.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_step_count() -> u32 {
    MODULE.with_borrow(|module| module.session.as_ref().map_or(0, Session::step_count))
}

/// Resets the session to the start values of the scene.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_reset() -> u32 {
    with_session(|session, _, _| {
        session.reset();
        Ok(())
    })
}

/// Sets the variable whose name is in the input buffer to `value` (SI units).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_set(value: f64) -> u32 {
    with_session(|session, name, _| session.set(text(name)?, value))
}

/// Initialises the run, and stores its first row.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_initialise() -> u32 {
    with_session(|session, _, row| {
        session.initialise()?;
        *row = session.row()?;
        Ok(())
    })
}

/// Performs one communication step, and stores its row.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_step() -> u32 {
    with_session(|session, _, row| {
        session.step()?;
        *row = session.row()?;
        Ok(())
    })
}

/// Returns the address of the row: time (s) and selected outputs (SI units).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_row() -> *const f64 {
    MODULE.with_borrow(|module| module.row.as_ptr())
}

/// Returns the number of values in the row.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_row_length() -> usize {
    MODULE.with_borrow(|module| module.row.len())
}

/// Stores the warnings since the last call as the text, one per line.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_warnings() {
    let warnings = MODULE.with_borrow_mut(|module| module.session.as_mut().map(Session::warnings));
    TEXT.set(warnings.unwrap_or_default());
}

/// Returns the address of the text (UTF-8).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_text() -> *const u8 {
    TEXT.with_borrow(|text| text.as_ptr())
}

/// Returns the length of the text (bytes).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_text_length() -> usize {
    TEXT.with_borrow(String::len)
}
