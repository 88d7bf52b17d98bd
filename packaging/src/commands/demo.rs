//! `tiprub demo`: all steps from the mesh to the results on a real blade, with a report.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use serde_json::json;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_field::animation::Capture;
use tiprub_fmi_host::{ImportedRun, UnpackedFmu};
use tiprub_gallery::{
    reduction,
    rom_cache::RomCache,
    scene_source::{self, ROTOR37_SCENE, rotor37_text},
};
use tiprub_model::{Reduction, Rotor37Options};
use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console, shown_path, warnings_json},
    native::{self, NativeRun, RunInputs},
    output_file,
    schedule::Schedule,
};
use tiprub_study::estimate::{self, Estimate};

use crate::{
    answer::{self, AnswerLine},
    cli::DemoArguments,
    fmu::{FmiVersion, FmuPackage},
    library::{self, LibraryBuild, LibraryUnit},
    observers::Observers,
    report::{
        input::{ImportedSummary, ReportFile, ReportInput},
        page,
    },
    rom_facts::RomFacts,
};

/// Names of the files that the demo writes into its directory.
const ROM_FILE: &str = "rotor37.rom.safetensors";
const SCENE_FILE: &str = "rotor37.toml";
const REPORT_FILE: &str = "report.html";
const CSV_FILE: &str = "results.csv";

/// All files, including the FMUs.
pub const FILES: [&str; 6] = [ROM_FILE, SCENE_FILE, REPORT_FILE, CSV_FILE, "rotor37_fmi2.fmu", "rotor37_fmi3.fmu"];

/// Largest size (bytes) of a scene file that a demo may have written.
const LARGEST_SCENE: u64 = 1 << 20;

/// Hint at the error study, which the demo does not run.
const STUDY: &str = "to measure the error against run time of every method on this machine (takes minutes): \
                     tiprub study error builtin:rotor37 --quick";

/// Remedy if the directory contains a scene that was changed.
const KEEP: &str = "Choose another directory with --out, or move your file elsewhere";

/// Wall times of the parts of the demo.
#[derive(Debug, Default)]
struct Stopwatch(Vec<(String, f64)>);

impl Stopwatch {
    fn measure<T>(&mut self, what: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let clock = Instant::now();
        let result = work();
        self.0.push((what.to_string(), clock.elapsed().as_secs_f64()));
        result
    }
}

/// Reduces, packages, imports and runs, compares, and writes the report.
///
/// # Errors
/// A step failed, or the runs do not agree bit for bit.
pub fn run(arguments: &DemoArguments, console: &Console) -> Result<CommandOutcome> {
    let directory = arguments.out.as_path();
    let scene_text = scene_text(arguments.revolutions)?;
    keep_changed_scene(&directory.join(SCENE_FILE), &scene_text)?;
    output_file::create_directory(directory)?;
    let mut watch = Stopwatch::default();

    let libraries = watch.measure("building the FMU library", || {
        library::load(LibraryUnit::Scene, LibraryBuild::Shared, &arguments.libraries, console)
    })?;
    let reduction = watch.measure("reducing the blade", || reduction::rotor37(&Rotor37Options::default(), console))?;
    let scene = write_inputs(directory, &reduction, &scene_text)?;
    let schedule = Schedule::new(&scene.settings.experiment, None, None)?;

    let native = watch.measure("native run", || {
        let task = console.task("Native run", Some(schedule.count as u64));
        native::run(&scene, &schedule, RunInputs::default(), &|done| task.at(done as u64))
    })?;
    native.recording.write_csv(&directory.join(CSV_FILE))?;

    let package = FmuPackage::new(&scene, &libraries)?;
    let mut imported = Vec::new();
    for version in [FmiVersion::Two, FmiVersion::Three] {
        let label = format!("FMI {}.0", version.digit());
        let path = fmu_path(directory, version);
        watch.measure(&format!("packaging, {label}"), || {
            console.print_progress(format_args!("Packaging {}", path.display()));
            package.write(&path, version, None)
        })?;
        let run = watch.measure(&format!("import and run, {label}"), || import(&path, &label, &schedule, console))?;
        let agreement = native.recording.compare(&run.recording)?;
        imported.push(ImportedSummary { label, stepping: run.stepping.as_secs_f64(), agreement });
    }
    let estimates = watch.measure("estimating errors", || estimate::estimates(&scene, &[], schedule.count, console))?;
    let capture = watch.measure("run for the report", || observe(&scene, &reduction, &schedule, console))?;
    let facts = scene.roms.iter().map(|rom| RomFacts::of(rom, None)).collect::<Result<Vec<_>>>()?;
    let answer = answer::scene_lines(&native.recording, &scene.settings, &[]);
    let demo =
        Demo { answer, estimates, capture, directory, scene, schedule, facts, native, imported, durations: watch.0 };
    demo.write_report()?;
    demo.outcome()
}

