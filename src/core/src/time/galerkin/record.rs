//! Record of one sector over a span: prescribed motion, places of nodes, and results of contacts.

use crate::geometry::revolution::Instants;
use crate::geometry::surface_spline::ClosestPoint;
use crate::geometry::wrench::{MotionIncrement, Wrench};
use crate::geometry::{PrescribedMotion, Vector3};
use crate::math::vector::{ZERO, length};
use crate::system::ShapeGrowth;
use crate::system::carrier::Spot;
use crate::system::contact_view::ContactMember;
use crate::system::pair::ContactPair;
use crate::system::structure::NeededMinima;
use crate::system::work::{ContactWork, WorkingForce};
use crate::system::{ContactEvent, StepFailure, Structure};
use crate::time::galerkin::basis::{MOST, POINTS};
use crate::time::galerkin::compliance::Lanes;

/// Prescribed motion of a pair over a span: from its start, quadratic in time through the middle and the end. This is exact
/// because inputs are linear in time and the rotor angle is quadratic; only the shape may grow differently.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MotionCourse {
    before: PrescribedMotion,
    /// Linear and quadratic part of the motion over the whole span.
    parts: [MotionIncrement; 2],
    growth: ShapeGrowth,
    /// True if the shaft is displaced from the centre, or axially, at any time of the span.
    is_off_centre: bool,
}

/// Bounds on the motion of the shaft over a step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ShaftBounds {
    /// Distance of the shaft centre from the axis of the casing (m).
    pub offset: f64,
    /// Deviation of the displacement, along a direction that turns with the rotor, from linear motion over the step (m).
    pub chord_deviation: f64,
    /// Fourth derivative of this displacement with respect to time as a fraction of the step (m).
    pub fourth_derivative: f64,
    /// Change of the angle of a node about the axis of the casing, relative to the rotor, times the radius of the node (m).
    pub swing: f64,
}

impl MotionCourse {
    /// Creates the course from `before` through `middle` to `end`, over a span of length `span` (s).
    pub fn new(
        before: &PrescribedMotion,
        middle: &PrescribedMotion,
        growth: ShapeGrowth,
        end: &PrescribedMotion,
        span: f64,
    ) -> Self {
        let half = MotionIncrement::between(before, middle, 0.5 * span);
        let whole = MotionIncrement::between(before, end, span);
        let linear = half.over(4.0).less(&whole);
        let quadratic = whole.over(2.0).less(&half.over(4.0));
        let is_off_centre = [before.shaft, linear.shaft, quadratic.shaft] != [ZERO; 3];
        Self { before: *before, parts: [linear, quadratic], growth, is_off_centre }
    }

    /// Returns whether the shaft is displaced from the centre, or axially, at any time of the span.
    pub(crate) fn is_off_centre(&self) -> bool {
        self.is_off_centre
    }

    /// Returns whether the casing rests.
    pub(crate) fn is_casing_at_rest(&self) -> bool {
        self.parts.iter().all(MotionIncrement::is_casing_at_rest)
    }

    /// Returns the displacement (m) and the velocity (m/s) of the shaft centre at the fraction `theta` of the span, and its motion
    /// since the start of the span (m).
    pub(crate) fn shaft_at(&self, theta: f64) -> [Vector3; 3] {
        let ([linear, quadratic], before) = (&self.parts, &self.before);
        let moved = theta * linear.shaft + theta * theta * quadratic.shaft;
        let velocity = (linear.shaft + 2.0 * theta * quadratic.shaft) / linear.step;
        [before.shaft + moved, velocity, moved]
    }

    /// Bounds the motion of the shaft between two fractions of the span.
    pub(crate) fn shaft_bounds(&self, ends: [f64; 2]) -> ShaftBounds {
        if !self.is_off_centre {
            return ShaftBounds::default();
        }
        let ([linear, quadratic], part) = (&self.parts, ends[1] - ends[0]);
        let across = |shaft: &Vector3| libm::hypot(shaft[0], shaft[1]);
        let most = ends[0].abs().max(ends[1].abs());
        let rates =
            |linear: f64, quadratic: f64| [(linear + 2.0 * most * quadratic) * part, 2.0 * quadratic * part * part];
        let [turn, acceleration] = rates(linear.turn.abs(), quadratic.turn.abs());
        let [moved, bend] = rates(length(linear.shaft), length(quadratic.shaft));
        let [from, to] = ends.map(|theta| across(&self.shaft_at(theta)[0]));
        let offset = from.max(to) + 0.125 * bend;
        let square = turn * turn;
        ShaftBounds {
            offset,
            chord_deviation: 0.125 * (bend + 2.0 * moved * turn + offset * (square + acceleration)),
            fourth_derivative: offset
                * (square * square + 6.0 * square * acceleration + 3.0 * acceleration * acceleration)
                + 4.0 * moved * turn * (square + 3.0 * acceleration)
                + 6.0 * bend * (square + acceleration),
            swing: offset * turn + moved,
        }
    }

