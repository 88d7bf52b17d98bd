//! Interaction map: amplitude of the tips over angular velocity and frequency when blades rub an out-of-round casing, compared with the speeds at
//! which engine orders of the casing meet natural frequencies.

mod figures;
mod findings;
mod picture;
pub mod prediction;
mod run;
pub(crate) mod spectrum;
mod start;
mod statements;

use findings::{Coincidence, MapPeak};
use prediction::{Crossing, FrequencyPrediction};
use serde_json::json;
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use tiprub_core::Scene;
use tiprub_core::scene::settings::SpinSettings;
use tiprub_gallery::scene_source;
use tiprub_shell::{
    Failure, Result,
    console::Console,
    forecast::{Forecast, WorkPlan},
    sweep,
};
use tiprub_sweep::{
    part::Part,
    tasks::{TaskJournals, TaskResults},
};

use super::{Statement, Study, StudyOutcome};
use crate::arguments::{MapArguments, Speeds};
use crate::one_rotor_and_friction;
pub use run::{MapSetup, SpeedResponse, SpeedRun};
use start::MapStart;

/// Range of angular velocities relative to the resonance of the second harmonic of the casing with the first mode: a fifth to both sides, and room
/// above for responses that extend to higher speeds (see [`LEAN`]).
const RANGE: [f64; 2] = [0.8, 1.2 * LEAN];
/// Ratio of the highest speed of the map to a crossing up to a fifth above the middle, which is the largest shift of resonance observed for rotor
/// 37; the middle itself has more room.
const LEAN: f64 = 1.25;
/// Name of the study, also of its files.
const NAME: &str = "map";
const COUNT: usize = 141;
const QUICK_COUNT: usize = 8;
/// Revolutions of the window; the bin width is the speed divided by this number.
const REVOLUTIONS: usize = 64;
const QUICK_REVOLUTIONS: usize = 16;
/// Duration of the start-up in decay times of the first mode, after which 0.7 % of the start-up vibration remain.
const DECAY_TIMES: f64 = 5.0;
const LEAST_TRANSIENT: usize = 20;
const MOST_TRANSIENT: usize = 400;
const QUICK_TRANSIENT: usize = 40;
/// Number of modes in the map. Above the last one there is room, because a response that extends to higher speeds also extends to higher
/// frequencies.
const MODES: usize = 3;
const ABOVE: f64 = LEAN;
/// Sampling rate relative to the highest frequency of the map; see [`spectrum::Decimator`].
const OVERSAMPLING: f64 = 8.0;
/// Maximum number of samples in a revolution.
const MOST_PER_REVOLUTION: f64 = 1e6;
/// Multiple of the base order of the casing whose resonance is the middle of the range of speeds.
const HARMONIC: usize = 2;

/// Request and results of a map.
struct Map {
    setup: MapSetup,
    prediction: FrequencyPrediction,
    crossings: Vec<Crossing>,
    runs: Vec<SpeedRun>,
    peaks: Vec<MapPeak>,
    coincidences: Vec<Coincidence>,
    /// Distance by which the casing reaches beyond the tips at rest (m).
    intrusion: f64,
    /// Difference between the casing's largest and smallest radius (m).
    depth: f64,
    /// Displacement of the leading edge when it is slowly pushed inwards by `depth` (m).
    static_displacement: Option<f64>,
    start: MapStart,
}

/// Runs the study: simulates all speeds, transforms the responses, draws and compares.
///
/// # Errors
/// The scene cannot be loaded, the scene is rejected at every speed, or a journal in the output directory cannot be used.
pub fn study(arguments: &MapArguments, console: &Console) -> Result<StudyOutcome> {
    let name = arguments.scene.as_str();
    // Checked before any model is reduced.
    tiprub_shell::native::check_set_once(arguments.set.iter().map(|(name, _)| name.as_str()))?;
    let settings = scene_source::settings(name)?;
    start::master(&settings)?;
    one_rotor_and_friction(&settings)?;
    let scene = arguments.common.options.load(name, &arguments.common.cache.cache(), console)?;
    let request = MapRequest {
        quick: arguments.common.quick,
        speeds: arguments.speeds,
        revolutions: arguments.revolutions.map(std::num::NonZero::get),
        transient: arguments.transient,
        settings: arguments.set.clone(),
    };
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let (map, speeds) = Map::prepare(scene, &request)?;
    let part = arguments.part.unwrap_or(Part::WHOLE);
    let mut journals = TaskJournals::open(&arguments.common.directory(NAME), NAME, part, &map.setup.digests())?;
    let runs = {
        // The rate is unknown until the first steps are finished.
        let (count, steps) = (part.runs(speeds.len()).len(), map.setup.communication_steps());
        let title = format!("Running the interaction map at {count} angular velocities");
        let forecast = Forecast::new(console, &title, WorkPlan::new(0.0));
        let (finished, displayed, is_planned) = (AtomicU64::new(0), Cell::new(0), Cell::new(false));
        let progress = |done: usize| {
            if !is_planned.replace(true) {
                forecast.plan(0, steps as f64 * (count - done) as f64);
            }
            let finished = finished.load(Ordering::Relaxed);
            if finished > displayed.get() {
                forecast.done(0, (finished - displayed.replace(finished)) as f64);
            }
        };
        let run = |speed: &f64| map.setup.run(*speed, &finished);
        let runs = journals.run("speed", &speeds, threads, run, console, progress)?;
        forecast.finish();
        runs
    };
    let runs = match runs {
        TaskResults::All(runs) => runs,
        TaskResults::Part(part) => return Ok(StudyOutcome::Part(part)),
    };
    let (study, warnings) = map.finish(runs, request.quick)?;
    console.warn_lines(&warnings);
    Ok(StudyOutcome::Finished(Box::new(study), Some(journals)))
}

