//! `tiprub thermal`: writes the .fmu of the heat conduction of a casing.

use std::fmt::Write as _;

use serde_json::json;
use tiprub_gallery::reduction;
use tiprub_model::conduction::{
    AMBIENT_FILM, ConductionOptions, ConductionReduction, Conductor, GAS_FILM, MODES, reduce_mesh_conduction,
    reduce_ring_conduction,
};
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path},
};

use crate::{
    commands::package::{size, targets},
    library::{self, LibraryBuild, LibraryUnit},
    shared_arguments::MaterialChoice,
    thermal_arguments::ThermalArguments,
    thermal_fmu::ThermalPackage,
    user_mesh,
};

/// Reduces, checks, finds the library, and writes the archives.
///
/// # Errors
/// The casing or the mesh is invalid, there is no library, or files cannot be written.
pub fn run(arguments: &ThermalArguments, console: &Console) -> Result<CommandOutcome> {
    let casing = arguments.ring.options();
    let name = arguments.name();
    let targets = targets(arguments.fmi, &arguments.output, &name)?;
    let own =
        arguments.file.as_deref().map(|file| user_mesh::conducting(file, &arguments.model(), console)).transpose()?;
    let conductor = match arguments.ring.material {
        None if own.is_some() => None,
        None | Some(MaterialChoice::Steel) => Some(Conductor::steel()),
        Some(MaterialChoice::Titanium) => Some(Conductor::titanium()),
        Some(MaterialChoice::MaragingSteel) => None,
    };
    let property = |given: Option<f64>, known: Option<f64>, option: &str| {
        given.or(known).ok_or_else(|| {
            let problem = "the thermal properties of this material are unknown";
            let what = if arguments.ring.material.is_some() { "--material maraging-steel" } else { "material of FILE" };
            Failure::usage(what, problem, format!("Also give --{option}"))
        })
    };
    let options = ConductionOptions {
        name,
        density: own.as_ref().map_or(casing.material.density, |own| own.material.density),
        conductor: Conductor {
            conductivity: property(arguments.conductivity, conductor.map(|known| known.conductivity), "conductivity")?,
            specific_heat: property(
                arguments.heat_capacity,
                conductor.map(|known| known.specific_heat),
                "heat-capacity",
            )?,
        },
        films: [arguments.gas_film.unwrap_or(GAS_FILM), arguments.ambient_film.unwrap_or(AMBIENT_FILM)],
        heated: arguments.heated.unwrap_or(casing.rings.axial),
        surface: None,
        modes: arguments.modes.unwrap_or(MODES),
    };
    let reduced = reduction::with_progress("Reducing the casing", console, &|listener| {
        let Some(own) = &own else { return reduce_ring_conduction(&casing, &options, listener) };
        let heated = arguments.heated.or(arguments.ring.contact_axial);
        reduce_mesh_conduction(&own.mesh, (own.set.as_deref(), heated), casing.patches, &options, listener)
    })?;
    console.warn_texts(&own.map_or(Vec::new(), |own| own.warnings));
    let libraries = library::load(LibraryUnit::Thermal, LibraryBuild::Released, &arguments.libraries, console)?;
    let package = ThermalPackage::new(&reduced.model, &libraries)?;
    for (version, path) in &targets {
        console.print_progress(format_args!("Writing {}", path.display()));
        package.write(path, *version, arguments.arrays)?;
    }
    let mut text = facts(&reduced);
    for (version, path) in &targets {
        let _ = write!(text, "\nFMI {}.0: {} ({} kB)", version.digit(), path.display(), size(path) / 1000);
    }
    let files: Vec<_> = targets
        .iter()
        .map(|(version, path)| json!({"fmi": version.digit().to_string(), "file": shown_path(path), "bytes": size(path)}))
        .collect();
    let platforms: Vec<&str> = libraries.iter().map(|library| library.platform.tuple()).collect();
    let json = json!({"model": facts_json(&reduced), "fmus": files, "platforms": platforms});
    Ok(CommandOutcome { text, json, ..CommandOutcome::default() })
}

/// Formats the facts for the terminal.
fn facts(reduced: &ConductionReduction) -> String {
    let ConductionReduction { model, counts: [nodes, elements], areas: [gas, air, heated], time_constants, checks } =
        reduced;
    let mut text = format!(
        "{}: {nodes} nodes, {elements} elements, {} coordinates, {} patches\n  \
         heat capacity {:.1} J/K; gas side {:.4} m2, {:.2} W/K; air side {:.4} m2, {:.2} W/K; heated area {:.4} m2\n  \
         slowest time constants of the full model: {} s\n  \
         steady-state deviation from the full model (patches, heated surfaces) with the film coefficients multiplied by:",
        model.name,
        model.order(),
        model.patches.len(),
        model.heat_capacity,
        gas,
        model.gas_conductance(),
        air,
        model.ambient_conductance(),
        heated,
        time_constants.iter().take(4).map(|time| format!("{time:.2}")).collect::<Vec<_>>().join(", "),
    );
    for check in checks {
        let [gas, air] = check.factors;
        let _ = write!(text, "\n    gas {gas}, air {air}: {:.1e}, {:.1e}", check.patches, check.surfaces);
    }
    text
}

/// Returns the facts as JSON.
fn facts_json(reduced: &ConductionReduction) -> serde_json::Value {
    let model = &reduced.model;
    json!({
        "name": model.name,
        "origin": model.origin,
        "nodes": reduced.counts[0],
        "elements": reduced.counts[1],
        "coordinates": model.order(),
        "patches": model.patches.len(),
        "heat_capacity": model.heat_capacity,
        "conductances": [model.gas_conductance(), model.ambient_conductance()],
        "areas": reduced.areas,
        "time_constants": reduced.time_constants,
        "steady_states": reduced.checks.iter().map(|check| json!({
            "factors": check.factors, "patches": check.patches, "surfaces": check.surfaces,
        })).collect::<Vec<_>>(),
    })
}
