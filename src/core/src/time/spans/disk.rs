//! A disk of coupled sectors, during the steps that its sectors take together.

use crate::modes::cyclic::CyclicBank;
use crate::modes::sectors::Sectors;
use crate::system::Structure;
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::shared_body::SharedBody;

/// A disk of coupled sectors.
#[derive(Debug, Clone)]
pub struct CoupledDisk {
    /// Index of the structure.
    pub structure: usize,
    /// Modes of the disk.
    pub whole: SharedBody,
    /// Displacements of all contact rows at the points of the step (m), and velocities at its start (m/s), `[row][lane of sector]`.
    pub moved: [Vec<f64>; POINTS],
    pub velocity: Vec<f64>,
    /// Largest displacement of all rows of any sector per unit of a coordinate; largest displacements of the rows from rest.
    sizes: Vec<f64>,
    amplitudes: Vec<f64>,
    pub reach: Vec<f64>,
    /// Error of the judged step (m).
    pub error: f64,
}

impl CoupledDisk {
    /// Creates the tables of a structure, with polynomials of degree `degree`.
    pub fn new(structure: usize, bank: &CyclicBank, degree: usize) -> Self {
        let (coordinates, shapes) = bank.coordinates_of();
        let rows = bank.rows() * bank.lanes();
        Self {
            structure,
            moved: std::array::from_fn(|_| vec![0.0; rows]),
            velocity: vec![0.0; rows],
            sizes: bank.sizes(&shapes),
            amplitudes: vec![0.0; coordinates.inertia.len()],
            reach: vec![0.0; bank.rows()],
            error: 0.0,
            whole: SharedBody::new(coordinates, degree),
        }
    }

    /// Reads the state of the structure, before a span.
    pub fn read(&mut self, structure: &mut Structure) {
        let (forces, lanes, nodes) = (&structure.history.force.now, structure.lanes(), structure.nodes());
        let Sectors::Coupled(bank) = &mut structure.modes else { return };
        bank.read_all(self.whole.state_mut());
        self.whole.keep_inertia();
        let sectors = bank.sectors();
        let all = (0..sectors).flat_map(|sector| (0..nodes).map(move |node| (sector, node)));
        let force = |(sector, node): (usize, usize)| {
            (sector, node, [0, 1, 2].map(|component| forces[(3 * node + component) * lanes + sector]))
        };
        let pushing = all.map(force).filter(|(.., force)| force.iter().any(|component| *component != 0.0));
        bank.modal_forces(pushing, self.whole.forces_mut(0));
    }

    /// Finds the largest displacements of the rows of any sector from rest without contact (m).
    pub fn find_reach(&mut self, bank: &CyclicBank) {
        self.whole.amplitudes(&mut self.amplitudes);
        bank.reach(&self.amplitudes, &self.sizes, &mut self.reach);
    }
}
