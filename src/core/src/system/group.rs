//! Groups of contacts that influence each other: their Delassus matrix, their forces, and the effects on the structures.

mod response;

use super::carrier::Reaction;
use super::contact_view::{Bodies, ContactMember};
use super::delassus::{DelassusBlock, fill};
use super::{ContactEvent, StepFailure, Structure};
use crate::contact::Law;
use crate::contact::coating::Coating;
use crate::geometry::Vector3;
use crate::geometry::wrench::At;
use crate::math::vector::{set_strided_vector3, set_vector3_at};
use crate::scene::method::Solver;

/// Nodes outside a group count as penetrating beyond this fraction of the largest gap of the group.
const VIOLATED_FRACTION: f64 = 1e-13;

/// Outputs of the solution of a group in a step.
pub(crate) struct GroupSolution<'a> {
    /// Active contacts; new ones are appended.
    pub events: &'a mut Vec<ContactEvent>,
    /// Number of factorised small linear systems; it is increased.
    pub factorisations: &'a mut u64,
    /// Energy consumed by wear (J); it is increased.
    pub wear_energy: &'a mut tiprub_cosim::Sum,
}

/// Contact nodes of one structure in a group.
#[derive(Debug, Clone)]
struct GroupSide {
    structure: usize,
    /// True for nodes in the group that is being solved, `[node · lanes + lane]`.
    chosen: Vec<bool>,
    /// Change of all gaps of the structure by the solution (m), `[node · lanes + lane]`.
    response: Vec<f64>,
    /// Upper bound of the motion of each node and its surface by the solution (m), `[node · lanes + lane]`; empty if no node is skipped.
    travel: Vec<f64>,
    /// Gaps or their bounds after the solution (m); empty if no node is skipped.
    after: Vec<f64>,
    /// Index range of the members among those of the group.
    span: std::ops::Range<usize>,
}

/// Coupling of the contacts of a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// Each sector separately: uncoupled sectors of one structure against a rigid surface.
    Sector,
    /// All sectors of all structures of the group, coupled by a disk or by a common surface.
    All,
}

/// Contacts that can influence each other at any time of a run.
#[derive(Debug, Clone)]
pub(crate) struct ContactGroup {
    reach: Reach,
    sides: Vec<GroupSide>,
    /// Structures that carry the surfaces of the contacts.
    reactions: Vec<Reaction>,
    pub(crate) law: Law,
    /// The current contacts, structure by structure and sector by sector.
    members: Vec<ContactMember>,
    rows: Vec<Vector3>,
    columns: Vec<Vector3>,
    /// Force on each member (N).
    forces: Vec<Vector3>,
    /// Contact force on the rows of one sector.
    sector_force: Vec<f64>,
}

impl ContactGroup {
    /// Creates a group of the contacts of the structures `touching`, whose surfaces the structures `carriers` carry.
    pub fn new(
        reach: Reach,
        touching: &[usize],
        carriers: &[usize],
        structures: &[Structure],
        solver: Solver,
        coating: Option<Coating>,
    ) -> Self {
        let contacts = |structure: &usize| {
            let structure = &structures[*structure];
            let sectors = if reach == Reach::Sector { 1 } else { structure.modes().sectors() };
            structure.pair_of.iter().flatten().count() * sectors
        };
        let count: usize = touching.iter().map(contacts).sum();
        let law = Law::new(solver, coating, count);
        let per = law.directions();
        let side = |structure: &usize| {
            let len = if reach == Reach::Sector { 0 } else { structures[*structure].gaps().len() };
            GroupSide {
                structure: *structure,
                chosen: vec![false; len],
                response: vec![0.0; len],
                travel: vec![0.0; structures[*structure].nearness.len()],
                after: vec![0.0; structures[*structure].nearness.len()],
                span: 0..0,
            }
        };
        let rows = touching.iter().map(|structure| structures[*structure].modes().rows()).max().unwrap_or(0);
        Self {
            reach,
            sides: touching.iter().map(side).collect(),
            reactions: carriers
                .iter()
                .map(|carrier| Reaction::new(*carrier, &structures[*carrier], count, per))
                .collect(),
            law,
            members: Vec::with_capacity(count),
            rows: vec![Vector3::zeros(); per * count],
            columns: vec![Vector3::zeros(); per * count],
            forces: vec![Vector3::zeros(); count],
            sector_force: vec![0.0; rows],
        }
    }

