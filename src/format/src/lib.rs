//! Scene files (TOML), ROM files (safetensors) and the `resources/` directory of an FMU: conversion of text and bytes
//! to the plain data of `tiprub-core`, and back.
//!
//! Both the command line, which writes these files, and the library inside the FMU, which reads them, use this crate.
//! No input is trusted: every length, shape, key and value is checked, and every error contains the file, the place in
//! it, the problem and the remedy.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

mod input;
mod load;
mod remedy;
mod resources;
mod rom_file;
mod rom_layout;
mod scene_diagnosis;
mod scene_file;
mod scene_layout;
#[cfg(feature = "suggestions")]
mod suggestion;
mod thermal_file;

pub use input::{open_file, read_file};
pub use load::{LARGEST_ROM, load_scene, load_settings};
pub use resources::{
    CHECKS_FILE, LARGEST_CHECKS, Resources, SCENE_FILE, instantiation_token, largest_resource, load_resources,
    packed_scene, read_checks, resource_files, write_checks,
};
pub use rom_file::{read_rom, write_rom};
pub use rom_layout::{ARRAYS, ArrayLayout, METADATA, MetadataLayout};
pub use scene_file::{builtin_model, parse_scene, position_of, read_scene, write_scene};
pub use scene_layout::{FIELDS, SceneField};
#[cfg(feature = "suggestions")]
pub use suggestion::{closest_name, name_hint};
pub use thermal_file::{
    THERMAL_FILE, ThermalResources, load_thermal_resources, read_thermal, thermal_resource_files, write_thermal,
};

/// Prefix of the marks of all releases.
pub const LIBRARY_MARK: &str = "tiprub library ";
/// Mark in every library of an FMU, and in the program that packages it: the release and a digest of the sources of
/// both.
pub const LIBRARY_RELEASE: &str =
    concat!("tiprub library ", env!("CARGO_PKG_VERSION"), ", sources ", env!("TIPRUB_LIBRARY_SOURCES"));

/// Result of this crate.
pub(crate) type Result<T, E = tiprub_cosim::Diagnostic> = core::result::Result<T, E>;
