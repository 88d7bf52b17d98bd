//! Error of the steps against run time on rubs of rotor 37: `galerkin` by its tolerance, the other schemes by their steps.

use serde_json::{Value, json};
use tiprub_core::{
    Scene, Simulation,
    settings::{Preset, Scheme, Shape, Solver},
};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::scene_source;
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{Figure, Picture, Sheet, Statement, Study, arguments::StudyCommon, error::clock};

/// Communication step of all runs (s).
const H: f64 = 8e-5;
/// Communication steps: a revolution and a half.
const STEPS: u32 = 66;
const QUICK_STEPS: u32 = 14;
/// Runs of which the median time counts.
const REPEATED: usize = 3;

/// A rub: name and how far the bumps intrude, as the depth of the shape.
const RUBS: [(&str, f64); 2] = [("light", 0.6), ("heavy", 1.0)];

/// A scheme with its solver and what is varied of it: steps (s), or tolerances.
struct Method {
    name: &'static str,
    scheme: Scheme,
    solver: Solver,
    values: &'static [f64],
    /// Whose finest run is the limit of its equations.
    with_mass: bool,
}

const METHODS: [Method; 4] = [
    Method {
        name: "central-difference + film",
        scheme: Scheme::CentralDifference,
        solver: Solver::Film,
        values: &[4e-8, 2e-8],
        with_mass: true,
    },
    Method {
        name: "modal-exact + lcp",
        scheme: Scheme::ModalExact,
        solver: Solver::Lcp,
        values: &[1e-6, 5e-7, 2.5e-7, 1.25e-7],
        with_mass: true,
    },
    Method {
        name: "massless-boundary + lcp",
        scheme: Scheme::MasslessBoundary,
        solver: Solver::Lcp,
        values: &[2e-6, 1e-6, 5e-7, 2.5e-7, 1.25e-7],
        with_mass: false,
    },
    Method {
        name: "galerkin",
        scheme: Scheme::Galerkin,
        solver: Solver::Lcp,
        values: &[1e-2, 1e-3, 1e-4, 1e-5],
        with_mass: false,
    },
];
/// Finest runs: step with the mass of contact nodes (s), tolerance without.
const FINEST: (f64, f64) = (2e-8, 1e-7);

/// What came of a run.
struct Found {
    displacements: Vec<f64>,
    /// Processor time of the steps (s).
    seconds: f64,
}

/// A row of the table.
struct Row {
    rub: &'static str,
    method: &'static Method,
    value: f64,
    /// Error and time, or why there are none.
    outcome: std::result::Result<(f64, f64), String>,
}

fn scene(name: &str, depth: f64, arguments: &StudyCommon, console: &Console) -> Result<Scene> {
    let mut scene = scene_source::load(name, &arguments.cache.cache(), console)?;
    // Only its model is meant.
    scene.settings.preset = Preset::None;
    if let Shape::TwoLobe { depth: own, .. } = &mut scene.settings.surfaces[0].shape {
        *own = depth;
    }
    scene.settings.experiment.communication_step = H;
    Ok(scene)
}

fn run(scene: &Scene, method: (Scheme, Solver), value: f64, steps: u32) -> tiprub_core::Result<Found> {
    let mut scene = scene.clone();
    let time = &mut scene.settings.time;
    time.scheme = method.0;
    (time.step, time.tolerance) = if method.0 == Scheme::Galerkin { (H, Some(value)) } else { (value, None) };
    scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = method.1);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let (mut displacements, mut seconds) = (Vec::new(), 0.0);
    for step in 0..steps {
        let before = clock::now();
        simulation.do_step(f64::from(step) * H, H)?;
        seconds += (clock::now() - before).as_secs_f64();
        displacements.extend_from_slice(simulation.system().bank().displacement());
    }
    Ok(Found { displacements, seconds })
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
}

/// Median time of several runs, and the error.
fn measured(scene: &Scene, method: &Method, value: f64, steps: u32, limit: &[f64]) -> tiprub_core::Result<(f64, f64)> {
    let mut seconds = Vec::with_capacity(REPEATED);
    let mut error = 0.0;
    for _ in 0..REPEATED {
        let found = run(scene, (method.scheme, method.solver), value, steps)?;
        error = apart(&found.displacements, limit);
        seconds.push(found.seconds);
    }
    seconds.sort_by(f64::total_cmp);
    Ok((error, seconds[REPEATED / 2]))
}

fn varied(method: &Method, value: f64) -> String {
    if method.scheme == Scheme::Galerkin { format!("{value:e}") } else { format!("{} µs", 1e6 * value) }
}

fn table(rows: &[Row], revolutions: f64) -> String {
    let mut text =
        String::from("| rub | method | step or tolerance | error | ms per revolution |\n|---|---|---|---|---|\n");
    for Row { rub, method, value, outcome } in rows {
        let (error, time) = match outcome {
            Ok((error, seconds)) => (format!("{error:.1e}"), format!("{:.0}", 1e3 * seconds / revolutions)),
            Err(_) => ("refused".to_owned(), String::new()),
        };
        text.push_str(&format!("| {rub} | `{}` | {} | {error} | {time} |\n", method.name, varied(method, *value)));
    }
    text
}

