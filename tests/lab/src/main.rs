//! `lab`: the studies that provide evidence for the product.

use std::{ffi::OsString, process::ExitCode};

use tiprub_lab::cli::LabCli;
use tiprub_packaging::command_names;
use tiprub_shell::console::Console;

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let cli: LabCli = command_names::parsed(&Console::new(true, command_names::asks_for_json(&arguments)));
    let console = Console::new(cli.quiet, cli.json);
    console.finish(cli.run(&console))
}
