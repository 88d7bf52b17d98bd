//! Smallest gaps between the points of a step, for nodes that are open at all points, from the polynomials through the gaps.

use super::judgement::{FALLING, NEAR};
use super::{ForceInterpolation, Obstacle, Trial};
use crate::math::cubic::{evaluate, interior_minimum};
use crate::math::vector::{Vector3, vector3_at};
use crate::time::galerkin::basis::{POINTS, TimeBasis};
use crate::time::galerkin::parts::FOLLOW_FRACTION;

impl Trial {
    /// Finds nodes that may come closer between the points of a step than at them, by more than a fraction of `tolerance` (m).
    /// Returns whether there are any. `needed_below` returns the gap below which the smallest gap of a node is needed (m).
    ///
    /// Finds none if `is_resolved` is false: the polynomials of a step with a constant force, or of a step that misses the tolerance, do not
    /// describe the motion between its points.
    pub(crate) fn find_minima(
        &mut self,
        basis: &TimeBasis,
        is_resolved: bool,
        tolerance: f64,
        needed_below: impl Fn(usize) -> f64,
    ) -> bool {
        self.minima.fill(f64::NAN);
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
            let may_matter = !falls && deeper + left > FOLLOW_FRACTION * tolerance;
            if may_matter && lowest - deeper - left < needed_below(node) {
                self.minima[node] = minimum.unwrap_or(lower);
                found = true;
            }
        }
        found
    }

    /// Drops the minima of nodes whose surface has jumped by more than `tolerance` (m) at the start of the step. Displacements at the start must
    /// be known.
    pub(crate) fn drop_jumps(&mut self, obstacle: &impl Obstacle, tolerance: f64) {
        for node in 0..self.nodes() {
            if self.minimum(node).is_some() && self.has_jumped(node, obstacle, tolerance) {
                self.minima[node] = f64::NAN;
            }
        }
    }

    /// Returns whether the surface of a node has jumped by more than `tolerance` (m) at the start of the step, as far as gaps there are known.
    /// Displacements at the start must be known.
    pub(super) fn has_jumped(&self, node: usize, obstacle: &impl Obstacle, tolerance: f64) -> bool {
        let gap = obstacle.gap_within(node, 0.0, vector3_at(&self.start, node));
        gap.is_some_and(|gap| self.jump(node, gap) > tolerance)
    }

    /// Returns the fraction of the step at which a node may come closer than at the points, if any.
    pub fn minimum(&self, node: usize) -> Option<f64> {
        let theta = self.minima[node];
        (!theta.is_nan()).then_some(theta)
    }

    /// Gap of a node within the step (m), from the polynomial through the gaps at the points.
    pub(crate) fn gap_within(&self, basis: &TimeBasis, node: usize, theta: f64) -> f64 {
        let weights = basis.weights_at(theta);
        (0..basis.count()).map(|point| weights[point] * self.gap(point, node)).sum()
    }

    /// Displacement of a node within the step (m), from the polynomial through the displacements at the points.
    pub(crate) fn displacement_within(&self, basis: &TimeBasis, node: usize, theta: f64) -> Vector3 {
        let weights = basis.weights_at(theta);
        (0..basis.count()).map(|point| weights[point] * self.displacement(point, node)).sum()
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
