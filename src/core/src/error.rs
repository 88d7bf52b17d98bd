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

/// Result of this floor.
pub type Result<T, E = Error> = core::result::Result<T, E>;
