//! Loads a scene file with its ROMs, or a built-in scene.

use std::{
    cell::RefCell,
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
};

use tiprub_core::scene::settings::SceneSettings;
use tiprub_core::{Rom, Scene};
use tiprub_format::builtin_model;
use tiprub_shell::{Failure, Result, console::Console};

use crate::{builtin, rom_cache::RomCache};

/// Scene of the demo, in the form of a user's scene file.
pub const ROTOR37_SCENE: &str = include_str!("../scenes/rotor37.toml");
/// Scene of the demo with one row of patches and fixed steps.
pub const ROTOR37_ONE_ROW_SCENE: &str = include_str!("../scenes/rotor37-one-row.toml");

/// Scene of the demo with the paper's model and method.
pub const ROTOR37_PAPER_SCENE: &str = include_str!("../scenes/rotor37-paper.toml");

/// Coupled blades in an oval flexible casing, each with three contact nodes as in the paper.
pub(crate) const STAGE_NODES_SCENE: &str = include_str!("../scenes/stage-nodes.toml");

/// Free cube between two rings.
pub const CUBE_SCENE: &str = include_str!("../scenes/cube-between-rings.toml");

/// Built-in scenes: name after `builtin:`, and text.
pub const BUILTIN_SCENES: [(&str, &str); 8] = [
    ("rotor37", ROTOR37_SCENE),
    ("rotor37-one-row", ROTOR37_ONE_ROW_SCENE),
    ("rotor37-paper", ROTOR37_PAPER_SCENE),
    ("flexible-casing", include_str!("../scenes/flexible-casing.toml")),
    ("abradable", include_str!("../scenes/abradable.toml")),
    ("stage", include_str!("../scenes/stage.toml")),
    ("stage-nodes", STAGE_NODES_SCENE),
    ("cube-between-rings", CUBE_SCENE),
];

/// Prefix of the names of built-in scenes and models.
pub const BUILTIN: &str = "builtin:";

/// Loads a scene: a path, or `builtin:` and the name of one of [`BUILTIN_SCENES`]. Built-in models come from `cache`, or are reduced with a progress
/// display.
///
/// # Errors
/// Files are missing or wrong; the error names file, line, field and remedy.
pub fn load(argument: impl AsRef<OsStr>, cache: &RomCache, console: &Console) -> Result<Scene> {
    let unknown = RefCell::new(None);
    let reduce = |name: &str| {
        let model = builtin::rom(name, cache, console);
        if model.is_none() {
            *unknown.borrow_mut() = Some(name.to_owned());
        }
        Some(model?.map_err(|failure| failure.to_string()))
    };
    match source(argument.as_ref())? {
        SceneSource::Embedded(name, text) => builtin_scene(name, text, &reduce),
        SceneSource::File(path) => tiprub_format::load_scene(path, &reduce).map_err(|error| {
            let mut failure = Failure::from(error);
            if let Some(name) = unknown.take() {
                failure.diagnostic.remedy = builtin::unknown_model_remedy(&name);
            }
            with_specific_remedy(path, failure)
        }),
    }
}

/// Loads the settings of a scene without its models: nothing is reduced.
///
/// # Errors
/// The errors of [`load`], except those of the models.
pub fn settings(argument: impl AsRef<OsStr>) -> Result<SceneSettings> {
    Ok(match source(argument.as_ref())? {
        SceneSource::Embedded(name, text) => tiprub_format::parse_scene(text, name)?,
        SceneSource::File(path) => file_settings(path)?,
    })
}

fn file_settings(path: &Path) -> Result<SceneSettings> {
    tiprub_format::load_settings(path).map_err(|error| with_specific_remedy(path, error.into()))
}

