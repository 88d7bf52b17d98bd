//! Model descriptions: of a synthetic table and of a real scene.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/scene.rs"]
mod scene;

mod real_scene;
mod snapshots;
mod structure;
