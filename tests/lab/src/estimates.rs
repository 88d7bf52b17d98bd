//! Estimates of what steps, modes and patches leave, against the truth: rubs of rotor 37, each refined far in one direction.

use serde_json::{Value, json};
use tiprub_core::{Rom, Scene};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::{reduction, scene_source};
use tiprub_model::{
    Rotor37Options,
    rotor37::{MeshCounts, Tip},
};
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Figure, Picture, Sheet, Statement, Study,
    arguments::StudyCommon,
    convergence::march::{Marched, march},
    estimate::{self, Estimate},
};

/// Rubs of one model: elements of the mesh, modes, and depths of the bumps, friction coefficients and speeds (rad/s), each with each.
struct Group {
    mesh: [usize; 3],
    modes: usize,
    depths: &'static [f64],
    frictions: &'static [f64],
    speeds: &'static [f64],
}

/// The first group is the one that the bounds of [`estimate`] were chosen with, the second is not.
const GROUPS: [Group; 2] = [
    Group {
        mesh: [16, 1, 16],
        modes: 40,
        depths: &[0.55, 0.6, 0.7, 0.85],
        frictions: &[0.0, 0.15],
        speeds: &[1500.0, 1800.0, 2000.0],
    },
    Group {
        mesh: [12, 2, 20],
        modes: 60,
        depths: &[0.53, 0.65, 0.8, 1.0],
        frictions: &[0.05, 0.1],
        speeds: &[1300.0, 1700.0, 2200.0],
    },
];
/// Communication step (s), internal steps in it, and length of the runs (s).
const INTERVAL: f64 = 4e-6;
const DIVISION: u32 = 8;
const LENGTH: f64 = 5e-3;
const QUICK_LENGTH: f64 = 2e-3;
/// Own patches, and what stands for the truth.
const PATCHES: usize = 9;
const TRUE_MODES: usize = 200;
const TRUE_PATCHES: usize = 17;
const TRUE_DIVISION: u32 = 64;
/// An estimate is right where it is within this factor of the truth.
const FACTOR: f64 = 3.0;
/// Errors below this are as good as none: 1e-4 of displacements is beyond what anybody asks of a rub.
const NONE: f64 = 1e-4;
const DIRECTIONS: [&str; 3] = ["steps", "modes", "patches"];

/// What was estimated of the displacements, and what is true.
struct Compared {
    scene: usize,
    direction: usize,
    estimate: Option<f64>,
    truth: Option<f64>,
}

/// Scenes around the own model, the finer ones behind: modes, patches.
struct Scenes {
    names: Vec<String>,
    own: Vec<Scene>,
    modes: Vec<Scene>,
    patches: Vec<Scene>,
}

fn scenes(quick: bool, console: &Console) -> Result<Scenes> {
    let mut found = Scenes { names: Vec::new(), own: Vec::new(), modes: Vec::new(), patches: Vec::new() };
    let base = scene_source::settings("builtin:rotor37")?;
    for (group, number) in GROUPS.iter().zip(1..) {
        let roms = roms(group, console)?;
        let all = group.depths.iter().flat_map(|depth| group.frictions.iter().map(move |friction| (*depth, *friction)));
        let all = all.flat_map(|(depth, friction)| group.speeds.iter().map(move |speed| (depth, friction, *speed)));
        for (depth, friction, speed) in all.take(if quick { 1 } else { usize::MAX }) {
            let mut settings = base.clone();
            settings.surfaces[0].shape = tiprub_core::settings::Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
            (settings.contacts[0].friction, settings.structures[0].speed) = (friction, speed);
            settings.experiment.communication_step = INTERVAL;
            settings.time.step = INTERVAL / f64::from(DIVISION);
            found.names.push(format!("group {number}, depth {depth}, µ = {friction}, {speed} rad/s"));
            let [own, modes, patches] =
                roms.each_ref().map(|rom| Scene { settings: settings.clone(), roms: vec![rom.clone()] });
            found.own.push(own);
            found.modes.push(modes);
            found.patches.push(patches);
        }
    }
    Ok(found)
}

/// The own model of a group, with more modes, and with more patches.
fn roms(group: &Group, console: &Console) -> Result<[Rom; 3]> {
    let [chord, thickness, span] = group.mesh;
    let rom = |modes: usize, patches: usize| {
        let mesh = MeshCounts { chord, thickness, span };
        let options = Rotor37Options { mesh, tip: Tip::Patches(patches), modes, ..Rotor37Options::default() };
        reduction::rotor37(&options, console).map(|found| found.rom)
    };
    Ok([rom(group.modes, PATCHES)?, rom(TRUE_MODES, PATCHES)?, rom(group.modes, TRUE_PATCHES)?])
}

