//! Contact: surfaces, gaps, and the solvers of the unilateral problem.

pub mod coating;
pub mod coulomb;
pub mod gap;
pub mod layout;
pub mod open_gap;
pub mod solver;
pub mod spline;
pub mod spline_gap;
pub mod surface;
pub mod wrench;
