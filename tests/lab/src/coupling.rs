//! A rub and a shaft in its bearings, stepped alternately: once per step, by iterations from saved states, and by
//! Newton's method with derivatives over the step or with differences.

use std::f64::consts::TAU;
use std::time::Instant;

use nalgebra::{Matrix2, Vector2};
use serde_json::{Value, json};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::scene_source;
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure, arguments::StudyCommon};

use crate::stability::models;

/// Communication steps (s).
const STEPS: [f64; 4] = [2e-4, 1e-4, 5e-5, 2.5e-5];
/// Communication step of the reference run (s).
const FINE: f64 = 6.25e-6;
/// Length of the runs (s).
const LENGTH: f64 = 7e-3;
/// Maximum number of iterations of a step.
const MOST: usize = 25;
/// Smallest fraction of a Newton step.
const SHORTEST: f64 = 0.1;
/// Tolerance of the steps of the rub.
const TOLERANCE: f64 = 1e-3;
/// A step is solved if the shaft is within this fraction of the clearance from the position that its force causes: a
/// hundredth of the tolerance of the rub, whose forces jump by less than it when its steps change.
const SOLVED: f64 = 1e-5;
/// Change of the whirl by which an importer computes a difference (m).
const MOVED: f64 = 1e-6;
/// Static displacement of the shaft on its springs by the unbalance (m), which grows over a part of the run.
const UNBALANCE: f64 = 5e-5;
const GROWTH: f64 = 2e-3;

/// A shaft in isotropic bearings: m x'' + c x' + k x = F.
#[derive(Debug, Clone, Copy)]
struct Shaft {
    name: &'static str,
    mass: f64,
    damping: f64,
    stiffness: f64,
}

const SHAFTS: [Shaft; 2] = [
    Shaft { name: "heavy", mass: 30.0, damping: 1.2e3, stiffness: 3e7 },
    Shaft { name: "massless", mass: 0.0, damping: 150.0, stiffness: 2e6 },
];

/// Displacement (m) and velocity (m/s) of the shaft centre.
#[derive(Debug, Clone, Copy, Default)]
struct ShaftMotion {
    place: Vector2<f64>,
    velocity: Vector2<f64>,
}

impl Shaft {
    /// Returns the position after `step` (s) as a function of the mean force (N), by the midpoint rule: x₁ = free +
    /// compliance·F.
    fn law(&self, at: ShaftMotion, step: f64, unbalance: Vector2<f64>) -> (Vector2<f64>, f64) {
        let inertia = 2.0 * self.mass / (step * step) + self.damping / step;
        let compliance = 1.0 / (inertia + 0.5 * self.stiffness);
        let kept = at.place * (inertia - 0.5 * self.stiffness) + at.velocity * (2.0 * self.mass / step);
        ((kept + unbalance) * compliance, compliance)
    }

    /// Returns the force of the unbalance in the middle of a step (N).
    fn unbalance(&self, speed: f64, time: f64) -> Vector2<f64> {
        let grown = 0.5 * (1.0 - (0.5 * TAU * (time / GROWTH).min(1.0)).cos());
        let (sine, cosine) = (speed * time).sin_cos();
        Vector2::new(cosine, sine) * (self.stiffness * UNBALANCE * grown)
    }
}

/// Method of stepping both models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CouplingMethod {
    /// The shaft is stepped with the last force, then the rub with the new shaft position.
    Once,
    /// Repeated with the resulting force, from a saved state.
    FixedPoint,
    /// Newton's method with derivatives over the step.
    Newton,
    /// Newton's method with differences of steps repeated from a saved state.
    Differences,
}

impl CouplingMethod {
    const ALL: [Self; 4] = [Self::Once, Self::FixedPoint, Self::Newton, Self::Differences];

    fn name(self) -> &'static str {
        match self {
            Self::Once => "once per step",
            Self::FixedPoint => "fixed point",
            Self::Newton => "Newton, derivatives over the step",
            Self::Differences => "Newton, differences of 1 µm",
        }
    }
}

/// Result of a run.
#[derive(Debug, Clone, Default)]
struct CouplingRun {
    /// Displacement of the shaft at multiples of the longest step.
    orbit: Vec<Vector2<f64>>,
    /// Steps of the rub per communication step, including repeated ones and those for differences.
    steps: f64,
    /// Derivatives per communication step.
    derivatives: f64,
    unsolved: usize,
    seconds: f64,
}

