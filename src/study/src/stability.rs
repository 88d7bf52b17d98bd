//! Stability study of a scene: accepted, warned or rejected over friction, speed and internal step, growth of sliding contact, and the largest
//! accepted step of every scheme and solver.
//!
//! The answers are those of the core, obtained in the same way as by a run ([`scene`]). [`structure`] has growth rates and limits of one structure
//! by itself, [`grid`] the values to try, [`limits`] the largest steps, [`page`] pictures and tables.

pub mod grid;
pub mod limits;
pub mod page;
pub mod scene;
pub mod seek;
pub mod structure;

use serde::{Serialize, de::DeserializeOwned};
use std::{cell::Cell, fmt::Debug};

use grid::StabilityGrid;
use scene::{OperatingPoint, SceneStart, ScreeningResult, StabilityScene};
use structure::{KnownContact, Rates, SingleStructure};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_core::scene::settings::{BodyMotion, Meridian};
use tiprub_core::{Scene, Simulation};
use tiprub_shell::{
    Failure, Result,
    console::Console,
    forecast::{Forecast, WorkPlan},
    sweep,
};
use tiprub_sweep::{
    part::Part,
    tasks::{TaskJournals, TaskResults, scene_digest},
};

use super::{StudyOutcome, master};
use crate::{arguments::StabilityArguments, error::user_scene::refuse_compared, one_rotor_and_friction};

/// Friction that makes the coefficient a parameter of a scene; every answer replaces it.
const SOME_FRICTION: f64 = 0.1;

/// Answer at one operating point and step.
#[derive(Debug, Clone, PartialEq)]
pub struct StabilityPoint {
    /// Friction and speed.
    pub place: OperatingPoint,
    /// Internal step (s).
    pub step: f64,
    /// Answer of the core.
    pub answer: ScreeningResult,
    /// Growth of sliding contact, if it can be computed.
    pub rates: Option<Rates>,
}

/// Kinds of answers, best first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AnswerKind {
    /// Accepted without warnings.
    Right,
    /// Accepted with warnings.
    Warned,
    /// Accepted with warnings, and sliding contact flutters.
    Flutter,
    /// Rejected.
    Refused,
}

impl StabilityPoint {
    /// Returns the kind of the answer.
    pub fn verdict(&self) -> AnswerKind {
        let flutters = self.rates.as_ref().is_some_and(structure::Rates::is_flutter);
        match &self.answer {
            Err(_) => AnswerKind::Refused,
            Ok(_) if flutters => AnswerKind::Flutter,
            Ok(warnings) if warnings.is_empty() => AnswerKind::Right,
            Ok(_) => AnswerKind::Warned,
        }
    }

    /// Returns the reason of the rejection or the warnings; empty if there are none.
    pub fn reason(&self) -> String {
        match &self.answer {
            Ok(warnings) => warnings.join("; "),
            Err(refusal) => refusal.clone(),
        }
    }
}

/// Results of the stability study of a scene.
#[derive(Debug)]
pub struct StabilityResult {
    /// The scene.
    pub scene: Scene,
    /// Name on the command line.
    pub name: String,
    /// Start values of the scene.
    pub own: SceneStart,
    /// Requested values.
    pub grid: StabilityGrid,
    /// All answers: step by step, then speed by speed, then friction by friction.
    pub points: Vec<StabilityPoint>,
    /// Largest accepted steps.
    pub limits: Vec<limits::Usable>,
    /// Reason why growth rates cannot be determined, if they cannot.
    pub no_rates: Option<&'static str>,
}

/// Runs the study of a scene.
///
/// # Errors
/// The scene cannot be read, the scene is rejected for all values, start values are wrong, or a journal in the output directory cannot be used.
pub fn study(arguments: &StabilityArguments, console: &Console) -> Result<StudyOutcome> {
    refuse_compared(&arguments.set)?;
    let scene = arguments.common.options.load(&arguments.scene, &arguments.common.cache.cache(), console)?;
    one_rotor_and_friction(&scene.settings)?;
    let (scene, frictionless) = with_friction(scene);
    let asked = StabilityScene { scene: &scene, settings: &arguments.set };
    let mut own = asked.start_values()?;
    if frictionless && !arguments.set.iter().any(|(name, _)| name == "friction_coefficient") {
        own.friction = Some(0.0);
    }
    let coupled = scene.roms[master(&scene)].is_cyclic();
    // Wrong ranges are rejected before the work.
    let first = StabilityGrid::new(arguments, &own, coupled, None)?;
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let mut ledger = WorkPlan::new(seconds_per_answer(&asked, &own) / threads as f64);
    ledger.plan(LIMITS, limits::ANSWERS as f64);
    ledger.plan(GRID, (first.places().len() * first.steps.len()) as f64);
    let forecast = Forecast::new(console, &format!("Checking {}", scene.settings.name), ledger);
    let shared = [scene_digest(&scene), format!("{:?} {own:?} {}", arguments.set, arguments.common.quick)];
    let mut journals = TaskJournals::open(&arguments.common.directory(NAME), NAME, Part::WHOLE, &shared)?;
    let mut work = StoredWork { threads, journals: &mut journals, console, forecast: &forecast };
    let limits = limits::find_all(&asked, &own, arguments.common.quick, &mut work)?;
    let usable = limits.iter().find(|usable| usable.method == own.method).and_then(limits::Usable::step);
    let grid = StabilityGrid::new(arguments, &own, coupled, usable)?;
    let structures = structures(&scene, &own, &grid)?;
    let no_rates = structures.as_ref().err().copied();
    let structures = structures.unwrap_or_default();
    let points = points(&asked, &own, &grid, &structures, &mut work)?;
    forecast.finish();
    let found =
        StabilityResult { name: arguments.scene.clone(), own, grid, points, limits, no_rates, scene: scene.clone() };
    Ok(StudyOutcome::Finished(Box::new(page::study(&found)?), Some(journals)))
}

