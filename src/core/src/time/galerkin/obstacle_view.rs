//! One sector and its surfaces over a span: gaps at any time, and a record of the contacts.

use super::basis::TimeBasis;
use super::carrier::{BLOCKS, CarrierIntegrator};
use super::compliance::Lanes;
use super::level::StepTables;
use super::record::{FORCE_ROUNDING, PairRecord, SpanRecord, SurfacePlace};
use super::surroundings::{AcceptedStep, CarriersInStep, LaneStep, Witness};
use super::trial::{ForceInterpolation, Obstacle, SlidingState, Trial, node_by_node};
use crate::contact::ContactParameters;
use crate::geometry::spline::near::{NearNode, NearSearch};
use crate::geometry::wrench::{At, MotionIncrement};
use crate::geometry::{Gap, GapLaw, PrescribedMotion, Sliding, Vector3, Vibration};
use crate::math::vector::vector3_at;
use crate::system::carrier::Spot;
use crate::system::pair::ContactPair;
use crate::system::work::WorkingForce;
use std::iter;

/// Number of contact solutions in a trial after which the sliding directions are frozen, because a node that hardly slides would
/// change its direction in every solution.
const SOLUTIONS: usize = 3;

/// A sector of a structure and the surfaces that it can touch.
pub(crate) struct ObstacleView<'a> {
    /// Structures that carry the surfaces, if any.
    pub carriers: CarriersInStep<'a>,
    pub pairs: &'a mut [ContactPair],
    pub record: &'a mut SpanRecord,
}

impl ObstacleView<'_> {
    /// Returns the pair of a node, and its record.
    pub(super) fn pair(&self, node: usize) -> Option<(&ContactPair, &PairRecord)> {
        let own = &self.record.pairs[self.record.pair_of[node]?];
        Some((&self.pairs[own.pair], own))
    }

    /// Reads a value of the surface carrier that a node faces, at the place of the node and at a point of the step.
    fn on_carrier<T>(
        &self,
        node: usize,
        point: usize,
        when: SurfacePlace,
        read: impl Fn(&CarrierIntegrator, Spot) -> T,
    ) -> Option<T> {
        let (carrier, spot) = self.record.spot(node, point, when, self.pairs)?;
        Some(read(&self.carriers.carriers[carrier], spot))
    }

    /// Calls `read` with the surface carrier that a node faces, at a point of the step.
    fn with_carrier_mut(&mut self, node: usize, point: usize, read: impl FnOnce(&mut CarrierIntegrator, Spot)) {
        if let Some((carrier, spot)) = self.record.spot(node, point, SurfacePlace::Now, self.pairs) {
            read(&mut self.carriers.carriers[carrier], spot);
        }
    }

    /// Returns the surface carrier of a lane, and the current step.
    fn carrier(&mut self, lane: usize) -> Option<(&mut CarrierIntegrator, LaneStep)> {
        let CarriersInStep { carriers, step } = &mut self.carriers;
        let pair = self.record.pair_of[step.lanes.place(lane).1]?;
        Some((&mut carriers[self.record.pairs[pair].carrier?], *step))
    }

    fn at<'b>(&self, node: usize, drive: &'b PrescribedMotion) -> At<'b> {
        At { node, index: self.record.index(node), drive }
    }

    /// Returns whether `holds` for the gap of any node over a step of `length` from `from` (fractions of the span), with the motion at its
    /// start and the rotor angle (rad) at its end.
    fn any_node(&self, from: f64, length: f64, holds: impl Fn(At, &GapLaw, f64) -> bool) -> bool {
        self.record.pairs.iter().any(|own| {
            let [start, end] = [from, from + length].map(|theta| own.course.at(theta).0);
            let pair = &self.pairs[own.pair];
            pair.nodes().iter().any(|node| holds(self.at(*node, &start), pair.gap(), end.rotor_angle))
        })
    }
}

