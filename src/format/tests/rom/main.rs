//! ROM files.

#[path = "../common/loose.rs"]
mod loose;

mod cyclic;
mod extras;
mod file;
