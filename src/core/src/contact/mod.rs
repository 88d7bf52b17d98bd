//! Contact: surfaces, gaps, and the solvers of the unilateral problem.

pub mod coulomb;
pub mod gap;
pub mod solver;
pub mod surface;
