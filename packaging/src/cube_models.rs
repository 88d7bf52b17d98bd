//! The bodies of the cube between two rings, as `tiprub reduce` makes them.

use tiprub_gallery::reduction;
use tiprub_model::cube::{CubeOptions, MassMatrix, RingOptions, RingSide};
use tiprub_shell::{Result, console::Console};

use crate::{
    reduce_arguments::{CubeArguments, CubeRingArguments, MassChoice},
    reduced::ReducedModel,
    shared_arguments::KindChoice,
};

/// Set of the clamped nodes of a ring, for exported files.
const CLAMPED: &str = "CLAMPED";

/// The cube.
///
/// # Errors
/// Whatever the reduction refuses.
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

/// A ring.
///
/// # Errors
/// Whatever the reduction refuses.
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
