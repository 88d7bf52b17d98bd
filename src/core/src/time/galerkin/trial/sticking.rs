//! Contacts that may stick: forces at the end of a step lie anywhere within the friction cone.
//!
//! Polynomials are of degree 1, so that the slip of a node is its displacement along the surface over the step. With the gap and
//! the slip without force, b, and the flexibility W along normal and tangents, this is the problem of [`crate::contact::de_saxce`].

use super::prediction::{LanePrediction, LaneValues};
use super::{Trial, TrialResult};
use crate::math::vector::{Vector3, length, tangential, vector3_at};
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::compliance::{LaneCompliance, Lanes};
use crate::time::galerkin::kernels::{AddProduct, Combine};
use crate::time::galerkin::trial::Obstacle;
use nalgebra::DMatrix;

/// Accuracy of the slip, as a fraction of the displacements caused by the forces.
const ROUNDING: f64 = 1e-11;

/// Unknowns and scratch memory.
#[derive(Debug, Clone)]
pub(super) struct Sticking {
    /// Normal and tangents of each node, and those of the members.
    axes: Vec<[Vector3; 3]>,
    rows: Vec<Vector3>,
    /// Slip of the members under the current forces (m).
    slips: Vec<Vector3>,
    /// Motion of all nodes relative to the surface per force along each axis of each node: columns of three rows of lanes.
    columns: Vec<f64>,
    /// Motion of the surface per force, and under the current forces.
    carrier_compliance: Vec<f64>,
    carrier_moved: Vec<f64>,
}

impl Sticking {
    /// Allocates data for `nodes` nodes.
    pub(super) fn new(nodes: usize) -> Self {
        let stride = 3 * Lanes { points: 1, nodes }.width();
        Self {
            axes: vec![[Vector3::zeros(); 3]; nodes],
            rows: vec![Vector3::zeros(); 3 * nodes],
            slips: vec![Vector3::zeros(); nodes],
            columns: vec![0.0; 3 * nodes * stride],
            carrier_compliance: vec![0.0; stride],
            carrier_moved: vec![0.0; stride],
        }
    }
}

impl Trial {
    /// Solves the contact law at the end of the step: first for nodes that penetrate or push, then also for those that these
    /// forces make penetrate.
    pub(super) fn solve_sticking(
        &mut self,
        compliance: &LaneCompliance,
        obstacle: &mut impl Obstacle,
        verdict: &mut TrialResult,
    ) -> bool {
        let Some(mut own) = self.sticking.take() else { return false };
        let solved = self.seek(&mut own, compliance, obstacle, verdict);
        self.sticking = Some(own);
        if !solved {
            return false;
        }
        self.taken.clear();
        self.amounts.clear();
        for node in 0..self.lanes.nodes {
            let force = self.lanes.vector3(&self.forces, node);
            for (component, force) in force.iter().enumerate().filter(|(_, force)| **force != 0.0) {
                self.taken.push(3 * (self.lanes.nodes + node) + component);
                self.amounts.push(*force);
            }
        }
        self.combine(compliance.columns(), compliance.stride());
        true
    }

    fn seek(
        &mut self,
        own: &mut Sticking,
        compliance: &LaneCompliance,
        obstacle: &mut impl Obstacle,
        verdict: &mut TrialResult,
    ) -> bool {
        let lanes = self.lanes;
        self.members.clear();
        for lane in 0..lanes.len() {
            let pushed = lanes.vector3(&self.normals, lane).dot(&lanes.vector3(&self.pushed, lane));
            self.without[lane] = self.gaps[lane] - pushed;
            self.chosen[lane] = self.gaps[lane] <= 0.0 || self.multipliers[lane] > 0.0 || self.without[lane] < 0.0;
        }
        obstacle.begin_solution();
        self.carrier_yields = obstacle.prepare_compliance(lanes, &self.chosen, &self.normals[..3 * lanes.width()]);
        self.find_carrier_motion(own, obstacle);
        for lane in 0..lanes.len() {
            if self.chosen[lane] {
                self.choose_axes(own, lane, compliance, obstacle);
            }
        }
        loop {
            self.pose_sticking(own, obstacle);
            let outcome = self.law.solve();
            verdict.factorisations += outcome.factorisations;
            if !outcome.solved {
                return false;
            }
            let found = self.choose_pressed(own, compliance, obstacle);
            if !found {
                break;
            }
        }
        self.multipliers[..lanes.width()].fill(0.0);
        self.forces[..3 * lanes.width()].fill(0.0);
        for (member, lane) in self.members.iter().enumerate() {
            let along = &self.law.multipliers()[3 * member..][..3];
            self.multipliers[*lane] = along[0];
            if along[0] > 0.0 {
                let force = along.iter().zip(&own.axes[*lane]).map(|(along, axis)| *along * axis).sum();
                lanes.set(&mut self.forces, *lane, force);
            }
        }
        true
    }

