//! Changes from one refinement to the next as plots, tables and files.

use serde_json::{Value, json};
use tiprub_core::shown;
use tiprub_figure::{
    plots::{Plot, Series},
    table::Table,
};
use tiprub_shell::Result;

use super::{Found, Refined, march::QUANTITIES, refine::Direction};
use crate::{Figure, Picture, Sheet, Statement, Study};

/// Largest change by the next refinement that is called small.
const SMALL: f64 = 0.05;

const HOW_TO_READ: &str = "One thing is refined at a time, all else is the scene's own. A change is how far a run is from the next finer one of \
    the same direction, relative to the larger of both: of the displacements of all contact nodes at all communication points (L2, without flight), the normal \
    impulse and the work of friction over the window, the largest normal force averaged over a communication step, and the mean strain energy. \
    Where changes shrink from level to level the last one bounds roughly what is left; where they do not, the scene is not converged in that \
    direction, or its contact is chaotic. The direction with the largest change at the scene's own setting is the one to refine first. Forces of \
    single internal steps are not compared: an impact of a node gives the larger a force the shorter the step.";

/// The study from everything that was found.
///
/// # Errors
/// A plot cannot be drawn.
pub fn study(found: &Found) -> Result<Study> {
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
        files: vec![(
            "levels.csv".into(),
            "every level of every direction in one table".into(),
            csv(found).into_bytes(),
        )],
    })
}

fn value(refined: &Refined, value: f64) -> String {
    if refined.direction.unit == "s" { format!("{value:.4e} s") } else { format!("{value:.0}") }
}

/// "displacements 1.2 %, impulse ...".
fn told(changes: &[Option<f64>; 5]) -> String {
    let names = std::iter::once("displacements").chain(QUANTITIES.iter().map(|(name, _)| *name));
    let known = names.zip(changes).filter_map(|(name, change)| Some(format!("{name} {:.2} %", 100.0 * (*change)?)));
    known.collect::<Vec<_>>().join(", ")
}

fn statements(found: &Found) -> Vec<Statement> {
    let mut all: Vec<Statement> = found.refined.iter().filter_map(small).collect();
    all.extend(worst(found));
    for refined in found.refined.iter().filter(|refined| !refined.direction.missing.is_empty()) {
        let title = &refined.direction.title;
        all.push(Statement::remark(format!("Not refined: {title}"), refined.direction.missing.clone()));
    }
    for refined in &found.refined {
        for (level, run) in refined.direction.levels.iter().zip(&refined.runs) {
            if let Err(why) = run {
                let expected = format!("{} {} is refused", refined.direction.title, value(refined, level.value));
                all.push(Statement::remark(expected, why.clone()));
            }
        }
    }
    all
}

/// "modes of rotor", and with which step where it is not the scene's.
fn title(refined: &Refined) -> String {
    let Direction { title, shorter, .. } = &refined.direction;
    match shorter {
        None => title.clone(),
        Some(factor) => format!("{title} (all at 1/{factor} of the scene's step, at which one is refused)"),
    }
}

fn small(refined: &Refined) -> Option<Statement> {
    let (changes, onwards) = refined.at_own()?;
    let most = changes.iter().flatten().fold(0.0, |most: f64, change| most.max(*change));
    let which = if onwards { "the next refinement changes" } else { "the last refinement changed" };
    Some(Statement::tested(
        format!("{}: {which} nothing by more than {} %", title(refined), 100.0 * SMALL),
        most <= SMALL,
        told(&changes),
    ))
}

/// What to refine first.
fn worst(found: &Found) -> Option<Statement> {
    let most = |refined: &Refined| {
        let (changes, _) = refined.at_own()?;
        Some(changes.iter().flatten().fold(0.0, |most: f64, change| most.max(*change)))
    };
    let all = found.refined.iter().filter_map(|refined| Some((most(refined)?, &refined.direction.title)));
    let (change, title) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Statement::remark(
        "The direction that changes most at the scene's own setting",
        format!("{title}: {:.2} %", 100.0 * change),
    ))
}

