//! The parts of an importer that both FMI versions share.

use std::{
    cell::RefCell,
    ffi::{CStr, CString},
};

use tiprub_shell::{Failure, Result, schedule::Schedule};

use super::{ImportedDescription, VariableType};

/// Neighbouring outputs of one type, read in one call.
pub(super) struct OutputGroup {
    /// Data type.
    pub(super) kind: VariableType,
    /// Value references.
    pub(super) references: Vec<u32>,
    /// Number of scalar values; arrays count with all elements.
    pub(super) values: usize,
}

/// A co-simulation instance of either FMI version.
pub(super) trait HostedSlave {
    /// Goes from instantiated to step mode.
    fn initialise(&mut self, schedule: &Schedule) -> Result<()>;
    /// Performs one communication step.
    fn do_step(&mut self, time: f64, step: f64) -> Result<()>;
    /// Appends the values of a group.
    fn read(&mut self, group: &OutputGroup, values: &mut Vec<f64>) -> Result<()>;
    /// Sets one real value.
    fn set_real(&mut self, reference: u32, value: f64) -> Result<()>;
    /// Ends the run.
    fn terminate(&mut self) -> Result<()>;
    /// Returns everything the FMU logged.
    fn messages(&self) -> Vec<String>;
}

pub(super) fn group_outputs(description: &ImportedDescription) -> Vec<OutputGroup> {
    let mut groups: Vec<OutputGroup> = Vec::new();
    for output in description.numeric_outputs() {
        if groups.last().is_none_or(|group| group.kind != output.kind) {
            groups.push(OutputGroup { kind: output.kind, references: Vec::new(), values: 0 });
        }
        if let Some(group) = groups.last_mut() {
            group.references.push(output.reference);
            group.values += output.elements.unwrap_or(1);
        }
    }
    groups
}

/// Log of the FMU; its logger reaches it through a pointer to this value.
#[derive(Debug, Default)]
pub(super) struct MessageList(RefCell<Vec<String>>);

impl MessageList {
    pub(super) fn push(&self, text: &CStr) {
        self.0.borrow_mut().push(text.to_string_lossy().into_owned());
    }

    pub(super) fn all(&self) -> Vec<String> {
        self.0.borrow().clone()
    }

    /// Returns the last message as the end of a sentence.
    pub(super) fn last_words(&self) -> String {
        self.0.borrow().last().map_or_else(|| " without a message".into(), |message| format!(": {message}"))
    }
}

/// Accepts OK and Warning; any other status is a failure with the message of the FMU.
pub(super) fn check(function: &str, time: Option<f64>, status: i32, messages: &MessageList) -> Result<()> {
    let status_name = match status {
        0 | 1 => return Ok(()),
        2 => "Discard",
        3 => "Error",
        4 => "Fatal",
        5 => "Pending",
        _ => "an unknown status",
    };
    let at = time.map(|time| format!(" at t = {time} s")).unwrap_or_default();
    Err(Failure::new("FMU", format!("{function}{at} returned {status_name}{}", messages.last_words()), ""))
}

/// Calls an FMI function of the slave's instance and checks its status. Error messages contain the time (s).
macro_rules! call {
    ($slave:ident.$function:ident($($argument:expr),* $(,)?), $time:expr) => {{
        // SAFETY: the instance is alive, and its functions are called in the order that the standard requires. Every
        // pointer refers to a single value, or to an array with as many values as the count that is passed with it.
        let status = unsafe { ($slave.api.$function)($slave.instance $(, $argument)*) };
        $crate::slave::check(stringify!($function), $time, status, &$slave.messages)
    }};
}
pub(super) use call;

/// Converts a string for C.
pub(super) fn c_text(text: &str) -> Result<CString> {
    CString::new(text).map_err(|_| Failure::new(format!("{text:?}"), "contains a zero byte", "Remove it"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuses_worse_than_warning_stop_with_the_last_message() {
        let messages = MessageList::default();
        messages.push(c"first");
        messages.push(c"speed is NaN");
        assert!(check("f", None, 0, &messages).is_ok() && check("f", None, 1, &messages).is_ok());
        let failure = check("fmi3DoStep", Some(0.5), 3, &messages).unwrap_err();
        assert_eq!(failure.problem, "fmi3DoStep at t = 0.5 s returned Error: speed is NaN");
    }

    #[test]
    fn rejects_file_that_is_not_a_library() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("tiprub.so");
        std::fs::write(&path, "text").unwrap();
        assert!(crate::api::Fmi3Api::load(&path).unwrap_err().problem.contains("cannot be loaded"));
    }
}
