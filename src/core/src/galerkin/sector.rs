//! One sector over a span of time: steps as long as the tolerance and the energy allow.

use super::advance::Advance;
use super::basis::MOST;
use super::level::{Level, Modes};
use super::rows::Rows;
use super::state::SectorState;
use super::trial::{Kind, Obstacle, Trial, Verdict};
use crate::persist::persist_fields;

/// Halvings of the span that a step may have.
pub const HALVINGS: usize = 10;
/// Below this share of the tolerance the next step is twice as long.
const LENGTHEN: f64 = 1.0 / 32.0;
/// Nearness between points is looked at down to this step (s).
const SHORTEST_LOOK: f64 = 2.5e-6;

/// Tables of one kind of sector: spans of one length halved again and again. All have one degree.
#[derive(Debug, Clone)]
pub struct Tables {
    /// What all levels share.
    pub rows: Rows,
    /// Span, half of it, a quarter, …
    pub levels: Vec<Level>,
    modes: Modes,
}

impl Tables {
    /// For spans up to `longest` (s); [`Tables::set_span`] comes before the first.
    pub fn new(modes: Modes, longest: f64) -> Self {
        // Spans may be shorter than the longest: all lengths down to a thousandth of the shortest step are looked at.
        let degree = (0..2 * HALVINGS).map(|halvings| modes.degree_at(halved(longest, halvings))).min();
        let levels = (0..=HALVINGS).map(|_| Level::new(&modes, degree.unwrap_or(MOST))).collect();
        Self { rows: Rows::new(&modes), levels, modes }
    }

    /// Fill the tables for spans of length `span` (s). Does not allocate.
    pub fn set_span(&mut self, span: f64) {
        for (halvings, level) in self.levels.iter_mut().enumerate() {
            level.set_step(&self.modes, halved(span, halvings));
        }
    }
}

/// The shortest step of spans of length `span` (s).
pub fn shortest(span: f64) -> f64 {
    halved(span, HALVINGS)
}

/// `span` halved so many times (s).
fn halved(span: f64, halvings: usize) -> f64 {
    libm::ldexp(span, -i32::try_from(halvings).unwrap_or(i32::MAX))
}

/// What has been done to keep the tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Steps taken.
    pub steps: u64,
    /// Those of them in which nothing was in reach, without a trial.
    pub flights: u64,
    /// Trials, those taken included.
    pub trials: u64,
    /// Contact problems without a solution found.
    pub unsolved: u64,
    /// Steps with a constant force.
    pub constant: u64,
    /// Shortest steps that miss the tolerance.
    pub missed: u64,
    /// Linear systems factorised.
    pub factorisations: u64,
}

persist_fields!(Effort { steps, flights, trials, unsolved, constant, missed, factorisations });

impl Effort {
    /// Steps tried, with contact or without.
    pub fn tried(&self) -> u64 {
        self.trials + self.flights
    }
}

/// How exactly a sector is marched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Error of a step in displacements (m).
    pub tolerance: f64,
    /// Gaps of contacts that count as closed (m).
    pub precision: f64,
    /// No more are tried ([`Effort::tried`]).
    pub most: u64,
}

/// A step that is taken.
#[derive(Debug)]
pub struct Taken<'a> {
    /// Tables of its length.
    pub level: &'a Level,
    /// Kind of its force.
    pub kind: Kind,
    /// Forces, gaps and displacements at its points.
    pub trial: &'a Trial,
    /// Damping loss (J).
    pub damping_loss: f64,
    /// ½ΔfᵀGΔf, what a constant force loses against the one before (J).
    pub dropped: f64,
}

/// What is told of a span while it is marched.
pub trait Witness: Obstacle {
    /// A step of `length` from `from` (shares of the span) is about to be tried, with forces at the points of `level`.
    fn go(&mut self, from: f64, length: f64, level: &Level, kind: Kind);

    /// Whether nodes that stay within `reach` (m, three per node) of where they rest cannot touch over a step of `length` from `from`
    /// (shares of the span).
    fn is_clear(&self, from: f64, length: f64, reach: &[f64]) -> bool;

    /// A step has been taken in which nothing was in reach; its damping loss (J).
    fn flew(&mut self, damping_loss: f64);

    /// The step has been taken.
    fn took(&mut self, step: &Taken);
}

/// Why a span is not marched to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// No step is short enough for contacts to have a solution.
    Unsolved,
    /// More steps would have to be tried than are allowed.
    Exhausted,
}

/// Marches sectors over spans, one after the other; allocates only when made.
#[derive(Debug, Clone)]
pub struct Marcher {
    trial: Trial,
    advance: Advance,
}

impl Marcher {
    /// Room for the modes and contact nodes of one sector.
    pub fn new(modes: usize, nodes: usize) -> Self {
        Self { trial: Trial::new(modes, nodes), advance: Advance::new(modes, nodes) }
    }

    /// Displacements of the rows of a sector (m).
    pub fn displacements(&mut self, tables: &Tables, state: &SectorState) -> &[f64] {
        self.trial.forget();
        self.trial.find_start(&tables.rows, state)
    }

    /// How far the rows of a sector can be from where they rest while nothing pushes (m).
    pub fn reach(&mut self, tables: &Tables, state: &SectorState) -> &[f64] {
        self.trial.reach(&tables.rows, state)
    }

