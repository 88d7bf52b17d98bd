//! Rubs of bladed disks through the whole simulation: books, states, time, inputs; what is refused.

mod blades;
mod extremes;
mod inputs;
mod limits;
mod pulling;
mod robustness;
mod rub;
mod spin;
mod states;
mod values;
