//! `tiprub study`: a question about the stage that ships, answered with pictures and numbers.

use std::path::PathBuf;

use crate::{
    Result,
    builtin::DiskModel,
    cli::{StudyArguments, StudyChoice},
    console::{Console, Outcome},
    study::{self, convergence, modes, stage},
};

/// Study, write, sum up.
///
/// # Errors
/// A run that fails, or files that cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<Outcome> {
    let quick = arguments.quick;
    let (name, study) = match arguments.study {
        StudyChoice::Convergence => {
            let (reduction, _) = DiskModel::new(quick).reduce(console)?;
            ("convergence", convergence::study(&reduction, quick)?)
        }
        StudyChoice::Modes => {
            let (reduction, mesh) = DiskModel::new(quick).reduce(console)?;
            ("modes", modes::study(&reduction, &mesh, arguments.speed, quick)?)
        }
        StudyChoice::Stage => ("stage", stage::study(arguments, console)?),
    };
    let directory = arguments.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")));
    study::output::write(&study, &directory)
}
