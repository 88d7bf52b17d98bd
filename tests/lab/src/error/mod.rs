//! Error against run time of the standard problems, beside methods that share nothing with the product.

pub(crate) mod bars;
pub(crate) mod cube;
pub(crate) mod full;
pub(crate) mod marched;
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

#[cfg(test)]
mod tests {
    use tiprub_core::{
        Scene,
        settings::{Scheme, Solver},
    };
    use tiprub_gallery::scene_source;
    use tiprub_model::{Rotor37Options, reduce_rotor37, rotor37::MeshCounts};

    use super::{
        measure::apart,
        run::{Trace, trace},
        scene::SceneRun,
    };
    use crate::stability::bodies::{Body, Plate, Throw};

    const METHOD: (Scheme, Solver) = (Scheme::ModalExact, Solver::Lcp);
    const INTERVAL: f64 = 1e-5;

    fn rotor() -> Scene {
        let mesh = MeshCounts { chord: 4, thickness: 1, span: 4 };
        let options = Rotor37Options { mesh, modes: 4, ..Rotor37Options::paper() };
        let mut scene = scene_source::rotor37_scene_with(reduce_rotor37(&options, &|_| {}).unwrap().rom).unwrap();
        scene.settings.surfaces[0].ramp_time = 2e-4;
        scene
    }

    /// A body of two lumps that is thrown at a plate beside the rotor, along it at 30 m/s.
    fn beside(mut rotor: Scene, approach: f64) -> Scene {
        let throw = Throw {
            body: Body::elastic(&[0.05, 0.05], 1e7),
            velocity: [-approach, 30.0, 0.0],
            plates: vec![Plate::left(0.0201)],
            friction: 0.0,
            scheme: METHOD.0,
            solver: METHOD.1,
            step: 1e-6,
        };
        let thrown = throw.scene();
        rotor.settings.structures.extend(thrown.settings.structures);
        rotor.settings.surfaces.extend(thrown.settings.surfaces);
        rotor.settings.contacts.extend(thrown.settings.contacts);
        rotor.roms.extend(thrown.roms);
        rotor
    }

    fn run(scene: &Scene, division: u32) -> Trace {
        trace(&mut SceneRun::new(scene, METHOD, INTERVAL, division, 0.0).unwrap(), 60).unwrap()
    }

    fn error(scene: &Scene) -> f64 {
        apart(&run(scene, 4), &run(scene, 32))
    }

    #[test]
    fn what_flies_beside_a_rotor_hides_none_of_its_error() {
        let alone = error(&rotor());
        assert!((1e-7..0.1).contains(&alone), "{alone:e}");
        assert_eq!(error(&beside(rotor(), 0.0)).to_bits(), alone.to_bits(), "untouched");
        // The impact has an error of its own, relative to what it changes.
        let hit = error(&beside(rotor(), 1.0));
        assert!(hit >= alone && hit < 0.5, "{hit:e} {alone:e}");
    }

    #[test]
    fn flight_is_no_displacement_and_what_an_impact_changes_is() {
        let last = |approach: f64| {
            let found = run(&beside(rotor(), approach), 8);
            found.displacements[59][found.parts[0]..].to_vec()
        };
        assert!(last(0.0).iter().all(|value| *value == 0.0));
        let hit = last(1.0);
        let largest =
            |axis: usize| hit.iter().skip(axis).step_by(3).fold(0.0, |most: f64, value| most.max(value.abs()));
        // It has flown 18 mm along the plate, and was sent back by it.
        assert!(largest(1) < 1e-9 && (1e-5..2e-3).contains(&largest(0)), "{:e} {:e}", largest(0), largest(1));
    }
}