/// Replaces the remedy of a failure if the scene file does not exist, or if it is the plan of a sweep.
fn with_specific_remedy(path: &Path, mut failure: Failure) -> Failure {
    if !path.exists() {
        let names = BUILTIN_SCENES.map(|(known, _)| known);
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let hint = builtin::hint_with_prefix(&name, names);
        let known = builtin::with_prefix(&names);
        failure.diagnostic.remedy = format!("{hint}Give the path of a scene file (TOML), or one of {known}");
    } else if failure.what == "scene" {
        failure.diagnostic.remedy = "This file is the plan of a sweep: use `tiprub sweep`".to_owned();
    }
    failure
}

/// Returns the files that [`load`] would read: the scene and its ROMs; empty for a built-in or invalid scene.
pub fn files(argument: &str) -> Vec<PathBuf> {
    let Ok(SceneSource::File(path)) = source(argument.as_ref()) else { return Vec::new() };
    let structures = tiprub_format::load_settings(path).map(|settings| settings.structures).unwrap_or_default();
    let roms = structures.iter().filter(|structure| !structure.rom.starts_with(BUILTIN));
    let beside = |rom: &str| path.parent().unwrap_or(Path::new("")).join(rom);
    [path.to_path_buf()].into_iter().chain(roms.map(|structure| beside(&structure.rom))).collect()
}

/// Text of a scene with the place of its files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneText {
    /// Name for messages: the path, or the name of a built-in scene.
    pub name: String,
    /// The scene (TOML).
    pub text: String,
    /// Directory to which paths of ROM files are relative.
    pub directory: PathBuf,
}

/// Reads the text of a scene, without its models.
///
/// # Errors
/// The file cannot be read or is not a scene.
pub fn text(argument: impl AsRef<OsStr>) -> Result<SceneText> {
    match source(argument.as_ref())? {
        SceneSource::Embedded(name, text) => {
            Ok(SceneText { name: name.to_owned(), text: text.to_owned(), directory: PathBuf::new() })
        }
        SceneSource::File(path) => {
            // Checks the text and the size of the file.
            file_settings(path)?;
            let text = fs::read_to_string(path).map_err(|error| Failure::file(path, "cannot be read", &error))?;
            let directory = path.parent().unwrap_or(Path::new("")).to_owned();
            Ok(SceneText { name: path.display().to_string(), text, directory })
        }
    }
}

/// Adds the place of `time.step` in the scene file to a failure whose remedy names this key.
pub fn located(argument: impl AsRef<OsStr>, mut failure: Failure) -> Failure {
    const KEY: &str = "time.step";
    let place = || {
        let (name, text) = match source(argument.as_ref()).ok()? {
            SceneSource::Embedded(name, text) => (name.to_owned(), text.to_owned()),
            SceneSource::File(path) => (path.display().to_string(), fs::read_to_string(path).ok()?),
        };
        let (line, column) = tiprub_format::position_of(&text, KEY)?;
        Some(format!("{name}:{line}:{column}"))
    };
    if let Some(place) = failure.remedy.contains(&format!("`{KEY}`")).then(place).flatten() {
        (failure.diagnostic.place, failure.diagnostic.what) = (Some(place.into()), KEY.to_owned());
    }
    failure
}

/// Source of a scene.
enum SceneSource<'a> {
    /// One of [`BUILTIN_SCENES`].
    Embedded(&'a str, &'static str),
    File(&'a Path),
}

fn source(argument: &OsStr) -> Result<SceneSource<'_>> {
    if let Some(argument) = argument.to_str().filter(|argument| argument.starts_with(BUILTIN)) {
        let name = &argument[BUILTIN.len()..];
        let Some((_, text)) = BUILTIN_SCENES.iter().find(|(known, _)| *known == name) else {
            let names = BUILTIN_SCENES.map(|(known, _)| known);
            let known = builtin::with_prefix(&names);
            if builtin::NAMES.contains(&name) {
                let remedy = format!("Use it as `rom` in a scene file, or give one of the built-in scenes {known}");
                return Err(Failure::usage(argument, "is a built-in model, not a scene", remedy));
            }
            let remedy = format!("{}Give a scene file, or one of {known}", builtin::hint_with_prefix(name, names));
            return Err(Failure::usage(argument, "there is no such built-in scene", remedy));
        };
        return Ok(SceneSource::Embedded(argument, text));
    }
    let path = Path::new(argument);
    if path.is_dir() {
        return Err(Failure::usage(path.display(), "is a directory", "Give the scene file (TOML) in it"));
    }
    let kind = path.extension().map(|extension| extension.to_ascii_lowercase()).unwrap_or_default();
    let other = match kind.to_str() {
        Some("fmu") => Some("is an FMU, not a scene file"),
        Some("safetensors") => Some("is a ROM, not a scene file"),
        _ => None,
    };
    match other {
        Some(problem) => {
            let remedy = "Give a scene file (TOML); use `tiprub inspect` to see the contents of this file";
            Err(Failure::usage(path.display(), problem, remedy))
        }
        None => Ok(SceneSource::File(path)),
    }
}

