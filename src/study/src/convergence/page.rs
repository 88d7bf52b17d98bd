//! Presents the changes between refinements as plots, tables and files.

use serde_json::{Value, json};
use tiprub_cosim::shown;
use tiprub_figure::{
    plots::{Plot, Series},
    table::Table,
};
use tiprub_shell::Result;

use super::{
    ConvergenceResult, Refined,
    march::{QUANTITIES, RunSummary},
    refine::{OF_CLEARANCE, RefinementDirection, SECONDS, is_adaptive},
};
use crate::{Picture, Sheet, Statement, Study, StudyFigure, estimate};

/// Changes by the next refinement up to this size count as small.
const SMALL: f64 = 0.05;

const HOW_TO_READ: &str = "One setting is refined at a time, and all others stay as in the scene. A change is the difference between a run \
     and the next finer run in the same direction, relative to the larger value. Changes are given for the \
     displacements of all contact nodes at all communication points (L2, without rigid-body motion of free bodies), \
     the normal impulse and the friction work over the window, the largest normal force averaged over a communication \
     step, and the mean strain energy. If the changes shrink from level to level, the limit is extrapolated from the \
     three finest levels (Richardson, with the observed order, at most two). The limit gives the error of every level. \
     If the changes do not shrink, the scene is not converged in that direction or its contact is chaotic, and no \
     limit is given. Refine the direction with the largest change at the scene's setting first. Forces in individual \
     internal steps are not compared, because the force of an impact grows as the step shrinks.";

/// Builds the study from its results.
///
/// # Errors
/// A plot cannot be drawn.
pub fn study(found: &ConvergenceResult) -> Result<Study> {
    let figures = found.refined.iter().filter(|refined| !refined.direction.levels.is_empty());
    let [name, scene] = &found.names;
    let (window, samples) = found.window;
    Ok(Study {
        name: "convergence",
        title: format!("Convergence of {scene}"),
        summary: HOW_TO_READ.into(),
        facts: vec![
            ("scene".into(), format!("{name}, {scene}")),
            ("scheme and solver".into(), found.method.clone()),
            ("window (s)".into(), format!("{window:.4e}, {samples} communication steps")),
        ],
        statements: statements(found),
        figures: figures.map(figure).collect::<Result<_>>()?,
        results: results(found),
        files: [
            ("levels.csv", "all levels of all directions in one table", csv(found)),
            ("limits.csv", "limit of every direction, and the error of the scene", limits_csv(found)),
        ]
        .map(|(name, meaning, text)| (name.into(), meaning.into(), text.into_bytes()))
        .into(),
    })
}

fn value(refined: &Refined, value: f64) -> String {
    match refined.direction.unit {
        SECONDS => format!("{value:.4e} s"),
        OF_CLEARANCE => format!("{value:.1e}"),
        _ => format!("{value:.0}"),
    }
}

/// Returns the names of the compared quantities: displacements and others.
pub fn compared() -> impl Iterator<Item = &'static str> {
    std::iter::once("displacements").chain(QUANTITIES.iter().map(|(name, _)| *name))
}

/// Formats changes, such as "displacements 1.2 %, impulse ...".
fn changes_text(changes: &[Option<f64>; 5]) -> String {
    let known =
        compared().zip(changes).filter_map(|(name, change)| Some(format!("{name} {:.2} %", 100.0 * (*change)?)));
    known.collect::<Vec<_>>().join(", ")
}

/// Returns the error of the scene in a direction, as far as the levels show it.
fn error(refined: &Refined) -> Option<Statement> {
    if refined.direction.levels.len() < 2 {
        return None;
    }
    let own = refined.ran().into_iter().find(|(level, _)| level.own)?.1;
    let (errors, finest) = (refined.errors(own), refined.ran().last()?.1);
    let to_finest = own.changes(finest);
    let unread: [Option<f64>; 5] =
        std::array::from_fn(|index| if errors[index].is_none() { to_finest[index] } else { None });
    let parts =
        [("", changes_text(&errors)), ("no limit found; difference from the finest level: ", changes_text(&unread))];
    let found = parts.iter().filter(|(_, text)| !text.is_empty()).map(|(what, text)| format!("{what}{text}"));
    let found = found.collect::<Vec<_>>().join("; ");
    Some(Statement::remark(format!("Error of the scene due to {}", title(refined)), found))
}