impl ObstacleView<'_> {
    /// Adds all nodes at all points as lanes, if they face one surface of revolution and the shaft stays in the middle.
    fn enter_lanes(&mut self, lanes: Lanes) -> Option<usize> {
        let first = (*self.record.pair_of.first()?)?;
        let PairRecord { pair, drives, .. } = &self.record.pairs[first];
        let GapLaw::Revolution(law) = self.pairs[*pair].gap() else { return None };
        for (node, other) in self.record.pair_of.iter().enumerate() {
            if *other != Some(first) {
                return None;
            }
            for point in 1..=lanes.points {
                let at = self.at(node, &drives[point].0);
                if !law.enter(at, lanes.at(point, node), &mut self.record.instants) {
                    return None;
                }
            }
        }
        Some(*pair)
    }
}

impl Obstacle for ObstacleView<'_> {
    fn gap(&mut self, node: usize, point: usize, moved: Vector3) -> Gap {
        let Some(number) = self.record.pair_of[node] else { return Gap::NOTHING };
        let PairRecord { pair, drives, .. } = &self.record.pairs[number];
        let at = At { node, index: self.record.index(node), drive: &drives[point].0 };
        let gap = self.pairs[*pair].parts.gap.gap(at, moved, Some(self.record.places[point][node]));
        self.record.places[point][node] = gap.foot;
        gap
    }

    fn gap_at_start(&mut self, node: usize, moved: Vector3) -> f64 {
        let place = self.record.places[0][node];
        let gap = self.gap(node, 0, moved).distance;
        self.record.places[0][node] = place;
        gap
    }

    fn gaps(&mut self, lanes: Lanes, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        if let Some(pair) = self.record.lanes_of
            && let GapLaw::Revolution(law) = self.pairs[pair].gap()
        {
            return law.of_lanes(&mut self.record.instants, moved, gaps, normals);
        }
        if self.record.faces_rigid_rings {
            return self.find_gaps_to_rigid_rings(lanes, moved, gaps, normals);
        }
        node_by_node(self, lanes, moved, gaps, normals);
    }

    fn gaps_at(&mut self, point: usize, lanes: Lanes, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        self.find_gaps_to_other_surfaces(point, lanes, moved, gaps, normals);
    }

    fn gap_within(&self, node: usize, theta: f64, moved: Vector3) -> Option<f64> {
        let (pair, own) = self.pair(node)?;
        let [from, length] = self.record.step;
        let drive = own.course.at(from + length * theta).0;
        match pair.gap() {
            GapLaw::Fixed(law) => Some(law.gap(node, moved).distance),
            GapLaw::Revolution(law) => Some(law.gap(self.at(node, &drive), moved).distance),
            GapLaw::Spline(_) | GapLaw::Open(_) => {
                let ring = pair.gap().smooth_ring().filter(|_| own.carrier.is_none())?;
                // The ring has its shape at a point of the step.
                let end = own.course.at(from + length).0;
                if drive.shape_factor.to_bits() != end.shape_factor.to_bits() {
                    return None;
                }
                let mut distance = None;
                let near = NearNode { node, index: self.record.index(node), local: moved, guess: None };
                NearSearch::new(ring, &drive).find_gaps(iter::once(near), |_, gap| distance = Some(gap.distance));
                distance
            }
        }
    }

    fn sliding(&mut self, node: usize, point: usize, sliding: &SlidingState) -> Sliding {
        let Some(number) = self.record.pair_of[node] else { return Sliding::default() };
        let PairRecord { pair, drives, .. } = &self.record.pairs[number];
        let gap = self.pairs[*pair].gap();
        let at = self.at(node, &drives[point].0);
        if gap.slides_anywhere() {
            let known = self.record.slips[point][node].filter(|_| self.record.solutions > SOLUTIONS);
            let slip = known.unwrap_or_else(|| {
                let carriers = self.on_carrier(node, point, SurfacePlace::Now, |carrier, spot| {
                    carrier.sliding_distance_at(spot, point)
                });
                sliding.sliding_distance - carriers.unwrap_or_default()
            });
            let vibration = Vibration { node: slip, ..Vibration::default() };
            let over_step = gap.sliding(at, sliding.moved, vibration, sliding.normal);
            self.record.slips[point][node] = Some(slip);
            Sliding { speed: over_step.speed / sliding.duration, ..over_step }
        } else {
            let carriers = self.on_carrier(node, point, SurfacePlace::Begun, |carrier, spot| carrier.velocity_at(spot));
            let vibration = Vibration { node: sliding.velocity, surface: carriers.unwrap_or_default() };
            gap.sliding(at, sliding.moved, vibration, sliding.normal)
        }
    }

    fn sector(&self) -> usize {
        self.record.sector
    }

    fn angle(&self, node: usize, point: usize, moved: Vector3) -> f64 {
        let of = |(pair, own): (&ContactPair, &PairRecord)| {
            pair.gap().angle_on_casing(self.at(node, &own.drives[point].0), moved)
        };
        self.pair(node).map_or(0.0, of)
    }

    fn largest_displacement(&self, node: usize) -> f64 {
        self.pair(node).map_or(f64::INFINITY, |(pair, _)| pair.gap().largest_displacement())
    }

    fn turns(&self) -> bool {
        let mut pairs = self.record.pairs.iter().map(|own| &self.pairs[own.pair]);
        pairs.any(|pair| pair.gap().slides_anywhere() && pair.parts.parameters.friction != 0.0)
    }

    fn begin_solution(&mut self) {
        self.record.solutions += 1;
    }

    fn prepare_compliance(&mut self, lanes: Lanes, chosen: &[bool], normals: &[f64]) -> bool {
        if self.carriers.carriers.is_empty() {
            return false;
        }
        let block = self.carriers.step.block;
        self.carriers.carriers.iter_mut().for_each(|carrier| carrier.compliance.clear_lanes(block));
        for lane in (0..lanes.len()).filter(|lane| chosen[*lane]) {
            let (point, node) = lanes.place(lane);
            let normal = lanes.vector3(normals, lane);
            self.with_carrier_mut(node, point, |carrier, spot| {
                carrier.compliance.set_lane(block, lane, spot, normal);
            });
        }
        self.carriers.carriers.iter_mut().for_each(|carrier| carrier.compliance.find_modal_components(block, lanes));
        true
    }

    fn add_normal_compliance(&mut self, lane: usize, direction: Vector3, carrier_compliance: &mut [f64]) {
        carrier_compliance.fill(0.0);
        if let Some((carrier, step)) = self.carrier(lane) {
            carrier.compliance.add_normal_compliance(&carrier.body, step, lane, direction, carrier_compliance);
        }
    }

    fn add_compliance(&mut self, lane: usize, force: Vector3, carrier_compliance: &mut [f64]) {
        carrier_compliance.fill(0.0);
        if let Some((carrier, step)) = self.carrier(lane) {
            carrier.compliance.add_compliance(&carrier.body, step, lane, force, carrier_compliance);
        }
    }

    fn is_coupled(&self) -> bool {
        self.carriers.step.block < BLOCKS
    }

    fn add_force_change(&mut self, lane: usize, change: f64) {
        if let Some((carrier, step)) = self.carrier(lane) {
            carrier.compliance.add_force_change(step, lane, change);
        }
    }

    fn apply_force_changes(&mut self) {
        let CarriersInStep { carriers, step } = &mut self.carriers;
        carriers.iter_mut().for_each(|carrier| carrier.compliance.apply_force_changes(&carrier.body, *step));
    }

    fn gap_change(&self, lane: usize) -> f64 {
        let CarriersInStep { carriers, step } = &self.carriers;
        carriers.iter().map(|carrier| carrier.compliance.gap_change(*step, lane)).sum()
    }

    fn parameters(&self, node: usize) -> &ContactParameters {
        self.pair(node).map_or(&ContactParameters::FRICTIONLESS, |(pair, _)| &pair.parts.parameters)
    }

    fn drift(&self, node: usize, step_point: usize, moved: Vector3) -> Vector3 {
        let Some((pair, PairRecord { drives, .. })) = self.pair(node) else { return Vector3::zeros() };
        let ((_, before), (drive, now)) = (&drives[0], &drives[step_point]);
        let (gap, motion) = (pair.gap(), now.less(before));
        let at = self.at(node, drive);
        let point = gap.contact_point(at, moved, self.record.places[step_point][node]);
        let (spin, shaft) = (gap.spin_motion(at, point, &motion), gap.shaft_motion(at, point, &motion));
        let carriers = self.on_carrier(node, step_point, SurfacePlace::Now, |carrier, spot| {
            carrier.moved_at(spot, step_point) - carrier.moved_at(spot, 0)
        });
        spin + shaft - carriers.unwrap_or_default()
    }
}

