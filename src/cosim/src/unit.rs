//! Interface between a simulation with a table of variables and the code that drives it.

use crate::variables::{Causality, DataType, StartValue, Value, Variable, VariableTable};
use crate::{Result, VariableValues, Warning};

/// Result of one call of [`CoSimulation::advance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepProgress {
    /// Internal time reached (s).
    pub time: f64,
    /// True if the communication point is reached (and outputs are up to date there).
    pub finished: bool,
}

/// Co-simulation unit: variables by reference, communication steps that consist of internal steps, and a state as bytes.
///
/// Life cycle: created with start values, then parameters and inputs → [`CoSimulation::initialise`] → any number of communication steps →
/// ([`CoSimulation::reset`] and again). The caller, such as the FMU, enforces the order of calls; a unit only rejects meaningless ones.
///
/// A call that returns an error has changed nothing, unless its description says otherwise.
///
/// `Debug` is not required: its texts for a whole simulation, which are never read, would make up a tenth of a library.
///
/// # Examples
/// A run with parameters, an input and outputs:
/// ```
/// # use tiprub_core::{CoSimulation, Simulation};
/// # use tiprub_cosim::Value;
/// let mut unit = Simulation::new(&tiprub_test_models::rub(2))?;
/// let find = |name: &str| unit.table().find(name).expect("a variable").reference;
/// let [speed, damping, choice] = ["speed", "damping_ratio", "step_derivatives"].map(find);
/// let [scene, angle, contacts, touching] = ["scene", "rotor_angle", "contact_count", "in_contact"].map(find);
/// // One number per value reference.
/// assert_eq!(unit.variables().len(), unit.table().references());
/// println!("{} starts with a speed of {} rad/s", unit.string(scene)?, unit.real(speed)?);
/// assert!(unit.check(speed, Value::Real(f64::NAN)).is_err());
/// unit.set_real(damping, 0.01)?;
/// assert!(unit.set_integer(choice, 3).is_err(), "an enumeration of two items");
/// assert!(unit.set_boolean(touching, true).is_err(), "an output");
/// assert!(!unit.is_initialised());
/// unit.initialise(0.0)?;
/// unit.warnings().iter().for_each(|warning| println!("{warning}"));
/// for step in 0..10 {
///     unit.set(speed, Value::Real(1300.0 + f64::from(step)))?;
///     unit.do_step(f64::from(step) * 1e-4, 1e-4)?;
///     unit.take_notes().iter().for_each(|note| println!("{note}"));
/// }
/// println!("{} s: {} contacts, {}", unit.time(), unit.integer(contacts)?, unit.boolean(touching)?);
/// assert!((unit.output_derivative(angle, 1)? - 1309.0).abs() < 1e-6);
/// unit.terminate();
/// unit.reset();
/// # Ok::<(), tiprub_cosim::Error>(())
/// ```
///
/// At most ten internal steps, and a step that is discarded and repeated:
/// ```
/// # use tiprub_core::{CoSimulation, Simulation};
/// # use tiprub_cosim::Error;
/// let mut scene = tiprub_test_models::rub(2);
/// scene.settings.time.max_internal_steps = Some(10);
/// let mut unit = Simulation::new(&scene)?;
/// unit.initialise(0.0)?;
/// let mut state = vec![0; unit.state_size()];
/// unit.save_state(&mut state)?;
/// // A step of ten internal steps, without intermediate output values.
/// unit.begin_step(0.0, 1e-5)?;
/// unit.fly_ahead();
/// while !unit.advance()?.finished {}
/// unit.restore_state(&state)?;
/// // A step that ends early when the limit of internal steps is reached.
/// unit.begin_partial_step(0.0, 1e-4)?;
/// let reached = loop {
///     match unit.advance() {
///         Ok(progress) if progress.finished => break progress.time,
///         Ok(_) => unit.update_outputs()?,
///         Err(Error::Exhausted(_)) => {
///             assert!(unit.is_stepping());
///             unit.end_step_early()?;
///             break unit.time();
///         }
///         Err(error) => return Err(error),
///     }
/// };
/// assert!((reached - 1e-5).abs() < 1e-12);
/// # Ok::<(), Error>(())
/// ```
///
/// Derivatives of inputs, and of an output with respect to an input over a step:
/// ```
/// # use tiprub_core::{CoSimulation, Simulation};
/// let mut unit = Simulation::new(&tiprub_test_models::rub(2))?;
/// let find = |name: &str| unit.table().find(name).expect("a variable").reference;
/// let [speed, angle, choice] = ["speed", "rotor_angle", "step_derivatives"].map(find);
/// unit.set_integer(choice, 2)?;
/// assert!(unit.no_derivatives().is_none());
/// unit.initialise(0.0)?;
/// // The speed grows by 5000 rad/s per second over the step. The derivative can be removed again.
/// assert!(unit.check_input_derivative(speed, 2, 5000.0).is_err());
/// let before = unit.courses();
/// unit.set_input_derivative(speed, 1, 5000.0)?;
/// unit.restore_courses(&before);
/// unit.do_step(0.0, 1e-4)?;
/// assert!(unit.check_seed(speed, f64::NAN).is_err());
/// let mut sensitivity = [0.0];
/// unit.step_derivative(&[angle], &[speed], &[1.0], &mut sensitivity)?;
/// // The speed acts over the whole step of 0.1 ms.
/// assert!((sensitivity[0] - 1e-4).abs() < 1e-9);
/// # Ok::<(), tiprub_cosim::Error>(())
/// ```
pub trait CoSimulation: Send {
    /// Returns the variables with their current values.
    fn variables(&self) -> &VariableValues;

