//! Report of a run: one HTML file that opens offline, with an animation of the contact.

mod details;
mod figures;
pub mod input;
mod numbers;
pub mod page;
mod summary;
mod viewer;
