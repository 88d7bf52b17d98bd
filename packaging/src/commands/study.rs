//! `tiprub study`: a question about a scene, answered with pictures and numbers.

use std::path::PathBuf;

use tiprub_shell::{
    Result,
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
    };
    let directory = directory(name, common);
    output_file::try_directory(&directory)?;
    output::write(&work(console)?, &directory)
}

/// Where everything goes.
pub fn directory(name: &str, common: &StudyCommon) -> PathBuf {
    common.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")))
}
