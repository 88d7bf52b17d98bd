//! Integrates one sector over a span with steps that the tolerance and the energy balance allow.

use tiprub_cosim::persist_fields;

use super::advance::Advance;
use super::basis::MOST;
use super::level::{ContactModes, StepTables};
use super::march::{AdaptiveStepper, SpanStep, march};
use super::rows::ContactRows;
use super::state::SectorState;
use super::trial::{ForceInterpolation, Obstacle, Trial, TrialResult};

/// Largest number of halvings of the span.
pub const HALVINGS: usize = 10;

/// Tables of one kind of sector for a span that is halved repeatedly. All levels have the same degree.
#[derive(Debug, Clone)]
pub struct Tables {
    /// Data that all levels share.
    pub rows: ContactRows,
    /// Tables for the span, half of it, a quarter, …
    pub levels: Vec<StepTables>,
    /// Tables of a higher degree, for steps in which no sticking contact changes its status; empty without sticking.
    pub steady: Vec<StepTables>,
    modes: ContactModes,
}

impl Tables {
    /// Creates tables for spans up to `longest` (s); call [`Tables::set_span`] before the first span.
    pub fn new(modes: ContactModes, longest: f64) -> Self {
        let degree = modes.degree_up_to(longest);
        Self::of_degree(modes, degree)
    }

    /// Creates tables of a degree that is known to be suitable.
    pub fn of_degree(modes: ContactModes, degree: usize) -> Self {
        let levels = (0..=HALVINGS).map(|_| StepTables::new(&modes, degree)).collect();
        Self { rows: ContactRows::new(&modes), levels, steady: Vec::new(), modes }
    }

    /// Kinetic and strain energy of a sector (J).
    pub fn energy(&self, state: &SectorState) -> f64 {
        let (kinetic, strain) = state.energies(&self.modes.frequencies, self.rows.residual());
        kinetic + strain
    }

    /// Adds tables of degree `degree` for steps in which no contact changes its status.
    #[must_use]
    pub fn steady(mut self, degree: usize) -> Self {
        self.steady = (0..=HALVINGS).map(|_| StepTables::new(&self.modes, degree)).collect();
        self
    }

    /// Tables of a level with the given number of points.
    pub fn of_points(&self, level: usize, kind: ForceInterpolation, points: usize) -> &StepTables {
        let steady = self
            .steady
            .get(level)
            .filter(|level| kind == ForceInterpolation::Polynomial && level.basis.degree == points);
        steady.unwrap_or(&self.levels[level])
    }

    /// Fills the tables for spans of length `span` (s). Does not allocate.
    pub fn set_span(&mut self, span: f64) {
        if self.levels[0].step.to_bits() == span.to_bits() {
            return;
        }
        for levels in [&mut self.levels, &mut self.steady] {
            for (halvings, level) in levels.iter_mut().enumerate() {
                level.set_step(&self.modes, halved(span, halvings));
                level.share = halved(1.0, halvings);
            }
        }
    }
}

impl ContactModes {
    /// Largest suitable degree for spans up to `longest` (s). Shorter spans are possible, so all lengths down to a thousandth of
    /// the shortest step are checked.
    pub fn degree_up_to(&self, longest: f64) -> usize {
        let lengths = (0..2 * HALVINGS).map(|halvings| halved(longest, halvings));
        if lengths.into_iter().all(|length| self.allows_cubics(length)) { MOST } else { MOST - 1 }
    }
}

/// Shortest step of spans of length `span` (s).
pub fn shortest(span: f64) -> f64 {
    halved(span, HALVINGS)
}

/// `span` divided by 2 `halvings` times (s).
fn halved(span: f64, halvings: usize) -> f64 {
    libm::ldexp(span, -i32::try_from(halvings).unwrap_or(i32::MAX))
}

