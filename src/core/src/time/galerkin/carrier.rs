//! A structure that carries surfaces, during the steps of the sectors that touch them.

mod modal_compliance;
mod panels;

use super::basis::{MOST, POINTS, real};
use super::compliance::Lanes;
use super::shared_body::SharedBody;
use super::trial::ForceInterpolation;
use crate::math::simd::InstructionSet;
use crate::math::vector::{Vector3, vector3_at};
use crate::modes::bank::ModalBank;
use crate::modes::coordinates::Coordinates;
use crate::system::carrier::Spot;
use modal_compliance::ModalCompliance;
use panels::{PANEL, PanelMatrix};
use std::ops::RangeInclusive;

/// Largest number of sectors that exchange forces through the structure within a contact solution. Each of them has a block of lanes.
/// All other sectors share block `BLOCKS`.
pub(crate) const BLOCKS: usize = 32;

/// Tables, state and scratch memory of a structure that carries surfaces.
#[derive(Debug, Clone)]
pub struct CarrierIntegrator {
    /// Index of the structure.
    pub structure: usize,
    /// Modes of the structure.
    pub body: SharedBody,
    /// Mode shapes Φ at the rows that move control points, and Φᵀ.
    shapes: PanelMatrix,
    transposed: PanelMatrix,
    /// The indices 0, 1, 2, … of all modes.
    all: Vec<usize>,
    instructions: InstructionSet,
    /// Displacements of these rows at the points of the step (m), and velocities at its start (m/s).
    moved: [Vec<f64>; POINTS],
    velocity: Vec<f64>,
    /// True if `velocity` belongs to the start of the current step.
    is_velocity_known: bool,
    /// Displacements of these rows (m) at the last call of [`CarrierIntegrator::set_motion_origin`].
    motion_origin: Vec<f64>,
    /// Displacements over which forces at each point of the accepted step do work, Σ_k S_ik u_k (m).
    worked: [Vec<f64>; POINTS],
    /// Weights of the work of forces at each point of the tried step.
    pub work_weights: [[f64; POINTS]; POINTS],
    /// δ² per squared impulse on each mode: ½ mean φ²/ω².
    error_form: Vec<f64>,
    /// Errors of impulses on the modes in the tried step.
    pub impulses: Vec<f64>,
    /// Compliance at the lanes of the sectors, in single precision.
    pub(crate) compliance: ModalCompliance,
    /// Loads on the rows at the points (N), and true for each row with loads.
    loads: [Vec<f64>; POINTS],
    is_loaded: Vec<bool>,
    /// Scratch: indices of the rows with loads, in ascending order.
    loaded: Vec<usize>,
    /// Scratch: modal forces, padded to whole panels.
    modal: [Vec<f64>; MOST],
}

impl CarrierIntegrator {
    /// Creates an integrator with polynomials of degree `degree`, for sectors of at most these lanes.
    pub fn new(structure: usize, bank: &ModalBank, degree: usize, lanes: Lanes) -> Self {
        let coordinates = coordinates(bank);
        let (modes, rows) = (bank.modes(), bank.rows());
        let shape = |row: usize, mode: usize| bank.contact_row(row)[mode];
        let [padded, padded_modes] = [rows, modes].map(|count| count.next_multiple_of(PANEL));
        let lowest = coordinates.frequencies.iter().copied().filter(|w| *w > 0.0).fold(f64::INFINITY, f64::min);
        let of_mode = |mode: usize| {
            let square: f64 = (0..rows).map(|row| shape(row, mode).powi(2)).sum();
            0.5 * coordinates.inertia[mode] * square / real(rows) / coordinates.frequencies[mode].max(lowest).powi(2)
        };
        let error_form = (0..modes).map(of_mode).collect();
        let body = SharedBody::new(coordinates, degree);
        Self {
            error_form,
            structure,
            compliance: ModalCompliance::new(bank, lanes),
            shapes: PanelMatrix::new(rows, modes, shape),
            transposed: PanelMatrix::new(modes, rows, |mode, row| shape(row, mode)),
            all: (0..modes).collect(),
            instructions: InstructionSet::detect(),
            moved: std::array::from_fn(|_| vec![0.0; padded]),
            velocity: vec![0.0; padded],
            is_velocity_known: false,
            motion_origin: vec![0.0; padded],
            worked: std::array::from_fn(|_| vec![0.0; padded]),
            work_weights: [[0.0; POINTS]; POINTS],
            impulses: vec![0.0; modes],
            loads: std::array::from_fn(|_| vec![0.0; rows]),
            loaded: Vec::with_capacity(rows),
            is_loaded: vec![false; rows],
            modal: std::array::from_fn(|_| vec![0.0; padded_modes]),
            body: if bank.options.loads { body.loaded() } else { body },
        }
    }

