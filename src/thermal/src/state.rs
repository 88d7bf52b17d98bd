//! Complete state of a simulation, and its bytes.

use tiprub_cosim::persist::fingerprint_numbers;
use tiprub_cosim::{Input, Sum, VariableValues, persist_fields};

use crate::table::Item;

/// Number of bytes of the fingerprint of the model, before the state.
pub(crate) const FINGERPRINT_BYTES: usize = 8;
/// Largest absolute value of a number of a state (J of a year of the largest heats).
pub(crate) const LARGEST: f64 = 1e30;

/// Phase of a simulation: created, not yet initialised.
pub(crate) const CREATED: u64 = 0;
/// Phase: at a communication point.
pub(crate) const READY: u64 = 1;
/// Phase: a step failed.
pub(crate) const FAILED: u64 = 2;

/// State of a simulation.
#[derive(Debug, Clone, Default)]
pub(crate) struct ThermalState {
    pub(crate) phase: u64,
    /// Time (s).
    pub(crate) time: f64,
    /// Variables with their values; for inputs and parameters, the set values.
    pub(crate) values: VariableValues,
    /// Heat of the patches (W).
    pub(crate) heat: Vec<Input>,
    /// Temperatures of gas and air (K).
    pub(crate) films: [Input; 2],
    /// Factors of the last step, which define the eigenvectors of the coordinates.
    pub(crate) factors_used: [f64; 2],
    /// Coordinates z.
    pub(crate) coordinates: Vec<f64>,
    /// Length of the last step (s), 0 before the first; below, whether its film temperatures were ramps.
    pub(crate) last_length: f64,
    pub(crate) last_ramped: bool,
    /// Mean heat flows from gas and air over the last step (W).
    pub(crate) powers: [f64; 2],
    /// Heat supplied, from the gas and from the air since the start (J).
    pub(crate) totals: [Sum; 3],
    /// Sum of the absolute values of these heats (J).
    pub(crate) exchanged: f64,
    /// Heat stored at the start (J).
    pub(crate) initial_heat: f64,
}

persist_fields!(ThermalState {
    phase,
    time,
    values,
    heat,
    films,
    factors_used,
    coordinates,
    last_length,
    last_ramped,
    powers,
    totals,
    exchanged,
    initial_heat,
});

impl ThermalState {
    /// Creates the state before initialisation, with start values.
    pub(crate) fn new(mut values: VariableValues, patches: usize, order: usize) -> Self {
        values.reset();
        let heat = vec![Input::default(); patches];
        Self { values, heat, factors_used: [1.0; 2], coordinates: vec![0.0; order], ..Self::default() }
    }

    /// Returns the value of the variable of an item; `items` are those of the table.
    pub(crate) fn value(&self, items: &[Item], item: Item) -> f64 {
        let row = items.iter().position(|other| *other == item);
        row.map_or(0.0, |row| self.values[self.values.table().variables()[row].reference as usize])
    }

    /// Returns the convection factors of the gas and of the air that the importer has set.
    pub(crate) fn convection_factors(&self, items: &[Item]) -> [f64; 2] {
        [0, 1].map(|film| self.value(items, Item::Factor(film)))
    }
}

/// Returns the fingerprint of a model's numbers.
pub(crate) fn fingerprint_of<'a>(arrays: impl Iterator<Item = &'a [f64]>) -> u64 {
    arrays.fold(0, |seed, values| fingerprint_numbers(values, seed))
}
