//! Contact points before the reduction: nodes and patches.

use crate::Error;

/// A contact node or patch before the reduction.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPoint {
    /// Name, for example `leading_edge`.
    pub name: String,
    /// Node index in the mesh (from 0); for a patch, the node nearest to its middle.
    pub node: usize,
    /// Nodes and weights (sum 1) of a patch: its position and displacement are the weighted means, and its force is
    /// distributed with the same weights. Empty for a single node.
    pub patch: Vec<(usize, f64)>,
    /// Slope dr/dz of the structure's contour in the meridional plane.
    pub meridional_slope: f64,
    /// Area that a patch represents (m²); 0 for a node.
    pub area: f64,
    /// Length along the chord that it represents (m); 0 for a node.
    pub length: f64,
    /// Row across the thickness, from 0; the points of a row are consecutive.
    pub row: usize,
}

impl ContactPoint {
    /// Creates a single contact node.
    pub fn at(name: impl Into<String>, node: usize, meridional_slope: f64) -> Self {
        Self { name: name.into(), node, patch: Vec::new(), meridional_slope, area: 0.0, length: 0.0, row: 0 }
    }

    /// Returns the number of rows across the thickness if there are several.
    pub fn rows(points: &[Self]) -> Option<usize> {
        points.iter().map(|point| point.row + 1).max().filter(|rows| *rows > 1)
    }

    /// Iterates over nodes and weights.
    pub fn weights(&self) -> impl Iterator<Item = (usize, f64)> {
        let alone = self.patch.is_empty().then_some((self.node, 1.0));
        self.patch.iter().copied().chain(alone)
    }

    /// Returns the mean position (m) of the nodes in x, y, z, which a rigid motion moves like the mean of the nodes.
    pub(crate) fn cartesian(&self, nodes: &[[f64; 3]]) -> [f64; 3] {
        if self.patch.is_empty() {
            return nodes[self.node];
        }
        std::array::from_fn(|i| self.weights().map(|(node, weight)| weight * nodes[node][i]).sum())
    }

    /// Returns the mean radius (m), angle (rad) and axial position (m) of the nodes.
    pub(crate) fn cylindrical(&self, nodes: &[[f64; 3]]) -> [f64; 3] {
        if self.patch.is_empty() {
            let [x, y, z] = nodes[self.node];
            return [x.hypot(y), y.atan2(x), z];
        }
        let mean = |pick: &dyn Fn([f64; 3]) -> f64| self.weights().map(|(node, w)| w * pick(nodes[node])).sum::<f64>();
        let (sin, cos) = mean(&|[_, y, _]| y).atan2(mean(&|[x, ..]| x)).sin_cos();
        // Angles relative to the middle do not jump.
        let turned = mean(&|[x, y, _]| (y * cos - x * sin).atan2(x * cos + y * sin));
        [mean(&|[x, y, _]| x.hypot(y)), sin.atan2(cos) + turned, mean(&|[_, _, z]| z)]
    }
}

pub(crate) fn clamped_point(point: &ContactPoint) -> Error {
    Error::invalid(format!("contact node `{}`", point.name), "it is clamped", "Choose a node that can move")
}
