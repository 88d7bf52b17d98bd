//! Error study: error against run time of every scheme, solver and step of tiprub on a scene, compared with fine reference runs that must agree.
//!
//! A [`case::ErrorCase`] is a scene in one or several sizes, a [`competitor::Competitor`] is a method that steps it. [`measure`] compares every
//! configuration with two references, and [`ranking`] finds the cheapest ones. Rejections and failures are rows like all others.
//! [`user_scene::UserScene`] turns any scene into a case.

pub mod case;
pub mod chart;
pub mod clock;
pub mod competitor;
pub mod measure;
pub mod ranking;
pub mod run;
pub mod scene;
pub mod sheets;
pub mod summary;
pub mod total;
mod total_page;
pub mod user_scene;
pub mod window;

use std::iter::zip;

use case::ErrorCase;
use chart::ErrorChart;
use competitor::{Competitor, EquationFamily};
use measure::{Measured, MeasuredRow};
use ranking::ErrorKind;
use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_figure::table::Table;
use tiprub_shell::{
    Result,
    console::Console,
    forecast::{Forecast, WorkPlan},
};

use super::{Picture, Statement, Study, StudyFigure};
use crate::{
    arguments::ErrorArguments,
    convergence::refine::{Again, FINEST_TIP, RomSource},
};

/// Cases of a study, each with its measurements.
pub type MeasuredCases = Vec<(Box<dyn ErrorCase>, Measured)>;

/// Largest accepted distance between the two references of a scene.
const MEET: f64 = 2e-3;

/// Runs the study of a user scene; `source` is the origin of the ROM of its master, if it is a known file.
///
/// # Errors
/// The scene cannot be read or stepped, a reference fails, or the source does not give the ROM of the scene.
pub fn study(arguments: &ErrorArguments, source: Option<&dyn RomSource>, console: &Console) -> Result<Study> {
    let case = user_scene::UserScene::new(arguments, console)?;
    let (quick, cache) = (arguments.common.quick, arguments.common.cache.cache());
    let (title, all) = (case.title().to_owned(), measure::count(&case));
    // Checked first, so that a model that cannot be reduced again is reported before the long work.
    let again = Again { source, cache: &cache, mesh: 1.0, finest_tip: FINEST_TIP, only: &[], quick, console };
    let prepared = total::prepare(&case, &again)?;
    let mut ledger = case.ledger();
    measure::plan(&case, 0, repetitions(quick), &mut ledger);
    if let Ok(prepared) = &prepared {
        prepared.plan(&case, quick, &mut ledger);
    }
    let forecast = Forecast::new(console, "Error against run time", ledger);
    let total = match prepared {
        Ok(prepared) => total::measure(&case, prepared, &again, &forecast)?,
        Err(why) => Err(why),
    };
    let summary = format!(
        "Every time scheme and contact solver on {}, with longer and shorter steps than those of the scene ({all} \
         runs), and models with other numbers of contact points, rows and modes, compared with {}.",
        arguments.scene,
        if total.as_ref().is_ok_and(|total| total.is_total()) { "a finer reference model" } else { "one reference" }
    );
    let (mut study, _) = study_cases(vec![Box::new(case)], &[], (quick, summary), &forecast)?;
    forecast.finish();
    match total {
        Err(why) => study
            .statements
            .push(Statement::remark(format!("{title}: the errors of modes, contact points and mesh are unknown"), why)),
        Ok(total) => {
            let mut statements = total.statements(&title);
            statements.append(&mut study.statements);
            study.statements = statements;
            let figure = total.figure(&title);
            if let Some((.., text)) = study.files.iter_mut().find(|(name, ..)| name == "tables.md") {
                text.extend_from_slice(format!("\n![{title}]({}.svg)\n", figure.name).as_bytes());
            }
            study.figures.push(figure);
            study.results[total.key()] = total.to_json();
            let of_steps = study.results["scenes"][0]["cheapest"].as_array().cloned().unwrap_or_default();
            let cheapest = total_page::cheapest_csv(&of_steps, &total);
            for (name, meaning, text) in [
                (
                    format!("{}.csv", total.key().replace('_', "-")),
                    format!("all settings with their {}", total.name()),
                    total.csv(),
                ),
                (
                    "cheapest.csv".into(),
                    format!("the cheapest settings by error of the steps and by {}", total.name()),
                    cheapest,
                ),
            ] {
                study.files.push((name, meaning, text.into_bytes()));
            }
        }
    }
    Ok(study)
}

