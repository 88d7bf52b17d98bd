//! What refining a scene changes: its internal step, the modes of its structures, the contact nodes of its blades, one at a time.
//!
//! [`refine`] finds the directions and the scenes at every level, `nodes` which of a refined model's nodes touch, [`truncate`] takes modes away from any ROM, [`mod@march`] runs and
//! compares, [`page`] draws and tells.

pub mod coarsen;
pub mod march;
mod nodes;
pub mod page;
pub mod refine;
pub mod truncate;

use march::{Marched, march};
use refine::{Direction, Level, Source};
use tiprub_gallery::scene_source;
use tiprub_shell::{Failure, Result, console::Console, sweep};

use super::Study;
use crate::{
    arguments::ConvergenceArguments,
    error::{
        case::Case,
        own::{Own, refuse_compared},
    },
    one_rotor,
};

/// One direction with the runs of its levels.
#[derive(Debug)]
pub struct Refined {
    /// What is refined.
    pub direction: Direction,
    /// A run per level, or why it is refused.
    pub runs: Vec<std::result::Result<Marched, String>>,
}

/// Everything that was found of a scene.
#[derive(Debug)]
pub struct Found {
    /// Name of the scene on the command line, and in the scene.
    pub names: [String; 2],
    /// Time compared (s), and its communication steps.
    pub window: (f64, usize),
    /// Scheme and solver.
    pub method: String,
    /// All directions.
    pub refined: Vec<Refined>,
}

/// The study of a scene; `source` is where the ROM of its master comes from, if that is a file and known.
///
/// # Errors
/// The scene cannot be read or does not run, or a model cannot be reduced again.
pub fn study(arguments: &ConvergenceArguments, source: Option<&dyn Source>, console: &Console) -> Result<Study> {
    refuse_compared(&arguments.set)?;
    let quick = arguments.common.quick;
    let scene = scene_source::load(&arguments.scene, &arguments.common.cache.cache(), console)?;
    one_rotor(&scene.settings)?;
    let case = Own::of(&arguments.scene, scene.clone(), &arguments.set, (arguments.window, quick), console)?;
    let interval = case.interval();
    let own = divisions(interval, scene.settings.time.step);
    let directions = refine::directions(&scene, own, source, quick, console)?;
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let runner = Runner { settings: &arguments.set, samples: case.samples(), threads, console };
    let mut refined = Vec::new();
    for direction in directions {
        refined.push(runner.refined(direction)?);
    }
    let method = crate::error_study::name((scene.settings.time.scheme, scene.settings.contacts[0].solver));
    if let Some(why) = refined.iter().find_map(own_refused) {
        return Err(Failure::new(&arguments.scene, format!("the scene as it stands does not run: {why}"), ""));
    }
    page::study(&Found {
        names: [arguments.scene.clone(), scene.settings.name.clone()],
        window: (interval * case.samples() as f64, case.samples()),
        method,
        refined,
    })
}

/// Shares of the step at which a direction is run once more where one of its levels is refused.
const SHORTER: [u32; 3] = [2, 4, 8];

/// How levels are run.
pub(crate) struct Runner<'a> {
    settings: &'a [(String, String)],
    samples: usize,
    threads: usize,
    console: &'a Console,
}

impl<'a> Runner<'a> {
    pub(crate) fn new(settings: &'a [(String, String)], samples: usize, console: &'a Console) -> Self {
        Self { settings, samples, threads: sweep::processors(), console }
    }

    /// Run a direction with the steps that it says.
    pub(crate) fn as_it_is(&self, direction: Direction) -> Result<Refined> {
        Ok(Refined { runs: self.runs(&direction)?, direction })
    }

    /// Run a direction. A ROM with more modes or nodes may ask for a shorter step than the scene's: then all of its levels take one.
    fn refined(&self, mut direction: Direction) -> Result<Refined> {
        let runs = self.runs(&direction)?;
        let refused = runs.iter().any(std::result::Result::is_err) && direction.name != refine::STEP;
        for shorter in SHORTER.into_iter().filter(|_| refused) {
            let finer = direction.stepped(shorter);
            let runs = self.runs(&finer)?;
            if runs.iter().all(std::result::Result::is_ok) {
                direction = finer;
                direction.shorter = Some(shorter);
                return Ok(Refined { direction, runs });
            }
        }
        Ok(Refined { direction, runs })
    }

    fn runs(&self, direction: &Direction) -> Result<Vec<std::result::Result<Marched, String>>> {
        let count = direction.levels.len();
        let task = self.console.task(&format!("Refining {}", direction.title), Some(count as u64));
        let run = |level: &Level| Ok(march(&level.scene, self.settings, level.division, self.samples));
        let progress = |done: usize| {
            task.at(done as u64);
            task.line(&format!("{done} of {count} runs"));
        };
        sweep::sweep(&direction.levels, self.threads, run, progress)
    }
}

/// Internal steps per communication step.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
pub(crate) fn divisions(interval: f64, step: f64) -> u32 {
    (interval / step * (1.0 - 1e-9)).ceil().clamp(1.0, 1e8) as u32
}

fn own_refused(refined: &Refined) -> Option<String> {
    let levels = refined.direction.levels.iter().zip(&refined.runs);
    let own = levels.filter(|(level, _)| level.own);
    own.filter_map(|(_, run)| run.as_ref().err().cloned()).next()
}

impl Refined {
    /// Levels that ran, with their runs.
    pub fn ran(&self) -> Vec<(&Level, &Marched)> {
        let levels = self.direction.levels.iter().zip(&self.runs);
        levels.filter_map(|(level, run)| Some((level, run.as_ref().ok()?))).collect()
    }

    /// Change from every level that ran to the next that did.
    pub fn changes(&self) -> Vec<[Option<f64>; 5]> {
        self.ran().windows(2).map(|pair| pair[0].1.changes(pair[1].1)).collect()
    }

    /// What the next refinement changes of the scene as it stands, and whether that is the step from it; where it is the finest, the
    /// step to it.
    pub fn at_own(&self) -> Option<([Option<f64>; 5], bool)> {
        let (ran, changes) = (self.ran(), self.changes());
        let own = ran.iter().position(|(level, _)| level.own)?;
        match changes.get(own) {
            Some(changes) => Some((*changes, true)),
            None => Some((*changes.get(own.checked_sub(1)?)?, false)),
        }
    }
}
