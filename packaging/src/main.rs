//! The `tiprub` command line.

use std::process::ExitCode;

use clap::Parser;
use tiprub_packaging::{cli::Cli, commands, console::Console};

fn main() -> ExitCode {
    let cli = Cli::parse();
    let console = Console::new(cli.quiet, cli.json);
    match commands::run(&cli.command, &console).and_then(|outcome| console.deliver(&outcome)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console.fail(&failure);
            ExitCode::from(failure.exit_code())
        }
    }
}
