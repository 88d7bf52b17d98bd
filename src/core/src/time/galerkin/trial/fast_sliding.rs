//! Steps of a higher degree in which contacts that could stick slide fast. They may open and close within the step.
//!
//! If the vibration velocity of nodes is at most half of their prescribed sliding velocity, no contact sticks, and the contact problem
//! has one unknown per lane, as without sticking. Friction opposes the slip under the solution, whose direction is found by
//! iteration.

use super::steady::Steady;
use super::{ForceInterpolation, Obstacle, Trial, TrialResult};
use crate::math::vector::{Vector3, direction, length, tangential};
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::rows::ContactRows;
use crate::time::galerkin::state::SectorState;
use std::mem::{swap, take};

/// Largest number of evaluations of gaps and slips.
const PASSES: usize = 16;
/// Number of evaluations that find the direction of friction at each point. In very short steps, the flexibility of the nodes
/// affects these directions so much that they do not converge; further evaluations find one direction for the whole step.
const POINTWISE_PASSES: usize = 4;
/// Number of evaluations after which directions change by half of the change that they require.
const FULL_PASSES: usize = 8;
/// Largest vibration velocity at which contacts slide fast, as a fraction of the sliding velocity by prescribed motion.
const LARGEST_VIBRATION: f64 = 0.5;
/// Smallest ratios of the displacement that sticking requires in the two lowest modes to the largest displacement of a run, for
/// blades that hardly ever stick. The second mode excludes blades that are soft in one mode only, such as pinned blades.
/// `core/tests/galerkin/sticking.rs` tests three rubs with larger ratios.
const MIN_STICKING_AMPLITUDES: [f64; 2] = [2.0, 0.5];

/// Largest displacement that the last change of the directions of friction may cause, as a multiple of the accuracy of gaps.
///
/// Larger multiples save evaluations, but with 30 the errors of a blade at 60 rad/s reach the tolerance
/// (`core/tests/galerkin/sticking.rs`).
const DIRECTION_PRECISION_FACTOR: f64 = 10.0;
/// Value of [`DIRECTION_PRECISION_FACTOR`] for blades that hardly ever stick: changes of the directions may move nodes by a hundredth of
/// the tolerance.
const LOOSE_DIRECTION_PRECISION_FACTOR: f64 = 100.0;

impl Trial {
    /// Tries a step in which all contacts slide fast. It counts as unsolved if one may stick.
    pub(crate) fn run_fast_sliding(
        &mut self,
        level: &StepTables,
        rows: &ContactRows,
        state: &SectorState,
        obstacle: &mut impl Obstacle,
        precision: f64,
    ) -> TrialResult {
        let mut result = TrialResult::default();
        let Some(mut own) = self.steady.take() else { return result };
        self.begin(level, ForceInterpolation::Polynomial, Some(rows), state);
        self.find_start(rows, state);
        self.find_start_gaps(state, |node, moved| obstacle.gap_at_start(node, moved));
        self.end_slopes = level.basis.slopes_at(1.0).map(|slope| slope / level.step);
        self.slides_fast = true;
        swap(&mut self.law, &mut own.sliding_law);
        result.solved = self.solve_fast_sliding(&mut own, level, rows, obstacle, precision, &mut result);
        swap(&mut self.law, &mut own.sliding_law);
        self.steady = Some(own);
        if result.solved {
            self.judge(level, rows, obstacle, 0.0, &mut result);
            if self.has_depth() {
                result.depth = self.depth(obstacle);
            }
        }
        result
    }

    fn solve_fast_sliding(
        &mut self,
        own: &mut Steady,
        level: &StepTables,
        rows: &ContactRows,
        obstacle: &mut impl Obstacle,
        precision: f64,
        result: &mut TrialResult,
    ) -> bool {
        // `choose` finds the unknown directions of nodes that begin to touch.
        own.directions.fill(Vector3::zeros());
        for pass in 0..PASSES {
            let (lowest, largest) = self.find_gaps(obstacle);
            if lowest.is_nan() {
                return false;
            }
            if self.rests() && lowest >= 0.0 {
                return true;
            }
            let Some(moved) = self.find_fast_directions(&mut own.directions, level, pass, obstacle) else {
                return false;
            };
            let is_within = |factor: f64| moved <= factor * precision;
            let have_directions_converged = is_within(DIRECTION_PRECISION_FACTOR)
                || is_within(LOOSE_DIRECTION_PRECISION_FACTOR) && !self.may_stick_later(level, rows, obstacle);
            if pass > 0 && lowest >= -precision && largest <= precision && have_directions_converged {
                return true;
            }
            self.slip_directions = take(&mut own.directions);
            let solved = self.solve(&level.compliance, rows.residual(), obstacle, result);
            own.directions = take(&mut self.slip_directions);
            if !solved {
                return false;
            }
        }
        false
    }

