//! `tiprub run`: runs a scene without FMI, with one row of results per communication point.

use std::{fmt::Write as _, path::Path, time::Instant};

use serde_json::{Map, Value, json};
use tiprub_core::{CoSimulation, Scene, Warning};
use tiprub_field::FieldSeries;
use tiprub_gallery::scene_source;
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path, warnings_json},
    extremes::{Extreme, extremes},
    history::InputHistory,
    means,
    native::{self, ParameterValue, RunInputs, UsedParameter},
    output_file,
    recording::shortest,
    schedule::Schedule,
};

use tiprub_study::estimate::{self, Estimate};
use tiprub_table::recording_file;

use crate::{
    answer,
    observers::{Observers, surfaces},
    report::{input::ReportInput, page},
    run_arguments::RunArguments,
    scene_features,
};

/// Loads and runs the scene, writes the CSV and the Parquet file, and summarises.
///
/// # Errors
/// The scene or an option is wrong, the simulation is rejected or diverges, or a file cannot be written.
pub fn run(arguments: &RunArguments, console: &Console) -> Result<CommandOutcome> {
    let to_stdout = arguments.csv.as_deref() == Some(Path::new("-"));
    if to_stdout && console.is_json() {
        let problem = "cannot be used with --json, as both write to stdout";
        return Err(Failure::usage("--csv -", problem, "Give a file to --csv"));
    }
    let cache = arguments.cache.cache();
    let scene = arguments.options.load(&arguments.scene, &cache, console)?;
    let schedule = Schedule::new(&scene.settings.experiment, arguments.stop, arguments.step)?;
    let history = arguments.inputs.as_deref().map(InputHistory::read).transpose()?;
    let known = cache.checks(&scene);
    let requested = (arguments.fields(), arguments.report.is_some());
    let surfaces = || surfaces(&scene, &arguments.scene, &cache, console);
    let mut observers = Observers::new(&scene, &schedule, requested, surfaces, console)?;
    let clock = Instant::now();
    let run = {
        let task = console.task(&format!("Running {}", scene.settings.name), Some(schedule.count as u64));
        let (settings, history) = (&arguments.set[..], history.as_ref());
        let given = RunInputs { settings, history, checks: &known, observed: None };
        let progress = |done| task.at(done as u64);
        let run = match &mut observers {
            None => native::run(&scene, &schedule, given, &progress),
            Some(observers) => observers.run(&schedule, given, &progress),
        };
        // The message refers to the step in the file, unless the command line sets another one.
        let is_set = arguments.step.is_some() || arguments.set.iter().any(|(name, _)| name == "internal_step_max");
        run.map_err(|failure| if is_set { failure } else { scene_source::located(&arguments.scene, failure) })?
    };
    let wall = clock.elapsed().as_secs_f64();
    cache.keep_checks(&scene, &run.checks);
    if let Some(path) = arguments.csv.as_deref().filter(|_| !to_stdout) {
        run.recording.write_csv(path)?;
    }
    if let Some(path) = arguments.parquet.as_deref() {
        let facts =
            [("tiprub.release", env!("CARGO_PKG_VERSION").to_owned()), ("tiprub.scene", scene.settings.name.clone())];
        recording_file::write(path, &run.recording, &facts)?;
    }
    let stepping = run.stepping.as_secs_f64();
    let simulated = schedule.stop - schedule.start;
    let rows = run.recording.rows();
    let last: Map<String, Value> = run
        .recording
        .names
        .iter()
        .zip(run.recording.row(rows - 1))
        .map(|(name, value)| (name.clone(), json!(value)))
        .collect();
    let extremes = extremes(&run.recording);
    // A parameter on the command line replaces that of the scene.
    let is_set = arguments.set.iter().any(|(name, _)| name == "scheme");
    let scheme = if is_set { "set on the command line".to_owned() } else { scene_features::scheme(&scene.settings) };
    let answer = answer::scene_lines(&run.recording, &scene.settings, &arguments.set);
    let [warnings, warning_details] = warnings_json(&run.warnings);
    let estimates = estimated(&scene, arguments, &schedule, console)?;
    let fields = observers.as_ref().and_then(|observers| observers.fields.as_ref());
    let capture = observers.as_ref().and_then(|observers| observers.capture.as_ref());
    let report = match arguments.report.as_deref().zip(capture) {
        None => None,
        Some((path, capture)) => {
            let html = page::render(&ReportInput {
                scene: &scene,
                table: native::compiled(&scene, &schedule)?.table(),
                settings: &arguments.set,
                history: history.as_ref(),
                schedule: &schedule,
                native: &run,
                capture,
                answer: &answer,
                facts: &[],
                imported: &[],
                estimates: &estimates,
                files: &[],
                durations: &[],
            })?;
            output_file::write(path, &html)?;
            Some((path, html.len()))
        }
    };
    let mut json = json!({
        "model": scene.settings.name,
        "scheme": scheme,
        "start": schedule.start,
        "stop": schedule.stop,
        "communication_step": schedule.step,
        "communication_steps": schedule.count,
        "internal_steps": run.internal_steps,
        "seconds": wall,
        "stepping_seconds": stepping,
        "microseconds_per_internal_step": 1e6 * stepping / run.internal_steps as f64,
        "milliseconds_per_communication_step": {
            "mean": 1e3 * stepping / schedule.count as f64,
            "most": 1e3 * run.slowest.as_secs_f64(),
        },
        "missed_steps": run.effort.map(|effort| effort.missed),
        "internal_trials": run.effort.map(|effort| effort.tried()),
        "real_time_factor": stepping / simulated,
        "warnings": warnings,
        "warning_details": warning_details,
        "answer": answer::json(&answer),
        "csv": arguments.csv.as_deref().map(shown_path),
        "parquet": arguments.parquet.as_deref().map(shown_path),
        "vtk": fields.map(fields_json),
        "report": report.map(|(path, _)| shown_path(path)),
        "parameters": parameters_json(&run.parameters),
        "extremes": Extreme::json(&extremes),
        "means": means::json(&means::means(&run)),
        "totals": means::json(&means::totals(&run)),
        "last": last,
    });
    let rest = if arguments.all {
        let outputs = outputs(&run.recording.names, run.recording.row(rows - 1));
        let fields = written_lines(fields, report);
        format!("\n{outputs}\n{}{fields}", summary(&json, &extremes, &run.warnings) + &lines(&estimates))
    } else {
        let reported =
            if estimates.is_empty() { String::new() } else { format!("\n{}", estimate::errors_text(&estimates)) };
        let fields = written_lines(fields, report);
        let hint =
            if arguments.estimate { "" } else { "\nto estimate the errors of this run with coarser runs: --estimate" };
        format!("{}{fields}{reported}{hint}", where_the_rest_is(&json, !run.warnings.is_empty()))
    };
    let (text, rest) = if to_stdout { (run.recording.to_csv(), String::new()) } else { (answer::text(&answer), rest) };
    if !estimates.is_empty() {
        json["estimated_errors"] = Value::Object(estimates.iter().map(Estimate::json).collect());
    }
    Ok(CommandOutcome { text, warnings: run.warnings, rest, json, failure: None })
}

