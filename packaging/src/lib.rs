//! The `tiprub` command line as a library: reduce, package, run, demo, inspect.
//!
//! It wires the lower floors together. [`commands`] holds one module per command; the rest are the parts they share.
//!
//! - [`cli`], [`reduce_arguments`], [`casing_arguments`], [`thermal_arguments`], [`mesh_arguments`], [`shared_arguments`]: what can be requested; [`command_names`]: errors of the command line;
//! - [`command_files`]: what each command reads and writes, looked at before any work;
//! - [`left_out`]: what a scene leaves out, in one table;
//! - [`answer`]: the five lines that a run is about;
//! - [`scene_features`], [`rom_facts`]: what is to be known of a scene or a ROM before it is trusted;
//! - [`user_mesh`], [`cube_models`], [`mod@reduced`]: models read, judged, reduced, and what is told of them;
//! - [`fmu`], [`thermal_fmu`], [`library`]: what is in an FMU, and where its shared library comes from;
//! - [`report`]: the HTML report of the demo.

pub mod answer;
pub mod casing_arguments;
pub mod cli;
pub mod command_files;
pub mod command_names;
pub mod commands;
pub mod cube_models;
pub mod fmu;
pub mod left_out;
pub mod library;
pub mod mesh_arguments;
pub mod reduce_arguments;
pub mod reduced;
pub mod report;
pub mod rom_facts;
pub mod scene_features;
pub mod shared_arguments;
pub mod thermal_arguments;
pub mod thermal_fmu;
pub mod user_mesh;
