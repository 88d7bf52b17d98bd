//! ROM files.

mod cyclic;
mod extras;
mod file;
mod loose;
