//! The `resources/` directory of an FMU: the scene, its ROMs, and the packaging options of the variables.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tiprub_core::scene::rom::{RomExtras, SUPPORT_ROWS, SupportRows};
use tiprub_core::scene::settings::{SceneSettings, SpinSettings, StructureSettings};
use tiprub_core::{Rom, Scene};

use crate::load::{LARGEST_ROM, LARGEST_SCENE, RomBytes, file_error, read_bytes, text_error};
use crate::{LIBRARY_RELEASE, Result, parse_scene, read_file, read_rom, write_rom, write_scene};

/// File name of the scene inside `resources/`.
pub const SCENE_FILE: &str = "scene.toml";
/// File name of the packaging options inside `resources/`.
pub(crate) const PACKAGE_FILE: &str = "package.toml";
/// File name of the stored results of slow checks inside `resources/`.
pub const CHECKS_FILE: &str = "checks.bin";
/// Maximum size of the stored results (bytes).
pub const LARGEST_CHECKS: u64 = 64 << 20;
/// Maximum size of the packaging options (bytes).
const LARGEST_PACKAGE: u64 = 1 << 12;
/// Suffix of the names of ROM files and thermal models.
const ARRAYS_END: &str = ".safetensors";
/// Version of the layout of `resources/`.
pub(crate) const RESOURCES_FORMAT_VERSION: u32 = 1;

pub(crate) const INTACT: &str =
    "Import the FMU again or recreate it with `tiprub package`; this copy is damaged or was modified";

/// Resources of an FMU instance.
#[derive(Debug, Clone, PartialEq)]
pub struct Resources {
    /// Settings and ROMs.
    pub scene: Scene,
    /// Instantiation token (FMI 2.0: GUID) that belongs to these resources.
    pub token: String,
    /// True if the FMI 3.0 description has arrays (otherwise scalars, as in FMI 2.0).
    pub fmi3_arrays: bool,
    /// Results of slow checks for [`Simulation::use_checks`](tiprub_core::Simulation::use_checks); empty if this
    /// release has stored none.
    pub checks: Vec<u8>,
}

/// Returns the maximum size (bytes) of a file of this name inside `resources/`; `None` if the file is not read.
///
/// # Examples
/// ```
/// assert!(tiprub_format::largest_resource("scene.toml").is_some());
/// assert!(tiprub_format::largest_resource("readme.txt").is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn largest_resource(name: &str) -> Option<u64> {
    match name {
        SCENE_FILE => Some(LARGEST_SCENE),
        PACKAGE_FILE => Some(LARGEST_PACKAGE),
        CHECKS_FILE => Some(LARGEST_CHECKS),
        _ => name.ends_with(ARRAYS_END).then_some(LARGEST_ROM),
    }
}

/// Content of `package.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PackageFile {
    format_version: u32,
    fmi3_arrays: bool,
}

/// Returns the files of `resources/`, in fixed order with fixed content for a given scene: the scene (each `rom`
/// replaced by the name of the file next to it), one ROM file per structure with the data that this scene needs, and
/// the packaging options.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// # let directory = tempfile::tempdir()?;
/// for (name, bytes) in tiprub_format::resource_files(&scene, false) {
///     std::fs::write(directory.path().join(name), bytes)?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn resource_files(scene: &Scene, fmi3_arrays: bool) -> Vec<(String, Vec<u8>)> {
    let Scene { settings, roms } = packed_scene(scene);
    let mut files = vec![(SCENE_FILE.to_owned(), write_scene(&settings).into_bytes())];
    for (structure, rom) in settings.structures.iter().zip(&roms) {
        files.push((structure.rom.clone(), write_rom(rom)));
    }
    files.push(package_file(fmi3_arrays));
    files
}

/// Returns the packaging options as a file.
pub(crate) fn package_file(fmi3_arrays: bool) -> (String, Vec<u8>) {
    let package = PackageFile { format_version: RESOURCES_FORMAT_VERSION, fmi3_arrays };
    let package = toml::to_string(&package).expect("a number and a flag can be written");
    (PACKAGE_FILE.to_owned(), package.into_bytes())
}

/// Reads the packaging options and adds their file to `files`; returns whether FMI 3.0 has arrays.
pub(crate) fn read_package(directory: &Path, files: &mut Vec<(String, Vec<u8>)>) -> Result<bool> {
    let text = read_into(directory, PACKAGE_FILE, files)?;
    Ok(parse_package(&directory.join(PACKAGE_FILE), &text)?.fmi3_arrays)
}

