//! Contact surfaces over the outer nodes of a ring: a bicubic B-spline and the facets of the mesh.
//!
//! Both are combinations of *carriers* with local weights: of control points for the spline, of the nodes themselves
//! for facets. Carriers follow from the nodes by a fixed linear map; forces are transferred by its transpose.

mod facets;
mod spline;
mod tensor;

use tensor::Tensor;

/// Contact surface of a ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceKind {
    /// Bicubic uniform B-spline through the nodes, free ends and free edges (second derivative zero).
    Spline,
    /// Bilinear facets of the finite elements.
    Facets,
}

/// Foot of a point on the surface.
#[derive(Debug, Clone)]
pub struct SurfaceFoot {
    /// Unit normal, pointing out of the ring.
    pub normal: [f64; 3],
    /// Distance along the normal (m), negative inside the ring.
    pub gap: f64,
    /// Carriers and their weights, which sum to one.
    pub weights: Vec<(usize, f64)>,
}

/// Surface over a grid of nodes: `rows` along the arc, `columns` along z; node (i, j) is number i·columns + j.
#[derive(Debug, Clone)]
pub struct SplineSurface {
    kind: SurfaceKind,
    rows: usize,
    columns: usize,
    /// +1 if ∂S/∂s × ∂S/∂t points out of the ring, −1 otherwise.
    orientation: f64,
    tensor: Tensor,
}

impl SplineSurface {
    /// Creates a surface over rows × columns nodes.
    pub fn new(kind: SurfaceKind, rows: usize, columns: usize, orientation: f64) -> Self {
        let tensor = match kind {
            SurfaceKind::Spline => Tensor::interpolating(rows, columns),
            SurfaceKind::Facets => Tensor::identity(rows, columns),
        };
        Self { kind, rows, columns, orientation, tensor }
    }

    /// Returns the number of carriers, which equals that of nodes.
    pub fn count(&self) -> usize {
        self.rows * self.columns
    }

    /// Returns the values of the carriers from values at the nodes (any vector quantity: positions, displacements).
    pub fn carriers(&self, nodal: &[[f64; 3]]) -> Vec<[f64; 3]> {
        self.tensor.apply(nodal)
    }

    /// Returns the forces on the nodes that do the same work as forces on the carriers.
    pub fn spread(&self, forces: &[[f64; 3]]) -> Vec<[f64; 3]> {
        self.tensor.apply_transposed(forces)
    }

    /// Returns the closest point of the surface with these carriers (positions, m); `guess` are parameters near it,
    /// in elements. Returns `None` beyond the ends and edges.
    pub fn foot(&self, point: [f64; 3], carriers: &[[f64; 3]], guess: [f64; 2]) -> Option<SurfaceFoot> {
        match self.kind {
            SurfaceKind::Spline => spline::foot(self, point, carriers, guess),
            SurfaceKind::Facets => facets::foot(self, point, carriers, guess),
        }
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn scaled(a: [f64; 3], factor: f64) -> [f64; 3] {
    a.map(|x| x * factor)
}

pub(crate) fn unit(a: [f64; 3]) -> [f64; 3] {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

#[cfg(feature = "cube")]
pub(crate) fn is_zero(a: &[f64; 3]) -> bool {
    a.iter().all(|x| *x == 0.0)
}

pub(crate) fn add_scaled(sum: &mut [f64; 3], a: [f64; 3], factor: f64) {
    (0..3).for_each(|i| sum[i] += factor * a[i]);
}
