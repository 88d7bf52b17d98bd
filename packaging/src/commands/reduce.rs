//! `tiprub reduce`: from a blade or a casing to a ROM file, with its checks.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    time::Instant,
};

use serde_json::{Value, json};
use tiprub_gallery::{builtin, reduction};
use tiprub_model::{
    Rotor37Options,
    casing::{CLAMPED, Support},
    cyclic::ModeSelection,
    rotor37::MeshCounts,
    stage::sector_mesh,
};
use tiprub_shell::{
    Failure, Result,
    console::{Console, Outcome, shown_path},
    output_file,
    places::{self, Named},
};

use crate::{
    casing_arguments::{self, CasingArguments, MaterialChoice},
    cli::{Model, ReduceArguments},
    command_files, cube_models,
    file_arguments::FileArguments,
    reduced::Reduced,
    rom_facts::RomFacts,
    users_model,
};

/// Reduce, check, write.
///
/// # Errors
/// Counts that do not fit the mesh, wrong files, or files that cannot be written.
pub fn run(arguments: &ReduceArguments, console: &Console) -> Result<Outcome> {
    // What would fail after the work is said before it.
    let output = &arguments.output.clone().map_or_else(|| expected_output(arguments), Ok)?;
    let others = arguments.inp.iter().chain(&arguments.vtk);
    let names = [
        Some(("--output", output)),
        arguments.inp.as_ref().map(|path| ("--inp", path)),
        arguments.vtk.as_ref().map(|path| ("--vtk", path)),
    ];
    let names: Vec<Named> = names.into_iter().flatten().map(|(role, path)| Named::new(role, path)).collect();
    places::apart(&command_files::model_files(arguments), &names)?;
    std::iter::once(output).chain(others).try_for_each(|path| check_target(path, arguments))?;
    let start = Instant::now();
    let reduced = Reduced { seconds: start.elapsed().as_secs_f64(), ..reduced(arguments, console)? };
    let facts = RomFacts::of(&reduced.rom, None)?;
    let mut files = vec![(output, tiprub_format::write_rom(&reduced.rom))];
    if let Some(path) = &arguments.inp {
        files.push((path, reduced.calculix()?));
    }
    if let Some(path) = &arguments.vtk {
        files.push((path, reduced.vtk()?));
    }
    for (path, bytes) in &files {
        output_file::write(path, bytes)?;
    }
    let mut warnings = reduced.warnings.clone();
    warnings.extend(facts.warnings());
    warnings.extend(spin_warning(&reduced.spin_checks));
    console.warn(&warnings);
    let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
    Ok(Outcome { text: text(&reduced, &facts, &paths), json: json(&reduced, &facts, arguments, output, &warnings) })
}

/// The file that is written where none is named: that of the name which the model will have.
fn expected_output(arguments: &ReduceArguments) -> Result<PathBuf> {
    let name = match &arguments.model {
        Some(Model::Rotor37) => "rotor37".to_owned(),
        Some(Model::Casing) => casing_arguments::options(arguments)?.name,
        Some(Model::Stage) => builtin::stage(arguments.coarse).0.to_owned(),
        Some(Model::StageCasing) => builtin::stage_casing(arguments.coarse).name,
        Some(Model::Cube) => builtin::CUBE.to_owned(),
        Some(Model::Ring(side)) => {
            let [left, right] = builtin::RINGS;
            (if *side == left.1 { left.0 } else { right.0 }).to_owned()
        }
        Some(Model::File(_)) | None => users_model::name(arguments),
    };
    Ok(format!("{name}.rom.safetensors").into())
}

/// Whether a file can be written there, and replaces none without being told to. Devices and pipes take whatever comes.
fn check_target(path: &Path, arguments: &ReduceArguments) -> Result<()> {
    if path.is_file() && !arguments.force {
        let remedy = "Choose another file, or replace it with --force";
        return Err(Failure::new(path.display(), "is there already", remedy));
    }
    if path.exists() {
        return output_file::begin(path).map(drop);
    }
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    output_file::try_directory(directory.unwrap_or(Path::new(".")))
}

