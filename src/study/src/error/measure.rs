//! Measures errors and times of all configurations of a scene against references that are computed first.

use std::iter::zip;

use tiprub_shell::{
    Failure, Result,
    forecast::{Forecast, WorkPlan},
};

use super::{
    case::ErrorCase,
    competitor::{Competitor, EquationFamily, FINEST},
    run::{self, Trace},
};

/// Measured values of a run; errors are relative unless a unit is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    /// Median processor time of stepping (s).
    pub seconds: f64,
    /// Error of the displacements against the truth: the exact solution, or the reference of the largest size. Displacements and impulses are those
    /// of the worst structure.
    pub total: f64,
    /// Error of the displacements against the reference of the same size: the effect of the steps alone.
    pub of_time: f64,
    /// Error of the displacements against the limit of the same equations, which differs for massless contact nodes and for sticking.
    pub of_own: f64,
    /// Error of the normal impulse in windows against the reference of the same size.
    pub impulse: f64,
    /// Error of the normal impulse in windows against the truth.
    pub impulse_total: f64,
    /// Error of the final energy against the truth, relative to the largest energy.
    pub energy: f64,
    /// Residual of the energy ledger.
    pub residual: Option<f64>,
    /// Deepest penetration (m).
    pub penetration: f64,
    /// Most negative normal force (N).
    pub adhesion: f64,
    /// Largest error of a release time, relative to the duration of its contact.
    pub release: Option<f64>,
}

/// Row of results: one configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredRow {
    /// Index of the size.
    pub size: usize,
    /// The competitor.
    pub competitor: Competitor,
    /// Internal step (s), or tolerance with adaptive steps.
    pub step: f64,
    /// Measured values, or the reason of a rejection or failure.
    pub outcome: Result<Figures, String>,
}

/// References of one size.
pub struct CaseReferences {
    /// Reference of tiprub.
    pub first: Trace,
    /// Independent reference.
    pub second: Trace,
    /// References of tiprub for other equations.
    pub limits: Vec<(EquationFamily, Trace)>,
    /// Relative distances of the first two: displacements and windowed impulses.
    pub apart: [f64; 2],
    /// Relative distance of the displacements of two schemes with massless contact nodes, one of them with adaptive steps.
    pub massless_apart: Option<f64>,
}

impl CaseReferences {
    /// Returns the limit of the equations of a family; if nothing can stick, that of sliding contact.
    pub fn limit(&self, family: EquationFamily) -> &Trace {
        let of = |family: EquationFamily| self.limits.iter().find(|limit| limit.0 == family).map(|limit| &limit.1);
        of(family).or_else(|| of(EquationFamily { sticking: false, ..family })).unwrap_or(&self.first)
    }

    /// Returns the distance of the limit of a family from the first reference; `None` if it was not computed.
    pub fn away(&self, family: EquationFamily) -> Option<f64> {
        let own = self.limits.iter().find(|limit| limit.0 == family)?;
        Some(apart(&own.1, &self.first))
    }
}

/// All measured values of a scene.
pub struct Measured {
    /// All configurations.
    pub rows: Vec<MeasuredRow>,
    /// References by size.
    pub references: Vec<CaseReferences>,
    /// Distance of the displacements of the reference of each size from the truth.
    pub truncation: Vec<f64>,
}

/// A run has failed if the error of its displacements exceeds this multiple of their norm.
const DIVERGED: f64 = 10.0;

/// Smallest motion that is judged by its own norm, as a fraction of the largest motion; the norm of less would be that of rounding.
pub(super) const STILL: f64 = 1e-6;

/// Returns |a − b| / |b| over all samples, of the structure with the largest error, so that a large motion does not hide the errors of another
/// structure.
pub fn apart(a: &Trace, b: &Trace) -> f64 {
    parts_apart(&a.displacements, &b.displacements, &b.parts)
}

/// Returns the same measure for samples with this number of values for each structure.
pub fn parts_apart(a: &[Vec<f64>], b: &[Vec<f64>], parts: &[usize]) -> f64 {
    let mut from = 0;
    let squares = parts.iter().map(|length| {
        let own = from..from + length;
        from += length;
        let (mut difference, mut size) = (0.0, 0.0);
        for (a, b) in zip(a, b) {
            for (a, b) in zip(&a[own.clone()], &b[own.clone()]) {
                difference += (a - b) * (a - b);
                size += b * b;
            }
        }
        [difference, size]
    });
    let squares: Vec<[f64; 2]> = squares.collect();
    let least = STILL * STILL * squares.iter().fold(0.0, |most: f64, [_, size]| most.max(*size));
    let of = |[difference, size]: &[f64; 2]| (difference / size.max(least).max(f64::MIN_POSITIVE)).sqrt();
    worst(squares.iter().map(of))
}

/// Returns the largest error; NaN if one of them is NaN.
pub(super) fn worst(errors: impl Iterator<Item = f64>) -> f64 {
    errors.fold(0.0, |most: f64, error| if most.is_nan() || error <= most { most } else { error })
}

