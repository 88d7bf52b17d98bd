//! Contact stepping of reduced-order models: everything that runs inside `doStep`.
//!
//! Floor 0. The crate takes and returns plain data: no files, no clock and no printing. A step allocates nothing. Threads
//! exist only if the parameter `threads` is above 1: they are created at initialisation or when a state is restored. SI units everywhere (m, kg, s, N, rad).
//!
//! A [`Scene`] (settings and a [`Rom`]) is compiled once into a [`Simulation`]. The simulation owns the [`VariableTable`], from which all
//! texts and calls for importers are derived, and steps the contact problem from one communication point to the next.
#![forbid(unsafe_op_in_unsafe_fn)]

pub mod contact;
pub mod geometry;
pub mod limits;
mod math;
pub mod modes;
pub mod scene;
pub mod simulation;
pub mod system;
pub mod time;

pub use scene::Scene;
pub use scene::rom::Rom;
pub use simulation::Simulation;
pub use system::Ledger;
pub use tiprub_cosim::{CoSimulation, Error, Result, VariableTable, Warning};
