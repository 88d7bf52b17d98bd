//! Islands: sectors and bodies that must step together, as one type. A blade on rigid surfaces is an island of one sector; the sectors of
//! a coupled disk, and all sectors that touch surfaces of one carrier, are an island with shared bodies.

mod attempt;

use super::advance::Advance;
use super::carrier::{BLOCKS, CarrierIntegrator};
use super::compliance::Lanes;
use super::disk::CoupledDisk;
use super::shared_body::SharedBody;
use super::span::{Flight, LONGEST_NEAR_STEP, SpanStep, SpanSteps, StepGoal, Stopped, integrate};
use super::state::SectorState;
use super::surroundings::{AcceptedStep, CarriersInStep, LaneStep, Surroundings, Witness};
use super::tables::{HALVINGS, Tables, halved};
use super::trial::{ForceInterpolation, StepToFollow, TravelBounds, Trial, TrialResult};
use crate::scene::method::Solver;
use crate::system::Effort;

/// Fraction of the largest energy so far that a step of coupled sectors may add to a bank that still holds energy. Some contact opens or
/// closes in most of these steps, so all steps would be short without this allowance. On `builtin:stage` with a tolerance of 1e-3 it halves
/// the number of trials, and the error is 3e-4 instead of 1e-4.
const BANK_ALLOWANCE: f64 = 1e-6;

/// Limits up to which an inactive sector certainly stays open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OpenLimits {
    /// Time from the start of the span, as a fraction of the span.
    pub until: f64,
    /// Largest allowed motion of the surfaces, and of the nodes of a coupled sector, since the start of the step (m).
    pub motion: f64,
}

/// Assumed largest motion of bodies between the points of a step, divided by their largest motion at the points.
pub(crate) const BETWEEN_POINTS_FACTOR: f64 = 2.0;

/// Time until the next check whether an active sector stays open, after a check that failed, in lengths of the step.
const RECHECK_STEPS: f64 = 4.0;

/// State of step control that persists from span to span.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepControl {
    /// Energy bank of contacts that opened and closed (J).
    pub bank: f64,
    /// Largest energy so far, the reference for the bank (J).
    pub largest: f64,
    /// Number of halvings of the span for the next step.
    pub level: usize,
}

/// Tables, state and scratch memory of an island; allocates only on creation.
#[derive(Debug, Clone)]
pub struct Island {
    /// Sectors with contact nodes.
    pub sectors: Vec<IslandSector>,
    /// Indices of the sectors that may touch in the current step; the others are in free motion.
    pub(crate) active: Vec<usize>,
    /// Disks whose modes move the sectors.
    pub disks: Vec<CoupledDisk>,
    /// Structures that carry the surfaces.
    pub carriers: Vec<CarrierIntegrator>,
    /// Tables of each structure with contact nodes, one for each kind of its sectors.
    pub tables: Vec<Vec<Tables>>,
    /// Step control.
    pub control: StepControl,
    /// Length of the spans of the tables (s).
    span: f64,
    /// True if no step of the span has been accepted.
    fresh: bool,
    /// The sector for which a step has failed, and whether its gap is NaN.
    pub failed: Option<(usize, bool)>,
}

/// One sector of an island.
#[derive(Debug, Clone)]
pub struct IslandSector {
    /// Index of the structure's tables, and of the sector's table among them.
    pub table: [usize; 2],
    /// Index of the disk, and lane of the sector on it, if its modes belong to a disk.
    pub disk: Option<(usize, usize)>,
    /// State between steps.
    pub state: SectorState,
    pub(super) trial: Trial,
    advance: Advance,
    /// Limits up to which the sector stays open; `None` for active sectors.
    pub(crate) limits: Option<OpenLimits>,
    /// Time at which it was last found that the sector must be active, as a fraction of the span; `None` at the start of a span.
    pub(crate) checked_at: Option<f64>,
    /// Bound of the motion of the surfaces, and of the nodes of a coupled sector, over the last step (m); 0 at the start of a span.
    pub(crate) last_motion: f64,
    /// Sum of these motions since the start of the span (m).
    pub(crate) drift: f64,
    /// Block of lanes of the sector on surface carriers in the current trial; `None` before its first contact problem.
    block: Option<usize>,
    /// True if no force acts on the sector and its gaps are so wide that they are evaluated only after the contact problems of the other
    /// sectors are solved.
    pub(crate) is_far: bool,
}

