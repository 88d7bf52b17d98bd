//! Contact nodes that are certainly open in a step, whose gaps need no evaluation.
//!
//! A gap is the distance of a node from a surface, and a distance changes by no more than both move. Each node has a free distance: its
//! gap when it was last evaluated, minus an upper bound of all motion since then ([`SplineGap::gap_changes`], the displacement of the node
//! itself, and the motion of both by contact forces). While the free distance is positive the gap is larger, and the node cannot touch.
//! A node with a large free distance is skipped: its free distance replaces its gap.
//!
//! In every step the smallest gap of each node over all sectors, and of each sector if outputs need it, is exact: skipped nodes whose free
//! distance is below it are evaluated. So outputs do not depend on which nodes are skipped.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter};

use super::pair::ContactPair;
use super::structure::Structure;
use crate::geometry::spline::SplineGap;
use crate::geometry::spline::near::{NearGap, NearNode, NearSearch};
use crate::geometry::surface_spline::ClosestPoint;
use crate::geometry::{Geometry, PrescribedMotion};
use crate::math::octet::{Octet, OctetKernel};
use crate::math::simd::Kernel;
use crate::math::vector::{Vector3, strided_vector3};
use crate::modes::bank::LANES;

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
    /// Motion of the closest point on the surface in the last step, apart from the rotation of the rotor (patches).
    drift: Vec<[f64; 2]>,
    /// Scratch: upper bounds of the change of any gap of each lane in the current step by everything except the displacement of its node
    /// (m).
    pub changes: Vec<f64>,
    /// Scratch: free distances of the lanes of a node beyond those that require an evaluation (m).
    margin: Vec<f64>,
    /// Scratch: nodes evaluated in the current step, and those among them whose closest point needs a longer search.
    evaluated: Vec<usize>,
    searched: Vec<usize>,
    /// Normals of the evaluated nodes in fixed directions.
    fixed_normals: Vec<Vector3>,
}

impl Persist for Nearness {
    fn save(&self, writer: &mut StateWriter) {
        self.free.save(writer);
        self.skipped.save(writer);
        self.drift.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.free.restore(reader);
        self.skipped.restore(reader);
        self.drift.restore(reader);
    }
    fn check(&self, reader: &mut StateReader) {
        self.free.check(reader);
        self.skipped.check(reader);
        self.drift.check(reader);
    }
}

