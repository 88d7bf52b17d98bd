//! The contact problem of one group of coupled nodes: Delassus matrix, solution, and what it does to the structures.

use super::slave::carrier_of;
use super::{ContactEvent, StepFailure, System, frame_of};
use crate::contact::gap::{Drive, dot};
use crate::contact::wrench::At;
use crate::dynamics::bank::ModalBank;
use crate::dynamics::cyclic::CyclicBank;
use crate::dynamics::dispatch::Kernel;
use crate::dynamics::sectors::Sectors;
use crate::settings::Solver;
use nalgebra::DMatrix;

/// Nodes outside a group count as penetrating beyond this fraction of the largest gap of the group.
const VIOLATED_FRACTION: f64 = 1e-13;

/// Penetrations below this are none (m): squares of what they lead to leave the range of double precision, and modes as small
/// are flushed to rest.
const LEAST_PENETRATION: f64 = 1e-150;

/// A contact node of one sector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Member {
    /// Contact node.
    pub node: usize,
    /// Sector.
    pub sector: usize,
    /// `node · lanes + sector`.
    pub index: usize,
}

/// Forces of one group.
#[derive(Debug, Clone, Default)]
pub struct Solution {
    /// Multipliers along the columns of the Delassus matrix (N): one per contact, or (normal, tangent, tangent).
    values: Vec<f64>,
    len: usize,
}

impl Solution {
    /// Room for `len` values.
    pub fn new(len: usize) -> Self {
        Self { values: vec![0.0; len], len: 0 }
    }

    /// The values.
    pub fn values(&self) -> &[f64] {
        &self.values[..self.len]
    }
}

impl System {
    /// Directions per contact in the Delassus matrix.
    pub(super) fn directions(&self) -> usize {
        if self.settings.solver == Solver::Coulomb { 3 } else { 1 }
    }

    /// All nodes of the sectors that touch, each sector by itself.
    pub(super) fn solve_sectors(&mut self, drive: &Drive) -> Result<(), StepFailure> {
        let (lanes, nodes) = (self.lanes, self.law.nodes());
        for sector in 0..self.bank.sectors() {
            // NaN counts as touching, and is found out there.
            if self.lowest[sector] < -LEAST_PENETRATION || self.lowest[sector].is_nan() {
                self.members.clear();
                self.members.extend((0..nodes).map(|node| Member { node, sector, index: node * lanes + sector }));
                self.solve_group(drive)?;
                self.apply();
            }
        }
        Ok(())
    }

    /// Sectors coupled through the slave or as a disk: the nodes that penetrate or touched last, then those that their solution
    /// makes penetrate, until there are none.
    pub(super) fn solve_coupled(&mut self, drive: &Drive) -> Result<(), StepFailure> {
        if self.lowest.iter().all(|gap| *gap >= -LEAST_PENETRATION) {
            return Ok(());
        }
        let film = self.settings.solver == Solver::Film;
        let lanes = self.lanes;
        self.chosen.fill(false);
        for index in 0..self.chosen.len() {
            let gap = self.state.gap[index];
            // What touched and is beyond an edge now has nothing to touch.
            let touched = self.state.gap_before[index] <= 0.0 && gap.is_finite() && !film;
            if gap < 0.0 || gap.is_nan() || touched {
                self.choose(index);
            }
        }
        loop {
            self.members.clear();
            for sector in 0..self.bank.sectors() {
                let places = (0..self.law.nodes()).map(|node| Member { node, sector, index: node * lanes + sector });
                self.members.extend(places.filter(|member| self.chosen[member.index]));
            }
            self.solve_group(drive)?;
            self.respond(drive);
            if film || !self.add_violated() {
                break;
            }
        }
        self.apply();
        Ok(())
    }

    /// Take a node into the group; on a coating the whole blade, whose nodes share cells.
    fn choose(&mut self, index: usize) {
        let lanes = self.lanes;
        if self.coating.is_none() {
            self.chosen[index] = true;
            return;
        }
        for node in 0..self.law.nodes() {
            self.chosen[node * lanes + index % lanes] = true;
        }
    }

