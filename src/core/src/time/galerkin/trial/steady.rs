//! Steps of a higher degree for contacts that may stick, while no contact changes its status.
//!
//! The equations for the forces at the points are then linear: a sticking node keeps its place on the surface, and the friction
//! on a sliding node opposes its slip. The assumption is checked afterwards: forces press and lie within the friction cone,
//! sliding has not reversed, and open nodes stay open. Otherwise a step of degree 1 finds the change.

use super::{Trial, TrialResult};
use crate::contact::Law;
use crate::contact::de_saxce::Eliminate;
use crate::math::vector::{Vector3, length, tangential, tangents, vector3_at};
use crate::scene::method::Solver;
use crate::time::galerkin::basis::{POINTS, TimeBasis};
use crate::time::galerkin::compliance::LaneCompliance;
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::rows::ContactRows;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::trial::{ForceInterpolation, Obstacle};

/// Largest number of evaluations of gaps and slips.
const PASSES: usize = 8;
/// A contact slides if its force is within the cone by less than this fraction of µλ.
const ON_THE_CONE: f64 = 1e-7;
/// Accuracy of sliding directions.
const TURNED: f64 = 1e-9;
/// Rounding error of forces, as a fraction of the largest.
const ROUNDING: f64 = 1e-10;

/// Status of a contact over the step.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ContactStatus {
    Open,
    Sticks,
    /// Slides; friction opposes this direction at the start.
    Slides(Vector3),
}

/// Scratch memory.
#[derive(Debug, Clone)]
pub(super) struct Steady {
    status: Vec<ContactStatus>,
    /// Direction of the slip at every lane.
    pub(super) directions: Vec<Vector3>,
    /// Law of contacts that slide fast.
    pub(super) sliding_law: Law,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Steady {
    /// Allocates data for `lanes` lanes and `nodes` nodes.
    pub(super) fn new(lanes: usize, nodes: usize) -> Self {
        Self {
            status: vec![ContactStatus::Open; nodes],
            directions: vec![Vector3::zeros(); lanes],
            sliding_law: Law::new(Solver::Lcp, None, lanes),
            matrix: vec![0.0; 9 * lanes * lanes],
            right: vec![0.0; 3 * lanes],
        }
    }
}

impl Trial {
    /// Tries a step in which no contact changes its status; it counts as unsolved if one does.
    pub(crate) fn run_steady(
        &mut self,
        level: &StepTables,
        rows: &ContactRows,
        state: &SectorState,
        obstacle: &mut impl Obstacle,
        precision: f64,
    ) -> TrialResult {
        let mut verdict = TrialResult::default();
        let Some(mut own) = self.steady.take() else { return verdict };
        if self.find_status(&mut own, state, obstacle) {
            self.begin(level, ForceInterpolation::Polynomial, Some(rows), state);
            self.find_start(rows, state);
            self.end_slopes = level.basis.slopes_at(1.0).map(|slope| slope / level.step);
            verdict.solved = self.seek_steady(&mut own, level, obstacle, precision, &mut verdict);
        }
        self.steady = Some(own);
        if verdict.solved {
            self.judge(level, rows, obstacle, 0.0, &mut verdict);
            verdict.depth = self.depth(obstacle);
            // The energy supplied by friction at the start would have to come from the bank.
            verdict.solved = !verdict.switches;
        }
        verdict
    }

    /// Finds the status of all contacts at the start; returns false if none is closed.
    fn find_status(&self, own: &mut Steady, state: &SectorState, obstacle: &impl Obstacle) -> bool {
        let mut any = false;
        for (node, status) in own.status.iter_mut().enumerate() {
            let multiplier = state.multipliers[node];
            let along = vector3_at(&state.forces, node) - multiplier * vector3_at(&state.normals, node);
            let (size, most) = (length(along), obstacle.parameters(node).friction * multiplier);
            *status = if multiplier == 0.0 {
                ContactStatus::Open
            } else if size < most * (1.0 - ON_THE_CONE) {
                ContactStatus::Sticks
            } else {
                ContactStatus::Slides(if size > 0.0 { -along / size } else { Vector3::zeros() })
            };
            any |= multiplier > 0.0;
        }
        any
    }

    fn seek_steady(
        &mut self,
        own: &mut Steady,
        level: &StepTables,
        obstacle: &mut impl Obstacle,
        precision: f64,
        verdict: &mut TrialResult,
    ) -> bool {
        let (lanes, basis) = (self.lanes, &level.basis);
        for lane in 0..lanes.len() {
            if let ContactStatus::Slides(direction) = own.status[lanes.place(lane).1] {
                own.directions[lane] = direction;
            }
        }
        for pass in 0..PASSES {
            let (lowest, largest) = self.find_gaps(obstacle);
            if lowest.is_nan() {
                return false;
            }
            let turned = self.find_directions(own, basis, obstacle);
            if pass > 0 && largest <= precision && turned <= TURNED && self.largest_slip(own, obstacle) <= precision {
                return lowest >= -precision && self.holds(own, obstacle);
            }
            verdict.factorisations += 1;
            if !self.solve_steady(own, &level.compliance, obstacle) {
                return false;
            }
        }
        false
    }

