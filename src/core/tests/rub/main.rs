//! Rubs of bladed disks through the whole simulation: books, states, time, inputs; what is refused.

#[path = "../common/blades.rs"]
mod blades;

mod extremes;
mod inputs;
mod limits;
mod robustness;
mod rub;
mod states;
mod values;
