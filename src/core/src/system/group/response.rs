//! Effects of the forces of a group on the gaps of all nodes that can touch, in and outside the group.

use super::{ContactGroup, ContactMember, GroupSide};
use crate::geometry::Vector3;
use crate::math::vector::{length, strided_vector3};
use crate::system::contact_view::Bodies;
use crate::system::structure::Structure;

impl ContactGroup {
    /// Computes the change of every evaluated gap by the solution (m), for members and other nodes, and bounds of the motion of all nodes.
    pub(super) fn respond(&mut self, bodies: &mut Bodies) {
        for side in &mut self.sides {
            let (members, forces) = (&self.members[side.span.clone()], &self.forces[side.span.clone()]);
            side.response.fill(0.0);
            side.travel.fill(0.0);
            if !members.is_empty() {
                side.respond(&mut bodies.structures[side.structure], members, forces);
            }
        }
        let per = self.law.directions();
        for reaction in &mut self.reactions {
            reaction.respond(&bodies.structures[reaction.structure], self.law.multipliers(), per);
        }
        if !self.reactions.is_empty() {
            self.respond_of_carriers(bodies);
        }
    }

    /// Adds the changes of the gaps by the motion of the surface carriers.
    #[inline(never)]
    fn respond_of_carriers(&mut self, bodies: &Bodies) {
        for side in 0..self.sides.len() {
            let number = self.sides[side].structure;
            let structure = &bodies.structures[number];
            if structure.nearness.is_used() {
                for index in structure.nearness.evaluated() {
                    if let Some(at) = structure.contact_at(number, *index) {
                        self.sides[side].response[*index] -= self.approach_of_surface(bodies, at);
                    }
                }
                self.add_surface_travel(side, bodies);
                continue;
            }
            for sector in 0..structure.modes().sectors() {
                for at in structure.contacts(number, sector) {
                    self.sides[side].response[at.index] -= self.approach_of_surface(bodies, at);
                }
            }
        }
    }

    /// Displacement of the surface along its normal at a contact node, caused by the solution (m).
    fn approach_of_surface(&self, bodies: &Bodies, at: ContactMember) -> f64 {
        let (pair, structure) = (&bodies.pairs[at.pair], &bodies.structures[at.structure]);
        let (Some(carrier), Some(surface)) = (pair.carrier(), pair.gap().spline()) else { return 0.0 };
        let Some(reaction) = self.reactions.iter().find(|one| one.structure == carrier.structure) else { return 0.0 };
        let geometry = &structure.history.geometry.now;
        if structure.nearness.is_used() {
            let moved = reaction.moved_at(surface, geometry.places[at.index], carrier.first_row);
            return structure.nearness.fixed_normal(at.index).dot(&moved);
        }
        let moved = bodies.pose(at).spot().map_or(Vector3::zeros(), |spot| reaction.responded(spot));
        geometry.normal_at(at.index).dot(&moved)
    }

    /// Adds bounds of the motion of the surfaces to those of the nodes.
    fn add_surface_travel(&mut self, side: usize, bodies: &Bodies) {
        let side = &mut self.sides[side];
        let lanes = bodies.structures[side.structure].lanes();
        for pair in bodies.pairs.iter().filter(|pair| pair.structure() == side.structure) {
            let Some((carrier, gap)) = pair.carrier().zip(pair.gap().spline_law()) else { continue };
            let reaction = self.reactions.iter_mut().find(|one| one.structure == carrier.structure);
            let Some(motions) = reaction.map(|reaction| reaction.surface_motions(gap, carrier.first_row)) else {
                continue;
            };
            for lane in 0..lanes {
                let faced = gap.faced_patches(lane, pair.drive_now(), 0.0);
                let motion = gap.largest_faced(faced, |patch| motions.bound(patch));
                pair.nodes().iter().for_each(|node| side.travel[node * lanes + lane] += motion);
            }
        }
    }