impl Nearness {
    /// Allocates free distances for nodes and lanes; every node is evaluated in the first step.
    pub fn new(nodes: usize, lanes: usize) -> Self {
        let count = nodes * lanes;
        Self {
            free: vec![0.0; count],
            skipped: vec![false; count],
            drift: vec![[0.0; 2]; count],
            changes: vec![0.0; lanes],
            margin: vec![0.0; lanes],
            evaluated: Vec::with_capacity(count),
            searched: Vec::with_capacity(count),
            fixed_normals: vec![Vector3::zeros(); count],
        }
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

    /// Nodes that have been evaluated in the current step.
    pub fn evaluated(&self) -> &[usize] {
        &self.evaluated
    }

    /// Unit normal at an evaluated node, in fixed directions.
    #[inline(always)]
    pub fn fixed_normal(&self, index: usize) -> Vector3 {
        self.fixed_normals[index]
    }

    /// Reduces the free distances by the motion of each node and its surface (m).
    pub fn reduce(&mut self, motion: &[f64]) {
        self.free.iter_mut().zip(motion).for_each(|(free, motion)| *free -= motion);
    }

    /// Computes gaps or their bounds (m) after evaluated gaps have changed by `response`, and nodes and surfaces have moved by at most
    /// `travel`.
    pub fn gaps_after(&self, gaps: &[f64], response: &[f64], travel: &[f64], after: &mut [f64]) {
        let changes = response.iter().zip(travel).zip(&self.skipped);
        for ((after, gap), ((response, travel), skipped)) in after.iter_mut().zip(gaps).zip(changes) {
            *after = gap + if *skipped { -travel } else { *response };
        }
    }

    /// Returns the skipped node with the smallest bound, if it may be in contact or have the smallest gap of the nodes `indices`. `gaps`
    /// are the gaps of all nodes (m), or bounds of skipped ones.
    fn undecided(&self, indices: impl Iterator<Item = usize> + Clone, gaps: &[f64]) -> Option<usize> {
        let (mut lowest, mut bound, mut candidate) = (f64::INFINITY, f64::INFINITY, None);
        for index in indices {
            if !self.skipped[index] {
                lowest = lowest.min(gaps[index]);
            } else if gaps[index] < bound {
                (bound, candidate) = (gaps[index], Some(index));
            }
        }
        candidate.filter(|_| bound <= lowest.max(0.0))
    }

    /// Returns whether [`Nearness::undecided`] finds a node in a row of lanes.
    #[inline(always)]
    fn is_row_undecided(&self, row: std::ops::Range<usize>, gaps: &[f64]) -> bool {
        let (mut lowest, mut bound) = ([f64::INFINITY; LANES], [f64::INFINITY; LANES]);
        let (gaps, skipped) = (gaps[row.clone()].as_chunks::<LANES>().0, self.skipped[row].as_chunks::<LANES>().0);
        for (gaps, skipped) in gaps.iter().zip(skipped) {
            for lane in 0..LANES {
                let (gap, limit) =
                    if skipped[lane] { (f64::INFINITY, gaps[lane]) } else { (gaps[lane], f64::INFINITY) };
                lowest[lane] = if gap < lowest[lane] { gap } else { lowest[lane] };
                bound[lane] = if limit < bound[lane] { limit } else { bound[lane] };
            }
        }
        let least = |values: [f64; LANES]| values.into_iter().fold(f64::INFINITY, f64::min);
        let bound = least(bound);
        bound < f64::INFINITY && bound <= least(lowest).max(0.0)
    }
}

/// Motion of the lanes of one node in a step, which reduces their free distances.
struct Approach<'a> {
    /// Displacements of the three rows of the node now and before (m).
    now: [&'a [f64]; 3],
    before: [&'a [f64]; 3],
    /// Upper bounds of all other motion (m): of each lane, and rounding.
    changes: &'a [f64],
    rounding: f64,
    free: &'a mut [f64],
    gaps: &'a mut [f64],
    margin: &'a mut [f64],
}

impl Kernel for Approach<'_> {
    #[inline(always)]
    fn run(self) {
        let ([x, y, z], [x0, y0, z0]) = (self.now, self.before);
        let targets = self.free.iter_mut().zip(self.gaps.iter_mut()).zip(self.margin.iter_mut()).zip(self.changes);
        let rows = x.iter().zip(x0).zip(y.iter().zip(y0)).zip(z.iter().zip(z0));
        for ((((free, gap), margin), change), (((x, x0), (y, y0)), (z, z0))) in targets.zip(rows) {
            let [x, y, z] = [x - x0, y - y0, z - z0];
            let motion = change + self.rounding + (x * x + y * y + z * z).sqrt();
            *free -= motion;
            *gap = *free;
            *margin = *free - STEPS_AHEAD * motion;
        }
    }
}

/// Evaluates nodes whose closest points move little in the step; the others are added to `searched`.
struct EvaluateNear<'a> {
    search: NearSearch<'a>,
    evaluated: &'a [usize],
    lanes: usize,
    displacement: &'a [f64],
    before: &'a [ClosestPoint],
    drift: &'a mut [[f64; 2]],
    target: NearTarget<'a>,
    searched: &'a mut Vec<usize>,
}

/// Arrays to which evaluated nodes are written.
struct NearTarget<'a> {
    gaps: &'a mut [f64],
    geometry: &'a mut Geometry,
    free: &'a mut [f64],
    fixed_normals: &'a mut [Vector3],
}

impl NearTarget<'_> {
    #[inline(always)]
    fn write(&mut self, index: usize, found: &NearGap) {
        self.gaps[index] = found.distance;
        self.geometry.places[index] = found.place;
        self.geometry.set_normal(index, found.normal);
        self.free[index] = found.free;
        self.fixed_normals[index] = found.fixed;
    }
}

