//! The simulation as a WebAssembly module, for the page of the guide that steps a rub in the browser.
//!
//! The module imports nothing. Its functions work on one session. Texts and files go in through a buffer that
//! [`tiprub_input`] provides. Texts and numbers come out of two buffers, whose places [`tiprub_text`] and
//! [`tiprub_row`] return. A function that can fail returns 0, or 1 with the error as the text. If the module panics,
//! it traps, and the text is the message of the panic.
#![warn(unreachable_pub)]

mod session;

use std::cell::RefCell;

use session::{Result, Session};

/// Buffers, and the session once it is created.
#[derive(Default)]
struct Module {
    input: Vec<u8>,
    /// Scene, ROM and names of outputs, until the session is created.
    files: Vec<Vec<u8>>,
    row: Vec<f64>,
    session: Option<Session>,
}

thread_local! {
    static MODULE: RefCell<Module> = RefCell::default();
    /// Error, warnings, or the message of a panic.
    static TEXT: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Calls a function of the module; stores the text of an error.
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

/// Stores the messages of panics as the text. Call it first.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_start() {
    std::panic::set_hook(Box::new(|panic| TEXT.set(panic.to_string())));
}

/// Returns the place of an input buffer of `length` bytes, which the caller then fills.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_input(length: usize) -> *mut u8 {
    MODULE.with_borrow_mut(|module| {
        module.input = vec![0; length];
        module.input.as_mut_ptr()
    })
}

/// Adds the input as a file: first the scene, then its ROM, then the names of the outputs to read, one per line.
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
            return Err(format!("session: {} files were added. Add scene, ROM and names.", files.len()));
        };
        module.session = Some(Session::new(text(scene)?, rom, text(names)?)?);
        Ok(())
    })
}

/// Returns the number of communication steps of the scene; 0 without a session.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_count() -> u32 {
    MODULE.with_borrow(|module| module.session.as_ref().map_or(0, Session::count))
}

/// Returns to the start values of the scene.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_reset() -> u32 {
    with_session(|session, _, _| {
        session.reset();
        Ok(())
    })
}

/// Sets the input or parameter whose name is the input (SI units).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_set(value: f64) -> u32 {
    with_session(|session, name, _| session.set(text(name)?, value))
}

/// Initialises the run, and reads the first row.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_initialise() -> u32 {
    with_session(|session, _, row| {
        session.initialise()?;
        *row = session.row()?;
        Ok(())
    })
}

/// Takes one communication step, and reads its row.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_step() -> u32 {
    with_session(|session, _, row| {
        session.step()?;
        *row = session.row()?;
        Ok(())
    })
}

/// Returns the place of the row: time (s) and the chosen outputs (SI units).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_row() -> *const f64 {
    MODULE.with_borrow(|module| module.row.as_ptr())
}

/// Returns the length of the row.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_row_length() -> usize {
    MODULE.with_borrow(|module| module.row.len())
}

/// Makes the warnings since the last call the text, one per line.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_warnings() {
    let warnings = MODULE.with_borrow_mut(|module| module.session.as_mut().map(Session::warnings));
    TEXT.set(warnings.unwrap_or_default());
}

/// Returns the place of the text.
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_text() -> *const u8 {
    TEXT.with_borrow(|text| text.as_ptr())
}

/// Returns the length of the text (bytes).
#[unsafe(no_mangle)]
pub extern "C" fn tiprub_text_length() -> usize {
    TEXT.with_borrow(String::len)
}
