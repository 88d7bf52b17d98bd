//! Where the shared libraries that go into every FMU come from.
//!
//! In this order: the files and directories given with `--library`; for a tiprub that runs from a cargo target directory
//! of the workspace, a fresh build of the fmi crate alone (profile `fmu`, so that no other crate's features leak in);
//! else the libraries beside the executable, where an installation puts them, one for each platform. What a file is made
//! for, and of which unit it is, is read from its content.

use std::{
    collections::{BTreeMap, VecDeque},
    env,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
};

use tiprub_fmi_host::Platform;
use tiprub_shell::{Failure, Result, console::Console};

use crate::cli::LibraryArguments;

/// The workspace this program was compiled from; it need not exist where it runs. A program that is built to be handed on
/// (`wheels.sh`) knows none, so that its bytes do not tell where it was built.
const WORKSPACE: Option<&str> = match option_env!("TIPRUB_HANDED_ON") {
    Some(_) => None,
    None => Some(concat!(env!("CARGO_MANIFEST_DIR"), "/..")),
};

/// Directories in which an installation may hold the libraries, relative to that of the executable. Each is called as
/// its platform. The last is where `pip install --user` puts them on Windows, seen from `Python311/Scripts` and its like.
#[cfg(not(windows))]
const INSTALLED: [&str; 2] = [".", "../lib/tiprub"];
#[cfg(windows)]
const INSTALLED: [&str; 3] = [".", "../lib/tiprub", "../../lib/tiprub"];

/// Largest library (bytes).
const LARGEST: u64 = 1 << 30;

/// Extensions of libraries; a directory may hold other files too.
const EXTENSIONS: [&str; 3] = ["so", "dll", "dylib"];

/// Lines of cargo's stderr kept for the error message.
const LINES_KEPT: usize = 30;

/// What a library makes of the resources of an FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Contact of a scene.
    Scene,
    /// Heat conduction of a casing.
    Thermal,
}

impl Unit {
    /// Crate that the library is built of, and its file without prefix and extension.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Scene => ("tiprub-fmi", "tiprub_fmi"),
            Self::Thermal => ("tiprub-fmi-thermal", "tiprub_thermal_fmi"),
        }
    }

    /// What names of installed libraries begin with.
    fn prefix(self) -> &'static str {
        match self {
            Self::Scene => "",
            Self::Thermal => "thermal-",
        }
    }

    /// The unit of a library: that of heat conduction knows the name of the file it reads.
    fn of_library(bytes: &[u8]) -> Self {
        if holds(bytes, tiprub_format::THERMAL_FILE.as_bytes()) { Self::Thermal } else { Self::Scene }
    }
}

fn holds(bytes: &[u8], name: &[u8]) -> bool {
    bytes.windows(name.len()).any(|part| part == name)
}

/// The FMU's code for one platform.
#[derive(Debug, Clone)]
pub struct Library {
    /// What it runs on.
    pub platform: Platform,
    /// The file.
    pub bytes: Vec<u8>,
}

/// The libraries for an FMU, one for each platform, in the order of [`Platform::ALL`].
///
/// # Errors
/// No library found, the build failed, a file that is no shared library for a known platform, two for one platform, or
/// none for a platform asked for.
pub fn load(unit: Unit, arguments: &LibraryArguments, console: &Console) -> Result<Vec<Library>> {
    let mut found: BTreeMap<Platform, (PathBuf, Vec<u8>)> = BTreeMap::new();
    for path in find(unit, arguments, console)? {
        let bytes =
            tiprub_format::read_file(&path, LARGEST).map_err(|error| Failure::file(&path, "cannot be read", &error))?;
        let platform = recognised(&path, &bytes)?;
        if Unit::of_library(&bytes) != unit {
            // A directory holds those of all units.
            if !arguments.library.contains(&path) {
                continue;
            }
            let problem = "a library of another unit: scenes and heat conduction have one each";
            return Err(Failure::new(path.display(), problem, format!("Give {}", unit.names().1)));
        }
        if let Some((other, _)) = found.get(&platform) {
            return Err(Failure::new(
                path.display(),
                format!("a second library for {}, after {}", platform.tuple(), other.display()),
                "Give one for each platform",
            ));
        }
        found.insert(platform, (path, bytes));
    }
    if found.is_empty() {
        let problem = format!("none of {} is among the files given", unit.names().1);
        return Err(Failure::new("FMU library", problem, "Make it with packaging/libraries.sh and give --library DIR"));
    }
    wanted(&arguments.platform, found.keys().copied().collect())?;
    Ok(found
        .into_iter()
        .filter(|(platform, _)| {
            arguments.platform.is_empty() || arguments.platform.iter().any(|choice| choice.0 == *platform)
        })
        .map(|(platform, (_, bytes))| Library { platform, bytes })
        .collect())
}

