//! Laws of contacts that always slide: one multiplier λ per contact, with friction in the columns of the Delassus matrix.

use std::marker::PhantomData;

use nalgebra::DMatrix;

use super::{ContactLaw, ContactParameters, ContactPrediction, fill_sliding};
use crate::contact::active_set::{ContactSolver, SolverOutcome};
use crate::math::vector::Vector3;

/// Properties in which laws of sliding contacts differ.
pub(crate) trait SlidingRule {
    /// See [`ContactLaw::is_iterative`].
    const IS_ITERATIVE: bool = true;

    /// Friction coefficient at a sliding speed (m/s), if µ is positive.
    fn friction(parameters: &ContactParameters, _speed: f64) -> f64 {
        parameters.friction
    }

    /// Solves a contact problem that is completely filled in.
    fn solve(solver: &mut ContactSolver) -> SolverOutcome {
        solver.lcp()
    }
}

/// Forward-increment Lagrange multipliers (eqs 10-11 of the paper): the gaps of all nodes that penetrate in the
/// prediction become zero. Penetration is detected once. The law checks neither for negative λ nor for new penetration
/// of other nodes.
#[derive(Debug, Clone)]
pub(crate) struct Film;

impl SlidingRule for Film {
    const IS_ITERATIVE: bool = false;

    fn solve(solver: &mut ContactSolver) -> SolverOutcome {
        solver.film()
    }
}

/// Signorini's law on all contacts of a group: 0 ≤ λ ⟂ g + Wλ ≥ 0.
#[derive(Debug, Clone)]
pub(crate) struct Lcp;

impl SlidingRule for Lcp {}

/// A law of sliding contacts, started from the closed contacts of the previous step.
#[derive(Debug, Clone)]
pub(crate) struct SlidingLaw<R>(ContactSolver, PhantomData<R>);

impl<R: SlidingRule> SlidingLaw<R> {
    /// Allocates for `contacts` contacts.
    pub fn new(contacts: usize) -> Self {
        Self(ContactSolver::new(contacts), PhantomData)
    }
}

impl<R: SlidingRule> ContactLaw for SlidingLaw<R> {
    fn is_iterative(&self) -> bool {
        R::IS_ITERATIVE
    }

    fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        fill_sliding(at, R::friction, rows, columns);
    }

    fn begin(&mut self, size: usize) {
        self.0.set_size(size);
        self.0.monotone = true;
    }

    fn begin_with_same_matrix(&mut self) -> bool {
        self.0.begin_with_same_matrix()
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        &mut self.0.delassus
    }

    fn pose(&mut self, contact: usize, _: &[Vector3], at: &impl ContactPrediction) {
        self.0.gaps[contact] = at.gap();
        // The contacts that were closed in the last step are the best initial guess for this step.
        self.0.active[contact] = at.was_closed(0.0);
        self.0.monotone &= at.parameters().friction == 0.0;
    }

    fn solve(&mut self) -> SolverOutcome {
        R::solve(&mut self.0)
    }

    fn multipliers(&self) -> &[f64] {
        &self.0.multipliers[..self.0.size]
    }

    fn gaps(&self) -> &[f64] {
        &self.0.gaps[..self.0.size]
    }
}
