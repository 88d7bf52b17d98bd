//! Presents the answers as pictures, tables and files.

use serde_json::{Value, json};
use tiprub_cosim::shown;
use tiprub_figure::{
    cells::{Cell, CellKind, CellPanel, Cells},
    plots::{Plot, Series},
    table::Table,
};
use tiprub_shell::Result;

use super::{AnswerKind, StabilityPoint, StabilityResult, seek::Sought};
use crate::{Picture, Sheet, Statement, Study, StudyFigure, error::competitor::method_name};

const VERDICTS: [AnswerKind; 4] = [AnswerKind::Right, AnswerKind::Warned, AnswerKind::Flutter, AnswerKind::Refused];

const HOW_TO_READ: &str = "Every cell shows whether a run with this friction coefficient, speed and internal step is accepted, together with the \
     warnings or the error message that `tiprub run` would give, but the study does not execute the run. Read a column \
     from the bottom up: the longest step for a friction coefficient is the last one before the first rejection, and \
     all longer steps are rejected. The table of largest accepted steps lists this step. An accepted step has passed \
     the checks at the start of a run and has not been run. Flutter is physical and not an error of the step: friction \
     feeds energy into the blades during contact, and a shorter step does not help. A frequency of 0 Hz means \
     divergence, which is growth without oscillation. The framed cell is the scene as it stands. Move the pointer over \
     a cell to see its message; all messages are in the table and in answers-in-words.csv.";

impl AnswerKind {
    fn kind(self) -> CellKind {
        let (label, color, sign) = match self {
            Self::Right => ("accepted", "#c5e0d2", ""),
            Self::Warned => ("accepted with warnings", "#f4e3a1", "!"),
            Self::Flutter => ("accepted with friction-induced flutter", "#f2b98c", "~"),
            Self::Refused => ("rejected", "#cf8a98", "×"),
        };
        CellKind { label: label.into(), color, sign }
    }

    fn name(self) -> &'static str {
        ["right", "warned", "flutter", "refused"][self as usize]
    }
}

/// Builds the study from its results.
///
/// # Errors
/// A plot cannot be drawn.
pub fn study(found: &StabilityResult) -> Result<Study> {
    let mut figures = vec![answers(found)];
    figures.extend(growth(found)?);
    Ok(Study {
        name: "stability",
        title: format!("Stability of {}", found.scene.settings.name),
        summary: HOW_TO_READ.into(),
        facts: facts(found),
        statements: statements(found),
        figures,
        results: results(found),
        files: vec![
            (
                "answers-in-words.csv".into(),
                "all results with messages and growth rates".into(),
                answer_text(found).into_bytes(),
            ),
            (
                "largest-steps.csv".into(),
                "largest accepted step of every scheme and solver".into(),
                limits_csv(found).into_bytes(),
            ),
        ],
    })
}

fn or_none(value: Option<f64>) -> String {
    value.map_or_else(|| "not in this scene".into(), shown)
}

