//! Structured mesh of a casing ring: a shell along the contour, with a flange on the outside at each end.
//!
//! Nodes lie on a grid of (radial, circumferential, axial) stations with twice the element counts; hex8 elements use
//! the even ones. Radial offsets are measured from the inner contour, so that all layers are parallel to it.

use core::f64::consts::TAU;
use std::collections::BTreeMap;

use tiprub_cosim::shown;

use super::contour::InnerContour;
use super::grid::GridNodes;
use crate::element::ElementKind;
use crate::mesh::{Element, Mesh};
use crate::{Error, Result};

/// Axial positions closer than this fraction of the length coincide.
const SAME: f64 = 1e-9;

/// Flange: a thickened end of the ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flange {
    /// Length along the axis (m).
    pub thickness: f64,
    /// Radial height over the outer surface of the shell (m).
    pub height: f64,
}

/// Geometry of a casing ring.
#[derive(Debug, Clone, PartialEq)]
pub struct RingGeometry {
    /// Inner contour over the whole length.
    pub contour: InnerContour,
    /// Radial thickness of the shell (m).
    pub thickness: f64,
    /// Flanges at the low and the high end of z.
    pub flanges: [Option<Flange>; 2],
}

/// Numbers of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RingCounts {
    /// Around the circumference; a multiple of the number of contact nodes around.
    pub around: usize,
    /// Through the shell.
    pub through: usize,
    /// Along the axis: divided between flanges and contact rings by length, at least one for each part.
    pub along: usize,
    /// Along the height of a flange.
    pub flange: usize,
}

/// Rings of contact nodes on the inner surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactRings {
    /// Contact nodes around the circumference (at least 4).
    pub around: usize,
    /// Rings along the axis (at least 2), evenly spaced.
    pub along: usize,
    /// Axial positions of the first and the last ring (m).
    pub axial: [f64; 2],
}

/// Mesh of a ring with its contact nodes.
#[derive(Debug, Clone)]
pub struct RingMesh {
    /// Elements of one kind; node sets `inner`, `outer`, `low_face` and `high_face` (end faces, flanges included).
    pub mesh: Mesh,
    /// The contact nodes.
    pub grid: GridNodes,
}

impl RingGeometry {
    /// Checks thickness and flanges.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the length.
    pub(crate) fn validate(&self) -> Result<()> {
        let [low, high] = self.contour.axial();
        let positive = |what: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(Error::invalid(
                format!("casing, {what}"),
                format!("{} m is not positive", shown(value)),
                "Give a positive length in m",
            ))
        };
        positive("thickness", self.thickness)?;
        for flange in self.flanges.iter().flatten() {
            positive("flange thickness", flange.thickness)?;
            positive("flange height", flange.height)?;
        }
        let taken: f64 = self.flanges.iter().flatten().map(|flange| flange.thickness).sum();
        if taken >= high - low {
            let problem = format!(
                "the flanges are {} m thick in total, but the casing is only {} m long",
                shown(taken),
                shown(high - low)
            );
            return Err(Error::invalid("casing, flange thickness", problem, "Give thinner flanges or a longer casing"));
        }
        Ok(())
    }
}

/// Builds the mesh of a ring.
///
/// # Errors
/// [`Error::Invalid`] for inconsistent lengths, counts and contact rings, or an element kind other than hex8 and
/// hex20.
pub fn ring_mesh(
    geometry: &RingGeometry,
    counts: RingCounts,
    rings: ContactRings,
    kind: ElementKind,
) -> Result<RingMesh> {
    geometry.validate()?;
    check_counts(counts, rings, kind)?;
    let contact = contact_positions(geometry, rings)?;
    let lattice = StationGrid::new(geometry, counts, &contact);
    let mut mesh = Mesh::default();
    let mut numbers = BTreeMap::new();
    for cell in lattice.cells() {
        let place = |natural: &[f64; 3]| lattice.place(cell, *natural);
        let mut nodes: Vec<usize> = Vec::with_capacity(kind.node_count());
        for natural in kind.natural_nodes() {
            let next = numbers.len();
            let number = *numbers.entry(place(natural)).or_insert(next);
            if number == next {
                mesh.nodes.push(lattice.position(geometry, place(natural)));
            }
            nodes.push(number);
        }
        mesh.elements.push(Element { kind, nodes });
    }
    mesh.sets = lattice.sets(&numbers);
    let stations: Vec<usize> = contact.iter().map(|z| lattice.station(*z)).collect();
    let step = 2 * counts.around / rings.around;
    let nodes = stations.iter().flat_map(|&k| (0..rings.around).map(move |i| [0, step * i, k]));
    let grid = GridNodes {
        around: rings.around,
        nodes: nodes.map(|place| numbers[&place]).collect(),
        slopes: contact.iter().map(|z| geometry.contour.slope(*z)).collect(),
        points: Vec::new(),
    };
    Ok(RingMesh { mesh, grid })
}