/// Rejects a path that is not a directory.
pub(crate) fn check_directory(directory: &Path) -> Result<()> {
    if directory.is_dir() {
        return Ok(());
    }
    Err(file_error(directory, "directory not found (the FMU's resources are expected here)", INTACT))
}

/// Returns a scene as an FMU contains it: with the names of the ROM files in the FMU, and without data that the scene
/// does not use.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// // This scene has no effects of spin: the packed ROM has no spin matrices.
/// let packed = tiprub_format::packed_scene(&scene);
/// assert!(packed.roms[0].extras.spin.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn packed_scene(scene: &Scene) -> Scene {
    let mut settings = scene.settings.clone();
    for index in 0..settings.structures.len() {
        settings.structures[index].rom = rom_file_name(scene, index);
    }
    let structures = scene.settings.structures.iter().zip(&scene.roms);
    let roms =
        structures.map(|(structure, rom)| Rom { extras: needed(structure, rom, &scene.settings), ..rom.clone() });
    Scene { roms: roms.collect(), settings }
}

/// Returns the content of a file with results of slow checks. Only this release reads the results.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
/// # let mut simulation = tiprub_core::Simulation::new(&scene)?;
/// # tiprub_core::CoSimulation::initialise(&mut simulation, 0.0)?;
/// let file = tiprub_format::write_checks(&simulation.checks());
/// assert_eq!(tiprub_format::read_checks(&file), simulation.checks());
/// assert!(tiprub_format::read_checks(b"of another release").is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_checks(checks: &[u8]) -> Vec<u8> {
    [LIBRARY_RELEASE.as_bytes(), b"\n", checks].concat()
}

/// Returns the results in a file that [`write_checks`] of this release wrote; empty for any other file.
///
/// # Examples
/// ```
/// let file = tiprub_format::write_checks(b"results");
/// assert_eq!(tiprub_format::read_checks(&file), b"results");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_checks(file: &[u8]) -> &[u8] {
    let results = file.strip_prefix(LIBRARY_RELEASE.as_bytes()).and_then(|rest| rest.strip_prefix(b"\n"));
    results.unwrap_or_default()
}

/// Returns the ROM without the data of effects that are off.
fn needed(structure: &StructureSettings, rom: &Rom, settings: &SceneSettings) -> RomExtras {
    let spins = structure.spin != SpinSettings::default();
    let carries = settings.surfaces.iter().any(|surface| surface.structure.as_ref() == Some(&structure.name));
    RomExtras {
        spin: rom.extras.spin.clone().filter(|_| spins),
        thermal: rom.extras.thermal.clone().filter(|_| structure.thermal),
        // A nodal-diameter load is distributed on the grid too.
        grid: rom.extras.grid.filter(|_| carries || structure.load.is_some()),
        harmonics: rom.extras.harmonics.clone(),
        // The displacements of these points are outputs of watched sectors.
        watched: rom.extras.watched.clone().filter(|_| !settings.outputs.watched_sectors.is_empty()),
        stress: rom.extras.stress.clone().filter(|_| settings.outputs.stress),
        stress_thermal: rom.extras.stress_thermal.clone().filter(|_| settings.outputs.stress && structure.thermal),
        stress_centrifugal: (rom.extras.stress_centrifugal.clone())
            .filter(|_| settings.outputs.stress && structure.spin.growth),
        support: rom.extras.support.clone().filter(|_| carries && settings.outputs.support_reaction).map(|support| {
            SupportRows {
                // The columns of this matrix are the patches.
                thermal: if structure.thermal { support.thermal } else { DMatrix::zeros(SUPPORT_ROWS, 0) },
                ..support
            }
        }),
        basis: rom.extras.basis,
        rows: rom.extras.rows,
    }
}

/// Returns `<structure>.rom.safetensors`, in characters that every file system and zip reader accepts. Names that would
/// collide get a number.
fn rom_file_name(scene: &Scene, index: usize) -> String {
    let safe = |name: &str| {
        let keep = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
        name.chars().map(keep).collect::<String>()
    };
    let structures = &scene.settings.structures;
    let name = safe(&structures[index].name);
    // Case is ignored, as on some file systems.
    let same = structures.iter().filter(|other| safe(&other.name).eq_ignore_ascii_case(&name)).count();
    let number = if same > 1 { format!(".{}", index + 1) } else { String::new() };
    format!("{name}{number}.rom.safetensors")
}

