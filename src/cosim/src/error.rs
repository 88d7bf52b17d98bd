//! The error type of units: problems with place and remedy.

use std::fmt;

use thiserror::Error;

/// Problem, with its place and the remedy.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub struct Diagnostic {
    /// File or other container of the subject, if it is known.
    pub place: Option<Box<str>>,
    /// Field, array, variable or argument, as written by the user; empty if the problem names it.
    pub what: String,
    /// The problem, with the value.
    pub problem: String,
    /// The remedy, an imperative sentence without a full stop; empty if the problem contains it.
    pub remedy: String,
}

impl Diagnostic {
    /// Creates a diagnostic without a place.
    pub fn new(what: impl ToString, problem: impl ToString, remedy: impl ToString) -> Self {
        Self { place: None, what: what.to_string(), problem: problem.to_string(), remedy: remedy.to_string() }
    }

    /// Adds a place, before the place that is known.
    #[must_use]
    pub fn at(self, place: impl fmt::Display) -> Self {
        let place = self.place.map_or_else(|| place.to_string(), |inner| format!("{place}: {inner}"));
        Self { place: Some(place.into()), ..self }
    }

    /// Returns place and subject, separated by a colon.
    pub fn subject(&self) -> String {
        let parts = self.place.as_deref().into_iter().chain([&*self.what]).filter(|part| !part.is_empty());
        parts.collect::<Vec<_>>().join(": ")
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let subject = self.subject();
        let (colon, stop) =
            (if subject.is_empty() { "" } else { ": " }, if self.remedy.is_empty() { "" } else { ". " });
        write!(out, "{subject}{colon}{}{stop}{}", self.problem, self.remedy)
    }
}

/// Error of a unit.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// A value in the scene, in a model or of a variable is outside the range of the method.
    #[error(transparent)]
    Invalid(#[from] Diagnostic),
    /// The scheme would be unstable, or the contact problem not solvable, with these settings.
    #[error(transparent)]
    Unstable(Diagnostic),
    /// The state became non-finite during a step.
    #[error(transparent)]
    NonFinite(Diagnostic),
    /// A communication step takes more internal steps than allowed; the state is preserved.
    #[error(transparent)]
    Exhausted(Diagnostic),
    /// A saved state does not belong to this unit, or is damaged.
    #[error(transparent)]
    State(Diagnostic),
}

impl Error {
    /// Creates an [`Error::Invalid`].
    pub fn invalid(what: impl ToString, problem: impl ToString, remedy: impl ToString) -> Self {
        Self::Invalid(Diagnostic::new(what, problem, remedy))
    }

    /// Creates an [`Error::Unstable`] with the exceeded limit, and the setting to change with its new value.
    pub fn unstable(problem: impl ToString, remedy: impl ToString) -> Self {
        Self::Unstable(Diagnostic::new("", problem, remedy))
    }

    /// Creates an [`Error::NonFinite`] from the last communication point with a finite state and the time of its detection (s).
    pub fn non_finite(last_good_time: f64, time: f64, remedy: impl ToString) -> Self {
        let [last, time] = [last_good_time, time].map(shown_time);
        let problem = format!("the state became non-finite between t = {last} s and t = {time} s");
        Self::NonFinite(Diagnostic::new("", problem, remedy))
    }

    /// Creates an [`Error::State`] with the part of the state that does not fit.
    pub fn state(problem: impl fmt::Display) -> Self {
        Self::State(Diagnostic::new("", format!("the saved state cannot be restored: {problem}"), ""))
    }

    /// Returns the problem with its place and remedy.
    pub fn into_diagnostic(self) -> Diagnostic {
        match self {
            Self::Invalid(diagnostic)
            | Self::Unstable(diagnostic)
            | Self::NonFinite(diagnostic)
            | Self::Exhausted(diagnostic)
            | Self::State(diagnostic) => diagnostic,
        }
    }

    /// Adds the time (s) to the error.
    #[must_use]
    pub fn at_time(mut self, time: f64) -> Self {
        let time = shown_time(time);
        match &mut self {
            Self::Invalid(diagnostic) => diagnostic.what += &format!(" at t = {time} s"),
            Self::Unstable(diagnostic) => diagnostic.problem.insert_str(0, &format!("at t = {time} s ")),
            _ => {}
        }
        self
    }

    /// Replaces the name of a table of the scene file by that of the entry `at`, such as `contact` by `contact[2]`.
    #[must_use]
    pub fn placed(mut self, table: &str, at: &str) -> Self {
        if let Self::Invalid(Diagnostic { what, .. }) = &mut self
            && let Some(field) = what.strip_prefix(table).and_then(|field| field.strip_prefix('.'))
        {
            *what = format!("{at}.{field}");
        }
        self
    }
}

/// Formats a number for messages: plain, or with an exponent if that is shorter.
pub fn shown(value: f64) -> String {
    let size = value.abs();
    let plain = size == 0.0 || (1e-4..1e6).contains(&size) || !value.is_finite();
    if plain { format!("{value}") } else { format!("{value:e}") }
}

/// Formats a time (s) for messages: as [`shown`], without the digits beyond the 14th, which are rounding errors of summed steps.
pub fn shown_time(time: f64) -> String {
    shown(format!("{time:.13e}").parse().unwrap_or(time))
}

/// Result type of this crate.
pub type Result<T, E = Error> = core::result::Result<T, E>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_times_hide_accumulated_rounding() {
        for (time, text) in [
            (0.0007400000000000001, "0.00074"),
            (1_000_000.000_000_1, "1.0000000000001e6"),
            (0.0, "0"),
            (-1e-9, "-1e-9"),
        ] {
            assert_eq!(shown_time(time), text);
        }
        assert_eq!(shown_time(f64::INFINITY), "inf");
    }

    #[test]
    fn numbers_are_short_and_round_trip() {
        for (value, text) in [
            (0.0, "0"),
            (-0.25, "-0.25"),
            (1e-4, "0.0001"),
            (9.5e-5, "9.5e-5"),
            (999_999.5, "999999.5"),
            (-1e6, "-1e6"),
            (1e300, "1e300"),
            (f64::MIN_POSITIVE, "2.2250738585072014e-308"),
        ] {
            assert_eq!(shown(value), text);
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
        assert_eq!([f64::INFINITY, f64::NAN].map(shown), ["inf", "NaN"]);
        let error = Error::non_finite(1e300, 2e300, "Reset");
        assert_eq!(error.to_string(), "the state became non-finite between t = 1e300 s and t = 2e300 s. Reset");
    }
}
