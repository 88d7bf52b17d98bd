//! Gaps of structures described in fixed directions: contact nodes against a surface through a contact grid.
//!
//! A node is at x = X + u, which includes the rigid flight, and can touch the closest point of its surface: g = (x − S)·n with n = S_t ×
//! S_s/|S_t × S_s|. A node beyond a free edge has no surface to touch: its gap is infinite and its normal zero.

use super::surface_spline::{ClosestPoint, Projection, SurfaceSpline};
use super::{Gap, Geometry, Vector3};
use crate::math::real;
use crate::math::vector::{length, vector3_at};
use crate::scene::ranges::SMALL;

/// [`OpenGap::clearance`] as a fraction of the largest displacement that counts as small.
const CLEARANCE: f64 = 1e-2;

/// Largest distance of a node behind a surface that is continued beyond its edge: as a fraction of the path of the node in the step, since
/// the surface may be curved, and of the largest small displacement.
const BEHIND_EDGE: [f64; 2] = [1e-3, 1e-6];

/// Contact nodes described in fixed directions, facing a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenGap {
    /// Undeformed positions of the contact nodes of the structure (m).
    pub(crate) positions: Vec<Vector3>,
    /// Contact nodes that can touch the surface.
    pub(crate) nodes: Vec<usize>,
    /// Current surface through the contact grid of a structure, in fixed directions.
    pub surface: SurfaceSpline,
    /// Undeformed control points (m).
    undeformed: Vec<Vector3>,
    /// Largest displacement and penetration that count as small (m): a tenth of the smallest extent of the contact
    /// nodes and of their surfaces.
    pub largest: f64,
}

impl OpenGap {
    /// Creates the gap function of `nodes` of the contact nodes at `positions` (m).
    pub fn new(positions: Vec<Vector3>, nodes: Vec<usize>, surface: SurfaceSpline) -> Self {
        let undeformed = surface.control_points().to_vec();
        let smallest = extent(&undeformed).min(extent(&positions));
        Self { positions, nodes, surface, undeformed, largest: SMALL * smallest }
    }

    /// Includes the extent of the undeformed `surface` of another pair of the same structure in the limit of small
    /// displacements.
    pub fn beside(self, surface: &SurfaceSpline) -> Self {
        Self { largest: self.largest.min(SMALL * extent(surface.control_points())), ..self }
    }

    /// Displaces the control points by `moved` (m, three per control point; empty for a rigid surface).
    pub(super) fn follow(&mut self, moved: &[f64]) {
        if !moved.is_empty() {
            self.surface.set_control_points(|index| self.undeformed[index] + vector3_at(moved, index));
        }
    }

    /// Returns the point of the surface at a closest point (m).
    pub fn contact_point(&self, place: ClosestPoint) -> Vector3 {
        self.surface.evaluate(place).point
    }

    /// See [`super::GapLaw::evaluate`]; without a `guess` the search starts from the nearest data point.
    pub fn evaluate(
        &mut self,
        displacement: &[f64],
        moved: &[f64],
        guess: Option<&[ClosestPoint]>,
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
        self.follow(moved);
        for &node in &self.nodes {
            let found = self.gap(node, vector3_at(displacement, node), guess.map(|places| places[node]));
            (gap[node], geometry.places[node]) = (found.distance, found.foot);
            geometry.set_normal(node, found.normal);
        }
    }

    /// Returns the gap of one node displaced by `moved` (m) to the current surface. The caller detects a NaN gap: the model no longer
    /// describes such a state.
    pub(super) fn gap(&self, node: usize, moved: Vector3, guess: Option<ClosestPoint>) -> Gap {
        let surface = &self.surface;
        let point = self.positions[node] + moved;
        let start = guess.unwrap_or_else(|| surface.locate(point));
        let mut found = surface.project(point, start);
        if found == Projection::Lost {
            found = surface.project(point, surface.locate(point));
        }
        match found {
            Projection::Found { gap, .. } => gap,
            Projection::BeyondEdge { place } => Gap { foot: place, ..Gap::NOTHING },
            Projection::Lost => Gap { distance: f64::NAN, foot: start, ..Gap::NOTHING },
        }
    }

    /// Returns the length that replaces the clearance, which free bodies do not have: a thousandth of the smallest extent (m).
    pub(super) fn clearance(&self) -> f64 {
        CLEARANCE * self.largest
    }

    /// Returns whether a node with the current gap (m) was behind the surface, continued beyond its edge, before it moved by `moved`
    /// relative to it (m).
    pub(crate) fn was_behind(&self, moved: Vector3, normal: Vector3, gap: f64) -> bool {
        let (approach, travel) = (moved.dot(&normal), length(moved));
        gap - approach < -(BEHIND_EDGE[0] * travel + BEHIND_EDGE[1] * self.largest)
    }

    /// Returns whether the contact nodes have moved relative to each other by more than small displacements: displacements minus their
    /// mean.
    pub(crate) fn is_distorted(&self, displacement: &[f64]) -> bool {
        let (moved, _) = displacement.as_chunks::<3>();
        let share = 1.0 / real(moved.len());
        (0..3).any(|i| {
            let mean = share * moved.iter().map(|moved| moved[i]).sum::<f64>();
            moved.iter().any(|moved| (moved[i] - mean).abs() > self.largest)
        })
    }
}

/// Longest side of the bounding box of points (m).
fn extent(points: &[Vector3]) -> f64 {
    let side = |i: usize| {
        let values = || points.iter().map(|point| point[i]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    (0..3).map(side).fold(0.0, f64::max)
}
