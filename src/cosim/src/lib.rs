//! Co-simulation units: what a simulation offers to the code that drives it.
//!
//! A unit has a table of variables with their current values, communication steps that consist of internal steps, and a state that can be
//! saved as bytes. The crate defines the interface of units ([`CoSimulation`]) and the types that appear in it. The contact simulation
//! (`tiprub-core`) and heat conduction (`tiprub-thermal`) are units; the C functions of FMI and the model descriptions work with any unit.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

pub mod bounds;
mod error;
mod input;
mod patch;
pub mod persist;
mod sum;
mod unit;
mod values;
pub mod variables;
pub mod warning;

pub use error::{Diagnostic, Error, Result, shown, shown_time};
pub use input::Input;
pub use patch::ThermalPatch;
pub use sum::Sum;
pub use unit::{CoSimulation, StepProgress};
pub use values::VariableValues;
pub use variables::{Value, VariableTable};
pub use warning::{Severity, Warning};
