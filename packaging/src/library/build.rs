//! Builds libraries from the sources of this program.

use std::{
    collections::VecDeque,
    env,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
};

use tempfile::TempDir;
use tiprub_fmi_host::Platform;
use tiprub_format::{LIBRARY_MARK, LIBRARY_RELEASE};
use tiprub_shell::{Failure, Result, console::Console, output_file};

use super::{LARGEST, LibraryBuild, LibraryUnit, holds, is_library};

/// Number of lines of cargo's stderr for the error message.
const LINES_KEPT: usize = 30;

/// Returns the path at which a library of these sources for this platform is cached.
pub(super) fn kept(unit: LibraryUnit, directory: &Path) -> Option<PathBuf> {
    let name = format!("{}{}", unit.prefix(), Platform::here()?.file_name());
    let sources = LIBRARY_RELEASE.strip_prefix(LIBRARY_MARK)?.replace(", ", "-").replace(' ', "-");
    Some(directory.join("libraries").join(sources).join(name))
}

/// Builds the library for a program that cargo installed, in a temporary directory, and caches it for the next command.
pub(super) fn build_once(
    unit: LibraryUnit,
    workspace: &Path,
    cache: Option<&Path>,
    console: &Console,
) -> Result<(Vec<PathBuf>, Option<TempDir>)> {
    let place = cache.filter(|directory| output_file::create_directory(directory).is_ok());
    let place = place.map_or_else(env::temp_dir, Path::to_path_buf);
    let target = TempDir::with_prefix_in("tiprub-library-", &place)
        .map_err(|error| Failure::file(&place, "cannot create a temporary directory", &error))?;
    console.print_progress(
        "Building the FMU library from the sources of tiprub; this takes a few minutes and is done only once",
    );
    let built = build(unit, LibraryBuild::Released, workspace, target.path(), console)?;
    let bytes =
        tiprub_format::read_file(&built, LARGEST).map_err(|error| Failure::file(&built, "cannot be read", &error))?;
    if !holds(&bytes, LIBRARY_RELEASE.as_bytes()) {
        return Err(Failure::new(
            workspace.display(),
            "these sources have changed since tiprub was installed from them",
            format!("Install it again: cargo install --path {}", workspace.join("packaging").display()),
        ));
    }
    let Some(library) = cache.and_then(|directory| kept(unit, directory)) else {
        return Ok((vec![built], Some(target)));
    };
    match output_file::only_a_file(&library).and_then(|()| output_file::write(&library, bytes)) {
        Ok(()) => Ok((vec![library], None)),
        Err(failure) => {
            console.print_progress(format_args!("The library is not cached: {failure}"));
            Ok((vec![built], Some(target)))
        }
    }
}

/// Returns the cargo target directory that contains `executable`, recognised by a file that cargo keeps there.
pub(super) fn cargo_target(executable: &Path) -> Option<&Path> {
    executable.ancestors().skip(1).find(|directory| directory.join(".rustc_info.json").is_file())
}

/// Builds the crate of the unit, and returns the library that cargo reports.
pub(super) fn build(
    unit: LibraryUnit,
    kind: LibraryBuild,
    workspace: &Path,
    target: &Path,
    console: &Console,
) -> Result<PathBuf> {
    let task = console.task(
        match kind {
            LibraryBuild::Released => "Building the FMU library (several minutes for new sources)",
            LibraryBuild::Shared => "Building the FMU library",
        },
        None,
    );
    let failed = |problem: String, remedy: &str| Failure::new("building the FMU library", problem, remedy);
    let mut child = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["build", "--package", unit.names().0, "--message-format", "json-render-diagnostics"])
        .arg("--manifest-path")
        .arg(workspace.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(target)
        .args(options(kind, workspace))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| failed(format!("cargo cannot be started: {error}"), "Install Rust, or use --library FILE"))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let messages = thread::spawn(move || {
        let mut text = String::new();
        // After a broken pipe, the library is missing below.
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
    let status = child.wait().map_err(|error| failed(format!("cannot wait for cargo: {error}"), "Try again"))?;
    if !status.success() {
        let lines = Vec::from(last_lines).join("\n");
        return Err(failed(format!("cargo ended with {status}:\n{lines}\n"), "Correct these errors, then try again"));
    }
    artifact(&messages.join().unwrap_or_default(), unit.names().1)
        .ok_or_else(|| failed("cargo reported no shared library".into(), "Use --library FILE"))
}

/// Returns the cargo options for this kind of build. A shared library is built together with the program, because all
/// packages of a build determine the features of dependencies, and the features determine the compiled crates.
fn options(kind: LibraryBuild, workspace: &Path) -> Vec<String> {
    let options: &[&str] = match kind {
        LibraryBuild::Released => &["--profile", "fmu"],
        LibraryBuild::Shared => &["--release", "--lib", "--package", env!("CARGO_PKG_NAME")],
    };
    let paths = if kind == LibraryBuild::Released { without_builder_paths(workspace) } else { Vec::new() };
    options.iter().copied().map(String::from).chain(paths).collect()
}

/// Returns cargo options that keep the paths of cargo's home, its registry and the workspace, and with them the user name and the host of the
/// registry, out of the library: the same sources then give the same bytes everywhere. Flags in the user's environment take precedence, as in cargo.
/// `remap.sh` does the same for the scripts.
fn without_builder_paths(workspace: &Path) -> Vec<String> {
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| env::var_os("HOME").map(|home| Path::new(&home).join(".cargo")));
    let flags: Vec<String> = remaps(home.as_deref(), workspace)
        .iter()
        .map(|(from, to)| format!("{:?}", format!("--remap-path-prefix={}={to}", from.display())))
        .collect();
    vec!["--config".into(), format!("target.\"cfg(all())\".rustflags=[{}]", flags.join(","))]
}

/// Returns directories and the neutral names that replace them; if two match, rustc uses the later one.
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

/// Finds the shared library in cargo's JSON messages, one per line.
fn artifact(messages: &str, name: &str) -> Option<PathBuf> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["reason"] == "compiler-artifact" && message["target"]["name"] == name)
        .flat_map(|message| message["filenames"].as_array().cloned().unwrap_or_default())
        .filter_map(|name| name.as_str().map(PathBuf::from))
        .find(|path| is_library(path))
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
        assert_eq!(artifact(messages, "tiprub_fmi"), Some(PathBuf::from("/t/libtiprub_fmi.so")));
        assert_eq!(artifact("", "tiprub_fmi"), None);
    }

    #[test]
    fn build_paths_are_remapped_to_neutral_names() {
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
    fn a_program_in_a_target_directory_of_cargo_is_recognised() {
        let root = tempfile::tempdir().unwrap();
        let executable = root.path().join("release/tiprub");
        assert_eq!(cargo_target(&executable), None);
        std::fs::write(root.path().join(".rustc_info.json"), "").unwrap();
        assert_eq!(cargo_target(&executable), Some(root.path()));
    }
}
