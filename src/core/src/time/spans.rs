//! One span by continuous Galerkin: each sector separately, with its own steps.

pub(crate) mod casing;
pub(crate) mod coupled_set;
mod disk;
mod flight;
pub(crate) mod obstacle_view;
pub(crate) mod record;

use crate::geometry::PrescribedMotion;
use crate::geometry::wrench::Wrench;
use crate::modes::bank::ModalBank;
use crate::modes::sectors::Sectors;
use crate::scene::method::{Scheme, Solver};
use crate::system::contact_view::ContactMember;
use crate::system::growth::ShapeGrowth;
use crate::system::ledger::Ledger;
use crate::system::{ContactEvent, ContactPair, StepFailure, Structure, System};
use crate::time::galerkin::flight::FreeFlight;
use crate::time::galerkin::level::ContactModes;
use crate::time::galerkin::march::march;
use crate::time::galerkin::sector::{Effort, SectorIntegrator, StepGoal, Stopped, Tables};
use crate::time::galerkin::state::SectorState;
use crate::time::spans::obstacle_view::ObstacleView;
use crate::time::spans::record::{NodeTally, SpanRecord, Worked};
use coupled_set::CoupledSet;
use nalgebra::DMatrix;

/// Contacts count as closed within this fraction of the tolerance.
const PRECISION: f64 = 1e-4;

/// Tables and scratch memory of one structure whose sectors are integrated with adaptive steps.
#[derive(Debug, Clone)]
pub struct Galerkin {
    tables: Vec<Tables>,
    /// Free flight of each table.
    flights: Vec<FreeFlight>,
    marcher: SectorIntegrator,
    state: SectorState,
    record: SpanRecord,
    demand: StepGoal,
}

impl Galerkin {
    /// Creates the tables of a structure with the modes `bank`, for spans up to `longest` (s), errors of `tolerance` (m) and gaps
    /// rounded by `rounding` (m).
    fn new(
        bank: &ModalBank,
        (nodes, pairs): (usize, usize),
        (longest, sticks): (f64, bool),
        [tolerance, rounding]: [f64; 2],
    ) -> Self {
        let modes = bank.model().dynamic_modes(Scheme::Galerkin);
        let kinds: Vec<ContactModes> = (0..bank.sets()).map(|set| modes_of(bank, set, modes)).collect();
        let (marcher, state) = (SectorIntegrator::new(modes, nodes), SectorState::new(modes, nodes));
        let degree = |kind: &ContactModes| if sticks { 1 } else { kind.degree_up_to(longest) };
        Self {
            flights: kinds.iter().map(FreeFlight::new).collect(),
            tables: kinds
                .into_iter()
                .map(|kind| {
                    let (degree, steady) = (degree(&kind), kind.degree_up_to(longest));
                    let tables = Tables::of_degree(kind, degree);
                    if sticks { tables.steady(steady) } else { tables }
                })
                .collect(),
            marcher: if sticks { marcher.sticking() } else { marcher },
            state: if sticks { state.sticking() } else { state },
            record: SpanRecord::new(nodes, pairs, tolerance),
            demand: StepGoal { tolerance, precision: (PRECISION * tolerance).max(rounding), most: u64::MAX },
        }
    }

    /// Fills the tables for spans of length `span` (s).
    pub(crate) fn set_span(&mut self, span: f64) {
        self.tables.iter_mut().for_each(|tables| tables.set_span(span));
    }
}

/// Modes with inertia of a sector, and the flexibility of the others.
fn modes_of(bank: &ModalBank, sector: usize, count: usize) -> ContactModes {
    let model = bank.model();
    let rows = model.contact_modes.nrows();
    let mut residual = DMatrix::zeros(rows, rows);
    for mode in count..model.len() {
        let shape = model.contact_modes.column(mode);
        residual.ger(bank.frequency_of(mode, sector).powi(-2), &shape, &shape, 1.0);
    }
    ContactModes {
        frequencies: (0..count).map(|mode| bank.frequency_of(mode, sector)).collect(),
        damping_ratios: model.damping_ratios[..count].to_vec(),
        shapes: model.contact_modes.columns(0, count).into_owned(),
        residual,
    }
}

