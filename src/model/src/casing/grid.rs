//! Contact nodes of a casing as a grid of rings: at nodes of the mesh, or between them on its faces.

use core::f64::consts::TAU;

use tiprub_core::scene::rom::{ContactGrid, ContactNode};

use crate::inner_surface::{InnerSurface, SurfacePoint};
use crate::mesh::Mesh;
use crate::reduce::ContactPoint;
use crate::{Error, Result};

/// Nodes of a mesh that form rings: node `along · around + i` is the i-th of ring `along`, rings by ascending z,
/// nodes of a ring by ascending angle.
#[derive(Debug, Clone, PartialEq)]
pub struct GridNodes {
    /// Number of nodes per ring.
    pub around: usize,
    /// Node indices of the mesh (from 0), ring by ring; for points between nodes, the node with the largest weight.
    pub nodes: Vec<usize>,
    /// Slope dr/dz of the inner surface at each ring.
    pub slopes: Vec<f64>,
    /// Points of the grid on the faces of the mesh; empty if all of them are nodes.
    pub points: Vec<SurfacePoint>,
}

/// Tolerance of a grid position, as a fraction of the distance between neighbours on a ring.
const TOLERANCE: f64 = 1e-3;
/// A point is clamped if the largest weight of its movable nodes is at most this value.
const CLAMPED: f64 = 0.01;

impl GridNodes {
    /// Sorts nodes into `along` rings by z, and the nodes of a ring by angle. Slopes are those of the parabola
    /// through the mean radii of a ring and its neighbours.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the nodes do not exist or cannot be divided evenly. The validation of the ROM checks
    /// whether they form a grid.
    pub fn sorted(mesh: &Mesh, nodes: &[usize], along: usize) -> Result<Self> {
        if along < 2 || !nodes.len().is_multiple_of(along) || nodes.len() / along < 4 {
            return Err(Error::invalid(
                "contact nodes of the casing",
                format!("{} nodes cannot be divided into {along} rings of at least 4 nodes", nodes.len()),
                "Give at least two rings with the same number of nodes each",
            ));
        }
        if let Some(node) = nodes.iter().find(|node| **node >= mesh.nodes.len()) {
            let problem = format!("node {} does not exist; the mesh has {} nodes", node + 1, mesh.nodes.len());
            return Err(Error::invalid("contact nodes of the casing", problem, "Choose nodes of the mesh"));
        }
        let around = nodes.len() / along;
        let mut sorted = nodes.to_vec();
        sorted.sort_by(|a, b| mesh.nodes[*a][2].total_cmp(&mesh.nodes[*b][2]));
        let quarter = 0.25 * TAU / around as f64;
        let angle = |node: usize| mesh.nodes[node][1].atan2(mesh.nodes[node][0]);
        // Angles start a quarter of a step before zero, so that rounding moves no node at zero to the end of its
        // ring.
        let smallest = sorted[..around].iter().map(|node| (angle(*node) + quarter).rem_euclid(TAU)).fold(TAU, f64::min);
        for ring in sorted.chunks_mut(around) {
            // Shift that places nodes at the angle of the first node of the first ring at half a step.
            let place = |node: usize| (angle(node) - smallest + 3.0 * quarter).rem_euclid(TAU);
            ring.sort_by(|a, b| place(*a).total_cmp(&place(*b)));
        }
        let mut grid = Self { around, nodes: sorted, slopes: Vec::new(), points: Vec::new() };
        grid.slopes = grid.parabolic_slopes(mesh);
        Ok(grid)
    }