    /// Finds the displacements of the obstacle under the current forces.
    fn find_carrier_motion(&mut self, own: &mut Sticking, obstacle: &mut impl Obstacle) {
        own.carrier_moved.fill(0.0);
        if !self.carrier_yields {
            return;
        }
        for lane in (0..self.lanes.len()).filter(|lane| self.multipliers[*lane] > 0.0) {
            obstacle.add_compliance(lane, self.lanes.vector3(&self.forces, lane), &mut own.carrier_compliance);
            own.carrier_moved
                .iter_mut()
                .zip(&own.carrier_compliance)
                .for_each(|(sum, carrier_compliance)| *sum += carrier_compliance);
        }
    }

    /// Makes a node three unknowns.
    fn choose_axes(
        &mut self,
        own: &mut Sticking,
        lane: usize,
        compliance: &LaneCompliance,
        obstacle: &mut impl Obstacle,
    ) {
        let (lanes, stride) = (self.lanes, compliance.stride());
        let (mut axes, mut columns) = ([Vector3::zeros(); 3], [Vector3::zeros(); 3]);
        let Self { without, multipliers, normals, moved, .. } = &*self;
        let values = LaneValues { lanes, without, multipliers, normals, moved };
        self.law.fill_all(&mut axes, &mut columns, std::iter::once(values.prediction(lane, obstacle)));
        own.axes[lane] = axes;
        self.members.push(lane);
        let columns = [0, 1, 2].map(|component| 3 * (lanes.nodes + lane) + component);
        for axis in 0..3 {
            let direction = own.axes[lane][axis];
            let target = &mut own.columns[(3 * lane + axis) * stride..][..stride];
            let (table, columns) = (compliance.columns(), &columns[..]);
            let sums = [&mut *target];
            self.instructions.run(Combine { table, stride, columns, coefficients: [direction.as_slice()], sums });
            if self.carrier_yields {
                obstacle.add_compliance(lane, direction, &mut own.carrier_compliance[..stride]);
                target
                    .iter_mut()
                    .zip(&own.carrier_compliance)
                    .for_each(|(moved, carrier_compliance)| *moved += carrier_compliance);
            }
        }
    }

    /// Assembles the problem of the members.
    fn pose_sticking(&mut self, own: &mut Sticking, obstacle: &impl Obstacle) {
        let (lanes, stride) = (self.lanes, 3 * self.lanes.width());
        for (place, lane) in self.members.iter().enumerate() {
            own.slips[place] = self.slip(*lane, 1, obstacle);
        }
        let Self { law, members, without, multipliers, normals, moved, pushed, forces, .. } = self;
        law.begin(members.len());
        let matrix = law.matrix();
        for (place, lane) in members.iter().enumerate() {
            own.rows[3 * place..][..3].copy_from_slice(&own.axes[*lane]);
            for axis in 0..3 {
                let column = &own.columns[(3 * lane + axis) * stride..][..stride];
                for (row, other) in members.iter().enumerate() {
                    let moved = lanes.vector3(column, *other);
                    for (along, direction) in own.axes[*other].iter().enumerate() {
                        matrix[(3 * row + along, 3 * place + axis)] = direction.dot(&moved);
                    }
                }
            }
        }
        let values = LaneValues { lanes, without, multipliers, normals, moved };
        let predictions = members.iter().zip(&own.slips).map(|(lane, slip)| {
            let (pushed, carrier) = (lanes.vector3(pushed, *lane), lanes.vector3(&own.carrier_moved, *lane));
            let prediction = values.prediction(*lane, obstacle);
            LanePrediction {
                gap: prediction.gap - prediction.normal.dot(&carrier),
                slip: slip - pushed - carrier,
                last_force: if prediction.closed { lanes.vector3(forces, *lane) } else { Vector3::zeros() },
                ..prediction
            }
        });
        law.pose_all(&own.rows, predictions);
    }