/// Returns the number of timed runs of a configuration.
fn repetitions(quick: bool) -> usize {
    if quick { 1 } else { run::REPETITIONS }
}

/// Returns the planned work of a study of several cases; its rate is unknown.
pub fn planned(cases: &[Box<dyn ErrorCase>], smooth: &[&dyn ErrorCase], quick: bool) -> WorkPlan {
    let mut ledger = WorkPlan::new(0.0);
    for (number, case) in cases.iter().enumerate() {
        measure::plan(case.as_ref(), number, repetitions(quick), &mut ledger);
    }
    for (number, case) in (cases.len()..).zip(smooth) {
        measure::plan(*case, number, 1, &mut ledger);
    }
    ledger
}

/// Runs the study of several cases. Returns the study and the measurements of each case. The cases in `smooth`
/// contribute only orders of convergence.
///
/// # Errors
/// A reference fails.
pub fn study_cases(
    cases: Vec<Box<dyn ErrorCase>>,
    smooth: &[&dyn ErrorCase],
    (quick, summary): (bool, String),
    forecast: &Forecast,
) -> Result<(Study, MeasuredCases)> {
    let mut study = Study {
        name: "error",
        title: "Error against run time".into(),
        summary,
        facts: super::machine::facts(),
        statements: Vec::new(),
        figures: Vec::new(),
        results: Value::Null,
        files: Vec::new(),
    };
    let repetitions = repetitions(quick);
    let time = format!("{}, median of at least {repetitions} runs, one run at a time", clock::MEANING);
    study.facts.push(("time".into(), time));
    let mut measured = Vec::new();
    for (number, case) in cases.into_iter().enumerate() {
        let found = measure::measure(case.as_ref(), number, repetitions, forecast)?;
        measured.push((case, found));
    }
    let orders = orders(smooth, &measured, forecast)?;
    let mut text = guide_page(&study.facts);
    let mut results = Vec::new();
    for (case, found) in &measured {
        let tables = add(&mut study, case.as_ref(), found);
        text.push_str(&section(case.as_ref(), &tables));
        results.push(sheets::to_json(case.as_ref(), found));
    }
    if let Some(last) = study.figures.last_mut() {
        last.picture.html.push_str(&orders.to_html(false));
    }
    text.push_str(&format!("\n## Orders\n\n{}", orders.to_markdown()));
    study.files.push(("tables.md".into(), "pictures and tables as Markdown".into(), text.into_bytes()));
    study.results = json!({ "scenes": results, "quick": quick });
    Ok((study, measured))
}

/// Adds tables that compare all scenes.
pub fn add_summary(study: &mut Study, measured: &[(Box<dyn ErrorCase>, Measured)]) {
    let scenes: Vec<(&dyn ErrorCase, &Measured)> =
        measured.iter().map(|(case, found)| (case.as_ref(), found)).collect();
    let tables = [
        ("summary-steps.md", "cheapest settings for a given error of the steps", summary::of_steps(&scenes)),
        ("summary-total.md", "cheapest settings for a given total error", summary::in_total(&scenes)),
        ("summary-limits.md", "differences between the references", summary::limits(&scenes)),
    ];
    for (name, meaning, table) in tables {
        study.files.push((name.into(), meaning.into(), table.to_markdown().into_bytes()));
    }
}

/// Returns the head of the page of the guide.
fn guide_page(facts: &[(String, String)]) -> String {
    let facts: String = facts.iter().map(|(name, value)| format!("* {name}: {value}\n")).collect();
    format!("# Error against run time: pictures and tables\n\n{facts}")
}

/// Returns the section of a scene in that page.
fn section(case: &dyn ErrorCase, tables: &[Table]) -> String {
    let title = case.title();
    let drawn = if sheets::has_total(case) { 2 } else { 1 };
    let pictures: String =
        case.figures().iter().take(drawn).map(|figure| format!("![{title}]({figure}.svg)\n\n")).collect();
    // Captions on the page of all scenes begin with the name of the scene.
    let own = |table: &Table| {
        let caption =
            table.caption.strip_prefix(title).map_or(table.caption.as_str(), |rest| rest.trim_start_matches(": "));
        Table { caption: format!("**{caption}**"), ..table.clone() }.to_markdown()
    };
    format!("\n## {title}\n\n{pictures}{}", tables.iter().map(own).collect::<Vec<_>>().join("\n"))
}

