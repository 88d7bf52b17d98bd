//! Tries a step of an island: evaluates motion, gaps and forces in turn until they are consistent, then assesses the
//! step.

use super::{BETWEEN_POINTS_FACTOR, Island, IslandInSpan, IslandSector, SectorInStep};
use crate::time::galerkin::carrier::{BLOCKS, CarrierIntegrator};
use crate::time::galerkin::span::{SpanStep, StepGoal};
use crate::time::galerkin::surroundings::{Surroundings, Witness};
use crate::time::galerkin::tables::HALVINGS;
use crate::time::galerkin::trial::{ForceInterpolation, Obstacle, TrialResult};

/// Largest number of gap evaluations in one trial of a single sector. The last one is exact except for curvature.
const PASSES_OF_ONE: usize = 6;
/// Largest number of gap evaluations in one trial of several sectors whose motions are coupled.
const PASSES: usize = 16;

/// Largest number of exchanges of forces between sectors on elastic surfaces per contact solution, and precision of the gaps after these
/// exchanges, relative to the largest gap of a closed contact. The change of the normals until the next evaluation causes similar errors.
/// Blades of one disk also move each other through the disk, which the exchanges do not contain, by about 1 % of this gap.
const MAX_EXCHANGES: usize = 12;
const EXCHANGE_PRECISION: f64 = 1e-5;
const EXCHANGE_PRECISION_ON_DISKS: f64 = 1e-3;

/// Sectors whose gaps at the start of a step exceed this many tolerances are evaluated only after the contact problems of the other sectors
/// are solved.
const FAR: f64 = 20.0;

/// Depth, in tolerances, by which open nodes may enter a surface between the points of a step of coupled sectors. In most steps, some node
/// of the sectors comes near a surface, so most steps would be short if no depth were allowed. On `builtin:stage` with a tolerance of 1e-2,
/// this depth more than halves the number of trials at the same error.
const ALLOWED_DEPTH: f64 = 0.3;

/// Gaps of an island at the points of a step.
pub(super) struct IslandGaps {
    /// Smallest gap (m).
    pub lowest: f64,
    /// Largest gap of an active contact (m).
    largest: f64,
    /// True if no contact is active.
    rests: bool,
}

