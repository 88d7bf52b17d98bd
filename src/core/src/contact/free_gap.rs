//! Gaps of a free master: every contact node against the open surface of its pair, all in the fixed frame.
//!
//! A node stands at x = X + u, rigid flight included, and meets the closest point of its surface: g = (x − S)·n with
//! n = S_t × S_s/|S_t × S_s|. A node beyond a free edge has nothing to touch, and so has one that belongs to no pair: their
//! gap is infinite and their normal zero.

use super::gap::{Geometry, dot};
use super::spline::{ClosestPoint, Projection, SurfaceSpline};
use super::spline_gap::NOTHING_TO_TOUCH;

/// Displacements and penetrations beyond this share of the extent of the contact nodes are not small.
const SMALL_FRACTION: f64 = 0.1;

/// A surface through the open contact grid of a structure.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenSurface {
    /// The surface as it is now.
    pub surface: SurfaceSpline,
    /// Which of the carriers deforms it; `None` for a rigid surface.
    pub carrier: Option<usize>,
    /// Control points undeformed (m).
    undeformed: Vec<[f64; 3]>,
    /// Control points in use.
    control: Vec<[f64; 3]>,
}

impl OpenSurface {
    /// Undeformed.
    pub fn new(surface: SurfaceSpline, carrier: Option<usize>) -> Self {
        let undeformed = surface.control_points().to_vec();
        Self { surface, carrier, control: undeformed.clone(), undeformed }
    }

    /// Displace the control points by `moved` (m, three per control point).
    pub fn follow(&mut self, moved: &[f64]) {
        let (moved, _) = moved.as_chunks::<3>();
        for ((point, undeformed), moved) in self.control.iter_mut().zip(&self.undeformed).zip(moved) {
            *point = std::array::from_fn(|i| undeformed[i] + moved[i]);
        }
        self.surface.set_control_points(&self.control);
    }
}

/// Contact nodes of a free structure facing open surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeGap {
    /// Undeformed positions of the contact nodes (m).
    positions: Vec<[f64; 3]>,
    /// Surface that each node meets; `None` for nodes of no pair.
    surface_of: Vec<Option<usize>>,
    /// The surfaces.
    pub surfaces: Vec<OpenSurface>,
    /// Largest displacement that counts as small (m).
    largest: f64,
}

impl FreeGap {
    /// Nodes at `positions` (m), each against the surface of this index.
    pub fn new(positions: Vec<[f64; 3]>, surface_of: Vec<Option<usize>>, surfaces: Vec<OpenSurface>) -> Self {
        let of = |surface: &OpenSurface| extent(surface.surface.control_points());
        let smallest = surfaces.iter().map(of).fold(extent(&positions), f64::min);
        Self { positions, surface_of, surfaces, largest: SMALL_FRACTION * smallest }
    }

    /// Number of contact nodes.
    pub fn nodes(&self) -> usize {
        self.positions.len()
    }

    /// Index of the surface that a node meets.
    pub fn surface_of(&self, node: usize) -> Option<usize> {
        self.surface_of[node]
    }

    /// Largest displacement and penetration that count as small (m): a tenth of the smallest extent of the contact nodes
    /// of master and slaves.
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// Undeformed position of a node (m).
    pub fn position(&self, node: usize) -> [f64; 3] {
        self.positions[node]
    }

    /// The point of the surface at the place that a node meets (m); the node itself if it belongs to no pair.
    pub fn contact_point(&self, node: usize, place: ClosestPoint) -> [f64; 3] {
        let surface = self.surface_of[node].map(|index| &self.surfaces[index].surface);
        surface.map_or(self.positions[node], |surface| surface.evaluate(place).point)
    }

    /// Gaps (m), normals and places of all nodes for the displacements of the contact rows (m); closest points are sought
    /// from `guess`, or from the nearest data point.
    pub fn evaluate(
        &self,
        displacement: &[f64],
        guess: Option<&[ClosestPoint]>,
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
        for (node, gap) in gap.iter_mut().enumerate() {
            let Some(index) = self.surface_of[node] else {
                *gap = NOTHING_TO_TOUCH;
                continue;
            };
            let surface = &self.surfaces[index].surface;
            let point = std::array::from_fn(|i| self.positions[node][i] + displacement[3 * node + i]);
            let start = guess.map_or_else(|| surface.locate(point), |places| places[node]);
            let mut found = surface.project(point, start);
            if found == Projection::Lost {
                found = surface.project(point, surface.locate(point));
            }
            let (value, place, normal) = match found {
                Projection::Found { place, normal, gap, .. } => (gap, place, normal),
                Projection::BeyondEdge { place } => (NOTHING_TO_TOUCH, place, [0.0; 3]),
                // Found out by the caller: the state is not what the model describes any more.
                Projection::Lost => (f64::NAN, start, [0.0; 3]),
            };
            *gap = value;
            geometry.places[node] = place;
            for (component, value) in normal.into_iter().enumerate() {
                geometry.normal[component][node] = value;
            }
        }
    }

    /// Whether the contact nodes have moved against each other by more than what counts as small: displacements less
    /// their mean.
    pub fn is_distorted(&self, displacement: &[f64]) -> bool {
        let (moved, _) = displacement.as_chunks::<3>();
        #[expect(clippy::cast_precision_loss, reason = "node counts are far below 2^52")]
        let share = 1.0 / moved.len() as f64;
        (0..3).any(|i| {
            let mean = share * moved.iter().map(|moved| moved[i]).sum::<f64>();
            moved.iter().any(|moved| (moved[i] - mean).abs() > self.largest)
        })
    }
}

/// Longest side of the box around points (m).
fn extent(points: &[[f64; 3]]) -> f64 {
    let side = |i: usize| {
        let values = || points.iter().map(|point| point[i]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// Unit tangent along a velocity (m/s); zero when nothing slides.
#[inline(always)]
pub fn tangent(velocity: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let along = dot(velocity, normal);
    let tangent: [f64; 3] = std::array::from_fn(|i| velocity[i] - along * normal[i]);
    let length = dot(tangent, tangent).sqrt();
    if length > 0.0 { tangent.map(|value| value / length) } else { [0.0; 3] }
}