fn check_counts(counts: RingCounts, rings: ContactRings, kind: ElementKind) -> Result<()> {
    let RingCounts { around, through, along, flange } = counts;
    for (name, count) in [("around", around), ("through", through), ("along", along), ("flange", flange)] {
        if count == 0 {
            let remedy = "Give at least one element in every direction";
            return Err(Error::invalid(format!("casing, element count `{name}`"), "it is zero", remedy));
        }
    }
    if !matches!(kind, ElementKind::Hex8 | ElementKind::Hex20) {
        let problem = format!("{} is neither hex8 nor hex20", kind.calculix_name());
        return Err(Error::invalid("casing, element kind", problem, "Choose hex20"));
    }
    if rings.around < 4 || rings.along < 2 {
        let problem = format!("{} around and {} along are too few", rings.around, rings.along);
        return Err(Error::invalid("casing, contact nodes", problem, "Give at least 4 around and 2 along"));
    }
    if !around.is_multiple_of(rings.around) {
        let next = around.div_ceil(rings.around) * rings.around;
        let problem = format!("{around} is not a multiple of the {} contact nodes around", rings.around);
        let remedy = format!("Give {next} elements around, or another number of contact nodes");
        return Err(Error::invalid("casing, element count `around`", problem, remedy));
    }
    Ok(())
}

/// Returns the axial positions of the contact rings.
fn contact_positions(geometry: &RingGeometry, rings: ContactRings) -> Result<Vec<f64>> {
    let ([low, high], [first, last]) = (geometry.contour.axial(), rings.axial);
    // Written so that NaN is rejected, too.
    if !(first > low && first < last && last < high) {
        let problem = {
            let [first, last, low, high] = [first, last, low, high].map(shown);
            format!("{first} m to {last} m is not an ascending range inside the casing ({low} m to {high} m)")
        };
        return Err(Error::invalid("casing, axial positions of the contact rings", problem, "Choose positions inside"));
    }
    let share = |k: usize| k as f64 / (rings.along - 1) as f64;
    Ok((0..rings.along).map(|k| if k + 1 == rings.along { last } else { first + (last - first) * share(k) }).collect())
}

/// Grid of stations.
struct StationGrid {
    /// Offsets from the inner contour (m), two per element.
    radial: Vec<f64>,
    /// Elements through the shell.
    through: usize,
    /// Elements around.
    around: usize,
    /// Axial positions (m), two per element.
    axial: Vec<f64>,
    /// Flange of each axial row of elements, if any.
    flanged: Vec<Option<usize>>,
    /// Radial offsets of the two flanges, two per element.
    flange_radial: [Vec<f64>; 2],
}

