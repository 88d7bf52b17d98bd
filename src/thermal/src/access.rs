//! Access to variables: reading and setting them.

use tiprub_core::variables::{Causality, DataType, StartValue, Variability, Variable};
use tiprub_core::{Error, Result, shown};

use crate::simulation::ThermalSimulation;
use crate::state::CREATED;
use crate::table::Item;

impl ThermalSimulation {
    /// Returns one element of a real variable; inputs and parameters return their set values.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// println!("{}", simulation.real(gas)?);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference, or not a real variable.
    pub fn real(&self, reference: u32) -> Result<f64> {
        self.of_kind(reference, "real", |kind| kind == DataType::Real)?;
        Ok(self.values[reference as usize])
    }

    /// Returns an item of an enumeration.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// // This unit has real variables only.
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// assert!(simulation.integer(gas).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference, or not an enumeration.
    pub fn integer(&self, reference: u32) -> Result<i32> {
        self.of_kind(reference, "integer", |kind| matches!(kind, DataType::Integer | DataType::Enumeration(_)))?;
        #[expect(clippy::cast_possible_truncation, reason = "stored as the i32 it was set from")]
        Ok(self.values[reference as usize] as i32)
    }

    /// Returns a boolean variable; there is none.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// // This unit has real variables only.
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// assert!(simulation.boolean(gas).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Always.
    pub fn boolean(&self, reference: u32) -> Result<bool> {
        self.of_kind(reference, "boolean", |kind| kind == DataType::Boolean).map(|_| false)
    }

    /// Returns a text.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// // This unit has real variables only.
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// assert!(simulation.string(gas).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference, or not a text.
    pub fn string(&self, reference: u32) -> Result<&str> {
        let (variable, _) = self.of_kind(reference, "string", |kind| kind == DataType::String)?;
        match &variable.start {
            Some(StartValue::String(text)) => Ok(text),
            _ => Ok(""),
        }
    }

    fn of_kind(&self, reference: u32, wanted: &str, fits: impl Fn(DataType) -> bool) -> Result<(&Variable, usize)> {
        let (variable, element) = self.table.locate(reference)?;
        if fits(variable.kind) {
            return Ok((variable, element));
        }
        let problem = format!("is of type {:?}, not {wanted}", variable.kind);
        let remedy = "Call the function for the variable's type in modelDescription.xml";
        Err(Error::invalid(format!("variable `{}`", variable.name), problem, remedy))
    }

    /// Returns the item of a reference, if it can be set now.
    fn settable(&self, reference: u32) -> Result<(Item, usize, &Variable)> {
        let (variable, element) = self.table.locate(reference)?;
        let what = || format!("variable `{}`", variable.name);
        if !variable.is_settable() {
            return Err(Error::invalid(what(), "is computed and cannot be set", "Set inputs and parameters only"));
        }
        if variable.variability == Variability::Fixed && self.state.phase != CREATED {
            let remedy = "Set it before initialisation ends, or reset the instance first";
            return Err(Error::invalid(what(), "is fixed and cannot be set after initialisation", remedy));
        }
        Ok((self.item(variable), element, variable))
    }

    pub(crate) fn item(&self, variable: &Variable) -> Item {
        let row = self.table.variables().iter().position(|other| other.reference == variable.reference);
        row.map_or(Item::Constant, |row| self.items[row])
    }