impl Witness for ObstacleView<'_> {
    fn begin_step(&mut self, from: f64, length: f64, level: &StepTables, kind: ForceInterpolation) {
        let points: &[f64] = match kind {
            ForceInterpolation::Constant => &[0.0, 1.0],
            ForceInterpolation::Polynomial => &level.basis.points[..level.basis.count()],
        };
        for PairRecord { course, drives, .. } in &mut self.record.pairs {
            drives.iter_mut().zip(points).for_each(|(drive, theta)| *drive = course.at(from + length * theta));
        }
        (self.record.solutions, self.record.step) = (0, [from, length]);
        self.record.slips.iter_mut().for_each(|slips| slips.fill(None));
        self.record.located = false;
        self.record.lanes_of = self.enter_lanes(Lanes { points: points.len() - 1, nodes: self.record.pair_of.len() });
    }

    fn is_clear(&self, from: f64, length: f64, reach: &[f64]) -> bool {
        self.record.pairs.iter().all(|own| own.course.only_turns())
            && !self.any_node(from, length, |at, gap, end| !gap.is_clear(at, end, vector3_at(reach, at.node)))
    }

    fn may_come_closer(&self, from: f64, length: f64, reach: &[f64]) -> bool {
        let tolerance = self.record.tolerance;
        self.any_node(from, length, |at, gap, end| gap.approach(at, end, vector3_at(reach, at.node)) > tolerance)
    }

    fn largest_bends(&self, from: f64, length: f64) -> Option<[f64; 2]> {
        self.record.pairs.iter().try_fold([0.0_f64; 2], |most, own| {
            let is_known = own.course.only_turns() && own.carrier.is_none();
            let [start, end] = [from, from + length].map(|theta| own.course.at(theta).0);
            let turn = end.rotor_angle - start.rotor_angle;
            let bends = self.pairs[own.pair].gap().largest_bends(end.shape_factor, turn).filter(|_| is_known)?;
            Some([most[0].max(bends[0]), most[1].max(bends[1])])
        })
    }

    fn keep_places(&mut self) {
        let [first, second, ..] = &mut self.record.places;
        first.copy_from_slice(second);
    }

    fn needed_below(&self, node: usize) -> f64 {
        self.record.needed_below[node].min(self.record.tallies[node].lowest)
    }

    fn record_gaps(&mut self, level: &StepTables, trial: &Trial) {
        for node in 0..trial.nodes() {
            if self.record.pair_of[node].is_some() {
                self.record.tallies[node].lowest = self.lowest(trial, &level.basis, node);
            }
        }
    }

    fn record_damping(&mut self, damping_loss: f64) {
        self.record.damping += damping_loss;
    }

    fn closing_loss(&self) -> f64 {
        self.record.work.closing
    }

    fn guess_start_places(&mut self) {
        self.record.guess_start_places(self.pairs);
    }

    fn react(&mut self, node: usize, point: usize, force: Vector3) {
        self.record.act(node, point);
        self.with_carrier_mut(node, point, |carrier, spot| carrier.react(spot, point, force));
    }

    fn add_impulse(&mut self, node: usize, point: usize, impulse: Vector3) {
        self.with_carrier_mut(node, point, |carrier, spot| carrier.react(spot, 0, impulse));
    }

    fn record_step(&mut self, step: &AcceptedStep) {
        self.record.work.dropped += step.dropped;
        let (points, nodes) = (step.trial.points(), 0..step.trial.nodes());
        if nodes.clone().any(|node| (0..=points).any(|point| step.trial.multiplier(point, node) > 0.0)) {
            self.weigh_motions(step);
        }
        for node in nodes {
            let Some(pair) = self.record.pair_of[node] else { continue };
            self.record.tallies[node].lowest = self.lowest(step.trial, &step.level.basis, node);
            let comes = (1..=points).find(|i| step.trial.multiplier(*i, node) > 0.0);
            if comes.is_some_and(|i| self.was_behind(step.trial, node, pair, i)) {
                self.record.behind_edge = Some(node);
            }
            if (0..=points).any(|point| step.trial.multiplier(point, node) > 0.0) {
                self.enter(step, node, pair);
            }
        }
        for places in [&mut self.record.places, &mut self.record.acted] {
            let [first, rest @ ..] = places;
            first.copy_from_slice(&rest[points - 1]);
        }
    }
}

