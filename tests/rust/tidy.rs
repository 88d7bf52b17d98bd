//! The structure of the code, as absences: crates that must not depend on others, and places without unsafe code.

mod messages;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use tiprub_tests::root;

/// Returns every crate that a package is built from (normal dependencies, with its features).
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
fn crate_dependencies_respect_the_layers() {
    let offline = ["faer", "rayon", "quick-xml", "zip", "clap", "plotters", "indicatif", "libloading", "parquet"];
    let floors = ["tiprub-model", "tiprub-reference", "tiprub-model-description", "tiprub"];
    let files = ["tiprub-format", "tiprub-fmi", "tiprub-fmi-facade", "toml", "safetensors", "serde_json"];
    let simulations = ["tiprub-core", "tiprub-thermal", "nalgebra"];
    free_of("tiprub-cosim", &[&offline[..], &floors, &files, &simulations].concat());
    free_of("tiprub-core", &[&offline[..], &floors, &files, &["tiprub-thermal"]].concat());
    free_of("tiprub-thermal", &[&offline[..], &floors, &files, &["tiprub-core"]].concat());
    free_of("tiprub-fmi-facade", &[&offline[..], &floors, &simulations, &["tiprub-format", "tiprub-fmi"]].concat());
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
    let above_field = ["tiprub-gallery", "tiprub-study", "tiprub-figure", "tiprub-fmi-host", "tiprub"];
    let bindings = ["wasm-bindgen", "js-sys", "web-sys", "console_error_panic_hook"];
    let above_browser = ["tiprub-shell", "tiprub-fmi", "tiprub-fmi-facade", "tiprub-gallery"];
    free_of("tiprub-browser", &[&offline[..], &floors, &bindings, &above_browser].concat());
    free_of("tiprub-field", &[&above_field[..], &["tiprub-table", "clap", "plotters", "zip"]].concat());
    free_of("tiprub-gallery", &["tiprub-figure", "tiprub-study", "tiprub-fmi-host", "clap", "plotters"]);
    free_of("tiprub-table", &["tiprub-model", "tiprub-gallery", "tiprub-fmi-host", "clap", "plotters", "arrow-array"]);
    free_of("tiprub-sweep", &["tiprub-figure", "tiprub-study", "tiprub-fmi-host", "clap", "plotters", "zip", "tiprub"]);
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

/// Returns the lines of code (not comments) that contain a word.
fn lines_with(path: &Path, word: &str) -> Vec<String> {
    let text = std::fs::read_to_string(path).expect("a source file");
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned());
    code.filter(|line| line.contains(word)).collect()
}

/// Modules of core, each of which imports only those before it, with the items that `lib.rs` re-exports from them; items of
/// `tiprub-cosim` stand below all.
const LAYERS: [(&str, &[&str]); 9] = [
    ("math", &["CoSimulation", "Error", "Result", "VariableTable", "Warning"]),
    ("scene", &["Scene", "Rom"]),
    ("modes", &[]),
    ("geometry", &[]),
    ("contact", &[]),
    ("system", &["Ledger"]),
    ("time", &[]),
    ("limits", &[]),
    ("simulation", &["Simulation"]),
];

/// Returns the first names of all paths that begin with `crate::` in code that is not a test.
fn crate_paths(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let code: String = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let names = |rest: &str| -> Vec<String> {
        let word = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        match rest.strip_prefix('{').and_then(|rest| rest.split_once('}')) {
            Some((group, _)) => group.split(',').map(|entry| word(entry.trim())).collect(),
            None => vec![word(rest)],
        }
    };
    code.split("crate::").skip(1).flat_map(names).filter(|name| !name.is_empty()).collect()
}

#[test]
fn modules_of_core_import_only_lower_layers() {
    let (source, mut files) = (root().join("src/core/src"), Vec::new());
    sources(&source, &mut files);
    let place = |name: &str| LAYERS.iter().position(|(module, items)| *module == name || items.contains(&name));
    let (mut upward, mut checked) = (Vec::new(), 0);
    for path in files.iter().filter(|path| !path.components().any(|part| part.as_os_str() == "tests")) {
        let within = path.strip_prefix(&source).expect("below the sources").with_extension("");
        let module = within.iter().next().and_then(|name| name.to_str()).expect("a name");
        if module == "lib" || within.ends_with("tests") {
            continue;
        }
        let own = place(module).unwrap_or_else(|| panic!("{module} has no layer"));
        for name in crate_paths(&std::fs::read_to_string(path).expect("a source file")) {
            let other = place(&name).unwrap_or_else(|| panic!("{name} in {} has no layer", path.display()));
            checked += 1;
            if other > own {
                upward.push(format!("{} imports {name}", within.display()));
            }
        }
    }
    assert!(checked > 500, "only {checked} imports found");
    assert!(upward.is_empty(), "{upward:#?}");
}

