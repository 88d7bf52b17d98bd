//! Error against run time of a scene: every scheme and contact solver at several internal steps, against references.
//!
//! References are stepped with an internal step far below the others. Two of them, one with each scheme that gives
//! every mode its inertia, stand for the same equations; how far they are apart says down to which error the study can be
//! read. The massless boundary solves other equations and has a reference of its own. Errors are taken over a window that ends before rounding
//! differences of chaotic contact could dominate.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tiprub_core::{
    Scene, Simulation,
    settings::{Scheme, Solver},
};

use crate::{Failure, Result, console::Task};

/// Internal steps per communication step that are compared.
const DIVISIONS: [u32; 6] = [2, 5, 10, 20, 40, 80];
/// Internal steps per communication step of the references.
const REFERENCE_DIVISION: u32 = 640;
/// Repetitions of a run for the median time; the references run once.
const REPETITIONS: usize = 3;

/// Scheme and solver.
pub type Method = (Scheme, Solver);

/// The default first, its relative without inertia of the contact nodes, and the paper's last.
pub const METHODS: [Method; 5] = [
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
    /// Largest penetration at a communication point (m).
    pub penetration: f64,
    /// Most negative multiplier at a communication point (N), 0 if none.
    pub adhesion: f64,
}

/// One method at one internal step.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Scheme and solver.
    pub method: Method,
    /// Internal step h (s).
    pub step: f64,
    /// Median stepping time (s) and errors, or why the run was refused or failed.
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

/// What a run leaves behind.
struct Trace {
    displacements: Vec<f64>,
    impulse: f64,
    penetration: f64,
    adhesion: f64,
    stepping: Duration,
}

/// Number of runs a study makes, for progress.
pub fn runs() -> u64 {
    (METHODS.len() * DIVISIONS.len() + 3) as u64
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
    let exact = reference(METHODS[0])?;
    task.at(1);
    let other = reference((Scheme::CentralDifference, Solver::Lcp))?;
    task.at(2);
    let massless = reference((Scheme::MasslessBoundary, Solver::Lcp))?;
    task.at(3);
    let mut rows = Vec::new();
    for method in METHODS {
        for division in DIVISIONS {
            let equations = if method.0 == Scheme::MasslessBoundary { &massless } else { &exact };
            let outcome = measure(scene, method, division, steps, equations);
            rows.push(Row { method, step: length / f64::from(division), outcome });
            task.at(3 + rows.len() as u64);
        }
    }
    Ok(ErrorStudy {
        window,
        reference_step: length / f64::from(REFERENCE_DIVISION),
        references_apart: apart(&exact.displacements, &other.displacements),
        massless_apart: apart(&exact.displacements, &massless.displacements),
        rows,
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of communication steps")]
fn count(steps: f64) -> usize {
    (steps.round() as usize).max(1)
}

fn measure(scene: &Scene, method: Method, division: u32, steps: usize, exact: &Trace) -> Result<(f64, Errors), String> {
    let mut times = Vec::new();
    let mut last = trace(scene, method, division, steps)?;
    for _ in 1..REPETITIONS {
        times.push(last.stepping.as_secs_f64());
        last = trace(scene, method, division, steps)?;
    }
    times.push(last.stepping.as_secs_f64());
    times.sort_by(f64::total_cmp);
    let errors = Errors {
        displacement: apart(&exact.displacements, &last.displacements),
        impulse: (last.impulse / exact.impulse - 1.0).abs(),
        penetration: last.penetration,
        adhesion: last.adhesion,
    };
    Ok((times[times.len() / 2], errors))
}

fn trace(scene: &Scene, (scheme, solver): Method, division: u32, steps: usize) -> Result<Trace, String> {
    let mut scene = scene.clone();
    let length = scene.settings.experiment.communication_step;
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = length / f64::from(division);
    scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = solver);
    let start = scene.settings.experiment.start;
    let mut simulation = Simulation::new(&scene).map_err(|error| error.to_string())?;
    simulation.initialise(start).map_err(|error| error.to_string())?;
    let mut found =
        Trace { displacements: Vec::new(), impulse: 0.0, penetration: 0.0, adhesion: 0.0, stepping: Duration::ZERO };
    let impulse = simulation.table().find("normal_impulse").map(|variable| variable.reference);
    for index in 0..steps {
        let time = start + index as f64 * length;
        let clock = Instant::now();
        simulation.do_step(time, length).map_err(|error| error.to_string())?;
        found.stepping += clock.elapsed();
        let system = simulation.system();
        for row in 0..system.bank().rows() {
            found.displacements.extend((0..system.bank().sectors()).map(|sector| system.bank().row(row, sector)));
        }
        found.penetration = system.gaps().iter().fold(found.penetration, |deepest, gap| deepest.max(-gap));
        found.adhesion = system.events().iter().fold(found.adhesion, |least, event| least.min(event.normal));
        if let Some(reference) = impulse {
            found.impulse += simulation.real(reference).map_err(|error| error.to_string())?;
        }
    }
    Ok(found)
}

/// |a − b| / |a|.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    let difference = square(&mut a.iter().zip(b).map(|(a, b)| a - b));
    (difference / square(&mut a.iter().copied()).max(f64::MIN_POSITIVE)).sqrt()
}

/// Name of a method as in scene files.
pub fn name((scheme, solver): Method) -> String {
    let scheme = match scheme {
        Scheme::ModalExact => "modal-exact",
        Scheme::CentralDifference => "central-difference",
        Scheme::MasslessBoundary => "massless-boundary",
    };
    let solver = match solver {
        Solver::Lcp => "lcp",
        Solver::Film => "film",
        Solver::Coulomb => "coulomb",
    };
    format!("{scheme} + {solver}")
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
                "method": name(row.method), "internal_step": row.step, "seconds": time,
                "displacement_error": errors.displacement, "impulse_error": errors.impulse,
                "penetration": errors.penetration, "adhesion": errors.adhesion,
            }),
            Err(problem) => json!({ "method": name(row.method), "internal_step": row.step, "refused": problem }),
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
