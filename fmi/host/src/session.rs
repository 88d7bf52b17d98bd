//! One instance of an imported FMU, driven call by call.

use std::time::{Duration, Instant};

use tiprub_core::scene::settings::ExperimentSettings;
use tiprub_shell::{Failure, Result, recording::Recording, schedule::Schedule};

use super::{
    ImportedRun, ImportedVariable, UnpackedFmu, fmi2, fmi3,
    slave::{self, HostedSlave, OutputGroup},
};

/// A co-simulation instance; freed when dropped. A call with a status worse than Warning is a failure with the message
/// of the FMU.
pub struct Session<'a> {
    fmu: &'a UnpackedFmu,
    slave: Box<dyn HostedSlave>,
    groups: Vec<OutputGroup>,
}

impl std::fmt::Debug for Session<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "instance of {}", self.fmu.description.model_name)
    }
}

impl<'a> Session<'a> {
    /// Loads the library and creates an instance.
    ///
    /// # Errors
    /// Same as [`UnpackedFmu::simulate`].
    pub fn new(fmu: &'a UnpackedFmu) -> Result<Self> {
        let slave: Box<dyn HostedSlave> = match fmu.description.fmi_version.as_str() {
            "2.0" => Box::new(fmi2::Fmi2Slave::new(fmu)?),
            "3.0" => Box::new(fmi3::Fmi3Slave::new(fmu)?),
            other => {
                let problem = format!("FMI version {other} is not supported");
                return Err(Failure::new("FMU", problem, "Use FMI 2.0 or 3.0"));
            }
        };
        Ok(Self { fmu, slave, groups: slave::group_outputs(&fmu.description) })
    }

    /// Sets a scalar, or the first element of an array written as scalars.
    ///
    /// # Errors
    /// No variable of this name, or an error of the FMU.
    pub fn set_real(&mut self, name: &str, value: f64) -> Result<()> {
        let first = format!("{name}[1]");
        let found =
            self.fmu.description.variables.iter().find(|variable| variable.name == name || variable.name == first);
        let missing = || Failure::new("FMU", format!("has no variable {name}"), "");
        self.slave.set_real(found.ok_or_else(missing)?.reference, value)
    }

    /// Goes from instantiated to step mode.
    ///
    /// # Errors
    /// An error of the FMU.
    pub fn initialise(&mut self, start: f64) -> Result<()> {
        let experiment = ExperimentSettings { start, stop: start + 1.0, communication_step: 1.0 };
        self.slave.initialise(&Schedule::new(&experiment, None, None)?)
    }

    /// Performs one communication step (s).
    ///
    /// # Errors
    /// An error of the FMU.
    pub fn do_step(&mut self, time: f64, step: f64) -> Result<()> {
        self.slave.do_step(time, step)
    }

    /// Returns all numeric outputs, in file order.
    ///
    /// # Errors
    /// An error of the FMU.
    pub fn outputs(&mut self) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        self.read(&mut values)?;
        Ok(values)
    }

    fn read(&mut self, values: &mut Vec<f64>) -> Result<()> {
        self.groups.iter().try_for_each(|group| self.slave.read(group, values))
    }

    /// Runs the instance over the schedule and terminates it; records all numeric outputs at every communication point.
    pub(crate) fn run(&mut self, schedule: &Schedule, progress: &dyn Fn(usize)) -> Result<ImportedRun> {
        let names = self.fmu.description.numeric_outputs().flat_map(ImportedVariable::scalar_names).collect();
        let mut recording = Recording::with_columns(names, schedule.count + 1)?;
        let mut stepping = Duration::ZERO;
        self.slave.initialise(schedule)?;
        for index in 0..=schedule.count {
            let time = schedule.time(index);
            recording.times.push(time);
            self.read(&mut recording.values)?;
            progress(index);
            if index < schedule.count {
                let clock = Instant::now();
                self.slave.do_step(time, schedule.time(index + 1) - time)?;
                stepping += clock.elapsed();
            }
        }
        self.slave.terminate()?;
        Ok(ImportedRun { recording, stepping, messages: self.slave.messages() })
    }
}
