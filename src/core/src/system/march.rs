//! One span of time by continuous Galerkin: each sector by itself, in steps of its own.

mod flight;

use super::facing::{Course, Facing, Record};
use super::growth::Growth;
use super::posed::Member;
use super::{ContactEvent, Pair, StepFailure, Structure, System};
use crate::dynamics::bank::ModalBank;
use crate::dynamics::sectors::Sectors;
use crate::galerkin::flight::Flight;
use crate::galerkin::level::Modes;
use crate::galerkin::sector::{Demand, Effort, Marcher, Stopped, Tables};
use crate::galerkin::state::SectorState;
use crate::gaps::Drive;
use crate::gaps::wrench::Wrench;
use crate::settings::Scheme;
use nalgebra::DMatrix;

/// Contacts count as closed within this share of the tolerance.
const PRECISION: f64 = 1e-4;

/// Tables and scratch of one structure whose sectors are marched.
#[derive(Debug, Clone)]
pub struct Galerkin {
    tables: Vec<Tables>,
    /// Of each table.
    flights: Vec<Flight>,
    marcher: Marcher,
    state: SectorState,
    record: Record,
    demand: Demand,
    /// Smallest gap of each node and lane within the span (m).
    lowest: Vec<f64>,
}

impl Galerkin {
    /// Of a structure whose modes are `bank`, for spans up to `longest` (s) and errors of `tolerance` (m).
    fn new(bank: &ModalBank, nodes: usize, pairs: usize, longest: f64, tolerance: f64) -> Self {
        let modes = bank.model().dynamic_modes(Scheme::Galerkin);
        let kinds: Vec<Modes> = (0..bank.sets()).map(|set| modes_of(bank, set, modes)).collect();
        Self {
            flights: kinds.iter().map(Flight::new).collect(),
            tables: kinds.into_iter().map(|kind| Tables::new(kind, longest)).collect(),
            marcher: Marcher::new(modes, nodes),
            state: SectorState::new(modes, nodes),
            record: Record::new(nodes, pairs),
            demand: Demand { tolerance, precision: PRECISION * tolerance, most: u64::MAX },
            lowest: vec![f64::INFINITY; nodes * bank.lanes()],
        }
    }

    /// Smallest gaps within the last span (m), `[node · lanes + lane]`.
    pub fn lowest(&self) -> &[f64] {
        &self.lowest
    }

    /// Tables for spans of length `span` (s).
    pub(super) fn set_span(&mut self, span: f64) {
        self.tables.iter_mut().for_each(|tables| tables.set_span(span));
    }
}

/// Modes with inertia of a sector, and the flexibility of the others.
fn modes_of(bank: &ModalBank, sector: usize, count: usize) -> Modes {
    let model = bank.model();
    let rows = model.contact_modes.nrows();
    let mut residual = DMatrix::zeros(rows, rows);
    for mode in count..model.len() {
        let shape = model.contact_modes.column(mode);
        residual.ger(bank.frequency_of(mode, sector).powi(-2), &shape, &shape, 1.0);
    }
    Modes {
        frequencies: (0..count).map(|mode| bank.frequency_of(mode, sector)).collect(),
        damping_ratios: model.damping_ratios[..count].to_vec(),
        shapes: model.contact_modes.columns(0, count).into_owned(),
        residual,
    }
}

impl System {
    /// Make room for marching spans up to `longest` (s) within `tolerance` of the smallest clearance of each structure; only before
    /// [`System::start`]. Allocates.
    pub fn prepare_spans(&mut self, longest: f64, tolerance: f64) {
        for index in 0..self.structures.len() {
            let clearance =
                self.pairs.iter().filter(|pair| pair.structure() == index).map(|pair| pair.gap().clearance());
            let clearance = clearance.fold(f64::INFINITY, f64::min);
            let pairs = self.pairs.len();
            let structure = &mut self.structures[index];
            let nodes = structure.nodes();
            let made = structure.bank().filter(|_| self.settings.scheme == Scheme::Galerkin && nodes > 0);
            let made = made.map(|bank| Box::new(Galerkin::new(bank, nodes, pairs, longest, tolerance * clearance)));
            structure.galerkin = made;
        }
    }

    /// Prescribed motion of a pair in the middle of the span to come, and how its shape grows.
    pub fn set_middle(&mut self, pair: usize, drive: &Drive, growth: Growth) {
        self.pairs[pair].middle = (*drive, growth);
    }

