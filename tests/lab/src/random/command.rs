//! `lab random`: runs random scenes, prints the table and writes failed scenes.

use std::path::Path;

use tiprub_packaging::cli::LibraryArguments;
use tiprub_packaging::library;
use tiprub_shell::console::{CommandOutcome, Console};
use tiprub_shell::{Failure, Result, output_file, sweep};

use super::faces::LibraryFaces;
use super::table::{RandomTable, row_as_json, row_as_text};
use super::{judged, scenes};
use crate::cli::RandomArguments;

/// Maximum number of failed scenes that are named.
const NAMED: usize = 10;

/// Runs the requested scenes.
///
/// # Errors
/// A missing library, files that cannot be written, or a failed scene.
pub(crate) fn run(arguments: &RandomArguments, console: &Console) -> Result<CommandOutcome> {
    let directory = tempfile::tempdir()
        .map_err(|error| Failure::file(&std::env::temp_dir(), "cannot create a temporary directory", &error))?;
    let faces = if arguments.fmu > 0 { Some(load(arguments, console, directory.path())?) } else { None };
    if let Some(seed) = arguments.only {
        return only(arguments, faces.as_ref(), seed);
    }
    let seeds: Vec<(usize, u64)> = (0..arguments.scenes).map(|index| (index, seed_of(arguments.seed, index))).collect();
    let task = console.task("Random scenes", Some(seeds.len() as u64));
    let threads = arguments.threads.map_or_else(sweep::processors, std::num::NonZero::get);
    let every = arguments.fmu.max(1);
    let rows = sweep::sweep(
        &seeds,
        threads,
        |(index, seed)| {
            let row = judged(*seed, faces.as_ref().filter(|_| index.is_multiple_of(every)));
            if row.is_wrong() {
                task.line(&row_as_text(&row));
            }
            Ok(row)
        },
        |done| task.at(done as u64),
    )?;
    drop(task);
    let table = RandomTable { rows };
    if let Some(out) = &arguments.out {
        for row in table.wrong() {
            write_scene(out, row.seed)?;
        }
        output_file::write(&out.join("results.json"), format!("{:#}\n", table.to_json()))?;
    }
    let seeds: Vec<u64> = table.wrong().map(|row| row.seed).collect();
    if seeds.is_empty() {
        return Ok(CommandOutcome { text: table.to_text(), json: table.to_json(), ..CommandOutcome::default() });
    }
    console.print_progress(table.to_text());
    let named: Vec<String> = seeds.iter().take(NAMED).map(u64::to_string).collect();
    let problem = format!("{} of {} scenes failed: {}", seeds.len(), arguments.scenes, named.join(", "));
    Err(Failure::new("lab random", problem, format!("Run a single scene with `lab random --only {}`", named[0])))
}

/// Returns the seed of a scene of a run, which is the only effect of its index.
fn seed_of(seed: u64, index: usize) -> u64 {
    scenes::numbers(seed, 0x5ce0 + index as u64).0
}

/// Runs one scene and prints its full result.
fn only(arguments: &RandomArguments, faces: Option<&LibraryFaces>, seed: u64) -> Result<CommandOutcome> {
    let row = judged(seed, faces);
    if let Some(out) = &arguments.out {
        write_scene(out, seed)?;
    }
    if row.is_wrong() {
        let problem = row.findings.iter().map(|one| format!("{}: {}", one.oracle, one.text)).collect::<Vec<_>>();
        return Err(Failure::new(format!("scene {seed}"), problem.join("; "), row_as_text(&row)));
    }
    Ok(CommandOutcome { text: row_as_text(&row), json: row_as_json(&row), ..CommandOutcome::default() })
}

/// Writes the scene as TOML with its ROMs, as an FMU contains them.
fn write_scene(out: &Path, seed: u64) -> Result<()> {
    let directory = out.join(seed.to_string());
    output_file::create_directory(&directory)?;
    for (name, bytes) in tiprub_format::resource_files(&scenes::trial(seed).scene, false) {
        output_file::write(&directory.join(name), bytes)?;
    }
    Ok(())
}

fn load(arguments: &RandomArguments, console: &Console, directory: &Path) -> Result<LibraryFaces> {
    let chosen =
        LibraryArguments { library: arguments.library.iter().cloned().collect(), ..LibraryArguments::default() };
    let libraries = library::load(library::LibraryUnit::Scene, library::LibraryBuild::Released, &chosen, console)?;
    let here = tiprub_fmi_host::Platform::here();
    let fitting = libraries.into_iter().find(|library| Some(library.platform) == here);
    let fitting = fitting.ok_or_else(|| {
        Failure::new("FMU library", "there is no library for this platform", "Choose a library with `--library`")
    })?;
    let path = directory.join("tiprub_fmi");
    output_file::write(&path, fitting.bytes)?;
    LibraryFaces::load(&path)
}
