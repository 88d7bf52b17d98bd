//! Steps of a higher degree in which contacts that could stick slide fast. They may open and close within the step.
//!
//! Where the slip along a surface hardly changes its velocity during the step, no contact sticks, and friction opposes a
//! known direction. The contact problem then has one unknown per lane, as without sticking. The directions are those of
//! the slip under the solution, found by iteration.

use super::steady::Steady;
use super::{ForceInterpolation, Obstacle, Trial, TrialResult};
use crate::math::vector::{Vector3, length, tangential};
use crate::time::galerkin::basis::{POINTS, TimeBasis};
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::rows::ContactRows;
use crate::time::galerkin::state::SectorState;
use std::mem::{swap, take};

/// Largest number of evaluations of gaps and slips.
const PASSES: usize = 8;
/// Accuracy of the directions of friction. They cause an error of the forces of µ times this fraction.
const TURNED: f64 = 1e-6;
/// Smallest component of the slip velocity along the mean slip, at any point and as a fraction of the mean slip velocity.
const SLOWEST: f64 = 0.5;

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
            self.judge(level, rows, obstacle, &mut result);
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
        for pass in 0..PASSES {
            let (lowest, largest) = self.find_gaps(obstacle);
            if lowest.is_nan() {
                return false;
            }
            if self.rests() && lowest >= 0.0 {
                return true;
            }
            let Some(turned) = self.find_fast_directions(&mut own.directions, &level.basis, obstacle) else {
                return false;
            };
            if pass > 0 && lowest >= -precision && largest <= precision && turned <= TURNED {
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

    /// Finds the directions of the slip of all nodes at all points, and returns by how much those of touching nodes have turned.
    /// Returns `None` if a touching node may stick.
    fn find_fast_directions(
        &self,
        directions: &mut [Vector3],
        basis: &TimeBasis,
        obstacle: &impl Obstacle,
    ) -> Option<f64> {
        let (lanes, last) = (self.lanes, basis.degree);
        let mut turned = 0.0_f64;
        for node in (0..lanes.nodes).filter(|node| obstacle.parameters(*node).friction > 0.0) {
            let touches = (0..=last).any(|point| self.multiplier(point, node) > 0.0)
                || (1..=last).any(|point| self.gap(point, node) < 0.0);
            let mut places = [Vector3::zeros(); POINTS];
            (1..=last).for_each(|point| places[point] = self.slip(node, point, obstacle));
            let mean = tangential(places[last], self.normal(last, node));
            for point in 0..=last {
                let slip: Vector3 = (0..=last).map(|k| basis.work[point][k] * places[k]).sum();
                if touches && slip.dot(&mean) <= SLOWEST * basis.weights[point] * mean.norm_squared() {
                    return None;
                }
                if point == 0 {
                    continue;
                }
                let along = tangential(slip, self.normal(point, node));
                let (size, lane) = (length(along), lanes.at(point, node));
                let direction = if size > 0.0 { along / size } else { Vector3::zeros() };
                if touches {
                    turned = turned.max((direction - directions[lane]).amax());
                }
                directions[lane] = direction;
            }
        }
        Some(turned)
    }
}
