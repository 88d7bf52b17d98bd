//! The scene file: TOML to [`SceneSettings`] and back.

use toml::de::DeTable;

use tiprub_core::settings::{Preset, SceneSettings, Scheme, Solver, StructureSettings};

use crate::load::BUILTIN_PREFIX;
use crate::scene_diagnosis::{Document, check_brackets, diagnose, position};
use crate::{Error, Result};

/// Read a scene; `origin` names the file in messages.
///
/// # Errors
/// [`Error::Scene`] with line and column, the field path, what is wrong and the remedy: wrong syntax, unknown keys,
/// missing keys, values of the wrong type, and whatever [`SceneSettings::validate`] refuses.
pub fn parse_scene(text: &str, origin: &str) -> Result<SceneSettings> {
    let document = DeTable::parse(text).map_err(|error| Error::Scene {
        origin: origin.to_owned(),
        position: error.span().map(|span| position(text, span.start)),
        what: "TOML syntax".into(),
        problem: error.message().to_owned(),
        remedy: "Correct the file at this place; values that are words need quotation marks, and each key its own line"
            .into(),
    })?;
    let document = Document { text, origin, root: document.get_ref() };
    check_brackets(&document)?;
    let mut settings: SceneSettings = toml::from_str(text).map_err(|error| diagnose(&document, &error))?;
    apply_preset(&mut settings, &document);
    settings.validate().map_err(|error| match error {
        tiprub_core::Error::Invalid { what, problem, remedy } => document.refusal(&what, problem, remedy),
        other => document.refusal("scene", other.to_string(), "Change the settings named".into()),
    })?;
    Ok(settings)
}

/// Line and column, from 1, of the key at this path (indices from 1) in the text of a scene; `None` where it is not there.
pub fn position_of(text: &str, path: &str) -> Option<(usize, usize)> {
    let document = DeTable::parse(text).ok()?;
    Document { text, origin: "", root: document.get_ref() }.position(path)
}

/// What a preset says of keys that the file leaves out.
fn apply_preset(settings: &mut SceneSettings, document: &Document) {
    if settings.preset != Preset::Paper {
        return;
    }
    if !document.holds("time.scheme") {
        settings.time.scheme = Scheme::CentralDifference;
    }
    for (index, contact) in settings.contacts.iter_mut().enumerate() {
        if !document.holds(&format!("contact[{}].solver", index + 1)) {
            contact.solver = Solver::Film;
        }
    }
}

/// Returns the name of the built-in model of a structure, `None` if it names a ROM file.
pub fn builtin_model(structure: &StructureSettings) -> Option<&str> {
    structure.rom.strip_prefix(BUILTIN_PREFIX)
}

/// A scene as TOML; reading it back gives the same settings, bit for bit.
///
/// # Panics
/// If a whole number exceeds the range of TOML, 2⁶³ − 1: no such number passes [`SceneSettings::validate`].
pub fn write_scene(settings: &SceneSettings) -> String {
    toml::to_string(settings).expect("the settings consist of tables, texts, numbers and lists")
}
