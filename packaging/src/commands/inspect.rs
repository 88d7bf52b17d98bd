//! `tiprub inspect`: what is in a file, and whether it is sound.

use std::{
    fmt::Write as _,
    io::Read,
    path::{Path, PathBuf},
};

use serde_json::{Value, json};
use tiprub_core::{
    Scene, Simulation,
    plausibility::Slip,
    settings::{BodyMotion, ContactSettings, SceneSettings, StructureSettings},
    variables::Causality,
    warning::{self, Warning},
};
use tiprub_fmi_host::{UnpackedFmu, entries, open_archive};
use tiprub_gallery::scene_source;
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, warnings_json},
};
use tiprub_study::stability::structure::KnownContact;

use crate::{cli::InspectArguments, left_out, rom_facts::RomFacts, scene_features};

/// Kinds of files, told apart by name and, where that does not help, by their first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Fmu,
    Rom,
    Scene,
}

/// Inspect the file.
///
/// # Errors
/// The file is missing, of no known kind, or damaged.
pub fn run(arguments: &InspectArguments, console: &Console) -> Result<CommandOutcome> {
    let path = arguments.file.as_path();
    match kind(path)? {
        FileKind::Fmu => inspect_fmu(path, arguments.measure, console),
        FileKind::Rom => {
            let facts = RomFacts::of(&scene_source::read_rom(path)?, None)?;
            let slips = facts.slips();
            let warnings: Vec<Warning> = facts.warnings().into_iter().chain(slips.iter().map(Slip::warning)).collect();
            let [texts, details] = warnings_json(&warnings);
            let json = json!({ "kind": "rom", "rom": facts.to_json(), "warnings": texts, "warning_details": details });
            Ok(CommandOutcome { text: facts.to_text(), warnings, json, ..CommandOutcome::default() })
        }
        FileKind::Scene => {
            let scene = arguments.options.load(path, &arguments.cache.cache(), console)?;
            let described = describe_scene(&scene, arguments.measure, console);
            let Described { text, warnings, json } =
                described.map_err(|failure| scene_source::located(path, failure))?;
            let json = json!({ "kind": "scene", "scene": json });
            Ok(CommandOutcome { text, warnings, json, ..CommandOutcome::default() })
        }
    }
}

fn kind(path: &Path) -> Result<FileKind> {
    if path.to_str().is_some_and(|name| name.starts_with(scene_source::BUILTIN)) {
        return Ok(FileKind::Scene);
    }
    let mut start = Vec::new();
    tiprub_format::open_file(path)
        .and_then(|file| file.take(9).read_to_end(&mut start))
        .map_err(|error| Failure::file(path, "cannot be read", &error))?;
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase()).unwrap_or_default();
    match extension.to_str() {
        Some("fmu" | "zip") => Ok(FileKind::Fmu),
        Some("safetensors") => Ok(FileKind::Rom),
        Some("toml") => Ok(FileKind::Scene),
        _ if start.starts_with(b"PK") => Ok(FileKind::Fmu),
        // safetensors: length of the header (8 bytes), then its JSON.
        _ if start.len() == 9 && start[8] == b'{' => Ok(FileKind::Rom),
        _ => Err(Failure::usage(
            path.display(),
            "neither .fmu nor .safetensors nor .toml",
            "Give an FMU, a ROM file or a scene file",
        )),
    }
}

fn inspect_fmu(path: &Path, measure: bool, console: &Console) -> Result<CommandOutcome> {
    let in_file = |failure: Failure| Failure { what: format!("{}: {}", path.display(), failure.what), ..failure };
    let files = entries(&mut open_archive(path)?).map_err(in_file)?;
    let resource = |name: &str| name.strip_prefix("resources/").and_then(tiprub_format::largest_resource);
    let fmu = UnpackedFmu::open_part(path, resource)?;
    let description = &fmu.description;
    let count = |causality: &str| description.variables.iter().filter(|row| row.causality == causality).count();
    let mut text = format!(
        "{}: FMI {} co-simulation, model {}, identifier {}\n  made by {}, token {}\n\nfiles (all checksums right)\n",
        path.display(),
        description.fmi_version,
        description.model_name,
        description.model_identifier,
        description.generation_tool.as_deref().unwrap_or("an unnamed tool"),
        description.token,
    );
    for (name, size) in &files {
        let _ = writeln!(text, "  {size:>10}  {name}");
    }
    let counts = ["input", "parameter", "output", "local"].map(|causality| (causality, count(causality)));
    let _ = writeln!(text, "\nvariables");
    for (causality, count) in counts {
        let _ = writeln!(text, "  {count:>10}  {causality}");
    }
    for variable in &description.variables {
        let elements = variable.elements.map(|elements| format!("[{elements}]")).unwrap_or_default();
        let unit = variable.unit.as_deref().unwrap_or("-");
        let meaning = variable.description.as_deref().unwrap_or_default();
        let name = format!("{}{elements}", variable.name);
        let _ = writeln!(text, "  {:<11} {name:<34} {unit:<8} {meaning}", variable.causality);
    }
    let resources = inspect_resources(&fmu, measure, console)?;
    let mut warnings = Vec::new();
    if let Some(scene) = &resources {
        let _ = write!(text, "\n{}", scene.text);
        warnings.clone_from(&scene.warnings);
    }
    let json = json!({
        "kind": "fmu",
        "fmi_version": description.fmi_version,
        "model": description.model_name,
        "model_identifier": description.model_identifier,
        "token": description.token,
        "generation_tool": description.generation_tool,
        "capabilities": description.capabilities,
        "default_experiment": description.experiment,
        "files": files.iter().map(|(name, size)| json!({"name": name, "bytes": size})).collect::<Vec<_>>(),
        "variables": counts.iter().map(|(causality, count)| ((*causality).to_string(), json!(count)))
            .collect::<serde_json::Map<_, _>>(),
        "scene": resources.map(|scene| scene.json),
    });
    Ok(CommandOutcome { text, warnings, json, ..CommandOutcome::default() })
}

