//! Smallest gaps between the points of a step, for nodes that are open at all points.
//!
//! The polynomial through the gaps at the points shows where a node may come closer in between. In a single sector, the motion of these nodes is
//! then followed: the step is divided into up to eight parts, all modes are evaluated at the ends of the parts, and cubics interpolate
//! displacements and velocities in between. The error of the cubics is a fraction of the tolerance, unless the number of parts is at its limit.
//! For nodes that are in contact at a point, only the gaps at the points are used.

use super::judgement::{FALLING, NEAR};
use super::{ForceInterpolation, Obstacle, Trial};
use crate::math::cubic::{evaluate, interior_minimum};
use crate::math::vector::Vector3;
use crate::time::galerkin::advance::Advance;
use crate::time::galerkin::basis::{POINTS, TimeBasis, real};
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::rows::ContactRows;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::{HALVINGS, Tables};

/// Largest number of halvings that divide a step into parts.
const MAX_PART_HALVINGS: usize = 3;
/// Largest number of parts of a step.
pub const MAX_PARTS: usize = 1 << MAX_PART_HALVINGS;
/// Error bound of the cubics, as a fraction of the tolerance, below which a step is not divided further.
const CUBIC_ERROR: f64 = 0.1;
/// Nodes are followed if they may come closer by more than this fraction of the tolerance.
const SHARE: f64 = 0.1;

/// Displacement of a node at the ends of parts of a step (m), and its change per part there.
type Path = [[Vector3; 2]; MAX_PARTS + 1];

/// Smallest gaps between the points.
#[derive(Debug, Clone)]
pub(super) struct Minima {
    /// Fraction of the step at which the polynomial through the gaps of a node is smallest; NaN if the node need not be followed.
    at: Vec<f64>,
    /// Paths of the nodes, and the number of parts in which they are known; 0 if no paths were followed.
    paths: Vec<Path>,
    parts: usize,
    /// Displacement of each node due to the residual flexibility (m), as coefficients of θᵃ.
    residual_displacements: Vec<[Vector3; POINTS]>,
    /// State within the step.
    state: SectorState,
}

impl Minima {
    /// Allocates data for `modes` modes and `nodes` contact nodes.
    pub(super) fn new(modes: usize, nodes: usize) -> Self {
        Self {
            at: vec![f64::NAN; nodes],
            paths: vec![[[Vector3::zeros(); 2]; MAX_PARTS + 1]; nodes],
            parts: 0,
            residual_displacements: vec![[Vector3::zeros(); POINTS]; nodes],
            state: SectorState::new(modes, 0),
        }
    }
}

impl Trial {
    /// Finds nodes that may come closer between the points of a step than at them, by more than a fraction of `tolerance` (m).
    /// Returns whether there are any. `is_needed` returns whether the smallest gap of a node is needed if it may be as
    /// small as a bound (m).
    ///
    /// Finds none if `is_resolved` is false: the polynomials of a step with a constant force, or of a step that misses the tolerance, do not
    /// describe the motion between its points.
    pub(crate) fn find_minima(
        &mut self,
        basis: &TimeBasis,
        is_resolved: bool,
        tolerance: f64,
        is_needed: impl Fn(usize, f64) -> bool,
    ) -> bool {
        self.minima.at.fill(f64::NAN);
        self.minima.parts = 0;
        let mut found = false;
        for node in (0..self.nodes()).filter(|_| is_resolved) {
            let open = |point: usize| self.multiplier(point, node) == 0.0 && self.gap(point, node).is_finite();
            if !(0..basis.count()).all(open) {
                continue;
            }
            let mut gaps = [0.0; POINTS];
            gaps[..basis.count()].iter_mut().enumerate().for_each(|(point, gap)| *gap = self.gap(point, node));
            let cubic = basis.coefficients(&gaps);
            let lower = if gaps[basis.degree] < gaps[0] { 1.0 } else { 0.0 };
            let slope = cubic[1] + lower * (2.0 * cubic[2] + lower * 3.0 * cubic[3]);
            let left = NEAR * gaps.iter().zip(&basis.left_out).map(|(gap, weight)| gap * weight).sum::<f64>().abs();
            let minimum = interior_minimum(&cubic);
            let lowest = gaps[..basis.count()].iter().copied().fold(f64::INFINITY, f64::min);
            let deeper = minimum.map_or(0.0, |theta| lowest - evaluate(&cubic, theta));
            let falls = minimum.is_none() && slope.abs() > left * FALLING;
            let may_matter = !falls && deeper + left > SHARE * tolerance;
            if may_matter && is_needed(node, lowest - deeper - left) {
                self.minima.at[node] = minimum.unwrap_or(lower);
                found = true;
            }
        }
        found
    }

    /// Drops the selected nodes whose surface has jumped by more than `tolerance` (m) at the start of the step, as far as gaps there are
    /// known. Displacements at the start must be known.
    pub(crate) fn drop_jumps(&mut self, obstacle: &impl Obstacle, tolerance: f64) {
        for node in 0..self.nodes() {
            if self.minimum(node).is_none() {
                continue;
            }
            let gap = obstacle.gap_within(node, 0.0, self.displacement(0, node));
            if gap.is_some_and(|gap| self.jump(node, gap) > tolerance) {
                self.minima.at[node] = f64::NAN;
            }
        }
    }

