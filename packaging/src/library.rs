//! Where the shared library that goes into every FMU comes from.
//!
//! In this order: the file given with `--library`; for a tiprub that runs from a cargo target directory of the
//! workspace, a fresh build of the fmi crate alone (profile `fmu`, so that no other crate's features leak in); else a
//! library beside the executable, where an installation puts it.

use std::{
    collections::VecDeque,
    env,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
};

use tiprub_shell::{Failure, Result, console::Console};

/// The workspace this program was compiled from; it need not exist where it runs.
const WORKSPACE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Names under which an installation may hold the library, relative to the directory of the executable.
const INSTALLED: [&str; 3] = ["tiprub.so", "libtiprub_fmi.so", "../lib/tiprub/tiprub.so"];

/// Largest library (bytes).
const LARGEST: u64 = 1 << 30;

/// Lines of cargo's stderr kept for the error message.
const LINES_KEPT: usize = 30;

/// The library for the FMU, as bytes.
///
/// # Errors
/// No library found, the build failed, or the file is not a shared library for Linux on x86-64.
pub fn load(explicit: Option<&Path>, console: &Console) -> Result<Vec<u8>> {
    let path = find(explicit, console)?;
    let bytes =
        tiprub_format::read_file(&path, LARGEST).map_err(|error| Failure::file(&path, "cannot be read", &error))?;
    check_format(&path, &bytes)?;
    Ok(bytes)
}

fn find(explicit: Option<&Path>, console: &Console) -> Result<PathBuf> {
    if let Some(path) = explicit {
        return Ok(path.to_path_buf());
    }
    let executable = env::current_exe().unwrap_or_default();
    let workspace = Path::new(WORKSPACE);
    if let Some(target) = cargo_target(&executable)
        && workspace.join("fmi/Cargo.toml").is_file()
    {
        return build(workspace, target, console);
    }
    installed(&executable).ok_or_else(|| {
        Failure::new(
            "FMU library",
            format!("none of {} is beside {}", INSTALLED.join(", "), executable.display()),
            "Give it with --library FILE, or run tiprub from its source workspace with `cargo run --release`",
        )
    })
}

fn installed(executable: &Path) -> Option<PathBuf> {
    let directory = executable.parent()?;
    INSTALLED.iter().map(|name| directory.join(name)).find(|path| path.is_file())
}

/// The cargo target directory that `executable` lies in, recognised by the file cargo keeps there.
fn cargo_target(executable: &Path) -> Option<&Path> {
    executable.ancestors().skip(1).find(|directory| directory.join(".rustc_info.json").is_file())
}

/// Build the fmi crate alone and return the library cargo reports.
fn build(workspace: &Path, target: &Path, console: &Console) -> Result<PathBuf> {
    let task = console.task("Building the FMU library", None);
    let failed = |problem: String, remedy: &str| Failure::new("building the FMU library", problem, remedy);
    let mut child = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["build", "--package", "tiprub-fmi", "--profile", "fmu", "--message-format", "json-render-diagnostics"])
        .arg("--manifest-path")
        .arg(workspace.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(target)
        .args(without_builder_paths(workspace))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| failed(format!("cargo cannot be started: {error}"), "Install Rust, or give --library FILE"))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let messages = thread::spawn(move || {
        let mut text = String::new();
        // A broken pipe shows up as a missing artifact below.
        let _ = stdout.map(|mut pipe| pipe.read_to_string(&mut text));
        text
    });
    let mut last_lines = VecDeque::new();
    for line in stderr.into_iter().flat_map(|pipe| BufReader::new(pipe).lines().map_while(Result::ok)) {
        task.now(&format!("Building the FMU library: {}", line.trim()));
        task.line(line.trim());
        last_lines.push_back(line);
        if last_lines.len() > LINES_KEPT {
            last_lines.pop_front();
        }
    }
    let status = child.wait().map_err(|error| failed(format!("cargo was lost: {error}"), "Try again"))?;
    if !status.success() {
        let lines = Vec::from(last_lines).join("\n");
        return Err(failed(format!("cargo ended with {status}:\n{lines}\n"), "Correct what it names, then try again"));
    }
    artifact(&messages.join().unwrap_or_default()).ok_or_else(|| {
        failed("cargo reported no shared library".into(), "Is this Linux? Otherwise give --library FILE")
    })
}

