//! The report of a run: one HTML file that opens offline.

pub mod page;
pub mod sections;
