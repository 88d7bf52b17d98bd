//! Surface of a model with the displacement of each of its points per reduced coordinate, for pictures.
//!
//! Only the corner nodes of the faces are kept, which draws a quadratic face as a plane one. A surface with more than
//! [`MAX_POINTS`] points is thinned: all nodes in one cell of a regular grid are represented by the node nearest to
//! the middle of the cell. Every point remains a node, so its displacement is that of the model.

use std::collections::{BTreeMap, BTreeSet};

use faer::{Mat, c64};
use nalgebra::{Complex, DMatrix};

use crate::mesh::{Mesh, surface_quads};

/// Largest number of points of a surface.
pub const MAX_POINTS: usize = 20_000;
/// Factor on the size of the cells until a surface has few enough points.
const COARSER: f64 = 1.1;

/// Smallest inner radius of a ring, as a fraction of its outer radius.
const THICKEST_RING: f64 = 0.5;
/// Factor by which the first cells of a thinned surface are finer than evenly spread points.
const FINEST: f64 = 6.0;

/// Surface of one sector or one structure, and its displacements.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceShapes {
    /// Undeformed positions (x, y, z) of the points (m).
    pub points: Vec<[f64; 3]>,
    /// Point indices (from 0) of the corners of all triangles and quadrilaterals, one after the other.
    pub corners: Vec<u32>,
    /// End of each face in `corners`.
    pub ends: Vec<u32>,
    /// Displacements of nodal diameter 0 and, for coupled sectors, of all others, ascending.
    pub diameters: Vec<DiameterShapes>,
}

/// Displacements of the points of a surface per reduced coordinate of one nodal diameter of a
/// [ROM](tiprub_core::Rom).
#[derive(Debug, Clone, PartialEq)]
pub struct DiameterShapes {
    /// Number of reduced coordinates.
    pub order: usize,
    /// Real parts of the displacements along x, y, z (m per unit coordinate), `[coordinate][point][axis]`.
    pub real: Vec<f32>,
    /// Imaginary parts in the same order; empty if all are zero.
    pub imaginary: Vec<f32>,
}

/// Surface of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Surface {
    /// Nodes of the mesh that are points of the surface.
    nodes: Vec<usize>,
    positions: Vec<[f64; 3]>,
    corners: Vec<u32>,
    ends: Vec<u32>,
}

impl Surface {
    /// Finds the surface of a mesh, without faces all of whose corners are in one of the sets `omitted`.
    pub(crate) fn new(mesh: &Mesh, omitted: &[BTreeSet<usize>]) -> Self {
        Self::with_at_most(mesh, omitted, MAX_POINTS)
    }

    fn with_at_most(mesh: &Mesh, omitted: &[BTreeSet<usize>], points: usize) -> Self {
        let mut faces = surface_quads(mesh);
        faces.retain(|face| !omitted.iter().any(|set| face.iter().all(|node| set.contains(node))));
        let used: BTreeSet<usize> = faces.iter().flatten().copied().collect();
        let nodes: Vec<usize> = used.into_iter().collect();
        let Merged { kept, corners, ends } =
            merged(faces.into_iter(), &thinned(&mesh.nodes, &nodes, points, 1.0, &|_| 0));
        Self { positions: kept.iter().map(|node| mesh.nodes[*node]).collect(), nodes: kept, corners, ends }
    }

    /// Creates the shapes from the displacements of the free dofs (3·node + component, ascending) per coordinate, `free
    /// dofs` × `coordinates`, or per coordinate of `turn`, `coordinates` × reduced coordinates.
    pub(crate) fn real(self, free: &[usize], transformation: &Mat<f64>, turn: Option<&DMatrix<f64>>) -> SurfaceShapes {
        let dofs = self.nodes.iter().flat_map(|node| (0..3).map(move |axis| 3 * node + axis));
        let rows: Vec<Option<usize>> = dofs.map(|dof| free.binary_search(&dof).ok()).collect();
        let own = Mat::from_fn(rows.len(), transformation.ncols(), |i, k| {
            rows[i].map_or(0.0, |row| transformation[(row, k)])
        });
        let own = match turn {
            None => own,
            Some(turn) => own * Mat::from_fn(turn.nrows(), turn.ncols(), |i, k| turn[(i, k)]),
        };
        let real = own.col_iter().flat_map(|column| column.iter().map(|value| single(*value)));
        let shapes = DiameterShapes { order: own.ncols(), real: real.collect(), imaginary: Vec::new() };
        self.with(vec![shapes])
    }

