//! The FMI 3.0 co-simulation call sequence, function by function, over the C ABI.

use std::ffi::{CStr, c_char, c_void};

use tiprub_shell::{Failure, Result, schedule::Schedule};

use super::{
    UnpackedFmu, VariableType,
    api::{Fmi3Api, InstancePointer, ReferencePointer},
    slave::{HostedSlave, MessageList, OutputGroup, c_text, call, check},
};

/// Logger; the environment is the message list of the slave.
unsafe extern "C" fn log_message(
    environment: *mut c_void,
    _status: i32,
    _category: *const c_char,
    message: *const c_char,
) {
    if environment.is_null() || message.is_null() {
        return;
    }
    // SAFETY: a zero-terminated string by the standard; the list outlives the instance.
    unsafe { (*environment.cast::<MessageList>()).push(CStr::from_ptr(message)) }
}

/// One FMI 3.0 co-simulation instance; freed when dropped.
pub(super) struct Fmi3Slave {
    instance: InstancePointer,
    messages: Box<MessageList>,
    /// Last field, so that the code is unloaded after everything else.
    api: Fmi3Api,
}

impl Fmi3Slave {
    /// Loads the library and creates an instance.
    pub(super) fn new(fmu: &UnpackedFmu) -> Result<Self> {
        let api = Fmi3Api::load(&fmu.library()?)?;
        let messages = Box::new(MessageList::default());
        let name = c_text(&fmu.description.model_name)?;
        let token = c_text(&fmu.description.token)?;
        // FMI 3.0 requires an absolute native path with a trailing separator.
        let resources = c_text(&format!("{}/", fmu.resources().display()))?;
        // SAFETY: all strings outlive the call, and the message list outlives the instance.
        let instance = unsafe {
            (api.fmi3InstantiateCoSimulation)(
                name.as_ptr(),
                token.as_ptr(),
                resources.as_ptr(),
                false,
                false,
                false,
                false,
                std::ptr::null(),
                0,
                std::ptr::from_ref(messages.as_ref()).cast_mut().cast(),
                Some(log_message),
                None,
            )
        };
        if instance.is_null() {
            let problem = format!("fmi3InstantiateCoSimulation failed{}", messages.last_words());
            return Err(Failure::new("FMU", problem, ""));
        }
        Ok(Self { instance, messages, api })
    }

    /// Reads `group.values` numbers with one getter.
    fn get<T: Copy + Default>(
        &self,
        function: &str,
        get: unsafe extern "C" fn(InstancePointer, ReferencePointer, usize, *mut T, usize) -> i32,
        group: &OutputGroup,
    ) -> Result<Vec<T>> {
        let mut values = vec![T::default(); group.values];
        let references = &group.references;
        // SAFETY: the two counts are the lengths of the two arrays.
        let status =
            unsafe { get(self.instance, references.as_ptr(), references.len(), values.as_mut_ptr(), values.len()) };
        check(function, None, status, &self.messages)?;
        Ok(values)
    }
}

impl Drop for Fmi3Slave {
    fn drop(&mut self) {
        // SAFETY: the instance is alive until here and not used afterwards.
        unsafe { (self.api.fmi3FreeInstance)(self.instance) }
    }
}

impl HostedSlave for Fmi3Slave {
    fn initialise(&mut self, schedule: &Schedule) -> Result<()> {
        call!(self.fmi3EnterInitializationMode(false, 0.0, schedule.start, true, schedule.stop), None)?;
        call!(self.fmi3ExitInitializationMode(), None)
    }

    fn do_step(&mut self, time: f64, step: f64) -> Result<()> {
        let ([mut event, mut terminate, mut early], mut last_time) = ([false; 3], f64::NAN);
        let flags = [&raw mut event, &raw mut terminate, &raw mut early];
        call!(self.fmi3DoStep(time, step, true, flags[0], flags[1], flags[2], &raw mut last_time), Some(time))?;
        if terminate || early || last_time.to_bits() != (time + step).to_bits() {
            return Err(Failure::new(
                "FMU",
                format!("fmi3DoStep from {time} s with step size {step} s ended at {last_time} s"),
                "Report this to the author of the FMU: neither early return nor event mode was requested",
            ));
        }
        Ok(())
    }

    fn read(&mut self, group: &OutputGroup, values: &mut Vec<f64>) -> Result<()> {
        match group.kind {
            VariableType::Float64 => values.extend(self.get("fmi3GetFloat64", self.api.fmi3GetFloat64, group)?),
            VariableType::Int32 => {
                values.extend(self.get("fmi3GetInt32", self.api.fmi3GetInt32, group)?.into_iter().map(f64::from));
            }
            VariableType::Int64 => {
                let numbers = self.get("fmi3GetInt64", self.api.fmi3GetInt64, group)?;
                values.extend(numbers.into_iter().map(|number| number as f64));
            }
            // One byte each; anything but 0 is true.
            VariableType::Boolean => {
                let bytes = self.get("fmi3GetBoolean", self.api.fmi3GetBoolean, group)?;
                values.extend(bytes.into_iter().map(|byte| f64::from(u8::from(byte != 0))));
            }
            VariableType::Text => {}
        }
        Ok(())
    }

    fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        call!(self.fmi3SetFloat64(&raw const reference, 1, &raw const value, 1), None)
    }

    fn terminate(&mut self) -> Result<()> {
        call!(self.fmi3Terminate(), None)
    }

    fn messages(&self) -> Vec<String> {
        self.messages.all()
    }
}
