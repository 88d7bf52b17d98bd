//! `tiprub reduce`: writes a ROM file for a blade or a casing, with its checks.

use std::{fmt::Write as _, path::Path, time::Instant};

use serde_json::{Value, json};
use tiprub_core::Rom;
use tiprub_core::limits::plausibility::Slip;
use tiprub_cosim::warning::{self, Warning};
use tiprub_field::shape_file;
use tiprub_gallery::{builtin, reduction};
use tiprub_model::{
    Rotor37Options,
    casing::{CLAMPED, RingSupport},
    rotor37::{MeshCounts, TipContact},
    stage::sector_mesh,
};
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path},
    output_file,
    places::{self, NamedFile},
};

use crate::{
    casing_arguments::CasingArguments,
    cube_models,
    reduce_arguments::{ModelToReduce, ReduceArguments, StageArguments, StageCasingArguments},
    reduced::ReducedModel,
    rom_facts::RomFacts,
    shared_arguments::{MaterialChoice, OutputArguments},
    user_mesh,
};

/// Reduces, checks and writes.
///
/// # Errors
/// Counts do not fit the mesh, input files are wrong, or files cannot be written.
pub fn run(arguments: &ReduceArguments, console: &Console) -> Result<CommandOutcome> {
    // Problems that would appear after the work are reported before it.
    let written = arguments.model.written();
    let output =
        &written.output.clone().unwrap_or_else(|| format!("{}.rom.safetensors", arguments.model.name()).into());
    let shapes = &written.shapes(output);
    let targets = [
        ("--output", Some(output)),
        ("--inp", written.inp.as_ref()),
        ("--vtk", written.vtk.as_ref()),
        ("the shape file", shapes.as_ref()),
    ];
    let names: Vec<NamedFile> =
        targets.into_iter().filter_map(|(role, path)| Some(NamedFile::new(role, path?))).collect();
    places::apart(&arguments.model.files(), &names)?;
    targets.into_iter().filter_map(|(_, path)| path).try_for_each(|path| check_target(path, written.force))?;
    let start = Instant::now();
    let mut reduced = reduced(&arguments.model, console)?;
    reduced.seconds = start.elapsed().as_secs_f64();
    let facts = RomFacts::of(&reduced.rom, None)?;
    let slips = check_slips(&reduced, &facts, written.accept_implausible)?;
    let mut files = vec![(output, tiprub_format::write_rom(&reduced.rom))];
    if let Some(path) = &written.inp {
        files.push((path, reduced.calculix()?));
    }
    if let Some(path) = &written.vtk {
        files.push((path, reduced.vtk()?));
    }
    if let Some((path, own)) = shapes.as_ref().zip(reduced.shapes.as_ref()) {
        files.push((path, shape_file::write(own, &reduced.rom)));
    }
    for (path, bytes) in &files {
        output_file::write(path, bytes)?;
    }
    let mut warnings = reduced.warnings.clone();
    warnings.extend(warning::texts(&[facts.warnings(), slips].concat()));
    if matches!(arguments.model, ModelToReduce::Blade(_) | ModelToReduce::Sector(_)) {
        warnings.extend(facts.sense_warning());
    }
    warnings.extend(spin_warning(&reduced.spin_checks));
    console.warn_texts(&warnings);
    let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
    let has_shapes = reduced.shapes.is_some();
    let shapes = shapes.as_deref().filter(|_| has_shapes);
    let (text, json) =
        (text(&reduced, &facts, &paths), json(&reduced, &facts, written, [Some(output), shapes], &warnings));
    Ok(CommandOutcome { text, json, ..CommandOutcome::default() })
}

/// Reduces and checks a model without writing files.
///
/// # Errors
/// The errors of [`run`], except those of files that are written.
pub(crate) fn rom(model: &ModelToReduce, console: &Console) -> Result<Rom> {
    let reduced = reduced(model, console)?;
    check_slips(&reduced, &RomFacts::of(&reduced.rom, None)?, model.written().accept_implausible)?;
    Ok(reduced.rom)
}

/// Rejects a model with implausible values, unless it `is_meant`: its slips are warnings then.
fn check_slips(reduced: &ReducedModel, facts: &RomFacts, is_meant: bool) -> Result<Vec<Warning>> {
    let slips = [reduced.slips.clone(), facts.slips()].concat();
    match slips.first().filter(|_| !is_meant) {
        Some(Slip { what, problem, question }) => {
            let remedy = format!("{question} If the value is correct, use --accept-implausible");
            Err(Failure::new(what, problem, remedy))
        }
        None => Ok(slips.iter().map(Slip::warning).collect()),
    }
}

/// Checks that a file can be written, and that it replaces another one only if requested. Devices and pipes are always accepted.
///
/// # Errors
/// The file already exists, or cannot be written.
pub fn check_target(path: &Path, force: bool) -> Result<()> {
    if path.is_file() && !force {
        let remedy = "Choose another file, or replace it with --force";
        return Err(Failure::new(path.display(), "already exists", remedy));
    }
    if path.exists() {
        return output_file::begin(path).map(drop);
    }
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    output_file::try_directory(directory.unwrap_or(Path::new(".")))
}

