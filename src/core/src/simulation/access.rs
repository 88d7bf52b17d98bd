//! Access to variables: checks of kind, causality and variability, reading and setting.

use super::drive::Input;
use super::{Simulation, SimulationPhase};
use crate::variables::{Causality, DataType, Quantity, StartValue, Variability, Variable};
use crate::{Error, Result, shown};

impl Simulation {
    /// Reads one element of a real variable (inputs and parameters return the value that was set).
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let torque = simulation.table().find("torque").expect("an output").reference;
    /// assert_eq!(simulation.real(torque)?, 0.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; not a real variable.
    pub fn real(&self, reference: u32) -> Result<f64> {
        self.expect_kind(reference, "real", |kind| kind == DataType::Real)?;
        Ok(self.values[reference as usize])
    }

    /// Reads an integer or enumeration variable.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let contacts = simulation.table().find("contact_count").expect("an output").reference;
    /// assert_eq!(simulation.integer(contacts)?, 0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; neither an integer nor an enumeration variable.
    pub fn integer(&self, reference: u32) -> Result<i32> {
        self.expect_kind(reference, "integer", |kind| matches!(kind, DataType::Integer | DataType::Enumeration(_)))?;
        #[expect(clippy::cast_possible_truncation, reason = "integers are stored as the i32 they were set from")]
        Ok(self.values[reference as usize] as i32)
    }

    /// Reads a boolean variable.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let touching = simulation.table().find("in_contact").expect("an output").reference;
    /// assert!(!simulation.boolean(touching)?);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; not a boolean variable.
    pub fn boolean(&self, reference: u32) -> Result<bool> {
        self.expect_kind(reference, "boolean", |kind| kind == DataType::Boolean)?;
        Ok(self.values[reference as usize] != 0.0)
    }

    /// Reads a string variable.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let name = simulation.table().variables().iter().find(|variable| variable.kind == tiprub_core::variables::DataType::String);
    /// if let Some(name) = name {
    ///     println!("{}", simulation.string(name.reference)?);
    /// }
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; not a string variable.
    pub fn string(&self, reference: u32) -> Result<&str> {
        self.expect_kind(reference, "string", |kind| kind == DataType::String)?;
        match &self.table.locate(reference)?.0.start {
            Some(StartValue::String(text)) => Ok(text),
            _ => Ok(""),
        }
    }

    fn expect_kind(&self, reference: u32, wanted: &str, fits: impl Fn(DataType) -> bool) -> Result<()> {
        let (variable, _) = self.table.locate(reference)?;
        if fits(variable.kind) {
            return Ok(());
        }
        Err(Error::invalid(
            format!("variable `{}`", variable.name),
            format!("the type is {:?}, not {wanted}", variable.kind),
            "Call the function for the variable's type in modelDescription.xml",
        ))
    }

    fn settable(&self, reference: u32) -> Result<(Quantity, String, usize)> {
        let (variable, element) = self.table.locate(reference)?;
        if !variable.is_settable() {
            return Err(Error::invalid(
                format!("variable `{}`", variable.name),
                format!("a variable with causality {:?} cannot be set", variable.causality),
                "Set inputs and parameters only",
            ));
        }
        let fixed = variable.causality == Causality::Parameter && variable.variability == Variability::Fixed;
        if fixed && self.phase != SimulationPhase::Created {
            return Err(Error::invalid(
                format!("parameter `{}`", variable.name),
                "a fixed parameter cannot be set after initialisation",
                "Set it before initialisation ends, or reset the instance first",
            ));
        }
        Ok((variable.quantity, variable.name.clone(), element))
    }

