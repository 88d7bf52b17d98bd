//! Error against run time of the standard problems, beside methods that share nothing with the product.

pub(crate) mod bars;
pub(crate) mod cube;
pub(crate) mod full;
pub(crate) mod outside;
pub(crate) mod rods;
pub(crate) mod rotor;
pub(crate) mod stage;
mod turning;

use bars::Bars;
use case::Case;
use cube::Cube;
use rotor::{Rub, rotor};
use tiprub_gallery::rom_cache::RomCache;
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{
    Study,
    error::{case, competitor, measure, of_cases, run, scene, window},
};

use crate::cli::{ErrorArguments, ErrorScene};

/// The study.
///
/// # Errors
/// A reference fails; never with the scenes that ship.
pub(crate) fn study(arguments: &ErrorArguments, console: &Console) -> Result<Study> {
    let scenes = if arguments.scenes.is_empty() { ErrorScene::ALL.to_vec() } else { arguments.scenes.clone() };
    let quick = arguments.common.quick;
    let cache = arguments.common.cache.cache();
    let cases = scenes.into_iter().map(|scene| case_of(scene, quick, &cache, console)).collect::<Result<Vec<_>>>()?;
    let shaken = [Bars::shaken(false).map_err(never)?, Bars::shaken(true).map_err(never)?];
    let smooth = shaken.each_ref().map(|bars| bars as &dyn Case);
    let summary = "Every time scheme and contact solver, at steps on both sides of the stability limit and with several numbers of modes, beside \
                   methods that share no code with them."
        .to_owned();
    of_cases(cases, &smooth, (quick, summary), console)
}

fn never(problem: String) -> Failure {
    Failure::new("error study", problem, "Report this to the developers")
}

/// The scene of this name, reduced where it has to be.
fn case_of(scene: ErrorScene, quick: bool, cache: &RomCache, console: &Console) -> Result<Box<dyn Case>> {
    Ok(match scene {
        ErrorScene::Carpenter => Box::new(Bars::carpenter(quick).map_err(never)?),
        ErrorScene::BouncingBar => Box::new(Bars::bouncing(quick).map_err(never)?),
        ErrorScene::Rotor37Light => Box::new(rotor(Rub::Light, quick, cache, console)?),
        ErrorScene::Rotor37Heavy => Box::new(rotor(Rub::Heavy, quick, cache, console)?),
        ErrorScene::Cube => Box::new(Cube::new(quick, cache, console)?),
        ErrorScene::Stage => Box::new(stage::stage(quick, cache, console)?),
    })
}
