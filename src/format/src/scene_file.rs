//! The scene file: TOML to [`SceneSettings`] and back.

use toml::de::DeTable;

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{ADAPTIVE_STEP, Preset, SceneSettings, StructureSettings, TimeSettings};
use tiprub_core::{Rom, Scene};
use tiprub_cosim::Diagnostic;

use crate::Result;
use crate::load::BUILTIN_PREFIX;
use crate::scene_diagnosis::{Document, check_brackets, diagnose, position, scene_error};

/// Keys that are optional in a file.
const SCHEME: &str = "time.scheme";
const STEP: &str = "time.step";

/// Reads a scene; `origin` names the file in messages. If the text has no scheme, one is chosen from the settings
/// without their ROMs.
///
/// # Examples
/// ```
/// let text = r#"
/// name = "bench"
///
/// [[structure]]
/// name = "blade"
/// rom = "blade.rom.safetensors"
/// motion = "rotating"
/// speed = 100.0
///
/// [[surface]]
/// name = "casing"
///
/// [surface.shape]
/// kind = "circular"
///
/// [[contact]]
/// master = "blade"
/// slave = "casing"
/// gap = 1e-4
///
/// [experiment]
/// start = 0.0
/// stop = 0.01
/// communication_step = 1e-4
/// "#;
///
/// let settings = tiprub_format::parse_scene(text, "bench.toml")?;
/// assert_eq!(settings.contacts[0].gap, 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A [`Diagnostic`] with line and column, the field path, the problem and the remedy: wrong syntax, unknown keys,
/// missing keys, values of the wrong type, and everything that [`SceneSettings::validate`] rejects.
pub fn parse_scene(text: &str, origin: &str) -> Result<SceneSettings> {
    with_document(text, origin, |document| {
        let mut settings = parse(document)?;
        choose_scheme(&mut settings, &[], document)?;
        Ok(settings)
    })
}

/// Reads a scene with its ROMs, which `rom` returns for the path of a structure and its settings. If the text has no
/// scheme, it is chosen here with the ROMs, and everything that runs, studies or packages the scene uses this choice.
///
/// # Examples
/// ```
/// # let text = r#"
/// # name = "bench"
/// #
/// # [[structure]]
/// # name = "blade"
/// # rom = "blade.rom.safetensors"
/// # motion = "rotating"
/// # speed = 100.0
/// #
/// # [[surface]]
/// # name = "casing"
/// #
/// # [surface.shape]
/// # kind = "circular"
/// #
/// # [[contact]]
/// # master = "blade"
/// # slave = "casing"
/// # gap = 1e-4
/// #
/// # [time]
/// # step = 1e-6
/// #
/// # [experiment]
/// # start = 0.0
/// # stop = 0.01
/// # communication_step = 1e-4
/// # "#;
/// # let blade = tiprub_test_models::blade(1);
///
/// let scene = tiprub_format::read_scene(text, "bench.toml", |_index, _structure| Ok::<_, tiprub_cosim::Diagnostic>(blade.clone()))?;
/// assert_eq!(scene.roms[0].name, blade.name);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Same as [`parse_scene`], and the errors of `rom`.
pub fn read_scene<E: From<Diagnostic>>(
    text: &str,
    origin: &str,
    mut rom: impl FnMut(usize, &StructureSettings) -> Result<Rom, E>,
) -> Result<Scene, E> {
    with_document(text, origin, |document| {
        let mut settings = parse(document)?;
        let structures = settings.structures.iter().enumerate();
        let roms = structures.map(|(index, structure)| rom(index, structure)).collect::<Result<Vec<_>, E>>()?;
        choose_scheme(&mut settings, &roms, document)?;
        Ok(Scene { settings, roms })
    })
}

fn with_document<T, E: From<Diagnostic>>(
    text: &str,
    origin: &str,
    work: impl FnOnce(&Document) -> Result<T, E>,
) -> Result<T, E> {
    let root = DeTable::parse(text).map_err(|error| {
        let position = error.span().map(|span| position(text, span.start));
        let remedy =
            "Correct the file at this position; text values need quotation marks, and each key needs its own line";
        scene_error(origin, position, "TOML syntax", error.message(), remedy)
    })?;
    work(&Document { text, origin, root: root.get_ref() })
}