impl<S: Surroundings> IslandInSpan<'_, S> {
    /// Starts a trial: prescribed motion at the points, motion without forces, and an initial guess of the forces.
    pub(super) fn prepare(&mut self, step: SpanStep, kind: ForceInterpolation) {
        self.island.disks.iter_mut().for_each(|disk| disk.body.begin(step, kind));
        let basis = &self.island.tables[0][0].levels[step.level].basis;
        for carrier in &mut self.island.carriers {
            carrier.body.begin(step, kind);
            carrier.work_weights = std::array::from_fn(|i| kind.work_weights(basis, i));
        }
        self.begin_surfaces(step, kind);
        // Inactive sectors keep no block, because active ones could get the same.
        self.island.sectors.iter_mut().for_each(|one| one.block = None);
        for place in self.places() {
            self.begin_trial(self.index(place), step, kind);
        }
        if self.island.fresh {
            // Earlier forces are applied at the places of the nodes at the start of the span.
            self.react(0..=0, step, kind);
        }
    }

    /// Starts the trial of a sector.
    fn begin_trial(&mut self, index: usize, step: SpanStep, kind: ForceInterpolation) {
        let is_single = self.island.is_single();
        let one = &mut self.island.sectors[index];
        one.block = None;
        let SectorInStep { mut surfaces, tables, disk, trial, state, .. } = self.sector(index, step, kind);
        let level = &tables.levels[step.level];
        let rows = disk.is_none().then_some(&tables.rows);
        if let Some(rows) = rows.filter(|_| trial.sticks() && !is_single || !state.gaps_known) {
            trial.find_start(rows, state);
        }
        trial.begin(level, kind, rows, state);
        trial.find_start_gaps(state, |node, moved| surfaces.gap(node, 0, moved).distance);
        drop(surfaces);
        let distance = FAR * self.goal.tolerance;
        let one = &mut self.island.sectors[index];
        one.is_far = !is_single && one.trial.rests() && one.trial.lowest_at_start() > distance;
    }

    /// Sets the prescribed motion at the points, and initial guesses of the closest points. Surfaces follow the motion of the first sector.
    fn begin_surfaces(&mut self, step: SpanStep, kind: ForceInterpolation) {
        let is_single = self.island.is_single();
        for index in 0..self.island.sectors.len() {
            let is_active = self.island.sectors[index].limits.is_none();
            let SectorInStep { mut surfaces, tables, .. } = self.sector(index, step, kind);
            if is_active || surfaces.sector() == 0 {
                surfaces.begin_step(step.from, step.length, &tables.levels[step.level], kind);
                if !is_single {
                    surfaces.guess_start_places();
                }
            }
        }
        if !self.island.carriers.is_empty() && self.active().any(|one| !one.state.gaps_known) {
            self.surroundings.bend(&self.island.carriers, 0);
        }
    }

    /// Applies the forces at some points of the step to the surface carriers.
    fn react(&mut self, points: std::ops::RangeInclusive<usize>, step: SpanStep, kind: ForceInterpolation) {
        if self.island.carriers.is_empty() {
            return;
        }
        self.island.carriers.iter_mut().for_each(CarrierIntegrator::clear_loads);
        for place in self.places() {
            let index = self.index(place);
            if self.island.sectors[index].is_far {
                continue;
            }
            let SectorInStep { mut surfaces, trial, .. } = self.sector(index, step, kind);
            for (point, node) in points.clone().flat_map(|point| (0..trial.nodes()).map(move |node| (point, node))) {
                if trial.multiplier(point, node) != 0.0 {
                    surfaces.react(node, point, trial.force(point, node));
                }
            }
        }
        self.island.carriers.iter_mut().for_each(|carrier| carrier.gather(points.clone()));
    }

    /// Computes the motion of all shared bodies under the current forces.
    pub(super) fn move_bodies(&mut self, step: SpanStep, kind: ForceInterpolation, points: usize) {
        let Island { disks, sectors, active, .. } = &mut *self.island;
        for (number, disk) in disks.iter_mut().enumerate() {
            let Some(bank) = self.surroundings.disk(disk.structure) else { continue };
            let of_disk = |one: &IslandSector| one.disk.filter(|(disk, _)| *disk == number).map(|(_, lane)| lane);
            let pushing = |point: usize| {
                let own = active.iter().map(|index| &sectors[*index]).filter_map(|one| Some((one, of_disk(one)?)));
                own.flat_map(move |(one, lane)| {
                    let nodes = (0..one.trial.nodes()).filter(move |node| one.trial.multiplier(point, *node) != 0.0);
                    nodes.map(move |node| (lane, node, one.trial.force(point, node)))
                })
            };
            let [_, one, two, three] = &mut disk.body.forces;
            match points {
                1 => bank.modal_forces(pushing(1), one),
                _ => bank.modal_forces_of_two([pushing(1), pushing(2)], [one, two]),
            }
            if points == 3 {
                bank.modal_forces(pushing(3), three);
            }
            disk.body.push(step.level, kind);
            disk.find_rows_at(bank, points);
            for index in active.iter() {
                let one = &mut sectors[*index];
                if let Some(lane) = of_disk(one) {
                    one.trial.carry(|point, node| disk.moved_at(point, node, lane));
                }
            }
        }
        if self.island.carriers.is_empty() {
            return;
        }
        self.react(1..=points, step, kind);
        for carrier in &mut self.island.carriers {
            carrier.body.push(step.level, kind);
            carrier.recover(points);
        }
    }

    /// Computes the gaps at all points, either of the far sectors or of the near sectors.
    pub(super) fn find_gaps(
        &mut self,
        step: SpanStep,
        kind: ForceInterpolation,
        points: usize,
        is_far: bool,
    ) -> IslandGaps {
        if self.island.carriers.is_empty() {
            for place in self.places() {
                let index = self.index(place);
                if self.island.sectors[index].is_far == is_far {
                    let SectorInStep { mut surfaces, trial, .. } = self.sector(index, step, kind);
                    trial.find_gaps(&mut surfaces);
                }
            }
        } else {
            for place in self.places() {
                let one = &mut self.island.sectors[self.island.active[place]];
                if one.is_far == is_far {
                    one.trial.move_rows();
                }
            }
            for point in 1..=points {
                self.surroundings.bend(&self.island.carriers, point);
                self.surroundings.find_ring_gaps(self.island, point, is_far);
                for place in self.places() {
                    let index = self.index(place);
                    if self.island.sectors[index].is_far == is_far {
                        let SectorInStep { mut surfaces, trial, .. } = self.sector(index, step, kind);
                        trial.find_gaps_at(point, &mut surfaces);
                    }
                }
            }
        }
        let mut found = IslandGaps { lowest: f64::INFINITY, largest: 0.0, rests: true };
        for one in self.active().filter(|one| one.is_far == is_far) {
            let (lowest, largest) = one.trial.extremes();
            let is_lost = lowest.is_nan() || found.lowest.is_nan();
            found.lowest = if is_lost { f64::NAN } else { found.lowest.min(lowest) };
            found.largest = found.largest.max(largest);
            found.rests &= one.trial.rests();
        }
        found
    }

    /// Marks the sectors that are far; `lowest` is the lowest gap (m).
    fn separate_far_sectors(&mut self, lowest: f64) {
        for place in self.places() {
            let one = &mut self.island.sectors[self.island.active[place]];
            one.is_far |= one.trial.rests() && one.trial.extremes().0 > -lowest;
        }
    }

    /// Rechecks the far sectors. Returns whether one of them touches, and marks that sector as near.
    fn recheck_far_sectors(&mut self, step: SpanStep, kind: ForceInterpolation, points: usize) -> bool {
        if !self.active().any(|one| one.is_far) {
            return false;
        }
        let IslandGaps { lowest, .. } = self.find_gaps(step, kind, points, true);
        for place in self.places() {
            let one = &mut self.island.sectors[self.island.active[place]];
            one.is_far &= one.trial.extremes().0 >= 0.0;
        }
        // The next evaluation of the near sectors reports NaN gaps.
        lowest.is_nan() || lowest < 0.0
    }

    /// Stores the first sector for which `holds` is true as the cause of the failure.
    fn blame(&mut self, holds: impl Fn(&IslandSector) -> bool, is_lost: bool) {
        let failed = self.island.active.iter().find(|index| holds(&self.island.sectors[**index]));
        self.island.failed = failed.map(|index| (*index, is_lost));
    }

    /// Finds forces that remove penetration, sector by sector. Sectors on elastic surfaces then exchange their new forces until their gaps
    /// agree to `precision` (m). Returns false if a contact problem has no solution.
    fn solve(&mut self, step: SpanStep, kind: ForceInterpolation, precision: f64, result: &mut TrialResult) -> bool {
        self.island.carriers.iter_mut().for_each(|carrier| carrier.compliance.clear_force_changes());
        let mut blocks = BLOCKS.min(self.island.sectors.iter().filter(|one| one.block.is_some()).count());
        let mut solved = 0;
        for place in self.places() {
            let index = self.index(place);
            let IslandSector { is_far, trial, block, .. } = &mut self.island.sectors[index];
            if *is_far || (trial.extremes().0 >= 0.0 && trial.rests()) {
                continue;
            }
            solved += 1;
            if block.is_none() {
                *block = Some(blocks);
                blocks = BLOCKS.min(blocks + 1);
            }
            let SectorInStep { mut surfaces, tables, disk, trial, state, .. } = self.sector(index, step, kind);
            if disk.is_none() {
                trial.find_start(&tables.rows, state);
            }
            let compliance = tables.levels[step.level].compliance_of(kind);
            let solved = trial.solve(compliance, tables.rows.residual(), &mut surfaces, result);
            drop(surfaces);
            if !solved {
                self.island.failed = Some((index, false));
                return false;
            }
        }
        let is_coupled = solved > 1 && !self.island.carriers.is_empty();
        !is_coupled || self.exchange_forces(step, kind, precision, result)
    }

    /// Solves the contact problems again with the new forces of the other sectors. Returns false if one of them has no solution.
    fn exchange_forces(
        &mut self,
        step: SpanStep,
        kind: ForceInterpolation,
        precision: f64,
        result: &mut TrialResult,
    ) -> bool {
        for _ in 0..MAX_EXCHANGES {
            let mut changed = false;
            for place in self.places() {
                let index = self.index(place);
                let IslandSector { is_far, trial, .. } = &self.island.sectors[index];
                if *is_far || trial.sticks() || (trial.extremes().0 >= 0.0 && trial.rests()) {
                    continue;
                }
                let SectorInStep { mut surfaces, tables, trial, .. } = self.sector(index, step, kind);
                let compliance = tables.levels[step.level].compliance_of(kind);
                let [solved, own] = trial.solve_again(compliance, &mut surfaces, precision, result);
                drop(surfaces);
                if !solved {
                    self.island.failed = Some((index, false));
                    return false;
                }
                changed |= own;
            }
            if !changed {
                break;
            }
        }
        true
    }

    /// Tries a step. Activates further sectors if bodies move so far that these sectors may touch.
    pub(super) fn attempt_step(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        if let Some(result) = self.attempt_steady(step, kind) {
            return result;
        }
        self.attempt_active(step, kind)
    }

    /// Activates the sectors that may touch because bodies move further than their limits. Returns whether one of them touches.
    fn activate_sectors(&mut self, step: SpanStep, kind: ForceInterpolation, points: usize) -> bool {
        if self.island.active.len() == self.island.sectors.len() {
            return false;
        }
        self.surroundings.find_surface_motions(&self.island.carriers, 1..=points);
        self.island.disks.iter_mut().for_each(|disk| disk.find_motions(1..=points));
        let before = self.island.active.len();
        for index in 0..self.island.sectors.len() {
            let motion = self.surroundings.surface_motion(index) + self.island.disk_motion(index);
            let one = &mut self.island.sectors[index];
            if one.limits.is_some_and(|limits| limits.motion <= BETWEEN_POINTS_FACTOR * motion) {
                (one.limits, one.checked_at) = (None, Some(step.from));
                self.island.active.push(index);
            }
        }
        if self.island.active.len() == before {
            return false;
        }
        self.surroundings.bend(&self.island.carriers, 0);
        self.surroundings.prepare_activated_sectors(self.island, before);
        for place in before..self.island.active.len() {
            let index = self.index(place);
            let SectorInStep { mut surfaces, tables, .. } = self.sector(index, step, kind);
            surfaces.begin_step(step.from, step.length, &tables.levels[step.level], kind);
            surfaces.guess_start_places();
            drop(surfaces);
            self.begin_trial(index, step, kind);
            let Island { disks, sectors, .. } = &mut *self.island;
            let one = &mut sectors[index];
            one.is_far = true;
            if let Some((disk, lane)) = one.disk {
                one.trial.carry(|point, node| disks[disk].moved_at(point, node, lane));
            }
        }
        self.island.active.sort_unstable();
        self.recheck_far_sectors(step, kind, points)
    }

    /// Tries a step of the active sectors.
    fn attempt_active(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        self.surroundings.choose_active(self.island, step);
        self.prepare(step, kind);
        let (points, precision) = (self.island.points(step, kind), self.goal.precision);
        let passes = if self.island.is_single() { PASSES_OF_ONE } else { PASSES };
        let mut result = TrialResult::default();
        for pass in 0..passes {
            self.move_bodies(step, kind, points);
            let IslandGaps { lowest, largest, rests } = self.find_gaps(step, kind, points, false);
            if lowest.is_nan() {
                self.blame(|one| one.trial.extremes().0.is_nan(), true);
                return result;
            }
            // No contact is active or needed, or the solution also holds for the curved gaps.
            if ((rests && lowest >= 0.0) || (pass > 0 && lowest >= -precision && largest <= precision))
                && !self.recheck_far_sectors(step, kind, points)
                && !self.activate_sectors(step, kind, points)
            {
                result.solved = true;
                break;
            }
            if pass == 0 && !self.island.is_single() {
                self.separate_far_sectors(lowest.min(-precision));
            }
            if pass + 1 == passes {
                self.blame(|one| one.trial.extremes().0 <= lowest || one.trial.extremes().1 >= largest, false);
                return result;
            }
            let relative = if self.island.disks.is_empty() { EXCHANGE_PRECISION } else { EXCHANGE_PRECISION_ON_DISKS };
            let exchanged = relative * largest.max(-lowest).max(precision);
            if !self.solve(step, kind, exchanged, &mut result) {
                return result;
            }
        }
        if kind == ForceInterpolation::Polynomial {
            self.judge(step, points, &mut result);
        }
        result
    }

    /// Tries a step of a higher degree, if there are tables for it. Returns the result if all contacts slide fast, or if no
    /// contact changes its status within the step.
    fn attempt_steady(&mut self, step: SpanStep, kind: ForceInterpolation) -> Option<TrialResult> {
        if kind == ForceInterpolation::Constant || !self.island.is_single() {
            return None;
        }
        let StepGoal { precision, tolerance, .. } = self.goal;
        let SectorInStep { mut surfaces, tables, trial, state, .. } = self.sector(0, step, kind);
        let level = tables.steady.get(step.level)?;
        surfaces.begin_step(step.from, step.length, level, kind);
        let fast = trial.run_fast_sliding(level, &tables.rows, state, &mut surfaces, precision);
        // A shortest step that misses the tolerance or needs energy is also tried with degree 1.
        let needs_energy = fast.switches && fast.switched > 0.0;
        if fast.solved && (step.level < HALVINGS || !needs_energy && !fast.misses(tolerance)) {
            return Some(fast);
        }
        let result = trial.run_steady(level, &tables.rows, state, &mut surfaces, precision);
        result.solved.then_some(result)
    }

    /// Finds error, switches and near misses of all sectors.
    fn judge(&mut self, step: SpanStep, points: usize, result: &mut TrialResult) {
        self.island.carriers.iter_mut().for_each(CarrierIntegrator::clear_loads);
        self.island.disks.iter_mut().for_each(|disk| disk.error = 0.0);
        let is_single = self.island.is_single();
        let allowed_depth = if is_single { 0.0 } else { ALLOWED_DEPTH * self.goal.tolerance };
        for place in self.places() {
            let index = self.index(place);
            self.island.sectors[index].is_far = false;
            let SectorInStep { mut surfaces, tables, disk, trial, state, .. } =
                self.sector(index, step, ForceInterpolation::Polynomial);
            let (level, mut own) = (&tables.levels[step.level], TrialResult::default());
            if is_single {
                trial.find_free_motion(level, &tables.rows, state);
            }
            trial.judge(level, &tables.rows, &surfaces, allowed_depth, &mut own);
            match disk {
                // The error of one sector makes all sectors of its disk vibrate.
                Some(disk) => disk.error = disk.error.hypot(own.error),
                None => result.error = result.error.max(own.error),
            }
            result.switches |= own.switches;
            result.switched += own.switched;
            result.near |= own.near;
            for node in 0..trial.nodes() {
                let impulse = trial.impulse(node);
                if impulse.iter().any(|component| *component != 0.0) {
                    surfaces.add_impulse(node, points, impulse);
                }
            }
        }
        self.island.carriers.iter_mut().for_each(CarrierIntegrator::gather_impulses);
        if self.active().any(|one| one.trial.has_depth()) {
            result.depth = self.depth(step, points);
        }
        let errors = self.island.carriers.iter().map(CarrierIntegrator::error);
        let errors = errors.chain(self.island.disks.iter().map(|disk| disk.error));
        result.error = errors.fold(result.error, f64::max);
    }

    /// Returns the largest penetration of open nodes between the points of a step (m).
    fn depth(&mut self, step: SpanStep, points: usize) -> f64 {
        let (mut deepest, is_single) = (0.0_f64, self.island.is_single());
        self.surroundings.bend(&self.island.carriers, 0);
        for place in self.places() {
            let index = self.index(place);
            let SectorInStep { mut surfaces, tables, disk, trial, state, .. } =
                self.sector(index, step, ForceInterpolation::Polynomial);
            if disk.is_none() {
                trial.find_start(&tables.rows, state);
            }
            deepest = deepest.max(trial.depth(&mut surfaces));
        }
        // Contacts of a single sector are recorded on the surface as it was last evaluated.
        if !is_single {
            self.surroundings.bend(&self.island.carriers, points);
        }
        deepest
    }
}
