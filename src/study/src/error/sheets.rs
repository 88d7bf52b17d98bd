//! Presents all measurements of a scene: chart, CSV, JSON, table of all runs.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_figure::table::Table;
use tiprub_shell::recording::shortest;

use super::{
    case::ErrorCase,
    chart::{ErrorChart, Points},
    competitor::{Competitor, EquationFamily},
    measure::{Figures, Measured, MeasuredRow},
    ranking::{self, ErrorKind, TARGETS, seconds},
};
use crate::Sheet;

/// Name of the column of steps and tolerances.
pub(super) const STEP: &str = "h (s) or tolerance";

/// Returns the key for the step or tolerance of a competitor.
pub fn step_name(competitor: Competitor) -> &'static str {
    if competitor.is_by_tolerance() { "tolerance" } else { "internal_step" }
}

/// Returns the chart of one kind of error and its numbers: a row per configuration, with its error in the column of the competitor.
pub fn chart(case: &dyn ErrorCase, found: &Measured, kind: ErrorKind) -> (ErrorChart, Sheet) {
    let rows = kind.rows(case, found);
    let mut chart = ErrorChart {
        error_label: match kind {
            ErrorKind::OfTime => "error of the steps, displacements (relative L2)".into(),
            ErrorKind::OfOwn => "error of the steps, displacements (relative L2), per-method limit".into(),
            ErrorKind::Total => "total error, displacements (relative L2)".into(),
        },
        all: Vec::new(),
        joined: kind != ErrorKind::Total,
        readable: (kind != ErrorKind::Total)
            .then(|| (found.references[case.standard()].apart[0], "difference of the two references".into())),
    };
    let competitors: Vec<Competitor> = Competitor::all()
        .into_iter()
        .filter(|competitor| rows.iter().any(|row| row.competitor == *competitor))
        .collect();
    let mut sheet = Sheet::default();
    sheet.columns.extend(["time (s)".to_owned(), case.size_name().to_owned(), STEP.to_owned()]);
    sheet.columns.extend(competitors.iter().map(|competitor| competitor.name()));
    for (column, &competitor) in competitors.iter().enumerate() {
        let mut points = Vec::new();
        for row in rows.iter().filter(|row| row.competitor == competitor) {
            let Ok(figures) = &row.outcome else { continue };
            points.push((figures.seconds, kind.of(figures)));
            #[expect(clippy::cast_precision_loss, reason = "numbers of elements and modes")]
            let mut cells = vec![figures.seconds, case.sizes()[row.size] as f64, row.step];
            cells.extend((0..competitors.len()).map(|i| if i == column { kind.of(figures) } else { f64::NAN }));
            sheet.rows.push(cells);
        }
        chart.all.push(Points { competitor, points });
    }
    (chart, sheet)
}

/// Value of a run: its name, its key for programs, true if it is compared with a finer model than the case's own, and the value.
type NamedFigure = (&'static str, &'static str, bool, fn(&Figures) -> Option<f64>);

const FIGURES: [NamedFigure; 11] = [
    ("time (s)", "seconds", false, |figures| Some(figures.seconds)),
    ("error of the steps", "error_of_steps", false, |figures| Some(figures.of_time)),
    ("error against the method's limit", "error_of_own_limit", false, |figures| Some(figures.of_own)),
    ("total error", "total_error", true, |figures| Some(figures.total)),
    ("impulse error of the steps", "impulse_error_of_steps", false, |figures| Some(figures.impulse)),
    ("total impulse error", "total_impulse_error", true, |figures| Some(figures.impulse_total)),
    ("energy error", "energy_error", false, |figures| Some(figures.energy)),
    ("energy balance residual", "ledger_residual", false, |figures| figures.residual),
    ("penetration (m)", "penetration", false, |figures| Some(figures.penetration)),
    ("smallest force (N)", "least_force", false, |figures| Some(figures.adhesion)),
    ("release error", "release_error", false, |figures| figures.release),
];

/// Returns whether a case has models finer than its own, or an exact solution; otherwise it has no total errors.
pub fn has_total(case: &dyn ErrorCase) -> bool {
    case.sizes().len() > 1 || case.exact().is_some()
}

/// Returns the values that a case has.
fn figures_of(case: &dyn ErrorCase) -> impl Iterator<Item = &'static NamedFigure> {
    let has_total = has_total(case);
    FIGURES.iter().filter(move |(_, _, total, _)| has_total || !total)
}

/// Returns every configuration as comma-separated values; rejections with their reason.
pub fn csv(case: &dyn ErrorCase, found: &Measured) -> String {
    let names: Vec<&str> = figures_of(case).map(|figure| figure.0).collect();
    let mut text = format!("competitor,{},{STEP},{},remark\n", case.size_name(), names.join(","));
    for row in &found.rows {
        let _ = write!(text, "\"{}\",{},{}", row.competitor.name(), case.sizes()[row.size], shortest(row.step));
        let _ = match &row.outcome {
            Ok(figures) => {
                for figure in figures_of(case) {
                    let _ = write!(
                        text,
                        ",{}",
                        (figure.3)(figures).map_or_else(String::new, |value| format!("{value:.4e}"))
                    );
                }
                writeln!(text, ",")
            }
            Err(problem) => writeln!(text, "{}\"{}\"", ",".repeat(names.len() + 1), problem.replace('"', "'")),
        };
    }
    text
}

