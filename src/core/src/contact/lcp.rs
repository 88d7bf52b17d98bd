//! Signorini's law on all contacts of a group: 0 ≤ λ ⟂ g + Wλ ≥ 0.

use nalgebra::DMatrix;

use super::{ContactLaw, ContactPrediction, fill_sliding};
use crate::contact::active_set::{ContactSolver, SolverOutcome};
use crate::math::vector::Vector3;

/// Linear complementarity, started from the closed contacts of the previous step.
#[derive(Debug, Clone)]
pub struct Lcp(ContactSolver);

impl Lcp {
    /// Allocates for `contacts` contacts.
    pub fn new(contacts: usize) -> Self {
        Self(ContactSolver::new(contacts))
    }
}

impl ContactLaw for Lcp {
    const DIRECTIONS: usize = 1;
    const LOOKS_AGAIN: bool = true;

    fn fill_directions(at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        fill_sliding(at, rows, columns);
    }

    fn begin(&mut self, size: usize) {
        self.0.set_size(size);
        self.0.monotone = true;
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        &mut self.0.delassus
    }

    fn pose(&mut self, contact: usize, _: &[Vector3], at: &impl ContactPrediction) {
        self.0.gaps[contact] = at.gap();
        // Contacts that were closed in the last step are the best guess for this one.
        self.0.active[contact] = at.was_closed(0.0);
        self.0.monotone &= at.friction() == 0.0;
    }

    fn solve(&mut self) -> SolverOutcome {
        self.0.lcp()
    }

    fn multipliers(&self) -> &[f64] {
        &self.0.multipliers[..self.0.size()]
    }

    fn gaps(&self) -> &[f64] {
        &self.0.gaps[..self.0.size()]
    }
}
