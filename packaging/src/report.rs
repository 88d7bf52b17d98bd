//! Report of a run: one HTML file that opens offline and shows the contact as a picture that moves.

mod details;
mod figures;
pub mod input;
mod numbers;
pub mod page;
mod summary;
mod viewer;
