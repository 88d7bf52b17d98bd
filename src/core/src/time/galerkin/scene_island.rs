//! An island of a scene: the sectors and carriers that it consists of, their state, and the record of their contacts.

mod blade_sectors;
mod contacts;
mod open_sectors;
mod ring_gaps;
mod steady_phase;

use super::basis::MOST;
use super::blade::{BladeModel, SpanKind};
use super::carrier::{CarrierIntegrator, coordinates};
use super::compliance::Lanes;
use super::disk::CoupledDisk;
use super::flight::FreeFlight;
use super::island::{Island, IslandSector};
use super::obstacle_view::ObstacleView;
use super::record::{PairRecord, SpanRecord};
use super::span::{SpanStep, StepGoal, Stopped};
use super::state::SectorState;
use super::surroundings::{CarriersInStep, Surroundings};
use super::tables::Tables;
use crate::geometry::PrescribedMotion;
use crate::geometry::wrench::At;
use crate::math::vector::vector3_at;
use crate::modes::bank::{Disk, ModalBank};
use crate::modes::coordinates::ContactModes;
use crate::system::contact_view::ContactMember;
use crate::system::work::ContactWork;
use crate::system::{ContactPair, StepFailure, Structure, System};
use crate::time::workers::Workers;
use blade_sectors::{BladeSectors, SectorSpan, SpanOfSectors};
use nalgebra::DMatrix;
use ring_gaps::RingScratch;
use std::mem::take;
use std::ops::RangeInclusive;

/// Contacts count as closed within this fraction of the tolerance.
const PRECISION: f64 = 1e-4;

/// Trials of several sectors whose contacts may stick end at this fraction of the closed-gap precision, because errors of sticking contacts
/// accumulate.
const CLOSE: f64 = 1e-2;

/// An island of a scene. The uncoupled sectors of one structure take turns in one island, because their tables are the same.
#[derive(Debug, Clone)]
pub(crate) struct SceneIsland {
    /// Set of structures to whose ledger the island belongs.
    set: usize,
    island: Island,
    /// One for each sector of the island.
    records: Vec<SpanRecord>,
    ring_scratch: RingScratch,
    /// Number of sectors that take turns.
    turns: usize,
    goal: StepGoal,
    /// Sectors that face one surface of revolution.
    blade: Option<Box<BladeSectors>>,
    /// Free flight of each kind of a single sector.
    flights: Vec<FreeFlight>,
}

/// Structures and pairs around an island.
struct SceneSurroundings<'a> {
    structures: &'a mut [Structure],
    pairs: &'a mut [ContactPair],
    records: &'a mut [SpanRecord],
    ring_scratch: &'a mut RingScratch,
}

impl Surroundings for SceneSurroundings<'_> {
    type Surfaces<'a>
        = ObstacleView<'a>
    where
        Self: 'a;

    fn surfaces<'a>(&'a mut self, sector: usize, carriers: CarriersInStep<'a>) -> ObstacleView<'a> {
        ObstacleView { carriers, pairs: self.pairs, record: &mut self.records[sector] }
    }

    fn bend(&mut self, carriers: &[CarrierIntegrator], point: usize) {
        // The sectors of a structure share its pairs.
        let own = self.records.iter().filter(|record| record.sector == 0).flat_map(|record| &record.pairs);
        for PairRecord { pair, carrier, drives, .. } in own {
            let rows = carrier.map_or(&[][..], |carrier| carriers[carrier].moved(point));
            self.pairs[*pair].bend(drives[point].0.shape_factor, rows);
        }
    }

    fn choose_active(&mut self, island: &mut Island, step: SpanStep) {
        self.choose_open_sectors(island, step);
    }

    fn find_ring_gaps(&mut self, island: &mut Island, point: usize, is_far: bool) {
        self.find_gaps_of_active_sectors(island, point, is_far);
    }

    fn prepare_activated_sectors(&mut self, island: &mut Island, first: usize) {
        let mut sectors = take(&mut self.ring_scratch.sectors);
        sectors.clear();
        sectors.extend(&island.active[first..]);
        self.find_gaps_at_start(island, &sectors);
        self.ring_scratch.sectors = sectors;
    }

    fn find_surface_motions(&mut self, carriers: &[CarrierIntegrator], points: RangeInclusive<usize>) {
        let own = self.records.iter().filter(|record| record.sector == 0).flat_map(|record| &record.pairs);
        for (pair, carrier) in own.filter_map(|record| Some((record.pair, record.carrier?))) {
            self.pairs[pair].find_surface_motions(|row| carriers[carrier].largest_square_motion(row, points.clone()));
        }
    }

    fn surface_motion(&self, sector: usize) -> f64 {
        let SpanRecord { pairs, sector, .. } = &self.records[sector];
        let carried = pairs.iter().filter(|record| record.carrier.is_some());
        carried.map(|record| self.pairs[record.pair].faced_motion(*sector)).fold(0.0, f64::max)
    }

    fn disk(&mut self, structure: usize) -> Option<&mut Disk> {
        self.structures[structure].modes.disk_mut()
    }
}