    /// Chooses a grid on the surface whose nodes are the `set`; the `clamped` ones of them (ascending) cannot move.
    /// It has `along` rings, evenly spaced from the axial position `axial[0]` to `axial[1]` (m; by default the first
    /// and the last of the movable nodes), and `around` points at equal angles. If the mesh has a node at each
    /// position, these nodes are used: rings at the nodes nearest to their axial positions, angles from the smallest
    /// angle on. Otherwise angles count from zero, and points lie on the faces of the [`InnerSurface`].
    ///
    /// # Errors
    /// [`Error::Invalid`] for a grid that is too small; the errors of [`InnerSurface`].
    pub fn chosen(
        mesh: &Mesh,
        (set, clamped): (&[usize], &[usize]),
        [around, along]: [usize; 2],
        axial: Option<[f64; 2]>,
    ) -> Result<Self> {
        let what = "contact grid of the casing";
        if around < 4 || along < 2 {
            let problem = format!("{around} points around and {along} along are too few");
            return Err(Error::invalid(what, problem, "Request at least 4 x 2"));
        }
        if let Some(node) = set.iter().find(|node| **node >= mesh.nodes.len()) {
            let problem = format!("node {} does not exist; the mesh has {} nodes", node + 1, mesh.nodes.len());
            return Err(Error::invalid(what, problem, "Choose nodes of the mesh"));
        }
        let free: Vec<usize> = set.iter().copied().filter(|node| clamped.binary_search(node).is_err()).collect();
        let heights = free.iter().map(|&node| mesh.nodes[node][2]);
        let ends = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
        let [from, to] = axial.unwrap_or(ends);
        let heights: Vec<f64> = (0..along).map(|ring| from + (to - from) * ring as f64 / (along - 1) as f64).collect();
        let (nodes, points) = match Self::nodes_at(mesh, &free, around, &heights) {
            Some(nodes) => (nodes, Vec::new()),
            None => Self::points_at(mesh, (set, clamped), around, &heights)?,
        };
        let mut grid = Self { around, nodes, slopes: Vec::new(), points };
        grid.slopes = grid.parabolic_slopes(mesh);
        Ok(grid)
    }

