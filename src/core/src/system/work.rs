//! Entries of a step in the energy ledger.

use super::{ContactEvent, StepFailure, System};
use crate::geometry::surface_spline::ClosestPoint;
use crate::geometry::wrench::{At, MotionIncrement};
use crate::geometry::{GapLaw, Vector3};
use crate::system::history::{Two, When};
use crate::system::ledger::Ledger;

/// Work of contacts over a step (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ContactWork {
    /// Work of the shaft.
    pub shaft: f64,
    /// Work of whirl.
    pub whirl: f64,
    /// Work of axial shift.
    pub shift: f64,
    /// Work of the casing.
    pub casing: f64,
    /// Friction heat.
    pub heat: f64,
    /// Energy supplied by friction of contacts that may stick, and by cutting (≤ 0), when the tip reverses between the two steps
    /// that are averaged.
    pub turned: f64,
    /// Work of cutting the coating.
    pub cut: f64,
    /// Part of `turned` that is cutting (≤ 0), because a tip that moves backwards cuts nothing.
    pub uncut: f64,
    /// Energy lost by gaps that close.
    pub closing: f64,
    /// Part of `closing` that a coating absorbs.
    pub worn: f64,
    /// Energy lost by changes to a constant force within a step.
    pub dropped: f64,
    /// Work in the scheme, on both structures.
    pub exact: f64,
    /// Magnitudes of the work of all inputs.
    pub turnover: f64,
    /// Magnitude of the work on both structures.
    pub moved: f64,
}

impl ContactWork {
    /// Sums over the contacts of one set in one step need no compensation, unlike the sums over all steps.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        self.shaft += other.shaft;
        self.whirl += other.whirl;
        self.shift += other.shift;
        self.casing += other.casing;
        self.heat += other.heat;
        self.turned += other.turned;
        self.cut += other.cut;
        self.uncut += other.uncut;
        self.closing += other.closing;
        self.worn += other.worn;
        self.dropped += other.dropped;
        self.exact += other.exact;
        self.turnover += other.turnover;
        self.moved += other.moved;
    }

    /// Returns the remaining work, which is curvature work.
    fn curvature(&self) -> f64 {
        self.exact + self.heat + self.cut + self.closing - (self.shaft + self.whirl + self.shift + self.casing)
    }

    /// Adds the work to a ledger. The energy that friction supplies to a tip reversed by an impact is deducted from the impact loss; the
    /// rest, of tips that reverse while they stay closed, vanishes with the step and is part of the curvature work.
    pub fn enter(mut self, ledger: &mut Ledger) {
        if self.turned != 0.0 {
            self.closing = self.worn + (self.closing - self.worn + self.turned).max(0.0);
        }
        ledger.wear_work.add(self.worn);
        ledger.impact_loss.add(self.closing - self.worn + self.dropped);
        ledger.friction_loss.add(self.heat);
        ledger.cutting_work.add(self.cut);
        ledger.shaft_work.add(self.shaft);
        ledger.whirl_work.add(self.whirl);
        ledger.shift_work.add(self.shift);
        ledger.casing_work.add(self.casing);
        ledger.curvature_work.add(self.curvature());
        ledger.turnover.add(self.turnover);
        ledger.contact_work.add(self.moved);
    }
}

/// A contact force, and the motion over which it does work.
///
/// The work on both structures is f·u with the relative displacement u. It equals the work of inputs (force times prescribed motion) less
/// the friction heat (friction force times slip) and the loss of the approach (λ times the decrease of the gap), except for curvature work
/// within the step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WorkingForce<'a> {
    /// Gap function of the contact, and its node.
    pub gap: &'a GapLaw,
    /// Node, and prescribed motion when the force acts.
    pub at: At<'a>,
    /// Data of the contact point ([`GapLaw::contact_point`]), and its closest point on the surface.
    pub point: Vector3,
    /// Closest point on the surface.
    pub place: ClosestPoint,
    /// Unit normal for which the gap was found.
    pub normal: Vector3,
    /// Multiplier λ (N).
    pub multiplier: f64,
    /// Force on the structure (N).
    pub force: Vector3,
    /// Part of the force that is not along the normal for which it was found (N).
    pub tangential: Vector3,
    /// Force in fixed directions (N).
    pub fixed: Vector3,
    /// Prescribed motion over which the force does work.
    pub motion: &'a MotionIncrement,
    /// Displacement relative to the surface over which the force does work (m).
    pub moved: Vector3,
    /// Decrease of the gap over which λ does work (m).
    pub approach: f64,
}