/// Formats numbers for a cell or a label.
fn short(value: f64) -> String {
    format!("{:.4}", value).trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn micro(step: f64) -> String {
    let value = 1e6 * step;
    if (0.01..1e5).contains(&value) { short(value) } else { format!("{value:.2e}") }
}

fn facts(found: &StabilityResult) -> Vec<(String, String)> {
    let (settings, own) = (&found.scene.settings, &found.own);
    let range = |values: &[Option<f64>]| match values {
        [Some(low), .., Some(high)] => format!("{} values from {} to {}", values.len(), short(*low), short(*high)),
        [one] => or_none(*one),
        _ => or_none(None),
    };
    let steps = match found.grid.steps.as_slice() {
        [low, .., high] => format!("{} values from {low:.3e} to {high:.3e}", found.grid.steps.len()),
        steps => steps.iter().map(|step| shown(*step)).collect(),
    };
    let mut facts = vec![
        ("scene".to_owned(), format!("{}, {}", found.name, settings.name)),
        ("friction coefficient of the scene".into(), or_none(own.friction)),
        ("speed of the scene (rad/s)".into(), or_none(own.speed)),
        ("internal step of the scene (s)".into(), shown(own.step)),
        ("scheme and solver of the scene".into(), method_name(own.method)),
        ("studied friction coefficients".into(), range(&found.grid.frictions)),
        ("studied speeds (rad/s)".into(), range(&found.grid.speeds)),
        ("studied internal steps (s)".into(), steps),
    ];
    for usable in &found.limits {
        facts.push((format!("largest accepted step, {}", method_name(usable.method)), usable.to_text()));
    }
    facts
}

/// Returns the point of the unchanged scene.
fn own_point(found: &StabilityResult) -> Option<&StabilityPoint> {
    let own = &found.own;
    let is = |point: &&StabilityPoint| {
        point.place.friction == own.friction
            && point.place.speed == own.speed
            && point.step.to_bits() == own.step.to_bits()
    };
    found.points.iter().find(is)
}

fn statements(found: &StabilityResult) -> Vec<Statement> {
    let mut all = Vec::new();
    if let Some(point) = own_point(found) {
        let words = match (&point.answer, point.reason()) {
            (Err(_), words) => words,
            (Ok(_), words) if words.is_empty() => "accepted without warnings".into(),
            (Ok(_), words) => format!("accepted with warnings: {words}"),
        };
        all.push(Statement::tested("The scene as it stands is accepted", point.answer.is_ok(), words));
        all.extend(flutter(found, point));
    }
    let usable = found.limits.iter().find(|usable| usable.method == found.own.method);
    if let Some(usable) = usable {
        let within = usable.step().is_some_and(|step| found.own.step <= step);
        all.push(Statement::tested(
            "Its internal step does not exceed the largest accepted step",
            within,
            format!("step {} s, largest accepted step: {}", shown(found.own.step), usable.to_text()),
        ));
    }
    let count = |verdict: AnswerKind| found.points.iter().filter(|point| point.verdict() == verdict).count();
    let counts: Vec<String> =
        VERDICTS.iter().map(|verdict| format!("{} {}", count(*verdict), verdict.kind().label)).collect();
    all.push(Statement::remark(format!("Results at {} points", found.points.len()), counts.join(", ")));
    all
}

fn flutter(found: &StabilityResult, point: &StabilityPoint) -> Option<Statement> {
    let expected = "Sliding contact does not flutter at the friction coefficient of the scene";
    if let Some(why) = found.no_rates {
        return Some(Statement::remark(expected, format!("unknown: {why}")));
    }
    let Some(rates) = &point.rates else {
        return Some(Statement::remark(expected, "unknown: no friction, or too many modes for growth rates"));
    };
    let frequency = rates.frequency().map_or(String::new(), |hertz| format!(" at {hertz:.1} Hz"));
    let text = format!("growth rate {:.3e} 1/s{frequency}, closed nodes: {}", rates.physical.rate, rates.closed);
    Some(Statement::tested(expected, !rates.is_flutter(), text))
}

fn title(speed: Option<f64>) -> String {
    speed.map_or_else(String::new, |speed| format!("{} rad/s", short(speed)))
}

/// Returns the map, with the tables below it.
fn answers(found: &StabilityResult) -> StudyFigure {
    let (grid, count) = (&found.grid, found.grid.frictions.len());
    let of = |speed: usize, step: usize| {
        let places = count * grid.speeds.len();
        &found.points[step * places + speed * count..][..count]
    };
    let cell = |point: &StabilityPoint| Cell {
        kind: point.verdict() as usize,
        words: format!(
            "µ {}, h {} µs: {}",
            point.place.friction.map_or("-".into(), short),
            micro(point.step),
            if point.reason().is_empty() { "accepted".into() } else { point.reason() }
        ),
    };
    let at = |values: &[Option<f64>], own: Option<f64>| values.iter().position(|value| *value == own);
    let row = grid.steps.iter().rev().position(|step| step.to_bits() == found.own.step.to_bits());
    let panel = |(index, speed): (usize, &Option<f64>)| CellPanel {
        title: title(*speed),
        cells: (0..grid.steps.len()).rev().map(|step| of(index, step).iter().map(cell).collect()).collect(),
        framed: row.zip(at(&grid.frictions, found.own.friction)).filter(|_| *speed == found.own.speed),
    };
    let cells = Cells {
        x_label: "friction coefficient µ".into(),
        y_label: "h (µs)".into(),
        columns: grid.frictions.iter().map(|friction| friction.map_or("-".into(), short)).collect(),
        rows: grid.steps.iter().rev().map(|step| micro(*step)).collect(),
        kinds: VERDICTS.iter().map(|verdict| verdict.kind()).collect(),
        panels: grid.speeds.iter().enumerate().map(panel).collect(),
    };
    let svg = cells.to_svg();
    let html = format!("{svg}{}{}", limits_table(found).to_html(false), points_table(found).to_html(true));
    StudyFigure {
        name: "answers",
        caption: format!(
            "Results of {} with {}, one panel per speed.",
            found.scene.settings.name,
            method_name(found.own.method)
        ),
        picture: Picture { svg, html },
        sheet: sheet(found),
    }
}

const COLUMNS: [&str; 7] = [
    "speed (rad/s)",
    "friction",
    "internal step (s)",
    "result (0 accepted, 1 warnings, 2 flutter, 3 rejected)",
    "growth rate without time steps (1/s)",
    "growth rate with time steps (1/s)",
    "flutter frequency (Hz)",
];

/// Returns all points as a sheet; NaN if the scene has no such value, or if a rate cannot be determined.
fn sheet(found: &StabilityResult) -> Sheet {
    let mut sheet = Sheet::new(COLUMNS);
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    for point in &found.points {
        let growth = point.rates.as_ref().map(|rates| rates.growth);
        sheet.rows.push(vec![
            known(point.place.speed),
            known(point.place.friction),
            point.step,
            f64::from(point.verdict() as u8),
            known(point.rates.as_ref().map(|rates| rates.physical.rate)),
            known(growth.map(|growth| growth.stepped)),
            known(point.rates.as_ref().and_then(|rates| rates.frequency())),
        ]);
    }
    sheet
}

/// Returns the table cells of one point.
fn row(point: &StabilityPoint) -> Vec<String> {
    let growth = point.rates.as_ref().map(|rates| rates.growth);
    let rate = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.3e}"));
    let frequency = point.rates.as_ref().and_then(|rates| rates.frequency());
    vec![
        point.place.speed.map_or(String::new(), shown),
        point.place.friction.map_or(String::new(), short),
        format!("{:.4e}", point.step),
        point.verdict().kind().label,
        rate(point.rates.as_ref().map(|rates| rates.physical.rate)),
        rate(growth.map(|growth| growth.stepped)),
        frequency.map_or(String::new(), |hertz| format!("{hertz:.1}")),
        point.reason(),
    ]
}

