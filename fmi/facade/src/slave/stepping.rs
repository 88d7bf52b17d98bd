//! Communication steps: whole, or internal step by internal step for FMI 3.0 intermediate updates.

use tiprub_core::simulation::StepProgress;
use tiprub_core::{shown, shown_time};

use super::{FmiStatus, InstancePhase, Refusal, Result, Slave};

/// Distance by which a step may end beyond the stop time, as a fraction of the step: importers add up their communication points, and the sum of many
/// steps misses the stop time by rounding.
const STOP_TOLERANCE: f64 = 1e-3;
/// The same as a fraction of the stop time, for runs of very many steps.
const STOP_ROUNDING: f64 = 1e-9;

/// With the feature `test-panic`, the communication step size that makes the step panic: an odd number that nobody uses.
#[cfg(feature = "test-panic")]
const PANIC_STEP_SIZE: f64 = 1.234_567_890_123e-5;

impl Slave {
    /// Begin a communication step, which may end early (`partial`) where the internal steps allowed are used up; the phase becomes
    /// [`InstancePhase::Updating`] until it is ended.
    ///
    /// # Errors
    /// Wrong time, bad step size, a step beyond the stop time, too many internal steps; the state is as before.
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
        self.unit.begin_step(current_time, step_size, partial)?;
        self.collect_notes();
        #[cfg(feature = "test-panic")]
        assert!(step_size.to_bits() != PANIC_STEP_SIZE.to_bits(), "panic requested by the panic test");
        self.phase = InstancePhase::Updating { stop, reached: self.unit.time(), fresh: false };
        Ok(())
    }

    /// March one internal step. When it finishes the communication step, the phase is [`InstancePhase::Stepping`] again.
    ///
    /// # Errors
    /// The state became non-finite; the phase is [`InstancePhase::Failed`] then. Or the internal steps allowed are used up: the phase is
    /// [`InstancePhase::Stepping`] as if the step had not begun, or [`InstancePhase::Updating`] where it may end at the internal step reached.
    pub(crate) fn advance(&mut self) -> Result<StepProgress> {
        let last_good = self.unit.time();
        let InstancePhase::Updating { stop, .. } = self.phase else {
            return Err(Refusal::error("no step is in progress"));
        };
        let progress = match self.unit.advance() {
            Ok(progress) => progress,
            Err(error @ tiprub_core::Error::Exhausted { .. }) => {
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

    /// Ends all stepping until a saved state is restored or the instance is reset, and returns the refusal that says so.
    fn fail(&mut self, last_good: f64, error: tiprub_core::Error) -> Refusal {
        self.phase = InstancePhase::Failed { last_good };
        let Refusal { status, message } = error.into();
        Refusal {
            status,
            message: format!("{message}. Restore a saved state or reset the instance before the next step"),
        }
    }

    /// March one internal step; `None` where the internal steps allowed are used up, and the communication step has ended early.
    ///
    /// # Errors
    /// As [`Slave::advance`] and [`Slave::end_step`].
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

    /// End the communication step: at its end, or at the internal step reached (early return).
    ///
    /// # Errors
    /// Early: the state is not finite; the phase is [`InstancePhase::Failed`] then.
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

    /// A whole communication step.
    ///
    /// # Errors
    /// As [`Slave::begin_step`] and [`Slave::advance`].
    pub(crate) fn step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin_step(current_time, step_size, false)?;
        self.unit.fly_ahead();
        while !self.advance()?.finished {}
        self.end_step(false)
    }

    /// A communication step, or as much of it as the internal steps allowed are enough for; whether it ended early.
    ///
    /// # Errors
    /// As [`Slave::step`]; where not even one internal step is allowed, [`FmiStatus::Discard`].
    pub(crate) fn step_partially(&mut self, current_time: f64, step_size: f64) -> Result<bool> {
        self.begin_step(current_time, step_size, true)?;
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
