//! Contact patches: a tip divided along its chord, with forces distributed consistently over the faces of the mesh.
//!
//! With hat functions h_k(s) over the chord, which sum to one, patch k has the weights w_kp = ∫ h_k N_p dA / ∫ h_k dA
//! over the nodes p of the tip, with their shape functions N_p. Its displacement is Σ w_kp u_p, with the directions
//! of each node, and its force is distributed with the same weights, so that the work of both is the same. Its
//! position is the mean of radii, angles and axial positions, since a mean of Cartesian ones would lie inside the arc
//! of the chord. Point forces do not converge with mesh refinement, since their flexibility grows without bounds;
//! forces per length do.

mod coordinates;
mod outline;
mod tip;

use std::collections::HashMap;

use nalgebra::DMatrix;

use crate::contact_point::ContactPoint;
use crate::element::ElementKind;
use crate::mesh::{Element, Mesh};
use crate::places::Places;
use crate::{Error, Result};

pub(crate) use coordinates::PatchCoordinates;
use outline::Outline;
pub use tip::{FoundTip, find_root, find_tip};

/// Number of parts into which every face is divided in both directions, because hat functions have kinks.
const PARTS: usize = 4;
/// Fraction of the largest eigenvalue of the products of the weights below which patches depend on each other.
const DEPENDENT: f64 = 1e-9;
/// Gauss-Legendre points and weights of a part, on 0 to 1.
const GAUSS: [(f64, f64); 2] = [(0.211_324_865_405_187_1, 0.5), (0.788_675_134_594_812_9, 0.5)];

/// Returns the number of places along the chord at which a set has nodes, which is its largest number of patches.
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
/// assert_eq!(tiprub_model::patches::places_along_chord(&mesh, mesh.set("TIP")?), 2);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn places_along_chord(mesh: &Mesh, set: &[usize]) -> usize {
    Places::new(&mesh.nodes, set).stations()
}

/// Returns `count` patches along the chord of the tip with the nodes `set`, by ascending z like contact nodes, each
/// with its `name`.
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
/// let name = |patch: usize| format!("patch_{}", patch + 1);
/// let patches = tiprub_model::patches::contact_patches(&mesh, mesh.set("TIP")?, 2, name)?;
/// let area: f64 = patches.iter().map(|patch| patch.area).sum();
/// assert!((area - 4e-4).abs() < 1e-5);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for no patches, more than the tip has nodes along its chord, or a set without a whole outer
/// face of an element.
pub fn contact_patches(
    mesh: &Mesh,
    set: &[usize],
    count: usize,
    name: impl Fn(usize) -> String,
) -> Result<Vec<ContactPoint>> {
    tip_patches(mesh, set, [count, 1], name)
}

