//! A compiled scene with its state: what an FMU instance, the native run and the tests all drive.

use crate::{Result, Scene, VariableTable};

/// What one call of [`Simulation::advance`] did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Internal time reached (s).
    pub time: f64,
    /// True when the communication point is reached (and outputs are up to date there).
    pub finished: bool,
}

/// A scene compiled into kernels, and its state.
///
/// Life: [`Simulation::new`] → set parameters and inputs → [`Simulation::initialise`] → any number of
/// [`Simulation::do_step`] → ([`Simulation::reset`] and again). The caller (the FMU slave) keeps track of which
/// calls are legal when; this type only refuses what would be meaningless.
#[derive(Debug)]
pub struct Simulation {
    table: VariableTable,
}

impl Simulation {
    /// Compile a scene. Start values are in place, nothing is computed yet.
    ///
    /// # Errors
    /// Invalid settings or ROM, refused combinations.
    pub fn new(_scene: &Scene) -> Result<Self> {
        unimplemented!()
    }

    /// The variable table.
    pub fn table(&self) -> &VariableTable {
        &self.table
    }

    /// Read one element of a real variable (inputs and parameters give back what was set).
    ///
    /// # Errors
    /// Unknown reference, or not a real.
    pub fn real(&self, _reference: u32) -> Result<f64> {
        unimplemented!()
    }

    /// Read an integer or enumeration variable.
    ///
    /// # Errors
    /// Unknown reference, or neither integer nor enumeration.
    pub fn integer(&self, _reference: u32) -> Result<i32> {
        unimplemented!()
    }

    /// Read a boolean variable.
    ///
    /// # Errors
    /// Unknown reference, or not a boolean.
    pub fn boolean(&self, _reference: u32) -> Result<bool> {
        unimplemented!()
    }

    /// Read a string variable.
    ///
    /// # Errors
    /// Unknown reference, or not a string.
    pub fn string(&self, _reference: u32) -> Result<&str> {
        unimplemented!()
    }

    /// Set one element of a real input or parameter. Value must be finite and within min and max. Clears a
    /// derivative given for the same input.
    ///
    /// # Errors
    /// Unknown reference, wrong kind, not settable, non-finite, out of range; nothing is changed then.
    pub fn set_real(&mut self, _reference: u32, _value: f64) -> Result<()> {
        unimplemented!()
    }

    /// Set an integer or enumeration parameter.
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn set_integer(&mut self, _reference: u32, _value: i32) -> Result<()> {
        unimplemented!()
    }

    /// Set a boolean parameter.
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn set_boolean(&mut self, _reference: u32, _value: bool) -> Result<()> {
        unimplemented!()
    }

    /// Set a string parameter.
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn set_string(&mut self, _reference: u32, _value: &str) -> Result<()> {
        unimplemented!()
    }

    /// First time derivative of a continuous real input, valid from now until the input is set again.
    ///
    /// # Errors
    /// Unknown reference, not a continuous real input, order other than 1, non-finite.
    pub fn set_input_derivative(&mut self, _reference: u32, _order: i32, _value: f64) -> Result<()> {
        unimplemented!()
    }

    /// First time derivative of a continuous real output at the last communication point.
    ///
    /// # Errors
    /// Unknown reference, not a continuous real output, order other than 1.
    pub fn output_derivative(&self, _reference: u32, _order: i32) -> Result<f64> {
        unimplemented!()
    }

    /// Check parameters against stability and solvability limits and set the state to the start.
    ///
    /// # Errors
    /// Refusals with numbers and remedy; the instance can be given other parameters and asked again.
    pub fn initialise(&mut self, _start_time: f64) -> Result<()> {
        unimplemented!()
    }

    /// Warnings collected by the last [`Simulation::initialise`] (unresolved modes and the like).
    pub fn warnings(&self) -> &[String] {
        unimplemented!()
    }

    /// Current time (s): the end of the last finished (or early-returned) step.
    pub fn time(&self) -> f64 {
        unimplemented!()
    }

    /// Begin a communication step of length H from the current time, landing exactly on `current_time + step_size`.
    ///
    /// # Errors
    /// Step size not positive and finite, or `current_time` further than 1e-6·H from [`Simulation::time`].
    pub fn begin_step(&mut self, _current_time: f64, _step_size: f64) -> Result<()> {
        unimplemented!()
    }

    /// March one internal step of the communication step begun. Inputs may be set between calls.
    ///
    /// # Errors
    /// Non-finite state; the simulation must then be reset or restored.
    pub fn advance(&mut self) -> Result<Progress> {
        unimplemented!()
    }

    /// End the communication step here, before its end (early return): outputs cover the part done.
    pub fn end_step_early(&mut self) {
        unimplemented!()
    }

    /// `begin_step`, then `advance` to the end.
    ///
    /// # Errors
    /// As those two.
    pub fn do_step(&mut self, _current_time: f64, _step_size: f64) -> Result<()> {
        unimplemented!()
    }

    /// Back to the state after [`Simulation::new`]: start values everywhere.
    pub fn reset(&mut self) {
        unimplemented!()
    }

    /// Size of a saved state in bytes (constant for a given scene).
    pub fn state_size(&self) -> usize {
        unimplemented!()
    }

    /// Write everything that determines the future into `buffer` (exactly [`Simulation::state_size`] bytes).
    ///
    /// # Errors
    /// Buffer of the wrong length.
    pub fn save_state(&self, _buffer: &mut [u8]) -> Result<()> {
        unimplemented!()
    }

    /// Restore a saved state; on error nothing is changed.
    ///
    /// # Errors
    /// Wrong length, wrong scene, damaged (checksum).
    pub fn restore_state(&mut self, _buffer: &[u8]) -> Result<()> {
        unimplemented!()
    }
}