/// For people.
fn text(reduced: &Reduced, facts: &RomFacts, paths: &[&Path]) -> String {
    let elements = reduced.mesh.as_ref().map(|(mesh, _)| format!(" {} elements,", mesh.elements.len()));
    let read = &reduced.read.0;
    let mut text = if read.is_empty() { facts.to_text() } else { format!("{read}\n\n{}", facts.to_text()) };
    let _ = write!(
        text,
        "\n  full model: {} nodes,{} {} free degrees of freedom, reduced in {:.2} s",
        reduced.nodes,
        elements.unwrap_or_default(),
        reduced.free_dofs,
        reduced.seconds
    );
    for path in paths {
        let _ = write!(text, "\n  written: {}", path.display());
    }
    for check in &reduced.spin_checks {
        let worst =
            check.frequency_deviation().into_iter().fold(0.0, |worst: f64, deviation| worst.max(deviation.abs()));
        let _ = write!(
            text,
            "\n  at {} rad/s: {:.2} Hz first; frequencies off by up to {worst:.3} %, growth by {:.3} %",
            check.speed,
            check.reduced_frequencies.first().copied().unwrap_or(0.0),
            check.growth_deviation()
        );
    }
    text
}

/// For programs.
fn json(reduced: &Reduced, facts: &RomFacts, arguments: &ReduceArguments, output: &Path, warnings: &[String]) -> Value {
    json!({
        "rom": facts.to_json(),
        "model": reduced.read.1,
        "full_model": {
            "nodes": reduced.nodes,
            "elements": reduced.mesh.as_ref().map(|(mesh, _)| mesh.elements.len()),
            "free_dofs": reduced.free_dofs,
            "largest_mode_residual": reduced.largest_residual,
        },
        "spin": reduced.spin_checks.iter().map(|check| json!({
            "speed": check.speed,
            "full_frequencies": check.full_frequencies,
            "reduced_frequencies": check.reduced_frequencies,
            "growth_deviation": check.growth_deviation(),
        })).collect::<Vec<_>>(),
        "seconds": reduced.seconds,
        "warnings": warnings,
        "files": {
            "rom": shown_path(output),
            "inp": arguments.inp.as_deref().map(shown_path),
            "vtk": arguments.vtk.as_deref().map(shown_path),
        },
    })
}

fn reduced(arguments: &ReduceArguments, console: &Console) -> Result<Reduced> {
    cube_models::refuse_elsewhere(arguments)?;
    match &arguments.model {
        Some(Model::Rotor37) => {
            refuse_file_options(arguments)?;
            let reduction = reduction::rotor37(&rotor37_options(arguments)?, console)?;
            Ok(Reduced::general(reduction, Some("hub")))
        }
        Some(Model::Casing) => {
            refuse_file_options(arguments)?;
            let options = casing_arguments::options(arguments)?;
            let clamped = (options.support != Support::Free).then_some(CLAMPED);
            Ok(Reduced::general(reduction::casing(&options, console)?, clamped))
        }
        Some(Model::Stage) => {
            refuse_file_options(arguments)?;
            stage(arguments, console)
        }
        Some(Model::StageCasing) => {
            refuse_file_options(arguments)?;
            stage_casing(arguments, console)
        }
        Some(Model::Cube) => cube_models::cube(arguments, console),
        Some(Model::Ring(side)) => cube_models::ring(arguments, *side, console),
        Some(Model::File(_)) | None => users_model::reduce(arguments, console),
    }
}

/// The bladed disk that ships.
fn stage(arguments: &ReduceArguments, console: &Console) -> Result<Reduced> {
    if arguments.casing != CasingArguments::default() || arguments.mesh.is_some() || arguments.spin.is_some() {
        let remedy = "Leave out --mesh, --spin and what `tiprub reduce --help` lists as options of `casing`";
        return Err(Failure::usage("stage", "an option given describes another model", remedy));
    }
    let (name, mut options) = builtin::stage(arguments.coarse);
    options.contact_nodes = arguments.contact_nodes.unwrap_or(options.contact_nodes);
    options.modes = arguments.modes.map_or(options.modes, ModeSelection::Families);
    let sector = sector_mesh(&options.sector).map_err(|error| reduction::failure("stage", error))?;
    let mut reduced = reduction::stage(&options, console)?;
    name.clone_into(&mut reduced.rom.name);
    let (nodes, mesh) = (sector.mesh.nodes.len(), Some((sector.mesh, options.material)));
    Ok(Reduced::cyclic(reduced, mesh, nodes, Some("CLAMPED"), ["CYCLIC_LOW", "CYCLIC_HIGH"]))
}