    /// Returns the displacements of the points from those of all nodes of the mesh for each coordinate, 3·points ×
    /// coordinates.
    pub(crate) fn moved(&self, shapes: &[Vec<[Complex<f64>; 3]>]) -> Mat<c64> {
        Mat::from_fn(3 * self.nodes.len(), shapes.len(), |row, k| {
            let value = shapes[k][self.nodes[row / 3]][row % 3];
            c64::new(value.re, value.im)
        })
    }

    /// Adds the displacements of every nodal diameter.
    pub(crate) fn with(self, diameters: Vec<DiameterShapes>) -> SurfaceShapes {
        SurfaceShapes { points: self.positions, corners: self.corners, ends: self.ends, diameters }
    }
}

impl DiameterShapes {
    /// Creates the shapes from the displacements, 3·points × coordinates.
    pub(crate) fn new(moved: &Mat<c64>, is_real: bool) -> Self {
        let part = |pick: fn(&c64) -> f64| -> Vec<f32> {
            moved.col_iter().flat_map(|column| column.iter().map(|value| single(pick(value)))).collect()
        };
        let imaginary = if is_real { Vec::new() } else { part(|value| value.im) };
        Self { order: moved.ncols(), real: part(|value| value.re), imaginary }
    }
}

impl SurfaceShapes {
    /// Returns the surface with at most `most` of its points, unchanged if it has no more. A point never represents points of the
    /// other side of a thin structure.
    #[must_use]
    pub fn thinned(self, most: usize) -> Self {
        if self.points.len() <= most {
            return self;
        }
        let all: Vec<usize> = (0..self.points.len()).collect();
        let (sides, positions) = (self.sides(), self.cell_positions());
        let Merged { kept, corners, ends } =
            merged(self.faces(), &thinned(&positions, &all, most, FINEST, &|point| sides[point]));
        let pick = |values: &[f32]| -> Vec<f32> {
            let coordinates = values.chunks_exact(3 * self.points.len());
            coordinates
                .flat_map(|own| kept.iter().flat_map(move |point| own[3 * point..][..3].iter().copied()))
                .collect()
        };
        let diameters = self.diameters.iter().map(|own| DiameterShapes {
            order: own.order,
            real: pick(&own.real),
            imaginary: pick(&own.imaginary),
        });
        let points = kept.iter().map(|point| self.points[*point]).collect();
        Self { points, corners, ends, diameters: diameters.collect() }
    }

    /// Returns the positions from which thinning finds the cells of points: radius, arc length and z (m) for a ring around the z
    /// axis, so that its cross-section is the same everywhere; otherwise x, y and z (m).
    fn cell_positions(&self) -> Vec<[f64; 3]> {
        let radii = self.points.iter().map(|[x, y, _]| x.hypot(*y));
        let [low, high] = radii.fold([f64::INFINITY, 0.0], |[low, high], r: f64| [low.min(r), high.max(r)]);
        if low < THICKEST_RING * high {
            return self.points.clone();
        }
        self.points.iter().map(|[x, y, z]| [x.hypot(*y), high * y.atan2(*x), *z]).collect()
    }

    /// Returns a number for the direction of the normal at each point: twice the axis (0 to 2) of its largest component, plus 1
    /// if this component is negative.
    fn sides(&self) -> Vec<u8> {
        let mut normals = vec![[0.0; 3]; self.points.len()];
        for face in self.faces() {
            let [a, b, c] = [0, 1, 2].map(|corner: usize| self.points[face[corner]]);
            let [u, v] = [b, c].map(|end| [0, 1, 2].map(|axis| end[axis] - a[axis]));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            for corner in face {
                normals[corner].iter_mut().zip(normal).for_each(|(sum, value)| *sum += value);
            }
        }
        let side = |normal: &[f64; 3]| {
            let axis = (0..3_u8).max_by(|a, b| {
                let [a, b] = [a, b].map(|axis| normal[usize::from(*axis)].abs());
                a.total_cmp(&b)
            });
            let axis = axis.unwrap_or(0);
            2 * axis + u8::from(normal[usize::from(axis)] < 0.0)
        };
        normals.iter().map(side).collect()
    }