    fn add_violated(&mut self) -> bool {
        let scale = self.members.iter().fold(0.0, |scale: f64, member| scale.max(self.state.gap[member.index].abs()));
        let mut found = false;
        for index in 0..self.chosen.len() {
            let after = self.state.gap[index] + self.response[index];
            if !self.chosen[index] && after < -VIOLATED_FRACTION * scale {
                self.choose(index);
                found = true;
            }
        }
        found
    }

    /// Fill and solve the problem of `members`.
    fn solve_group(&mut self, drive: &Drive) -> Result<(), StepFailure> {
        for &Member { node, sector, index } in &self.members {
            let gap = self.state.gap[index];
            if !gap.is_finite() {
                return Err(StepFailure::NonFinite);
            }
            if gap < 0.0 && !self.law.is_plausible(node, gap, self.state.geometry.normal_at(index)) {
                return Err(StepFailure::Implausible { sector });
            }
        }
        self.fill_directions(drive);
        self.fill_delassus();
        let solved = if self.coating.is_some() {
            self.solve_coated(drive)
        } else if self.settings.solver == Solver::Coulomb {
            self.solve_coulomb(drive)
        } else {
            self.solve_normal()
        };
        if self.solution.values().iter().any(|value| !value.is_finite()) {
            return Err(StepFailure::NonFinite);
        }
        if solved { Ok(()) } else { Err(StepFailure::Unsolved { sector: self.members[0].sector }) }
    }

    /// Rows n and columns n − µt per contact; n, t₁, t₂ for both where contacts may stick.
    fn fill_directions(&mut self, drive: &Drive) {
        let friction = self.settings.friction;
        for member in 0..self.members.len() {
            let at = self.members[member];
            let index = at.index;
            let normal = self.state.geometry.normal_at(index);
            if self.settings.solver == Solver::Coulomb {
                let [first, second] = tangents(normal);
                for (direction, value) in [normal, first, second].into_iter().enumerate() {
                    self.row_directions[3 * member + direction] = value;
                    self.column_directions[3 * member + direction] = value;
                }
                continue;
            }
            let slip = if friction > 0.0 {
                let mut velocity = self.law.sliding_velocity(at.node, index, drive, self.displacement(at));
                let moved = if self.is_delayed() { self.slip_of_inertia(at) } else { self.slip_of_deformation(at) };
                for (value, moved) in velocity.iter_mut().zip(moved) {
                    *value += moved / self.bank.step();
                }
                self.law.slip_direction(velocity, normal)
            } else {
                [0.0; 3]
            };
            self.row_directions[member] = normal;
            self.column_directions[member] = std::array::from_fn(|i| normal[i] - friction * slip[i]);
        }
    }

    /// Displacement of a node relative to the slave over the step, prediction included (m), without rigid motion.
    #[inline(always)]
    pub(super) fn slip_of_deformation(&self, at: Member) -> [f64; 3] {
        self.slip_between(at, self.bank.displacement(), self.bank.displacement_before())
    }

    /// Displacement of a node as predicted (m), in its own directions.
    #[inline(always)]
    fn displacement(&self, Member { node, sector, .. }: Member) -> [f64; 3] {
        std::array::from_fn(|i| self.bank.displacement()[(3 * node + i) * self.lanes + sector])
    }

    /// The same of the modes with inertia alone. The prediction of massless-boundary is without the forces that deform
    /// quasi-static modes, however short the step is: taken for a slip over h it would grow without bounds.
    fn slip_of_inertia(&self, at: Member) -> [f64; 3] {
        self.slip_between(at, &self.state.predicted, &self.predicted_before)
    }

    #[inline(always)]
    fn slip_between(&self, Member { node, sector, index }: Member, now: &[f64], before: &[f64]) -> [f64; 3] {
        let lanes = self.lanes;
        let mut moved: [f64; 3] = std::array::from_fn(|component| {
            let row = (3 * node + component) * lanes + sector;
            now[row] - before[row]
        });
        if let Some((slave, surface)) = carrier_of(&self.slaves, &self.law, node) {
            let frame = self.frame(index, self.state.drive.rotor_angle);
            let slave = slave.moved_last(surface, self.state.geometry.places[index], frame);
            moved = std::array::from_fn(|i| moved[i] - slave[i]);
        }
        moved
    }