/// Builds an embedded scene with embedded models from `reduce`.
fn builtin_scene(name: &str, text: &str, reduce: &dyn Fn(&str) -> Option<Result<Rom, String>>) -> Result<Scene> {
    tiprub_format::read_scene(text, name, |_, structure| {
        let model = builtin_model(structure).and_then(reduce).unwrap_or_else(|| Err("unknown built-in model".into()));
        model.map_err(|problem| Failure::new(&structure.rom, problem, ""))
    })
}

/// Builds [`ROTOR37_ONE_ROW_SCENE`] with a blade that is already reduced.
///
/// # Errors
/// Only if the built-in scene is invalid.
pub fn rotor37_scene_with(rom: Rom) -> Result<Scene> {
    let rom = RefCell::new(Some(rom));
    builtin_scene("builtin:rotor37-one-row", ROTOR37_ONE_ROW_SCENE, &|_| rom.borrow_mut().take().map(Ok))
}

/// Returns the scene of the stage with contact nodes, with the full or the coarse models.
///
/// # Errors
/// Only if the built-in scene or a model is invalid.
pub fn stage_scene(coarse: bool, cache: &RomCache, console: &Console) -> Result<Scene> {
    let suffix = if coarse { "-coarse" } else { "" };
    let reduce = |name: &str| {
        let model = builtin::rom(&format!("{name}{suffix}"), cache, console)?;
        Some(model.map_err(|failure| failure.to_string()))
    };
    builtin_scene("builtin:stage-nodes", STAGE_NODES_SCENE, &reduce)
}

/// Returns the embedded scene as text, with its ROM read from `rom_file` and the stop time replaced.
pub fn rotor37_text(rom_file: &str, stop: f64) -> String {
    let mut text = String::new();
    for line in ROTOR37_SCENE.lines() {
        if line.starts_with("rom = ") {
            text.push_str(&format!("rom = \"{rom_file}\""));
        } else if line.starts_with("stop = ") {
            text.push_str(&format!("stop = {stop:?}"));
        } else {
            text.push_str(line);
        }
        text.push('\n');
    }
    text
}

