//! Finds the shared libraries for the FMUs.
//!
//! In this order: the files and directories given with `--library`; for a tiprub that runs from a cargo target
//! directory of the workspace, a fresh build of the fmi crate ([`LibraryBuild`]); otherwise the libraries beside the
//! executable, where an installation puts them, one for each platform; otherwise, for a tiprub that cargo installed, a
//! library built from the same sources, which is cached in the user's cache directory. The content of a library shows
//! its platform, unit and sources.

mod build;

use std::{
    collections::BTreeMap,
    env,
    path::{Path, PathBuf},
};

use tempfile::TempDir;
use tiprub_fmi_host::Platform;
use tiprub_format::{LIBRARY_MARK, LIBRARY_RELEASE};
use tiprub_gallery::rom_cache::RomCache;
use tiprub_shell::{Failure, Result, console::Console};

use crate::cli::LibraryArguments;

/// Workspace from which this program was compiled; it need not exist at run time. A program that is built for distribution (`wheels.sh`) does not
/// know it, so that its bytes do not contain the build location.
const WORKSPACE: Option<&str> = match option_env!("TIPRUB_HANDED_ON") {
    Some(_) => None,
    None => Some(concat!(env!("CARGO_MANIFEST_DIR"), "/..")),
};

/// Directories in which an installation may have the libraries, relative to that of the executable. Each library is named after its platform. The
/// last one is where `pip install --user` puts them on Windows, relative to `Python311/Scripts` and similar directories.
#[cfg(not(windows))]
const INSTALLED: [&str; 2] = [".", "../lib/tiprub"];
#[cfg(windows)]
const INSTALLED: [&str; 3] = [".", "../lib/tiprub", "../../lib/tiprub"];

/// Largest library (bytes).
const LARGEST: u64 = 1 << 30;

/// Extensions of libraries; a directory may also contain other files.
const EXTENSIONS: [&str; 3] = ["so", "dll", "dylib"];

/// Kind of FMU that a library is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LibraryUnit {
    /// Simulation of the contact of a scene.
    Scene,
    /// Heat conduction of a casing.
    Thermal,
}

impl LibraryUnit {
    /// Returns the crate of the library, and its file name without prefix and extension.
    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Scene => ("tiprub-fmi", "tiprub_fmi"),
            Self::Thermal => ("tiprub-fmi-thermal", "tiprub_thermal_fmi"),
        }
    }

    /// Returns the beginning of the names of installed libraries.
    fn prefix(self) -> &'static str {
        match self {
            Self::Scene => "",
            Self::Thermal => "thermal-",
        }
    }

    /// Returns the unit of a library: that of heat conduction contains the name of the file it reads.
    fn of_library(bytes: &[u8]) -> Self {
        if holds(bytes, tiprub_format::THERMAL_FILE.as_bytes()) { Self::Thermal } else { Self::Scene }
    }
}

fn holds(bytes: &[u8], name: &[u8]) -> bool {
    place_of(bytes, name).is_some()
}

fn place_of(bytes: &[u8], name: &[u8]) -> Option<usize> {
    bytes.windows(name.len()).position(|part| part == name)
}

/// Returns the release that a library states, cut to the length of that of this program.
fn release(bytes: &[u8]) -> Option<String> {
    let start = place_of(bytes, LIBRARY_MARK.as_bytes())?;
    let text = &bytes[start..bytes.len().min(start + LIBRARY_RELEASE.len())];
    Some(text.iter().take_while(|byte| matches!(byte, 0x20..0x7f)).map(|byte| char::from(*byte)).collect())
}

/// Build of a library in the cargo target directory from which the program runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LibraryBuild {
    /// Build as in a release, with profile `fmu` and whole-program optimisation. The crate is built alone, so that
    /// features of other crates do not affect it. The library contains no paths of this machine.
    Released,
    /// Build from the crates that were compiled for the program, which takes seconds instead of minutes. The library
    /// gives the same bits, but it is larger and contains paths of this machine.
    Shared,
}

/// Code of the FMU for one platform.
#[derive(Debug, Clone)]
pub struct Library {
    /// Platform of the library.
    pub platform: Platform,
    /// Content of the file.
    pub bytes: Vec<u8>,
}