/// Returns the results in words.
pub fn statements(found: &ConvergenceResult) -> Vec<Statement> {
    let mut all: Vec<Statement> = found.refined.iter().filter_map(error).collect();
    all.extend(found.refined.iter().filter_map(small));
    all.extend(worst(found));
    all.extend(found.refined.iter().filter_map(lock_up));
    all.extend(scope(found));
    for refined in found.refined.iter().filter(|refined| !refined.direction.missing.is_empty()) {
        let title = &refined.direction.title;
        all.push(Statement::remark(format!("Not refined: {title}"), refined.direction.missing.clone()));
    }
    for refined in &found.refined {
        for (level, run) in refined.direction.levels.iter().zip(&refined.runs) {
            if let Err(why) = run {
                let expected = format!("{}, {}: rejected", refined.direction.title, value(refined, level.value));
                all.push(Statement::remark(expected, why.clone()));
            }
        }
    }
    all
}

/// Returns the lock-up friction of the closed tip for every level, if there is one.
fn lock_up(refined: &Refined) -> Option<Statement> {
    let levels = refined.direction.levels.iter().zip(&refined.lock_up);
    let known = levels.map(|(level, least)| {
        let friction = least.map_or("none".to_owned(), |least| format!("{least:.3}"));
        format!("{} with {}", friction, value(refined, level.value))
    });
    let found = known.collect::<Vec<_>>().join(", ");
    let some = refined.lock_up.iter().any(Option::is_some);
    some.then(|| {
        Statement::remark(
            format!("Friction coefficient µ* at which the closed tip locks up, by {}", title(refined)),
            found,
        )
    })
}

/// Returns the title, such as "modes of rotor", with the step if it differs from the scene's.
fn title(refined: &Refined) -> String {
    let RefinementDirection { title, shorter, .. } = &refined.direction;
    match shorter {
        None => title.clone(),
        Some(factor) => format!(
            "{title} (at 1/{factor} of the scene's step, because the full step is too long for one of the levels)"
        ),
    }
}

fn small(refined: &Refined) -> Option<Statement> {
    let (changes, onwards) = refined.at_own()?;
    let most = changes.iter().flatten().fold(0.0, |most: f64, change| most.max(*change));
    let which = if onwards { "the next refinement changes" } else { "the last refinement changed" };
    Some(Statement::tested(
        format!("{}: {which} no quantity by more than {} %", title(refined), 100.0 * SMALL),
        most <= SMALL,
        changes_text(&changes),
    ))
}

/// Returns the direction to refine first.
fn worst(found: &ConvergenceResult) -> Option<Statement> {
    let most = |refined: &Refined| {
        let (changes, _) = refined.at_own()?;
        Some(changes.iter().flatten().fold(0.0, |most: f64, change| most.max(*change)))
    };
    let all = found.refined.iter().filter_map(|refined| Some((most(refined)?, &refined.direction.title)));
    let (change, title) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Statement::remark(
        "Direction with the largest change at the scene's setting, among the refined directions",
        format!("{title}: {:.2} %", 100.0 * change),
    ))
}

/// Returns the titles of the directions with a level finer than the scene that ran, of those with coarser ones only, and of the others.
fn directions(found: &ConvergenceResult) -> [Vec<&str>; 3] {
    let which = |refined: &Refined| {
        let ran = refined.ran();
        let own = ran.iter().position(|(level, _)| level.own);
        match own {
            Some(own) if own + 1 < ran.len() => 0,
            Some(own) if own > 0 => 1,
            _ => 2,
        }
    };
    [0, 1, 2].map(|kind| {
        found
            .refined
            .iter()
            .filter(|refined| which(refined) == kind)
            .map(|refined| refined.direction.title.as_str())
            .collect()
    })
}

/// Returns what was refined and what was not, and the errors that the ROM carries.
fn scope(found: &ConvergenceResult) -> Vec<Statement> {
    let [finer, coarser, not] = directions(found).map(|titles| titles.join(", "));
    let parts = [("finer levels: ", finer), ("coarser levels only: ", coarser), ("not refined: ", not)];
    let parts: Vec<String> = parts
        .into_iter()
        .filter(|(_, titles)| !titles.is_empty())
        .map(|(what, titles)| format!("{what}{titles}"))
        .collect();
    let refined = Statement::remark("Refined directions (other errors are not included)", parts.join("; "));
    let reported = estimate::rom_errors_text(&found.of_rom);
    let of_rom = reported.map(|reported| Statement::remark("Errors stored in the ROM of the scene", reported));
    std::iter::once(refined).chain(of_rom).collect()
}

const HEADINGS: [&str; 13] = [
    "direction",
    "value (step in s or count)",
    "setting of the scene",
    "internal step (s)",
    "impulse (N·s)",
    "friction work (J)",
    "peak force (N)",
    "strain energy (J)",
    "change of displacements (L2)",
    "change of impulse",
    "change of friction work",
    "change of peak force",
    "change of strain energy",
];