impl IslandSector {
    /// Creates a sector with the modes and contact nodes of its tables; the modes of a disk belong to the disk.
    pub(crate) fn new(table: [usize; 2], disk: Option<(usize, usize)>, tables: &[Vec<Tables>], solver: Solver) -> Self {
        let own = &tables[table[0]][table[1]];
        let (modes, nodes) = (if disk.is_some() { 0 } else { own.modes() }, own.nodes());
        let trial = Trial::new(modes, nodes, solver);
        Self {
            table,
            disk,
            state: SectorState::new(modes, nodes),
            trial: if own.steady.is_empty() { trial } else { trial.steady() },
            advance: Advance::new(modes, nodes),
            limits: None,
            checked_at: None,
            last_motion: 0.0,
            drift: 0.0,
            block: None,
            is_far: false,
        }
    }

    /// Returns whether it was found recently that the sector must be active.
    pub(crate) fn was_checked(&self, step: SpanStep) -> bool {
        self.checked_at.is_some_and(|time| step.from < time + RECHECK_STEPS * step.length)
    }

    /// Returns the displacements of the contact rows (m) and the state.
    pub fn displacements(&mut self, tables: &[Vec<Tables>]) -> (&[f64], &SectorState) {
        let rows = &tables[self.table[0]][self.table[1]].rows;
        (self.trial.displacements(rows, &self.state), &self.state)
    }

    /// Returns the largest displacement of each contact row from rest (m) without contact.
    pub(crate) fn largest_displacements(&mut self, tables: &[Vec<Tables>]) -> &[f64] {
        let rows = &tables[self.table[0]][self.table[1]].rows;
        self.trial.largest_displacements(rows, &self.state)
    }
}

impl Island {
    /// Creates an island; call [`Island::set_span`] before the first span.
    pub fn new(
        tables: Vec<Vec<Tables>>,
        sectors: Vec<IslandSector>,
        disks: Vec<CoupledDisk>,
        carriers: Vec<CarrierIntegrator>,
    ) -> Self {
        let (active, control) = ((0..sectors.len()).collect(), StepControl::default());
        Self { sectors, active, disks, carriers, tables, control, span: 0.0, fresh: true, failed: None }
    }

    /// Creates an island of one sector.
    pub fn of_one(tables: Tables) -> Self {
        let tables = vec![vec![tables]];
        let sector = IslandSector::new([0; 2], None, &tables, Solver::Lcp);
        Self::new(tables, vec![sector], Vec::new(), Vec::new())
    }

    /// Sets the length of the spans (s). Fills all tables of a single sector on rigid surfaces; in other islands, the first step of a level
    /// fills the tables of this level.
    pub fn set_span(&mut self, span: f64) {
        if span.to_bits() == self.span.to_bits() {
            return;
        }
        self.span = span;
        self.tables.iter_mut().flatten().for_each(|tables| tables.set_span_length(span));
        self.shared_bodies_mut().for_each(|body| body.set_span_length(span));
        if self.is_single() {
            (0..=HALVINGS).for_each(|level| self.fill(level));
        }
    }

    /// Fills the tables of a level, unless they are filled.
    fn fill(&mut self, level: usize) {
        self.tables.iter_mut().flatten().for_each(|tables| {
            tables.fill(level);
        });
        self.shared_bodies_mut().for_each(|body| body.fill(level));
    }

    /// Returns whether the island is a single sector on rigid surfaces.
    pub(crate) fn is_single(&self) -> bool {
        self.sectors.len() == 1 && self.disks.is_empty() && self.carriers.is_empty()
    }

