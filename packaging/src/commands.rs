//! One module per command; each converts its arguments to a [`CommandOutcome`] or a [`Failure`].

pub mod demo;
pub mod inspect;
pub mod package;
pub mod reduce;
pub mod run;
pub mod study;
pub mod sweep;
pub mod thermal;

use std::panic::{AssertUnwindSafe, catch_unwind};

use tiprub_shell::{
    Failure, Result,
    console::{CommandOutcome, Console},
};

use crate::{cli::Command, command_files};

/// Runs the command. Before any output or long work, it checks that no output would replace an input or another output.
///
/// # Errors
/// The failure of the command. A panic of the program is also returned as a failure.
pub fn run(command: &Command, console: &Console) -> Result<CommandOutcome> {
    walled(|| {
        command_files::check(command)?;
        match command {
            Command::Demo(arguments) => demo::run(arguments, console),
            Command::Reduce(arguments) => reduce::run(arguments, console),
            Command::Package(arguments) => package::run(arguments, console),
            Command::Thermal(arguments) => thermal::run(arguments, console),
            Command::Run(arguments) => run::run(arguments, console),
            Command::Inspect(arguments) => inspect::run(arguments, console),
            Command::Study(arguments) => study::run(arguments, console),
            Command::Sweep(arguments) => sweep::run(arguments, console),
        }
    })
}

/// Converts a panic to a failure; its location was already printed on stderr.
fn walled(work: impl FnOnce() -> Result<CommandOutcome>) -> Result<CommandOutcome> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
        let problem = format!("an internal error stopped the program: {}", text.unwrap_or("no message"));
        let remedy = "Report it to the developers, with the command line, its files and the messages above";
        Err(Failure::new("tiprub", problem, remedy))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_is_reported_as_a_failure() {
        let said: [fn() -> Result<CommandOutcome>; 2] = [|| panic!("index {} too large", 7), || panic!("plain")];
        for (panics, words) in said.into_iter().zip(["index 7 too large", "plain"]) {
            let failure = walled(panics).unwrap_err();
            assert_eq!(failure.exit_code(), 1);
            assert!(failure.problem.contains(words) && failure.remedy.contains("Report"), "{failure}");
        }
    }
}
