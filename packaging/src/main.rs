//! The `tiprub` command line.

use std::process::ExitCode;

use clap::Parser;
use tiprub_packaging::{
    cli::{self, Cli},
    commands,
};
use tiprub_shell::console::Console;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            if let Some(failure) = cli::usage_failure(&error, std::env::args_os().skip(1)) {
                Console::new(true, true).answer(&failure);
            }
            error.exit()
        }
    };
    let console = Console::new(cli.quiet, cli.json);
    match commands::run(&cli.command, &console).and_then(|outcome| console.deliver(&outcome)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console.fail(&failure);
            ExitCode::from(failure.exit_code())
        }
    }
}
