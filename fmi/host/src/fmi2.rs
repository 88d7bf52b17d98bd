//! The FMI 2.0 co-simulation call sequence, function by function, over the C ABI.

use std::ffi::{CStr, c_char, c_void};

use tiprub_shell::{Failure, Result, schedule::Schedule};

use super::{
    UnpackedFmu, VariableType,
    api::{Fmi2Api, Fmi2Callbacks, InstancePointer},
    slave::{HostedSlave, MessageList, OutputGroup, c_text, call},
};

/// Co-simulation slave of fmi2Type.
const CO_SIMULATION: i32 = 1;

extern "C" fn allocate(count: usize, size: usize) -> *mut c_void {
    // SAFETY: calloc has no preconditions; the FMU returns the block through `release`.
    unsafe { libc::calloc(count, size) }
}

extern "C" fn release(block: *mut c_void) {
    // SAFETY: the block came from `allocate`, by the contract of the standard.
    unsafe { libc::free(block) }
}

/// Logger as seen by a caller that passes the format "%s" and one string.
///
/// Rust cannot define variadic functions. In the calling conventions of System V x86-64, AAPCS64 and Windows the six
/// pointer-sized arguments are passed in the same places whether or not the callee is variadic, so a plain function can
/// be used instead; Apple's convention on Arm puts them on the stack. Any other format is shown unchanged.
#[cfg(not(all(target_vendor = "apple", target_arch = "aarch64")))]
unsafe extern "C" fn log_message(
    environment: *mut c_void,
    _instance: *const c_char,
    _status: i32,
    _category: *const c_char,
    format: *const c_char,
    argument: *const c_char,
) {
    if format.is_null() || environment.is_null() {
        return;
    }
    // SAFETY: strings are zero-terminated by the standard; `argument` is read only for "%s"; the environment is
    // the message list of the slave, which outlives the instance.
    unsafe {
        let format = CStr::from_ptr(format);
        let text = if format.to_bytes() == b"%s" && !argument.is_null() { CStr::from_ptr(argument) } else { format };
        (*environment.cast::<MessageList>()).push(text);
    }
}

#[cfg(not(all(target_vendor = "apple", target_arch = "aarch64")))]
fn logger() -> *const c_void {
    log_message as *const c_void
}

#[cfg(all(target_vendor = "apple", target_arch = "aarch64"))]
fn logger() -> *const c_void {
    std::ptr::null()
}

/// One FMI 2.0 co-simulation instance; freed when dropped.
pub(super) struct Fmi2Slave {
    instance: InstancePointer,
    messages: Box<MessageList>,
    /// The FMU may keep the pointer to these callbacks.
    _callbacks: Box<Fmi2Callbacks>,
    /// Last field, so that the code is unloaded after everything else.
    api: Fmi2Api,
}

impl Fmi2Slave {
    /// Loads the library and creates an instance.
    pub(super) fn new(fmu: &UnpackedFmu) -> Result<Self> {
        let api = Fmi2Api::load(&fmu.library()?)?;
        let messages = Box::new(MessageList::default());
        let callbacks = Box::new(Fmi2Callbacks {
            logger: logger(),
            allocateMemory: allocate as *const c_void,
            freeMemory: release as *const c_void,
            stepFinished: std::ptr::null(),
            componentEnvironment: std::ptr::from_ref(messages.as_ref()).cast_mut().cast(),
        });
        let name = c_text(&fmu.description.model_name)?;
        let token = c_text(&fmu.description.token)?;
        let resources = c_text(&file_uri(&fmu.resources().to_string_lossy(), cfg!(windows)))?;
        // SAFETY: all strings outlive the call, and the callbacks outlive the instance.
        let instance = unsafe {
            (api.fmi2Instantiate)(name.as_ptr(), CO_SIMULATION, token.as_ptr(), resources.as_ptr(), &*callbacks, 0, 0)
        };
        if instance.is_null() {
            return Err(Failure::new("FMU", format!("fmi2Instantiate failed{}", messages.last_words()), ""));
        }
        Ok(Self { instance, messages, _callbacks: callbacks, api })
    }
}

impl Drop for Fmi2Slave {
    fn drop(&mut self) {
        // SAFETY: the instance is alive until here and not used afterwards.
        unsafe { (self.api.fmi2FreeInstance)(self.instance) }
    }
}

impl HostedSlave for Fmi2Slave {
    fn initialise(&mut self, schedule: &Schedule) -> Result<()> {
        call!(self.fmi2SetupExperiment(0, 0.0, schedule.start, 1, schedule.stop), None)?;
        call!(self.fmi2EnterInitializationMode(), None)?;
        call!(self.fmi2ExitInitializationMode(), None)
    }

    fn do_step(&mut self, time: f64, step: f64) -> Result<()> {
        call!(self.fmi2DoStep(time, step, 1), Some(time))
    }

    fn read(&mut self, group: &OutputGroup, values: &mut Vec<f64>) -> Result<()> {
        let (references, count) = (group.references.as_ptr(), group.references.len());
        if group.kind == VariableType::Float64 {
            let at = values.len();
            values.resize(at + count, 0.0);
            return call!(self.fmi2GetReal(references, count, values[at..].as_mut_ptr()), None);
        }
        let mut integers = vec![0_i32; count];
        if group.kind == VariableType::Boolean {
            call!(self.fmi2GetBoolean(references, count, integers.as_mut_ptr()), None)?;
        } else {
            call!(self.fmi2GetInteger(references, count, integers.as_mut_ptr()), None)?;
        }
        values.extend(integers.into_iter().map(f64::from));
        Ok(())
    }

    fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        call!(self.fmi2SetReal(&raw const reference, 1, &raw const value), None)
    }

    fn terminate(&mut self) -> Result<()> {
        call!(self.fmi2Terminate(), None)
    }

    fn messages(&self) -> Vec<String> {
        self.messages.all()
    }
}

/// Returns a file URI by RFC 8089, with everything but unreserved characters percent-encoded; on Windows the path has a
/// drive.
fn file_uri(path: &str, windows: bool) -> String {
    use std::fmt::Write as _;
    let (path, kept): (String, &[u8]) =
        if windows { (format!("/{}", path.replace('\\', "/")), b"/-._~:") } else { (path.to_owned(), b"/-._~") };
    let mut uri = String::from("file://");
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || kept.contains(&byte) {
            uri.push(char::from(byte));
        } else {
            let _ = write!(uri, "%{byte:02X}");
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_are_encoded() {
        assert_eq!(file_uri("/tmp/a b/ü", false), "file:///tmp/a%20b/%C3%BC");
        assert_eq!(file_uri(r"C:\tmp\a b", true), "file:///C:/tmp/a%20b");
    }

    #[test]
    fn the_logger_reads_format_and_argument() {
        let messages = MessageList::default();
        let environment: *mut c_void = std::ptr::from_ref(&messages).cast_mut().cast();
        type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, i32, *const c_char, *const c_char, ...);
        // SAFETY: the first six arguments use the same registers, as explained at `log_message`.
        let log = unsafe { std::mem::transmute::<*const c_void, Logger>(logger()) };
        // SAFETY: a variadic call as an FMU makes it, with live strings.
        unsafe {
            log(environment, c"i".as_ptr(), 3, c"error".as_ptr(), c"%s".as_ptr(), c"100 % wrong".as_ptr());
            log(environment, std::ptr::null(), 0, std::ptr::null(), c"plain".as_ptr());
            log(environment, std::ptr::null(), 0, std::ptr::null(), std::ptr::null());
        }
        assert_eq!(messages.all(), ["100 % wrong", "plain"]);
    }
}