#[test]
fn unsafe_code_is_confined_to_the_fmi_boundary() {
    let (mut files, source) = (Vec::new(), root().join("fmi/facade/src"));
    sources(&source, &mut files);
    assert!(files.len() > 10);
    let boundary = [source.join("boundary"), source.join("boundary.rs")];
    for path in files.iter().filter(|path| !boundary.iter().any(|place| path.starts_with(place))) {
        let blocks: Vec<_> = lines_with(path, "unsafe").into_iter().filter(|line| line.contains("unsafe {")).collect();
        assert!(blocks.is_empty(), "{}: {blocks:?}", path.display());
    }
    for unit in ["fmi/src", "fmi/thermal/src", "src/browser/src", "src/cosim/src", "src/thermal/src"] {
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

/// Returns the text of the blocks `impl <name> {` of a file.
fn implementations(text: &str, name: &str) -> String {
    let start = format!("\nimpl {name} {{\n");
    let blocks = text.split(start.as_str()).skip(1);
    blocks.map(|block| block.split("\n}\n").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Returns the public functions of a text whose doc comment has no example.
fn without_example(text: &str) -> Vec<String> {
    let (mut missing, mut has_example) = (Vec::new(), false);
    for line in text.lines().map(str::trim_start) {
        if line.starts_with("///") {
            has_example |= line.contains("```");
        } else if let Some(function) = line.strip_prefix("pub fn ").or_else(|| line.strip_prefix("pub const fn ")) {
            if !has_example {
                missing.push(function.split(['(', '<']).next().unwrap_or_default().to_owned());
            }
            has_example = false;
        } else if !line.starts_with("#[") {
            has_example = false;
        }
    }
    missing
}

/// Returns the methods of a trait that are not called in any example of its file.
fn without_call(text: &str) -> Vec<String> {
    let examples: Vec<&str> = text.lines().map(str::trim_start).filter(|line| line.starts_with("///")).collect();
    let methods = text.lines().filter_map(|line| line.strip_prefix("    fn "));
    let names = methods.map(|method| method.split(['(', '<']).next().unwrap_or_default());
    let is_called = |name: &str| examples.iter().any(|line| line.contains(&format!(".{name}(")));
    names.filter(|name| !is_called(name)).map(|name| format!("CoSimulation: {name}")).collect()
}

/// Covers the functions that programs call first: simulations, files, meshes and reductions. `cargo test --doc`
/// compiles and runs the examples.
#[test]
fn public_entry_points_have_examples() {
    let folder = |path: &str| {
        let mut files = Vec::new();
        sources(&root().join(path), &mut files);
        files.iter().map(|path| std::fs::read_to_string(path).expect("a source file")).collect::<Vec<_>>().join("\n")
    };
    let file = |path: &str| std::fs::read_to_string(root().join(path)).expect("a source file");
    let thermal = folder("src/thermal/src");
    let trait_text = file("src/cosim/src/unit.rs");
    let mut texts = vec![
        (
            "Simulation",
            implementations(&(file("src/core/src/simulation.rs") + &folder("src/core/src/simulation")), "Simulation"),
        ),
        ("ThermalSimulation", implementations(&thermal, "ThermalSimulation")),
        ("ConductionModel", implementations(&thermal, "ConductionModel")),
    ];
    for name in ["input", "load", "resources", "rom_file", "scene_file", "thermal_file"] {
        texts.push(("format", file(&format!("src/format/src/{name}.rs"))));
    }
    let model = ["reduce", "mesh", "fe_model", "read", "inp", "thermal", "assembly", "casing", "casing/reduction"];
    for name in model {
        texts.push(("model", file(&format!("src/model/src/{name}.rs"))));
    }
    let functions = texts
        .iter()
        .flat_map(|(unit, text)| without_example(text).into_iter().map(move |name| format!("{unit}: {name}")));
    let missing: Vec<String> = functions.chain(without_call(&trait_text)).collect();
    let found: usize = texts.iter().map(|(_, text)| text.matches("pub fn ").count()).sum();
    let found = found + trait_text.matches("\n    fn ").count();
    assert!(found > 90, "{found} public functions found");
    assert!(missing.is_empty(), "without an example: {}", missing.join(", "));
}
