//! The `tiprub` command line as a library: reduce, package, run, sweep, demo, inspect.
//!
//! It connects the lower layers. [`commands`] has one module per command; the other modules are shared by them.
//!
//! - [`cli`], [`reduce_arguments`], [`casing_arguments`], [`run_arguments`], [`thermal_arguments`], [`mesh_arguments`], [`shared_arguments`]: arguments;
//!   [`command_names`]: errors of the command line;
//! - [`command_files`]: inputs and outputs of each command, checked before any work;
//! - [`left_out`]: table of the effects that a scene leaves out;
//! - [`answer`]: main results of a run in five lines;
//! - [`scene_features`], [`rom_facts`]: properties and limits of a scene or a ROM;
//! - [`user_mesh`], [`cube_models`], [`mod@reduced`]: models that are read, checked, reduced and described;
//! - [`fmu`], [`thermal_fmu`], [`library`]: content of an FMU, and the source of its shared library;
//! - [`sweep_sources`]: scenes and models of a sweep;
//! - [`observers`]: fields over time and motion of a run;
//! - [`report`]: the HTML report of a run.

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
pub mod observers;
pub mod reduce_arguments;
pub mod reduced;
pub mod report;
pub mod rom_facts;
pub mod run_arguments;
pub mod scene_features;
pub mod shared_arguments;
pub mod sweep_sources;
pub mod thermal_arguments;
pub mod thermal_fmu;
pub mod user_mesh;
