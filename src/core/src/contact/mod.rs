//! Contact: surfaces, gaps, and the solvers of the unilateral problem.

pub mod gap;
pub mod solver;
pub mod spline;
pub mod surface;
