//! Coupled sectors: comparison with the whole disk, faces, checks, patches.

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod boundary;
mod patches;
mod quality;
mod whole;
