//! Gaps of the nodes of one sector: to rigid smooth rings, from initial guesses of the closest points, and to surfaces that are not smooth
//! rings.

use super::compliance::Lanes;
use super::obstacle_view::ObstacleView;
use super::record::{PairRecord, SpanRecord};
use super::trial::Obstacle;
use crate::geometry::spline::SplineGap;
use crate::geometry::spline::near::{NearNode, NearSearch};
use crate::math::octet::Eight;
use std::cell::Cell;

impl ObstacleView<'_> {
    /// Finds gaps (m) and normals of all nodes that do not face smooth rings, at a point of the step.
    pub(super) fn find_gaps_to_other_surfaces(
        &mut self,
        point: usize,
        lanes: Lanes,
        moved: &[f64],
        gaps: &mut [f64],
        normals: &mut [f64],
    ) {
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
            self.find_near_gaps(point, lanes, moved, gaps, normals);
        }
        self.record.located = true;
    }

    /// Returns the gap function of a node that faces a smooth ring.
    fn smooth_ring(&self, node: usize) -> Option<&SplineGap> {
        self.pair(node)?.0.gap().smooth_ring()
    }

    /// Finds gaps (m) and normals of the nodes that face smooth rings, at a point of the step. If `record.located` is true, the search
    /// starts at the stored closest points.
    fn find_near_gaps(&mut self, point: usize, lanes: Lanes, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        let SpanRecord { pairs, places, lanes: stride, sector, evaluated_gaps, located, .. } = &mut *self.record;
        let places = Cell::from_mut(&mut places[point][..]).as_slice_of_cells();
        for own in pairs {
            let pair = &self.pairs[own.pair];
            let Some(law) = pair.gap().smooth_ring() else { continue };
            *evaluated_gaps += Eight::blocks(pair.nodes().len()) as u64;
            let nodes = pair.nodes().iter().map(|node| NearNode {
                node: *node,
                index: node * *stride + *sector,
                local: lanes.vector3(moved, lanes.at(point, *node)),
                guess: located.then(|| places[*node].get()),
            });
            NearSearch::new(law, &own.drives[point].0).find_gaps(nodes, |NearNode { node, .. }, gap| {
                let lane = lanes.at(point, node);
                gaps[lane] = gap.distance;
                lanes.set(normals, lane, gap.normal);
                places[node].set(gap.foot);
            });
        }
    }
}
