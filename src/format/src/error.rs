//! One error type: every variant contains the file, the place in it, the problem and the remedy.

use std::path::Path;

use thiserror::Error;

/// Reason why a scene, a ROM or a resources directory was rejected.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Error {
    /// A ROM file is damaged, incomplete, or not a ROM file.
    #[error("{origin}: {what}: {problem}. {remedy}")]
    Rom {
        /// File name, as given by the caller.
        origin: String,
        /// Array or metadata entry.
        what: String,
        /// The problem.
        problem: String,
        /// The remedy.
        remedy: String,
    },
    /// A scene file has wrong syntax, a wrong key or a wrong value.
    #[error("{origin}{}: {what}: {problem}. {remedy}", place(.position))]
    Scene {
        /// File name, as given by the caller.
        origin: String,
        /// Line and column (both from 1, columns in characters), where known.
        position: Option<(usize, usize)>,
        /// Field path, for example `contact[1].gap`.
        what: String,
        /// The problem.
        problem: String,
        /// The remedy.
        remedy: String,
    },
    /// A file could not be read.
    #[error("{path}: {problem}. {remedy}")]
    File {
        /// Path as it was opened.
        path: String,
        /// The problem, as the operating system words it.
        problem: String,
        /// The remedy.
        remedy: String,
    },
}

fn place(position: &Option<(usize, usize)>) -> String {
    position.map(|(line, column)| format!(":{line}:{column}")).unwrap_or_default()
}

impl Error {
    /// Shorthand for [`Error::File`].
    pub(crate) fn file(path: &Path, problem: impl ToString, remedy: impl Into<String>) -> Self {
        Self::File { path: path.display().to_string(), problem: problem.to_string(), remedy: remedy.into() }
    }
}