impl OctetKernel for EvaluateNear<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(mut self) {
        let lanes = self.lanes;
        for group in self.evaluated.chunks(8) {
            let (mut nodes, mut starts) = ([NearNode::default(); 8], [ClosestPoint::default(); 8]);
            for (place, index) in group.iter().enumerate() {
                let (node, lane, [s, t]) = (index / lanes, index % lanes, self.drift[*index]);
                let start = self.search.advanced(self.before[*index]);
                let guess = ClosestPoint { s: start.s + s, t: start.t + t, ..start };
                let local = strided_vector3(self.displacement, 3 * node * lanes + lane, lanes);
                (starts[place], nodes[place]) = (start, NearNode { node, index: *index, local, guess: Some(guess) });
            }
            let found = self.search.find_closely::<L>(&nodes[..group.len()]);
            for ((index, start), found) in group.iter().zip(&starts).zip(&found) {
                match found {
                    Some(found) => {
                        self.drift[*index] = [found.place.s - start.s, found.place.t - start.t];
                        self.target.write(*index, found);
                    }
                    None => self.searched.push(*index),
                }
            }
        }
    }
}

impl Structure {
    /// Makes normals and closest points of the previous step those of skipped nodes.
    pub(crate) fn keep_geometry(&mut self) {
        if self.nearness.is_used() {
            self.history.geometry.now.copy_from(&self.history.geometry.before);
            self.nearness.evaluated.clear();
        }
    }

    /// Finds the gaps of the nodes of a pair that may be in contact or that outputs need.
    pub(crate) fn find_near_gaps(&mut self, gap: &mut SplineGap, drive: &PrescribedMotion, moved: &[f64]) {
        gap.follow(drive.shape_factor, moved);
        gap.out_of_reach = None;
        let first = self.nearness.evaluated.len();
        self.nearness.searched.clear();
        for node in &gap.nodes {
            self.approach(*node, ROUNDING * gap.layout.radii[*node]);
            self.choose_near(*node);
        }
        self.evaluate_near(NearSearch::new(gap, drive), first);
        let search = NearSearch::new(gap, drive);
        for position in 0..self.nearness.searched.len() {
            self.evaluate_at(&search, self.nearness.searched[position]);
        }
        for minimum in 0..self.minima_among(&gap.nodes) {
            while let Some(index) = self.undecided(&gap.nodes, minimum, &self.history.gap.now) {
                self.evaluate_at(&search, index);
            }
        }
        let mut evaluated = self.nearness.evaluated[first..].iter();
        gap.out_of_reach = evaluated.find(|index| self.history.gap.now[**index] == f64::INFINITY).copied();
    }

    /// Reduces the free distances of all lanes of a node by all motion and by `rounding` (m). The results are also its gaps.
    fn approach(&mut self, node: usize, rounding: f64) {
        let (lanes, sectors, first) = (self.lanes(), self.modes.sectors(), node * self.lanes());
        let rows = |values| [0, 1, 2].map(|component| row(values, 3 * node + component, [lanes, sectors]));
        let Nearness { free, changes, margin, .. } = &mut self.nearness;
        self.modes.instruction_set.run(Approach {
            now: rows(self.modes.displacement()),
            before: rows(self.modes.displacement_before()),
            changes: &changes[..sectors],
            rounding,
            free: &mut free[first..first + sectors],
            gaps: &mut self.history.gap.now[first..first + sectors],
            margin: &mut margin[..sectors],
        });
    }

    /// Chooses the lanes of a node that need an evaluation. Those that were skipped before have no closest point to start from.
    fn choose_near(&mut self, node: usize) {
        let first = node * self.lanes();
        let Nearness { skipped, margin, evaluated, searched, .. } = &mut self.nearness;
        for lane in 0..self.modes.sectors() {
            let index = first + lane;
            if margin[lane] > 0.0 && !self.needed_minima.all_of(lane) {
                skipped[index] = true;
            } else if skipped[index] {
                searched.push(index);
            } else {
                evaluated.push(index);
            }
        }
    }

