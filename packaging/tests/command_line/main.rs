//! The `tiprub` program as a user meets it: a small scene, real files, exit codes, and nothing half-written.

mod files;
mod inspect;
mod package;
mod project;
mod reduce;
mod run;
mod told;
mod usage;
