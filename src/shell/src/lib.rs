//! Parts that the programs around the core share.
//!
//! - [`failure`], [`console`]: errors as text and JSON; the terminal and progress;
//! - [`output_file`], [`places`]: files that are written completely or not at all, and the check that no output is an input;
//! - [`schedule`], [`history`], [`native`], [`recording`], [`extremes`], [`means`]: communication points, inputs, the run without FMI, its
//!   table of results, and their summary;
//! - [`forecast`]: progress of long work and its remaining time;
//! - [`sweep`]: independent runs in parallel.

pub mod console;
pub mod extremes;
pub mod failure;
pub mod forecast;
pub mod history;
pub mod means;
pub mod native;
pub mod output_file;
pub mod places;
pub mod recording;
pub mod schedule;
pub mod sweep;

pub use failure::{Failure, Result};
