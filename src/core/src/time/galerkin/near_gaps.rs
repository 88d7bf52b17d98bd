//! Gaps of the nodes of a sector to a smooth ring, from initial guesses of the closest points.

use super::compliance::Lanes;
use super::obstacle_view::ObstacleView;
use super::record::{PairRecord, SpanRecord};
use super::trial::Obstacle;
use crate::geometry::spline::SplineGap;
use crate::geometry::spline::near::NearSearch;
use crate::geometry::surface_spline::ClosestPoint;
use crate::math::simd::Kernel;

/// Gaps and normals of some nodes of a sector at a point of the step.
struct NearGaps<'a> {
    search: NearSearch<'a>,
    /// Nodes, and their indices among all lanes of the structure: node · `stride` + `sector`.
    nodes: &'a [usize],
    stride: usize,
    sector: usize,
    /// Lanes of the step, and the point.
    lanes: Lanes,
    point: usize,
    /// Displacements (m).
    moved: &'a [f64],
    /// Initial guesses of the closest points, valid if `located` is true; the results replace them.
    places: &'a mut [ClosestPoint],
    located: bool,
    gaps: &'a mut [f64],
    normals: &'a mut [f64],
}

impl Kernel for NearGaps<'_> {
    #[inline(always)]
    fn run(self) {
        for node in self.nodes {
            let lane = self.lanes.at(self.point, *node);
            let index = [*node, node * self.stride + self.sector];
            let moved = self.lanes.vector3(self.moved, lane);
            let gap = self.search.gap(index, moved, self.located.then_some(self.places[*node]));
            self.gaps[lane] = gap.distance;
            self.lanes.set(self.normals, lane, gap.normal);
            self.places[*node] = gap.foot;
        }
    }
}

impl ObstacleView<'_> {
    /// Finds gaps (m) and normals of all nodes at a point of the step.
    pub(super) fn find_gaps_at(
        &mut self,
        point: usize,
        lanes: Lanes,
        moved: &[f64],
        gaps: &mut [f64],
        normals: &mut [f64],
    ) {
        self.find_near_gaps(point, lanes, moved, gaps, normals, true);
        for node in 0..lanes.nodes {
            if self.smooth_ring(node).is_none() {
                let lane = lanes.at(point, node);
                let gap = self.gap(node, point, lanes.vector3(moved, lane));
                gaps[lane] = gap.distance;
                lanes.set(normals, lane, gap.normal);
            }
        }
    }

    /// Finds gaps (m) and normals of all nodes at all points. All nodes must face rigid smooth rings.
    pub(super) fn find_gaps_to_rigid_rings(
        &mut self,
        lanes: Lanes,
        moved: &[f64],
        gaps: &mut [f64],
        normals: &mut [f64],
    ) {
        for point in 1..=lanes.points {
            for PairRecord { pair, drives, .. } in &self.record.pairs {
                self.pairs[*pair].bend(drives[point].0.shape_factor, &[]);
            }
            self.find_near_gaps(point, lanes, moved, gaps, normals, self.record.located);
        }
        self.record.located = true;
    }

    /// Returns the gap function of a node that faces a smooth ring.
    fn smooth_ring(&self, node: usize) -> Option<&SplineGap> {
        self.pair(node)?.0.gap().smooth_ring()
    }

    /// Finds gaps (m) and normals of the nodes that face smooth rings, at a point of the step. If `located` is true, the search starts at the
    /// stored places of the nodes.
    fn find_near_gaps(
        &mut self,
        point: usize,
        lanes: Lanes,
        moved: &[f64],
        gaps: &mut [f64],
        normals: &mut [f64],
        located: bool,
    ) {
        let SpanRecord { pairs, places, lanes: stride, sector, instructions, .. } = &mut *self.record;
        for own in pairs {
            let pair = &self.pairs[own.pair];
            if let Some(law) = pair.gap().smooth_ring() {
                instructions.run(NearGaps {
                    search: NearSearch::new(law, &own.drives[point].0),
                    nodes: pair.nodes(),
                    stride: *stride,
                    sector: *sector,
                    lanes,
                    point,
                    moved,
                    places: &mut places[point],
                    located,
                    gaps,
                    normals,
                });
            }
        }
    }
}
