//! Contact with an abradable coating: rods that are free, elastic or yielding, and the hard casing behind the coating.

use nalgebra::DMatrix;

use super::{ContactLaw, ContactPrediction, fill_sliding};
use crate::contact::active_set::SolverOutcome;
use crate::contact::coating::{CoatedProblem, Coating};
use crate::math::vector::Vector3;

/// A coating with its wear, and the contact problem of its blades. Groups are whole blades, whose nodes share cells.
#[derive(Debug, Clone)]
pub(crate) struct Coated {
    coating: Coating,
    problem: CoatedProblem,
    size: usize,
    /// Angles of the contacts on the casing (rad).
    angles: Vec<f64>,
    /// Force of coating and hard casing together (N).
    multipliers: Vec<f64>,
}

impl Coated {
    /// Allocates for `contacts` contacts, all of whole blades.
    pub fn new(coating: Coating, contacts: usize) -> Self {
        Self {
            problem: coating.problem(contacts / coating.nodes()),
            coating,
            size: 0,
            angles: vec![0.0; contacts],
            multipliers: vec![0.0; contacts],
        }
    }
}

impl ContactLaw for Coated {
    fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        fill_sliding(at, |parameters, _| parameters.friction, rows, columns);
    }

    fn begin(&mut self, size: usize) {
        self.problem.clear();
        self.problem.monotone = true;
        self.size = size;
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        &mut self.problem.delassus
    }

    fn pose(&mut self, contact: usize, _: &[Vector3], at: &impl ContactPrediction) {
        self.angles[contact] = at.angle();
        self.problem.gaps[contact] = at.gap();
        self.problem.monotone &= at.parameters().friction == 0.0;
        self.problem.closed[contact] = at.was_closed(self.coating.thickness());
    }

    #[inline(never)]
    fn solve(&mut self) -> SolverOutcome {
        let size = self.size;
        for blade in self.angles[..size].chunks_exact(self.coating.nodes()) {
            self.coating.locate(&mut self.problem, blade);
        }
        let outcome = self.problem.solve();
        for contact in 0..size {
            self.multipliers[contact] = self.problem.coating[contact] + self.problem.hard[contact];
        }
        outcome
    }

    fn multipliers(&self) -> &[f64] {
        &self.multipliers[..self.size]
    }

    fn gaps(&self) -> &[f64] {
        &self.problem.gaps[..self.size]
    }

    fn coating_shares(&self) -> &[f64] {
        &self.problem.coating[..self.size]
    }

    fn coating(&self) -> Option<&Coating> {
        Some(&self.coating)
    }

    fn coating_mut(&mut self) -> Option<&mut Coating> {
        Some(&mut self.coating)
    }

    fn commit(&mut self) -> f64 {
        self.coating.commit(&self.problem)
    }
}
