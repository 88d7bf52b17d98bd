//! Sectors of a structure that face one surface of revolution.
//!
//! Several threads can share the sectors of a span. The result of a sector depends only on the state at the start of the
//! span and, in a long span, on the smallest gaps of the first few sectors. Results are entered in the order of the
//! sectors, so they do not depend on the number of threads.

use super::steady_phase::{real_count, steady_course};
use crate::contact::ContactParameters;
use crate::geometry::GapLaw;
use crate::geometry::revolution::RevolutionGap;
use crate::system::contact_view::ContactMember;
use crate::system::pair::Prescribed;
use crate::system::structure::UNKNOWN_GAP;
use crate::system::{ContactPair, Effort, EvaluatedBlocks, StepFailure, Structure, System};
use crate::time::SteadyInterval;
use crate::time::galerkin::blade::{
    Blade, BladeInSpan, BladeModel, BladePlace, BladeTally, SkippedSector, StoredStep, mark_unsampled,
};
use crate::time::galerkin::island::StepControl;
use crate::time::galerkin::record::MotionCourse;
use crate::time::galerkin::span::{StepGoal, Stopped, integrate};
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::Tables;
use crate::time::galerkin::trial::Trial;
use crate::time::workers::Workers;
use std::iter::Zip;
use std::mem::{swap, take};
use std::ops::Range;
use std::slice::IterMut;
use std::sync::{Mutex, PoisonError};

/// Number of sectors per sector that is integrated before the others.
const SECTORS_PER_FIRST_SECTOR: usize = 9;

/// Tables, scratch memory and results of the sectors of a structure.
#[derive(Debug, Clone)]
pub(super) struct BladeSectors {
    pub model: BladeModel,
    /// Length of an array that stores an open step of a sector; 0 if all steps end at internal points.
    pub open_step_len: usize,
    /// Scratch memory of each thread.
    scratch: Vec<Scratch>,
    /// One result per sector; with one thread, a single result that the sectors use in turn.
    results: Vec<SectorResult>,
}

/// Scratch memory of a thread.
#[derive(Debug, Clone)]
struct Scratch {
    blade: Blade,
    /// Finds the displacements of the contact rows.
    trial: Trial,
}

/// State of a sector at the end of a span, and its contacts during the span.
#[derive(Debug, Clone)]
pub(super) struct SectorResult {
    /// Kind of the sector among the tables.
    pub kind: usize,
    pub state: SectorState,
    /// Displacements of the contact rows (m).
    pub displacements: Vec<f64>,
    pub control: StepControl,
    pub tally: BladeTally,
    /// Rates of the gaps at the end of an interval of a steady phase (m/s), and energy at the start of the open step (J).
    pub gap_rates: Vec<f64>,
    pub energy: f64,
    /// Results that are known at the end of the span.
    pub sampled: Sampled,
    /// Kinetic and strain energy at the end of an interval of a steady phase (J).
    pub energies: [f64; 2],
    pub effort: Effort,
    pub evaluated: EvaluatedBlocks,
    /// True if a gap of the last trial is not a number.
    pub is_lost: bool,
    pub outcome: Result<(), Stopped>,
}

/// Results of a sector that are known at the end of a span. At the end of an interval of a steady phase, only the results
/// that outputs or the next interval need are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sampled {
    /// Only the energies.
    Energies,
    /// The gaps and the energies.
    Gaps,
    /// Gaps, modes, displacements and contact forces.
    State,
}

/// A span of the sectors.
#[derive(Debug, Clone, Copy)]
pub(super) enum SectorSpan<'a> {
    /// A span that ends at an internal point, with its prescribed motion and length (s).
    Bounded(&'a MotionCourse, f64),
    /// An interval of a steady phase.
    Interval(SteadyInterval),
    /// The end of a steady phase.
    End(SteadyInterval),
}

impl SectorSpan<'_> {
    /// Returns the number of sectors that are integrated before the others, because their smallest gaps limit the search in the
    /// others. This saves time only if steps end within the span, so it is 0 for other spans.
    pub fn first_sectors(&self, sectors: usize) -> usize {
        match self {
            Self::Interval(interval) if interval.to - interval.from > interval.span => {
                sectors / SECTORS_PER_FIRST_SECTOR
            }
            _ => 0,
        }
    }

    /// Length of the span (s).
    fn length(&self) -> f64 {
        match self {
            Self::Bounded(_, length) => *length,
            Self::Interval(interval) | Self::End(interval) => interval.to - interval.from,
        }
    }
}