    /// Sets one element of a real input or parameter; ends a previous derivative.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// simulation.set_real(gas, 300.0)?;
    /// assert!(simulation.set_real(gas, f64::NAN).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Unknown reference, wrong kind, not settable or out of range; nothing is changed in these cases.
    pub fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        self.of_kind(reference, "real", |kind| kind == DataType::Real)?;
        let (item, element, variable) = self.settable(reference)?;
        let (low, high) = (variable.min.unwrap_or(f64::MIN), variable.max.unwrap_or(f64::MAX));
        if !(low..=high).contains(&value) {
            let problem = format!("{} is outside the range {} to {}", shown(value), shown(low), shown(high));
            let remedy = "Give a value within this range";
            return Err(Error::invalid(format!("variable `{}`", variable.name), problem, remedy));
        }
        let state = &mut self.state;
        match item {
            Item::Heat => state.heat[element].set(value),
            Item::Film(index) => state.films[index].set(value),
            Item::Factor(index) => state.factors[index] = value,
            Item::InitialTemperature => state.initial_temperature = value,
            _ => {}
        }
        self.values[reference as usize] = value;
        Ok(())
    }

    /// Sets an item of an enumeration.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// assert!(simulation.set_integer(gas, 300).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`ThermalSimulation::set_real`].
    pub fn set_integer(&mut self, reference: u32, value: i32) -> Result<()> {
        self.of_kind(reference, "integer", |kind| matches!(kind, DataType::Integer | DataType::Enumeration(_)))?;
        let (item, _, variable) = self.settable(reference)?;
        if let DataType::Enumeration(choices) = variable.kind
            && !usize::try_from(value).is_ok_and(|item| (1..=choices.items.len()).contains(&item))
        {
            let items = choices.items.iter().enumerate().map(|(index, (name, _))| format!("{} = {name}", index + 1));
            let remedy = format!("Use one of: {}", items.collect::<Vec<_>>().join(", "));
            let problem = format!("{value} is not an item of {}", choices.name);
            return Err(Error::invalid(format!("variable `{}`", variable.name), problem, remedy));
        }
        match item {
            Item::InitialState => self.state.initial_state = value,
            Item::Interpolation => self.state.interpolation = value,
            _ => {}
        }
        self.values[reference as usize] = f64::from(value);
        Ok(())
    }

    /// Sets a boolean variable; there is none.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// assert!(simulation.set_boolean(gas, true).is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Always.
    pub fn set_boolean(&mut self, reference: u32, _value: bool) -> Result<()> {
        self.of_kind(reference, "boolean", |kind| kind == DataType::Boolean).map(drop)
    }

    /// Sets a text; no text can be set.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// assert!(simulation.set_string(gas, "hot").is_err());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Always.
    pub fn set_string(&mut self, reference: u32, _value: &str) -> Result<()> {
        self.of_kind(reference, "string", |kind| kind == DataType::String)?;
        self.settable(reference).map(drop)
    }

    /// Sets the first time derivative of heat or of a temperature of gas or air, until the input is set again.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// // The gas grows hotter by 2 K/s over the step.
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// simulation.set_input_derivative(gas, 1, 2.0)?;
    /// simulation.do_step(0.0, 10.0)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Another variable, an order other than 1, or a value that is not finite.
    pub fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()> {
        let (variable, element) = self.table.locate(reference)?;
        let what = format!("derivative of `{}`", variable.name);
        let item = self.item(variable);
        if order != 1 {
            let problem = format!("order {order} is not supported");
            return Err(Error::invalid(what, problem, "Give order 1: inputs are linear in time"));
        }
        if !value.is_finite() {
            return Err(Error::invalid(what, format!("{} is not finite", shown(value)), "Give a finite number"));
        }
        match item {
            Item::Heat => self.state.heat[element].set_slope(value),
            Item::Film(index) => self.state.films[index].set_slope(value),
            Item::Factor(_) if value == 0.0 => {}
            _ => {
                let problem = "only heat and the gas and air temperatures can vary within a step";
                return Err(Error::invalid(what, problem, "Set its value at communication points"));
            }
        }
        Ok(())
    }

    /// Returns the first time derivative of a continuous real output at the last communication point, under the
    /// inputs at that point; for means over the step, the derivative is taken from its middle to that point.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let temperature = simulation.table().find("temperature_mean").expect("an output").reference;
    /// simulation.do_step(0.0, 10.0)?;
    /// println!("{} K/s", simulation.output_derivative(temperature, 1)?);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Another variable, or an order other than 1.
    pub fn output_derivative(&self, reference: u32, order: i32) -> Result<f64> {
        let (variable, element) = self.table.locate(reference)?;
        let what = format!("derivative of `{}`", variable.name);
        if variable.causality != Causality::Output || variable.kind != DataType::Real {
            let remedy = "Request derivatives of continuous real outputs only";
            return Err(Error::invalid(what, "the variable is not a continuous real output", remedy));
        }
        if order != 1 {
            let problem = format!("order {order} is not supported");
            return Err(Error::invalid(what, problem, "Request derivatives of order 1 only"));
        }
        Ok(self.rate(self.item(variable), element))
    }
}
