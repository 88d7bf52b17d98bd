//! FMU libraries on the rubs: the library of these sources, and those of other releases, called through the C functions.

use std::path::Path;

use tempfile::TempDir;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_fmi_host::{Platform, Session, UnpackedFmu, VariableType};
use tiprub_packaging::cli::LibraryArguments;
use tiprub_packaging::fmu::{FmiVersion, FmuPackage};
use tiprub_packaging::library::{self, Library, LibraryBuild, LibraryUnit};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::error::clock;

use super::{BenchRow, FINEST, INTERVALS, Rub, SAMPLE, TOLERANCES, calls};
use crate::beside::apart;

/// Tolerance of the runs, the default of scenes.
const TOLERANCE: f64 = TOLERANCES[1];
/// Extension of an FMU.
const FMU: &str = "fmu";

/// A library with its name in the table.
pub(super) struct NamedLibrary {
    name: String,
    library: Library,
}

/// Returns the library of these sources and the given ones; nothing if none is given.
///
/// # Errors
/// A file that is not a library for this platform, or an FMU without one; these sources cannot be compiled.
pub(super) fn load(files: &[impl AsRef<Path>], quick: bool, console: &Console) -> Result<Vec<NamedLibrary>> {
    if files.is_empty() {
        return Ok(Vec::new());
    }
    let build = if quick { LibraryBuild::Shared } else { LibraryBuild::Released };
    let own = library::load(LibraryUnit::Scene, build, &LibraryArguments::default(), console)?;
    let own = own.into_iter().find(|library| Some(library.platform) == Platform::here());
    let own = own.map(|library| NamedLibrary { name: "FMU library of these sources".into(), library });
    let given = files.iter().map(|file| given(file.as_ref()));
    own.map(Ok).into_iter().chain(given).collect()
}