/// Data that all sectors share in a span.
#[derive(Debug, Clone, Copy)]
struct SectorsInSpan<'a> {
    model: &'a BladeModel,
    tables: &'a [Tables],
    structure: &'a Structure,
    gap: &'a RevolutionGap,
    parameters: ContactParameters,
    prescribed: &'a Prescribed,
    goal: StepGoal,
    span: SectorSpan<'a>,
}

/// Sectors that no thread has started.
struct Remaining<'a> {
    results: Zip<Range<usize>, IterMut<'a, SectorResult>>,
    open_steps: &'a mut [f64],
    open_step_len: usize,
}

impl<'a> Remaining<'a> {
    /// Returns the next sector, its result and its open step.
    fn next(&mut self) -> Option<(usize, &'a mut SectorResult, &'a mut [f64])> {
        let (sector, result) = self.results.next()?;
        let (own, rest) = take(&mut self.open_steps).split_at_mut(self.open_step_len);
        self.open_steps = rest;
        Some((sector, result, own))
    }
}

/// Span of the sectors, with the tables of all contact rows, the place in the system, and the tolerance.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpanOfSectors<'a> {
    pub span: SectorSpan<'a>,
    pub tables: &'a [Tables],
    /// Indices of the set, the structure and the pair.
    pub set: usize,
    pub structure: usize,
    pub pair: usize,
    pub goal: StepGoal,
}

impl BladeSectors {
    /// Allocates memory for one thread.
    pub fn new(model: BladeModel, structure: &Structure, trial: &Trial) -> Self {
        let is_open = model.supports_steady_phase() && !structure.step_control.open_steps.is_empty();
        let open_step_len = if is_open { structure.open_step_len() } else { 0 };
        let scratch = Scratch { blade: Blade::new(&model), trial: trial.clone() };
        let nodes = structure.nodes();
        let result = SectorResult {
            kind: 0,
            state: SectorState::new(structure.modes().model().inertial_modes(), nodes),
            displacements: vec![0.0; 3 * nodes],
            control: StepControl::default(),
            tally: scratch.blade.tally.clone(),
            gap_rates: vec![0.0; nodes],
            energy: 0.0,
            sampled: Sampled::State,
            energies: [0.0; 2],
            effort: Effort::default(),
            evaluated: EvaluatedBlocks::default(),
            is_lost: false,
            outcome: Ok(()),
        };
        Self { model, open_step_len, scratch: vec![scratch], results: vec![result] }
    }

    /// Allocates memory for `threads` threads that share `sectors` sectors.
    pub fn use_threads(&mut self, threads: usize, sectors: usize) {
        let (trial, result) = (self.scratch[0].trial.clone(), self.results[0].clone());
        // A cloned `Vec` has no spare capacity, so each thread allocates a new `Blade`.
        self.scratch.resize_with(threads, || Scratch { blade: Blade::new(&self.model), trial: trial.clone() });
        self.results.resize(if threads > 1 { sectors } else { 1 }, result);
    }

    /// Integrates some sectors over a span if several threads share them.
    pub fn integrate_together(
        &mut self,
        sectors: Range<usize>,
        system: &mut System,
        of: SpanOfSectors,
        workers: &Workers,
    ) {
        if self.results.len() == 1 || sectors.is_empty() {
            return;
        }
        let mut open_steps = take(&mut system.structures[of.structure].step_control.open_steps);
        if let Some(common) = of.begin(system, &self.model) {
            let open_step_len = self.open_step_len;
            let open_steps = &mut open_steps[sectors.start * open_step_len..sectors.end * open_step_len];
            let results = sectors.clone().zip(&mut self.results[sectors]);
            let remaining = Remaining { results, open_steps, open_step_len };
            let (remaining, scratch) = (Mutex::new(remaining), Mutex::new(self.scratch.iter_mut()));
            workers.run(&|| {
                let Some(scratch) = take_next(&scratch, Iterator::next) else { return };
                while let Some((sector, result, open_step)) = take_next(&remaining, Remaining::next) {
                    common.integrate(sector, open_step, scratch, result);
                }
            });
        }
        system.structures[of.structure].step_control.open_steps = open_steps;
    }