    /// Finds the sliding directions of the nodes at all points, and returns by how much they have turned.
    fn find_directions(&self, own: &mut Steady, basis: &TimeBasis, obstacle: &impl Obstacle) -> f64 {
        let mut turned = 0.0_f64;
        for node in 0..self.lanes.nodes {
            let ContactStatus::Slides(_) = own.status[node] else { continue };
            let mut places = [Vector3::zeros(); POINTS];
            (1..basis.count()).for_each(|point| places[point] = self.slip(node, point, obstacle));
            for point in 1..basis.count() {
                let (lane, normal) = (self.lanes.at(point, node), self.normal(point, node));
                let slip = (0..basis.count()).map(|k| basis.work[point][k] * places[k]).sum();
                let along = tangential(slip, normal);
                let size = length(along);
                if size > 0.0 {
                    let direction = along / size;
                    let change = (direction - own.directions[lane]).amax();
                    (turned, own.directions[lane]) = (turned.max(change), direction);
                }
            }
        }
        turned
    }

    /// Largest slip of a sticking node (m).
    fn largest_slip(&self, own: &Steady, obstacle: &impl Obstacle) -> f64 {
        let lanes = self.lanes;
        let slip = |lane: usize| {
            let (point, node) = lanes.place(lane);
            length(tangential(self.slip(node, point, obstacle), self.normal(point, node)))
        };
        let sticking = (0..lanes.len()).filter(|lane| own.status[lanes.place(*lane).1] == ContactStatus::Sticks);
        sticking.map(slip).fold(0.0, f64::max)
    }

    /// Finds forces that keep closed nodes closed and sticking nodes in place, with friction on sliding nodes.
    fn solve_steady(&mut self, own: &mut Steady, compliance: &LaneCompliance, obstacle: &impl Obstacle) -> bool {
        let lanes = self.lanes;
        self.keep_normals();
        self.members.clear();
        let closed = (0..lanes.len()).filter(|lane| own.status[lanes.place(*lane).1] != ContactStatus::Open);
        self.members.extend(closed);
        let order = 3 * self.members.len();
        own.matrix[..order * order].fill(0.0);
        for (place, lane) in self.members.iter().enumerate() {
            let (point, node) = lanes.place(*lane);
            let (normal, friction) = (self.normal(point, node), obstacle.parameters(node).friction);
            let [first, second] = tangents(normal);
            let (moved, free) = (lanes.vector3(&self.moved, *lane), lanes.vector3(&self.free, *lane));
            let relative = self.slip(node, point, obstacle);
            let slides = own.status[node] != ContactStatus::Sticks;
            // Scales forces to displacements.
            let own_columns = compliance.of_lane(*lane);
            let scale = (0..3).map(|c| lanes.vector3(own_columns[c], *lane)[c]).sum::<f64>() / 3.0;
            for (axis, direction) in [normal, first, second].into_iter().enumerate() {
                let row = 3 * place + axis;
                if axis > 0 && slides {
                    let share = friction * direction.dot(&own.directions[*lane]);
                    for (c, entry) in (scale * (direction + share * normal)).iter().enumerate() {
                        own.matrix[(3 * place + c) * order + row] = *entry;
                    }
                    own.right[row] = 0.0;
                    continue;
                }
                for (column, other) in self.members.iter().enumerate() {
                    for (c, table) in compliance.of_lane(*other).into_iter().enumerate() {
                        own.matrix[(3 * column + c) * order + row] = direction.dot(&lanes.vector3(table, *lane));
                    }
                }
                let away = if axis == 0 { self.gaps[*lane] } else { direction.dot(&relative) };
                own.right[row] = direction.dot(&(moved - free)) - away;
            }
        }
        let mut regular = false;
        let (matrix, right) = (&mut own.matrix[..order * order], &mut own.right[..order]);
        self.instructions.run(Eliminate { order, matrix, right, regular: &mut regular });
        if !regular || right.iter().any(|force| !force.is_finite()) {
            return false;
        }
        let width = lanes.width();
        self.multipliers[..width].fill(0.0);
        self.forces[..3 * width].fill(0.0);
        self.taken.clear();
        self.amounts.clear();
        for (place, lane) in self.members.iter().enumerate() {
            let force = vector3_at(right, place);
            let (point, node) = lanes.place(*lane);
            lanes.set(&mut self.forces, *lane, force);
            self.multipliers[*lane] = force.dot(&self.normal(point, node));
            for (c, force) in force.iter().enumerate() {
                self.taken.push(3 * (lanes.nodes + *lane) + c);
                self.amounts.push(*force);
            }
        }
        self.combine(compliance.columns(), compliance.stride());
        true
    }

    /// Returns whether forces press and lie within the cone, and sliding has not reversed.
    fn holds(&mut self, own: &Steady, obstacle: &impl Obstacle) -> bool {
        let lanes = self.lanes;
        let largest = self.multipliers[..lanes.len()].iter().copied().fold(0.0, f64::max);
        self.members.iter().all(|lane| {
            let (point, node) = lanes.place(*lane);
            let (force, normal) = (lanes.vector3(&self.forces, *lane), self.normal(point, node));
            let multiplier = self.multipliers[*lane];
            let along = force - multiplier * normal;
            multiplier > 0.0
                && match own.status[node] {
                    ContactStatus::Open => true,
                    ContactStatus::Sticks => {
                        length(along) <= obstacle.parameters(node).friction * multiplier + ROUNDING * largest
                    }
                    ContactStatus::Slides(direction) => {
                        direction == Vector3::zeros() || direction.dot(&own.directions[*lane]) > 0.0
                    }
                }
        })
    }
}
