//! Error against run time of built-in scenes and standard problems, compared with methods that share nothing with the
//! product.

pub(crate) mod bars;
mod belt;
mod built_in;
mod communication;
pub(crate) mod cube;
pub(crate) mod full;
mod guide_page;
pub(crate) mod marched;
pub(crate) mod outside;
pub(crate) mod rods;
pub(crate) mod rotor;
pub(crate) mod stage;
mod turning;

use bars::Bars;
use belt::BeltCase;
use built_in::BuiltIn;
use case::ErrorCase;
use cube::Cube;
use rotor::{BumpDepth, rotor};
use tiprub_figure::table::Table;
use tiprub_gallery::rom_cache::RomCache;
use tiprub_shell::{Failure, Result, console::Console, forecast::Forecast};
use tiprub_study::{
    Study,
    error::{add_summary, case, clock, competitor, measure, planned, run, scene, study_cases, window},
};

use crate::cli::{ErrorScene, LabErrorArguments};

/// Name of the table of time and error by communication step length (Markdown).
const COMMUNICATION: &str = "communication-steps.md";

/// Runs the study. Its tables and pictures are written into the guide if requested.
///
/// # Errors
/// A reference that fails, which does not happen with built-in scenes, or a guide that cannot be written.
pub(crate) fn study(arguments: &LabErrorArguments, console: &Console) -> Result<Study> {
    let guide = arguments.guide.as_deref();
    if guide.is_some() && arguments.common.quick {
        return Err(Failure::new("--guide", "the guide needs the full study", "Remove `--quick`"));
    }
    let scenes = if arguments.scenes.is_empty() { ErrorScene::ALL.to_vec() } else { arguments.scenes.clone() };
    let quick = arguments.common.quick;
    let cache = arguments.common.cache.cache();
    let mut communication = None;
    let mut cases: Vec<Box<dyn ErrorCase>> = Vec::new();
    for scene in scenes {
        cases.push(case_of(scene, (quick, &cache), console, &mut communication)?);
    }
    let shaken = [Bars::shaken(false).map_err(never)?, Bars::shaken(true).map_err(never)?];
    let smooth = shaken.each_ref().map(|bars| bars as &dyn ErrorCase);
    let summary = "Adaptive steps, fixed steps and the paper's method on built-in scenes; all schemes and solvers on \
                   standard problems, compared with methods that share no code with them."
        .to_owned();
    let forecast = Forecast::new(console, "Error against run time", planned(&cases, &smooth, quick));
    let (mut study, measured) = study_cases(cases, &smooth, (quick, summary), &forecast)?;
    forecast.finish();
    add_summary(&mut study, &measured);
    if let Some(table) = communication {
        let text = table.to_markdown().into_bytes();
        study.files.push((COMMUNICATION.into(), "time and error against the communication step".into(), text));
    }
    let time = format!("{:.0} min", clock::now().as_secs_f64() / 60.0);
    study.facts.push(("processor time of the study".into(), time));
    if let Some(directory) = guide {
        guide_page::write(&study, directory, arguments.scenes.is_empty())?;
    }
    Ok(study)
}

fn never(problem: String) -> Failure {
    Failure::new("lab error", problem, "Report this to the developers")
}

