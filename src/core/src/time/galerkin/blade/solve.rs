//! The contact problem of a step of a blade: forces that keep all nodes from penetrating at all points.

use super::columns::{combine, displace_nodes, eliminate, eliminate_any};
use super::level::{BladeLevel, Place};
use super::off_centre::{OffCentreGaps, directions_of};
use super::rows::BladeRows;
use super::surface::FacedSurface;
use super::trial::{BladeTrial, StartContacts};
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::trial::{ForceInterpolation, TrialResult};

/// Number of solutions after which all lanes of the wrong sign change their status together. Later solutions change
/// only the first lane of the wrong sign.
const JOINT_CHANGES: usize = 8;
/// Largest number of evaluations of the curvature of the surface.
const PASSES: usize = 6;
/// Forces and gaps of the wrong sign within this fraction of the largest count as rounding.
const ROUNDING: f64 = 1e-13;

/// Adds the displacements caused by the forces at the start of the step.
#[inline(always)]
fn add_pushed<L: Octet, const P: usize>(
    blocks: usize,
    start: &StartContacts,
    level: &BladeLevel,
    [closing, around]: [&mut [Eight]; 2],
) {
    for first in (0..blocks * P).step_by(P) {
        let mut sums = [both(|_| L::zero()); P];
        for p in 0..P {
            sums[p] = [L::load(&closing[first + p]), L::load(&around[first + p])];
        }
        for (block, multipliers) in start.multipliers.iter().enumerate() {
            let mut nodes = L::zero().less(L::load(multipliers));
            while nodes != 0 {
                let i = nodes.trailing_zeros() as usize;
                nodes &= nodes - 1;
                let [a, b] = both(|along| L::splat(start.forces[along][block].0[i]));
                let columns = level.start_column(8 * block + i);
                let columns = [0, 1, 2, 3].map(|of| &columns[of][first..][..P]);
                for p in 0..P {
                    let [aa, ab] = both(|seen| L::load(&columns[seen][p]));
                    let [ba, bb] = both(|seen| L::load(&columns[2 + seen][p]));
                    sums[p] = [sums[p][0] + (a * aa + b * ba), sums[p][1] + (a * ab + b * bb)];
                }
            }
        }
        for p in 0..P {
            sums[p][0].store(&mut closing[first + p]);
            sums[p][1].store(&mut around[first + p]);
        }
    }
}

/// Tries a step.
pub(super) struct Attempt<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    pub faced: &'a FacedSurface<'a>,
    /// Largest gap of a contact that counts as closed (m).
    pub precision: f64,
}

impl OctetKernel for Attempt<'_> {
    type Output = TrialResult;
    #[inline(always)]
    fn run<L: Octet>(mut self) -> TrialResult {
        let mut result = TrialResult { solved: true, ..TrialResult::default() };
        match self.level.points() {
            1 => self.move_freely::<L, 1>(),
            2 => self.move_freely::<L, 2>(),
            _ => self.move_freely::<L, 3>(),
        }
        let penetrates = self.find_open_gaps::<L>();
        if penetrates {
            self.choose_first::<L>();
            result.solved = self.solve::<L>(&mut result.factorisations);
        } else {
            self.rest::<L>();
        }
        if result.solved && self.level.kind == ForceInterpolation::Polynomial {
            self.judge::<L>(&mut result);
        }
        result
    }
}

