//! Time integration: recurrences with fixed steps, and the continuous Galerkin method with adaptive steps.

pub mod galerkin;
mod recurrence;
pub(crate) mod spans;
