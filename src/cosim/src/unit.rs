//! Interface between a simulation with a table of variables and the code that drives it.

use crate::variables::{Causality, Value, Variable, VariableTable};
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
pub trait CoSimulation: Send {
    /// Returns the variables with their current values.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// // One number per value reference.
    /// assert_eq!(simulation.variables().len(), simulation.table().references());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn variables(&self) -> &VariableValues;

    /// Returns all variables.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let speed = simulation.table().find("speed").expect("a rotor has a speed");
    /// assert_eq!(simulation.real(speed.reference)?, 1300.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn table(&self) -> &VariableTable {
        self.variables().table()
    }

    /// Returns one element of a real variable; inputs and parameters return the value that was set.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let torque = simulation.table().find("torque").expect("an output").reference;
    /// assert_eq!(simulation.real(torque)?, 0.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference, or a variable of another type.
    fn real(&self, reference: u32) -> Result<f64> {
        self.variables().real(reference)
    }

    /// Returns an integer or an item of an enumeration.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let contacts = simulation.table().find("contact_count").expect("an output").reference;
    /// assert_eq!(simulation.integer(contacts)?, 0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`].
    fn integer(&self, reference: u32) -> Result<i32> {
        self.variables().integer(reference)
    }

    /// Returns a truth value.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let touching = simulation.table().find("in_contact").expect("an output").reference;
    /// assert!(!simulation.boolean(touching)?);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`].
    fn boolean(&self, reference: u32) -> Result<bool> {
        self.variables().boolean(reference)
    }

    /// Returns a text.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # use tiprub_cosim::variables::DataType;
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// for variable in simulation.table().variables().iter().filter(|variable| variable.kind == DataType::String) {
    ///     println!("{} = {}", variable.name, simulation.string(variable.reference)?);
    /// }
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::real`].
    fn string(&self, reference: u32) -> Result<&str> {
        self.variables().string(reference)
    }

    /// Returns whether the unit has been initialised, after which fixed parameters cannot be set.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// assert!(!simulation.is_initialised());
    /// simulation.initialise(0.0)?;
    /// assert!(simulation.is_initialised());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn is_initialised(&self) -> bool;

    /// Checks that a variable has the type of a value, can be set now, and that the value is in its range; returns the variable and the
    /// index of the element. A unit may have further limits, which only [`CoSimulation::set`] checks.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # use tiprub_cosim::Value;
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// assert!(simulation.check(speed, Value::Real(1310.0)).is_ok());
    /// assert!(simulation.check(speed, Value::Real(f64::NAN)).is_err());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
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
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # use tiprub_cosim::Value;
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// simulation.set(speed, Value::Real(1310.0))?;
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::check`]; limits of stability, and of motions within a step.
    fn set(&mut self, reference: u32, value: Value) -> Result<()>;

    /// Sets one element of a real input or parameter.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// simulation.set_real(speed, 1310.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::set`].
    fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        self.set(reference, Value::Real(value))
    }

    /// Sets an integer or an item of an enumeration.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let derivatives = simulation.table().find("step_derivatives").expect("a parameter").reference;
    /// simulation.set_integer(derivatives, 2)?;
    /// assert!(simulation.set_integer(derivatives, 3).is_err());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::set`].
    fn set_integer(&mut self, reference: u32, value: i32) -> Result<()> {
        self.set(reference, Value::Integer(value.into()))
    }

    /// Sets a truth value.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// // Truth values of this unit are outputs; none can be set.
    /// let touching = simulation.table().find("in_contact").expect("an output").reference;
    /// assert!(simulation.set_boolean(touching, true).is_err());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::set`].
    fn set_boolean(&mut self, reference: u32, value: bool) -> Result<()> {
        self.set(reference, Value::Boolean(value))
    }

    /// Sets the first time derivative of a continuous real input, which is valid until the input is set again: value and derivative
    /// together define the end of a ramp over the communication step.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// // The speed grows by 5000 rad/s per second over the step.
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// simulation.set_real(speed, 1300.0)?;
    /// simulation.set_input_derivative(speed, 1, 5000.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::check_input_derivative`].
    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()>;

    /// Checks that a derivative of an input may be set; returns the variable and the index of the element.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// assert!(simulation.check_input_derivative(speed, 1, 5000.0).is_ok());
    /// assert!(simulation.check_input_derivative(speed, 2, 5000.0).is_err());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
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
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// assert!(simulation.check_seed(speed, 1.0).is_ok());
    /// assert!(simulation.check_seed(speed, f64::NAN).is_err());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
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
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let angle = simulation.table().find("rotor_angle").expect("an output").reference;
    /// simulation.do_step(0.0, 1e-4)?;
    /// assert!((simulation.output_derivative(angle, 1)? - 1300.0).abs() < 1e-6);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference, a variable that is not a continuous real output, or an order other than 1.
    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64>;

    /// Returns the inputs over time as bytes, derivatives included, so that they can be restored if a set of values is rejected as a
    /// whole.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// let before = simulation.courses();
    /// simulation.set_input_derivative(speed, 1, 5000.0)?;
    /// simulation.restore_courses(&before);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn courses(&self) -> Vec<u8>;

    /// Restores what [`CoSimulation::courses`] returned at the same time; the values that were read are set before.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// let before = simulation.courses();
    /// simulation.set_real(speed, 1310.0)?;
    /// simulation.set_real(speed, 1300.0)?;
    /// simulation.restore_courses(&before);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn restore_courses(&mut self, courses: &[u8]);

    /// Checks parameters, sets the initial state and computes outputs.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let damping = simulation.table().find("damping_ratio").expect("a parameter").reference;
    /// simulation.set_real(damping, 0.01)?;
    /// simulation.initialise(0.0)?;
    /// assert_eq!(simulation.time(), 0.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Rejected parameters, with numbers and a remedy. The unit can be initialised again with other parameters.
    fn initialise(&mut self, start_time: f64) -> Result<()>;

    /// Restores the state after creation, with all start values.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// simulation.reset();
    /// simulation.initialise(0.0)?;
    /// assert_eq!(simulation.time(), 0.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn reset(&mut self);

    /// Returns the current time (s): the end of the last finished step, also of one that ended early.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 2.5e-4)?;
    /// assert_eq!(simulation.time(), 2.5e-4);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn time(&self) -> f64;

    /// Returns the warnings about the parameters after [`CoSimulation::initialise`].
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// for warning in simulation.warnings() {
    ///     println!("{warning}");
    /// }
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn warnings(&self) -> &[Warning] {
        &[]
    }

    /// Returns the warnings since initialisation or the last call. Each is reported once.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// for note in simulation.take_notes() {
    ///     println!("{note}");
    /// }
    /// assert!(simulation.take_notes().is_empty());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn take_notes(&mut self) -> Vec<Warning>;

    /// Begins a communication step of length `step_size` (s), which ends exactly at `current_time + step_size`.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 1e-4)?;
    /// while !simulation.advance()?.finished {}
    /// assert_eq!(simulation.time(), 1e-4);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// A step size out of range, a `current_time` further than 1e-3 step sizes from [`CoSimulation::time`], or inputs that leave their
    /// ranges within the step; [`crate::Error::Exhausted`] if it takes more internal steps than allowed.
    fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()>;

    /// Begins a communication step that may end when the allowed internal steps are used up ([`CoSimulation::end_step_early`]).
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut scene = tiprub_test_models::rub(2);
    /// scene.settings.time.max_internal_steps = Some(10);
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.initialise(0.0)?;
    /// simulation.begin_partial_step(0.0, 1e-4)?;
    /// let ended_early = loop {
    ///     match simulation.advance() {
    ///         Ok(progress) if progress.finished => break false,
    ///         Ok(_) => {}
    ///         Err(tiprub_cosim::Error::Exhausted(_)) => break true,
    ///         Err(error) => return Err(error),
    ///     }
    /// };
    /// if ended_early {
    ///     simulation.end_step_early()?;
    /// }
    /// assert!(simulation.time() < 1e-4);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Same as [`CoSimulation::begin_step`].
    fn begin_partial_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin_step(current_time, step_size)
    }

    /// Skips internal steps that are not needed, for callers that do not read values within the communication step. The last step is
    /// taken normally, so that rates at its end are those of an internal step.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 1e-4)?;
    /// simulation.fly_ahead();
    /// while !simulation.advance()?.finished {}
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn fly_ahead(&mut self) {}

    /// Advances the current communication step by one internal step. Inputs may be set between calls.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 1e-4)?;
    /// let mut steps = 1;
    /// while !simulation.advance()?.finished {
    ///     steps += 1;
    /// }
    /// assert_eq!(steps, 100);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// The state is lost, and the unit must be reset or restored. [`crate::Error::Exhausted`] if the allowed internal steps are used up:
    /// the unit is then in the state before the communication step or, if the step may end early, in the state after the last finished
    /// internal step ([`CoSimulation::is_stepping`]).
    fn advance(&mut self) -> Result<StepProgress>;

    /// Returns whether a communication step has begun and not ended.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 1e-4)?;
    /// assert!(simulation.is_stepping());
    /// while !simulation.advance()?.finished {}
    /// assert!(!simulation.is_stepping());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn is_stepping(&self) -> bool;

    /// Ends the communication step at the internal step reached; outputs cover the finished part.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 1e-4)?;
    /// let progress = simulation.advance()?;
    /// simulation.end_step_early()?;
    /// assert_eq!(simulation.time(), progress.time);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// No finished internal step in a current communication step; a state that is lost.
    fn end_step_early(&mut self) -> Result<()> {
        Ok(())
    }

    /// Updates the outputs to the internal time reached, for callers that read within a communication step: means cover the finished part
    /// of it. At communication points outputs are up to date, and this does nothing.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let angle = simulation.table().find("rotor_angle").expect("an output").reference;
    /// simulation.begin_step(0.0, 1e-4)?;
    /// simulation.advance()?;
    /// simulation.update_outputs()?;
    /// assert!(simulation.real(angle)? > 0.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// An output that is not finite.
    fn update_outputs(&mut self) -> Result<()> {
        Ok(())
    }

    /// Computes a whole communication step.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let clearance = simulation.table().find("clearance_minimum").expect("an output").reference;
    /// for step in 0..10 {
    ///     simulation.do_step(f64::from(step) * 1e-4, 1e-4)?;
    ///     println!("{:.3e} m", simulation.real(clearance)?);
    /// }
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
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
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let buffer = vec![0; simulation.state_size()];
    /// assert!(!buffer.is_empty());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn state_size(&self) -> usize;

    /// Saves everything that determines the future into exactly [`CoSimulation::state_size`] bytes.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let mut state = vec![0; simulation.state_size()];
    /// simulation.save_state(&mut state)?;
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// A buffer of another length.
    fn save_state(&self, buffer: &mut [u8]) -> Result<()>;

    /// Restores a saved state.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// # simulation.initialise(0.0)?;
    /// let mut state = vec![0; simulation.state_size()];
    /// simulation.save_state(&mut state)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// simulation.restore_state(&state)?;
    /// assert_eq!(simulation.time(), 0.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// Bytes of another length or of another unit, or damaged ones.
    fn restore_state(&mut self, buffer: &[u8]) -> Result<()>;

    /// Returns the reason why there are no derivatives over the last communication step, `None` if there are.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let derivatives = simulation.table().find("step_derivatives").expect("a parameter").reference;
    /// assert!(simulation.no_derivatives().is_some());
    /// simulation.set_integer(derivatives, 2)?;
    /// assert!(simulation.no_derivatives().is_none());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    fn no_derivatives(&self) -> Option<&'static str> {
        None
    }

    /// Computes the derivatives of `outputs` at the end of the last communication step with respect to `inputs` over it, in the direction
    /// `seed`: Σ_j ∂y_i(t+H)/∂u_j s_j, written to `sensitivity`.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let mut simulation = Simulation::new(&tiprub_test_models::rub(2))?;
    /// let derivatives = simulation.table().find("step_derivatives").expect("a parameter").reference;
    /// simulation.set_integer(derivatives, 2)?;
    /// simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// let [speed, angle] = ["speed", "rotor_angle"].map(|name| simulation.table().find(name).expect("a variable").reference);
    /// let mut sensitivity = [0.0];
    /// simulation.step_derivative(&[angle], &[speed], &[1.0], &mut sensitivity)?;
    /// // The speed acts over the whole step of 0.1 ms.
    /// assert!((sensitivity[0] - 1e-4).abs() < 1e-9);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// No such step, variables without derivatives, or a seed that is not finite.
    ///
    /// # Panics
    /// Slices of different lengths.
    fn step_derivative(&mut self, outputs: &[u32], inputs: &[u32], seed: &[f64], sensitivity: &mut [f64])
    -> Result<()>;
}
