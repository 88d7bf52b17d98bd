//! A disk of coupled sectors, during the steps that its sectors take together.

use super::basis::POINTS;
use super::shared_body::SharedBody;
use super::state::SectorState;
use super::trial::ForceInterpolation;
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::{Vector3, strided_vector3};
use crate::modes::bank::{Disk, ModalBank};
use std::ops::RangeInclusive;

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
    /// Displacements at the last call of [`CoupledDisk::set_motion_origin`] (m).
    motion_origin: Vec<f64>,
    /// Unit normals at the start of the span.
    normals: [Vec<f64>; 3],
    /// Bounds of the change of the gaps of each sector by the motion of its nodes (m).
    motions: Vec<f64>,
    instructions: InstructionSet,
}

/// Assumed largest rotation of a normal in a span (rad). Bumps of a casing are about as high as its clearance, so its flanks are flat.
const NORMAL_ROTATION: f64 = 0.1;

/// Bounds the change of the gap (m) of a node whose displacement components change by up to `motion` (m). `normal` is the unit normal
/// at the start of the span.
#[inline(always)]
pub(super) fn largest_gap_change(motion: [f64; 3], normal: [f64; 3]) -> f64 {
    let ([x, y, z], [a, b, c]) = (motion.map(f64::abs), normal.map(f64::abs));
    a * x + b * y + c * z + NORMAL_ROTATION * (x + y + z)
}

/// Bounds the changes of the gaps of each sector (m), and keeps larger values in `motions`.
struct FindMotions<'a> {
    lanes: usize,
    moved: &'a [f64],
    motion_origin: &'a [f64],
    normals: &'a [Vec<f64>; 3],
    motions: &'a mut [f64],
}

impl Kernel for FindMotions<'_> {
    #[inline(always)]
    fn run(self) {
        let lanes = self.lanes;
        let nodes = self.moved.chunks_exact(3 * lanes).zip(self.motion_origin.chunks_exact(3 * lanes));
        for (node, (now, before)) in nodes.enumerate() {
            let [a, b, c] = self.normals.each_ref().map(|normals| &normals[node * lanes..][..lanes]);
            let change = |row: usize, lane: usize| now[row * lanes + lane] - before[row * lanes + lane];
            for (lane, largest) in self.motions.iter_mut().enumerate() {
                let moved = [change(0, lane), change(1, lane), change(2, lane)];
                let motion = largest_gap_change(moved, [a[lane], b[lane], c[lane]]);
                *largest = if motion > *largest { motion } else { *largest };
            }
        }
    }
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
            motion_origin: vec![0.0; rows],
            normals: std::array::from_fn(|_| vec![0.0; rows / 3]),
            motions: vec![0.0; bank.lanes()],
            instructions: InstructionSet::detect(),
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
        disk.rows_of_two([&self.body.at[0], &self.body.state.velocity], [&mut self.moved[0], &mut self.velocity]);
    }

    /// Advances to the end of an accepted step, whose displacements become those at the start of the next one.
    pub(crate) fn take(&mut self, level: usize, kind: ForceInterpolation, points: usize) {
        self.body.take(level, kind);
        self.body.settle();
        self.moved.swap(0, points);
    }

    /// Finds velocities of all rows at the start of a step.
    pub(crate) fn find_velocity(&mut self, disk: &mut Disk) {
        disk.rows_of(&self.body.state.velocity, &mut self.velocity);
    }

    /// Finds displacements of all rows at the points 1 … `points` of the step.
    pub(crate) fn find_rows_at(&mut self, disk: &mut Disk, points: usize) {
        let ([_, a, b, c], [_, one, two, three]) = (&self.body.at, &mut self.moved);
        if points == 1 {
            return disk.rows_of(a, one);
        }
        disk.rows_of_two([a, b], [one, two]);
        if points == 3 {
            disk.rows_of(c, three);
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

    /// Makes the displacements at the start of the step, which must be known, the origin from which motion is measured.
    pub(crate) fn set_motion_origin(&mut self) {
        self.motion_origin.copy_from_slice(&self.moved[0]);
    }

    /// Sets the normals at the start of the span, `[component][node · lanes + sector]`.
    pub(crate) fn set_normals(&mut self, normals: &[Vec<f64>; 3]) {
        self.normals.iter_mut().zip(normals).for_each(|(own, normals)| own.copy_from_slice(normals));
    }

    /// Bounds the changes of the gaps of each sector (m) by the motion of its nodes since [`CoupledDisk::set_motion_origin`], at the
    /// given points of the step.
    pub(crate) fn find_motions(&mut self, points: RangeInclusive<usize>) {
        self.motions.fill(0.0);
        for moved in &self.moved[points] {
            let Self { lanes, motion_origin, normals, motions, .. } = self;
            self.instructions.run(FindMotions { lanes: *lanes, moved, motion_origin, normals, motions });
        }
    }

    /// Returns the bound of a sector from [`CoupledDisk::find_motions`] (m).
    pub(crate) fn motion(&self, sector: usize) -> f64 {
        self.motions[sector]
    }

    /// Finds the largest displacements of the rows of any sector from rest without contact (m).
    pub(crate) fn find_reach(&mut self, disk: &Disk) {
        self.body.amplitudes(&mut self.amplitudes);
        disk.reach(&self.amplitudes, &self.sizes, &mut self.reach);
    }
}
