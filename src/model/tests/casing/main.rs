//! Casings: heat and reduction, rings against closed forms and CalculiX.

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod casing;
mod closed_rings;
mod momentum;
mod ring;
mod unstructured;