    /// Begins a span from the current states; contact forces at its start are up to date.
    pub fn begin<'a, S: Surroundings>(&'a mut self, surroundings: &'a mut S, goal: StepGoal) -> IslandInSpan<'a, S> {
        self.sectors.iter_mut().for_each(|one| one.trial.forget());
        (self.fresh, self.failed) = (true, None);
        self.carriers.iter_mut().for_each(CarrierIntegrator::find_start);
        let mut island = IslandInSpan { island: self, surroundings, goal };
        island.find_start();
        island.island.disks.iter_mut().for_each(CoupledDisk::set_motion_origin);
        island
    }

    /// Bounds the displacements of the nodes of a sector over up to `max_time` (s) without contact; `None` for sectors of a disk.
    pub(crate) fn travel(&mut self, index: usize, max_time: f64) -> Option<TravelBounds<'_>> {
        let IslandSector { table, disk, trial, state, .. } = &mut self.sectors[index];
        let rows = &self.tables[table[0]][table[1]].rows;
        disk.is_none().then(|| trial.travel(rows, state, max_time))
    }

    /// Length of the spans (s).
    pub(crate) fn span(&self) -> f64 {
        self.span
    }

    /// Refills `active` with the sectors that have no limits.
    pub(crate) fn list_active(&mut self) {
        let active = self.sectors.iter().enumerate().filter(|(_, one)| one.limits.is_none());
        self.active.clear();
        self.active.extend(active.map(|(index, _)| index));
    }

    /// Bound of the changes of the gaps of a sector (m) by the motion of its disk, from the last call of [`CoupledDisk::find_motions`]; 0
    /// for uncoupled sectors.
    pub(crate) fn disk_motion(&self, index: usize) -> f64 {
        self.sectors[index].disk.map_or(0.0, |(disk, lane)| self.disks[disk].motion(lane))
    }

    /// Prepares an inactive sector for the next trial, and finds the displacements of its contact rows at the start of the step.
    pub(crate) fn find_start_of_inactive(&mut self, index: usize) {
        self.restart(index);
        let IslandSector { table, trial, state, .. } = &mut self.sectors[index];
        trial.find_start(&self.tables[table[0]][table[1]].rows, state);
    }

    /// Prepares an inactive sector for the next trial.
    fn restart(&mut self, index: usize) {
        let one = &mut self.sectors[index];
        one.trial.forget();
        if let Some((disk, lane)) = one.disk {
            one.trial.start_at(|row| self.disks[disk].row_at_start(row, lane));
        }
    }

    /// Kinetic and strain energy of all bodies at the start of the step (J).
    fn energy(&self) -> f64 {
        let own = self.sectors.iter().filter(|one| one.disk.is_none());
        let sectors = own.map(|one| self.tables[one.table[0]][one.table[1]].energy(&one.state));
        sectors.chain(self.shared_bodies().map(SharedBody::energy)).sum()
    }

    fn shared_bodies(&self) -> impl Iterator<Item = &SharedBody> {
        self.disks.iter().map(|disk| &disk.body).chain(self.carriers.iter().map(|carrier| &carrier.body))
    }

    fn shared_bodies_mut(&mut self) -> impl Iterator<Item = &mut SharedBody> {
        let disks = self.disks.iter_mut().map(|disk| &mut disk.body);
        disks.chain(self.carriers.iter_mut().map(|carrier| &mut carrier.body))
    }

    /// Number of points of a step.
    fn points(&self, step: SpanStep, kind: ForceInterpolation) -> usize {
        kind.points(&self.tables[0][0].levels[step.level].basis)
    }
}

/// An island and its surroundings during a span.
pub struct IslandInSpan<'a, S> {
    island: &'a mut Island,
    surroundings: &'a mut S,
    pub(super) goal: StepGoal,
}

/// One sector of an island in a step, with its surfaces.
struct SectorInStep<'a, W> {
    surfaces: W,
    tables: &'a Tables,
    disk: Option<&'a mut CoupledDisk>,
    trial: &'a mut Trial,
    state: &'a mut SectorState,
    advance: &'a mut Advance,
}

