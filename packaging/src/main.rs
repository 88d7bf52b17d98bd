//! The `tiprub` command line.

use std::{ffi::OsString, process::ExitCode};

use tiprub_packaging::{cli::Cli, commands, spelling};
use tiprub_shell::console::Console;

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let asked = Console::new(true, spelling::asks_for_json(&arguments));
    if let Some(failure) = spelling::of_before(&arguments) {
        asked.fail(&failure);
        return ExitCode::from(failure.exit_code());
    }
    let cli: Cli = spelling::parsed(&asked);
    let console = Console::new(cli.quiet, cli.json);
    match commands::run(&cli.command, &console).and_then(|outcome| console.deliver(&outcome)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console.fail(&failure);
            ExitCode::from(failure.exit_code())
        }
    }
}
