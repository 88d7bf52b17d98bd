//! Heat conduction of a reduced-order model: everything that runs inside `doStep` of the thermal unit.
//!
//! Floor 0, beside the contact simulation of `tiprub-core`, of which it takes the table of variables, errors and saved bytes. A
//! [`ConductionModel`] is plain data; a [`ThermalSimulation`] solves C Ṫ + (K + s_g H_g + s_a H_a) T = heat exactly over each communication step, for
//! inputs that are linear in it, whatever its length. No files, no threads, no clock, no printing. SI units; temperatures are
//! differences from a reference (K).
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

mod access;
mod course;
mod exponential;
mod model;
mod operator;
mod outputs;
mod simulation;
mod state;
mod table;
mod tangent;

pub use model::{ConductionModel, LARGEST_ORDER};
pub use simulation::ThermalSimulation;
pub use state::ThermalInputs;