fn run(scene: &Scene, division: u32, samples: usize) -> Result<Marched> {
    let mut scene = scene.clone();
    scene.settings.time.step = INTERVAL / f64::from(division);
    march(&scene, &[], division, samples).map_err(|why| Failure::new(&scene.settings.name, why, ""))
}

/// Of one scene in all directions.
fn compared(scenes: &Scenes, scene: usize, samples: usize) -> Result<Vec<Compared>> {
    let quiet = Console::new(true, false);
    let estimates = estimate::estimates(&scenes.own[scene], &[], samples, &quiet)?;
    let own = run(&scenes.own[scene], DIVISION, samples)?;
    let truths = [
        run(&scenes.own[scene], TRUE_DIVISION, samples),
        run(&scenes.modes[scene], DIVISION, samples),
        run(&scenes.patches[scene], DIVISION, samples),
    ];
    let of = |(direction, truth): (usize, Result<Marched>)| {
        let estimate = estimates.iter().find(|one: &&Estimate| one.direction == DIRECTIONS[direction]);
        Compared {
            scene,
            direction,
            estimate: estimate.and_then(|one| one.left.clone().ok()),
            truth: truth.ok().and_then(|truth| own.changes(&truth)[0]),
        }
    };
    Ok(truths.into_iter().enumerate().map(of).collect())
}

fn statement(all: &[Compared], direction: usize) -> Statement {
    let compared = all.iter().filter(|one| one.direction == direction && one.truth.is_some());
    let given: Vec<(f64, f64)> = compared.clone().filter_map(|one| one.estimate.zip(one.truth)).collect();
    let within = |(a, b): &&(f64, f64)| a.max(*b).max(NONE) <= FACTOR * a.min(*b).max(NONE);
    let right = given.iter().filter(within).count();
    Statement::tested(
        format!("{}: nine of ten estimates are within a factor of {FACTOR}", DIRECTIONS[direction]),
        !given.is_empty() && 10 * right >= 9 * given.len(),
        format!("{right} of {}; {} are unknown", given.len(), compared.count() - given.len()),
    )
}

fn figure(all: &[Compared]) -> Result<Figure> {
    let logarithm = |value: f64| value.max(NONE).log10();
    let series = DIRECTIONS.iter().enumerate().map(|(direction, name)| {
        let own = all.iter().filter(|one| one.direction == direction);
        let points = own.filter_map(|one| Some((logarithm(one.truth?), logarithm(one.estimate?))));
        Series::line(*name, points.collect())
    });
    let plot = Plot { marked: true, ..Plot::new("log10 of the true error", "log10 of the estimate", series.collect()) };
    let mut sheet = Sheet::new(["scene", "direction (0 steps, 1 modes, 2 patches)", "estimate", "truth"]);
    for one in all {
        let [estimate, truth] = [one.estimate, one.truth].map(|value| value.unwrap_or(f64::NAN));
        sheet.rows.push(vec![one.scene as f64, one.direction as f64, estimate, truth]);
    }
    Ok(Figure {
        name: "estimates",
        caption: "Estimated against true relative error of the displacements of watched points.".into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// The study.
///
/// # Errors
/// A model that cannot be reduced, a run of the own model that fails, a plot that cannot be drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let scenes = scenes(arguments.quick, console)?;
    let length = if arguments.quick { QUICK_LENGTH } else { LENGTH };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a thousand")]
    let samples = (length / INTERVAL).round() as usize;
    let task = console.task("Estimates against the truth", Some(scenes.names.len() as u64));
    let indices: Vec<usize> = (0..scenes.names.len()).collect();
    let progress = |done: usize| task.at(done as u64);
    let found = sweep::sweep(&indices, sweep::processors(), |scene| compared(&scenes, *scene, samples), progress)?;
    let all: Vec<Compared> = found.into_iter().flatten().collect();
    let row = |one: &Compared| json!({ "scene": scenes.names[one.scene], "direction": DIRECTIONS[one.direction], "estimate": one.estimate, "truth": one.truth });
    Ok(Study {
        name: "estimates",
        title: "Estimates against the truth".into(),
        summary: format!(
            "Rubs of rotor 37, {PATCHES} patches on coarse meshes, in two groups: one that the estimates were made with, one that they were not. \
             Each is estimated from coarser runs of itself, and run again with {} times shorter steps, with {TRUE_MODES} modes, and with \
             {TRUE_PATCHES} patches.",
            TRUE_DIVISION / DIVISION
        ),
        facts: vec![
            ("scenes".into(), scenes.names.len().to_string()),
            ("length of each run".into(), format!("{length} s")),
            ("internal step".into(), format!("{:e} s", INTERVAL / f64::from(DIVISION))),
        ],
        statements: (0..DIRECTIONS.len()).map(|direction| statement(&all, direction)).collect(),
        figures: vec![figure(&all)?],
        results: Value::Array(all.iter().map(row).collect()),
        files: Vec::new(),
    })
}
