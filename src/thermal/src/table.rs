//! Variable table of the unit.

use std::ops::RangeInclusive;

use tiprub_cosim::variables::{
    Causality, DataType, Enumeration, Quantity, Span, StartValue, Variability, Variable, VariableTable, VariableUnit,
};
use tiprub_cosim::{Result, units};

use crate::model::ConductionModel;

/// Range of temperatures above the reference (K), as in the contact unit.
pub(crate) const TEMPERATURES: RangeInclusive<f64> = -3000.0..=3000.0;
/// Range of the heat into a patch (W), beyond that of any engine.
pub(crate) const HEAT: RangeInclusive<f64> = -1e9..=1e9;
/// Range of the factors on film coefficients.
pub(crate) const FACTORS: RangeInclusive<f64> = 0.0..=1e3;

units! {
    KELVIN "K" "TemperatureDifference" [0, 0, 0, 0, 1] [];
    WATT "W" "Power" [1, 2, -3, 0, 0] [("kW", 1e-3)];
    JOULE "J" "Energy" [1, 2, -2, 0, 0] [("kJ", 1e-3)];
    CAPACITY "J/K" "HeatCapacity" [1, 2, -2, 0, -1] [];
    CONDUCTANCE "W/K" "ThermalConductance" [1, 2, -3, 0, -1] [];
    SECOND "s" "Time" [0, 0, 1, 0, 0] [("min", 1.0 / 60.0)];
}

static INITIAL_STATES: Enumeration = Enumeration {
    name: "InitialState",
    description: "Initial temperatures",
    items: &[
        ("uniform", "initial_temperature everywhere"),
        ("steady", "Steady-state temperatures for the start values of the inputs"),
    ],
};

static INTERPOLATIONS: Enumeration = Enumeration {
    name: "InputInterpolation",
    description: "Temperatures of gas and air between communication points",
    items: &[
        ("ramp", "Linear from the current value to the value set, which is reached at the end of the step"),
        ("hold", "The value set applies immediately"),
    ],
};

/// Number of the initial state `steady`.
pub(crate) const STEADY: f64 = 2.0;
/// Number of the interpolation `hold`.
pub(crate) const HOLD: f64 = 2.0;

/// Quantity of a variable, with an item for each row in the order of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Item {
    Time,
    Heat,
    /// Temperature of the gas (0) or the air (1).
    Film(usize),
    Factor(usize),
    InitialTemperature,
    InitialState,
    Interpolation,
    Constant,
    /// Rows of [`crate::outputs::rows`] from this one on, in K.
    Rows(usize),
    Hottest,
    Power(usize),
    Stored,
    /// Heat supplied, from the gas, or from the air.
    Total(usize),
    Residual,
    RelativeResidual,
}

/// Rows of the table with their items.
#[derive(Default)]
struct ThermalTableBuilder {
    variables: Vec<Variable>,
    items: Vec<Item>,
}

impl ThermalTableBuilder {
    fn push(&mut self, item: Item, name: &str, unit: Option<&'static VariableUnit>, text: &str) -> &mut Variable {
        self.items.push(item);
        self.variables.push(Variable { unit, ..Variable::output(name.into(), text.into()) });
        self.variables.last_mut().expect("just pushed")
    }
}

/// Prefix of variable names, and description, of the gas and of the air.
const FILMS: [(&str, &str); 2] = [("gas", "gas inside"), ("ambient", "air outside")];

/// Builds the table of a model, with the items of its rows.
pub(crate) fn build(model: &ConductionModel) -> Result<(VariableTable, Vec<Item>)> {
    let (mut table, patches) = (ThermalTableBuilder::default(), model.patches.len());
    let time = table.push(Item::Time, "time", Some(&SECOND), "Simulated time");
    (time.causality, time.quantity) = (Causality::Independent, Quantity::Time);
    inputs(&mut table, patches);
    parameters(&mut table, model);
    temperatures(&mut table, patches);
    heat(&mut table);
    Ok((VariableTable::new(table.variables)?, table.items))
}

