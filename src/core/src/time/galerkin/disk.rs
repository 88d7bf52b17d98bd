//! A disk of coupled sectors, during the steps that its sectors take together.

use super::basis::POINTS;
use super::shared_body::SharedBody;
use super::state::SectorState;
use crate::math::vector::{Vector3, strided_vector3};
use crate::modes::bank::{Disk, ModalBank};

/// A disk of coupled sectors.
#[derive(Debug, Clone)]
pub struct CoupledDisk {
    /// Index of the structure.
    pub structure: usize,
    /// Modes of the disk.
    pub body: SharedBody,
    /// Displacements of all contact rows at the points of the step (m), and velocities at its start (m/s), `[row][lane of sector]`.
    moved: [Vec<f64>; POINTS],
    velocity: Vec<f64>,
    /// Lanes of a row.
    lanes: usize,
    /// Largest displacement of all rows of any sector per unit of a coordinate; largest displacements of the rows from rest.
    sizes: Vec<f64>,
    amplitudes: Vec<f64>,
    pub reach: Vec<f64>,
    /// Error of the judged step (m).
    pub error: f64,
}

impl CoupledDisk {
    /// Creates the tables of a structure, with polynomials of degree `degree`.
    pub fn new(structure: usize, bank: &ModalBank, disk: &Disk, degree: usize) -> Self {
        let (coordinates, shapes) = disk.coordinates_of();
        let rows = bank.rows() * bank.lanes();
        Self {
            structure,
            moved: std::array::from_fn(|_| vec![0.0; rows]),
            velocity: vec![0.0; rows],
            sizes: disk.sizes(&shapes),
            amplitudes: vec![0.0; coordinates.inertia.len()],
            reach: vec![0.0; bank.rows()],
            error: 0.0,
            lanes: bank.lanes(),
            body: SharedBody::new(coordinates, degree),
        }
    }

    /// Reads the state of the structure before a span; `forces` are the contact forces on all rows (N).
    pub fn read(&mut self, bank: &mut ModalBank, forces: &[f64], nodes: usize) {
        let SectorState { position, velocity, .. } = &mut self.body.state;
        bank.read_all([position, velocity]);
        self.body.keep_inertia();
        let (sectors, lanes) = (bank.sectors(), self.lanes);
        let all = (0..sectors).flat_map(|sector| (0..nodes).map(move |node| (sector, node)));
        let force = |node: usize, sector: usize| strided_vector3(forces, 3 * node * lanes + sector, lanes);
        let all = all.map(|(sector, node)| (sector, node, force(node, sector)));
        let pushing = all.filter(|(.., force)| *force != Vector3::zeros());
        if let Some(disk) = bank.disk_mut() {
            disk.modal_forces(pushing, &mut self.body.forces[0]);
        }
    }

    /// Finds displacements and velocities of all rows at the start of a step.
    pub(crate) fn find_rows(&mut self, disk: &mut Disk) {
        disk.rows_of(&self.body.at[0], &mut self.moved[0]);
        disk.rows_of(&self.body.state.velocity, &mut self.velocity);
    }

    /// Finds displacements of all rows at the points 1 … `points` of the step.
    pub(crate) fn find_rows_at(&mut self, disk: &mut Disk, points: usize) {
        for point in 1..=points {
            disk.rows_of(&self.body.at[point], &mut self.moved[point]);
        }
    }

    /// Displacement (m) and velocity (m/s) of a row of a sector at the start of the step.
    pub(crate) fn row_at_start(&self, row: usize, sector: usize) -> [f64; 2] {
        let place = row * self.lanes + sector;
        [self.moved[0][place], self.velocity[place]]
    }

    /// Displacement of a node of a sector at a point of the step (m).
    pub(crate) fn moved_at(&self, point: usize, node: usize, sector: usize) -> Vector3 {
        strided_vector3(&self.moved[point], 3 * node * self.lanes + sector, self.lanes)
    }

    /// Finds the largest displacements of the rows of any sector from rest without contact (m).
    pub(crate) fn find_reach(&mut self, disk: &Disk) {
        self.body.amplitudes(&mut self.amplitudes);
        disk.reach(&self.amplitudes, &self.sizes, &mut self.reach);
    }
}
