//! Effects of refining the standard scenes: rubs of rotor 37 and of the stage, with and without friction, over patches,
//! meshes, modes and steps; the limit of each sequence, and the error of the scene as built in.

use serde_json::json;
use tiprub_core::scene::settings::{SceneSettings, Shape};
use tiprub_core::{Rom, Scene};
use tiprub_figure::{
    plots::{Plot, Series},
    table::Table,
};
use tiprub_gallery::{
    builtin::{self, ModelVariant},
    rom_cache::RomCache,
    scene_source,
};
use tiprub_model::rotor37::TipContact;
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Picture, Sheet, Statement, Study, StudyFigure,
    convergence::{
        self, ConvergenceRequest, ConvergenceResult, Refined,
        limit::ConvergedLimit,
        page,
        refine::{self, RefinementDirection},
    },
};

use crate::cli::RefinementArguments;

/// Depth of the bumps around rotor 37, which intrude by 2·depth − 1 of the gap.
const LIGHT: f64 = 0.6;
const HEAVY: f64 = 1.0;
/// Tolerance of the scenes with adaptive steps: small compared with the other errors.
const TOLERANCE: f64 = 1e-3;
/// Friction coefficient of the scenes with friction.
const FRICTION: f64 = 0.15;
/// Families of scenes that share a picture.
const FAMILIES: [&str; 2] = ["rotor37", "stage"];
/// Family of scenes without a picture.
const APART: &str = "apart";
/// Tips of a blade of the stage: two rows of patches, and three nodes.
const STAGE_TIPS: [(TipContact, &str, &str); 2] =
    [(TipContact::Rows([9, 2]), "stage", "9 × 2 patches"), (TipContact::Nodes(3), "stage-nodes", "3 contact nodes")];
/// Friction coefficients of the stage: none, below the lock-up friction of its tip, and above.
const STAGE_FRICTIONS: [(f64, &str); 3] = [(0.0, "-smooth"), (0.05, ""), (FRICTION, "-digging")];
/// Mesh factor of its sector, so that the built-in mesh is the finest of four: reducing a finer one takes many minutes.
const STAGE_MESH: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Number of spaces between contact points of the finest tip of the stage, as a multiple of the scene: its mesh
/// provides points for 17 patches.
const STAGE_FINEST: usize = 2;

/// One scene of the study.
struct Standard {
    name: String,
    title: String,
    /// Picture of the scene: `rotor37` or `stage`, or none.
    family: &'static str,
    settings: SceneSettings,
    /// Tip and mesh of the touching structure, instead of those of the scene.
    other: Option<(TipContact, f64)>,
    /// Number of spaces between contact points of the finest tip, as a multiple of the scene.
    finest_tip: usize,
}

fn standards() -> Result<Vec<Standard>> {
    let mut all = Vec::new();
    for (friction, depth, name, title) in [
        (0.0, LIGHT, "rotor37-light-smooth", "rotor 37, light rub, µ = 0"),
        (FRICTION, LIGHT, "rotor37-light", "rotor 37, light rub, µ = 0.15"),
        (0.0, HEAVY, "rotor37-heavy-smooth", "rotor 37, heavy rub, µ = 0"),
        (FRICTION, HEAVY, "rotor37-heavy", "rotor 37, heavy rub, µ = 0.15"),
        (FRICTION, LIGHT, "rotor37-one-row", "rotor 37, one row, light rub, µ = 0.15"),
    ] {
        let one_row = name.ends_with("one-row");
        let mut settings = scene_source::settings(if one_row { "builtin:rotor37-one-row" } else { "builtin:rotor37" })?;
        if !one_row {
            settings.time.tolerance = Some(TOLERANCE);
        }
        settings.contacts[0].friction = friction;
        settings.surfaces[0].shape = Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
        let (name, title, family) = (name.into(), title.into(), if one_row { APART } else { FAMILIES[0] });
        all.push(Standard { name, title, family, settings, other: None, finest_tip: refine::FINEST_TIP });
    }
    for (tip, name, touching) in STAGE_TIPS {
        for (friction, ending) in STAGE_FRICTIONS {
            let scene = if matches!(tip, TipContact::Nodes(_)) { "builtin:stage-nodes" } else { "builtin:stage" };
            let mut settings = scene_source::settings(scene)?;
            settings.contacts[0].friction = friction;
            all.push(Standard {
                name: format!("{name}{ending}"),
                title: format!("stage, {touching}, µ = {friction}"),
                family: FAMILIES[1],
                settings,
                other: Some((tip, STAGE_MESH)),
                finest_tip: STAGE_FINEST,
            });
        }
    }
    Ok(all)
}

