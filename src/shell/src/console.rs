//! Terminal output of a command: progress on stderr, one result on stdout.

use std::{
    borrow::Cow,
    io::{IsTerminal, Write},
    path::Path,
    process::ExitCode,
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};

use tiprub_cosim::warning::{self, Warning};

use crate::{Failure, Result};

/// Escapes control characters and marks of writing direction, which names and descriptions in files may contain, as `\u{1b}` and the like. Line
/// breaks are kept.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |character| format!("\\u{{{:x}}}", u32::from(character)))
}

/// Escapes these characters in JSON, where only strings can contain them.
fn printable_json(text: &str) -> Cow<'_, str> {
    escaped(text, |character| format!("\\u{:04x}", u32::from(character)))
}

/// Returns a path as text for messages and JSON; invalid characters are replaced.
pub fn shown_path(path: &Path) -> String {
    path.display().to_string()
}

fn escaped(text: &str, shown: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let each = |character: char| if is_obeyed(character) { shown(character) } else { character.to_string() };
    Cow::Owned(text.chars().map(each).collect())
}

fn is_obeyed(character: char) -> bool {
    let turns = matches!(character, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    turns || (character.is_control() && !matches!(character, '\n' | '\t'))
}

/// Exit code if the reader of stdout closed it early, such as `head`: the code that shells report for a program ended by SIGPIPE.
const READER_LEFT: u8 = 128 + 13;
/// Environment variable that suppresses the text of errors printed as JSON. The Python module sets it, so that a caught error prints nothing.
pub const ERRORS_IN_JSON: &str = "TIPRUB_ERRORS_IN_JSON";

/// Result of a command, as text and as JSON.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CommandOutcome {
    /// Answer as text.
    pub text: String,
    /// Warnings that belong to the answer; they are printed after it on stderr.
    pub warnings: Vec<Warning>,
    /// Lines after the warnings, with references to more results.
    pub rest: String,
    /// Answer as one JSON object.
    pub json: serde_json::Value,
    /// Failure of a command that has an answer nevertheless. It is printed after the answer, and determines the exit code.
    pub failure: Option<Failure>,
}

impl CommandOutcome {
    /// Returns the JSON object; if there is a failure, with the key `error`.
    fn json(&self) -> serde_json::Value {
        let mut json = self.json.clone();
        if let Some(failure) = &self.failure {
            json["error"] = failure.to_json()["error"].take();
        }
        json
    }
}

/// Returns warnings as JSON: their full texts, and their identifiers, levels and lines in the same order.
pub fn warnings_json(warnings: &[Warning]) -> [serde_json::Value; 2] {
    let each = |warning: &Warning| {
        let [problem, remedy] = warning.lines();
        let (id, level) = (warning.topic().id(), warning.level().name());
        serde_json::json!({ "id": id, "level": level, "problem": problem, "remedy": remedy })
    };
    [warning::texts(warnings).into(), warnings.iter().map(each).collect()]
}

/// Returns two lines for every topic: its first warning, and the number of others.
fn warning_lines(warnings: &[Warning]) -> Vec<String> {
    let first =
        |(index, warning): &(usize, &Warning)| !warnings[..*index].iter().any(|other| other.topic() == warning.topic());
    let lines = |(_, warning): (usize, &Warning)| {
        let alike = warnings.iter().filter(|other| other.topic() == warning.topic()).count();
        let more =
            if alike > 1 { format!(" ({} more of this kind, shown by --all)", alike - 1) } else { String::new() };
        let [problem, remedy] = warning.lines();
        format!("{} [{}] {problem}\n    {remedy}{more}", warning.level().name(), warning.topic().id())
    };
    warnings.iter().enumerate().filter(first).map(lines).collect()
}

/// Destination of progress and results.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    quiet: bool,
    json: bool,
    terminal: bool,
}

impl Console {
    /// Creates a console. `quiet` suppresses progress (warnings and errors stay); `json` prints results as one JSON object instead of text.
    pub fn new(quiet: bool, json: bool) -> Self {
        Self { quiet, json, terminal: std::io::stderr().is_terminal() }
    }

    /// Returns whether the result is printed as JSON.
    pub fn is_json(&self) -> bool {
        self.json
    }

    /// Prints one line of progress on stderr.
    pub fn print_progress(&self, line: impl std::fmt::Display) {
        if !self.quiet {
            // A closed stderr must not stop the work.
            let _ = writeln!(std::io::stderr(), "{}", printable(&line.to_string()));
        }
    }

    /// Prints warnings without an identifier, one line each, on stderr; `quiet` does not suppress them.
    pub fn warn_texts(&self, warnings: &[String]) {
        self.warn_lines(&warnings.iter().map(|warning| format!("warning: {warning}")).collect::<Vec<_>>());
    }

    /// Prints warnings that are already formatted, on stderr; `quiet` does not suppress them.
    pub fn warn_lines(&self, warnings: &[String]) {
        for warning in warnings {
            // A closed stderr must not stop the work.
            let _ = writeln!(std::io::stderr(), "{}", printable(warning));
        }
    }

    /// Prints warnings, two lines for every topic, on stderr; `quiet` does not suppress them.
    pub fn warn(&self, warnings: &[Warning]) {
        self.warn_lines(&warning_lines(warnings));
    }

