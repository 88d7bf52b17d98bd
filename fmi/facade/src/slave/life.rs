//! Life cycle from instantiation to termination: initialisation, termination, reset.

use tiprub_cosim::variables::Causality;

use super::{ExperimentTimes, FmiStatus, InstancePhase, Refusal, Result, Slave, logged};

impl ExperimentTimes {
    /// Checks start and stop time as given by the importer.
    ///
    /// # Errors
    /// Times that are not finite, or a stop time before the start time.
    pub(crate) fn new(start: f64, stop: Option<f64>) -> Result<Self> {
        if !start.is_finite() {
            return Err(Refusal::error(format!("startTime = {start} is not finite. Give a start time in seconds")));
        }
        match stop {
            Some(stop) if !(stop.is_finite() && stop >= start) => Err(Refusal::error(format!(
                "stopTime = {stop} is not a finite time at or after startTime = {start}. Give a later stop time, or \
                 stopTimeDefined = false"
            ))),
            _ => Ok(Self { start, stop }),
        }
    }
}

impl Slave {
    /// Implements `fmi2SetupExperiment`; the last of several calls counts.
    pub(crate) fn set_experiment(&mut self, experiment: ExperimentTimes) {
        if let InstancePhase::Instantiated { experiment: current } = &mut self.phase {
            *current = experiment;
        }
    }

    /// Enters Initialization Mode, with the experiment given here (FMI 3.0) or before (FMI 2.0).
    ///
    /// Nothing is computed yet: parameters can still be set one after the other.
    pub(crate) fn enter_initialisation(&mut self, given: Option<ExperimentTimes>) {
        if let InstancePhase::Instantiated { experiment } = self.phase {
            self.phase = InstancePhase::Initialising { experiment: given.unwrap_or(experiment), before: None };
        }
    }

    /// Updates the outputs: in Initialization Mode and between internal steps they are computed only when requested.
    ///
    /// # Errors
    /// An error of the unit at initialisation; other parameters can then be set and the call repeated.
    pub(super) fn refresh(&mut self) -> Result<()> {
        match &mut self.phase {
            InstancePhase::Initialising { experiment, before: before @ None } => {
                let mut state = vec![0; self.unit.state_size()];
                self.unit.save_state(&mut state)?;
                if let Err(error) = self.unit.initialise(experiment.start) {
                    self.unit.restore_state(&state)?;
                    return Err(error.into());
                }
                *before = Some(state);
            }
            InstancePhase::Updating { fresh: fresh @ false, .. } => {
                self.unit.update_outputs()?;
                *fresh = true;
            }
            _ => {}
        }
        Ok(())
    }

    /// Prepares for setting a value: in Initialization Mode it restores the state before the outputs were computed.
    pub(super) fn invalidate(&mut self) -> Result<()> {
        if let InstancePhase::Initialising { before, .. } = &mut self.phase
            && let Some(state) = before.take()
        {
            self.unit.restore_state(&state)?;
        }
        Ok(())
    }

    /// Exits Initialization Mode. Returns `Warning` if the unit reports a warning; notes leave the status `Ok`.
    ///
    /// # Errors
    /// An error of the unit; the instance stays in Initialization Mode and other parameters can be set.
    pub(crate) fn exit_initialisation(&mut self) -> Result<FmiStatus> {
        self.refresh()?;
        if let InstancePhase::Initialising { experiment, .. } = self.phase {
            self.phase = InstancePhase::Stepping { stop: experiment.stop };
        }
        let warnings: Vec<_> = self.unit.warnings().iter().map(logged).collect();
        let warns = warnings.iter().any(|(status, _)| *status == FmiStatus::Warning);
        let status = if warns { FmiStatus::Warning } else { FmiStatus::Ok };
        self.notes.extend(warnings);
        Ok(status)
    }

    /// Terminates the instance; values can still be read afterwards.
    pub(crate) fn terminate(&mut self) {
        self.unit.terminate();
        self.phase = InstancePhase::Terminated { time: self.time() };
    }

    /// Restores the state after instantiation. Saved states stay valid.
    pub(crate) fn reset(&mut self) {
        self.unit.reset();
        self.strings.clear();
        self.phase = InstancePhase::Instantiated { experiment: ExperimentTimes::default() };
    }

    /// Checks the inputs and outputs that an FMI 3.0 importer will access during intermediate updates.
    ///
    /// # Errors
    /// An unknown reference, or a variable that is not an input, an output or the time.
    pub(crate) fn check_intermediate_variables(&self, references: &[u32]) -> Result<()> {
        for &reference in references {
            let (variable, index) = self.unit.table().locate(reference)?;
            let accessible = [Causality::Input, Causality::Output, Causality::Independent];
            if !accessible.contains(&variable.causality) {
                return Err(Refusal::error(format!(
                    "requiredIntermediateVariables contains {} (value reference {reference}), which is neither an \
                     input nor an output. Remove it",
                    variable.element_name(index)
                )));
            }
        }
        Ok(())
    }
}
