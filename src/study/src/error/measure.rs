//! Errors and times of all configurations of a scene, against references that are computed first.

use std::iter::zip;

use tiprub_shell::{Failure, Result, console::Task};

use super::{
    case::Case,
    competitor::{Competitor, DEFAULT, Family},
    run::{self, Trace},
};

/// What a run is judged by. Relative errors unless units are given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Median processor time of stepping (s).
    pub seconds: f64,
    /// Displacements against the truth: exact, or the reference of the largest size.
    pub total: f64,
    /// Displacements against the reference of the same size: what the steps alone do.
    pub of_time: f64,
    /// Displacements against the limit of the same equations, which differ for massless contact nodes and for sticking.
    pub of_own: f64,
    /// Normal impulse in windows against the reference of the same size.
    pub impulse: f64,
    /// Normal impulse in windows against the truth.
    pub impulse_total: f64,
    /// Energy in the end against that of the truth, relative to the largest energy there was.
    pub energy: f64,
    /// Residual of the energy ledger.
    pub residual: Option<f64>,
    /// Deepest penetration (m).
    pub penetration: f64,
    /// Most negative normal force (N).
    pub adhesion: f64,
    /// Largest error of a release, relative to the duration of its contact.
    pub release: Option<f64>,
}

/// One configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Index of the size.
    pub size: usize,
    /// Who.
    pub competitor: Competitor,
    /// Internal step (s).
    pub step: f64,
    /// How it went, or why it was refused or failed.
    pub outcome: Result<Figures, String>,
}

/// References of one size.
pub struct References {
    /// The product's.
    pub first: Trace,
    /// The outside one.
    pub second: Trace,
    /// The product's for other equations.
    pub limits: Vec<(Family, Trace)>,
    /// Displacements and windowed impulses of the first two, relative.
    pub apart: [f64; 2],
}

impl References {
    /// Limit of the equations of a family; where nothing can stick, those of sliding.
    pub fn limit(&self, family: Family) -> &Trace {
        let of = |family: Family| self.limits.iter().find(|limit| limit.0 == family).map(|limit| &limit.1);
        of(family).or_else(|| of(Family { sticking: false, ..family })).unwrap_or(&self.first)
    }

    /// How far the limit of a family is from the first reference; `None` where it was not computed.
    pub fn away(&self, family: Family) -> Option<f64> {
        let own = self.limits.iter().find(|limit| limit.0 == family)?;
        Some(apart(&own.1.displacements, &self.first.displacements))
    }
}

/// Everything measured of a scene.
pub struct Measured {
    /// All configurations.
    pub rows: Vec<Row>,
    /// By size.
    pub references: Vec<References>,
    /// Displacements of the reference of each size from the truth.
    pub truncation: Vec<f64>,
}

/// A run whose displacements are further away than so many times their size has failed.
const DIVERGED: f64 = 10.0;

/// |a − b| / |b| over all samples.
pub fn apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let (mut difference, mut size) = (0.0, 0.0);
    for (a, b) in zip(a.iter().flatten(), b.iter().flatten()) {
        difference += (a - b) * (a - b);
        size += b * b;
    }
    (difference / f64::max(size, f64::MIN_POSITIVE)).sqrt()
}

/// |a − b| / |b| of impulses summed over windows of so many samples.
fn windows_apart(a: &[f64], b: &[f64], window: usize) -> f64 {
    let sums = |values: &[f64]| vec![values.chunks(window).map(|part| part.iter().sum()).collect::<Vec<f64>>()];
    apart(&sums(a), &sums(b))
}

/// Number of runs of a scene, for progress.
pub fn count(case: &dyn Case) -> u64 {
    let of = |size: usize| {
        let all = case.competitors(size).into_iter();
        all.map(|competitor| case.divisions_of(size, competitor).len()).sum::<usize>() + 1
    };
    (0..case.sizes().len()).map(of).sum::<usize>() as u64
}