    /// Structures whose nodes are in contact.
    pub fn structures(&self) -> impl Iterator<Item = usize> {
        self.sides.iter().map(|side| side.structure)
    }

    /// Selects another solver. A coating has the same law for all solvers.
    pub(crate) fn set_solver(&mut self, solver: Solver, structures: &[Structure]) {
        if self.law.coating().is_none() {
            let touching: Vec<usize> = self.structures().collect();
            let carriers: Vec<usize> = self.reactions.iter().map(|reaction| reaction.structure).collect();
            *self = Self::new(self.reach, &touching, &carriers, structures, solver, None);
        }
    }

    /// Solves the contact forces of the step and applies them.
    ///
    /// # Errors
    /// A contact exceeds the small-displacement limits, or a problem has no solution.
    pub fn solve(&mut self, bodies: &mut Bodies, found: &mut GroupSolution) -> Result<(), StepFailure> {
        match self.reach {
            Reach::Sector => self.solve_sectors(bodies, found),
            Reach::All => self.solve_together(bodies, found),
        }
    }

    /// Solves all nodes of the sectors in contact, each sector separately.
    fn solve_sectors(&mut self, bodies: &mut Bodies, found: &mut GroupSolution) -> Result<(), StepFailure> {
        let (structure, mut next) = (self.sides[0].structure, 0);
        while let Some(sector) = bodies.structures[structure].touching_from(next) {
            self.members.clear();
            self.members.extend(bodies.structures[structure].contacts(structure, sector));
            self.sides[0].span = 0..self.members.len();
            self.find_forces(bodies, found)?;
            self.apply(bodies, found);
            next = sector + 1;
        }
        Ok(())
    }

    /// Solves contacts that influence each other: first the nodes that penetrate or were in contact, then also those that the
    /// solution makes penetrate, until there are no more.
    fn solve_together(&mut self, bodies: &mut Bodies, found: &mut GroupSolution) -> Result<(), StepFailure> {
        let rests = |side: &GroupSide| bodies.structures[side.structure].touching_from(0).is_none();
        if self.sides.iter().all(rests) {
            return Ok(());
        }
        self.choose_touching(bodies);
        loop {
            self.list_members(bodies);
            self.find_forces(bodies, found)?;
            self.respond(bodies);
            self.evaluate_reached(bodies);
            if !self.law.is_iterative() || !self.add_violated(bodies) {
                break;
            }
        }
        self.apply(bodies, found);
        Ok(())
    }

    fn choose_touching(&mut self, bodies: &Bodies) {
        for side in 0..self.sides.len() {
            self.sides[side].chosen.fill(false);
            let history = &bodies.structures[self.sides[side].structure].history;
            for index in 0..self.sides[side].chosen.len() {
                let gap = history.gap.now[index];
                // A node that was in contact and is now beyond an edge has nothing to touch.
                let touched = history.gap.before[index] <= 0.0 && gap.is_finite() && self.law.is_iterative();
                if gap < 0.0 || gap.is_nan() || touched {
                    self.choose(side, index, bodies);
                }
            }
        }
    }

    /// Adds a node to the group; with a coating, all nodes of the blade, because they share cells.
    fn choose(&mut self, side: usize, index: usize, bodies: &Bodies) {
        let (side, coated) = (&mut self.sides[side], self.law.coating().is_some());
        side.chosen[index] = true;
        if coated {
            let structure = &bodies.structures[side.structure];
            let sector = index % structure.lanes();
            for node in (0..structure.nodes()).filter(|node| structure.pair_of[*node].is_some()) {
                side.chosen[structure.index(node, sector)] = true;
            }
        }
    }

