//! `tiprub run`: runs a scene without FMI, with one row of results per communication point.

use std::{path::Path, time::Instant};

use serde_json::{Map, Value, json};
use tiprub_core::scene::settings::{ContactSettings, SceneSettings};
use tiprub_core::{Scene, Warning};
use tiprub_field::{FieldSeries, shape_file};
use tiprub_gallery::{builtin, rom_cache::RomCache, scene_source};
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path, warnings_json},
    extremes::{Extreme, extremes},
    history::InputHistory,
    means,
    native::{self, ObservedScene, ParameterValue, RunInputs, StartedRun, UsedParameter},
    recording::shortest,
    schedule::Schedule,
};

use tiprub_study::estimate::{self, Estimate};
use tiprub_table::recording_file;

use crate::{answer, cli::RunArguments, scene_features};

/// Returns the largest gap or penetration of a closed contact with adaptive steps (m); 0 with fixed steps.
fn allowed_error(settings: &SceneSettings, set: &[(String, String)]) -> f64 {
    let Some(tolerance) = estimate::time_in_use(settings, set).step_tolerance() else { return 0.0 };
    let gap = |contact: &ContactSettings| contact.nominal_gap();
    let smallest = settings.contacts.iter().map(gap).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { tolerance * smallest } else { 0.0 }
}

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
    let (mut fields, observed) = fields(arguments, &scene, &schedule, &cache, console)?.unzip();
    let clock = Instant::now();
    let run = {
        let task = console.task(&format!("Running {}", scene.settings.name), Some(schedule.count as u64));
        let (settings, history) = (&arguments.set[..], history.as_ref());
        let given = RunInputs { settings, history, checks: &known, observed: observed.as_ref() };
        let progress = |done| task.at(done as u64);
        let run = match &mut fields {
            None => native::run(&scene, &schedule, given, &progress),
            Some(RequestedFields { scene, series }) => StartedRun::new(scene, &schedule, given)
                .and_then(|run| run.finish_observed(&progress, &mut |index, simulation| series.add(index, simulation)))
                // If the run fails, its files up to then can be used.
                .and_then(|run| series.finish().map(|()| run))
                .inspect_err(|_| drop(series.finish())),
        };
        // The message refers to the step in the file, unless the command line sets another one.
        let is_set = arguments.step.is_some() || arguments.set.iter().any(|(name, _)| name == "internal_step_max");
        run.map_err(|failure| if is_set { failure } else { scene_source::located(&arguments.scene, failure) })?
    };
    let wall = clock.elapsed().as_secs_f64();
    if run.checks != known {
        cache.keep_checks(&scene, &run.checks);
    }
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
    let answer = answer::lines(&run.recording, allowed_error(&scene.settings, &arguments.set));
    let [warnings, warning_details] = warnings_json(&run.warnings);
    let estimates = estimated(&scene, arguments, &schedule, console)?;
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
        "vtk": fields.as_ref().map(RequestedFields::json),
        "parameters": parameters_json(&run.parameters),
        "extremes": Extreme::json(&extremes),
        "means": means::json(&means::means(&run)),
        "totals": means::json(&means::totals(&run)),
        "last": last,
    });
    let rest = if arguments.all {
        let outputs = outputs(&run.recording.names, run.recording.row(rows - 1));
        let fields = fields.as_ref().map_or(String::new(), RequestedFields::text);
        format!("\n{outputs}\n{}{fields}", summary(&json, &extremes, &run.warnings) + &lines(&estimates))
    } else {
        let reported =
            if estimates.is_empty() { String::new() } else { format!("\n{}", estimate::errors_text(&estimates)) };
        let fields = fields.as_ref().map_or(String::new(), RequestedFields::text);
        let hint =
            if arguments.estimate { "" } else { "\nto estimate the errors of this run with coarser runs: --estimate" };
        format!("{}{fields}{reported}{hint}", where_the_rest_is(&json, !run.warnings.is_empty()))
    };
    let (text, rest) = if to_stdout { (run.recording.to_csv(), String::new()) } else { (answer::text(&answer), rest) };
    if !estimates.is_empty() {
        json["estimated_errors"] = Value::Object(estimates.iter().map(Estimate::json).collect());
    }
    Ok(CommandOutcome { text, warnings: run.warnings, rest, json })
}

/// Fields over time.
struct RequestedFields {
    /// Scene whose outputs include the fields.
    scene: Scene,
    series: FieldSeries,
}

impl RequestedFields {
    fn json(&self) -> Value {
        let (files, bytes) = self.series.written();
        json!({
            "index": shown_path(&self.series.index_path()),
            "files": files,
            "bytes": bytes,
            "without_surface": self.series.without_surface(),
        })
    }

    fn text(&self) -> String {
        let (files, bytes) = self.series.written();
        let megabytes = 1e-6 * bytes as f64;
        format!("\nwritten: {} ({files} files, {megabytes:.1} MB)", self.series.index_path().display())
    }
}

/// Prepares fields over time, if they are requested.
fn fields(
    arguments: &RunArguments,
    scene: &Scene,
    schedule: &Schedule,
    cache: &RomCache,
    console: &Console,
) -> Result<Option<(RequestedFields, ObservedScene)>> {
    let Some(options) = arguments.fields() else { return Ok(None) };
    let extended = options.scene(scene)?;
    let directory = Path::new(&arguments.scene).parent().unwrap_or(Path::new(""));
    let shapes = scene.settings.structures.iter().zip(&scene.roms).map(|(structure, rom)| {
        match tiprub_format::builtin_model(structure) {
            Some(name) => builtin::shapes(name, rom, cache, console).transpose(),
            None => {
                let path = directory.join(&structure.rom);
                let beside = shape_file::beside(&path);
                let files = shape_file::in_directory(path.parent().unwrap_or(Path::new("")), Some(&beside));
                shape_file::find(rom, files)
            }
        }
    });
    let observed = ObservedScene::new(scene, schedule)?;
    let series = FieldSeries::new(options, &extended, shapes.collect::<Result<_>>()?, *schedule)?;
    let alone = series.without_surface().into_iter().map(|name| {
        format!(
            "{name} is shown by its contact nodes only: no shape file belongs to its ROM. `tiprub reduce` writes one \
             beside the ROM of a mesh with one material"
        )
    });
    console.warn_texts(&alone.collect::<Vec<_>>());
    Ok(Some((RequestedFields { scene: extended, series }, observed)))
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
        json["start"],
        json["stop"],
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
    let mut text = format!(
        "{}: t = {} s to {} s, communication steps: {}, internal steps: {}\n\
         scheme: {}\n\
         stepping took {:.3} s: {:.3} µs per internal step, {:.3} s of computing per simulated second\n\
         one communication step took {:.3} ms on average, {:.3} ms at most\n",
        json["model"].as_str().unwrap_or_default(),
        json["start"],
        json["stop"],
        json["communication_steps"],
        json["internal_steps"],
        json["scheme"].as_str().unwrap_or_default(),
        number("stepping_seconds"),
        number("microseconds_per_internal_step"),
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