impl StationGrid {
    fn new(geometry: &RingGeometry, counts: RingCounts, contact: &[f64]) -> Self {
        let [low, high] = geometry.contour.axial();
        let inner = [
            geometry.flanges[0].map_or(low, |flange| low + flange.thickness),
            geometry.flanges[1].map_or(high, |flange| high - flange.thickness),
        ];
        // Positions that a row of elements must not cross.
        let mut edges = vec![low, inner[0], inner[1], high];
        edges.extend_from_slice(contact);
        edges.sort_by(f64::total_cmp);
        let slack = SAME * (high - low);
        edges.dedup_by(|b, a| *b - *a < slack);
        let mut axial = vec![low];
        for pair in edges.windows(2) {
            let rows = rows_of(pair[1] - pair[0], high - low, counts.along);
            divide(&mut axial, pair[1], 2 * rows);
        }
        let flanged = (0..(axial.len() - 1) / 2).map(|row| match axial[2 * row + 1] {
            middle if middle < inner[0] => Some(0),
            middle if middle > inner[1] => Some(1),
            _ => None,
        });
        let flanged = flanged.collect();
        let mut radial = vec![0.0];
        divide(&mut radial, geometry.thickness, 2 * counts.through);
        let flange_radial = geometry.flanges.map(|flange| {
            let mut offsets = radial.clone();
            if let Some(flange) = flange {
                divide(&mut offsets, geometry.thickness + flange.height, 2 * counts.flange);
            }
            offsets
        });
        Self { radial, through: counts.through, around: counts.around, axial, flanged, flange_radial }
    }

    /// Iterates over the (radial, circumferential, axial) index of every element.
    fn cells(&self) -> impl Iterator<Item = [usize; 3]> {
        (0..self.flanged.len()).flat_map(move |k| {
            let layers = self.flanged[k].map_or(self.through, |end| (self.flange_radial[end].len() - 1) / 2);
            (0..self.around).flat_map(move |i| (0..layers).map(move |j| [j, i, k]))
        })
    }

    /// Returns the station of a node of an element.
    fn place(&self, [j, i, k]: [usize; 3], natural: [f64; 3]) -> [usize; 3] {
        let base = [2 * j, 2 * i, 2 * k];
        let [radial, around, axial] = core::array::from_fn(|d| match natural[d] {
            x if x < 0.0 => base[d],
            x if x > 0.0 => base[d] + 2,
            _ => base[d] + 1,
        });
        [radial, around % (2 * self.around), axial]
    }

    fn position(&self, geometry: &RingGeometry, [j, i, k]: [usize; 3]) -> [f64; 3] {
        let row = (k / 2).min(self.flanged.len() - 1);
        // A station between two rows belongs to the row with the larger radial extent.
        let ends = [self.flanged[row], if k % 2 == 0 && k > 0 { self.flanged[k / 2 - 1] } else { None }];
        let offset = match self.radial.get(j) {
            Some(offset) => *offset,
            None => ends.iter().flatten().find_map(|end| self.flange_radial[*end].get(j)).copied().unwrap_or_default(),
        };
        let z = self.axial[k];
        let radius = geometry.contour.radius(z) + offset;
        let angle = TAU * i as f64 / (2 * self.around) as f64;
        [radius * angle.cos(), radius * angle.sin(), z]
    }

    /// Returns the station of an edge between rows of elements.
    fn station(&self, z: f64) -> usize {
        let slack = SAME * (self.axial[self.axial.len() - 1] - self.axial[0]);
        self.axial.partition_point(|station| *station < z - slack)
    }

    fn sets(&self, numbers: &BTreeMap<[usize; 3], usize>) -> BTreeMap<String, Vec<usize>> {
        let set = |inside: &dyn Fn([usize; 3]) -> bool| {
            let mut nodes: Vec<usize> =
                numbers.iter().filter(|(place, _)| inside(**place)).map(|(_, node)| *node).collect();
            nodes.sort_unstable();
            nodes
        };
        let last = self.axial.len() - 1;
        BTreeMap::from([
            ("inner".to_owned(), set(&|[j, _, _]| j == 0)),
            ("outer".to_owned(), set(&|[j, _, _]| j == 2 * self.through)),
            ("low_face".to_owned(), set(&|[_, _, k]| k == 0)),
            ("high_face".to_owned(), set(&|[_, _, k]| k == last)),
        ])
    }
}

/// Returns the number of rows of elements in a part of a length.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive and below the count asked for")]
fn rows_of(part: f64, whole: f64, rows: usize) -> usize {
    ((rows as f64 * part / whole).round() as usize).max(1)
}

/// Appends `count` even divisions up to `end`.
fn divide(stations: &mut Vec<f64>, end: f64, count: usize) {
    let start = stations[stations.len() - 1];
    for i in 1..count {
        stations.push(start + (end - start) * i as f64 / count as f64);
    }
    stations.push(end);
}