/// Number of iterations of the search for the smallest gap between points by a parabola through three gaps.
const PARABOLAS: usize = 4;
/// Factor by which the points move closer in each iteration.
const CLOSER: f64 = 0.25;

impl ObstacleView<'_> {
    /// Smallest gap of a node (m) so far, at the points of a step, and between them if it stays open.
    fn lowest(&self, trial: &Trial, basis: &TimeBasis, node: usize) -> f64 {
        let so_far = self.record.tallies[node].lowest;
        if let Some(minimum) = trial.followed_minimum(node) {
            return so_far.min(minimum).min(trial.gap(trial.points(), node));
        }
        let lowest = (1..=trial.points()).map(|point| trial.gap(point, node)).fold(so_far, f64::min);
        match trial.minimum(node) {
            Some(theta) => lowest.min(self.lowest_near(trial, basis, node, theta)),
            _ => lowest,
        }
    }

    /// Smallest gap of a node (m) within a step, near `theta`.
    ///
    /// A surface of revolution and the displacements are not polynomials of time, so gaps are evaluated. Gaps to other surfaces
    /// are a polynomial.
    fn lowest_near(&self, trial: &Trial, basis: &TimeBasis, node: usize, theta: f64) -> f64 {
        let of_spline = |(pair, _): (&ContactPair, &PairRecord)| pair.gap().spline().is_some();
        if !self.carriers.carriers.is_empty() && self.pair(node).is_some_and(of_spline) {
            // The gap is a polynomial whose minimum is at `theta`.
            return trial.gap_within(basis, node, theta);
        }
        let mut lowest = f64::INFINITY;
        let mut look = |theta: f64| {
            let moved = trial.displacement_within(basis, node, theta);
            let gap = self.gap_within(node, theta, moved).unwrap_or_else(|| trial.gap_within(basis, node, theta));
            lowest = lowest.min(gap);
            gap
        };
        let (mut theta, mut apart) = (theta, 0.1);
        for _ in 0..PARABOLAS {
            theta = theta.clamp(apart, 1.0 - apart);
            let [before, here, after] = [theta - apart, theta, theta + apart].map(&mut look);
            let bend = before - 2.0 * here + after;
            let downhill = if before < after { -1.0 } else { 1.0 };
            let vertex = if bend > 0.0 { 0.5 * (before - after) / bend } else { downhill };
            theta += apart * vertex.clamp(-1.0, 1.0);
            apart *= CLOSER;
        }
        look(theta.clamp(0.0, 1.0));
        lowest
    }

    /// Returns whether a node that touches at point `i` faced no surface before and was behind the surface extrapolated
    /// beyond its edge.
    fn was_behind(&self, trial: &Trial, node: usize, pair: usize, i: usize) -> bool {
        let GapLaw::Open(open) = self.pairs[self.record.pairs[pair].pair].gap() else { return false };
        if trial.gap(i - 1, node).is_finite() {
            return false;
        }
        let moved = trial.displacement(i, node) - trial.displacement(i - 1, node);
        let carriers = self.on_carrier(node, i, SurfacePlace::Now, |carrier, spot| {
            carrier.moved_at(spot, i) - carrier.moved_at(spot, i - 1)
        });
        open.was_behind(moved - carriers.unwrap_or_default(), trial.normal(i, node), trial.gap(i, node))
    }

    /// Computes Σ_k S_ik of the prescribed motion of a pair at the points, for each point i of the step.
    fn weigh_motions(&mut self, step: &AcceptedStep) {
        let points = 0..=step.trial.points();
        for PairRecord { drives, motions, .. } in &mut self.record.pairs {
            for i in points.clone() {
                let weights = step.kind.work_weights(&step.level.basis, i);
                let terms = points.clone().map(|k| drives[k].1.less(&drives[0].1).over(weights[k]));
                motions[i] = terms.fold(MotionIncrement::default(), |sum, term| sum.since(&term));
            }
        }
    }

    /// Records forces and work of an active node over a step. All work is linear in displacements and motion, which are weighted first.
    fn enter(&mut self, step: &AcceptedStep, node: usize, pair: usize) {
        let (trial, basis) = (step.trial, &step.level.basis);
        let (mut tally, mut work) = (self.record.tallies[node], self.record.work);
        let PairRecord { pair, drives, motions, .. } = &self.record.pairs[pair];
        let (gap, slides) = (self.pairs[*pair].gap(), self.pairs[*pair].parts.parameters.friction != 0.0);
        tally.peak = tally.peak.max(trial.peak(basis, step.kind, node));
        let mut heats = 0.0;
        for i in (0..=trial.points()).filter(|i| trial.multiplier(*i, node) != 0.0) {
            let multiplier = trial.multiplier(i, node);
            let at = self.at(node, &drives[i].0);
            let (force, normal, moved) = (trial.force(i, node), trial.normal(i, node), trial.displacement(i, node));
            let place = self.record.places[i][node];
            let point = gap.contact_point(at, moved, place);
            self.record.implausible |= !gap.is_plausible(node, trial.gap(i, node), normal);
            // With the normal for which the force was found: the effect of its rotation since then is curvature work, not heat.
            let tangential = trial.friction_force(i, node);
            let is_real = slides || tangential.amax() > FORCE_ROUNDING * multiplier;
            let tangential = if is_real { tangential } else { Vector3::zeros() };
            let wrench = gap.wrench(at, point, force);
            let duration = step.level.step * step.kind.weight(basis, i);
            let weights = step.kind.work_weights(basis, i);
            let (mut moved, mut open) = (Vector3::zeros(), 0.0);
            for k in (0..=trial.points()).filter(|k| weights[*k] != 0.0) {
                moved += weights[k] * trial.displacement(k, node);
                open += weights[k] * trial.finite_gap(k, node);
            }
            let carried = self.on_carrier(node, i, SurfacePlace::Acted, |carrier, spot| carrier.worked_at(spot, i));
            let acting = WorkingForce {
                gap,
                at,
                point,
                place,
                normal,
                multiplier,
                force,
                tangential,
                fixed: wrench.force,
                motion: &motions[i],
                moved: moved - carried.unwrap_or_default(),
                approach: -open,
            };
            tally.add(duration, &acting, &wrench);
            let done = acting.work();
            tally.heat += done.heat;
            heats += done.heat;
            work.add(&done);
        }
        if heats < 0.0 && trial.sticks() {
            // The force at the start does not belong to the slip of the step; the energy it supplies comes from earlier impact losses.
            work.heat -= heats;
            tally.heat -= heats;
            work.closing += heats;
        }
        (self.record.tallies[node], self.record.work) = (tally, work);
    }
}
