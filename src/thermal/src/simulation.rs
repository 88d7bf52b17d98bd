//! Model with its state, which an FMU instance or the tests drive.

use tiprub_core::scene::ranges;
use tiprub_core::simulation::StepProgress;
use tiprub_core::variables::{StartValue, VariableTable};
use tiprub_core::warning::Topic;
use tiprub_core::{Error, Result, Sum, Warning, shown};

use crate::course::InputCourse;
use crate::exponential::Phi;
use crate::model::ConductionModel;
use crate::operator::DiagonalOperator;
use crate::outputs::{rows, stored};
use crate::state::{CREATED, FAILED, READY, ThermalState, fingerprint_of};
use crate::table::{self, HEAT, Item, TEMPERATURES};

/// Largest difference between a communication point and the time of the simulation, as a fraction of H, as in the
/// contact unit.
const TIME_TOLERANCE: f64 = 1e-3;
/// Fraction of the largest rate below which the slowest rate is that of a casing without cooling, which has no steady
/// state.
const UNCOOLED: f64 = 1e-13;

/// Reduced model of heat conduction with its state.
///
/// Life cycle: [`ThermalSimulation::new`] → set parameters and inputs → [`ThermalSimulation::initialise`] → any
/// number of steps → ([`ThermalSimulation::reset`] and again). A communication step is one internal step, which is
/// exact.
#[derive(Debug, Clone)]
pub struct ThermalSimulation {
    pub(crate) model: ConductionModel,
    pub(crate) table: VariableTable,
    pub(crate) items: Vec<Item>,
    pub(crate) fingerprint: u64,
    /// Rows of the outputs of the model, in the coordinates of the model.
    pub(crate) model_rows: nalgebra::DMatrix<f64>,
    pub(crate) operator: DiagonalOperator,
    pub(crate) state: ThermalState,
    /// Values of all references; for inputs and parameters, the set values.
    pub(crate) values: Vec<f64>,
    /// Step in progress: time at its end and length (s).
    under_way: Option<[f64; 2]>,
    phi: Vec<Phi>,
    /// Heat of the patches at the beginning and at the end of a step (W).
    heat: [Vec<f64>; 2],
    /// True after the warning of steps shorter than elements resolve, which is given once for all steps of the
    /// instance.
    warned: bool,
    /// Warnings since the last [`ThermalSimulation::take_notes`].
    notes: Vec<Warning>,
}

impl ThermalSimulation {
    /// Creates a simulation with start values; nothing is computed yet.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// let mut simulation = ThermalSimulation::new(model)?;
    /// simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 60.0)?;
    /// assert_eq!(simulation.time(), 60.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`ConductionModel::validate`].
    pub fn new(model: ConductionModel) -> Result<Self> {
        model.validate()?;
        let (table, items) = table::build(&model)?;
        let (order, patches) = (model.order(), model.patches.len());
        let model_rows = rows(&model);
        let operator = DiagonalOperator::new(&model, &model_rows, [1.0; 2]);
        let arrays =
            [&model.conduction, &model.gas_convection, &model.ambient_convection, &model.heat_loads, &model_rows];
        let fingerprint = fingerprint_of(arrays.iter().map(|array| array.as_slice()));
        let mut simulation = Self {
            values: vec![0.0; table.references()],
            table,
            items,
            fingerprint,
            model_rows,
            operator,
            state: ThermalState::new(patches, order),
            under_way: None,
            phi: vec![Phi::default(); order],
            heat: [vec![0.0; patches], vec![0.0; patches]],
            warned: false,
            notes: Vec::new(),
            model,
        };
        simulation.reset();
        Ok(simulation)
    }

    /// Returns the variable table.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// for variable in simulation.table().variables() {
    ///     println!("{} ({})", variable.name, variable.description);
    /// }
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn table(&self) -> &VariableTable {
        &self.table
    }