    /// Returns the nodes of a grid if there is a different node at each position.
    fn nodes_at(mesh: &Mesh, nodes: &[usize], around: usize, heights: &[f64]) -> Option<Vec<usize>> {
        let angle = |node: usize| mesh.nodes[node][1].atan2(mesh.nodes[node][0]);
        let height = |node: usize| mesh.nodes[node][2];
        let step = TAU / around as f64;
        let first =
            nodes.iter().map(|node| (angle(*node) + 1e-3 * step).rem_euclid(TAU)).fold(TAU, f64::min) - 1e-3 * step;
        let mut chosen = Vec::with_capacity(around * heights.len());
        for wanted in heights {
            let off = |node: &usize| (height(*node) - wanted).abs();
            let nearest = nodes.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            let level = nearest.map_or(*wanted, |node| height(*node));
            for place in 0..around {
                let target = first + step * place as f64;
                let miss = |node: &usize| {
                    let turned = (angle(*node) - target + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
                    let [x, y, z] = mesh.nodes[*node];
                    (turned * x.hypot(y)).hypot(z - level)
                };
                let node = nodes.iter().copied().min_by(|a, b| miss(a).total_cmp(&miss(b)))?;
                let radius = mesh.nodes[node][0].hypot(mesh.nodes[node][1]);
                if miss(&node) > TOLERANCE * step * radius {
                    return None;
                }
                chosen.push(node);
            }
        }
        let mut distinct = chosen.clone();
        distinct.sort_unstable();
        distinct.dedup();
        (distinct.len() == chosen.len()).then_some(chosen)
    }

    /// Returns the points of a grid on the faces of the mesh, each with its node.
    fn points_at(
        mesh: &Mesh,
        (set, clamped): (&[usize], &[usize]),
        around: usize,
        heights: &[f64],
    ) -> Result<(Vec<usize>, Vec<SurfacePoint>)> {
        let surface = InnerSurface::find(mesh, Some(set), Some([heights[0], heights[heights.len() - 1]]))?;
        let step = TAU / around as f64;
        let radius = surface.radius();
        let (mut nodes, mut points) = (Vec::new(), Vec::new());
        for &height in heights {
            for place in 0..around {
                let mut point = surface.point(step * place as f64, height, TOLERANCE * step * radius)?;
                // Clamped nodes do not move; the other nodes of the face keep their weights in the force.
                point.weights.retain(|(node, _)| clamped.binary_search(node).is_err());
                let largest = point.weights.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
                let Some(&(node, _)) = largest.filter(|(_, weight)| weight.abs() > CLAMPED) else {
                    let degrees = (step * place as f64).to_degrees();
                    let problem = format!("the point at {degrees:.3}° and z = {height:.6} m lies on clamped nodes");
                    let remedy = "Give axial positions away from the clamped nodes (--contact-axial)";
                    return Err(Error::invalid("contact grid of the casing", problem, remedy));
                };
                nodes.push(node);
                points.push(point);
            }
        }
        Ok((nodes, points))
    }

    /// Returns the position (x, y, z) of each point of the grid (m).
    pub fn positions(&self, mesh: &Mesh) -> Vec<[f64; 3]> {
        if self.points.is_empty() {
            return self.nodes.iter().map(|&node| mesh.nodes[node]).collect();
        }
        self.points.iter().map(|point| point.position).collect()
    }

    /// Checks that nodes and slopes fill whole rings.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the counts.
    pub(crate) fn validate(&self) -> Result<()> {
        let whole = self.around > 0
            && self.nodes.len().is_multiple_of(self.around)
            && (self.points.is_empty() || self.points.len() == self.nodes.len());
        if whole && self.slopes.len() == self.along() {
            return Ok(());
        }
        let problem =
            format!("{} nodes and {} slopes do not fit rings of {}", self.nodes.len(), self.slopes.len(), self.around);
        Err(Error::invalid(
            "contact nodes of the casing",
            problem,
            "Give all nodes of every ring and one slope per ring",
        ))
    }

    /// Returns the number of rings.
    pub fn along(&self) -> usize {
        self.nodes.len() / self.around
    }

    /// Returns the shape of the grid for the ROM.
    pub(crate) fn shape(&self) -> ContactGrid {
        ContactGrid { around: self.around, along: self.along(), closed: true }
    }

    /// Returns the contact nodes in the cylindrical frame.
    pub(crate) fn contact_nodes(&self, mesh: &Mesh) -> Vec<ContactNode> {
        let node = |(index, [x, y, z]): (usize, [f64; 3])| {
            let meridional_slope = self.slopes[index / self.around];
            ContactNode {
                name: self.name(index),
                position: [x.hypot(y), y.atan2(x), z],
                meridional_slope,
                ..ContactNode::default()
            }
        };
        self.positions(mesh).into_iter().enumerate().map(node).collect()
    }

    /// Returns the contact nodes before the reduction; points between nodes become patches of the nodes of their
    /// faces.
    pub fn contact_points(&self) -> Vec<ContactPoint> {
        let slope = |index: usize| self.slopes[index / self.around];
        let point = |(index, node): (usize, &usize)| ContactPoint {
            patch: self.points.get(index).map_or(Vec::new(), |point| point.weights.clone()),
            ..ContactPoint::at(self.name(index), *node, slope(index))
        };
        self.nodes.iter().enumerate().map(point).collect()
    }

    /// Returns the name of the contact node with the given index: `ring_1_node_1`, ...
    pub(crate) fn name(&self, index: usize) -> String {
        format!("ring_{}_node_{}", index / self.around + 1, index % self.around + 1)
    }

    /// Returns the mean z and r of every ring.
    fn rings(&self, mesh: &Mesh) -> Vec<[f64; 2]> {
        let mean = |ring: &[[f64; 3]], value: &dyn Fn([f64; 3]) -> f64| {
            ring.iter().map(|point| value(*point)).sum::<f64>() / ring.len() as f64
        };
        let ring = |ring: &[[f64; 3]]| [mean(ring, &|[_, _, z]| z), mean(ring, &|[x, y, _]| x.hypot(y))];
        self.positions(mesh).chunks(self.around).map(ring).collect()
    }

    fn parabolic_slopes(&self, mesh: &Mesh) -> Vec<f64> {
        let rings = self.rings(mesh);
        let secants: Vec<f64> =
            rings.windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).collect();
        let last = secants.len() - 1;
        if last == 0 {
            return vec![secants[0]; 2];
        }
        let length = |i: usize| rings[i + 1][0] - rings[i][0];
        let inner = |i: usize| (secants[i - 1] * length(i) + secants[i] * length(i - 1)) / (length(i - 1) + length(i));
        let slope = |i: usize| match i {
            0 => 2.0 * secants[0] - inner(1),
            i if i > last => 2.0 * secants[last] - inner(last),
            i => inner(i),
        };
        (0..rings.len()).map(slope).collect()
    }
}