    /// Evaluates the chosen nodes from position `first` on.
    fn evaluate_near(&mut self, search: NearSearch, first: usize) {
        let lanes = self.lanes();
        let Nearness { free, drift, evaluated, searched, fixed_normals, .. } = &mut self.nearness;
        let history = &mut self.history;
        let (gaps, geometry) = (&mut history.gap.now[..], &mut history.geometry.now);
        self.modes.instruction_set.run_octets(EvaluateNear {
            search,
            evaluated: &evaluated[first..],
            lanes,
            displacement: self.modes.displacement(),
            before: &history.geometry.before.places,
            drift,
            target: NearTarget { gaps, geometry, free, fixed_normals },
            searched,
        });
    }

    /// Number of smallest gaps among the nodes `nodes` of a pair that must be exact: of each node and, if outputs need it, of each sector.
    pub(crate) fn minima_among(&self, nodes: &[usize]) -> usize {
        nodes.len() + if self.needed_minima.by_sector { self.modes.sectors() } else { 0 }
    }

    /// Returns a skipped node that may be in contact or have the smallest gap number `minimum` of [`Structure::minima_among`]. `gaps` are
    /// the gaps of all nodes (m), or bounds of skipped ones.
    pub(crate) fn undecided(&self, nodes: &[usize], minimum: usize, gaps: &[f64]) -> Option<usize> {
        let lanes = self.lanes();
        match nodes.get(minimum) {
            Some(node) => {
                let row = node * lanes..(node + 1) * lanes;
                let is_undecided = self.nearness.is_row_undecided(row.clone(), gaps);
                is_undecided.then(|| self.nearness.undecided(row, gaps)).flatten()
            }
            None => {
                let lane = minimum - nodes.len();
                self.nearness.undecided(nodes.iter().map(|node| node * lanes + lane), gaps)
            }
        }
    }

    /// Evaluates the gap of a skipped node of a pair at its predicted position.
    pub(crate) fn evaluate_skipped(&mut self, pair: &ContactPair, index: usize) {
        if let Some(gap) = pair.gap().spline_law() {
            self.evaluate_at(&NearSearch::new(gap, pair.drive_now()), index);
        }
    }

    /// Evaluates the gap of a node, and searches its closest point from that of the previous step, or from its angle if it was skipped.
    fn evaluate_at(&mut self, search: &NearSearch, index: usize) {
        let (node, lane) = (index / self.lanes(), index % self.lanes());
        let local = self.vector3(self.modes.displacement(), node, lane);
        let was_skipped = self.nearness.skipped[index];
        let before = (!was_skipped).then(|| self.history.geometry.before.places[index]);
        let (found, drift) = search.find([node, index], local, before);
        let Nearness { free, skipped, drift: drifts, evaluated, fixed_normals, .. } = &mut self.nearness;
        let history = &mut self.history;
        let (gaps, geometry) = (&mut history.gap.now[..], &mut history.geometry.now);
        NearTarget { gaps, geometry, free, fixed_normals }.write(index, &found);
        drifts[index] = drift;
        if was_skipped {
            skipped[index] = false;
            evaluated.push(index);
            if found.distance > 0.0 && found.distance.is_finite() {
                // The previous gap is a bound, not a value that a slope could be computed from.
                history.gap.before[index] = found.distance;
            }
        }
    }

    /// Records that all gaps of the nodes of a gap function have been evaluated.
    pub(crate) fn note_all_evaluated(&mut self, nodes: &[usize]) {
        for node in nodes {
            let row = node * self.lanes()..node * self.lanes() + self.modes.sectors();
            self.nearness.free[row.clone()].fill(0.0);
            self.nearness.skipped[row.clone()].fill(false);
            self.nearness.drift[row].fill([0.0; 2]);
        }
    }
}

/// Values of a row in the lanes of sectors; [lanes, sectors].
fn row(values: &[f64], row: usize, [lanes, sectors]: [usize; 2]) -> &[f64] {
    &values[row * lanes..row * lanes + sectors]
}