    /// Integrates one sector over a span, unless [`Self::integrate_together`] has integrated it.
    pub fn integrate_one(&mut self, sector: usize, system: &mut System, of: SpanOfSectors) {
        if self.results.len() > 1 && !matches!(of.span, SectorSpan::End(_)) {
            return;
        }
        let mut open_steps = take(&mut system.structures[of.structure].step_control.open_steps);
        if let Some(common) = of.begin(system, &self.model) {
            let open_step = &mut open_steps[sector * self.open_step_len..][..self.open_step_len];
            let place = self.result_place(sector);
            common.integrate(sector, open_step, &mut self.scratch[0], &mut self.results[place]);
        }
        system.structures[of.structure].step_control.open_steps = open_steps;
    }

    /// Enters the result of a sector that has been integrated.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub fn enter(&self, sector: usize, system: &mut System, of: SpanOfSectors) -> Result<(), StepFailure> {
        let SpanOfSectors { span, set, structure, pair, goal, .. } = of;
        let result = &self.results[self.result_place(sector)];
        let System { structures, events, counted, evaluated, .. } = system;
        let of = &mut structures[structure];
        counted.effort.add(&result.effort);
        evaluated.add(&result.evaluated);
        if result.outcome == Err(Stopped::Exhausted) || counted.effort.tried() > goal.most {
            return Err(StepFailure::Exhausted);
        }
        let is_interval = matches!(span, SectorSpan::Interval(_));
        if is_interval {
            of.step_control.energies[sector] = result.energy;
            if result.outcome.is_ok() {
                of.write_gaps(sector, result);
            }
        }
        let rows = self.model.rows(result.kind);
        let touching_nodes = if result.tally.touched { of.nodes() } else { 0 };
        events.now.extend((0..touching_nodes).filter_map(|node| {
            let at = ContactMember { structure, pair, node, sector, index: of.index(node, sector) };
            result.tally.event(rows, at, span.length())
        }));
        result.tally.work.enter(&mut counted.ledgers[set]);
        if result.tally.implausible || result.is_lost {
            return Err(StepFailure::Implausible { structure, sector });
        }
        of.write_result(sector, result);
        if is_interval {
            of.step_control.energies_now[2 * sector..][..2].copy_from_slice(&result.energies);
        }
        result.outcome.map_err(|_| StepFailure::Unsolved { structure, sector })
    }

    /// Includes the smallest gaps of an integrated sector in those of all integrated sectors.
    pub fn include_lowest(&mut self, sector: usize) {
        let place = self.result_place(sector);
        self.model.include_lowest(&self.results[place].tally);
    }

    fn result_place(&self, sector: usize) -> usize {
        if self.results.len() > 1 { sector } else { 0 }
    }
}

/// Takes the next item from a shared iterator.
fn take_next<I, T>(shared: &Mutex<I>, next: impl FnOnce(&mut I) -> Option<T>) -> Option<T> {
    next(&mut shared.lock().unwrap_or_else(PoisonError::into_inner))
}

impl<'a> SpanOfSectors<'a> {
    fn begin(&self, system: &'a System, model: &'a BladeModel) -> Option<SectorsInSpan<'a>> {
        let pair: &ContactPair = &system.pairs[self.pair];
        let GapLaw::Revolution(gap) = pair.gap() else { return None };
        // Sectors before this one may have used a part of the allowed steps.
        let most = self.goal.most.saturating_sub(system.steps_tried());
        Some(SectorsInSpan {
            model,
            tables: self.tables,
            structure: &system.structures[self.structure],
            gap,
            parameters: pair.parts.parameters,
            prescribed: &pair.prescribed,
            goal: StepGoal { most, ..self.goal },
            span: self.span,
        })
    }
}