/// Formats the internal step of a level (s); empty with adaptive steps.
fn step(level: &super::RefinementLevel) -> String {
    if is_adaptive(&level.scene) {
        return String::new();
    }
    let length = level.scene.settings.experiment.communication_step;
    format!("{:.4e}", length / f64::from(level.division))
}

/// Returns the rows of one direction; the row of a rejected level states the reason instead of numbers.
fn rows(refined: &Refined) -> Vec<Vec<String>> {
    let mut changes = refined.changes().into_iter();
    let levels = refined.direction.levels.iter().zip(&refined.runs);
    let row = |(level, run): (&super::RefinementLevel, &std::result::Result<super::RunSummary, String>)| {
        let own = if level.own { "yes" } else { "" };
        let mut cells = vec![refined.direction.title.clone(), shown(level.value), own.into(), step(level)];
        match run {
            Ok(run) => {
                cells.extend(run.quantities().map(|value| format!("{value:.6e}")));
                let changes = changes.next().unwrap_or([None; 5]);
                cells.extend(changes.map(|change| change.map_or(String::new(), |change| format!("{change:.3e}"))));
            }
            Err(_) => cells.extend(["rejected"; 4].into_iter().chain([""; 5]).map(str::to_owned)),
        }
        cells
    };
    levels.map(row).collect()
}

fn table(refined: &Refined) -> Table {
    let caption = format!("{}: all levels, and the changes to the next finer level", title(refined));
    Table { rows: rows(refined), ..Table::new(caption, HEADINGS) }
}

const LIMIT_HEADINGS: [&str; 6] =
    ["direction", "quantity", "order (at most 2)", "limit", "value of the scene", "error of the scene"];

/// Returns the limits of a direction: one row for displacements and one for every quantity; cells without an extrapolation are empty.
pub fn limit_rows(refined: &Refined) -> Vec<Vec<String>> {
    let ran = refined.ran();
    let (Some((_, own)), Some((_, finest))) = (ran.iter().find(|(level, _)| level.own), ran.last()) else {
        return Vec::new();
    };
    let (errors, quantities) = (refined.errors(own), own.quantities());
    let title = &refined.direction.title;
    let error = |index: usize| errors[index].map_or("no limit".into(), |error| format!("{error:.3e}"));
    let order = |limit: Option<super::limit::ConvergedLimit>| {
        limit.map_or(String::new(), |limit| format!("{:.2}", limit.order))
    };
    let first =
        vec![title.clone(), "displacements".into(), order(refined.rest()), String::new(), String::new(), error(0)];
    let limits = refined.limits().into_iter().enumerate().map(|(index, limit)| {
        let to = limit.map_or(String::new(), |limit| format!("{:.6e}", finest.quantities()[index] + limit.rest));
        let (name, unit) = QUANTITIES[index];
        let name = format!("{name} ({unit})");
        vec![title.clone(), name, order(limit), to, format!("{:.6e}", quantities[index]), error(index + 1)]
    });
    std::iter::once(first).chain(limits).collect()
}

fn limit_table(refined: &Refined) -> Table {
    let caption = format!("{}: limits extrapolated from the three finest levels", title(refined));
    Table { rows: limit_rows(refined), ..Table::new(caption, LIMIT_HEADINGS) }
}

fn limits_csv(found: &ConvergenceResult) -> String {
    let head = LIMIT_HEADINGS.join(",") + "\n";
    let lines = found.refined.iter().flat_map(limit_rows).map(|cells| cells.join(",") + "\n");
    [head].into_iter().chain(lines).collect()
}

fn csv(found: &ConvergenceResult) -> String {
    let head = HEADINGS.join(",") + "\n";
    let lines = found.refined.iter().flat_map(rows).map(|cells| cells.join(",") + "\n");
    [head].into_iter().chain(lines).collect()
}

/// Returns the errors of a run for a plot; without a limit, the distance from the finest level.
pub fn drawn(refined: &Refined, run: &RunSummary) -> [Option<f64>; 5] {
    let finest = refined.ran().last().map(|(_, finest)| run.changes(finest)).unwrap_or([None; 5]);
    let errors = refined.errors(run);
    std::array::from_fn(|index| errors[index].or(finest[index]))
}