const HEADINGS: [&str; 13] = [
    "direction",
    "value (s of steps, else how many)",
    "scene's own",
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

/// The internal step of a level (s).
fn step(level: &super::Level) -> String {
    let length = level.scene.settings.experiment.communication_step;
    format!("{:.4e}", length / f64::from(level.division))
}

/// Rows of one direction; a refused level says so in place of its numbers.
fn rows(refined: &Refined) -> Vec<Vec<String>> {
    let mut changes = refined.changes().into_iter();
    let levels = refined.direction.levels.iter().zip(&refined.runs);
    let row = |(level, run): (&super::Level, &std::result::Result<super::Marched, String>)| {
        let own = if level.own { "yes" } else { "" };
        let mut cells = vec![refined.direction.title.clone(), shown(level.value), own.into(), step(level)];
        match run {
            Ok(run) => {
                cells.extend(run.quantities().map(|value| format!("{value:.6e}")));
                let changes = changes.next().unwrap_or([None; 5]);
                cells.extend(changes.map(|change| change.map_or(String::new(), |change| format!("{change:.3e}"))));
            }
            Err(_) => cells.extend(["refused"; 4].into_iter().chain([""; 5]).map(str::to_owned)),
        }
        cells
    };
    levels.map(row).collect()
}

fn table(refined: &Refined) -> Table {
    let caption = format!("{}: every level, and the change to the next finer one", title(refined));
    Table { rows: rows(refined), ..Table::new(caption, HEADINGS) }
}

fn csv(found: &Found) -> String {
    let head = HEADINGS.join(",") + "\n";
    let lines = found.refined.iter().flat_map(rows).map(|cells| cells.join(",") + "\n");
    [head].into_iter().chain(lines).collect()
}

fn figure(refined: &Refined) -> Result<Figure> {
    let (ran, changes) = (refined.ran(), refined.changes());
    let direction = &refined.direction;
    let names = std::iter::once("displacements (L2)").chain(QUANTITIES.iter().map(|(name, _)| *name));
    let curve = |quantity: usize| {
        let points = ran.iter().zip(&changes);
        let mut points: Vec<(f64, f64)> =
            points.filter_map(|((level, _), changes)| Some((level.value, changes[quantity]?))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let series = names.enumerate().map(|(quantity, name)| Series::line(name, curve(quantity))).collect();
    let x_label = format!("{} ({})", direction.title, if direction.unit == "s" { "s" } else { "-" });
    let plot = Plot {
        height: 300,
        logarithmic: true,
        logarithmic_x: true,
        marked: true,
        ..Plot::new(x_label, "relative change to the next finer", series)
    };
    let picture = Picture::plot(&plot)?;
    let html = format!("{}{}", picture.html, table(refined).to_html(false));
    let mut sheet = Sheet::new([
        "value",
        "scene's own (1 yes)",
        "impulse (N·s)",
        "friction work (J)",
        "peak force (N)",
        "strain energy (J)",
        "change of displacements (L2)",
        "change of impulse",
        "change of friction work",
        "change of peak force",
        "change of strain energy",
    ]);
    for (index, (level, run)) in ran.iter().enumerate() {
        let changes = changes.get(index).copied().unwrap_or([None; 5]).map(|change| change.unwrap_or(f64::NAN));
        let own = f64::from(u8::from(level.own));
        sheet.rows.push([level.value, own].into_iter().chain(run.quantities()).chain(changes).collect());
    }
    let own =
        direction.levels.iter().find(|level| level.own).map_or(String::new(), |level| value(refined, level.value));
    let caption = format!("{}: change of a run to the next finer one; the scene has {own}.", title(refined));
    Ok(Figure { name: direction.name, caption, picture: Picture { html, ..picture }, sheet })
}

fn results(found: &Found) -> Value {
    let level = |refined: &Refined| {
        let mut changes = refined.changes().into_iter();
        let levels = refined.direction.levels.iter().zip(&refined.runs);
        let each = |(level, run): (&super::Level, &std::result::Result<super::Marched, String>)| match run {
            Ok(run) => json!({
                "value": level.value, "own": level.own, "impulse": run.impulse, "friction_work": run.friction_work,
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
            "direction": refined.direction.title, "step_divided_by": refined.direction.shorter.unwrap_or(1), "unit": refined.direction.unit, "levels": level(refined),
            "not_refined": (!refined.direction.missing.is_empty()).then_some(&refined.direction.missing),
        })
    };
    json!({
        "scene": found.names[0],
        "window": shown(found.window.0),
        "directions": found.refined.iter().map(direction).collect::<Vec<_>>(),
    })
}