    /// Finds the directions of the slip of touching nodes at all points. Returns the largest displacement that their changes may
    /// cause (m), or `None` if a touching node may stick.
    fn find_fast_directions(
        &self,
        directions: &mut [Vector3],
        level: &StepTables,
        pass: usize,
        obstacle: &impl Obstacle,
    ) -> Option<f64> {
        let (lanes, basis, last) = (self.lanes, &level.basis, level.basis.degree);
        let relaxation = if pass < FULL_PASSES { 1.0 } else { 0.5 };
        let mut largest = 0.0_f64;
        for node in 0..lanes.nodes {
            let friction = obstacle.parameters(node).friction;
            if friction == 0.0 {
                continue;
            }
            let touches = (0..=last).any(|point| self.multiplier(point, node) > 0.0)
                || (1..=last).any(|point| self.gap(point, node) < 0.0);
            if !touches {
                continue;
            }
            let mut places = [Vector3::zeros(); POINTS];
            (1..=last).for_each(|point| places[point] = self.slip(node, point, obstacle));
            let normal = self.normal(last, node);
            let drift = tangential(obstacle.drift(node, last, self.displacement(last, node)), normal);
            for point in 0..=last {
                let slip: Vector3 = (0..=last).map(|k| basis.work[point][k] * places[k]).sum();
                let vibration = tangential(slip, normal) - basis.weights[point] * drift;
                if length(vibration) > LARGEST_VIBRATION * basis.weights[point] * length(drift) {
                    return None;
                }
                if point == 0 {
                    continue;
                }
                let lane = lanes.at(point, node);
                let slip = if pass < POINTWISE_PASSES { slip } else { places[last] };
                let before = directions[lane];
                let along = direction(tangential(slip, self.normal(point, node)));
                let along = if relaxation < 1.0 { before + relaxation * (along - before) } else { along };
                directions[lane] = direction(along);
                let flexibility = level.compliance.of_lane(lane);
                let flexibility = (0..3).map(|c| lanes.vector3(flexibility[c], lane)[c]).fold(0.0, f64::max);
                let turned = length(directions[lane] - before) / relaxation;
                largest = largest.max(friction * self.multiplier(point, node) * turned * flexibility);
            }
        }
        Some(largest)
    }

    /// Returns whether a touching node could stick later. A node that sticks moves with the surface at a velocity v, for which a mode
    /// of angular frequency ω needs the amplitude v/ω. Blades hardly ever stick if this amplitude, for the two lowest frequencies, is at
    /// least [`MIN_STICKING_AMPLITUDES`] times the displacement at which a run ends.
    pub(super) fn may_stick_later(&self, level: &StepTables, rows: &ContactRows, obstacle: &impl Obstacle) -> bool {
        let last = level.basis.degree;
        let touches = |node: &usize| (0..=last).any(|point| self.multiplier(point, *node) > 0.0);
        (0..self.lanes.nodes).filter(touches).any(|node| {
            let drift = tangential(obstacle.drift(node, last, self.displacement(last, node)), self.normal(last, node));
            let (drift, largest) = (length(drift), level.step * obstacle.largest_displacement(node));
            let mut modes = rows.lowest_frequencies(node).into_iter().zip(MIN_STICKING_AMPLITUDES);
            // A rigid-body mode can follow the surface at any velocity.
            modes.any(|(frequency, ratio)| frequency == 0.0 || drift < frequency * ratio * largest)
        })
    }

    /// Returns the unit vector of the slip over which friction on a node at a point does work, at the current displacements. Zero if the
    /// node does not slip.
    pub(super) fn find_slip_direction(&self, node: usize, point: usize, obstacle: &impl Obstacle) -> Vector3 {
        let weights = self.work_weights[point];
        let slip: Vector3 = (1..=self.lanes.points).map(|k| weights[k] * self.slip(node, k, obstacle)).sum();
        direction(tangential(slip, self.normal(point, node)))
    }
}
