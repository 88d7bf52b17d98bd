//! Effect of the communication step on inputs that move or load a structure: each as a staircase of values, with
//! derivatives and held, compared with a run whose communication step is the internal one.

use std::f64::consts::{PI, TAU};

use serde_json::{Value, json};
use tiprub_core::scene::settings::{InputInterpolation, Shape};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::Quantity;
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::scene_source;
use tiprub_shell::{Failure, Result, console::Console, sweep};
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure, arguments::StudyCommon};

use crate::stability::models;

/// Communication steps (s); the first is the internal step.
const STEPS: [f64; 3] = [1e-6, 1e-5, 1e-4];
/// Length of the parts of the run over which the torque is averaged (s), equal for all communication steps.
const PART: f64 = 1e-4;
/// Radius of the whirl (m), its speed (rad/s), and the time of its growth (s).
const WHIRL: (f64, f64, f64) = (0.39e-3, 600.0, 2e-3);
/// Depth of casing or bumps beyond the clearance (m).
const DEPTH: f64 = 3e-5;
/// Cooling of the casing's patches (K).
const COOLING: f64 = 40.0;
/// Length of the runs (s).
const LENGTH: f64 = 8e-3;
const QUICK_LENGTH: f64 = 3e-3;
/// Inputs that do not jump may exceed the fine run by this factor.
const MILD: f64 = 1.5;

/// Method by which the importer gives an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum InputMethod {
    /// Values only, ramped by the FMU.
    Ramp,
    /// Values and derivatives.
    Derivatives,
    /// Values only, held.
    Hold,
}

impl InputMethod {
    const ALL: [Self; 3] = [Self::Ramp, Self::Derivatives, Self::Hold];

    fn name(self) -> &'static str {
        match self {
            Self::Ramp => "ramp (default)",
            Self::Derivatives => "derivatives",
            Self::Hold => "hold",
        }
    }
}

/// An input and its course.
struct InputCase {
    name: &'static str,
    title: &'static str,
    scene: Scene,
    /// Inputs (all elements equal) and their values at a time (s).
    values: fn(&Scene, f64, f64) -> Vec<(&'static str, f64)>,
}

/// Result of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
struct InputRun {
    /// Largest normal force of any node in any internal step (N).
    force: f64,
    /// Largest magnitude of the torque over [`PART`] (N.m).
    torque: f64,
    /// Mean torque of the whole run (N.m).
    mean: f64,
}

/// Returns a value that grows smoothly from 0 to 1.
fn grown(share: f64) -> f64 {
    0.5 * (1.0 - (PI * share.clamp(0.0, 1.0)).cos())
}

/// Returns a value that changes smoothly from 0 to 1 and back over the run.
fn swing(time: f64, length: f64) -> f64 {
    0.5 * (1.0 - (TAU * time / length).cos())
}

fn gap(scene: &Scene) -> f64 {
    scene.settings.contacts[0].gap
}

fn whirl(_: &Scene, time: f64, _: f64) -> Vec<(&'static str, f64)> {
    let (radius, speed, growth) = WHIRL;
    let radius = radius * grown(time / growth);
    let (sine, cosine) = (speed * time).sin_cos();
    vec![("whirl_x", radius * cosine), ("whirl_y", radius * sine)]
}

fn gap_offset(scene: &Scene, time: f64, length: f64) -> Vec<(&'static str, f64)> {
    vec![("gap_offset", -(gap(scene) + DEPTH) * swing(time, length))]
}

fn shape_factor(_: &Scene, time: f64, length: f64) -> Vec<(&'static str, f64)> {
    vec![("casing_shape_factor", swing(time, length))]
}

fn temperature(_: &Scene, time: f64, length: f64) -> Vec<(&'static str, f64)> {
    vec![("casing_temperature", -COOLING * swing(time, length))]
}

/// Returns all courses; the quick ones on models of a few masses and springs, which need no reduction.
fn courses(arguments: &StudyCommon, console: &Console) -> Result<Vec<InputCase>> {
    let (rigid, elastic) = if arguments.quick {
        let mut elastic = models::bumps(models::blade(12));
        models::on_ring(&mut elastic, 0.03);
        elastic.settings.structures[1].thermal = true;
        (models::bumps(models::blade(12)), elastic)
    } else {
        let cache = arguments.cache.cache();
        let load = |name| scene_source::load(name, &cache, console);
        // The page contains the figures of three nodes, which match the step below.
        let of_nodes = |name| -> Result<Scene> {
            let mut scene = load(name)?;
            scene.roms[0].clone_from(&load("builtin:rotor37-paper")?.roms[0]);
            Ok(scene)
        };
        (of_nodes("builtin:rotor37-one-row")?, of_nodes("builtin:flexible-casing")?)
    };
    let with = |scene: &Scene, change: fn(&mut Scene)| {
        let mut scene = scene.clone();
        scene.settings.time.step = STEPS[0];
        change(&mut scene);
        scene
    };
    let round = |scene: &mut Scene| scene.settings.surfaces[0].shape = Shape::Circular {};
    let bumps = |scene: &mut Scene| {
        (scene.settings.surfaces[0].moving, scene.settings.surfaces[0].ramp_time) = (true, 0.0);
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.55, width: 0.15, phase: 0.0 };
    };
    let whirling = |scene: &mut Scene| {
        scene.settings.surfaces[0].shape = Shape::Circular {};
        scene.settings.structures[0].whirl = true;
    };
    Ok(vec![
        InputCase { name: "whirl", title: "whirl_x, whirl_y", scene: with(&rigid, whirling), values: whirl },
        InputCase { name: "gap-offset", title: "gap_offset", scene: with(&rigid, round), values: gap_offset },
        InputCase {
            name: "shape-factor",
            title: "casing_shape_factor",
            scene: with(&rigid, bumps),
            values: shape_factor,
        },
        InputCase {
            name: "temperature",
            title: "casing_temperature",
            scene: with(&elastic, |_| ()),
            values: temperature,
        },
    ])
}

