//! Run time and error of rubs by tolerance and communication step, with baselines measured in the same run.

mod dense;
mod features;
mod libraries;
mod numpy;
mod tolerances;

use std::path::Path;

use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_figure::table::Table;
use tiprub_gallery::scene_source;
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{
    Statement, Study,
    arguments::StudyCommon,
    error::{clock, scene::SceneRun, summary::rate},
    machine,
};

use crate::{
    beside::{self, apart, blades_of},
    cli::BenchArguments,
    stability::models,
};
use dense::DensePaper;
use libraries::NamedLibrary;
use tiprub_reference::reduced::rub::BladeScene;

/// Depths of the bumps: as built in, and a heavy rub.
const DEPTHS: [(&str, f64); 2] = [("light", 0.6), ("heavy", 1.2)];
const TOLERANCES: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];
/// Communication steps (s), shortest first.
const INTERVALS: [f64; 3] = [1e-5, 1e-4, 1e-3];
/// Communication step of the baselines (s).
const BASE_INTERVAL: f64 = 1e-4;
/// Tolerance of the reference run for errors of adaptive steps.
const FINEST: f64 = 1e-6;
/// Interval of the compared displacements (s).
const SAMPLE: f64 = 1e-3;
/// Duration of a run (ms): full study, quick study.
const DURATION: [u32; 2] = [10, 2];
/// Duration of the runs with dense matrices in reduced coordinates (ms), which take minutes per simulated second.
const SHORT: [u32; 2] = [2, 1];
/// The paper's method, and other methods with fixed steps.
const PAPER: (Scheme, Solver) = (Scheme::PAPER, Solver::Film);
const FIXED: [(Scheme, Solver); 2] = [(Scheme::ModalExact, Solver::Lcp), (Scheme::MasslessBoundary, Solver::Lcp)];
/// Longest fixed step that is tried (s), and maximum number of times that it is halved.
const LONGEST: f64 = 1e-6;
const MAX_HALVINGS: i32 = 6;
/// Step of the independent solver (s).
const INDEPENDENT_STEP: f64 = 5e-7;
/// Number of repetitions; the fastest one counts.
const REPETITIONS: usize = 3;

/// Displacements of all contact nodes at the end of every millisecond, one after the other (m), and the processor time
/// of the steps (s).
struct TimedRub {
    displacements: Vec<f64>,
    seconds: f64,
}

/// One row of the table.
struct BenchRow {
    rub: &'static str,
    method: String,
    setting: String,
    interval: f64,
    /// Processor time per simulated second (s/s), and relative error of the displacements.
    found: std::result::Result<[f64; 2], String>,
    /// Duration of a revolution (s).
    revolution: f64,
}

/// Row of a method with fixed steps, the step (s), and the displacements with a quarter of the step.
type FixedRun = (BenchRow, Option<(f64, Vec<f64>)>);

/// Returns the number of communication steps in a millisecond.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most a hundred")]
fn calls(interval: f64) -> u32 {
    (SAMPLE / interval).round() as u32
}

/// Returns the displacements of all contact nodes at the current time (m).
fn displacements_of<'a>(simulation: &'a Simulation, scene: &'a Scene) -> impl Iterator<Item = f64> + 'a {
    let bank = simulation.system().bank();
    bank.displacement().chunks_exact(bank.lanes()).flat_map(|row| &row[..scene.roms[0].sectors]).copied()
}

/// Runs `milliseconds` of the scene with communication steps of `interval` (s). If `whole` is false, only the states that
/// outputs need are evaluated, as in an FMU, and no displacements are returned.
fn timed(scene: &Scene, interval: f64, milliseconds: u32, whole: bool) -> tiprub_core::Result<TimedRub> {
    let mut scene = scene.clone();
    scene.settings.experiment.communication_step = interval;
    let mut simulation = Simulation::new(&scene)?;
    if !whole {
        simulation.skip_unneeded_states();
    }
    simulation.initialise(0.0)?;
    let steps = calls(interval);
    let mut found = TimedRub { displacements: Vec::new(), seconds: 0.0 };
    for step in 0..milliseconds * steps {
        let before = clock::now();
        simulation.do_step(f64::from(step) * interval, interval)?;
        found.seconds += (clock::now() - before).as_secs_f64();
        if whole && (step + 1).is_multiple_of(steps) {
            found.displacements.extend(displacements_of(&simulation, &scene));
        }
    }
    Ok(found)
}

