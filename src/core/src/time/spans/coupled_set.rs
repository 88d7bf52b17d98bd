//! Sectors that step together: those of one disk, and those that touch a surface carried by a structure.

use super::casing::{CarrierIntegrator, coordinates};
use super::disk::CoupledDisk;
use super::{PRECISION, failure, modes_of};
use crate::modes::bank::ModalBank;
use crate::modes::sectors::Sectors;
use crate::scene::method::Scheme;
use crate::system::{ContactPair, StepFailure, Structure};
use crate::time::galerkin::advance::Advance;
use crate::time::galerkin::basis::MOST;
use crate::time::galerkin::compliance::Lanes;
use crate::time::galerkin::level::ContactModes;
use crate::time::galerkin::march::{AdaptiveStepper, SpanStep};
use crate::time::galerkin::sector::{AcceptedStep, StepGoal, Stopped, Tables, Witness};
use crate::time::galerkin::shared_body::SharedBody;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::trial::{ForceInterpolation, Obstacle, Trial, TrialResult};
use crate::time::spans::obstacle_view::{CarriersInStep, ObstacleView};
use crate::time::spans::record::SpanRecord;

/// Largest number of gap evaluations in one trial; it is larger than for one sector because other sectors move as well.
const PASSES: usize = 16;
/// Passes end at this fraction of the closed-gap precision, because other sectors have moved since; the last pass of a single
/// sector is exact except for curvature.
const CLOSE: f64 = 1e-2;

/// Scratch memory and tables of a set of structures whose sectors step together; allocates only on creation.
#[derive(Debug, Clone)]
pub struct CoupledSet {
    /// Index of the set.
    pub set: usize,
    pub sectors: Vec<CoupledSector>,
    disks: Vec<CoupledDisk>,
    casings: Vec<CarrierIntegrator>,
    /// Index of the casing that carries the surface of each pair.
    casing_of: Vec<Option<usize>>,
    /// Tables of each structure with contact nodes.
    tables: Vec<Vec<Tables>>,
    pub demand: StepGoal,
    bank: f64,
    /// Largest energy so far, the reference for the energy bank (J).
    largest: f64,
    level: usize,
    /// Length of the spans of the tables (s).
    span: f64,
    /// True if no step of the span has been accepted.
    fresh: bool,
    /// The sector for which a step has failed, and whether its gap is NaN.
    failed: Option<(usize, bool)>,
}

/// One sector of a structure with contact nodes.
#[derive(Debug, Clone)]
pub struct CoupledSector {
    pub structure: usize,
    pub sector: usize,
    /// Index of the structure's tables, and of the sector's table among them.
    table: [usize; 2],
    /// Index of the disk, if the modes of the sector belong to a disk.
    disk: Option<usize>,
    trial: Trial,
    state: SectorState,
    advance: Advance,
    pub record: SpanRecord,
    /// True if no force acts on the sector and its gaps are wider than the depth of other sectors' penetration, because other
    /// sectors move it by less in a step.
    far: bool,
}

/// Parts of the scene that are not scratch memory.
struct SceneMut<'a> {
    structures: &'a mut [Structure],
    pairs: &'a mut [ContactPair],
}

/// The set and the scene, as one system that is integrated with adaptive steps.
pub struct CoupledStepper<'a> {
    coupled_set: &'a mut CoupledSet,
    world: SceneMut<'a>,
}

