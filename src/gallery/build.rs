//! A digest of the sources that decide what a built-in model is, so that a cached one is never that of other sources.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

/// What built-in models come from: the reduction, the types it fills, the file it is kept in, the numerical libraries.
const SOURCES: [&str; 5] =
    ["../model/src", "../core/src/rom.rs", "../core/src/rom", "../format/src/rom_file", "../../Cargo.lock"];

fn main() {
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
        collect(Path::new(source), &mut files);
    }
    files.sort();
    let mut hash = Sha256::new();
    for file in files {
        let bytes = fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        for item in [file.to_string_lossy().as_bytes(), &bytes] {
            hash.update((item.len() as u64).to_le_bytes());
            hash.update(item);
        }
    }
    let digest: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    println!("cargo::rustc-env=TIPRUB_MODEL_SOURCES={digest}");
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
