//! Total error against run time of a scene: other steps, schemes and numbers of patches, rows of patches and modes, compared with one reference that
//! has more of all.
//!
//! Models with fewer patches, rows and modes follow from the ROM itself; those with more are reduced again, if that is possible. If it is not, the
//! reference has the modes and patches of the scene: the errors are then those of the steps and are named accordingly. All models are compared with
//! one reference at the points that their tips have in common (watched points, or common patches). The time is that of the steps, so that smaller
//! models are cheaper. The mesh does not affect the run time; its error is reported separately.

use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_shell::{
    Result,
    forecast::{Forecast, WorkPlan},
};

use super::{
    case::ErrorCase as _,
    clock,
    competitor::{Competitor, TOLERANT},
    measure::{kind, units},
    run::TimedRun as _,
    scene::SceneRun,
    user_scene::UserScene,
};
use crate::{
    convergence::{
        Runner,
        coarsen::{coarsened, fewer_rows},
        march::{Observed, RunSummary},
        refine::Again,
        refiner::Refiner,
        truncate::{Truncation, truncated},
    },
    estimate::{self, Estimate},
    master,
};

/// Numbers of internal steps, relative to the scene.
const SHARES: [f64; 5] = [0.125, 0.25, 0.5, 1.0, 2.0];
const QUICK_SHARES: [f64; 2] = [0.5, 1.0];
/// Numbers of internal steps of the reference, relative to the scene; larger ones are used if smaller ones are rejected.
const TRUE_SHARES: [u32; 3] = [4, 8, 16];
/// Factors of the models finer than the scene's, for modes and for intervals between contact points. The last one is the reference.
const FINER: [usize; 2] = [2, 4];
/// Number of times that patches and modes are halved.
const COARSER: usize = 2;
/// Minimum total time (s) and maximum number of the timed runs.
const LEAST_TIME: f64 = 5e-3;
const MOST_RUNS: usize = 5;

/// A model of the scene.
#[derive(Debug)]
pub struct SceneModel {
    /// Contact nodes, or patches along the chord.
    pub points: usize,
    /// Rows of patches across the thickness.
    pub rows: usize,
    /// Modes of the structure that has contact nodes.
    pub modes: usize,
    /// True if it is the scene's own model.
    pub own: bool,
    scene: Scene,
}

impl SceneModel {
    fn of(scene: Scene, own: bool) -> Self {
        let rom = &scene.roms[master(&scene)];
        let rows = rom.rows();
        Self { points: rom.contact_nodes.len() / rows, rows, modes: Truncation::of(rom).modes(rom), own, scene }
    }

    /// Describes the tip, such as "9 × 2 patches" or "3 nodes".
    pub(super) fn tip(&self, touching: &str) -> String {
        let rows = if self.rows == 1 { String::new() } else { format!(" × {}", self.rows) };
        format!("{}{rows} {touching}", self.points)
    }
}

/// One setting and its result.
#[derive(Debug)]
pub struct TotalRow {
    /// Index of the model.
    pub model: usize,
    /// The competitor.
    pub competitor: Competitor,
    /// Internal step (s), or tolerance with adaptive steps.
    pub step: f64,
    /// True for the unchanged scene.
    pub own: bool,
    /// Processor time of the steps (s) and error of the displacements (relative L2), or the reason of a rejection.
    pub outcome: std::result::Result<(f64, f64), String>,
}

/// Results of the measurement of total errors.
#[derive(Debug)]
pub struct Total {
    /// Models that ran, without the reference.
    pub models: Vec<SceneModel>,
    /// All settings.
    pub rows: Vec<TotalRow>,
    /// Description of the reference.
    pub truth: String,
    /// Change by the last refinement on the way to the reference: errors below cannot be read. `None` if the reference is the scene's own model.
    pub readable: Option<f64>,
    /// Kind of contact points: `patches` or `nodes`.
    pub touching: &'static str,
    /// True if the reference has more modes than the scene, more contact points along the chord, and more rows of them; nodes have no rows and count
    /// as refined.
    pub finer: [bool; 3],
    /// Errors that the ROM carries; empty if it has none.
    pub of_rom: Vec<Estimate>,
    /// Error of the mesh, or the reason why it is unknown.
    pub mesh: std::result::Result<f64, String>,
}