/// Returns the displacements of a run, and the shortest time of several runs.
fn fastest(scene: &Scene, interval: f64, size: BenchSize) -> tiprub_core::Result<TimedRub> {
    let mut best = timed(scene, interval, size.milliseconds, true)?;
    best.seconds = f64::INFINITY;
    for _ in 0..size.repetitions {
        best.seconds = best.seconds.min(timed(scene, interval, size.milliseconds, false)?.seconds);
    }
    Ok(best)
}

#[derive(Debug, Clone, Copy)]
struct BenchSize {
    milliseconds: u32,
    /// Duration of the runs with dense matrices in reduced coordinates.
    short: u32,
    repetitions: usize,
}

impl BenchSize {
    fn new(quick: bool) -> Self {
        let [milliseconds, short] = [DURATION, SHORT].map(|durations| durations[usize::from(quick)]);
        Self { milliseconds, short, repetitions: if quick { 1 } else { REPETITIONS } }
    }

    fn rate(self, seconds: f64) -> f64 {
        seconds / (SAMPLE * f64::from(self.milliseconds))
    }
}

/// A rub with its name.
struct Rub {
    name: &'static str,
    scene: Scene,
    size: BenchSize,
}

impl Rub {
    fn row(
        &self,
        method: &str,
        setting: String,
        interval: f64,
        found: std::result::Result<[f64; 2], String>,
    ) -> BenchRow {
        let revolution = std::f64::consts::TAU / self.scene.settings.structures[0].speed.abs();
        BenchRow { rub: self.name, method: method.to_owned(), setting, interval, found, revolution }
    }

    fn with_tolerance(&self, tolerance: f64) -> Scene {
        let mut scene = SceneRun::changed(&self.scene, (Scheme::ADAPTIVE, Solver::Lcp), 8e-5, 0.0);
        scene.settings.time.tolerance = Some(tolerance);
        scene
    }

    /// Returns the rows of adaptive steps.
    fn adaptive(&self) -> tiprub_core::Result<Vec<BenchRow>> {
        let finest = timed(&self.with_tolerance(FINEST), BASE_INTERVAL, self.size.milliseconds, true)?;
        let mut rows = Vec::new();
        for tolerance in TOLERANCES {
            let scene = self.with_tolerance(tolerance);
            for interval in INTERVALS {
                let run = fastest(&scene, interval, self.size)?;
                let found = [self.size.rate(run.seconds), apart(&run.displacements, &finest.displacements)];
                rows.push(self.row("adaptive steps", format!("tolerance {tolerance:.0e}"), interval, Ok(found)));
            }
        }
        Ok(rows)
    }

    /// Returns the row of a method with the longest fixed step that the scene accepts.
    fn fixed(&self, method: (Scheme, Solver)) -> FixedRun {
        let with = |step: f64| SceneRun::changed(&self.scene, method, step, 0.0);
        let name = format!("{} + {}", method.0.name(), method.1.name());
        let mut why = String::new();
        for halvings in 0..=MAX_HALVINGS {
            let step = LONGEST * 0.5_f64.powi(halvings);
            let setting = format!("h = {:.4} µs", 1e6 * step);
            let runs = fastest(&with(step), BASE_INTERVAL, self.size)
                .and_then(|run| Ok([run, timed(&with(0.25 * step), BASE_INTERVAL, self.size.milliseconds, true)?]));
            match runs {
                Ok([run, finer]) => {
                    let error = apart(&run.displacements, &finer.displacements);
                    let found = Ok([self.size.rate(run.seconds), error]);
                    return (self.row(&name, setting, BASE_INTERVAL, found), Some((step, finer.displacements)));
                }
                Err(problem) => why = problem.to_string(),
            }
        }
        (self.row(&name, "no step was accepted".into(), BASE_INTERVAL, Err(why)), None)
    }

