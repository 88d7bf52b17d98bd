//! One error type for the floor: every variant names what, where and the remedy.

use thiserror::Error;

/// What can go wrong when a scene is compiled or stepped.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// A value in the scene or the ROM is outside what the method allows.
    #[error("{what}: {problem}. {remedy}")]
    Invalid {
        /// The field, array or variable, as the user wrote it.
        what: String,
        /// What is wrong with it, with its value.
        problem: String,
        /// What to do about it.
        remedy: String,
    },
    /// A value reference that the table does not hold.
    #[error(
        "value reference {reference} does not exist in this FMU. Take it from modelDescription.xml of the same FMU"
    )]
    UnknownReference {
        /// The reference as given.
        reference: u32,
    },
    /// The scheme would be unstable, or the contact problem not solvable, with these settings.
    #[error("refused: {problem}. {remedy}")]
    Unstable {
        /// Which limit is exceeded, with numbers.
        problem: String,
        /// Which setting to change, and to what.
        remedy: String,
    },
    /// The state became non-finite during a step.
    #[error("the state became non-finite between t = {last_good_time} s and t = {time} s. {remedy}")]
    NonFinite {
        /// The last communication point with a finite state (s).
        last_good_time: f64,
        /// Internal time at which it was found (s).
        time: f64,
        /// What to do about it.
        remedy: String,
    },
    /// A saved state does not belong to this scene, or is damaged.
    #[error("the saved state cannot be restored: {problem}")]
    State {
        /// What does not fit.
        problem: String,
    },
}

impl Error {
    /// Shorthand for [`Error::Invalid`].
    pub fn invalid(what: impl Into<String>, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), problem: problem.into(), remedy: remedy.into() }
    }
}

/// A number as a user would write it: 1e308 has no three hundred zeros.
pub(crate) fn number(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-5..1e7).contains(&value.abs());
    if plain { format!("{value}") } else { format!("{value:e}") }
}

/// Result of this floor.
pub type Result<T, E = Error> = core::result::Result<T, E>;

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_stay_short_and_exact() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "-0"),
            (2.1, "2.1"),
            (-1e-5, "-0.00001"),
            (9.5e-6, "9.5e-6"),
            (1e7, "1e7"),
            (-1e308, "-1e308"),
            (5e-324, "5e-324"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(value), text);
            assert!(
                number(value).parse::<f64>().is_ok_and(|parsed| parsed.to_bits() == value.to_bits() || value.is_nan())
            );
        }
    }
}
