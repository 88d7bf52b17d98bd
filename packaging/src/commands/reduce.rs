//! `tiprub reduce`: from a blade or a casing to a ROM file, with its checks.

use serde_json::{Value, json};
use tiprub_model::{
    Reduction, Rotor37Options,
    casing::{CLAMPED, Support},
    inp::calculix_input,
    rotor37::MeshCounts,
};

use crate::{
    Failure, Result,
    casing_arguments::{self, CasingArguments},
    cli::{Model, ReduceArguments},
    console::{Console, Outcome},
    file_arguments::FileArguments,
    output_file, reduction,
    rom_facts::RomFacts,
    users_model::{self, UsersReduction},
};

/// Frequencies asked for in the exported finite-element model.
const EXPORTED_FREQUENCIES: usize = 10;

/// Reduce, check, write.
///
/// # Errors
/// Counts that do not fit the mesh, or files that cannot be written.
pub fn run(arguments: &ReduceArguments, console: &Console) -> Result<Outcome> {
    let Reduced { reduction, clamped, name, text: read, json: read_json, mut warnings } = reduced(arguments, console)?;
    let default_output = format!("{name}.rom.safetensors");
    let output = &arguments.output.clone().unwrap_or_else(|| default_output.into());
    let facts = RomFacts::of(&reduction.rom)?;
    let mut files = vec![(output, tiprub_format::write_rom(&reduction.rom))];
    if let Some(path) = &arguments.inp {
        let (Some(mesh), Some(material)) = (&reduction.mesh, &reduction.material) else {
            let remedy = "Leave --inp out";
            return Err(Failure::usage("--inp", "the model has no mesh of one material to export", remedy));
        };
        let text = calculix_input(mesh, material, clamped, EXPORTED_FREQUENCIES)
            .map_err(|error| Failure::from_below(path.display(), error))?;
        files.push((path, text.into_bytes()));
    }
    if !arguments.force {
        for (path, bytes) in &files {
            output_file::refuse_to_replace(path, bytes, "Choose another file, or replace it with --force")?;
        }
    }
    for (path, bytes) in &files {
        output_file::write(path, bytes)?;
    }
    warnings.extend(facts.warnings());
    warnings.extend(spin_warning(&reduction.spin_checks));
    console.warn(&warnings);
    let elements = reduction.mesh.as_ref().map(|mesh| mesh.elements.len());
    let counted = elements.map(|count| format!(" {count} elements,")).unwrap_or_default();
    let mut text = if read.is_empty() { facts.to_text() } else { format!("{read}\n\n{}", facts.to_text()) };
    text.push_str(&format!(
        "\n  full model: {} nodes,{counted} {} free degrees of freedom, reduced in {:.2} s\n  written: {}",
        reduction.nodes,
        reduction.free_dofs,
        reduction.timings.total(),
        output.display()
    ));
    if let Some(path) = &arguments.inp {
        text.push_str(&format!("\n  written: {}", path.display()));
    }
    for check in &reduction.spin_checks {
        let worst =
            check.frequency_deviation().into_iter().fold(0.0, |worst: f64, deviation| worst.max(deviation.abs()));
        text.push_str(&format!(
            "\n  at {} rad/s: {:.2} Hz first; frequencies off by up to {worst:.3} %, growth by {:.3} %",
            check.speed,
            check.reduced_frequencies.first().copied().unwrap_or(0.0),
            check.growth_deviation()
        ));
    }
    let json = json!({
        "rom": facts.to_json(),
        "model": read_json,
        "full_model": {
            "nodes": reduction.nodes,
            "elements": elements,
            "free_dofs": reduction.free_dofs,
            "largest_mode_residual": reduction.largest_residual,
        },
        "spin": reduction.spin_checks.iter().map(|check| json!({
            "speed": check.speed,
            "full_frequencies": check.full_frequencies,
            "reduced_frequencies": check.reduced_frequencies,
            "growth_deviation": check.growth_deviation(),
        })).collect::<Vec<_>>(),
        "seconds": reduction.timings.total(),
        "warnings": warnings,
        "files": { "rom": output, "inp": arguments.inp },
    });
    Ok(Outcome { text, json })
}

/// What was reduced, and what is to be told about it.
struct Reduced {
    reduction: Reduction,
    /// Set of clamped nodes, for exported files.
    clamped: Option<&'static str>,
    name: String,
    /// What was read, where it was a file.
    text: String,
    json: Value,
    warnings: Vec<String>,
}

fn reduced(arguments: &ReduceArguments, console: &Console) -> Result<Reduced> {
    let shipped = |reduction: Reduction, clamped| {
        let name = reduction.rom.name.clone();
        Reduced { reduction, clamped, name, text: String::new(), json: Value::Null, warnings: Vec::new() }
    };
    match &arguments.model {
        Some(Model::Rotor37) => {
            refuse_file_options(arguments)?;
            let reduction = reduction::rotor37(&rotor37_options(arguments)?, console)?;
            Ok(shipped(reduction, Some("hub")))
        }
        Some(Model::Casing) => {
            refuse_file_options(arguments)?;
            let options = casing_arguments::options(arguments)?;
            let clamped = (options.support != Support::Free).then_some(CLAMPED);
            Ok(shipped(reduction::casing(&options, console)?, clamped))
        }
        Some(Model::File(_)) | None => {
            let UsersReduction { reduction, name, clamped, text, json, warnings } =
                users_model::reduce(arguments, console)?;
            Ok(Reduced { reduction, clamped, name, text, json, warnings })
        }
    }
}

fn refuse_file_options(arguments: &ReduceArguments) -> Result<()> {
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