/// Returns the libraries for an FMU, one for each platform, in the order of [`Platform::ALL`].
///
/// # Errors
/// There is no library, the build failed, a file is not a shared library for a known platform, two are for one platform, or none is for a requested
/// platform.
pub fn load(
    unit: LibraryUnit,
    kind: LibraryBuild,
    arguments: &LibraryArguments,
    console: &Console,
) -> Result<Vec<Library>> {
    let mut found: BTreeMap<Platform, (PathBuf, Vec<u8>)> = BTreeMap::new();
    let (files, _build) = find(unit, kind, arguments, console)?;
    for path in files {
        let bytes =
            tiprub_format::read_file(&path, LARGEST).map_err(|error| Failure::file(&path, "cannot be read", &error))?;
        let platform = recognised(&path, &bytes)?;
        if LibraryUnit::of_library(&bytes) != unit {
            // A directory contains the libraries of all units.
            if !arguments.library.contains(&path) {
                continue;
            }
            let problem =
                "is the library for the other kind of FMU: scenes and heat conduction have separate libraries";
            return Err(Failure::new(
                path.display(),
                problem,
                format!("Give the library {} (on Linux lib{}.so)", unit.names().1, unit.names().1),
            ));
        }
        if let Some((other, _)) = found.get(&platform) {
            return Err(Failure::new(
                path.display(),
                format!("is a second library for {}, after {}", platform.tuple(), other.display()),
                "Give only one library per platform",
            ));
        }
        found.insert(platform, (path, bytes));
    }
    if found.is_empty() {
        let problem = format!("the given files contain no {}", unit.names().1);
        return Err(Failure::new(
            "FMU library",
            problem,
            "Build it with packaging/libraries.sh and give --library DIR",
        ));
    }
    check_platforms(&arguments.platform, found.keys().copied().collect())?;
    Ok(found
        .into_iter()
        .filter(|(platform, _)| {
            arguments.platform.is_empty() || arguments.platform.iter().any(|choice| choice.0 == *platform)
        })
        .map(|(platform, (_, bytes))| Library { platform, bytes })
        .collect())
}

/// Checks that there is a library for each requested platform.
fn check_platforms(asked: &[PlatformChoice], found: Vec<Platform>) -> Result<()> {
    let Some(missing) = asked.iter().find(|choice| !found.contains(&choice.0)) else { return Ok(()) };
    let names: Vec<&str> = found.into_iter().map(Platform::tuple).collect();
    Err(Failure::new(
        format!("--platform {}", missing.0.tuple()),
        format!("no library for this platform, only for {}", names.join(", ")),
        "Install tiprub with the libraries of all platforms, or build them with packaging/libraries.sh and give \
         --library DIR",
    ))
}

/// Platform as an argument of the command line.
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

/// Returns the files that `--library` names, including those in directories.
///
/// # Errors
/// A directory cannot be read, or is empty.
pub fn given_libraries(arguments: &LibraryArguments) -> Result<Vec<PathBuf>> {
    Ok(arguments.library.iter().map(|path| files(path)).collect::<Result<Vec<_>>>()?.concat())
}

/// Origin of libraries that the command line does not name.
#[derive(Debug, PartialEq)]
enum Origin<'a> {
    /// Built in the cargo target directory from which the program runs.
    Target {
        sources: &'a Path,
        target: &'a Path,
    },
    /// Beside the program.
    Installed(Vec<PathBuf>),
    /// Built earlier from the sources of the program.
    Kept(PathBuf),
    /// To be built from the sources of the program.
    Sources(&'a Path),
    Nowhere,
}

/// Returns the origin; `sources` is the workspace from which the program was compiled, if it still exists; `cache` contains built libraries.
fn origin<'a>(unit: LibraryUnit, executable: &'a Path, sources: Option<&'a Path>, cache: Option<&Path>) -> Origin<'a> {
    if let (Some(sources), Some(target)) = (sources, build::cargo_target(executable)) {
        return Origin::Target { sources, target };
    }
    let installed = installed(unit, executable);
    if !installed.is_empty() {
        return Origin::Installed(installed);
    }
    let kept = cache.and_then(|directory| build::kept(unit, directory)).filter(|path| path.is_file());
    kept.map(Origin::Kept).or(sources.map(Origin::Sources)).unwrap_or(Origin::Nowhere)
}

