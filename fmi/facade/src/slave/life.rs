//! From instantiated to terminated and back: initialisation, termination, reset.

use tiprub_core::variables::Causality;

use super::{ExperimentTimes, FmiStatus, InstancePhase, Refusal, Result, Slave, logged};

impl ExperimentTimes {
    /// Check start and stop time as an importer gives them.
    ///
    /// # Errors
    /// Non-finite times, stop before start.
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
    /// `fmi2SetupExperiment`; may be called again, the last call counts.
    pub(crate) fn set_experiment(&mut self, experiment: ExperimentTimes) {
        if let InstancePhase::Instantiated { experiment: current } = &mut self.phase {
            *current = experiment;
        }
    }

    /// Enter Initialization Mode, with the experiment given here (FMI 3.0) or before (FMI 2.0).
    ///
    /// Nothing is computed yet: parameters may still be set one after the other.
    pub(crate) fn enter_initialisation(&mut self, given: Option<ExperimentTimes>) {
        if let InstancePhase::Instantiated { experiment } = self.phase {
            self.phase = InstancePhase::Initialising { experiment: given.unwrap_or(experiment), before: None };
        }
    }

    /// Bring outputs up to date: in Initialization Mode and between internal steps they are computed when asked for.
    ///
    /// # Errors
    /// The core's refusal to initialise; other parameters can then be set and the call repeated.
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
            InstancePhase::Updating { fresh: fresh @ false, reached, .. } => {
                self.unit.update_outputs(*reached)?;
                *fresh = true;
            }
            _ => {}
        }
        Ok(())
    }

    /// A value is about to be set: in Initialization Mode go back to before the outputs were computed.
    pub(super) fn invalidate(&mut self) -> Result<()> {
        if let InstancePhase::Initialising { before, .. } = &mut self.phase
            && let Some(state) = before.take()
        {
            self.unit.restore_state(&state)?;
        }
        Ok(())
    }

    /// Exit Initialization Mode. `Warning` if the core warns of something; notes leave the status `Ok`.
    ///
    /// # Errors
    /// The core's refusal; the instance stays in Initialization Mode and can be given other parameters.
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

    /// Terminate; values can still be read afterwards.
    pub(crate) fn terminate(&mut self) {
        self.phase = InstancePhase::Terminated { time: self.time() };
    }

    /// Back to the state after instantiation. Saved states stay valid.
    pub(crate) fn reset(&mut self) {
        self.unit.reset();
        self.strings.clear();
        self.phase = InstancePhase::Instantiated { experiment: ExperimentTimes::default() };
    }

    /// FMI 3.0: the inputs and outputs which the importer means to access during intermediate updates.
    ///
    /// # Errors
    /// A reference that does not exist, or is no input, output or time.
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
