//! Complete state of a simulation, and its bytes.

use tiprub_cosim::persist::fingerprint_numbers;
use tiprub_cosim::{Sum, persist_fields};

use crate::course::InputCourse;

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
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct ThermalState {
    pub(crate) phase: u64,
    /// Time (s).
    pub(crate) time: f64,
    /// Parameters in the order of [`crate::table`]: initial temperature (K), item of the initial state, item of the interpolation.
    pub(crate) initial_temperature: f64,
    pub(crate) initial_state: i32,
    pub(crate) interpolation: i32,
    /// Heat of the patches (W).
    pub(crate) heat: Vec<InputCourse>,
    /// Temperatures of gas and air (K).
    pub(crate) films: [InputCourse; 2],
    /// Set convection factors.
    pub(crate) factors: [f64; 2],
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
    initial_temperature,
    initial_state,
    interpolation,
    heat,
    films,
    factors,
    factors_used,
    coordinates,
    last_length,
    last_ramped,
    powers,
    totals,
    exchanged,
    initial_heat,
});

/// Returns the fingerprint of a model's numbers.
pub(crate) fn fingerprint_of<'a>(arrays: impl Iterator<Item = &'a [f64]>) -> u64 {
    arrays.fold(0, |seed, values| fingerprint_numbers(values, seed))
}