/// Describes the files of fields over time.
fn fields_json(fields: &FieldSeries) -> Value {
    let (files, bytes) = fields.written();
    json!({
        "index": shown_path(&fields.index_path()),
        "files": files,
        "bytes": bytes,
        "without_surface": fields.without_surface(),
    })
}

/// Returns one line for the fields over time and one for the report, as far as they were written.
fn written_lines(fields: Option<&FieldSeries>, report: Option<(&Path, usize)>) -> String {
    let mut text = String::new();
    if let Some(fields) = fields {
        let (files, bytes) = fields.written();
        let megabytes = 1e-6 * bytes as f64;
        let _ = write!(text, "\nwritten: {} ({files} files, {megabytes:.1} MB)", fields.index_path().display());
    }
    if let Some((path, bytes)) = report {
        let _ = write!(text, "\nwritten: {} ({:.2} MB), open it in a browser", path.display(), 1e-6 * bytes as f64);
    }
    text
}

/// Returns the inputs and parameters at the start of a run as a JSON object.
fn parameters_json(parameters: &[UsedParameter]) -> Value {
    let value = |parameter: &UsedParameter| match &parameter.value {
        ParameterValue::Real(value) => json!(value),
        ParameterValue::Reals(values) => json!(values),
        ParameterValue::Integer(value) => json!(value),
        ParameterValue::Boolean(value) => json!(value),
        ParameterValue::Text(value) => json!(value),
    };
    parameters.iter().map(|parameter| (parameter.name.clone(), value(parameter))).collect::<Map<_, _>>().into()
}

/// Returns the last lines, which say where the rest of the results is.
fn where_the_rest_is(json: &Value, warned: bool) -> String {
    let number = |name: &str| json[name].as_f64().unwrap_or(f64::NAN);
    let mut text = format!(
        "\n{}: t = {} s to {} s, computed in {:.3} s ({:.3} s of computing per simulated second)\n\
         scheme: {}\n\
         for final outputs, extremes, times and full warnings: --all; outputs over time: {}",
        json["model"].as_str().unwrap_or_default(),
        number("start"),
        number("stop"),
        number("stepping_seconds"),
        number("real_time_factor"),
        json["scheme"].as_str().unwrap_or_default(),
        json["csv"].as_str().or(json["parquet"].as_str()).unwrap_or("--csv FILE or --parquet FILE"),
    );
    if warned {
        text.push_str("\nfor the meaning of a warning: docs/warnings.md; to suppress it: --silence ID");
    }
    text
}

