//! Inputs and outputs of each command, checked before any work.

use std::path::{Path, PathBuf};

use tiprub_field::series;
use tiprub_gallery::scene_source;
use tiprub_shell::{
    Failure, Result, output_file,
    places::{Identity, NamedFile, apart, identity, outputs},
};

use tiprub_sweep::{engine::SweepFiles, plan};

use crate::{
    cli::{Command, LibraryArguments, PackageArguments, StudyCommand},
    commands::{demo, package::targets},
    fmu::FmiVersion,
    library,
    shared_arguments::OutputArguments,
};

/// Extensions of the files that a study writes.
const STUDY_FILES: [&str; 5] = ["csv", "html", "json", "md", "svg"];

/// Extensions of other formats than Parquet: of tables, and of the files that other options and commands read or write.
const NOT_PARQUET: [&str; 12] =
    ["csv", "fmu", "html", "json", "pvd", "safetensors", "toml", "tsv", "txt", "vtu", "xls", "xlsx"];

/// Checks all files that a command line names, before any work.
///
/// # Errors
/// Two names stand for one file, at least one of them an output, or a file cannot be written.
pub fn check(command: &Command) -> Result<()> {
    match command {
        Command::Run(arguments) => {
            let csv = arguments.csv.clone().filter(|path| path != Path::new("-"));
            let inputs = NamedFile::option("--inputs", &arguments.inputs);
            let read: Vec<NamedFile> = scene(&arguments.scene).into_iter().chain(inputs).collect();
            let parquet = NamedFile::option("--parquet", &arguments.parquet);
            let report = NamedFile::option("--report", &arguments.report);
            let files = [parquet, report].into_iter().flatten();
            if let Some(file) = files.clone().find(|file| file.path == Path::new("-")) {
                return Err(not_stdout(&file.role));
            }
            let written = Vec::from_iter(NamedFile::option("--csv", &csv).into_iter().chain(files));
            outputs(&read, &written)?;
            if let Some(file) = NamedFile::option("--csv", &csv) {
                reject_other_formats(&file, "CSV", &["parquet"], "Use --parquet for a Parquet file")?;
            }
            if let Some(file) = NamedFile::option("--parquet", &arguments.parquet) {
                reject_other_formats(
                    &file,
                    "Parquet",
                    &NOT_PARQUET,
                    "Give a name that ends in .parquet, or use --csv for a CSV file",
                )?;
            }
            let Some(fields) = arguments.fields() else { return Ok(()) };
            reject_outputs_inside(&written, ("--vtk", &fields.directory), &series::FILES)?;
            apart(&written, &[NamedFile::new("--vtk", fields.directory.join(series::INDEX))])?;
            keep_inputs(&read, ("--vtk", &fields.directory), &series::FILES)?;
            fields.check_directory()
        }
        Command::Reduce(arguments) => outputs(&arguments.model.files(), &written(arguments.model.written())),
        Command::Demo(arguments) => {
            let files: Vec<NamedFile> =
                demo::FILES.map(|name| NamedFile::new("--out", arguments.out.join(name))).to_vec();
            apart(&libraries(&arguments.libraries)?, &files)?;
            output_file::try_directory(&arguments.out)
        }
        Command::Study(arguments) => match &arguments.study {
            StudyCommand::Map(own) => study(&own.scene, &own.common.directory("map"), Vec::new()),
            StudyCommand::Convergence(own) => {
                let read = scene(&own.study.scene).into_iter().chain(own.from.files()).collect::<Vec<_>>();
                outputs(&read, &Vec::from_iter(NamedFile::option("--into", &own.study.into)))?;
                study(&own.study.scene, &own.study.common.directory("convergence"), own.from.files())
            }
            StudyCommand::Stability(own) => study(&own.scene, &own.common.directory("stability"), Vec::new()),
            StudyCommand::Error(own) => study(&own.study.scene, &own.study.common.directory("error"), own.from.files()),
        },
        Command::Package(arguments) => package(arguments),
        Command::Thermal(arguments) => {
            let targets = targets(arguments.fmi, &arguments.output, &arguments.name())?;
            let read: Vec<NamedFile> = arguments.files().into_iter().chain(libraries(&arguments.libraries)?).collect();
            outputs(&read, &fmus(&targets))
        }
        Command::Sweep(arguments) => {
            let plan = NamedFile::new("the plan", &arguments.plan);
            if extension(&plan.path) == "parquet" {
                let remedy = "Give the TOML file of the plan whose results these are";
                return Err(Failure::usage(
                    plan.path.display().to_string(),
                    "is a table of results, not a plan",
                    remedy,
                ));
            }
            let named =
                plan::input_files(&arguments.plan).into_iter().map(|path| NamedFile::new("a file of the plan", path));
            let read: Vec<NamedFile> = [plan].into_iter().chain(named).collect();
            if arguments.output() == Path::new("-") {
                return Err(not_stdout("--output"));
            }
            let SweepFiles { rows, histories, .. } = SweepFiles::new(&arguments.output());
            let rows = NamedFile::new("--output", rows);
            outputs(&read, &[rows.clone(), NamedFile::new("--output", histories)])?;
            reject_other_formats(
                &rows,
                "Parquet",
                &NOT_PARQUET,
                "Give a name that ends in .parquet; sweeps write no other format",
            )
        }
        Command::Inspect(_) => Ok(()),
    }
}

