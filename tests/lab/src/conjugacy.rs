//! Forces, moments and work: the torque is conjugate to the rotor angle, master and slave get equal and opposite forces
//! and moments, and every input has its work, over all features, schemes and solvers.

mod run;

use std::fmt::Write as _;

pub(crate) use run::{ConjugacyRun, SurfaceFeature, WrenchSide, run};
use serde_json::json;
use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_figure::plots::{Plot, Series};
use tiprub_shell::{Failure, Result, sweep};
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure};

use crate::stability::models::short_name;

/// Largest internal step of the table (s).
const STEP: f64 = 1e-6;
/// Number of halvings in the figure.
const HALVINGS: i32 = 4;
/// File name of the table.
pub(crate) const TABLE: &str = "table.md";

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ConjugacyCase {
    feature: SurfaceFeature,
    scheme: Scheme,
    solver: Solver,
    friction: f64,
}

/// Results of the runs of a case.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ConjugacyRow {
    case: ConjugacyCase,
    /// Runs with steps h and h/2.
    seen: [ConjugacyRun; 2],
    /// Result without friction in a round rigid casing.
    round: Option<f64>,
}

impl ConjugacyCase {
    fn exists(&self, quick: bool) -> bool {
        let shown = match (self.solver.properties().complementary, self.solver.sticks()) {
            (false, _) => self.scheme == Scheme::PAPER,
            (true, false) => self.scheme != Scheme::PAPER,
            (true, true) => self.scheme == Scheme::default(),
        };
        let asked = if quick { shown && self.friction > 0.0 } else { self.friction > 0.0 || !self.solver.sticks() };
        asked && self.scene(self.friction, false).check_methods(self.scheme, self.solver).is_ok()
    }

    fn scene(&self, friction: f64, round: bool) -> Scene {
        let mut scene = self.feature.scene(friction, true, round);
        scene.settings.time.scheme = self.scheme;
        scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = self.solver);
        scene
    }

    fn row(&self) -> Result<ConjugacyRow> {
        let named = |error: tiprub_core::Error| {
            Failure::new(
                format!(
                    "{}, {}, {}, µ = {}",
                    self.feature.name(),
                    short_name(self.scheme),
                    self.solver.name(),
                    self.friction
                ),
                error.to_string(),
                "Report this to the developers",
            )
        };
        let scene = self.scene(self.friction, false);
        let seen = [run(&scene, STEP).map_err(named)?, run(&scene, 0.5 * STEP).map_err(named)?];
        let stays_round = matches!(
            self.feature,
            SurfaceFeature::Revolution | SurfaceFeature::Spline | SurfaceFeature::Disk | SurfaceFeature::Coating
        );
        let free_of_friction = !self.solver.sticks() && stays_round;
        let round = free_of_friction.then(|| run(&self.scene(0.0, true), STEP).map_err(named)).transpose()?;
        Ok(ConjugacyRow { case: *self, seen, round: round.map(|seen| seen.axis_moment) })
    }
}

fn cases(quick: bool) -> Vec<ConjugacyCase> {
    let mut cases = Vec::new();
    for feature in SurfaceFeature::ALL {
        for scheme in Scheme::RECURRENCES {
            for solver in Solver::ALL {
                for friction in [0.0, 0.15] {
                    cases.push(ConjugacyCase { feature, scheme, solver, friction });
                }
            }
        }
    }
    cases.retain(|case| case.exists(quick));
    cases
}

/// Runs all cases and states the results.
///
/// # Errors
/// A run that is rejected or fails.
pub(crate) fn study(quick: bool) -> Result<Study> {
    let rows = sweep::sweep(&cases(quick), sweep::processors(), ConjugacyCase::row, |_| ())?;
    let figure = curvature(if quick { 2 } else { HALVINGS })?;
    Ok(Study {
        name: "conjugacy",
        title: "Consistency of forces, moments and work".into(),
        summary:
            "Rotors that accelerate, whirl and shift in casings that contract, rotate and change shape, and a free \
                  body between plates, with every scheme and solver: balance of forces and moments on both sides of \
                  the contacts, of torque and shaft work, and of energy."
                .into(),
        facts: vec![
            ("runs".into(), rows.len().to_string()),
            ("contacts".into(), rows.iter().map(|row| row.seen[0].contacts).sum::<usize>().to_string()),
            ("largest internal step".into(), format!("{STEP:e} s")),
        ],
        statements: statements(&rows),
        results: json!({ "rows": rows.iter().copied().map(ConjugacyRow::to_json).collect::<Vec<_>>() }),
        files: vec![(TABLE.into(), "table".into(), table(&rows).into_bytes())],
        figures: vec![figure],
    })
}

/// Returns the largest value over the rows.
fn worst(rows: &[ConjugacyRow], value: impl Fn(&ConjugacyRow) -> f64) -> f64 {
    rows.iter().map(value).fold(0.0, |worst, value| if value > worst || value.is_nan() { value } else { worst })
}

