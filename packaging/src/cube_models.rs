//! Bodies of the scene with a cube between two rings, for `tiprub reduce`.

use tiprub_gallery::reduction;
use tiprub_model::cube::{CubeOptions, MassMatrix, RingOptions, RingSide};
use tiprub_shell::{Result, console::Console};

use crate::{
    reduce_arguments::{CubeArguments, CubeRingArguments, MassChoice},
    reduced::ReducedModel,
    shared_arguments::KindChoice,
};

/// Name of the set of clamped nodes of a ring in exported files.
const CLAMPED: &str = "CLAMPED";

/// Reduces the cube.
///
/// # Errors
/// The reduction fails.
pub fn cube(arguments: &CubeArguments, console: &Console) -> Result<ReducedModel> {
    let options = CubeOptions {
        patches: arguments.contact_patches,
        kind: KindChoice::kind(arguments.kind, arguments.contact_patches.is_some()),
        modes: arguments.modes,
        mass: mass(arguments.mass_matrix),
        ..CubeOptions::default()
    };
    Ok(ReducedModel::general(reduction::cube(&options, console)?, None))
}

/// Reduces a ring.
///
/// # Errors
/// The reduction fails.
pub fn ring(arguments: &CubeRingArguments, side: RingSide, console: &Console) -> Result<ReducedModel> {
    let defaults = RingOptions::new(side);
    let options = RingOptions {
        modes: arguments.modes.unwrap_or(defaults.modes),
        static_responses: arguments.static_responses.unwrap_or(defaults.static_responses),
        mass: mass(arguments.mass_matrix),
        ..defaults
    };
    Ok(ReducedModel::general(reduction::cube_ring(&options, console)?, Some(CLAMPED)))
}

fn mass(choice: Option<MassChoice>) -> MassMatrix {
    choice.map_or(MassMatrix::default(), MassMatrix::from)
}
