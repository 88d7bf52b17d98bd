//! The surface of a casing: which faces are in the gas, in the air, heated; integrals over them.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use faer::Mat;

use super::add;
use crate::element::consistent_mass;
use crate::mesh::{Element, Mesh};
use crate::patches::{face_points, on_face};
use crate::sparse::{Pattern, SparseMatrix};
use crate::{Error, Result};

/// A face looks towards the axis where its normal is within 45 degrees of that direction.
const INWARD: f64 = -core::f64::consts::FRAC_1_SQRT_2;
/// Axial positions closer than this share of the length are one.
const SAME: f64 = 1e-9;
/// Gauss-Legendre on 0 to 1.
const GAUSS_3: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// A face of an element: number of the element, its own numbers of the corners.
#[derive(Debug, Clone, Copy)]
struct Face {
    element: usize,
    corners: &'static [usize],
}

/// Faces by what they meet.
#[derive(Debug, Clone)]
pub struct Surfaces {
    /// In the gas, in the air.
    sides: [Vec<Face>; 2],
    heated: Vec<Face>,
}

impl Surfaces {
    /// Outer faces of the mesh; those in the gas between the axial positions `heated` (m) are heated.
    ///
    /// # Errors
    /// No face in the gas, or none that is heated.
    pub fn new(mesh: &Mesh, heated: [f64; 2]) -> Result<Self> {
        let axial = mesh.nodes.iter().map(|node| node[2]);
        let [low, high] = axial.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| [a.min(z), b.max(z)]);
        let slack = SAME * (high - low);
        let mut surfaces = Self { sides: [Vec::new(), Vec::new()], heated: Vec::new() };
        for face in outer_faces(mesh) {
            let corners = face.corner_positions(mesh);
            let at = |end: f64| corners.iter().all(|corner| (corner[2] - end).abs() <= slack);
            if at(low) || at(high) {
                continue;
            }
            if !looks_inward(&corners) {
                surfaces.sides[1].push(face);
                continue;
            }
            surfaces.sides[0].push(face);
            let middle = corners.iter().map(|corner| corner[2]).sum::<f64>() / corners.len() as f64;
            if middle > heated[0] && middle < heated[1] {
                surfaces.heated.push(face);
            }
        }
        let [gas, _] = &surfaces.sides;
        if gas.is_empty() || surfaces.heated.is_empty() {
            let which =
                if gas.is_empty() { "faces of the mesh look towards the axis" } else { "face in the gas lies there" };
            let problem = format!("of z = {} m to {} m: no {which}", heated[0], heated[1]);
            let remedy = "Give axial positions within the casing; its axis is z";
            return Err(Error::invalid("thermal model, heated surface", problem, remedy));
        }
        Ok(surfaces)
    }

    /// ∫ h N Nᵀ dA of the faces in the gas (`side` 0) or in the air (1).
    pub(super) fn film(&self, mesh: &Mesh, pattern: &Arc<Pattern>, side: usize, film: f64) -> SparseMatrix {
        let mut values = vec![0.0; pattern.rows.len()];
        for face in &self.sides[side] {
            let element = &mesh.elements[face.element];
            face.integrate(mesh, |shape, area| {
                add(pattern, &mut values, &element.nodes, |a, b| film * area * shape[a] * shape[b]);
            });
        }
        SparseMatrix { pattern: Arc::clone(pattern), values }
    }

    /// ∫ N dA / A of each side; zeros where a side has no face.
    pub(super) fn wetted_means(&self, mesh: &Mesh) -> Mat<f64> {
        let mut means = Mat::zeros(mesh.nodes.len(), 2);
        for (side, faces) in self.sides.iter().enumerate() {
            add_means(mesh, faces.iter().map(|face| (face, side)), &mut means);
        }
        normalised(means)
    }

    /// ∫ N dA / A of the heated faces of each patch.
    ///
    /// # Errors
    /// A patch without one.
    pub(super) fn heat(&self, mesh: &Mesh, of_elements: &[Option<usize>], patches: usize) -> Result<Mat<f64>> {
        let mut means = Mat::zeros(mesh.nodes.len(), patches);
        let of_patches = self.heated.iter().filter_map(|face| Some((face, of_elements[face.element]?)));
        add_means(mesh, of_patches, &mut means);
        let empty = (0..patches).find(|&patch| means.col(patch).iter().all(|value| *value == 0.0));
        empty.map_or_else(
            || Ok(normalised(means)),
            |patch| {
                let what = format!("thermal model, patch {}", patch + 1);
                Err(Error::invalid(
                    what,
                    "no heated face lies in it",
                    "Give one row of patches, or heat all of the length",
                ))
            },
        )
    }

    /// Corner nodes of heated faces, ascending.
    pub(super) fn places(&self, mesh: &Mesh) -> Vec<usize> {
        let nodes = self
            .heated
            .iter()
            .flat_map(|face| face.corners.iter().map(|&corner| mesh.elements[face.element].nodes[corner]));
        nodes.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Largest depth of an element under a heated face (m): its volume over the area of the face.
    ///
    /// # Errors
    /// An element without volume.
    pub(super) fn depth(&self, mesh: &Mesh) -> Result<f64> {
        let mut deepest = 0.0_f64;
        for face in &self.heated {
            let element = &mesh.elements[face.element];
            let products = consistent_mass(element.kind, &mesh.coordinates(element), 1.0, face.element)?;
            let mut area = 0.0;
            face.integrate(mesh, |_, part| area += part);
            deepest = deepest.max(products.sum() / area);
        }
        Ok(deepest)
    }

    /// In the gas, in the air, heated (m²).
    pub(super) fn areas(&self, mesh: &Mesh) -> [f64; 3] {
        [&self.sides[0], &self.sides[1], &self.heated].map(|faces| {
            let mut total = 0.0;
            faces.iter().for_each(|face| face.integrate(mesh, |_, area| total += area));
            total
        })
    }
}

