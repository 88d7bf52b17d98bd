//! Convergence study: refines the internal step, the modes of the structures, the contact nodes and the mesh of the blades, one at a time, and
//! estimates the limit of each sequence and the discretisation errors of the scene.
//!
//! [`mod@directions`] finds the directions ([`refine`] defines them), `refiner` creates the scenes of every level, `rows` varies the rows of patches
//! across the thickness, `nodes` assigns the nodes of a refined model to contact pairs, [`truncate`] removes modes from any ROM, [`mod@march`] runs
//! and compares, [`limit`] extrapolates, [`page`] draws plots and writes the results.

pub mod coarsen;
pub mod directions;
pub mod limit;
pub mod march;
mod nodes;
pub mod page;
pub mod refine;
pub(crate) mod refiner;
pub(crate) mod rows;
pub mod truncate;

use std::time::Instant;

use directions::directions;
use limit::ConvergedLimit;
use march::{RunSummary, march};
use refine::{Again, RefinementDirection, RefinementLevel, RomSource, is_adaptive};
use tiprub_core::scene::rom::RubErrors;
use tiprub_core::{Rom, Scene};
use tiprub_gallery::rom_cache::RomCache;
use tiprub_shell::{
    Failure, Result,
    console::Console,
    forecast::{Forecast, WorkPlan},
    sweep,
};

use super::Study;
use crate::{
    arguments::ConvergenceArguments,
    error::{
        case::ErrorCase,
        user_scene::{UserScene, refuse_compared},
    },
    estimate::{self, Estimate},
    master, one_rotor,
    stability::structure::SingleStructure,
};

/// One direction with the runs of its levels.
#[derive(Debug)]
pub struct Refined {
    /// Direction of refinement.
    pub direction: RefinementDirection,
    /// Result of the run of every level, or the reason of its rejection.
    pub runs: Vec<std::result::Result<RunSummary, String>>,
    /// Lock-up friction of the closed tip for every level; `None` if there is none, and without friction.
    pub lock_up: Vec<Option<f64>>,
}

/// Results of the convergence study of a scene.
#[derive(Debug)]
pub struct ConvergenceResult {
    /// Name of the scene on the command line, and name in the scene file.
    pub names: [String; 2],
    /// Compared time (s) and its number of communication steps.
    pub window: (f64, usize),
    /// Scheme and solver.
    pub method: String,
    /// All directions.
    pub refined: Vec<Refined>,
    /// Errors that the ROM of the master already carried; empty if it had none.
    pub of_rom: Vec<Estimate>,
}

/// ROM with the errors that a study estimated for it.
#[derive(Debug)]
pub struct EstimatedRom {
    /// The ROM.
    pub rom: Rom,
    /// True if the study estimated an error that a ROM can carry.
    pub known: bool,
}

impl ConvergenceResult {
    /// Returns the ROM of the master with its errors on this scene; unchanged if none was found.
    pub fn with_errors(&self, scene: &Scene) -> EstimatedRom {
        let index = master(scene);
        let of = |name: &str| {
            let refined = self.refined.iter().find(|refined| refined.direction.name == name)?;
            refined.own_errors()?[0]
        };
        let mut rom = scene.roms[index].clone();
        let found = RubErrors {
            found_on: format!("{}, {:.2} ms", self.names[1], 1e3 * self.window.0),
            modes: refine::modes_of(index).and_then(of),
            patches: of(refine::NODES),
            rows: of(refine::ROWS),
            mesh: of(refine::MESH),
        };
        if found.is_empty() {
            return EstimatedRom { rom, known: false };
        }
        rom.checks.rub_errors = Some(found);
        EstimatedRom { rom, known: true }
    }
}

