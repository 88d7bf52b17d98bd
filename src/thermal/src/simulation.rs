//! Model with its state, which an FMU instance or the tests drive.

use tiprub_cosim::warning::Topic;
use tiprub_cosim::{CoSimulation, Error, Result, VariableValues, Warning, shown};

use crate::course::InputCourse;
use crate::exponential::Phi;
use crate::model::ConductionModel;
use crate::operator::DiagonalOperator;
use crate::outputs::rows;
use crate::state::{CREATED, ThermalState, fingerprint_of};
use crate::table::{self, Item};

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
    pub(crate) items: Vec<Item>,
    pub(crate) fingerprint: u64,
    /// Rows of the outputs of the model, in the coordinates of the model.
    pub(crate) model_rows: nalgebra::DMatrix<f64>,
    pub(crate) operator: DiagonalOperator,
    pub(crate) state: ThermalState,
    /// Variables with their values; for inputs and parameters, the set values.
    pub(crate) values: VariableValues,
    /// Step in progress: time at its end and length (s).
    pub(crate) under_way: Option<[f64; 2]>,
    pub(crate) phi: Vec<Phi>,
    /// Heat of the patches at the beginning and at the end of a step (W).
    pub(crate) heat: [Vec<f64>; 2],
    /// True after the warning of steps shorter than elements resolve, which is given once for all steps of the
    /// instance.
    pub(crate) warned: bool,
    /// Warnings since the last [`ThermalSimulation::take_notes`].
    pub(crate) notes: Vec<Warning>,
}

impl ThermalSimulation {
    /// Creates a simulation with start values; nothing is computed yet.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_cosim::CoSimulation;
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// let mut simulation = ThermalSimulation::new(model)?;
    /// simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 60.0)?;
    /// assert_eq!(simulation.time(), 60.0);
    /// # Ok::<(), tiprub_cosim::Error>(())
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
            values: VariableValues::new(table),
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

    /// Returns the model.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_cosim::CoSimulation;
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// println!("{} J/K", simulation.model().heat_capacity);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    pub fn model(&self) -> &ConductionModel {
        &self.model
    }

    /// Returns 1/λ of all coordinates (s), the slowest first, at the convection factors of the last step; infinite
    /// for constant coordinates.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_cosim::CoSimulation;
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let slowest = simulation.time_constants().into_iter().fold(0.0, f64::max);
    /// println!("steady after about {:.0} s", 5.0 * slowest);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    pub fn time_constants(&self) -> Vec<f64> {
        self.operator.rates.iter().map(|rate| 1.0 / rate).collect()
    }

    /// Solves λ z = load.
    pub(crate) fn start_steady(&mut self) -> Result<()> {
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
    pub(crate) fn follow_factors(&mut self) {
        let used = self.state.factors_used;
        if used.map(f64::to_bits) != self.operator.factors.map(f64::to_bits) {
            self.operator = DiagonalOperator::new(&self.model, &self.model_rows, used);
        }
    }

    /// Changes to the set factors, with the same temperatures.
    pub(crate) fn change_factors(&mut self) {
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
        for (row, item) in self.items.iter().enumerate() {
            let first = self.values.table().variables()[row].reference as usize;
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

    /// Returns the warning of a communication step that is shorter than the diffusion time of an element.
    pub(crate) fn unresolved(&self, step_size: f64) -> Warning {
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

    /// Advances all coordinates over a step; returns the heat from gas and air (J).
    pub(crate) fn march(&mut self, length: f64, films: [[f64; 2]; 2]) -> [f64; 2] {
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
}

impl ThermalState {
    pub(crate) fn new(patches: usize, order: usize) -> Self {
        Self {
            phase: CREATED,
            initial_state: 1,
            interpolation: 1,
            heat: vec![InputCourse::default(); patches],
            factors: [1.0; 2],
            factors_used: [1.0; 2],
            coordinates: vec![0.0; order],
            ..Self::default()
        }
    }
}
