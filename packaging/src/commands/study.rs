//! `tiprub study`: a question about a model that ships, or about a scene, answered with pictures and numbers.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::{
    Failure, Result,
    builtin::DiskModel,
    cli::{StudyArguments, StudyChoice},
    console::{Console, Outcome},
    output_file,
    study::{self, conjugacy, convergence, cube, error, inputs, map, modes, stage},
};

/// Study, write, sum up.
///
/// # Errors
/// A run that fails, or files that cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<Outcome> {
    refuse_other_options(arguments)?;
    let quick = arguments.quick;
    let directory = directory(arguments);
    output_file::try_directory(&directory)?;
    let study = match arguments.study {
        StudyChoice::Convergence => {
            let (reduction, _) = DiskModel::new(quick).reduce(console)?;
            convergence::study(&reduction, quick)?
        }
        StudyChoice::Modes => {
            let (reduction, mesh) = DiskModel::new(quick).reduce(console)?;
            modes::study(&reduction, &mesh, arguments.speed, quick)?
        }
        StudyChoice::Cube => cube::study(arguments, console)?,
        StudyChoice::Stage => stage::study(arguments, console)?,
        StudyChoice::Map => map::study(arguments, console)?,
        StudyChoice::Error => error::study(arguments, console)?,
        StudyChoice::Conjugacy => conjugacy::study(quick)?,
        StudyChoice::Inputs => inputs::study(arguments, console)?,
    };
    study::output::write(&study, &directory)
}

/// Where everything goes.
fn directory(arguments: &StudyArguments) -> PathBuf {
    let name = arguments.study.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
    arguments.out.clone().unwrap_or_else(|| PathBuf::from(format!("study-{name}")))
}

/// Options of another study would be passed over in silence.
fn refuse_other_options(arguments: &StudyArguments) -> Result<()> {
    use StudyChoice::{Error, Map, Modes, Stage};
    let given: [(&str, bool, &[StudyChoice], &str); 8] = [
        ("--speed", arguments.speed.is_some(), &[Modes], "modes"),
        ("--speeds", arguments.speeds.is_some(), &[Stage, Map], "stage` and `study map"),
        ("--threads", arguments.threads.is_some(), &[Stage, Map], "stage` and `study map"),
        ("SCENE", arguments.scene.is_some(), &[Map], "map"),
        ("--scene", !arguments.scenes.is_empty(), &[Error], "error"),
        ("--revolutions", arguments.revolutions.is_some(), &[Map], "map"),
        ("--transient", arguments.transient.is_some(), &[Map], "map"),
        ("--set", !arguments.set.is_empty(), &[Map], "map"),
    ];
    match given.into_iter().find(|(_, given, studies, _)| *given && !studies.contains(&arguments.study)) {
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
            ("error --scene carpenter --scene rotor37-light", None),
            ("modes --scene carpenter", Some("--scene")),
            ("convergence --threads 2", Some("--threads")),
            ("map scene.toml --speeds 400:900:3 --threads 1 --revolutions 8 --transient 0 --set a=1", None),
            ("stage scene.toml", Some("SCENE")),
            ("stage --revolutions 8", Some("--revolutions")),
            ("modes --transient 8", Some("--transient")),
            ("convergence --set a=1", Some("--set")),
        ] {
            let words = ["tiprub", "study"].into_iter().chain(line.split(' '));
            let Ok(Cli { command: Command::Study(arguments), .. }) = Cli::try_parse_from(words) else {
                panic!("{line}")
            };
            let name = line.split(' ').next().unwrap();
            assert_eq!(directory(&arguments), PathBuf::from(format!("study-{name}")));
            let refused = refuse_other_options(&arguments).err().map(|failure| failure.what);
            assert_eq!(refused.as_deref(), wrong, "{line}");
        }
    }
}
