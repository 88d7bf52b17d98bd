//! Runs the interaction map at one speed: after the start-up, a window is recorded and transformed.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use tiprub_core::scene::method::Scheme;
use tiprub_core::system::System;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::shown;
use tiprub_cosim::variables::Quantity;
use tiprub_cosim::warning::{Severity, Warning};
use tiprub_shell::{Failure, Result, native};
use tiprub_sweep::tasks::scene_digest;

use super::{
    spectrum::{Analyser, Decimator},
    start,
};

/// Maximum number of recorded displacements in memory per run; beyond it, not every blade is recorded.
const MOST_SAMPLES: usize = 16_000_000;
/// Numbers recorded per blade and sample: two nodes, three components each.
const ROWS: usize = 6;
/// Maximum memory (bytes) for the spectra of all runs together, and the memory per bin: numbers, their table and its text.
const MOST_BYTES: usize = 2 << 30;
const BYTES_PER_BIN: usize = 256;
/// Number of samples per bin that is kept, at least: the sampling rate is [`super::OVERSAMPLING`] times the highest frequency.
const BIN_SHARE: usize = 8;
/// Smallest number of steps per sample from which [`Decimator`] filters the motion between samples.
const LEAST_FACTOR: f64 = 4.0;

/// Data that all runs share.
#[derive(Debug, Clone)]
pub struct MapSetup {
    /// Scene, except for the magnitude of its speed.
    pub scene: Scene,
    /// Start values to replace (name, value as text).
    pub settings: Vec<(String, String)>,
    /// Samples per revolution; a power of two.
    pub samples: usize,
    /// Revolutions before the window.
    pub transient: usize,
    /// Revolutions of the window.
    pub revolutions: usize,
    /// Highest frequency that is kept (Hz).
    pub top: f64,
}

/// Result of one speed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SpeedRun {
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Response, or the reason why there is none.
    pub outcome: Result<SpeedResponse, String>,
}

/// Response in the window at one speed. The two ends of a blade tip are given, leading edge first; for a structure with one contact node they are
/// equal.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SpeedResponse {
    /// Distance of the bins (Hz).
    pub resolution: f64,
    /// Amplitude of the displacement vector of the first blade per bin (m).
    pub first_blade: [Vec<f64>; 2],
    /// Largest amplitude of all blades per bin (m).
    pub largest_blade: [Vec<f64>; 2],
    /// Largest distance of a tip node from its mean position, over all blades (m).
    pub deflection: [f64; 2],
    /// Fraction of time in contact, averaged over all blades.
    pub contact_share: f64,
    /// Mean over time of the sum of all normal forces (N).
    pub normal_force: f64,
    /// Largest normal force of one node (N).
    pub largest_force: f64,
    /// Deepest penetration of any node at any internal step (m).
    pub penetration: f64,
    /// Relative change of the effective displacement of the leading edges from the first to the second half of the window.
    pub drift: f64,
    /// Relative residual of the energy ledger; 0 if the scene has none.
    pub energy_residual: f64,
    /// Internal steps per sample.
    pub factor: usize,
    /// Number of all internal steps.
    pub internal_steps: u64,
    /// Time spent for stepping.
    pub stepping: Duration,
    /// Warnings of the simulation.
    pub warnings: Vec<RunWarning>,
}

/// Warning of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunWarning {
    /// Identifier of the topic.
    pub id: String,
    /// True if the warning is only a note.
    pub is_note: bool,
    /// Problem and remedy.
    pub lines: [String; 2],
    /// Problem and remedy as one text.
    pub text: String,
}

impl RunWarning {
    pub(super) fn new(warning: &Warning) -> Self {
        Self {
            id: warning.topic().id().to_owned(),
            is_note: warning.level() == Severity::Note,
            lines: warning.lines().clone(),
            text: warning.to_string(),
        }
    }
}

/// Returns two lines for every topic and level of the warnings of `runs`, which contains the speed (rad/s) and the response of every run. The numbers
/// in warnings differ from run to run, so the lines contain the first warning and the number of runs with a warning of this topic and level.
pub fn warning_lines(runs: &[(f64, &SpeedResponse)]) -> Vec<String> {
    let all = || runs.iter().flat_map(|(speed, run)| run.warnings.iter().map(move |warning| (*speed, warning)));
    let kind = |warning: &RunWarning| (warning.id.clone(), warning.is_note);
    let mut kinds: Vec<(String, bool)> = Vec::new();
    for (_, warning) in all() {
        if !kinds.contains(&kind(warning)) {
            kinds.push(kind(warning));
        }
    }
    let lines = |own: &(String, bool)| {
        let (speed, RunWarning { id, is_note, lines: [problem, remedy], .. }) =
            all().find(|(_, warning)| kind(warning) == *own)?;
        let count = runs.iter().filter(|(_, run)| run.warnings.iter().any(|warning| kind(warning) == *own)).count();
        let level = if *is_note { Severity::Note } else { Severity::Warning }.name();
        let source = format!("{count} of {} runs; values from the run at {} rad/s", runs.len(), shown(speed));
        Some(format!("{level} [{id}] {problem}\n    {remedy} ({source})"))
    };
    kinds.iter().filter_map(lines).collect()
}

