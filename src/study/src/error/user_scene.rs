//! Makes any scene a case of the error study: all schemes and solvers of tiprub at steps around the scene's own step.

use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_cosim::shown;
use tiprub_shell::{Failure, Result, console::Console, forecast::WorkPlan, schedule::Schedule};

use super::{
    case::ErrorCase,
    competitor::{Competitor, DEFAULT, EquationFamily, TOLERANCES, TOLERANT},
    measure::units,
    run::{StepExtremes, TimedRun},
    scene::SceneRun,
    window,
};
use crate::{arguments::ErrorArguments, convergence::refine::is_adaptive, divisions};

/// Internal steps to try, as multiples of the scene's number.
const SHARES: [f64; 7] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
const QUICK_SHARES: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Internal steps of the references, as multiples of the largest number that is tried.
const FINER: u32 = 8;
/// Maximum number of times that the longest step of a scene with adaptive steps is halved until fixed-step methods accept it.
const MOST_HALVINGS: u32 = 12;
/// Maximum number of further halvings if a fixed step is rejected during the run of a scene with adaptive steps.
const MOST_DOUBLINGS: u32 = 3;
/// Default number of samples of the window.
const SAMPLES: usize = 400;
const QUICK_SAMPLES: usize = 100;

/// Parameters that start values must not replace.
const COMPARED: [&str; 4] = ["scheme", "solver", "internal_step_max", "tolerance"];

/// Rejects start values that a study varies itself.
///
/// # Errors
/// One of the start values is such a parameter.
pub fn refuse_compared(settings: &[(String, String)]) -> Result<()> {
    tiprub_shell::native::check_set_once(settings.iter().map(|(name, _)| name.as_str()))?;
    match settings.iter().find(|(name, _)| COMPARED.contains(&name.as_str())) {
        Some((name, _)) => {
            let problem = "the study varies this setting itself";
            Err(Failure::usage(format!("--set {name}"), problem, "Leave it out"))
        }
        None => Ok(()),
    }
}

/// User scene as a case of the error study.
pub struct UserScene {
    title: String,
    scene: Scene,
    settings: Vec<(String, String)>,
    interval: f64,
    samples: usize,
    /// Internal steps per communication step around which fixed steps are tried.
    base: u32,
    divisions: Vec<u32>,
    parting: Vec<f64>,
}

impl UserScene {
    /// Reads the scene, and finds the window in which runs do not diverge.
    ///
    /// # Errors
    /// The scene cannot be read or does not run, or there is no contact within the window.
    pub fn new(arguments: &ErrorArguments, console: &Console) -> Result<Self> {
        refuse_compared(&arguments.set)?;
        let scene = arguments.common.options.load(&arguments.scene, &arguments.common.cache.cache(), console)?;
        Self::of(&arguments.scene, scene, &arguments.set, (arguments.window, arguments.common.quick), console)
    }

    /// Creates the case of the scene called `name` with replaced start values; without a `window` (s), that of a quick or a full study applies.
    ///
    /// # Errors
    /// The scene does not run, or there is no contact within the window.
    pub fn of(
        name: &str,
        scene: Scene,
        settings: &[(String, String)],
        (window, quick): (Option<f64>, bool),
        console: &Console,
    ) -> Result<Self> {
        let schedule = Schedule::new(&scene.settings.experiment, None, None)?;
        let interval = scene.settings.experiment.communication_step;
        let base = base(&scene, settings, interval).map_err(|problem| Failure::new(name, problem, ""))?;
        let most = if quick { QUICK_SAMPLES } else { SAMPLES };
        let title = scene.settings.name.clone();
        let mut case = Self {
            title,
            scene,
            settings: settings.to_vec(),
            interval,
            samples: 0,
            base,
            divisions: divisions_around(base, quick),
            parting: Vec::new(),
        };
        let refused = |problem| Failure::new(name, problem, "");
        let task = console.task("Finding the window in which runs do not diverge", None);
        let (touch, samples) = loop {
            match case.follow((window, most), schedule.count) {
                Ok((touch, samples, parting)) => {
                    case.parting = parting;
                    break (touch, samples);
                }
                // Friction causes growth in bands of steps, and whether closed contact grows is known only during the run.
                Err(_) if is_adaptive(&case.scene) && case.base < base << MOST_DOUBLINGS => {
                    case.base *= 2;
                    case.divisions = divisions_around(case.base, quick);
                }
                Err(problem) => return Err(refused(problem)),
            }
        };
        drop(task);
        if touch >= samples {
            let problem = if touch < schedule.count {
                let when = shown(interval * touch as f64);
                format!("no contact within the window: the first contact after the start is at {when} s")
            } else {
                "no contact before the end of the experiment".into()
            };
            return Err(Failure::new(name, problem, "Give a longer --window, or a scene with contact"));
        }
        case.samples = window::samples(&case.parting, samples);
        if case.samples == 0 {
            let problem = "nearly identical runs diverge within the first communication step".into();
            return Err(refused(problem));
        }
        Ok(case)
    }
}

