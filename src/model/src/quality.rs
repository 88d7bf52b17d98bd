//! Shape quality of elements.

use crate::element::ElementKind;
use crate::mesh::Mesh;

/// Shape quality of an element, or the worst of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementQuality {
    /// Scaled Jacobian: the smallest value, over the corners, of the triple product of the unit tangents of the three
    /// edges that meet there, divided by its value for the regular element (1 for cubes, √3/2 for prisms, √2/2 for
    /// tetrahedra). 1 is ideal, 0 flat. P. M. Knupp, Int. J. Numer. Meth. Engng 48, 2000.
    pub scaled_jacobian: f64,
    /// Smallest over largest Jacobian determinant among nodes and integration points; ≤ 0 for a folded element.
    pub jacobian_ratio: f64,
}

/// Returns the quality of one element from the coordinates of its nodes (m).
pub fn quality(kind: ElementKind, coordinates: &[[f64; 3]]) -> ElementQuality {
    let nodes = kind.natural_nodes();
    let corners = &nodes[..kind.corner_count()];
    let scaled = corners.iter().enumerate().map(|(corner, point)| {
        let jacobian = jacobian(kind, coordinates, *point);
        let mut tangents = kind.quadratic().edges().iter().filter_map(|&[a, b]| {
            let other = if a == corner { b } else { a };
            (a == corner || b == corner).then(|| {
                let direction: [f64; 3] = core::array::from_fn(|d| nodes[other][d] - point[d]);
                unit(core::array::from_fn(|i| (0..3).map(|d| jacobian[d][i] * direction[d]).sum()))
            })
        });
        let mut tangent = || tangents.next().expect("three edges meet at a corner of a solid element");
        // Edges come in any order, so the sign is that of the determinant.
        determinant([tangent(), tangent(), tangent()]).abs().copysign(determinant(jacobian)) / regular(kind)
    });
    let scaled_jacobian = scaled.fold(f64::INFINITY, f64::min);
    let rules = [kind.stiffness_rule(), kind.mass_rule()].concat();
    let points = nodes.iter().copied().chain(rules.iter().map(|point| point.point));
    let determinants = points.map(|point| determinant(jacobian(kind, coordinates, point)));
    let [least, most] = determinants.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
    ElementQuality { scaled_jacobian, jacobian_ratio: least / most.abs() }
}

/// Returns the worst of both values over all elements.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
///
/// let quality = tiprub_model::quality::worst_quality(&mesh);
/// println!("{quality:?}");
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn worst_quality(mesh: &Mesh) -> ElementQuality {
    let all = mesh.elements.iter().map(|element| quality(element.kind, &mesh.coordinates(element)));
    all.fold(ElementQuality { scaled_jacobian: 1.0, jacobian_ratio: 1.0 }, |worst, one| ElementQuality {
        scaled_jacobian: worst.scaled_jacobian.min(one.scaled_jacobian),
        jacobian_ratio: worst.jacobian_ratio.min(one.jacobian_ratio),
    })
}

/// Returns the triple product of unit edges at the corner of the regular element.
fn regular(kind: ElementKind) -> f64 {
    match kind {
        ElementKind::Hex8 | ElementKind::Hex20 => 1.0,
        ElementKind::Penta6 | ElementKind::Penta15 => 0.75_f64.sqrt(),
        ElementKind::Tet4 | ElementKind::Tet10 => 0.5_f64.sqrt(),
    }
}

/// Returns ∂x/∂(natural coordinate), one row per natural coordinate.
fn jacobian(kind: ElementKind, coordinates: &[[f64; 3]], point: [f64; 3]) -> [[f64; 3]; 3] {
    let gradients = kind.shape(point).gradients;
    let part = |d: usize, i: usize| coordinates.iter().zip(&gradients).map(|(x, gradient)| gradient[d] * x[i]).sum();
    core::array::from_fn(|d| core::array::from_fn(|i| part(d, i)))
}

fn determinant([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    vector.map(|x| x / length)
}
