//! `lab`: the studies that are evidence for the product.

use std::process::ExitCode;

use clap::Parser;
use tiprub_lab::cli::Cli;
use tiprub_shell::console::Console;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let console = Console::new(cli.quiet, cli.json);
    match cli.run(&console).and_then(|outcome| console.deliver(&outcome)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console.fail(&failure);
            ExitCode::from(failure.exit_code())
        }
    }
}
