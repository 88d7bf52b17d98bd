//! The scene file: TOML to [`SceneSettings`] and back.

use toml::de::DeTable;

use tiprub_core::settings::SceneSettings;

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
    let settings: SceneSettings = toml::from_str(text).map_err(|error| diagnose(&document, &error))?;
    settings.validate().map_err(|error| match error {
        tiprub_core::Error::Invalid { what, problem, remedy } => document.refusal(&what, problem, remedy),
        other => document.refusal("scene", other.to_string(), "Change the settings named".into()),
    })?;
    Ok(settings)
}

/// A scene as TOML; reading it back gives the same settings, bit for bit.
///
/// # Panics
/// If a whole number exceeds the range of TOML, 2⁶³ − 1: no such number passes [`SceneSettings::validate`].
pub fn write_scene(settings: &SceneSettings) -> String {
    toml::to_string(settings).expect("the settings consist of tables, texts, numbers and lists")
}
