//! Detection of the tip and the root of a blade in its mesh.

use std::collections::{BTreeSet, HashMap};

use tiprub_cosim::shown;

use super::middles;
use crate::mesh::{Element, Mesh};
use crate::places::Places;
use crate::{Error, Result};

/// Cosine of the largest angle between the radial direction and the normal of an outward face: 45 degrees.
const OUTWARD: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Fraction of the radius by which another face may lie below the tip at its axial position and still count as
/// equally far out.
const AS_FAR_OUT: f64 = 1e-3;

/// Fraction of the chord at which elements across it are counted: near its middle, on no line of a regular mesh.
const MIDDLE: f64 = 0.4931;

/// Tip that was found in a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundTip {
    /// Nodes of the tip, including mid-side nodes, ascending.
    pub nodes: Vec<usize>,
    /// Number of faces.
    pub faces: usize,
    /// Number of places along the chord with nodes.
    pub places: usize,
    /// Number of elements across the thickness, in the middle of the chord.
    pub across: usize,
    /// Length along its chord (m).
    pub chord: f64,
    /// Median length of the edges of its faces (m).
    pub edge: f64,
    /// Smallest and largest radius of its nodes (m).
    pub radius: [f64; 2],
    /// Smallest and largest axial position of its nodes (m).
    pub axial: [f64; 2],
    /// Number of outward faces elsewhere that are equally far out at their axial position, within a thousandth of the
    /// radius.
    pub elsewhere: usize,
}

impl FoundTip {
    /// Returns `patches`, or the largest number of patches that are no narrower than elements.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "far fewer elements than 2^52")]
    pub fn at_most(&self, patches: usize) -> usize {
        let elements = (self.chord / self.edge).round() as usize;
        patches.min(elements + 1).min(self.places)
    }
}

/// Outer face that faces away from the axis or towards it.
struct TipFace<'a> {
    element: &'a Element,
    corners: &'static [usize],
    /// Mean of its corners (m).
    radius: f64,
    axial: f64,
}

impl TipFace<'_> {
    fn corner_nodes(&self) -> Vec<usize> {
        self.corners.iter().map(|&corner| self.element.nodes[corner]).collect()
    }
}

/// Finds the outermost of all outer faces whose normals are within 45 degrees of the radial direction, and all such
/// faces connected with it by edges. None of their nodes may be `fixed` (ascending), that is clamped or on a face to
/// a neighbouring sector.
///
/// # Errors
/// [`Error::Invalid`] for a mesh without such faces, and if they include fixed nodes.
pub fn find_tip(mesh: &Mesh, fixed: &[usize]) -> Result<FoundTip> {
    let faces = radial_faces(mesh, NormalDirection::Outer);
    let first = (0..faces.len()).max_by(|&a, &b| faces[a].radius.total_cmp(&faces[b].radius).then(b.cmp(&a)));
    let Some(first) = first else {
        let problem = "no outer face of the mesh points outward within 45 degrees of the radial direction";
        return Err(not_found(problem.to_owned(), "Check the axis of rotation (--axis)"));
    };
    let chosen = connected(&faces, first);
    let own: Vec<&TipFace> = faces.iter().zip(&chosen).filter(|(_, chosen)| **chosen).map(|(face, _)| face).collect();
    let others = faces.iter().zip(&chosen).filter(|(_, chosen)| !**chosen).map(|(face, _)| face);
    let elsewhere = others.filter(|face| as_far_out(face, &own)).count();
    let nodes = nodes_of(&own);
    let radius = extent(mesh, &nodes, |[x, y, _]| x.hypot(y));
    let held = nodes.iter().filter(|node| fixed.binary_search(node).is_ok()).count();
    if held > 0 {
        let problem = format!(
            "of the {} nodes of the outermost faces, at radii up to {} m, {held} are clamped or lie on cyclic faces",
            nodes.len(),
            shown(radius[1])
        );
        return Err(not_found(problem, "Check the clamped nodes and the axis"));
    }
    let places = Places::new(&mesh.nodes, &nodes);
    let across = elements_across(mesh, &own, &places);
    let (places, chord) = (places.stations(), places.chord_length());
    let (edge, axial) = (median_edge(mesh, &own), extent(mesh, &nodes, |[_, _, z]| z));
    Ok(FoundTip { faces: own.len(), nodes, places, across, chord, edge, radius, axial, elsewhere })
}

/// Returns the nodes of the root, including mid-side ones, ascending: of the innermost of all outer faces whose
/// normals are within 45 degrees of the inward radial direction, and of all such faces connected with it by edges.
/// Empty for a mesh without such faces.
pub fn find_root(mesh: &Mesh) -> Vec<usize> {
    let faces = radial_faces(mesh, NormalDirection::Inner);
    let first = (0..faces.len()).min_by(|&a, &b| faces[a].radius.total_cmp(&faces[b].radius).then(a.cmp(&b)));
    let Some(first) = first else { return Vec::new() };
    let chosen = connected(&faces, first);
    nodes_of(&faces.iter().zip(&chosen).filter(|(_, chosen)| **chosen).map(|(face, _)| face).collect::<Vec<_>>())
}

/// Counts the faces that a line across the chord crosses in its middle; for triangles, two per layer.
fn elements_across(mesh: &Mesh, faces: &[&TipFace], places: &Places) -> usize {
    let along = |node: usize| places.share_along(mesh.nodes[node]);
    let meets = |face: &TipFace| {
        let ends = face.corner_nodes().into_iter().map(along);
        let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
        (low..high).contains(&MIDDLE)
    };
    let halves = |face: &&&TipFace| if face.corners.len() == 3 { 1 } else { 2 };
    let met = faces.iter().filter(|face| meets(face)).map(|face| halves(&face)).sum::<usize>();
    met.div_ceil(2).max(1)
}