/// Request of a map; `None` selects the default of the study.
#[derive(Debug, Clone, Default)]
pub struct MapRequest {
    /// True for few short runs.
    pub quick: bool,
    /// Angular velocities.
    pub speeds: Option<Speeds>,
    /// Revolutions of the window.
    pub revolutions: Option<usize>,
    /// Revolutions before the window.
    pub transient: Option<usize>,
    /// Start values to replace (name, value as text).
    pub settings: Vec<(String, String)>,
}

impl Map {
    /// Evaluates the runs, and returns the study with the warnings of the runs.
    ///
    /// # Errors
    /// All runs were rejected, or a figure cannot be drawn.
    fn finish(mut self, runs: Vec<SpeedRun>, quick: bool) -> Result<(Study, Vec<String>)> {
        self.runs = runs;
        if let (true, Some(Err(refusal))) =
            (self.answered().next().is_none(), self.runs.first().map(|run| run.outcome.as_ref().map(|_| ())))
        {
            return Err(Failure::new(
                "study map",
                format!("all angular velocities were rejected; reason for the first: {refusal}"),
                "",
            ));
        }
        self.peaks = findings::peaks(&self.runs);
        self.coincidences =
            findings::coincidences(&self.runs, &self.prediction, &self.crossings, self.setup.revolutions);
        let warnings = self.warning_lines();
        Ok((self.report(quick)?, warnings))
    }

    /// Prepares the map, and returns the speeds to run.
    fn prepare(scene: Scene, request: &MapRequest) -> Result<(Self, Vec<f64>)> {
        if request.settings.iter().any(|(name, _)| name == "speed") {
            return Err(Failure::usage("--set speed", "the study varies the speed", "Use --speeds FROM:TO:COUNT"));
        }
        let mut setup =
            MapSetup { scene, settings: request.settings.clone(), samples: 0, transient: 0, revolutions: 0, top: 0.0 };
        let master = start::master(&setup.scene.settings)?;
        let fastest = setup.scene.roms[master].extras.spin.as_ref().map_or(0.0, |spin| spin.largest_speed);
        // At the speed of the scene, because the speeds of the study may be rejected.
        let probe = setup.simulation(setup.scene.settings.structures[master].speed.abs())?;
        let start = MapStart::of(&setup.scene, &probe)?;
        let prediction = FrequencyPrediction::new(&setup.scene, &start, fastest)?;
        let turns = setup.scene.settings.structures[master].spin != SpinSettings::default();
        let speeds = speeds(&prediction, request, if turns { fastest } else { f64::INFINITY })?;
        let range = [speeds[0], speeds[speeds.len() - 1]];
        let elastic: Vec<f64> =
            prediction.modes(prediction.base_order.max(1), range[1]).into_iter().filter(|mode| *mode > 0.0).collect();
        let first = *elastic.first().ok_or_else(|| Failure::new("study map", "the master has no elastic mode", ""))?;
        setup.top = ABOVE * elastic[(MODES - 1).min(elastic.len() - 1)];
        setup.samples = samples(setup.top, range[0])?;
        setup.revolutions = request.revolutions.unwrap_or(if request.quick { QUICK_REVOLUTIONS } else { REVOLUTIONS });
        let decay = DECAY_TIMES / (start.damping_ratio * std::f64::consts::TAU * first);
        let patience = as_count((start.ramp_time + decay) * range[1] / std::f64::consts::TAU);
        let most = if request.quick { QUICK_TRANSIENT } else { MOST_TRANSIENT };
        setup.transient = request.transient.unwrap_or(patience.clamp(LEAST_TRANSIENT, most));
        setup.check_size(speeds.len())?;
        let crossings = prediction.crossings(range, setup.top);
        let shape = prediction::shape(&setup.scene, start.shape_factor)?;
        let lowest = shape.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = shape.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let intrusion = -(start.clearance[0] + lowest);
        let static_displacement = findings::static_displacement(&setup.scene, highest - lowest)?;
        let map = Self {
            setup,
            prediction,
            crossings,
            runs: Vec::new(),
            peaks: Vec::new(),
            coincidences: Vec::new(),
            intrusion,
            depth: highest - lowest,
            static_displacement,
            start,
        };
        Ok((map, speeds))
    }

