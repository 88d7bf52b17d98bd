//! Continues a running state: another step size, saving and restoring, and nodes that pass an edge.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter};

use super::contact_view::ContactMember;
use super::{Bodies, ContactEvent, ContactPair, StepFailure, Structure, SurfaceCarrier, System, sum_of};
use crate::geometry::surface_spline::ClosestPoint;
use crate::geometry::wrench::At;
use crate::geometry::{GapLaw, Vector3};
use crate::math::vector::{set_strided_vector3, strided_vector3};
use crate::system::history::ContactHistory;

/// A contact force is continued over steps up to this many times as long as the step in which it was found.
const FORCE_REACH: f64 = 4.0;
/// Gaps below this fraction of the negligible gap ([`GapLaw::indifferent`]) count as closed.
const CLOSED: f64 = 1e-9;
/// Curvature work above this fraction of all exchanged energy is not a mere truncation error.
const MOST_CURVATURE: f64 = 0.5;

impl System {
    /// Sets the step size `step` (s) from now on. A running state is converted by resampling the modal motion under the last
    /// contact force; the energy ledger records the change of energy.
    ///
    /// Only a persistent force is continued, that of a contact closed at both ends of the last step. The multiplier of an impact
    /// is p/h of a past impulse and has no meaning for a step of another length. A much longer step reaches back to times before
    /// the last force, which is therefore reduced.
    pub fn set_step(&mut self, step: f64) {
        let (old, scheme) = (self.step_size(), self.settings.scheme);
        if old > 0.0 && self.counted.steps > 0 {
            for set in 0..self.sets.count() {
                self.mechanical[set] = self.mechanical_energy(set);
            }
            self.find_lasting(old, step);
            self.structures
                .iter_mut()
                .for_each(|structure| structure.modes.resample(scheme, step, &structure.history.passing.lasting));
            // The gap of the previous step is extrapolated along its own slope, not along the motion of the modes.
            self.counted.witnessed = self.counted.steps + 2;
            let ratio = step / old;
            self.pairs.iter_mut().for_each(|pair| pair.stretch(ratio));
            for structure in &mut self.structures {
                let gap = &mut structure.history.gap;
                for (before, now) in gap.before.iter_mut().zip(&gap.now) {
                    if now.is_finite() {
                        *before = now - ratio * (now - *before);
                    }
                }
            }
            for set in 0..self.sets.count() {
                let change = self.mechanical_energy(set) - self.mechanical[set];
                self.counted.ledgers[set].step_change.add(change);
                self.counted.ledgers[set].turnover.add(change.abs());
            }
        } else {
            self.set_first_step(step);
        }
    }

    /// Sets the step size `step` (s) without conversion of the state, before the first step.
    pub(crate) fn set_first_step(&mut self, step: f64) {
        let scheme = self.settings.scheme;
        self.structures.iter_mut().for_each(|structure| structure.modes.set_step(scheme, step));
    }

    /// Instantaneous kinetic and strain energy of all structures (J), ½q̇ᵀMq̇ and ½qᵀKq, between steps only. `each` is called
    /// with the energies of every set.
    pub(crate) fn energies_now(&mut self, mut each: impl FnMut(usize, (f64, f64))) -> (f64, f64) {
        let is_steady = self.steady_phase.active;
        if !is_steady {
            let step = self.step_size();
            self.find_lasting(step, step);
        }
        let Self { sets, structures, .. } = self;
        sum_of((0..sets.count()).map(|set| {
            let own = sum_of(sets.members(set).iter().map(|member| {
                let Structure { modes, history, step_control, .. } = &mut structures[*member];
                if is_steady && !step_control.energies_now.is_empty() {
                    sum_of(step_control.energies_now.as_chunks().0.iter().map(|[kinetic, strain]| (*kinetic, *strain)))
                } else {
                    modes.energies_now(&history.passing.lasting)
                }
            }));
            each(set, own);
            own
        }))
    }

    /// Finds the persistent contact forces on all structures. The force of a contact that was not closed at both ends of the last
    /// step, such as an impact, does not persist.
    fn find_lasting(&mut self, old: f64, new: f64) {
        let reach = (FORCE_REACH * old / new).min(1.0);
        self.structures.iter_mut().for_each(|structure| structure.history.passing.lasting.fill(0.0));
        for event in &self.events.now {
            let structure = &mut self.structures[event.structure];
            let (index, lanes) = (structure.index(event.node, event.sector), structure.lanes());
            // `film` closes gaps to rounding.
            let closed = CLOSED * self.pairs[event.pair].gap().indifferent(event.node);
            let ContactHistory { gap, force, passing, .. } = &mut structure.history;
            if gap.before[index] <= closed && gap.now[index] <= closed {
                let first = 3 * event.node * lanes + event.sector;
                let force = strided_vector3(&force.now, first, lanes);
                set_strided_vector3(&mut passing.lasting, first, lanes, reach * reach * force);
            }
        }
        for pair in &self.pairs {
            pair.spread_lasting(&mut self.structures);
        }
    }