/// Returns the scene as text over this number of revolutions (`None`: with the stop time of the built-in scene).
fn scene_text(revolutions: Option<f64>) -> Result<String> {
    let settings = tiprub_format::parse_scene(ROTOR37_SCENE, SCENE_FILE)?;
    let speed = settings.structures.first().map_or(0.0, |structure| structure.speed.abs());
    let turn = std::f64::consts::TAU / speed;
    let step = settings.experiment.communication_step;
    // Whole communication steps, so that the last point of every importer is a regular one.
    let stop = revolutions.map_or(settings.experiment.stop, |count| (count * turn / step).ceil() * step);
    Ok(rotor37_text(ROM_FILE, stop))
}

/// Rejects the replacement of a scene that the user changed. A scene that an earlier demo wrote, for any number of revolutions, may be replaced.
fn keep_changed_scene(path: &Path, text: &str) -> Result<()> {
    let present = tiprub_format::read_file(path, LARGEST_SCENE).ok().and_then(|bytes| String::from_utf8(bytes).ok());
    let present = present.unwrap_or_default();
    let stop = present.lines().find_map(|line| line.strip_prefix("stop = ")?.parse().ok());
    if stop.is_some_and(|stop| rotor37_text(ROM_FILE, stop) == present) {
        return Ok(());
    }
    output_file::refuse_to_replace(path, text, KEEP)
}

/// Writes the ROM and the scene as files for further use; returns the scene as read back from them.
fn write_inputs(directory: &Path, reduction: &Reduction, scene_text: &str) -> Result<Scene> {
    let rom = tiprub_format::write_rom(&reduction.rom);
    output_file::write(&directory.join(ROM_FILE), rom)?;
    let scene = directory.join(SCENE_FILE);
    output_file::write(&scene, scene_text)?;
    scene_source::load(&scene, &RomCache::off(), &Console::new(true, false))
}

/// Repeats the native run with the observer of the report, so that the computing times of the first run do not include it.
fn observe(scene: &Scene, reduction: &Reduction, schedule: &Schedule, console: &Console) -> Result<Capture> {
    let shapes = || Ok(vec![reduction.shapes.clone()]);
    let observers = Observers::new(scene, schedule, (None, true), shapes, console)?;
    let task = console.task("Native run for the report", Some(schedule.count as u64));
    let run = |mut observers: Observers| -> Result<Option<Capture>> {
        observers.run(schedule, RunInputs::default(), &|done| task.at(done as u64))?;
        Ok(observers.capture)
    };
    let missing = || Failure::new("report", "the run was not observed", "Report this to the developers");
    observers.map(run).transpose()?.flatten().ok_or_else(missing)
}

fn fmu_path(directory: &Path, version: FmiVersion) -> PathBuf {
    directory.join(format!("rotor37_fmi{}.fmu", version.digit()))
}

fn import(path: &Path, label: &str, schedule: &Schedule, console: &Console) -> Result<ImportedRun> {
    let task = console.task(&format!("Importing and running {label}"), Some(schedule.count as u64));
    let fmu = UnpackedFmu::open(path)?;
    let in_file = |failure: Failure| failure.at(path.display());
    fmu.simulate(schedule, &|done| task.at(done as u64)).map_err(in_file)
}

/// All results of the demo.
struct Demo<'a> {
    directory: &'a Path,
    scene: Scene,
    schedule: Schedule,
    facts: Vec<RomFacts>,
    native: NativeRun,
    answer: [AnswerLine; 5],
    imported: Vec<ImportedSummary>,
    estimates: Vec<Estimate>,
    capture: Capture,
    durations: Vec<(String, f64)>,
}

