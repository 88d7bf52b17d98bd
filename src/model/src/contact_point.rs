//! Contact before the reduction: nodes and patches.

use crate::Error;

/// A contact node or patch before the reduction.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPoint {
    /// Name, for example `leading_edge`.
    pub name: String,
    /// Node index in the mesh (from 0); of a patch the node nearest to its middle.
    pub node: usize,
    /// Nodes and weights (sum 1) of a patch: it moves and stands as their mean does, and spreads its force over them. Empty for
    /// the node alone.
    pub patch: Vec<(usize, f64)>,
    /// Slope dr/dz of the structure's contour in the meridional plane.
    pub meridional_slope: f64,
    /// Area that a patch stands for (m²); 0 for a node.
    pub area: f64,
    /// Length along the chord that it stands for (m); 0 for a node.
    pub length: f64,
    /// Row across the thickness, from 0; all points of a row follow each other.
    pub row: usize,
}

impl ContactPoint {
    /// A node alone.
    pub fn at(name: impl Into<String>, node: usize, meridional_slope: f64) -> Self {
        Self { name: name.into(), node, patch: Vec::new(), meridional_slope, area: 0.0, length: 0.0, row: 0 }
    }

    /// Number of rows across the thickness that points are in, where there are several.
    pub fn rows(points: &[Self]) -> Option<usize> {
        points.iter().map(|point| point.row + 1).max().filter(|rows| *rows > 1)
    }

    /// Nodes and weights.
    pub fn weights(&self) -> impl Iterator<Item = (usize, f64)> {
        let alone = self.patch.is_empty().then_some((self.node, 1.0));
        self.patch.iter().copied().chain(alone)
    }

    /// Mean position (m) of its nodes in x, y, z: what a rigid motion moves as the mean of its nodes moves.
    pub(crate) fn cartesian(&self, nodes: &[[f64; 3]]) -> [f64; 3] {
        if self.patch.is_empty() {
            return nodes[self.node];
        }
        std::array::from_fn(|i| self.weights().map(|(node, weight)| weight * nodes[node][i]).sum())
    }

    /// Mean radius (m), angle (rad) and axial position (m) of its nodes.
    pub(crate) fn cylindrical(&self, nodes: &[[f64; 3]]) -> [f64; 3] {
        if self.patch.is_empty() {
            let [x, y, z] = nodes[self.node];
            return [x.hypot(y), y.atan2(x), z];
        }
        let mean = |pick: &dyn Fn([f64; 3]) -> f64| self.weights().map(|(node, w)| w * pick(nodes[node])).sum::<f64>();
        let (sin, cos) = mean(&|[_, y, _]| y).atan2(mean(&|[x, ..]| x)).sin_cos();
        // Angles from the middle do not jump.
        let turned = mean(&|[x, y, _]| (y * cos - x * sin).atan2(x * cos + y * sin));
        [mean(&|[x, y, _]| x.hypot(y)), sin.atan2(cos) + turned, mean(&|[_, _, z]| z)]
    }
}

pub(crate) fn clamped_point(point: &ContactPoint) -> Error {
    Error::invalid(format!("contact node `{}`", point.name), "it is clamped", "Choose a node that can move")
}
