//! Closest points of nodes that move little along the surface in a step.

use super::SplineGap;
use crate::geometry::frame::PolarFrame;
use crate::geometry::surface_spline::close::{EightGaps, EightNodes};
use crate::geometry::surface_spline::{ClosestPoint, Projection};
use crate::geometry::{Gap, PrescribedMotion, Vector3};
use crate::math::octet::{Eight, Octet, OctetKernel};

/// Longest Newton step (in patches) whose extrapolated end is accepted. On a casing with 24 columns, errors of gaps are then below 1e-12 m.
/// The step roughly squares the error of the closest point, which is the next initial guess.
const NEARBY: f64 = 2e-3;

/// Largest number of Newton steps from a guess before the general search.
const NEWTON_STEPS: usize = 4;

/// Minimum number of nodes for which the vectorised search is faster than single searches.
const MIN_NODES_TOGETHER: usize = 3;

/// A search for closest points of many nodes at one instant.
pub(crate) struct NearSearch<'a> {
    gap: &'a SplineGap,
    drive: &'a PrescribedMotion,
    /// Angle of the rotor relative to the shape (rad).
    relative_angle: f64,
    /// Frames of the rotor relative to the shape, and of the shape.
    rotor: PolarFrame,
    shape: PolarFrame,
    /// Centre of the shaft in the directions of the shape (m).
    centre: Vector3,
    /// Largest distance over which a node may be skipped (m).
    reach: f64,
}

/// A node whose gap is to be found.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NearNode {
    /// Contact node, and its index `node · lanes + lane`.
    pub node: usize,
    pub index: usize,
    /// Displacement in the directions of the node (m).
    pub local: Vector3,
    /// Guess of the closest point at the current angle of the rotor; `None` to start from the angle of the node.
    pub guess: Option<ClosestPoint>,
}

/// Gap of a node, with the normal in its own directions and in fixed directions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NearGap {
    /// Gap (m): infinite beyond the extension of the surface, NaN without closest point.
    pub distance: f64,
    /// Closest point.
    pub place: ClosestPoint,
    /// Unit normal in the directions of the node, and in fixed directions.
    pub normal: Vector3,
    pub fixed: Vector3,
    /// Distance that node and surface may move before the node could touch (m).
    pub free: f64,
}

impl<'a> NearSearch<'a> {
    /// Prepares the search for the current surface and prescribed motion.
    pub fn new(gap: &'a SplineGap, drive: &'a PrescribedMotion) -> Self {
        let shape = PolarFrame::new(drive.shape_rotation);
        let relative_angle = drive.rotor_angle - drive.shape_rotation;
        let rotor = PolarFrame::new(relative_angle);
        Self {
            gap,
            drive,
            relative_angle,
            rotor,
            shape,
            centre: shape.local(drive.shaft),
            reach: gap.surface.extension() / 6.0,
        }
    }

    /// Position of a node displaced by `local` (m) in the directions of the shape, and its own directions there.
    #[inline(always)]
    fn position(&self, node: usize, index: usize, local: Vector3) -> (Vector3, PolarFrame) {
        let frame = self.gap.frames[index].turned(self.rotor);
        let arm = self.gap.arm(node, index % self.gap.layout.lanes, self.drive, local);
        (frame.fixed(arm) + self.centre, frame)
    }

    /// Returns the closest point of the step before at the current angle of the rotor.
    #[inline(always)]
    pub fn advanced(&self, before: ClosestPoint) -> ClosestPoint {
        self.gap.surface.advance(before, self.gap.turned)
    }

    /// Finds the gaps of up to eight nodes with guesses. Returns `None` for nodes whose closest points need more than one evaluation of the
    /// surface.
    #[inline(always)]
    pub fn find_closely<L: Octet>(&self, nodes: &[NearNode]) -> [Option<NearGap>; 8] {
        let (eight, frames, found) = self.project::<L>(nodes);
        let mut gaps = [None; 8];
        for place in 0..eight.count {
            gaps[place] = found.gap(place, eight.guesses[place]).map(|gap| self.near(gap, frames[place]));
        }
        gaps
    }

    /// Takes a Newton step for each of up to eight nodes. Returns the nodes, their directions and the ends of the steps.
    #[inline(always)]
    fn project<L: Octet>(&self, nodes: &[NearNode]) -> (EightNodes, [PolarFrame; 8], EightGaps) {
        let mut frames = [PolarFrame::FIXED; 8];
        let mut eight = EightNodes { x: [Eight::ZERO; 3], guesses: [ClosestPoint::default(); 8], count: nodes.len() };
        for (place, node) in nodes.iter().enumerate() {
            let (x, frame) = self.position(node.node, node.index, node.local);
            (frames[place], eight.guesses[place]) = (frame, self.initial_guess(node, x, frame));
            for component in 0..3 {
                eight.x[component].0[place] = x[component];
            }
        }
        let found = self.gap.surface.project_eight::<L>(&eight, NEARBY);
        (eight, frames, found)
    }