    /// Displacements of the rows at a point of the step (m).
    pub fn moved(&self, point: usize) -> &[f64] {
        &self.moved[point]
    }

    /// Computes the rows at the points 1 … `points` of the step, under the forces there; and their velocities at the start of the step, if
    /// they are not known.
    pub fn recover(&mut self, points: usize) {
        let Self { shapes, all, moved: [_, one, two, three], velocity, is_velocity_known, body, .. } = self;
        let [_, a, b, c] = body.at.each_ref().map(|at| &at[..]);
        let (v, instructions) = (&body.state.velocity[..], self.instructions);
        match (points, *is_velocity_known) {
            (1, true) => shapes.multiply(instructions, all, [a], [one]),
            (1, false) => shapes.multiply(instructions, all, [a, v], [one, velocity]),
            (2, true) => shapes.multiply(instructions, all, [a, b], [one, two]),
            (2, false) => shapes.multiply(instructions, all, [a, b, v], [one, two, velocity]),
            (_, true) => shapes.multiply(instructions, all, [a, b, c], [one, two, three]),
            (_, false) => shapes.multiply(instructions, all, [a, b, c, v], [one, two, three, velocity]),
        }
        *is_velocity_known = true;
    }

    /// Finds displacements and velocities of the rows at the start of a span.
    pub(crate) fn find_start(&mut self) {
        self.body.settle();
        let Self { shapes, all, moved: [start, ..], velocity, body, instructions, .. } = self;
        shapes.multiply(*instructions, all, [&body.at[0], &body.state.velocity], [start, velocity]);
        self.is_velocity_known = true;
        self.set_motion_origin();
    }

    /// Makes the displacements at the start of the step the origin from which motion is measured.
    pub(crate) fn set_motion_origin(&mut self) {
        self.motion_origin.copy_from_slice(&self.moved[0]);
    }

    /// Largest square of the motion of a control point since [`CarrierIntegrator::set_motion_origin`] at the given points of the step (m²);
    /// `row` is its first row.
    pub(crate) fn largest_square_motion(&self, row: usize, points: RangeInclusive<usize>) -> f64 {
        let square = |moved: &Vec<f64>| {
            (vector3_at(&moved[row..], 0) - vector3_at(&self.motion_origin[row..], 0)).norm_squared()
        };
        self.moved[points].iter().map(square).fold(0.0, f64::max)
    }

    /// Advances to the end of an accepted step. Displacements at its end become those at the start of the next step.
    pub(crate) fn take(&mut self, level: usize, kind: ForceInterpolation, points: usize) {
        self.body.take(level, kind);
        self.body.settle();
        self.moved.swap(0, points);
        self.is_velocity_known = false;
    }

    /// Velocity of a place at the start of the step (m/s), in the directions of the node.
    pub(crate) fn velocity_at(&self, spot: Spot) -> Vector3 {
        spot.interpolate(|row| self.velocity[row])
    }

    /// Returns the displacement of a place over which a force at point i of the tried step does work (m), in the directions of the node.
    pub(crate) fn sliding_distance_at(&self, spot: Spot, i: usize) -> Vector3 {
        let (weights, moved) = (&self.work_weights[i], &self.moved);
        let sliding_distance =
            |row: usize| weights.iter().zip(moved).map(|(weight, moved)| weight * moved[row]).sum::<f64>();
        spot.interpolate(sliding_distance)
    }

