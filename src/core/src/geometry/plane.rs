//! Plane obstacles and node-to-node pairs, with constant normals.

use super::{Geometry, dot};

/// Constant normals, gaps and sliding velocities of one group of contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedGap {
    /// Unit normal of each contact, from the slave to the master.
    pub normals: Vec<[f64; 3]>,
    /// Initial gap of each contact (m).
    pub gaps: Vec<f64>,
    /// Prescribed velocity of the master relative to the slave (m/s), on top of the deformation.
    pub sliding: Vec<[f64; 3]>,
}

impl FixedGap {
    /// Computes gaps (m) for the displacements of the contact rows of one structure (m).
    pub(super) fn evaluate(&self, displacement: &[f64], gap: &mut [f64]) {
        for (node, (normal, initial)) in self.normals.iter().zip(&self.gaps).enumerate() {
            gap[node] = initial + dot(*normal, std::array::from_fn(|i| displacement[3 * node + i]));
        }
    }

    /// Writes the normals, with rows of `lanes` lanes.
    pub(super) fn prepare(&self, lanes: usize, geometry: &mut Geometry) {
        for (node, normal) in self.normals.iter().enumerate() {
            for component in 0..3 {
                geometry.normal[component][node * lanes] = normal[component];
            }
        }
    }
}
