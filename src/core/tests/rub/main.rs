//! Rubs of bladed disks through the whole simulation: energy balance, states, time, inputs, errors.

#[path = "../../../../tests/guide.rs"]
mod guide;

mod blades;
mod extremes;
mod gains;
mod inputs;
mod limits;
mod pulling;
mod robustness;
mod rub;
mod spin;
mod states;
mod stored_checks;
mod tangent;
mod values;
