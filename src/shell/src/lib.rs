//! What programs around the core share.
//!
//! - [`failure`], [`console`]: what went wrong, for people and programs; the terminal and progress;
//! - [`output_file`], [`places`]: files that appear whole or not at all, and no output that is an input;
//! - [`schedule`], [`history`], [`native`], [`recording`], [`extremes`]: communication points, inputs, the run without FMI, its table of
//!   results;
//! - [`forecast`]: progress of long work and how long the rest takes;
//! - [`sweep`]: runs that do not depend on each other.

pub mod console;
pub mod extremes;
pub mod failure;
pub mod forecast;
pub mod history;
pub mod native;
pub mod output_file;
pub mod places;
pub mod recording;
pub mod schedule;
pub mod sweep;

pub use failure::{Failure, Result};