/// Reads a library, or the one that an FMU contains for this platform.
fn given(file: &Path) -> Result<NamedLibrary> {
    let unfit = |problem: &str| {
        Failure::new(file.display(), problem, "Give an FMU of another release, or the library that it contains")
    };
    let read = |path: &Path| {
        tiprub_format::read_file(path, 1 << 30).map_err(|error| Failure::file(path, "cannot be read", &error))
    };
    let here = Platform::here().ok_or_else(|| unfit("no library can be loaded on this platform"))?;
    let bytes = if file.extension().is_some_and(|extension| extension == FMU) {
        let fmu = UnpackedFmu::open(file)?;
        let place = here.place(&fmu.description.fmi_version, &fmu.description.model_identifier);
        let root = fmu.resources().parent().map(|root| root.join(place));
        let path = root.filter(|path| path.is_file());
        read(&path.ok_or_else(|| unfit("is an FMU without a library for this platform"))?)?
    } else {
        read(file)?
    };
    if Platform::of_library(&bytes) != Some(here) {
        return Err(unfit("is not a complete shared library for this platform"));
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    Ok(NamedLibrary { name: format!("FMU library of {name}"), library: Library { platform: here, bytes } })
}

/// Returns whether an output is a displacement of a contact node.
fn is_displacement(name: &str) -> bool {
    name.contains(".tip_") && name.contains("_displacement")
}

/// Packs the scene with a library. If `all` is true, its outputs contain the displacements of all contact nodes.
fn packed(scene: &Scene, all: bool, library: &NamedLibrary) -> Result<(TempDir, UnpackedFmu)> {
    let mut scene = scene.clone();
    let experiment = &mut scene.settings.experiment;
    experiment.stop = experiment.start + experiment.communication_step;
    if all {
        watch_everything(&mut scene);
    }
    let directory = tempfile::tempdir()
        .map_err(|error| Failure::file(&std::env::temp_dir(), "cannot create a temporary directory", &error))?;
    let path = directory.path().join("rub.fmu");
    let libraries = [library.library.clone()];
    FmuPackage::new(&scene, &libraries)?.write(&path, FmiVersion::Three, None)?;
    let fmu = UnpackedFmu::open(&path)?;
    Ok((directory, fmu))
}

fn watch_everything(scene: &mut Scene) {
    scene.settings.outputs.watched_sectors = (1..=scene.roms[0].sectors).collect();
    scene.settings.outputs.tip_displacements = true;
}

/// Returns the displacements of all contact nodes at every millisecond, computed by these sources without a library (m).
fn reference(scene: &Scene, milliseconds: u32) -> tiprub_core::Result<Vec<f64>> {
    let mut scene = scene.clone();
    watch_everything(&mut scene);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let rows = simulation.table().variables().iter().filter(|row| is_displacement(&row.name));
    let references: Vec<u32> = rows.flat_map(|row| (row.reference..).take(row.len())).collect();
    let mut found = Vec::new();
    for millisecond in 0..milliseconds {
        simulation.do_step(f64::from(millisecond) * SAMPLE, SAMPLE)?;
        for reference in &references {
            found.push(simulation.real(*reference)?);
        }
    }
    Ok(found)
}

/// Returns the time of all calls of `doStep` (s), and the displacements in the outputs at every millisecond (m).
fn run(fmu: &UnpackedFmu, interval: f64, milliseconds: u32) -> Result<(f64, Vec<f64>)> {
    let outputs = fmu.description.variables.iter().filter(|one| one.causality == "output");
    let outputs = outputs.filter(|one| one.kind != VariableType::Text);
    let chosen: Vec<bool> =
        outputs.flat_map(|one| std::iter::repeat_n(is_displacement(&one.name), one.elements.unwrap_or(1))).collect();
    let is_recorded = chosen.contains(&true);
    let mut session = Session::new(fmu)?;
    session.initialise(0.0)?;
    let (mut seconds, mut displacements) = (0.0, Vec::new());
    let per_sample = calls(interval);
    for step in 0..milliseconds * per_sample {
        let before = clock::now();
        session.do_step(f64::from(step) * interval, interval)?;
        seconds += (clock::now() - before).as_secs_f64();
        if is_recorded && (step + 1).is_multiple_of(per_sample) {
            let values = session.outputs()?;
            displacements.extend(values.iter().zip(&chosen).filter(|(_, chosen)| **chosen).map(|(value, _)| *value));
        }
    }
    Ok((seconds, displacements))
}

impl Rub {
    /// Returns the rows of all libraries; a library that rejects the scene has one row with the reason.
    ///
    /// # Errors
    /// The run without a library fails.
    pub(super) fn by_library(&self, libraries: &[NamedLibrary]) -> tiprub_core::Result<Vec<BenchRow>> {
        if libraries.is_empty() {
            return Ok(Vec::new());
        }
        let finest = reference(&self.with_tolerance(FINEST), self.size.milliseconds)?;
        Ok(libraries.iter().flat_map(|library| self.rows_of(library, &finest)).collect())
    }

    fn rows_of(&self, library: &NamedLibrary, finest: &[f64]) -> Vec<BenchRow> {
        let setting = || format!("tolerance {TOLERANCE:.0e}");
        let rows = || -> Result<Vec<BenchRow>> {
            let scene = self.with_tolerance(TOLERANCE);
            let (_directory, plain) = packed(&scene, false, library)?;
            let (_other, watched) = packed(&scene, true, library)?;
            let mut rows = Vec::new();
            for interval in INTERVALS {
                let error = apart(&run(&watched, interval, self.size.milliseconds)?.1, finest);
                let mut seconds = f64::INFINITY;
                for _ in 0..self.size.repetitions {
                    seconds = seconds.min(run(&plain, interval, self.size.milliseconds)?.0);
                }
                rows.push(self.row(&library.name, setting(), interval, Ok([self.size.rate(seconds), error])));
            }
            Ok(rows)
        };
        rows()
            .unwrap_or_else(|failure| vec![self.row(&library.name, setting(), INTERVALS[0], Err(failure.to_string()))])
    }
}
