//! Heat conduction of a reduced-order model: all code that runs inside `doStep` of the thermal unit.
//!
//! A co-simulation unit beside the contact simulation of `tiprub-core`. A [`ConductionModel`] is plain data; a [`ThermalSimulation`] solves C Ṫ + (K + s_g H_g + s_a H_a) T =
//! heat exactly over each communication step of any length, for inputs that are linear in it. It uses no files, no
//! threads, no clock, and prints nothing. All quantities are in SI units; temperatures are differences from a
//! reference (K).
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

mod exponential;
mod model;
mod operator;
mod outputs;
mod simulation;
mod state;
mod table;
mod tangent;
mod unit;

pub use model::{ConductionModel, LARGEST_ORDER};
pub use simulation::ThermalSimulation;