    /// Finds the gap of a node displaced by `local` (m) from its closest point `before` one step earlier, or from its angle, and the motion
    /// of the closest point in the step.
    pub fn find(&self, [node, index]: [usize; 2], local: Vector3, before: Option<ClosestPoint>) -> (NearGap, [f64; 2]) {
        let (x, frame) = self.position(node, index, local);
        let start = before.map(|before| self.advanced(before));
        let guess = start.unwrap_or_else(|| self.gap.surface.locate(x));
        let found = self.search(x, guess);
        let (foot, is_near) = (found.foot, start.is_some_and(|start| start.patch == found.foot.patch));
        let drift = if is_near { [foot.s - guess.s, foot.t - guess.t] } else { [0.0; 2] };
        (self.near(found, frame), drift)
    }

    /// Finds the gaps of nodes, with the normals in the directions of the nodes, and calls `store` with each of them.
    pub fn find_gaps(&self, mut nodes: impl Iterator<Item = NearNode>, mut store: impl FnMut(NearNode, Gap)) {
        loop {
            let (mut group, mut count) = ([NearNode::default(); 8], 0);
            for (place, node) in group.iter_mut().zip(nodes.by_ref().take(8)) {
                *place = node;
                count += 1;
            }
            if count == 0 {
                return;
            }
            let group = &group[..count];
            group.iter().zip(self.gaps(group)).for_each(|(node, gap)| store(*node, gap));
        }
    }

    /// Finds the gap of a node, with the normal in the directions of the node.
    fn gap(&self, node: NearNode) -> Gap {
        let (x, frame) = self.position(node.node, node.index, node.local);
        let found = self.closest(x, self.initial_guess(&node, x, frame), NEWTON_STEPS, node.guess);
        Gap { normal: frame.local(found.normal), ..found }
    }

    /// Finds the gaps of up to eight nodes, with the normals in the directions of the nodes. Further entries have no meaning.
    fn gaps(&self, nodes: &[NearNode]) -> [Gap; 8] {
        if nodes.len() < MIN_NODES_TOGETHER {
            let mut gaps = [Gap::NOTHING; 8];
            gaps.iter_mut().zip(nodes).for_each(|(gap, node)| *gap = self.gap(*node));
            return gaps;
        }
        self.gap.instruction_set.run_octets(EightNodeSearch { search: self, nodes })
    }

    /// Returns the given guess of the closest point of a node at `x` (m), or a guess from the angle of the node.
    #[inline(always)]
    fn initial_guess(&self, node: &NearNode, x: Vector3, frame: PolarFrame) -> ClosestPoint {
        if let Some(guess) = node.guess {
            return guess;
        }
        let (surface, position) = (&self.gap.surface, frame.local(x));
        // The displacements of node and shaft rotate the node about z by a small angle. A guess may neglect the fifth power of its tangent.
        let tangent = position[1] / position[0];
        let turned = tangent * (1.0 - tangent * tangent / 3.0);
        let angle = self.gap.layout.angles[node.index] + self.relative_angle + turned;
        surface.step_closer(x, surface.locate_at(angle, x[2]))
    }

    /// Finds the closest point to `x` (m) by up to `steps` Newton steps from `start`. If they fail, runs the general search from `guess`, or from
    /// the position `x` without a guess. The normal is in the directions of the shape.
    fn closest(&self, x: Vector3, start: ClosestPoint, steps: usize, guess: Option<ClosestPoint>) -> Gap {
        let surface = &self.gap.surface;
        let mut place = start;
        for _ in 0..steps {
            match surface.project_close(x, place, NEARBY) {
                Ok(gap) => return gap,
                Err(Some(next)) => place = next,
                Err(None) => break,
            }
        }
        self.search(x, guess.unwrap_or_else(|| surface.locate(x)))
    }

    /// Searches the closest point to a position. The normal has the directions of the shape. The gap is infinite beyond the extension of the
    /// surface, and NaN if there is no closest point.
    fn search(&self, x: Vector3, guess: ClosestPoint) -> Gap {
        let nowhere = Gap { distance: f64::NAN, normal: -Vector3::x(), foot: guess };
        match self.gap.surface.project(x, guess) {
            Projection::Found { gap, .. } => gap,
            Projection::BeyondEdge { place } => Gap { distance: f64::INFINITY, foot: place, ..nowhere },
            // The caller detects this: the model no longer describes such a state.
            Projection::Lost => nowhere,
        }
    }

    #[inline(always)]
    fn near(&self, found: Gap, frame: PolarFrame) -> NearGap {
        let Gap { distance, normal, foot } = found;
        let is_free = distance.is_finite() && self.gap.surface.is_far_from_edges(foot);
        let free = if is_free { distance.min(self.reach).max(0.0) } else { 0.0 };
        NearGap { distance, place: foot, normal: frame.local(normal), fixed: self.shape.fixed(normal), free }
    }
}

/// Finds the gaps of up to eight nodes, with the bits of [`NearSearch::gap`].
struct EightNodeSearch<'a> {
    search: &'a NearSearch<'a>,
    nodes: &'a [NearNode],
}

