//! Sweeps: many runs of a scene with other start values, scene fields or ROMs.
//!
//! A plan ([`plan`]) names a scene, its variables and a [`design`]: a grid, lists or a table. A [`part`] of it is the unit of work. The
//! [`engine`] runs a part on several threads, appends each finished row to a [`journal`], and writes the results as one Parquet file at the end.
//! A row is identified by a digest of everything that determines it, so that a sweep resumes with the runs that have no row yet.
//!
//! - [`fields`]: values of the keys of a scene file;
//! - [`cases`]: scene, models, start values and digest of one run;
//! - [`models`]: ROMs of a sweep, each read or reduced once;
//! - [`row`]: results of one run; [`result_file`]: the Parquet files;
//! - [`histories`]: outputs over time;
//! - [`plan_digest`]: comparison of the files of several machines.
//!
//! Studies store the results of their [`tasks`] in journals of the same kind.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

pub mod cases;
pub mod design;
pub mod engine;
pub mod fields;
pub mod histories;
pub mod journal;
pub mod models;
pub mod part;
pub mod plan;
pub mod plan_digest;
pub mod result_file;
pub mod row;
pub mod tasks;
#[cfg(test)]
mod tests;