/// Returns the internal steps per communication step to try around `base`, ascending.
fn divisions_around(base: u32, quick: bool) -> Vec<u32> {
    let shares = if quick { &QUICK_SHARES[..] } else { &SHARES[..] };
    let mut divisions: Vec<u32> = shares.iter().map(|share| count(share * f64::from(base))).collect();
    divisions.dedup();
    divisions
}

impl UserScene {
    /// Returns the sample of the first contact, the number of samples of a `window` (s), or of `most` samples after that contact, and the divergence
    /// of two runs over them; the experiment has `all` samples.
    fn follow(&self, (window, most): (Option<f64>, usize), all: usize) -> Result<(usize, usize, Vec<f64>), String> {
        let touch = self.first_touch(self.base, all)?;
        let asked = window.map_or(touch + most, |window| count(window / self.interval) as usize);
        let samples = asked.clamp(1, all);
        let parting = if touch < samples { window::parting(self, 2 * self.base, samples)? } else { Vec::new() };
        Ok((touch, samples, parting))
    }

    /// Returns the scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the start values that replace those of the scene.
    pub fn settings(&self) -> &[(String, String)] {
        &self.settings
    }

    /// Returns the scene's number of internal steps per communication step, or the inverse of its tolerance.
    pub fn own_division(&self) -> u32 {
        own_division(&self.scene)
    }

    /// Returns the internal steps per communication step, or inverse tolerances, to try with a competitor, ascending: `shares` times the scene's
    /// number.
    pub(super) fn tried(&self, competitor: Competitor, shares: &[f64]) -> Vec<u32> {
        let mut all: Vec<u32> = match competitor.is_by_tolerance() {
            true => TOLERANCES.to_vec(),
            false => shares.iter().map(|share| count(share * f64::from(self.base))).collect(),
        };
        if competitor == self.method() {
            all.push(self.own_division());
        }
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Returns the scheme and the solver of the scene.
    pub fn method(&self) -> Competitor {
        Competitor::Core(self.scene.settings.time.scheme, self.scene.settings.contacts[0].solver)
    }

    /// Returns an empty work plan. Its rate is the slowest of three runs per unit of work: the scene's own method, and fixed steps with `lcp` and
    /// `coulomb`, of which most of the work consists.
    pub fn ledger(&self) -> WorkPlan {
        let sticking = Competitor::Core(Scheme::default(), Solver::STICKING);
        let runs = [(self.method(), self.own_division()), (DEFAULT, self.base), (sticking, self.base)];
        WorkPlan::new(runs.into_iter().filter_map(|(method, division)| self.rate(method, division)).fold(0.0, f64::max))
    }

    /// Returns the time (s) per unit of work of a method, from its first second of stepping; `None` if it does not start.
    fn rate(&self, method: Competitor, division: u32) -> Option<f64> {
        let mut run = self.start(0, method, division, 0.0).ok()?;
        let clock = std::time::Instant::now();
        // A run that ends early has a rate as well, and a row that states the reason.
        let ran = (0..self.samples)
            .take_while(|_| run.advance().is_ok() && clock.elapsed().as_secs_f64() < 1.0)
            .count()
            .max(1);
        let share = ran as f64 / self.samples as f64;
        Some(clock.elapsed().as_secs_f64() / (share * units(self, 0, method, division)).max(1.0))
    }

    /// Returns the number of communication steps before the first contact, at most `most`.
    fn first_touch(&self, division: u32, most: usize) -> Result<usize, String> {
        let mut run = self.start(0, DEFAULT, division, 0.0)?;
        let mut seen = StepExtremes::nothing();
        for sample in 0..most {
            run.watch(&mut seen)?;
            if seen.impulse > 0.0 {
                return Ok(sample);
            }
        }
        Ok(most)
    }
}

/// Returns a scene's number of internal steps per communication step, or the inverse of its tolerance.
pub(crate) fn own_division(scene: &Scene) -> u32 {
    let time = &scene.settings.time;
    let steps = || divisions(scene.settings.experiment.communication_step, time.step);
    time.step_tolerance().map_or_else(steps, |tolerance| count(1.0 / tolerance))
}

/// Returns the internal steps per communication step around which fixed steps are tried: the scene's number; for adaptive steps, those of a quarter
/// of the longest step that the first reference accepts at its start.
fn base(scene: &Scene, settings: &[(String, String)], interval: f64) -> Result<u32, String> {
    let own = divisions(interval, scene.settings.time.step);
    if !scene.settings.time.scheme.properties().adaptive {
        return Ok(own);
    }
    let Competitor::Core(scheme, solver) = DEFAULT else { return Ok(own) };
    let mut refused = String::new();
    for halvings in 0..MOST_HALVINGS {
        let division = own << halvings;
        let scene = SceneRun::changed(scene, (scheme, solver), interval / f64::from(division), 0.0);
        match SceneRun::with_start_values(&scene, interval, division, settings) {
            Ok(_) => return Ok(4 * division),
            Err(problem) => refused = problem,
        }
    }
    Err(refused)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
pub(super) fn count(value: f64) -> u32 {
    value.round().clamp(1.0, 1e8) as u32
}

impl ErrorCase for UserScene {
    fn name(&self) -> &'static str {
        "scene"
    }

    /// The second figure is that of [`super::total`].
    fn figures(&self) -> [&'static str; 2] {
        ["scene-steps", "scene-total"]
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn description(&self) -> String {
        let settings = &self.scene.settings;
        format!("{} Inputs keep their start values.", settings.description)
    }

    fn size_name(&self) -> &'static str {
        "coordinates of the first ROM"
    }

    fn sizes(&self) -> Vec<usize> {
        vec![self.scene.roms[0].order()]
    }

    fn interval(&self) -> f64 {
        self.interval
    }

    fn samples(&self) -> usize {
        self.samples
    }

    fn impulse_window(&self) -> usize {
        (self.samples / 20).max(1)
    }

    fn divisions(&self, _: usize) -> Vec<u32> {
        self.divisions.clone()
    }

    fn reference_divisions(&self, _: usize) -> (u32, u32) {
        let most = self.divisions.last().copied().unwrap_or(1);
        (FINER.saturating_mul(most), FINER.saturating_mul(most))
    }

    fn second(&self) -> Competitor {
        Competitor::Core(Scheme::PAPER, Solver::Lcp)
    }

    fn relation(&self) -> &'static str {
        "another scheme"
    }