    /// Displacement of a place at a point of the step (m), in the directions of the node.
    pub(crate) fn moved_at(&self, spot: Spot, point: usize) -> Vector3 {
        spot.interpolate(|row| self.moved[point][row])
    }

    /// Returns the displacement of a place over which a force at point i of the accepted step does work (m), in the directions of the node.
    pub(crate) fn worked_at(&self, spot: Spot, i: usize) -> Vector3 {
        spot.interpolate(|row| self.worked[i][row])
    }

    /// Computes the weighted displacements for the work of forces at the points.
    pub(crate) fn weigh(&mut self, points: usize) {
        let Self { worked, moved, work_weights, .. } = self;
        for (worked, weights) in worked.iter_mut().zip(work_weights).take(points + 1) {
            for (row, worked) in worked.iter_mut().enumerate() {
                *worked = (0..=points).map(|k| weights[k] * moved[k][row]).sum();
            }
        }
    }

    /// Removes all loads.
    pub(crate) fn clear_loads(&mut self) {
        self.is_loaded.fill(false);
        self.loads.iter_mut().for_each(|loads| loads.fill(0.0));
    }

    /// Adds the reaction to a force on a node at a place to the loads at point i.
    pub(crate) fn react(&mut self, spot: Spot, i: usize, force: Vector3) {
        let ((weights, first), fixed) = (spot.rows(), spot.frame.fixed(force));
        for (first, weight) in first.iter().zip(&weights.values[..weights.len]) {
            for (component, force) in fixed.iter().enumerate() {
                let row = first + component;
                self.loads[i][row] -= weight * force;
                self.is_loaded[row] = true;
            }
        }
    }

    /// Computes the modal forces at some points from the loads.
    pub(crate) fn gather(&mut self, points: RangeInclusive<usize>) {
        let (first, count) = (*points.start(), points.end() + 1 - points.start());
        self.gather_loads(first, count);
        for (forces, modal) in self.body.forces[points].iter_mut().zip(&self.modal) {
            let modes = forces.len();
            forces.copy_from_slice(&modal[..modes]);
        }
    }

    /// Computes the modal impulses (N·s) from the loads at point 0, which contain the reactions to impulses on the nodes.
    pub(crate) fn gather_impulses(&mut self) {
        self.gather_loads(0, 1);
        let modes = self.impulses.len();
        self.impulses.copy_from_slice(&self.modal[0][..modes]);
    }

    /// Computes the modal forces of the loads at `count` points from `first` on.
    fn gather_loads(&mut self, first: usize, count: usize) {
        let Self { transposed, loads, loaded, is_loaded, modal: [one, two, three], .. } = self;
        loaded.clear();
        loaded.extend(is_loaded.iter().enumerate().filter(|(_, is_loaded)| **is_loaded).map(|(row, _)| row));
        let (loads, instructions) = (&loads[first..first + count], self.instructions);
        match loads {
            [a] => transposed.multiply(instructions, loaded, [a], [one]),
            [a, b] => transposed.multiply(instructions, loaded, [a, b], [one, two]),
            [a, b, c] => transposed.multiply(instructions, loaded, [a, b, c], [one, two, three]),
            _ => unreachable!("loads are gathered at one to three points"),
        }
    }

    /// Displacement error caused by the impulses (m).
    pub fn error(&self) -> f64 {
        self.impulses.iter().zip(&self.error_form).map(|(impulse, form)| impulse * impulse * form).sum::<f64>().sqrt()
    }
}

/// Modes of a structure that carries surfaces.
pub fn coordinates(bank: &ModalBank) -> Coordinates {
    let model = bank.model();
    let dynamic = model.inertial_modes();
    Coordinates::new(&model.frequencies, &model.damping_ratios, dynamic)
}