/// Returns |a − b| / |b| of impulses summed over windows of `window` samples; the largest of several structures.
fn windows_apart(a: &Trace, b: &Trace, window: usize) -> f64 {
    if b.parts.len() < 2 || a.shares.len() != b.shares.len() {
        let sums = |trace: &Trace| vec![sums(&trace.impulses, window)];
        return parts_apart(&sums(a), &sums(b), &[b.impulses.len().div_ceil(window)]);
    }
    let each = |trace: &Trace| {
        let of = |part: usize| trace.shares.iter().map(|shares| shares[part]).collect::<Vec<_>>();
        vec![(0..b.parts.len()).flat_map(|part| sums(&of(part), window)).collect::<Vec<_>>()]
    };
    parts_apart(&each(a), &each(b), &vec![b.shares.len().div_ceil(window); b.parts.len()])
}

fn sums(values: &[f64], window: usize) -> Vec<f64> {
    values.chunks(window).map(|part| part.iter().sum()).collect()
}

/// Number of kinds of work for a forecast: one for references, one for every competitor.
const KINDS: usize = 64;

/// Returns the kind of work of a competitor's runs in the case with this number.
pub(super) fn kind(case_number: usize, competitor: Competitor) -> usize {
    let known = Competitor::all().iter().position(|other| *other == competitor);
    KINDS * case_number + 1 + known.unwrap_or(KINDS - 2)
}

/// Returns the work of a run, as internal steps of one size; a tolerance that is ten times smaller doubles the steps.
pub(super) fn units(case: &dyn ErrorCase, size: usize, competitor: Competitor, division: u32) -> f64 {
    let usual = || {
        let divisions = case.divisions(size);
        f64::from(divisions.get(divisions.len() / 2).copied().unwrap_or(1))
    };
    let steps = if competitor.is_by_tolerance() {
        usual() * (f64::from(division) / USUAL_TOLERANCE).powf(0.3)
    } else {
        f64::from(division)
    };
    let elements = case.sizes().get(size).map_or(1.0, |size| *size as f64);
    steps * case.samples() as f64 * elements
}

/// Inverse of the tolerance at which a run is assumed to cost as much as one with the usual number of steps.
const USUAL_TOLERANCE: f64 = 1e3;

/// Returns the number of runs of a configuration: one for its results and `repetitions` for its time.
fn timed(repetitions: usize) -> f64 {
    (1 + repetitions) as f64
}

fn of_references(case: &dyn ErrorCase, size: usize) -> f64 {
    let (division, outside) = case.reference_divisions(size);
    let second = if case.second_trace().is_some() { 0.0 } else { units(case, size, case.second(), outside) };
    let own = units(case, size, case.first(), division);
    let tolerant = case.competitors(size).contains(&case.tolerant());
    let finest = if tolerant { units(case, size, case.tolerant(), FINEST) } else { 0.0 };
    own * (1 + case.families(size).len()) as f64 + second + finest
}

/// Plans the runs of the case with this number.
pub fn plan(case: &dyn ErrorCase, case_number: usize, repetitions: usize, ledger: &mut WorkPlan) {
    for size in 0..case.sizes().len() {
        ledger.plan(KINDS * case_number, of_references(case, size));
        for competitor in case.competitors(size) {
            for division in case.divisions_of(size, competitor) {
                let own = timed(repetitions) * units(case, size, competitor, division);
                ledger.plan(kind(case_number, competitor), own);
            }
        }
    }
}

/// Returns the number of runs of a scene.
pub fn count(case: &dyn ErrorCase) -> u64 {
    let of = |size: usize| {
        let all = case.competitors(size).into_iter();
        all.map(|competitor| case.divisions_of(size, competitor).len()).sum::<usize>() + 1
    };
    (0..case.sizes().len()).map(of).sum::<usize>() as u64
}

/// Runs all configurations, one run at a time, each `repetitions` times to measure its time.
///
/// # Errors
/// A reference fails.
pub fn measure(case: &dyn ErrorCase, case_number: usize, repetitions: usize, forecast: &Forecast) -> Result<Measured> {
    let mut references = Vec::new();
    for size in 0..case.sizes().len() {
        references.push(refer(case, size)?);
        forecast.done(KINDS * case_number, of_references(case, size));
    }
    let exact = case.exact();
    let truth = exact.as_ref().or(references.last().map(|last| &last.first));
    let Some(truth) = truth else {
        return Err(Failure::new(case.name(), "there is no model of the scene to measure", ""));
    };
    let mut rows = Vec::new();
    for (size, own) in references.iter().enumerate() {
        for competitor in case.competitors(size) {
            for division in case.divisions_of(size, competitor) {
                let outcome = judge(case, size, (competitor, division), own, truth, repetitions);
                let whole = if competitor.is_by_tolerance() { 1.0 } else { case.interval() };
                rows.push(MeasuredRow { size, competitor, step: whole / f64::from(division), outcome });
                forecast
                    .done(kind(case_number, competitor), timed(repetitions) * units(case, size, competitor, division));
            }
        }
    }
    let truncation = references.iter().map(|own| apart(&own.first, truth)).collect();
    Ok(Measured { rows, truncation, references })
}