impl SceneIsland {
    /// Creates the island of a set of structures, for spans up to `longest` (s) and errors within the fraction `tolerance` of the smallest
    /// clearance of the set. The sectors of a structure that are uncoupled and touch rigid surfaces take turns.
    pub fn new(set: usize, system: &System, longest: f64, tolerance: f64) -> Self {
        let (System { structures, pairs, sets, .. }, solver) = (system, system.settings.solver);
        let own = || sets.pairs(set).iter().map(|pair| (*pair, &pairs[*pair]));
        let tolerance = tolerance * own().map(|(_, pair)| pair.gap().clearance()).fold(f64::INFINITY, f64::min);
        let rounding = own().map(|(_, pair)| pair.gap().rounding()).fold(0.0, f64::max);
        let (touching, carrying): (Vec<usize>, Vec<usize>) =
            sets.members(set).iter().partition(|member| structures[**member].nodes() > 0);
        let takes_turns = carrying.is_empty() && structures[touching[0]].bank().is_some();
        let kinds: Vec<Vec<ContactModes>> = touching.iter().map(|one| kinds_of(structures[*one].modes())).collect();
        let banks: Vec<&ModalBank> = carrying.iter().filter_map(|one| structures[*one].bank()).collect();
        let degree = |modes: &ContactModes| if solver.sticks() { 1 } else { modes.degree_up_to(longest) };
        let carried = banks.iter().map(|bank| degree(&coordinates(bank).seen_at(&bank.model().contact_modes)));
        let common = kinds.iter().flatten().map(degree).chain(carried).min().unwrap_or(MOST);
        let nodes = touching.iter().map(|one| structures[*one].nodes()).max().unwrap_or(0);
        let lanes = Lanes { points: MOST, nodes };
        let carriers: Vec<CarrierIntegrator> =
            carrying.iter().zip(banks).map(|(one, bank)| CarrierIntegrator::new(*one, bank, common, lanes)).collect();
        let disk = |one: &usize| {
            let bank = structures[*one].modes();
            bank.disk().map(|disk| CoupledDisk::new(*one, bank, disk, common))
        };
        let disks: Vec<CoupledDisk> = touching.iter().filter_map(disk).collect();
        let flights = if takes_turns { kinds[0].iter().map(FreeFlight::new).collect() } else { Vec::new() };
        let of_kind = |kind: ContactModes| match (takes_turns, solver.sticks()) {
            (false, _) => Tables::of_degree(kind, common),
            (true, false) => Tables::new(kind, longest),
            (true, true) => Tables::with_steady(kind, longest),
        };
        let tables: Vec<Vec<Tables>> =
            kinds.into_iter().map(|kinds| kinds.into_iter().map(of_kind).collect()).collect();
        let (mut sectors, mut records) = (Vec::new(), Vec::new());
        for (number, structure) in touching.iter().copied().enumerate() {
            let of = &structures[structure];
            let disk = disks.iter().position(|disk| disk.structure == structure);
            let carrier = |pair: &ContactPair| pair.carrier().map(|carrier| carrier.structure);
            let place = |pair| carriers.iter().position(|one| Some(one.structure) == carrier(pair));
            let pairs = own().filter(|(_, pair)| pair.structure() == structure);
            let pairs = pairs.map(|(index, pair)| PairRecord::new(index, place(pair), of.lanes())).collect();
            let record = SpanRecord::new(structure, of, pairs, &system.pairs, tolerance);
            for sector in 0..if takes_turns { 1 } else { of.modes().sectors() } {
                let kind = of.bank().map_or(0, |bank| bank.set_of(sector));
                let disk = disk.map(|disk| (disk, sector));
                sectors.push(IslandSector::new([number, kind], disk, &tables, solver));
                records.push(SpanRecord { sector, ..record.clone() });
            }
        }
        let model = match own().next() {
            Some((_, pair)) if takes_turns && own().nth(1).is_none() => BladeModel::new(&tables[0], pair.gap(), solver),
            _ => None,
        };
        let first = &structures[touching[0]];
        let blade = model.map(|model| Box::new(BladeSectors::new(model, first, &sectors[0].trial)));
        let is_close = !takes_turns && solver.sticks();
        let precision = if is_close { CLOSE * PRECISION } else { PRECISION };
        Self {
            set,
            ring_scratch: RingScratch::new(if carriers.is_empty() { 0 } else { records.len() }, nodes),
            island: Island::new(tables, sectors, disks, carriers),
            records,
            blade,
            turns: if takes_turns { first.modes().sectors() } else { 1 },
            goal: StepGoal { tolerance, precision: (precision * tolerance).max(rounding), longest, most: u64::MAX },
            flights,
        }
    }