/// Sums over the window.
#[derive(Debug, Default)]
struct WindowTally {
    steps: u64,
    touching: u64,
    force: f64,
    largest_force: f64,
    penetration: f64,
}

impl WindowTally {
    fn add(&mut self, system: &System, touched: &mut [bool]) {
        touched.fill(false);
        for event in system.events() {
            touched[event.sector] = true;
            self.force += event.normal;
            self.largest_force = self.largest_force.max(event.normal);
        }
        self.touching += touched.iter().filter(|touched| **touched).count() as u64;
        self.penetration = system.gaps().fold(self.penetration, |deepest, gap| deepest.max(-gap));
        self.steps += 1;
    }
}

impl MapSetup {
    /// Returns texts that change with everything that determines the result of a run, except for its speed.
    pub fn digests(&self) -> Vec<String> {
        let Self { scene, settings, samples, transient, revolutions, top } = self;
        let mut settings = settings.clone();
        settings.sort();
        vec![scene_digest(scene), format!("{settings:?} {samples} {transient} {revolutions} {top:?}")]
    }

    /// Creates a simulation with its start values, not yet initialised, that rotates with `speed` (rad/s) in the sense of the scene.
    ///
    /// # Errors
    /// The scene is rejected, or settings are unknown or wrong.
    pub fn simulation(&self, speed: f64) -> Result<Simulation> {
        let mut scene = self.scene.clone();
        let master = start::master(&scene.settings)?;
        scene.settings.structures[master].speed = self.sense() * speed;
        let mut simulation = Simulation::new(&scene).map_err(|error| self.at(speed, error))?;
        for (name, value) in &self.settings {
            native::set(&mut simulation, name, value)?;
        }
        Ok(simulation)
    }

    /// Returns −1 if the scene's own speed is negative, else 1.
    pub fn sense(&self) -> f64 {
        let master = start::master(&self.scene.settings);
        if master.is_ok_and(|master| self.scene.settings.structures[master].speed < 0.0) { -1.0 } else { 1.0 }
    }

    /// Rejects requests that would not fit into memory: samples of one blade in one run, and the spectra of all `runs`.
    ///
    /// # Errors
    /// The request is too large; the error names the largest number of revolutions that fits.
    pub fn check_size(&self, runs: usize) -> Result<()> {
        let per_blade = ROWS * self.samples;
        let spectra = runs.saturating_mul(self.samples.div_ceil(BIN_SHARE)).saturating_mul(BYTES_PER_BIN);
        let most = (MOST_SAMPLES / per_blade).min(MOST_BYTES / spectra.max(1));
        if self.revolutions <= most {
            return Ok(());
        }
        Err(Failure::usage(
            format!("--revolutions {}", self.revolutions),
            format!(
                "with {} samples per revolution and {runs} angular velocities this exceeds {MOST_SAMPLES} recorded \
                 values per blade or 2 GiB for the spectra of all runs",
                self.samples
            ),
            if most > 0 {
                format!("Give at most {most} revolutions, or fewer or higher --speeds")
            } else {
                "Give fewer or higher --speeds".into()
            },
        ))
    }

    fn at(&self, speed: f64, error: tiprub_core::Error) -> Failure {
        Failure::from_core(format!("scene `{}` at {} rad/s", self.scene.settings.name, shown(speed)), error)
    }

    /// Returns the number of communication steps of a run: start-up, window, the measured step, and the tail of the filter.
    pub fn communication_steps(&self) -> u64 {
        ((self.transient + self.revolutions) * self.samples + 1 + Decimator::TAIL) as u64
    }

    /// Runs the scene at one speed (rad/s), and adds each of its communication steps to `finished`. If the run ends early, its missing steps are added
    /// at the end. A rejection is an outcome, not an error.
    ///
    /// # Errors
    /// Only programming errors.
    pub fn run(&self, speed: f64, finished: &AtomicU64) -> Result<SpeedRun> {
        let mut count = 0;
        let mut step = || {
            count += 1;
            finished.fetch_add(1, Ordering::Relaxed);
        };
        let outcome = self.response(speed, &mut step).map_err(|failure| failure.to_string());
        finished.fetch_add(self.communication_steps().saturating_sub(count), Ordering::Relaxed);
        Ok(SpeedRun { speed, outcome })
    }

