//! `tiprub study`: a question about a scene, answered with pictures and numbers.

use std::path::PathBuf;

use tiprub_shell::{
    Failure, Result,
    console::{Console, Outcome},
    output_file,
};
use tiprub_study as study;
use tiprub_study::{arguments::StudyCommon, error, map};

use crate::cli::{StudyArguments, StudyCommand};

/// Study, write, sum up.
///
/// # Errors
/// A run that fails, or files that cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<Outcome> {
    let (name, common) = match &arguments.study {
        StudyCommand::Map(arguments) => ("map", &arguments.common),
        StudyCommand::Error(arguments) => ("error", &arguments.common),
        StudyCommand::Other(words) => return Err(moved(words.first().map_or("", String::as_str))),
    };
    let directory = directory(name, common);
    output_file::try_directory(&directory)?;
    let study = match &arguments.study {
        StudyCommand::Map(arguments) => map::study(arguments, console)?,
        StudyCommand::Error(arguments) => error::study(arguments, console)?,
        StudyCommand::Other(words) => return Err(moved(words.first().map_or("", String::as_str))),
    };
    study::output::write(&study, &directory)
}

/// Where everything goes.
pub fn directory(name: &str, common: &StudyCommon) -> PathBuf {
    common.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")))
}

/// Studies of the models that ship, which are evidence for the program and none of its commands.
const LABORATORY: [&str; 7] = ["stage", "convergence", "modes", "cube", "conjugacy", "inputs", "stability"];

/// The answer to a study that is none, or is one of the laboratory.
pub fn moved(name: &str) -> Failure {
    if LABORATORY.contains(&name) {
        let problem = "is a study of the models that ship, which has moved to the laboratory in the sources";
        let remedy = format!("Run `cargo run --release -p tiprub-lab -- {name}` there");
        return Failure::usage(name, problem, remedy);
    }
    Failure::usage(format!("study {name}"), "no such study", "Choose `map` or `error`, see `tiprub study --help`")
}
