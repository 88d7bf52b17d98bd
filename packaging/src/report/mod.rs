//! The report of a run: one HTML file that opens offline.

pub mod decimate;
pub mod page;
pub mod picture;
pub mod plots;
pub mod sections;
pub mod waterfall;
