//! Error against run time of a scene: every scheme and contact solver at several internal steps or tolerances, against references.
//!
//! References are stepped with an internal step far below the others. Two of them, one with each scheme that gives
//! every mode its inertia, stand for the same equations; how far they are apart says down to which error the study can be
//! read. The massless boundary solves other equations and has a reference of its own. Errors are taken over a window that ends before rounding
//! differences of chaotic contact could dominate.

use serde_json::{Value, json};
use tiprub_core::{
    Scene,
    settings::{Scheme, Solver},
};
use tiprub_shell::{Failure, Result, console::Task};

use crate::error::{
    competitor::Competitor,
    measure::apart,
    run::{self, Run, Trace},
    scene::SceneRun,
};

/// Internal steps per communication step that are compared.
const DIVISIONS: [u32; 5] = [2, 5, 10, 20, 40];
/// One over the tolerances that are compared.
const TOLERANCES: [u32; 5] = [100, 300, 1000, 10_000, 100_000];
/// Internal steps per communication step of the references.
const REFERENCE_DIVISION: u32 = 320;

/// Scheme and solver.
pub type Method = (Scheme, Solver);

/// By a tolerance first, then steps of one length: those without inertia of the contact nodes and with it, the paper's last.
pub const METHODS: [Method; 6] = [
    (Scheme::Galerkin, Solver::Lcp),
    (Scheme::ModalExact, Solver::Lcp),
    (Scheme::MasslessBoundary, Solver::Lcp),
    (Scheme::ModalExact, Solver::Film),
    (Scheme::CentralDifference, Solver::Lcp),
    (Scheme::CentralDifference, Solver::Film),
];

/// What a run is compared by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Displacements of all contact nodes at all communication points, relative L2.
    pub displacement: f64,
    /// Normal impulse over the window, relative.
    pub impulse: f64,
    /// Largest penetration in any step (m).
    pub penetration: f64,
    /// Most negative multiplier in any step (N), 0 if none.
    pub adhesion: f64,
}

/// One method at one internal step.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Scheme and solver.
    pub method: Method,
    /// Internal step h (s), or the tolerance.
    pub step: f64,
    /// Median processor time of stepping (s) and errors, or why the run was refused or failed.
    pub outcome: Result<(f64, Errors), String>,
}

/// The study of one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorStudy {
    /// Window (s from the start).
    pub window: f64,
    /// Internal step of the references (s).
    pub reference_step: f64,
    /// Relative L2 difference of the displacements of the two references of the same equations.
    pub references_apart: f64,
    /// Relative L2 difference of the massless boundary's reference from the first: what taking inertia away changes.
    pub massless_apart: f64,
    /// All runs.
    pub rows: Vec<Row>,
}

/// Whether a method goes by a tolerance.
pub fn by_tolerance((scheme, solver): Method) -> bool {
    Competitor::Core(scheme, solver).is_by_tolerance()
}

/// Internal steps per communication step, or one over tolerances.
fn divisions(method: Method) -> &'static [u32] {
    if by_tolerance(method) { &TOLERANCES } else { &DIVISIONS }
}

/// Number of runs a study makes, for progress.
pub fn runs() -> u64 {
    (METHODS.iter().map(|method| divisions(*method).len()).sum::<usize>() + 3) as u64
}

/// Study `scene` over `window` (s from its start) with the communication step of its experiment.
///
/// # Errors
/// A reference cannot be computed.
pub fn study(scene: &Scene, window: f64, task: &Task) -> Result<ErrorStudy> {
    let length = scene.settings.experiment.communication_step;
    let steps = count(window / length);
    let reference = |method| {
        let trace = trace(scene, method, REFERENCE_DIVISION, steps);
        trace.map_err(|problem| Failure::new("error study", format!("the reference run failed: {problem}"), ""))
    };
    let exact = reference((Scheme::ModalExact, Solver::Lcp))?;
    task.at(1);
    let other = reference((Scheme::CentralDifference, Solver::Lcp))?;
    task.at(2);
    let massless = reference((Scheme::MasslessBoundary, Solver::Lcp))?;
    task.at(3);
    let mut rows = Vec::new();
    for method in METHODS {
        for division in divisions(method) {
            let without_mass = matches!(method.0, Scheme::MasslessBoundary | Scheme::Galerkin);
            let outcome = measure(scene, method, *division, steps, if without_mass { &massless } else { &exact });
            let range = if by_tolerance(method) { 1.0 } else { length };
            rows.push(Row { method, step: range / f64::from(*division), outcome });
            task.at(3 + rows.len() as u64);
        }
    }
    Ok(ErrorStudy {
        window,
        reference_step: length / f64::from(REFERENCE_DIVISION),
        references_apart: apart(&other, &exact),
        massless_apart: apart(&massless, &exact),
        rows,
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of communication steps")]
fn count(steps: f64) -> usize {
    (steps.round() as usize).max(1)
}

fn measure(scene: &Scene, method: Method, division: u32, steps: usize, exact: &Trace) -> Result<(f64, Errors), String> {
    let last = trace(scene, method, division, steps)?;
    let seconds = run::time(&|| start(scene, method, division), steps, run::REPETITIONS, None)?;
    let impulse = |trace: &Trace| trace.impulses.iter().sum::<f64>();
    let errors = Errors {
        displacement: apart(&last, exact),
        impulse: (impulse(&last) / impulse(exact) - 1.0).abs(),
        penetration: last.penetration,
        adhesion: last.adhesion,
    };
    Ok((seconds, errors))
}

fn start(scene: &Scene, method: Method, division: u32) -> Result<Box<dyn Run>, String> {
    let length = scene.settings.experiment.communication_step;
    let scene = SceneRun::by(scene, method, length, division, 0.0);
    Ok(Box::new(SceneRun::with_start_values(&scene, length, division, &[])?))
}

fn trace(scene: &Scene, method: Method, division: u32, steps: usize) -> Result<Trace, String> {
    run::trace(start(scene, method, division)?.as_mut(), steps)
}

/// Name of a method as in scene files.
pub fn name((scheme, solver): Method) -> String {
    Competitor::Core(scheme, solver).name()
}

/// What [`Row::step`] is.
fn setting(method: Method) -> &'static str {
    if by_tolerance(method) { "tolerance" } else { "internal_step" }
}

impl ErrorStudy {
    /// The run of a method that takes least time among those with at most this displacement error.
    pub fn cheapest(&self, method: Method, error: f64) -> Option<f64> {
        let good = self.rows.iter().filter(|row| row.method == method).filter_map(|row| row.outcome.as_ref().ok());
        let good = good.filter(|(_, errors)| errors.displacement <= error);
        good.map(|(time, _)| *time).min_by(f64::total_cmp)
    }

    /// All rows for programs.
    pub fn to_json(&self) -> Value {
        let rows = self.rows.iter().map(|row| match &row.outcome {
            Ok((time, errors)) => json!({
                "method": name(row.method), setting(row.method): row.step, "seconds": time,
                "displacement_error": errors.displacement, "impulse_error": errors.impulse,
                "penetration": errors.penetration, "adhesion": errors.adhesion,
            }),
            Err(problem) => json!({ "method": name(row.method), setting(row.method): row.step, "refused": problem }),
        });
        json!({
            "window": self.window,
            "reference_step": self.reference_step,
            "references_apart": self.references_apart,
            "massless_boundary_apart": self.massless_apart,
            "rows": rows.collect::<Vec<_>>(),
        })
    }
}