/// Plots the errors of all levels on logarithmic axes.
///
/// # Errors
/// The plot cannot be drawn.
pub fn picture(refined: &Refined) -> Result<Picture> {
    let (direction, ran) = (&refined.direction, refined.ran());
    let read = refined.own_errors().unwrap_or([None; 5]);
    let curve = |(index, name): (usize, &str)| {
        let points = ran.iter().filter_map(|(level, run)| Some((level.value, drawn(refined, run)[index]?)));
        let mut points: Vec<(f64, f64)> = points.collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let how = if read[index].is_some() { "" } else { ", from finest level" };
        Series::line(format!("{name}{how}"), points)
    };
    let x_label = match direction.unit {
        SECONDS => format!("{} (s)", direction.title),
        OF_CLEARANCE => format!("{} (fraction of the clearance)", direction.title),
        unit if direction.title.starts_with(unit) => format!("{} (-)", direction.title),
        unit => format!("{unit}: {} (-)", direction.title),
    };
    let series = compared().enumerate().map(curve).collect();
    Picture::plot(&Plot {
        height: 300,
        logarithmic: true,
        logarithmic_x: true,
        marked: true,
        ..Plot::new(x_label, "relative error", series)
    })
}

fn figure(refined: &Refined) -> Result<StudyFigure> {
    let (ran, changes, direction) = (refined.ran(), refined.changes(), &refined.direction);
    let picture = picture(refined)?;
    let tables = format!("{}{}", limit_table(refined).to_html(false), table(refined).to_html(false));
    let mut sheet = Sheet { columns: vec!["value".into(), "setting of the scene (1 yes)".into()], rows: Vec::new() };
    sheet.columns.extend(QUANTITIES.map(|(name, unit)| format!("{name} ({unit})")));
    for what in ["change of", "error of"] {
        sheet.columns.extend(compared().map(|name| format!("{what} {name}")));
    }
    for (index, (level, run)) in ran.iter().enumerate() {
        let known = |values: [Option<f64>; 5]| values.map(|value| value.unwrap_or(f64::NAN));
        let changes = known(changes.get(index).copied().unwrap_or([None; 5]));
        let own = f64::from(u8::from(level.own));
        let start = [level.value, own].into_iter().chain(run.quantities());
        sheet.rows.push(start.chain(changes).chain(known(refined.errors(run))).collect());
    }
    let own =
        direction.levels.iter().find(|level| level.own).map_or(String::new(), |level| value(refined, level.value));
    let caption = format!(
        "{}: error of every run against the extrapolated limit, or its difference from the finest run if there is no \
         limit; the scene has {own}.",
        title(refined)
    );
    let html = format!("{}{tables}", picture.html);
    Ok(StudyFigure { name: direction.name, caption, picture: Picture { html, ..picture }, sheet })
}

/// Returns the results as JSON.
pub fn results(found: &ConvergenceResult) -> Value {
    let level = |refined: &Refined| {
        let mut changes = refined.changes().into_iter();
        let levels = refined.direction.levels.iter().zip(&refined.runs).zip(&refined.lock_up);
        type ReachedErrors = std::result::Result<RunSummary, String>;
        let each = |((level, run), lock_up): ((&super::RefinementLevel, &ReachedErrors), &Option<f64>)| match run {
            Ok(run) => json!({
                "value": level.value, "own": level.own, "locks_up_above": lock_up, "impulse": run.impulse, "friction_work": run.friction_work,
                "peak_force": run.peak_force, "strain_energy": run.strain_energy,
                "changes_to_next": changes.next().map(|changes| json!({
                    "displacements": changes[0], "impulse": changes[1], "friction_work": changes[2], "peak_force": changes[3],
                    "strain_energy": changes[4],
                })),
            }),
            Err(why) => json!({ "value": level.value, "own": level.own, "refused": why }),
        };
        levels.map(each).collect::<Vec<_>>()
    };
    let direction = |refined: &Refined| {
        json!({
            "direction": refined.direction.title, "name": refined.direction.name, "step_divided_by": refined.direction.shorter.unwrap_or(1), "unit": refined.direction.unit, "levels": level(refined),
            "error": refined.own_errors().map(|errors| json!({
                "displacements": errors[0], "impulse": errors[1], "friction_work": errors[2], "peak_force": errors[3], "strain_energy": errors[4],
            })),
            "not_refined": (!refined.direction.missing.is_empty()).then_some(&refined.direction.missing),
        })
    };
    let [finer, coarser, not_refined] = self::directions(found);
    json!({
        "refined": finer, "coarser_only": coarser, "not_refined": not_refined, "estimates_of_rom": estimate::json_of(&found.of_rom),
        "scene": found.names[0],
        "window": shown(found.window.0),
        "directions": found.refined.iter().map(direction).collect::<Vec<_>>(),
    })
}
