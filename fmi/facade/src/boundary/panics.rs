//! A panic is a defect of this library: it is caught and logged, and nothing is printed.
//!
//! This shared library contains a statically linked copy of the standard library, so its panic hook is invisible to
//! everything else, including a host written in Rust. The hook set here replaces the one that prints.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, PanicHookInfo};
use std::sync::{Mutex, Once, PoisonError};

/// Place of the last panic of a thread: the end of the file's path, its length, the line. It has no destructor, so that
/// the library can be unloaded while threads that used it are still running.
type PanicPlace = ([u8; 48], usize, u32);

/// Value without a panic.
const NO_PLACE: PanicPlace = ([0; 48], 0, 0);

thread_local! {
    static PLACE: Cell<PanicPlace> = const { Cell::new(NO_PLACE) };
}

/// Place of the last panic of any thread. Threads of a unit pass their panics to the thread that called the unit, which has no place of
/// its own.
static LAST: Mutex<PanicPlace> = Mutex::new(NO_PLACE);

static HOOK: Once = Once::new();

/// Makes panics of this library silent, once.
pub(crate) fn silence() {
    HOOK.call_once(|| panic::set_hook(Box::new(remember)));
}

fn remember(info: &PanicHookInfo<'_>) {
    let Some(location) = info.location() else { return };
    let file = location.file().as_bytes();
    let tail = &file[file.len().saturating_sub(48)..];
    let mut bytes = [0; 48];
    bytes[..tail.len()].copy_from_slice(tail);
    let place = (bytes, tail.len(), location.line());
    PLACE.set(place);
    *LAST.lock().unwrap_or_else(PoisonError::into_inner) = place;
}

/// Returns the message for the importer's log.
pub(super) fn describe(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
    let own = PLACE.replace(NO_PLACE);
    let place = if own == NO_PLACE { *LAST.lock().unwrap_or_else(PoisonError::into_inner) } else { own };
    let (bytes, length, line) = place;
    let file = String::from_utf8_lossy(&bytes[..length]).into_owned();
    format!(
        "internal error: {text} (at {file}:{line}). Free the instance, which is no longer usable, and report this \
         message with the model to the developers"
    )
}
