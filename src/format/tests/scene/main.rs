//! Scene files, and the resources directory of an FMU.

#[path = "../common/mod.rs"]
mod common;
#[path = "../features/mod.rs"]
mod features;

mod asked;
mod default_scheme;
mod file;
mod resources;