    /// Returns the rows of the paper's method: in modal coordinates, and with dense matrices in Rust and in NumPy. The last
    /// two have the same step and the same reference as the first.
    fn paper(&self, python: &Path) -> Vec<BenchRow> {
        let (row, run) = self.fixed(PAPER);
        let Some((step, finer)) = run else { return vec![row] };
        let blades = blades_of(&self.scene).map_err(|failure| failure.to_string());
        let setting = format!("{}, first {} ms", row.setting, self.size.short);
        let dense = |name: &str, run: &dyn Fn(&BladeScene) -> std::result::Result<TimedRub, String>| {
            let found = blades.as_ref().map_err(Clone::clone).and_then(run).map(|run| {
                let rate = run.seconds / (SAMPLE * f64::from(self.size.short));
                [rate, apart(&run.displacements, &finer[..run.displacements.len()])]
            });
            self.row(name, setting.clone(), SAMPLE, found)
        };
        let in_rust =
            dense("paper's method, dense matrices, Rust", &|blades| timed_dense(blades, step, self.size.short));
        let in_numpy =
            dense("paper's method, dense matrices, NumPy", &|blades| numpy::run(python, blades, step, self.size.short));
        vec![row, in_rust, in_numpy]
    }

    /// Returns the row of the independent solver with dense matrices.
    fn independent(&self) -> BenchRow {
        let run = |step: f64| -> std::result::Result<TimedRub, String> {
            let blades = blades_of(&self.scene).map_err(|failure| failure.to_string())?;
            let before = clock::now();
            let found = beside::witness(&blades, SAMPLE, step, self.size.milliseconds)?;
            Ok(TimedRub { displacements: found.displacements, seconds: (clock::now() - before).as_secs_f64() })
        };
        let found = run(INDEPENDENT_STEP).and_then(|own| {
            let finer = run(0.5 * INDEPENDENT_STEP)?;
            Ok([self.size.rate(own.seconds), apart(&own.displacements, &finer.displacements)])
        });
        let setting = format!("h = {:.1} µs", 1e6 * INDEPENDENT_STEP);
        self.row("Moreau-Jean, independent and dense", setting, SAMPLE, found)
    }

    fn rows(&self, libraries: &[NamedLibrary], python: &Path) -> Result<Vec<BenchRow>> {
        let failed = |error| Failure::from_core(format!("lab bench, {} rub", self.name), error);
        let mut rows = self.adaptive().map_err(failed)?;
        rows.extend(self.by_library(libraries).map_err(failed)?);
        rows.extend(self.paper(python));
        rows.extend(FIXED.map(|method| self.fixed(method).0));
        rows.push(self.independent());
        Ok(rows)
    }
}

/// Runs the paper's method with dense matrices.
fn timed_dense(blades: &BladeScene, step: f64, milliseconds: u32) -> std::result::Result<TimedRub, String> {
    let mut method = DensePaper::new(blades, step).ok_or("singular matrix M/h² + D/2h")?;
    let mut found = TimedRub { displacements: Vec::new(), seconds: 0.0 };
    for _ in 0..milliseconds {
        let before = clock::now();
        // The step is a millisecond divided by a whole number.
        for _ in 0..calls(step) {
            method.step()?;
        }
        found.seconds += (clock::now() - before).as_secs_f64();
        found.displacements.extend(method.contact_rows().transpose().iter());
    }
    Ok(found)
}

fn rubs(common: &StudyCommon, console: &Console) -> Result<Vec<Rub>> {
    let size = BenchSize::new(common.quick);
    if common.quick {
        return Ok(vec![Rub { name: "small", scene: models::bumps(models::blade(12)), size }]);
    }
    let scene = scene_source::load("builtin:rotor37", &common.cache.cache(), console)?;
    let with = |(name, bumps): (&'static str, f64)| {
        let mut scene = scene.clone();
        tolerances::deepen(&mut scene, bumps);
        Rub { name, scene, size }
    };
    Ok(DEPTHS.map(with).into())
}

impl BenchRow {
    fn cells(&self) -> Vec<String> {
        let [revolution, second, error] = match &self.found {
            Ok([rate_of, error]) => [rate(1e3 * rate_of * self.revolution), rate(*rate_of), format!("{error:.1e}")],
            Err(why) if why.starts_with("skipped") => ["skipped"; 3].map(String::from),
            Err(_) => ["rejected"; 3].map(String::from),
        };
        let interval = format!("{:.0}", 1e6 * self.interval);
        vec![self.rub.into(), self.method.clone(), self.setting.clone(), interval, revolution, second, error]
    }