    /// Returns the corners of each face.
    pub fn faces(&self) -> impl Iterator<Item = Vec<usize>> {
        let starts = core::iter::once(0).chain(self.ends.iter().copied());
        let ranges = starts.zip(&self.ends).map(|(start, end)| start as usize..*end as usize);
        ranges.map(|range| self.corners[range].iter().map(|corner| *corner as usize).collect())
    }
}

/// Faces of a thinned surface.
struct Merged {
    /// Points that remain, ascending.
    kept: Vec<usize>,
    /// Corners and ends as in [`SurfaceShapes`], over the points that remain.
    corners: Vec<u32>,
    ends: Vec<u32>,
}

/// Replaces the corners of faces by their representatives, and omits faces that collapse.
fn merged(faces: impl Iterator<Item = Vec<usize>>, representative: &BTreeMap<usize, usize>) -> Merged {
    let kept: BTreeSet<usize> = representative.values().copied().collect();
    let kept: Vec<usize> = kept.into_iter().collect();
    let index: BTreeMap<usize, u32> = kept.iter().copied().zip(0..).collect();
    let (mut corners, mut ends) = (Vec::new(), Vec::new());
    let mut end = 0;
    for face in faces {
        let mut around: Vec<u32> = face.iter().map(|node| index[&representative[node]]).collect();
        around.dedup();
        if around.len() > 1 && around.first() == around.last() {
            around.pop();
        }
        let distinct: BTreeSet<u32> = around.iter().copied().collect();
        if distinct.len() < 3 || distinct.len() != around.len() {
            continue;
        }
        end += if around.len() == 3 { 3 } else { 4 };
        corners.extend(around);
        ends.push(end);
    }
    Merged { kept, corners, ends }
}

