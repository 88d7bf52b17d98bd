//! Continuous Galerkin in time: contact forces are polynomials, the modes follow them exactly, and a tolerance controls the steps.
//!
//! [`level`] makes tables of all modes for one step length, from the [`response`] of each mode and the points of a [`basis`]; [`tables`] has
//! them for all lengths. [`trial`] solves the contact problem of a sector at these points, as lanes of registers ([`compliance`],
//! [`kernels`]), and judges the step. An [`island`] accepts it ([`advance`]) or tries a step of half the length, over a [`span`]. What its
//! sectors touch are its [`surroundings`]; up to here everything is independent of the scene. A `scene_island` belongs to a system, and
//! the [`stepper`] has all of them. A [`flight`] lasts as long as nothing comes near.

pub mod advance;
pub mod basis;
mod blade;
pub mod carrier;
pub mod compliance;
mod disk;
pub mod flight;
pub mod island;
pub mod kernels;
pub mod level;
mod near_gaps;
mod obstacle_view;
mod parts;
mod record;
pub mod response;
pub mod rows;
mod scene_island;
pub(crate) mod shared_body;
pub mod span;
pub mod state;
pub mod stepper;
pub mod surroundings;
pub mod tables;
#[cfg(test)]
mod tests;
pub mod trial;
