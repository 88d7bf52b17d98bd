//! Contact nodes that are certainly open in a step, whose gaps need no evaluation.
//!
//! A gap is the distance of a node from a surface, and a distance changes by no more than both move. Each node has a free distance: its
//! gap when it was last evaluated, minus an upper bound of all motion since then ([`SplineGap::gap_change`], the displacement of the node
//! itself, and the motion of both by contact forces). While the free distance is positive the gap is larger, and the node cannot touch.
//! A node with a large free distance is skipped: its free distance replaces its gap.
//!
//! In every step the smallest gap of each node over all sectors, and of each sector if outputs need it, is exact: skipped nodes whose free
//! distance is below it are evaluated. So outputs do not depend on which nodes are skipped.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter};

use super::pair::ContactPair;
use super::structure::Structure;
use crate::geometry::PrescribedMotion;
use crate::geometry::spline::SplineGap;
use crate::geometry::surface_spline::ClosestPoint;
use crate::geometry::wrench::At;
use crate::math::simd::Kernel;

/// A node is evaluated if its free distance is less than this many times its motion in a step. So the gaps one and two steps before a
/// contact, which belong to its work, have been evaluated unless the motion grows by this factor within two steps.
const STEPS_AHEAD: f64 = 8.0;
/// Rounding error of a gap, relative to the radius of its node.
const ROUNDING: f64 = 1e-14;

/// Free distances of the contact nodes of a structure, `[node · lanes + lane]`; empty if all gaps are evaluated in every step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Nearness {
    /// Free distance (m).
    free: Vec<f64>,
    /// True for nodes whose current gap is a lower bound.
    skipped: Vec<bool>,
    /// Scratch: free distances of the lanes of a node beyond those that require an evaluation (m).
    margin: Vec<f64>,
}

impl Persist for Nearness {
    fn save(&self, writer: &mut StateWriter) {
        self.free.save(writer);
        self.skipped.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.free.restore(reader);
        self.skipped.restore(reader);
    }
    fn check(&self, reader: &mut StateReader) {
        self.free.check(reader);
        self.skipped.check(reader);
    }
}

impl Nearness {
    /// Allocates free distances for nodes and lanes; every node is evaluated in the first step.
    pub fn new(nodes: usize, lanes: usize) -> Self {
        let (free, skipped) = (vec![0.0; nodes * lanes], vec![false; nodes * lanes]);
        Self { free, skipped, margin: vec![0.0; lanes] }
    }

    /// Number of free distances.
    pub fn len(&self) -> usize {
        self.free.len()
    }

    /// Returns whether gaps may be skipped.
    #[inline(always)]
    pub(crate) fn is_used(&self) -> bool {
        !self.free.is_empty()
    }

    /// Returns whether the current gap of a node is a lower bound.
    #[inline(always)]
    pub(crate) fn is_skipped(&self, index: usize) -> bool {
        self.skipped.get(index).copied().unwrap_or(false)
    }

    /// Requests the evaluation of all nodes in the next step.
    pub fn clear(&mut self) {
        self.free.fill(0.0);
        self.skipped.fill(false);
    }

    /// Free distance of a node after node and surface have moved by at most `travel` (m).
    #[inline(always)]
    pub(crate) fn free_after(&self, index: usize, travel: f64) -> f64 {
        self.free[index] - travel
    }

    /// Reduces the free distances by the motion of each node and its surface (m), also in place of the gaps of skipped nodes (m).
    pub fn reduce(&mut self, motion: &[f64], gaps: &mut [f64]) {
        for (((free, skipped), motion), gap) in self.free.iter_mut().zip(&self.skipped).zip(motion).zip(gaps) {
            *free -= motion;
            *gap = if *skipped { *free } else { *gap };
        }
    }

    /// Returns the skipped node with the smallest bound, if it may be in contact or have the smallest gap of the nodes `indices`. `gap` is
    /// the gap of a node (m), or the bound of a skipped one.
    fn undecided(&self, indices: impl Iterator<Item = usize>, gap: impl Fn(usize) -> f64) -> Option<usize> {
        let (mut lowest, mut bound, mut candidate) = (f64::INFINITY, f64::INFINITY, None);
        for index in indices {
            let gap = gap(index);
            if !self.skipped[index] {
                lowest = lowest.min(gap);
            } else if gap < bound {
                (bound, candidate) = (gap, Some(index));
            }
        }
        candidate.filter(|_| bound <= lowest.max(0.0))
    }
}

/// Motion of the lanes of one node in a step, which reduces their free distances.
struct Approach<'a> {
    /// Displacements of the three rows of the node now and before (m).
    now: [&'a [f64]; 3],
    before: [&'a [f64]; 3],
    /// Upper bound of all other motion (m).
    change: f64,
    free: &'a mut [f64],
    gaps: &'a mut [f64],
    margin: &'a mut [f64],
}

impl Kernel for Approach<'_> {
    #[inline(always)]
    fn run(self) {
        let ([x, y, z], [x0, y0, z0]) = (self.now, self.before);
        let targets = self.free.iter_mut().zip(self.gaps.iter_mut()).zip(self.margin.iter_mut());
        let rows = x.iter().zip(x0).zip(y.iter().zip(y0)).zip(z.iter().zip(z0));
        for (((free, gap), margin), (((x, x0), (y, y0)), (z, z0))) in targets.zip(rows) {
            let [x, y, z] = [x - x0, y - y0, z - z0];
            let motion = self.change + (x * x + y * y + z * z).sqrt();
            *free -= motion;
            *gap = *free;
            *margin = *free - STEPS_AHEAD * motion;
        }
    }
}