/// The rub as an importer sees it.
struct CoupledRub {
    simulation: Simulation,
    inputs: [u32; 2],
    outputs: [u32; 2],
    state: Vec<u8>,
    steps: usize,
    derivatives: usize,
}

impl CoupledRub {
    fn new(scene: &Scene, way: CouplingMethod) -> tiprub_core::Result<Self> {
        let mut simulation = Simulation::new(scene)?;
        let reference = |name: &str| simulation.table().find(name).map_or(0, |row| row.reference);
        let (inputs, outputs) = (["whirl_x", "whirl_y"].map(reference), ["force_x", "force_y"].map(reference));
        let switch = reference("step_derivatives");
        if way == CouplingMethod::Newton {
            simulation.set_integer(switch, 2)?;
        }
        simulation.initialise(0.0)?;
        let state = vec![0; simulation.state_size()];
        Ok(Self { simulation, inputs, outputs, state, steps: 0, derivatives: 0 })
    }

    /// Returns the mean force over the step from the saved state to `whirl`.
    fn force(&mut self, whirl: Vector2<f64>, step: f64) -> tiprub_core::Result<Vector2<f64>> {
        self.simulation.restore_state(&self.state)?;
        self.steps += 1;
        self.simulation.set_real(self.inputs[0], whirl.x)?;
        self.simulation.set_real(self.inputs[1], whirl.y)?;
        self.simulation.do_step(self.simulation.time(), step)?;
        Ok(Vector2::new(self.simulation.real(self.outputs[0])?, self.simulation.real(self.outputs[1])?))
    }

    /// Returns ∂force/∂whirl over the last step.
    fn derivative(&mut self) -> tiprub_core::Result<Matrix2<f64>> {
        let mut all = Matrix2::zeros();
        for (column, input) in self.inputs.into_iter().enumerate() {
            self.derivatives += 1;
            let mut one = [0.0; 2];
            self.simulation.step_derivative(&self.outputs, &[input], &[1.0], &mut one)?;
            all.set_column(column, &Vector2::from(one));
        }
        Ok(all)
    }

    /// Returns this derivative from two more steps, moved by [`MOVED`].
    fn difference(&mut self, whirl: Vector2<f64>, force: Vector2<f64>, step: f64) -> tiprub_core::Result<Matrix2<f64>> {
        let x = (self.force(whirl + Vector2::new(MOVED, 0.0), step)? - force) / MOVED;
        let y = (self.force(whirl + Vector2::new(0.0, MOVED), step)? - force) / MOVED;
        Ok(Matrix2::from_columns(&[x, y]))
    }
}

fn march(scene: &Scene, shaft: Shaft, way: CouplingMethod, step: f64) -> tiprub_core::Result<CouplingRun> {
    let start = Instant::now();
    let mut rub = CoupledRub::new(scene, way)?;
    let speed = scene.settings.structures[0].speed;
    let precision = SOLVED * scene.settings.contacts[0].nominal_gap();
    let (mut at, mut force, mut found) = (ShaftMotion::default(), Vector2::zeros(), CouplingRun::default());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "constants: at most 1120 steps")]
    let [count, every] = [LENGTH / step, STEPS[0] / step].map(|ratio| ratio.round() as usize);
    for index in 0..count {
        let middle = (index as f64 + 0.5) * step;
        let (free, compliance) = shaft.law(at, step, shaft.unbalance(speed, middle));
        rub.simulation.save_state(&mut rub.state)?;
        let mut place = free + force * compliance;
        force = rub.force(place, step)?;
        let mut left = free + force * compliance - place;
        let mut tried = 1;
        while way != CouplingMethod::Once && left.norm() > precision && tried < MOST {
            let change = match way {
                CouplingMethod::Once | CouplingMethod::FixedPoint => left,
                CouplingMethod::Newton | CouplingMethod::Differences => {
                    let slope = if way == CouplingMethod::Newton {
                        rub.derivative()?
                    } else {
                        rub.difference(place, force, step)?
                    };
                    let matrix = Matrix2::identity() - slope * compliance;
                    matrix.lu().solve(&left).unwrap_or(left)
                }
            };
            // Forces have kinks, across which Newton's method may oscillate; the step is then shortened.
            let (from, before) = (place, left.norm());
            let mut share = 1.0;
            loop {
                place = from + change * share;
                force = rub.force(place, step)?;
                left = free + force * compliance - place;
                (tried, share) = (tried + 1, 0.5 * share);
                if way == CouplingMethod::FixedPoint || left.norm() < before || tried >= MOST || share < SHORTEST {
                    break;
                }
            }
        }
        found.unsolved += usize::from(way != CouplingMethod::Once && left.norm() > precision);
        at = ShaftMotion { place, velocity: (place - at.place) * (2.0 / step) - at.velocity };
        if (index + 1) % every == 0 {
            found.orbit.push(place);
        }
    }
    found.steps = rub.steps as f64 / count as f64;
    found.derivatives = rub.derivatives as f64 / count as f64;
    found.seconds = start.elapsed().as_secs_f64();
    Ok(found)
}