impl CoupledSet {
    /// Creates the tables of the structures of a set, for spans up to `longest` (s) and errors of `tolerance` (m).
    pub fn new(
        set: usize,
        members: &[usize],
        (structures, pairs): (&[Structure], &[ContactPair]),
        (longest, sticks): (f64, bool),
        tolerance: f64,
    ) -> Self {
        let touching: Vec<usize> = members.iter().copied().filter(|one| structures[*one].nodes() > 0).collect();
        let carrying: Vec<usize> = members.iter().copied().filter(|one| structures[*one].nodes() == 0).collect();
        let kinds: Vec<Vec<ContactModes>> = touching.iter().map(|one| kinds_of(structures[*one].modes())).collect();
        let banks: Vec<&ModalBank> = carrying.iter().filter_map(|one| structures[*one].bank()).collect();
        let degree = |modes: &ContactModes| if sticks { 1 } else { modes.degree_up_to(longest) };
        let carried = banks.iter().map(|bank| degree(&coordinates(bank).seen_at(&bank.model().contact_modes)));
        let degree = kinds.iter().flatten().map(degree).chain(carried).min().unwrap_or(MOST);
        let own = pairs.iter().filter(|pair| touching.contains(&pair.structure()));
        let rounding = own.map(|pair| pair.gap().rounding()).fold(0.0, f64::max);
        let nodes = touching.iter().map(|one| structures[*one].nodes()).max().unwrap_or(0);
        let lanes = Lanes { points: MOST, nodes };
        let casings: Vec<CarrierIntegrator> =
            carrying.iter().zip(banks).map(|(one, bank)| CarrierIntegrator::new(*one, bank, degree, lanes)).collect();
        let place = |structure: usize| casings.iter().position(|casing| casing.structure == structure);
        let disk = |one: &usize| structures[*one].modes().coupled().map(|bank| CoupledDisk::new(*one, bank, degree));
        let disks: Vec<CoupledDisk> = touching.iter().filter_map(disk).collect();
        let mut sectors = Vec::new();
        for (number, structure) in touching.iter().enumerate() {
            let of = &structures[*structure];
            let disk = disks.iter().position(|disk| disk.structure == *structure);
            for sector in 0..of.modes().sectors() {
                let kind = of.bank().map_or(0, |bank| bank.set_number(sector));
                let modes = if disk.is_some() { 0 } else { kinds[number][kind].len() };
                let (trial, state) = (Trial::new(modes, of.nodes()), SectorState::new(modes, of.nodes()));
                sectors.push(CoupledSector {
                    structure: *structure,
                    sector,
                    table: [number, kind],
                    disk,
                    trial: if sticks { trial.sticking() } else { trial },
                    state: if sticks { state.sticking() } else { state },
                    advance: Advance::new(modes, of.nodes()),
                    record: SpanRecord::new(of.nodes(), pairs.len(), tolerance),
                    far: false,
                });
            }
        }
        let made = |kinds: Vec<ContactModes>| kinds.into_iter().map(|kind| Tables::of_degree(kind, degree)).collect();
        Self {
            set,
            sectors,
            disks,
            casing_of: pairs.iter().map(|pair| place(pair.carrier()?.structure)).collect(),
            casings,
            tables: kinds.into_iter().map(made).collect(),
            demand: StepGoal { tolerance, precision: (CLOSE * PRECISION * tolerance).max(rounding), most: u64::MAX },
            bank: 0.0,
            largest: 0.0,
            level: 0,
            span: 0.0,
            fresh: true,
            failed: None,
        }
    }

    /// Fills the tables for spans of length `span` (s).
    pub fn set_span(&mut self, span: f64) {
        if span.to_bits() == self.span.to_bits() {
            return;
        }
        self.span = span;
        self.tables.iter_mut().flatten().for_each(|tables| tables.set_span(span));
        let wholes = self.disks.iter_mut().map(|disk| &mut disk.whole);
        wholes.chain(self.casings.iter_mut().map(|casing| &mut casing.whole)).for_each(|whole| whole.set_span(span));
    }

    /// Converts the reason why the set was not integrated to the end.
    pub fn failure(&self, stopped: Stopped) -> StepFailure {
        let (index, is_lost) = self.failed.unwrap_or((0, false));
        let Some(CoupledSector { structure, sector, trial, .. }) = self.sectors.get(index) else {
            return StepFailure::NonFinite;
        };
        let (structure, sector) = (*structure, *sector);
        match stopped {
            // The node is far from the surface.
            Stopped::Unsolved if is_lost => StepFailure::Implausible { structure, sector },
            _ => failure(stopped, (structure, sector), trial.entered()),
        }
    }