impl Demo<'_> {
    fn write_report(&self) -> Result<()> {
        let simulation = Simulation::new(&self.scene).map_err(|error| Failure::from_core(SCENE_FILE, error))?;
        let html = page::render(&ReportInput {
            scene: &self.scene,
            table: simulation.table(),
            settings: &[],
            history: None,
            schedule: &self.schedule,
            native: &self.native,
            capture: &self.capture,
            answer: &self.answer,
            facts: &self.facts,
            imported: &self.imported,
            estimates: &self.estimates,
            files: &self.files(),
            durations: &self.durations,
        })?;
        output_file::write(&self.directory.join(REPORT_FILE), html)
    }

    fn files(&self) -> Vec<ReportFile> {
        let list = [
            ("rotor37_fmi2.fmu", "FMU for FMI 2.0 co-simulation"),
            ("rotor37_fmi3.fmu", "FMU for FMI 3.0 co-simulation"),
            (CSV_FILE, "all outputs at all communication points"),
            (SCENE_FILE, "the scene; copy and edit it, then use it with tiprub run or tiprub package"),
            (ROM_FILE, "the reduced-order model of the blade"),
        ];
        list.map(|(name, meaning)| ReportFile {
            name: name.into(),
            meaning: meaning.into(),
            bytes: std::fs::metadata(self.directory.join(name)).map_or(0, |metadata| metadata.len()),
        })
        .to_vec()
    }

    /// Returns the result, or a failure if an FMU and the native run differ in any bit (the report is written in both cases).
    fn outcome(&self) -> Result<CommandOutcome> {
        if let Some(run) = self.imported.iter().find(|run| !run.agreement.is_exact()) {
            let (name, time) = run.agreement.first.clone().unwrap_or_default();
            return Err(Failure::new(
                &run.label,
                format!(
                    "{} of {} values differ from the native run, first in {name} at t = {time} s, by at most {:e}",
                    run.agreement.different,
                    run.agreement.points * run.agreement.variables,
                    run.agreement.largest
                ),
                "Build the library and tiprub from the same sources",
            ));
        }
        let stepping = self.native.stepping.as_secs_f64();
        let simulated = self.schedule.stop - self.schedule.start;
        let per_step = 1e6 * stepping / self.native.internal_steps as f64;
        let report = self.directory.join(REPORT_FILE);
        let [seconds, per_second] = [stepping, stepping / simulated];
        let rest = format!(
            "\n{}: t = {} s to {} s, computed in {seconds:.3} s ({per_second:.3} s of computing per simulated second)\n\
             {} and the native run agree in all bits: {} outputs at {} communication points\n\
             {} (estimated from coarser runs, as with `tiprub run --estimate`)\n\
             files in {}: {}\n\
             open {} in a browser: it shows the contact and the checks of the ROM\n{STUDY}",
            self.scene.settings.name,
            self.schedule.start,
            self.schedule.stop,
            self.imported.iter().map(|run| run.label.as_str()).collect::<Vec<_>>().join(", "),
            self.native.recording.names.len(),
            self.native.recording.rows(),
            estimate::errors_text(&self.estimates),
            self.directory.display(),
            self.files().iter().map(|file| file.name.clone()).collect::<Vec<_>>().join(", "),
            report.display(),
        );
        let text = answer::text(&self.answer);
        let json = json!({
            "model": self.scene.settings.name,
            "report": shown_path(&report),
            "files": self.files().iter().map(|file| json!({
                "name": file.name, "bytes": file.bytes, "meaning": file.meaning,
            })).collect::<Vec<_>>(),
            "roms": self.facts.iter().map(RomFacts::to_json).collect::<Vec<_>>(),
            "simulated_seconds": simulated,
            "communication_steps": self.schedule.count,
            "internal_steps": self.native.internal_steps,
            "microseconds_per_internal_step": per_step,
            "real_time_factor": stepping / simulated,
            "agreement": self.imported.iter().map(|run| json!({
                "run": run.label,
                "points": run.agreement.points,
                "outputs": run.agreement.variables,
                "values_different": run.agreement.different,
                "seconds_in_do_step": run.stepping,
            })).collect::<Vec<_>>(),
            "seconds": self.durations.iter().map(|(what, seconds)| (what.clone(), json!(seconds)))
                .collect::<serde_json::Map<_, _>>(),
            "estimated_errors": self.estimates.iter().map(Estimate::json).collect::<serde_json::Map<_, _>>(),
            "answer": answer::json(&self.answer),
            "warnings": warnings_json(&self.native.warnings)[0],
        });
        Ok(CommandOutcome { text, warnings: self.native.warnings.clone(), rest, json, failure: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn demo_keeps_only_a_modified_scene() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(SCENE_FILE);
        let text = |stop| rotor37_text(ROM_FILE, stop);
        keep_changed_scene(&path, &text(0.01)).unwrap();
        std::fs::write(&path, text(0.02)).unwrap();
        keep_changed_scene(&path, &text(0.01)).unwrap();
        std::fs::write(&path, text(0.02).replace("friction = 0.15", "friction = 0.2")).unwrap();
        let failure = keep_changed_scene(&path, &text(0.02)).unwrap_err();
        assert!(failure.to_string().contains("differs"), "{failure}");
    }
}
