//! One module per command; each turns its arguments into an [`Outcome`] or a [`Failure`](crate::Failure).

pub mod demo;
pub mod inspect;
pub mod package;
pub mod reduce;
pub mod run;
pub mod stability;
pub mod study;

use crate::{
    Result,
    cli::Command,
    console::{Console, Outcome},
};

/// Run the command.
///
/// # Errors
/// What the command could not do.
pub fn run(command: &Command, console: &Console) -> Result<Outcome> {
    match command {
        Command::Demo(arguments) => demo::run(arguments, console),
        Command::Reduce(arguments) => reduce::run(arguments, console),
        Command::Package(arguments) => package::run(arguments, console),
        Command::Run(arguments) => run::run(arguments, console),
        Command::Inspect(arguments) => inspect::run(arguments, console),
        Command::Stability(arguments) => stability::run(arguments, console),
        Command::Study(arguments) => study::run(arguments, console),
    }
}
