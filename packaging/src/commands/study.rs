//! `tiprub study`: a question about a scene, answered with pictures and numbers.

use std::path::PathBuf;

use tiprub_shell::{
    Failure, Result,
    console::{Console, Outcome},
    output_file,
};
use tiprub_study::{Study, arguments::StudyCommon, error, map, output, stability};

use crate::cli::{StudyArguments, StudyCommand};

/// Study, write, sum up.
///
/// # Errors
/// A run that fails, or files that cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<Outcome> {
    type Work<'a> = Box<dyn Fn(&Console) -> Result<Study> + 'a>;
    let (name, common, work): (_, _, Work) = match &arguments.study {
        StudyCommand::Map(own) => ("map", &own.common, Box::new(|console| map::study(own, console))),
        StudyCommand::Error(own) => ("error", &own.common, Box::new(|console| error::study(own, console))),
        StudyCommand::Stability(own) => ("stability", &own.common, Box::new(|console| stability::study(own, console))),
        StudyCommand::Other(words) => return Err(moved(words.first().map_or("", String::as_str))),
    };
    let directory = directory(name, common);
    output_file::try_directory(&directory)?;
    output::write(&work(console)?, &directory)
}

/// Where everything goes.
pub fn directory(name: &str, common: &StudyCommon) -> PathBuf {
    common.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")))
}

/// Studies of the models that ship, which are evidence for the program and none of its commands.
const LABORATORY: [&str; 5] = ["stage", "modes", "cube", "conjugacy", "inputs"];

/// The answer to what was `tiprub stability`.
pub fn stability_moved() -> Failure {
    let problem = "of a scene it is a study; stiff and extreme cases have moved to the laboratory in the sources";
    let remedy = "Run `tiprub study stability SCENE`, or `cargo run --release -p tiprub-lab -- stability` there";
    Failure::usage("stability", problem, remedy)
}

/// The answer to a study that is none, or is one of the laboratory.
pub fn moved(name: &str) -> Failure {
    if LABORATORY.contains(&name) {
        let problem = "is a study of the models that ship, which has moved to the laboratory in the sources";
        let remedy = format!("Run `cargo run --release -p tiprub-lab -- {name}` there");
        return Failure::usage(name, problem, remedy);
    }
    Failure::usage(
        format!("study {name}"),
        "no such study",
        "Choose `map`, `error` or `stability`, see `tiprub study --help`",
    )
}