    /// Returns the model.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// println!("{} J/K", simulation.model().heat_capacity);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn model(&self) -> &ConductionModel {
        &self.model
    }

    /// Returns the time of the last communication point (s).
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 10.0)?;
    /// assert_eq!(simulation.time(), 10.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// Returns 1/λ of all coordinates (s), the slowest first, at the convection factors of the last step; infinite
    /// for constant coordinates.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let slowest = simulation.time_constants().into_iter().fold(0.0, f64::max);
    /// println!("steady after about {:.0} s", 5.0 * slowest);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn time_constants(&self) -> Vec<f64> {
        self.operator.rates.iter().map(|rate| 1.0 / rate).collect()
    }

    /// Resets the simulation to the start values.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 10.0)?;
    /// simulation.reset();
    /// simulation.initialise(0.0)?;
    /// assert_eq!(simulation.time(), 0.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn reset(&mut self) {
        self.state = ThermalState::new(self.model.patches.len(), self.model.order());
        self.under_way = None;
        self.values.fill(0.0);
        for variable in self.table.variables() {
            let first = variable.reference as usize;
            match &variable.start {
                Some(StartValue::Real(values)) => self.values[first..first + values.len()].copy_from_slice(values),
                Some(StartValue::Integer(value)) => self.values[first] = f64::from(*value),
                _ => {}
            }
        }
        self.follow_factors();
    }

    /// Sets the temperatures to their initial state.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// let start = simulation.table().find("initial_temperature").expect("a parameter").reference;
    /// simulation.set_real(start, 80.0)?;
    /// simulation.initialise(0.0)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// A start time out of range; a steady start without any cooling.
    pub fn initialise(&mut self, start_time: f64) -> Result<()> {
        ranges::at_most("start time", start_time, ranges::TIME)?;
        let state = &mut self.state;
        state.phase = CREATED;
        state.factors_used = state.factors;
        state.heat.iter_mut().chain(&mut state.films).for_each(InputCourse::start);
        self.follow_factors();
        if self.state.initial_state == 2 {
            self.start_steady()?;
        } else {
            // The uniform temperature is the first coordinate of the model.
            let first = self.model.heat_capacity.sqrt() * self.state.initial_temperature;
            let row = self.operator.vectors.row(0);
            self.state.coordinates.iter_mut().zip(row.iter()).for_each(|(z, share)| *z = share * first);
        }
        let state = &mut self.state;
        (state.time, state.last_length, state.last_ramped) = (start_time, 0.0, false);
        (state.powers, state.totals, state.exchanged) = ([0.0; 2], [Sum::default(); 3], 0.0);
        state.initial_heat = stored(&self.operator, &state.coordinates);
        state.phase = READY;
        self.compute_outputs();
        Ok(())
    }

    /// Solves λ z = load.
    fn start_steady(&mut self) -> Result<()> {
        let rates = &self.operator.rates;
        let (slowest, fastest) = (rates[0], rates[rates.len() - 1]);
        if slowest <= UNCOOLED * fastest {
            return Err(Error::invalid(
                "initial_state = steady",
                "the casing has no significant cooling: convection factors times film coefficients are 0 or too small",
                "Set larger convection factors, or start with a uniform temperature",
            ));
        }
        let heat: Vec<f64> = self.state.heat.iter().map(|course| course.value).collect();
        let films = self.state.films.map(|course| course.value);
        for (coordinate, z) in self.state.coordinates.iter_mut().enumerate() {
            *z = self.operator.load(coordinate, &heat, films) / self.operator.rates[coordinate];
        }
        Ok(())
    }

    /// Updates the eigenvectors to the factors that the state uses.
    fn follow_factors(&mut self) {
        let used = self.state.factors_used;
        if used.map(f64::to_bits) != self.operator.factors.map(f64::to_bits) {
            self.operator = DiagonalOperator::new(&self.model, &self.model_rows, used);
        }
    }

    /// Changes to the set factors, with the same temperatures.
    fn change_factors(&mut self) {
        if self.state.factors.map(f64::to_bits) == self.operator.factors.map(f64::to_bits) {
            return;
        }
        let model = &self.operator.vectors * nalgebra::DVector::from_column_slice(&self.state.coordinates);
        self.state.factors_used = self.state.factors;
        self.follow_factors();
        self.state.coordinates.copy_from_slice(self.operator.vectors.tr_mul(&model).as_slice());
    }

    /// Adopts a state whose content has been checked.
    pub(crate) fn adopt(&mut self, state: ThermalState) {
        self.state = state;
        self.under_way = None;
        self.follow_factors();
        self.write_back();
        self.compute_outputs();
    }

    /// Writes the values of inputs and parameters from the state.
    fn write_back(&mut self) {
        let state = &self.state;
        for (variable, item) in self.table.variables().iter().zip(&self.items) {
            let first = variable.reference as usize;
            match item {
                Item::Heat => {
                    let values = self.values[first..].iter_mut();
                    values.zip(&state.heat).for_each(|(value, course)| *value = course.value);
                }
                Item::Film(index) => self.values[first] = state.films[*index].value,
                Item::Factor(index) => self.values[first] = state.factors[*index],
                Item::InitialTemperature => self.values[first] = state.initial_temperature,
                Item::InitialState => self.values[first] = f64::from(state.initial_state),
                Item::Interpolation => self.values[first] = f64::from(state.interpolation),
                _ => {}
            }
        }
    }

    /// Begins a communication step of length `step_size` (s) from `current_time` (s).
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 10.0)?;
    /// while !simulation.advance()?.finished {}
    /// assert_eq!(simulation.time(), 10.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Not at a communication point, a time other than that of the simulation, a length out of range, or inputs that
    /// leave their range within the step.
    pub fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        if self.state.phase != READY {
            let remedy = "Initialise, reset or restore the instance";
            return Err(Error::invalid("step", "the simulation is not at a communication point", remedy));
        }
        ranges::within("communication step", step_size, ranges::SHORTEST_STEP, ranges::TIME)?;
        ranges::at_most("end of the communication step", current_time + step_size, ranges::TIME)?;
        let time = self.state.time;
        // Written so that NaN is rejected.
        let off = (current_time - time).abs();
        if off.is_nan() || off > TIME_TOLERANCE * step_size {
            let problem = format!("{} s, but the simulation is at {} s", shown(current_time), shown(time));
            let remedy = "Start the step at the current time of the simulation";
            return Err(Error::invalid("start of the communication step", problem, remedy));
        }
        let heat = self.state.heat.iter().map(|course| (course, &HEAT, false));
        let films = self.state.films.iter().map(|course| (course, &TEMPERATURES, true));
        for (course, range, ramp) in heat.chain(films) {
            let [_, end] = course.over(step_size, ramp);
            if !range.contains(&end) {
                let problem =
                    format!("its derivative leads to {} at the end of the step, which is out of range", shown(end));
                let remedy = "Set a new value or derivative";
                return Err(Error::invalid("input", problem, remedy));
            }
        }
        self.under_way = Some([current_time + step_size, step_size]);
        if step_size < self.model.element_time && !self.warned {
            self.warned = true;
            self.notes.push(self.unresolved(step_size));
        }
        Ok(())
    }

    /// Returns the warning of a communication step that is shorter than the diffusion time of an element.
    fn unresolved(&self, step_size: f64) -> Warning {
        let problem = format!(
            "{}: the communication step of {} s is shorter than the {:.3} s that heat needs to diffuse through an \
             element of the heated surface (depth squared over diffusivity), so `surface_temperature` rises too slowly \
             after a change of `casing_heat`; `casing_temperature` (volume means) and heat are not affected",
            self.model.name,
            shown(step_size),
            self.model.element_time
        );
        let remedy = "Use longer communication steps with the heat averaged over each step, or thinner elements: twice as many elements \
                      through the thickness (`tiprub thermal --mesh`) allow steps a quarter as long";
        Warning::new(Topic::ThermalStep, problem, remedy)
    }

    /// Returns the warnings since the last call.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 10.0)?;
    /// for note in simulation.take_notes() {
    ///     println!("{note}");
    /// }
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn take_notes(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.notes)
    }

    /// Solves the communication step in progress.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 10.0)?;
    /// assert!(simulation.advance()?.finished);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// No step in progress; a state that is no longer finite.
    pub fn advance(&mut self) -> Result<StepProgress> {
        let Some([end, length]) = self.under_way.take() else {
            return Err(Error::invalid("step", "no step was begun", "Begin a step first"));
        };
        self.change_factors();
        let ramp = self.state.interpolation == 1;
        let [heat_start, heat_end] = &mut self.heat;
        for ((course, start), end) in self.state.heat.iter().zip(heat_start).zip(heat_end) {
            [*start, *end] = course.over(length, false);
        }
        let films = self.state.films.map(|course| course.over(length, ramp));
        self.operator.fill_phi(length, &mut self.phi);
        let flows = self.march(length, films);
        let supplied: f64 = self.heat[0].iter().zip(&self.heat[1]).map(|(a, b)| 0.5 * (a + b) * length).sum();
        let state = &mut self.state;
        for (total, heat) in state.totals.iter_mut().zip([supplied, flows[0], flows[1]]) {
            total.add(heat);
            state.exchanged += heat.abs();
        }
        state.powers = flows.map(|heat| heat / length);
        state.heat.iter_mut().chain(&mut state.films).for_each(|course| course.shift(length));
        (state.time, state.last_length, state.last_ramped) = (end, length, ramp);
        self.compute_outputs();
        if let Some(wrong) = self.values.iter().position(|value| !value.is_finite()) {
            self.state.phase = FAILED;
            let remedy = format!("Check heat and convection factors; value reference {wrong} became non-finite first");
            return Err(Error::NonFinite { last_good_time: end - length, time: end, remedy });
        }
        Ok(StepProgress { time: end, finished: true })
    }

    /// Advances all coordinates over a step; returns the heat from gas and air (J).
    fn march(&mut self, length: f64, films: [[f64; 2]; 2]) -> [f64; 2] {
        let operator = &self.operator;
        let mean = films.map(|[start, end]| 0.5 * (start + end) * length);
        let mut flows = [0, 1].map(|film| operator.conductances[film] * mean[film]);
        for (coordinate, z) in self.state.coordinates.iter_mut().enumerate() {
            let start = operator.load(coordinate, &self.heat[0], films.map(|film| film[0]));
            let end = operator.load(coordinate, &self.heat[1], films.map(|film| film[1]));
            let [next, integral] = self.phi[coordinate].step(length, *z, start, end - start);
            *z = next;
            for (flow, film) in flows.iter_mut().zip(&operator.films) {
                *flow -= film[coordinate] * integral;
            }
        }
        flows
    }

    /// Performs a whole communication step.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// simulation.set_real(gas, 300.0)?;
    /// simulation.do_step(0.0, 10.0)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`ThermalSimulation::begin_step`] and [`ThermalSimulation::advance`].
    pub fn do_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin_step(current_time, step_size)?;
        self.advance().map(drop)
    }

    /// Returns whether a step is in progress.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// simulation.begin_step(0.0, 10.0)?;
    /// assert!(simulation.is_stepping());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn is_stepping(&self) -> bool {
        self.under_way.is_some()
    }
}

impl ThermalState {
    fn new(patches: usize, order: usize) -> Self {
        Self {
            phase: CREATED,
            time: 0.0,
            initial_temperature: 0.0,
            initial_state: 1,
            interpolation: 1,
            heat: vec![InputCourse::default(); patches],
            films: [InputCourse::default(); 2],
            factors: [1.0; 2],
            factors_used: [1.0; 2],
            coordinates: vec![0.0; order],
            last_length: 0.0,
            last_ramped: false,
            powers: [0.0; 2],
            totals: [Sum::default(); 3],
            exchanged: 0.0,
            initial_heat: 0.0,
        }
    }
}