impl Standard {
    fn scene(&self, cache: &RomCache, console: &Console) -> Result<Scene> {
        let rom = |(index, structure): (usize, &tiprub_core::scene::settings::StructureSettings)| -> Result<Rom> {
            let missing = || Failure::new(&structure.rom, "unknown built-in model", "");
            let name = tiprub_format::builtin_model(structure).ok_or_else(missing)?;
            let found = match self.other.filter(|_| index == 0) {
                Some((tip, mesh)) => {
                    let other = ModelVariant { modes: 1.0, tip, mesh };
                    builtin::refined(name, other, cache, console)
                }
                None => builtin::rom(name, cache, console),
            };
            found.ok_or_else(missing)?
        };
        let roms = self.settings.structures.iter().enumerate().map(rom).collect::<Result<_>>()?;
        Ok(Scene { settings: self.settings.clone(), roms })
    }
}

/// Results of a scene, or the reason why it does not run.
struct RefinementCase {
    title: String,
    name: String,
    family: &'static str,
    found: std::result::Result<ConvergenceResult, String>,
    seconds: f64,
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a plot that cannot be drawn.
pub(crate) fn study(arguments: &RefinementArguments, console: &Console) -> Result<Study> {
    let cache = arguments.common.cache.cache();
    let quick = arguments.common.quick;
    let asked = |standard: &Standard| arguments.scenes.is_empty() || arguments.scenes.contains(&standard.name);
    let mut cases = Vec::new();
    for standard in standards()?.iter().filter(|standard| asked(standard)) {
        console.print_progress(&standard.title);
        let clock = std::time::Instant::now();
        let scene = standard.scene(&cache, console)?;
        let of = ConvergenceRequest {
            settings: &[],
            window: None,
            quick,
            threads: arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get),
            source: None,
            cache: cache.clone(),
            mesh: standard.other.map_or(1.0, |(_, mesh)| mesh),
            finest_tip: standard.finest_tip,
            only: &arguments.directions,
        };
        let found = convergence::found(&standard.name, &scene, &of, console).map_err(|failure| failure.to_string());
        let seconds = clock.elapsed().as_secs_f64();
        let (title, name) = (standard.title.clone(), standard.name.clone());
        cases.push(RefinementCase { title, name, family: standard.family, found, seconds });
    }
    if cases.is_empty() {
        let names = standards()?.into_iter().map(|standard| standard.name).collect::<Vec<_>>().join(", ");
        return Err(Failure::usage("--scene", "unknown scene", format!("Choose from {names}")));
    }
    let mut figures = pictures(&cases)?;
    if let Some(last) = figures.last_mut() {
        for case in &cases {
            last.picture.html.push_str(&tables(case).iter().map(|table| table.to_html(false)).collect::<String>());
        }
    }
    Ok(Study {
        name: "refinement",
        title: "Convergence of the standard scenes".into(),
        summary: "Patches, mesh, modes and steps of rubs of rotor 37 and of the stage are refined one at a time. \
                  Errors are relative to the limit extrapolated from the three finest levels."
            .into(),
        facts: tiprub_study::machine::facts(),
        statements: cases.iter().flat_map(statements).collect(),
        figures,
        results: json!(
            cases
                .iter()
                .map(|case| json!({
                    "scene": case.name, "seconds": case.seconds,
                    "found": case.found.as_ref().ok().map(page::results), "refused": case.found.as_ref().err(),
                }))
                .collect::<Vec<_>>()
        ),
        files: vec![("tables.md".into(), "all tables in Markdown".into(), markdown(&cases).into_bytes())],
    })
}

