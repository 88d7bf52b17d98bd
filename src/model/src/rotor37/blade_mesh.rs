//! Structured quadratic mesh of the blade.

use std::collections::BTreeMap;

use super::{AerofoilSection, CylindricalPoint, sections};
use crate::element::ElementKind;
use crate::mesh::{Element, Mesh};
use crate::patches::{contact_patches, row_name, tip_patches};
use crate::reduce::ContactPoint;
use crate::{Error, Result};

/// Numbers of elements in the three directions of the blade.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshCounts {
    /// Leading to trailing edge.
    pub chord: usize,
    /// Through the thickness.
    pub thickness: usize,
    /// Hub to tip.
    pub span: usize,
}

impl Default for MeshCounts {
    fn default() -> Self {
        Self { chord: 16, thickness: 2, span: 20 }
    }
}

/// Mesh of the blade with its tip line.
#[derive(Debug, Clone)]
pub struct BladeMesh {
    /// Hex20 elements; node sets `hub`, `tip`, `leading_edge`, `trailing_edge`.
    pub mesh: Mesh,
    /// Nodes on the mid-thickness line of the tip, leading to trailing edge.
    pub tip_line: Vec<usize>,
    /// Slope dr/dz of the tip section at each of these nodes.
    pub tip_slopes: Vec<f64>,
}

/// Builds the mesh of one blade, mirrored so that its design speed is positive about +z.
///
/// Nodes lie on a grid of twice the element counts. Each section is divided evenly along its chord and across its
/// thickness; corresponding points of the twelve sections are connected by natural cubic splines of z, r and θ over
/// the mean radius, which are divided evenly in the mean radius.
///
/// # Errors
/// [`Error::Invalid`] if a count is zero.
pub fn blade_mesh(counts: MeshCounts) -> Result<BladeMesh> {
    for (name, count) in [("chord", counts.chord), ("thickness", counts.thickness), ("span", counts.span)] {
        if count == 0 {
            let remedy = "Give at least one element in every direction; 16 x 2 x 20 is the default";
            return Err(Error::invalid(format!("mesh count `{name}`"), "it is zero", remedy));
        }
    }
    let fine = [2 * counts.chord, 2 * counts.thickness, 2 * counts.span];
    let span = SpanInterpolation::new(fine[2]);
    let mut numbers = BTreeMap::new();
    let mut mesh = Mesh::default();
    for i in 0..=fine[0] {
        for j in 0..=fine[1] {
            let line: Vec<CylindricalPoint> =
                sections().iter().map(|section| grid_point(section, ratio(i, fine[0]), ratio(j, fine[1]))).collect();
            // A serendipity brick has nodes on its edges only: at most one index is odd.
            for k in (0..=fine[2]).filter(|k| i % 2 + j % 2 + k % 2 < 2) {
                numbers.insert([i, j, k], mesh.nodes.len());
                mesh.nodes.push(span.cartesian(&line, k));
            }
        }
    }
    mesh.elements = elements(counts, &numbers);
    mesh.sets = node_sets(fine, &numbers);
    let tip_line: Vec<usize> = (0..=fine[0]).filter_map(|i| numbers.get(&[i, fine[1] / 2, fine[2]]).copied()).collect();
    let tip = &sections()[sections().len() - 1];
    let tip_slopes = (0..=fine[0])
        .filter(|&i| numbers.contains_key(&[i, fine[1] / 2, fine[2]]))
        .map(|i| tip.meridional_slope(plane_point(tip, ratio(i, fine[0]), 0.5)[0]))
        .collect();
    Ok(BladeMesh { mesh, tip_line, tip_slopes })
}

impl BladeMesh {
    /// Returns `count` contact patches over the whole tip: `patch_1`, `patch_2`, ... from leading to trailing edge.
    ///
    /// # Errors
    /// The errors of [`contact_patches`](crate::patches::contact_patches).
    pub fn contact_patches(&self, count: usize) -> Result<Vec<ContactPoint>> {
        contact_patches(&self.mesh, self.mesh.set("tip")?, count, |index| format!("patch_{}", index + 1))
    }

    /// Returns contact patches in rows across the thickness, side to side: `patch_1_row_1`, `patch_2_row_1`, ...
    ///
    /// # Errors
    /// The errors of [`tip_patches`](crate::patches::tip_patches).
    pub fn contact_rows(&self, [count, rows]: [usize; 2]) -> Result<Vec<ContactPoint>> {
        let name = |index: usize| row_name(&format!("patch_{}", index % count + 1), index / count, rows);
        tip_patches(&self.mesh, self.mesh.set("tip")?, [count, rows], name)
    }

    /// Returns `count` contact nodes spread along the mid-thickness line of the tip: `leading_edge`, `tip_2`, ...,
    /// `trailing_edge`; the middle one of an odd count is `mid_chord`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than two nodes or more than the line has.
    pub fn contact_points(&self, count: usize) -> Result<Vec<ContactPoint>> {
        spread_contact(&self.tip_line, &self.tip_slopes, count)
    }
}

/// Returns `count` contact nodes spread along a line of nodes from leading to trailing edge, with the slopes dr/dz
/// there.
pub(crate) fn spread_contact(line: &[usize], slopes: &[f64], count: usize) -> Result<Vec<ContactPoint>> {
    let available = line.len();
    if count < 2 || count > available {
        return Err(Error::invalid(
            "number of contact nodes",
            format!(
                "{count} is outside the range 2 to {available}, limited by the nodes on the mid-thickness line of the tip"
            ),
            "Choose another number or more elements along the chord",
        ));
    }
    let point = |index: usize| {
        // Rounded to the nearest node of the line.
        let place = (2 * index * (available - 1) + count - 1) / (2 * (count - 1));
        ContactPoint::at(place_name(index, count), line[place], slopes[place])
    };
    Ok((0..count).map(point).collect())
}