/// Returns the scene of this name, reduced if necessary; rows of built-in scenes are added to the table of
/// communication steps.
fn case_of(
    scene: ErrorScene,
    (quick, cache): (bool, &RomCache),
    console: &Console,
    communication: &mut Option<Table>,
) -> Result<Box<dyn ErrorCase>> {
    let mut built_in = |facts: built_in::BuiltInFacts| -> Result<Box<dyn ErrorCase>> {
        let case = BuiltIn::new(facts, quick, cache, console)?;
        let mut table = communication::table(&case, quick, console)?;
        match communication {
            Some(all) => all.rows.append(&mut table.rows),
            None => *communication = Some(table),
        }
        Ok(Box::new(case))
    };
    match scene {
        ErrorScene::Rotor37Light => built_in(built_in::LIGHT),
        ErrorScene::Rotor37Heavy => built_in(built_in::HEAVY),
        ErrorScene::FlexibleCasing => built_in(built_in::CASING),
        ErrorScene::Stage => built_in(built_in::STAGE),
        ErrorScene::Rotor37PaperLight => Ok(Box::new(rotor(BumpDepth::Light, quick, cache, console)?)),
        ErrorScene::Rotor37PaperHeavy => Ok(Box::new(rotor(BumpDepth::Heavy, quick, cache, console)?)),
        ErrorScene::StageCoarse => Ok(Box::new(stage::stage(quick, cache, console)?)),
        ErrorScene::Cube => Ok(Box::new(Cube::new(quick, cache, console)?)),
        ErrorScene::Carpenter => Ok(Box::new(Bars::carpenter(quick).map_err(never)?)),
        ErrorScene::Belt => Ok(Box::new(BeltCase::new(quick))),
        ErrorScene::BouncingBar => Ok(Box::new(Bars::bouncing(quick).map_err(never)?)),
    }
}

#[cfg(test)]
mod tests {
    use tiprub_core::Scene;
    use tiprub_core::scene::method::{Scheme, Solver};
    use tiprub_gallery::scene_source;
    use tiprub_model::{Rotor37Options, reduce_rotor37, rotor37::MeshCounts};

    use super::{
        measure::apart,
        run::{Trace, trace},
        scene::SceneRun,
    };
    use crate::stability::{
        bodies::{LumpChain, Plate, Throw},
        models::StabilityMethod,
    };

    const METHOD: (Scheme, Solver) = (Scheme::ModalExact, Solver::Lcp);
    const INTERVAL: f64 = 1e-5;

    fn rotor() -> Scene {
        let mesh = MeshCounts { chord: 4, thickness: 1, span: 4 };
        let options = Rotor37Options { mesh, modes: 4, ..Rotor37Options::paper() };
        let mut scene = scene_source::rotor37_scene_with(reduce_rotor37(&options, &|_| {}).unwrap().rom).unwrap();
        scene.settings.surfaces[0].ramp_time = 2e-4;
        scene
    }

    /// Adds a body of two masses that is thrown at a plate next to the rotor, along it at 30 m/s.
    fn beside(mut rotor: Scene, approach: f64) -> Scene {
        let throw = Throw {
            body: LumpChain::elastic(&[0.05, 0.05], 1e7),
            velocity: [-approach, 30.0, 0.0],
            plates: vec![Plate::left(0.0201)],
            friction: 0.0,
            method: StabilityMethod::exact(METHOD.1),
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
    fn free_body_does_not_mask_the_error_of_a_rotor() {
        let alone = error(&rotor());
        assert!((1e-7..0.1).contains(&alone), "{alone:e}");
        assert_eq!(error(&beside(rotor(), 0.0)).to_bits(), alone.to_bits(), "untouched");
        // The impact has an error that is relative to its change of velocity.
        let hit = error(&beside(rotor(), 1.0));
        assert!(hit >= alone && hit < 0.5, "{hit:e} {alone:e}");
    }

    #[test]
    fn free_body_displacement_excludes_undisturbed_flight() {
        let last = |approach: f64| {
            let found = run(&beside(rotor(), approach), 8);
            found.displacements[59][found.parts[0]..].to_vec()
        };
        assert!(last(0.0).iter().all(|value| *value == 0.0));
        let hit = last(1.0);
        let largest =
            |axis: usize| hit.iter().skip(axis).step_by(3).fold(0.0, |most: f64, value| most.max(value.abs()));
        // The body has flown 18 mm along the plate, and has bounced off it.
        assert!(largest(1) < 1e-9 && (1e-5..2e-3).contains(&largest(0)), "{:e} {:e}", largest(0), largest(1));
    }
}