/// Returns patches in rows across the thickness, one row after the other, by ascending angle at the chord of the tip.
/// A tilted tip touches with one of its sides: the mean over the thickness does not represent this, and forces on
/// that mean do not bend the blade.
///
/// With hat functions h_k along the chord and χ_l across, from 0 to 1 between the sides of the outline of the tip,
/// the weights are w_p = ∫ h_k χ_l N_p dA / ∫ h_k χ_l dA. Hat functions h_l across would place the outermost rows
/// within the tip, two rows at its thirds. Their duals χ_l with ∫ χ_l h_m = δ_lm ∫ h_l also sum to one, and rows are
/// at the peaks of the hat functions: the outermost at the sides of the tip. A tip that stays straight across its
/// thickness is clear of a surface if two rows are.
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
/// let name = |patch: usize| format!("patch_{}", patch + 1);
/// let patches = tiprub_model::patches::tip_patches(&mesh, mesh.set("TIP")?, [2, 2], name)?;
/// assert_eq!(patches.len(), 4);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// The errors of [`contact_patches`]; no rows, or more than the nodes of the tip resolve.
pub fn tip_patches(
    mesh: &Mesh,
    set: &[usize],
    [count, rows]: [usize; 2],
    name: impl Fn(usize) -> String,
) -> Result<Vec<ContactPoint>> {
    let faces = faces_within(mesh, set)?;
    let places = Places::new(&mesh.nodes, set);
    let stations = places.stations();
    if count == 0 || count > stations {
        let problem = format!(
            "{count} is outside the range 1 to {stations}, limited by the node positions of the set along the chord"
        );
        return Err(Error::invalid("number of contact patches", problem, "Choose another number or refine the tip"));
    }
    if rows == 0 || count * rows > set.len() {
        let nodes = set.len();
        let problem = format!("{rows} rows of {count} patches are not possible with the {nodes} nodes of the tip");
        return Err(rows_refused(problem));
    }
    let outline = Outline::new(mesh, &faces, &places);
    let duals = duals(rows);
    let products = |position: [f64; 3]| -> Vec<(usize, f64)> {
        let along = hats(places.share_along(position), count);
        if rows == 1 {
            return along.to_vec();
        }
        let across = all_duals(&duals, &hats(outline.share_across(places.developed(position)), rows));
        let row = |(row, dual): (usize, &f64)| along.map(|(k, hat)| (row * count + k, hat * dual));
        across.iter().enumerate().flat_map(row).collect()
    };
    let weights = weights(mesh, (set, faces), count * rows, products)?;
    if rows > 1 && !independent(&weights) {
        let problem = format!("{rows} rows of {count} patches are too many for the nodes across the tip");
        return Err(rows_refused(problem));
    }
    let patches = weights.into_iter().enumerate();
    let length = |patch: usize| places.length() * share_of_chord(patch % count, count);
    let point = |(patch, weights): (usize, Vec<f64>)| {
        let found = point(mesh, set, &places, (&weights, length(patch)), name(patch));
        ContactPoint { row: patch / count, ..found }
    };
    Ok(patches.map(point).collect())
}

/// Returns the name of a patch from its name along the chord and, if there are several rows, its row:
/// `patch_5_row_2`.
pub fn row_name(along: &str, row: usize, rows: usize) -> String {
    if rows == 1 { along.to_owned() } else { format!("{along}_row_{}", row + 1) }
}

fn rows_refused(problem: String) -> Error {
    Error::invalid("rows of contact patches", problem, "Use fewer rows or refine the tip across its thickness")
}

/// Returns the duals of hat functions in terms of hat functions: row l of ∫ h_l (∫ h h)⁻¹.
fn duals(rows: usize) -> DMatrix<f64> {
    let share = |row: usize| share_of_chord(row, rows);
    let product = |i: usize, j: usize| match (i.abs_diff(j), rows) {
        (0, 1) => 1.0,
        (0, _) => 2.0 / 3.0 * share(i),
        (1, _) => 1.0 / (6.0 * (rows - 1) as f64),
        _ => 0.0,
    };
    let inverse = DMatrix::from_fn(rows, rows, product).try_inverse().unwrap_or_else(|| DMatrix::identity(rows, rows));
    DMatrix::from_fn(rows, rows, |i, j| share(i) * inverse[(i, j)])
}

/// Returns the values of all duals at a place from those of the hat functions there.
fn all_duals(duals: &DMatrix<f64>, hats: &[(usize, f64)]) -> Vec<f64> {
    (0..duals.nrows()).map(|row| hats.iter().map(|(other, hat)| duals[(row, *other)] * hat).sum()).collect()
}

/// Returns whether all patches are linearly independent.
fn independent(weights: &[Vec<f64>]) -> bool {
    let size = |weights: &[f64]| weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    let scaled = DMatrix::from_fn(weights.len(), weights[0].len(), |i, j| weights[i][j] / size(&weights[i]));
    let gram = (&scaled * scaled.transpose()).symmetric_eigenvalues();
    gram.min() > DEPENDENT * gram.max()
}