    fn list_members(&mut self, bodies: &Bodies) {
        self.members.clear();
        for side in &mut self.sides {
            let (first, structure) = (self.members.len(), side.structure);
            let of = &bodies.structures[structure];
            for sector in 0..of.modes().sectors() {
                self.members.extend(of.contacts(structure, sector).filter(|member| side.chosen[member.index]));
            }
            side.span = first..self.members.len();
        }
    }

    fn add_violated(&mut self, bodies: &Bodies) -> bool {
        let gap_of = |member: &ContactMember| bodies.structures[member.structure].history.gap.now[member.index];
        let scale = self.members.iter().fold(0.0, |scale: f64, member| scale.max(gap_of(member).abs()));
        let mut found = false;
        for side in 0..self.sides.len() {
            let gaps = &bodies.structures[self.sides[side].structure].history.gap.now;
            for (index, gap) in gaps.iter().enumerate() {
                let after = gap + self.sides[side].response[index];
                if !self.sides[side].chosen[index] && after < -VIOLATED_FRACTION * scale {
                    self.choose(side, index, bodies);
                    found = true;
                }
            }
        }
        found
    }

    /// Fills and solves the problem of the members.
    fn find_forces(&mut self, bodies: &mut Bodies, found: &mut GroupSolution) -> Result<(), StepFailure> {
        let per = self.law.directions();
        self.members.iter().try_for_each(|&member| bodies.pose(member).check())?;
        let contacts = self.members.iter().map(|&member| bodies.pose(member));
        self.law.fill_all(&mut self.rows, &mut self.columns, contacts);
        self.law.begin(self.members.len());
        self.fill_delassus(bodies, per);
        self.law.pose_all(&self.rows, self.members.iter().map(|&member| bodies.pose(member)));
        let outcome = self.law.solve();
        *found.factorisations += outcome.factorisations as u64;
        if self.law.multipliers().iter().any(|value| !value.is_finite()) {
            return Err(StepFailure::NonFinite);
        }
        let ContactMember { structure, sector, .. } = self.members[0];
        if !outcome.solved {
            return Err(StepFailure::Unsolved { structure, sector });
        }
        self.find_force_vectors(per);
        Ok(())
    }

    /// Fills W of the group: structures with contact nodes by their flexibility, surface carriers by their modes.
    fn fill_delassus(&mut self, bodies: &mut Bodies, per: usize) {
        let matrix = self.law.matrix();
        if self.sides.len() > 1 {
            let size = per * self.members.len();
            matrix.view_mut((0, 0), (size, size)).fill(0.0);
        }
        for side in self.sides.iter().filter(|side| !side.span.is_empty()) {
            let directions = per * side.span.start..per * side.span.end;
            let (rows, columns) = (&self.rows[directions.clone()], &self.columns[directions]);
            let block =
                DelassusBlock { members: &self.members[side.span.clone()], rows, columns, per, first: side.span.start };
            let structure = &bodies.structures[side.structure];
            fill(matrix, structure.modes(), &block);
        }
        if !self.reactions.is_empty() {
            self.add_reactions(bodies, per);
        }
    }

    /// Adds the part of the surface carriers.
    #[inline(never)]
    fn add_reactions(&mut self, bodies: &mut Bodies, per: usize) {
        for reaction in &mut self.reactions {
            reaction.clear();
            for (contact, &member) in self.members.iter().enumerate() {
                let posed = bodies.pose(member);
                let Some(spot) = posed.spot() else { continue };
                if spot.carrier.structure == reaction.structure {
                    let span = per * contact..per * (contact + 1);
                    reaction.see(contact, spot, &self.rows[span.clone()], &self.columns[span]);
                }
            }
            reaction.add_delassus(&mut bodies.structures[reaction.structure], self.law.matrix(), per);
        }
    }