fn figure(rub: &'static str, rows: &[Row], revolutions: f64) -> Result<Figure> {
    let own = || rows.iter().filter(|row| row.rub == rub);
    let points = |method: &Method| -> Vec<(f64, f64)> {
        let own = own().filter(|row| row.method.name == method.name).filter_map(|row| row.outcome.as_ref().ok());
        own.map(|(error, seconds)| ((1e3 * seconds / revolutions).log10(), *error)).collect()
    };
    let series =
        METHODS.iter().map(|method| Series::line(method.name, points(method))).filter(|one| !one.points.is_empty());
    let plot = Plot {
        logarithmic: true,
        marked: true,
        height: 300,
        ..Plot::new("log10 of milliseconds per revolution", "error of displacements", series.collect())
    };
    let mut sheet = Sheet::new(["method", "step (s) or tolerance", "error", "time per revolution (ms)"]);
    for row in own() {
        let method = METHODS.iter().zip(0_u8..).find(|(method, _)| method.name == row.method.name);
        let (error, seconds) = row.outcome.as_ref().map_or((f64::NAN, f64::NAN), |found| *found);
        sheet.rows.push(vec![
            method.map_or(f64::NAN, |(_, index)| f64::from(index)),
            row.value,
            error,
            1e3 * seconds / revolutions,
        ]);
    }
    let name = if rub == "light" { "light" } else { "heavy" };
    let caption = format!(
        "Error of the steps against processor time, {rub} rub of rotor 37, of each against the limit of its equations."
    );
    Ok(Figure { name, caption, picture: Picture::plot(&plot)?, sheet })
}

/// Errors of `galerkin` against what was asked for.
fn kept(rows: &[Row]) -> Statement {
    let own = rows.iter().filter(|row| row.method.scheme == Scheme::Galerkin);
    let errors = own.filter_map(|row| Some((row.value, row.outcome.as_ref().ok()?.0)));
    let worst = errors.fold(0.0, |worst: f64, (tolerance, error)| worst.max(error / tolerance));
    Statement::tested(
        "Errors of `galerkin` are at most three times its tolerance".to_owned(),
        worst > 0.0 && worst <= 3.0,
        format!("{worst:.2} times at most"),
    )
}

/// The study.
///
/// # Errors
/// A model that cannot be reduced, a plot that cannot be drawn, a reference that is refused.
pub(crate) fn study(arguments: &StudyCommon, console: &Console) -> Result<Study> {
    let steps = if arguments.quick { QUICK_STEPS } else { STEPS };
    let name = if arguments.quick { "builtin:rotor37-paper" } else { "builtin:rotor37" };
    let mut rows = Vec::new();
    let mut speed = 0.0;
    for (rub, depth) in RUBS {
        let scene = scene(name, depth, arguments, console)?;
        speed = scene.settings.structures[0].speed;
        let finest = |method, value| {
            run(&scene, method, value, steps).map_err(|error| Failure::new("the finest run", error.to_string(), ""))
        };
        let limits =
            [finest((Scheme::Galerkin, Solver::Lcp), FINEST.1)?, finest((Scheme::ModalExact, Solver::Lcp), FINEST.0)?];
        for method in &METHODS {
            for value in method.values {
                let limit = &limits[usize::from(method.with_mass)].displacements;
                let outcome = measured(&scene, method, *value, steps, limit).map_err(|error| error.to_string());
                rows.push(Row { rub, method, value: *value, outcome });
            }
        }
    }
    let revolutions = f64::from(steps) * H * speed / std::f64::consts::TAU;
    Ok(Study {
        name: "tolerance",
        title: "A tolerance in place of a step".into(),
        summary: format!(
            "Rubs of {name}: error of the steps in displacements of all contact nodes against processor time. Each scheme is held against the \
             limit of its equations: modal-exact at {:e} s with the mass of contact nodes, galerkin at {:e} without.{}",
            FINEST.0,
            FINEST.1,
            if arguments.quick { " Quick form: the paper's model, a third of a revolution." } else { "" }
        ),
        facts: vec![("length".into(), format!("{revolutions:.2} revolutions")), ("time".into(), clock::MEANING.into())],
        statements: vec![kept(&rows)],
        figures: RUBS.iter().map(|(rub, _)| figure(rub, &rows, revolutions)).collect::<Result<_>>()?,
        results: results(&rows, revolutions),
        files: vec![("tolerance.md".into(), "the table of the guide".into(), table(&rows, revolutions).into_bytes())],
    })
}

fn results(rows: &[Row], revolutions: f64) -> Value {
    let row = |row: &Row| match &row.outcome {
        Ok((error, seconds)) => json!({
            "rub": row.rub, "method": row.method.name, "value": row.value, "error": error,
            "seconds_per_revolution": seconds / revolutions,
        }),
        Err(why) => json!({"rub": row.rub, "method": row.method.name, "value": row.value, "refused": why}),
    };
    rows.iter().map(row).collect()
}