    /// W = C_Nᵀ A⁻¹ C_NT of the group: sectors by their flexibility, coupled through the slave's modes.
    fn fill_delassus(&mut self) {
        let (nodes, per) = (self.law.nodes(), self.directions());
        let matrix = match (&mut self.coating, &mut self.coulomb) {
            (Some((_, problem)), _) => {
                problem.clear();
                &mut problem.delassus
            }
            (None, Some(solver)) if self.settings.solver == Solver::Coulomb => &mut solver.delassus,
            _ => &mut self.problem.delassus,
        };
        let (members, rows, columns) = (&self.members[..], &self.row_directions[..], &self.column_directions[..]);
        match &self.bank {
            Sectors::Uncoupled(bank) if !self.coupled => {
                let flexibility = bank.flexibility(members[0].sector).as_slice();
                let (rows, columns) = (&rows[..per * nodes], &columns[..per * nodes]);
                match per {
                    1 => fill_sector::<1>(matrix, flexibility, rows, columns),
                    _ => fill_sector::<3>(matrix, flexibility, rows, columns),
                }
                return;
            }
            Sectors::Uncoupled(bank) => fill_sectors(matrix, bank, members, rows, columns, per),
            Sectors::Coupled(disk) => fill_disk(matrix, disk, members, rows, columns, per),
        }
        for (carrier, slave) in self.slaves.iter_mut().enumerate() {
            slave.clear_members();
            for (member, &Member { node, index, .. }) in self.members.iter().enumerate() {
                let Some((surface, own)) = self.law.spline_of(node) else { continue };
                if own == carrier {
                    let frame = frame_of(&self.law, index, self.state.drive.rotor_angle);
                    let span = per * member..per * (member + 1);
                    let (rows, columns) = (&self.row_directions[span.clone()], &self.column_directions[span]);
                    slave.see(member, surface, self.state.geometry.places[index], frame, rows, columns);
                }
            }
            slave.add_delassus(matrix, per);
        }
    }

    fn solve_normal(&mut self) -> bool {
        let size = self.members.len();
        self.problem.set_size(size);
        for (member, &Member { index, .. }) in self.members.iter().enumerate() {
            self.problem.gaps[member] = self.state.gap[index];
            // Closed in the last step: the likeliest guess for this one.
            self.problem.active[member] = self.state.gap_before[index] <= 0.0;
        }
        let outcome = if self.settings.solver == Solver::Film { self.problem.film() } else { self.problem.lcp() };
        self.state.factorisations += outcome.factorisations as u64;
        self.solution.len = size;
        self.solution.values[..size].copy_from_slice(&self.problem.multipliers[..size]);
        self.corrected[..size].copy_from_slice(&self.problem.gaps[..size]);
        self.coating_share[..size].fill(0.0);
        outcome.solved
    }

    fn solve_coated(&mut self, drive: &Drive) -> bool {
        let (lanes, nodes) = (self.lanes, self.law.nodes());
        let Some((coating, problem)) = &mut self.coating else { return false };
        for blade in self.members.chunks_exact(nodes) {
            for (angle, Member { node, sector, index }) in self.angles.iter_mut().zip(blade) {
                let moved = std::array::from_fn(|i| self.bank.displacement()[(3 * node + i) * lanes + sector]);
                *angle = self.law.angle_on_casing(At { node: *node, index: *index, drive }, moved);
            }
            coating.locate(problem, &self.angles);
        }
        for (member, &Member { index, .. }) in self.members.iter().enumerate() {
            problem.gaps[member] = self.state.gap[index];
            problem.closed[member] = self.state.gap_before[index] <= -coating.thickness();
        }
        let outcome = problem.solve();
        self.state.factorisations += outcome.factorisations as u64;
        let size = self.members.len();
        self.solution.len = size;
        for member in 0..size {
            self.solution.values[member] = problem.coating[member] + problem.hard[member];
            self.corrected[member] = problem.gaps[member];
            self.coating_share[member] = problem.coating[member];
        }
        outcome.solved
    }

