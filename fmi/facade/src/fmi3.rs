//! The 75 functions of FMI 3.0, named and typed as `fmi3FunctionTypes.h` (3.0.2) declares them. Each is one expression
//! that passes the guard; none has an unsafe block.
#![allow(non_snake_case, reason = "names of the standard")]
#![allow(clippy::too_many_arguments, reason = "signatures of the standard")]

pub(crate) mod common;
mod refused;
mod step;
mod values;

/// `fmi3Boolean`, `fmi3Clock`: a C `bool`, read as a byte because an importer's byte may hold anything.
pub type Boolean = u8;