    fn json(&self) -> Value {
        let [seconds, error] = self.found.as_ref().map_or([None; 2], |found| found.map(Some));
        json!({
            "rub": self.rub, "method": self.method, "setting": self.setting, "communication_step": self.interval,
            "seconds_per_second": seconds, "error": error, "rejected": self.found.as_ref().err(),
        })
    }
}

/// Runs the benchmark.
///
/// # Errors
/// If a run with adaptive steps fails, or a library cannot be read.
pub(crate) fn study(arguments: &BenchArguments, console: &Console) -> Result<Study> {
    let common = &arguments.common;
    let libraries = libraries::load(&arguments.library, common.quick, console)?;
    let rubs = rubs(common, console)?;
    let task = console.task("Timing rubs", Some((rubs.len() * (1 + features::COUNT) + 1) as u64));
    let mut rows = Vec::new();
    for (done, rub) in (1..).zip(&rubs) {
        task.line(&format!("{} rub", rub.name));
        rows.extend(rub.rows(&libraries, &arguments.python)?);
        task.at(done);
    }
    task.line("features");
    let (by_feature, of_features) = features::compare(&rubs, &|done| task.at((rubs.len() + done) as u64))?;
    task.line("tolerances");
    let (by_tolerance, of_tolerances, printed) = tolerances::compare(&rubs[0], common.quick)?;
    drop(task);
    console.warn_texts(&missing(&rows));
    let columns = ["rub", "method", "setting", "H (µs)", "ms per revolution", "time (s/s)", "error"];
    let mut table = Table::new("Processor time and error of rubs", columns);
    table.rows = rows.iter().map(BenchRow::cells).collect();
    Ok(Study {
        name: "bench",
        title: "Speed of rubs".into(),
        summary: "Processor times of the steps, the fastest of several runs. Errors are relative L2 errors of the displacements at \
                  every millisecond: of adaptive steps and of FMU libraries against a tolerance of 1e-6, of fixed steps against the \
                  same method with a quarter of the step, of the independent solver against half of its step. The times of dense \
                  matrices are extrapolated from the first milliseconds."
            .into(),
        facts: machine::facts(),
        statements: vec![within_tolerance(&rows), printed],
        figures: Vec::new(),
        results: rows.iter().map(BenchRow::json).chain(of_features).chain(of_tolerances).collect(),
        files: vec![
            ("bench.md".into(), "table of the results".into(), table.to_markdown().into_bytes()),
            ("features.md".into(), "table of the features".into(), by_feature.to_markdown().into_bytes()),
            ("tolerances.md".into(), "table of nine rubs by tolerance".into(), by_tolerance.to_markdown().into_bytes()),
        ],
    })
}

/// Returns a line with the reason for each method without a result.
fn missing(rows: &[BenchRow]) -> Vec<String> {
    let lines = rows.iter().filter_map(|row| Some(format!("{}: {}", row.method, row.found.as_ref().err()?)));
    lines.collect::<std::collections::BTreeSet<_>>().into_iter().collect()
}

/// Compares the errors of adaptive steps with their tolerances.
fn within_tolerance(rows: &[BenchRow]) -> Statement {
    let ratios = rows.iter().filter(|row| row.method == "adaptive steps").filter_map(|row| {
        let tolerance: f64 = row.setting.strip_prefix("tolerance ")?.parse().ok()?;
        Some(row.found.as_ref().ok()?[1] / tolerance)
    });
    let worst = ratios.fold(0.0, f64::max);
    Statement::tested(
        "Adaptive steps cause a smaller error than the tolerance",
        worst < 1.0,
        format!("at most {worst:.2} of the tolerance"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Modal coordinates of the product, and dense matrices with independent geometry.
    #[test]
    fn papers_method_is_the_same_in_both_coordinates() {
        let step = 1e-6;
        let run = |friction: f64| {
            let mut scene = SceneRun::changed(&models::bumps(models::blade(4)), PAPER, step, 0.0);
            scene.settings.contacts[0].friction = friction;
            let own = timed(&scene, SAMPLE, 3, true).unwrap().displacements;
            (timed_dense(&blades_of(&scene).unwrap(), step, 3).unwrap().displacements, own)
        };
        let ((dense, own), (smooth, _)) = (run(0.15), run(0.0));
        assert!(apart(&dense, &own) < 1e-3, "{:e}", apart(&dense, &own));
        assert!(apart(&smooth, &own) > 1e-2, "friction has an effect: {:e}", apart(&smooth, &own));
    }
}