/// Counters of the work of adaptive integration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Number of accepted steps.
    pub steps: u64,
    /// Number of steps without a trial, because no contact was possible.
    pub flights: u64,
    /// Number of trials, including accepted ones.
    pub trials: u64,
    /// Number of contact problems for which no solution was found.
    pub unsolved: u64,
    /// Number of trials with a constant force.
    pub constant: u64,
    /// Number of shortest steps that miss the tolerance.
    pub missed: u64,
    /// Number of factorised linear systems.
    pub factorisations: u64,
}

persist_fields!(Effort { steps, flights, trials, unsolved, constant, missed, factorisations });

impl Effort {
    /// Number of attempted steps, with and without contact.
    pub fn tried(&self) -> u64 {
        self.trials + self.flights
    }
}

/// Tolerance and limits of the steps of a sector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepGoal {
    /// Largest displacement error of a step (m).
    pub tolerance: f64,
    /// Largest gap of a contact that counts as closed (m).
    pub precision: f64,
    /// Largest number of attempted steps ([`Effort::tried`]).
    pub most: u64,
}

/// A step that is accepted.
#[derive(Debug)]
pub struct AcceptedStep<'a> {
    /// Tables for the length of the step.
    pub level: &'a StepTables,
    /// Interpolation of the contact force.
    pub kind: ForceInterpolation,
    /// Forces, gaps and displacements at the points of the step.
    pub trial: &'a Trial,
    /// Damping loss (J).
    pub damping_loss: f64,
    /// ½ΔfᵀGΔf, the energy lost by the change to a constant force (J).
    pub dropped: f64,
}

/// Records the steps of a span while it is integrated.
pub trait Witness: Obstacle {
    /// Called before a step of `length` from `from` (fractions of the span) is tried, with forces at the points of `level`.
    fn begin_step(&mut self, from: f64, length: f64, level: &StepTables, kind: ForceInterpolation);

    /// Returns whether nodes that stay within `reach` of their rest positions (m, three per node) cannot touch during a step of
    /// `length` from `from` (fractions of the span).
    fn is_clear(&self, from: f64, length: f64, reach: &[f64]) -> bool;

    /// Returns whether a node that stays within `reach` may come closer during the step than at its ends, by more than the tolerance.
    fn may_come_closer(&self, _from: f64, _length: f64, _reach: &[f64]) -> bool {
        false
    }

    /// Called before the tried step is accepted, with gaps and displacements at its points.
    fn record_gaps(&mut self, _level: &StepTables, _trial: &Trial) {}

    /// Records a step in which no contact was possible, and its damping loss (J).
    fn record_flight(&mut self, damping_loss: f64);

    /// Records an accepted step.
    fn record_step(&mut self, step: &AcceptedStep);
}

/// Reason why a span was not integrated to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// Even the shortest step has no solution of the contact problem.
    Unsolved,
    /// The limit of attempted steps is exceeded.
    Exhausted,
}

/// Integrates sectors over spans, one after the other; allocates only on creation.
#[derive(Debug, Clone)]
pub struct SectorIntegrator {
    trial: Trial,
    advance: Advance,
}

impl SectorIntegrator {
    /// Creates an integrator for the modes and contact nodes of one sector.
    pub fn new(modes: usize, nodes: usize) -> Self {
        Self { trial: Trial::new(modes, nodes), advance: Advance::new(modes, nodes) }
    }

    /// Enables contacts that may stick.
    #[must_use]
    pub fn sticking(mut self) -> Self {
        self.trial = self.trial.sticking().steady();
        self
    }

    /// Displacements of the rows of a sector (m).
    pub fn displacements(&mut self, tables: &Tables, state: &SectorState) -> &[f64] {
        self.trial.forget();
        self.trial.find_start(&tables.rows, state)
    }

    /// Returns the largest displacement of each row of a sector from rest (m) without contact.
    pub fn largest_displacements(&mut self, tables: &Tables, state: &SectorState) -> &[f64] {
        self.trial.largest_displacements(&tables.rows, state)
    }

    /// See [`Trial::entered`].
    pub fn entered(&self) -> Option<usize> {
        self.trial.entered()
    }