    /// Starts a task of known length (`Some(total)`) or of unknown length (`None`: a spinner).
    pub fn task(&self, title: &str, total: Option<u64>) -> Task {
        if self.quiet {
            return Task { bar: ProgressBar::hidden(), lines: false };
        }
        if !self.terminal {
            self.print_progress(format!("{title} ..."));
            return Task { bar: ProgressBar::hidden(), lines: true };
        }
        let bar = total.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
        let template = match total {
            Some(_) => "{msg:<44} [{bar:30}] {pos}/{len} {elapsed}",
            None => "{msg:<44} {spinner} {elapsed}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(printable(title).into_owned());
        bar.enable_steady_tick(Duration::from_millis(120));
        Task { bar, lines: false }
    }

    /// Prints the result on stdout, or the failure. Returns the exit code of the program.
    pub fn finish(&self, result: Result<CommandOutcome>) -> ExitCode {
        match result.and_then(|outcome| self.deliver(&outcome)) {
            Ok(code) => code,
            Err(failure) => {
                self.fail(&failure);
                ExitCode::from(failure.exit_code())
            }
        }
    }

    /// Prints the result of the command on stdout.
    ///
    /// # Errors
    /// Stdout does not accept all bytes, for example a file on a full disk.
    fn deliver(&self, outcome: &CommandOutcome) -> Result<ExitCode> {
        let json = self.json.then(|| format!("{:#}", outcome.json()));
        let text = json.as_deref().map_or_else(|| printable(outcome.text.trim_end()), printable_json);
        let code = print(&text)?;
        self.warn(&outcome.warnings);
        if let Some(failure) = &outcome.failure {
            self.print_error(failure);
            return Ok(ExitCode::from(failure.exit_code()));
        }
        if self.json || outcome.rest.is_empty() || code != ExitCode::SUCCESS {
            return Ok(code);
        }
        print(&printable(outcome.rest.trim_end()))
    }

    /// Prints a failure: text on stderr, and with `--json` the object on stdout. A caller that reports the object itself sets the environment variable
    /// [`ERRORS_IN_JSON`] to suppress the text.
    pub fn fail(&self, failure: &Failure) {
        self.warn(&failure.warnings);
        self.print_error(failure);
        self.answer(failure);
    }

    /// Prints a failure on stderr, unless its text is suppressed.
    fn print_error(&self, failure: &Failure) {
        if self.prints_errors() {
            let _ = writeln!(std::io::stderr(), "error: {}", printable(&failure.to_string()));
        }
    }

    /// Returns whether errors are printed as text.
    pub fn prints_errors(&self) -> bool {
        !self.json || std::env::var_os(ERRORS_IN_JSON).is_none()
    }

    /// Prints the object of a failure on stdout if `--json` is set.
    pub fn answer(&self, failure: &Failure) {
        if self.json {
            let _ = writeln!(std::io::stdout(), "{}", printable_json(&format!("{:#}", failure.to_json())));
        }
    }
}

/// Prints a text on stdout, with a line break at its end.
fn print(text: &str) -> Result<ExitCode> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(ExitCode::from(READER_LEFT)),
        Err(error) => Err(Failure::file(Path::new("stdout"), "cannot be written", &error)),
    }
}

/// Running task; its progress line disappears when it is dropped.
#[derive(Debug)]
pub struct Task {
    bar: ProgressBar,
    /// True if progress is printed line by line: stderr is not a terminal, and progress is not suppressed.
    lines: bool,
}

impl Task {
    /// Sets the number of finished units.
    pub fn at(&self, position: u64) {
        self.bar.set_position(position);
    }

    /// Prints a line of a long task if no progress bar is shown; without it, a task of minutes would look like a hang in a log.
    pub fn line(&self, line: &str) {
        if self.lines {
            // A closed stderr must not stop the work.
            let _ = writeln!(std::io::stderr(), "  {}", printable(line));
        }
    }

    /// Shows the current activity.
    pub fn now(&self, message: &str) {
        self.bar.set_message(printable(message).into_owned());
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_two_lines_per_topic_for_any_number_of_warnings() {
        use tiprub_cosim::warning::{Severity, Topic};
        let slow = |name: &str| Warning::new(Topic::Sticking, "too slow", "Turn faster").named(name);
        let flutter = Warning::new(Topic::Flutter, "contact grows", "Nothing to do").at_level(Severity::Note);
        let all = [slow("front"), flutter, slow("rear")];
        let lines = warning_lines(&all);
        assert_eq!(
            lines[0],
            "warning [sticking] front: too slow\n    Turn faster (1 more of this kind, shown by --all)"
        );
        assert_eq!(lines[1], "note [flutter] contact grows\n    Nothing to do");
        assert_eq!(lines.len(), 2);
        let [texts, details] = warnings_json(&all);
        assert_eq!((texts.as_array().unwrap().len(), &details[2]["id"]), (3, &serde_json::json!("sticking")));
    }

    #[test]
    fn control_characters_are_escaped() {
        assert!(matches!(printable("36 Schaufeln, µ = 0.15\n\tso"), Cow::Borrowed(_)));
        assert_eq!(printable("a\u{1b}[31m\u{7}b\rc\u{9b}d\u{202e}"), "a\\u{1b}[31m\\u{7}b\\u{d}c\\u{9b}d\\u{202e}");
        let json = serde_json::json!({ "name": "a\u{1b}\u{7f}\u{9b}\u{202e}b\n" });
        let text = format!("{json:#}");
        let shown = printable_json(&text);
        assert!(!shown.contains(is_obeyed), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), json);
    }
}
