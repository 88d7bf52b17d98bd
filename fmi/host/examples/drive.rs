//! Drives an FMU through its C ABI over its default experiment, or over a given number of communication steps, and
//! prints all outputs as CSV: `drive FILE.fmu [STEPS]`. Cross-compiled, it compares platforms to the bit
//! (`tests/importers`).

use std::process::ExitCode;

use tiprub_core::scene::settings::ExperimentSettings;
use tiprub_fmi_host::UnpackedFmu;
use tiprub_shell::{Failure, Result, schedule::Schedule};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match drive(&arguments) {
        Ok(table) => {
            print!("{table}");
            ExitCode::SUCCESS
        }
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}

fn drive(arguments: &[String]) -> Result<String> {
    let usage = || Failure::usage("drive", "needs a file and at most a number of steps", "Give FILE.fmu [STEPS]");
    let (file, steps) = match arguments {
        [file] => (file, None),
        [file, steps] => (file, Some(steps.parse::<u32>().map_err(|_| usage())?)),
        _ => return Err(usage()),
    };
    let fmu = UnpackedFmu::open(file.as_ref())?;
    let of_experiment = |key: &str| fmu.description.experiment.get(key).copied().unwrap_or_default();
    let experiment = ExperimentSettings {
        start: of_experiment("startTime"),
        stop: of_experiment("stopTime"),
        communication_step: of_experiment("stepSize"),
    };
    let stop = steps.map(|steps| experiment.start + f64::from(steps) * experiment.communication_step);
    let schedule = Schedule::new(&experiment, stop, None)?;
    Ok(fmu.simulate(&schedule, &|_| {})?.recording.to_csv())
}
