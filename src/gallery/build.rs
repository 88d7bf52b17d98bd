//! A digest of the sources that decide what a built-in model is, so that a cached one is never that of other sources.

#[path = "../format/digest.rs"]
mod digest;

/// Sources of built-in models: the reduction, the types it fills, the file that holds them, the numerical libraries.
const SOURCES: [&str; 5] =
    ["../model/src", "../core/src/rom.rs", "../core/src/rom", "../format/src/rom_file", "../../Cargo.lock"];

fn main() {
    digest::set("TIPRUB_MODEL_SOURCES", &SOURCES);
}
