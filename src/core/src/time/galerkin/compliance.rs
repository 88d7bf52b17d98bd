//! Displacements of the contact rows at the points of a step caused by contact forces at these points.

use super::kernels::PADDED;
use crate::math::vector::{Vector3, set_strided_vector3, strided_vector3};
use nalgebra::DMatrix;

/// Lanes of a step: points 1 … s one after the other, with all nodes at each point, padded to whole registers. Vectors have one
/// row of lanes for each of their three components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lanes {
    /// Number of points, s.
    pub points: usize,
    /// Number of contact nodes.
    pub nodes: usize,
}

impl Lanes {
    /// Number of lanes in use.
    pub fn len(self) -> usize {
        self.points * self.nodes
    }

    /// Returns whether there are no lanes.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Length of a row including padding.
    pub fn width(self) -> usize {
        self.len().next_multiple_of(PADDED)
    }

    /// Lane of a node at point 1 … s.
    pub fn at(self, point: usize, node: usize) -> usize {
        (point - 1) * self.nodes + node
    }

    /// Point 1 … s and node of a lane.
    pub fn place(self, lane: usize) -> (usize, usize) {
        (lane / self.nodes + 1, lane % self.nodes)
    }

    /// Returns the three components of a lane.
    pub(crate) fn vector3(self, values: &[f64], lane: usize) -> Vector3 {
        strided_vector3(values, lane, self.width())
    }

    /// Sets the three components of a lane.
    pub fn set(self, values: &mut [f64], lane: usize, to: Vector3) {
        set_strided_vector3(values, lane, self.width(), to);
    }
}

/// Displacements of all lanes per force (m/N), with a column of three rows of lanes for each force component.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneCompliance {
    lanes: Lanes,
    /// Columns of forces at points 0 … s: column 3(k·nodes + node) + component.
    columns: Vec<f64>,
    /// Columns of forces that are equal at points 1 … s: column 3·node + component.
    held: Vec<f64>,
}

impl LaneCompliance {
    /// Creates a compliance with all entries zero.
    pub fn new(lanes: Lanes) -> Self {
        let stride = 3 * lanes.width();
        let column = 3 * lanes.nodes * stride;
        Self { lanes, columns: vec![0.0; (lanes.points + 1) * column], held: vec![0.0; column] }
    }

    /// Returns the lanes.
    pub fn lanes(&self) -> Lanes {
        self.lanes
    }

    /// Length of a column.
    pub fn stride(&self) -> usize {
        3 * self.lanes.width()
    }

    /// Columns of forces at points 0 … s.
    pub fn columns(&self) -> &[f64] {
        &self.columns
    }

    /// Columns of forces that are equal from point 1 on.
    pub fn held(&self) -> &[f64] {
        &self.held
    }

    /// The three columns of a force at lane `lane`.
    pub fn of_lane(&self, lane: usize) -> [&[f64]; 3] {
        let stride = self.stride();
        let first = 3 * (lane + self.lanes.nodes);
        [0, 1, 2].map(|component| &self.columns[(first + component) * stride..][..stride])
    }

    /// Sets P_ik (rows × rows, m/N) of points i = 1 … s and k = 0 … s. After the last block, call [`LaneCompliance::hold`] to
    /// compute the columns of constant forces.
    pub fn set(&mut self, i: usize, k: usize, block: &DMatrix<f64>) {
        let (lanes, stride) = (self.lanes, self.stride());
        for (force, column) in block.column_iter().enumerate() {
            let target = &mut self.columns[(3 * k * lanes.nodes + force) * stride..][..stride];
            for (row, value) in column.iter().enumerate() {
                target[(row % 3) * lanes.width() + lanes.at(i, row / 3)] = *value;
            }
        }
    }

    /// Sums the columns of points 1 … s into those of constant forces.
    pub fn hold(&mut self) {
        self.held.fill(0.0);
        if self.held.is_empty() {
            return;
        }
        for columns in self.columns.chunks_exact(self.held.len()).skip(1) {
            self.held.iter_mut().zip(columns).for_each(|(held, column)| *held += column);
        }
    }
}