    /// Chooses nodes that the current forces push into a surface.
    fn choose_pressed(
        &mut self,
        own: &mut Sticking,
        compliance: &LaneCompliance,
        obstacle: &mut impl Obstacle,
    ) -> bool {
        let (lanes, stride) = (self.lanes, 3 * self.lanes.width());
        let scale = self.members.iter().fold(0.0_f64, |most, lane| most.max(self.gaps[*lane].abs()));
        let members = self.members.len();
        let mut found = false;
        for lane in 0..lanes.len() {
            if self.chosen[lane] || !self.gaps[lane].is_finite() {
                continue;
            }
            let normal = lanes.vector3(&self.normals, lane);
            let mut after = self.without[lane] - normal.dot(&lanes.vector3(&own.carrier_moved, lane));
            for (place, member) in self.members[..members].iter().enumerate() {
                for axis in 0..3 {
                    let column = &own.columns[(3 * member + axis) * stride..][..stride];
                    after += self.law.multipliers()[3 * place + axis] * normal.dot(&lanes.vector3(column, lane));
                }
            }
            if after < -super::ROUNDING * scale {
                self.chosen[lane] = true;
                self.choose_axes(own, lane, compliance, obstacle);
                found = true;
            }
        }
        found
    }

    /// Returns the slip of a node up to a point, relative to the surface (m).
    pub(super) fn slip(&self, node: usize, point: usize, obstacle: &impl Obstacle) -> Vector3 {
        let now = self.displacement(point, node);
        now - vector3_at(&self.start, node) + obstacle.drift(node, point, now)
    }

    /// Energy that friction supplies at the nodes over a solved step (J), because the force at its start does not belong to the
    /// slip of the step.
    pub(crate) fn find_gain(&self, obstacle: &impl Obstacle) -> f64 {
        let mut gain = 0.0;
        let points = self.points();
        let touches = |node: &usize| (0..=points).any(|point| self.multiplier(point, *node) > 0.0);
        for node in (0..self.lanes.nodes).filter(touches) {
            let mut slips = [Vector3::zeros(); POINTS];
            (1..=points).for_each(|point| slips[point] = self.slip(node, point, obstacle));
            let pushed = self.lanes.vector3(&self.pushed, self.lanes.at(points, node));
            let (mut own, mut moved) = (0.0, 0.0);
            for point in 0..=points {
                let terms = self.work_weights[point].iter().zip(&slips);
                let slip: Vector3 = terms.map(|(weight, slip)| *weight * slip).sum();
                let friction = self.friction_force(point, node);
                own += friction.dot(&slip);
                moved += length(friction) * length(pushed);
            }
            gain += if own > ROUNDING * moved { own } else { 0.0 };
        }
        gain
    }

    /// Returns whether contacts may stick.
    pub fn sticks(&self) -> bool {
        self.sticking.is_some()
    }

    /// Returns whether contacts may stick in the tried step.
    pub(super) fn may_stick(&self) -> bool {
        self.sticking.is_some() && !self.slides_fast
    }

    /// Returns the largest distance (m) that nodes may have slid back and forth within a step. Where sliding reverses, nodes
    /// stick for a while; the result is four times the distance because of the duration of sticking.
    pub(crate) fn find_turn(&mut self, residual: &DMatrix<f64>, step: f64, obstacle: &impl Obstacle) -> f64 {
        self.withdrawn.copy_from_slice(&self.velocities);
        let (matrix, x, y) = (residual, &self.start_contacts.slopes, &mut self.withdrawn);
        self.instructions.run(AddProduct { matrix, x, y });
        let touches = |node: &usize| (0..2).all(|point| self.multiplier(point, *node) > 0.0);
        let turn = |node: usize| {
            let (normal, slip) = (self.normal(1, node), self.slip(node, 1, obstacle));
            let drift = obstacle.drift(node, 1, self.displacement(1, node));
            let along = tangential(vector3_at(&self.withdrawn, node) + drift / step, normal);
            let speed = length(along);
            // Speed at the end if it changes steadily.
            let last = 2.0 * slip.dot(&along) / (step * speed) - speed;
            if last < 0.0 { 2.0 * step * last * last / (speed - last) } else { 0.0 }
        };
        (0..self.lanes.nodes).filter(touches).map(turn).fold(0.0, f64::max)
    }
}
