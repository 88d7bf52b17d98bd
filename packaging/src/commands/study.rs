//! `tiprub study`: a question about the stage that ships, answered with pictures and numbers.

use std::path::PathBuf;

use crate::{
    Failure, Result,
    builtin::DiskModel,
    cli::{StudyArguments, StudyChoice},
    console::{Console, Outcome},
    study::{self, convergence, cube, modes, stage},
};

/// Study, write, sum up.
///
/// # Errors
/// A run that fails, or files that cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<Outcome> {
    refuse_other_options(arguments)?;
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
        StudyChoice::Cube => ("cube", cube::study(arguments, console)?),
        StudyChoice::Stage => ("stage", stage::study(arguments, console)?),
    };
    let directory = arguments.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")));
    study::output::write(&study, &directory)
}

/// Options of another study would be passed over in silence.
fn refuse_other_options(arguments: &StudyArguments) -> Result<()> {
    let asked = arguments.study;
    let given = [
        ("--speed", arguments.speed.is_some(), StudyChoice::Modes, "modes"),
        ("--speeds", arguments.speeds.is_some(), StudyChoice::Stage, "stage"),
        ("--threads", arguments.threads.is_some(), StudyChoice::Stage, "stage"),
    ];
    match given.into_iter().find(|(_, given, study, _)| *given && *study != asked) {
        Some((option, _, _, name)) => {
            Err(Failure::usage(option, format!("it belongs to `study {name}`"), "Leave it out"))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    #[test]
    fn options_of_another_study_are_refused() {
        for (line, wrong) in [
            ("modes --speed 900", None),
            ("stage --speeds 400:900:3 --threads 1", None),
            ("modes --speeds 400:900:3", Some("--speeds")),
            ("stage --speed 900", Some("--speed")),
            ("convergence --threads 2", Some("--threads")),
        ] {
            let words = ["tiprub", "study"].into_iter().chain(line.split(' '));
            let Ok(Cli { command: Command::Study(arguments), .. }) = Cli::try_parse_from(words) else {
                panic!("{line}")
            };
            let refused = refuse_other_options(&arguments).err().map(|failure| failure.what);
            assert_eq!(refused.as_deref(), wrong, "{line}");
        }
    }
}
