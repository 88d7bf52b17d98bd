//! Reading of a scene file and its ROM files.

use std::path::Path;

use tiprub_core::scene::settings::SceneSettings;
use tiprub_core::{Rom, Scene};
use tiprub_cosim::Diagnostic;

use crate::{Result, builtin_model, parse_scene, read_file, read_rom, read_scene};

/// Prefix of a `rom` entry that names a built-in model.
pub(crate) const BUILTIN_PREFIX: &str = "builtin:";

/// Maximum size of a ROM file (bytes): mass, stiffness and three spin matrices of 3500 coordinates, whose eigenvalues
/// take minutes.
pub const LARGEST_ROM: u64 = 512 << 20;
/// Maximum size of a scene file (bytes): six hundred rotors, each with its surface, or a measured casing of fifty
/// thousand points. A parser needs seventy times as much memory for a text of short tables.
pub(crate) const LARGEST_SCENE: u64 = 1 << 20;
/// Maximum size of all ROM files of a scene together (bytes).
const LARGEST_ROMS: u64 = 2 << 30;

/// Counter of the bytes of the ROM files of a scene; several structures may use one file.
#[derive(Default)]
pub(crate) struct RomBytes(u64);

impl RomBytes {
    /// Adds one more file.
    ///
    /// # Errors
    /// A total above the maximum size.
    pub(crate) fn add(&mut self, path: &Path, bytes: usize) -> Result<()> {
        self.0 = self.0.saturating_add(bytes as u64);
        if self.0 <= LARGEST_ROMS {
            return Ok(());
        }
        let problem =
            format!("this file brings the total size of the ROM files above the limit of {LARGEST_ROMS} bytes");
        Err(file_error(path, problem, "Use fewer structures or smaller ROMs"))
    }
}

/// Reads a scene file and its ROM files, whose paths are relative to it. Names after `builtin:` are passed to
/// `builtin`, which returns `None` for an unknown name, and otherwise a ROM or the reason why there is none.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// # let directory = tempfile::tempdir()?;
/// # for (name, bytes) in tiprub_format::resource_files(&scene, false) {
/// #     std::fs::write(directory.path().join(name), bytes)?;
/// # }
/// # let path = directory.path().join("scene.toml");
/// // A scene without built-in models.
/// let scene = tiprub_format::load_scene(&path, &|_name| None)?;
/// assert_eq!(scene.roms.len(), scene.settings.structures.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A [`Diagnostic`] for files that cannot be read, otherwise same as [`parse_scene`] and [`read_rom`].
pub fn load_scene(path: &Path, builtin: &dyn Fn(&str) -> Option<Result<Rom, String>>) -> Result<Scene> {
    let directory = path.parent().unwrap_or(Path::new(""));
    let mut read = RomBytes::default();
    read_scene(&scene_text(path)?, &path.display().to_string(), |index, structure| match builtin_model(structure) {
        Some(name) => builtin_rom(path, index, name, builtin(name)),
        None => {
            let relative =
                if Path::new(&structure.rom).is_relative() { " (a path relative to the scene file)" } else { "" };
            let remedy = format!(
                "Correct structure[{}].rom in {}{relative}, or create the file with `tiprub reduce`",
                index + 1,
                path.display()
            );
            let path = directory.join(&structure.rom);
            let bytes = read_bytes(&path, LARGEST_ROM, &remedy)?;
            read.add(&path, bytes.len())?;
            read_rom(&bytes, &path.display().to_string())
        }
    })
}

fn scene_text(path: &Path) -> Result<String> {
    read_text(path, "Give the path of a scene file (TOML)")
}

/// Reads a scene file, without the ROM files.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// # let directory = tempfile::tempdir()?;
/// # let path = directory.path().join("scene.toml");
/// # std::fs::write(&path, tiprub_format::write_scene(&scene.settings))?;
/// let settings = tiprub_format::load_settings(&path)?;
/// println!("{} structures", settings.structures.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A [`Diagnostic`] for a file that cannot be read, otherwise same as [`parse_scene`].
pub fn load_settings(path: &Path) -> Result<SceneSettings> {
    parse_scene(&scene_text(path)?, &path.display().to_string())
}

fn builtin_rom(scene: &Path, index: usize, name: &str, answer: Option<Result<Rom, String>>) -> Result<Rom> {
    let refuse = |problem: String, remedy: &str| {
        Diagnostic::new(format!("structure[{}].rom", index + 1), problem, remedy).at(scene.display())
    };
    match answer {
        Some(Ok(rom)) => rom.validate().map(|()| rom).map_err(|error| {
            refuse(format!("the built-in model `{name}` is not usable: {error}"), "Report this to the developers")
        }),
        Some(Err(problem)) => Err(refuse(
            format!("the built-in model `{name}` could not be generated: {problem}"),
            "Use a ROM file instead, or fix the reported problem",
        )),
        None => Err(refuse(
            format!("there is no built-in model `{name}`"),
            "Give a ROM file or a built-in model such as `builtin:rotor37`",
        )),
    }
}

/// Returns the error of a file.
pub(crate) fn file_error(path: &Path, problem: impl ToString, remedy: impl ToString) -> Diagnostic {
    Diagnostic::new("", problem, remedy).at(path.display())
}

/// Returns the bytes of a file of at most `most` bytes; `remedy` is the remedy in the message if it cannot be read.
pub(crate) fn read_bytes(path: &Path, most: u64, remedy: &str) -> Result<Vec<u8>> {
    read_file(path, most).map_err(|error| file_error(path, format!("cannot be read: {error}"), remedy))
}

fn read_text(path: &Path, remedy: &str) -> Result<String> {
    String::from_utf8(read_bytes(path, LARGEST_SCENE, remedy)?).map_err(|error| text_error(path, &error))
}

pub(crate) fn text_error(path: &Path, error: &std::string::FromUtf8Error) -> Diagnostic {
    let offset = error.utf8_error().valid_up_to();
    let line = error.as_bytes()[..offset].iter().filter(|byte| **byte == b'\n').count() + 1;
    file_error(path, format!("invalid UTF-8 in line {line} (byte {offset})"), "Save the file as UTF-8")
}