/// Computes the references of one size.
fn refer(case: &dyn ErrorCase, size: usize) -> Result<CaseReferences> {
    let (division, outside) = case.reference_divisions(size);
    let trace = |competitor: Competitor, division: u32| {
        let run = case.start(size, competitor, division, 0.0);
        run.and_then(|mut run| run::trace(run.as_mut(), case.samples())).map_err(|problem| {
            Failure::new(
                format!("{}, {}", case.name(), competitor.name()),
                format!("the reference run failed: {problem}"),
                "",
            )
        })
    };
    let first = trace(case.first(), division)?;
    let second = case.second_trace().map_or_else(|| trace(case.second(), outside), Ok)?;
    // Equations that are rejected at this size have no limit; their rows state the reason.
    let limits =
        case.families(size).into_iter().map(|family| Some((family, trace(family.reference(), division).ok()?)));
    let mut limits: Vec<(EquationFamily, Trace)> = limits.flatten().collect();
    let by_tolerance = case.tolerant();
    let tolerant = case.competitors(size).contains(&by_tolerance).then(|| trace(by_tolerance, FINEST).ok()).flatten();
    let mut massless_apart = None;
    if let Some(finest) = tolerant {
        let family = by_tolerance.family();
        let other = limits.iter().position(|limit| limit.0 == family).map(|index| limits.swap_remove(index));
        massless_apart = other.map(|(_, other)| apart(&other, &finest));
        limits.push((family, finest));
    }
    Ok(CaseReferences {
        apart: [apart(&second, &first), windows_apart(&second, &first, case.impulse_window())],
        limits,
        massless_apart,
        first,
        second,
    })
}

/// Runs one configuration once to evaluate its results, and again to measure its time.
fn judge(
    case: &dyn ErrorCase,
    size: usize,
    (competitor, division): (Competitor, u32),
    own: &CaseReferences,
    truth: &Trace,
    repetitions: usize,
) -> Result<Figures, String> {
    let start = || case.start(size, competitor, division, 0.0);
    let mut run = start()?;
    let found = run::trace(run.as_mut(), case.samples())?;
    // The full model has a different limit.
    let plain = if competitor.is_full() { truth } else { &own.first };
    let error = apart(&found, plain);
    if error.is_nan() || error > DIVERGED {
        return Err(format!("diverged: the displacement error is {error:.0e} times the displacements"));
    }
    let limit = if competitor.is_full() { truth } else { own.limit(competitor.family()) };
    let window = case.impulse_window();
    let energies = truth.energies.iter().chain(&own.first.energies).chain([&truth.initial_energy]);
    let largest = energies.fold(f64::MIN_POSITIVE, |largest, energy| largest.max(energy.abs()));
    let largest = case.energy_scale().unwrap_or(largest);
    let last = |trace: &Trace| trace.energies.last().copied().unwrap_or(0.0);
    Ok(Figures {
        seconds: run::time(&start, case.samples(), repetitions, run.own_seconds())?,
        total: apart(&found, truth),
        of_time: error,
        of_own: apart(&found, limit),
        impulse: windows_apart(&found, plain, window),
        impulse_total: windows_apart(&found, truth, window),
        energy: (last(&found) - last(truth)).abs() / largest,
        residual: found.residual.map(f64::abs),
        penetration: found.penetration,
        adhesion: found.adhesion,
        release: release(case, &found, truth),
    })
}

/// Returns the largest error of a release time.
fn release(case: &dyn ErrorCase, found: &Trace, truth: &Trace) -> Option<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates the trace of two structures with one displacement each, in a window of one sample.
    fn trace(displacements: [f64; 2], shares: [f64; 2]) -> Trace {
        Trace {
            displacements: vec![displacements.to_vec()],
            parts: vec![1, 1],
            impulses: vec![shares.iter().sum()],
            shares: vec![shares.to_vec()],
            last_forces: Vec::new(),
            energies: Vec::new(),
            initial_energy: 0.0,
            residual: None,
            penetration: 0.0,
            adhesion: 0.0,
        }
    }

    #[test]
    fn error_is_relative_to_the_size_of_the_worst_structure() {
        let (found, truth) = (trace([1e-3, 1.2e-6], [5.0, 0.03]), trace([1e-3, 1.0e-6], [5.0, 0.02]));
        assert!((apart(&found, &truth) - 0.2).abs() < 1e-12 && (windows_apart(&found, &truth, 1) - 0.5).abs() < 1e-12);
        // Motions within rounding are ignored; NaN stays NaN.
        assert!(apart(&trace([1e-3, 2e-14], [1.0; 2]), &trace([1e-3, 1e-14], [1.0; 2])) < 1e-4);
        assert!(apart(&trace([f64::NAN, 1e-6], [1.0; 2]), &truth).is_nan());
    }
}