/// Models that are compared, and the finest one, which gives the reference.
pub struct Prepared<'a> {
    refiner: Refiner<'a>,
    models: Vec<SceneModel>,
    finer: Vec<Scene>,
    truth: Option<Scene>,
}

/// Creates the models for a user scene; the inner error states why there is nothing to measure.
///
/// # Errors
/// A reduction does not reproduce the model of the scene.
pub fn prepare<'a>(case: &'a UserScene, again: &'a Again<'a>) -> Result<std::result::Result<Prepared<'a>, String>> {
    let scene = case.scene();
    if let Err(several) = crate::one_rotor(&scene.settings) {
        return Ok(Err(several.to_string()));
    }
    let refiner = Refiner::checked(scene, case.own_division(), again)?;
    let mut finer = refiner.finer(if again.quick { &FINER[..1] } else { &FINER });
    let models = coarser(scene, again.quick);
    let truth = finer.pop();
    if models.len() == 1 && truth.is_none() {
        return Ok(Err("no coarser model can be derived from the ROM, and no finer one can be reduced".into()));
    }
    Ok(Ok(Prepared { refiner, models, finer, truth }))
}

/// Kind of work of other meshes in a forecast, apart from those of competitors.
const MESHES: usize = 1000;
/// Number of meshes that are run, including that of the scene.
const MESHES_RUN: f64 = 3.0;

impl Prepared<'_> {
    /// Plans all runs.
    pub fn plan(&self, case: &UserScene, quick: bool, ledger: &mut WorkPlan) {
        let own = (case.method(), case.own_division());
        let truth = self.truth.as_ref().unwrap_or(case.scene());
        ledger.plan(kind(0, own.0), work(case, truth, own.0, TRUE_SHARES[0].saturating_mul(own.1)));
        let shares = if quick { &QUICK_SHARES[..] } else { &SHARES[..] };
        for scene in self.models.iter().map(|model| &model.scene).chain(&self.finer) {
            for competitor in competitors(case) {
                for division in case.tried(competitor, shares) {
                    ledger.plan(kind(0, competitor), work(case, scene, competitor, division));
                }
            }
        }
        if !quick {
            ledger.plan(MESHES, MESHES_RUN * units(case, 0, own.0, own.1));
        }
    }
}

/// Returns the work of a run of a model, as internal steps of the scene's model.
fn work(case: &UserScene, scene: &Scene, competitor: Competitor, division: u32) -> f64 {
    let order = |scene: &Scene| scene.roms.iter().map(|rom| rom.total_order() as f64).sum::<f64>();
    units(case, 0, competitor, division) * order(scene) / order(case.scene())
}

/// Measures a user scene; the inner error states why nothing was measured.
///
/// # Errors
/// A mesh cannot be reduced.
pub fn measure(
    case: &UserScene,
    prepared: Prepared<'_>,
    again: &Again,
    forecast: &Forecast,
) -> Result<std::result::Result<Total, String>> {
    let scene = case.scene();
    let Prepared { refiner, mut models, finer, truth } = prepared;
    let of_source = truth.is_some();
    let truth_scene = truth.unwrap_or_else(|| scene.clone());
    let (division, truth) = match true_run(case, &truth_scene) {
        Ok(found) => found,
        Err(why) => return Ok(Err(format!("the reference does not run: {why}"))),
    };
    forecast.done(kind(0, case.method()), work(case, &truth_scene, case.method(), division));
    let before = finer.last().unwrap_or(scene);
    let before = of_source.then(|| observed(case, before, case.method(), division)).and_then(std::result::Result::ok);
    let readable = before.and_then(|(_, run)| run.displacement_change(&truth));
    models.extend(finer.into_iter().map(|scene| SceneModel::of(scene, false)));
    let rows = rows(case, &models, &truth, forecast, again.quick);
    let mesh = mesh(case, &refiner, again)?;
    if !again.quick {
        forecast.done(MESHES, MESHES_RUN * units(case, 0, case.method(), case.own_division()));
    }
    let touching =
        if scene.roms[master(scene)].contact_nodes.iter().all(|node| node.area > 0.0) { "patches" } else { "nodes" };
    let own = SceneModel::of(scene.clone(), true);
    let finest = SceneModel::of(truth_scene, false);
    let modes = finest.modes;
    let finer = [modes > own.modes, finest.points > own.points, finest.rows > own.rows || touching == "nodes"];
    let of_rom = estimate::of_rom(&scene.roms[master(scene)]);
    let step = case.method().setting(value(case, case.method(), division));
    let whose = if of_source { "" } else { " (the model of the scene, which cannot be refined)" };
    let method = case.method().name();
    let truth = format!("{} and {modes} modes with {method} at {step}{whose}", finest.tip(touching));
    Ok(Ok(Total { models, rows, truth, readable, touching, finer, of_rom, mesh }))
}

