//! What refining the standard scenes changes: rubs of rotor 37 and of the stage, with friction and without, over patches, meshes, modes and
//! steps; where each sequence goes, and the error of the scene as it ships.

use serde_json::json;
use tiprub_core::{
    Rom, Scene,
    settings::{SceneSettings, Shape},
};
use tiprub_figure::{
    plots::{Plot, Series},
    table::Table,
};
use tiprub_gallery::{
    builtin::{self, Other},
    rom_cache::RomCache,
    scene_source,
};
use tiprub_model::rotor37::Tip;
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Figure, Picture, Sheet, Statement, Study,
    convergence::{self, Asked, Found, Refined, limit::Limit, page},
};

use crate::cli::RefinementArguments;

/// Depth of the bumps around rotor 37: they intrude by 2·depth − 1 of the gap.
const LIGHT: f64 = 0.6;
const HEAVY: f64 = 1.0;
/// Friction coefficient of the scenes with friction.
const FRICTION: f64 = 0.15;
/// Patches of a blade of the stage, which ships with three nodes, and the mesh of its sector, so that the one that ships is the finest of four: to
/// reduce a finer one takes many minutes.
const STAGE: (usize, f64) = (5, core::f64::consts::FRAC_1_SQRT_2);

/// One scene of the study.
struct Standard {
    name: &'static str,
    title: &'static str,
    settings: SceneSettings,
    /// Patches and mesh of the structure that touches, instead of what the scene names.
    other: Option<(usize, f64)>,
}

fn standards() -> Result<Vec<Standard>> {
    let mut all = Vec::new();
    for (friction, depth, name, title) in [
        (0.0, LIGHT, "rotor37-light-smooth", "rotor 37, light rub, µ = 0"),
        (FRICTION, LIGHT, "rotor37-light", "rotor 37, light rub, µ = 0.15"),
        (0.0, HEAVY, "rotor37-heavy-smooth", "rotor 37, heavy rub, µ = 0"),
        (FRICTION, HEAVY, "rotor37-heavy", "rotor 37, heavy rub, µ = 0.15"),
    ] {
        let mut settings = scene_source::settings("builtin:rotor37")?;
        settings.contacts[0].friction = friction;
        settings.surfaces[0].shape = Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
        all.push(Standard { name, title, settings, other: None });
    }
    for (friction, name, title) in [(0.0, "stage-smooth", "stage, µ = 0"), (FRICTION, "stage", "stage, µ = 0.15")] {
        let mut settings = scene_source::settings("builtin:stage")?;
        settings.contacts[0].friction = friction;
        all.push(Standard { name, title, settings, other: Some(STAGE) });
    }
    Ok(all)
}

impl Standard {
    fn scene(&self, cache: &RomCache, console: &Console) -> Result<Scene> {
        let rom = |(index, structure): (usize, &tiprub_core::settings::StructureSettings)| -> Result<Rom> {
            let missing = || Failure::new(&structure.rom, "no such model", "");
            let name = tiprub_format::builtin_model(&self.settings, structure).ok_or_else(missing)?;
            let found = match self.other.filter(|_| index == 0) {
                Some((patches, mesh)) => {
                    let other = Other { modes: 1.0, tip: Tip::Patches(patches), mesh };
                    builtin::refined(&name, other, cache, console)
                }
                None => builtin::rom(&name, cache, console),
            };
            found.ok_or_else(missing)?
        };
        let roms = self.settings.structures.iter().enumerate().map(rom).collect::<Result<_>>()?;
        Ok(Scene { settings: self.settings.clone(), roms })
    }
}

/// What was found of a scene, or why it does not run.
struct Case {
    title: &'static str,
    name: &'static str,
    found: std::result::Result<Found, String>,
    seconds: f64,
}

