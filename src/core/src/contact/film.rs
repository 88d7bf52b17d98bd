//! Forward-increment Lagrange multipliers (eqs 10-11 of the paper): equality on the nodes that penetrate in the prediction.

use nalgebra::DMatrix;

use super::{ContactLaw, ContactPrediction, fill_sliding};
use crate::contact::active_set::{ContactSolver, SolverOutcome};
use crate::math::vector::Vector3;

/// Penetration is detected once; neither a negative λ nor a penetration caused elsewhere is checked again.
#[derive(Debug, Clone)]
pub struct Film(ContactSolver);

impl Film {
    /// Allocates for `contacts` contacts.
    pub fn new(contacts: usize) -> Self {
        Self(ContactSolver::new(contacts))
    }
}

impl ContactLaw for Film {
    const DIRECTIONS: usize = 1;
    const LOOKS_AGAIN: bool = false;

    fn fill_directions(at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        fill_sliding(at, rows, columns);
    }

    fn begin(&mut self, size: usize) {
        self.0.set_size(size);
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        &mut self.0.delassus
    }

    fn pose(&mut self, contact: usize, _: &[Vector3], at: &impl ContactPrediction) {
        self.0.gaps[contact] = at.gap();
    }

    fn solve(&mut self) -> SolverOutcome {
        self.0.film()
    }

    fn multipliers(&self) -> &[f64] {
        &self.0.multipliers[..self.0.size()]
    }

    fn gaps(&self) -> &[f64] {
        &self.0.gaps[..self.0.size()]
    }
}
