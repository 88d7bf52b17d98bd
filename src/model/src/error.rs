//! Error type of the crate: every variant states the place, the problem and the remedy.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;
use tiprub_cosim::Diagnostic;

use crate::element::ElementKind;

/// Error in the steps from a mesh to a reduced model.
#[derive(Debug, Error)]
pub enum Error {
    /// A value, set or count is out of range.
    #[error(transparent)]
    Invalid(Diagnostic),
    /// An element is inverted or degenerate.
    #[error(
        "element {element} ({}): the Jacobian determinant at integration point {point} is {determinant:.3e}, not \
         positive. Check its node order and its distortion",
        kind.calculix_name()
    )]
    NegativeJacobian {
        /// Number of the element, counted from 1 as in an exported file.
        element: usize,
        /// Kind of the element.
        kind: ElementKind,
        /// Integration point, counted from 1.
        point: usize,
        /// Jacobian determinant there (m³ per unit of natural volume).
        determinant: f64,
    },
    /// A Cholesky factorisation found a pivot that is not positive.
    #[error("the matrix {matrix} is not positive definite. {remedy}")]
    NotPositiveDefinite {
        /// The matrix.
        matrix: String,
        /// The remedy.
        remedy: String,
    },
    /// The eigenvalue iteration ended before all requested pairs converged.
    #[error(
        "only {converged} of {wanted} eigenpairs converged to {tolerance:.1e} in a Krylov basis of {basis} vectors. \
         Request more modes, which enlarges the basis, and check the lengths (in m) and the mesh for loosely connected parts"
    )]
    NotConverged {
        /// Number of requested pairs.
        wanted: usize,
        /// Number of pairs that reached the tolerance.
        converged: usize,
        /// Size of the basis when the iteration ended.
        basis: usize,
        /// Relative tolerance.
        tolerance: f64,
    },
    /// The crate `tiprub-core` rejected the reduced model.
    #[error(transparent)]
    Core(#[from] tiprub_core::Error),
    /// The contents of a file cannot be used.
    #[error(transparent)]
    Read(Diagnostic),
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The message of the operating system.
        source: std::io::Error,
    },
}

impl Error {
    /// Shorthand for [`Error::Invalid`].
    pub fn invalid(what: impl ToString, problem: impl ToString, remedy: impl ToString) -> Self {
        Self::Invalid(Diagnostic::new(what, problem, remedy))
    }

    /// Creates an [`Error::Read`]. The place is a file and line (from 1), a byte of a binary file, or a record.
    pub(crate) fn read(place: impl fmt::Display, problem: impl ToString, remedy: impl ToString) -> Self {
        Self::Read(Diagnostic::new("", problem, remedy).at(place))
    }
}

/// Result of this crate.
pub type Result<T, E = Error> = core::result::Result<T, E>;
