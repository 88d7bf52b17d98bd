//! Estimates of the discretisation errors of steps, modes, patches and mesh, against the true errors: rubs of rotor 37,
//! each refined far in one direction. The mesh error is estimated from one coarser mesh, and from two, as `tiprub study
//! convergence` does.

use serde_json::{Value, json};
use tiprub_core::{Rom, Scene};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::{reduction, scene_source};
use tiprub_model::{
    Rotor37Options,
    rotor37::{MeshCounts, TipContact},
};
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{
    Picture, Sheet, Statement, Study, StudyFigure,
    convergence::{
        limit,
        march::{RunSummary, march},
    },
    estimate::{self, Estimate},
};

use crate::cli::EstimatesArguments;

/// Rubs of one model: elements of its mesh, of two coarser ones (the coarsest first) and of the reference, modes, and
/// depths of the bumps, friction coefficients and speeds (rad/s) in all combinations.
struct RubGroup {
    mesh: [usize; 3],
    coarser: [[usize; 3]; 2],
    finer: [usize; 3],
    modes: usize,
    depths: &'static [f64],
    frictions: &'static [f64],
    speeds: &'static [f64],
}

/// The first group was used to choose the bounds of [`estimate`], the second was not.
static GROUPS: [RubGroup; 2] = [
    RubGroup {
        mesh: [16, 1, 16],
        coarser: [[8, 1, 8], [12, 1, 12]],
        finer: [32, 1, 32],
        modes: 40,
        depths: &[0.55, 0.6, 0.7, 0.85],
        frictions: &[0.0, 0.15],
        speeds: &[1500.0, 1800.0, 2000.0],
    },
    RubGroup {
        mesh: [12, 2, 20],
        coarser: [[6, 2, 10], [8, 2, 14]],
        finer: [24, 2, 40],
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
/// Number of patches of the model, and of the reference.
const PATCHES: usize = 9;
const TRUE_MODES: usize = 200;
const TRUE_PATCHES: usize = 17;
const TRUE_DIVISION: u32 = 64;
/// An estimate is correct if it is within this factor of the true error.
const FACTOR: f64 = 3.0;
/// Errors below this are negligible: 1e-4 of displacements is beyond any requirement on a rub.
const NONE: f64 = 1e-4;
const DIRECTIONS: [&str; 5] = ["steps", "modes", "patches", "mesh (one coarser mesh)", "mesh (two coarser meshes)"];
/// Number of directions that the product estimates without further models.
const OF_SCENE: usize = 3;

/// Estimated and true errors of the displacements.
#[derive(Debug, Clone, Copy)]
struct Compared {
    scene: usize,
    direction: usize,
    estimate: Option<f64>,
    truth: Option<f64>,
}

/// A rub: its group, and its scene with the original and other models.
struct EstimatedRub {
    name: String,
    group: &'static RubGroup,
    own: Scene,
    modes: Scene,
    patches: Scene,
    /// Scenes on coarser meshes, the coarsest first.
    coarser: [Scene; 2],
    finer: Scene,
}

fn rubs(quick: bool, console: &Console) -> Result<Vec<EstimatedRub>> {
    let mut found = Vec::new();
    let base = scene_source::settings("builtin:rotor37-one-row")?;
    for (group, number) in GROUPS.iter().zip(1..) {
        let roms = roms(group, console)?;
        let all = group.depths.iter().flat_map(|depth| group.frictions.iter().map(move |friction| (*depth, *friction)));
        let all = all.flat_map(|(depth, friction)| group.speeds.iter().map(move |speed| (depth, friction, *speed)));
        for (depth, friction, speed) in all.take(if quick { 1 } else { usize::MAX }) {
            let mut settings = base.clone();
            settings.surfaces[0].shape =
                tiprub_core::scene::settings::Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
            (settings.contacts[0].friction, settings.structures[0].speed) = (friction, speed);
            settings.experiment.communication_step = INTERVAL;
            settings.time.step = INTERVAL / f64::from(DIVISION);
            let name = format!("group {number}, depth {depth}, µ = {friction}, {speed} rad/s");
            let with = |rom: &Rom| Scene { settings: settings.clone(), roms: vec![rom.clone()] };
            let [own, modes, patches, coarsest, coarser, finer] = roms.each_ref().map(with);
            found.push(EstimatedRub { name, group, own, modes, patches, coarser: [coarsest, coarser], finer });
        }
    }
    Ok(found)
}

/// Returns the model of a group, and variants with more modes, with more patches, on the coarser meshes and on the
/// reference mesh.
fn roms(group: &RubGroup, console: &Console) -> Result<[Rom; 6]> {
    let rom = |[chord, thickness, span]: [usize; 3], modes: usize, patches: usize| {
        let mesh = MeshCounts { chord, thickness, span };
        // The checks of these models are not used.
        let own = Rotor37Options::default();
        let options = Rotor37Options { mesh, tip: TipContact::Patches(patches), modes, checked_modes: 1, ..own };
        reduction::rotor37(&options, console).map(|found| found.rom)
    };
    let (mesh, modes) = (group.mesh, group.modes);
    Ok([
        rom(mesh, modes, PATCHES)?,
        rom(mesh, TRUE_MODES, PATCHES)?,
        rom(mesh, modes, TRUE_PATCHES)?,
        rom(group.coarser[0], modes, PATCHES)?,
        rom(group.coarser[1], modes, PATCHES)?,
        rom(group.finer, modes, PATCHES)?,
    ])
}

fn run(scene: &Scene, division: u32, samples: usize) -> Result<RunSummary> {
    let mut scene = scene.clone();
    scene.settings.time.step = INTERVAL / f64::from(division);
    march(&scene, &[], division, samples).map_err(|why| Failure::new(&scene.settings.name, why, ""))
}

/// Returns the edge length of the elements, up to a factor.
fn edge([chord, _, span]: [usize; 3]) -> f64 {
    1.0 / ((chord * span) as f64).sqrt()
}

/// Estimates the error of the mesh, from one coarser mesh and from two.
fn of_mesh(rub: &EstimatedRub, own: &RunSummary, samples: usize) -> [Option<f64>; 2] {
    let [coarsest, coarse] = rub.coarser.each_ref().map(|scene| run(scene, DIVISION, samples).ok());
    let [first, second] = rub.group.coarser.map(edge);
    let own_edge = edge(rub.group.mesh);
    let last = coarse.as_ref().and_then(|coarse| coarse.displacement_change(own));
    let before = coarsest.zip(coarse).and_then(|(coarsest, coarse)| coarsest.displacement_change(&coarse));
    let three = before.zip(last).and_then(|(before, last)| {
        limit::of_changes([first, second, own_edge], [before, last], limit::LEAST_OF_MESHES)
    });
    let two = last.map(|last| limit::of_two_meshes([second, own_edge], last));
    [two, three].map(|limit| limit.map(|limit| limit.rest))
}

/// Compares estimated and true mesh errors of one rub.
fn compared_over_meshes(rubs: &[EstimatedRub], scene: usize, samples: usize) -> Result<Vec<Compared>> {
    let rub = &rubs[scene];
    let own = run(&rub.own, DIVISION, samples)?;
    let truth = run(&rub.finer, DIVISION, samples).ok().and_then(|truth| own.displacement_change(&truth));
    let of = |(at, estimate): (usize, Option<f64>)| Compared { scene, direction: OF_SCENE + at, estimate, truth };
    Ok(of_mesh(rub, &own, samples).into_iter().enumerate().map(of).collect())
}

/// Compares estimated and true errors in the directions that need no further models.
fn compared_by_itself(rubs: &[EstimatedRub], scene: usize, samples: usize) -> Result<Vec<Compared>> {
    let quiet = Console::new(true, false);
    let rub = &rubs[scene];
    let estimates = estimate::estimates(&rub.own, &[], samples, &quiet)?;
    let own = run(&rub.own, DIVISION, samples)?;
    let truths = [
        run(&rub.own, TRUE_DIVISION, samples),
        run(&rub.modes, DIVISION, samples),
        run(&rub.patches, DIVISION, samples),
    ];
    let truths = truths.map(|truth| truth.ok().and_then(|truth| own.changes(&truth)[0]));
    let of_scene = DIRECTIONS[..OF_SCENE].iter().map(|direction| {
        let estimate = estimates.iter().find(|one: &&Estimate| one.direction == *direction);
        estimate.and_then(|one| one.left.clone().ok())
    });
    let of =
        |(direction, estimate): (usize, Option<f64>)| Compared { scene, direction, estimate, truth: truths[direction] };
    Ok(of_scene.enumerate().map(of).collect())
}

fn statement(all: &[Compared], direction: usize) -> Statement {
    let compared = all.iter().filter(|one| one.direction == direction && one.truth.is_some());
    let given: Vec<(f64, f64)> = compared.clone().filter_map(|one| one.estimate.zip(one.truth)).collect();
    let within = |(a, b): &&(f64, f64)| a.max(*b).max(NONE) <= FACTOR * a.min(*b).max(NONE);
    let right = given.iter().filter(within).count();
    Statement::tested(
        format!(
            "{}: nine of ten estimates agree with the true error within a factor of {FACTOR}",
            DIRECTIONS[direction]
        ),
        !given.is_empty() && 10 * right >= 9 * given.len(),
        format!("{right} of {}; {} rubs have no estimate", given.len(), compared.count() - given.len()),
    )
}

/// Returns statements on the true errors and ratios of every group.
fn groups(rubs: &[EstimatedRub], all: &[Compared], direction: usize) -> Vec<Statement> {
    let of = |(group, number): (&'static RubGroup, usize)| {
        let own = |one: &&Compared| one.direction == direction && core::ptr::eq(rubs[one.scene].group, group);
        let own: Vec<&Compared> = all.iter().filter(own).collect();
        let truths: Vec<f64> = own.iter().filter_map(|one| one.truth).collect();
        let given: Vec<(f64, f64)> = own.iter().filter_map(|one| one.estimate.zip(one.truth)).collect();
        let ends = |values: &mut dyn Iterator<Item = f64>| {
            values.fold([f64::INFINITY, 0.0_f64], |[low, high], value| [low.min(value), high.max(value)])
        };
        let [least, most] = ends(&mut truths.iter().map(|truth| 100.0 * truth));
        let [low, high] = ends(&mut given.iter().map(|(estimate, truth)| estimate / truth));
        let right = given.iter().filter(|(a, b)| a.max(*b).max(NONE) <= FACTOR * a.min(*b).max(NONE)).count();
        Statement::remark(
            format!("{}, group {number}", DIRECTIONS[direction]),
            format!(
                "true error {least:.2} to {most:.2} %, estimate / true error {low:.2} to {high:.2}, {right} of {} \
                 within a factor of {FACTOR}, {} without an estimate",
                given.len(),
                truths.len() - given.len()
            ),
        )
    };
    GROUPS.iter().zip(1..).map(of).collect()
}

fn figure(all: &[Compared]) -> Result<StudyFigure> {
    let logarithm = |value: f64| value.max(NONE).log10();
    let series = DIRECTIONS.iter().enumerate().map(|(direction, name)| {
        let own = all.iter().filter(|one| one.direction == direction);
        let points = own.filter_map(|one| Some((logarithm(one.truth?), logarithm(one.estimate?))));
        Series::line(*name, points.collect())
    });
    let plot = Plot { marked: true, ..Plot::new("log10 of the true error", "log10 of the estimate", series.collect()) };
    let mut sheet =
        Sheet::new(["scene", "direction (0 steps, 1 modes, 2 patches, 3 and 4 mesh)", "estimate", "true error"]);
    for one in all {
        let [estimate, truth] = [one.estimate, one.truth].map(|value| value.unwrap_or(f64::NAN));
        sheet.rows.push(vec![one.scene as f64, one.direction as f64, estimate, truth]);
    }
    Ok(StudyFigure {
        name: "estimates",
        caption: "Estimated against true relative error of the displacements of the watched points.".into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a failed run of the unrefined model, a plot that cannot be drawn.
pub(crate) fn study(arguments: &EstimatesArguments, console: &Console) -> Result<Study> {
    let (arguments, mesh_only) = (&arguments.common, arguments.mesh_only);
    let rubs = rubs(arguments.quick, console)?;
    let length = if arguments.quick { QUICK_LENGTH } else { LENGTH };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a thousand")]
    let samples = (length / INTERVAL).round() as usize;
    let task = console.task("Estimates against true errors", Some(rubs.len() as u64));
    let indices: Vec<usize> = (0..rubs.len()).collect();
    let progress = |done: usize| {
        task.at(done as u64);
        task.line(&format!("{done} of {} rubs", rubs.len()));
    };
    let compared = |scene: &usize| {
        let by_itself = if mesh_only { Vec::new() } else { compared_by_itself(&rubs, *scene, samples)? };
        Ok([by_itself, compared_over_meshes(&rubs, *scene, samples)?].concat())
    };
    let found = sweep::sweep(&indices, sweep::processors(), compared, progress)?;
    let all: Vec<Compared> = found.into_iter().flatten().collect();
    let row = |one: &Compared| json!({ "scene": rubs[one.scene].name, "direction": DIRECTIONS[one.direction], "estimate": one.estimate, "truth": one.truth });
    Ok(Study {
        name: "estimates",
        title: "Estimates against true errors".into(),
        summary: format!(
            "Rubs of rotor 37 with {PATCHES} patches on coarse meshes, in two groups, one of which was used to develop \
             the estimates. Each error is estimated from coarser runs; the true error follows \
             from runs with steps {} times shorter, with {TRUE_MODES} modes, with {TRUE_PATCHES} patches, and on a \
             mesh with half the element size.",
            TRUE_DIVISION / DIVISION
        ),
        facts: vec![
            ("scenes".into(), rubs.len().to_string()),
            ("duration of each run".into(), format!("{length} s")),
            ("internal step".into(), format!("{:e} s", INTERVAL / f64::from(DIVISION))),
        ],
        statements: (0..DIRECTIONS.len())
            .filter(|direction| all.iter().any(|one| one.direction == *direction))
            .flat_map(|direction| [statement(&all, direction)].into_iter().chain(groups(&rubs, &all, direction)))
            .collect(),
        figures: vec![figure(&all)?],
        results: Value::Array(all.iter().map(row).collect()),
        files: Vec::new(),
    })
}