/// Returns the instantiation token of a set of resource files: `{8-4-4-4-12}` hexadecimal digits of a SHA-256 over the
/// release of this library and over names and contents, so that a description cannot be combined with other resources
/// or another release.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// let files = tiprub_format::resource_files(&scene, false);
/// let token = tiprub_format::instantiation_token(&files);
/// assert!(token.starts_with('{') && token.len() == 38);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn instantiation_token(files: &[(String, Vec<u8>)]) -> String {
    let mut hash = Sha256::new();
    let mut item = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    item(env!("CARGO_PKG_VERSION").as_bytes());
    for (name, content) in files {
        item(name.as_bytes());
        item(content);
    }
    let mut token = String::from("{");
    for (index, byte) in hash.finalize().iter().take(16).enumerate() {
        if matches!(index, 4 | 6 | 8 | 10) {
            token.push('-');
        }
        let _ = write!(token, "{byte:02x}"); // writing to a String cannot fail
    }
    token.push('}');
    token
}

/// Reads the `resources/` directory of an unpacked FMU.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// # let directory = tempfile::tempdir()?;
/// # for (name, bytes) in tiprub_format::resource_files(&scene, false) {
/// #     std::fs::write(directory.path().join(name), bytes)?;
/// # }
/// use tiprub_core::{CoSimulation, Simulation};
///
/// let resources = tiprub_format::load_resources(directory.path())?;
/// let mut simulation = Simulation::new(&resources.scene)?;
/// simulation.initialise(0.0)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A [`Diagnostic`](tiprub_cosim::Diagnostic) with the path of a file that is missing, unreadable or from another release; otherwise same as
/// [`parse_scene`] and [`read_rom`].
pub fn load_resources(directory: &Path) -> Result<Resources> {
    check_directory(directory)?;
    let mut files = Vec::new();
    let scene_path = directory.join(SCENE_FILE);
    let settings = parse_scene(&read_into(directory, SCENE_FILE, &mut files)?, &scene_path.display().to_string())?;
    let (mut roms, mut read) = (Vec::<Rom>::new(), RomBytes::default());
    for (index, structure) in settings.structures.iter().enumerate() {
        let name = &structure.rom;
        if Path::new(name).file_name() != Some(name.as_ref()) || name.contains(['/', '\\']) {
            let problem = format!("structure[{}].rom = {name:?} is not a file name inside resources/", index + 1);
            return Err(file_error(&scene_path, problem, INTACT));
        }
        let path = directory.join(name);
        let bytes = read_bytes(&path, LARGEST_ROM, INTACT)?;
        read.add(&path, bytes.len())?;
        roms.push(read_rom(&bytes, &path.display().to_string())?);
        files.push((name.clone(), bytes));
    }
    let fmi3_arrays = read_package(directory, &mut files)?;
    let token = instantiation_token(&files);
    // Without this file the checks are repeated.
    let checks = read_file(&directory.join(CHECKS_FILE), LARGEST_CHECKS).unwrap_or_default();
    Ok(Resources { scene: Scene { settings, roms }, token, fmi3_arrays, checks: read_checks(&checks).to_vec() })
}

fn read_into(directory: &Path, name: &str, files: &mut Vec<(String, Vec<u8>)>) -> Result<String> {
    let path = directory.join(name);
    let bytes = read_bytes(&path, largest_resource(name).unwrap_or(LARGEST_PACKAGE), INTACT)?;
    files.push((name.to_owned(), bytes.clone()));
    String::from_utf8(bytes).map_err(|error| text_error(&path, &error))
}

fn parse_package(path: &Path, text: &str) -> Result<PackageFile> {
    let table: toml::Table = toml::from_str(text).map_err(|error| file_error(path, error.message(), INTACT))?;
    let version = table.get("format_version").and_then(toml::Value::as_integer);
    if version != Some(i64::from(RESOURCES_FORMAT_VERSION)) {
        let found = version.map_or("none".to_owned(), |version| version.to_string());
        let problem = format!("found format_version {found}, expected {RESOURCES_FORMAT_VERSION}");
        return Err(file_error(path, problem, "Recreate the FMU with `tiprub package` from the same release"));
    }
    table.try_into().map_err(|error: toml::de::Error| file_error(path, error.message(), INTACT))
}