    /// Computes the paths of the selected nodes over a step. `state` is the state at its start, and `level` the number of halvings of the span.
    /// Divides the step into the smallest number of parts for which the error bound of the cubics is at most `CUBIC_ERROR` times `tolerance`
    /// (m), or into the largest number.
    pub fn follow(
        &mut self,
        tables: &Tables,
        step_tables: &StepTables,
        (level, tolerance): (usize, f64),
        state: &SectorState,
        advance: &mut Advance,
    ) {
        let (rows, basis) = (&tables.rows, &step_tables.basis);
        self.find_start(rows, state);
        let polynomial = |node: usize| self.polynomial(basis, ForceInterpolation::Polynomial, node);
        let error = advance.prepare_parts(rows, state, step_tables.step, polynomial);
        let max_halvings = MAX_PART_HALVINGS.min(HALVINGS - level);
        let is_accurate = |halvings: &usize| error <= CUBIC_ERROR * tolerance * real(1 << (4 * halvings));
        let halvings = (0..max_halvings).find(is_accurate).unwrap_or(max_halvings);
        let (parts, table) = (1_usize << halvings, &tables.levels[level + halvings]);
        let mut minima = std::mem::replace(&mut self.minima, Minima::new(0, 0));
        minima.state.position.copy_from_slice(&state.position);
        minima.state.velocity.copy_from_slice(&state.velocity);
        minima.parts = parts;
        for node in (0..self.nodes()).filter(|node| !minima.at[*node].is_nan()) {
            minima.residual_displacements[node] = self.residual_displacement(basis, rows, node);
        }
        for part in 0..=parts {
            let theta = real(part) / real(parts);
            for node in (0..self.nodes()).filter(|node| !minima.at[*node].is_nan()) {
                let now = [&minima.state.position, &minima.state.velocity].map(|modes| rows.at_node(node, modes));
                let [moved, velocity] = now;
                let [a, b, c, d] = &minima.residual_displacements[node];
                let position = a + theta * (b + theta * (c + theta * d));
                let slope = b + theta * (2.0 * c + 3.0 * theta * d);
                minima.paths[node][part] = [moved + position, table.step * velocity + slope / real(parts)];
            }
            if part < parts {
                advance.advance_part(table, &mut minima.state, part, parts);
            }
        }
        self.minima = minima;
    }

    /// Returns the displacement of a node due to the residual flexibility (m), as coefficients of θᵃ.
    fn residual_displacement(&self, basis: &TimeBasis, rows: &ContactRows, node: usize) -> [Vector3; POINTS] {
        let mut at_points = [Vector3::zeros(); POINTS];
        for other in 0..self.nodes() {
            for (point, moved) in at_points[..basis.count()].iter_mut().enumerate() {
                if self.multiplier(point, other) > 0.0 {
                    let force = self.force(point, other);
                    for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                        moved[row] += rows.residual()[(3 * node + row, 3 * other + column)] * force[column];
                    }
                }
            }
        }
        let mut coefficients = [Vector3::zeros(); POINTS];
        for component in 0..3 {
            let polynomial = basis.coefficients(&at_points.map(|moved| moved[component]));
            coefficients.iter_mut().zip(polynomial).for_each(|(target, value)| target[component] = value);
        }
        coefficients
    }

    /// Returns the fraction of the step at which a node may come closer than at the points, if any.
    pub fn minimum(&self, node: usize) -> Option<f64> {
        let theta = self.minima.at[node];
        (!theta.is_nan()).then_some(theta)
    }

    /// Number of parts in which the motion of nodes is known; 1 if it is the polynomial of the step.
    pub fn parts(&self) -> usize {
        self.minima.parts.max(1)
    }

    /// Gap of a node within the step (m), from the polynomial through the gaps at the points.
    pub(crate) fn gap_within(&self, basis: &TimeBasis, node: usize, theta: f64) -> f64 {
        let weights = basis.weights_at(theta);
        (0..basis.count()).map(|point| weights[point] * self.gap(point, node)).sum()
    }

    /// Displacement of a node within the step (m): followed exactly, or from the polynomial through the displacements at the points.
    pub(crate) fn displacement_within(&self, basis: &TimeBasis, node: usize, theta: f64) -> Vector3 {
        let parts = self.minima.parts;
        if parts == 0 {
            let weights = basis.weights_at(theta);
            return (0..basis.count()).map(|point| weights[point] * self.displacement(point, node)).sum();
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ θ ≤ 1")]
        let part = ((theta * real(parts)) as usize).min(parts - 1);
        let t = theta * real(parts) - real(part);
        let path = &self.minima.paths[node];
        let ([from, start], [to, end]) = (path[part], path[part + 1]);
        let rise = to - from;
        let (bend, twist) = (3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise);
        from + t * (start + t * (bend + t * twist))
    }

    /// Largest λ of a node within the step (N), from the polynomial through the values at the points.
    pub fn peak(&self, basis: &TimeBasis, kind: ForceInterpolation, node: usize) -> f64 {
        let at_points = (0..=self.points()).fold(0.0_f64, |peak, point| peak.max(self.multiplier(point, node)));
        if kind == ForceInterpolation::Constant {
            return at_points;
        }
        let mut falling = [0.0; POINTS];
        let values = falling[..basis.count()].iter_mut().enumerate();
        values.for_each(|(point, value)| *value = -self.multiplier(point, node));
        let falling = basis.coefficients(&falling);
        interior_minimum(&falling).map_or(at_points, |theta| at_points.max(-evaluate(&falling, theta)))
    }
}