/// Run everything, configurations so many times each for their time. One run at a time.
///
/// # Errors
/// A reference fails.
pub fn measure(case: &dyn Case, repetitions: usize, task: &Task) -> Result<Measured> {
    let mut done = 0;
    let mut tick = || {
        done += 1;
        task.at(done);
    };
    let mut references = Vec::new();
    for size in 0..case.sizes().len() {
        references.push(refer(case, size)?);
        tick();
    }
    let exact = case.exact();
    let truth = exact.as_ref().or(references.last().map(|last| &last.first));
    let Some(truth) = truth else { return Err(Failure::new(case.name(), "the scene has no size", "")) };
    let mut rows = Vec::new();
    for (size, own) in references.iter().enumerate() {
        for competitor in case.competitors(size) {
            for division in case.divisions_of(size, competitor) {
                let outcome = judge(case, size, (competitor, division), own, truth, repetitions);
                rows.push(Row { size, competitor, step: case.interval() / f64::from(division), outcome });
                tick();
            }
        }
    }
    let truncation = references.iter().map(|own| apart(&own.first.displacements, &truth.displacements)).collect();
    Ok(Measured { rows, truncation, references })
}

/// The references of one size.
fn refer(case: &dyn Case, size: usize) -> Result<References> {
    let (division, outside) = case.reference_divisions(size);
    let trace = |competitor: Competitor, division: u32| {
        let run = case.start(size, competitor, division, 0.0);
        run.and_then(|mut run| run::trace(run.as_mut(), case.samples())).map_err(|problem| {
            Failure::new(
                format!("{}, {}", case.name(), competitor.name()),
                format!("the reference failed: {problem}"),
                "",
            )
        })
    };
    let first = trace(DEFAULT, division)?;
    let second = case.second_trace().map_or_else(|| trace(case.second(), outside), Ok)?;
    // Equations that are refused at this size have no limit; their rows say why.
    let limits =
        case.families(size).into_iter().map(|family| Some((family, trace(family.reference(), division).ok()?)));
    Ok(References {
        apart: [
            apart(&second.displacements, &first.displacements),
            windows_apart(&second.impulses, &first.impulses, case.impulse_window()),
        ],
        limits: limits.flatten().collect(),
        first,
        second,
    })
}

/// Run one configuration once to look at it, and again for its time.
fn judge(
    case: &dyn Case,
    size: usize,
    (competitor, division): (Competitor, u32),
    own: &References,
    truth: &Trace,
    repetitions: usize,
) -> Result<Figures, String> {
    let start = || case.start(size, competitor, division, 0.0);
    let mut run = start()?;
    let found = run::trace(run.as_mut(), case.samples())?;
    // The full model has a limit of its own.
    let plain = if competitor.is_full() { truth } else { &own.first };
    let error = apart(&found.displacements, &plain.displacements);
    if error.is_nan() || error > DIVERGED {
        return Err(format!("diverged: displacements are {error:.0e} times their size away"));
    }
    let limit = if competitor.is_full() { truth } else { own.limit(competitor.family()) };
    let window = case.impulse_window();
    let energies = truth.energies.iter().chain(&own.first.energies).chain([&truth.initial_energy]);
    let largest = energies.fold(f64::MIN_POSITIVE, |largest, energy| largest.max(energy.abs()));
    let largest = case.energy_scale().unwrap_or(largest);
    let last = |trace: &Trace| trace.energies.last().copied().unwrap_or(0.0);
    Ok(Figures {
        seconds: run::time(&start, case.samples(), repetitions, run.own_seconds())?,
        total: apart(&found.displacements, &truth.displacements),
        of_time: error,
        of_own: apart(&found.displacements, &limit.displacements),
        impulse: windows_apart(&found.impulses, &plain.impulses, window),
        impulse_total: windows_apart(&found.impulses, &truth.impulses, window),
        energy: (last(&found) - last(truth)).abs() / largest,
        residual: found.residual.map(f64::abs),
        penetration: found.penetration,
        adhesion: found.adhesion,
        release: release(case, &found, truth),
    })
}

/// Largest error of a release.
fn release(case: &dyn Case, found: &Trace, truth: &Trace) -> Option<f64> {
    let errors = case.releases().into_iter().map(|[touch, free]| {
        let before = |trace: &Trace| {
            let index = |i: &usize| (*i + 1) as f64 * case.interval() <= free * (1.0 + 1e-12);
            let last = (0..trace.last_forces.len()).filter(index).last();
            last.map_or(f64::NAN, |sample| trace.last_forces[sample])
        };
        let (found, exact) = (before(found), before(truth));
        // No force at all: a whole contact is missing.
        if found.is_nan() { 1.0 } else { (found - exact).abs() / (exact - touch) }
    });
    errors.reduce(f64::max)
}