/// Reads a ROM file.
///
/// # Errors
/// The file is missing or damaged; the error names the array.
pub fn read_rom(path: &Path) -> Result<Rom> {
    let bytes = tiprub_format::read_file(path, tiprub_format::LARGEST_ROM)
        .map_err(|error| Failure::file(path, "cannot be read", &error))?;
    Ok(tiprub_format::read_rom(&bytes, &path.display().to_string())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn embedded_scene_is_valid_and_equals_its_file_form() {
        let embedded = tiprub_format::parse_scene(ROTOR37_SCENE, "embedded").unwrap();
        let written = tiprub_format::parse_scene(&rotor37_text("blade.rom.safetensors", 0.25), "written").unwrap();
        assert_eq!(written.structures[0].rom, "blade.rom.safetensors");
        assert_eq!(written.experiment.stop.to_bits(), 0.25_f64.to_bits());
        let mut restored = written;
        restored.structures[0].rom.clone_from(&embedded.structures[0].rom);
        restored.experiment.stop = embedded.experiment.stop;
        assert_eq!(restored, embedded);
    }

    #[test]
    fn embedded_scenes_are_valid_and_use_embedded_models() {
        for (name, text) in BUILTIN_SCENES {
            let settings = tiprub_format::parse_scene(text, name).unwrap();
            assert!(settings.structures.iter().all(|structure| structure.rom.starts_with(BUILTIN)), "{name}");
            let models = settings.structures.iter().map(|structure| &structure.rom[BUILTIN.len()..]);
            assert!(models.clone().all(|model| builtin::NAMES.contains(&model)), "{name}");
        }
    }

    #[test]
    fn scene_uses_the_model_of_the_same_name() {
        let shared = ["rotor37", "rotor37-one-row", "rotor37-paper", "stage", "stage-nodes"];
        for name in shared {
            let (_, text) = BUILTIN_SCENES.iter().find(|(scene, _)| *scene == name).unwrap();
            let settings = tiprub_format::parse_scene(text, name).unwrap();
            assert_eq!(settings.structures[0].rom, format!("{BUILTIN}{name}"));
        }
        let both = BUILTIN_SCENES.iter().filter(|(scene, _)| builtin::NAMES.contains(scene));
        assert_eq!(both.count(), shared.len());
    }

    #[test]
    fn missing_files_and_unknown_builtins_are_named() {
        let console = Console::new(true, false);
        let load = |argument: &str, console: &Console| load(argument, &RomCache::off(), console);
        let missing = load("/nowhere/scene.toml", &console).unwrap_err();
        assert!(missing.to_string().starts_with("/nowhere/scene.toml"), "{missing}");
        let failure = load("builtin:rotor38", &console).unwrap_err();
        assert_eq!(failure.what, "builtin:rotor38");
        for words in ["Did you mean `builtin:rotor37`?", "builtin:abradable"] {
            assert!(failure.remedy.contains(words), "{failure}");
        }
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("scene.toml");
        fs::write(&path, ROTOR37_SCENE.replace("builtin:rotor37", "builtin:rotor73")).unwrap();
        let failure = super::load(&path, &RomCache::off(), &console).unwrap_err();
        for words in ["`rotor73`", "Did you mean `builtin:rotor37`?", "builtin:casing37"] {
            assert!(failure.to_string().contains(words), "{failure}");
        }
        for (name, kind) in [("rub.fmu", "an FMU"), ("blade.rom.safetensors", "a ROM")] {
            let failure = load(name, &console).unwrap_err();
            assert!(failure.problem.contains(kind) && failure.remedy.contains("inspect"), "{failure}");
        }
        assert!(load("/", &console).unwrap_err().problem.contains("directory"));
    }

    #[test]
    fn rejected_step_is_located_in_the_scene_file() {
        let failure = |remedy: &str| Failure::new("scene `a`", "refused: too long", remedy);
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("scene.toml");
        fs::write(&path, "name = \"a\"\n[time]\nscheme = \"modal-exact\"\n step = 1e-6\n").unwrap();
        let found = located(&path, failure("Set `time.step` below 1e-7 s"));
        let text = found.to_string();
        assert!(text.contains("scene.toml:4:2: time.step: ") && found.problem == "refused: too long", "{found}");
        let builtin = located("builtin:rotor37", failure("Set `time.step` below 1")).to_string();
        assert!(builtin.starts_with("builtin:rotor37:"), "{builtin}");
        for (path, remedy) in [(path.as_path(), "Use less friction"), (Path::new("/nowhere.toml"), "Set `time.step`")] {
            assert_eq!(located(path, failure(remedy)).what, "scene `a`");
        }
    }

    #[test]
    fn invalid_scene_reports_line_and_field() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("scene.toml");
        fs::write(&path, ROTOR37_SCENE.replace("gap = ", "gapp = ")).unwrap();
        let text = load(&path, &RomCache::off(), &Console::new(true, false)).unwrap_err().to_string();
        assert!(text.contains("scene.toml:") && text.contains("gapp") && text.contains("`gap`"), "{text}");
    }
}