    fn solve_coulomb(&mut self, drive: &Drive) -> bool {
        let (lanes, step) = (self.lanes, self.bank.step());
        for member in 0..self.members.len() {
            let at = self.members[member];
            let Member { node, sector, index } = at;
            let sliding = self.law.sliding_velocity(node, index, drive, self.displacement(at));
            let moved = self.slip_of_deformation(at);
            let slip: [f64; 3] = std::array::from_fn(|i| sliding[i] * step + moved[i]);
            let last: [f64; 3] = std::array::from_fn(|i| self.force_before[(3 * node + i) * lanes + sector]);
            let Some(solver) = &mut self.coulomb else { return false };
            solver.friction[member] = self.settings.friction;
            for along in 0..3 {
                let direction = self.row_directions[3 * member + along];
                solver.free[3 * member + along] = dot(direction, slip);
                solver.reactions[3 * member + along] = dot(direction, last);
            }
            solver.free[3 * member] = self.state.gap[index];
        }
        let size = self.members.len();
        let Some(solver) = &mut self.coulomb else { return false };
        let outcome = solver.solve(size);
        self.state.factorisations += outcome.factorisations as u64;
        self.solution.len = 3 * size;
        self.solution.values[..3 * size].copy_from_slice(&solver.reactions[..3 * size]);
        for member in 0..size {
            let touching = solver.reactions[3 * member] > 0.0;
            self.corrected[member] = if touching { 0.0 } else { solver.relative[3 * member].max(0.0) };
            self.coating_share[member] = 0.0;
        }
        outcome.solved
    }

    /// Force on the master at a member of the group (N), in its own directions.
    #[inline(always)]
    fn force_on(&self, member: usize) -> [f64; 3] {
        let per = self.directions();
        let mut force = [0.0; 3];
        for along in per * member..per * (member + 1) {
            let (value, direction) = (self.solution.values[along], self.column_directions[along]);
            force = std::array::from_fn(|i| force[i] + value * direction[i]);
        }
        force
    }

    /// Change of every gap by the solution (m), members and others.
    fn respond(&mut self, drive: &Drive) {
        let lanes = self.lanes;
        match &self.bank {
            Sectors::Uncoupled(_) => self.respond_alone(),
            Sectors::Coupled(_) => self.respond_together(),
        }
        if self.slaves.is_empty() {
            return;
        }
        let per = self.directions();
        self.slaves.iter_mut().for_each(|slave| slave.respond(&self.solution, per));
        for index in (0..self.response.len()).filter(|index| index % lanes < self.bank.sectors()) {
            let Some((slave, surface)) = carrier_of(&self.slaves, &self.law, index / lanes) else { continue };
            let moved =
                slave.responded(surface, self.state.geometry.places[index], self.frame(index, drive.rotor_angle));
            self.response[index] -= dot(self.state.geometry.normal_at(index), moved);
        }
    }

    /// Change of the gaps of uncoupled sectors.
    #[inline(never)]
    fn respond_alone(&mut self) {
        let Sectors::Uncoupled(bank) = &self.bank else { return };
        let (lanes, nodes) = (bank.lanes(), self.law.nodes());
        self.response.fill(0.0);
        for member in 0..self.members.len() {
            let Member { node: column, sector, .. } = self.members[member];
            let force = self.force_on(member);
            let flexibility = bank.flexibility(sector);
            for node in 0..nodes {
                let index = node * lanes + sector;
                let moved: [f64; 3] = std::array::from_fn(|i| {
                    (0..3).map(|j| flexibility[(3 * node + i, 3 * column + j)] * force[j]).sum()
                });
                self.response[index] += dot(self.state.geometry.normal_at(index), moved);
            }
        }
    }

