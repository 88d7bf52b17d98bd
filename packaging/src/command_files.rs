//! What each command reads and writes, looked at before any work.

use std::path::Path;

use tiprub_gallery::scene_source;
use tiprub_shell::{
    Failure, Result, output_file,
    places::{Named, apart, identity, outputs},
};

use crate::{
    cli::{Command, StudyCommand},
    commands::demo,
    library,
    shared_arguments::Written,
};

/// Extensions of what a study writes.
const STUDY_FILES: [&str; 5] = ["csv", "html", "json", "md", "svg"];

/// Look at everything that a command line names, before any work.
///
/// # Errors
/// Two names for one file of which one is written, or a file that cannot be written.
pub fn check(command: &Command) -> Result<()> {
    match command {
        Command::Run(arguments) => {
            let csv = arguments.csv.clone().filter(|path| path != Path::new("-"));
            outputs(&scene(&arguments.scene), &Vec::from_iter(Named::option("--csv", &csv)))
        }
        Command::Reduce(arguments) => outputs(&arguments.model.files(), &written(arguments.model.written())),
        Command::Demo(arguments) => {
            let files: Vec<Named> = demo::FILES.map(|name| Named::new("--out", arguments.out.join(name))).to_vec();
            let libraries = library::given(&arguments.libraries)?;
            let libraries = libraries.iter().map(|path| Named::new("--library", path));
            apart(&libraries.collect::<Vec<_>>(), &files)?;
            output_file::try_directory(&arguments.out)
        }
        Command::Study(arguments) => match &arguments.study {
            StudyCommand::Map(arguments) => study(&arguments.scene, arguments.common.out.as_deref(), Vec::new()),
            StudyCommand::Convergence(own) => {
                let read = scene(&own.study.scene).into_iter().chain(own.from.files()).collect::<Vec<_>>();
                outputs(&read, &Vec::from_iter(Named::option("--into", &own.study.into)))?;
                study(&own.study.scene, own.study.common.out.as_deref(), own.from.files())
            }
            StudyCommand::Stability(arguments) => study(&arguments.scene, arguments.common.out.as_deref(), Vec::new()),
            StudyCommand::Error(own) => study(&own.study.scene, own.study.common.out.as_deref(), own.from.files()),
        },
        // Names follow from the scene: see the command.
        Command::Package(_) | Command::Thermal(_) | Command::Inspect(_) => Ok(()),
    }
}

/// The files of a scene.
pub fn scene(argument: &str) -> Vec<Named> {
    let files = scene_source::files(argument).into_iter();
    files
        .enumerate()
        .map(|(index, path)| Named::new(if index == 0 { "SCENE" } else { "a ROM of SCENE" }, path))
        .collect()
}

/// The files that `reduce` was told to write.
fn written(arguments: &Written) -> Vec<Named> {
    let options = [("--output", &arguments.output), ("--inp", &arguments.inp), ("--vtk", &arguments.vtk)];
    options.into_iter().filter_map(|(role, path)| Named::option(role, path)).collect()
}

/// A study names its files itself, in one directory: what is read must not be there under a name of that kind.
pub fn study(argument: &str, out: Option<&Path>, more: Vec<Named>) -> Result<()> {
    let Some(out) = out else { return Ok(()) };
    let directory = identity(out);
    for input in scene(argument).into_iter().chain(more) {
        let kind = input.path.extension().and_then(|kind| kind.to_str()).unwrap_or_default().to_ascii_lowercase();
        let real = output_file::destination(&input.path).unwrap_or_else(|_| input.path.clone());
        let inside = directory.is_some() && identity(real.parent().unwrap_or(Path::new("."))) == directory;
        if inside && STUDY_FILES.contains(&kind.as_str()) {
            let problem =
                format!("holds {}, {}, which a file of the study may replace", input.role, input.path.display());
            return Err(Failure::usage(format!("--out {}", out.display()), problem, "Give another directory"));
        }
    }
    Ok(())
}