/// Returns a grid of patches over a face of a body, rows along the first of two directions (unit vectors), ascending
/// along the second. With the duals χ_k and χ_l of hat functions along both directions, from 0 to 1 between the
/// outermost nodes of the set, patch (k, l) has the weights w_p = ∫ χ_k χ_l N_p dA / ∫ χ_k χ_l dA over the nodes p.
/// Products of duals sum to one, as duals do. So patches are at the peaks of the hat functions, the outermost on the
/// edges of the face: a flat face touches a curved body with its edges first. As many patches as nodes on a grid of
/// linear elements coincide with the nodes.
///
/// # Errors
/// [`Error::Invalid`] for no patches, more than the face has places for, or a set without a whole outer face of an
/// element.
pub fn face_patches(
    mesh: &Mesh,
    set: &[usize],
    counts: [usize; 2],
    directions: [[f64; 3]; 2],
    name: impl Fn(usize) -> String,
) -> Result<Vec<ContactPoint>> {
    let faces = faces_within(mesh, set)?;
    let along = |place: [f64; 3], axis: usize| -> f64 { place.iter().zip(directions[axis]).map(|(x, d)| x * d).sum() };
    let ends = [0, 1].map(|axis| {
        let places = set.iter().map(|&node| along(mesh.nodes[node], axis));
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| [low.min(place), high.max(place)])
    });
    for (axis, [low, high]) in ends.into_iter().enumerate() {
        let mut places: Vec<f64> = set.iter().map(|&node| along(mesh.nodes[node], axis)).collect();
        places.sort_by(f64::total_cmp);
        let stations = 1 + places.windows(2).filter(|pair| pair[1] - pair[0] > SAME_PLACE * (high - low)).count();
        if !(1..=stations).contains(&counts[axis]) {
            let problem = format!("{} in a direction in which the face has {stations} node positions", counts[axis]);
            return Err(Error::invalid(
                "number of contact patches",
                problem,
                "Choose another number or refine the face",
            ));
        }
    }
    let duals = counts.map(duals);
    let products = |position: [f64; 3]| {
        let [first, second] = [0, 1].map(|axis| {
            let [low, high] = ends[axis];
            let hats = hats((along(position, axis) - low) / (high - low), counts[axis]);
            all_duals(&duals[axis], &hats)
        });
        second
            .iter()
            .enumerate()
            .flat_map(|(l, b)| first.iter().enumerate().map(move |(k, a)| (l * counts[0] + k, a * b)))
            .collect()
    };
    let weights = weights(mesh, (set, faces), counts[0] * counts[1], products)?;
    let named = |(patch, weights): (usize, Vec<f64>)| {
        let name = name(patch);
        let (patch, area) = (shares(set, &weights), weights.iter().sum());
        let point = ContactPoint { patch, area, ..ContactPoint::at(name, 0, 0.0) };
        let middle = point.cartesian(&mesh.nodes);
        ContactPoint { node: nearest(mesh, set, middle), ..point }
    };
    Ok(weights.into_iter().enumerate().map(named).collect())
}

/// Places closer than this fraction of the extent of a face coincide.
const SAME_PLACE: f64 = 1e-3;

/// Faces of elements with the local numbers of their corners.
type ElementFaces<'a> = Vec<(&'a Element, &'static [usize])>;

