//! The energy ledger's entries of a step.

use super::pair::{When, at_place};
use super::{ContactEvent, StepFailure, System};
use crate::gaps::wrench::{At, MotionIncrement};
use crate::gaps::{Geometry, dot};
use crate::settings::Solver;

/// Work of one contact over a step (J).
#[derive(Debug, Clone, Copy, Default)]
struct ContactWork {
    shaft: f64,
    whirl: f64,
    shift: f64,
    casing: f64,
    heat: f64,
    /// Friction that gives, of contacts that may stick, and cutting that gives (≤ 0): the tip turns round between the two steps whose mean
    /// is booked.
    turned: f64,
    /// Against what is cut off.
    cut: f64,
    /// Part of `turned` that is cutting (≤ 0): a tip that goes back cuts nothing.
    uncut: f64,
    /// Energy lost by the node that stops at the surface (J).
    closing: f64,
    /// The part of it that a coating takes.
    worn: f64,
    /// By the scheme, on both structures.
    exact: f64,
    /// Magnitudes of the work of all inputs.
    turnover: f64,
    /// Magnitude of the work on both structures.
    moved: f64,
}

impl ContactWork {
    /// Sums over the contacts of one set in one step need no compensation: those over all steps have it.
    #[inline(always)]
    fn add(&mut self, other: &Self) {
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
        self.exact += other.exact;
        self.turnover += other.turnover;
        self.moved += other.moved;
    }

    /// Returns the rest of the work, which is curvature work.
    fn curvature(&self) -> f64 {
        self.exact + self.heat + self.cut + self.closing - (self.shaft + self.whirl + self.shift + self.casing)
    }

    /// A tip that an impact turns round within a step takes what friction gives from what the impact costs. The rest, of tips that turn
    /// round while they stay closed, vanishes with the step and is left to what has no other name.
    fn settle(&mut self) {
        if self.turned != 0.0 {
            self.closing = self.worn + (self.closing - self.worn + self.turned).max(0.0);
        }
    }
}

impl System {
    /// Enter the work of all contacts that acted over the step just done, each after a look at whether its gap is a distance, and of
    /// loads beside contact.
    ///
    /// # Errors
    /// [`StepFailure::Unexplained`] for the first whose gap is not.
    pub(crate) fn enter_work(&mut self) -> Result<(), StepFailure> {
        let when = self.when_acted();
        let mut events = std::mem::take(self.acted_mut(when));
        let outcome = match self.sets.count() {
            1 => self.enter_contacts::<false>(&mut events, when),
            _ => self.enter_contacts::<true>(&mut events, when),
        };
        *self.acted_mut(when) = events;
        self.enter_loads();
        outcome
    }