/// Each platform asked for is there.
fn wanted(asked: &[PlatformChoice], found: Vec<Platform>) -> Result<()> {
    let Some(missing) = asked.iter().find(|choice| !found.contains(&choice.0)) else { return Ok(()) };
    let names: Vec<&str> = found.into_iter().map(Platform::tuple).collect();
    Err(Failure::new(
        format!("--platform {}", missing.0.tuple()),
        format!("no library for it, only for {}", names.join(", ")),
        "Install tiprub with the libraries of all platforms, or make them with packaging/libraries.sh and give \
         --library DIR",
    ))
}

/// A platform as the command line takes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlatformChoice(pub Platform);

impl clap::ValueEnum for PlatformChoice {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [PlatformChoice; Platform::ALL.len()] = {
            let mut all = [PlatformChoice(Platform::X86_64Linux); Platform::ALL.len()];
            let mut index = 0;
            while index < all.len() {
                all[index] = PlatformChoice(Platform::ALL[index]);
                index += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(clap::builder::PossibleValue::new(self.0.tuple()))
    }
}

/// The files that `--library` names, those of directories among them.
///
/// # Errors
/// A directory that cannot be read, or is empty.
pub fn given(arguments: &LibraryArguments) -> Result<Vec<PathBuf>> {
    Ok(arguments.library.iter().map(|path| files(path)).collect::<Result<Vec<_>>>()?.concat())
}

fn find(unit: Unit, arguments: &LibraryArguments, console: &Console) -> Result<Vec<PathBuf>> {
    if !arguments.library.is_empty() {
        return given(arguments);
    }
    let executable = env::current_exe().unwrap_or_default();
    if let Some(workspace) = WORKSPACE.map(Path::new)
        && let Some(target) = cargo_target(&executable)
        && workspace.join("fmi/Cargo.toml").is_file()
    {
        return Ok(vec![build(unit, workspace, target, console)?]);
    }
    let installed = installed(unit, &executable);
    if installed.is_empty() {
        return Err(Failure::new(
            "FMU library",
            format!(
                "none beside {} or in ../lib/tiprub from there, by a name such as {}{}",
                executable.display(),
                unit.prefix(),
                Platform::X86_64Linux.file_name()
            ),
            "Give it with --library FILE, or run tiprub from its source workspace with `cargo run --release`",
        ));
    }
    Ok(installed)
}

/// A file, or the libraries of a directory by their extensions.
fn files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]);
    }
    let unreadable = |error: std::io::Error| Failure::file(path, "cannot be read", &error);
    let entries = path.read_dir().map_err(unreadable)?.collect::<std::io::Result<Vec<_>>>().map_err(unreadable)?;
    let library = |path: &PathBuf| path.is_file() && is_library(path);
    let mut files: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).filter(library).collect();
    files.sort();
    if files.is_empty() {
        let problem = format!("holds no library (.{})", EXTENSIONS.join(", ."));
        return Err(Failure::new(path.display(), problem, "Make them with packaging/libraries.sh"));
    }
    Ok(files)
}

/// By its name.
fn is_library(path: &Path) -> bool {
    path.extension().is_some_and(|extension| EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known)))
}

fn installed(unit: Unit, executable: &Path) -> Vec<PathBuf> {
    let directory = executable.parent().unwrap_or(Path::new("."));
    let place = |platform: Platform| {
        let name = format!("{}{}", unit.prefix(), platform.file_name());
        INSTALLED.iter().map(|part| directory.join(part).join(&name)).find(|path| path.is_file())
    };
    Platform::ALL.into_iter().filter_map(place).collect()
}

/// The cargo target directory that `executable` lies in, recognised by the file cargo keeps there.
fn cargo_target(executable: &Path) -> Option<&Path> {
    executable.ancestors().skip(1).find(|directory| directory.join(".rustc_info.json").is_file())
}

/// Build the crate of the unit alone and return the library cargo reports.
fn build(unit: Unit, workspace: &Path, target: &Path, console: &Console) -> Result<PathBuf> {
    let task = console.task("Building the FMU library", None);
    let failed = |problem: String, remedy: &str| Failure::new("building the FMU library", problem, remedy);
    let mut child = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["build", "--package", unit.names().0, "--profile", "fmu", "--message-format", "json-render-diagnostics"])
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
    artifact(&messages.join().unwrap_or_default(), unit.names().1)
        .ok_or_else(|| failed("cargo reported no shared library".into(), "Give --library FILE"))
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
fn artifact(messages: &str, name: &str) -> Option<PathBuf> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["reason"] == "compiler-artifact" && message["target"]["name"] == name)
        .flat_map(|message| message["filenames"].as_array().cloned().unwrap_or_default())
        .filter_map(|name| name.as_str().map(PathBuf::from))
        .find(|path| is_library(path))
}