/// Computes ∫ h_k N_p dA over the faces, patch by patch over the nodes of the set.
fn weights(
    mesh: &Mesh,
    (set, faces): (&[usize], ElementFaces<'_>),
    count: usize,
    hats: impl Fn([f64; 3]) -> Vec<(usize, f64)>,
) -> Result<Vec<Vec<f64>>> {
    let within: HashMap<usize, usize> = set.iter().enumerate().map(|(place, &node)| (node, place)).collect();
    let mut weights = vec![vec![0.0; set.len()]; count];
    for (element, corners) in faces {
        let coordinates = mesh.coordinates(element);
        for (point, share) in quadrature(element.kind, corners) {
            let (values, area, position) = on_face(element.kind, &coordinates, point);
            let hats = hats(position);
            for (&node, value) in element.nodes.iter().zip(values) {
                // Nodes off the face have zero shape functions on it.
                let Some(&place) = within.get(&node) else { continue };
                for &(patch, hat) in &hats {
                    weights[patch][place] += hat * value * area * share;
                }
            }
        }
    }
    match weights.iter().position(|weights| weights.iter().sum::<f64>() <= 0.0) {
        None => Ok(weights),
        Some(empty) => {
            let problem = format!("patch {} of {count} covers no face", empty + 1);
            Err(Error::invalid("contact patches", problem, "Use fewer patches or refine the tip"))
        }
    }
}

/// Returns the hat functions that are not zero at a place along the chord, 0 to 1.
fn hats(along: f64, count: usize) -> [(usize, f64); 2] {
    if count == 1 {
        return [(0, 1.0), (0, 0.0)];
    }
    let scaled = along.clamp(0.0, 1.0) * (count - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the number of patches")]
    let first = (scaled as usize).min(count - 2);
    let share = scaled - first as f64;
    [(first, 1.0 - share), (first + 1, share)]
}

/// Returns the nodes with nonzero weights, scaled to sum to one.
fn shares(set: &[usize], weights: &[f64]) -> Vec<(usize, f64)> {
    let total: f64 = weights.iter().sum();
    let some = set.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
    some.map(|(&node, weight)| (node, weight / total)).collect()
}

/// Returns the node of the set that is nearest to a place.
fn nearest(mesh: &Mesh, set: &[usize], middle: [f64; 3]) -> usize {
    let distance = |node: usize| -> f64 { mesh.nodes[node].iter().zip(middle).map(|(a, b)| (a - b) * (a - b)).sum() };
    set.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or_default()
}

/// Returns the integral of the hat function of a patch over the chord of length 1.
fn share_of_chord(patch: usize, count: usize) -> f64 {
    match count {
        1 => 1.0,
        _ if patch == 0 || patch + 1 == count => 0.5 / (count - 1) as f64,
        _ => 1.0 / (count - 1) as f64,
    }
}

fn point(mesh: &Mesh, set: &[usize], places: &Places, (weights, length): (&[f64], f64), name: String) -> ContactPoint {
    let total: f64 = weights.iter().sum();
    let slopes = weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
    let meridional_slope = slopes.map(|(place, weight)| weight / total * places.slope(place)).sum();
    let patch = shares(set, weights);
    let point = ContactPoint { patch, area: total, length, ..ContactPoint::at(name, 0, meridional_slope) };
    let [radius, angle, axial] = point.cylindrical(&mesh.nodes);
    let middle = [radius * angle.cos(), radius * angle.sin(), axial];
    ContactPoint { node: nearest(mesh, set, middle), ..point }
}

/// Natural coordinates of a point of a face, and the vectors along its two directions there.
pub(crate) type FacePoint = ([f64; 3], [[f64; 3]; 2]);

/// Returns the integration points of a face, given by its corners, with their fractions of the parameter area.
fn quadrature(kind: ElementKind, corners: &[usize]) -> impl Iterator<Item = (FacePoint, f64)> {
    let part = |part: usize| GAUSS.map(|(x, w)| ((part as f64 + x) / PARTS as f64, w / PARTS as f64));
    face_points(kind, corners, (0..PARTS).flat_map(part).collect())
}

/// Returns the integration points of a face for a rule on 0 to 1 in both directions.
pub(crate) fn face_points(
    kind: ElementKind,
    corners: &[usize],
    rule: Vec<(f64, f64)>,
) -> impl Iterator<Item = (FacePoint, f64)> {
    let at: Vec<[f64; 3]> = corners.iter().map(|&corner| kind.natural_nodes()[corner]).collect();
    // The third and the fourth corner of a triangle coincide: its sides degenerate, its area does not.
    points_between(std::array::from_fn(|corner| at[corner.min(at.len() - 1)]), rule)
}

/// Returns the integration points between four corners in natural coordinates.
pub(crate) fn points_between(at: [[f64; 3]; 4], rule: Vec<(f64, f64)>) -> impl Iterator<Item = (FacePoint, f64)> {
    let pairs: Vec<_> = rule.iter().flat_map(|first| rule.iter().map(|second| (*first, *second))).collect();
    pairs.into_iter().map(move |((a, wa), (b, wb))| {
        let mix =
            |weights: [f64; 4]| std::array::from_fn(|i| (0..4).map(|corner| weights[corner] * at[corner][i]).sum());
        let natural = mix([(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b]);
        let along = [mix([b - 1.0, 1.0 - b, b, -b]), mix([a - 1.0, -a, a, 1.0 - a])];
        ((natural, along), wa * wb)
    })
}

/// Returns the shape functions of an element at a point of a face, the area per parameter area (m²), and the position
/// (m).
pub(crate) fn on_face(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    (natural, along): FacePoint,
) -> (Vec<f64>, f64, [f64; 3]) {
    let shape = kind.shape(natural);
    let tangent = |direction: [f64; 3]| -> [f64; 3] {
        let rate = |gradient: [f64; 3]| -> f64 { gradient.iter().zip(direction).map(|(g, d)| g * d).sum() };
        std::array::from_fn(|i| {
            coordinates.iter().zip(shape.gradients).map(|(x, gradient)| x[i] * rate(gradient)).sum()
        })
    };
    let [[ax, ay, az], [bx, by, bz]] = along.map(tangent);
    let normal = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
    let area = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    let position = std::array::from_fn(|i| coordinates.iter().zip(shape.values).map(|(x, value)| x[i] * value).sum());
    (shape.values[..coordinates.len()].to_vec(), area, position)
}

/// Returns the outer faces whose nodes, including mid-side ones, are all in the set.
fn faces_within<'a>(mesh: &'a Mesh, set: &[usize]) -> Result<ElementFaces<'a>> {
    let mut chosen = vec![false; mesh.nodes.len()];
    set.iter().for_each(|&node| chosen[node] = true);
    let mut found: HashMap<Vec<usize>, (usize, &Element, &'static [usize])> = HashMap::new();
    for element in &mesh.elements {
        for &corners in element.kind.faces() {
            let mut key: Vec<usize> = corners.iter().map(|&corner| element.nodes[corner]).collect();
            if key.iter().all(|&node| chosen[node]) && middles(element, corners).all(|node| chosen[node]) {
                key.sort_unstable();
                found.entry(key).or_insert((0, element, corners)).0 += 1;
            }
        }
    }
    let mut outer: Vec<_> = found.into_iter().filter(|(_, (count, ..))| *count == 1).collect();
    // The order of sums must not depend on that of a hash table.
    outer.sort_by(|a, b| a.0.cmp(&b.0));
    if outer.is_empty() {
        let problem = "no outer face of an element has all of its nodes in the contact set";
        let remedy = "Give all nodes of the tip faces, or use contact nodes";
        return Err(Error::invalid("contact patches", problem, remedy));
    }
    Ok(outer.into_iter().map(|(_, (_, element, corners))| (element, corners)).collect())
}

/// Returns the mid-side nodes on the sides of a face.
fn middles<'a>(element: &'a Element, corners: &'static [usize]) -> impl Iterator<Item = usize> + 'a {
    let first = element.kind.corner_count();
    let sides = element.kind.edges().iter().enumerate();
    let on_face = move |(_, ends): &(usize, &[usize; 2])| ends.iter().all(|end| corners.contains(end));
    sides.filter(on_face).filter_map(move |(side, _)| element.nodes.get(first + side).copied())
}
