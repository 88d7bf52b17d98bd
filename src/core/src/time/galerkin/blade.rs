//! Steps of one blade on a surface of revolution. Every displacement and every force of a node has two components instead
//! of three.
//!
//! With F = r_c − r − u_r + m u_z ([`revolution`](crate::geometry::revolution)) and N = |∇F|, the gap is F/N and the
//! normal force is λ' ∇F with the scaled multiplier λ' = λ/N. The complementarity condition and the work keep their
//! form, but need neither a square root nor a division.
//!
//! Only two displacements affect F: the closing displacement a = −u_r + m u_z and the circumferential displacement
//! b = u_θ. Contact forces lie in the plane of the two. With friction, the components of a force along a and b are
//! λ' (1 + µσ/M) and λ' (σ − µM), with σ = s'/r and M = √(1 + m²). The coefficient µ is negative if the node slides
//! towards negative b.
//!
//! These equations are for a centred shaft. [`off_centre`] extends them to an off-centre shaft.

mod accept;
mod columns;
mod contact_free;
mod dense;
mod follow;
mod gaps;
mod judge;
mod level;
mod meridional;
mod minima;
mod off_centre;
mod open_step;
mod reach;
mod rows;
mod skipped;
mod solve;
mod span;
mod start;
mod stored;
mod surface;
mod tables;
mod tally;
#[cfg(test)]
mod tests;
mod trial;

pub(crate) use skipped::SkippedSector;
pub(crate) use span::{Blade, BladeInSpan, BladeModel, BladePlace};
pub(crate) use stored::{StoredStep, mark_unsampled, stored_len, stored_start};
pub(crate) use tables::SpanKind;
pub(crate) use tally::BladeTally;
