//! Continuous Galerkin in time of one sector: contact forces are polynomials, the modes follow them exactly, and a tolerance
//! controls the steps.
//!
//! [`level`] makes tables of all modes for one step length, from the [`response`] of each mode and the points of a [`basis`].
//! [`trial`] solves the contact problem at these points, as lanes of registers ([`compliance`], [`kernels`]), and judges the
//! step. [`sector`] accepts it ([`advance`]) or tries a step of half the length. The surfaces are a [`trial::Obstacle`], and a
//! [`sector::Witness`] records the steps; this module is independent of the scene. A [`flight`] lasts as long as nothing comes
//! near.

pub mod advance;
pub mod basis;
pub mod compliance;
pub mod flight;
pub mod kernels;
pub mod level;
pub mod march;
pub mod response;
pub mod rows;
pub mod sector;
pub mod shared_body;
pub mod state;
#[cfg(test)]
mod tests;
pub mod trial;