fn statements(case: &RefinementCase) -> Vec<Statement> {
    match &case.found {
        Err(why) => {
            vec![Statement::remark(&case.title, format!("does not run (ended after {:.0} s): {why}", case.seconds))]
        }
        Ok(found) => {
            let all = page::statements(found).into_iter();
            all.map(|one| Statement { expected: format!("{}: {}", case.title, one.expected), ..one }).collect()
        }
    }
}

/// Headings of a table; the sixth is the one of [energy].
const HEADINGS: [&str; 7] =
    ["refined", "value", "displacements", "impulse (N·s)", "error", "friction work or strain energy (J)", "error"];

/// Returns "1.2 %"; in brackets the distance from the finest level if no limit could be determined.
fn percent(error: Option<f64>, to_finest: Option<f64>) -> String {
    let reported = |error: f64| match 100.0 * error {
        small if small < 0.095 => format!("{small:.3} %"),
        other => format!("{other:.2} %"),
    };
    match (error, to_finest) {
        (Some(error), _) => reported(error),
        (None, Some(other)) if other > 0.0 => format!("({})", reported(other)),
        (None, _) => "-".into(),
    }
}

/// Returns the energy that is compared, as an index after the displacements: strain energy of a scene without friction,
/// otherwise the work of friction.
fn energy(refined: &Refined) -> usize {
    if refined.ran().iter().any(|(_, run)| run.friction_work > 0.0) { 2 } else { 4 }
}

/// Returns a short name of a direction.
fn short(direction: &RefinementDirection) -> &str {
    match direction.name {
        refine::STEP if direction.unit == refine::OF_CLEARANCE => "tolerance",
        refine::NODES => direction.unit,
        "modes-2" => "modes of the casing",
        name => name,
    }
}

/// Returns the levels of a direction with their errors, and its limit.
fn rows(refined: &Refined) -> Vec<Vec<String>> {
    let energy = energy(refined);
    let direction = &refined.direction;
    let title = match direction.shorter {
        Some(factor) => format!("{} (1/{factor} of the step)", short(direction)),
        None => short(direction).to_owned(),
    };
    let value = |value: f64| match direction.unit {
        refine::SECONDS => format!("{:.3} µs", 1e6 * value),
        refine::OF_CLEARANCE => format!("{value:.0e}"),
        _ => format!("{value:.0}"),
    };
    let levels = direction.levels.iter().zip(&refined.runs).map(|(level, run)| {
        let own = if level.own { " (the scene)" } else { "" };
        let mut row = vec![title.clone(), format!("{}{own}", value(level.value))];
        match run {
            Ok(run) => {
                let (errors, drawn, quantities) = (refined.errors(run), page::drawn(refined, run), run.quantities());
                let error = |index: usize| percent(errors[index], drawn[index]);
                row.extend([error(0), format!("{:.5e}", quantities[0]), error(1)]);
                row.extend([format!("{:.5e}", quantities[energy - 1]), error(energy)]);
            }
            Err(why) => row.extend(
                std::iter::once(format!("rejected: {}", first_words(why))).chain(["", "", "", ""].map(String::from)),
            ),
        }
        row
    });
    let limits = refined.limits();
    let finest = refined.ran().last().map(|(_, run)| run.quantities());
    let limit = |index: usize| match limits[index].zip(finest) {
        Some((limit, finest)) => format!("{:.5e}", finest[index] + limit.rest),
        None => "undetermined".into(),
    };
    let order = |limit: Option<ConvergedLimit>| {
        limit.map_or("undetermined".into(), |limit| format!("order {:.1}", limit.order))
    };
    let short = |limit: Option<ConvergedLimit>| limit.map_or("-".into(), |limit| format!("order {:.1}", limit.order));
    let last = vec![
        title.clone(),
        "limit".into(),
        order(refined.rest()),
        limit(0),
        short(limits[0]),
        limit(energy - 1),
        short(limits[energy - 1]),
    ];
    levels.chain((direction.levels.len() > 2).then_some(last)).collect()
}

