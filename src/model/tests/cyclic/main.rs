//! Coupled sectors: against the whole disk, their faces, their checks, their patches.

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod boundary;
mod patches;
mod quality;
mod whole;
