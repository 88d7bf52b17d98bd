//! The bodies of the cube between two rings, as `tiprub reduce` makes them.

use tiprub_gallery::reduction;
use tiprub_model::cube::{CubeOptions, MassMatrix, RingOptions, Side};
use tiprub_shell::{Failure, Result, console::Console};

use crate::{
    casing_arguments::CasingArguments,
    cli::{Model, ReduceArguments},
    file_arguments::FileArguments,
    reduced::Reduced,
};

/// Set of the clamped nodes of a ring, for exported files.
const CLAMPED: &str = "CLAMPED";

/// The cube.
///
/// # Errors
/// Options of another model, and whatever the reduction refuses.
pub fn cube(arguments: &ReduceArguments, console: &Console) -> Result<Reduced> {
    refuse_others(arguments)?;
    if arguments.static_responses.is_some() {
        let problem = "all forces on the cube's contact nodes have their static response anyway";
        return Err(Failure::usage("--static-responses", problem, "Leave it out"));
    }
    let options = CubeOptions { modes: arguments.modes, mass: mass(arguments), ..CubeOptions::default() };
    Ok(Reduced::general(reduction::cube(&options, console)?, None))
}

/// A ring.
///
/// # Errors
/// Options of another model, and whatever the reduction refuses.
pub fn ring(arguments: &ReduceArguments, side: Side, console: &Console) -> Result<Reduced> {
    refuse_others(arguments)?;
    let defaults = RingOptions::new(side);
    let options = RingOptions {
        modes: arguments.modes.unwrap_or(defaults.modes),
        static_responses: arguments.static_responses.unwrap_or(defaults.static_responses),
        mass: mass(arguments),
        ..defaults
    };
    Ok(Reduced::general(reduction::cube_ring(&options, console)?, Some(CLAMPED)))
}

fn mass(arguments: &ReduceArguments) -> MassMatrix {
    arguments.mass_matrix.map_or(MassMatrix::default(), MassMatrix::from)
}

/// Options of these bodies with any other model would be passed over in silence.
///
/// # Errors
/// Such an option.
pub fn refuse_elsewhere(arguments: &ReduceArguments) -> Result<()> {
    if matches!(arguments.model, Some(Model::Cube | Model::Ring(_))) {
        return Ok(());
    }
    let given = [
        ("--static-responses", arguments.static_responses.is_some()),
        ("--mass-matrix", arguments.mass_matrix.is_some()),
    ];
    match given.into_iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::usage(option, "it belongs to `cube` and its rings", "Leave it out")),
        None => Ok(()),
    }
}

fn refuse_others(arguments: &ReduceArguments) -> Result<()> {
    let other = arguments.casing != CasingArguments::default()
        || arguments.file != FileArguments::default()
        || arguments.mesh.is_some()
        || arguments.spin.is_some()
        || arguments.contact_nodes.is_some()
        || arguments.coarse;
    if !other {
        return Ok(());
    }
    let remedy = "Give only --modes, --static-responses (rings) and --mass-matrix";
    Err(Failure::usage("MODEL", "an option given describes another model", remedy))
}