impl InputCase {
    /// Runs one case with communication steps of `step` (s).
    fn run(&self, way: InputMethod, step: f64, length: f64) -> Result<InputRun> {
        let mut scene = self.scene.clone();
        if way == InputMethod::Hold {
            scene.settings.time.input_interpolation = InputInterpolation::Hold;
        }
        let place = || format!("lab inputs, {} with H = {step} s ({})", self.title, way.name());
        self.march(&scene, way, step, length).map_err(|error| Failure::from_core(place(), error))
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "constants: at most 8000 steps")]
    fn march(&self, scene: &Scene, way: InputMethod, step: f64, length: f64) -> tiprub_core::Result<InputRun> {
        let mut simulation = Simulation::new(scene)?;
        self.give(&mut simulation, way, [0.0, step], length)?;
        simulation.initialise(0.0)?;
        let output = |quantity| simulation.table().with_quantity(quantity).map_or(0, |row| row.reference);
        let (torque, force) = (output(Quantity::Moment(2)), output(Quantity::NormalForcePeak));
        let parts = (length / PART).round() as usize;
        let steps = (PART / step).round() as usize;
        let mut found = InputRun { force: 0.0, torque: 0.0, mean: 0.0 };
        for part in 0..parts {
            let mut sum = 0.0;
            for index in part * steps..(part + 1) * steps {
                let times = [index, index + 1].map(|index| index as f64 * step);
                self.give(&mut simulation, way, times, length)?;
                simulation.do_step(times[0], step)?;
                sum += simulation.real(torque)? / steps as f64;
                found.force = found.force.max(simulation.real(force)?);
            }
            found.torque = found.torque.max(sum.abs());
            found.mean += sum / parts as f64;
        }
        Ok(found)
    }

    /// Sets the inputs at the first of two communication points.
    fn give(
        &self,
        simulation: &mut Simulation,
        way: InputMethod,
        times: [f64; 2],
        length: f64,
    ) -> tiprub_core::Result<()> {
        let [now, next] = times.map(|time| (self.values)(&self.scene, time, length));
        for ((name, value), (_, next)) in now.into_iter().zip(next) {
            let row = simulation.table().find(name).map(|row| (row.reference, row.len(), row.quantity));
            let Some((first, count, quantity)) = row else { continue };
            for reference in (first..).take(count) {
                simulation.set_real(reference, value)?;
                // A parameter has no derivative: this method sets it to its value at the end.
                if way == InputMethod::Derivatives && quantity == Quantity::GapOffset {
                    simulation.set_real(reference, next)?;
                } else if way == InputMethod::Derivatives {
                    simulation.set_input_derivative(reference, 1, (next - value) / (times[1] - times[0]))?;
                }
            }
        }
        Ok(())
    }
}

/// All runs of a course: the fine one, then by input methods and steps.
struct InputRuns {
    fine: InputRun,
    by_way: Vec<[InputRun; 3]>,
}

fn table(courses: &[InputCase], runs: &[InputRuns]) -> String {
    let mut text = String::from(
        "| input | method | H (s) | peak node force (N) | relative to the fine run | peak torque (N m) | mean torque \
         (N m) |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (course, runs) in courses.iter().zip(runs) {
        let mut row = |way: &str, step: &str, found: &InputRun| {
            let ratio = found.force / runs.fine.force;
            text.push_str(&format!(
                "| `{}` | {way} | {step} | {:.1} | {ratio:.2} | {:.2} | {:.3} |\n",
                course.title.replace(", ", "`, `"),
                found.force,
                found.torque,
                found.mean
            ));
        };
        row("fine run", "1e-6", &runs.fine);
        for (way, found) in InputMethod::ALL.iter().zip(&runs.by_way) {
            for (step, found) in STEPS.iter().zip(found) {
                row(way.name(), &format!("{step:e}"), found);
            }
        }
    }
    text
}