    /// Sets one element of a real input or parameter. The value must be finite and within min and max. Clears a derivative that was given
    /// for the same input. Inputs that move or load a structure ramp from their current value to the new one until the end of the current
    /// or next communication step; with `input_interpolation` = hold they take the value immediately.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// simulation.set_real(speed, 1310.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; wrong kind; variable that cannot be set; value not finite or out of range. Nothing is changed then.
    pub fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        self.check_real(reference, value)?;
        let (variable, _) = self.table.locate(reference)?;
        if variable.quantity == Quantity::Friction && self.phase != SimulationPhase::Created {
            let before = std::mem::replace(&mut self.values[reference as usize], value);
            let parameters = self.parameters();
            let outcome = self.check_limits(&parameters);
            self.values[reference as usize] = before;
            outcome?;
            self.warn_of_friction(&parameters);
            self.tangent.follow_anew();
            self.apply_friction(&parameters);
        }
        let offset = self.offset_now();
        self.change_input(reference, |input| input.ask(value, offset))?;
        self.values[reference as usize] = value;
        Ok(())
    }

    /// Returns whether [`Simulation::set_real`] would accept the value, stability limits aside.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// assert!(simulation.check_real(speed, 1310.0).is_ok());
    /// assert!(simulation.check_real(speed, f64::NAN).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn check_real(&self, reference: u32, value: f64) -> Result<()> {
        self.expect_kind(reference, "real", |kind| kind == DataType::Real)?;
        self.settable(reference)?;
        let (variable, _) = self.table.locate(reference)?;
        check_range(variable, value)
    }

    /// Sets an integer or enumeration parameter. A new bound on the number of steps applies from the next communication step on.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// let derivatives = simulation.table().find("step_derivatives").expect("a parameter").reference;
    /// simulation.set_integer(derivatives, 2)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn set_integer(&mut self, reference: u32, value: i32) -> Result<()> {
        self.check_integer(reference, value)?;
        self.values[reference as usize] = f64::from(value);
        self.make_room();
        Ok(())
    }

    /// Returns whether [`Simulation::set_integer`] would accept the value.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// let derivatives = simulation.table().find("step_derivatives").expect("a parameter").reference;
    /// assert!(simulation.check_integer(derivatives, 2).is_ok());
    /// assert!(simulation.check_integer(derivatives, 3).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn check_integer(&self, reference: u32, value: i32) -> Result<()> {
        self.expect_kind(reference, "integer", |kind| matches!(kind, DataType::Integer | DataType::Enumeration(_)))?;
        let (_, name, _) = self.settable(reference)?;
        let (variable, _) = self.table.locate(reference)?;
        let DataType::Enumeration(choices) = variable.kind else { return check_range(variable, f64::from(value)) };
        let item = usize::try_from(value).unwrap_or(0);
        if (1..=choices.items.len()).contains(&item) {
            return Ok(());
        }
        let items = choices.items.iter().enumerate().map(|(i, (item, _))| format!("{} = {item}", i + 1));
        Err(Error::invalid(
            format!("parameter `{name}`"),
            format!("{value} is not an item of {}", choices.name),
            format!("Use one of: {}", items.collect::<Vec<_>>().join(", ")),
        ))
    }

    /// Sets a boolean parameter.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// // Boolean variables are outputs; none can be set.
    /// let touching = simulation.table().find("in_contact").expect("an output").reference;
    /// assert!(simulation.set_boolean(touching, true).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<()> {
        self.expect_kind(reference, "boolean", |kind| kind == DataType::Boolean)?;
        self.settable(reference)?;
        self.values[reference as usize] = f64::from(u8::from(value));
        Ok(())
    }

    /// Sets a string parameter. The table has none, so this always returns an error.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// assert!(simulation.set_string(speed, "fast").is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::set_real`].
    pub fn set_string(&mut self, reference: u32, _value: &str) -> Result<()> {
        self.expect_kind(reference, "string", |kind| kind == DataType::String)?;
        let (_, name, _) = self.settable(reference)?;
        Err(Error::invalid(format!("variable `{name}`"), "string variables cannot be set", "Remove the call"))
    }

    /// Sets the first time derivative of a continuous real input, valid from now until the input is set again: value and derivative
    /// together define the end of a ramp over the communication step.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// // The speed grows by 5000 rad/s per second over the step.
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// simulation.set_real(speed, 1300.0)?;
    /// simulation.set_input_derivative(speed, 1, 5000.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; not a continuous real input; order other than 1; value not finite.
    pub fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()> {
        self.check_input_derivative(reference, order, value)?;
        let offset = self.offset_now();
        self.change_input(reference, |input| input.ask_slope(value, offset))
    }

    /// Changes an input. Within a communication step the input turns towards its new target immediately. The target must be allowed at the
    /// end of the step, and the internal step must be able to follow; nothing is changed otherwise.
    fn change_input(&mut self, reference: u32, change: impl FnOnce(&mut Input)) -> Result<()> {
        let (variable, element) = self.table.locate(reference)?;
        let (quantity, of) = (variable.quantity, variable.of);
        let (stepping, at_once) = (self.phase == SimulationPhase::Stepping, self.acts_at_once(quantity));
        if stepping {
            self.tangent.forget();
        }
        let Some(mut input) = self.inputs.get(quantity, of, element).copied() else { return Ok(()) };
        let (offset, length) = (self.offset_now(), self.communication.length);
        change(&mut input);
        if stepping {
            self.check_course(variable, element, &input, at_once, [offset, length])?;
        }
        if at_once || self.phase == SimulationPhase::Created {
            input.take();
        } else if stepping {
            input.aim(offset, self.inputs.until);
        }
        if stepping {
            self.check_motion(quantity, of, &input)?;
        }
        if quantity == Quantity::Speed {
            self.rotors[of].rebase(&self.inputs.rotors[of].speed, offset);
        }
        if let Some(place) = self.inputs.get_mut(quantity, of, element) {
            *place = input;
        }
        if stepping && quantity == Quantity::Speed {
            let (until, hold) = (self.inputs.until, self.holds());
            self.inputs.rotors[of].lead_spin(offset, until, hold);
        }
        Ok(())
    }

    /// Checks that the current internal step can follow a new course of the speed or of the rotation of the shape.
    fn check_motion(&self, quantity: Quantity, of: usize, input: &Input) -> Result<()> {
        let (step, length) = (self.system.step_size(), self.communication.length);
        match quantity {
            Quantity::Speed => {
                for (pair, _) in self.compiled.plan.pairs_of(of) {
                    let rotation = self.inputs.pairs[pair].shape_rotation.rate();
                    self.check_turning(pair, step, length, input, rotation)?;
                }
                [0.0, length].into_iter().try_for_each(|offset| self.compiled.check_speed(of, input.at(offset)))
            }
            Quantity::ShapeRotation => {
                let body = self.compiled.plan.pairs[of].body;
                self.check_turning(of, step, length, &self.inputs.rotors[body].speed, input.rate())
            }
            _ => Ok(()),
        }
    }

    /// Returns whether [`Simulation::set_input_derivative`] would accept the value.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// assert!(simulation.check_input_derivative(speed, 1, 5000.0).is_ok());
    /// assert!(simulation.check_input_derivative(speed, 2, 5000.0).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Simulation::set_input_derivative`].
    pub fn check_input_derivative(&self, reference: u32, order: i32, value: f64) -> Result<()> {
        let (variable, _) = self.table.locate(reference)?;
        let what = format!("derivative of `{}`", variable.name);
        if variable.causality != Causality::Input || variable.kind != DataType::Real {
            return Err(Error::invalid(
                what,
                "the variable is not a real input",
                "Set derivatives of real inputs only",
            ));
        }
        if order != 1 {
            let problem = format!("order {order} is not supported");
            return Err(Error::invalid(what, problem, "Use order 1, because inputs are linear in time"));
        }
        if !value.is_finite() {
            return Err(Error::invalid(what, shown(value), "Give a finite number"));
        }
        Ok(())
    }

    /// Returns the first time derivative of a continuous real output at the last communication point.
    ///
    /// Clearances and the rotor angle have a rate of their own; the rate of other outputs is their change since the previous communication
    /// point (for means: between the middles of the last two steps), or 0 before there are two points.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let angle = simulation.table().find("rotor_angle").expect("an output").reference;
    /// simulation.do_step(0.0, 1e-4)?;
    /// assert!((simulation.output_derivative(angle, 1)? - 1300.0).abs() < 1e-6);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference; not a continuous real output; order other than 1.
    pub fn output_derivative(&self, reference: u32, order: i32) -> Result<f64> {
        let (variable, element) = self.table.locate(reference)?;
        let what = format!("derivative of `{}`", variable.name);
        let continuous = variable.causality == Causality::Output && variable.variability == Variability::Continuous;
        if !continuous || variable.kind != DataType::Real {
            let remedy = "Request derivatives of continuous real outputs only";
            return Err(Error::invalid(what, "the variable is not a continuous real output", remedy));
        }
        if order != 1 {
            let problem = format!("order {order} is not supported");
            return Err(Error::invalid(what, problem, "Use order 1"));
        }
        let derivative = self.derivative_of(variable, element, reference);
        if derivative.is_finite() {
            return Ok(derivative);
        }
        let problem = "the rate of change over the communication step overflows double precision";
        Err(Error::invalid(what, problem, "Use longer communication steps, and check loads and inputs"))
    }
}

pub(super) fn check_range(variable: &Variable, value: f64) -> Result<()> {
    let (low, high) = (variable.min.unwrap_or(f64::MIN), variable.max.unwrap_or(f64::MAX));
    if (low..=high).contains(&value) {
        return Ok(());
    }
    let problem = if value.is_finite() {
        format!("{} is outside the range {} to {}", shown(value), shown(low), shown(high))
    } else {
        format!("{value} is not finite")
    };
    let remedy = if value.is_finite() { "Give a value within this range" } else { "Give a finite number" };
    Err(Error::invalid(format!("variable `{}`", variable.name), problem, remedy))
}
