//! The 44 functions of FMI 2.0, named and typed as `fmi2FunctionTypes.h` (2.0.4) declares them. Each is one expression
//! that passes the guard; none has an unsafe block.
#![allow(non_snake_case, reason = "names of the standard")]
#![allow(clippy::too_many_arguments, reason = "signatures of the standard")]

mod co_simulation;
pub(crate) mod common;
mod model_exchange;

/// `fmi2Boolean`: a C `int`.
pub type Boolean = i32;
