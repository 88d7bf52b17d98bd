//! What the façade drives: a simulation with a table of variables.

use std::any::Any;
use std::path::Path;

use tiprub_core::variables::VariableTable;
use tiprub_core::{Result, Warning, simulation::StepProgress};

/// A unit of co-simulation: variables by reference, communication steps marched internal step by internal step, its state as
/// bytes. Which calls are legal when is the façade's business.
///
/// It asks for no `Debug`: texts of a whole simulation that nobody reads would be a tenth of a library.
///
/// Life: made by a [`Load`], then parameters and inputs → [`CoSimulationUnit::initialise`] → any number of communication steps
/// → ([`CoSimulationUnit::reset`] and again).
pub trait CoSimulationUnit: Send {
    /// All variables.
    fn table(&self) -> &VariableTable;

    /// Read one element of a real variable; inputs and parameters give back what was set.
    ///
    /// # Errors
    /// Unknown reference, or of another type.
    fn real(&self, reference: u32) -> Result<f64>;

    /// Read an integer or an item of an enumeration.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::real`].
    fn integer(&self, reference: u32) -> Result<i32>;

    /// Read a boolean.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::real`].
    fn boolean(&self, reference: u32) -> Result<bool>;

    /// Read a text.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::real`].
    fn string(&self, reference: u32) -> Result<&str>;

    /// Set one element of a real input or parameter.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::real`]; not settable, or not a value it may have. Nothing is changed then.
    fn set_real(&mut self, reference: u32, value: f64) -> Result<()>;

    /// Set an integer or an item of an enumeration.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::set_real`].
    fn set_integer(&mut self, reference: u32, value: i32) -> Result<()>;

    /// Set a boolean.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::set_real`].
    fn set_boolean(&mut self, reference: u32, value: bool) -> Result<()>;

    /// Set a text.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::set_real`].
    fn set_string(&mut self, reference: u32, value: &str) -> Result<()>;

    /// First time derivative of a continuous real input, until the input is set again.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::set_real`]; an order other than 1.
    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()>;

    /// First time derivative of a continuous real output at the last communication point.
    ///
    /// # Errors
    /// As [`CoSimulationUnit::real`]; an order other than 1.
    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64>;

    /// Returns the inputs over time, derivatives included, so that they can be restored if a set of values is rejected as a whole.
    fn courses(&self) -> Box<dyn Any>;

    /// Back to what [`CoSimulationUnit::courses`] gave at the same instant; values as read are set back before.
    fn restore_courses(&mut self, courses: Box<dyn Any>);

    /// Check parameters, set the state to the start and compute outputs.
    ///
    /// # Errors
    /// A refusal with numbers and remedy; other parameters can be given and this be called again.
    fn initialise(&mut self, start_time: f64) -> Result<()>;

    /// Back to the start values.
    fn reset(&mut self);

    /// Time of the last communication point, or of the internal step reached (s).
    fn time(&self) -> f64;

    /// Returns the warnings about the parameters after [`CoSimulationUnit::initialise`].
    fn warnings(&self) -> &[Warning];

    /// Returns the warnings since the last call.
    fn take_notes(&mut self) -> Vec<Warning>;

    /// Begin a communication step of length `step_size` (s), which may end early (`partial`) where the unit allows only so many
    /// internal steps.
    ///
    /// # Errors
    /// Wrong time or step size; [`tiprub_core::Error::Exhausted`].
    fn begin_step(&mut self, current_time: f64, step_size: f64, partial: bool) -> Result<()>;

    /// Go ahead by more than an internal step, where nobody looks in between.
    fn fly_ahead(&mut self) {}

    /// March one internal step.
    ///
    /// # Errors
    /// The state is lost, or [`tiprub_core::Error::Exhausted`].
    fn advance(&mut self) -> Result<StepProgress>;

    /// Whether a communication step is under way.
    fn is_stepping(&self) -> bool;

    /// End the communication step at the internal step reached.
    ///
    /// # Errors
    /// The state is lost.
    fn end_step_early(&mut self) -> Result<()>;

    /// Compute outputs at the internal step reached.
    ///
    /// # Errors
    /// One is not finite.
    fn update_outputs(&mut self, time: f64) -> Result<()>;

    /// Length of every saved state (bytes).
    fn state_size(&self) -> usize;

    /// Save the state into exactly [`CoSimulationUnit::state_size`] bytes.
    ///
    /// # Errors
    /// Another length.
    fn save_state(&self, buffer: &mut [u8]) -> Result<()>;

    /// Restore a saved state.
    ///
    /// # Errors
    /// Bytes that are no state of this unit; nothing is changed then.
    fn restore_state(&mut self, buffer: &[u8]) -> Result<()>;

    /// Why there are no derivatives over the last communication step, if there are none.
    fn no_derivatives(&self) -> Option<&'static str>;

    /// Derivatives of outputs at the end of the last communication step by inputs over it, in the direction `seed`.
    ///
    /// # Errors
    /// No such step, or variables that have none.
    fn step_derivative(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64], sensitivity: &mut [f64])
    -> Result<()>;
}

/// Content of the resources of an FMU.
pub struct Loaded {
    /// Makes the unit of them: start values in place, nothing computed. Asked once the token is known to be theirs.
    pub unit: Box<dyn FnOnce() -> Result<Box<dyn CoSimulationUnit>>>,
    /// Instantiation token that belongs to the resources.
    pub token: String,
    /// Whether the description of FMI 3.0 has arrays; else scalars, as FMI 2.0 has.
    pub fmi3_arrays: bool,
    /// Name and version of the library, for messages; a program that packages the library finds this in its bytes.
    pub release: &'static str,
}

/// Reads the unit of a library from the unpacked directory `resources/`, or says what is wrong with it.
pub type Load = fn(&Path) -> std::result::Result<Loaded, String>;
