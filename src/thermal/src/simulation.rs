//! Model with its state, which an FMU instance or the tests drive.

use tiprub_cosim::warning::Topic;
use tiprub_cosim::{Error, Result, VariableValues, Warning, shown};

use crate::model::ConductionModel;
use crate::operator::DiagonalOperator;
use crate::outputs::rows;
use crate::state::{ThermalState, fingerprint_of};
use crate::table::{self, Item};

/// Fraction of the largest rate below which the slowest rate is that of a casing without cooling, which has no steady
/// state.
const UNCOOLED: f64 = 1e-13;

/// Reduced model of heat conduction with its state.
///
/// Life cycle: [`ThermalSimulation::new`] → set parameters and inputs → [`CoSimulation::initialise`](tiprub_cosim::CoSimulation::initialise) → any
/// number of steps → ([`CoSimulation::reset`](tiprub_cosim::CoSimulation::reset) and again). A communication step is one internal step, which is
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
    /// Step in progress: time at its end and length (s).
    pub(crate) under_way: Option<[f64; 2]>,
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
        Ok(Self {
            items,
            fingerprint,
            model_rows,
            operator,
            state: ThermalState::new(VariableValues::new(table), patches, order),
            under_way: None,
            heat: [vec![0.0; patches], vec![0.0; patches]],
            warned: false,
            notes: Vec::new(),
            model,
        })
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
        let heat: Vec<f64> = self.state.heat.iter().map(|input| input.value).collect();
        let films = self.state.films.map(|input| input.value);
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
        let set = self.state.convection_factors(&self.items);
        if set.map(f64::to_bits) == self.operator.factors.map(f64::to_bits) {
            return;
        }
        let model = &self.operator.vectors * nalgebra::DVector::from_column_slice(&self.state.coordinates);
        self.state.factors_used = set;
        self.follow_factors();
        self.state.coordinates.copy_from_slice(self.operator.vectors.tr_mul(&model).as_slice());
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
}
