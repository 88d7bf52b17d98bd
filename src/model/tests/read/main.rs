//! Users' files: meshes and matrices, read and damaged.

#[path = "../common/mod.rs"]
mod common;

mod fuzz;
mod inp;
mod matrices;
mod meshes;
