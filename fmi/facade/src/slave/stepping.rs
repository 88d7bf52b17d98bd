//! Communication steps: as a whole, or one internal step at a time for FMI 3.0 intermediate updates.

use tiprub_cosim::StepProgress;
use tiprub_cosim::{shown, shown_time};

use super::{FmiStatus, InstancePhase, Refusal, Result, Slave};

/// Distance by which a step may exceed the stop time, as a fraction of the step: importers add up their communication
/// points, and the sum of many steps misses the stop time by rounding.
const STOP_TOLERANCE: f64 = 1e-3;
/// Permitted excess as a fraction of the stop time, for runs of very many steps.
const STOP_ROUNDING: f64 = 1e-9;

/// With the feature `test-panic`, the communication step size that makes the step panic: an odd number that does not
/// occur otherwise.
#[cfg(feature = "test-panic")]
const PANIC_STEP_SIZE: f64 = 1.234_567_890_123e-5;

impl Slave {
    /// Begins a communication step, which may end early (`partial`) if the maximum number of internal steps is reached;
    /// the phase is [`InstancePhase::Updating`] until the step ends.
    ///
    /// # Errors
    /// A wrong time, an invalid step size, a step beyond the stop time, or too many internal steps; the state is
    /// unchanged.
    pub(crate) fn begin_step(&mut self, current_time: f64, step_size: f64, partial: bool) -> Result<()> {
        let InstancePhase::Stepping { stop } = self.phase else {
            return Err(Refusal::error("a step cannot begin in this phase"));
        };
        if let Some(stop) = stop {
            let end = current_time + step_size;
            let allowance = STOP_TOLERANCE * step_size + STOP_ROUNDING * stop.abs();
            if end - stop > allowance {
                return Err(Refusal::error(format!(
                    "the step from t = {} s with size {} s ends at {} s, after the stop time {} s given at \
                     initialisation. Use a smaller step, or initialise without a stop time",
                    shown_time(current_time),
                    shown(step_size),
                    shown_time(end),
                    shown_time(stop)
                )));
            }
        }
        if partial {
            self.unit.begin_partial_step(current_time, step_size)?;
        } else {
            self.unit.begin_step(current_time, step_size)?;
        }
        self.collect_notes();
        #[cfg(feature = "test-panic")]
        assert!(step_size.to_bits() != PANIC_STEP_SIZE.to_bits(), "panic requested by the panic test");
        self.phase = InstancePhase::Updating { stop, reached: self.unit.time(), fresh: false };
        Ok(())
    }

    /// Computes one internal step. When it finishes the communication step, the phase is [`InstancePhase::Stepping`]
    /// again.
    ///
    /// # Errors
    /// A state that became non-finite; the phase is [`InstancePhase::Failed`] then. Or the maximum number of internal
    /// steps is reached: the phase is [`InstancePhase::Stepping`] as if the step had not begun, or
    /// [`InstancePhase::Updating`] if it can end at the internal step reached.
    pub(crate) fn advance(&mut self) -> Result<StepProgress> {
        let last_good = self.unit.time();
        let InstancePhase::Updating { stop, .. } = self.phase else {
            return Err(Refusal::error("no step is in progress"));
        };
        let progress = match self.unit.advance() {
            Ok(progress) => progress,
            Err(error @ tiprub_cosim::Error::Exhausted(_)) => {
                match &mut self.phase {
                    InstancePhase::Updating { fresh, .. } if self.unit.is_stepping() => *fresh = false,
                    phase => *phase = InstancePhase::Stepping { stop },
                }
                return Err(error.into());
            }
            Err(error) => return Err(self.fail(last_good, error)),
        };
        self.phase = InstancePhase::Updating { stop, reached: progress.time, fresh: progress.finished };
        Ok(progress)
    }

    /// Stops all stepping until a saved state is restored or the instance is reset, and returns the refusal that
    /// reports it.
    fn fail(&mut self, last_good: f64, error: tiprub_cosim::Error) -> Refusal {
        self.phase = InstancePhase::Failed { last_good };
        let mut refusal = Refusal::from(error);
        refusal.message += ". Restore a saved state or reset the instance before the next step";
        refusal
    }

    /// Computes one internal step; returns `None` if the maximum number of internal steps is reached and the
    /// communication step has ended early.
    ///
    /// # Errors
    /// Same as [`Slave::advance`] and [`Slave::end_step`].
    pub(crate) fn advance_partially(&mut self) -> Result<Option<StepProgress>> {
        match self.advance() {
            Err(refusal)
                if refusal.status == FmiStatus::Discard && matches!(self.phase, InstancePhase::Updating { .. }) =>
            {
                self.end_step(true)?;
                let time = self.unit.time();
                self.note(FmiStatus::Ok, format!("ended early at t = {} s: {refusal}", shown_time(time)));
                Ok(None)
            }
            outcome => outcome.map(Some),
        }
    }

    /// Ends the communication step: at its end, or at the internal step reached (early return).
    ///
    /// # Errors
    /// Early return with a state that is not finite; the phase is [`InstancePhase::Failed`] then.
    pub(crate) fn end_step(&mut self, early: bool) -> Result<()> {
        let last_good = self.unit.time();
        if let InstancePhase::Updating { stop, .. } = self.phase {
            if early {
                self.unit.end_step_early().map_err(|error| self.fail(last_good, error))?;
            }
            self.phase = InstancePhase::Stepping { stop };
            self.collect_notes();
        }
        Ok(())
    }

    /// Computes the communication step that was begun, within the maximum number of internal steps. Returns whether the step
    /// ended early, which is possible only for a partial step.
    ///
    /// # Errors
    /// Same as [`Slave::advance`] and [`Slave::end_step`].
    pub(crate) fn finish_step(&mut self) -> Result<bool> {
        self.unit.fly_ahead();
        loop {
            match self.advance_partially()? {
                None => return Ok(true),
                Some(progress) if progress.finished => break,
                Some(_) => {}
            }
        }
        self.end_step(false)?;
        Ok(false)
    }
}
