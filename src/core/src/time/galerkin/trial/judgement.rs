//! Judges a solved step: its error, the energy of contacts that open or close, and nodes that came near between the points.

use super::{ForceInterpolation, Obstacle, Trial};
use crate::math::vector::{Vector3, vector3_at};
use crate::time::galerkin::basis::{POINTS, TimeBasis};
use crate::time::galerkin::kernels::AddProduct;
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::rows::{ContactRows, Sums};
use crate::time::galerkin::state::SectorState;

/// Weight of the largest change of slope of a force in the error of a step, because the highest divided difference misses a
/// contact that opens or closes. Measured on 148 random rubs at tolerances from 1e-2 to 1e-5 (`lab scatter`): with 0.05, 0.1 and
/// 0.2, 5 % of the errors exceed 1.9, 1.9 and 1.8 times the tolerance, with 1, 2 and 6 % more trials than without this term.
pub(crate) const KINK: f64 = 0.2;
/// Weight of the change of slope of forces that are linear in time, if contacts may stick. Measured on a block that swings under
/// friction (`core/tests/belt.rs`): 14 stops cause an error of up to 2.5 times the tolerance. On a rub in which all contacts
/// slide (`core/tests/galerkin/sticking.rs`): 0.2 to 0.8 times.
const BEND: f64 = 0.5;
/// Weight of the error of a contact that opens or closes, and of all contacts that slide fast, where contacts may stick: this
/// error determines when the next contact sticks and slips. `core/tests/galerkin/sticking.rs` measures the errors of slow bouncing
/// blades with this weight. Blades that hardly ever stick have the weight 1.
const OPENING: f64 = 30.0;
/// A step is shortened if the gap of a node between the points may be below this multiple of the interpolation error.
pub(crate) const NEAR: f64 = 4.0;
/// Ratio of slope to interpolation error above which a gap with a monotonic polynomial is smallest at an end of the
/// step. The slope is that over the whole step, and the error is its bound. Modes that the points do not resolve need a
/// large ratio.
pub(crate) const FALLING: f64 = 16.0;
/// Free motion of the contact rows over a step of degree 1.
#[derive(Debug, Clone)]
pub(super) struct FreeMotion {
    /// Velocities at the end (m/s).
    pub(super) end_velocities: Sums<1>,
    /// Summed amplitudes of the modes that the step does not resolve (m).
    unresolved_amplitudes: Sums<1>,
    /// True if the velocities and the amplitudes belong to the tried step.
    pub(super) is_known: bool,
}

impl FreeMotion {
    /// Allocates data for `modes` modes and `nodes` contact nodes.
    pub(super) fn new(modes: usize, nodes: usize) -> Self {
        let sums = || Sums::new(modes, nodes);
        Self { end_velocities: sums(), unresolved_amplitudes: sums(), is_known: false }
    }
}

/// Result of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrialResult {
    /// True if the contact problem has been solved.
    pub solved: bool,
    /// Estimated displacement error of the step (m).
    pub error: f64,
    /// True if a contact opens or closes.
    pub switches: bool,
    /// Energy added by switching contacts (J): Σ λ_i S_ik g_k of their nodes plus the energy supplied by friction.
    pub switched: f64,
    /// True if an open node may have entered a surface between the points by more than the allowed depth.
    pub near: bool,
    /// Depth of open nodes within a surface between the points (m), from the polynomial through their gaps.
    pub depth: f64,
    /// Number of factorised linear systems.
    pub factorisations: usize,
}

impl TrialResult {
    /// Returns whether the error or the depth of the step exceeds the tolerance (m).
    pub fn misses(&self, tolerance: f64) -> bool {
        self.error > tolerance || self.depth > tolerance
    }

    /// Returns whether the polynomials of the step describe the motion between its points: its force is a polynomial and its
    /// error is within the tolerance (m).
    pub(crate) fn resolves_motion(&self, kind: ForceInterpolation, tolerance: f64) -> bool {
        kind == ForceInterpolation::Polynomial && !self.misses(tolerance)
    }
}

impl Trial {
    /// Finds the free motion within a step of degree 1: two points give a straight line, which cannot represent it.
    pub(crate) fn find_free_motion(&mut self, level: &StepTables, rows: &ContactRows, state: &SectorState) {
        if level.basis.degree == 1 {
            self.find_start(rows, state);
            let FreeMotion { end_velocities, unresolved_amplitudes, is_known } = &mut self.free_motion;
            rows.end_velocities(level, state, end_velocities);
            rows.unresolved_amplitudes(level.step, state, unresolved_amplitudes);
            *is_known = true;
        }
    }

