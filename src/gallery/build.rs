//! Computes a digest of the sources that determine the built-in models, so that a cached model of other sources is never used.

#[path = "../format/digest.rs"]
mod digest;

/// Sources of built-in models: the reduction, its data types, the file format, and the numerical libraries.
const SOURCES: [&str; 6] = [
    "../model/src",
    "../core/src/scene/rom.rs",
    "../core/src/scene/rom",
    "../cosim/src/patch.rs",
    "../format/src/rom_file",
    "../../Cargo.lock",
];

fn main() {
    digest::set("TIPRUB_MODEL_SOURCES", &SOURCES);
}