/// Tabulates orders of convergence without changes of contact, and in the measured scenes.
fn orders(
    smooth: &[&dyn ErrorCase],
    measured: &[(Box<dyn ErrorCase>, Measured)],
    forecast: &Forecast,
) -> Result<Table> {
    let numbered = smooth.iter().zip(measured.len()..);
    let found =
        numbered.map(|(case, number)| measure::measure(*case, number, 1, forecast)).collect::<Result<Vec<_>>>()?;
    let mut all: Vec<(&dyn ErrorCase, &Measured)> = zip(smooth.iter().copied(), &found).collect();
    all.extend(measured.iter().map(|(case, found)| (case.as_ref(), found)));
    Ok(ranking::orders(&all))
}

/// Adds figures, statements and files of one scene; returns its tables.
fn add(study: &mut Study, case: &dyn ErrorCase, found: &Measured) -> Vec<Table> {
    let about = sheets::references(case, found);
    let mut all = vec![about.clone()];
    // With one size and no exact solution, both figures are the same.
    let of_steps = ErrorKind::of_steps(case);
    let kinds: &[ErrorKind] = if sheets::has_total(case) { &[of_steps, ErrorKind::Total] } else { &[of_steps] };
    for (&kind, name) in zip(kinds, case.figures()) {
        let (chart, sheet) = sheets::chart(case, found, kind);
        let (winners, costs) = (ranking::winners(case, found, kind), ranking::costs(case, found, kind));
        let mut html = chart.to_svg();
        html.push_str(&winners.to_html(false));
        html.push_str(&costs.to_html(false));
        if Some(&kind) == kinds.last() {
            html.push_str(&about.to_html(false));
            if let Some(statistics) = window::statistics(case) {
                html.push_str(&statistics.to_html(false));
                all.push(statistics);
            }
            html.push_str(&sheets::rows(case, found).to_html(true));
        }
        let picture = Picture { svg: chart.to_svg(), html };
        study.figures.push(StudyFigure { name, caption: caption(case, found, kind, &chart), picture, sheet });
        all.extend([winners, costs]);
    }
    study.statements.extend(statements(case, found));
    study.files.push((
        format!("{}.csv", case.name()),
        format!("all configurations of {}", case.title()),
        sheets::csv(case, found).into_bytes(),
    ));
    all
}

fn caption(case: &dyn ErrorCase, found: &Measured, kind: ErrorKind, chart: &ErrorChart) -> String {
    let standard = case.standard();
    let own = &found.references[standard];
    let size = case.sizes()[standard];
    let what = match kind {
        ErrorKind::OfTime | ErrorKind::OfOwn => format!(
            "{}: error of the steps alone with {size} {}: relative L2 error of the displacements against {} at h = \
             {:.2e} s. The second reference, {} at h = {:.2e} s ({}), differs by {:.1e}.",
            case.title(),
            case.size_name(),
            case.first().name(),
            case.interval() / f64::from(case.reference_divisions(standard).0),
            case.second().name(),
            case.interval() / f64::from(case.reference_divisions(standard).1),
            case.relation(),
            own.apart[0]
        ),
        ErrorKind::Total => {
            format!("{}: total error of the displacements, for all numbers of {}.", case.title(), case.size_name())
        }
    };
    let away = |family: EquationFamily, what: &str| {
        own.away(family)
            .map_or_else(String::new, |away| format!(" {what} converges to a solution that differs by {away:.1e}."))
    };
    let mut limits = away(case.tolerant().family(), "massless-boundary") + &away(EquationFamily::STICKING, "coulomb");
    if let Some(apart) = own.massless_apart {
        limits.push_str(&format!(
            " galerkin converges to the solution of massless-boundary: two fine runs differ by {apart:.1e}. Each \
             method is compared with the converged solution of the same model."
        ));
    }
    let refused = found.rows.iter().filter(|row| row.outcome.is_err()).count();
    let shown: usize = chart.all.iter().map(|each| each.points.len()).sum();
    format!(
        "{what}{} {} {shown} configurations are shown; {refused} configurations of this scene were rejected or failed \
         and are listed in the table of all runs.",
        if kind == ErrorKind::Total { "" } else { limits.as_str() },
        if kind == ErrorKind::Total { String::new() } else { case.description() }
    )
}