/// Cargo options that keep the places of cargo's home, its registry and the workspace, and with them the builder's name
/// and the registry's host, out of the library: the same sources then give the same bytes for everybody. Flags of the
/// user's own environment take precedence, as cargo has it. `remap.sh` does the same for the scripts.
fn without_builder_paths(workspace: &Path) -> Vec<String> {
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| env::var_os("HOME").map(|home| Path::new(&home).join(".cargo")));
    let flags: Vec<String> = remaps(home.as_deref(), workspace)
        .iter()
        .map(|(from, to)| format!("{:?}", format!("--remap-path-prefix={}={to}", from.display())))
        .collect();
    vec!["--config".into(), format!("target.\"cfg(all())\".rustflags=[{}]", flags.join(","))]
}

/// Directories and the neutral names that stand for them; of two that match, rustc takes the later.
fn remaps(home: Option<&Path>, workspace: &Path) -> Vec<(PathBuf, &'static str)> {
    let mut remaps = Vec::new();
    if let Ok(workspace) = workspace.canonicalize() {
        remaps.push((workspace, "tiprub"));
    }
    if let Some(home) = home {
        remaps.push((home.to_path_buf(), "cargo"));
        let registries = std::fs::read_dir(home.join("registry/src")).into_iter().flatten().flatten();
        let mut registries: Vec<PathBuf> = registries.map(|registry| registry.path()).collect();
        registries.sort();
        remaps.extend(registries.into_iter().map(|registry| (registry, "crates")));
    }
    remaps
}

/// The shared library in cargo's JSON messages, one per line.
fn artifact(messages: &str) -> Option<PathBuf> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["reason"] == "compiler-artifact" && message["target"]["name"] == "tiprub_fmi")
        .flat_map(|message| message["filenames"].as_array().cloned().unwrap_or_default())
        .filter_map(|name| name.as_str().map(PathBuf::from))
        .find(|path| path.extension().is_some_and(|extension| extension == "so"))
}

/// 64-bit little-endian ELF, shared object, x86-64: what `binaries/linux64` and `binaries/x86_64-linux` promise.
fn check_format(path: &Path, bytes: &[u8]) -> Result<()> {
    let elf = bytes.len() > 64 && bytes[..6] == *b"\x7fELF\x02\x01";
    if elf && bytes[16..18] == [3, 0] && bytes[18..20] == [62, 0] {
        return Ok(());
    }
    Err(Failure::new(
        path.display(),
        "not a shared library for Linux on x86-64",
        "Give the library built from the fmi crate with --library FILE",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_artifact_is_taken_from_cargo_messages() {
        let messages = concat!(
            r#"{"reason":"compiler-artifact","target":{"name":"nalgebra"},"filenames":["/t/libnalgebra.rlib"]}"#,
            "\nnot json\n",
            r#"{"reason":"compiler-artifact","target":{"name":"tiprub_fmi"},"filenames":["/t/libtiprub_fmi.so"]}"#,
            "\n{\"reason\":\"build-finished\",\"success\":true}\n"
        );
        assert_eq!(artifact(messages), Some(PathBuf::from("/t/libtiprub_fmi.so")));
        assert_eq!(artifact(""), None);
    }

    #[test]
    fn a_file_that_is_no_library_is_refused_by_name() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("tiprub.so");
        std::fs::write(&path, "hello").unwrap();
        let console = Console::new(true, false);
        assert!(load(Some(&path), &console).unwrap_err().problem.contains("not a shared library"));
        let missing = load(Some(&root.path().join("none.so")), &console).unwrap_err();
        assert!(missing.what.ends_with("none.so") && missing.problem.contains("cannot be read"), "{missing}");
    }

    #[test]
    fn places_of_the_builder_get_neutral_names() {
        let root = tempfile::tempdir().unwrap();
        let home = root.path().join("home");
        let registry = home.join("registry/src/index.example-0123");
        std::fs::create_dir_all(&registry).unwrap();
        let workspace = root.path().canonicalize().unwrap();
        let expected = [(workspace, "tiprub"), (home.clone(), "cargo"), (registry, "crates")];
        assert_eq!(remaps(Some(&home), root.path()), expected);
        assert_eq!(remaps(None, &root.path().join("missing")), []);
    }

    #[test]
    fn an_installed_library_is_found_beside_the_program() {
        let root = tempfile::tempdir().unwrap();
        let executable = root.path().join("tiprub");
        assert_eq!(installed(&executable), None);
        std::fs::write(root.path().join("libtiprub_fmi.so"), "").unwrap();
        assert_eq!(installed(&executable), Some(root.path().join("libtiprub_fmi.so")));
        assert_eq!(cargo_target(&executable), None);
        std::fs::write(root.path().join(".rustc_info.json"), "").unwrap();
        assert_eq!(cargo_target(&root.path().join("release/tiprub")), Some(root.path()));
    }
}
