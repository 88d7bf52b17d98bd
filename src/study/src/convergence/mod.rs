//! What refining a scene changes: its internal step, the modes of its structures, the contact nodes and the mesh of its blades, one at a
//! time; where each sequence goes, and with it the error of the scene as it stands.
//!
//! [`mod@directions`] finds the directions ([`refine`] says what one is), `refiner` the scenes at every level, `rows` those of rows across
//! the thickness, `nodes` which of a refined model's nodes touch, [`truncate`] takes modes
//! away from any ROM, [`mod@march`] runs and compares, [`limit`] extrapolates, [`page`] draws and tells.

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
use tiprub_core::{Rom, Scene, rom::RubErrors};
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
    /// A run per level, or why it is refused.
    pub runs: Vec<std::result::Result<RunSummary, String>>,
    /// Per level: friction coefficient beyond which the closed tip digs in; `None` where there is none, and without friction.
    pub lock_up: Vec<Option<f64>>,
}

/// Everything that was found of a scene.
#[derive(Debug)]
pub struct ConvergenceResult {
    /// Name of the scene on the command line, and in the scene.
    pub names: [String; 2],
    /// Time compared (s), and its communication steps.
    pub window: (f64, usize),
    /// Scheme and solver.
    pub method: String,
    /// All directions.
    pub refined: Vec<Refined>,
    /// Errors that the ROM of the master carried before; empty if it had none.
    pub of_rom: Vec<Estimate>,
}

/// A ROM with what a study found of it.
#[derive(Debug)]
pub struct EstimatedRom {
    /// The ROM.
    pub rom: Rom,
    /// Whether an error was found that a ROM carries.
    pub known: bool,
}

impl ConvergenceResult {
    /// The ROM of the master with its errors on this scene; as it was where none was found.
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

/// The study of a scene, and the ROM of its master with what was found of it; `source` is where that comes from, if it is a file and known.
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
    /// Start values that replace its own (name, value as text).
    pub settings: &'a [(String, String)],
    /// Time that is compared (s); where none is given, that of a quick study or of a whole one.
    pub window: Option<f64>,
    /// Few and short runs.
    pub quick: bool,
    /// Runs at the same time.
    pub threads: usize,
    /// Where the ROM of the master comes from, if that is a file and known.
    pub source: Option<&'a dyn RomSource>,
    /// Where models that ship are kept.
    pub cache: RomCache,
    /// Mesh of the master where it ships: 1, or what its elements along the edges are multiplied with.
    pub mesh: f64,
    /// Spaces between contact points of the finest tip, times its own.
    pub finest_tip: usize,
    /// Names of the directions; empty for all.
    pub only: &'a [String],
}

/// Everything about the scene called `name`.
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

/// All runs, as steps times sizes of the models, at the rate of the run of the scene as it stands.
fn planned(directions: &[RefinementDirection], scene: &Scene, (own, seconds): (u32, f64), runner: &Runner) -> WorkPlan {
    let mut ledger = WorkPlan::new(seconds / runner.threads as f64);
    for (number, direction) in directions.iter().enumerate() {
        ledger.plan(number, work(direction, scene, own));
    }
    ledger
}

/// Work of a direction, in runs of the scene as it stands.
fn work(direction: &RefinementDirection, scene: &Scene, own: u32) -> f64 {
    let size = |scene: &Scene| scene.roms.iter().map(|rom| rom.total_order() as f64).sum::<f64>();
    let steps = |level: &RefinementLevel| match is_adaptive(scene) {
        // A decade doubles the steps.
        true => (f64::from(level.division) / f64::from(own)).powf(0.3),
        false => f64::from(level.division) / f64::from(own),
    };
    let cost = |level: &RefinementLevel| steps(level) * size(&level.scene) / size(scene);
    direction.levels.iter().filter(|level| !level.own || direction.shorter.is_some()).map(cost).sum()
}

/// Shares of the step at which a direction is run once more where one of its levels is refused.
const SHORTER: [u32; 3] = [2, 4, 8];

/// Runs the levels.
pub(crate) struct Runner<'a> {
    settings: &'a [(String, String)],
    samples: usize,
    threads: usize,
    console: &'a Console,
    /// The scene as it stands, where it has been run.
    own: Option<RunSummary>,
}

impl<'a> Runner<'a> {
    pub(crate) fn new(settings: &'a [(String, String)], samples: usize, console: &'a Console) -> Self {
        Self { settings, samples, threads: sweep::processors(), console, own: None }
    }

    /// Run a direction with the steps that it says.
    pub(crate) fn as_it_is(&self, direction: RefinementDirection) -> Result<Refined> {
        let count = direction.levels.len();
        let task = self.console.task(&format!("Refining {}", direction.title), Some(count as u64));
        let progress = |done: usize| {
            task.at(done as u64);
            task.line(&format!("{done} of {count} runs"));
        };
        Ok(Refined { runs: self.runs(&direction, &progress)?, lock_up: vec![None; count], direction })
    }

    /// Run a direction. A ROM with more modes or nodes may ask for a shorter step than the scene's: then all of its levels take one.
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
    /// Levels that ran, with their runs.
    pub fn ran(&self) -> Vec<(&RefinementLevel, &RunSummary)> {
        let levels = self.direction.levels.iter().zip(&self.runs);
        levels.filter_map(|(level, run)| Some((level, run.as_ref().ok()?))).collect()
    }

    /// Change from every level that ran to the next that did.
    pub fn changes(&self) -> Vec<[Option<f64>; 5]> {
        self.ran().windows(2).map(|pair| pair[0].1.changes(pair[1].1)).collect()
    }

    /// Levels that are read: the finest of those that ran, the last, and those before it that are far enough apart; sizes go with a power
    /// of the error.
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

    /// Where the quantities go, and what the finest level lacks of that; `None` of one that is not to be read.
    pub fn limits(&self) -> [Option<ConvergedLimit>; 4] {
        let read = self.read();
        let [a, b, c] = &read[..] else { return [None; 4] };
        let [x, y, z] = [a.1, b.1, c.1].map(RunSummary::quantities);
        std::array::from_fn(|index| limit::of_values([a.0, b.0, c.0], [x[index], y[index], z[index]]))
    }

    /// Error of a run of this direction: displacements (L2) and every quantity, relative to the limit; `None` where that is not to be
    /// read. Displacements are as far from the limit as from the finest level, and what that one lacks.
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

    /// Error of the scene as it stands.
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