const HEADINGS: [&str; 8] = [
    "speed (rad/s)",
    "friction",
    "internal step (s)",
    "result",
    "growth rate without time steps (1/s)",
    "growth rate with time steps (1/s)",
    "flutter frequency (Hz)",
    "message",
];

fn points_table(found: &StabilityResult) -> Table {
    let caption = format!("All {} results", found.points.len());
    Table { rows: found.points.iter().map(row).collect(), ..Table::new(caption, HEADINGS) }
}

/// Quotes text for a cell of a CSV file.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

fn csv(table: &Table) -> String {
    let line = |cells: &[String]| cells.iter().map(|cell| quoted(cell)).collect::<Vec<_>>().join(",") + "\n";
    std::iter::once(&table.columns).chain(&table.rows).map(|cells| line(cells)).collect()
}

fn answer_text(found: &StabilityResult) -> String {
    csv(&points_table(found))
}

fn limits_csv(found: &StabilityResult) -> String {
    csv(&limits_table(found))
}

fn limits_table(found: &StabilityResult) -> Table {
    let (friction, speed) = (or_none(found.own.friction), or_none(found.own.speed));
    let caption = format!(
        "Largest internal step that passes the checks at the start of a run, at the scene's friction coefficient \
         ({friction}) and speed ({speed} rad/s), to within 1 %; all shorter steps that were tried are accepted"
    );
    let mut table = Table::new(caption, ["scheme and solver", "largest step (s)", "why longer steps are rejected"]);
    for usable in &found.limits {
        let step = match &usable.sought {
            Sought::All(step) => format!("none rejected up to {step:.1e}"),
            Sought::Below(step, _) => format!("{step:.3e}"),
            Sought::None(_) => "none".into(),
        };
        table.rows.push(vec![method_name(usable.method), step, usable.why().to_owned()]);
    }
    table
}