/// The study.
///
/// # Errors
/// A model that cannot be reduced, a plot that cannot be drawn.
pub(crate) fn study(arguments: &RefinementArguments, console: &Console) -> Result<Study> {
    let cache = arguments.common.cache.cache();
    let quick = arguments.common.quick;
    let asked =
        |standard: &Standard| arguments.scenes.is_empty() || arguments.scenes.iter().any(|one| one == standard.name);
    let mut cases = Vec::new();
    for standard in standards()?.iter().filter(|standard| asked(standard)) {
        console.say(standard.title);
        let clock = std::time::Instant::now();
        let scene = standard.scene(&cache, console)?;
        let of = Asked {
            settings: &[],
            window: None,
            quick,
            threads: arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get),
            source: None,
            cache: cache.clone(),
            mesh: standard.other.map_or(1.0, |(_, mesh)| mesh),
        };
        let found = convergence::found(standard.name, &scene, &of, console).map_err(|failure| failure.to_string());
        let seconds = clock.elapsed().as_secs_f64();
        cases.push(Case { title: standard.title, name: standard.name, found, seconds });
    }
    if cases.is_empty() {
        let names = standards()?.iter().map(|standard| standard.name).collect::<Vec<_>>().join(", ");
        return Err(Failure::usage("--scene", "no such scene", format!("Give some of {names}")));
    }
    let mut figures = pictures(&cases)?;
    if let Some(last) = figures.last_mut() {
        for case in &cases {
            last.picture.html.push_str(&tables(case).iter().map(|table| table.to_html(false)).collect::<String>());
        }
    }
    Ok(Study {
        name: "refinement",
        title: "What refining the standard scenes changes".into(),
        summary: "Patches, mesh, modes and steps of rubs of rotor 37 and of the stage are refined one at a time; the errors are those against the \
                  limit that the three finest levels show."
            .into(),
        facts: tiprub_study::machine::facts(),
        statements: cases.iter().flat_map(statements).collect(),
        figures,
        results: json!(cases.iter().map(|case| json!({
            "scene": case.name, "seconds": case.seconds,
            "found": case.found.as_ref().ok().map(page::results), "refused": case.found.as_ref().err(),
        })).collect::<Vec<_>>()),
        files: vec![("tables.md".into(), "all tables as Markdown".into(), markdown(&cases).into_bytes())],
    })
}

fn statements(case: &Case) -> Vec<Statement> {
    match &case.found {
        Err(why) => vec![Statement::remark(case.title, format!("does not run, after {:.0} s: {why}", case.seconds))],
        Ok(found) => {
            let all = page::statements(found).into_iter();
            all.map(|one| Statement { expected: format!("{}: {}", case.title, one.expected), ..one }).collect()
        }
    }
}

const HEADINGS: [&str; 8] = [
    "refined",
    "value",
    "displacements",
    "impulse (N·s)",
    "error",
    "friction work or strain energy (J)",
    "error",
    "step (µs)",
];

/// "1.2 %"; in brackets how far it is from the finest level, where no limit is read.
fn percent(error: Option<f64>, to_finest: Option<f64>) -> String {
    let told = |error: f64| match 100.0 * error {
        small if small < 0.095 => format!("{small:.3} %"),
        other => format!("{other:.2} %"),
    };
    match (error, to_finest) {
        (Some(error), _) => told(error),
        (None, Some(other)) if other > 0.0 => format!("({})", told(other)),
        (None, _) => "-".into(),
    }
}

/// Of a scene without friction its strain energy, else the work of friction: which quantity, counted with the displacements.
fn energy(refined: &Refined) -> usize {
    if refined.ran().iter().any(|(_, run)| run.friction_work > 0.0) { 2 } else { 4 }
}

/// The levels of a direction with their errors, and its limit.
fn rows(refined: &Refined) -> Vec<Vec<String>> {
    let energy = energy(refined);
    let direction = &refined.direction;
    let title = direction.title.clone();
    let value =
        |value: f64| if direction.unit == "s" { format!("{:.3} µs", 1e6 * value) } else { format!("{value:.0}") };
    let levels = direction.levels.iter().zip(&refined.runs).map(|(level, run)| {
        let own = if level.own { " (the scene)" } else { "" };
        let step = 1e6 * level.scene.settings.experiment.communication_step / f64::from(level.division);
        let mut row = vec![title.clone(), format!("{}{own}", value(level.value))];
        match run {
            Ok(run) => {
                let (errors, drawn, quantities) = (refined.errors(run), page::drawn(refined, run), run.quantities());
                let error = |index: usize| percent(errors[index], drawn[index]);
                row.extend([error(0), format!("{:.5e}", quantities[0]), error(1)]);
                row.extend([format!("{:.5e}", quantities[energy - 1]), error(energy)]);
            }
            Err(why) => row.extend(
                std::iter::once(format!("refused: {}", first_words(why))).chain(["", "", "", ""].map(String::from)),
            ),
        }
        row.push(format!("{step:.3}"));
        row
    });
    let limits = refined.limits();
    let finest = refined.ran().last().map(|(_, run)| run.quantities());
    let limit = |index: usize| match limits[index].zip(finest) {
        Some((limit, finest)) => format!("{:.5e}", finest[index] + limit.rest),
        None => "not to be read".into(),
    };
    let order =
        |limit: Option<Limit>| limit.map_or("not to be read".into(), |limit| format!("order {:.1}", limit.order));
    let short = |limit: Option<Limit>| limit.map_or("-".into(), |limit| format!("order {:.1}", limit.order));
    let last = vec![
        title.clone(),
        "limit".into(),
        order(refined.rest()),
        limit(0),
        short(limits[0]),
        limit(energy - 1),
        short(limits[energy - 1]),
        String::new(),
    ];
    levels.chain((direction.levels.len() > 2).then_some(last)).collect()
}