fn statements(rows: &[ConjugacyRow]) -> Vec<Statement> {
    let below = |expected: &str, bound: f64, found: f64| {
        Statement::tested(format!("{expected}, at most {bound:.0e}"), found <= bound, format!("{found:.1e}"))
    };
    let is_spline = |row: &ConjugacyRow| row.case.feature == SurfaceFeature::Spline;
    let round = |spline: bool| worst(rows, |row| if is_spline(row) == spline { row.round.unwrap_or(0.0) } else { 0.0 });
    let touching = rows.iter().map(|row| row.seen[0].contacts).min().unwrap_or(0);
    let of =
        |side: WrenchSide| worst(rows, |row| if row.case.feature.side() == side { row.seen[0].moment } else { 0.0 });
    let massless = |row: &ConjugacyRow| row.case.scheme == Scheme::MasslessBoundary;
    let curved = |step: usize| worst(rows, |row| if massless(row) { 0.0 } else { row.seen[step].curvature.abs() });
    vec![
        Statement::tested("every run has contacts", touching > 0, format!("at least {touching} per run")),
        below(
            "moment about the axis of a frictionless round surface of revolution, relative to |F| r",
            1e-14,
            round(false),
        ),
        below("the same moment for a spline through 60 points of a circle, relative to |F| r", 1e-5, round(true)),
        below(
            "sum of the integral of torque times speed and the shaft work, relative to the total work",
            1e-13,
            worst(rows, |row| row.seen[0].shaft),
        ),
        below(
            "residual of the energy balance, relative to the total work",
            1e-13,
            worst(rows, |row| row.seen[0].balance),
        ),
        below(
            "imbalance of the forces on master and slave, relative to |F|",
            1e-14,
            worst(rows, |row| row.seen[0].force),
        ),
        below(
            "imbalance of the moments on master and slave about one point, for slaves with control points, relative to \
             |F| r",
            1e-13,
            of(WrenchSide::ControlPoints),
        ),
        below(
            "the same imbalance on surfaces of revolution, where nodes are offset by the penetration of a step, \
             relative to |F| r",
            1e-4,
            of(WrenchSide::Surface),
        ),
        below(
            "deviation of the modal forces on the surface carrier from those of the control-point forces",
            1e-12,
            worst(rows, |row| row.seen[0].modal),
        ),
        Statement::tested(
            "curvature work decreases with the step size (schemes with mass at the contact nodes)",
            curved(1) < 0.7 * curved(0),
            format!("at most {:.1e} of the total work with h, {:.1e} with h/2", curved(0), curved(1)),
        ),
    ]
}

impl ConjugacyRow {
    fn to_json(self) -> serde_json::Value {
        let ConjugacyCase { feature, scheme, solver, friction } = self.case;
        let [first, second] = self.seen;
        json!({
            "feature": feature.name(), "scheme": short_name(scheme), "solver": solver.name(), "friction": friction,
            "contacts": first.contacts, "axis_moment_round": self.round, "shaft": first.shaft, "ledger": first.balance,
            "force": first.force, "moment": first.moment, "modal": first.modal,
            "curvature": first.curvature, "curvature_half_step": second.curvature,
        })
    }
}

/// Returns the table in Markdown.
fn table(rows: &[ConjugacyRow]) -> String {
    let mut text = String::from(
        "| scene | scheme | solver | µ | contacts | axial moment, round casing, µ = 0 | torque·speed + shaft work | \
         energy balance | force | moment | curvature work, h | h/2 \
         |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for ConjugacyRow { case, seen: [first, second], round } in rows {
        let ConjugacyCase { feature, scheme, solver, friction } = case;
        let reported = |there: bool, value: f64| if there { format!("{value:.0e}") } else { "-".to_owned() };
        let round = reported(round.is_some(), round.unwrap_or_default());
        let shaft = reported(*feature != SurfaceFeature::Free, first.shaft);
        let force = reported(feature.side() == WrenchSide::ControlPoints, first.force);
        let moment = reported(feature.side() != WrenchSide::Dented, first.moment);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {friction} | {} | {round} | {shaft} | {:.0e} | {force} | {moment} | {:.1e} | {:.1e} |",
            feature.name(),
            short_name(*scheme),
            solver.name(),
            first.contacts,
            first.balance,
            first.curvature,
            second.curvature
        );
    }
    text
}

/// Draws the curvature work against the step.
fn curvature(halvings: i32) -> Result<StudyFigure> {
    let features = [SurfaceFeature::Revolution, SurfaceFeature::Spline, SurfaceFeature::Casing];
    let steps: Vec<f64> = (0..halvings).rev().map(|halving| STEP * 0.5_f64.powi(halving)).collect();
    let mut sheet = Sheet::new(["step (s)", "surface of revolution (-)", "rigid spline (-)", "flexible casing (-)"]);
    let tasks: Vec<(f64, SurfaceFeature)> =
        steps.iter().flat_map(|step| features.map(|feature| (*step, feature))).collect();
    let run = |(step, feature): &(f64, SurfaceFeature)| {
        run(&feature.scene(0.15, true, false), *step)
            .map_err(|error| Failure::new("lab conjugacy", error.to_string(), ""))
    };
    let seen = sweep::sweep(&tasks, sweep::processors(), run, |_| ())?;
    for (step, seen) in steps.iter().zip(seen.chunks(features.len())) {
        sheet.rows.push(std::iter::once(*step).chain(seen.iter().map(|seen| seen.curvature.abs())).collect());
    }
    let series = (1..=features.len()).map(|column| {
        Series::line(features[column - 1].name(), sheet.rows.iter().map(|row| (row[0], row[column])).collect())
    });
    let plot = Plot {
        logarithmic: true,
        logarithmic_x: true,
        marked: true,
        ..Plot::new("internal step (s)", "curvature work / total work", series.collect())
    };
    Ok(StudyFigure {
        name: "curvature",
        caption:
            "Work due to the rotation of normals and the curvature of surfaces within an internal step (modal-exact, \
             lcp, µ = 0.15)."
                .into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}