/// Returns the beginning of a reason, which the statements contain in full.
fn first_words(why: &str) -> String {
    why.split_whitespace().take(18).collect::<Vec<_>>().join(" ")
}

fn tables(case: &RefinementCase) -> Vec<Table> {
    let Ok(found) = &case.found else { return Vec::new() };
    let caption =
        format!("{}: {}, {:.2} ms, {:.0} s for all runs", case.title, found.method, 1e3 * found.window.0, case.seconds);
    let directions = found.refined.iter().filter(|refined| refined.direction.levels.len() > 1);
    let mut headings = HEADINGS;
    headings[5] = if found.refined.iter().any(|refined| energy(refined) == 2) {
        "friction work (J)"
    } else {
        "strain energy (J)"
    };
    vec![Table { rows: directions.flat_map(rows).collect(), ..Table::new(caption, headings) }]
}

/// Returns the table of the errors of the unrefined scenes: a row per scene, a column per direction.
fn summary(cases: &[RefinementCase]) -> Table {
    let mut table = Table::new(
        "Error of the displacements of the unrefined scene (relative L2)",
        ["scene", "steps", "modes", "patches", "rows", "mesh"],
    );
    for case in cases {
        let Ok(found) = &case.found else { continue };
        let of = |name: &str| {
            let own = found.refined.iter().find(|refined| refined.direction.name == name);
            percent(own.and_then(|refined| refined.own_errors()?[0]), None)
        };
        let cells = [refine::STEP, "modes", refine::NODES, refine::ROWS, refine::MESH].map(of);
        table.rows.push(std::iter::once(case.title.clone()).chain(cells).collect());
    }
    table
}

fn markdown(cases: &[RefinementCase]) -> String {
    let all = std::iter::once(summary(cases)).chain(cases.iter().flat_map(tables));
    all.map(|table| table.to_markdown() + "\n").collect()
}

/// Quantities in the pictures of a direction, in the order of their names.
const DRAWN: [&str; 3] = ["displacements (L2)", "impulse", "friction work (strain energy if µ = 0)"];
/// Family, direction, label of its values, names of the pictures.
const PICTURES: [(&str, &str, &str, [&str; 3]); 10] = [
    (
        FAMILIES[0],
        refine::NODES,
        "contact patches along the chord (-)",
        ["refinement-patches", "refinement-patches-impulse", "refinement-patches-work"],
    ),
    (FAMILIES[0], "modes", "modes (-)", ["refinement-modes", "refinement-modes-impulse", "refinement-modes-work"]),
    (
        FAMILIES[0],
        refine::MESH,
        "mesh nodes (-)",
        ["refinement-mesh", "refinement-mesh-impulse", "refinement-mesh-work"],
    ),
    (
        FAMILIES[0],
        refine::STEP,
        "tolerance (relative to the clearance)",
        ["refinement-step", "refinement-step-impulse", "refinement-step-work"],
    ),
    (
        FAMILIES[0],
        refine::ROWS,
        "rows of contact patches across the thickness (-)",
        ["refinement-rows", "refinement-rows-impulse", "refinement-rows-work"],
    ),
    (
        FAMILIES[1],
        refine::ROWS,
        "rows of contact patches across the thickness (-)",
        ["refinement-stage-rows", "refinement-stage-rows-impulse", "refinement-stage-rows-work"],
    ),
    (
        FAMILIES[1],
        refine::NODES,
        "contact patches or nodes (-)",
        ["refinement-stage-patches", "refinement-stage-patches-impulse", "refinement-stage-patches-work"],
    ),
    (
        FAMILIES[1],
        "modes",
        "mode families of the disk (-)",
        ["refinement-stage-modes", "refinement-stage-modes-impulse", "refinement-stage-modes-work"],
    ),
    (
        FAMILIES[1],
        refine::MESH,
        "mesh nodes (-)",
        ["refinement-stage-mesh", "refinement-stage-mesh-impulse", "refinement-stage-mesh-work"],
    ),
    (
        FAMILIES[1],
        refine::STEP,
        "internal step (s)",
        ["refinement-stage-step", "refinement-stage-step-impulse", "refinement-stage-step-work"],
    ),
];