/// Returns the errors of the run if requested, else those that are known without further runs.
fn estimated(scene: &Scene, arguments: &RunArguments, schedule: &Schedule, console: &Console) -> Result<Vec<Estimate>> {
    if !arguments.estimate {
        return Ok(estimate::without_runs(scene, &arguments.set));
    }
    let mut scene = scene.clone();
    (scene.settings.experiment.start, scene.settings.experiment.communication_step) = (schedule.start, schedule.step);
    estimate::estimates(&scene, &arguments.set, schedule.count, console)
}

fn lines(estimates: &[Estimate]) -> String {
    if estimates.is_empty() {
        return String::new();
    }
    let why = estimates.iter().filter_map(|one| Some(format!("\n  {}: {}", one.direction, one.left.as_ref().err()?)));
    format!("\n{}{}", estimate::errors_text(estimates), why.collect::<String>())
}

/// Longest array that is listed; longer ones are shown by their range.
const MOST_LISTED: usize = 12;

/// Returns the most useful results, which come last, near the prompt: extremes, warnings, files.
fn summary(json: &Value, extremes: &[Extreme], warnings: &[Warning]) -> String {
    let number = |name: &str| json[name].as_f64().unwrap_or(f64::NAN);
    let per_step = |name: &str| json["milliseconds_per_communication_step"][name].as_f64().unwrap_or(f64::NAN);
    let per_internal_step = match json["microseconds_per_internal_step"].as_f64() {
        Some(microseconds) => format!("{microseconds:.3} µs per internal step, "),
        None => String::new(),
    };
    let mut text = format!(
        "{}: t = {} s to {} s, communication steps: {}, internal steps: {}\n\
         scheme: {}\n\
         stepping took {:.3} s: {per_internal_step}{:.3} s of computing per simulated second\n\
         one communication step took {:.3} ms on average, {:.3} ms at most\n",
        json["model"].as_str().unwrap_or_default(),
        number("start"),
        number("stop"),
        json["communication_steps"],
        json["internal_steps"],
        json["scheme"].as_str().unwrap_or_default(),
        number("stepping_seconds"),
        number("real_time_factor"),
        per_step("mean"),
        per_step("most"),
    );
    if let (Some(missed), Some(trials)) = (json["missed_steps"].as_u64(), json["internal_trials"].as_u64()) {
        text.push_str(&format!(
            "steps of all blades: {trials} tried, {missed} of the shortest length missed the tolerance\n"
        ));
    }
    if !extremes.is_empty() {
        text.push_str("\nextremes over the run:\n");
        text.extend(extremes.iter().map(|extreme| format!("  {}\n", extreme.line())));
    }
    if !warnings.is_empty() {
        text.push_str("\nfull warnings:\n");
        let whole = |warning: &Warning| format!("  [{}] {warning}\n", warning.topic().id());
        text.extend(warnings.iter().map(whole));
    }
    for path in [&json["csv"], &json["parquet"]].into_iter().filter_map(Value::as_str) {
        text.push_str(&format!("\nwritten: {path}"));
    }
    text
}

/// Formats all outputs at the end of the run.
fn outputs(names: &[String], last: &[f64]) -> String {
    let mut text = "values at the end:\n".to_owned();
    let width = names.iter().map(String::len).max().unwrap_or(0);
    let array = |name: &str| name.rsplit_once('[').map_or(name, |(array, _)| array).to_owned();
    let mut rest = names.iter().zip(last).peekable();
    while let Some((name, value)) = rest.next() {
        let (start, mut values) = (array(name), vec![*value]);
        let is_array = start != *name;
        while is_array && values.len() < names.len() && rest.peek().is_some_and(|(next, _)| array(next) == start) {
            values.extend(rest.next().map(|(_, value)| *value));
        }
        if values.len() > MOST_LISTED {
            let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
            let range = format!("{start}[1..{}]", values.len());
            text.push_str(&format!("  {range:<width$}  {} to {}\n", shortest(low), shortest(high)));
        } else {
            for (index, value) in values.iter().enumerate() {
                let name = if is_array { format!("{start}[{}]", index + 1) } else { name.clone() };
                text.push_str(&format!("  {name:<width$}  {}\n", shortest(*value)));
            }
        }
    }
    text
}
