//! Loading of the unit in the resources of an FMU.

use std::path::Path;

use tiprub_cosim::{CoSimulation, Diagnostic, Result};

/// Content of the resources of an FMU.
pub struct Loaded {
    /// Creates the unit, with start values set and nothing computed. Called after the token has been checked.
    pub unit: Box<dyn FnOnce() -> Result<Box<dyn CoSimulation>>>,
    /// Instantiation token that belongs to the resources.
    pub token: String,
    /// True if the FMI 3.0 description has arrays, otherwise scalars as in FMI 2.0.
    pub fmi3_arrays: bool,
    /// Name and version of the library for messages; a program that packages the library searches its bytes for this
    /// text.
    pub release: &'static str,
}

/// Reads the unit of a library from the unpacked directory `resources/`.
pub type Load = fn(&Path) -> Result<Loaded, Diagnostic>;