    /// Change of the gaps of a disk: every force moves every sector.
    #[inline(never)]
    fn respond_together(&mut self) {
        for member in 0..self.members.len() {
            self.member_forces[member] = self.force_on(member);
        }
        let Sectors::Coupled(disk) = &mut self.bank else { return };
        let forces = self.members.iter().zip(&self.member_forces);
        disk.ask(forces.map(|(member, force)| (member.sector, member.node, *force)));
        let (sectors, lanes, [across, around, along]) = (disk.sectors(), disk.lanes(), &self.state.geometry.normal);
        let nodes = disk.moved().chunks_exact(3 * lanes).zip(self.response.chunks_exact_mut(lanes));
        let normals = across.chunks_exact(lanes).zip(around.chunks_exact(lanes)).zip(along.chunks_exact(lanes));
        for ((moved, response), ((across, around), along)) in nodes.zip(normals) {
            for lane in 0..sectors {
                response[lane] = across[lane] * moved[lane]
                    + around[lane] * moved[lanes + lane]
                    + along[lane] * moved[2 * lanes + lane];
            }
        }
    }

    /// Let the solution act on both structures, and record it.
    fn apply(&mut self) {
        if self.coupled {
            for (gap, response) in self.state.gap.iter_mut().zip(&self.response) {
                *gap += response;
            }
        }
        match &self.bank {
            Sectors::Uncoupled(_) => self.apply_alone(),
            Sectors::Coupled(_) => self.apply_together(),
        }
        self.slaves.iter_mut().for_each(|slave| slave.apply(self.settings.ledger));
        if let Some((coating, problem)) = &mut self.coating {
            self.state.ledger.wear_energy.add(coating.commit(problem));
        }
    }

    /// Let the solution that was responded to last act on a disk.
    #[inline(never)]
    fn apply_together(&mut self) {
        for member in 0..self.members.len() {
            self.state.gap[self.members[member].index] = self.corrected[member];
            self.record(member, self.member_forces[member]);
        }
        if let Sectors::Coupled(disk) = &mut self.bank {
            disk.act();
        }
    }

    /// Let the solution act on uncoupled sectors.
    #[inline(always)]
    fn apply_alone(&mut self) {
        let mut next = 0;
        while next < self.members.len() {
            let sector = self.members[next].sector;
            self.force.fill(0.0);
            while next < self.members.len() && self.members[next].sector == sector {
                let Member { node, index, .. } = self.members[next];
                self.state.gap[index] = self.corrected[next];
                let force = self.force_on(next);
                self.force[3 * node..][..3].copy_from_slice(&force);
                self.record(next, force);
                next += 1;
            }
            if let Sectors::Uncoupled(bank) = &mut self.bank {
                bank.correct(sector, &self.force, self.settings.ledger);
            }
        }
    }

    #[inline(always)]
    fn record(&mut self, member: usize, force: [f64; 3]) {
        let lanes = self.lanes;
        let Member { node, sector, index } = self.members[member];
        let normal = self.solution.values[self.directions() * member];
        if normal == 0.0 {
            return;
        }
        self.state.multiplier[index] = normal;
        self.state.coating_force[index] = self.coating_share[member];
        let at = At { node, index, drive: &self.state.drive };
        // Where the gap was evaluated, whose normal has no moment about the axis of a round casing.
        let point = self.law.contact_point(at, self.displacement(self.members[member]), &self.state.geometry.places);
        let wrench = self.law.wrench(at, point, force);
        for component in 0..3 {
            let row = (3 * node + component) * lanes + sector;
            (self.state.force[row], self.state.points[row]) = (force[component], point[component]);
        }
        let event = ContactEvent::new((sector, node), normal, force, self.coating_share[member], (point, wrench));
        self.events.push(event);
    }
}

/// W of nodes of uncoupled sectors with `per` directions each.
#[inline(never)]
fn fill_sectors(
    matrix: &mut DMatrix<f64>,
    bank: &ModalBank,
    members: &[Member],
    rows: &[[f64; 3]],
    columns: &[[f64; 3]],
    per: usize,
) {
    let height = bank.rows();
    for (member, &Member { node: column_node, sector, .. }) in members.iter().enumerate() {
        let flexibility = bank.flexibility(sector).as_slice();
        let [first, second, third] = std::array::from_fn(|j| &flexibility[(3 * column_node + j) * height..][..height]);
        for along in per * member..per * (member + 1) {
            let direction = columns[along];
            for (other, row) in members.iter().enumerate() {
                let at = 3 * row.node;
                let same = row.sector == sector;
                let moved: [f64; 3] = std::array::from_fn(|i| {
                    let i = at + i;
                    first[i] * direction[0] + second[i] * direction[1] + third[i] * direction[2]
                });
                for across in per * other..per * (other + 1) {
                    matrix[(across, along)] = if same { dot(rows[across], moved) } else { 0.0 };
                }
            }
        }
    }
}

