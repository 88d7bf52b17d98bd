//! `tiprub study`: a question about a scene, answered with pictures and numbers.

use std::path::PathBuf;

use tiprub_shell::{
    Result,
    console::{Console, Outcome},
    output_file,
};
use tiprub_study::{
    Study,
    arguments::StudyCommon,
    convergence::{self, refine::Source},
    error, map, output, stability,
};

use crate::{
    cli::{StudyArguments, StudyCommand},
    users_model::BladeSource,
};

/// Study, write, sum up.
///
/// # Errors
/// A run that fails, or files that cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<Outcome> {
    type Work<'a> = Box<dyn Fn(&Console) -> Result<Study> + 'a>;
    let (name, common, work): (_, _, Work) = match &arguments.study {
        StudyCommand::Map(own) => ("map", &own.common, Box::new(|console| map::study(own, console))),
        StudyCommand::Error(own) => ("error", &own.common, Box::new(|console| error::study(own, console))),
        StudyCommand::Convergence(own) => {
            let has_source = own.has_source()?;
            let of = move |console: &Console| {
                let source = BladeSource { file: own.file.as_deref(), options: &own.blade };
                convergence::study(&own.study, has_source.then_some(&source as &dyn Source), console)
            };
            ("convergence", &own.study.common, Box::new(of))
        }
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