/// Returns the scene's model and coarser ones: all combinations of patches and modes that are halved once or twice; fewer rows with all patches
/// along the chord.
fn coarser(scene: &Scene, quick: bool) -> Vec<SceneModel> {
    let index = master(scene);
    let halvings = if quick { 1 } else { COARSER };
    let halved = (0..halvings).scan(scene.roms[index].clone(), |rom, _| {
        *rom = coarsened(rom).ok()?;
        Some(rom.clone())
    });
    let mut tips = vec![scene.roms[index].clone()];
    tips.extend(halved);
    let own = &scene.roms[index];
    tips.extend((1..own.rows()).filter_map(|rows| fewer_rows(own, rows).ok()));
    let own_modes = Truncation::of(&tips[0]).modes(&tips[0]);
    let mut models = Vec::new();
    for (tip, rom) in tips.into_iter().enumerate() {
        for halving in 0..=halvings {
            // The coordinates of omitted contact points become modes of a coarser tip.
            let kept = own_modes >> halving;
            let found = if Truncation::of(&rom).modes(&rom) == kept { Ok(rom.clone()) } else { truncated(&rom, kept) };
            if let (Ok(rom), true) = (found, kept > 0) {
                let mut scene = scene.clone();
                scene.roms[index] = rom;
                models.push(SceneModel::of(scene, (tip, halving) == (0, 0)));
            }
        }
    }
    models
}

/// Runs the reference with the longest of its steps that is accepted; also returns the number of steps per communication step.
fn true_run(case: &UserScene, scene: &Scene) -> std::result::Result<(u32, RunSummary), String> {
    let mut refused = String::new();
    for share in TRUE_SHARES {
        let division = share.saturating_mul(case.own_division());
        match observed(case, scene, case.method(), division) {
            Ok((_, found)) => return Ok((division, found)),
            Err(why) => refused = why,
        }
    }
    Err(refused)
}

/// Returns the competitors: the schemes with the solver of the scene's law, and the paper's method.
fn competitors(case: &UserScene) -> Vec<Competitor> {
    let Competitor::Core(_, solver) = case.method() else { return Vec::new() };
    let alike = [Solver::Lcp, Solver::Film];
    let solvers = if alike.contains(&solver) { alike.to_vec() } else { vec![solver] };
    let all = Scheme::RECURRENCES.into_iter().flat_map(|scheme| solvers.iter().map(move |solver| (scheme, *solver)));
    all.map(|(scheme, solver)| Competitor::Core(scheme, solver)).chain([TOLERANT]).collect()
}

/// Returns the internal step (s) or the tolerance.
fn value(case: &UserScene, competitor: Competitor, division: u32) -> f64 {
    (if competitor.is_by_tolerance() { 1.0 } else { case.interval() }) / f64::from(division)
}

fn rows(
    case: &UserScene,
    models: &[SceneModel],
    truth: &RunSummary,
    forecast: &Forecast,
    quick: bool,
) -> Vec<TotalRow> {
    let shares = if quick { &QUICK_SHARES[..] } else { &SHARES[..] };
    let own = case.own_division();
    let competitors = competitors(case);
    let mut rows = Vec::new();
    for (index, model) in models.iter().enumerate() {
        for &competitor in &competitors {
            for division in case.tried(competitor, shares) {
                let found = observed(case, &model.scene, competitor, division);
                let outcome = found.and_then(|(seconds, run)| match run.displacement_change(truth) {
                    Some(error) if error.is_finite() => Ok((seconds, error)),
                    _ => Err("the displacements cannot be compared with the reference".into()),
                });
                let own = model.own && competitor == case.method() && division == own;
                rows.push(TotalRow { model: index, competitor, step: value(case, competitor, division), own, outcome });
                forecast.done(kind(0, competitor), work(case, &model.scene, competitor, division));
            }
        }
    }
    rows
}

