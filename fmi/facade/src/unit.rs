//! Interface between the façade and a simulation with a table of variables.

use std::any::Any;
use std::path::Path;

use tiprub_core::variables::VariableTable;
use tiprub_core::{Result, Warning, simulation::StepProgress};

/// Co-simulation unit: variables by reference, communication steps that consist of internal steps, and a state as
/// bytes. The façade checks which calls are legal in which phase.
///
/// `Debug` is not required: its texts for a whole simulation, which are never read, would make up a tenth of a library.
///
/// Life cycle: created by a [`Load`], then parameters and inputs → [`CoSimulationUnit::initialise`] → any number of
/// communication steps → ([`CoSimulationUnit::reset`] and again).
pub trait CoSimulationUnit: Send {
    /// Returns all variables.
    fn table(&self) -> &VariableTable;

    /// Returns one element of a real variable; inputs and parameters return the value that was set.
    ///
    /// # Errors
    /// Unknown reference, or a variable of another type.
    fn real(&self, reference: u32) -> Result<f64>;

    /// Returns an integer or an item of an enumeration.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::real`].
    fn integer(&self, reference: u32) -> Result<i32>;

    /// Returns a boolean.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::real`].
    fn boolean(&self, reference: u32) -> Result<bool>;

    /// Returns a string.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::real`].
    fn string(&self, reference: u32) -> Result<&str>;

    /// Sets one element of a real input or parameter.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::real`]; a variable that cannot be set, or a value outside its range. Nothing is
    /// changed then.
    fn set_real(&mut self, reference: u32, value: f64) -> Result<()>;

    /// Sets an integer or an item of an enumeration.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::set_real`].
    fn set_integer(&mut self, reference: u32, value: i32) -> Result<()>;

    /// Sets a boolean.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::set_real`].
    fn set_boolean(&mut self, reference: u32, value: bool) -> Result<()>;

    /// Sets a string.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::set_real`].
    fn set_string(&mut self, reference: u32, value: &str) -> Result<()>;

    /// Sets the first time derivative of a continuous real input, which is valid until the input is set again.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::set_real`]; an order other than 1.
    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()>;

    /// Returns the first time derivative of a continuous real output at the last communication point.
    ///
    /// # Errors
    /// Same as [`CoSimulationUnit::real`]; an order other than 1.
    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64>;

    /// Returns the inputs over time, derivatives included, so that they can be restored if a set of values is rejected as a whole.
    fn courses(&self) -> Box<dyn Any>;

    /// Restores what [`CoSimulationUnit::courses`] returned at the same time; the values that were read are set before.
    fn restore_courses(&mut self, courses: Box<dyn Any>);

    /// Checks parameters, sets the initial state and computes outputs.
    ///
    /// # Errors
    /// Invalid parameters; the message contains numbers and the remedy. You can set other parameters and call this
    /// function again.
    fn initialise(&mut self, start_time: f64) -> Result<()>;

    /// Restores the start values.
    fn reset(&mut self);

    /// Returns the time of the last communication point, or of the internal step reached (s).
    fn time(&self) -> f64;

    /// Returns the warnings about the parameters after [`CoSimulationUnit::initialise`].
    fn warnings(&self) -> &[Warning];

    /// Returns the warnings since the last call.
    fn take_notes(&mut self) -> Vec<Warning>;

    /// Begins a communication step of length `step_size` (s), which may end early (`partial`) if the unit limits the
    /// number of internal steps.
    ///
    /// # Errors
    /// A wrong time or step size; [`tiprub_core::Error::Exhausted`].
    fn begin_step(&mut self, current_time: f64, step_size: f64, partial: bool) -> Result<()>;

    /// Advances by more than one internal step while no intermediate values are needed.
    fn fly_ahead(&mut self) {}

    /// Computes one internal step.
    ///
    /// # Errors
    /// The state is lost, or [`tiprub_core::Error::Exhausted`].
    fn advance(&mut self) -> Result<StepProgress>;

    /// Returns whether a communication step is in progress.
    fn is_stepping(&self) -> bool;

    /// Ends the communication step at the internal step reached.
    ///
    /// # Errors
    /// The state is lost.
    fn end_step_early(&mut self) -> Result<()>;

    /// Computes the outputs at the internal step reached.
    ///
    /// # Errors
    /// An output that is not finite.
    fn update_outputs(&mut self, time: f64) -> Result<()>;

    /// Returns the length of every saved state (bytes).
    fn state_size(&self) -> usize;

    /// Saves the state into exactly [`CoSimulationUnit::state_size`] bytes.
    ///
    /// # Errors
    /// A buffer of another length.
    fn save_state(&self, buffer: &mut [u8]) -> Result<()>;

    /// Restores a saved state.
    ///
    /// # Errors
    /// Bytes that are not a state of this unit; nothing is changed then.
    fn restore_state(&mut self, buffer: &[u8]) -> Result<()>;

    /// Returns the reason why there are no derivatives over the last communication step, `None` if there are.
    fn no_derivatives(&self) -> Option<&'static str>;

    /// Computes the derivatives of outputs at the end of the last communication step with respect to inputs over it, in
    /// the direction `seed`.
    ///
    /// # Errors
    /// No such step, or variables without derivatives.
    fn step_derivative(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64], sensitivity: &mut [f64])
    -> Result<()>;
}

/// Content of the resources of an FMU.
pub struct Loaded {
    /// Creates the unit, with start values set and nothing computed. Called after the token has been checked.
    pub unit: Box<dyn FnOnce() -> Result<Box<dyn CoSimulationUnit>>>,
    /// Instantiation token that belongs to the resources.
    pub token: String,
    /// True if the FMI 3.0 description has arrays, otherwise scalars as in FMI 2.0.
    pub fmi3_arrays: bool,
    /// Name and version of the library for messages; a program that packages the library searches its bytes for this
    /// text.
    pub release: &'static str,
}

/// Reads the unit of a library from the unpacked directory `resources/`, or returns a message that describes the
/// problem.
pub type Load = fn(&Path) -> std::result::Result<Loaded, String>;
