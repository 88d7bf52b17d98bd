//! Continuous Galerkin in time of one sector: contact forces as polynomials, modes driven by them exactly, steps by a tolerance.
//!
//! The road: [`level`] makes tables of all modes at one length of the step, from the [`response`] of each and the points of a [`basis`];
//! [`trial`] solves contact at these points, as lanes of registers ([`compliance`], [`kernels`]), and judges the step; [`sector`] takes
//! it ([`advance`]), or tries one half as long. What a sector may touch is an [`trial::Obstacle`], and who keeps the books a
//! [`sector::Witness`]: nothing here knows a scene. A [`flight`] is as long as nothing comes near.

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
