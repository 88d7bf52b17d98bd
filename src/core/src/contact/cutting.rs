//! Contact with a coating that is cut, and the hard casing behind it. On a coating the tangential force is 1/κ of the normal force, on the
//! hard casing µ of it, both against the slip.

use nalgebra::DMatrix;

use super::{ContactLaw, ContactPrediction, fill_tangents};
use crate::contact::active_set::SolverOutcome;
use crate::contact::coating::{BladePassage, CoatedProblem, Coating};
use crate::math::vector::Vector3;

/// A coating with its cuts, and the contact problem of its blades. Groups are whole blades, whose nodes share cells.
#[derive(Debug, Clone)]
pub(crate) struct CuttingLaw {
    coating: Coating,
    problem: CoatedProblem,
    size: usize,
    /// Delassus matrix along normals and tangents (m/N).
    matrix: DMatrix<f64>,
    contacts: Vec<CuttingContact>,
    angles: Vec<f64>,
    /// Sliding distance of each contact over the step (m), positive along its first tangent.
    slid: Vec<f64>,
    /// Multipliers along normals and tangents (N).
    multipliers: Vec<f64>,
}

/// Data of one contact.
#[derive(Debug, Clone, Copy, Default)]
struct CuttingContact {
    /// Coulomb coefficient of the hard casing.
    friction: f64,
    /// Component of the slip direction along the first tangent.
    sense: f64,
    sector: usize,
}

impl CuttingLaw {
    /// Allocates for `contacts` contacts, all of whole blades.
    pub fn new(coating: Coating, contacts: usize) -> Self {
        let mut problem = coating.problem(contacts / coating.nodes());
        problem.cut = Some(DMatrix::zeros(contacts, contacts));
        Self {
            problem,
            coating,
            size: 0,
            matrix: DMatrix::zeros(3 * contacts, 3 * contacts),
            contacts: vec![CuttingContact::default(); contacts],
            angles: vec![0.0; contacts],
            slid: vec![0.0; contacts],
            multipliers: vec![0.0; 3 * contacts],
        }
    }

    /// Fills in gaps per normal force with its tangential force: on the hard casing, and on the coating.
    fn fill(&mut self) {
        let tangential = self.coating.tangential_ratio();
        let Some(cut) = &mut self.problem.cut else { return };
        for (j, &CuttingContact { friction, sense, .. }) in self.contacts[..self.size].iter().enumerate() {
            for i in 0..self.size {
                let (normal, across) = (self.matrix[(3 * i, 3 * j)], sense * self.matrix[(3 * i, 3 * j + 1)]);
                self.problem.delassus[(i, j)] = normal - friction * across;
                cut[(i, j)] = normal - tangential * across;
            }
        }
    }
}

impl ContactLaw for CuttingLaw {
    fn directions(&self) -> usize {
        3
    }

    fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        fill_tangents(at, rows, columns);
    }

    fn begin(&mut self, size: usize) {
        self.problem.clear();
        self.problem.monotone = false;
        self.size = size;
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        &mut self.matrix
    }

    fn pose(&mut self, contact: usize, directions: &[Vector3], at: &impl ContactPrediction) {
        let (along, friction) = (at.sliding().direction, at.parameters().friction);
        let sense = along.dot(&directions[1]);
        self.problem.gaps[contact] = at.gap();
        self.problem.closed[contact] = at.was_closed(self.coating.thickness());
        self.contacts[contact] = CuttingContact { friction, sense, sector: at.sector() };
        self.angles[contact] = at.angle();
        self.slid[contact] = sense * along.dot(&at.slip());
    }

    #[inline(never)]
    fn solve(&mut self) -> SolverOutcome {
        let (size, nodes) = (self.size, self.coating.nodes());
        self.fill();
        for first in (0..size).step_by(nodes) {
            let (angles, slid) = (&self.angles[first..first + nodes], &self.slid[first..first + nodes]);
            let way = BladePassage { blade: self.contacts[first].sector, angles, slid };
            self.coating.locate_cut(&mut self.problem, way);
        }
        let outcome = self.problem.solve();
        let tangential = self.coating.tangential_ratio();
        for (contact, &CuttingContact { friction, sense, .. }) in self.contacts[..size].iter().enumerate() {
            let (cut, hard) = (self.problem.coating[contact], self.problem.hard[contact]);
            let across = -sense * (tangential * cut + friction * hard);
            self.multipliers[3 * contact..][..3].copy_from_slice(&[cut + hard, across, 0.0]);
        }
        outcome
    }

    fn multipliers(&self) -> &[f64] {
        &self.multipliers[..3 * self.size]
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

    /// Records the cut of the last solution; the material is removed once the sliding distance is known ([`Coating::cut`]).
    fn commit(&mut self) -> f64 {
        self.coating.take_chips(&self.problem, &self.slid);
        0.0
    }
}
