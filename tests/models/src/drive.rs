//! A simulation driven by the names of its variables.

use tiprub_core::variables::DataType;
use tiprub_core::{Result, Scene, Simulation};

/// First reference of a variable.
#[track_caller]
pub fn reference(simulation: &Simulation, name: &str) -> u32 {
    simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference
}

/// Value of a real variable.
#[track_caller]
pub fn real(simulation: &Simulation, name: &str) -> f64 {
    element(simulation, name, 0)
}

/// Value of an element of a real variable.
#[track_caller]
pub fn element(simulation: &Simulation, name: &str, element: u32) -> f64 {
    simulation.real(reference(simulation, name) + element).unwrap()
}

/// Set a real variable.
#[track_caller]
pub fn set(simulation: &mut Simulation, name: &str, value: f64) {
    simulation.set_real(reference(simulation, name), value).unwrap();
}

/// Set an element of a real variable.
#[track_caller]
pub fn set_element(simulation: &mut Simulation, name: &str, element: u32, value: f64) {
    simulation.set_real(reference(simulation, name) + element, value).unwrap();
}

/// Derivative of an input over time.
#[track_caller]
pub fn slope(simulation: &mut Simulation, name: &str, value: f64) {
    simulation.set_input_derivative(reference(simulation, name), 1, value).unwrap();
}

/// From `value` on with a constant rate.
#[track_caller]
pub fn move_on(simulation: &mut Simulation, name: &str, value: f64, rate: f64) {
    set(simulation, name, value);
    slope(simulation, name, rate);
}

/// One communication step (s) from where it is.
#[track_caller]
pub fn go(simulation: &mut Simulation, length: f64) {
    simulation.do_step(simulation.time(), length).unwrap_or_else(|error| panic!("{error}"));
}

/// Initialised at zero.
///
/// # Errors
/// The scene is refused.
pub fn try_started(scene: &Scene) -> Result<Simulation> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    Ok(simulation)
}

/// Initialised at zero.
#[track_caller]
pub fn started(scene: &Scene) -> Simulation {
    started_at(scene, 0.0)
}

/// Initialised at a time (s).
#[track_caller]
pub fn started_at(scene: &Scene, time: f64) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|error| panic!("{error}"));
    simulation.initialise(time).unwrap_or_else(|error| panic!("{error}"));
    simulation
}

/// The state as bytes.
#[track_caller]
pub fn saved(simulation: &Simulation) -> Vec<u8> {
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    state
}

/// All real values as bits, in the order of their references.
pub fn bits(simulation: &Simulation) -> Vec<u64> {
    let rows = simulation.table().variables().iter().filter(|row| row.kind == DataType::Real);
    let references = rows.flat_map(|row| (row.reference..).take(row.len()));
    references.map(|reference| simulation.real(reference).unwrap().to_bits()).collect()
}