impl Face {
    fn corner_positions(&self, mesh: &Mesh) -> Vec<[f64; 3]> {
        let nodes = &mesh.elements[self.element].nodes;
        self.corners.iter().map(|&corner| mesh.nodes[nodes[corner]]).collect()
    }

    /// Shape functions of the element and area at each point of a rule.
    fn integrate(&self, mesh: &Mesh, mut visit: impl FnMut(&[f64], f64)) {
        let element: &Element = &mesh.elements[self.element];
        let coordinates = mesh.coordinates(element);
        for (point, share) in face_points(element.kind, self.corners, GAUSS_3.to_vec()) {
            let (shape, area, _) = on_face(element.kind, &coordinates, point);
            visit(&shape, area * share);
        }
    }
}

/// Faces that belong to one element, in the order of elements.
fn outer_faces(mesh: &Mesh) -> Vec<Face> {
    let key = |element: &Element, corners: &[usize]| {
        let mut nodes: Vec<usize> = corners.iter().map(|&corner| element.nodes[corner]).collect();
        nodes.sort_unstable();
        nodes
    };
    let mut count: HashMap<Vec<usize>, usize> = HashMap::new();
    let all = || {
        mesh.elements.iter().enumerate().flat_map(|(number, element)| {
            element.kind.faces().iter().map(move |&corners| (Face { element: number, corners }, element))
        })
    };
    all().for_each(|(face, element)| *count.entry(key(element, face.corners)).or_default() += 1);
    all().filter(|(face, element)| count[&key(element, face.corners)] == 1).map(|(face, _)| face).collect()
}

/// Whether the normal of a face, counter-clockwise seen from outside, points towards the axis.
fn looks_inward(corners: &[[f64; 3]]) -> bool {
    let edge = |to: usize| -> [f64; 3] { core::array::from_fn(|i| corners[to][i] - corners[0][i]) };
    let ([ax, ay, az], [bx, by, bz]) = (edge(1), edge(corners.len() - 1));
    let [x, y, z] = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
    let middle = [0, 1].map(|i| corners.iter().map(|corner| corner[i]).sum::<f64>());
    let size = x.hypot(y).hypot(z) * middle[0].hypot(middle[1]);
    x * middle[0] + y * middle[1] < INWARD * size
}

/// Add ∫ N dA of faces to columns.
fn add_means<'a>(mesh: &Mesh, faces: impl Iterator<Item = (&'a Face, usize)>, means: &mut Mat<f64>) {
    for (face, column) in faces {
        let nodes = &mesh.elements[face.element].nodes;
        face.integrate(mesh, |shape, area| {
            nodes.iter().zip(shape).for_each(|(&node, value)| means[(node, column)] += value * area);
        });
    }
}

/// Columns that add up to one.
fn normalised(means: Mat<f64>) -> Mat<f64> {
    let totals: Vec<f64> = (0..means.ncols()).map(|k| means.col(k).iter().sum::<f64>()).collect();
    Mat::from_fn(means.nrows(), means.ncols(), |i, k| if totals[k] > 0.0 { means[(i, k)] / totals[k] } else { 0.0 })
}
