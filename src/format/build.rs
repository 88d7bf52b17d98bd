//! A digest of the sources that the library inside an FMU is built from, so that a program does not package a library
//! built from other sources.

mod digest;

/// Sources of the libraries.
const SOURCES: [&str; 8] = [
    "src",
    "../core/src",
    "../cosim/src",
    "../thermal/src",
    "../../fmi/src",
    "../../fmi/facade/src",
    "../../fmi/thermal/src",
    "../../Cargo.lock",
];

fn main() {
    digest::set("TIPRUB_LIBRARY_SOURCES", &SOURCES);
}
