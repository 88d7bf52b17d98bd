//! The error type of this crate: every variant gives place, problem and remedy.

use thiserror::Error;

/// Error of compiling or stepping a scene.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// A value in the scene or the ROM is outside the range of the method.
    #[error("{what}: {problem}. {remedy}")]
    Invalid {
        /// The field, array or variable, as written by the user.
        what: String,
        /// The problem, with the value.
        problem: String,
        /// The remedy.
        remedy: String,
    },
    /// A value reference that is not in the table.
    #[error(
        "value reference {reference} does not exist in this FMU. Use a value reference of its modelDescription.xml"
    )]
    UnknownReference {
        /// The reference as given.
        reference: u32,
    },
    /// The scheme would be unstable, or the contact problem not solvable, with these settings.
    #[error("{problem}. {remedy}")]
    Unstable {
        /// The exceeded limit, with numbers.
        problem: String,
        /// The setting to change, and its new value.
        remedy: String,
    },
    /// The state became non-finite during a step.
    #[error("the state became non-finite between t = {} s and t = {} s. {remedy}", shown_time(*last_good_time), shown_time(*time))]
    NonFinite {
        /// The last communication point with a finite state (s).
        last_good_time: f64,
        /// Internal time at which the error was detected (s).
        time: f64,
        /// The remedy.
        remedy: String,
    },
    /// A communication step takes more internal steps than allowed; the state is preserved.
    #[error("{problem}. {remedy}")]
    Exhausted {
        /// The number of internal steps, and the time from which they were counted.
        problem: String,
        /// The remedy.
        remedy: String,
    },
    /// A saved state does not belong to this scene, or is damaged.
    #[error("the saved state cannot be restored: {problem}")]
    State {
        /// The part of the state that does not fit.
        problem: String,
    },
}

impl Error {
    /// Creates an [`Error::Invalid`].
    pub fn invalid(what: impl Into<String>, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// Adds the time (s) to the error.
    pub(crate) fn at_time(self, time: f64) -> Self {
        let time = shown_time(time);
        match self {
            Self::Invalid { what, problem, remedy } => {
                Self::Invalid { what: format!("{what} at t = {time} s"), problem, remedy }
            }
            Self::Unstable { problem, remedy } => {
                Self::Unstable { problem: format!("at t = {time} s {problem}"), remedy }
            }
            other => other,
        }
    }

    /// Places the error in a `table` of the scene file: replaces the name of the table by that of the entry `at`, such as `contact` by `contact[2]`.
    pub(crate) fn placed(self, table: &str, at: &str) -> Self {
        let rest = |what: &str| Some(format!("{at}.{}", what.strip_prefix(table)?.strip_prefix('.')?));
        match self {
            Self::Invalid { what, problem, remedy } => {
                Self::Invalid { what: rest(&what).unwrap_or(what), problem, remedy }
            }
            other => other,
        }
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
        let error = Error::NonFinite { last_good_time: 1e300, time: 2e300, remedy: "Reset".into() };
        assert_eq!(error.to_string(), "the state became non-finite between t = 1e300 s and t = 2e300 s. Reset");
    }
}
