//! What carries a running state on: another step size, saving and restoring, and ways over an edge.

use super::{ContactEvent, Member, Slave, StepFailure, System, frame_of};
use crate::contact::gap::{GapLaw, dot};
use crate::contact::spline::ClosestPoint;
use crate::contact::wrench::At;
use crate::persist::{Persist, Reader, Writer};

/// A contact force is continued over steps at most this many times as long as the one it was found in.
const FORCE_REACH: f64 = 4.0;
/// Gaps are closed up to this share of what says nothing ([`GapLaw::indifferent`]).
const CLOSED: f64 = 1e-9;
/// How far behind a surface, continued beyond its edge, a node may have been: share of its way in the step, since the surface
/// may bend, and of the largest displacement that counts as small.
const BEHIND_EDGE: [f64; 2] = [1e-3, 1e-6];
/// Curvature work beyond this share of all energy exchanged is more than an error of truncation.
const MOST_CURVATURE: f64 = 0.5;

impl System {
    /// Use step size `step` (s) from here. A running state is carried over by resampling the modal motion under
    /// the last contact force; the energy this adds is booked in the ledger.
    ///
    /// Only a force that lasts is continued: that of a contact closed at both ends of the last step. The multiplier of
    /// an impact is p/h, an impulse that is over, and means nothing over a step of another length. A much longer
    /// step reaches back to times of which the last force knows nothing; there it fades out.
    pub fn set_step(&mut self, step: f64) {
        let old = self.bank.step();
        if old > 0.0 && self.state.steps > 0 {
            let before = self.mechanical_energy();
            self.lasting_force(old, step);
            self.bank.resample(self.settings.scheme, step, &self.displacement_oldest);
            self.resample_slaves(step);
            // The gap of the step before is continued along its own slope, not along the motion of the modes.
            self.state.witnessed = self.state.steps + 2;
            let ratio = step / old;
            self.state.motion = self.state.motion.over(ratio);
            for (before, now) in self.state.gap_before.iter_mut().zip(&self.state.gap) {
                if now.is_finite() {
                    *before = now - ratio * (now - *before);
                }
            }
            let after = self.mechanical_energy();
            self.state.ledger.step_change.add(after - before);
            self.state.ledger.turnover.add((after - before).abs());
        } else {
            self.bank.set_step(self.settings.scheme, step);
            self.slaves.iter_mut().for_each(|slave| slave.set_step(self.settings.scheme, step));
        }
    }

    /// Kinetic and strain energy of all structures at this instant (J): ½q̇ᵀMq̇ with the velocity of the instant, ½qᵀKq. Between
    /// steps only.
    pub fn energies_now(&mut self) -> (f64, f64) {
        let step = self.bank.step();
        self.lasting_force(step, step);
        self.spread_lasting();
        let own = self.bank.energies_now(&self.displacement_oldest);
        let slaves = self.slaves.iter_mut().map(Slave::energies_now);
        slaves.fold(own, |sum, slave| (sum.0 + slave.0, sum.1 + slave.1))
    }

    fn resample_slaves(&mut self, step: f64) {
        self.spread_lasting();
        self.slaves.iter_mut().for_each(|slave| slave.carry_over(self.settings.scheme, step));
    }

    /// The same forces act on the slaves, where the last step found them.
    fn spread_lasting(&mut self) {
        if self.slaves.is_empty() {
            return;
        }
        let lanes = self.lanes;
        self.slaves.iter_mut().for_each(Slave::clear_lasting);
        for index in 0..self.state.gap.len() {
            let (node, sector) = (index / lanes, index % lanes);
            let force: [f64; 3] = std::array::from_fn(|i| self.displacement_oldest[(3 * node + i) * lanes + sector]);
            if let (true, Some((surface, carrier))) =
                (force.iter().any(|value| *value != 0.0), self.law.spline_of(node))
            {
                let frame = frame_of(&self.law, index, self.state.drive.rotor_angle);
                self.slaves[carrier].add_lasting(surface, self.state.geometry.places[index], frame, force);
            }
        }
    }

    /// Leaves in `displacement_oldest` (scratch between steps) the contact forces without those of impacts.
    fn lasting_force(&mut self, old: f64, new: f64) {
        let lanes = self.lanes;
        let reach = (FORCE_REACH * old / new).min(1.0);
        for (lasting, force) in self.displacement_oldest.iter_mut().zip(&self.state.force) {
            *lasting = reach * reach * force;
        }
        for (index, gap) in self.state.gap_before.iter().enumerate() {
            // `film` closes gaps up to rounding.
            let closed = CLOSED * self.law.indifferent(index / lanes);
            let lasts = *gap <= closed && self.state.gap[index] <= closed;
            if !lasts {
                let (node, sector) = (index / lanes, index % lanes);
                for component in 0..3 {
                    self.displacement_oldest[(3 * node + component) * lanes + sector] = 0.0;
                }
            }
        }
    }

    /// A node of a free master that moves far in one step could pass a surface, or its edge, between two looks.
    pub(super) fn check_travel(&self) -> Result<(), StepFailure> {
        let GapLaw::Free(law) = &self.law else { return Ok(()) };
        let (now, before) = (self.bank.displacement(), self.bank.displacement_before());
        let mut moved = now.iter().zip(before).map(|(now, before)| (now - before).abs());
        if moved.any(|moved| moved > law.largest()) { Err(StepFailure::TooFast) } else { Ok(()) }
    }