/// Returns every configuration as a table for the page.
pub fn rows(case: &dyn ErrorCase, found: &Measured) -> Table {
    let mut columns = vec!["competitor".to_owned(), case.size_name().to_owned(), "step or tolerance".to_owned()];
    columns.extend(figures_of(case).map(|figure| figure.0.to_owned()).chain(["remark".to_owned()]));
    let mut table = Table { caption: format!("All runs of {}", case.title()), columns, rows: Vec::new() };
    for row in &found.rows {
        table.rows.push(cells(case, row));
    }
    table
}

fn cells(case: &dyn ErrorCase, row: &MeasuredRow) -> Vec<String> {
    let mut cells = vec![row.competitor.name(), case.sizes()[row.size].to_string(), row.competitor.setting(row.step)];
    match &row.outcome {
        Ok(figures) => {
            cells.push(seconds(figures.seconds));
            let rest = figures_of(case).skip(1).map(|figure| (figure.3)(figures));
            cells.extend(rest.map(|value| value.map_or_else(String::new, |value| format!("{value:.1e}"))));
            cells.push(String::new());
        }
        Err(problem) => {
            cells.extend(figures_of(case).map(|_| String::new()));
            cells.push(problem.clone());
        }
    }
    cells
}

/// Tabulates the distance of the references, size by size.
pub fn references(case: &dyn ErrorCase, found: &Measured) -> Table {
    let caption = format!(
        "{}: differences between the references ({} and {}), and truncation errors by number of {}",
        case.title(),
        case.first().name(),
        case.second().name(),
        case.size_name()
    );
    let columns = [
        case.size_name(),
        "displacement difference",
        "impulse difference",
        "massless-boundary against reference",
        "galerkin against massless-boundary",
        "coulomb against reference",
        "truncation error",
    ];
    let mut table = Table::new(caption, columns);
    for ((size, own), truncation) in case.sizes().iter().zip(&found.references).zip(&found.truncation) {
        let away = |family| own.away(family).map_or_else(|| "-".into(), |away: f64| format!("{away:.1e}"));
        let truncation = if *truncation == 0.0 { "0 (reference)".into() } else { format!("{truncation:.1e}") };
        let [displacements, impulses] = own.apart.map(|apart| format!("{apart:.1e}"));
        table.rows.push(vec![
            size.to_string(),
            displacements,
            impulses,
            away(case.tolerant().family()),
            own.massless_apart.map_or_else(|| "-".into(), |apart| format!("{apart:.1e}")),
            away(EquationFamily::STICKING),
            truncation,
        ]);
    }
    table
}

/// Returns the cheapest configuration for an error of the steps, if the references can resolve it.
fn cheapest(case: &dyn ErrorCase, found: &Measured, target: f64) -> Value {
    let kind = ErrorKind::of_steps(case);
    let rows = ranking::conclusive_rows(case, found, kind, &kind.rows(case, found), target);
    match ranking::cheapest(&rows, kind, None, target) {
        None => json!({ "error": target }),
        Some((row, figures)) => json!({
            "error": target, "competitor": row.competitor.name(), step_name(row.competitor): row.step, "seconds": figures.seconds,
            "error_of_steps": kind.of(figures),
        }),
    }
}

/// Returns the results as JSON.
pub fn to_json(case: &dyn ErrorCase, found: &Measured) -> Value {
    let rows = found.rows.iter().map(|row| {
        let mut object = json!({
            "competitor": row.competitor.name(), "size": case.sizes()[row.size], step_name(row.competitor): row.step,
        });
        match &row.outcome {
            Ok(figures) => {
                for (_, key, _, value) in figures_of(case) {
                    object[key] = json!(value(figures));
                }
            }
            Err(problem) => object["refused"] = json!(problem),
        }
        object
    });
    json!({
        "scene": case.name(),
        "size_is": case.size_name(),
        "standard_size": case.sizes()[case.standard()],
        "window": case.interval() * case.samples() as f64,
        "references_apart": found.references.iter().map(|own| own.apart).collect::<Vec<_>>(),
        "massless_boundary_away": found.references.iter().map(|own| own.away(case.tolerant().family())).collect::<Vec<_>>(),
        "massless_apart": found.references.iter().map(|own| own.massless_apart).collect::<Vec<_>>(),
        "coulomb_away": found.references.iter().map(|own| own.away(EquationFamily::STICKING)).collect::<Vec<_>>(),
        "reference_from_truth": found.truncation,
        "cheapest": TARGETS.map(|target| cheapest(case, found, target)),
        "rows": rows.collect::<Vec<_>>(),
    })
}