/// Returns the name of the contact node or patch `index` of `count` from leading to trailing edge.
pub(crate) fn place_name(index: usize, count: usize) -> String {
    match index {
        0 => "leading_edge".to_owned(),
        _ if index + 1 == count => "trailing_edge".to_owned(),
        _ if 2 * index + 1 == count => "mid_chord".to_owned(),
        _ => format!("tip_{}", index + 1),
    }
}

fn ratio(index: usize, count: usize) -> f64 {
    index as f64 / count as f64
}

/// Returns the plane coordinates of a grid point: `along` the chord and `across` the thickness, both 0 to 1.
fn plane_point(section: &AerofoilSection, along: f64, across: f64) -> [f64; 2] {
    let [leading, trailing] =
        section.edge_radii().map(|radius| core::f64::consts::FRAC_PI_4 * radius / section.chord());
    let u = -leading + along * (1.0 + leading + trailing);
    let [camber, half] = section.sides(u);
    section.plane(u, camber + (2.0 * across - 1.0) * half)
}

fn grid_point(section: &AerofoilSection, along: f64, across: f64) -> CylindricalPoint {
    section.on_surface(plane_point(section, along, across))
}

/// Interpolation over the sections at the span stations of the mesh.
struct SpanInterpolation {
    /// Weights of the twelve sections, one row per station.
    weights: Vec<Vec<f64>>,
}

impl SpanInterpolation {
    fn new(fine: usize) -> Self {
        let radii: Vec<f64> = sections().iter().map(AerofoilSection::mean_radius).collect();
        let (first, last) = (radii[0], radii[radii.len() - 1]);
        // The spline of each unit vector gives the weights, since interpolation is linear in the data.
        let columns: Vec<Vec<f64>> = (0..radii.len())
            .map(|section| {
                let data: Vec<f64> = (0..radii.len()).map(|other| if other == section { 1.0 } else { 0.0 }).collect();
                let curvature = natural_spline(&radii, &data);
                (0..=fine)
                    .map(|k| evaluate_spline(&radii, &data, &curvature, first + (last - first) * ratio(k, fine)))
                    .collect()
            })
            .collect();
        Self { weights: (0..=fine).map(|k| columns.iter().map(|column| column[k]).collect()).collect() }
    }

    /// Returns Cartesian coordinates at a station, mirrored in θ.
    fn cartesian(&self, line: &[CylindricalPoint], station: usize) -> [f64; 3] {
        let mix = |pick: fn(&CylindricalPoint) -> f64| -> f64 {
            line.iter().zip(&self.weights[station]).map(|(point, weight)| weight * pick(point)).sum()
        };
        let (r, theta) = (mix(|point| point.r), -mix(|point| point.theta));
        [r * theta.cos(), r * theta.sin(), mix(|point| point.z)]
    }
}

/// Returns the second derivatives at the knots of the natural cubic spline (Thomas algorithm).
fn natural_spline(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let (mut upper, mut right) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n - 1 {
        let (before, after) = (x[i] - x[i - 1], x[i + 1] - x[i]);
        let load = 6.0 * ((y[i + 1] - y[i]) / after - (y[i] - y[i - 1]) / before);
        let pivot = 2.0 * (before + after) - before * upper[i - 1];
        upper[i] = after / pivot;
        right[i] = (load - before * right[i - 1]) / pivot;
    }
    let mut curvature = vec![0.0; n];
    for i in (1..n - 1).rev() {
        curvature[i] = right[i] - upper[i] * curvature[i + 1];
    }
    curvature
}

fn evaluate_spline(x: &[f64], y: &[f64], curvature: &[f64], at: f64) -> f64 {
    let i = x[1..x.len() - 1].iter().take_while(|&&knot| knot <= at).count();
    let h = x[i + 1] - x[i];
    let (a, b) = ((x[i + 1] - at) / h, (at - x[i]) / h);
    a * y[i] + b * y[i + 1] + ((a.powi(3) - a) * curvature[i] + (b.powi(3) - b) * curvature[i + 1]) * h * h / 6.0
}

fn elements(counts: MeshCounts, numbers: &BTreeMap<[usize; 3], usize>) -> Vec<Element> {
    let kind = ElementKind::Hex20;
    let mut elements = Vec::with_capacity(counts.chord * counts.thickness * counts.span);
    for k in 0..counts.span {
        for j in 0..counts.thickness {
            for i in 0..counts.chord {
                let base = [2 * i, 2 * j, 2 * k];
                let node = |natural: &[f64; 3]| {
                    let place = core::array::from_fn(|d| match natural[d] {
                        x if x < 0.0 => base[d],
                        x if x > 0.0 => base[d] + 2,
                        _ => base[d] + 1,
                    });
                    numbers[&place]
                };
                elements.push(Element { kind, nodes: kind.natural_nodes().iter().map(node).collect() });
            }
        }
    }
    elements
}

fn node_sets(fine: [usize; 3], numbers: &BTreeMap<[usize; 3], usize>) -> BTreeMap<String, Vec<usize>> {
    let set = |direction: usize, value: usize| {
        let mut nodes: Vec<usize> =
            numbers.iter().filter(|(place, _)| place[direction] == value).map(|(_, &node)| node).collect();
        nodes.sort_unstable();
        nodes
    };
    BTreeMap::from([
        ("hub".to_owned(), set(2, 0)),
        ("tip".to_owned(), set(2, fine[2])),
        ("leading_edge".to_owned(), set(0, 0)),
        ("trailing_edge".to_owned(), set(0, fine[0])),
    ])
}