    /// Returns the runs that were not rejected.
    fn answered(&self) -> impl Iterator<Item = (f64, &SpeedResponse)> {
        self.runs.iter().filter_map(|run| Some((run.speed, run.outcome.as_ref().ok()?)))
    }

    /// Returns every warning once, even if several runs report it.
    fn warnings(&self) -> Vec<String> {
        let texts = |response: &SpeedResponse| response.warnings.iter().map(|warning| warning.text.clone()).collect();
        let mut all: Vec<String> =
            self.answered().flat_map(|(_, response)| -> Vec<String> { texts(response) }).collect();
        all.sort();
        all.dedup();
        all
    }

    /// Returns two lines for every kind of warning.
    fn warning_lines(&self) -> Vec<String> {
        run::warning_lines(&self.answered().collect::<Vec<_>>())
    }

    fn report(&self, quick: bool) -> Result<Study> {
        let steps: u64 = self.answered().map(|(_, response)| response.internal_steps).sum();
        let stepping: f64 = self.answered().map(|(_, response)| response.stepping.as_secs_f64()).sum();
        let refusals: Vec<_> =
            self.runs.iter().filter_map(|run| Some((run.speed, run.outcome.as_ref().err()?))).collect();
        Ok(Study {
            name: NAME,
            title: "Interaction map".into(),
            summary: format!(
                "Amplitudes of the blade tips of the scene `{}` over angular velocity and frequency, from {} runs, and \
                 the speeds at which engine orders of the casing meet natural frequencies.{}",
                self.setup.scene.settings.name,
                self.runs.len(),
                if quick { " Quick mode: few, short runs, for a first look only." } else { "" }
            ),
            facts: self.facts(steps, stepping)?,
            statements: self.statements(),
            figures: figures::figures(self)?,
            results: json!({
                "speeds": self.runs.iter().map(|run| run.speed).collect::<Vec<_>>(),
                "refused": refusals,
                "base_engine_order": self.prediction.base_order,
                "peaks": self.peaks.iter().map(MapPeak::json).collect::<Vec<_>>(),
                "coincidences": self.coincidences.iter().map(Coincidence::json).collect::<Vec<_>>(),
                "intrusion": self.intrusion,
                "depth": self.depth,
                "static_displacement": self.static_displacement,
                "internal_steps": steps,
                "stepping_seconds": stepping,
                "warnings": self.warnings(),
            }),
            files: vec![
                (
                    "peaks.csv".into(),
                    "peaks of the map: angular velocity, frequency, amplitude".into(),
                    findings::peak_sheet(&self.peaks, &self.prediction).to_csv().into_bytes(),
                ),
                (
                    "coincidences.csv".into(),
                    "crossings of engine orders and modes, and the largest response to each order".into(),
                    findings::coincidence_sheet(&self.coincidences).to_csv().into_bytes(),
                ),
            ],
        })
    }

    fn facts(&self, steps: u64, stepping: f64) -> Result<Vec<(String, String)>> {
        let mut facts = self.facts_of_scene()?;
        facts.extend(self.facts_of_runs());
        facts.push((
            "stepping".into(),
            format!(
                "{:.2} µs per internal step, {stepping:.1} s in total on one processor",
                1e6 * stepping / steps.max(1) as f64
            ),
        ));
        Ok(facts)
    }

    /// Returns the facts of the scene.
    fn facts_of_scene(&self) -> Result<Vec<(String, String)>> {
        let (setup, settings) = (&self.setup, &self.setup.scene.settings);
        let rom = &setup.scene.roms[start::master(&setup.scene.settings)?];
        let ([low, high], without) = (self.start.clearance, self.start.without());
        let middle = self.runs[self.runs.len() / 2].speed;
        let modes = self.prediction.modes(self.prediction.base_order.max(1), middle);
        let shown: Vec<String> = modes.iter().take(MODES).map(|mode| format!("{mode:.2}")).collect();
        let at = if self.prediction.stiffening { format!(" at {middle:.1} rad/s") } else { " at rest".into() };
        let changed: Vec<String> = setup.settings.iter().map(|(name, value)| format!("{name} = {value}")).collect();
        Ok(vec![
            ("scene".into(), format!("{}: {}", settings.name, settings.description)),
            ("start values changed".into(), if changed.is_empty() { "none".into() } else { changed.join(", ") }),
            ("rotor".into(), format!("{} blades; {}", rom.sectors, rom.origin)),
            (format!("natural frequencies{at}"), format!("{} Hz", shown.join(", "))),
            (
                format!("clearance at rest{without}"),
                if low < high { format!("{low:.4e} to {high:.4e} m") } else { format!("{low:.4e} m") },
            ),
            (format!("interference between casing and tips{without}"), format!("{:.4e} m", self.intrusion)),
            ("friction coefficient".into(), self.start.friction.to_string()),
            ("damping ratio".into(), self.start.damping_ratio.to_string()),
        ])
    }