    /// Returns an upper bound of the motion over the span: each component changes at its largest rate in the span. The `turn` is the sum of
    /// the bounds of the rotation of the shape and of the rotation of the rotor relative to the shape.
    pub(crate) fn largest_motion(&self) -> MotionIncrement {
        let ([linear, quadratic], growth) = (&self.parts, &self.growth);
        let max =
            |component: &dyn Fn(&MotionIncrement) -> f64| component(linear).abs() + 2.0 * component(quadratic).abs();
        let shape_rotation = max(&|part| part.shape_rotation);
        MotionIncrement {
            step: linear.step,
            turn: shape_rotation + max(&|part| part.turn - part.shape_rotation),
            shaft: Vector3::new(max(&|part| part.shaft[0]), max(&|part| part.shaft[1]), max(&|part| part.shaft[2])),
            opening: max(&|part| part.opening),
            shape_factor: growth.largest_derivatives([0.0, 1.0])[0],
            shape_rotation,
        }
    }

    /// Growth of the shape over the span.
    pub(crate) fn growth(&self) -> &ShapeGrowth {
        &self.growth
    }

    /// Returns whether only the rotor moves.
    pub(crate) fn only_turns(&self) -> bool {
        self.parts.iter().all(|part| part.is_casing_at_rest() && part.shaft == Vector3::zeros())
    }

    /// Returns the prescribed motion at the fraction `theta` of the span, and the motion since its start, both without the shaft.
    #[inline]
    pub(crate) fn turning_at(&self, theta: f64) -> (TurningDrive, TurningMotion) {
        let ([linear, quadratic], before) = (&self.parts, &self.before);
        let combine = |linear: f64, quadratic: f64| theta * linear + theta * theta * quadratic;
        let motion = TurningMotion {
            turn: combine(linear.turn, quadratic.turn),
            opening: combine(linear.opening, quadratic.opening),
            shape_factor: self.growth.at(theta) - before.shape_factor,
            shape_rotation: combine(linear.shape_rotation, quadratic.shape_rotation),
            shaft: ZERO,
        };
        let drive = TurningDrive {
            rotor_angle: before.rotor_angle + motion.turn,
            speed: (linear.turn + 2.0 * theta * quadratic.turn) / linear.step,
            opening: before.gap_offset + before.radius_change + motion.opening,
            shape_factor: before.shape_factor + motion.shape_factor,
            shape_rotation: before.shape_rotation + motion.shape_rotation,
        };
        (drive, motion)
    }

    /// Prescribed motion at the fraction `theta` of the span, and the motion since its start.
    pub fn at(&self, theta: f64) -> (PrescribedMotion, MotionIncrement) {
        let (turning, TurningMotion { turn, opening, shape_factor, shape_rotation, .. }) = self.turning_at(theta);
        let ([linear, quadratic], before) = (&self.parts, &self.before);
        let square = theta * theta;
        let motion = MotionIncrement {
            step: theta * linear.step + square * quadratic.step,
            turn,
            shaft: theta * linear.shaft + square * quadratic.shaft,
            opening,
            shape_factor,
            shape_rotation,
        };
        let drive = PrescribedMotion {
            rotor_angle: turning.rotor_angle,
            speed: turning.speed,
            gap_offset: turning.opening,
            radius_change: 0.0,
            shape_factor: turning.shape_factor,
            shape_rotation: turning.shape_rotation,
            shaft: before.shaft + motion.shaft,
            shaft_velocity: (linear.shaft + 2.0 * theta * quadratic.shaft) / linear.step,
        };
        (drive, motion)
    }
}

/// Prescribed motion of a rotor and its casing, without the displacement of the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TurningDrive {
    /// Angle (rad) and speed (rad/s) of the rotor.
    pub rotor_angle: f64,
    pub speed: f64,
    /// Increase of the clearance (m).
    pub opening: f64,
    /// Factor on the shape of the surface, and its rotation (rad).
    pub shape_factor: f64,
    pub shape_rotation: f64,
}