    /// Checks that no node that can touch an open surface moves so far in one step that it could pass the surface or its edge unnoticed.
    pub(crate) fn check_travel(&self) -> Result<(), StepFailure> {
        for pair in &self.pairs {
            let GapLaw::Open(gap) = pair.gap() else { continue };
            let structure = pair.structure();
            let modes = self.structures[structure].modes();
            let mut moved = modes.displacement().iter().zip(modes.displacement_before());
            if moved.any(|(now, before)| (now - before).abs() > gap.largest) {
                return Err(StepFailure::TooFast { structure });
            }
        }
        Ok(())
    }

    /// Checks that a node that passes a free edge was in front of the surface, extrapolated beyond the edge. Otherwise contact
    /// would begin in penetration, with an impact of arbitrary strength.
    ///
    /// A surface around an axis is extrapolated beyond its edge, and a node outside the extrapolation ends the run.
    pub(crate) fn check_edges(&mut self) -> Result<(), StepFailure> {
        let bodies = Bodies { structures: &mut self.structures, pairs: &self.pairs, delays_contact: false };
        for (number, pair) in bodies.pairs.iter().enumerate() {
            let structure = pair.structure();
            let of = &bodies.structures[structure];
            if let Some(index) = pair.gap().out_of_reach() {
                let lanes = of.modes().lanes();
                return Err(StepFailure::OutOfReach { structure, node: index / lanes, sector: index % lanes });
            }
            let GapLaw::Open(open) = pair.gap() else { continue };
            for &node in pair.nodes() {
                let (gap, before) = (of.history.gap.now[node], of.history.gap.before[node]);
                if gap < 0.0 && before.is_infinite() {
                    let at = ContactMember { structure, pair: number, node, sector: 0, index: node };
                    let moved = bodies.pose(at).slip_of_deformation();
                    if open.was_behind(moved, of.history.geometry.now.normal_at(node), gap) {
                        return Err(StepFailure::BehindEdge { structure, node });
                    }
                }
            }
        }
        Ok(())
    }

    /// Checks for each set, at the end of a communication step, that friction and impacts have only dissipated energy and that
    /// curvature work, which no input supplies, is small compared with the exchanged energy.
    ///
    /// # Errors
    /// [`StepFailure::Gives`], [`StepFailure::Unbalanced`].
    pub(crate) fn check_ledger(&mut self) -> Result<(), StepFailure> {
        self.check_losses()?;
        for (set, ledger) in self.counted.ledgers.iter().enumerate() {
            let (work, exchanged) = (ledger.curvature_work.value(), ledger.exchanged());
            if work.abs() > MOST_CURVATURE * exchanged {
                return Err(StepFailure::Unbalanced { set, work, exchanged });
            }
        }
        Ok(())
    }

    /// Writes everything that determines the future, including the step size.
    pub fn save(&self, writer: &mut StateWriter) {
        self.step_size().save(writer);
        self.structures.iter().for_each(|structure| structure.save(writer));
        self.pairs.iter().for_each(|pair| pair.prescribed.save(writer));
        self.groups.iter().filter_map(|group| group.law.coating()).for_each(|coating| coating.save(writer));
        self.counted.save(writer);
        self.steady_phase.save(writer);
    }

    /// Reads over a saved state and rejects invalid values. Returns its step size (s) and the number of its infinite gaps. Gaps
    /// are unknown before the start.
    pub fn check(&self, reader: &mut StateReader, started: bool) -> (f64, usize) {
        let mut step = 0.0_f64;
        step.restore(reader);
        if !(0.0..=f64::MAX).contains(&step) {
            reader.refuse("its internal step is not a valid duration");
        }
        let mut endless = Some(0);
        for structure in &self.structures {
            let mut saved = structure.history.clone();
            saved.restore(&mut reader.clone());
            structure.check(reader);
            let places = [&saved.geometry.now.places, &saved.geometry.before.places];
            if !places.into_iter().all(|places| self.places_exist(structure, places)) {
                reader.refuse("the surface position of a contact node does not exist");
            }
            let found = self
                .infinite_gaps_of_structure(structure, &saved.gap.now)
                .zip(self.infinite_gaps_of_structure(structure, &saved.gap.before));
            endless = endless.zip(found).map(|(sum, (now, before))| sum + now + before);
        }
        if started && endless.is_none() {
            reader.refuse("a gap is not finite");
        }
        self.pairs.iter().for_each(|pair| pair.prescribed.check(reader));
        self.groups.iter().filter_map(|group| group.law.coating()).for_each(|coating| coating.check(reader));
        self.counted.check(reader);
        self.steady_phase.check(reader);
        (step, endless.unwrap_or(0))
    }