/// The casing around it.
fn stage_casing(arguments: &ReduceArguments, console: &Console) -> Result<Reduced> {
    let other = arguments.mesh.is_some() || arguments.spin.is_some() || arguments.contact_nodes.is_some();
    let mut described = arguments.casing.clone();
    let (grid, patches) = (described.contact_grid.take(), described.patches.take());
    let (fixed_interface_modes, material) = (described.fixed_interface_modes.take(), described.material.take());
    if other || described != CasingArguments::default() {
        let problem = "an option given describes another model";
        let remedy = "Give only --coarse, --modes, --fixed-interface-modes, --contact-grid, --patches and --material";
        return Err(Failure::usage("stage-casing", problem, remedy));
    }
    let mut options = builtin::stage_casing(arguments.coarse);
    options.contact = grid.unwrap_or(options.contact);
    options.patches = patches.unwrap_or(options.patches);
    options.fixed_interface_modes = fixed_interface_modes.unwrap_or(options.fixed_interface_modes);
    options.modes = arguments.modes.unwrap_or(options.modes);
    options.material = material.map_or(options.material.clone(), MaterialChoice::material);
    Ok(Reduced::general(reduction::stage_casing(&options, console)?, Some(CLAMPED)))
}

fn refuse_file_options(arguments: &ReduceArguments) -> Result<()> {
    if arguments.coarse && !matches!(arguments.model, Some(Model::Stage | Model::StageCasing)) {
        return Err(Failure::usage("--coarse", "it belongs to `stage` and `stage-casing`", "Leave it out"));
    }
    if arguments.file == FileArguments::default() {
        return Ok(());
    }
    let remedy = "Leave out what `tiprub reduce --help` lists as options of a model of your own";
    Err(Failure::usage("MODEL", "an option given describes a model of one's own, and this one ships", remedy))
}

fn rotor37_options(arguments: &ReduceArguments) -> Result<Rotor37Options> {
    if arguments.casing != CasingArguments::default() {
        let remedy = "Leave out what `tiprub reduce --help` lists as options of `casing`";
        return Err(Failure::usage("rotor37", "an option given describes a casing", remedy));
    }
    let defaults = Rotor37Options::default();
    Ok(Rotor37Options {
        mesh: arguments.mesh.map_or(defaults.mesh, |size| {
            let [chord, thickness, span] = size.0;
            MeshCounts { chord, thickness, span }
        }),
        contact_nodes: arguments.contact_nodes.unwrap_or(defaults.contact_nodes),
        fixed_interface_modes: arguments.modes.unwrap_or(defaults.fixed_interface_modes),
        spin: arguments.spin,
        ..defaults
    })
}

/// Share (%) by which frequencies or growth at speed may be off without a warning.
const SPIN_DEVIATION: f64 = 1.0;

/// A fit that does not follow the full model over its range of speed.
fn spin_warning(checks: &[tiprub_model::spin::SpinCheck]) -> Option<String> {
    let worst = |check: &tiprub_model::spin::SpinCheck| {
        let frequencies = check.frequency_deviation().into_iter().fold(0.0, |worst: f64, value| worst.max(value.abs()));
        frequencies.max(check.growth_deviation().abs())
    };
    let check =
        checks.iter().max_by(|a, b| worst(a).total_cmp(&worst(b))).filter(|check| worst(check) > SPIN_DEVIATION)?;
    Some(format!(
        "at {} rad/s frequencies or growth of the reduced model are off by {:.1} %: stiffening and growth over this range are \
         not to be trusted. Give a lower --spin",
        check.speed,
        worst(check)
    ))
}