/// W of nodes of a disk of coupled sectors with `per` directions each.
#[inline(never)]
fn fill_disk(
    matrix: &mut DMatrix<f64>,
    disk: &CyclicBank,
    members: &[Member],
    rows: &[[f64; 3]],
    columns: &[[f64; 3]],
    per: usize,
) {
    match per {
        1 => disk.instruction_set().run(FillDisk::<1> { matrix, disk, members, rows, columns }),
        _ => disk.instruction_set().run(FillDisk::<3> { matrix, disk, members, rows, columns }),
    }
}

/// The same as a kernel.
struct FillDisk<'a, const PER: usize> {
    matrix: &'a mut DMatrix<f64>,
    disk: &'a CyclicBank,
    members: &'a [Member],
    rows: &'a [[f64; 3]],
    columns: &'a [[f64; 3]],
}

impl<const PER: usize> Kernel for FillDisk<'_, PER> {
    #[inline(always)]
    fn run(self) {
        let Self { matrix, disk, members, rows, columns } = self;
        let (sectors, leading) = (disk.sectors(), matrix.nrows());
        let targets = matrix.as_mut_slice().chunks_exact_mut(PER * leading);
        let columns = columns.as_chunks::<PER>().0;
        for ((column, directions), targets) in members.iter().zip(columns).zip(targets) {
            for ((other, row), across) in members.iter().enumerate().zip(rows.as_chunks::<PER>().0) {
                let difference = row.sector + if row.sector < column.sector { sectors } else { 0 } - column.sector;
                let [first, second, third] = disk.flexibility(difference, column.node, row.node);
                for (along, direction) in directions.iter().enumerate() {
                    let mut moved = [0.0; 4];
                    for i in 0..4 {
                        moved[i] = first[i] * direction[0] + second[i] * direction[1] + third[i] * direction[2];
                    }
                    let moved = [moved[0], moved[1], moved[2]];
                    for (value, row) in targets[along * leading + PER * other..][..PER].iter_mut().zip(across) {
                        *value = dot(*row, moved);
                    }
                }
            }
        }
    }
}

/// W of all nodes of one sector with `PER` directions each; `flexibility` is G column by column.
fn fill_sector<const PER: usize>(
    matrix: &mut DMatrix<f64>,
    flexibility: &[f64],
    rows: &[[f64; 3]],
    columns: &[[f64; 3]],
) {
    let components = 3 * columns.len() / PER;
    let leading = matrix.nrows();
    let targets = matrix.as_mut_slice().chunks_exact_mut(leading);
    for ((along, direction), target) in columns.iter().enumerate().zip(targets) {
        let three = &flexibility[along / PER * 3 * components..][..3 * components];
        let (first, rest) = three.split_at(components);
        let (second, third) = rest.split_at(components);
        let nodes = first.as_chunks::<3>().0.iter().zip(second.as_chunks::<3>().0).zip(third.as_chunks::<3>().0);
        let targets = target.as_chunks_mut::<PER>().0.iter_mut().zip(rows.as_chunks::<PER>().0);
        for (((first, second), third), (target, rows)) in nodes.zip(targets) {
            let moved: [f64; 3] =
                std::array::from_fn(|i| first[i] * direction[0] + second[i] * direction[1] + third[i] * direction[2]);
            for (value, row) in target.iter_mut().zip(rows) {
                *value = dot(*row, moved);
            }
        }
    }
}

/// Two unit tangents; the first as near to the direction of sliding (second component) as the normal allows.
fn tangents(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let start = if normal[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
    let along = dot(start, normal);
    let first: [f64; 3] = std::array::from_fn(|i| start[i] - along * normal[i]);
    let length = dot(first, first).sqrt();
    let first = first.map(|value| value / length);
    let second = [
        normal[1] * first[2] - normal[2] * first[1],
        normal[2] * first[0] - normal[0] * first[2],
        normal[0] * first[1] - normal[1] * first[0],
    ];
    [first, second]
}