/// The scene inside a tiprub FMU, checked against the token; `None` for FMUs of other tools.
fn inspect_resources(fmu: &UnpackedFmu, measure: bool, console: &Console) -> Result<Option<Described>> {
    let directory: PathBuf = fmu.resources();
    if !directory.join(tiprub_format::SCENE_FILE).is_file() {
        return Ok(None);
    }
    let resources = tiprub_format::load_resources(&directory)?;
    if resources.token != fmu.description.token {
        return Err(Failure::new(
            "resources/",
            format!("their token {} is not that of modelDescription.xml", resources.token),
            "Somebody changed one of them; make the FMU again with `tiprub package`",
        ));
    }
    describe_scene(&resources.scene, measure, console).map(Some)
}

/// Description of a scene.
struct Described {
    text: String,
    warnings: Vec<Warning>,
    json: Value,
}

fn describe_scene(scene: &Scene, measure: bool, console: &Console) -> Result<Described> {
    let settings = &scene.settings;
    let in_scene = |error| Failure::from_core(format!("scene `{}`", settings.name), error);
    // Of many coupled sectors it takes long.
    let task = console.task(&format!("Checking limits of {}", settings.name), None);
    let mut simulation = Simulation::new(scene).map_err(in_scene)?;
    simulation.initialise(settings.experiment.start).map_err(in_scene)?;
    let table = simulation.table();
    let scalars = |causality| -> usize {
        table.variables().iter().filter(|row| row.causality == causality).map(|row| row.len()).sum()
    };
    let features = scene_features::features(scene);
    let mut text = scene_text(settings);
    for feature in &features {
        let _ = writeln!(text, "  adds          {feature}");
    }
    let _ = writeln!(
        text,
        "  variables     {} inputs, {} parameters, {} outputs (as scalars)",
        scalars(Causality::Input),
        scalars(Causality::Parameter),
        scalars(Causality::Output)
    );
    for reversed in simulation.if_reversed() {
        let _ = writeln!(text, "  if reversed   {reversed}");
    }
    let mut roms = Vec::new();
    for (rom, structure) in scene.roms.iter().zip(&settings.structures) {
        let contact = settings.contacts.iter().find(|contact| contact.master == structure.name);
        let sliding = contact.map(|contact| KnownContact { friction: contact.friction, speed: structure.speed });
        let facts = RomFacts::of(rom, sliding)?;
        let _ = write!(text, "\nstructure {}, {}", structure.name, facts.to_text());
        let mut json = facts.to_json();
        json["structure"] = json!(structure.name);
        roms.push(json);
    }
    let absent = left_out::left_out(scene, measure).map_err(in_scene)?;
    text.push_str(&left_out::text(&absent));
    drop(task);
    let [texts, details] = warnings_json(simulation.warnings());
    let json = json!({
        "settings": serde_json::to_value(settings).unwrap_or(Value::Null),
        "features": features,
        "left_out": left_out::json(&absent),
        "warnings": texts,
        "warning_details": details,
        "if_the_rotor_turned_the_other_way": warning::texts(&simulation.if_reversed()),
        "variables": {
            "inputs": scalars(Causality::Input),
            "parameters": scalars(Causality::Parameter),
            "outputs": scalars(Causality::Output),
        },
        "roms": roms,
    });
    Ok(Described { text, warnings: simulation.warnings().to_vec(), json })
}