impl Attempt<'_> {
    /// Computes the displacements at the points without forces after the start of the step.
    #[inline(always)]
    fn move_freely<L: Octet, const P: usize>(&mut self) {
        let Self { trial: BladeTrial { start, modal, moved, held, evaluated, .. }, rows, level, .. } = self;
        let [q, v] = &start.modes;
        for (modal, [a, b]) in modal.iter_mut().zip(&level.free).take(P) {
            for (block, modal) in modal.iter_mut().enumerate() {
                let terms = L::load(&a[block]) * L::load(&q[block]) + L::load(&b[block]) * L::load(&v[block]);
                terms.store(modal);
            }
        }
        let modes: [&[Eight]; P] = std::array::from_fn(|p| &modal[p][..]);
        let [closing, around] = moved;
        let width = level.blocks;
        let (closing, around) = (&mut closing[..width], &mut around[..width]);
        displace_nodes::<L, 2, P>(rows, [0, 1], rows.mode_blocks, modes, [closing, around]);
        evaluated.count(width, 2);
        held.copy_from_slice(&start.held[1]);
        if level.kind == ForceInterpolation::Constant {
            // The force at the start does not persist into the step.
            held.fill(Eight::ZERO);
        }
        if !start.pushed || level.kind == ForceInterpolation::Constant {
            return;
        }
        add_pushed::<L, P>(rows.blocks, start, level, [closing, around]);
    }

    /// Computes F of all lanes without forces, linearised about the place of their nodes, and the directions of the
    /// forces. Returns whether a lane penetrates.
    #[inline(always)]
    fn find_open_gaps<L: Octet>(&mut self) -> bool {
        let mut penetrates = false;
        let Self { trial, rows, faced, level, .. } = &mut *self;
        for Place { lane, point, block } in level.places(rows) {
            let valid = rows.valid(lane);
            let drive = &faced.drives[point + 1];
            let (per_radius, held) = (L::load(&rows.per_radius[block]), L::load(&trial.held[block]));
            let (closing, around) = (L::load(&trial.moved[0][lane]), L::load(&trial.moved[1][lane]));
            let angles = L::load(&trial.angles[block]);
            let (sigma, clear, bend) = if faced.is_off_centre {
                let place = (angles, directions_of(&trial.directions_of_nodes, block));
                let seen = OffCentreGaps::new(faced.surface, drive, (rows, block), place, [closing, around + held]);
                (seen.sigma, seen.clear, seen.bend)
            } else {
                let at = angles + L::splat(drive.turned) + (around + held) * per_radius;
                let [shape, slope, curvature] = faced.surface.evaluate_octet::<L>(at);
                let factor = L::splat(drive.factor);
                let bend = curvature * factor * per_radius * per_radius * L::splat(0.5);
                (slope * factor * per_radius, L::splat(drive.clearance) + shape * factor, bend)
            };
            let open = clear + closing - sigma * held;
            sigma.store(&mut trial.sigma[lane]);
            clear.store(&mut trial.clear[lane]);
            bend.store(&mut trial.bend[lane]);
            open.store(&mut trial.open[lane]);
            let friction = L::load(&trial.start.friction[block]);
            (L::splat(1.0) + friction * sigma * L::load(&rows.per_steepness[block]))
                .store(&mut trial.directions[0][lane]);
            (sigma - friction * L::load(&rows.steepness[block])).store(&mut trial.directions[1][lane]);
            trial.active[lane] = open.less(L::zero()) & valid;
            penetrates |= trial.active[lane] != 0;
        }
        penetrates
    }

    /// Writes the result of a step without contact: F with the curvature of the surface, and zero forces.
    #[inline(always)]
    fn rest<L: Octet>(&mut self) {
        let Self { trial, rows, level, .. } = self;
        for Place { lane, block, .. } in level.places(rows) {
            let held = L::load(&trial.held[block]);
            (L::load(&trial.open[lane]) + L::load(&trial.bend[lane]) * held * held).store(&mut trial.gaps[lane]);
        }
        trial.multipliers.fill(Eight::ZERO);
        trial.forces.iter_mut().for_each(|forces| forces.fill(Eight::ZERO));
        trial.pushes = trial.start.pushed;
    }

    /// Chooses the first members of the contact problem. If a force acts at the start and the forces are polynomials,
    /// these are the lanes of closed nodes whose λ', extrapolated from the last step, stays positive. Otherwise, they are
    /// all lanes that penetrate.
    #[inline(always)]
    fn choose_first<L: Octet>(&mut self) {
        let Self { trial, rows, level, .. } = &mut *self;
        trial.prepared.fill(0);
        trial.later.fill(0);
        trial.pushes = true;
        if !trial.start.pushed || level.kind == ForceInterpolation::Constant {
            return;
        }
        for Place { lane, point, block } in level.places(rows) {
            let (now, slope) = (L::load(&trial.start.multipliers[block]), L::load(&trial.start.slopes[block]));
            let closed = L::zero().less(now);
            let expected = (now + slope * L::splat(level.basis.points[point + 1] * level.step)).max(L::zero());
            trial.later[lane] = trial.active[lane] & !closed;
            trial.active[lane] = closed & L::zero().less(expected);
            expected.store(&mut trial.multipliers[lane]);
        }
    }

    /// Lists the members, and computes the columns of new members.
    #[inline(always)]
    fn list_members<L: Octet>(&mut self) {
        let Self { trial, rows, level, .. } = &mut *self;
        let width = level.blocks;
        trial.members.clear();
        for Place { lane, point, block } in level.places(rows) {
            let mut mask = trial.active[lane];
            while mask != 0 {
                let at = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let member = 8 * lane + at;
                trial.members.push(member);
                if trial.prepared[lane] >> at & 1 == 1 {
                    continue;
                }
                trial.prepared[lane] |= 1 << at;
                let [a, b] = both(|along| L::splat(trial.directions[along][lane].0[at]));
                let columns = level.column(point * rows.nodes + 8 * block + at);
                let (closing, around) = (&mut trial.closing, &mut trial.around);
                let closing = &mut closing[member * width..][..width];
                let around = &mut around[member * width..][..width];
                let sigma = &trial.sigma[..width];
                for i in 0..width {
                    let ([aa, ab], [ba, bb]) =
                        (both(|c| L::load(&columns[c][i])), both(|c| L::load(&columns[2 + c][i])));
                    let turned = a * ab + b * bb;
                    ((a * aa + b * ba) + L::load(&sigma[i]) * turned).store(&mut closing[i]);
                    turned.store(&mut around[i]);
                }
            }
        }
    }

    /// Adds the open lanes that penetrate under the extrapolated forces of the closed lanes. Returns whether there are
    /// any.
    #[inline(always)]
    fn add_open<L: Octet>(&mut self) -> bool {
        let width = self.level.blocks;
        let BladeTrial { open, closing, members, multipliers, gaps, later, active, .. } = &mut *self.trial;
        if later.iter().all(|mask| *mask == 0) {
            return false;
        }
        let amount = |place: usize| multipliers[members[place] / 8].0[members[place] % 8];
        combine::<L>(Some(&open[..width]), closing, members, amount, &mut gaps[..width]);
        let mut found = false;
        for lane in 0..width {
            let more = L::load(&gaps[lane]).less(L::zero()) & later[lane];
            active[lane] |= more;
            found |= more != 0;
        }
        later.fill(0);
        found
    }

    /// Solves the contact problem of the members, and computes F of all lanes.
    #[inline(always)]
    fn solve_members<L: Octet>(&mut self) {
        let width = self.level.blocks;
        let BladeTrial { open, closing, members, multipliers, gaps, matrix, .. } = &mut *self.trial;
        let count = members.len();
        let blocks = Eight::blocks(count);
        let matrix = &mut matrix[..(count + 1) * blocks];
        for (column, member) in matrix.chunks_exact_mut(blocks.max(1)).zip(&*members) {
            let entries = &closing[member * width..][..width];
            for (place, row) in members.iter().enumerate() {
                column[place / 8].0[place % 8] = entries[row / 8].0[row % 8];
            }
        }
        for (place, row) in members.iter().enumerate() {
            matrix[count * blocks + place / 8].0[place % 8] = -open[row / 8].0[row % 8];
        }
        match blocks {
            0 => {}
            1 => eliminate::<L, 1>(matrix, count),
            2 => eliminate::<L, 2>(matrix, count),
            3 => eliminate::<L, 3>(matrix, count),
            4 => eliminate::<L, 4>(matrix, count),
            5 => eliminate::<L, 5>(matrix, count),
            6 => eliminate::<L, 6>(matrix, count),
            _ => eliminate_any::<L>(matrix, count, blocks),
        }
        multipliers.fill(Eight::ZERO);
        let solution = &matrix[count * blocks..];
        for (place, member) in members.iter().enumerate() {
            multipliers[member / 8].0[member % 8] = solution[place / 8].0[place % 8];
        }
        let amount = |place: usize| solution[place / 8].0[place % 8];
        combine::<L>(Some(&open[..width]), closing, members, amount, &mut gaps[..width]);
    }

    /// Solves 0 ≤ λ' ⟂ F ≥ 0 by changing the status of all lanes of the wrong sign, first on the linearised and then on
    /// the curved surface. Returns false if no solution is found.
    #[inline(always)]
    fn solve<L: Octet>(&mut self, factorisations: &mut usize) -> bool {
        let width = self.level.blocks;
        let most = 40 + 4 * 8 * width;
        self.trial.curved.fill(Eight::ZERO);
        let (mut pass, mut solutions) = (0, 0);
        while solutions < most {
            self.list_members::<L>();
            if self.add_open::<L>() {
                continue;
            }
            self.solve_members::<L>();
            *factorisations += 1;
            solutions += 1;
            if self.change_members::<L>(solutions) {
                continue;
            }
            let is_curved = self.find_curvature::<L>();
            pass += 1;
            if !is_curved {
                self.finish::<L>();
                let mut finite = 0xff;
                for gaps in &self.trial.gaps[..width] {
                    finite &= L::load(gaps).abs().less(L::splat(f64::INFINITY));
                }
                return finite == 0xff;
            }
            if pass == PASSES {
                return false;
            }
        }
        false
    }

    /// Removes members that pull and adds lanes that penetrate. Returns whether any changed.
    #[inline(always)]
    fn change_members<L: Octet>(&mut self, solutions: usize) -> bool {
        let mut largest = [L::zero(); 2];
        for lane in 0..self.level.blocks {
            largest[0] = largest[0].max(L::load(&self.trial.multipliers[lane]).abs());
            let (open, active) = (L::load(&self.trial.open[lane]), self.trial.active[lane]);
            largest[1] = largest[1].max(L::select(active, open.abs(), L::zero()));
        }
        let [force, gap] = both(|of| largest[of].array().into_iter().fold(0.0_f64, f64::max) * ROUNDING);
        let mut changed = false;
        for lane in 0..self.level.blocks {
            let valid = self.rows.valid(lane);
            let BladeTrial { multipliers, gaps, active, .. } = &mut *self.trial;
            let pulls = active[lane] & L::load(&multipliers[lane]).less(L::splat(-force));
            let penetrates = !active[lane] & valid & L::load(&gaps[lane]).less(L::splat(-gap));
            let wrong = pulls | penetrates;
            if wrong == 0 {
                continue;
            }
            changed = true;
            if solutions > JOINT_CHANGES {
                active[lane] ^= wrong & wrong.wrapping_neg();
                break;
            }
            active[lane] ^= wrong;
        }
        changed
    }

    /// Computes the contribution of the curvature of the surface to F for the current solution. If it differs by more
    /// than the precision from the assumed contribution, replaces that and returns true.
    #[inline(always)]
    fn find_curvature<L: Octet>(&mut self) -> bool {
        let (width, precision) = (self.level.blocks, L::splat(self.precision));
        let BladeTrial { around, members, multipliers, gaps, held, bend, curved, open, active, turned, .. } =
            &mut *self.trial;
        let amount = |place: usize| multipliers[members[place] / 8].0[members[place] % 8];
        combine::<L>(None, around, members, amount, &mut turned[..width]);
        let mut over = 0;
        for Place { lane, block, .. } in self.level.places(self.rows) {
            let by = L::load(&turned[lane]) - L::load(&held[block]);
            let change = L::load(&bend[lane]) * by * by - L::load(&curved[lane]);
            let valid = self.rows.valid(lane);
            over |= active[lane] & precision.less(change.abs());
            over |= !active[lane] & valid & (L::load(&gaps[lane]) + change).less(L::zero() - precision);
        }
        if over == 0 {
            return false;
        }
        for Place { lane, block, .. } in self.level.places(self.rows) {
            let by = L::load(&turned[lane]) - L::load(&held[block]);
            let now = L::load(&bend[lane]) * by * by;
            let change = now - L::load(&curved[lane]);
            (L::load(&open[lane]) + change).store(&mut open[lane]);
            now.store(&mut curved[lane]);
        }
        true
    }

    /// Writes the displacements, F and the forces of the solution.
    #[inline(always)]
    fn finish<L: Octet>(&mut self) {
        let BladeTrial {
            clear, sigma, bend, curved, gaps, moved, multipliers, directions, forces, held, turned, ..
        } = &mut *self.trial;
        let [closing, around] = moved;
        for Place { lane, block, .. } in self.level.places(self.rows) {
            let turned = L::load(&turned[lane]);
            let by = turned - L::load(&held[block]);
            let straight = L::load(&gaps[lane]) - L::load(&curved[lane]);
            (straight - L::load(&clear[lane]) - L::load(&sigma[lane]) * by).store(&mut closing[lane]);
            (L::load(&around[lane]) + turned).store(&mut around[lane]);
            (straight + L::load(&bend[lane]) * by * by).store(&mut gaps[lane]);
            // Rounding may make a force slightly negative.
            let multiplier = L::load(&multipliers[lane]).max(L::zero());
            multiplier.store(&mut multipliers[lane]);
            for along in [0, 1] {
                (multiplier * L::load(&directions[along][lane])).store(&mut forces[along][lane]);
            }
        }
    }
}
