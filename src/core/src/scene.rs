//! Scene and ROM as plain data, with their checks.

pub mod method;
pub mod ranges;
pub mod rom;
pub mod settings;
pub mod shape;

pub use settings::Scene;