/// Runs the study of a scene, and returns the ROM of its master with the estimated errors; `source` is the origin of that ROM, if it is a known
/// file.
///
/// # Errors
/// The scene cannot be read or does not run, or a model cannot be reduced again.
pub fn study(
    arguments: &ConvergenceArguments,
    source: Option<&dyn RomSource>,
    console: &Console,
) -> Result<(Study, EstimatedRom)> {
    refuse_compared(&arguments.set)?;
    let cache = arguments.common.cache.cache();
    let scene = arguments.common.options.load(&arguments.scene, &cache, console)?;
    let asked = ConvergenceRequest {
        cache,
        mesh: 1.0,
        finest_tip: refine::FINEST_TIP,
        only: &[],
        settings: &arguments.set,
        window: arguments.window,
        quick: arguments.common.quick,
        threads: arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get),
        source,
    };
    let found = found(&arguments.scene, &scene, &asked, console)?;
    Ok((page::study(&found)?, found.with_errors(&scene)))
}

/// Request of a convergence study.
pub struct ConvergenceRequest<'a> {
    /// Start values that replace those of the scene (name, value as text).
    pub settings: &'a [(String, String)],
    /// Compared time (s); by default that of a quick or a full study.
    pub window: Option<f64>,
    /// True for few and short runs.
    pub quick: bool,
    /// Number of parallel runs.
    pub threads: usize,
    /// Origin of the ROM of the master, if it is a known file.
    pub source: Option<&'a dyn RomSource>,
    /// Cache of the built-in models.
    pub cache: RomCache,
    /// Mesh of the master if it is a built-in model: 1, or the factor for the number of elements along the edges.
    pub mesh: f64,
    /// Number of intervals between contact points of the finest tip, relative to the scene.
    pub finest_tip: usize,
    /// Names of the directions; empty for all.
    pub only: &'a [String],
}

/// Runs the whole study of the scene called `name`.
///
/// # Errors
/// The scene does not run, or a model cannot be reduced again.
pub fn found(name: &str, scene: &Scene, asked: &ConvergenceRequest, console: &Console) -> Result<ConvergenceResult> {
    one_rotor(&scene.settings)?;
    let case = UserScene::of(name, scene.clone(), asked.settings, (asked.window, asked.quick), console)?;
    let interval = case.interval();
    let own = case.own_division();
    let mut runner =
        Runner { settings: asked.settings, samples: case.samples(), threads: asked.threads, console, own: None };
    let clock = Instant::now();
    let standing = march(scene, asked.settings, own, case.samples())
        .map_err(|why| Failure::new(name, format!("the unrefined scene does not run: {why}"), ""))?;
    let seconds = clock.elapsed().as_secs_f64();
    runner.own = Some(standing);
    let directions = directions(
        scene,
        own,
        &Again {
            source: asked.source,
            cache: &asked.cache,
            mesh: asked.mesh,
            finest_tip: asked.finest_tip,
            only: asked.only,
            quick: asked.quick,
            console,
        },
    )?;
    let ledger = planned(&directions, scene, (own, seconds), &runner);
    let forecast = Forecast::new(console, &format!("Refining {}", scene.settings.name), ledger);
    let mut refined = Vec::new();
    for (number, direction) in directions.into_iter().enumerate() {
        refined.push(runner.refined(direction, (number, scene, own), &forecast)?);
    }
    forecast.finish();
    Ok(ConvergenceResult {
        names: [name.to_owned(), scene.settings.name.clone()],
        window: (interval * case.samples() as f64, case.samples()),
        method: crate::error::competitor::method_name((scene.settings.time.scheme, scene.settings.contacts[0].solver)),
        refined,
        of_rom: estimate::of_rom(&scene.roms[master(scene)]),
    })
}

/// Plans all runs; the work is the number of steps times the size of the model, the rate is that of the run of the unchanged scene.
fn planned(directions: &[RefinementDirection], scene: &Scene, (own, seconds): (u32, f64), runner: &Runner) -> WorkPlan {
    let mut ledger = WorkPlan::new(seconds / runner.threads as f64);
    for (number, direction) in directions.iter().enumerate() {
        ledger.plan(number, work(direction, scene, own));
    }
    ledger
}

