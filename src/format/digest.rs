//! A digest of source files, for build scripts.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};

/// Sets an environment variable of the compiler to a digest (16 hexadecimal digits) of files and of all files in directories.
pub fn set(variable: &str, sources: &[&str]) {
    let mut files = Vec::new();
    for source in sources {
        println!("cargo::rerun-if-changed={source}");
        collect(Path::new(source), &mut files);
    }
    files.sort();
    let mut hash = Sha256::new();
    for file in files {
        let mut bytes = fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        // Equal on every system, regardless of line endings and path separators.
        bytes.retain(|byte| *byte != b'\r');
        let name = file.to_string_lossy().replace('\\', "/");
        for item in [name.as_bytes(), &bytes] {
            hash.update((item.len() as u64).to_le_bytes());
            hash.update(item);
        }
    }
    let digest: String = hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    println!("cargo::rustc-env={variable}={digest}");
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
