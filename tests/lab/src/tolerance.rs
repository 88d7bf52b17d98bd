//! Error of the steps against run time on rubs: `galerkin` by its tolerance, the other schemes by their steps.

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
const QUICK_STEPS: u32 = 14;
const QUICK_SCENE: &str = "builtin:rotor37-paper";
/// Runs of which the median time counts.
const REPEATED: usize = 3;

/// A rub.
struct Rub {
    name: &'static str,
    /// In words.
    of: &'static str,
    scene: &'static str,
    change: fn(&mut Scene),
    /// Communication steps.
    steps: u32,
    /// What is done of it: steps of rotor 37 alone, or those of scenes whose blades move each other.
    together: bool,
}

const RUBS: [Rub; 4] = [
    Rub {
        name: "light",
        of: "light rub of rotor 37",
        scene: "builtin:rotor37",
        change: |scene| deepen(scene, 0.6),
        steps: 66,
        together: false,
    },
    Rub {
        name: "heavy",
        of: "heavy rub of rotor 37",
        scene: "builtin:rotor37",
        change: |scene| deepen(scene, 1.0),
        steps: 66,
        together: false,
    },
    Rub {
        name: "casing",
        of: "rotor 37 with points along its tip, in an elastic casing",
        scene: "builtin:flexible-casing",
        change: |_| (),
        steps: 44,
        together: true,
    },
    Rub {
        name: "stage",
        of: "stage: coupled blades in an elastic casing under load",
        scene: "builtin:stage",
        change: |_| (),
        steps: 120,
        together: true,
    },
];

/// How far the bumps intrude.
fn deepen(scene: &mut Scene, depth: f64) {
    if let Shape::TwoLobe { depth: own, .. } = &mut scene.settings.surfaces[0].shape {
        *own = depth;
    }
}

/// A scheme with its solver and what is varied of it: steps (s), or tolerances.
struct Method {
    name: &'static str,
    scheme: Scheme,
    solver: Solver,
    values: &'static [f64],
    /// The same where blades move each other.
    together: &'static [f64],
    /// Whose finest run is the limit of its equations.
    with_mass: bool,
}

const METHODS: [Method; 4] = [
    Method {
        name: "central-difference + film",
        scheme: Scheme::CentralDifference,
        solver: Solver::Film,
        values: &[4e-8, 2e-8],
        together: &[1e-6, 2.5e-7],
        with_mass: true,
    },
    Method {
        name: "modal-exact + lcp",
        scheme: Scheme::ModalExact,
        solver: Solver::Lcp,
        values: &[1e-6, 5e-7, 2.5e-7, 1.25e-7],
        together: &[2e-6, 1e-6, 5e-7, 2.5e-7],
        with_mass: true,
    },
    Method {
        name: "massless-boundary + lcp",
        scheme: Scheme::MasslessBoundary,
        solver: Solver::Lcp,
        values: &[2e-6, 1e-6, 5e-7, 2.5e-7, 1.25e-7],
        together: &[8e-6, 4e-6, 2e-6, 1e-6, 5e-7],
        with_mass: false,
    },
    Method {
        name: "galerkin",
        scheme: Scheme::Galerkin,
        solver: Solver::Lcp,
        values: &[1e-2, 1e-3, 1e-4, 1e-5],
        together: &[1e-2, 1e-3, 1e-4, 1e-5],
        with_mass: false,
    },
];
/// Finest runs: step with the mass of contact nodes (s), tolerance without; of rotor 37, and where blades move each other.
const FINEST: [(f64, f64); 2] = [(2e-8, 1e-7), (5e-8, 1e-6)];

/// What came of a run.
struct Found {
    displacements: Vec<f64>,
    /// Processor time of the steps (s).
    seconds: f64,
}

/// A row of the table.
struct Row {
    rub: &'static Rub,
    method: &'static Method,
    value: f64,
    /// Error and time, or why there are none.
    outcome: std::result::Result<(f64, f64), String>,
}