fn gap_text(contact: &ContactSettings) -> String {
    match contact.sector_gaps.as_slice() {
        [] => format!("gap {} m", contact.gap),
        gaps => {
            let [low, high] =
                gaps.iter().fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], gap| [low.min(*gap), high.max(*gap)]);
            format!("gaps {low} m to {high} m")
        }
    }
}

fn scene_text(settings: &SceneSettings) -> String {
    let colon = if settings.description.is_empty() { "" } else { ": " };
    let mut text = format!("scene {}{colon}{}\n", settings.name, settings.description);
    settings.structures.iter().for_each(|structure| text.push_str(&structure_text(structure)));
    // Gaps and surfaces of what flies freely are in the ROMs.
    let flies = |contact: &ContactSettings| {
        settings.master_of(contact).is_some_and(|structure| structure.motion == BodyMotion::Free)
    };
    for surface in &settings.surfaces {
        let mut contacts = settings.contacts.iter().filter(|contact| contact.slave == surface.name);
        if let Some(structure) = surface.structure.as_ref().filter(|_| contacts.any(flies)) {
            let how = if surface.rigid { "rigid, at the place of" } else { "carried by" };
            let _ = writeln!(text, "  surface       {} {how} {structure}", surface.name);
            continue;
        }
        let shape = serde_json::to_string(&surface.shape).unwrap_or_default();
        let _ = writeln!(
            text,
            "  surface       {} {shape}, ramp {} s{}",
            surface.name,
            surface.ramp_time,
            if surface.moving { ", moving" } else { "" }
        );
    }
    for contact in &settings.contacts {
        let nodes = contact.nodes.as_ref().map_or("all nodes".to_owned(), |start| format!("nodes {start}..."));
        let gap = if flies(contact) { String::new() } else { format!(", {}", gap_text(contact)) };
        let _ = writeln!(
            text,
            "  contact       {} against {}: {nodes}{gap}, friction {}, solver {}",
            contact.master,
            contact.slave,
            contact.friction,
            serde_json::to_value(contact.solver)
                .ok()
                .and_then(|name| name.as_str().map(String::from))
                .unwrap_or_default()
        );
    }
    let _ = writeln!(text, "  outputs       {}", serde_json::to_string(&settings.outputs).unwrap_or_default());
    let experiment = &settings.experiment;
    let _ = writeln!(text, "  scheme        {}", scene_features::scheme(settings));
    let _ = writeln!(text, "  time          internal step at most {} s", settings.time.step);
    let _ = writeln!(
        text,
        "  experiment    {} s to {} s, communication step {} s",
        experiment.start, experiment.stop, experiment.communication_step
    );
    text
}

fn structure_text(structure: &StructureSettings) -> String {
    let motion = match structure.motion {
        BodyMotion::Rotating => {
            format!("speed {} rad/s ({:.1} rpm)", structure.speed, structure.speed * 30.0 / std::f64::consts::PI)
        }
        BodyMotion::Still => "stands still".into(),
        BodyMotion::Free => {
            let [x, y, z] = structure.velocity;
            format!("flies freely, starts at {x}, {y}, {z} m/s")
        }
    };
    format!(
        "  structure     {} from {}, {motion}, damping ratio {}\n",
        structure.name,
        structure.rom,
        structure.damping_ratio.map_or("of the ROM".into(), |ratio| ratio.to_string())
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use tiprub_study::arguments::{CacheArguments, SceneOptions};

    fn inspect(name: &str, contents: impl AsRef<[u8]>) -> Result<CommandOutcome> {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join(name);
        fs::write(&path, contents).unwrap();
        run(
            &InspectArguments {
                file: path,
                cache: CacheArguments::default(),
                options: SceneOptions::default(),
                measure: false,
            },
            &Console::new(true, false),
        )
    }

    #[test]
    fn wrong_files_are_named_and_never_panic() {
        for (name, contents, hint) in [
            ("a.fmu", "no zip", "not a whole zip"),
            ("a.safetensors", "\u{8}\0\0\0\0\0\0\0{}", "a.safetensors"),
            ("a.safetensors", "", "a.safetensors"),
            ("a.toml", "name = ", "a.toml:1"),
            ("a.txt", "hello", "neither"),
            ("noextension", "PK\u{3}\u{4}", "not a whole zip"),
        ] {
            let text = inspect(name, contents).unwrap_err().to_string();
            assert!(text.contains(hint), "{name}: {text}");
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let failure = run(
            &InspectArguments {
                file: "/nowhere/x.fmu".into(),
                cache: CacheArguments::default(),
                options: SceneOptions::default(),
                measure: false,
            },
            &Console::new(true, false),
        )
        .unwrap_err();
        assert!(failure.what.contains("/nowhere/x.fmu"), "{failure}");
    }
}
