//! Smallest gaps between the points of a step, for nodes that stay open.
//!
//! The polynomial through the gaps at the points shows where a node may come closer between them. There, its motion is followed
//! exactly: all modes at the ends of eighths of the step, and cubics through their displacements and velocities in between. If a
//! contact is closed at a point, only the gaps at the points are used.

use super::judgement::{FALLING, NEAR};
use super::{ForceInterpolation, Obstacle, Trial};
use crate::math::cubic::{evaluate, interior_minimum};
use crate::math::vector::Vector3;
use crate::time::galerkin::advance::Advance;
use crate::time::galerkin::basis::{MOST, POINTS, TimeBasis, real};
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::rows::ContactRows;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::{HALVINGS, Tables};

/// Number of halvings of a step at whose ends the motion is followed.
const FINER: usize = 3;
/// Number of these parts.
pub const PARTS: usize = 1 << FINER;
/// Nodes are followed if they may come closer by more than this fraction of the tolerance.
const SHARE: f64 = 0.1;

/// Displacement of a node at the ends of parts of a step (m), and its change per part there.
type Path = [[Vector3; 2]; PARTS + 1];

/// Smallest gaps between the points.
#[derive(Debug, Clone)]
pub(super) struct Minima {
    /// Fraction of the step at which the polynomial through the gaps of a node is smallest; NaN if the node need not be followed.
    at: Vec<f64>,
    /// Paths of the nodes, and the number of parts in which they are known; 0 if no paths were followed.
    paths: Vec<Path>,
    parts: usize,
    /// State within the step.
    state: SectorState,
}

impl Minima {
    /// Allocates data for `modes` modes and `nodes` contact nodes.
    pub(super) fn new(modes: usize, nodes: usize) -> Self {
        Self {
            at: vec![f64::NAN; nodes],
            paths: vec![[[Vector3::zeros(); 2]; PARTS + 1]; nodes],
            parts: 0,
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

    /// Follows the selected nodes over a step of a level, before its state is advanced.
    pub fn follow(
        &mut self,
        tables: &Tables,
        of: &StepTables,
        level: usize,
        state: &SectorState,
        advance: &mut Advance,
    ) {
        let finer = FINER.min(HALVINGS - level);
        let (parts, rows) = (1_usize << finer, &tables.rows);
        let (table, basis) = (&tables.levels[level + finer], &of.basis);
        self.find_start(rows, state);
        let mut minima = std::mem::replace(&mut self.minima, Minima::new(0, 0));
        minima.state.position.copy_from_slice(&state.position);
        minima.state.velocity.copy_from_slice(&state.velocity);
        minima.parts = parts;
        for part in 0..=parts {
            for node in (0..self.nodes()).filter(|node| !minima.at[*node].is_nan()) {
                let now = [&minima.state.position, &minima.state.velocity].map(|modes| rows.at_node(node, modes));
                let bent = self.bent(basis, rows, node, real(part) / real(parts));
                let [moved, velocity] = now;
                minima.paths[node][part] = [moved + bent[0], table.step * velocity + bent[1] / real(parts)];
            }
            if part < parts {
                let forces = |node: usize| {
                    Some(within(&self.polynomial(basis, ForceInterpolation::Polynomial, node)?, part, parts))
                };
                advance.under(table, rows, &mut minima.state, forces);
            }
        }
        self.minima = minima;
    }

    /// Returns the displacement of a node within the step by the residual flexibility (m), and its derivative with respect to the
    /// fraction of the step.
    fn bent(&self, basis: &TimeBasis, rows: &ContactRows, node: usize, theta: f64) -> [Vector3; 2] {
        let mut sums = [Vector3::zeros(); 2];
        for other in 0..self.nodes() {
            let pushes = |point: usize| self.multiplier(point, other) > 0.0;
            if !(0..basis.count()).any(pushes) {
                continue;
            }
            let (weights, slopes) = (basis.weights_at(theta), basis.slopes_at(theta));
            for point in (0..basis.count()).filter(|point| pushes(*point)) {
                let force = self.force(point, other);
                for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                    let moved = rows.residual()[(3 * node + row, 3 * other + column)] * force[column];
                    sums[0][row] += weights[point] * moved;
                    sums[1][row] += slopes[point] * moved;
                }
            }
        }
        sums
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

/// Coefficients of a polynomial of degree 2 over one of several equal parts.
fn within(coefficients: &[Vector3; MOST], part: usize, parts: usize) -> [Vector3; MOST] {
    let (from, length) = (real(part) / real(parts), 1.0 / real(parts));
    let [a, b, c] = *coefficients;
    [a + from * (b + from * c), length * (b + 2.0 * from * c), length * length * c]
}