impl SectorsInSpan<'_> {
    /// Integrates a sector, whose open step is stored in an array.
    fn integrate(&self, sector: usize, open_step: &mut [f64], scratch: &mut Scratch, result: &mut SectorResult) {
        let Self { model, structure, .. } = *self;
        let Scratch { blade, trial } = scratch;
        let (bank, state) = (structure.modes(), &mut result.state);
        let (kind, control) = (bank.set_of(sector), structure.step_control_of(sector));
        (result.kind, result.control) = (kind, control);
        (result.effort, result.outcome) = (Effort::default(), Ok(()));
        result.evaluated = EvaluatedBlocks::default();
        (result.sampled, result.is_lost) = (Sampled::State, false);
        structure.read_gaps(sector, state);
        let stored = StoredStep::new(open_step).filter(|_| matches!(self.span, SectorSpan::Interval(_)));
        if stored.is_some_and(|step| !step.is_sampled()) {
            state.gaps.fill(UNKNOWN_GAP);
        }
        blade.choose_minima(model, &structure.needed_minima, sector, &state.gaps);
        if let (SectorSpan::Interval(interval), Some(step)) = (self.span, stored)
            && !structure.needs_state(sector)
            && let Some(SkippedSector { energies, at_start }) = blade.energies_if_skippable(model, kind, step, interval)
        {
            (result.sampled, result.energies, result.energy) = (Sampled::Energies, energies, at_start);
            mark_unsampled(open_step);
            swap(&mut result.tally, &mut blade.tally);
            return;
        }
        let (course, has_open_step) = match self.span {
            SectorSpan::Bounded(course, _) => (*course, false),
            _ => (MotionCourse::default(), open_step[0] != 0.0),
        };
        if !has_open_step {
            structure.read_contacts(sector, state);
            bank.read_sector(sector, &mut state.position, &mut state.velocity);
        }
        let place = BladePlace { kind, sector, gap: self.gap, parameters: self.parameters, course };
        let begun = (!has_open_step).then_some(&*state);
        let mut steps = BladeInSpan::begin(model, blade, place, control, self.goal, begun);
        match self.span {
            SectorSpan::Bounded(..) => {
                result.outcome = integrate(&mut steps, &mut result.effort);
                result.is_lost = steps.is_lost();
                steps.write(state);
                result.control = steps.control;
            }
            SectorSpan::Interval(interval) => self.integrate_interval(&mut steps, interval, open_step, result),
            SectorSpan::End(interval) => self.end(&mut steps, interval, open_step, result),
        }
        swap(&mut result.tally, &mut blade.tally);
        result.evaluated = blade.take_evaluated();
        if result.sampled == Sampled::State {
            result.displacements.copy_from_slice(trial.displacements(&self.tables[result.kind].rows, &result.state));
        }
    }

    fn integrate_interval(
        &self,
        steps: &mut BladeInSpan,
        interval: SteadyInterval,
        open_step: &mut [f64],
        result: &mut SectorResult,
    ) {
        let (structure, sector) = (self.structure, steps.sector());
        let was_sampled = StoredStep::new(open_step).is_none_or(StoredStep::is_sampled);
        let course = |spans: u64| steady_course(self.prescribed, real_count(spans) * interval.span, interval.span);
        if steps.recall(open_step) && !was_sampled && !steps.gaps_are_unneeded() {
            steps.sample_start(interval, course);
        }
        result.outcome = steps.integrate_steady_interval(interval, course, &mut result.effort);
        result.is_lost = steps.is_lost();
        (result.control, result.energy) = (steps.control, steps.energy());
        if result.outcome.is_err() {
            return;
        }
        let needs_gaps = structure.needed_minima.depends_on(sector) || !steps.gaps_are_unneeded();
        let needs_state = structure.needs_state(sector);
        if needs_gaps || needs_state {
            steps.write_sample(interval, course, needs_state, &mut result.state);
        }
        result.energies = steps.energies_at_end(interval);
        result.sampled = match (needs_state, needs_gaps) {
            (true, _) => Sampled::State,
            (false, true) => Sampled::Gaps,
            (false, false) => Sampled::Energies,
        };
        if !needs_state && !steps.is_plausible(result.energies) {
            // The displacements are checked after the interval.
            steps.write_whole_sample(interval, course, &mut result.state);
            result.sampled = Sampled::State;
        }
        result.gap_rates.iter_mut().enumerate().for_each(|(node, rate)| *rate = steps.gap_rate(node));
        steps.store(open_step, needs_gaps);
    }

    /// Ends the open step of a sector.
    fn end(&self, steps: &mut BladeInSpan, interval: SteadyInterval, open_step: &mut [f64], result: &mut SectorResult) {
        steps.recall(open_step);
        open_step.fill(0.0);
        let course = |[from, to]: [f64; 2]| steady_course(self.prescribed, from, to - from);
        result.outcome = steps.close(interval, course, &mut result.effort, &mut result.state);
        result.is_lost = steps.is_lost();
        result.control = StepControl { level: result.control.level, ..steps.control };
    }
}
