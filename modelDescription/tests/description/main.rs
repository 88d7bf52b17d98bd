//! Tests of model descriptions of a synthetic table and of a real scene.

mod common;
mod real_scene;
mod scene;
mod snapshots;
mod structure;
mod terminals;
