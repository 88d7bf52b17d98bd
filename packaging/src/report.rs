//! Report of a run: one HTML file that opens offline.

pub mod input;
pub mod page;
pub mod sections;
