//! `tiprub study`: answers a question about a scene with pictures and numbers.

use serde_json::json;

use tiprub_shell::{
    Result,
    console::{CommandOutcome, Console, shown_path},
    output_file,
};
use tiprub_study::{
    StudyOutcome,
    convergence::{self, EstimatedRom, refine::RomSource},
    error, estimate, map, output, stability,
};
use tiprub_sweep::tasks::{FinishedPart, TaskJournals};

use crate::{
    cli::{StudyArguments, StudyCommand},
    commands::reduce::check_target,
    mesh_arguments::ConvergenceCommand,
    user_mesh::BladeSource,
};

/// Runs the study, writes its files, and summarises.
///
/// # Errors
/// A run fails, or files cannot be written.
pub fn run(arguments: &StudyArguments, console: &Console) -> Result<CommandOutcome> {
    type Work<'a> = Box<dyn Fn(&Console) -> Result<StudyOutcome> + 'a>;
    let (name, common, work): (_, _, Work) = match &arguments.study {
        StudyCommand::Map(own) => ("map", &own.common, Box::new(|console| map::study(own, console))),
        StudyCommand::Error(own) => {
            let given = own.from.is_given()?;
            let of = move |console: &Console| {
                let source = BladeSource::of(&own.from);
                error::study(&own.study, given.then_some(&source as &dyn RomSource), console).map(StudyOutcome::from)
            };
            ("error", &own.study.common, Box::new(of))
        }
        StudyCommand::Convergence(own) => return convergence(own, console),
        StudyCommand::Stability(own) => ("stability", &own.common, Box::new(|console| stability::study(own, console))),
    };
    let directory = common.directory(name);
    output_file::try_directory(&directory)?;
    match work(console)? {
        StudyOutcome::Finished(study, journals) => {
            let outcome = output::write(&study, &directory)?;
            journals.map_or(Ok(()), TaskJournals::remove)?;
            Ok(outcome)
        }
        StudyOutcome::Part(part) => Ok(part_outcome(&part)),
    }
}

/// Runs the convergence study, which may also write a ROM.
fn convergence(own: &ConvergenceCommand, console: &Console) -> Result<CommandOutcome> {
    let given = own.from.is_given()?;
    let directory = own.study.common.directory("convergence");
    output_file::try_directory(&directory)?;
    if let Some(path) = &own.study.into {
        check_target(path, own.study.force)?;
    }
    let source = BladeSource::of(&own.from);
    let (study, EstimatedRom { rom, known }) =
        convergence::study(&own.study, given.then_some(&source as &dyn RomSource), console)?;
    let mut outcome = output::write(&study, &directory)?;
    if let Some(path) = &own.study.into {
        output_file::write(path, tiprub_format::write_rom(&rom))?;
        outcome.json["rom"] = shown_path(path).into();
        outcome.text.push_str(&format!("\nwritten: {}", path.display()));
        if known {
            outcome.text.push_str(&format!("\n{}", estimate::errors_text(&estimate::of_rom(&rom))));
        } else {
            let warning = format!(
                "{} contains the ROM unchanged: no error due to its modes, patches or mesh could be determined, for the reasons \
                 above",
                path.display()
            );
            outcome.text.push_str(&format!("\nwarning: {warning}"));
            outcome.json["warnings"] = vec![warning].into();
        }
    }
    Ok(outcome)
}

/// Summarises a part of a study.
fn part_outcome(FinishedPart { part, tasks, all, journal }: &FinishedPart) -> CommandOutcome {
    let text = format!(
        "part {part}: {tasks} of {all} runs are finished; their results are in {}\n\
         When all parts are finished, run the same command without --part to make the study",
        journal.display()
    );
    let json = json!({ "part": part.to_string(), "runs": tasks, "all_runs": all, "journal": shown_path(journal) });
    CommandOutcome { text, json, ..CommandOutcome::default() }
}