/// Change of the prescribed motion of a rotor and its casing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TurningMotion {
    /// Rotation of the rotor (rad).
    pub turn: f64,
    /// Change of the clearance (m).
    pub opening: f64,
    /// Change of the factor on the shape of the surface, and rotation of the shape (rad).
    pub shape_factor: f64,
    pub shape_rotation: f64,
    /// Motion of the shaft centre along fixed x, y and z (m).
    pub shaft: Vector3,
}

impl TurningMotion {
    /// Adds `weight` times the motion from `from` to `to`, without the motion of the shaft.
    pub fn add(&mut self, weight: f64, from: &Self, to: &Self) {
        self.turn += weight * (to.turn - from.turn);
        self.opening += weight * (to.opening - from.opening);
        self.shape_factor += weight * (to.shape_factor - from.shape_factor);
        self.shape_rotation += weight * (to.shape_rotation - from.shape_rotation);
    }

    /// Returns whether no input moves the casing.
    pub fn is_casing_at_rest(&self) -> bool {
        self.opening == 0.0 && self.shape_factor == 0.0 && self.shape_rotation == 0.0
    }
}

/// Rounding error of a contact force without friction, as a fraction of the force. A larger tangential part stems from
/// the time before the friction coefficient became zero.
pub(crate) const FORCE_ROUNDING: f64 = 1e-12;

/// Contact of one node over a span.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeTally {
    /// ∫λ dt (N·s).
    pub normal: f64,
    /// ∫|F_t| dt (N·s).
    pub tangential: f64,
    /// ∫F dt in the coordinates of the displacements (N·s).
    pub force: Vector3,
    /// ∫ of force and moment in fixed directions (N·s, N·m·s), and λ-weighted ∫ of the point (m·N·s).
    pub wrench: Wrench,
    /// Largest λ (N), between the points as well.
    pub peak: f64,
    /// Friction heat (J).
    pub heat: f64,
    /// Smallest gap (m): at the start of the span, at the points, and between the points for nodes that stay open.
    pub lowest: f64,
}

impl NodeTally {
    pub const NOTHING: Self = Self {
        normal: 0.0,
        tangential: 0.0,
        force: ZERO,
        wrench: Wrench { point: ZERO, force: ZERO, moment: ZERO },
        peak: 0.0,
        heat: 0.0,
        lowest: f64::INFINITY,
    };

    /// Adds the impulses of a force over `duration` (s).
    pub fn add(&mut self, duration: f64, force: &WorkingForce, wrench: &Wrench) {
        self.normal += duration * force.multiplier;
        self.tangential += duration * length(force.tangential);
        self.force += duration * force.force;
        self.wrench.force += duration * wrench.force;
        self.wrench.moment += duration * wrench.moment;
        self.wrench.point += duration * force.multiplier * wrench.point;
    }

    /// Returns the event of a contact from its means over a span (s); `None` without contact.
    pub fn event(&self, at: ContactMember, span: f64) -> Option<ContactEvent> {
        if self.normal <= 0.0 {
            return None;
        }
        let wrench = Wrench {
            point: self.wrench.point / self.normal,
            force: self.wrench.force / span,
            moment: self.wrench.moment / span,
        };
        let event = ContactEvent::new(at, self.normal / span, self.force / span, 0.0, ZERO, wrench);
        let (tangential, peak, friction_heat) = (self.tangential / span, self.peak, self.heat);
        Some(ContactEvent { tangential, peak, friction_heat, ..event })
    }
}

/// Selects a place of a node on the surface of a carrier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SurfacePlace {
    /// The place at the start of the step.
    Begun,
    /// The current closest point.
    Now,
    /// The place at which the force of the node was applied.
    Acted,
}