/// Returns validated settings. If the document has no scheme, it is not chosen yet.
fn parse(document: &Document) -> Result<SceneSettings> {
    check_brackets(document)?;
    let mut settings: SceneSettings = toml::from_str(document.text).map_err(|error| diagnose(document, &error))?;
    apply_preset(&mut settings, document);
    if !document.holds(STEP) {
        settings.time.step = ADAPTIVE_STEP;
    }
    settings.validate().map_err(|error| document.locate(error.into_diagnostic()))?;
    Ok(settings)
}

/// Chooses the scheme of a document without one from the known ROMs, and rejects fixed steps without a length.
fn choose_scheme(settings: &mut SceneSettings, roms: &[Rom], document: &Document) -> Result<()> {
    if !document.holds(SCHEME) && settings.preset == Preset::None {
        let (scheme, reason) = settings.default_scheme(roms);
        (settings.time.scheme, settings.time.scheme_reason) = (scheme, Some(reason));
    }
    let TimeSettings { scheme, scheme_reason, .. } = &settings.time;
    if document.holds(STEP) || scheme.properties().adaptive {
        return Ok(());
    }
    let why = scheme_reason.as_ref().map_or(String::new(), |reason| format!(" ({reason})"));
    let problem = format!("missing: the scheme `{}`{why} uses fixed steps", scheme.name());
    let is_adaptive = scheme_reason.is_none() && settings.default_scheme(roms).0.properties().adaptive;
    let galerkin = if is_adaptive { ", or use scheme = \"galerkin\", which chooses its own steps" } else { "" };
    let remedy = format!(
        "Add a step in s to [time], such as `step = 1e-6`, and check it with `tiprub run --estimate`; if it is too \
         long, the error gives a shorter one{galerkin}"
    );
    Err(document.locate(Diagnostic::new(STEP, problem, remedy)))
}

/// Returns line and column, from 1, of the key at this path (indices from 1) in the text of a scene; `None` if it is
/// missing.
///
/// # Examples
/// ```
/// let text = "[time]\nstep = 1e-6\n";
/// assert_eq!(tiprub_format::position_of(text, "time.step"), Some((2, 1)));
/// assert_eq!(tiprub_format::position_of(text, "time.scheme"), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn position_of(text: &str, path: &str) -> Option<(usize, usize)> {
    let document = DeTable::parse(text).ok()?;
    Document { text, origin: "", root: document.get_ref() }.position(path)
}

/// Sets the keys of a preset that are missing in the file.
fn apply_preset(settings: &mut SceneSettings, document: &Document) {
    if settings.preset != Preset::Paper {
        return;
    }
    if !document.holds(SCHEME) {
        settings.time.scheme = Scheme::PAPER;
    }
    for (index, contact) in settings.contacts.iter_mut().enumerate() {
        if !document.holds(&format!("contact[{}].solver", index + 1)) {
            contact.solver = Solver::PAPER;
        }
    }
}

/// Returns the name of the built-in model of a structure, `None` if it names a ROM file.
///
/// # Examples
/// ```
/// # use tiprub_core::scene::settings::StructureSettings;
/// let structure = StructureSettings { rom: "builtin:rotor37".into(), ..StructureSettings::default() };
/// assert_eq!(tiprub_format::builtin_model(&structure), Some("rotor37"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn builtin_model(structure: &StructureSettings) -> Option<&str> {
    structure.rom.strip_prefix(BUILTIN_PREFIX)
}

/// Writes a scene as TOML; reading it back gives the same settings, bit for bit.
///
/// # Examples
/// ```
/// # let scene = tiprub_test_models::rub(2);
///
/// let text = tiprub_format::write_scene(&scene.settings);
/// assert_eq!(tiprub_format::parse_scene(&text, "copy")?, scene.settings);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// If an integer exceeds the range of TOML, 2⁶³ − 1, which [`SceneSettings::validate`] rejects.
pub fn write_scene(settings: &SceneSettings) -> String {
    toml::to_string(settings).expect("the settings consist of tables, strings, numbers and lists")
}
