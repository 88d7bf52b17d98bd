//! Contact stepping of reduced-order models: everything that runs inside `doStep`.
//!
//! Floor 0. The crate takes and returns plain data: no files, no threads, no clock, no printing, and no allocation between
//! [`Simulation::initialise`] and the end of the run. SI units everywhere (m, kg, s, N, rad).
//!
//! A [`Scene`] (settings and a [`Rom`]) is compiled once into a [`Simulation`]. The simulation owns the [`VariableTable`], from which all
//! texts and calls for importers are derived, and steps the contact problem from one communication point to the next.
#![forbid(unsafe_op_in_unsafe_fn)]

mod cubic;
pub mod dynamics;
mod error;
pub mod galerkin;
pub mod gaps;
mod history;
pub mod laws;
mod ledger;
pub mod persist;
pub mod plausibility;
pub mod ranges;
pub mod rom;
pub mod schemes;
pub mod settings;
pub mod simulation;
pub mod stability;
mod step;
pub mod system;
pub mod variables;
pub mod warning;

pub use error::{Error, Result, shown, shown_time};
pub use ledger::{Ledger, Sum};
pub use rom::Rom;
pub use settings::Scene;
pub use simulation::Simulation;
pub use variables::VariableTable;
pub use warning::Warning;
