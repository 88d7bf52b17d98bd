//! Fields of a run over time, for ParaView.
//!
//! - [`shape_file`]: the surface of a model and its displacements per reduced coordinate, in a file beside the ROM;
//! - [`vtu`]: one file with points, cells and fields (`.vtu`);
//! - [`structure`]: geometry and displacements of one structure of a scene;
//! - [`animation`]: a compact copy of a run for a picture that moves;
//! - [`series`]: the files of a run, one `.vtu` per part and time, and the `.pvd` that lists them.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

pub mod animation;
mod cells;
mod ring;
pub mod series;
pub mod shape_file;
pub mod structure;
pub mod vtu;

pub use series::{FieldOptions, FieldSeries, observed_scene};
