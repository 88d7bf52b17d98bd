//! User files: valid and damaged meshes and matrices.

#[path = "../common/mod.rs"]
mod common;

mod fuzz;
mod inp;
mod matrices;
mod meshes;
