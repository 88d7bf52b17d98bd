//! Messages for the importer's logger.

use std::ffi::{CStr, CString, c_char};
use std::fmt;
use std::sync::atomic::{AtomicU8, Ordering};

use super::ImporterEnvironment;
use crate::slave::FmiStatus;

/// `fmi2CallbackLogger`: variadic, with a printf format.
pub type Fmi2Logger =
    unsafe extern "C" fn(ImporterEnvironment, *const c_char, FmiStatus, *const c_char, *const c_char, ...);

/// `fmi3LogMessageCallback`.
pub type Fmi3Logger = unsafe extern "C" fn(ImporterEnvironment, FmiStatus, *const c_char, *const c_char);

/// Categories in the order of `modelDescription.xml`; the last one stands for all.
const CATEGORIES: [&CStr; 5] =
    [c"logStatusWarning", c"logStatusDiscard", c"logStatusError", c"logStatusFatal", c"logAll"];

/// Bit of `logAll`.
const ALL: u8 = 1 << 4;
/// Bits of the messages that explain a status other than OK.
const EXPLANATIONS: u8 = ALL - 1;

/// Destination of messages.
pub(crate) enum Sink {
    /// FMI 2.0.
    Fmi2 {
        /// May be NULL.
        logger: Option<Fmi2Logger>,
        /// Passed back to the importer.
        environment: ImporterEnvironment,
        /// Instance name, copied.
        name: CString,
    },
    /// FMI 3.0.
    Fmi3 {
        /// May be NULL.
        logger: Option<Fmi3Logger>,
        /// Passed back to the importer.
        environment: ImporterEnvironment,
    },
}

impl fmt::Debug for Sink {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Fmi2 { .. } => "Fmi2",
            Self::Fmi3 { .. } => "Fmi3",
        })
    }
}

/// The importer's logger with the requested categories.
///
/// Messages that explain a status other than OK are sent even if `loggingOn` is false, because an importer must be able
/// to report the reason for an error. Only a choice of categories suppresses them.
#[derive(Debug)]
pub(crate) struct Log {
    sink: Sink,
    wanted: AtomicU8,
}

impl Log {
    /// Creates the log as it is at instantiation.
    pub(super) fn new(sink: Sink, logging_on: bool) -> Self {
        let log = Self { sink, wanted: AtomicU8::new(EXPLANATIONS) };
        log.choose(logging_on, &[]).unwrap_or_default();
        log
    }

    /// Implements `fmi2SetDebugLogging` and `fmi3SetDebugLogging`: no categories means all.
    ///
    /// # Errors
    /// An unknown category; nothing is changed then.
    pub(super) fn choose(&self, logging_on: bool, categories: &[&str]) -> Result<(), String> {
        let mut wanted = 0;
        for category in categories {
            let known = CATEGORIES.iter().position(|known| known.to_bytes() == category.as_bytes());
            wanted |= 1
                << known.ok_or_else(|| {
                    let names = CATEGORIES.map(|name| name.to_string_lossy().into_owned()).join(", ");
                    format!("log category \"{category}\" does not exist. Categories: {names}")
                })?;
        }
        let wanted = match (logging_on, categories) {
            (false, _) => EXPLANATIONS,
            (true, []) => EXPLANATIONS | ALL,
            (true, _) => wanted,
        };
        self.wanted.store(wanted, Ordering::Relaxed);
        Ok(())
    }

    /// Sends a message to the importer if its category is enabled.
    pub(crate) fn emit(&self, status: FmiStatus, message: &str) {
        let category = match status {
            FmiStatus::Ok => 4,
            FmiStatus::Warning => 0,
            FmiStatus::Discard => 1,
            FmiStatus::Error => 2,
        };
        if self.wanted.load(Ordering::Relaxed) & (1 << category | ALL) == 0 {
            return;
        }
        // In messages "#" begins a value reference (FMI 2.0.4, section 2.1.5); the text contains no NUL after the
        // replacement.
        let text = CString::new(message.replace('#', "##").replace('\0', " ")).unwrap_or_default();
        self.sink.send(status, CATEGORIES[category], &text);
    }
}

impl Sink {
    fn send(&self, status: FmiStatus, category: &CStr, text: &CStr) {
        match self {
            Self::Fmi2 { logger: Some(logger), environment, name } => {
                // SAFETY: the importer's own function, called as the standard requires; the texts outlive the call. The
                // format consumes exactly the one argument that follows it.
                unsafe {
                    logger(*environment, name.as_ptr(), status, category.as_ptr(), c"%s".as_ptr(), text.as_ptr());
                }
            }
            Self::Fmi3 { logger: Some(logger), environment } => {
                // SAFETY: the importer's own function, called as the standard requires; the texts outlive the call.
                unsafe { logger(*environment, status, category.as_ptr(), text.as_ptr()) }
            }
            _ => {}
        }
    }
}
