//! Time integration of a system: recurrences with fixed steps, and the continuous Galerkin method with adaptive steps.
//!
//! A stepper has tables and scratch memory only. Everything that determines the future is in the [`System`].

pub mod galerkin;
mod recurrence;
mod workers;

use std::io;
use std::ops::{Deref, DerefMut};

use tiprub_cosim::persist::StateReader;

use crate::geometry::PrescribedMotion;
use crate::system::{StepFailure, System};
use galerkin::stepper::Galerkin;
pub use recurrence::Recurrence;

/// An interval of a steady phase, between two internal points. In a steady phase, all inputs rest, the rotors turn at
/// constant speed, and steps do not end at internal points. Times are counted from the start of the phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyInterval {
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
    /// Length of the spans (s).
    pub span: f64,
}

/// A method that advances a system in time.
pub trait Stepper {
    /// Fills the tables for internal steps of length `step` (s). Does not allocate.
    fn set_step(&mut self, _step: f64) {}

    /// Sets the largest number of attempted steps since the start of the run ([`System::steps_tried`]), beyond which no island begins a
    /// step.
    fn allow(&mut self, _most_tried: u64) {}

    /// Uses this number of threads, including the caller's, if the method can share its work. Creates or ends the other threads.
    ///
    /// # Errors
    /// If the system cannot create a thread.
    fn use_threads(&mut self, _threads: usize) -> io::Result<()> {
        Ok(())
    }

    /// Advances the system by one internal step to the time described by `drives`, one per contact pair.
    ///
    /// # Errors
    /// A [`StepFailure`]; the state is undefined afterwards.
    fn step(&mut self, system: &mut System, drives: &[PrescribedMotion]) -> Result<(), StepFailure>;

    /// Advances all sectors in free flight by `length` (s) to the time described by `drives`; rotors turn by `turns` relative to
    /// the shapes (rad), with one entry of both per pair. During the flight, prescribed motion is linear in time, except that of
    /// the rotor. Returns false, without any change, if something may come near or if blades vibrate by more than the tolerance.
    fn fly(&mut self, _system: &mut System, _drives: &[PrescribedMotion], _turns: &[f64], _length: f64) -> bool {
        false
    }

    /// Returns whether steps can pass internal points in a steady phase.
    fn supports_steady_phase(&self) -> bool {
        false
    }

    /// Advances the system by an interval of a steady phase, to the prescribed motion `drives` at its end, one per contact
    /// pair.
    ///
    /// # Errors
    /// A [`StepFailure`]; the state is undefined afterwards.
    fn step_in_steady_phase(
        &mut self,
        _system: &mut System,
        _drives: &[PrescribedMotion],
        _interval: SteadyInterval,
    ) -> Result<(), StepFailure> {
        Ok(())
    }

    /// Ends the open steps at a time (s since the start of the steady phase), and the phase.
    ///
    /// # Errors
    /// A [`StepFailure`]; the state is undefined afterwards.
    fn close_steps(&mut self, _system: &mut System, _time: f64) -> Result<(), StepFailure> {
        Ok(())
    }

    /// Makes the current modal loads those at the start of the next step, if the method interpolates loads.
    fn begin_loads(&mut self, _system: &mut System) {}
}

/// The stepper of the scheme of a system.
#[derive(Debug, Clone)]
pub enum TimeStepper {
    /// Two-step recurrences with one step for all structures.
    Recurrence(Recurrence),
    /// Continuous Galerkin with adaptive steps of each island.
    Galerkin(Box<Galerkin>),
}

impl TimeStepper {
    /// Creates the stepper of a system for steps up to `longest` (s); adaptive steps have errors within the fraction `tolerance` of the
    /// smallest clearance. Call it before [`System::start`].
    pub fn new(system: &mut System, longest: f64, tolerance: f64) -> Self {
        system.structures.iter_mut().for_each(|structure| structure.lowest_in_span = Vec::new());
        if system.settings.scheme.properties().adaptive {
            Self::Galerkin(Box::new(Galerkin::new(system, longest, tolerance)))
        } else {
            Self::Recurrence(Recurrence)
        }
    }

    /// Returns whether the method chooses its own steps within an internal step.
    pub fn is_adaptive(&self) -> bool {
        matches!(self, Self::Galerkin(_))
    }

    /// Sets the step size `step` (s) from now on; a running state is converted ([`System::set_step`]).
    pub fn set_step(&mut self, system: &mut System, step: f64) {
        system.set_step(step);
        self.deref_mut().set_step(step);
    }

    /// Sets the step size `step` (s) without conversion of the state, before the first step.
    pub(crate) fn set_first_step(&mut self, system: &mut System, step: f64) {
        system.set_first_step(step);
        self.deref_mut().set_step(step);
    }

    /// Restores a saved state of the system.
    pub fn restore(&mut self, system: &mut System, reader: &mut StateReader) {
        system.restore(reader);
        if system.step_size() > 0.0 {
            self.deref_mut().set_step(system.step_size());
        }
    }
}

impl Deref for TimeStepper {
    type Target = dyn Stepper;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Recurrence(stepper) => stepper,
            Self::Galerkin(stepper) => &**stepper,
        }
    }
}

impl DerefMut for TimeStepper {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Recurrence(stepper) => stepper,
            Self::Galerkin(stepper) => &mut **stepper,
        }
    }
}