/// Returns the corners and mid-side nodes of faces, ascending.
fn nodes_of(faces: &[&TipFace]) -> Vec<usize> {
    let of_face = |face: &&TipFace| middles(face.element, face.corners).chain(face.corner_nodes()).collect::<Vec<_>>();
    faces.iter().flat_map(of_face).collect::<BTreeSet<_>>().into_iter().collect()
}

/// Returns the median length of the edges of faces (m).
fn median_edge(mesh: &Mesh, faces: &[&TipFace]) -> f64 {
    let mut lengths: Vec<f64> = faces.iter().flat_map(|face| edges(face)).map(|edge| length(mesh, edge)).collect();
    lengths.sort_by(f64::total_cmp);
    lengths[lengths.len() / 2]
}

fn length(mesh: &Mesh, [a, b]: [usize; 2]) -> f64 {
    let [x, y, z]: [f64; 3] = core::array::from_fn(|i| mesh.nodes[a][i] - mesh.nodes[b][i]);
    x.hypot(y).hypot(z)
}

/// Returns the corners at the ends of the edges of a face, ascending.
fn edges(face: &TipFace) -> Vec<[usize; 2]> {
    let nodes = face.corner_nodes();
    let ends = (0..nodes.len()).map(|i| (nodes[i], nodes[(i + 1) % nodes.len()]));
    ends.map(|(a, b)| [a.min(b), a.max(b)]).collect()
}

fn not_found(problem: String, remedy: &str) -> Error {
    Error::invalid("tip of the blade", problem, format!("{remedy}, or give the nodes of the tip with --contact-set"))
}

fn extent(mesh: &Mesh, nodes: &[usize], of: fn([f64; 3]) -> f64) -> [f64; 2] {
    let values = nodes.iter().map(|&node| of(mesh.nodes[node]));
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Direction of the normals of the faces to find: away from the axis, or towards it.
#[derive(Clone, Copy)]
enum NormalDirection {
    Outer,
    Inner,
}

impl NormalDirection {
    fn sign(self) -> f64 {
        match self {
            Self::Outer => 1.0,
            Self::Inner => -1.0,
        }
    }
}

fn radial_faces(mesh: &Mesh, side: NormalDirection) -> Vec<TipFace<'_>> {
    let mut count: HashMap<Vec<usize>, usize> = HashMap::new();
    let key = |element: &Element, corners: &[usize]| {
        let mut key: Vec<usize> = corners.iter().map(|&corner| element.nodes[corner]).collect();
        key.sort_unstable();
        key
    };
    let all = || mesh.elements.iter().flat_map(|element| element.kind.faces().iter().map(move |&face| (element, face)));
    for (element, corners) in all() {
        *count.entry(key(element, corners)).or_default() += 1;
    }
    let outer = all().filter(|(element, corners)| count[&key(element, corners)] == 1);
    outer.filter_map(|(element, corners)| radial_face(mesh, element, corners, side)).collect()
}

/// Returns the face if it faces this direction. Corners are counter-clockwise seen from outside.
fn radial_face<'a>(
    mesh: &Mesh,
    element: &'a Element,
    corners: &'static [usize],
    side: NormalDirection,
) -> Option<TipFace<'a>> {
    let at: Vec<[f64; 3]> = corners.iter().map(|&corner| mesh.nodes[element.nodes[corner]]).collect();
    let mean = |pick: &dyn Fn([f64; 3]) -> f64| at.iter().map(|&point| pick(point)).sum::<f64>() / at.len() as f64;
    let [x, y] = [mean(&|[x, ..]| x), mean(&|[_, y, _]| y)];
    let mut normal = [0.0; 3];
    for (i, a) in at.iter().enumerate() {
        let b = at[(i + 1) % at.len()];
        normal[0] += a[1] * b[2] - a[2] * b[1];
        normal[1] += a[2] * b[0] - a[0] * b[2];
        normal[2] += a[0] * b[1] - a[1] * b[0];
    }
    let size = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let radial = (normal[0] * x + normal[1] * y) / x.hypot(y);
    let radius = mean(&|[x, y, _]| x.hypot(y));
    (side.sign() * radial >= OUTWARD * size).then(|| TipFace { element, corners, radius, axial: mean(&|[_, _, z]| z) })
}

/// Returns which faces are connected with the first one by edges.
fn connected(faces: &[TipFace], first: usize) -> Vec<bool> {
    let mut beside: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    for (index, face) in faces.iter().enumerate() {
        edges(face).into_iter().for_each(|edge| beside.entry(edge).or_default().push(index));
    }
    let mut chosen = vec![false; faces.len()];
    let mut open = vec![first];
    while let Some(face) = open.pop() {
        if !core::mem::replace(&mut chosen[face], true) {
            open.extend(edges(&faces[face]).iter().flat_map(|edge| &beside[edge]));
        }
    }
    chosen
}

/// Returns whether a face is as far out as the tip face that is nearest along the axis.
fn as_far_out(face: &TipFace, tip: &[&TipFace]) -> bool {
    let apart = |own: &TipFace| (own.axial - face.axial).abs();
    let nearest = tip.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
    nearest.is_some_and(|own| face.radius >= (1.0 - AS_FAR_OUT) * own.radius)
}