/// Returns the pictures per family of scenes and direction, with a curve per scene.
fn pictures(cases: &[RefinementCase]) -> Result<Vec<StudyFigure>> {
    let mut figures = Vec::new();
    for (family, direction, label, names) in PICTURES {
        let of_family: Vec<&RefinementCase> = cases.iter().filter(|case| case.family == family).collect();
        for (number, name) in names.into_iter().enumerate() {
            figures.extend(picture(&of_family, (direction, label), number, name)?);
        }
    }
    Ok(figures)
}

/// Draws the errors of one quantity over the levels of a direction; `None` if no scene has them.
fn picture(
    cases: &[&RefinementCase],
    (direction, label): (&str, &str),
    number: usize,
    name: &'static str,
) -> Result<Option<StudyFigure>> {
    let (mut series, mut sheet) = (Vec::new(), Sheet::new(["scene", "value", "error"]));
    let quantity = DRAWN[number];
    for (case, scene) in cases.iter().zip(0_u32..) {
        let Ok(found) = &case.found else { continue };
        let Some(refined) = found.refined.iter().find(|refined| refined.direction.name == direction) else { continue };
        let index = if number == 2 { energy(refined) } else { number };
        let known = |run| page::drawn(refined, run)[index].unwrap_or(f64::NAN);
        let mut points: Vec<_> = refined.ran().into_iter().map(|(level, run)| (level.value, known(run))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        sheet.rows.extend(points.iter().map(|(value, error)| vec![f64::from(scene), *value, *error]));
        let read = refined.own_errors().is_some_and(|errors| errors[index].is_some());
        let how = if read { "" } else { " (relative to the finest level)" };
        series.push(Series::line(format!("{}{how}", case.title), points));
    }
    if sheet.rows.is_empty() {
        return Ok(None);
    }
    let plot = Plot {
        height: 300,
        logarithmic: true,
        logarithmic_x: true,
        marked: true,
        ..Plot::new(label, format!("error of {quantity}"), series)
    };
    let caption = format!(
        "Error of {quantity} relative to the limit, against {label}. Scenes are numbered from 0 in the order \
                 of the legend."
    );
    Ok(Some(StudyFigure { name, caption, picture: Picture::plot(&plot)?, sheet }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refines_the_built_in_stage_with_patches_and_nodes() {
        let all = standards().unwrap();
        let of = |name: &str| all.iter().find(|standard| standard.name == name).unwrap();
        let friction = |name: &str| of(name).settings.contacts[0].friction.to_bits();
        for (names, tip) in [
            (["stage-smooth", "stage", "stage-digging"], builtin::stage().1.tip),
            (["stage-nodes-smooth", "stage-nodes", "stage-nodes-digging"], builtin::stage_nodes(false).1.tip),
        ] {
            assert!(names.iter().all(|name| of(name).other.unwrap().0 == tip), "{names:?}");
        }
        let shipped = |name: &str| scene_source::settings(name).unwrap().contacts[0].friction.to_bits();
        assert_eq!(
            [friction("stage"), friction("stage-nodes-digging")],
            ["builtin:stage", "builtin:stage-nodes"].map(shipped)
        );
        let names: std::collections::BTreeSet<&str> = PICTURES.iter().flat_map(|(.., names)| *names).collect();
        assert_eq!(names.len(), 3 * PICTURES.len(), "a picture is written over another");
        assert!(all.iter().all(|standard| FAMILIES.contains(&standard.family) || standard.family == APART));
        // The built-in scene has two rows, and the other one is compared with it.
        let rows = |name: &str| of(name).settings.structures[0].rom.clone();
        assert_eq!(["rotor37-light", "rotor37-one-row"].map(rows), ["builtin:rotor37", "builtin:rotor37-one-row"]);
    }
}