/// The platform of a library whose names are those of both versions of FMI. A file that is called as a platform must be
/// for it.
fn recognised(path: &Path, bytes: &[u8]) -> Result<Platform> {
    let refused = |problem: &str| {
        Failure::new(path.display(), problem, "Give a library built from the fmi crate with --library FILE")
    };
    let platform = Platform::of_library(bytes)
        .ok_or_else(|| refused("not a whole 64-bit shared library for Linux, Windows or macOS"))?;
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let name = name.strip_prefix(Unit::Thermal.prefix()).unwrap_or(name);
    let called = Platform::ALL.into_iter().find(|named| name == &*named.file_name());
    if called.is_some_and(|called| called != platform) {
        return Err(Failure::new(
            path.display(),
            format!("a library for {}, whatever its name says", platform.tuple()),
            "Put the right library there, or call this one as what it is",
        ));
    }
    if !(holds(bytes, b"fmi2DoStep") && holds(bytes, b"fmi3DoStep")) {
        return Err(refused("a library, but of no FMU: it has no function fmi2DoStep or none fmi3DoStep"));
    }
    Ok(platform)
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

    /// What a library of an FMU has somewhere.
    const FUNCTIONS: &[u8] = b"fmi2DoStep\0fmi3DoStep\0";

    /// Headers of an empty shared library for Linux (ELF, machine 62 is x86-64 and 183 AArch64).
    fn elf(machine: u8) -> Vec<u8> {
        let mut bytes = vec![0_u8; 64];
        bytes.extend(FUNCTIONS);
        bytes[..20].copy_from_slice(b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\0\0");
        bytes[18] = machine;
        bytes
    }

    /// Headers of an empty library for macOS (Mach-O, file type 6; the last byte of the type of processor is 7 or 12).
    fn mach_o(processor: u8) -> Vec<u8> {
        let mut bytes = vec![0_u8; 32];
        bytes.extend(FUNCTIONS);
        bytes[..8].copy_from_slice(&[0xcf, 0xfa, 0xed, 0xfe, processor, 0, 0, 1]);
        bytes[12] = 6;
        bytes
    }

    /// Headers of an empty library for Windows: DOS header, COFF header (x86-64, a DLL), optional header of PE32+, one empty section.
    fn pe() -> Vec<u8> {
        let mut bytes = vec![0_u8; 64 + 24 + 112 + 16 * 8 + 40];
        bytes[..2].copy_from_slice(b"MZ");
        bytes[60] = 64;
        bytes[64..71].copy_from_slice(b"PE\0\0\x64\x86\x01");
        bytes[84..88].copy_from_slice(&[240, 0, 0x22, 0x20]);
        bytes[88..90].copy_from_slice(&[0x0b, 0x02]);
        bytes[88 + 108] = 16;
        bytes.extend(FUNCTIONS);
        bytes
    }

    fn arguments(library: &[PathBuf], platform: &[Platform]) -> LibraryArguments {
        let platform = platform.iter().copied().map(PlatformChoice).collect();
        LibraryArguments { library: library.to_vec(), platform }
    }

    #[test]
    fn libraries_of_a_directory_are_told_apart_by_content_and_chosen_by_platform() {
        let root = tempfile::tempdir().unwrap();
        let console = Console::new(true, false);
        let names = ["c.so", "e.DLL", "a.so", "d.dylib", "b.dylib"];
        for (name, bytes) in names.iter().zip([elf(62), pe(), elf(183), mach_o(7), mach_o(12)]) {
            std::fs::write(root.path().join(name), bytes).unwrap();
        }
        std::fs::write(root.path().join("README.md"), "Libraries of all platforms.").unwrap();
        let directory = [root.path().to_path_buf()];
        let platforms = |libraries: Vec<Library>| Vec::from_iter(libraries.iter().map(|library| library.platform));
        assert_eq!(platforms(load(Unit::Scene, &arguments(&directory, &[]), &console).unwrap()), Platform::ALL);
        let two = [Platform::Aarch64Darwin, Platform::X86_64Windows];
        let chosen = platforms(load(Unit::Scene, &arguments(&directory, &two), &console).unwrap());
        assert_eq!(chosen, [Platform::X86_64Windows, Platform::Aarch64Darwin]);
        let one = [root.path().join("e.DLL")];
        let missing = load(Unit::Scene, &arguments(&one, &two), &console).unwrap_err();
        assert!(missing.what.contains("aarch64-darwin") && missing.problem.contains("x86_64-windows"), "{missing}");
        let twice = load(Unit::Scene, &arguments(&[one[0].clone(), one[0].clone()], &[]), &console).unwrap_err();
        assert!(twice.problem.contains("a second library for x86_64-windows"), "{twice}");
    }

    #[test]
    fn installed_libraries_are_beside_the_program_or_in_its_prefix() {
        let root = tempfile::tempdir().unwrap();
        let program = root.path().join("bin/tiprub");
        for name in ["bin/x86_64-windows.dll", "lib/tiprub/x86_64-linux.so", "lib/tiprub/other.so"] {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found = installed(Unit::Scene, &program);
        let names: Vec<_> = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["x86_64-linux.so", "x86_64-windows.dll"]);
    }

    #[test]
    fn a_file_that_is_no_library_is_refused_by_name() {
        let root = tempfile::tempdir().unwrap();
        let console = Console::new(true, false);
        let refused = |path: PathBuf| load(Unit::Scene, &arguments(&[path], &[]), &console).unwrap_err();
        std::fs::write(root.path().join("README.md"), "None yet.").unwrap();
        assert!(refused(root.path().to_path_buf()).problem.contains("holds no library"));
        let mut program = elf(62);
        program[16] = 2;
        let (mut big_endian, mut other) = (elf(62), elf(243));
        big_endian[5] = 2;
        other[16] = 3;
        for bytes in [b"hello".to_vec(), vec![], program, big_endian, other, pe()[..80].to_vec(), mach_o(9)] {
            let path = root.path().join("tiprub.so");
            std::fs::write(&path, bytes).unwrap();
            assert!(refused(path).problem.contains("64-bit shared library"));
        }
        let path = root.path().join("other.so");
        std::fs::write(&path, &elf(62)[..64]).unwrap();
        assert!(refused(path).problem.contains("of no FMU"));
        let mut cut = pe();
        // The one section begins behind the end.
        cut[88 + 240 + 8..][..4].copy_from_slice(&[0, 2, 0, 0]);
        cut[88 + 240 + 16..][..8].copy_from_slice(&[0, 2, 0, 0, 0, 2, 0, 0]);
        let path = root.path().join("cut.dll");
        std::fs::write(&path, cut).unwrap();
        assert!(refused(path).problem.contains("not a whole"));
        let path = root.path().join("x86_64-linux.so");
        std::fs::write(&path, elf(183)).unwrap();
        let other = refused(path.clone());
        assert!(other.what.ends_with("x86_64-linux.so") && other.problem.contains("aarch64-linux"), "{other}");
        std::fs::write(&path, elf(62)).unwrap();
        assert!(load(Unit::Scene, &arguments(&[path], &[]), &console).is_ok());
        let missing = refused(root.path().join("none.so"));
        assert!(missing.what.ends_with("none.so") && missing.problem.contains("cannot be read"), "{missing}");
    }

    #[test]
    fn libraries_of_both_units_are_told_apart() {
        let (root, console) = (tempfile::tempdir().unwrap(), Console::new(true, false));
        let [scene, thermal] = ["x86_64-linux.so", "thermal-x86_64-linux.so"].map(|name| root.path().join(name));
        let conducts = [elf(62), tiprub_format::THERMAL_FILE.as_bytes().to_vec()].concat();
        std::fs::write(&scene, elf(62)).unwrap();
        std::fs::write(&thermal, &conducts).unwrap();
        for (unit, bytes, other) in [(Unit::Scene, elf(62), thermal), (Unit::Thermal, conducts, scene)] {
            let found = load(unit, &arguments(&[root.path().to_path_buf()], &[]), &console).unwrap();
            assert!(found.len() == 1 && found[0].bytes == bytes, "{unit:?}");
            assert!(load(unit, &arguments(&[other], &[]), &console).unwrap_err().problem.contains("another unit"));
        }
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
    fn a_program_in_a_target_directory_of_cargo_is_recognised() {
        let root = tempfile::tempdir().unwrap();
        let executable = root.path().join("release/tiprub");
        assert_eq!(cargo_target(&executable), None);
        std::fs::write(root.path().join(".rustc_info.json"), "").unwrap();
        assert_eq!(cargo_target(&executable), Some(root.path()));
    }
}
