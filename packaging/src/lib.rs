//! The `tiprub` command line as a library: reduce, package, run, demo, inspect.
//!
//! Top floor: it wires the lower floors together and owns everything that touches files, processes and the
//! terminal. [`commands`] holds one module per command; the rest are the parts they share.
//!
//! - [`scene_source`]: a scene file (or the embedded rotor 37 scene) with its ROMs;
//! - [`builtin`], [`rom_cache`]: the models that ship, reduced once and kept in the user's cache directory;
//! - [`scene_features`]: what a scene asks for beyond a plain rub, and its limits, in words;
//! - [`rom_facts`], [`step_limits`]: what is to be known of a ROM before it is trusted;
//! - [`schedule`], [`recording`], [`native`]: communication points, the table of results, the run without FMI;
//! - [`error_study`]: error against run time for every scheme and solver;
//! - [`archive`], [`fmu`], [`library`]: the reproducible zip, its contents, and the shared library that goes in;
//! - [`importer`]: a packaged FMU driven through its C ABI the way any importer would;
//! - [`casing_arguments`], [`file_arguments`]: what can be asked for of a casing, of a model of one's own;
//! - [`users_model`], [`mod@reduced`]: such a model read, judged, reduced; what is written and told of any reduced model;
//! - [`places`], [`output_file`]: what a command reads and writes, kept apart; files that appear whole or not at all;
//! - [`report`]: the HTML report with its pictures and plots.

pub mod archive;
pub mod builtin;
pub mod casing_arguments;
pub mod cli;
pub mod commands;
pub mod console;
pub mod cube_models;
pub mod error_study;
pub mod extremes;
pub mod failure;
pub mod file_arguments;
pub mod fmu;
pub mod importer;
pub mod library;
pub mod native;
pub mod output_file;
pub mod places;
pub mod recording;
pub mod reduced;
pub mod reduction;
pub mod report;
pub mod rom_cache;
pub mod rom_facts;
pub mod scene_features;
pub mod scene_source;
pub mod schedule;
pub mod step_limits;
pub mod study;
pub mod users_model;

pub use failure::{Failure, Result};
