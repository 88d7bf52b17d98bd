//! Total error against run time of a scene: other steps, schemes, numbers of patches, of rows of them and of modes, against one truth with more of
//! all.
//!
//! Models with fewer patches, rows and modes follow from the ROM itself; those with more are reduced again, where that is possible. Where it is
//! not, the truth has the modes and patches of the scene: the errors are then of the steps, and are called so. All are held
//! against one truth, by what their tips have in common (watched points, or patches that all have). Time is that of the steps: a
//! model is as cheap as it is small. A mesh costs no run time: what it leaves is told beside the others.

use tiprub_core::{
    Scene,
    settings::{Scheme, Solver},
};
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

/// Internal steps, times the number that the scene asks for.
const SHARES: [f64; 5] = [0.125, 0.25, 0.5, 1.0, 2.0];
const QUICK_SHARES: [f64; 2] = [0.5, 1.0];
/// Internal steps of the truth, times the number that the scene asks for: more where fewer are refused.
const TRUE_SHARES: [u32; 3] = [4, 8, 16];
/// Models finer than the scene's: so many times its modes and spaces between contact points. The last is the truth.
const FINER: [usize; 2] = [2, 4];
/// Halvings of patches and of modes.
const COARSER: usize = 2;
/// Timed runs add up to so much at least (s), and are no more than so many.
const LEAST_TIME: f64 = 5e-3;
const MOST_RUNS: usize = 5;

/// A model of the scene.
#[derive(Debug)]
pub struct SceneModel {
    /// Contact nodes, or patches along the chord.
    pub points: usize,
    /// Rows of patches across the thickness.
    pub rows: usize,
    /// Modes of the structure that touches.
    pub modes: usize,
    /// Whether it is the scene's.
    pub own: bool,
    scene: Scene,
}

impl SceneModel {
    fn of(scene: Scene, own: bool) -> Self {
        let rom = &scene.roms[master(&scene)];
        let rows = rom.rows();
        Self { points: rom.contact_nodes.len() / rows, rows, modes: Truncation::of(rom).modes(rom), own, scene }
    }

    /// "9 × 2 patches", "3 nodes".
    pub(super) fn tip(&self, touching: &str) -> String {
        let rows = if self.rows == 1 { String::new() } else { format!(" × {}", self.rows) };
        format!("{}{rows} {touching}", self.points)
    }
}

/// One setting and what became of it.
#[derive(Debug)]
pub struct TotalRow {
    /// Index of the model.
    pub model: usize,
    /// Who.
    pub competitor: Competitor,
    /// Internal step (s); the tolerance of those that go by one.
    pub step: f64,
    /// Whether it is the scene as it stands.
    pub own: bool,
    /// Processor time of the steps (s) and error of the displacements (relative L2), or why it is refused.
    pub outcome: std::result::Result<(f64, f64), String>,
}

/// Everything that was found.
#[derive(Debug)]
pub struct Total {
    /// The models that ran, the truth not among them.
    pub models: Vec<SceneModel>,
    /// All settings.
    pub rows: Vec<TotalRow>,
    /// Description of the reference.
    pub truth: String,
    /// Change by the last refinement on the way to the reference: errors below cannot be read. `None` if the reference is the scene's own model.
    pub readable: Option<f64>,
    /// `patches` or `nodes`.
    pub touching: &'static str,
    /// Whether the truth has more modes than the scene, more contact points along the chord, and more rows of them; nodes have no rows, and count
    /// as refined.
    pub finer: [bool; 3],
    /// Errors that the ROM carries; empty if it has none.
    pub of_rom: Vec<Estimate>,
    /// Error of the mesh, or why it is unknown.
    pub mesh: std::result::Result<f64, String>,
}

/// Models that are held against each other, and the finest, which the truth is found with.
pub struct Prepared<'a> {
    refiner: Refiner<'a>,
    models: Vec<SceneModel>,
    finer: Vec<Scene>,
    truth: Option<Scene>,
}

/// Make the models of a case of one's own; the inner error says why there is nothing to measure.
///
/// # Errors
/// A model that is reduced again and does not give the scene's.
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

/// Kind of work of other meshes, for a forecast: beside those of competitors.
const MESHES: usize = 1000;
/// Meshes that are run, the scene's among them.
const MESHES_RUN: f64 = 3.0;

impl Prepared<'_> {
    /// Plan all runs.
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

/// Work of a run of a model, as internal steps of the scene's.
fn work(case: &UserScene, scene: &Scene, competitor: Competitor, division: u32) -> f64 {
    let order = |scene: &Scene| scene.roms.iter().map(|rom| rom.total_order() as f64).sum::<f64>();
    units(case, 0, competitor, division) * order(scene) / order(case.scene())
}

/// Measure a case of one's own; the inner error says why nothing was measured.
///
/// # Errors
/// A mesh that cannot be reduced.
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

/// The scene's model and coarser ones: patches and modes halved, and halved again, each with each; fewer rows with all patches along the chord.
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
            // A coarser tip leaves its coordinates behind as modes.
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

/// The truth with the longest of its steps that are accepted, and their number per communication step.
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

/// Who takes part: the schemes with the solver of the scene's law, and the paper's method.
fn competitors(case: &UserScene) -> Vec<Competitor> {
    let Competitor::Core(_, solver) = case.method() else { return Vec::new() };
    let solvers = if solver == Solver::Coulomb { &[Solver::Coulomb][..] } else { &[Solver::Lcp, Solver::Film] };
    let all = Scheme::RECURRENCES.into_iter().flat_map(|scheme| solvers.iter().map(move |solver| (scheme, *solver)));
    all.map(|(scheme, solver)| Competitor::Core(scheme, solver)).chain([TOLERANT]).collect()
}

/// Internal step (s), or tolerance.
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

/// Displacements of a run, and the processor time of its steps (s): the median of several where it is short.
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

/// Error of the scene by its mesh, from others.
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

    /// One row is held against more, two are taken apart into one, and where none can be added the error is not called total.
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
        assert_eq!(own.name(), "own-model error of the steps");
        assert!(own.models.iter().any(|model| model.tip("patches") == "3 patches"));
    }
}