    /// The contacts of the only set, or set by set of `SEVERAL`.
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
                motion = self.pairs[of].motion().centred(self.pairs[of].motion_before());
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
                // What goes back cuts nothing, and is not paid for.
                event.slid = ((work.heat + work.cut + work.turned) / event.tangential).max(0.0);
            }
            total.add(&work);
        }
        if !events.is_empty() {
            self.enter(set, total);
        }
        outcome
    }

    fn acted_mut(&mut self, when: When) -> &mut Vec<ContactEvent> {
        match when {
            When::Now => &mut self.events.now,
            When::Before => &mut self.events.before,
        }
    }

    /// When the contacts that acted over the last step were found.
    pub(super) fn when_acted(&self) -> When {
        if self.settings.scheme.acts_later() { When::Before } else { When::Now }
    }

    /// Remove what blades have cut on their way over the step just done.
    pub(crate) fn remove_cut(&mut self) {
        for (group, ledger) in self.groups.iter_mut().zip(&mut self.counted.ledgers) {
            let Some(structure) = group.structures().next() else { continue };
            let Some(coating) = group.law_mut().coating_mut().filter(|coating| coating.is_cut()) else { continue };
            for event in self.events.now.iter().filter(|event| event.structure == structure) {
                let place = self.pairs[event.pair].nodes().iter().position(|node| *node == event.node);
                place.into_iter().for_each(|node| coating.slid(event.sector, node, event.slid));
            }
            ledger.wear_energy.add(coating.cut());
        }
    }

    fn enter_loads(&mut self) {
        for (set, ledger) in self.counted.ledgers.iter_mut().enumerate() {
            let (mut work, mut excitation, mut stiffening) = (0.0, 0.0, 0.0);
            for member in self.sets.members(set) {
                work += self.structures[*member].modes_mut().finish_loads();
                excitation += self.structures[*member].modes_mut().finish_excitation();
                stiffening += self.structures[*member].modes_mut().finish_stiffening();
            }
            if stiffening != 0.0 {
                ledger.stiffening_work.add(stiffening);
                ledger.turnover.add(stiffening.abs());
            }
            if excitation != 0.0 {
                ledger.excitation_work.add(excitation);
                ledger.turnover.add(excitation.abs());
            }
            if work != 0.0 {
                ledger.load_work.add(work);
                ledger.turnover.add(work.abs());
            }
        }
    }

    /// Enter the work of all contacts of a set in a step into its ledger.
    fn enter(&mut self, set: usize, mut work: ContactWork) {
        work.settle();
        let ledger = &mut self.counted.ledgers[set];
        ledger.wear_work.add(work.worn);
        ledger.impact_loss.add(work.closing - work.worn);
        ledger.friction_loss.add(work.heat);
        ledger.cutting_work.add(work.cut);
        ledger.shaft_work.add(work.shaft);
        ledger.whirl_work.add(work.whirl);
        ledger.shift_work.add(work.shift);
        ledger.casing_work.add(work.casing);
        ledger.curvature_work.add(work.curvature());
        ledger.turnover.add(work.turnover);
        ledger.contact_work.add(work.moved);
        self.counted.taken[set].uncut -= work.uncut;
    }

    /// The work on both structures is f·(u⁺ − u⁻)/2 with u the relative displacement. It is what inputs do, force times
    /// prescribed motion, less the friction heat, friction force times slip, and what the approach of the node costs, λ
    /// times half the change of gap, but for what turns and curves within the step. On a coating the approach is what its
    /// rods absorb.
    fn work_of(&self, event: &ContactEvent, moved: [f64; 3], motion: &MotionIncrement, when: When) -> ContactWork {
        let (structure, pair) = (&self.structures[event.structure], &self.pairs[event.pair]);
        let (node, index) = (event.node, structure.index(event.node, event.sector));
        let (geometry, gaps) = (self.geometry_of(event, when), &structure.history.gap);
        let (normal, at) = (geometry.normal_at(index), At { node, index, drive: pair.drive(when) });
        let tangential: [f64; 3] = std::array::from_fn(|i| event.force[i] - event.normal * normal[i]);
        let spin = pair.gap().spin_motion(at, event.point, motion);
        let shaft = pair.gap().shaft_motion(at, event.point, motion);
        let surface = pair.gap().surface_motion(at, event.point, normal, geometry.place_at(index), motion);
        let slip: [f64; 3] = std::array::from_fn(|i| moved[i] + spin[i] + shaft[i]);
        // A node that comes over a free edge had no gap to close: its motion is the approach.
        let (now, oldest) = (gaps.now[index], gaps.oldest[index]);
        let approach = if oldest.is_finite() { -0.5 * (now - oldest) } else { -dot(normal, moved) };
        let ([x, y, z], across) = (event.wrench.force, motion.shaft);
        let (shaft, casing) = (-dot(event.force, spin), event.normal * surface);
        let opposed = -dot(tangential, slip);
        let cut = if pair.cutting() > 0.0 { opposed * share_cut(event, pair.cutting()) } else { 0.0 };
        let (whirl, shift) = (-(x * across[0] + y * across[1]), -z * across[2]);
        let (heat, exact) = (opposed - cut, dot(event.force, moved));
        let turned = if self.settings.solver == Solver::Coulomb { heat.min(0.0) } else { 0.0 };
        let uncut = cut.min(0.0);
        ContactWork {
            shaft,
            whirl,
            shift,
            casing,
            heat: heat - turned,
            turned: turned + uncut,
            cut: cut - uncut,
            uncut,
            closing: event.normal * approach,
            worn: event.coating * approach,
            exact,
            turnover: shaft.abs() + whirl.abs() + shift.abs() + casing.abs(),
            moved: exact.abs(),
        }
    }

    /// Normals and places that a contact was found with.
    fn geometry_of(&self, event: &ContactEvent, when: When) -> &Geometry {
        let geometry = &self.structures[event.structure].history.geometry;
        match when {
            When::Now => &geometry.now,
            When::Before => &geometry.before,
        }
    }

    /// Half the displacement of a node relative to its surface over the last two steps (m), in its own directions.
    #[inline(always)]
    pub(super) fn relative_motion(&self, event: &ContactEvent, when: When) -> [f64; 3] {
        let structure = &self.structures[event.structure];
        let now = structure.vector3(structure.modes().displacement(), event.node, event.sector);
        let oldest = structure.vector3(&structure.history.passing.oldest, event.node, event.sector);
        let moved: [f64; 3] = std::array::from_fn(|i| 0.5 * (now[i] - oldest[i]));
        let pair = &self.pairs[event.pair];
        if pair.carrier().is_none() { moved } else { self.less_of_carrier(event, when, moved) }
    }

    /// Out of line: on rigid surfaces contacts never get here.
    #[inline(never)]
    fn less_of_carrier(&self, event: &ContactEvent, when: When, moved: [f64; 3]) -> [f64; 3] {
        let (pair, index) = (&self.pairs[event.pair], self.structures[event.structure].index(event.node, event.sector));
        let Some(surface) = pair.carried() else { return moved };
        let under = &self.structures[surface.1.structure];
        let (now, oldest) = (under.modes().displacement(), &under.history.passing.oldest);
        let frame = pair.frame(index, pair.drive(when).rotor_angle);
        let place = self.geometry_of(event, when).places[index];
        let carried = at_place(surface, place, frame, |row| 0.5 * (now[row] - oldest[row]));
        std::array::from_fn(|i| moved[i] - carried[i])
    }
}

/// Part of the tangential force of a contact that cuts.
fn share_cut(event: &ContactEvent, tangential: f64) -> f64 {
    if event.tangential > 0.0 { (tangential * event.coating / event.tangential).min(1.0) } else { 0.0 }
}
