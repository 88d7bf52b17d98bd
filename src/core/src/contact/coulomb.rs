//! Law with stick and slip on all contacts of a group, in De Saxcé's form.

use nalgebra::DMatrix;

use super::{ContactLaw, ContactPrediction, fill_tangents};
use crate::contact::active_set::SolverOutcome;
use crate::contact::de_saxce::CoulombSolver;
use crate::math::vector::Vector3;

/// Coulomb friction, started from the forces of the last step.
#[derive(Debug, Clone)]
pub(crate) struct Coulomb {
    solver: CoulombSolver,
    size: usize,
    /// Corrected gaps (m).
    corrected: Vec<f64>,
}

impl Coulomb {
    /// Allocates for `contacts` contacts.
    pub fn new(contacts: usize) -> Self {
        Self { solver: CoulombSolver::new(contacts), size: 0, corrected: vec![0.0; contacts] }
    }
}

impl ContactLaw for Coulomb {
    fn directions(&self) -> usize {
        3
    }

    fn starts_from_forces(&self) -> bool {
        true
    }

    fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        fill_tangents(at, rows, columns);
    }

    fn begin(&mut self, size: usize) {
        self.size = size;
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        &mut self.solver.delassus
    }

    fn pose(&mut self, contact: usize, directions: &[Vector3], at: &impl ContactPrediction) {
        let (slip, last) = (at.slip(), at.last_force());
        self.solver.friction[contact] = at.parameters().friction;
        for (along, direction) in directions.iter().enumerate() {
            self.solver.free[3 * contact + along] = direction.dot(&slip);
            self.solver.reactions[3 * contact + along] = direction.dot(&last);
        }
        self.solver.free[3 * contact] = at.gap();
    }

    #[inline(never)]
    fn solve(&mut self) -> SolverOutcome {
        let outcome = self.solver.solve(self.size);
        for (contact, gap) in self.corrected[..self.size].iter_mut().enumerate() {
            let touching = self.solver.reactions[3 * contact] > 0.0;
            *gap = if touching { 0.0 } else { self.solver.relative[3 * contact].max(0.0) };
        }
        outcome
    }

    fn multipliers(&self) -> &[f64] {
        &self.solver.reactions[..3 * self.size]
    }

    fn gaps(&self) -> &[f64] {
        &self.corrected[..self.size]
    }
}