    /// Computes the force on each member (N), in its own directions.
    #[inline(always)]
    fn find_force_vectors(&mut self, per: usize) {
        let values = self.law.multipliers();
        for (contact, force) in self.forces[..self.members.len()].iter_mut().enumerate() {
            *force = Vector3::zeros();
            for along in per * contact..per * (contact + 1) {
                *force += values[along] * self.columns[along];
            }
        }
    }

    /// Applies the solution to all structures and records it.
    #[inline(always)]
    fn apply(&mut self, bodies: &mut Bodies, found: &mut GroupSolution) {
        for side in &self.sides {
            let structure = &mut bodies.structures[side.structure];
            if structure.nearness.is_used() {
                structure.history.gap.now.copy_from_slice(&side.after);
                structure.nearness.reduce(&side.travel);
                continue;
            }
            for (gap, response) in structure.history.gap.now.iter_mut().zip(&side.response) {
                *gap += response;
            }
        }
        self.record(bodies, found);
        for side in 0..self.sides.len() {
            let span = self.sides[side].span.clone();
            self.act(&mut bodies.structures[self.sides[side].structure], span);
        }
        for reaction in &mut self.reactions {
            reaction.apply(&mut bodies.structures[reaction.structure]);
        }
        if self.law.coating().is_some() {
            found.wear_energy.add(self.law.commit());
        }
    }

    /// Applies the solution to a structure with contact nodes.
    #[inline(always)]
    fn act(&mut self, structure: &mut Structure, span: std::ops::Range<usize>) {
        let bank = structure.modes_mut();
        if bank.disk().is_some() {
            // The disk already has the forces of the request.
            if !span.is_empty() {
                bank.act();
            }
            return;
        }
        let (members, forces) = (&self.members[span.clone()], &self.forces[span]);
        let force = &mut self.sector_force[..bank.rows()];
        let mut next = 0;
        while next < members.len() {
            let sector = members[next].sector;
            force.fill(0.0);
            while next < members.len() && members[next].sector == sector {
                set_vector3_at(force, members[next].node, forces[next]);
                next += 1;
            }
            bank.correct(sector, force);
        }
    }

    /// Writes corrected gaps and forces to the history, and one event per contact with a force.
    #[inline(always)]
    fn record(&mut self, bodies: &mut Bodies, found: &mut GroupSolution) {
        let (per, values) = (self.law.directions(), self.law.multipliers());
        let (gaps, shares) = (self.law.gaps(), self.law.coating_shares());
        for (contact, &member) in self.members.iter().enumerate() {
            let ContactMember { structure, pair, node, sector, index } = member;
            let (normal, of) = (values[per * contact], &mut bodies.structures[structure]);
            of.history.gap.now[index] = gaps[contact];
            if normal == 0.0 {
                continue;
            }
            let moved = of.vector3(of.modes().displacement(), node, sector);
            let (share, force) = (shares.get(contact).copied().unwrap_or(0.0), self.forces[contact]);
            of.history.multiplier[index] = normal;
            of.history.coating_force[index] = share;
            let gap = bodies.pairs[pair].gap();
            let at = At { node, index, drive: bodies.pairs[pair].drive_now() };
            // The point at which the gap was evaluated, whose normal has no moment about the axis of a round casing.
            let point = gap.contact_point(at, moved, of.history.geometry.now.place_at(index));
            let wrench = gap.wrench(at, point, force);
            let lanes = of.lanes();
            let first = 3 * node * lanes + sector;
            set_strided_vector3(&mut of.history.force.now, first, lanes, force);
            set_strided_vector3(&mut of.history.points, first, lanes, point);
            found.events.push(ContactEvent::new(member, normal, force, share, point, wrench));
        }
    }
}