fn figure(course: &InputCase, runs: &InputRuns) -> Result<StudyFigure> {
    let points = |found: &[InputRun; 3]| STEPS.iter().zip(found).map(|(step, one)| (step.log10(), one.force)).collect();
    let series = InputMethod::ALL.iter().zip(&runs.by_way).map(|(way, found)| Series::line(way.name(), points(found)));
    let plot = Plot {
        logarithmic: true,
        marked: true,
        height: 260,
        ..Plot::new("log10 of the communication step (s)", "peak node force (N)", series.collect())
    };
    let mut sheet = Sheet::new([
        "method (0 ramp, 1 derivatives, 2 hold)",
        "H (s)",
        "force (N)",
        "torque (N.m)",
        "mean torque (N.m)",
    ]);
    for (way, found) in (0_u8..).zip(&runs.by_way) {
        for (step, one) in STEPS.iter().zip(found) {
            sheet.rows.push(vec![f64::from(way), *step, one.force, one.torque, one.mean]);
        }
    }
    Ok(StudyFigure {
        name: course.name,
        caption: format!(
            "Largest normal force at a node while {} changes, against the communication step.",
            course.title
        ),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

fn statements(course: &InputCase, runs: &InputRuns) -> [Statement; 2] {
    let worst = |way: usize| runs.by_way[way].iter().fold(0.0, |most: f64, one| most.max(one.force)) / runs.fine.force;
    let [ramp, derivatives, hold] = [0, 1, 2].map(worst);
    let title = course.title;
    [
        Statement::tested(
            format!(
                "{title}: with values only, the largest force is at most {MILD} times that of the fine run, for every H"
            ),
            ramp <= MILD,
            format!("{ramp:.2} times; {hold:.2} times with hold"),
        ),
        Statement::tested(
            format!("{title}: the same holds with derivatives"),
            derivatives <= MILD,
            format!("{derivatives:.2} times"),
        ),
    ]
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a run that fails, a plot that cannot be drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let length = if arguments.quick { QUICK_LENGTH } else { LENGTH };
    let courses = courses(arguments, console)?;
    let mut tasks = Vec::new();
    for course in &courses {
        tasks.push((course, InputMethod::Derivatives, STEPS[0]));
        tasks.extend(InputMethod::ALL.iter().flat_map(|way| STEPS.map(|step| (course, *way, step))));
    }
    let work = |(course, way, step): &(&InputCase, InputMethod, f64)| course.run(*way, *step, length);
    let found = sweep::sweep(&tasks, sweep::processors(), work, |_| ())?;
    let runs: Vec<InputRuns> = found
        .chunks(1 + 3 * STEPS.len())
        .map(|found| InputRuns {
            fine: found[0],
            by_way: found[1..].chunks(STEPS.len()).map(|found| [found[0], found[1], found[2]]).collect(),
        })
        .collect();
    let pairs = || courses.iter().zip(&runs);
    Ok(Study {
        name: "inputs",
        title: "Inputs between communication points".into(),
        summary: format!(
            "Inputs that move or load a structure, set at communication points as values, as values with derivatives, \
             and as values that are held. The fine run uses derivatives and a communication step of {:e} s, which \
             equals the internal step.{}",
            STEPS[0],
            if arguments.quick { " Quick mode: blades with three modes, an elastic ring without a mesh." } else { "" }
        ),
        facts: vec![
            ("duration of each run".into(), format!("{length} s")),
            ("internal step".into(), format!("{:e} s", STEPS[0])),
            (
                "whirl".into(),
                format!("circle with a radius of {} m at {} rad/s, reached in {} s", WHIRL.0, WHIRL.1, WHIRL.2),
            ),
            ("torque".into(), format!("peak of the averages over {PART:e} s")),
        ],
        statements: pairs().flat_map(|(course, runs)| statements(course, runs)).collect(),
        figures: pairs().map(|(course, runs)| figure(course, runs)).collect::<Result<_>>()?,
        results: results(&courses, &runs),
        files: vec![("inputs.md".into(), "table for the guide".into(), table(&courses, &runs).into_bytes())],
    })
}

fn results(courses: &[InputCase], runs: &[InputRuns]) -> Value {
    let one = |found: &InputRun| json!({ "force": found.force, "torque": found.torque, "mean_torque": found.mean });
    let course = |(course, runs): (&InputCase, &InputRuns)| {
        let ways = InputMethod::ALL.iter().zip(&runs.by_way);
        let ways = ways.map(|(way, found)| (way.name().to_owned(), found.iter().map(one).collect()));
        let all: serde_json::Map<String, Value> =
            [("fine".to_owned(), one(&runs.fine))].into_iter().chain(ways).collect();
        (course.name.to_owned(), Value::Object(all))
    };
    Value::Object(courses.iter().zip(runs).map(course).collect())
}