fn scene(rub: &Rub, arguments: &StudyCommon, console: &Console) -> Result<Scene> {
    let name = if arguments.quick { QUICK_SCENE } else { rub.scene };
    let mut scene = scene_source::load(name, &arguments.cache.cache(), console)?;
    // Only its model is meant.
    scene.settings.preset = Preset::None;
    (rub.change)(&mut scene);
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

fn table(rows: &[Row]) -> String {
    let mut text =
        String::from("| rub | method | step or tolerance | error | ms per revolution |\n|---|---|---|---|---|\n");
    for Row { rub, method, value, outcome } in rows {
        let (error, time) = match outcome {
            Ok((error, seconds)) => (format!("{error:.1e}"), format!("{:.0}", 1e3 * seconds)),
            Err(_) => ("refused".to_owned(), String::new()),
        };
        text.push_str(&format!(
            "| {} | `{}` | {} | {error} | {time} |\n",
            rub.name,
            method.name,
            varied(method, *value)
        ));
    }
    text
}

fn figure(rub: &'static Rub, rows: &[Row]) -> Result<Figure> {
    let own = || rows.iter().filter(|row| row.rub.name == rub.name);
    let points = |method: &Method| -> Vec<(f64, f64)> {
        let own = own().filter(|row| row.method.name == method.name).filter_map(|row| row.outcome.as_ref().ok());
        own.map(|(error, seconds)| ((1e3 * seconds).log10(), *error)).collect()
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
        sheet.rows.push(vec![method.map_or(f64::NAN, |(_, index)| f64::from(index)), row.value, error, 1e3 * seconds]);
    }
    let caption =
        format!("Error of the steps against processor time, {}, of each against the limit of its equations.", rub.of);
    Ok(Figure { name: rub.name, caption, picture: Picture::plot(&plot)?, sheet })
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
    let mut rows = Vec::new();
    let rubs = if arguments.quick { &RUBS[..2] } else { &RUBS[..] };
    let mut facts = Vec::new();
    for rub in rubs {
        let scene = scene(rub, arguments, console)?;
        let steps = if arguments.quick { QUICK_STEPS } else { rub.steps };
        let revolutions = f64::from(steps) * H * scene.settings.structures[0].speed / std::f64::consts::TAU;
        facts.push((format!("length, {}", rub.name), format!("{revolutions:.2} revolutions")));
        let finest = |method, value| {
            run(&scene, method, value, steps).map_err(|error| Failure::new("the finest run", error.to_string(), ""))
        };
        let (step, tolerance) = FINEST[usize::from(rub.together)];
        let limits =
            [finest((Scheme::Galerkin, Solver::Lcp), tolerance)?, finest((Scheme::ModalExact, Solver::Lcp), step)?];
        for method in &METHODS {
            for value in if rub.together { method.together } else { method.values } {
                console.say(format_args!("{}: {} {}", rub.name, method.name, varied(method, *value)));
                let limit = &limits[usize::from(method.with_mass)].displacements;
                let outcome = measured(&scene, method, *value, steps, limit).map_err(|error| error.to_string());
                let outcome = outcome.map(|(error, seconds)| (error, seconds / revolutions));
                rows.push(Row { rub, method, value: *value, outcome });
            }
        }
    }
    facts.push(("time".into(), clock::MEANING.into()));
    Ok(Study {
        name: "tolerance",
        title: "A tolerance in place of a step".into(),
        summary: format!(
            "Rubs: error of the steps in displacements of all contact nodes against processor time. Each scheme is held against the limit of \
             its equations: modal-exact at {:e} s ({:e} s where blades move each other) with the mass of contact nodes, galerkin at {:e} ({:e}) \
             without.{}",
            FINEST[0].0,
            FINEST[1].0,
            FINEST[0].1,
            FINEST[1].1,
            if arguments.quick { " Quick form: the paper's model, a third of a revolution." } else { "" }
        ),
        facts,
        statements: vec![kept(&rows)],
        figures: rubs.iter().map(|rub| figure(rub, &rows)).collect::<Result<_>>()?,
        results: results(&rows),
        files: vec![("tolerance.md".into(), "the table of the guide".into(), table(&rows).into_bytes())],
    })
}

fn results(rows: &[Row]) -> Value {
    let row = |row: &Row| match &row.outcome {
        Ok((error, seconds)) => json!({
            "rub": row.rub.name, "method": row.method.name, "value": row.value, "error": error,
            "seconds_per_revolution": seconds,
        }),
        Err(why) => json!({"rub": row.rub.name, "method": row.method.name, "value": row.value, "refused": why}),
    };
    rows.iter().map(row).collect()
}
