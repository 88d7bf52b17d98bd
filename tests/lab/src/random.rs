//! Random scenes, and the properties that each must have: `lab random`.
//!
//! A [`RandomScene`] follows from its seed alone: structures with a handful of modes, random features, scheme, solver
//! and inputs, and casings that close within a few periods, so that contact is violent. [`judged`] runs it natively
//! and, if the FMU library is given, through the C interface of both versions, and checks it with oracles that are
//! independent of the scene.

mod bodies;
pub(crate) mod command;
mod faces;
mod features;
mod inputs;
mod march;
mod oracles;
mod scenes;
mod states;
mod structures;
mod table;

use std::panic::{AssertUnwindSafe, catch_unwind};

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Error, Simulation};

use faces::{LibraryFaces, Native};
use march::RandomPlan;
use oracles::{Finding, OracleWatch};
use scenes::RandomScene;

/// Result of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SceneOutcome {
    /// The scene ran to its end.
    Ran,
    /// The scene was rejected before its start.
    Rejected,
    /// A step was rejected, with its reason.
    Ended,
}

/// A scene with its outcome and all findings.
#[derive(Debug, Clone, PartialEq)]
struct RandomRow {
    seed: u64,
    scheme: Scheme,
    solver: Solver,
    /// Indices in [`features::FEATURES`].
    features: Vec<usize>,
    outcome: SceneOutcome,
    /// Message of a rejection or of an early end.
    message: Option<String>,
    findings: Vec<Finding>,
    /// True if it was compared with the FMU library.
    compared: bool,
    /// Wall-clock time (s).
    seconds: f64,
}

impl RandomRow {
    fn is_wrong(&self) -> bool {
        !self.findings.is_empty()
    }
}

/// Runs a scene and applies all oracles; with the library, those of the FMU too.
fn judged(seed: u64, faces: Option<&LibraryFaces>) -> RandomRow {
    let clock = std::time::Instant::now();
    let trial = scenes::trial(seed);
    let mut row = RandomRow {
        seed,
        scheme: trial.scene.settings.time.scheme,
        solver: oracles::solver(&trial.scene),
        features: features::of(&trial.scene),
        outcome: SceneOutcome::Rejected,
        message: None,
        findings: Vec::new(),
        compared: faces.is_some(),
        seconds: 0.0,
    };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| run(&trial, faces, &mut row))) {
        let words = panic.downcast_ref::<String>().cloned();
        let words = words.or_else(|| panic.downcast_ref::<&str>().map(|words| (*words).to_owned()));
        row.findings.push(Finding { oracle: "panic", text: words.unwrap_or_default() });
    }
    row.seconds = clock.elapsed().as_secs_f64();
    row
}

fn run(trial: &RandomScene, faces: Option<&LibraryFaces>, row: &mut RandomRow) {
    let begun = Simulation::new(&trial.scene).and_then(|mut simulation| {
        let (plan, watch) = (RandomPlan::new(trial, &simulation), OracleWatch::new(trial, &simulation));
        simulation.initialise(0.0)?;
        Ok((simulation, plan, watch))
    });
    let (mut simulation, plan, mut watch) = match begun {
        Ok(begun) => begun,
        Err(error) => return reject(trial, faces, row, &error),
    };
    watch.begin(&simulation);
    let record = plan.march(&mut simulation, 0, |simulation, _| watch.look(simulation));
    row.outcome = if record.end.is_some() { SceneOutcome::Ended } else { SceneOutcome::Ran };
    row.message.clone_from(&record.end);
    row.findings.extend(record.end.as_deref().and_then(oracles::ends));
    row.findings.extend(watch.findings());
    row.findings.extend(states::restored(trial, &plan, &record));
    row.findings.extend(states::differentiated(trial, &plan));
    if let Some(faces) = faces {
        row.findings.extend(faces.compare(trial, Native::Ran(&plan, &record)));
    }
}

fn reject(trial: &RandomScene, faces: Option<&LibraryFaces>, row: &mut RandomRow, error: &Error) {
    row.message = Some(error.to_string());
    row.findings.extend(oracles::names(error));
    if let Some(faces) = faces {
        row.findings.extend(faces.compare(trial, Native::Rejected(&error.to_string())));
    }
}
