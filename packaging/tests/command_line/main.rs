//! The `tiprub` program as a user meets it: a small scene, real files, models of a user's own, exit codes, and nothing half-written.

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
mod usage;
mod user_meshes;
mod warnings;