    /// Starts the integration from the current state of the structures.
    pub fn begin<'a>(
        &'a mut self,
        structures: &'a mut [Structure],
        pairs: &'a mut [ContactPair],
    ) -> CoupledStepper<'a> {
        for one in &mut self.sectors {
            let structure = &structures[one.structure];
            structure.read_contacts(one.sector, &mut one.state);
            if let Some(bank) = structure.bank() {
                bank.read_sector(one.sector, &mut one.state.position, &mut one.state.velocity);
            }
            one.trial.forget();
            let (places, lanes, sector) = (&structure.history.geometry.before, structure.lanes(), one.sector);
            let gaps = &structure.history.gap.before;
            one.record.begin(|node| places.place_at(node * lanes + sector), |node| gaps[node * lanes + sector]);
        }
        for disk in &mut self.disks {
            let structure = &mut structures[disk.structure];
            disk.read(structure);
        }
        for casing in &mut self.casings {
            let structure = &structures[casing.structure];
            let Some(bank) = structure.bank() else { continue };
            let dynamic = casing.whole.coordinates().inertia.iter().filter(|inertia| **inertia > 0.0).count();
            let [position, velocity] = casing.whole.state_mut();
            bank.read_sector(0, &mut position[..dynamic], &mut velocity[..dynamic]);
            bank.read_loads(casing.whole.loads_mut());
        }
        let first = self.sectors.first().map(|one| &structures[one.structure].step_control);
        (self.fresh, self.failed) = (true, None);
        (self.bank, self.largest, self.level) = first.map_or((0.0, 0.0, 0), |step_control| {
            (step_control.bank[0], step_control.largest[0], step_control.level_of(0))
        });
        let mut marching = CoupledStepper { coupled_set: self, world: SceneMut { structures, pairs } };
        marching.find_start();
        marching
    }
}

/// Modes of the sectors, one entry per kind of sector.
fn kinds_of(modes: &Sectors) -> Vec<ContactModes> {
    match modes {
        Sectors::Uncoupled(bank) => {
            let count = bank.model().dynamic_modes(Scheme::Galerkin);
            (0..bank.sets()).map(|set| modes_of(bank, set, count)).collect()
        }
        Sectors::Coupled(bank) => {
            let (coordinates, shapes) = bank.coordinates_of();
            vec![coordinates.seen_at(&shapes)]
        }
    }
}

impl CoupledSector {
    /// Returns the sector's view of its surfaces.
    fn obstacle<'a>(
        &'a mut self,
        (structures, pairs): (&'a [Structure], &'a mut [ContactPair]),
        carriers: Option<CarriersInStep<'a>>,
    ) -> (ObstacleView<'a>, &'a mut Trial, &'a mut SectorState) {
        let structure = &structures[self.structure];
        let (pair_of, lanes) = (&structure.pair_of[..], structure.lanes());
        let obstacle = ObstacleView { carriers, pairs, pair_of, lanes, sector: self.sector, record: &mut self.record };
        (obstacle, &mut self.trial, &mut self.state)
    }
}