/// Returns the work of a direction, in runs of the unchanged scene.
fn work(direction: &RefinementDirection, scene: &Scene, own: u32) -> f64 {
    let size = |scene: &Scene| scene.roms.iter().map(|rom| rom.total_order() as f64).sum::<f64>();
    let steps = |level: &RefinementLevel| match is_adaptive(scene) {
        // A tolerance that is ten times smaller doubles the number of steps.
        true => (f64::from(level.division) / f64::from(own)).powf(0.3),
        false => f64::from(level.division) / f64::from(own),
    };
    let cost = |level: &RefinementLevel| steps(level) * size(&level.scene) / size(scene);
    direction.levels.iter().filter(|level| !level.own || direction.shorter.is_some()).map(cost).sum()
}

/// Factors by which the step is shortened to repeat a direction after one of its levels was rejected.
const SHORTER: [u32; 3] = [2, 4, 8];

/// Runs the levels.
pub(crate) struct Runner<'a> {
    settings: &'a [(String, String)],
    samples: usize,
    threads: usize,
    console: &'a Console,
    /// Result of the unchanged scene, if it has been run.
    own: Option<RunSummary>,
}

impl<'a> Runner<'a> {
    pub(crate) fn new(settings: &'a [(String, String)], samples: usize, console: &'a Console) -> Self {
        Self { settings, samples, threads: sweep::processors(), console, own: None }
    }

    /// Runs a direction with its given steps.
    pub(crate) fn as_it_is(&self, direction: RefinementDirection) -> Result<Refined> {
        let count = direction.levels.len();
        let task = self.console.task(&format!("Refining {}", direction.title), Some(count as u64));
        let progress = |done: usize| {
            task.at(done as u64);
            task.line(&format!("{done} of {count} runs"));
        };
        Ok(Refined { runs: self.runs(&direction, &progress)?, lock_up: vec![None; count], direction })
    }

    /// Runs a direction. If a ROM with more modes or nodes requires a shorter step than the scene's, all of its levels use a shorter step.
    fn refined(
        &self,
        mut direction: RefinementDirection,
        (number, scene, own): (usize, &Scene, u32),
        forecast: &Forecast,
    ) -> Result<Refined> {
        let counted = |direction: &RefinementDirection| {
            let each = work(direction, scene, own) / direction.levels.len() as f64;
            self.runs(direction, &|_| forecast.done(number, each))
        };
        let runs = counted(&direction)?;
        let refused = runs.iter().any(std::result::Result::is_err) && direction.name != refine::STEP;
        for shorter in SHORTER.into_iter().filter(|_| refused) {
            let finer = direction.stepped(shorter);
            forecast.plan(number, work(&finer, scene, own));
            let runs = counted(&finer)?;
            if runs.iter().all(std::result::Result::is_ok) {
                direction = finer;
                return Ok(Refined { lock_up: self.lock_up(&direction)?, direction, runs });
            }
        }
        Ok(Refined { lock_up: self.lock_up(&direction)?, direction, runs })
    }

    /// Returns the lock-up friction of the master's tip, level by level; it depends on the model, not on the steps.
    fn lock_up(&self, direction: &RefinementDirection) -> Result<Vec<Option<f64>>> {
        let of = |level: &RefinementLevel| {
            let (index, scene) = (master(&level.scene), &level.scene);
            let (rom, settings) = (&scene.roms[index], &scene.settings.structures[index]);
            let rubs = scene.settings.contacts.iter().any(|contact| contact.friction > 0.0);
            let found = SingleStructure::new(rom, rom.damping_ratio, 0.0).ok().filter(|_| rubs);
            Ok(found.and_then(|structure| Some(structure.lock_up(settings.speed)?.friction)))
        };
        match direction.name == refine::STEP {
            true => Ok(vec![None; direction.levels.len()]),
            false => sweep::sweep(&direction.levels, self.threads, of, |_| ()),
        }
    }

    fn runs(
        &self,
        direction: &RefinementDirection,
        progress: &dyn Fn(usize),
    ) -> Result<Vec<std::result::Result<RunSummary, String>>> {
        let run = |level: &RefinementLevel| {
            Ok(match &self.own {
                Some(own) if level.own && direction.shorter.is_none() => Ok(own.clone()),
                _ => march(&level.scene, self.settings, level.division, self.samples),
            })
        };
        sweep::sweep(&direction.levels, self.threads, run, progress)
    }
}