impl<S: Surroundings> IslandInSpan<'_, S> {
    /// Integrates over the span.
    ///
    /// # Errors
    /// [`Stopped`] if the span is not integrated to its end; the state is then the state after the last accepted step.
    pub fn integrate(&mut self, effort: &mut Effort) -> Result<(), Stopped> {
        integrate(self, effort)
    }

    /// Positions in the list of active sectors.
    fn places(&self) -> std::ops::Range<usize> {
        0..self.island.active.len()
    }

    /// Returns the index of the active sector at a position in the list.
    fn index(&self, place: usize) -> usize {
        self.island.active[place]
    }

    /// Active sectors.
    fn active(&self) -> impl Iterator<Item = &IslandSector> {
        self.island.active.iter().map(|index| &self.island.sectors[*index])
    }

    /// Returns a sector with its surfaces in a step.
    fn sector(&mut self, index: usize, step: SpanStep, kind: ForceInterpolation) -> SectorInStep<'_, S::Surfaces<'_>> {
        let Island { sectors, carriers, tables, disks, .. } = &mut *self.island;
        let IslandSector { table, disk, trial, state, advance, block, .. } = &mut sectors[index];
        let (lanes, block) = (Lanes { points: trial.points(), nodes: trial.nodes() }, block.unwrap_or(BLOCKS));
        let step = LaneStep { level: step.level, kind, lanes, block };
        let carriers = CarriersInStep { carriers, step };
        SectorInStep {
            surfaces: self.surroundings.surfaces(index, carriers),
            tables: &tables[table[0]][table[1]],
            disk: disk.map(|(disk, _)| &mut disks[disk]),
            trial,
            state,
            advance,
        }
    }

    /// Finds displacements and velocities of disks and of their sectors from the states of the disks.
    fn find_start(&mut self) {
        for disk in &mut self.island.disks {
            disk.body.settle();
            if let Some(bank) = self.surroundings.disk(disk.structure) {
                disk.find_rows(bank);
            }
        }
        self.start_sectors();
    }

    /// Sets displacements and velocities of the sectors of disks at the start of a step.
    fn start_sectors(&mut self) {
        let Island { disks, sectors, active, .. } = &mut *self.island;
        for index in active.iter() {
            let one = &mut sectors[*index];
            if let Some((disk, lane)) = one.disk {
                one.trial.start_at(|row| disks[disk].row_at_start(row, lane));
            }
        }
    }

    /// Returns the surfaces of a sector, and the largest displacements of its rows from rest (m) without contact.
    fn reach(&mut self, index: usize, step: SpanStep) -> (S::Surfaces<'_>, &[f64]) {
        let SectorInStep { surfaces, tables, disk, trial, state, .. } =
            self.sector(index, step, ForceInterpolation::Polynomial);
        let reach = match disk {
            Some(disk) => &disk.reach,
            None => trial.largest_displacements(&tables.rows, state),
        };
        (surfaces, reach)
    }

    /// Finds gaps within a step of free flight if a node may come closer there than at its ends.
    fn follow_flight(&mut self, step: SpanStep) {
        let may_come_closer = self.places().any(|place| {
            let index = self.index(place);
            let (surfaces, reach) = self.reach(index, step);
            surfaces.may_come_closer(step.from, step.length, reach)
        });
        if !may_come_closer {
            return;
        }
        let kind = ForceInterpolation::Polynomial;
        let points = self.island.points(step, kind);
        self.prepare(step, kind);
        self.move_bodies(step, kind, points);
        for far in [false, true] {
            self.find_gaps(step, kind, points, far);
        }
        if self.island.is_single() {
            self.follow(step, kind, true);
        } else {
            self.find_minima(step, kind, true);
        }
        for place in self.places() {
            let index = self.index(place);
            let SectorInStep { mut surfaces, tables, trial, .. } = self.sector(index, step, kind);
            surfaces.record_gaps(&tables.levels[step.level], trial);
        }
    }

    /// Takes a step of a single sector near rigid surfaces without a trial, if its nodes stay open.
    fn fly_near(&mut self, step: SpanStep) -> Flight {
        let (kind, tolerance) = (ForceInterpolation::Constant, self.goal.tolerance);
        if !self.island.is_single() || !self.island.sectors[0].state.gaps_known {
            return Flight::NeedsTrial;
        }
        let Some(bends) = self.sector(0, step, kind).surfaces.largest_bends(step.from, step.length) else {
            return Flight::NeedsTrial;
        };
        self.prepare(step, kind);
        let rejected = if step.level == HALVINGS || self.length(step.level) <= LONGEST_NEAR_STEP {
            Flight::NeedsTrial
        } else {
            Flight::TooLong
        };
        let lowest = self.find_gaps(step, kind, 1, false).lowest;
        if lowest.is_nan() {
            return Flight::NeedsTrial;
        }
        let SectorInStep { mut surfaces, tables, trial, state, advance, .. } = self.sector(0, step, kind);
        let step_tables = &tables.levels[step.level];
        let followed = StepToFollow { tables, level: step.level, step: step_tables, tolerance, state };
        if lowest <= 0.0 || !trial.stays_open(&followed, advance, &surfaces, bends) {
            return rejected;
        }
        surfaces.record_gaps(step_tables, trial);
        surfaces.keep_places();
        surfaces.record_damping(advance.freely(step_tables, state));
        trial.leave(state);
        Flight::Accepted
    }

    /// Finds how close the nodes of a single sector come between the points of a tried step, if the polynomials of the step describe the motion
    /// there (`is_resolved`). Stores the modal forces of the step. Returns the smallest of these gaps (m).
    fn follow(&mut self, step: SpanStep, kind: ForceInterpolation, is_resolved: bool) -> f64 {
        let tolerance = self.goal.tolerance;
        let SectorInStep { surfaces, tables, trial, state, advance, .. } = self.sector(0, step, kind);
        let step_tables = tables.of_points(step.level, kind, trial.points());
        advance.set_forces(&tables.rows, |node| trial.polynomial(&step_tables.basis, kind, node));
        trial.forget_followed();
        if !is_resolved {
            return f64::INFINITY;
        }
        let followed = StepToFollow { tables, level: step.level, step: step_tables, tolerance, state };
        trial.follow(&followed, advance, &surfaces)
    }

    /// Finds where nodes of several sectors may come closer between the points of a step, and stores the modal forces of the step.
    fn find_minima(&mut self, step: SpanStep, kind: ForceInterpolation, is_resolved: bool) {
        let tolerance = self.goal.tolerance;
        for place in self.places() {
            let index = self.index(place);
            let SectorInStep { surfaces, tables, disk, trial, state, advance } = self.sector(index, step, kind);
            let level = tables.of_points(step.level, kind, trial.points());
            if disk.is_none() {
                advance.set_forces(&tables.rows, |node| trial.polynomial(&level.basis, kind, node));
            }
            if trial.find_minima(&level.basis, is_resolved, tolerance, |node| surfaces.needed_below(node)) {
                if disk.is_none() {
                    trial.find_start(&tables.rows, state);
                }
                trial.drop_jumps(&surfaces, tolerance);
            }
        }
    }

    /// Advances all states to the end of the step.
    fn accept_states(&mut self, step: SpanStep, kind: ForceInterpolation) {
        self.island.fresh = false;
        for index in 0..self.island.sectors.len() {
            let is_active = self.island.sectors[index].limits.is_none();
            let SectorInStep { mut surfaces, tables, disk, trial, state, advance } = self.sector(index, step, kind);
            if !is_active {
                if disk.is_none() {
                    surfaces.record_damping(advance.freely(&tables.levels[step.level], state));
                }
                continue;
            }
            if disk.is_none() {
                let level = tables.of_points(step.level, kind, trial.points());
                surfaces.record_damping(advance.under_forces(level, state));
            }
            trial.leave(state);
        }
        let points = self.island.points(step, kind);
        self.island.carriers.iter_mut().for_each(|carrier| carrier.take(step.level, kind, points));
        for disk in &mut self.island.disks {
            disk.take(step.level, kind, points);
            // At the end of a span this is unnecessary: the next span computes displacements and velocities of all rows from the modal state,
            // and sets those of the sectors again.
            let bank = self.surroundings.disk(disk.structure).filter(|_| step.from + step.length < 1.0);
            if let Some(bank) = bank {
                disk.find_velocity(bank);
            }
        }
        self.start_sectors();
    }
}

