//! A simulation driven by the names of its variables.

use tiprub_core::{CoSimulation, Result, Scene, Simulation, Warning};
use tiprub_cosim::variables::DataType;

/// Returns the first reference of a variable.
#[track_caller]
pub fn reference(simulation: &Simulation, name: &str) -> u32 {
    simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference
}

/// Returns the value of a real variable.
#[track_caller]
pub fn real(simulation: &Simulation, name: &str) -> f64 {
    element(simulation, name, 0)
}

/// Returns the value of an element of a real variable.
#[track_caller]
pub fn element(simulation: &Simulation, name: &str, element: u32) -> f64 {
    simulation.real(reference(simulation, name) + element).unwrap()
}

/// Sets a real variable.
#[track_caller]
pub fn set(simulation: &mut Simulation, name: &str, value: f64) {
    simulation.set_real(reference(simulation, name), value).unwrap();
}

/// Sets an element of a real variable.
#[track_caller]
pub fn set_element(simulation: &mut Simulation, name: &str, element: u32, value: f64) {
    simulation.set_real(reference(simulation, name) + element, value).unwrap();
}

/// Sets the time derivative of an input.
#[track_caller]
pub fn slope(simulation: &mut Simulation, name: &str, value: f64) {
    simulation.set_input_derivative(reference(simulation, name), 1, value).unwrap();
}

/// Sets an input to `value`, with a constant rate from there on.
#[track_caller]
pub fn move_on(simulation: &mut Simulation, name: &str, value: f64, rate: f64) {
    set(simulation, name, value);
    slope(simulation, name, rate);
}

/// Performs one communication step (s) from the current time.
#[track_caller]
pub fn go(simulation: &mut Simulation, length: f64) {
    simulation.do_step(simulation.time(), length).unwrap_or_else(|error| panic!("{error}"));
}

/// Creates a simulation initialised at time zero.
///
/// # Errors
/// A rejected scene.
pub fn try_started(scene: &Scene) -> Result<Simulation> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    Ok(simulation)
}

/// Returns the number of blades in simultaneous contact for which `massless-boundary` is proven stable, if a warning reports it.
pub fn stable_blades(simulation: &Simulation) -> Option<usize> {
    let number = |text: &Warning| text.split("stable for up to ").nth(1)?.split(' ').next()?.parse().ok();
    simulation.warnings().iter().find_map(number)
}

/// Creates a simulation initialised at time zero.
#[track_caller]
pub fn started(scene: &Scene) -> Simulation {
    started_at(scene, 0.0)
}

/// Creates a simulation initialised at a time (s).
#[track_caller]
pub fn started_at(scene: &Scene, time: f64) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|error| panic!("{error}"));
    simulation.initialise(time).unwrap_or_else(|error| panic!("{error}"));
    simulation
}

/// Returns the state as bytes.
#[track_caller]
pub fn saved(simulation: &Simulation) -> Vec<u8> {
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    state
}

/// Returns all real values as bits, in the order of their references.
pub fn bits(simulation: &Simulation) -> Vec<u64> {
    let rows = simulation.table().variables().iter().filter(|row| row.kind == DataType::Real);
    let references = rows.flat_map(|row| (row.reference..).take(row.len()));
    references.map(|reference| simulation.real(reference).unwrap().to_bits()).collect()
}