impl Refined {
    /// Returns the levels that ran, with their results.
    pub fn ran(&self) -> Vec<(&RefinementLevel, &RunSummary)> {
        let levels = self.direction.levels.iter().zip(&self.runs);
        levels.filter_map(|(level, run)| Some((level, run.as_ref().ok()?))).collect()
    }

    /// Returns the changes between consecutive levels that ran.
    pub fn changes(&self) -> Vec<[Option<f64>; 5]> {
        self.ran().windows(2).map(|pair| pair[0].1.changes(pair[1].1)).collect()
    }

    /// Returns the levels for the extrapolation: the finest level that ran, last, and coarser ones that are far enough apart. The error follows a
    /// power of their sizes.
    fn read(&self) -> Vec<(f64, &RunSummary)> {
        let ran = self.ran();
        let sizes: Vec<f64> = ran.iter().map(|(level, _)| self.direction.size(level.value)).collect();
        limit::chosen(&sizes).into_iter().map(|index| (sizes[index], ran[index].1)).collect()
    }

    /// Returns the remaining change of the displacements of the finest level by further refinement (relative L2). With two meshes the order is
    /// assumed.
    pub fn rest(&self) -> Option<ConvergedLimit> {
        match &self.read()[..] {
            [a, b, c] => {
                let changes = [a.1.displacement_change(b.1)?, b.1.displacement_change(c.1)?];
                let least = if self.direction.name == refine::MESH { limit::LEAST_OF_MESHES } else { limit::LEAST };
                limit::of_changes([a.0, b.0, c.0], changes, least)
            }
            [a, b] if self.direction.name == refine::MESH => {
                Some(limit::of_two_meshes([a.0, b.0], a.1.displacement_change(b.1)?))
            }
            _ => None,
        }
    }

    /// Returns the limits of the quantities with the remaining errors of the finest level; `None` for a quantity without observed convergence.
    pub fn limits(&self) -> [Option<ConvergedLimit>; 4] {
        let read = self.read();
        let [a, b, c] = &read[..] else { return [None; 4] };
        let [x, y, z] = [a.1, b.1, c.1].map(RunSummary::quantities);
        std::array::from_fn(|index| limit::of_values([a.0, b.0, c.0], [x[index], y[index], z[index]]))
    }

    /// Returns the errors of a run of this direction: displacements (L2) and every quantity, relative to the limit; `None` if the limit is unknown.
    /// The error of the displacements is the distance from the finest level plus the remaining error of that level.
    pub fn errors(&self, run: &RunSummary) -> [Option<f64>; 5] {
        let Some((_, finest)) = self.ran().last().copied() else { return [None; 5] };
        let mut found = [None; 5];
        found[0] = self.rest().and_then(|rest| Some(run.displacement_change(finest)? + rest.rest));
        for (index, limit) in self.limits().into_iter().enumerate() {
            let limit = limit.map(|limit| finest.quantities()[index] + limit.rest).filter(|limit| *limit != 0.0);
            found[index + 1] = limit.map(|limit| (run.quantities()[index] / limit - 1.0).abs());
        }
        found
    }

    /// Returns the errors of the unchanged scene.
    pub fn own_errors(&self) -> Option<[Option<f64>; 5]> {
        let own = self.ran().into_iter().find(|(level, _)| level.own)?.1;
        Some(self.errors(own))
    }

    /// Returns the changes of the scene by the next refinement, and whether the step is from the scene; if it is the finest, the step to it.
    pub fn at_own(&self) -> Option<([Option<f64>; 5], bool)> {
        let (ran, changes) = (self.ran(), self.changes());
        let own = ran.iter().position(|(level, _)| level.own)?;
        match changes.get(own) {
            Some(changes) => Some((*changes, true)),
            None => Some((*changes.get(own.checked_sub(1)?)?, false)),
        }
    }
}