    /// Limits the span of adaptive steps to `longest` (s), since the displacements are observed only at the ends of spans. With a tolerance, the
    /// variable of the internal step is the longest span.
    fn shorten_spans(&self, simulation: &mut Simulation, longest: f64) -> tiprub_core::Result<()> {
        let table = simulation.table();
        let reference = |quantity| table.with_quantity(quantity).map(|variable| variable.reference);
        let (Some(scheme), Some(step)) = (reference(Quantity::SchemeChoice), reference(Quantity::StepMax)) else {
            return Ok(());
        };
        let marched = simulation.integer(scheme)? == Scheme::ADAPTIVE.number();
        if marched && simulation.real(step)? > longest {
            simulation.set_real(step, longest)?;
        }
        Ok(())
    }

    fn response(&self, speed: f64, on_step: &mut dyn FnMut()) -> Result<SpeedResponse> {
        let mut simulation = self.simulation(speed)?;
        let start = self.scene.settings.experiment.start;
        // With a whole number of samples per revolution, engine orders lie in the middle of bins.
        let step = std::f64::consts::TAU / (speed * self.samples as f64);
        self.shorten_spans(&mut simulation, step / LEAST_FACTOR).map_err(|error| self.at(speed, error))?;
        simulation.initialise(start).map_err(|error| self.at(speed, error))?;
        // Each sample consists of several internal steps, so that the filter has an effect.
        if let Some(variable) = simulation.table().with_quantity(Quantity::StepMax) {
            let (reference, coarsest) = (variable.reference, step / LEAST_FACTOR);
            if simulation.real(reference).is_ok_and(|longest| longest > coarsest) {
                return Err(Failure::new(
                    format!("scene `{}` at {} rad/s", self.scene.settings.name, shown(speed)),
                    format!("the internal step is longer than a quarter of the sampling interval of {step:.3e} s"),
                    format!(
                        "Use an internal step of at most {coarsest:.3e} s (--set internal_step_max={coarsest:.1e})"
                    ),
                ));
            }
        }
        let mut march = March { setup: self, speed, start, step, simulation, internal_steps: 0, index: 0, on_step };
        let clock = Instant::now();
        march.skip(self.transient.saturating_mul(self.samples))?;
        let recording = march.record()?;
        march.finish(recording, clock)
    }
}

/// Simulation that is advanced step by step.
struct March<'a> {
    setup: &'a MapSetup,
    speed: f64,
    start: f64,
    /// Communication step (s).
    step: f64,
    simulation: Simulation,
    internal_steps: u64,
    /// Number of finished communication steps.
    index: usize,
    /// Called after every communication step.
    on_step: &'a mut dyn FnMut(),
}

/// Recorded data of the window.
struct WindowRecording {
    decimator: Decimator,
    /// Contact rows recorded per blade: two nodes, three components each.
    blades: Vec<usize>,
    tally: WindowTally,
    factor: usize,
}