/// A contact pair of the structure over a span.
#[derive(Debug, Clone)]
pub(crate) struct PairRecord {
    /// Index of the pair in the system.
    pub pair: usize,
    /// Index of the carrier of its surface in the island.
    pub carrier: Option<usize>,
    /// Prescribed motion over the span.
    pub course: MotionCourse,
    /// Prescribed motion at the points of the tried step.
    pub drives: [(PrescribedMotion, MotionIncrement); POINTS],
    /// Weighted motion over which forces at each point of the accepted step do work.
    pub motions: [MotionIncrement; POINTS],
    /// Bounds of the change of the gaps of each sector (m) by [`MotionCourse::largest_motion`]; used in the record of the first sector of a
    /// structure.
    pub changes: Vec<f64>,
    /// Bound of the additional change of a gap over the span while the rotor turns, per motion of the surface since the start of the span
    /// (see `SurfaceSpline::patch_motions`).
    pub drift_factor: f64,
    /// True if these bounds are known; sectors may then be inactive.
    pub has_bounds: bool,
}

impl PairRecord {
    /// Creates the record of a pair, whose structure has `lanes` lanes.
    pub fn new(pair: usize, carrier: Option<usize>, lanes: usize) -> Self {
        let (course, drives, motions) = Default::default();
        Self { pair, carrier, course, drives, motions, changes: vec![0.0; lanes], drift_factor: 0.0, has_bounds: false }
    }
}

/// Data that is kept from span to span, and scratch memory; allocates only on creation.
#[derive(Debug, Clone)]
pub(crate) struct SpanRecord {
    pub structure: usize,
    pub sector: usize,
    /// Lanes of a row of the structure.
    pub lanes: usize,
    /// Pairs of the structure, and for each node the index of its pair in this list.
    pub pairs: Vec<PairRecord>,
    pub pair_of: Vec<Option<usize>>,
    /// Contact of each node over the span.
    pub tallies: Vec<NodeTally>,
    /// Work of all nodes over the span.
    pub work: ContactWork,
    /// Damping loss over the span (J).
    pub damping: f64,
    /// Gap of each node below which its smallest gap over the span is needed (m).
    pub needed_below: Vec<f64>,
    /// Smallest gap of each node (m), over all sectors at the start of the span and over the span in the sectors before this one.
    pub lowest_of_all: Vec<f64>,
    /// Start and length of the tried step, as fractions of the span.
    pub step: [f64; 2],
    /// Gaps within free flight are searched if they may be smaller than at its ends by more than this (m).
    pub tolerance: f64,
    pub places: [Vec<ClosestPoint>; POINTS],
    /// True if all nodes face smooth rings that no structure carries.
    pub faces_rigid_rings: bool,
    /// True if `places` contains the closest points of such nodes for the tried step.
    pub located: bool,
    /// Places at which forces were applied to surface carriers: those of the pass before the one in which the gaps converged.
    pub acted: [Vec<ClosestPoint>; POINTS],
    /// Sliding of nodes along open surfaces at the points (m), where it was requested in this trial; and the number of requests.
    pub slips: [Vec<Option<Vector3>>; POINTS],
    pub solutions: usize,
    pub instants: Instants,
    /// Pair to whose surface all nodes at all points are entered in `instants`.
    pub lanes_of: Option<usize>,
    /// Number of blocks of up to eight gaps to smooth rings that were evaluated since the last addition to the total; for sectors that are
    /// searched together, in the record of the first sector of the structure.
    pub evaluated_gaps: u64,
    /// True if a contact exceeds the limits of small displacements.
    pub implausible: bool,
    /// Node that has passed a free edge and was already behind the surface, if any.
    pub behind_edge: Option<usize>,
}

impl SpanRecord {
    /// Allocates data for the first sector of a structure. `pairs` are the contact pairs of the structure, and `all_pairs` those of the
    /// system. `tolerance` (m) bounds the errors of smallest gaps.
    pub fn new(
        structure: usize,
        of: &Structure,
        pairs: Vec<PairRecord>,
        all_pairs: &[ContactPair],
        tolerance: f64,
    ) -> Self {
        let nodes = of.nodes();
        let number = |pair: &Option<usize>| pairs.iter().position(|own| Some(own.pair) == *pair);
        let pair_of: Vec<Option<usize>> = of.pair_of.iter().map(number).collect();
        let is_rigid_ring =
            |own: &PairRecord| own.carrier.is_none() && all_pairs[own.pair].gap().smooth_ring().is_some();
        Self {
            structure,
            sector: 0,
            lanes: of.lanes(),
            faces_rigid_rings: pairs.iter().all(is_rigid_ring) && pair_of.iter().all(Option::is_some),
            pair_of,
            pairs,
            step: [0.0; 2],
            tolerance,
            tallies: vec![NodeTally::NOTHING; nodes],
            work: ContactWork::default(),
            damping: 0.0,
            needed_below: vec![f64::INFINITY; nodes],
            lowest_of_all: vec![f64::INFINITY; nodes],
            places: std::array::from_fn(|_| vec![ClosestPoint::default(); nodes]),
            located: false,
            acted: std::array::from_fn(|_| vec![ClosestPoint::default(); nodes]),
            slips: std::array::from_fn(|_| vec![None; nodes]),
            solutions: 0,
            instants: Instants::new(Lanes { points: MOST, nodes }.width()),
            lanes_of: None,
            evaluated_gaps: 0,
            implausible: false,
            behind_edge: None,
        }
    }