/// Returns the largest distance of two orbits as a fraction of the clearance.
fn distance(one: &CouplingRun, other: &CouplingRun, clearance: f64) -> f64 {
    one.orbit.iter().zip(&other.orbit).map(|(one, other)| (one - other).norm()).fold(0.0, f64::max) / clearance
}

fn scene(arguments: &StudyCommon, console: &Console) -> Result<Scene> {
    let mut scene = if arguments.quick {
        models::bumps(models::blade(12))
    } else {
        scene_source::load("builtin:rotor37", &arguments.cache.cache(), console)?
    };
    scene.settings.time.tolerance = Some(TOLERANCE);
    scene.settings.structures[0].whirl = true;
    Ok(scene)
}

/// A method, a communication step (s), and its result with the error; `None` if the run failed.
type CouplingRow = (CouplingMethod, f64, Option<(CouplingRun, f64)>);

/// All runs with one shaft.
struct CouplingRuns {
    shaft: Shaft,
    all: Vec<CouplingRow>,
}

fn runs(scene: &Scene, shaft: Shaft, console: &Console) -> Result<CouplingRuns> {
    let clearance = scene.settings.contacts[0].nominal_gap();
    let fine = march(scene, shaft, CouplingMethod::Newton, FINE)
        .map_err(|error| Failure::from_core(format!("lab coupling, {}", shaft.name), error))?;
    let mut all = Vec::new();
    let task = console.task(
        &format!("Coupling a rub and a shaft ({})", shaft.name),
        Some((CouplingMethod::ALL.len() * STEPS.len()) as u64),
    );
    for way in CouplingMethod::ALL {
        for step in STEPS {
            task.at(all.len() as u64);
            // A method that does not converge may throw the shaft through the casing.
            let found = march(scene, shaft, way, step).ok();
            all.push((way, step, found.map(|found| (found.clone(), distance(&found, &fine, clearance)))));
        }
    }
    Ok(CouplingRuns { shaft, all })
}

impl CouplingRuns {
    fn found(&self, way: CouplingMethod, step: f64) -> Option<&(CouplingRun, f64)> {
        self.all
            .iter()
            .find(|(one, at, _)| *one == way && at.to_bits() == step.to_bits())
            .and_then(|(_, _, found)| found.as_ref())
    }
}

fn table(runs: &[CouplingRuns]) -> String {
    let mut text = String::from(
        "| shaft | method | H (s) | error / clearance | rub steps per H | derivatives per H | not converged | time (s) \
         |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for runs in runs {
        for (way, step, found) in &runs.all {
            let figures = match found {
                Some((found, error)) => format!(
                    "{error:.1e} | {:.2} | {:.2} | {} | {:.2}",
                    found.steps, found.derivatives, found.unsolved, found.seconds
                ),
                None => "run failed | | | |".to_owned(),
            };
            text.push_str(&format!("| {} | {} | {step:.1e} | {figures} |\n", runs.shaft.name, way.name()));
        }
    }
    text
}