fn inputs(table: &mut ThermalTableBuilder, patches: usize) {
    let text = "Heat flow into each patch, spread over its heated surface; constant over the step, or linear if a \
                derivative is set";
    let heat = table.push(Item::Heat, "casing_heat", Some(&WATT), text).input(0.0);
    heat.starts(vec![0.0; patches]).nominal(100.0).range(*HEAT.start(), *HEAT.end());
    for (index, (name, what)) in FILMS.into_iter().enumerate() {
        let text = format!(
            "Temperature of the {what} above the reference; reached at the end of the step (input_interpolation)"
        );
        let film = table.push(Item::Film(index), &format!("{name}_temperature"), Some(&KELVIN), &text).input(0.0);
        film.nominal(100.0).range(*TEMPERATURES.start(), *TEMPERATURES.end());
    }
    for (index, (name, what)) in FILMS.into_iter().enumerate() {
        let text =
            format!("Factor on the film coefficient of the {what}; constant over the step, 0 means no convection");
        let factor = table.push(Item::Factor(index), &format!("{name}_convection_factor"), None, &text).input(1.0);
        factor.range(*FACTORS.start(), *FACTORS.end());
    }
}

fn parameters(table: &mut ThermalTableBuilder, model: &ConductionModel) {
    let text = "Initial temperature above the reference for a uniform start";
    let initial = table.push(Item::InitialTemperature, "initial_temperature", Some(&KELVIN), text).input(0.0);
    initial.role(Causality::Parameter, Variability::Fixed).range(*TEMPERATURES.start(), *TEMPERATURES.end());
    table.push(Item::InitialState, "initial_state", None, "Initial temperatures").choice(&INITIAL_STATES, 1);
    let text = "Temperatures of gas and air between communication points";
    table.push(Item::Interpolation, "input_interpolation", None, text).choice(&INTERPOLATIONS, 1);
    let name = table.push(Item::Constant, "model_name", None, "Name of the model");
    name.constant(DataType::String, StartValue::String(model.name.clone()));
    for (name, unit, value, text) in [
        ("heat_capacity", &CAPACITY, model.heat_capacity, "Total heat capacity"),
        (
            "gas_conductance",
            &CONDUCTANCE,
            model.gas_conductance(),
            "Film coefficient times area of the gas inside, at a factor of 1",
        ),
        (
            "ambient_conductance",
            &CONDUCTANCE,
            model.ambient_conductance(),
            "Film coefficient times area of the air outside, at a factor of 1",
        ),
    ] {
        let constant = table.push(Item::Constant, name, Some(unit), text);
        constant.constant(DataType::Real, StartValue::Real(vec![value]));
    }
}

fn temperatures(table: &mut ThermalTableBuilder, patches: usize) {
    let kelvin = |table: &mut ThermalTableBuilder, item, name: &str, text: &str| {
        table.push(item, name, Some(&KELVIN), text).nominal = Some(100.0);
    };
    let mut row = 0;
    for (name, text) in [
        ("casing_temperature", "Mean temperature of the volume of each patch above the reference"),
        ("surface_temperature", "Mean temperature of the heated surface of each patch above the reference"),
    ] {
        kelvin(table, Item::Rows(row), name, text);
        table.variables.last_mut().expect("just pushed").dimension = Some(patches);
        row += patches;
    }
    kelvin(table, Item::Rows(row), "temperature_mean", "Mean temperature of the whole volume above the reference");
    let text = "Largest temperature of the heated surface above the reference, at the corners of its elements";
    kelvin(table, Item::Hottest, "temperature_max", text);
    for (index, (name, what)) in FILMS.into_iter().enumerate() {
        let text = format!("Mean temperature above the reference of the surface in contact with the {what}");
        kelvin(table, Item::Rows(row + 1 + index), &format!("{name}_surface_temperature"), &text);
    }
}

fn heat(table: &mut ThermalTableBuilder) {
    for (index, (name, what)) in FILMS.into_iter().enumerate() {
        let text = format!("Heat flow from the {what} into the casing, mean over the communication step");
        table.push(Item::Power(index), &format!("{name}_power"), Some(&WATT), &text).span(Span::Mean);
    }
    table.push(Item::Stored, "stored_heat", Some(&JOULE), "Heat stored above the reference");
    for (index, (name, what)) in
        [("supplied", "into the patches"), ("gas", "from the gas inside"), ("ambient", "from the air outside")]
            .into_iter()
            .enumerate()
    {
        let text = format!("Heat {what} since the start");
        table.push(Item::Total(index), &format!("{name}_heat"), Some(&JOULE), &text).span(Span::Total);
    }
    let text = "Heat stored minus the sum of the heat stored at the start and all heat supplied since; zero except for rounding";
    table.push(Item::Residual, "energy_residual", Some(&JOULE), text).span(Span::Total);
    let text = "Ratio of energy_residual to the initial heat plus the sum of the absolute heat exchanged in each \
                communication step";
    table.push(Item::RelativeResidual, "energy_residual_relative", None, text).span(Span::Total);
}
