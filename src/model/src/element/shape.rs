//! Shape functions and their derivatives with respect to the natural coordinates.

use super::{ElementKind, HEX_NODES, MAX_NODES, PENTA_EDGES, TET_EDGES};

/// Shape functions at one point; entries beyond the element's node count are zero.
#[derive(Debug, Clone, Copy)]
pub struct ShapeFunctions {
    /// N_i.
    pub values: [f64; MAX_NODES],
    /// ∂N_i/∂(natural coordinate).
    pub gradients: [[f64; 3]; MAX_NODES],
}

impl ElementKind {
    /// Returns the shape functions at a natural point.
    pub fn shape(self, point: [f64; 3]) -> ShapeFunctions {
        match self {
            Self::Hex8 => hex8(point),
            Self::Hex20 => hex20(point),
            Self::Penta6 => penta6(point),
            Self::Penta15 => penta15(point),
            Self::Tet4 => tet4(point),
            Self::Tet10 => tet10(point),
        }
    }
}

const ZERO: ShapeFunctions = ShapeFunctions { values: [0.0; MAX_NODES], gradients: [[0.0; 3]; MAX_NODES] };

/// Returns the factor of a brick function in one direction and its derivative: 1 + aξ at ends (a = ±1), 1 - ξ²
/// mid-side (a = 0).
fn brick_factor(node: f64, x: f64) -> (f64, f64) {
    if node == 0.0 { (1.0 - x * x, -2.0 * x) } else { (1.0 + node * x, node) }
}

fn brick_product(node: [f64; 3], point: [f64; 3]) -> (f64, [f64; 3]) {
    let [(a, da), (b, db), (c, dc)] = core::array::from_fn(|i| brick_factor(node[i], point[i]));
    (a * b * c, [da * b * c, a * db * c, a * b * dc])
}

fn hex8(point: [f64; 3]) -> ShapeFunctions {
    let mut shape = ZERO;
    for (i, node) in HEX_NODES[..8].iter().enumerate() {
        let (product, derivative) = brick_product(*node, point);
        shape.values[i] = product / 8.0;
        shape.gradients[i] = derivative.map(|d| d / 8.0);
    }
    shape
}

fn hex20(point: [f64; 3]) -> ShapeFunctions {
    let mut shape = ZERO;
    for (i, node) in HEX_NODES.iter().enumerate() {
        let (product, derivative) = brick_product(*node, point);
        if i < 8 {
            let sum = node[0] * point[0] + node[1] * point[1] + node[2] * point[2] - 2.0;
            shape.values[i] = product * sum / 8.0;
            shape.gradients[i] = core::array::from_fn(|d| (derivative[d] * sum + product * node[d]) / 8.0);
        } else {
            shape.values[i] = product / 4.0;
            shape.gradients[i] = derivative.map(|d| d / 4.0);
        }
    }
    shape
}

const TRIANGLE_GRADIENTS: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];

fn penta6([r, s, z]: [f64; 3]) -> ShapeFunctions {
    let area = [1.0 - r - s, r, s];
    let mut shape = ZERO;
    for i in 0..6 {
        let (corner, end) = (i % 3, if i < 3 { -1.0 } else { 1.0 });
        let [dr, ds] = TRIANGLE_GRADIENTS[corner];
        let axial = 0.5 * (1.0 + end * z);
        shape.values[i] = area[corner] * axial;
        shape.gradients[i] = [dr * axial, ds * axial, 0.5 * end * area[corner]];
    }
    shape
}

fn penta15([r, s, z]: [f64; 3]) -> ShapeFunctions {
    let area = [1.0 - r - s, r, s];
    let mut shape = ZERO;
    for i in 0..6 {
        let (corner, end) = (i % 3, if i < 3 { -1.0 } else { 1.0 });
        let (l, [dr, ds], axial) = (area[corner], TRIANGLE_GRADIENTS[corner], 1.0 + end * z);
        let bracket = 2.0 * l - 2.0 + end * z;
        let by_area = 0.5 * axial * (bracket + 2.0 * l);
        shape.values[i] = 0.5 * l * axial * bracket;
        shape.gradients[i] = [by_area * dr, by_area * ds, 0.5 * l * end * (bracket + axial)];
    }
    for (i, edge) in PENTA_EDGES.iter().enumerate().take(6) {
        let (a, b, end) = (edge[0] % 3, edge[1] % 3, if i < 3 { -1.0 } else { 1.0 });
        let (ga, gb, axial) = (TRIANGLE_GRADIENTS[a], TRIANGLE_GRADIENTS[b], 1.0 + end * z);
        shape.values[6 + i] = 2.0 * area[a] * area[b] * axial;
        let plane = |d: usize| 2.0 * axial * (ga[d] * area[b] + area[a] * gb[d]);
        shape.gradients[6 + i] = [plane(0), plane(1), 2.0 * end * area[a] * area[b]];
    }
    for corner in 0..3 {
        let [dr, ds] = TRIANGLE_GRADIENTS[corner];
        let bubble = 1.0 - z * z;
        shape.values[12 + corner] = area[corner] * bubble;
        shape.gradients[12 + corner] = [dr * bubble, ds * bubble, -2.0 * z * area[corner]];
    }
    shape
}

const TET_GRADIENTS: [[f64; 3]; 4] = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn tet4([r, s, t]: [f64; 3]) -> ShapeFunctions {
    let mut shape = ZERO;
    shape.values[..4].copy_from_slice(&[1.0 - r - s - t, r, s, t]);
    shape.gradients[..4].copy_from_slice(&TET_GRADIENTS);
    shape
}

fn tet10([r, s, t]: [f64; 3]) -> ShapeFunctions {
    let volume = [1.0 - r - s - t, r, s, t];
    let mut shape = ZERO;
    for i in 0..4 {
        shape.values[i] = volume[i] * (2.0 * volume[i] - 1.0);
        shape.gradients[i] = TET_GRADIENTS[i].map(|g| g * (4.0 * volume[i] - 1.0));
    }
    for (i, &[a, b]) in TET_EDGES.iter().enumerate() {
        shape.values[4 + i] = 4.0 * volume[a] * volume[b];
        shape.gradients[4 + i] =
            core::array::from_fn(|d| 4.0 * (TET_GRADIENTS[a][d] * volume[b] + volume[a] * TET_GRADIENTS[b][d]));
    }
    shape
}