    /// One span to the instant described by `drives`, one per pair.
    pub(crate) fn march(&mut self, drives: &[Drive]) -> Result<(), StepFailure> {
        let span = self.step_size();
        for (pair, drive) in self.pairs.iter_mut().zip(drives) {
            pair.go_to(drive, span);
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
        self.find_gaps(true);
        for structure in &mut self.structures {
            if let Some(galerkin) = &mut structure.galerkin {
                let ends = galerkin.lowest.iter_mut().zip(&structure.history.gap.now);
                ends.for_each(|(lowest, gap)| *lowest = lowest.min(*gap));
            }
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
        for (course, pair) in galerkin.record.courses.iter_mut().zip(pairs.iter()) {
            *course = Course::new(pair.drive_before(), (&pair.middle.0, pair.middle.1), pair.drive_now(), span);
        }
        let factorisations = counted.effort.factorisations;
        for sector in 0..structure.modes().sectors() {
            structure.march_sector((index, sector), galerkin, pairs, &mut counted.effort)?;
            let work = galerkin.record.work;
            let ledger = &mut counted.ledgers[set];
            let turnover = work.shaft.abs() + work.whirl.abs() + work.shift.abs() + work.casing.abs();
            for (sum, term) in [
                (&mut ledger.shaft_work, work.shaft),
                (&mut ledger.whirl_work, work.whirl),
                (&mut ledger.shift_work, work.shift),
                (&mut ledger.casing_work, work.casing),
                (&mut ledger.friction_loss, work.heat),
                (&mut ledger.impact_loss, work.closing + work.dropped),
                (
                    &mut ledger.curvature_work,
                    work.exact + work.heat + work.closing - (work.shaft + work.whirl + work.shift + work.casing),
                ),
                (&mut ledger.turnover, turnover),
            ] {
                sum.add(term);
            }
            for (node, pair) in structure.pair_of.iter().enumerate() {
                let (tally, Some(pair)) = (&galerkin.record.tallies[node], *pair) else { continue };
                if tally.normal > 0.0 {
                    let member = Member { structure: index, pair, node, sector, index: structure.index(node, sector) };
                    events.now.push(event(member, tally, span));
                }
            }
        }
        counted.factorisations += counted.effort.factorisations - factorisations;
        Ok(())
    }
}

/// A contact of a span by its means over it.
fn event(at: Member, tally: &super::facing::Tally, span: f64) -> ContactEvent {
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
    /// Past and present change places before a span.
    fn begin_span(&mut self) {
        self.history.gap.shift();
        self.history.geometry.shift();
        if let Sectors::Uncoupled(bank) = self.modes_mut() {
            bank.begin_span();
        }
    }

    /// March one sector, and write its state.
    fn march_sector(
        &mut self,
        (number, sector): (usize, usize),
        galerkin: &mut Galerkin,
        pairs: &mut [Pair],
        effort: &mut Effort,
    ) -> Result<(), StepFailure> {
        let lanes = self.lanes();
        let Galerkin { tables, marcher, state, record, demand, lowest, .. } = galerkin;
        let Some(bank) = self.bank() else { return Ok(()) };
        let tables = &tables[bank.set_number(sector)];
        bank.read_sector(sector, &mut state.position, &mut state.velocity);
        for node in 0..self.nodes() {
            let index = self.index(node, sector);
            state.multipliers[node] = self.history.multiplier[index];
            state.gaps[node] = self.history.gap.before[index];
            state.normals[3 * node..3 * node + 3].copy_from_slice(&self.history.geometry.before.normal_at(index));
            state.forces[3 * node..3 * node + 3].copy_from_slice(&self.three(&self.history.force.now, node, sector));
        }
        state.looked = true;
        (state.bank, state.level) = (self.pace.bank[sector], self.pace.level_of(sector));
        let places = &self.history.geometry.before;
        record.begin(|node| places.place_at(node * lanes + sector));
        let mut facing = Facing { pairs, pair_of: &self.pair_of, lanes, sector, record };
        let outcome = marcher.march(tables, state, &mut facing, *demand, effort);
        if record.implausible {
            return Err(StepFailure::Implausible { structure: number, sector });
        }
        outcome.map_err(|stopped| match stopped {
            Stopped::Unsolved => StepFailure::Unsolved { structure: number, sector },
            Stopped::Exhausted => StepFailure::Exhausted,
        })?;
        (self.pace.bank[sector], self.pace.level[sector]) = (state.bank, state.level as u64);
        for node in 0..self.nodes() {
            let index = self.index(node, sector);
            self.history.multiplier[index] = state.multipliers[node];
            lowest[index] = record.tallies[node].lowest;
            for component in 0..3 {
                self.history.force.now[(3 * node + component) * lanes + sector] = state.forces[3 * node + component];
            }
        }
        if let Sectors::Uncoupled(bank) = self.modes_mut() {
            let moved = marcher.displacements(tables, state);
            bank.write_sector(sector, &state.position, &state.velocity, &state.forces, moved);
            bank.lose(sector, record.work.damping);
        }
        Ok(())
    }
}