/// The beginning of a reason: it stands whole in the statements.
fn first_words(why: &str) -> String {
    let why = why.trim_start_matches("refused: ");
    why.split_whitespace().take(18).collect::<Vec<_>>().join(" ")
}

fn tables(case: &Case) -> Vec<Table> {
    let Ok(found) = &case.found else { return Vec::new() };
    let caption =
        format!("{}: {}, {:.2} ms, {:.0} s for all", case.title, found.method, 1e3 * found.window.0, case.seconds);
    let directions = found.refined.iter().filter(|refined| refined.direction.levels.len() > 1);
    vec![Table { rows: directions.flat_map(rows).collect(), ..Table::new(caption, HEADINGS) }]
}

/// Error of the scene as it stands: a row per scene, a column per direction.
fn summary(cases: &[Case]) -> Table {
    let mut table = Table::new(
        "Error of the scene as it stands, of the displacements (relative L2)",
        ["scene", "steps", "modes", "patches", "mesh"],
    );
    for case in cases {
        let Ok(found) = &case.found else { continue };
        let of = |name: &str| {
            let own = found.refined.iter().find(|refined| refined.direction.name == name);
            percent(own.and_then(|refined| refined.own_errors()?[0]), None)
        };
        let cells = ["step", "modes", "nodes", "mesh"].map(of);
        table.rows.push(std::iter::once(case.title.to_owned()).chain(cells).collect());
    }
    table
}

fn markdown(cases: &[Case]) -> String {
    let all = std::iter::once(summary(cases)).chain(cases.iter().flat_map(tables));
    all.map(|table| table.to_markdown() + "\n").collect()
}

/// A picture per direction, a curve per scene: errors of the displacements.
fn pictures(cases: &[Case]) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for (direction, name, label) in [
        ("nodes", "refinement-patches", "contact patches (-)"),
        ("modes", "refinement-modes", "modes (-)"),
        ("mesh", "refinement-mesh", "mesh nodes (-)"),
        ("step", "refinement-step", "internal step (s)"),
    ] {
        let (mut series, mut sheet) =
            (Vec::new(), Sheet::new(["scene", "value", "displacements", "impulse", "work or energy"]));
        for (case, number) in cases.iter().zip(0_u32..) {
            let Ok(found) = &case.found else { continue };
            let Some(refined) = found.refined.iter().find(|refined| refined.direction.name == direction) else {
                continue;
            };
            let mut points = Vec::new();
            for (level, run) in refined.ran() {
                let errors = page::drawn(refined, run);
                let known = |index: usize| errors[index].unwrap_or(f64::NAN);
                points.push((level.value, known(0)));
                sheet.rows.push(vec![f64::from(number), level.value, known(0), known(1), known(energy(refined))]);
            }
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let how = if refined.rest().is_some() { "" } else { " (to the finest)" };
            series.push(Series::line(format!("{}{how}", case.title), points));
        }
        let plot = Plot {
            height: 300,
            logarithmic: true,
            logarithmic_x: true,
            marked: true,
            ..Plot::new(label, "error of the displacements (L2)", series)
        };
        let caption = format!(
            "Error of the displacements against the limit: {label}; numbers of the scenes from 0 in the order of the legend."
        );
        figures.push(Figure { name, caption, picture: Picture::plot(&plot)?, sheet });
    }
    Ok(figures)
}