impl System {
    /// Allocates memory for spans up to `longest` (s) with errors within the fraction `tolerance` of the smallest clearance of
    /// each structure. Call it only before [`System::start`].
    pub fn prepare_spans(&mut self, longest: f64, tolerance: f64) {
        self.coupled_sets.clear();
        for structure in &mut self.structures {
            (structure.galerkin, structure.lowest_in_span) = (None, Vec::new());
        }
        if self.settings.scheme != Scheme::Galerkin {
            return;
        }
        let sticks = self.settings.solver == Solver::Coulomb;
        for set in 0..self.sets.count() {
            let members = self.sets.members(set).to_vec();
            let own = |pair: &&ContactPair| members.contains(&pair.structure());
            let clearance = |pairs: &mut dyn Iterator<Item = &ContactPair>| {
                tolerance * pairs.map(|pair| pair.gap().clearance()).fold(f64::INFINITY, f64::min)
            };
            let moved_by_all = |one: &usize| self.structures[*one].modes().coupled().is_some();
            if members.iter().any(moved_by_all) || self.pairs.iter().filter(own).any(|pair| pair.carrier().is_some()) {
                let tolerance = clearance(&mut self.pairs.iter().filter(own));
                let parts = (&self.structures[..], &self.pairs[..]);
                self.coupled_sets.push(CoupledSet::new(set, &members, parts, (longest, sticks), tolerance));
            } else {
                for index in members {
                    let own = || self.pairs.iter().filter(|pair| pair.structure() == index);
                    let rounding = own().map(|pair| pair.gap().rounding()).fold(0.0, f64::max);
                    let errors = [clearance(&mut own()), rounding];
                    let (structure, pairs) = (&mut self.structures[index], self.pairs.len());
                    let (nodes, bank) = (structure.nodes(), structure.bank());
                    let made = |bank| Galerkin::new(bank, (nodes, pairs), (longest, sticks), errors);
                    structure.galerkin = bank.filter(|_| nodes > 0).map(made).map(Box::new);
                }
            }
        }
        for structure in self.structures.iter_mut().filter(|structure| structure.nodes() > 0) {
            structure.lowest_in_span = vec![f64::INFINITY; structure.gaps().len()];
        }
    }

    /// Sets the prescribed motion of a pair in the middle of the next span, and the growth of its shape.
    pub fn set_middle(&mut self, pair: usize, drive: &PrescribedMotion, growth: ShapeGrowth) {
        self.pairs[pair].middle = (*drive, growth);
    }

    /// Makes the current modal loads those at the start of the next span.
    pub fn begin_loads(&mut self) {
        for structure in &mut self.structures {
            if let Sectors::Uncoupled(bank) = structure.modes_mut() {
                bank.begin_loads();
            }
        }
    }

    /// Integrates over one span to the time described by `drives`, one per pair.
    pub(crate) fn march(&mut self, drives: &[PrescribedMotion]) -> Result<(), StepFailure> {
        let span = self.step_size();
        for (pair, drive) in self.pairs.iter_mut().zip(drives) {
            pair.move_to(drive, span);
        }
        self.events.shift();
        self.events.now.clear();
        for index in 0..self.structures.len() {
            let set = self.sets.of(index);
            let Some(mut galerkin) = self.structures[index].galerkin.take() else { continue };
            galerkin.demand.most = self.most_tried;
            let outcome = self.march_structure(index, set, &mut galerkin, span);
            self.structures[index].galerkin = Some(galerkin);
            outcome?;
        }
        let mut coupled_sets = std::mem::take(&mut self.coupled_sets);
        let outcome = coupled_sets.iter_mut().try_for_each(|coupled_sets| self.march_together(coupled_sets, span));
        self.coupled_sets = coupled_sets;
        outcome?;
        self.check_travel()?;
        self.find_gaps(true);
        for structure in &mut self.structures {
            let ends = structure.lowest_in_span.iter_mut().zip(&structure.history.gap.now);
            ends.for_each(|(lowest, gap)| *lowest = lowest.min(*gap));
        }
        self.check_edges()?;
        self.counted.steps += 1;
        Ok(())
    }

    fn march_structure(
        &mut self,
        index: usize,
        set: usize,
        galerkin: &mut Galerkin,
        span: f64,
    ) -> Result<(), StepFailure> {
        let Self { structures, pairs, events, counted, .. } = self;
        let structure = &mut structures[index];
        structure.begin_span();
        galerkin.record.begin_courses(pairs, span);
        let factorisations = counted.effort.factorisations;
        for sector in 0..structure.modes().sectors() {
            structure.march_sector((index, sector), galerkin, pairs, &mut counted.effort)?;
            enter_work(&mut counted.ledgers[set], &galerkin.record.work);
            enter_events(structure, (index, sector), &galerkin.record, span, &mut events.now);
        }
        counted.factorisations += counted.effort.factorisations - factorisations;
        Ok(())
    }

    /// Integrates sectors that step together.
    fn march_together(&mut self, coupled_sets: &mut CoupledSet, span: f64) -> Result<(), StepFailure> {
        let Self { structures, pairs, events, counted, sets, .. } = self;
        sets.members(coupled_sets.set).iter().for_each(|one| structures[*one].begin_span());
        coupled_sets.sectors.iter_mut().for_each(|one| one.record.begin_courses(pairs, span));
        let demand = StepGoal { most: self.most_tried, ..coupled_sets.demand };
        let factorisations = counted.effort.factorisations;
        let mut marching = coupled_sets.begin(structures, pairs);
        let outcome = march(&mut marching, demand, &mut counted.effort);
        let load_work = marching.finish();
        counted.factorisations += counted.effort.factorisations - factorisations;
        coupled_sets.sectors.iter().try_for_each(|one| one.record.check((one.structure, one.sector)))?;
        outcome.map_err(|stopped| coupled_sets.failure(stopped))?;
        let ledger = &mut counted.ledgers[coupled_sets.set];
        ledger.load_work.add(load_work);
        ledger.turnover.add(load_work.abs());
        for one in &coupled_sets.sectors {
            enter_work(&mut counted.ledgers[coupled_sets.set], &one.record.work);
            let structure = &structures[one.structure];
            enter_events(structure, (one.structure, one.sector), &one.record, span, &mut events.now);
        }
        Ok(())
    }
}

