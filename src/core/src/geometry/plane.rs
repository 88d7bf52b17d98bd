//! Plane obstacles and node-to-node pairs, with constant normals.

use super::surface_spline::ClosestPoint;
use super::{Gap, Geometry, Vector3};
use crate::math::vector::vector3_at;

/// Constant normals, gaps and sliding velocities of one group of contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedGap {
    /// Unit normal of each contact, from the slave to the master.
    pub normals: Vec<Vector3>,
    /// Initial gap of each contact (m).
    pub gaps: Vec<f64>,
    /// Prescribed velocity of the master relative to the slave (m/s), on top of the deformation.
    pub sliding: Vec<Vector3>,
}

impl FixedGap {
    /// Returns the gap of one node displaced by `moved` (m).
    pub fn gap(&self, node: usize, moved: Vector3) -> Gap {
        let normal = self.normals[node];
        Gap { distance: self.gaps[node] + normal.dot(&moved), normal, foot: ClosestPoint::default() }
    }

    /// Computes gaps (m) for the displacements of the contact rows of one structure (m), and writes the normals.
    pub(super) fn evaluate(&self, displacement: &[f64], geometry: &mut Geometry, gap: &mut [f64]) {
        for (node, (normal, initial)) in self.normals.iter().zip(&self.gaps).enumerate() {
            gap[node] = initial + normal.dot(&vector3_at(displacement, node));
            geometry.set_normal(node, *normal);
        }
    }
}