    /// Returns whether the sectors take turns on rigid surfaces.
    pub(crate) fn is_single(&self) -> bool {
        self.island.is_single()
    }

    /// First structure of the island.
    pub(crate) fn first_structure(&self) -> usize {
        self.records[0].structure
    }

    /// Uses tables for spans of length `span` (s).
    pub fn set_span(&mut self, span: f64) {
        if self.blade.is_none() {
            self.island.set_span(span);
        }
    }

    /// Returns the number of threads that can share the sectors.
    pub(crate) fn max_threads(&self) -> usize {
        if self.blade.is_some() { self.turns } else { 1 }
    }

    /// Allocates memory for `threads` threads, or fewer if there are fewer sectors to share.
    pub(crate) fn use_threads(&mut self, threads: usize) {
        let threads = threads.min(self.max_threads());
        if let Some(sectors) = &mut self.blade {
            sectors.use_threads(threads, self.turns);
        }
    }

    /// Integrates all sectors over a span (s), at whose end the pairs are.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub fn integrate(
        &mut self,
        system: &mut System,
        span: f64,
        most_tried: u64,
        workers: &Workers,
    ) -> Result<(), StepFailure> {
        system.sets.members(self.set).iter().for_each(|one| system.structures[*one].begin_span());
        self.records.iter_mut().for_each(|record| record.begin_courses(&system.pairs, span));
        if let Some(sectors) = &mut self.blade {
            let structure = &system.structures[self.records[0].structure];
            sectors.model.set_span(SpanKind::Bounded, span);
            sectors.model.begin_span(&structure.history.gap.before, structure.lanes(), self.turns, |_| true);
            let goal = StepGoal { most: most_tried, ..self.goal };
            let course = self.records[0].pairs[0].course;
            return self.integrate_sectors(system, SectorSpan::Bounded(&course, span), goal, workers);
        }
        if self.is_single() {
            let record = &mut self.records[0];
            record.find_lowest_of_all(&system.structures[record.structure]);
        }
        (0..self.turns).try_for_each(|turn| self.take_turn(turn, system, span, most_tried))
    }

    /// Integrates all sectors that face a surface of revolution over a span.
    fn integrate_sectors(
        &mut self,
        system: &mut System,
        span: SectorSpan,
        goal: StepGoal,
        workers: &Workers,
    ) -> Result<(), StepFailure> {
        let Self { set, island, records, turns, blade: Some(sectors), .. } = self else { return Ok(()) };
        let (structure, pair) = (records[0].structure, records[0].pairs[0].pair);
        let of = SpanOfSectors { span, set: *set, tables: &island.tables[0], structure, pair, goal };
        let first = span.first_sectors(*turns);
        for group in [0..first, first..*turns] {
            sectors.integrate_together(group.clone(), system, of, workers);
            for sector in group {
                sectors.integrate_one(sector, system, of);
                sectors.enter(sector, system, of)?;
                sectors.include_lowest(sector);
            }
            sectors.model.begin_group();
        }
        Ok(())
    }

    /// Integrates one sector after the other, or all together, over a span.
    fn take_turn(&mut self, turn: usize, system: &mut System, span: f64, most_tried: u64) -> Result<(), StepFailure> {
        self.aim(turn, &system.structures);
        let System { structures, pairs, events, counted, evaluated, .. } = system;
        self.read(structures);
        if self.is_single() {
            let record = &mut self.records[0];
            record.choose_minima(&structures[record.structure].needed_minima);
        }
        self.activate_all(structures, pairs);
        let goal = StepGoal { most: most_tried, ..self.goal };
        let Self { island, records, ring_scratch, .. } = &mut *self;
        let mut surroundings = SceneSurroundings { structures, pairs, records, ring_scratch };
        let outcome = island.begin(&mut surroundings, goal).integrate(&mut counted.effort);
        let load_work = self.write(structures);
        if self.is_single() {
            self.records[0].end_turn();
        }
        evaluated.gaps += self.records.iter_mut().map(|record| take(&mut record.evaluated_gaps)).sum::<u64>();
        self.records.iter().try_for_each(SpanRecord::check)?;
        outcome.map_err(|stopped| self.failure(stopped))?;
        let ledger = &mut counted.ledgers[self.set];
        if !self.island.carriers.is_empty() {
            ledger.load_work.add(load_work);
            ledger.turnover.add(load_work.abs());
        }
        for record in &self.records {
            let ContactWork { shaft, whirl, shift, casing, .. } = record.work;
            let turnover = shaft.abs() + whirl.abs() + shift.abs() + casing.abs();
            ContactWork { turnover, ..record.work }.enter(ledger);
            let (structure, sector, of) = (record.structure, record.sector, &structures[record.structure]);
            let contacts = of.pair_of.iter().zip(&record.tallies).enumerate();
            events.now.extend(contacts.filter_map(|(node, (pair, tally))| {
                let at = ContactMember { structure, pair: (*pair)?, node, sector, index: of.index(node, sector) };
                tally.event(at, span)
            }));
        }
        Ok(())
    }

    /// Selects the sector whose turn it is.
    fn aim(&mut self, turn: usize, structures: &[Structure]) {
        if self.is_single() {
            self.records[0].sector = turn;
            let bank = structures[self.records[0].structure].bank();
            self.island.sectors[0].table[1] = bank.map_or(0, |bank| bank.set_of(turn));
        }
    }

    /// Reads the state of the structures before a span.
    fn read(&mut self, structures: &mut [Structure]) {
        for (one, record) in self.island.sectors.iter_mut().zip(&mut self.records) {
            let (structure, sector) = (&structures[record.structure], record.sector);
            structure.read_contacts(sector, &mut one.state);
            if let Some(bank) = structure.bank() {
                bank.read_sector(sector, &mut one.state.position, &mut one.state.velocity);
            }
            let (places, gaps) = (&structure.history.geometry.before, &structure.history.gap.before);
            record.begin(|index| places.place_at(index), |index| gaps[index]);
        }
        for disk in &mut self.island.disks {
            let structure = &mut structures[disk.structure];
            let nodes = structure.nodes();
            disk.read(&mut structure.modes, &structure.history.force.now, nodes);
        }
        for carrier in &mut self.island.carriers {
            let Some(bank) = structures[carrier.structure].bank() else { continue };
            let dynamic = carrier.body.coordinates.inertia.iter().filter(|inertia| **inertia > 0.0).count();
            let SectorState { position, velocity, .. } = &mut carrier.body.state;
            bank.read_sector(0, &mut position[..dynamic], &mut velocity[..dynamic]);
            bank.read_loads(&mut carrier.body.loads);
        }
        self.read_control(structures);
    }

    /// Reads the step control of the first sector before a span.
    fn read_control(&mut self, structures: &[Structure]) {
        let SpanRecord { structure, sector, .. } = self.records[0];
        self.island.control = structures[structure].step_control_of(sector);
    }

    /// Writes the state to the structures and returns the work of loads during the span (J).
    fn write(&mut self, structures: &mut [Structure]) -> f64 {
        let mut load_work = 0.0;
        let Island { sectors, tables, control, disks, carriers, .. } = &mut self.island;
        for (one, record) in sectors.iter_mut().zip(&self.records) {
            let (structure, sector) = (&mut structures[record.structure], record.sector);
            structure.write_contacts(sector, &one.state, |node| record.tallies[node].lowest);
            structure.write_step_control(sector, *control);
            if one.disk.is_none() {
                let (bank, (moved, state)) = (&mut structure.modes, one.displacements(tables));
                bank.write_sector(sector, &state.position, &state.velocity, &state.forces, moved);
                bank.lose(sector, record.damping);
            }
        }
        for disk in disks {
            let bank = &mut structures[disk.structure].modes;
            bank.write_all(&disk.body.at[0], &disk.body.state.velocity, &[]);
            bank.lose(0, take(&mut disk.body.loss));
        }
        for carrier in carriers {
            let structure = &mut structures[carrier.structure];
            structure.delayed.copy_from_slice(&carrier.body.forces[0]);
            let bank = &mut structure.modes;
            let rows = &carrier.moved(0)[..bank.rows()];
            bank.write_all(&carrier.body.at[0], &carrier.body.state.velocity, rows);
            bank.lose(0, take(&mut carrier.body.loss));
            bank.begin_loads();
            load_work += take(&mut carrier.body.load_work);
        }
        load_work
    }

    /// Converts the reason why the island was not integrated to the end.
    fn failure(&self, stopped: Stopped) -> StepFailure {
        let Some((index, is_lost)) = self.island.failed.filter(|_| stopped == Stopped::Unsolved) else {
            return if stopped == Stopped::Exhausted { StepFailure::Exhausted } else { StepFailure::NonFinite };
        };
        let SpanRecord { structure, sector, .. } = self.records[index];
        match self.island.sectors[index].trial.entered() {
            // The node is far from the surface.
            _ if is_lost => StepFailure::Implausible { structure, sector },
            // A node that had nothing to touch before is now inside an open surface.
            Some(node) => StepFailure::BehindEdge { structure, node },
            None => StepFailure::Unsolved { structure, sector },
        }
    }

    /// Returns whether no sector touches anything, vibrates by more than the tolerance or can touch during a flight to `ends`, in which
    /// rotors turn by `turns` relative to the shapes (rad). The smallest gaps of the structure are then those during the flight.
    pub fn is_free(&mut self, system: &mut System, ends: &[PrescribedMotion], turns: &[f64]) -> bool {
        let System { structures, pairs, .. } = system;
        let index = self.first_structure();
        (0..self.turns).all(|sector| {
            self.aim(sector, structures);
            let structure = &mut structures[index];
            let Some(bank) = structure.bank() else { return false };
            let one = &mut self.island.sectors[0];
            bank.read_sector(sector, &mut one.state.position, &mut one.state.velocity);
            let reach = one.largest_displacements(&self.island.tables);
            reach.iter().all(|reach| *reach <= self.goal.tolerance)
                && (0..structure.nodes()).all(|node| {
                    let index = structure.index(node, sector);
                    let Some(pair) = structure.pair_of[node] else { return true };
                    let at = At { node, index, drive: pairs[pair].drive_now() };
                    let reach = vector3_at(reach, node);
                    let least = pairs[pair].gap().least(at, &ends[pair], turns[pair], reach).unwrap_or(0.0);
                    structure.lowest_in_span[index] = least;
                    structure.history.multiplier[index] == 0.0 && least > 0.0
                })
        })
    }

    /// Advances all sectors in free flight by `length` (s).
    pub fn fly(&mut self, system: &mut System, length: f64) {
        let System { structures, counted, .. } = system;
        let index = self.first_structure();
        structures[index].begin_span();
        self.flights.iter_mut().for_each(|flight| flight.set_length(length));
        for sector in 0..self.turns {
            self.aim(sector, structures);
            let bank = structures[index].modes_mut();
            let one = &mut self.island.sectors[0];
            one.state.forces.fill(0.0);
            bank.read_sector(sector, &mut one.state.position, &mut one.state.velocity);
            let loss = self.flights[one.table[1]].take(&mut one.state.position, &mut one.state.velocity);
            let (moved, state) = one.displacements(&self.island.tables);
            bank.write_sector(sector, &state.position, &state.velocity, &state.forces, moved);
            bank.lose(sector, loss);
        }
        structures[index].modes_mut().flush();
        structures[index].step_control.level.fill(0);
        counted.effort.steps += self.turns as u64;
        counted.effort.flights += self.turns as u64;
    }
}

/// Modes of the sectors, one entry per kind of sector.
fn kinds_of(bank: &ModalBank) -> Vec<ContactModes> {
    if let Some(disk) = bank.disk() {
        let (coordinates, shapes) = disk.coordinates_of();
        return vec![coordinates.seen_at(&shapes)];
    }
    let count = bank.model().inertial_modes();
    (0..bank.sets).map(|set| modes_of(bank, set, count)).collect()
}

/// Modes with inertia of a sector, and the flexibility of the others.
fn modes_of(bank: &ModalBank, sector: usize, count: usize) -> ContactModes {
    let model = bank.model();
    let rows = model.contact_modes.nrows();
    let mut residual = DMatrix::zeros(rows, rows);
    for mode in count..model.len() {
        let shape = model.contact_modes.column(mode);
        residual.ger(bank.frequency(mode, sector).powi(-2), &shape, &shape, 1.0);
    }
    ContactModes {
        frequencies: (0..count).map(|mode| bank.frequency(mode, sector)).collect(),
        damping_ratios: model.damping_ratios[..count].to_vec(),
        shapes: model.contact_modes.columns(0, count).into_owned(),
        residual,
    }
}