/// Finds the files; also returns their directory if it is temporary, so that it lives until they are read.
fn find(
    unit: LibraryUnit,
    kind: LibraryBuild,
    arguments: &LibraryArguments,
    console: &Console,
) -> Result<(Vec<PathBuf>, Option<TempDir>)> {
    if !arguments.library.is_empty() {
        return Ok((given_libraries(arguments)?, None));
    }
    let (executable, cache) = (env::current_exe().unwrap_or_default(), RomCache::of_user());
    let sources = WORKSPACE.map(Path::new).filter(|workspace| workspace.join("fmi/Cargo.toml").is_file());
    match origin(unit, &executable, sources, cache.directory()) {
        Origin::Target { sources, target } => {
            // The library cannot share crates of another profile or target.
            let shares = kind == LibraryBuild::Shared && executable.parent() == Some(&target.join("release"));
            let kind = if shares { LibraryBuild::Shared } else { LibraryBuild::Released };
            Ok((vec![build::build(unit, kind, sources, target, console)?], None))
        }
        Origin::Installed(files) => Ok((files, None)),
        Origin::Kept(file) => Ok((vec![file], None)),
        Origin::Sources(sources) => build::build_once(unit, sources, cache.directory(), console),
        Origin::Nowhere => Err(Failure::new(
            "FMU library",
            format!(
                "not found next to {} or in ../lib/tiprub relative to it (file name such as {}{}), and the sources of \
                 this program no longer exist",
                executable.display(),
                unit.prefix(),
                Platform::X86_64Linux.file_name()
            ),
            "Use --library FILE, or install tiprub again from its sources",
        )),
    }
}

/// Returns a file, or the libraries in a directory by their extensions.
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
        let problem = format!("contains no library (.{})", EXTENSIONS.join(", ."));
        return Err(Failure::new(path.display(), problem, "Build the libraries with packaging/libraries.sh"));
    }
    Ok(files)
}

/// Returns whether a file is a library by its extension.
fn is_library(path: &Path) -> bool {
    path.extension().is_some_and(|extension| EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known)))
}

fn installed(unit: LibraryUnit, executable: &Path) -> Vec<PathBuf> {
    let directory = executable.parent().unwrap_or(Path::new("."));
    let place = |platform: Platform| {
        let name = format!("{}{}", unit.prefix(), platform.file_name());
        INSTALLED.iter().map(|part| directory.join(part).join(&name)).find(|path| path.is_file())
    };
    Platform::ALL.into_iter().filter_map(place).collect()
}

/// Returns the platform of a library that exports the functions of both FMI versions. A file that is named after a platform must be for it.
fn recognised(path: &Path, bytes: &[u8]) -> Result<Platform> {
    let refused = |problem: &str| {
        Failure::new(path.display(), problem, "Give a library built from the fmi crate with --library FILE")
    };
    let platform = Platform::of_library(bytes)
        .ok_or_else(|| refused("is not a complete 64-bit shared library for Linux, Windows or macOS"))?;
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let name = name.strip_prefix(LibraryUnit::Thermal.prefix()).unwrap_or(name);
    let called = Platform::ALL.into_iter().find(|named| name == &*named.file_name());
    if called.is_some_and(|called| called != platform) {
        return Err(Failure::new(
            path.display(),
            format!("is a library for {}, but its name is that of another platform", platform.tuple()),
            "Use the library for the platform in the name, or rename this one",
        ));
    }
    if !(holds(bytes, b"fmi2DoStep") && holds(bytes, b"fmi3DoStep")) {
        return Err(refused("is a library without the function fmi2DoStep or fmi3DoStep of an FMU"));
    }
    if !holds(bytes, LIBRARY_RELEASE.as_bytes()) {
        let found = release(bytes).unwrap_or_else(|| "it contains no release number".into());
        return Err(Failure::new(
            path.display(),
            format!("{found}; this program needs {LIBRARY_RELEASE}"),
            "Use the library of the same release and sources, or rebuild it with packaging/libraries.sh",
        ));
    }
    Ok(platform)
}

#[cfg(test)]
mod tests;
