//! The shape of the code, as absences: which floors know nothing of which, and where unsafe code is not.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use tiprub_tests::root;

/// Every crate that a package is built of (normal dependencies, with its own features).
fn built_of(package: &str) -> BTreeSet<String> {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(["tree", "--offline", "-p", package, "-e", "normal", "--prefix", "none"]);
    let output = command.output().expect("cargo can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect()
}

#[track_caller]
fn free_of(package: &str, unwanted: &[&str]) {
    let crates = built_of(package);
    assert!(crates.contains(package) && crates.len() > 1, "{crates:?}");
    let found: Vec<_> = unwanted.iter().filter(|name| crates.contains(**name)).collect();
    assert!(found.is_empty(), "{package} is built of {found:?}");
}

#[test]
fn imports_run_one_way() {
    let offline = ["faer", "rayon", "quick-xml", "zip", "clap", "plotters", "indicatif", "libloading"];
    let floors = ["tiprub-model", "tiprub-reference", "tiprub-model-description", "tiprub"];
    let files = ["tiprub-format", "tiprub-fmi", "tiprub-fmi-facade", "toml", "safetensors", "serde_json"];
    free_of("tiprub-core", &[&offline[..], &floors, &files].concat());
    free_of("tiprub-thermal", &[&offline[..], &floors, &files].concat());
    free_of("tiprub-fmi-facade", &[&offline[..], &floors, &["tiprub-format", "tiprub-thermal", "tiprub-fmi"]].concat());
    free_of("tiprub-fmi", &[&offline[..], &floors].concat());
    free_of("tiprub-fmi-thermal", &[&offline[..], &floors, &["tiprub-fmi"]].concat());
    free_of("tiprub-format", &[&offline[..], &floors, &["tiprub-fmi"]].concat());
    let above_model = ["tiprub-fmi", "tiprub", "tiprub-model-description", "tiprub-reference"];
    free_of("tiprub-model", &[&above_model[..], &["quick-xml", "zip", "clap", "toml", "safetensors"]].concat());
    free_of("tiprub-model-description", &["faer", "tiprub-model", "tiprub-fmi", "tiprub", "toml", "safetensors"]);
    let above_shell = ["tiprub-gallery", "tiprub-figure", "tiprub-study", "tiprub-fmi-host", "tiprub", "tiprub-lab"];
    free_of("tiprub-shell", &[&above_shell[..], &["tiprub-model", "faer", "clap", "plotters", "zip"]].concat());
    free_of("tiprub-fmi-host", &["tiprub-fmi", "tiprub-model", "tiprub-gallery", "tiprub-figure", "clap", "faer"]);
    free_of("tiprub-figure", &["tiprub-gallery", "tiprub-study", "tiprub-fmi-host", "clap"]);
    free_of("tiprub-gallery", &["tiprub-figure", "tiprub-study", "tiprub-fmi-host", "clap", "plotters"]);
    let evidence = ["tiprub-reference", "tiprub-lab", "tiprub-fmi"];
    free_of("tiprub-study", &[&evidence[..], &["tiprub", "tiprub-fmi-host", "zip", "libloading"]].concat());
    free_of("tiprub", &evidence);
}

fn sources(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).expect("the sources can be read").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Lines of code (not comments) that contain a word.
fn lines_with(path: &Path, word: &str) -> Vec<String> {
    let text = std::fs::read_to_string(path).expect("a source file");
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned());
    code.filter(|line| line.contains(word)).collect()
}

#[test]
fn the_boundary_is_the_only_place_of_unsafe_code_in_the_library() {
    let (mut files, source) = (Vec::new(), root().join("fmi/facade/src"));
    sources(&source, &mut files);
    assert!(files.len() > 10);
    for path in files.iter().filter(|path| !path.starts_with(source.join("boundary"))) {
        let blocks: Vec<_> = lines_with(path, "unsafe").into_iter().filter(|line| line.contains("unsafe {")).collect();
        assert!(blocks.is_empty(), "{}: {blocks:?}", path.display());
    }
    for unit in ["fmi/src", "fmi/thermal/src", "src/thermal/src"] {
        let mut files = Vec::new();
        sources(&root().join(unit), &mut files);
        assert!(!files.is_empty() && files.iter().all(|path| lines_with(path, "unsafe {").is_empty()), "{unit}");
    }
    let lib = std::fs::read_to_string(source.join("lib.rs")).expect("a source file");
    assert!(lib.contains("#[forbid(unsafe_code)]\nmod slave;"));
}

#[test]
fn the_library_is_only_a_shared_library() {
    for unit in ["fmi", "fmi/thermal"] {
        let manifest = std::fs::read_to_string(root().join(unit).join("Cargo.toml")).expect("the manifest");
        assert!(
            manifest.contains("crate-type = [\"cdylib\"]"),
            "{unit}: an rlib beside it would silently drop link-time optimisation"
        );
        assert!(!manifest.contains("default = "), "{unit}: no feature is on in the shipped library");
    }
}

/// `tests/run.sh` runs no examples of docstrings, since there are none: one that is code would never be compiled.
#[test]
fn no_docstring_holds_code_that_nobody_runs() {
    let mut files = Vec::new();
    for folder in ["src", "fmi", "modelDescription", "packaging", "tests"] {
        sources(&root().join(folder), &mut files);
    }
    assert!(files.len() > 300);
    for path in files {
        let text = std::fs::read_to_string(&path).expect("a source file");
        let lines = text.lines().map(str::trim_start).filter(|line| line.starts_with("///") || line.starts_with("//!"));
        let fences = lines.map(|line| line[3..].trim()).filter(|line| line.starts_with("```")).step_by(2);
        let code: Vec<_> = fences.filter(|fence| *fence != "```text").collect();
        assert!(code.is_empty(), "{}: {code:?} is compiled by no test", path.display());
    }
}
