//! Stress at the nodes of an element, extrapolated from its most accurate points.
//!
//! Finite-element stresses are most accurate at the points of reduced integration (Barlow, Int. J. Numer. Methods
//! Eng. 10, 1976). The shape functions of the element corners interpolate them, and this interpolation is evaluated
//! at the node (Hinton, Campbell, Int. J. Numer. Methods Eng. 8, 1974); the result is linear in the displacements.

use nalgebra::{DMatrix, DVector};

use super::matrices::map_point;
use super::{ElementKind, QuadraturePoint};
use crate::{Error, Result, material::Material};

/// Number of stress components.
const COMPONENTS: usize = 6;

impl ElementKind {
    /// Returns the linear element of the same topology (itself if it is linear).
    fn linear(self) -> Self {
        match self {
            Self::Hex8 | Self::Hex20 => Self::Hex8,
            Self::Penta6 | Self::Penta15 => Self::Penta6,
            Self::Tet4 | Self::Tet10 => Self::Tet4,
        }
    }

    /// Returns the points of reduced integration: as many as corners, or the middle alone if stress is constant.
    fn stress_points(self) -> Vec<QuadraturePoint> {
        match self {
            Self::Tet4 | Self::Tet10 => self.stiffness_rule(),
            _ => self.linear().stiffness_rule(),
        }
    }

    /// Returns the weights of the stresses at [`stress_points`](Self::stress_points) in the stress at a natural
    /// point.
    fn stress_weights(self, points: &[QuadraturePoint], at: [f64; 3]) -> Option<DVector<f64>> {
        if points.len() == 1 {
            return Some(DVector::from_element(1, 1.0));
        }
        let (linear, corners) = (self.linear(), self.corner_count());
        let values = |point: [f64; 3]| linear.shape(point).values;
        let table = DMatrix::from_fn(corners, points.len(), |corner, point| values(points[point].point)[corner]);
        let sought = DVector::from_iterator(corners, values(at).into_iter().take(corners));
        table.lu().solve(&sought)
    }
}

/// Returns the stresses (σxx, σyy, σzz, τxy, τyz, τzx) in Pa at a node of an element per displacement of its nodes
/// (m), 6 × 3n, dofs ordered (node, component); `node` counts within the element.
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn nodal_stress(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    material: &Material,
    node: usize,
    element: usize,
) -> Result<DMatrix<f64>> {
    let points = kind.stress_points();
    let weights = kind.stress_weights(&points, kind.natural_nodes()[node]);
    let weights = weights.ok_or(Error::NegativeJacobian { element: element + 1, kind, point: 1, determinant: 0.0 })?;
    let (lambda, shear) = material.lame();
    let mut rows = DMatrix::zeros(COMPONENTS, 3 * kind.node_count());
    for (index, (point, weight)) in points.iter().zip(weights.iter()).enumerate() {
        let mapped = map_point(kind, coordinates, point, (element, index))?;
        for (a, gradient) in mapped.shape.gradients[..kind.node_count()].iter().enumerate() {
            for (i, slope) in gradient.iter().enumerate() {
                let column = 3 * a + i;
                for normal in 0..3 {
                    rows[(normal, column)] += weight * lambda * slope;
                }
                rows[(i, column)] += weight * 2.0 * shear * slope;
                // τxy, τyz, τzx: each combines a component with the next one cyclically.
                let next = (i + 1) % 3;
                let before = (i + 2) % 3;
                rows[(3 + i, column)] += weight * shear * gradient[next];
                rows[(3 + before, column)] += weight * shear * gradient[before];
            }
        }
    }
    Ok(rows)
}