impl WorkingForce<'_> {
    /// Work of the force; friction is heat, and all of the approach is a loss.
    #[inline(always)]
    pub fn work(&self) -> ContactWork {
        let spin = self.gap.spin_motion(self.at, self.point, self.motion);
        let shaft = self.gap.shaft_motion(self.at, self.point, self.motion);
        let surface = self.gap.surface_motion(self.at, self.point, self.normal, self.place, self.motion);
        let slip = self.moved + spin + shaft;
        let (fixed, across) = (self.fixed, self.motion.shaft);
        let exact = self.force.dot(&self.moved);
        let mut work = ContactWork {
            shaft: -self.force.dot(&spin),
            whirl: -(fixed[0] * across[0] + fixed[1] * across[1]),
            shift: -fixed[2] * across[2],
            casing: self.multiplier * surface,
            heat: -self.tangential.dot(&slip),
            closing: self.multiplier * self.approach,
            exact,
            moved: exact.abs(),
            ..ContactWork::default()
        };
        work.turnover = work.shaft.abs() + work.whirl.abs() + work.shift.abs() + work.casing.abs();
        work
    }
}

impl System {
    /// Records the work of all contacts that acted over the last step, after checking that each gap is a distance, and the work of loads.
    ///
    /// # Errors
    /// [`StepFailure::Unexplained`] for the first contact whose gap is not a distance.
    pub(crate) fn enter_work(&mut self) -> Result<(), StepFailure> {
        let when = self.when_acted();
        let mut events = std::mem::take(&mut self.events);
        let acted = if when == When::Now { &mut events.now } else { &mut events.before };
        let outcome = match self.sets.count() {
            1 => self.enter_contacts::<false>(acted, when),
            _ => self.enter_contacts::<true>(acted, when),
        };
        self.events = events;
        self.enter_loads();
        outcome
    }

    /// Records the contacts of the only set, or of several sets (`SEVERAL`).
    fn enter_contacts<const SEVERAL: bool>(
        &mut self,
        events: &mut [ContactEvent],
        when: When,
    ) -> Result<(), StepFailure> {
        let (mut of, mut motion, mut explained, mut outcome) = (usize::MAX, MotionIncrement::default(), 0.0, Ok(()));
        let mut set = 0;
        let mut total = ContactWork::default();
        for event in &mut *events {
            if event.pair != of {
                of = event.pair;
                let own = self.sets.of(event.structure);
                if SEVERAL && own != set {
                    self.enter(set, total);
                    (set, total) = (own, ContactWork::default());
                }
                let Two { now, before } = &self.pairs[of].prescribed.motion;
                motion = now.centred(before);
                explained = self.explained_by_drive(of);
            }
            let moved = self.relative_motion(event, when);
            outcome = self.witness(event, moved, explained);
            if outcome.is_err() {
                break;
            }
            let work = self.work_of(event, moved, &motion, when);
            event.friction_heat = work.heat;
            if event.tangential > 0.0 {
                // A tip that moves backwards cuts nothing, so no distance is counted.
                event.slid = ((work.heat + work.cut + work.turned) / event.tangential).max(0.0);
            }
            total.add(&work);
        }
        if !events.is_empty() {
            self.enter(set, total);
        }
        outcome
    }

    /// Returns the step in which the contacts that acted over the last step were found.
    pub(crate) fn when_acted(&self) -> When {
        if self.settings.scheme.properties().delays_contact { When::Before } else { When::Now }
    }

    /// Removes the coating that blades have cut over the last step.
    pub(crate) fn remove_cut(&mut self) {
        for (group, ledger) in self.groups.iter_mut().zip(&mut self.counted.ledgers) {
            let Some(structure) = group.structures().next() else { continue };
            let Some(coating) = group.law.coating_mut().filter(|coating| coating.is_cut()) else { continue };
            for event in self.events.now.iter().filter(|event| event.structure == structure) {
                let place = self.pairs[event.pair].nodes().iter().position(|node| *node == event.node);
                place.into_iter().for_each(|node| coating.slid(event.sector, node, event.slid));
            }
            ledger.wear_energy.add(coating.cut());
        }
    }