/// Formats the result for the terminal.
fn text(reduced: &ReducedModel, facts: &RomFacts, paths: &[&Path]) -> String {
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
    if reduced.shapes.is_none() {
        text.push_str(
            "\n  no shape file, because the model has no mesh of one material: `tiprub run --vtk` shows its contact nodes only",
        );
    }
    for check in &reduced.spin_checks {
        let worst =
            check.frequency_deviation().into_iter().fold(0.0, |worst: f64, deviation| worst.max(deviation.abs()));
        let _ = write!(
            text,
            "\n  at {} rad/s: first frequency {:.2} Hz; frequencies deviate by up to {worst:.3} %, growth by {:.3} %",
            check.speed,
            check.reduced_frequencies.first().copied().unwrap_or(0.0),
            check.growth_deviation()
        );
    }
    text
}

/// Returns the result as JSON.
fn json(
    reduced: &ReducedModel,
    facts: &RomFacts,
    written: &OutputArguments,
    [output, shapes]: [Option<&Path>; 2],
    warnings: &[String],
) -> Value {
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
            "rom": output.map(shown_path),
            "shapes": shapes.map(shown_path),
            "inp": written.inp.as_deref().map(shown_path),
            "vtk": written.vtk.as_deref().map(shown_path),
        },
    })
}

fn reduced(model: &ModelToReduce, console: &Console) -> Result<ReducedModel> {
    let [left, right] = builtin::RINGS.map(|(_, side)| side);
    match model {
        ModelToReduce::Blade(own) => {
            user_mesh::blade(own.file.as_deref(), &own.blade, (&own.tips, own.kept.clone()), console)
        }
        ModelToReduce::Sector(own) => user_mesh::sector(own, console),
        ModelToReduce::CasingMesh(own) => user_mesh::casing(own, console),
        ModelToReduce::Casing(own) => casing(own, console),
        ModelToReduce::Rotor37(own) => rotor37(&own.options(), console),
        ModelToReduce::Stage(own) => stage(own, console),
        ModelToReduce::StageCasing(own) => stage_casing(own, console),
        ModelToReduce::Cube(own) => cube_models::cube(own, console),
        ModelToReduce::RingLeft(own) => cube_models::ring(own, left, console),
        ModelToReduce::RingRight(own) => cube_models::ring(own, right, console),
    }
}

fn casing(arguments: &CasingArguments, console: &Console) -> Result<ReducedModel> {
    let options = arguments.options();
    let clamped = (options.support != RingSupport::Free).then_some(CLAMPED);
    Ok(ReducedModel::general(reduction::casing(&options, console)?, clamped))
}

/// Reduces the built-in bladed disk.
fn stage(arguments: &StageArguments, console: &Console) -> Result<ReducedModel> {
    let (name, options) = arguments.options();
    let sector = sector_mesh(&options.sector).map_err(|error| reduction::failure("stage", error))?;
    let mut reduced = reduction::stage(&options, console)?;
    name.clone_into(&mut reduced.rom.name);
    let (nodes, mesh) = (sector.mesh.nodes.len(), Some((sector.mesh, options.material)));
    Ok(ReducedModel::cyclic(reduced, mesh, nodes, Some("CLAMPED"), ["CYCLIC_LOW", "CYCLIC_HIGH"]))
}

/// Reduces the casing around it.
fn stage_casing(arguments: &StageCasingArguments, console: &Console) -> Result<ReducedModel> {
    let mut options = builtin::stage_casing(arguments.coarse);
    options.contact = arguments.contact_grid.unwrap_or(options.contact);
    options.patches = arguments.patches.unwrap_or(options.patches);
    options.fixed_interface_modes = arguments.fixed_interface_modes.unwrap_or(options.fixed_interface_modes);
    options.modes = arguments.modes.unwrap_or(options.modes);
    options.material = arguments.material.map_or(options.material.clone(), MaterialChoice::material);
    Ok(ReducedModel::general(reduction::stage_casing(&options, console)?, Some(CLAMPED)))
}

fn rotor37(options: &Rotor37Options, console: &Console) -> Result<ReducedModel> {
    let reduced = ReducedModel::general(reduction::rotor37(options, console)?, Some("hub"));
    let (MeshCounts { chord, thickness, .. }, [patches, rows]) = (options.mesh, options.tip.counts());
    let is_patch = !matches!(options.tip, TipContact::Nodes(_));
    let narrow = (is_patch && patches > chord + 1).then(|| user_mesh::narrow(patches, chord as f64, chord + 1));
    let narrow_rows = (rows > thickness + 1).then(|| user_mesh::narrow_rows(rows, thickness));
    Ok(ReducedModel { warnings: narrow.into_iter().chain(narrow_rows).collect(), ..reduced })
}

/// Largest deviation (%) of frequencies or growth at speed without a warning.
const SPIN_DEVIATION: f64 = 1.0;

/// Returns a warning about a fit that does not follow the full model over its range of speed.
fn spin_warning(checks: &[tiprub_model::spin::SpinCheck]) -> Option<String> {
    let worst = |check: &tiprub_model::spin::SpinCheck| {
        let frequencies = check.frequency_deviation().into_iter().fold(0.0, |worst: f64, value| worst.max(value.abs()));
        frequencies.max(check.growth_deviation().abs())
    };
    let check =
        checks.iter().max_by(|a, b| worst(a).total_cmp(&worst(b))).filter(|check| worst(check) > SPIN_DEVIATION)?;
    Some(format!(
        "at {} rad/s, frequencies or growth of the reduced model deviate by {:.1} % from the full model: stiffening \
         and growth are unreliable over this range. Give a lower --spin",
        check.speed,
        worst(check)
    ))
}
