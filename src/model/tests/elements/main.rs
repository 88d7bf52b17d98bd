//! Single and assembled elements against closed forms.

#[path = "../common/mod.rs"]
mod common;

mod convergence;
mod every;
mod incompatible;
mod large_displacements;
mod ordering;
mod recovered_stress;