impl CoupledStepper<'_> {
    /// Calls `to` for all sectors with their surfaces and surface carriers in a step, after marking all sectors as not far.
    fn each(
        &mut self,
        at: (SpanStep, ForceInterpolation),
        to: impl FnMut(&mut ObstacleView, (&mut Trial, &mut SectorState), &Tables, Option<&mut CoupledDisk>),
    ) {
        self.coupled_set.sectors.iter_mut().for_each(|one| one.far = false);
        self.each_of(false, at, to);
    }

    /// Calls `to` for the sectors that are far or for those that are not.
    fn each_of(
        &mut self,
        far: bool,
        (step, kind): (SpanStep, ForceInterpolation),
        mut to: impl FnMut(&mut ObstacleView, (&mut Trial, &mut SectorState), &Tables, Option<&mut CoupledDisk>),
    ) {
        let CoupledSet { sectors, casings, casing_of, tables, disks, .. } = &mut *self.coupled_set;
        for one in sectors.iter_mut().filter(|one| one.far == far) {
            let carriers = (!casings.is_empty()).then_some(CarriersInStep {
                casings,
                casing_of,
                level: step.level,
                kind,
                lanes: Lanes { points: 0, nodes: 0 },
            });
            let (tables, disk) = (&tables[one.table[0]][one.table[1]], one.disk.map(|disk| &mut disks[disk]));
            let (mut obstacle, trial, state) = one.obstacle((self.world.structures, self.world.pairs), carriers);
            to(&mut obstacle, (trial, state), tables, disk);
        }
    }

    /// Finds displacements and velocities of disks and casings at the start of a step.
    fn find_start(&mut self) {
        let CoupledSet { disks, casings, .. } = &mut *self.coupled_set;
        for disk in disks {
            disk.whole.settle();
            if let Sectors::Coupled(bank) = &mut self.world.structures[disk.structure].modes {
                bank.rows_of(disk.whole.at(0), &mut disk.moved[0]);
                bank.rows_of(disk.whole.velocity(), &mut disk.velocity);
            }
        }
        for casing in casings {
            casing.whole.settle();
            casing.find_start();
        }
        let sectors = &mut self.coupled_set.sectors;
        for one in sectors {
            let table = &self.coupled_set.tables[one.table[0]][one.table[1]];
            match one.disk.map(|disk| &self.coupled_set.disks[disk]) {
                None => {
                    one.trial.find_start(&table.rows, &one.state);
                }
                Some(disk) => {
                    let (lanes, sector) = (self.world.structures[one.structure].lanes(), one.sector);
                    let place = |row: usize| row * lanes + sector;
                    one.trial.start_at(|row| [disk.moved[0][place(row)], disk.velocity[place(row)]]);
                }
            }
        }
    }

    /// Starts a step: prescribed motion at its points, motion without forces, and an initial guess of the forces.
    fn prepare(&mut self, step: SpanStep, kind: ForceInterpolation) {
        for disk in &mut self.coupled_set.disks {
            disk.whole.begin(step, kind);
        }
        let basis = &self.coupled_set.tables[0][0].levels[step.level].basis;
        for casing in &mut self.coupled_set.casings {
            casing.whole.begin(step, kind);
            casing.work_weights = std::array::from_fn(|i| kind.work_weights(basis, i));
        }
        self.each((step, kind), |obstacle, (trial, state), tables, disk| {
            let level = &tables.levels[step.level];
            obstacle.begin_step(step.from, step.length, level, kind);
            obstacle.record.guess_start_places();
            trial.begin((level, kind), disk.is_none().then_some(&tables.rows), state);
            trial.find_start_gaps(state, |node, moved| obstacle.gap(node, 0, moved).0);
        });
        if self.coupled_set.fresh {
            // Earlier forces are applied at the places of the nodes at the start of the span.
            self.react(0..=0, (step, kind));
        }
    }

    /// Applies the forces at some points of the step to the structures that carry surfaces.
    fn react(&mut self, points: std::ops::RangeInclusive<usize>, at: (SpanStep, ForceInterpolation)) {
        for casing in &mut self.coupled_set.casings {
            points.clone().for_each(|point| casing.whole.forces_mut(point).fill(0.0));
        }
        self.each_of(false, at, |obstacle, (trial, _), _, _| {
            for (point, node) in points.clone().flat_map(|point| (0..trial.nodes()).map(move |node| (point, node))) {
                if trial.multiplier(point, node) != 0.0 {
                    let force = trial.force(point, node);
                    obstacle.record.act(node, point);
                    obstacle.with_carrier_mut(node, point, |casing, spot| casing.react(spot, point, force));
                }
            }
        });
    }

    /// Computes the motion of all bodies under the current forces.
    fn push(&mut self, step: SpanStep, kind: ForceInterpolation, points: usize) {
        let CoupledSet { disks, sectors, .. } = &mut *self.coupled_set;
        for (number, disk) in disks.iter_mut().enumerate() {
            let Sectors::Coupled(bank) = &mut self.world.structures[disk.structure].modes else { continue };
            let lanes = bank.lanes();
            for point in 1..=points {
                let own = sectors.iter().filter(|one| one.disk == Some(number));
                let pushing = own.flat_map(|one| {
                    let nodes = (0..one.trial.nodes()).filter(|node| one.trial.multiplier(point, *node) != 0.0);
                    nodes.map(|node| (one.sector, node, one.trial.force(point, node)))
                });
                bank.modal_forces(pushing, disk.whole.forces_mut(point));
            }
            disk.whole.push(step.level, kind);
            for point in 1..=points {
                bank.rows_of(disk.whole.at(point), &mut disk.moved[point]);
            }
            for one in sectors.iter_mut().filter(|one| one.disk == Some(number)) {
                let (moved, sector) = (&disk.moved, one.sector);
                one.trial.carry(|point, node| [0, 1, 2].map(|i| moved[point][(3 * node + i) * lanes + sector]));
            }
        }
        if self.coupled_set.casings.is_empty() {
            return;
        }
        self.react(1..=points, (step, kind));
        for casing in &mut self.coupled_set.casings {
            casing.whole.push(step.level, kind);
            casing.recover(points);
        }
    }

    /// Finds the gaps at all points, of sectors that are far or of those that are not. Returns the smallest gap, the largest gap
    /// of an active contact, and whether no contact is active.
    fn find_gaps(&mut self, step: SpanStep, kind: ForceInterpolation, points: usize, far: bool) -> (f64, f64, bool) {
        if self.coupled_set.casings.is_empty() {
            self.each_of(far, (step, kind), |obstacle, (trial, _), _, _| {
                trial.find_gaps(obstacle);
            });
        } else {
            self.each_of(far, (step, kind), |_, (trial, _), _, _| trial.move_rows());
            for point in 1..=points {
                self.bend_surfaces(point);
                self.each_of(far, (step, kind), |obstacle, (trial, _), _, _| {
                    trial.find_gaps_at(point, |node, moved| obstacle.gap(node, point, moved));
                });
            }
        }
        let mut found = (f64::INFINITY, 0.0_f64, true);
        for one in self.coupled_set.sectors.iter().filter(|one| one.far == far) {
            let (lowest, largest) = one.trial.extremes();
            let least = if lowest.is_nan() || found.0.is_nan() { f64::NAN } else { found.0.min(lowest) };
            found = (least, found.1.max(largest), found.2 && one.trial.rests());
        }
        found
    }

    /// Marks the sectors that are far; `lowest` is the lowest gap (m).
    fn separate_far_sectors(&mut self, lowest: f64) {
        for one in &mut self.coupled_set.sectors {
            one.far = one.trial.rests() && one.trial.extremes().0 > -lowest;
        }
    }

    /// Rechecks sectors that are far. Returns whether one of them touches; it is then no longer far.
    fn recheck_far_sectors(&mut self, step: SpanStep, kind: ForceInterpolation, points: usize) -> bool {
        let (lowest, ..) = self.find_gaps(step, kind, points, true);
        // The next evaluation of the near sectors reports NaN gaps.
        let found = lowest.is_nan() || lowest < 0.0;
        for one in self.coupled_set.sectors.iter_mut().filter(|one| one.far) {
            let lowest = one.trial.extremes().0;
            one.far = lowest >= 0.0;
        }
        found
    }

    /// Deforms the surfaces as at a point of the step.
    fn bend_surfaces(&mut self, point: usize) {
        let CoupledSet { casings, casing_of, sectors, .. } = &*self.coupled_set;
        for (number, pair) in self.world.pairs.iter_mut().enumerate() {
            let Some(casing) = casing_of[number].map(|casing| &casings[casing]) else { continue };
            let Some(one) = sectors.iter().find(|one| one.structure == pair.structure()) else { continue };
            pair.bend(one.record.drives[number][point].0.shape_factor, casing.moved(point));
        }
    }

    /// Stores the first sector for which `holds` is true as the cause of the failure.
    fn blame(&mut self, holds: impl Fn(&CoupledSector) -> bool, is_lost: bool) {
        self.coupled_set.failed = self.coupled_set.sectors.iter().position(holds).map(|index| (index, is_lost));
    }

    /// Finds forces that remove penetration, sector by sector.
    fn solve(&mut self, step: SpanStep, kind: ForceInterpolation, verdict: &mut TrialResult) -> bool {
        let (mut solved, mut failed) = (true, None);
        self.each_of(false, (step, kind), |obstacle, (trial, _), tables, _| {
            let (lowest, _) = trial.extremes();
            if solved && (lowest < 0.0 || !trial.rests()) {
                let parts = (tables.levels[step.level].compliance_of(kind), tables.rows.residual());
                solved = trial.solve(parts, obstacle, verdict);
                failed = (!solved).then_some(obstacle.sector);
            }
        });
        if let Some(sector) = failed {
            self.blame(|one| one.sector == sector && !one.far, false);
        }
        solved
    }

    /// Finds error, switches and near misses of all sectors.
    fn judge(&mut self, step: SpanStep, points: usize, verdict: &mut TrialResult) {
        self.coupled_set.casings.iter_mut().for_each(CarrierIntegrator::clear_impulses);
        self.coupled_set.disks.iter_mut().for_each(|disk| disk.error = 0.0);
        self.each((step, ForceInterpolation::Polynomial), |obstacle, (trial, _), tables, disk| {
            let mut own = TrialResult::default();
            trial.judge((&tables.levels[step.level], &tables.rows), obstacle, &mut own);
            match disk {
                // The error of one sector makes all sectors of its disk vibrate.
                Some(disk) => disk.error = disk.error.hypot(own.error),
                None => verdict.error = verdict.error.max(own.error),
            }
            verdict.switches |= own.switches;
            verdict.switched += own.switched;
            verdict.near |= own.near;
            if own.depth > 0.0 {
                let depth = trial.depth_without_jumps(|node, moved| obstacle.gap_within(node, 0.0, moved));
                verdict.depth = verdict.depth.max(depth);
            }
            for node in 0..trial.nodes() {
                let impulse = trial.impulse(node);
                if impulse.iter().any(|component| *component != 0.0) {
                    obstacle.with_carrier_mut(node, points, |casing, spot| casing.add_impulse(spot, impulse));
                }
            }
        });
        let errors = self.coupled_set.casings.iter().map(CarrierIntegrator::error);
        let errors = errors.chain(self.coupled_set.disks.iter().map(|disk| disk.error));
        verdict.error = errors.fold(verdict.error, f64::max);
    }

    /// Writes the state to the structures and returns the work of loads during the span (J).
    pub fn finish(self) -> f64 {
        let mut load_work = 0.0;
        let Self { coupled_set, world: SceneMut { structures, .. } } = self;
        for one in &mut coupled_set.sectors {
            let structure = &mut structures[one.structure];
            structure.write_contacts(one.sector, &one.state, |node| one.record.tallies[node].lowest);
            (structure.step_control.bank[one.sector], structure.step_control.largest[one.sector]) =
                (coupled_set.bank, coupled_set.largest);
            structure.step_control.level[one.sector] = coupled_set.level as u64;
            let table = &coupled_set.tables[one.table[0]][one.table[1]];
            if let (None, Sectors::Uncoupled(bank)) = (one.disk, &mut structure.modes) {
                let (state, loss) = (&one.state, one.record.work.damping);
                let moved = one.trial.find_start(&table.rows, state);
                bank.write_sector(one.sector, &state.position, &state.velocity, &state.forces, moved);
                bank.lose(one.sector, loss);
            }
        }
        for disk in &mut coupled_set.disks {
            if let Sectors::Coupled(bank) = &mut structures[disk.structure].modes {
                bank.write_all(disk.whole.at(0), disk.whole.velocity());
                bank.lose(disk.whole.collect_loss());
            }
        }
        for casing in &mut coupled_set.casings {
            let structure = &mut structures[casing.structure];
            structure.delayed.copy_from_slice(casing.whole.forces_mut(0));
            if let Sectors::Uncoupled(bank) = &mut structure.modes {
                let rows = &casing.moved(0)[..bank.rows()];
                bank.write_all(casing.whole.at(0), casing.whole.velocity(), rows);
                bank.lose(0, casing.whole.collect_loss());
                bank.begin_loads();
            }
            load_work += casing.whole.collect_load_work();
        }
        load_work
    }
}

