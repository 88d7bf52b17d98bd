//! Tests of the `tiprub` program: a small scene, real files, user models, exit codes, and no incomplete files.

#[path = "../../../tests/guide.rs"]
mod guide;

mod files;
mod inspect;
mod libraries;
mod package;
mod project;
mod reduce;
mod report;
mod run;
mod sweep;
mod usage;
mod user_meshes;
mod warnings;