    /// Evaluates the skipped nodes that the solution may bring into contact, or to a gap that outputs need.
    pub(super) fn evaluate_reached(&mut self, bodies: &mut Bodies) {
        for side in 0..self.sides.len() {
            let number = self.sides[side].structure;
            if !bodies.structures[number].nearness.is_used() {
                continue;
            }
            let GroupSide { response, travel, after, .. } = &mut self.sides[side];
            let structure = &bodies.structures[number];
            structure.nearness.gaps_after(structure.gaps(), response, travel, after);
            for pair in bodies.pairs.iter().filter(|pair| pair.structure() == number && pair.carrier().is_some()) {
                for minimum in 0..bodies.structures[number].minima_among(pair.nodes()) {
                    let next = |side: &GroupSide, structure: &Structure| {
                        structure.undecided(pair.nodes(), minimum, &side.after)
                    };
                    while let Some(index) = next(&self.sides[side], &bodies.structures[number]) {
                        bodies.structures[number].evaluate_skipped(pair, index);
                        let response = self.response_of(side, bodies, index);
                        self.sides[side].response[index] = response;
                        self.sides[side].after[index] = bodies.structures[number].gaps()[index] + response;
                    }
                }
            }
        }
    }

    /// Returns the change of the gap of one node by the solution (m), found with the same operations as for all nodes.
    fn response_of(&self, side: usize, bodies: &Bodies, index: usize) -> f64 {
        let (number, span) = (self.sides[side].structure, self.sides[side].span.clone());
        let structure = &bodies.structures[number];
        let (node, sector) = (index / structure.lanes(), index % structure.lanes());
        let mut response = 0.0;
        if !span.is_empty() {
            let normal = structure.history.geometry.now.normal_at(index);
            let lanes = structure.lanes();
            match structure.modes().disk() {
                None => {
                    let members = self.members[span.clone()].iter().zip(&self.forces[span]);
                    for (member, force) in members.filter(|(member, _)| member.sector == sector) {
                        let flexibility = structure.modes().flexibility(sector);
                        let moved = flexibility.fixed_view::<3, 3>(3 * node, 3 * member.node) * force;
                        response += normal.dot(&moved);
                    }
                }
                Some(disk) => response = normal.dot(&strided_vector3(&disk.moved, 3 * node * lanes + sector, lanes)),
            }
        }
        response - structure.contact_at(number, index).map_or(0.0, |at| self.approach_of_surface(bodies, at))
    }
}

impl GroupSide {
    /// Computes the change of the gaps of this structure by forces on its own members.
    #[inline(never)]
    fn respond(&mut self, structure: &mut Structure, members: &[ContactMember], forces: &[Vector3]) {
        let nodes = structure.nodes();
        if let Some(disk) = structure.modes_mut().disk_mut() {
            disk.ask(members.iter().zip(forces).map(|(member, force)| (member.sector, member.node, *force)));
        }
        let normals = &structure.history.geometry.now;
        let (bank, lanes) = (structure.modes(), structure.lanes());
        match bank.disk() {
            None => {
                for (&ContactMember { node: column, sector, .. }, force) in members.iter().zip(forces) {
                    let flexibility = bank.flexibility(sector);
                    for node in 0..nodes {
                        let index = node * lanes + sector;
                        let moved = flexibility.fixed_view::<3, 3>(3 * node, 3 * column) * force;
                        self.response[index] += normals.normal_at(index).dot(&moved);
                        if let Some(travel) = self.travel.get_mut(index) {
                            *travel += length(moved);
                        }
                    }
                }
            }
            // Every force moves every sector.
            Some(disk) => {
                let (sectors, [across, around, along]) = (bank.sectors(), &normals.normal);
                let nodes = disk.moved.chunks_exact(3 * lanes).zip(self.response.chunks_exact_mut(lanes));
                let normals = across.chunks_exact(lanes).zip(around.chunks_exact(lanes)).zip(along.chunks_exact(lanes));
                for ((moved, response), ((across, around), along)) in nodes.zip(normals) {
                    for lane in 0..sectors {
                        response[lane] = across[lane] * moved[lane]
                            + around[lane] * moved[lanes + lane]
                            + along[lane] * moved[2 * lanes + lane];
                    }
                }
                for (moved, travel) in disk.moved.chunks_exact(3 * lanes).zip(self.travel.chunks_exact_mut(lanes)) {
                    for lane in 0..sectors {
                        travel[lane] = length(strided_vector3(moved, lane, lanes));
                    }
                }
            }
        }
    }
}