impl AdaptiveStepper for CoupledStepper<'_> {
    fn step_control(&mut self) -> (&mut f64, &mut usize) {
        (&mut self.coupled_set.bank, &mut self.coupled_set.level)
    }

    fn largest_energy(&mut self) -> f64 {
        let energy = self.coupled_set.energy();
        self.coupled_set.largest = self.coupled_set.largest.max(energy);
        self.coupled_set.largest
    }

    fn length(&self, level: usize) -> f64 {
        self.coupled_set.tables[0][0].levels[level].step
    }

    fn count(&self) -> u64 {
        self.coupled_set.sectors.len() as u64
    }

    fn fly(&mut self, step: SpanStep) -> bool {
        let pushed = |one: &CoupledSector| one.state.multipliers.iter().any(|value| *value != 0.0);
        if !self.coupled_set.casings.is_empty() || self.coupled_set.sectors.iter().any(pushed) {
            return false;
        }
        for disk in &mut self.coupled_set.disks {
            if let Some(bank) = self.world.structures[disk.structure].modes.coupled() {
                disk.find_reach(bank);
            }
        }
        let mut clear = true;
        self.each((step, ForceInterpolation::Polynomial), |obstacle, _, _, disk| {
            clear = clear && disk.is_some_and(|disk| obstacle.is_clear(step.from, step.length, &disk.reach));
        });
        if !clear {
            return false;
        }
        self.pass(step);
        self.coupled_set.disks.iter_mut().for_each(|disk| disk.whole.fly(step.level));
        self.coupled_set.sectors.iter_mut().for_each(|one| one.state.gaps_known = false);
        self.find_start();
        true
    }

    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        self.prepare(step, kind);
        let points = if kind == ForceInterpolation::Constant {
            1
        } else {
            self.coupled_set.tables[0][0].levels[step.level].basis.degree
        };
        let (precision, mut verdict) = (self.coupled_set.demand.precision, TrialResult::default());
        for pass in 0..PASSES {
            self.push(step, kind, points);
            let (lowest, largest, rests) = self.find_gaps(step, kind, points, false);
            if lowest.is_nan() {
                self.blame(|one| one.trial.extremes().0.is_nan(), true);
                return verdict;
            }
            if ((rests && lowest >= 0.0) || (pass > 0 && lowest >= -precision && largest <= precision))
                && !self.recheck_far_sectors(step, kind, points)
            {
                verdict.solved = true;
                break;
            }
            if pass == 0 {
                self.separate_far_sectors(lowest.min(-precision));
            }
            if pass + 1 == PASSES {
                self.blame(|one| one.trial.extremes().0 <= lowest || one.trial.extremes().1 >= largest, false);
                return verdict;
            }
            if !self.solve(step, kind, &mut verdict) {
                return verdict;
            }
        }
        if kind == ForceInterpolation::Polynomial {
            self.judge(step, points, &mut verdict);
        }
        verdict
    }

    fn take(&mut self, step: SpanStep, kind: ForceInterpolation, verdict: &TrialResult) -> f64 {
        let level = &self.coupled_set.tables[0][0].levels[step.level];
        let points = if kind == ForceInterpolation::Constant { 1 } else { level.basis.degree };
        self.coupled_set.casings.iter_mut().for_each(|casing| casing.weigh(points));
        let (mut dropped, mut closed) = (0.0, 0.0);
        let before: f64 = self.coupled_set.sectors.iter().map(|one| one.record.work.closing).sum();
        for whole in self.coupled_set.shared_bodies() {
            dropped += if kind == ForceInterpolation::Constant { whole.dropped() } else { 0.0 };
        }
        let (mut of_wholes, tolerance) = (dropped, self.coupled_set.demand.tolerance);
        let is_resolved = verdict.resolves_motion(kind, tolerance);
        self.each((step, kind), |obstacle, (trial, state), tables, disk| {
            let own = if kind == ForceInterpolation::Constant && disk.is_none() {
                trial.dropped(tables.rows.residual(), state)
            } else {
                0.0
            };
            closed += if kind == ForceInterpolation::Constant { trial.closed() } else { 0.0 };
            dropped += own;
            let level = &tables.levels[step.level];
            trial.find_minima(&level.basis, is_resolved, tolerance);
            obstacle.record_step(&AcceptedStep {
                level,
                kind,
                trial,
                damping_loss: 0.0,
                dropped: own + std::mem::take(&mut of_wholes),
            });
        });
        self.accept_states(step, kind);
        // The energy supplied by gaps within the precision of contacts that stay closed comes from the bank as well.
        let after: f64 = self.coupled_set.sectors.iter().map(|one| one.record.work.closing).sum();
        if kind == ForceInterpolation::Constant { dropped + closed } else { after - before }
    }
}