/// Runs tasks on several threads and stores their results in journals.
pub(super) struct StoredWork<'a> {
    threads: usize,
    journals: &'a mut TaskJournals,
    console: &'a Console,
    forecast: &'a Forecast,
}

impl StoredWork<'_> {
    /// Runs the tasks `name`. Each of them is `share` units of the planned work of this kind in the forecast.
    fn run<T: Debug + Sync, R: Serialize + DeserializeOwned + Send>(
        &mut self,
        (kind, name, share): (usize, &str, f64),
        items: &[T],
        work: impl Fn(&T) -> Result<R> + Sync,
    ) -> Result<Vec<R>> {
        let before = Cell::new(0);
        let progress = |done: usize| {
            if done > before.get() {
                self.forecast.done(kind, share * (done - before.replace(done)) as f64);
            }
        };
        match self.journals.run(name, items, self.threads, work, self.console, progress)? {
            TaskResults::All(results) => Ok(results),
            TaskResults::Part(part) => Err(Failure::new(
                "study stability",
                format!("unexpected part of the tasks: {part:?}"),
                "Report this to the developers",
            )),
        }
    }
}

/// Name of the study, also of its files.
const NAME: &str = "stability";
/// Kinds of work in a forecast.
pub(super) const LIMITS: usize = 0;
const GRID: usize = 1;

/// Measures the time of the answer for the unchanged scene (s).
fn seconds_per_answer(asked: &StabilityScene, own: &SceneStart) -> f64 {
    let clock = std::time::Instant::now();
    asked.at(own.method, own.step, &[OperatingPoint { friction: own.friction, speed: own.speed }]);
    clock.elapsed().as_secs_f64()
}

/// Adds friction to a scene without friction, so that the coefficient is a parameter; also returns whether it had none.
fn with_friction(scene: Scene) -> (Scene, bool) {
    let mut other = scene.clone();
    let contacts = other.settings.contacts.iter_mut().filter(|contact| contact.friction == 0.0);
    let changed = contacts.map(|contact| contact.friction = SOME_FRICTION).count();
    if changed == scene.settings.contacts.len() && Simulation::new(&other).is_ok() {
        (other, true)
    } else {
        (scene, false)
    }
}

/// Returns the master at every speed of the grid, or the reason why its growth cannot be determined.
fn structures<'a>(
    scene: &'a Scene,
    own: &SceneStart,
    grid: &StabilityGrid,
) -> Result<Result<Vec<SingleStructure<'a>>, &'static str>> {
    let index = master(scene);
    let (settings, rom) = (&scene.settings.structures[index], &scene.roms[index]);
    if settings.motion == BodyMotion::Free || rom.frame == DisplacementFrame::Cartesian {
        return Ok(Err(
            "the master is a free body, and it is not known in advance which contacts close, where and for how long",
        ));
    }
    let damping = own.damping_ratio.unwrap_or(rom.damping_ratio);
    let factor = settings.frequency_factors.iter().fold(1.0, |most: f64, factor| most.max(*factor));
    let radial = scene.settings.contacts[0].meridian != Meridian::Contour;
    let at = |speed: &Option<f64>| {
        let speed = speed.filter(|_| settings.spin.stiffening).unwrap_or(0.0);
        let structure = SingleStructure::new(rom, damping, speed).map(|structure| structure.stiffened(factor));
        structure.map(|structure| if radial { structure.radial() } else { structure })
    };
    // The core rejects a speed that the structure does not support, point by point.
    let found: Vec<SingleStructure> =
        grid.speeds.iter().map(at).collect::<tiprub_core::Result<_>>().unwrap_or_default();
    Ok(if found.is_empty() { Err("the modes of the master cannot be computed at every speed") } else { Ok(found) })
}

/// Computes all answers.
fn points(
    asked: &StabilityScene,
    own: &SceneStart,
    grid: &StabilityGrid,
    structures: &[SingleStructure],
    work: &mut StoredWork,
) -> Result<Vec<StabilityPoint>> {
    let places = grid.places();
    let kind = (GRID, &*format!("grid {places:?}"), places.len() as f64);
    let answers = work.run(kind, &grid.steps, |step| Ok(asked.at(own.method, *step, &places)))?;
    let of_step = |(step, answers): &(f64, Vec<ScreeningResult>)| {
        let rates = |index: usize, place: &OperatingPoint| {
            let structure = structures.get(index / grid.frictions.len())?;
            rates(structure, own.method.0, *step, *place)
        };
        let points = places.iter().zip(answers.clone()).enumerate();
        Ok(points
            .map(|(index, (place, answer))| StabilityPoint {
                place: *place,
                step: *step,
                answer,
                rates: rates(index, place),
            })
            .collect::<Vec<_>>())
    };
    let answered: Vec<_> = grid.steps.iter().copied().zip(answers).collect();
    let found = sweep::sweep(&answered, work.threads, of_step, |_| {})?;
    let found = found.concat();
    if found.is_empty() { Err(Failure::new("stability", "the grid of the study is empty", "")) } else { Ok(found) }
}

fn rates(structure: &SingleStructure, scheme: Scheme, step: f64, place: OperatingPoint) -> Option<Rates> {
    let sliding = KnownContact { friction: place.friction?, speed: place.speed.unwrap_or(0.0) };
    structure.rates(scheme, step, sliding)
}