/// Converts the reason why a sector was not integrated to the end; `entered` is a node that had nothing to touch before and is
/// now inside an open surface.
fn failure(stopped: Stopped, (structure, sector): (usize, usize), entered: Option<usize>) -> StepFailure {
    match (stopped, entered) {
        (Stopped::Unsolved, Some(node)) => StepFailure::BehindEdge { structure, node },
        (Stopped::Unsolved, None) => StepFailure::Unsolved { structure, sector },
        (Stopped::Exhausted, _) => StepFailure::Exhausted,
    }
}

/// Adds the work of the contacts of a sector over a span to the ledger.
fn enter_work(ledger: &mut Ledger, work: &Worked) {
    let moved = work.shaft + work.whirl + work.shift + work.casing;
    for (sum, term) in [
        (&mut ledger.shaft_work, work.shaft),
        (&mut ledger.whirl_work, work.whirl),
        (&mut ledger.shift_work, work.shift),
        (&mut ledger.casing_work, work.casing),
        (&mut ledger.friction_loss, work.heat),
        (&mut ledger.impact_loss, work.closing + work.dropped),
        (&mut ledger.curvature_work, work.exact + work.heat + work.closing - moved),
        (&mut ledger.turnover, work.shaft.abs() + work.whirl.abs() + work.shift.abs() + work.casing.abs()),
        (&mut ledger.contact_work, work.moved),
    ] {
        sum.add(term);
    }
}

/// Turns the contacts of a sector into events.
fn enter_events(
    structure: &Structure,
    (index, sector): (usize, usize),
    record: &SpanRecord,
    span: f64,
    events: &mut Vec<ContactEvent>,
) {
    for (node, pair) in structure.pair_of.iter().enumerate() {
        let (tally, Some(pair)) = (&record.tallies[node], *pair) else { continue };
        if tally.normal > 0.0 {
            let member = ContactMember { structure: index, pair, node, sector, index: structure.index(node, sector) };
            events.push(event(member, tally, span));
        }
    }
}

/// Creates the event of a contact from its means over the span.
fn event(at: ContactMember, tally: &NodeTally, span: f64) -> ContactEvent {
    let mean = |values: [f64; 3]| values.map(|value| value / span);
    let wrench = Wrench {
        point: tally.wrench.point.map(|value| value / tally.normal),
        force: mean(tally.wrench.force),
        moment: mean(tally.wrench.moment),
    };
    let event = ContactEvent::new(at, tally.normal / span, mean(tally.force), 0.0, ([0.0; 3], wrench));
    ContactEvent { tangential: tally.tangential / span, peak: tally.peak, friction_heat: tally.heat, ..event }
}

impl Structure {
    /// Makes the current values the previous ones, before a span.
    fn begin_span(&mut self) {
        self.history.gap.shift();
        self.history.geometry.shift();
        self.modes.begin_span();
    }

    /// Integrates one sector and writes its state.
    fn march_sector(
        &mut self,
        (number, sector): (usize, usize),
        galerkin: &mut Galerkin,
        pairs: &mut [ContactPair],
        effort: &mut Effort,
    ) -> Result<(), StepFailure> {
        let lanes = self.lanes();
        let Galerkin { tables, marcher, state, record, demand, .. } = galerkin;
        let Some(bank) = self.bank() else { return Ok(()) };
        let tables = &tables[bank.set_number(sector)];
        bank.read_sector(sector, &mut state.position, &mut state.velocity);
        self.read_contacts(sector, state);
        (state.bank, state.largest) = (self.step_control.bank[sector], self.step_control.largest[sector]);
        state.level = self.step_control.level_of(sector);
        let places = &self.history.geometry.before;
        let gaps = &self.history.gap.before;
        record.begin(|node| places.place_at(node * lanes + sector), |node| gaps[node * lanes + sector]);
        let mut obstacle = ObstacleView { carriers: None, pairs, pair_of: &self.pair_of, lanes, sector, record };
        let outcome = marcher.march(tables, state, &mut obstacle, *demand, effort);
        record.check((number, sector))?;
        let entered = marcher.entered();
        outcome.map_err(|stopped| failure(stopped, (number, sector), entered))?;
        (self.step_control.bank[sector], self.step_control.largest[sector]) = (state.bank, state.largest);
        self.step_control.level[sector] = state.level as u64;
        self.write_contacts(sector, state, |node| record.tallies[node].lowest);
        if let Sectors::Uncoupled(bank) = self.modes_mut() {
            let moved = marcher.displacements(tables, state);
            bank.write_sector(sector, &state.position, &state.velocity, &state.forces, moved);
            bank.lose(sector, record.work.damping);
        }
        Ok(())
    }
}