/// Plots growth rates over friction at the scene's speed: of the equations, and of the steps.
fn growth(found: &StabilityResult) -> Result<Option<StudyFigure>> {
    let here: Vec<&StabilityPoint> = found.points.iter().filter(|point| point.place.speed == found.own.speed).collect();
    let rate = |point: &StabilityPoint, value: &dyn Fn(&super::Rates) -> f64| {
        Some((point.place.friction?, point.rates.as_ref().map(value)?))
    };
    let at = |step: f64, value: &dyn Fn(&super::Rates) -> f64| -> Vec<(f64, f64)> {
        here.iter()
            .filter(|point| point.step.to_bits() == step.to_bits())
            .filter_map(|point| rate(point, value))
            .collect()
    };
    let equations = at(found.own.step, &|rates| rates.physical.rate);
    if equations.len() < 2 {
        return Ok(None);
    }
    let mut series = vec![Series::line("without time discretisation", equations.clone())];
    let mut sheet =
        Sheet { columns: vec!["friction".into(), "growth rate without time steps (1/s)".into()], rows: Vec::new() };
    let mut columns = vec![equations];
    for step in &found.grid.steps {
        let points = at(*step, &|rates| rates.growth.stepped);
        series.push(Series::line(format!("h = {} µs", micro(*step)), points.clone()));
        sheet.columns.push(format!("growth rate with steps of {} s (1/s)", shown(*step)));
        columns.push(points);
    }
    for (index, (friction, _)) in columns[0].iter().enumerate() {
        let values = columns.iter().map(|column| column.get(index).map_or(f64::NAN, |point| point.1));
        sheet.rows.push([*friction].into_iter().chain(values).collect());
    }
    let plot = Plot { height: 320, marked: true, ..Plot::new("friction coefficient µ", "growth rate (1/s)", series) };
    Ok(Some(StudyFigure {
        name: "growth",
        caption: format!(
            "Growth rate of closed sliding contact at {}, for the set of closed nodes that grows fastest. A positive \
             rate without time discretisation (and without the mass of the contact nodes, where the model allows) \
             means flutter. The steps are those of {}, with the node mass of that scheme.",
            title(found.own.speed),
            found.own.method.0.name()
        ),
        picture: Picture::plot(&plot)?,
        sheet,
    }))
}

fn results(found: &StabilityResult) -> Value {
    let count = |verdict: AnswerKind| found.points.iter().filter(|point| point.verdict() == verdict).count();
    let point = |point: &StabilityPoint| {
        json!({
            "speed": point.place.speed, "friction": point.place.friction, "internal_step": point.step,
            "answer": point.verdict().name(),
            "warnings": point.answer.as_ref().ok(), "refusal": point.answer.as_ref().err(),
            "growth_of_equations": point.rates.as_ref().map(|rates| rates.physical.rate),
            "growth_of_steps": point.rates.as_ref().map(|rates| rates.growth.stepped),
            "flutter_frequency_hz": point.rates.as_ref().and_then(|rates| rates.frequency()),
        })
    };
    json!({
        "scene": found.name,
        "own": {
            "friction": found.own.friction, "speed": found.own.speed, "internal_step": found.own.step,
            "method": method_name(found.own.method),
        },
        "counts": VERDICTS.iter().map(|verdict| (verdict.name().to_owned(), json!(count(*verdict)))).collect::<serde_json::Map<_, _>>(),
        "points": found.points.iter().map(point).collect::<Vec<_>>(),
        "largest_steps": found.limits.iter().map(|usable| json!({
            "method": method_name(usable.method), "step": usable.step(), "refusal_beyond": usable.why(),
        })).collect::<Vec<_>>(),
    })
}