    /// March `state` over a span.
    ///
    /// # Errors
    /// [`Stopped`]; the state is then where the last step taken left it.
    pub fn march(
        &mut self,
        tables: &Tables,
        state: &mut SectorState,
        witness: &mut impl Witness,
        demand: Demand,
        effort: &mut Effort,
    ) -> Result<(), Stopped> {
        const WHOLE: u64 = 1 << HALVINGS;
        let mut done = 0_u64;
        self.trial.forget();
        while done < WHOLE {
            // The shortest may take two.
            if effort.tried() + u64::from(state.level == HALVINGS) >= demand.most {
                return Err(Stopped::Exhausted);
            }
            let level = state.level;
            let units = WHOLE >> level;
            let (from, length) = (share(done, WHOLE), share(units, WHOLE));
            let table = &tables.levels[level];
            let shortest = level == HALVINGS;
            if state.multipliers.iter().all(|value| *value == 0.0)
                && witness.is_clear(from, length, self.trial.reach(&tables.rows, state))
            {
                witness.flew(self.advance.freely(table, state));
                self.trial.forget();
                state.looked = false;
                (effort.steps, effort.flights, done) = (effort.steps + 1, effort.flights + 1, done + units);
                state.level -= usize::from(level > 0 && done.is_multiple_of(2 * units));
                continue;
            }
            let (verdict, kind) = self.try_step((table, from, length), tables, state, witness, demand, effort);
            let refused = !verdict.solved
                || (kind == Kind::Polynomial
                    && (verdict.error > demand.tolerance
                        || (verdict.near && table.step > SHORTEST_LOOK)
                        || (verdict.switches && verdict.switched > state.bank)));
            if refused && !shortest {
                state.level += 1;
                continue;
            }
            if !verdict.solved {
                return Err(Stopped::Unsolved);
            }
            effort.missed += u64::from(verdict.error > demand.tolerance);
            self.take((table, kind), tables, state, witness, &verdict);
            effort.steps += 1;
            done += units;
            let even = done.is_multiple_of(2 * units);
            if level > 0 && even && kind == Kind::Polynomial && verdict.error < LENGTHEN * demand.tolerance {
                state.level -= 1;
            }
        }
        Ok(())
    }

    /// Try one step; the shortest with a constant force where a polynomial cannot be taken.
    fn try_step(
        &mut self,
        (table, from, length): (&Level, f64, f64),
        tables: &Tables,
        state: &SectorState,
        witness: &mut impl Witness,
        demand: Demand,
        effort: &mut Effort,
    ) -> (Verdict, Kind) {
        let mut run = |kind: Kind, witness: &mut _, effort: &mut Effort| {
            Witness::go(witness, from, length, table, kind);
            let verdict = self.trial.run((table, kind), &tables.rows, state, witness, demand.precision);
            effort.trials += 1;
            effort.factorisations += verdict.factorisations as u64;
            effort.unsolved += u64::from(!verdict.solved);
            verdict
        };
        let verdict = run(Kind::Polynomial, witness, effort);
        let affordable = verdict.solved && !(verdict.switches && verdict.switched > state.bank);
        if state.level < HALVINGS || affordable {
            return (verdict, Kind::Polynomial);
        }
        effort.constant += 1;
        (run(Kind::Constant, witness, effort), Kind::Constant)
    }

    /// The state goes to the end of the step that has been tried last.
    fn take(
        &mut self,
        (level, kind): (&Level, Kind),
        tables: &Tables,
        state: &mut SectorState,
        witness: &mut impl Witness,
        verdict: &Verdict,
    ) {
        let dropped = if kind == Kind::Constant { self.dropped(tables, state) } else { 0.0 };
        let (trial, basis) = (&self.trial, &level.basis);
        let damping_loss = self.advance.under((level, &tables.rows), state, |node| trial.polynomial(basis, kind, node));
        state.bank += match kind {
            Kind::Polynomial if verdict.switches => -verdict.switched,
            Kind::Polynomial => 0.0,
            Kind::Constant => dropped + self.closed(),
        };
        witness.took(&Taken { level, kind, trial: &self.trial, damping_loss, dropped });
        self.trial.leave(state);
    }

    /// ½ΔfᵀGΔf (J).
    fn dropped(&self, tables: &Tables, state: &SectorState) -> f64 {
        let change = |row: usize| self.trial.force(1, row / 3)[row % 3] - state.forces[row];
        let residual = tables.rows.residual();
        let rows = 0..residual.nrows();
        0.5 * rows
            .clone()
            .map(|i| change(i) * rows.clone().map(|k| residual[(i, k)] * change(k)).sum::<f64>())
            .sum::<f64>()
    }

    /// What contacts that close under a constant force lose: λ times the gap there was (J).
    fn closed(&self) -> f64 {
        let trial = &self.trial;
        let lost = |node: usize| trial.multiplier(1, node) * (trial.gap(0, node) - trial.gap(1, node));
        (0..trial.nodes()).filter(|node| trial.multiplier(1, *node) > 0.0).map(lost).sum()
    }
}

/// Small counts as a share.
#[expect(clippy::cast_precision_loss, reason = "below 2^HALVINGS")]
fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole as f64
}