impl OctetKernel for EightNodeSearch<'_> {
    type Output = [Gap; 8];

    #[inline(always)]
    fn run<L: Octet>(self) -> [Gap; 8] {
        let Self { search, nodes } = self;
        let (eight, frames, found) = search.project::<L>(nodes);
        let mut gaps = [Gap::NOTHING; 8];
        for (place, node) in nodes.iter().enumerate() {
            let guess = eight.guesses[place];
            let gap = found.gap(place, guess).unwrap_or_else(|| {
                let steps = if found.near >> place & 1 == 1 { NEWTON_STEPS - 1 } else { 0 };
                let (x, end) = (eight.x.each_ref().map(|x| x.0[place]), found.end(place, guess));
                search.closest(x.into(), search.gap.surface.settle(end), steps, node.guess)
            });
            gaps[place] = Gap { normal: frames[place].local(gap.normal), ..gap };
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::layout::Layout;
    use crate::geometry::surface_spline::SurfaceSpline;
    use crate::geometry::wrench::At;
    use crate::scene::settings::{Closure, Interpolation};
    use tiprub_test_models::SeededRandom;

    const SECTORS: usize = 12;
    const RADIUS: f64 = 0.25;
    const CLEARANCE: f64 = 3e-4;

    /// A flared casing with three lobes and unevenly spaced rings. Some nodes are on borders of patches while the rotor and the shaft are at
    /// their initial positions.
    fn flared_casing_with_lobes() -> SplineGap {
        let ring = |z: f64| {
            (0..24).map(move |i| {
                let angle = std::f64::consts::TAU * f64::from(i) / 24.0;
                let (sine, cosine) = libm::sincos(angle);
                let radius = RADIUS + CLEARANCE + 0.1 * z + 2e-4 * libm::cos(3.0 * angle);
                [radius * cosine, radius * sine, z]
            })
        };
        let points: Vec<[f64; 3]> = [-0.012, -0.005, 0.003, 0.012].into_iter().flat_map(ring).collect();
        let surface = SurfaceSpline::new(&points, 24, 4, Closure::Smooth, Interpolation::Spline).unwrap();
        let places = [[RADIUS, 0.0, -0.005], [RADIUS, 0.01, 0.0], [RADIUS, -0.02, 0.0135]];
        let layout = Layout::of_places(&places, SECTORS, &[CLEARANCE; SECTORS], SECTORS).unwrap();
        SplineGap::new(layout, CLEARANCE, surface, Vec::new(), 1.0)
    }

    /// Without an initial guess, the search starts from the angle of the node, and finds the same closest point as the full search.
    #[test]
    fn searches_without_guess_find_the_closest_point() {
        let gap = flared_casing_with_lobes();
        let mut random = SeededRandom(7);
        let (mut distances, mut normals) = (0.0_f64, 0.0_f64);
        for trial in 0..400 {
            let size = [0.0, 1e-4, 1e-3, 4e-3][trial % 4];
            let drive = PrescribedMotion {
                rotor_angle: if trial < 8 { 0.0 } else { random.within(-7.0, 700.0) },
                shape_rotation: if trial < 8 { 0.0 } else { random.within(-7.0, 7.0) },
                shaft: Vector3::from(random.vector(0.3 * size)),
                gap_offset: random.within(-CLEARANCE, CLEARANCE),
                ..PrescribedMotion::default()
            };
            let search = NearSearch::new(&gap, &drive);
            for (node, sector) in (0..3).flat_map(|node| (0..SECTORS).map(move |sector| (node, sector))) {
                let index = node * SECTORS + sector;
                let moved = Vector3::from(random.vector(size));
                let found = search.gap(NearNode { node, index, local: moved, guess: None });
                let expected = gap.gap_to_current(At { node, index, drive: &drive }, moved);
                assert!(found.distance.is_finite(), "{drive:?}: {found:?}, {expected:?}");
                distances = distances.max((found.distance - expected.distance).abs());
                normals = normals.max((found.normal - expected.normal).norm());
            }
        }
        // Rounding of coordinates of 0.25 m.
        assert!(distances < 1e-15, "{distances:e} m");
        assert!(normals < 1e-10, "{normals:e}");
    }

    /// The gap of a node beyond the extension of the last ring is infinite, with and without an initial guess.
    #[test]
    fn gap_beyond_the_last_ring_is_infinite() {
        let gap = flared_casing_with_lobes();
        let drive = PrescribedMotion { shaft: Vector3::new(0.0, 0.0, 0.02), ..PrescribedMotion::default() };
        let search = NearSearch::new(&gap, &drive);
        let last = NearNode { node: 2, index: 2 * SECTORS, ..NearNode::default() };
        let beyond = search.gap(last);
        assert!(beyond.distance.is_infinite(), "{beyond:?}");
        let again = search.gap(NearNode { guess: Some(beyond.foot), ..last });
        assert!(again.distance.is_infinite(), "{again:?}");
        let within = search.gap(NearNode::default());
        assert!(within.distance.is_finite(), "{within:?}");
    }
}