/// Rounds to single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Returns the representative of each of these nodes, which is on the same `side`. There are at most `most` representatives. The
/// search starts with cells that are smaller by the factor `fineness` than the spacing of evenly spread points.
fn thinned(
    positions: &[[f64; 3]],
    nodes: &[usize],
    most: usize,
    fineness: f64,
    side: &dyn Fn(usize) -> u8,
) -> BTreeMap<usize, usize> {
    if nodes.len() <= most {
        return nodes.iter().map(|node| (*node, *node)).collect();
    }
    let extent = |axis: usize| {
        let values = nodes.iter().map(|node| positions[*node][axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    let extents = [0, 1, 2].map(extent);
    let largest = extents.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    // Coarser than the points of a surface would be if they were evenly spread over the largest two extents.
    let mut size = largest / (most as f64).sqrt() / fineness;
    loop {
        #[expect(clippy::cast_possible_truncation, reason = "cell indices are small")]
        let cell = |node: usize| [0, 1, 2].map(|axis| ((positions[node][axis] - extents[axis][0]) / size) as i64);
        let distance = |node: usize| {
            let cell = cell(node);
            let off = [0, 1, 2].map(|axis| positions[node][axis] - extents[axis][0] - (cell[axis] as f64 + 0.5) * size);
            off.iter().map(|x| x * x).sum::<f64>()
        };
        let mut nearest: BTreeMap<([i64; 3], u8), usize> = BTreeMap::new();
        for &node in nodes {
            let chosen = nearest.entry((cell(node), side(node))).or_insert(node);
            if distance(node) < distance(*chosen) {
                *chosen = node;
            }
        }
        if nearest.len() <= most {
            return nodes.iter().map(|node| (*node, nearest[&(cell(*node), side(*node))])).collect();
        }
        size *= COARSER;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::ElementKind;
    use crate::mesh::Element;

    /// Returns a plate of 20 × 20 × 1 bricks of 1 m.
    fn plate() -> Mesh {
        let (count, at) = (20, |i: usize, j: usize, k: usize| (i * 21 + j) * 2 + k);
        let mut mesh = Mesh::default();
        for i in 0..=count {
            for j in 0..=count {
                mesh.nodes.extend([0.0, 1.0].map(|z| [i as f64, j as f64, z]));
            }
        }
        for i in 0..count {
            for j in 0..count {
                let layer = |k| [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k)];
                mesh.elements.push(Element { kind: ElementKind::Hex8, nodes: [layer(0), layer(1)].concat() });
            }
        }
        mesh
    }

    #[test]
    fn thinned_surface_has_few_points_that_are_nodes() {
        let mesh = plate();
        let whole = Surface::new(&mesh, &[]);
        assert_eq!((whole.nodes.len(), whole.ends.len()), (mesh.nodes.len(), 2 * 400 + 80));
        let few = Surface::with_at_most(&mesh, &[], 200);
        assert!((100..=200).contains(&few.nodes.len()), "{}", few.nodes.len());
        let mut start = 0;
        for end in few.ends.iter().map(|end| *end as usize) {
            let corners: BTreeSet<u32> = few.corners[start..end].iter().copied().collect();
            assert!(corners.len() == end - start && (3..=4).contains(&corners.len()), "{corners:?}");
            start = end;
        }
        assert_eq!(start, few.corners.len());
        for (node, position) in few.nodes.iter().zip(&few.positions) {
            assert_eq!(mesh.nodes[*node].map(f64::to_bits), position.map(f64::to_bits));
        }
        for axis in [0, 1] {
            let values = few.positions.iter().map(|place| place[axis]);
            let [low, high] = values.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)]);
            assert!(low <= 2.0 && high >= 18.0, "{low} {high}");
        }
    }

    #[test]
    fn thinned_surface_keeps_the_displacements_of_its_points() {
        let surface = Surface::new(&plate(), &[]);
        let place = |point: &[f64; 3]| point.map(single);
        let real: Vec<f32> = surface.positions.iter().flat_map(place).collect();
        let twice: Vec<f32> = real.iter().map(|value| 2.0 * value).collect();
        let shapes = DiameterShapes { order: 2, real: [real.clone(), twice].concat(), imaginary: real };
        let all = surface.with(vec![shapes]);
        assert_eq!(all.clone().thinned(all.points.len()), all);
        let few = all.clone().thinned(300);
        assert!((150..=300).contains(&few.points.len()) && few.ends.len() < all.ends.len());
        // Both sides of the plate, which is thinner than the cells, remain.
        let thick = |point: &&[f64; 3]| point[2] > 0.5;
        let above = few.points.iter().filter(thick).count();
        assert!(above > 50 && few.points.len() - above > 50, "{above} of {}", few.points.len());
        let positions: Vec<f32> = few.points.iter().flat_map(place).collect();
        let [own] = &few.diameters[..] else { panic!("one nodal diameter") };
        let doubled: Vec<f32> = positions.iter().map(|value| 2.0 * value).collect();
        assert!(own.real == [positions.clone(), doubled].concat() && own.imaginary == positions);
        assert!(few.faces().flatten().all(|corner| corner < few.points.len()));
        assert_eq!(few.faces().count(), few.ends.len());
    }

    #[test]
    fn thinned_ring_has_the_same_cross_section_everywhere() {
        let [around, along] = [120_u32, 12_u32];
        let place = |k: u32, i: u32| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            let radius = 1.0 + 0.02 * f64::from(k % 2);
            [radius * angle.cos(), radius * angle.sin(), 0.02 * f64::from(k)]
        };
        let face = |k: u32, i: u32| {
            let next = (i + 1) % around;
            [k * around + i, k * around + next, (k + 1) * around + next, (k + 1) * around + i]
        };
        let corners: Vec<u32> = (0..along - 1).flat_map(|k| (0..around).flat_map(move |i| face(k, i))).collect();
        let ring = SurfaceShapes {
            points: (0..along).flat_map(|k| (0..around).map(move |i| place(k, i))).collect(),
            ends: (1..=(along - 1) * around).map(|face| 4 * face).collect(),
            corners,
            diameters: Vec::new(),
        };
        #[expect(clippy::cast_possible_truncation, reason = "micrometres")]
        let rounded = |value: f64| (1e6 * value).round() as i64;
        let few = ring.thinned(500);
        assert!((150..=500).contains(&few.points.len()), "{}", few.points.len());
        let rows: BTreeSet<[i64; 2]> = few.points.iter().map(|[x, y, z]| [x.hypot(*y), *z].map(rounded)).collect();
        assert!(rows.len() <= 12 && few.points.len() / rows.len() >= 20, "{} of {}", rows.len(), few.points.len());
    }

    #[test]
    fn omitted_faces_leave_their_shared_points() {
        let mesh = plate();
        let rim: BTreeSet<usize> = (0..mesh.nodes.len()).filter(|node| mesh.nodes[*node][0] == 0.0).collect();
        let open = Surface::new(&mesh, &[rim]);
        assert_eq!((open.nodes.len(), open.ends.len()), (mesh.nodes.len(), 2 * 400 + 60));
    }
}