impl<S: Surroundings> SpanSteps for IslandInSpan<'_, S> {
    fn goal(&self) -> StepGoal {
        self.goal
    }

    fn control(&mut self) -> &mut StepControl {
        &mut self.island.control
    }

    fn largest_energy(&mut self) -> f64 {
        let energy = self.island.energy();
        self.island.control.largest = self.island.control.largest.max(energy);
        self.island.control.largest
    }

    fn length(&self, level: usize) -> f64 {
        halved(self.island.span, level)
    }

    fn count(&self) -> u64 {
        self.island.sectors.len() as u64
    }

    fn bank_allowance(&self) -> f64 {
        if self.island.is_single() { 0.0 } else { BANK_ALLOWANCE }
    }

    fn fly(&mut self, step: SpanStep) -> Flight {
        self.island.fill(step.level);
        let pushed = |one: &IslandSector| one.state.multipliers.iter().any(|value| *value != 0.0);
        if !self.island.carriers.is_empty() || self.island.sectors.iter().any(pushed) {
            return Flight::NeedsTrial;
        }
        for disk in &mut self.island.disks {
            if let Some(bank) = self.surroundings.disk(disk.structure) {
                disk.find_reach(bank);
            }
        }
        let is_clear = self.places().all(|place| {
            let index = self.index(place);
            let (surfaces, reach) = self.reach(index, step);
            surfaces.is_clear(step.from, step.length, reach)
        });
        if !is_clear {
            return self.fly_near(step);
        }
        self.follow_flight(step);
        for place in self.places() {
            let index = self.index(place);
            let SectorInStep { mut surfaces, tables, disk, trial, state, advance } =
                self.sector(index, step, ForceInterpolation::Polynomial);
            if disk.is_none() {
                surfaces.record_damping(advance.freely(&tables.levels[step.level], state));
            }
            trial.forget();
            state.gaps_known = false;
        }
        self.island.disks.iter_mut().for_each(|disk| disk.body.fly(step.level));
        self.find_start();
        Flight::Accepted
    }

    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        let mut result = self.attempt_step(step, kind);
        if result.solved && self.island.is_single() {
            let (tolerance, is_shortest) = (self.goal.tolerance, step.level == HALVINGS);
            let lowest = self.follow(step, kind, result.resolves_motion(kind, tolerance));
            if lowest < -tolerance && !is_shortest {
                result.depth = result.depth.max(-lowest);
            }
        }
        result
    }

    fn accept(&mut self, step: SpanStep, kind: ForceInterpolation, result: &TrialResult) -> f64 {
        let constant = kind == ForceInterpolation::Constant;
        let points = self.island.points(step, kind);
        self.island.carriers.iter_mut().for_each(|carrier| carrier.weigh(points));
        let (mut dropped, mut closed, mut before, mut after) = (0.0, 0.0, 0.0, 0.0);
        if constant {
            dropped = self.island.shared_bodies().map(SharedBody::dropped).sum();
        }
        let mut of_bodies = dropped;
        if !self.island.is_single() {
            self.find_minima(step, kind, result.resolves_motion(kind, self.goal.tolerance));
        }
        for place in self.places() {
            let index = self.index(place);
            self.island.sectors[index].is_far = false;
            let SectorInStep { mut surfaces, tables, disk, trial, state, .. } = self.sector(index, step, kind);
            let own = if constant && disk.is_none() { trial.dropped(tables.rows.residual(), state) } else { 0.0 };
            closed += if constant { trial.closed() } else { 0.0 };
            dropped += own;
            before += surfaces.closing_loss();
            surfaces.record_step(&AcceptedStep {
                level: tables.of_points(step.level, kind, trial.points()),
                kind,
                trial,
                dropped: own + std::mem::take(&mut of_bodies),
            });
            after += surfaces.closing_loss();
        }
        self.accept_states(step, kind);
        match kind {
            ForceInterpolation::Constant => dropped + closed,
            // The energy supplied by gaps within the precision of contacts that stay closed comes from the bank as well.
            ForceInterpolation::Polynomial if !self.island.is_single() => after - before,
            ForceInterpolation::Polynomial if result.switches => -result.switched,
            ForceInterpolation::Polynomial => 0.0,
        }
    }
}
