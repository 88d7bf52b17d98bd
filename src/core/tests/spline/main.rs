//! Surfaces through data points: the spline, open edges, and forces on them.

#[path = "../common/casings.rs"]
mod casings;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod conjugacy;
mod open_surface;
mod spline;