/// Checks `package`, whose output files are named after the scene.
fn package(arguments: &PackageArguments) -> Result<()> {
    // Problems of the command line alone come first.
    targets(arguments.fmi, &arguments.output, "model")?;
    let read = libraries(&arguments.libraries)?;
    let name = scene_source::settings(&arguments.scene)?.name;
    let read: Vec<NamedFile> = scene(&arguments.scene).into_iter().chain(read).collect();
    outputs(&read, &fmus(&targets(arguments.fmi, &arguments.output, &name)?))
}

/// Returns the error for `-` as an output that must be a file.
fn not_stdout(option: &str) -> Failure {
    let remedy = "Give the name of a file, or ./- for a file with this name";
    Failure::usage(format!("{option} -"), "cannot be printed on stdout", remedy)
}

fn fmus(targets: &[(FmiVersion, PathBuf)]) -> Vec<NamedFile> {
    targets.iter().map(|(_, path)| NamedFile::new("--output", path)).collect()
}

/// Returns the libraries that are named on the command line.
fn libraries(arguments: &LibraryArguments) -> Result<Vec<NamedFile>> {
    Ok(library::given_libraries(arguments)?.into_iter().map(|path| NamedFile::new("--library", path)).collect())
}

/// Returns the files of a scene.
fn scene(argument: &str) -> Vec<NamedFile> {
    let files = scene_source::files(argument).into_iter();
    files
        .enumerate()
        .map(|(index, path)| NamedFile::new(if index == 0 { "the scene" } else { "a ROM of the scene" }, path))
        .collect()
}

/// Returns the output files that `reduce` was given.
fn written(arguments: &OutputArguments) -> Vec<NamedFile> {
    let shapes = arguments.output.as_deref().and_then(|output| arguments.shapes(output));
    let options = [
        ("--output", &arguments.output),
        ("--inp", &arguments.inp),
        ("--vtk", &arguments.vtk),
        ("the shape file", &shapes),
    ];
    options.into_iter().filter_map(|(role, path)| NamedFile::option(role, path)).collect()
}

/// Checks a study, which names its files itself in one directory: no input may be there with one of the extensions of these files.
fn study(argument: &str, out: &Path, more: Vec<NamedFile>) -> Result<()> {
    let read: Vec<NamedFile> = scene(argument).into_iter().chain(more).collect();
    keep_inputs(&read, ("--out", out), &STUDY_FILES)
}

/// Checks a command that names its files itself in the directory of an option: no input may be there with one of these extensions.
fn keep_inputs(inputs: &[NamedFile], (option, out): (&str, &Path), extensions: &[&str]) -> Result<()> {
    let replaced = |path: &PathBuf| extensions.contains(&extension(path).as_str());
    // If the directory does not exist, there are no files.
    let files = out.read_dir().into_iter().flatten().flatten().map(|entry| entry.path()).filter(replaced);
    let files: Vec<Identity> = files.filter_map(|path| identity(&path)).collect();
    for input in inputs {
        if identity(&input.path).is_some_and(|place| files.contains(&place)) {
            let problem = format!("contains {} {}, which this command may overwrite", input.role, input.path.display());
            return Err(Failure::usage(format!("{option} {}", out.display()), problem, "Give another directory"));
        }
    }
    Ok(())
}

/// Rejects an output in a format, if its name has one of the extensions `others` of other formats.
fn reject_other_formats(file: &NamedFile, format: &str, others: &[&str], remedy: &str) -> Result<()> {
    let kind = extension(&file.path);
    if !others.contains(&kind.as_str()) {
        return Ok(());
    }
    let what = format!("{} {}", file.role, file.path.display());
    Err(Failure::usage(what, format!("would contain {format}, but its name ends in .{kind}"), remedy))
}

/// Rejects outputs that are the directory of an option or contain it, and outputs in this directory that have an extension of the files that the
/// option writes there.
fn reject_outputs_inside(outputs: &[NamedFile], (option, directory): (&str, &Path), extensions: &[&str]) -> Result<()> {
    let Some(directory_identity) = identity(directory) else { return Ok(()) };
    let with_parents: Vec<Identity> = directory.ancestors().filter_map(identity).collect();
    if let Some(output) =
        outputs.iter().find(|output| identity(&output.path).is_some_and(|own| with_parents.contains(&own)))
    {
        let what = format!("{} {}", output.role, output.path.display());
        let problem = format!("is a directory of {option} {}", directory.display());
        return Err(Failure::usage(what, problem, "Give another name"));
    }
    for output in outputs.iter().filter(|output| extensions.contains(&extension(&output.path).as_str())) {
        let path = output_file::destination(&output.path).unwrap_or_else(|_| output.path.clone());
        if path.parent().and_then(identity).as_ref() == Some(&directory_identity) {
            let what = format!("{} {}", output.role, output.path.display());
            let problem = format!("may be a file that {option} {} also writes", directory.display());
            return Err(Failure::usage(what, problem, "Give a file in another directory, or with another extension"));
        }
    }
    Ok(())
}

/// Returns the extension of a file in lower case; empty if it has none.
fn extension(path: &Path) -> String {
    path.extension().and_then(|kind| kind.to_str()).unwrap_or_default().to_ascii_lowercase()
}

#[cfg(test)]
mod tests;