    fn competitors(&self, _: usize) -> Vec<Competitor> {
        let steps = Scheme::RECURRENCES
            .into_iter()
            .flat_map(|scheme| Solver::ALL.map(|solver| Competitor::Core(scheme, solver)));
        steps.chain([TOLERANT]).collect()
    }

    fn divisions_of(&self, _: usize, competitor: Competitor) -> Vec<u32> {
        if competitor.is_by_tolerance() { self.tried(competitor, &[]) } else { self.divisions.clone() }
    }

    fn parting(&self) -> &[f64] {
        &self.parting
    }

    fn is_coated(&self) -> bool {
        self.scene.settings.contacts.iter().any(|contact| contact.coating.is_some())
    }

    fn perturbed(&self) -> &'static str {
        "the clearance or velocity"
    }

    fn families(&self, _: usize) -> Vec<EquationFamily> {
        vec![EquationFamily::MASSLESS, EquationFamily::STICKING, EquationFamily::BOTH]
    }

    fn start<'a>(
        &'a self,
        _: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> Result<Box<dyn TimedRun + 'a>, String> {
        let Competitor::Core(scheme, solver) = competitor else {
            return Err("the method is not available for user scenes".into());
        };
        let scene = SceneRun::by(&self.scene, (scheme, solver), self.interval, division, perturbation);
        Ok(Box::new(SceneRun::with_start_values(&scene, self.interval, division, &self.settings)?))
    }
}

#[cfg(test)]
mod tests {
    use tiprub_model::rotor37::TipContact;
    use tiprub_shell::console::Console;

    use super::*;
    use crate::convergence::{
        refine::RomSource as _,
        rows::tests::{PatchedBlade, scene},
    };

    /// The whole window accepts the base of the fixed steps, so that half of it and multiples can be compared.
    #[test]
    fn fixed_reference_steps_cover_the_whole_window() {
        let console = Console::new(true, false);
        let mut scene = scene(2);
        scene.roms[0] = PatchedBlade.reduce(None, 10, TipContact::patches([5, 2]), &console).unwrap().rom;
        scene.settings.contacts[0].friction = 0.4;
        (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, 8e-5);
        let first = base(&scene, &[], 1e-5).unwrap();
        let case = UserScene::of("a blade", scene, &[], (Some(1.5e-3), true), &console).unwrap();
        assert!(case.base >= first && case.first_touch(case.base, 150).is_ok(), "{first} {}", case.base);
        assert_eq!(case.divisions, [case.base / 2, case.base, 2 * case.base, 4 * case.base]);
    }
}