    /// Index of a node of the sector among all lanes of the structure.
    pub(crate) fn index(&self, node: usize) -> usize {
        node * self.lanes + self.sector
    }

    /// Returns the carrier of the surface of a node, and the location of the node on it at a point of the step.
    pub(crate) fn spot<'a>(
        &self,
        node: usize,
        point: usize,
        when: SurfacePlace,
        pairs: &'a [ContactPair],
    ) -> Option<(usize, Spot<'a>)> {
        let own = &self.pairs[self.pair_of[node]?];
        let place = match when {
            SurfacePlace::Begun => self.places[0][node],
            SurfacePlace::Now => self.places[point][node],
            SurfacePlace::Acted => self.acted[point][node],
        };
        Some((own.carrier?, pairs[own.pair].spot(self.index(node), place, own.drives[point].0.rotor_angle)?))
    }

    /// Stores that the force on a node at a point of the step was applied at the node's current place.
    pub fn act(&mut self, node: usize, point: usize) {
        self.acted[point][node] = self.places[point][node];
    }

    /// Returns the failure that ends a span, if any.
    pub fn check(&self) -> Result<(), StepFailure> {
        let Self { structure, sector, .. } = *self;
        if self.implausible {
            return Err(StepFailure::Implausible { structure, sector });
        }
        self.behind_edge.map_or(Ok(()), |node| Err(StepFailure::BehindEdge { structure, node }))
    }

    /// Sets the prescribed motion of a span (s); the pairs are at its end.
    pub(crate) fn begin_courses(&mut self, pairs: &[ContactPair], span: f64) {
        for own in &mut self.pairs {
            let pair = &pairs[own.pair];
            own.course =
                MotionCourse::new(&pair.prescribed.drive.before, &pair.middle.0, pair.middle.1, pair.drive_now(), span);
        }
    }

    /// Uses the places at the start of the step, advanced by the rotation of the rotor, as initial guesses.
    pub(crate) fn guess_start_places(&mut self, pairs: &[ContactPair]) {
        let [first, rest @ ..] = &mut self.places;
        for own in &self.pairs {
            let pair = &pairs[own.pair];
            let ring = pair.gap().smooth_ring();
            for (places, (_, motion)) in rest.iter_mut().zip(&own.drives[1..]) {
                let motion = motion.less(&own.drives[0].1);
                let turns = (motion.turn - motion.shape_rotation) / std::f64::consts::TAU;
                for node in pair.nodes() {
                    places[*node] = ring.map_or(first[*node], |law| law.surface.advance(first[*node], turns));
                }
            }
        }
    }

    /// Finds the smallest gap of each node over all sectors of the structure at the start of the span.
    pub(crate) fn find_lowest_of_all(&mut self, of: &Structure) {
        let (gaps, sectors) = (&of.history.gap.before, of.modes().sectors());
        for (lowest, gaps) in self.lowest_of_all.iter_mut().zip(gaps.chunks_exact(self.lanes)) {
            *lowest = gaps[..sectors].iter().copied().fold(f64::INFINITY, f64::min);
        }
    }

    /// Finds which smallest gaps of the sector outputs need in its turn.
    pub(crate) fn choose_minima(&mut self, needed: &NeededMinima) {
        let own = if needed.all_of(self.sector) {
            f64::INFINITY
        } else if needed.by_sector {
            self.tallies.iter().map(|tally| tally.lowest).fold(f64::INFINITY, f64::min)
        } else {
            f64::NEG_INFINITY
        };
        for (below, lowest) in self.needed_below.iter_mut().zip(&self.lowest_of_all) {
            *below = lowest.max(own);
        }
    }

    /// Ends the turn of the sector.
    pub(crate) fn end_turn(&mut self) {
        for (lowest, tally) in self.lowest_of_all.iter_mut().zip(&self.tallies) {
            *lowest = lowest.min(tally.lowest);
        }
    }

    /// Starts the span of a sector, with the places and gaps (m) of its nodes at their indices. The search for closest
    /// points in the first step also starts at these places, because the places of earlier trials are not part of a
    /// saved state.
    pub fn begin(&mut self, place_of: impl Fn(usize) -> ClosestPoint, gap_of: impl Fn(usize) -> f64) {
        for node in 0..self.tallies.len() {
            let index = self.index(node);
            self.places[0][node] = place_of(index);
            self.tallies[node] = NodeTally { lowest: gap_of(index), ..NodeTally::NOTHING };
        }
        let [first, rest @ ..] = &mut self.places;
        rest.iter_mut().for_each(|places| places.copy_from_slice(first));
        (self.work, self.damping) = (ContactWork::default(), 0.0);
        (self.implausible, self.behind_edge) = (false, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiprub_test_models::SeededRandom;

    /// Between any two times of a span, each component changes by at most the same fraction of the largest motion, even if it reverses.
    #[test]
    fn motion_at_the_largest_rate_bounds_motion_between_any_times() {
        let mut random = SeededRandom(9);
        for case in 0..200 {
            let mut at = |angle: f64| PrescribedMotion {
                rotor_angle: angle + 0.1 * random.signed(),
                gap_offset: 1e-4 * random.signed(),
                shaft: Vector3::new(random.signed(), random.signed(), random.signed()),
                shape_rotation: 0.1 * random.signed(),
                ..PrescribedMotion::default()
            };
            let [before, middle, end] = [at(0.0), at(0.0), at(0.0)];
            let growth = ShapeGrowth {
                factors: [random.signed(), random.signed()],
                elapsed: [0.0, random.within(0.1, 2.0)],
                length: random.of(&[0.0, 1.0]),
            };
            let course = MotionCourse::new(&before, &middle, growth, &end, 1.0);
            let values = |motion: &MotionIncrement| {
                let MotionIncrement { turn, shaft, opening, shape_factor, shape_rotation, .. } = *motion;
                [turn - shape_rotation, shape_rotation, opening, shape_factor, shaft[0], shaft[1], shaft[2]]
            };
            let bounds = values(&course.largest_motion());
            for _ in 0..50 {
                let times = [random.unit(), random.unit()];
                let [from, to] = times.map(|theta| values(&course.at(theta).1));
                let part = (times[1] - times[0]).abs();
                for ((from, to), bound) in from.iter().zip(to).zip(bounds) {
                    assert!((to - from).abs() <= part * bound * (1.0 + 1e-9) + 1e-15, "case {case}");
                }
            }
        }
    }

    /// A rotor that accelerates on an accelerated shaft: places follow the motion at any time, velocities are its rates.
    #[test]
    fn prescribed_motion_is_consistent_with_its_rates() {
        let span = 4e-5;
        let at = |time: f64| PrescribedMotion {
            rotor_angle: 0.3 + 1300.0 * time + 4e6 * time * time,
            speed: 1300.0 + 8e6 * time,
            gap_offset: 2e-4 - 3.0 * time,
            shaft: Vector3::new(0.2 * time, 1e-5 - 0.1 * time + 500.0 * time * time, -0.3 * time),
            shaft_velocity: Vector3::new(0.2, -0.1 + 1000.0 * time, -0.3),
            ..PrescribedMotion::default()
        };
        let course = MotionCourse::new(&at(0.0), &at(0.5 * span), ShapeGrowth::default(), &at(span), span);
        for place in 0..=8 {
            let theta = 0.125 * f64::from(place);
            let (found, expected) = (course.at(theta).0, at(theta * span));
            let pairs = [
                (found.rotor_angle, expected.rotor_angle, 1.0),
                (found.speed, expected.speed, 1300.0),
                (found.gap_offset, expected.gap_offset, 1e-4),
            ];
            let shaft = (0..3).map(|i| (found.shaft[i], expected.shaft[i], 1e-5));
            let velocity = (0..3).map(|i| (found.shaft_velocity[i], expected.shaft_velocity[i], 0.1));
            for (found, expected, size) in pairs.into_iter().chain(shaft).chain(velocity) {
                assert!((found - expected).abs() < 1e-9 * size, "θ = {theta}: {found}, {expected}");
            }
        }
    }
}
