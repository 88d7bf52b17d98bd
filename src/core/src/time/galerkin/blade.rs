//! Steps of one blade on a surface of revolution that its shaft does not move, with two numbers per node and force.
//!
//! With F = r_c − r − u_r + m u_z ([`revolution`](crate::geometry::revolution)), the gap is F/N and the force λ' ∇F with λ' = λ/N, N = |∇F|:
//! the same complementarity and the same work without a root or a division. Forces and the displacements that matter lie in a plane: the
//! closing displacement a = −u_r + m u_z and the displacement around b = u_θ. A force λ' with friction is λ' (1 + µσ/M, σ − µM) along the
//! two, with σ = s'/r, M = √(1 + m²) and µ negative where the node slides towards negative b.

mod columns;
mod judge;
mod level;
mod minima;
mod reach;
mod rows;
mod solve;
mod span;
mod start;
mod surface;
mod take;
mod tally;
#[cfg(test)]
mod tests;
mod trial;

pub(crate) use span::{Blade, BladeInSpan, BladePlace};