    /// Returns the facts of the runs.
    fn facts_of_runs(&self) -> Vec<(String, String)> {
        let setup = &self.setup;
        let [first, last] = [self.runs[0].speed, self.runs[self.runs.len() - 1].speed];
        let factors: Vec<usize> = self.answered().map(|(_, response)| response.factor).collect();
        let periods = setup.top * std::f64::consts::TAU / (first * setup.samples as f64);
        let factor = factors.iter().copied().min().unwrap_or(1);
        let folded = 100.0 * spectrum::gain(1.0 - periods, factor) / spectrum::gain(periods, factor);
        let bin = |speed: f64| speed / std::f64::consts::TAU / setup.revolutions as f64;
        vec![
            (
                "angular velocities".into(),
                format!(
                    "{} from {first:.3} to {last:.3} rad/s, in the {} sense about +z",
                    self.runs.len(),
                    if setup.sense() < 0.0 { "negative" } else { "positive" }
                ),
            ),
            (
                "one run".into(),
                format!(
                    "{} start-up revolutions, then {} in the Fourier transform (Hann window)",
                    setup.transient, setup.revolutions
                ),
            ),
            (
                "frequency resolution".into(),
                format!(
                    "{:.3} to {:.3} Hz, 1/{} of the rotational frequency",
                    bin(first),
                    bin(last),
                    setup.revolutions
                ),
            ),
            (
                "sampling".into(),
                format!(
                    "{} samples per revolution from {} to {} internal steps each, filtered by four boxcars of one \
                     sample's length; frequencies above the sampling rate alias into the map with at most {folded:.3} \
                     % of their amplitude",
                    setup.samples,
                    factor,
                    factors.iter().copied().max().unwrap_or(1)
                ),
            ),
        ]
    }

    fn statements(&self) -> Vec<Statement> {
        statements::statements(self)
    }
}

/// Returns the requested angular velocities, or those around the resonance of the second harmonic of the casing, up to the `fastest` valid speed of
/// the model (rad/s).
fn speeds(prediction: &FrequencyPrediction, request: &MapRequest, fastest: f64) -> Result<Vec<f64>> {
    if let Some(speeds) = request.speeds {
        return Ok(speeds.values());
    }
    let order = HARMONIC * if prediction.base_order > 0 { prediction.base_order } else { 2 };
    let rigid = prediction.modes(order, 0.0).iter().take_while(|mode| **mode <= 0.0).count();
    let middle = prediction.meeting(order, rigid).filter(|speed| *speed > 0.0);
    let middle = middle.ok_or_else(|| {
        Failure::new("study map", format!("no mode meets engine order {order}"), "Give --speeds FROM:TO:COUNT")
    })?;
    let count = if request.quick { QUICK_COUNT } else { COUNT };
    let [from, to] = RANGE.map(|share| share * middle);
    // If even the resonance is too fast for the model, the rejections of the runs report it.
    let to = if fastest > middle { to.min(fastest) } else { to };
    Ok(Speeds { from, to, count }.values())
}

/// Returns the number of samples per revolution, a power of two, for which the sampling rate is at least [`OVERSAMPLING`] times the top frequency
/// (Hz) even at the slowest speed (rad/s).
fn samples(top: f64, slowest: f64) -> Result<usize> {
    let least = OVERSAMPLING * top * std::f64::consts::TAU / slowest;
    if least <= MOST_PER_REVOLUTION {
        return Ok(as_count(least).next_power_of_two());
    }
    // The message shows two digits; rounded down, the value would be rejected again.
    let lowest = 1.05 * OVERSAMPLING * top * std::f64::consts::TAU / MOST_PER_REVOLUTION;
    Err(Failure::usage(
        "--speeds",
        format!("at {slowest} rad/s a revolution would need {least:.1e} samples to show frequencies up to {top:.0} Hz"),
        format!("Start at {lowest:.1e} rad/s or above"),
    ))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before")]
fn as_count(value: f64) -> usize {
    value.ceil().clamp(1.0, 1e6) as usize
}

#[cfg(test)]
mod tests;