/// Returns the expectations of every scene.
fn statements(case: &dyn ErrorCase, found: &Measured) -> Vec<Statement> {
    let title = case.title();
    let lcp = Scheme::RECURRENCES.map(|scheme| Competitor::Core(scheme, Solver::Lcp));
    let ran = found.rows.iter().filter(|row| lcp.contains(&row.competitor));
    let ran: Vec<_> = ran.filter_map(|row| row.outcome.as_ref().ok()).collect();
    let deepest = ran.iter().map(|figures| figures.penetration).fold(0.0, f64::max);
    let least = ran.iter().map(|figures| figures.adhesion).fold(0.0, f64::min);
    let mut all = meeting(case, found);
    all.extend(massless(case, found));
    all.extend(limits(case, found));
    let takes_part = found.rows.iter().any(|row| lcp.contains(&row.competitor));
    all.extend(takes_part.then(|| {
        Statement {
            expected: format!("{title}: lcp has no penetration and no tensile force at any internal step of any run"),
            found: format!("largest penetration {deepest:.1e} m, smallest force {least:.1e} N in {} runs", ran.len()),
            // A tip is expected to penetrate a coating.
            holds: (!case.is_coated())
                .then(|| !ran.is_empty() && ran.iter().all(|one| one.penetration <= 0.0 && one.adhesion >= 0.0)),
        }
    }));
    all.extend(ranking::floor(case, found));
    all.extend(window::statement(case));
    all
}

/// Returns the statement that two independent references agree.
fn meeting(case: &dyn ErrorCase, found: &Measured) -> Vec<Statement> {
    let title = case.title();
    let (size, apart) = (case.sizes()[case.standard()], found.references[case.standard()].apart[0]);
    let Some((full, who)) = case.meeting() else {
        return vec![Statement::tested(
            format!("{title}: the two references agree to {MEET:e} (second reference: {})", case.relation()),
            apart < MEET,
            format!("displacements differ by {apart:.1e} with {size} {}", case.size_name()),
        )];
    };
    let truncation: Vec<String> = zip(case.sizes(), &found.truncation)
        .map(|(size, apart)| format!("{apart:.1e} with {size} {}", case.size_name()))
        .collect();
    vec![
        Statement::tested(
            format!("{title}: two references with independent stepping and contact code agree to {MEET:e}"),
            full < MEET,
            format!("displacements differ by {full:.1e}: {who}"),
        ),
        Statement::tested(
            format!("{title}: the error of tiprub falls as the number of {} grows", case.size_name()),
            found.truncation.len() > 1 && found.truncation.windows(2).all(|pair| pair[1] < pair[0]),
            truncation.join(", "),
        ),
    ]
}

/// Returns the statement that schemes without mass of the contact nodes tend to a common limit.
fn massless(case: &dyn ErrorCase, found: &Measured) -> Vec<Statement> {
    let (own, title) = (&found.references[case.standard()], case.title());
    let Some(away) = own.away(case.tolerant().family()).filter(|_| ErrorKind::of_steps(case) == ErrorKind::OfOwn)
    else {
        return Vec::new();
    };
    let between = Statement::remark(
        format!("{title}: converged solutions with and without mass of the contact nodes"),
        format!("displacements differ by {away:.1e}; this is a difference of the models, not an error of the steps"),
    );
    let witness = own.massless_apart.map(|apart| {
        Statement::tested(
            format!("{title}: massless-boundary with fine steps and galerkin with a fine tolerance agree to {MEET:e}"),
            apart < MEET,
            format!("displacements differ by {apart:.1e}"),
        )
    });
    std::iter::once(between).chain(witness).collect()
}