fn figure(runs: &CouplingRuns, name: &'static str) -> Result<StudyFigure> {
    let points = |way: CouplingMethod| {
        let found = |step: &f64| runs.found(way, *step).map(|(_, error)| (step.log10(), *error));
        STEPS.iter().filter_map(found).collect()
    };
    let series = CouplingMethod::ALL.map(|way| Series::line(way.name(), points(way)));
    let plot = Plot {
        logarithmic: true,
        marked: true,
        height: 260,
        ..Plot::new("log10 of the communication step (s)", "error / clearance", series.into())
    };
    let mut sheet =
        Sheet::new(["method", "H (s)", "error / clearance", "rub steps per H", "derivatives per H", "time (s)"]);
    for (way, step, found) in &runs.all {
        let number = CouplingMethod::ALL.iter().position(|one| one == way).unwrap_or(0);
        if let Some((found, error)) = found {
            sheet.rows.push(vec![number as f64, *step, *error, found.steps, found.derivatives, found.seconds]);
        }
    }
    Ok(StudyFigure {
        name,
        caption: format!("With the {} shaft: largest deviation from the orbit with H = {FINE:e} s.", runs.shaft.name),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Returns the communication steps of all runs of one method.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "constants: some hundreds of steps")]
fn steps_of_all() -> usize {
    STEPS.iter().map(|step| (LENGTH / step).round() as usize).sum()
}

fn statements(runs: &CouplingRuns) -> Vec<Statement> {
    let name = runs.shaft.name;
    let unsolved = |way: CouplingMethod| {
        let failed = STEPS.iter().filter(|step| runs.found(way, **step).is_none()).count();
        let unsolved: usize =
            STEPS.iter().filter_map(|step| runs.found(way, *step)).map(|(found, _)| found.unsolved).sum();
        (
            unsolved,
            if failed > 0 {
                format!("{failed} runs failed, {unsolved} steps not converged")
            } else {
                format!("{unsolved} steps not converged")
            },
        )
    };
    let steps = |way: CouplingMethod| {
        let all = STEPS.iter().filter_map(|step| runs.found(way, *step));
        all.map(|(found, _)| found.steps + found.derivatives).fold(0.0, f64::max)
    };
    let [fixed, newton, differences] =
        [CouplingMethod::FixedPoint, CouplingMethod::Newton, CouplingMethod::Differences].map(unsolved);
    vec![
        Statement::tested(
            format!(
                "{name}: Newton's method with derivatives over the step converges in 99 of 100 steps, and no run \
                     fails"
            ),
            100 * newton.0 <= steps_of_all() && !newton.1.contains("failed"),
            format!("{}; fixed point: {}; differences of 1 µm: {}", newton.1, fixed.1, differences.1),
        ),
        Statement::tested(
            format!(
                "{name}: Newton's method takes at most 10 % more rub steps than finite differences, counting derivatives as steps"
            ),
            steps(CouplingMethod::Newton) <= 1.1 * steps(CouplingMethod::Differences),
            format!(
                "{:.2} against {:.2} per communication step",
                steps(CouplingMethod::Newton),
                steps(CouplingMethod::Differences)
            ),
        ),
    ]
}

/// Runs the study.
///
/// # Errors
/// A model that cannot be reduced, a fine run that fails, a plot that cannot be drawn.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let scene = scene(arguments, console)?;
    let all = SHAFTS.into_iter().map(|shaft| runs(&scene, shaft, console)).collect::<Result<Vec<_>>>()?;
    let figures = all.iter().zip(["heavy", "without-mass"]).map(|(runs, name)| figure(runs, name));
    Ok(Study {
        name: "coupling",
        title: "Coupling of a rub and a shaft".into(),
        summary: format!(
            "Rotor 37 whirls in its casing on a shaft with unbalance, which a separate model integrates with the \
             midpoint rule. The two models are coupled by four methods. Errors are in the orbit, relative to the \
             converged orbit with H = {FINE:e} s.{}",
            if arguments.quick { " Quick mode: blades with three modes." } else { "" }
        ),
        facts: SHAFTS
            .iter()
            .map(|shaft| {
                let Shaft { name, mass, damping, stiffness } = shaft;
                (format!("{name} shaft"), format!("{mass} kg, {damping} N s/m, {stiffness:e} N/m"))
            })
            .collect(),
        statements: all.iter().flat_map(statements).collect(),
        figures: figures.collect::<Result<_>>()?,
        results: results(&all),
        files: vec![("coupling.md".into(), "table for the guide".into(), table(&all).into_bytes())],
    })
}

fn results(all: &[CouplingRuns]) -> Value {
    let one = |(way, step, found): &CouplingRow| {
        let figures = found.as_ref().map(|(found, error)| {
            json!({ "error": error, "steps": found.steps, "derivatives": found.derivatives, "unsolved": found.unsolved,
                    "seconds": found.seconds })
        });
        json!({ "way": way.name(), "step": step, "found": figures })
    };
    let runs = |runs: &CouplingRuns| (runs.shaft.name.to_owned(), runs.all.iter().map(one).collect::<Value>());
    Value::Object(all.iter().map(runs).collect())
}
