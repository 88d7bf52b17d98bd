//! A digest of the sources that the library inside an FMU is built from, so that a program packages no library of other sources.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

/// What the libraries are built from.
const SOURCES: [&str; 7] = [
    "src",
    "../core/src",
    "../thermal/src",
    "../../fmi/src",
    "../../fmi/facade/src",
    "../../fmi/thermal/src",
    "../../Cargo.lock",
];

fn main() {
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
        collect(Path::new(source), &mut files);
    }
    files.sort();
    let mut hash = Sha256::new();
    for file in files {
        let mut bytes = fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        // The same on every system, whatever ends lines and separates names there.
        bytes.retain(|byte| *byte != b'\r');
        let name = file.to_string_lossy().replace('\\', "/");
        for item in [name.as_bytes(), &bytes] {
            hash.update((item.len() as u64).to_le_bytes());
            hash.update(item);
        }
    }
    let digest: String = hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    println!("cargo::rustc-env=TIPRUB_LIBRARY_SOURCES={digest}");
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(path) else {
        files.push(path.to_path_buf());
        return;
    };
    for entry in entries.flatten() {
        collect(&entry.path(), files);
    }
}