    /// Finds error, switches and near misses of a solved step. Open nodes may enter a surface between the points by `allowed_depth` (m).
    pub fn judge(
        &mut self,
        level: &StepTables,
        rows: &ContactRows,
        obstacle: &impl Obstacle,
        allowed_depth: f64,
        verdict: &mut TrialResult,
    ) {
        let (basis, count) = (&level.basis, level.basis.count());
        self.impulses.fill(0.0);
        (verdict.switches, verdict.switched, verdict.near, verdict.error) = (false, 0.0, false, 0.0);
        self.depths.fill(0.0);
        let (mut pushed, may_stick) = (false, self.may_stick());
        let may_stick_later = self.slides_fast && self.may_stick_later(level, rows, obstacle);
        let weight = if may_stick_later { OPENING } else { 1.0 };
        for node in 0..self.nodes() {
            let pushes = |point: usize| self.multiplier(point, node) > 0.0;
            let (any, all) = ((0..count).any(pushes), (0..count).all(pushes));
            if !any {
                let (near, depth) = self.comes_near(level, node, obstacle, allowed_depth);
                verdict.near |= near;
                self.depths[node] = depth;
                continue;
            }
            pushed = true;
            // A contact that passes over a free edge needs short steps.
            verdict.near |= (0..count).any(|point| self.gap(point, node) == f64::INFINITY);
            let mut forces = [Vector3::zeros(); POINTS];
            forces[..count].iter_mut().enumerate().for_each(|(point, force)| *force = self.force(point, node));
            for component in 0..3 {
                let force = |point: usize| forces[point][component];
                let left = (0..count).map(|point| basis.left_out[point] * force(point)).sum::<f64>() * level.step;
                self.impulses[3 * node + component] = if may_stick && basis.degree > 1 {
                    left / level.share
                } else if may_stick {
                    // Errors of closed contacts accumulate over all steps of a span.
                    let bend = if all { BEND / level.share } else { OPENING };
                    bend * level.step * self.bend(node, component)
                } else if all {
                    weight * left
                } else {
                    weight * left.abs().max(KINK * level.step * kink(basis, force))
                };
            }
            if !all {
                verdict.switches = true;
                let terms = (0..count).flat_map(|i| (0..count).map(move |k| (i, k)));
                let left =
                    |(i, k): (usize, usize)| self.multiplier(i, node) * basis.work[i][k] * self.finite_gap(k, node);
                verdict.switched += terms.map(left).sum::<f64>();
            }
        }
        let mut turn = 0.0;
        if may_stick {
            if basis.degree == 1 {
                turn = self.find_turn(rows.residual(), level.step, obstacle);
            }
            let gained = self.find_gain(obstacle);
            verdict.switches |= gained > 0.0;
            verdict.switched += gained;
        }
        if pushed {
            self.left.fill(0.0);
            self.instructions.run(AddProduct { matrix: rows.error_form(), x: &self.impulses, y: &mut self.left });
            let square: f64 = self.left.iter().zip(&self.impulses).map(|(a, b)| a * b).sum();
            verdict.error = square.max(0.0).sqrt().max(turn);
        }
    }

    /// Change of slope of a linear force relative to the previous step; sticking and sliding turn the force without opening the contact.
    fn bend(&self, node: usize, component: usize) -> f64 {
        let row = 3 * node + component;
        let slope = self.force(1, node)[component] - self.start_contacts.forces[row];
        let followed =
            if self.multiplier(0, node) > 0.0 { self.start_contacts.slopes[row] / self.per_step } else { 0.0 };
        let before = slope - followed;
        if self.multiplier(1, node) == 0.0 && slope.abs() > before.abs() { slope } else { before }
    }

    /// Returns whether open nodes are within a surface between the points, as far as their gaps at the points show.
    pub(crate) fn has_depth(&self) -> bool {
        self.depths.iter().any(|depth| *depth > 0.0)
    }

    /// Returns the largest depth of open nodes between the points (m). It excludes nodes whose surface has jumped at the start of
    /// the step, because the polynomial through their gaps overshoots. Displacements at the start must be known, and surfaces must be
    /// bent as at the start.
    pub(crate) fn depth(&self, obstacle: &mut impl Obstacle) -> f64 {
        let open = (0..self.nodes()).filter(|node| self.depths[*node] > 0.0);
        // The overshoot below the gaps at the points is less than 0.15 times the jump.
        let mut jump = |node| self.jump(node, obstacle.gap_at_start(node, vector3_at(&self.start, node)));
        open.filter(|node| jump(*node) < self.depths[*node]).map(|node| self.depths[node]).fold(0.0, f64::max)
    }

    /// Returns the jump of the surface of a node at the start of the step (m), because of a held input: `gap` is the gap there (m).
    pub(super) fn jump(&self, node: usize, gap: f64) -> f64 {
        (gap - self.start_contacts.gaps[node]).abs()
    }