impl March<'_> {
    fn time(&self, index: usize) -> f64 {
        self.start + index as f64 * self.step
    }

    /// Performs one communication step; `seen` is called after every internal step.
    fn advance(&mut self, mut seen: impl FnMut(&System)) -> Result<()> {
        let time = self.time(self.index);
        let next = self.time(self.index + 1) - time;
        let mut march = || -> tiprub_core::Result<()> {
            self.simulation.begin_step(time, next)?;
            loop {
                self.internal_steps += 1;
                let finished = self.simulation.advance()?.finished;
                seen(self.simulation.system());
                if finished {
                    return Ok(());
                }
            }
        };
        march().map_err(|error| self.setup.at(self.speed, error))?;
        self.index += 1;
        (self.on_step)();
        Ok(())
    }

    fn skip(&mut self, count: usize) -> Result<()> {
        (0..count).try_for_each(|_| self.advance(|_| {}))
    }

    fn record(&mut self) -> Result<WindowRecording> {
        let bank = self.simulation.system().bank();
        let (sectors, nodes, count) = (bank.sectors(), bank.rows() / 3, self.setup.revolutions * self.setup.samples);
        let rows: Vec<usize> = [0, nodes - 1].into_iter().flat_map(|node| 3 * node..3 * node + 3).collect();
        let stride = (sectors * rows.len() * count).div_ceil(MOST_SAMPLES).max(1);
        let blades: Vec<usize> = (0..sectors).step_by(stride).collect();
        let factor = self.factor()?;
        let before = self.internal_steps;
        let mut decimator = Decimator::new(factor, blades.len() * rows.len(), count);
        let (mut values, mut touched, mut tally) = (Vec::new(), vec![false; sectors], WindowTally::default());
        for _ in 0..count + Decimator::TAIL {
            self.advance(|system| {
                values.clear();
                let bank = system.bank();
                values.extend(blades.iter().flat_map(|blade| rows.iter().map(|row| bank.row(*row, *blade))));
                decimator.push(&values);
                tally.add(system, &mut touched);
            })?;
        }
        let steps = usize::try_from(self.internal_steps - before).unwrap_or(usize::MAX);
        if steps != factor * (count + Decimator::TAIL) {
            let problem = format!("{steps} internal steps do not make {count} samples of {factor}");
            return Err(Failure::new("sampling", problem, "Report this to the developers"));
        }
        Ok(WindowRecording { decimator, blades, tally, factor })
    }

    /// Returns the number of internal steps of one communication step.
    fn factor(&mut self) -> Result<usize> {
        let before = self.internal_steps;
        self.advance(|_| {})?;
        Ok(usize::try_from(self.internal_steps - before).unwrap_or(usize::MAX))
    }

    fn finish(self, recording: WindowRecording, clock: Instant) -> Result<SpeedResponse> {
        let stepping = clock.elapsed();
        let WindowRecording { decimator, blades, tally, factor } = recording;
        let setup = self.setup;
        let count = setup.revolutions * setup.samples;
        let resolution = self.speed / (std::f64::consts::TAU * setup.revolutions as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "far below the number of samples")]
        let bins = (setup.top / resolution).floor() as usize + 2;
        let analyser = Analyser::new(count, bins);
        let mut first_blade = [Vec::new(), Vec::new()];
        let mut largest_blade = [vec![0.0; bins], vec![0.0; bins]];
        let mut deflection = [0.0_f64; 2];
        let mut halves = [0.0; 2];
        for (index, _) in blades.iter().enumerate() {
            for node in 0..2 {
                let channels = [0, 1, 2].map(|component| 6 * index + 3 * node + component);
                let amplitudes = vector_spectrum(&analyser, &decimator, channels, count)?;
                largest_blade[node]
                    .iter_mut()
                    .zip(&amplitudes)
                    .for_each(|(most, value)| *most = f64::max(*most, *value));
                let distances = distances(&decimator, channels, count);
                deflection[node] = distances.iter().copied().fold(deflection[node], f64::max);
                if node == 0 {
                    let (early, late) = distances.split_at(count / 2);
                    let sum = |part: &[f64]| part.iter().map(|value| value * value).sum::<f64>();
                    halves = [halves[0] + sum(early), halves[1] + sum(late)];
                }
                if index == 0 {
                    first_blade[node] = amplitudes;
                }
            }
        }
        let residual = self.simulation.table().with_quantity(Quantity::EnergyResidualRelative);
        let residual = residual.map_or(Ok(0.0), |variable| self.simulation.real(variable.reference));
        let steps = tally.steps as f64;
        Ok(SpeedResponse {
            resolution,
            first_blade,
            largest_blade,
            deflection,
            contact_share: tally.touching as f64 / (steps * self.simulation.system().bank().sectors() as f64),
            normal_force: tally.force / steps,
            largest_force: tally.largest_force,
            penetration: tally.penetration,
            drift: if halves[0] > 0.0 { (halves[1] / halves[0]).sqrt() - 1.0 } else { 0.0 },
            energy_residual: residual.map_err(|error| setup.at(self.speed, error))?.abs(),
            factor,
            internal_steps: self.internal_steps,
            stepping,
            warnings: self.simulation.warnings().iter().map(RunWarning::new).collect(),
        })
    }
}

/// Returns the root of the sum of the squared amplitudes of three components; for a motion along a line, this is the amplitude of the vector.
fn vector_spectrum(analyser: &Analyser, decimator: &Decimator, channels: [usize; 3], count: usize) -> Result<Vec<f64>> {
    let mut sum: Vec<f64> = Vec::new();
    for channel in channels {
        let squares = analyser.squares(decimator.channel(channel))?;
        sum.resize(squares.len(), 0.0);
        sum.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
    }
    let gain = |bin: usize| decimator.gain(bin as f64 / count as f64);
    Ok(sum.iter().enumerate().map(|(bin, square)| square.sqrt() / gain(bin)).collect())
}

/// Returns the distance from the mean position, sample by sample.
fn distances(decimator: &Decimator, channels: [usize; 3], count: usize) -> Vec<f64> {
    let mut squares = vec![0.0; count];
    for channel in channels {
        let mean = decimator.channel(channel).sum::<f64>() / count as f64;
        squares.iter_mut().zip(decimator.channel(channel)).for_each(|(sum, value)| *sum += (value - mean).powi(2));
    }
    squares.iter().map(|square: &f64| square.sqrt()).collect()
}
