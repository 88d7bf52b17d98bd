//! Parts of a tip at which contact is evaluated: means over patches, or points of the faces.

use std::collections::{BTreeMap, BTreeSet};

use tiprub_model::Mesh;
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Element;

use crate::reduced::rub::RubTip;

/// Part of a tip that must stay inside the casing and is pushed by one normal force.
#[derive(Debug, Clone, PartialEq)]
pub struct TipPart {
    /// Position of the part.
    pub(super) tip: RubTip,
    /// Nodes, their weights (sum 1), and the angle of the radial direction of their displacements (rad).
    pub(super) shares: Vec<(usize, f64, f64)>,
}

/// Points on [0, 1] and weights of Gauss's rules with one, two and three points.
const GAUSS: [&[f64]; 3] = [
    &[0.5],
    &[0.211_324_865_405_187_1, 0.788_675_134_594_812_9],
    &[0.112_701_665_379_258_3, 0.5, 0.887_298_334_620_741_7],
];

impl TipPart {
    /// Creates the mean over nodes with weights (sum 1), each in its local directions, on a contour with the given
    /// slope.
    pub fn mean(nodes: &[[f64; 3]], weights: impl Iterator<Item = (usize, f64)>, slope: f64) -> Self {
        let angle = |node: usize| nodes[node][1].atan2(nodes[node][0]);
        let shares: Vec<_> = weights.map(|(node, weight)| (node, weight, angle(node))).collect();
        let mean = |of: &dyn Fn(usize) -> f64| shares.iter().map(|(node, weight, _)| weight * of(*node)).sum();
        let radius = mean(&|node| nodes[node][0].hypot(nodes[node][1]));
        Self { tip: RubTip { radius, angle: mean(&angle), slope }, shares }
    }

    /// Returns the Gauss points of all faces whose nodes are in the set (ascending), `each` by `each` per face (up to
    /// 3).
    pub fn points(mesh: &Mesh, set: &[usize], each: usize) -> Vec<Self> {
        let mut found = Vec::new();
        for element in &mesh.elements {
            for corners in element.kind.faces() {
                if corners.iter().all(|corner| set.binary_search(&element.nodes[*corner]).is_ok()) {
                    let rule = GAUSS[each - 1];
                    let pairs = rule.iter().flat_map(|a| rule.iter().map(move |b| [*a, *b]));
                    found.extend(pairs.map(|place| Self::point(mesh, element, corners, place)));
                }
            }
        }
        found
    }

    /// Returns the point of a face with parameters from 0 to 1.
    fn point(mesh: &Mesh, element: &Element, corners: &[usize], [a, b]: [f64; 2]) -> Self {
        let (natural, along) = on_face(element.kind, corners, [a, b]);
        let shape = element.kind.shape(natural);
        let coordinates = mesh.coordinates(element);
        let sum = |of: &dyn Fn(usize) -> f64| -> [f64; 3] {
            std::array::from_fn(|i| coordinates.iter().enumerate().map(|(node, x)| of(node) * x[i]).sum())
        };
        let [x, y, _] = sum(&|node| shape.values[node]);
        let (radius, angle) = (x.hypot(y), y.atan2(x));
        // dr = m dz along both directions of the face, by least squares.
        let rates = along.map(|along| {
            let [dx, dy, dz] = sum(&|node| dot(shape.gradients[node], along));
            [(x * dx + y * dy) / radius, dz]
        });
        let total = |of: fn(&[f64; 2]) -> f64| rates.iter().map(of).sum::<f64>();
        let slope = total(|[dr, dz]| dr * dz) / total(|[_, dz]| dz * dz);
        let nodes = element.nodes.iter().zip(shape.values).filter(|(_, value)| value.abs() > 1e-12);
        Self {
            tip: RubTip { radius, angle, slope },
            shares: nodes.map(|(node, value)| (*node, value, angle)).collect(),
        }
    }

    /// Returns all nodes of the outline of the faces whose nodes are in the set (ascending), ends of the tip
    /// included, with the slope of the nearest Gauss point.
    pub fn outline(mesh: &Mesh, set: &[usize]) -> Vec<Self> {
        let mut sides: BTreeMap<[usize; 2], (usize, Option<usize>)> = BTreeMap::new();
        for element in &mesh.elements {
            let within = |corner: &usize| set.binary_search(&element.nodes[*corner]).is_ok();
            for corners in element.kind.faces().iter().filter(|corners| corners.iter().all(within)) {
                for (index, &first) in corners.iter().enumerate() {
                    let second = corners[(index + 1) % corners.len()];
                    let (a, b) = (element.nodes[first], element.nodes[second]);
                    let edge =
                        element.kind.edges().iter().position(|ends| ends.contains(&first) && ends.contains(&second));
                    let middle = edge.and_then(|edge| element.nodes.get(element.kind.corner_count() + edge));
                    sides.entry([a.min(b), a.max(b)]).or_insert((0, middle.copied())).0 += 1;
                }
            }
        }
        let once = sides.iter().filter(|(_, (faces, _))| *faces == 1);
        let nodes: BTreeSet<usize> = once.flat_map(|(ends, (_, middle))| ends.iter().copied().chain(*middle)).collect();
        let known: Vec<(f64, f64)> =
            Self::points(mesh, set, 3).iter().map(|part| (part.axial(mesh), part.tip.slope)).collect();
        let slope = |node: usize| {
            let away = |(axial, _): &&(f64, f64)| (axial - mesh.nodes[node][2]).abs();
            known.iter().min_by(|a, b| away(a).total_cmp(&away(b))).map_or(0.0, |(_, slope)| *slope)
        };
        nodes.into_iter().map(|node| Self::mean(&mesh.nodes, [(node, 1.0)].into_iter(), slope(node))).collect()
    }

    /// Returns the axial position (m).
    fn axial(&self, mesh: &Mesh) -> f64 {
        self.shares.iter().map(|(node, weight, _)| weight * mesh.nodes[*node][2]).sum()
    }

    /// Shifts the angle of the part (rad).
    #[must_use]
    pub fn turned(mut self, by: f64) -> Self {
        self.tip.angle += by;
        self
    }

    /// Returns the angle (rad).
    pub fn angle(&self) -> f64 {
        self.tip.angle
    }

    /// Returns the displacements along radius, circumference and axis per displacement of a node along x, y, z: node,
    /// and three rows.
    pub(super) fn seen(&self) -> impl Iterator<Item = (usize, [[f64; 3]; 3])> {
        self.shares.iter().map(|&(node, weight, angle)| {
            let (sine, cosine) = angle.sin_cos();
            let rows = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
            (node, rows.map(|row| row.map(|entry| weight * entry)))
        })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the natural coordinates of a point of a face with three or four corners, and their derivatives along its
/// two parameters.
fn on_face(kind: ElementKind, corners: &[usize], [a, b]: [f64; 2]) -> ([f64; 3], [[f64; 3]; 2]) {
    let at = |corner: usize| kind.natural_nodes()[corners[corner.min(corners.len() - 1)]];
    let mix = |weights: [f64; 4]| std::array::from_fn(|i| (0..4).map(|corner| weights[corner] * at(corner)[i]).sum());
    let natural = mix([(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b]);
    (natural, [mix([b - 1.0, 1.0 - b, b, -b]), mix([a - 1.0, -a, a, 1.0 - a])])
}