    /// Integrates `state` over a span.
    ///
    /// # Errors
    /// [`Stopped`]; the state is then that after the last accepted step.
    pub fn march(
        &mut self,
        tables: &Tables,
        state: &mut SectorState,
        witness: &mut impl Witness,
        demand: StepGoal,
        effort: &mut Effort,
    ) -> Result<(), Stopped> {
        self.trial.forget();
        march(&mut SingleSector { marcher: self, tables, state, witness, demand }, demand, effort)
    }
}

/// One sector that steps independently of others.
struct SingleSector<'a, W> {
    marcher: &'a mut SectorIntegrator,
    tables: &'a Tables,
    state: &'a mut SectorState,
    witness: &'a mut W,
    demand: StepGoal,
}

impl<W: Witness> AdaptiveStepper for SingleSector<'_, W> {
    fn step_control(&mut self) -> (&mut f64, &mut usize) {
        (&mut self.state.bank, &mut self.state.level)
    }

    fn largest_energy(&mut self) -> f64 {
        self.state.largest = self.state.largest.max(self.tables.energy(self.state));
        self.state.largest
    }

    fn length(&self, level: usize) -> f64 {
        self.tables.levels[level].step
    }

    fn count(&self) -> u64 {
        1
    }

    fn fly(&mut self, step: SpanStep) -> bool {
        let Self {
            marcher: SectorIntegrator { trial, advance },
            tables,
            state,
            witness,
            demand: StepGoal { tolerance, .. },
        } = self;
        if state.multipliers.iter().any(|value| *value != 0.0)
            || !witness.is_clear(step.from, step.length, trial.largest_displacements(&tables.rows, state))
        {
            return false;
        }
        let table = &tables.levels[step.level];
        if witness.may_come_closer(step.from, step.length, trial.largest_displacements(&tables.rows, state)) {
            witness.begin_step(step.from, step.length, table, ForceInterpolation::Polynomial);
            trial.glide(table, &tables.rows, state, *witness);
            if trial.find_minima(&table.basis, true, *tolerance) {
                trial.follow(tables, table, step.level, state, advance);
            }
            witness.record_gaps(table, trial);
        }
        witness.record_flight(advance.freely(table, state));
        trial.forget();
        state.gaps_known = false;
        true
    }

    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        if let Some(table) = self.tables.steady.get(step.level).filter(|_| kind == ForceInterpolation::Polynomial) {
            self.witness.begin_step(step.from, step.length, table, kind);
            let (trial, precision) = (&mut self.marcher.trial, self.demand.precision);
            let verdict = trial.run_steady(table, &self.tables.rows, self.state, self.witness, precision);
            if verdict.solved {
                return verdict;
            }
        }
        let table = &self.tables.levels[step.level];
        self.witness.begin_step(step.from, step.length, table, kind);
        self.marcher.trial.run((table, kind), &self.tables.rows, self.state, self.witness, self.demand.precision)
    }

    fn take(&mut self, step: SpanStep, kind: ForceInterpolation, verdict: &TrialResult) -> f64 {
        let Self { marcher, tables, state, witness, demand: StepGoal { tolerance, .. } } = self;
        let level = tables.of_points(step.level, kind, marcher.trial.points());
        if marcher.trial.find_minima(&level.basis, verdict.resolves_motion(kind, *tolerance), *tolerance) {
            let SectorIntegrator { trial, advance } = &mut **marcher;
            trial.follow(tables, level, step.level, state, advance);
        }
        let dropped = if kind == ForceInterpolation::Constant {
            marcher.trial.dropped(tables.rows.residual(), state)
        } else {
            0.0
        };
        let (trial, basis) = (&marcher.trial, &level.basis);
        let damping_loss =
            marcher.advance.under((level, &tables.rows), state, |node| trial.polynomial(basis, kind, node));
        let left = match kind {
            ForceInterpolation::Polynomial if verdict.switches => -verdict.switched,
            ForceInterpolation::Polynomial => 0.0,
            ForceInterpolation::Constant => dropped + trial.closed(),
        };
        witness.record_step(&AcceptedStep { level, kind, trial, damping_loss, dropped });
        marcher.trial.leave(state);
        left
    }
}