/// Result of one step of central differences.
struct Tried {
    size: usize,
    /// Internal step (s).
    step: f64,
    /// Result: it ran, was rejected for its stability, or failed otherwise.
    outcome: RunOutcome,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RunOutcome {
    Ran,
    /// ω_max·h ≥ 2.
    Unstable,
    Failed,
}

impl RunOutcome {
    fn of(row: &MeasuredRow) -> Self {
        match &row.outcome {
            Ok(_) => Self::Ran,
            Err(reason) if reason.contains("ω_max·h = ") => Self::Unstable,
            Err(_) => Self::Failed,
        }
    }
}

/// Returns whether steps were rejected, all for ω_max·h ≥ 2, and whether at every size some steps ran, all of them shorter than the rejected ones.
fn bounded(tried: &[Tried]) -> bool {
    let steps = |size: usize, outcome: RunOutcome| {
        tried.iter().filter(move |one| one.size == size && one.outcome == outcome).map(|one| one.step)
    };
    let parted = |size: usize| {
        let longest = steps(size, RunOutcome::Ran).fold(0.0, f64::max);
        longest > 0.0 && longest < steps(size, RunOutcome::Unstable).fold(f64::INFINITY, f64::min)
    };
    let has = |outcome: RunOutcome| tried.iter().any(|one| one.outcome == outcome);
    has(RunOutcome::Unstable) && !has(RunOutcome::Failed) && tried.iter().all(|one| parted(one.size))
}

/// Returns the longest step that ran and the shortest that did not, at each size.
fn bounds(case: &dyn ErrorCase, tried: &[Tried]) -> String {
    let of = |at: usize, size: usize| {
        let steps = |ran: bool| {
            let own = tried.iter().filter(move |one| one.size == at && (one.outcome == RunOutcome::Ran) == ran);
            own.map(|one| 1e6 * one.step)
        };
        let longest = steps(true).fold(0.0, f64::max);
        let shortest = steps(false).fold(f64::INFINITY, f64::min);
        let refused = if shortest.is_finite() { format!("{shortest:.3} µs rejected") } else { "none rejected".into() };
        format!("with {size} {}: {longest:.3} µs ran, {refused}", case.size_name())
    };
    case.sizes().into_iter().enumerate().map(|(at, size)| of(at, size)).collect::<Vec<_>>().join("; ")
}

/// Returns the steps that central differences reject, and the longest steps of modal-exact.
fn limits(case: &dyn ErrorCase, found: &Measured) -> Vec<Statement> {
    let own = |scheme: Scheme| {
        let competitor = Competitor::Core(scheme, Solver::Lcp);
        found.rows.iter().filter(move |row| row.competitor == competitor)
    };
    let standard = |row: &&MeasuredRow| row.size == case.standard();
    let longest = |scheme: Scheme| -> f64 {
        own(scheme).filter(standard).filter(|row| row.outcome.is_ok()).map(|row| row.step).fold(0.0, f64::max)
    };
    let (central, exact) = (longest(Scheme::PAPER), longest(Scheme::default()));
    let tried: Vec<Tried> =
        own(Scheme::PAPER).map(|row| Tried { size: row.size, step: row.step, outcome: RunOutcome::of(row) }).collect();
    if tried.is_empty() {
        return Vec::new();
    }
    vec![
        Statement {
            expected: format!(
                "{}: central differences reject steps only because of ω_max·h ≥ 2, and at every size all steps that \
                 run are shorter than those rejected",
                case.title()
            ),
            found: bounds(case, &tried),
            // If all steps run, they do not show the limit.
            holds: tried.iter().any(|one| one.outcome != RunOutcome::Ran).then(|| bounded(&tried)),
        },
        Statement::remark(
            format!("{}: longest step of modal-exact that ran", case.title()),
            format!("{:.3} µs, {:.1} times that of central differences", 1e6 * exact, exact / central),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::{RunOutcome, Tried, bounded};

    fn holds(tried: &[(usize, f64, RunOutcome)]) -> bool {
        let tried: Vec<Tried> = tried.iter().map(|&(size, step, outcome)| Tried { size, step, outcome }).collect();
        bounded(&tried)
    }

    #[test]
    fn step_limit_separates_rejected_from_successful_runs() {
        use RunOutcome::{Failed, Ran, Unstable};
        let tried = [(0, 4.0, Unstable), (0, 2.0, Ran), (1, 2.0, Unstable), (1, 1.0, Ran)];
        let with = |more: (usize, f64, RunOutcome)| [&tried[..], &[more]].concat();
        assert!(holds(&tried));
        assert!(holds(&with((2, 1.0, Ran))), "a size at which no step was long enough");
        assert!(!holds(&tried[..3]), "nothing ran at the second size");
        assert!(!holds(&[tried[1], tried[3]]), "nothing was refused");
        assert!(!holds(&with((1, 8.0, Ran))), "a longer step ran");
        assert!(!holds(&with((0, 1.0, Unstable))), "a shorter step was refused");
        assert!(!holds(&with((0, 8.0, Failed))), "a step failed for another reason");
        assert!(!holds(&[]), "nothing was tried");
    }
}