/// Returns the processor time of the steps (s), the median of several runs if they are short, and the displacements of a run.
fn observed(
    case: &UserScene,
    scene: &Scene,
    competitor: Competitor,
    division: u32,
) -> std::result::Result<(f64, RunSummary), String> {
    let Competitor::Core(scheme, solver) = competitor else {
        return Err("the method is not available for user scenes".into());
    };
    let scene = SceneRun::by(scene, (scheme, solver), case.interval(), division, 0.0);
    let (observer, points) = Observed::of(&scene.roms[master(&scene)]);
    let mut times: Vec<f64> = Vec::new();
    loop {
        let mut run = SceneRun::with_start_values(&scene, case.interval(), division, case.settings())?;
        let (mut taken, mut displacements) = (0.0, Vec::with_capacity(case.samples()));
        for _ in 0..case.samples() {
            let before = clock::now();
            run.advance()?;
            taken += (clock::now() - before).as_secs_f64();
            displacements.push(observer.displacements(&run));
        }
        times.push(taken);
        if times.iter().sum::<f64>() >= LEAST_TIME || times.len() == MOST_RUNS {
            times.sort_by(f64::total_cmp);
            return Ok((times[times.len() / 2], RunSummary::of_displacements(points, displacements)));
        }
    }
}

/// Estimates the mesh error of the scene from runs with other meshes.
fn mesh(case: &UserScene, refiner: &Refiner, again: &Again) -> Result<std::result::Result<f64, String>> {
    if again.quick {
        return Ok(Err("a quick study does not run other meshes".into()));
    }
    let direction = refiner.meshes()?;
    if direction.levels.len() < 3 {
        let few = "three meshes are needed, including that of the scene".to_owned();
        return Ok(Err(if direction.missing.is_empty() { few } else { direction.missing }));
    }
    let runner = Runner::new(case.settings(), case.samples(), again.console);
    let refined = runner.as_it_is(direction)?;
    let error = refined.own_errors().and_then(|errors| errors[0]);
    Ok(error.ok_or_else(|| "the changes from mesh to mesh do not shrink, or a run was rejected".into()))
}

#[cfg(test)]
mod tests {
    use tiprub_gallery::rom_cache::RomCache;
    use tiprub_shell::console::Console;

    use super::*;
    use crate::convergence::rows::tests::{PatchedBlade, scene};

    /// One row is compared with more rows, two rows are merged into one; if no row can be added, the error is not called total.
    #[test]
    fn patch_rows_contribute_to_the_total_error() {
        let (console, cache) = (Console::new(true, false), RomCache::off());
        let total = |rows: usize, source: Option<&dyn crate::convergence::refine::RomSource>| {
            let case = UserScene::of("a blade", scene(rows), &[], (Some(1.2e-3), true), &console).unwrap();
            let again =
                Again { source, cache: &cache, mesh: 1.0, finest_tip: 4, only: &[], quick: true, console: &console };
            let forecast = Forecast::new(&console, "total errors", case.ledger());
            measure(&case, prepare(&case, &again).unwrap().unwrap(), &again, &forecast).unwrap().unwrap()
        };
        let one = total(1, Some(&PatchedBlade));
        assert!(one.truth.starts_with("5 × 2 patches and 12 modes") && one.is_total(), "{}", one.truth);
        assert_eq!(one.directions()[0], ["steps", "modes", "patches", "rows"]);
        let error =
            |total: &Total| total.rows.iter().find(|row| row.own).and_then(|row| row.outcome.clone().ok()).unwrap().1;
        let three = total(3, Some(&PatchedBlade));
        assert!(!three.is_total() && three.name() == "error of steps, modes and patches", "{}", three.name());
        assert!(error(&three) < error(&one), "{} {}", error(&three), error(&one));
        assert_eq!(three.models.iter().map(|model| model.tip("")).collect::<std::collections::BTreeSet<_>>().len(), 4);
        let own = total(2, None);
        assert_eq!(own.directions()[1], ["modes", "patches", "rows", "mesh"]);
        assert_eq!(own.name(), "error of the steps alone");
        assert!(own.models.iter().any(|model| model.tip("patches") == "3 patches"));
    }
}