    fn enter_loads(&mut self) {
        for (set, ledger) in self.counted.ledgers.iter_mut().enumerate() {
            let mut done = [0.0; 3];
            for member in self.sets.members(set) {
                let modes = self.structures[*member].modes_mut();
                let (loads, excitation) = (modes.finish_loads(), modes.finish_excitation());
                let own = [modes.finish_stiffening(), excitation, loads];
                done.iter_mut().zip(own).for_each(|(sum, work)| *sum += work);
            }
            let Ledger { stiffening_work, excitation_work, load_work, turnover, .. } = ledger;
            let sums = [stiffening_work, excitation_work, load_work].into_iter().zip(done);
            for (sum, work) in sums.filter(|(_, work)| *work != 0.0) {
                sum.add(work);
                turnover.add(work.abs());
            }
        }
    }

    /// Adds the work of all contacts of a set in a step to its ledger.
    fn enter(&mut self, set: usize, work: ContactWork) {
        work.enter(&mut self.counted.ledgers[set]);
        self.counted.taken[set].uncut -= work.uncut;
    }

    /// Work of a contact over a step, for which its motion over the last two steps is averaged. With a coating, its rods absorb the loss
    /// of the approach.
    fn work_of(&self, event: &ContactEvent, moved: Vector3, motion: &MotionIncrement, when: When) -> ContactWork {
        let (structure, pair) = (&self.structures[event.structure], &self.pairs[event.pair]);
        let (node, index) = (event.node, structure.index(event.node, event.sector));
        let (geometry, gaps) = (structure.history.geometry.at(when), &structure.history.gap);
        let normal = geometry.normal_at(index);
        // A node that passes a free edge had no gap to close, so its motion is the approach.
        let (now, oldest) = (gaps.now[index], gaps.oldest[index]);
        let approach = if oldest.is_finite() { -0.5 * (now - oldest) } else { -normal.dot(&moved) };
        let force = WorkingForce {
            gap: pair.gap(),
            at: At { node, index, drive: pair.prescribed.drive.at(when) },
            point: event.point,
            place: geometry.place_at(index),
            normal,
            multiplier: event.normal,
            force: event.force,
            tangential: event.force - event.normal * normal,
            fixed: event.wrench.force,
            motion,
            moved,
            approach,
        };
        let work = force.work();
        let opposed = work.heat;
        let cutting = pair.parts.parameters.cutting;
        let cut = if cutting > 0.0 { opposed * share_cut(event, cutting) } else { 0.0 };
        let heat = opposed - cut;
        let turned = if self.settings.solver.sticks() { heat.min(0.0) } else { 0.0 };
        let uncut = cut.min(0.0);
        ContactWork {
            heat: heat - turned,
            turned: turned + uncut,
            cut: cut - uncut,
            uncut,
            worn: event.coating * approach,
            ..work
        }
    }

    /// Half the displacement of a node relative to its surface over the last two steps (m), in the directions of the node.
    #[inline(always)]
    pub(crate) fn relative_motion(&self, event: &ContactEvent, when: When) -> Vector3 {
        let structure = &self.structures[event.structure];
        let now = structure.vector3(structure.modes().displacement(), event.node, event.sector);
        let oldest = structure.vector3(&structure.history.passing.oldest, event.node, event.sector);
        let moved = 0.5 * (now - oldest);
        let pair = &self.pairs[event.pair];
        if pair.carrier().is_none() { moved } else { self.less_of_carrier(event, when, moved) }
    }

    /// Not inlined, because contacts on rigid surfaces never call it.
    #[inline(never)]
    fn less_of_carrier(&self, event: &ContactEvent, when: When, moved: Vector3) -> Vector3 {
        let (pair, index) = (&self.pairs[event.pair], self.structures[event.structure].index(event.node, event.sector));
        let place = self.structures[event.structure].history.geometry.at(when).places[index];
        let Some(spot) = pair.spot(index, place, pair.prescribed.drive.at(when).rotor_angle) else { return moved };
        let carrier = &self.structures[spot.carrier.structure];
        let (now, oldest) = (carrier.modes().displacement(), &carrier.history.passing.oldest);
        moved - spot.interpolate(|row| 0.5 * (now[row] - oldest[row]))
    }
}

/// Fraction of the tangential force of a contact that cuts.
fn share_cut(event: &ContactEvent, tangential: f64) -> f64 {
    if event.tangential > 0.0 { (tangential * event.coating / event.tangential).min(1.0) } else { 0.0 }
}
