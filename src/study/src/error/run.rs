//! Runs one competitor: records results at the sample times, and measures the time of the steps.

use super::clock;

/// Number of timed runs of a configuration.
pub const REPETITIONS: usize = 3;
/// Minimum total time (s) of the timed runs; short runs are repeated until they reach it.
const LEAST_TIME: f64 = 5e-3;
/// Maximum number of timed runs of a configuration.
const MOST_REPETITIONS: usize = 40;

/// Competitor that advances a scene from one sample time to the next.
pub trait TimedRun {
    /// Advances to the next sample time.
    ///
    /// # Errors
    /// The run ends here.
    fn advance(&mut self) -> Result<(), String>;

    /// Advances to the next sample time, and records every internal step.
    ///
    /// # Errors
    /// The run ends here.
    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String>;

    /// Returns the displacements that are compared (m).
    fn displacements(&self) -> Vec<f64>;

    /// Returns the number of displacements of each structure that touches, in their order.
    fn parts(&self) -> Vec<usize> {
        vec![self.displacements().len()]
    }

    /// Returns the kinetic, strain and potential energy (J).
    fn energy(&self) -> f64;

    /// Returns the residual of the energy ledger relative to the exchanged energy; `None` if there is no ledger.
    fn residual(&self) -> Option<f64>;

    /// Returns the processor time of the steps (s), if the run measures it itself.
    fn own_seconds(&self) -> Option<f64> {
        None
    }
}

/// Extremes and sums over internal steps.
#[derive(Debug, Clone, PartialEq)]
pub struct StepExtremes {
    /// ∫ of all normal forces since the last sample (N·s).
    pub impulse: f64,
    /// The same integral for every structure with contact nodes, if the run distinguishes them.
    pub shares: Vec<f64>,
    /// Time of the last force (s); NaN before the first force.
    pub last_force: f64,
    /// Deepest penetration so far (m).
    pub penetration: f64,
    /// Most negative normal force so far (N); 0 if there is none.
    pub adhesion: f64,
}

impl StepExtremes {
    /// Starts the next sample.
    pub fn next(&mut self) {
        self.impulse = 0.0;
        self.shares.fill(0.0);
    }

    /// Returns extremes without any steps.
    pub fn nothing() -> Self {
        Self { impulse: 0.0, shares: Vec::new(), last_force: f64::NAN, penetration: 0.0, adhesion: 0.0 }
    }

    /// Adds a step of length `step` (s) that ends at `time` (s).
    pub fn add(&mut self, time: f64, step: f64, forces: impl Iterator<Item = f64>, least_gap: f64) {
        let mut total = 0.0;
        for force in forces {
            total += force;
            self.adhesion = self.adhesion.min(force);
        }
        if total != 0.0 {
            self.impulse += total * step;
            // The force that closes the gap at the end of the step acts at its beginning.
            self.last_force = time - step;
        }
        self.penetration = self.penetration.max(-least_gap);
    }
}

/// Recorded results of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Displacements, sample by sample (m).
    pub displacements: Vec<Vec<f64>>,
    /// See [`TimedRun::parts`].
    pub parts: Vec<usize>,
    /// Normal impulse between samples (N·s).
    pub impulses: Vec<f64>,
    /// Normal impulse of every structure with contact nodes, if a run distinguishes them.
    pub shares: Vec<Vec<f64>>,
    /// Time of the last force up to every sample (s).
    pub last_forces: Vec<f64>,
    /// Energy at every sample (J).
    pub energies: Vec<f64>,
    /// Energy at the start (J).
    pub initial_energy: f64,
    /// See [`TimedRun::residual`].
    pub residual: Option<f64>,
    /// Deepest penetration (m).
    pub penetration: f64,
    /// Most negative normal force (N).
    pub adhesion: f64,
}

/// Records `samples` samples.
///
/// # Errors
/// The run ends early.
pub fn trace(run: &mut dyn TimedRun, samples: usize) -> Result<Trace, String> {
    let mut found = Trace {
        displacements: Vec::with_capacity(samples),
        parts: Vec::new(),
        shares: Vec::with_capacity(samples),
        impulses: Vec::with_capacity(samples),
        last_forces: Vec::with_capacity(samples),
        energies: Vec::with_capacity(samples),
        initial_energy: run.energy(),
        residual: None,
        penetration: 0.0,
        adhesion: 0.0,
    };
    let mut seen = StepExtremes::nothing();
    for _ in 0..samples {
        seen.next();
        run.watch(&mut seen)?;
        found.displacements.push(run.displacements());
        found.impulses.push(seen.impulse);
        found.shares.push(seen.shares.clone());
        found.last_forces.push(seen.last_force);
        found.energies.push(run.energy());
    }
    (found.parts, found.residual) = (run.parts(), run.residual());
    (found.penetration, found.adhesion) = (seen.penetration, seen.adhesion);
    Ok(found)
}

/// Returns the median of the processor time of the steps over `samples` samples (s) in at least `repetitions` runs; `known` is the time of a run
/// that has already finished.
///
/// # Errors
/// A run ends early.
pub fn time<'a>(
    start: &dyn Fn() -> Result<Box<dyn TimedRun + 'a>, String>,
    samples: usize,
    repetitions: usize,
    known: Option<f64>,
) -> Result<f64, String> {
    let mut times: Vec<f64> = known.into_iter().collect();
    let mut total: f64 = times.iter().sum();
    while times.len() < repetitions || (repetitions > 1 && total < LEAST_TIME && times.len() < MOST_REPETITIONS) {
        let mut run = start()?;
        let before = clock::now();
        for _ in 0..samples {
            run.advance()?;
        }
        let taken = run.own_seconds().unwrap_or((clock::now() - before).as_secs_f64());
        total += taken;
        times.push(taken);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}
