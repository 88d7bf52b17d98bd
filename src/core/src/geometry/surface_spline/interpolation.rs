//! The interpolation problem in one direction.
//!
//! (Q_{i−1} + 4 Q_i + Q_{i+1})/6 = P_i with cyclic indices, or between free ends: a zero second derivative at an end means Q_end = P_end,
//! and the remaining system is tridiagonal. O(n), in place.

use super::SurfaceSpline;
use crate::math::vector::Vector3;

/// Interpolation problem of one row of data points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InterpolationRow {
    kind: RowEnds,
    /// Reciprocal pivots of the tridiagonal matrix.
    pivots: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq)]
enum RowEnds {
    /// Control points are the data points.
    Facets,
    /// Cyclic matrix = tridiagonal one + rank one; the vector is A'⁻¹u/(1 + vᵀA'⁻¹u) of Sherman and Morrison.
    Closed { correction: Vec<f64> },
    /// The unknowns are the points 1.. between point 0 and point `last`.
    Free { last: usize },
}

/// u and v of the rank-one part, u = (−4, 0, …, 0, 1) and v = (1, 0, …, 0, −¼): A = A' + u vᵀ.
const CORNER: [f64; 2] = [-4.0, 1.0];
const MIRROR: f64 = -0.25;

impl InterpolationRow {
    /// Creates the trivial problem of facets.
    pub fn facets() -> Self {
        Self { kind: RowEnds::Facets, pivots: Vec::new() }
    }

    /// Creates the problem of a closed row with continuous first and second derivatives.
    pub fn closed(count: usize) -> Self {
        let mut diagonal = vec![4.0; count];
        diagonal[0] -= CORNER[0];
        diagonal[count - 1] -= CORNER[1] * MIRROR;
        let mut line = Self { kind: RowEnds::Facets, pivots: pivots(&diagonal) };
        let mut image = vec![Vector3::zeros(); count];
        (image[0][0], image[count - 1][0]) = (CORNER[0], CORNER[1]);
        line.solve_tridiagonal(&mut image, 0, 1);
        let scale = 1.0 + image[0][0] + MIRROR * image[count - 1][0];
        line.kind = RowEnds::Closed { correction: image.iter().map(|value| value[0] / scale).collect() };
        line
    }

    /// Creates the problem of a row of `count` data points with free ends at point 0 and at point `last`, which is the
    /// last point, or 0 if the ends meet.
    pub(crate) fn free_ends(count: usize, last: usize) -> Self {
        Self { kind: RowEnds::Free { last }, pivots: pivots(&vec![4.0; count - if last == 0 { 1 } else { 2 }]) }
    }

    /// Converts data points to control points, at `start`, `start + stride`, …
    pub fn interpolate(&self, values: &mut [Vector3], start: usize, stride: usize) {
        match &self.kind {
            RowEnds::Facets => {}
            RowEnds::Closed { correction } => self.solve_closed(correction, values, start, stride),
            RowEnds::Free { last } => {
                let inner = start + stride;
                let unknowns = self.pivots.len();
                for index in 0..unknowns {
                    values[inner + index * stride] *= 6.0;
                }
                if unknowns > 0 {
                    values[inner] -= values[start];
                    values[inner + (unknowns - 1) * stride] -= values[start + last * stride];
                }
                self.solve_tridiagonal(values, inner, stride);
            }
        }
    }

    fn solve_closed(&self, correction: &[f64], values: &mut [Vector3], start: usize, stride: usize) {
        let last = start + (self.pivots.len() - 1) * stride;
        self.solve_tridiagonal(values, start, stride);
        let share = values[start] + MIRROR * values[last];
        for (index, factor) in correction.iter().enumerate() {
            let value = &mut values[start + index * stride];
            *value = 6.0 * (*value - *factor * share);
        }
    }

    /// Solves a tridiagonal system with off-diagonals 1 by the Thomas algorithm.
    fn solve_tridiagonal(&self, values: &mut [Vector3], start: usize, stride: usize) {
        let mut before = Vector3::zeros();
        for (index, pivot) in self.pivots.iter().enumerate() {
            let value = &mut values[start + index * stride];
            *value = (*value - before) * *pivot;
            before = *value;
        }
        let mut after = Vector3::zeros();
        for (index, pivot) in self.pivots.iter().enumerate().rev() {
            let value = &mut values[start + index * stride];
            *value -= *pivot * after;
            after = *value;
        }
    }
}

/// Reciprocal pivots of a tridiagonal matrix with off-diagonals 1.
fn pivots(diagonal: &[f64]) -> Vec<f64> {
    let mut before = 0.0;
    diagonal
        .iter()
        .map(|entry| {
            before = 1.0 / (entry - before);
            before
        })
        .collect()
}

impl SurfaceSpline {
    /// Solves the interpolation problem in place: around × along data points, or their displacements (the map is linear), become control
    /// points, or their displacements.
    ///
    /// # Panics
    /// Wrong number of values.
    pub fn interpolate(&self, values: &mut [Vector3]) {
        assert_eq!(values.len(), self.around * self.along, "one value per data point");
        (0..self.along).for_each(|ring| self.lines[0].interpolate(values, ring * self.around, 1));
        (0..self.around).for_each(|column| self.lines[1].interpolate(values, column, self.around));
    }
}
