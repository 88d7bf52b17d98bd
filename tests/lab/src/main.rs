//! `lab`: the studies that are evidence for the product.

use std::{ffi::OsString, process::ExitCode};

use tiprub_lab::cli::LabCli;
use tiprub_packaging::spelling;
use tiprub_shell::console::Console;

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let cli: LabCli = spelling::parsed(&Console::new(true, spelling::asks_for_json(&arguments)));
    let console = Console::new(cli.quiet, cli.json);
    console.finish(cli.run(&console))
}
