//! Contact with an abradable coating and the hard casing behind it. A coating that is compressed consists of rods that
//! are free, elastic or yielding, with Coulomb friction. On a coating that is cut, the tangential force is 1/κ times
//! the normal force. On the hard casing it is µ times the normal force. Both act against the slip.

use nalgebra::DMatrix;

use super::{ContactLaw, ContactPrediction, fill_sliding, fill_tangents};
use crate::contact::active_set::SolverOutcome;
use crate::contact::coating::{CoatedProblem, Coating};
use crate::math::vector::Vector3;

/// A coating with its wear, and the contact problem of its blades. Groups are whole blades, whose nodes share cells.
#[derive(Debug, Clone)]
pub(crate) struct Coated {
    coating: Coating,
    problem: Box<CoatedProblem>,
    size: usize,
    /// Angles of the contacts on the casing (rad).
    angles: Vec<f64>,
    /// Force of coating and hard casing together (N), along normals and, if the coating is cut, tangents.
    multipliers: Vec<f64>,
    cut: Option<CutContacts>,
}

/// Contacts of a group on a coating that is cut.
#[derive(Debug, Clone)]
struct CutContacts {
    /// Delassus matrix along normals and tangents (m/N).
    matrix: DMatrix<f64>,
    contacts: Vec<CutContact>,
    /// Sliding distance of each contact over the step (m), positive along its first tangent.
    slid: Vec<f64>,
}

/// A contact on a coating that is cut.
#[derive(Debug, Clone, Copy, Default)]
struct CutContact {
    /// Coulomb coefficient of the hard casing.
    friction: f64,
    /// Component of the slip direction along the first tangent.
    sense: f64,
    sector: usize,
}

impl Coated {
    /// Allocates for `contacts` contacts, all of whole blades.
    pub fn new(coating: Coating, contacts: usize) -> Self {
        let mut problem = Box::new(coating.problem(contacts / coating.nodes()));
        let cut = coating.is_cut().then(|| CutContacts {
            matrix: DMatrix::zeros(3 * contacts, 3 * contacts),
            contacts: vec![CutContact::default(); contacts],
            slid: vec![0.0; contacts],
        });
        problem.cut = cut.as_ref().map(|_| DMatrix::zeros(contacts, contacts));
        let (angles, multipliers) = (vec![0.0; contacts], vec![0.0; if cut.is_some() { 3 } else { 1 } * contacts]);
        Self { coating, problem, size: 0, angles, multipliers, cut }
    }

    /// Fills the matrices of gaps per normal force, which include its tangential force: one for the hard casing, one
    /// for the cut coating.
    fn fill(&mut self) {
        let tangential = self.coating.tangential_ratio();
        let (Some(of), Some(cut)) = (&self.cut, &mut self.problem.cut) else { return };
        for (j, &CutContact { friction, sense, .. }) in of.contacts[..self.size].iter().enumerate() {
            for i in 0..self.size {
                let (normal, across) = (of.matrix[(3 * i, 3 * j)], sense * of.matrix[(3 * i, 3 * j + 1)]);
                self.problem.delassus[(i, j)] = normal - friction * across;
                cut[(i, j)] = normal - tangential * across;
            }
        }
    }
}

impl ContactLaw for Coated {
    fn directions(&self) -> usize {
        if self.cut.is_some() { 3 } else { 1 }
    }

    fn fill_directions(&self, at: &impl ContactPrediction, rows: &mut [Vector3], columns: &mut [Vector3]) {
        match self.cut {
            Some(_) => fill_tangents(at, rows, columns),
            None => fill_sliding(at, |parameters, _| parameters.friction, rows, columns),
        }
    }

    fn begin(&mut self, size: usize) {
        self.problem.clear();
        self.problem.monotone = self.cut.is_none();
        self.size = size;
    }

    fn matrix(&mut self) -> &mut DMatrix<f64> {
        self.cut.as_mut().map_or(&mut self.problem.delassus, |cut| &mut cut.matrix)
    }

    fn pose(&mut self, contact: usize, directions: &[Vector3], at: &impl ContactPrediction) {
        let friction = at.parameters().friction;
        self.angles[contact] = at.angle();
        self.problem.gaps[contact] = at.gap();
        self.problem.monotone &= friction == 0.0;
        self.problem.closed[contact] = at.was_closed(self.coating.thickness);
        if let Some(cut) = &mut self.cut {
            let along = at.sliding().direction;
            let sense = along.dot(&directions[1]);
            cut.contacts[contact] = CutContact { friction, sense, sector: at.sector() };
            cut.slid[contact] = sense * along.dot(&at.slip());
        }
    }

    #[inline(never)]
    fn solve(&mut self) -> SolverOutcome {
        self.fill();
        let nodes = self.coating.nodes();
        for (blade, angles) in self.angles[..self.size].chunks_exact(nodes).enumerate() {
            let Some(CutContacts { contacts, slid, .. }) = &self.cut else {
                self.coating.locate(&mut self.problem, angles);
                continue;
            };
            let first = blade * nodes;
            self.coating.locate_cut(&mut self.problem, contacts[first].sector, angles, &slid[first..][..nodes]);
        }
        let (outcome, tangential) = (self.problem.solve(), self.coating.tangential_ratio());
        for contact in 0..self.size {
            let (coating, hard) = (self.problem.coating[contact], self.problem.hard[contact]);
            let Some(cut) = &self.cut else {
                self.multipliers[contact] = coating + hard;
                continue;
            };
            let CutContact { friction, sense, .. } = cut.contacts[contact];
            let across = -sense * (tangential * coating + friction * hard);
            self.multipliers[3 * contact..][..3].copy_from_slice(&[coating + hard, across, 0.0]);
        }
        outcome
    }

    fn multipliers(&self) -> &[f64] {
        &self.multipliers[..self.directions() * self.size]
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

    /// If the coating is cut, records the cut of the last solution; the material is removed once the sliding distance
    /// is known ([`Coating::cut`]).
    fn commit(&mut self) -> f64 {
        let Some(cut) = &self.cut else { return self.coating.commit(&self.problem) };
        self.coating.take_chips(&self.problem, &cut.slid);
        0.0
    }
}
