//! Scenes and models of a sweep: scene files, FMUs, and the arguments of `tiprub reduce`.

use std::{
    path::{Path, PathBuf},
    sync::Mutex,
};

use clap::Parser;
use tiprub_core::Rom;
use tiprub_fmi_host::UnpackedFmu;
use tiprub_gallery::scene_source::{self, SceneText};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_sweep::models::SweepSources;

use crate::{command_names, commands::reduce, reduce_arguments::ModelToReduce};

/// Arguments of `tiprub reduce` in a plan.
#[derive(Debug, Parser)]
#[command(name = "tiprub reduce", no_binary_name = true)]
struct ReductionLine {
    #[command(subcommand)]
    model: ModelToReduce,
}

/// Scenes and models that this program can read.
#[derive(Debug, Default)]
pub struct ProgramSources {
    /// FMUs that have been opened; their files exist as long as this value.
    fmus: Mutex<Vec<UnpackedFmu>>,
}

impl ProgramSources {
    /// Returns the text of the scene in an FMU of this program.
    fn scene_of_fmu(&self, path: &Path) -> Result<SceneText> {
        let resource = |name: &str| name.strip_prefix("resources/").and_then(tiprub_format::largest_resource);
        let fmu = UnpackedFmu::open_part(path, resource)?;
        let scene = fmu.resources().join(tiprub_format::SCENE_FILE);
        if !scene.is_file() {
            let remedy = "Give an FMU that `tiprub package` wrote, or a scene file";
            return Err(Failure::new(path.display(), "the FMU contains no scene", remedy));
        }
        let text = scene_source::text(&scene)?;
        if let Ok(mut fmus) = self.fmus.lock() {
            fmus.push(fmu);
        }
        Ok(SceneText { name: path.display().to_string(), ..text })
    }
}

impl SweepSources for ProgramSources {
    fn scene(&self, argument: &str) -> Result<SceneText> {
        let is_fmu = Path::new(argument).extension().is_some_and(|kind| kind.eq_ignore_ascii_case("fmu"));
        if is_fmu { self.scene_of_fmu(Path::new(argument)) } else { scene_source::text(argument) }
    }

    fn reduction_files(&self, arguments: &str, directory: &Path) -> Result<Vec<PathBuf>> {
        let model = parsed(arguments, directory)?;
        let written = model.written();
        if written.output.is_some() || written.inp.is_some() || written.vtk.is_some() {
            let remedy = "Remove --output, --inp and --vtk from the entry `reduce`";
            return Err(Failure::new(what(arguments), "a sweep writes no files of its models", remedy));
        }
        Ok(model.files().into_iter().map(|file| file.path).collect())
    }

    fn reduce(&self, arguments: &str, directory: &Path, console: &Console) -> Result<Rom> {
        console.print_progress(format_args!("tiprub reduce {arguments}"));
        reduce::rom(&parsed(arguments, directory)?, console)
    }
}

fn what(arguments: &str) -> String {
    format!("reduce = \"{arguments}\"")
}

/// Parses arguments of `tiprub reduce`. Names of files are relative to `directory`.
fn parsed(arguments: &str, directory: &Path) -> Result<ModelToReduce> {
    let beside = |word: &str| {
        let path = directory.join(word);
        if !word.starts_with('-') && path.is_file() { path.display().to_string() } else { word.to_owned() }
    };
    let words = arguments.split_whitespace().map(beside);
    ReductionLine::try_parse_from(words).map(|line| line.model).map_err(|error| {
        let failure = command_names::failure(&error, "tiprub reduce");
        let failure = failure.unwrap_or_else(|| Failure::new("", "requests help", "Give a kind of model and options"));
        failure.at(what(arguments))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reductions_are_checked_before_any_work() {
        let root = tempfile::tempdir().unwrap();
        std::fs::write(root.path().join("blade.inp"), "").unwrap();
        let sources = ProgramSources::default();
        let files = |arguments: &str| sources.reduction_files(arguments, root.path());
        assert_eq!(files("rotor37 --modes 20").unwrap(), Vec::<PathBuf>::new());
        let blade = "blade blade.inp --contact-set TIP --clamp-set ROOT";
        assert_eq!(files(blade).unwrap(), [root.path().join("blade.inp")]);
        for (arguments, problem) in [
            ("rotor38", "rotor38"),
            ("rotor37 --mods 20", "--mods"),
            ("rotor37 --modes many", "many"),
            ("rotor37 -o a.rom.safetensors", "writes no files"),
            ("--help", "requests help"),
            ("", "missing"),
        ] {
            let failure = files(arguments).unwrap_err();
            assert!(failure.problem.contains(problem), "{arguments}: {failure}");
            assert!(failure.to_string().contains(&format!("reduce = \"{arguments}\"")), "{failure}");
        }
    }

    #[test]
    fn fmu_without_a_scene_is_rejected() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.fmu");
        std::fs::write(&path, "no archive").unwrap();
        let failure = ProgramSources::default().scene(&path.display().to_string()).unwrap_err();
        assert!(failure.to_string().contains("a.fmu"), "{failure}");
    }
}