    fn places_exist(&self, structure: &Structure, places: &[ClosestPoint]) -> bool {
        let lanes = structure.modes().lanes();
        let surface = |index: usize| self.pairs[structure.pair_of[index / lanes]?].gap().spline();
        places.iter().enumerate().all(|(index, place)| surface(index).is_none_or(|surface| surface.has_place(*place)))
    }

    /// Returns the number of infinite gaps among the gaps of all structures, in the order of [`Structure::gaps`]: those of
    /// padding lanes, of nodes without a pair, and of nodes beyond a free edge. Returns `None` if any other gap is infinite, or
    /// if one is −∞.
    pub(crate) fn infinite_gap_count(&self, gaps: &[f64]) -> Option<usize> {
        let (mut rest, mut sum) = (gaps, 0);
        for structure in &self.structures {
            let (own, others) = rest.split_at(structure.gaps().len());
            sum += self.infinite_gaps_of_structure(structure, own)?;
            rest = others;
        }
        Some(sum)
    }

    fn infinite_gaps_of_structure(&self, structure: &Structure, gaps: &[f64]) -> Option<usize> {
        let (lanes, sectors) = (structure.modes().lanes(), structure.modes().sectors());
        let may_end = |pair: Option<usize>| pair.is_none_or(|pair| matches!(self.pairs[pair].gap(), GapLaw::Open(_)));
        let sound = |(index, gap): (usize, &f64)| {
            let infinite = index % lanes >= sectors || may_end(structure.pair_of[index / lanes]) && gap.is_infinite();
            if infinite { *gap == f64::INFINITY } else { gap.is_finite() }
        };
        let all = gaps.iter().enumerate().all(sound);
        all.then(|| gaps.iter().filter(|gap| gap.is_infinite()).count())
    }

    /// Restores a saved state; coefficients are those of the saved step size.
    pub fn restore(&mut self, reader: &mut StateReader) {
        let mut step = 0.0_f64;
        step.restore(reader);
        for structure in &mut self.structures {
            if step > 0.0 {
                structure.modes.prepare_restore(self.settings.scheme, step);
            }
            structure.restore(reader);
        }
        self.pairs.iter_mut().for_each(|pair| pair.prescribed.restore(reader));
        self.groups.iter_mut().filter_map(|group| group.law.coating_mut()).for_each(|coating| coating.restore(reader));
        self.counted.restore(reader);
        self.steady_phase.restore(reader);
        self.rebuild_events();
    }

    /// Reconstructs the events of the last step from the saved multipliers and forces (heat does not affect the future).
    fn rebuild_events(&mut self) {
        self.events.now.clear();
        for (number, structure) in self.structures.iter().enumerate() {
            for sector in 0..structure.modes().sectors() {
                for at in structure.contacts(number, sector) {
                    let (history, ContactMember { pair, node, index, .. }) = (&structure.history, at);
                    let normal = history.multiplier[index];
                    if normal != 0.0 {
                        let force = structure.vector3(&history.force.now, node, sector);
                        let point = structure.vector3(&history.points, node, sector);
                        let of = &self.pairs[pair];
                        let wrench = of.gap().wrench(At { node, index, drive: of.drive_now() }, point, force);
                        let coating = history.coating_force[index];
                        self.events.now.push(ContactEvent::new(at, normal, force, coating, point, wrench));
                    }
                }
            }
        }
    }
}

impl ContactPair {
    /// Also applies persistent contact forces to the structure that carries the surface.
    fn spread_lasting(&self, structures: &mut [Structure]) {
        let (Some(surface), Some(SurfaceCarrier { structure, first_row })) = (self.gap().spline(), self.carrier())
        else {
            return;
        };
        let Ok([touching, carrier]) = structures.get_disjoint_mut([self.structure(), structure]) else { return };
        let rotor_angle = self.drive_now().rotor_angle;
        for &node in self.nodes() {
            for sector in 0..touching.modes().sectors() {
                let force = touching.vector3(&touching.history.passing.lasting, node, sector);
                if force == Vector3::zeros() {
                    continue;
                }
                let index = touching.index(node, sector);
                let force = self.frame(index, rotor_angle).fixed(force);
                for (point, weight) in surface.weights(touching.geometry().places[index]).iter() {
                    for (component, value) in force.iter().enumerate() {
                        carrier.history.passing.lasting[first_row + 3 * point + component] -= weight * value;
                    }
                }
            }
        }
    }
}
