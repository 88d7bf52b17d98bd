//! Error type of the command line: place, problem and remedy, and the matching exit code.

use std::fmt;
use std::ops::Deref;
use std::path::Path;

use tiprub_cosim::{Diagnostic, Warning};

use crate::console::warnings_json;

/// Reason why a command failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Problem with the file, option or scene field, and the remedy.
    pub diagnostic: Diagnostic,
    /// True if the command line itself is wrong (exit code 2), false if the work failed (exit code 1).
    pub usage: bool,
    /// Warnings before the failure, which often name its cause.
    pub warnings: Vec<Warning>,
}

/// Operations that fail on a file that is only read.
const READING: [&str; 2] = ["cannot be read", "cannot be opened"];

/// Result type of this crate.
pub type Result<T, E = Failure> = std::result::Result<T, E>;

impl Failure {
    /// Creates a failure of the work: exit code 1.
    pub fn new(what: impl fmt::Display, problem: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Diagnostic::new(what, problem, remedy).into()
    }

    /// Creates a failure of the command line: exit code 2.
    pub fn usage(what: impl fmt::Display, problem: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self { usage: true, ..Self::new(what, problem, remedy) }
    }

    /// Adds the warnings that occurred before the failure.
    #[must_use]
    pub fn with_warnings(self, warnings: Vec<Warning>) -> Self {
        Self { warnings, ..self }
    }

    /// Creates a failure from an error of a lower layer while handling `what`; the text of the error already contains place, problem and remedy.
    pub fn from_below(what: impl fmt::Display, error: impl fmt::Display) -> Self {
        Self::new(what, error, "")
    }

    /// Creates a failure from an error of the core while handling `what`.
    pub fn from_core(what: impl fmt::Display, error: tiprub_cosim::Error) -> Self {
        error.into_diagnostic().at(what).into()
    }

    /// Adds the file or other place that contains the subject.
    #[must_use]
    pub fn at(self, place: impl fmt::Display) -> Self {
        Self { diagnostic: self.diagnostic.at(place), ..self }
    }

    /// Creates a failure of a file operation.
    pub fn file(path: &Path, doing: &str, error: &std::io::Error) -> Self {
        let remedy = match error.kind() {
            std::io::ErrorKind::NotFound => "Check the path",
            std::io::ErrorKind::PermissionDenied if READING.contains(&doing) => "Check the permissions",
            std::io::ErrorKind::PermissionDenied => "Check the permissions, or choose another location",
            std::io::ErrorKind::StorageFull => "Free some space, or choose another location",
            std::io::ErrorKind::InvalidInput => "Give a regular file",
            std::io::ErrorKind::FileTooLarge => "Check that this is the intended file",
            std::io::ErrorKind::IsADirectory => "Give a file, not a directory",
            _ => "Check the path and the disk",
        };
        Self::new(path.display(), format!("{doing}: {error}"), remedy)
    }

    /// Returns the process exit code.
    pub fn exit_code(&self) -> u8 {
        if self.usage { 2 } else { 1 }
    }

    /// Returns the failure as a JSON object, for `--json`.
    pub fn to_json(&self) -> serde_json::Value {
        let mut json = serde_json::json!({
            "error": { "what": self.subject(), "problem": self.problem, "remedy": self.remedy, "exit_code": self.exit_code() }
        });
        if !self.warnings.is_empty() {
            [json["warnings"], json["warning_details"]] = warnings_json(&self.warnings);
        }
        json
    }
}

/// Ends `text` with exactly one full stop, unless it ends in a question mark or an ellipsis.
fn sentence(text: &str) -> String {
    let text = text.trim_end();
    if text.ends_with("...") {
        return text.to_string();
    }
    let text = text.trim_end_matches('.');
    if text.ends_with('?') { text.to_string() } else { format!("{text}.") }
}

impl fmt::Display for Failure {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // File names may contain line breaks.
        write!(out, "{}: {}", self.subject().replace('\n', "\\n"), sentence(&self.problem))?;
        if self.remedy.is_empty() { Ok(()) } else { write!(out, " {}", sentence(&self.remedy)) }
    }
}

impl std::error::Error for Failure {}

impl From<Diagnostic> for Failure {
    fn from(diagnostic: Diagnostic) -> Self {
        Self { diagnostic, usage: false, warnings: Vec::new() }
    }
}

impl Deref for Failure {
    type Target = Diagnostic;

    fn deref(&self) -> &Diagnostic {
        &self.diagnostic
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_has_subject_problem_and_remedy() {
        let failure = Failure::new("a.toml", "no such field `gapp`", "Did you mean `gap`?");
        assert_eq!(failure.to_string(), "a.toml: no such field `gapp`. Did you mean `gap`?");
        assert_eq!(Failure::from_below("x.fmu", "truncated.").to_string(), "x.fmu: truncated.");
    }

    #[test]
    fn proposes_another_location_only_for_write_failures() {
        let denied = std::io::Error::from(std::io::ErrorKind::PermissionDenied);
        let remedy = |doing| Failure::file(Path::new("a.so"), doing, &denied).diagnostic.remedy;
        assert_eq!(remedy("cannot be read"), "Check the permissions");
        assert!(remedy("cannot be written").contains("another location"));
    }

    #[test]
    fn exit_codes_follow_the_cause() {
        assert_eq!(Failure::new("a", "b", "c").exit_code(), 1);
        assert_eq!(Failure::usage("a", "b", "c").exit_code(), 2);
        assert_eq!(Failure::usage("a", "b", "c").to_json()["error"]["exit_code"], 2);
    }
}