    /// A node that comes over a free edge was in front of the surface, continued beyond the edge; else it is a start in
    /// penetration, an impact of arbitrary strength.
    ///
    /// A surface around an axis goes on beyond its edge, and a node further out ends the run.
    pub(super) fn check_edges(&self) -> Result<(), StepFailure> {
        if let Some(index) = self.law.out_of_reach() {
            return Err(StepFailure::OutOfReach { node: index / self.lanes, sector: index % self.lanes });
        }
        let GapLaw::Free(law) = &self.law else { return Ok(()) };
        for (node, (gap, before)) in self.state.gap.iter().zip(&self.state.gap_before).enumerate() {
            if *gap < 0.0 && before.is_infinite() {
                let moved = self.slip_of_deformation(Member { node, sector: 0, index: node });
                let approach = dot(moved, self.state.geometry.normal_at(node));
                let travel = dot(moved, moved).sqrt();
                if gap - approach < -(BEHIND_EDGE[0] * travel + BEHIND_EDGE[1] * law.largest()) {
                    return Err(StepFailure::BehindEdge { node });
                }
            }
        }
        Ok(())
    }

    /// Whether curvature work, which no input does, is still small beside what was exchanged; at the end of a communication
    /// step.
    ///
    /// # Errors
    /// It is not: [`StepFailure::Unbalanced`].
    pub fn check_books(&self) -> Result<(), StepFailure> {
        let ledger = &self.state.ledger;
        let curved = ledger.curvature_work.value();
        if curved.abs() > MOST_CURVATURE * ledger.exchanged() {
            return Err(StepFailure::Unbalanced { work: curved, exchanged: ledger.exchanged() });
        }
        Ok(())
    }

    /// Write everything that determines the future, the step size included.
    pub fn save(&self, writer: &mut Writer) {
        self.bank.step().save(writer);
        self.bank.save(writer);
        self.slaves.iter().for_each(|slave| slave.save(writer));
        if let Some((coating, _)) = &self.coating {
            coating.save(writer);
        }
        self.state.save(writer);
    }

    /// Pass over a saved state and refuse what is none; returns its step size (s) and how many of its gaps are infinite. Before
    /// the start, gaps are not known.
    pub fn check(&self, reader: &mut Reader, started: bool) -> (f64, usize) {
        let mut step = 0.0_f64;
        step.restore(reader);
        if !(0.0..=f64::MAX).contains(&step) {
            reader.refuse("its internal step is no length of time");
        }
        self.bank.check(reader);
        self.slaves.iter().for_each(|slave| slave.check(reader));
        if let Some((coating, _)) = &self.coating {
            coating.check(reader);
        }
        let mut saved = self.state.clone();
        saved.restore(&mut reader.clone());
        self.state.check(reader);
        let exists = |(index, place): (usize, &ClosestPoint)| {
            self.law.surface_of(index / self.lanes).is_none_or(|surface| surface.has_patch(*place))
        };
        if !saved.geometry.places.iter().enumerate().all(exists) {
            reader.refuse("a contact node is on a patch that its surface does not have");
        }
        let endless = self.endless(&saved.gap).zip(self.endless(&saved.gap_before));
        if started && endless.is_none() {
            reader.refuse("a gap is not finite");
        }
        (step, endless.map_or(0, |(now, before)| now + before))
    }

    /// How many gaps, `[node · lanes + lane]`, are infinite: those of padding lanes, and of nodes of a free master that have
    /// nothing to touch; `None` where others are, or one is negative.
    pub fn endless(&self, gaps: &[f64]) -> Option<usize> {
        let (sectors, free) = (self.bank.sectors(), matches!(self.law, GapLaw::Free(_)));
        let sound = |(index, gap): (usize, &f64)| {
            let padding = index % self.lanes >= sectors;
            if padding || free && gap.is_infinite() { *gap == f64::INFINITY } else { gap.is_finite() }
        };
        let all = gaps.iter().enumerate().all(sound);
        all.then(|| gaps.iter().filter(|gap| gap.is_infinite()).count())
    }

    /// Restore a saved state; coefficients are recomputed from the saved step size.
    pub fn restore(&mut self, reader: &mut Reader) {
        let mut step = 0.0_f64;
        step.restore(reader);
        if step > 0.0 {
            self.bank.set_step(self.settings.scheme, step);
            self.slaves.iter_mut().for_each(|slave| slave.set_step(self.settings.scheme, step));
        }
        self.bank.restore(reader);
        self.slaves.iter_mut().for_each(|slave| slave.restore(reader));
        if let Some((coating, _)) = &mut self.coating {
            coating.restore(reader);
        }
        self.state.restore(reader);
        self.rebuild_events();
    }

    /// The events of the last step follow from the saved multipliers and forces (heat is not part of the future).
    fn rebuild_events(&mut self) {
        let lanes = self.lanes;
        self.events.clear();
        for sector in 0..self.bank.sectors() {
            for node in 0..self.law.nodes() {
                let normal = self.state.multiplier[node * lanes + sector];
                if normal != 0.0 {
                    let index = node * lanes + sector;
                    let of = |rows: &[f64]| std::array::from_fn(|i| rows[(3 * node + i) * lanes + sector]);
                    let (force, point) = (of(&self.state.force), of(&self.state.points));
                    let wrench = self.law.wrench(At { node, index, drive: &self.state.drive }, point, force);
                    let (place, coating) = ((sector, node), self.state.coating_force[index]);
                    self.events.push(ContactEvent::new(place, normal, force, coating, (point, wrench)));
                }
            }
        }
    }
}