    /// Returns whether an open node may enter a surface between the points by more than `allowed_depth` (m), and its depth there (m).
    fn comes_near(&self, level: &StepTables, node: usize, obstacle: &impl Obstacle, allowed_depth: f64) -> (bool, f64) {
        let basis = &level.basis;
        let mut gaps = [0.0; POINTS];
        let gaps = &mut gaps[..basis.count()];
        gaps.iter_mut().enumerate().for_each(|(point, gap)| *gap = self.gap(point, node));
        if !gaps[0].is_finite() || !gaps[1].is_finite() {
            return (false, 0.0);
        }
        if basis.degree == 1 {
            let (lowest, bend) = self.bend_of_gap(level.step, node, [gaps[0], gaps[1]], obstacle);
            // A parabola with this deviation falls below its ends and its middle by at most a quarter of it.
            return (lowest + allowed_depth < 0.25 * NEAR * bend, (-lowest).max(0.0));
        }
        // Between its points, a cubic exceeds their range by less than half of it, and its interpolation error is less than the range.
        let extremes = |(low, high): (f64, f64), gap: &f64| (gap.min(low), gap.max(high));
        let (low, high) = gaps.iter().fold((f64::INFINITY, f64::NEG_INFINITY), extremes);
        if low > (0.5 + NEAR) * (high - low) {
            return (false, 0.0);
        }
        let sum = |weights: &[f64; POINTS]| gaps.iter().zip(weights).map(|(gap, weight)| gap * weight).sum::<f64>();
        let left = NEAR * sum(&basis.left_out).abs();
        let lowest = basis.between.iter().map(sum).fold(f64::INFINITY, f64::min);
        (lowest + allowed_depth < left, (-lowest).max(0.0))
    }

    /// Estimates the smallest gap of a node at the ends and in the middle of the step (m), and by how much the gap in the middle can deviate from
    /// the straight line between the ends (m). The deviation adds three magnitudes, which may not cancel because they are estimates: the node's
    /// path, a cubic with the velocities at both ends; the motion of the surface; and the amplitudes of modes that the step does not resolve.
    ///
    /// The velocity at the end is that of free motion. If it is unknown, the path is a parabola. Surfaces that are known only at
    /// the points count as being at rest.
    fn bend_of_gap(&self, step: f64, node: usize, ends: [f64; 2], obstacle: &impl Obstacle) -> (f64, f64) {
        let (from, to, normal) = (self.displacement(0, node), self.displacement(1, node), self.normal(1, node));
        let velocity = vector3_at(&self.velocities, node);
        let FreeMotion { end_velocities, unresolved_amplitudes, is_known } = &self.free_motion;
        let (end, amplitude) = if *is_known {
            (end_velocities.vector3(0, node, self.nodes()), unresolved_amplitudes.vector3(0, node, self.nodes()))
        } else {
            (2.0 * (to - from) / step - velocity, Vector3::zeros())
        };
        let bent = 0.125 * step * normal.dot(&(velocity - end));
        let amplitude = normal.abs().dot(&amplitude);
        let line = 0.5 * (ends[0] + ends[1]);
        let middle = obstacle.gap_within(node, 0.5, 0.5 * (from + to)).unwrap_or(line);
        (ends[0].min(ends[1]).min(middle + bent), bent.abs() + (middle - line).abs() + amplitude)
    }
}

/// Largest change of slope of values at the points over the step. Values that begin or end with 0 count as resting there before
/// or after, so that a contact that opens or closes is detected even if its values at the points lie on a straight line.
fn kink(basis: &TimeBasis, value: impl Fn(usize) -> f64) -> f64 {
    let last = basis.degree;
    let slope = |i: usize| (value(i + 1) - value(i)) / (basis.points[i + 1] - basis.points[i]);
    let resting = |point: usize, there: usize| if value(point) == 0.0 { 0.0 } else { slope(there) };
    let (mut before, mut most) = (resting(0, 0), 0.0_f64);
    for after in (0..last).map(slope).chain(std::iter::once_with(|| resting(last, last - 1))) {
        most = most.max((after - before).abs());
        before = after;
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opening_or_closing_contact_is_detected_as_a_kink() {
        for degree in 1..=3 {
            let basis = TimeBasis::new(degree);
            let of = |value: &dyn Fn(f64) -> f64| kink(&basis, |point| value(basis.points[point]));
            // Straight lines from the start and to the end, and a kink within the step.
            assert!((of(&|theta| theta) - 1.0).abs() < 1e-12 && (of(&|theta| 1.0 - theta) - 1.0).abs() < 1e-12);
            assert!(of(&|theta| (theta - 0.5).max(0.0)) > 0.49 && of(&|theta| (0.5 - theta).max(0.0)) > 0.49);
            assert!(of(&|theta| 2.0 + theta) < 1e-12);
        }
    }
}