    /// Returns all variables.
    fn table(&self) -> &VariableTable {
        self.variables().table()
    }

    /// Returns one element of a real variable; inputs and parameters return the value that was set.
    ///
    /// # Errors
    /// Unknown reference, or a variable of another type.
    fn real(&self, reference: u32) -> Result<f64> {
        Ok(self.variables().stored(reference, DataType::Real)?.1)
    }

    /// Returns an integer or an item of an enumeration.
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`].
    fn integer(&self, reference: u32) -> Result<i32> {
        #[expect(clippy::cast_possible_truncation, reason = "integers are stored as the i32 they were set from")]
        self.variables().stored(reference, DataType::Integer).map(|(_, value)| value as i32)
    }

    /// Returns a truth value.
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`].
    fn boolean(&self, reference: u32) -> Result<bool> {
        Ok(self.variables().stored(reference, DataType::Boolean)?.1 != 0.0)
    }

    /// Returns a text.
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`].
    fn string(&self, reference: u32) -> Result<&str> {
        match &self.variables().stored(reference, DataType::String)?.0.start {
            Some(StartValue::String(text)) => Ok(text),
            _ => Ok(""),
        }
    }

    /// Returns whether the unit has been initialised, after which fixed parameters cannot be set.
    fn is_initialised(&self) -> bool;

    /// Checks that a variable has the type of a value, can be set now, and that the value is in its range; returns the variable and the
    /// index of the element. A unit may have further limits, which only [`CoSimulation::set`] checks.
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`]; a variable that cannot be set, or a value outside its range.
    fn check(&self, reference: u32, value: Value) -> Result<(&Variable, usize)> {
        let (variable, element) = self.table().locate(reference)?;
        variable.check(element, value, self.is_initialised())?;
        Ok((variable, element))
    }

    /// Sets one element of an input or parameter, and ends a derivative that was given for the same input. Inputs ramp from their current
    /// value to the new one until the end of the current or next communication step, unless the parameter `input_interpolation` is `hold`
    /// or the description of the variable says that it acts immediately.
    ///
    /// # Errors
    /// Same as [`CoSimulation::check`]; limits of stability, and of motions within a step.
    fn set(&mut self, reference: u32, value: Value) -> Result<()>;

    /// Sets one element of a real input or parameter.
    ///
    /// # Errors
    /// Same as [`CoSimulation::set`].
    fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        self.set(reference, Value::Real(value))
    }

    /// Sets an integer or an item of an enumeration.
    ///
    /// # Errors
    /// Same as [`CoSimulation::set`].
    fn set_integer(&mut self, reference: u32, value: i32) -> Result<()> {
        self.set(reference, Value::Integer(value.into()))
    }

    /// Sets a truth value.
    ///
    /// # Errors
    /// Same as [`CoSimulation::set`].
    fn set_boolean(&mut self, reference: u32, value: bool) -> Result<()> {
        self.set(reference, Value::Boolean(value))
    }

    /// Sets the first time derivative of a continuous real input, which is valid until the input is set again: value and derivative
    /// together define the end of a ramp over the communication step.
    ///
    /// # Errors
    /// Same as [`CoSimulation::check_input_derivative`].
    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()>;

    /// Checks that a derivative of an input may be set; returns the variable and the index of the element.
    ///
    /// # Errors
    /// Unknown reference, a variable that is not a continuous real input, an order other than 1, or a value that is not finite.
    fn check_input_derivative(&self, reference: u32, order: i32, value: f64) -> Result<(&Variable, usize)> {
        let (variable, element) = self.table().locate(reference)?;
        variable.check_derivative(element, Causality::Input, order)?;
        if !value.is_finite() {
            let what = format!("derivative of `{}`", variable.element_name(element));
            return Err(crate::Error::invalid(what, format!("{value} is not finite"), "Set a finite number"));
        }
        Ok((variable, element))
    }

    /// Checks the seed of an input for derivatives over a step; returns the variable and the index of the element.
    ///
    /// # Errors
    /// Unknown reference, a variable that is not a continuous real input, or a seed that is not finite.
    fn check_seed(&self, reference: u32, seed: f64) -> Result<(&Variable, usize)> {
        let (variable, element) = self.check_input_derivative(reference, 1, 0.0)?;
        if !seed.is_finite() {
            let what = format!("seed of `{}`", variable.element_name(element));
            return Err(crate::Error::invalid(what, format!("{seed} is not finite"), "Give finite seeds"));
        }
        Ok((variable, element))
    }

    /// Returns the first time derivative of a continuous real output at the last communication point.
    ///
    /// # Errors
    /// Unknown reference, a variable that is not a continuous real output, or an order other than 1.
    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64>;

    /// Returns the inputs over time as bytes, derivatives included, so that they can be restored if a set of values is rejected as a
    /// whole.
    fn courses(&self) -> Vec<u8>;

    /// Restores what [`CoSimulation::courses`] returned at the same time; the values that were read are set before.
    fn restore_courses(&mut self, courses: &[u8]);

    /// Checks parameters, sets the initial state and computes outputs.
    ///
    /// # Errors
    /// Rejected parameters, with numbers and a remedy. The unit can be initialised again with other parameters.
    fn initialise(&mut self, start_time: f64) -> Result<()>;

    /// Ends the run and the threads of the unit. Values can still be read. Reset and initialise the unit before further steps.
    fn terminate(&mut self) {}

    /// Restores the state after creation, with all start values.
    fn reset(&mut self);

    /// Returns the current time (s): the end of the last finished step, also of one that ended early.
    fn time(&self) -> f64;

    /// Returns the warnings about the parameters after [`CoSimulation::initialise`].
    fn warnings(&self) -> &[Warning] {
        &[]
    }

    /// Returns the warnings since initialisation or the last call. Each is reported once.
    fn take_notes(&mut self) -> Vec<Warning>;

    /// Begins a communication step of length `step_size` (s), which ends exactly at `current_time + step_size`.
    ///
    /// # Errors
    /// A step size out of range, a `current_time` further than 1e-3 step sizes from [`CoSimulation::time`], or inputs that leave their
    /// ranges within the step; [`crate::Error::Exhausted`] if it takes more internal steps than allowed.
    fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()>;

    /// Begins a communication step that may end when the allowed internal steps are used up ([`CoSimulation::end_step_early`]).
    ///
    /// # Errors
    /// Same as [`CoSimulation::begin_step`].
    fn begin_partial_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin_step(current_time, step_size)
    }

    /// Skips internal steps that are not needed, for callers that do not read values within the communication step. The last step is
    /// taken normally, so that rates at its end are those of an internal step.
    fn fly_ahead(&mut self) {}

    /// Advances the current communication step by one internal step. Inputs may be set between calls.
    ///
    /// # Errors
    /// The state is lost, and the unit must be reset or restored. [`crate::Error::Exhausted`] if the allowed internal steps are used up:
    /// the unit is then in the state before the communication step or, if the step may end early, in the state after the last finished
    /// internal step ([`CoSimulation::is_stepping`]).
    fn advance(&mut self) -> Result<StepProgress>;

    /// Returns whether a communication step has begun and not ended.
    fn is_stepping(&self) -> bool;

    /// Ends the communication step at the internal step reached; outputs cover the finished part.
    ///
    /// # Errors
    /// No finished internal step in a current communication step; a state that is lost.
    fn end_step_early(&mut self) -> Result<()> {
        Ok(())
    }

    /// Updates the outputs to the internal time reached, for callers that read within a communication step: means cover the finished part
    /// of it. At communication points outputs are up to date, and this does nothing.
    ///
    /// # Errors
    /// An output that is not finite.
    fn update_outputs(&mut self) -> Result<()> {
        Ok(())
    }

    /// Computes a whole communication step.
    ///
    /// # Errors
    /// Same as [`CoSimulation::begin_step`] and [`CoSimulation::advance`].
    fn do_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin_step(current_time, step_size)?;
        self.fly_ahead();
        while !self.advance()?.finished {}
        Ok(())
    }

    /// Returns the length of every saved state (bytes).
    fn state_size(&self) -> usize;

    /// Saves everything that determines the future into exactly [`CoSimulation::state_size`] bytes.
    ///
    /// # Errors
    /// A buffer of another length.
    fn save_state(&self, buffer: &mut [u8]) -> Result<()>;

    /// Restores a saved state.
    ///
    /// # Errors
    /// Bytes of another length or of another unit, or damaged ones.
    fn restore_state(&mut self, buffer: &[u8]) -> Result<()>;

    /// Returns the reason why there are no derivatives over the last communication step, `None` if there are.
    fn no_derivatives(&self) -> Option<&'static str> {
        None
    }

    /// Computes the derivatives of `outputs` at the end of the last communication step with respect to `inputs` over it, in the direction
    /// `seed`: Σ_j ∂y_i(t+H)/∂u_j s_j, written to `sensitivity`.
    ///
    /// # Errors
    /// No such step, variables without derivatives, or a seed that is not finite.
    ///
    /// # Panics
    /// Slices of different lengths.
    fn step_derivative(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64], sensitivity: &mut [f64])
    -> Result<()>;
}