impl Structure {
    /// Makes normals and closest points of the previous step those of skipped nodes.
    pub(crate) fn keep_geometry(&mut self) {
        if self.nearness.is_used() {
            self.history.geometry.now.copy_from(&self.history.geometry.before);
        }
    }

    /// Finds the gaps of the nodes of a pair that may be in contact or that outputs need. `change` is an upper bound of the change of a gap
    /// over the step by everything except the displacement of its node (m).
    pub(crate) fn find_near_gaps(&mut self, gap: &mut SplineGap, drive: &PrescribedMotion, moved: &[f64], change: f64) {
        gap.follow(drive.shape_factor, moved);
        gap.out_of_reach = None;
        let (lanes, sectors) = (self.lanes(), self.modes.sectors());
        for slot in 0..gap.nodes.len() {
            let node = gap.nodes[slot];
            self.approach(node, change + ROUNDING * gap.layout.radii[node]);
            for lane in 0..sectors {
                let index = node * lanes + lane;
                if self.nearness.margin[lane] > 0.0 && !self.needed_minima.all_of(lane) {
                    self.nearness.skipped[index] = true;
                } else {
                    let is_known = !self.nearness.skipped[index];
                    let start =
                        is_known.then(|| gap.surface.advance(self.history.geometry.before.places[index], gap.turned));
                    let found = self.evaluate_at(gap, At { node, index, drive }, start);
                    if found == f64::INFINITY {
                        gap.out_of_reach = gap.out_of_reach.or(Some(index));
                    }
                }
            }
        }
        for choice in 0..self.minima_among(&gap.nodes) {
            let gap_of = |structure: &Self, index: usize| structure.history.gap.now[index];
            while let Some(index) = self.undecided(&gap.nodes, choice, gap_of) {
                self.evaluate_at(gap, At { node: index / lanes, index, drive }, None);
            }
        }
    }

    /// Reduces the free distances of all lanes of a node by its motion and by `change` (m). The results are also its gaps.
    fn approach(&mut self, node: usize, change: f64) {
        let (lanes, sectors, first) = (self.lanes(), self.modes.sectors(), node * self.lanes());
        let rows = |values| [0, 1, 2].map(|component| row(values, 3 * node + component, [lanes, sectors]));
        let Nearness { free, margin, .. } = &mut self.nearness;
        self.modes.instruction_set.run(Approach {
            now: rows(self.modes.displacement()),
            before: rows(self.modes.displacement_before()),
            change,
            free: &mut free[first..first + sectors],
            gaps: &mut self.history.gap.now[first..first + sectors],
            margin: &mut margin[..sectors],
        });
    }

    /// Number of smallest gaps among the nodes `nodes` of a pair that must be exact: of each node and, if outputs need it, of each sector.
    pub(crate) fn minima_among(&self, nodes: &[usize]) -> usize {
        nodes.len() + if self.needed_minima.by_sector { self.modes.sectors() } else { 0 }
    }

    /// Returns a skipped node that may be in contact or have the smallest gap number `minimum` of [`Structure::minima_among`]. `gap` is the
    /// gap of a node (m), or the bound of a skipped one.
    pub(crate) fn undecided(
        &self,
        nodes: &[usize],
        minimum: usize,
        gap: impl Fn(&Self, usize) -> f64,
    ) -> Option<usize> {
        let (lanes, gap) = (self.lanes(), |index| gap(self, index));
        match nodes.get(minimum) {
            Some(node) => self.nearness.undecided(node * lanes..node * lanes + self.modes.sectors(), gap),
            None => {
                let lane = minimum - nodes.len();
                self.nearness.undecided(nodes.iter().map(|node| node * lanes + lane), gap)
            }
        }
    }

    /// Evaluates the gap of a skipped node of a pair at its predicted position.
    pub(crate) fn evaluate_skipped(&mut self, pair: &ContactPair, index: usize) {
        if let Some(gap) = pair.gap().spline_law() {
            self.evaluate_at(gap, At { node: index / self.lanes(), index, drive: pair.drive_now() }, None);
        }
    }

    /// Evaluates the gap of a node, and searches its closest point from `start` or from its angle. Returns the gap (m).
    fn evaluate_at(&mut self, gap: &SplineGap, at: At<'_>, start: Option<ClosestPoint>) -> f64 {
        let (index, lanes) = (at.index, self.lanes());
        let local = self.vector3(self.modes.displacement(), at.node, index % lanes);
        let found = gap.evaluate_from(at, local, start, &mut self.history.geometry.now);
        self.history.gap.now[index] = found;
        if self.nearness.skipped[index] && found > 0.0 && found.is_finite() {
            // The previous gap is a bound, not a value that a slope could be computed from.
            self.history.gap.before[index] = found;
        }
        self.note_evaluated(gap, index);
        found
    }

    fn note_evaluated(&mut self, gap: &SplineGap, index: usize) {
        let history = &self.history;
        self.nearness.free[index] = gap.free_distance(history.gap.now[index], history.geometry.now.places[index]);
        self.nearness.skipped[index] = false;
    }

    /// Records that all gaps of the nodes of a gap function have been evaluated.
    pub(crate) fn note_all_evaluated(&mut self, gap: &SplineGap) {
        let lanes = self.lanes();
        for node in &gap.nodes {
            for index in node * lanes..node * lanes + self.modes.sectors() {
                self.note_evaluated(gap, index);
            }
        }
    }
}

/// Values of a row in the lanes of sectors; [lanes, sectors].
fn row(values: &[f64], row: usize, [lanes, sectors]: [usize; 2]) -> &[f64] {
    &values[row * lanes..row * lanes + sectors]
}