impl CoupledStepper<'_> {
    /// Finds gaps within a step of free flight if a node may come closer there than at its ends.
    fn pass(&mut self, step: SpanStep) {
        let mut closer = false;
        self.each((step, ForceInterpolation::Polynomial), |obstacle, _, _, disk| {
            closer = closer || disk.is_some_and(|disk| obstacle.may_come_closer(step.from, step.length, &disk.reach));
        });
        if !closer {
            return;
        }
        let (kind, tolerance) = (ForceInterpolation::Polynomial, self.coupled_set.demand.tolerance);
        let points = self.coupled_set.tables[0][0].levels[step.level].basis.degree;
        self.prepare(step, kind);
        self.push(step, kind, points);
        self.find_gaps(step, kind, points, false);
        self.each((step, kind), |obstacle, (trial, _), tables, _| {
            let level = &tables.levels[step.level];
            trial.find_minima(&level.basis, true, tolerance);
            obstacle.record_gaps(level, trial);
        });
    }

    /// Advances all states to the end of the step.
    fn accept_states(&mut self, step: SpanStep, kind: ForceInterpolation) {
        self.coupled_set.fresh = false;
        for one in &mut self.coupled_set.sectors {
            if one.disk.is_none() {
                let tables = &self.coupled_set.tables[one.table[0]][one.table[1]];
                let (level, trial) = (&tables.levels[step.level], &one.trial);
                let basis = &level.basis;
                let forces = |node| trial.polynomial(basis, kind, node);
                one.record.work.damping += one.advance.under((level, &tables.rows), &mut one.state, forces);
            }
            one.trial.leave(&mut one.state);
        }
        self.coupled_set.shared_bodies_mut().for_each(|whole| whole.take(step.level, kind));
        self.find_start();
    }
}

impl CoupledSet {
    /// Kinetic and strain energy of all bodies at the start of the step (J).
    fn energy(&self) -> f64 {
        let own = self.sectors.iter().filter(|one| one.disk.is_none());
        let sectors = own.map(|one| self.tables[one.table[0]][one.table[1]].energy(&one.state));
        sectors.chain(self.shared_bodies().map(SharedBody::energy)).sum()
    }

    fn shared_bodies(&self) -> impl Iterator<Item = &SharedBody> {
        self.disks.iter().map(|disk| &disk.whole).chain(self.casings.iter().map(|casing| &casing.whole))
    }

    fn shared_bodies_mut(&mut self) -> impl Iterator<Item = &mut SharedBody> {
        let disks = self.disks.iter_mut().map(|disk| &mut disk.whole);
        disks.chain(self.casings.iter_mut().map(|casing| &mut casing.whole))
    }
}
