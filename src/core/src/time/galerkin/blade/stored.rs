//! Open steps as arrays of numbers, which are part of a saved state.

use super::open_step::{OpenStep, SpanProgress, to_count, to_real};
use super::span::BladeInSpan;
use super::trial::BladeTrial;
use crate::math::octet::Eight;
use crate::system::Effort;
use crate::system::work::ContactWork;
use crate::time::SteadyInterval;
use crate::time::galerkin::basis::MOST;
use crate::time::galerkin::span::{SpanStep, UNITS_PER_SPAN};
use crate::time::galerkin::tables::HALVINGS;
use crate::time::galerkin::trial::ForceInterpolation;
use std::iter::once;

/// Length of the header of a stored step, before its arrays.
const HEADER_LEN: usize = 28;
/// Code of a flight without an end.
const UNBOUNDED_FLIGHT: f64 = 3.0;
/// Index of the number that is 1 if the gaps at the last communication point are unknown, and otherwise 0.
const UNSAMPLED: usize = 27;

impl BladeInSpan<'_> {
    /// Stores the rates of the gaps and, if it has changed, the open step in an array with a length of [`stored_len`].
    /// `sampled` is false if the gaps at the end of the interval are unknown.
    pub fn store(&mut self, numbers: &mut [f64], sampled: bool) {
        let (head, arrays) = numbers.split_at_mut(HEADER_LEN);
        head[UNSAMPLED] = f64::from(u8::from(!sampled));
        let (rates, arrays) = arrays.split_at_mut(8 * self.blade.trial.rates.len());
        let blocks = self.blade.trial.rates.iter().zip(rates.as_chunks_mut().0);
        // Unknown rates must not be part of a saved state.
        blocks.for_each(|(block, numbers)| *numbers = if sampled { block.0 } else { [0.0; 8] });
        if !self.has_changed {
            return;
        }
        let Some(OpenStep { step, kind, is_resolved, work, energy, banked }) = self.open else { return };
        self.clear_unknown(step, kind);
        let flag = |is: bool| f64::from(u8::from(is));
        let SpanProgress { spans, done, effort } = self.progress;
        let code = match kind {
            None => 0.0,
            Some(ForceInterpolation::Polynomial) => 1.0,
            Some(ForceInterpolation::Constant) => 2.0,
        };
        let code = if self.open.is_some_and(|open| open.is_unbounded()) { UNBOUNDED_FLIGHT } else { code };
        let counts = [effort.steps, effort.flights, effort.trials, effort.unsolved];
        let more = [effort.constant, effort.missed, effort.factorisations];
        let values = [1.0, to_real(spans), to_real(done), to_real(step.level as u64), code]
            .into_iter()
            .chain([is_resolved, self.known, self.reach_known, self.blade.trial.pushes].map(flag))
            .chain([flag(self.blade.trial.start.pushed), energy])
            .chain([
                work.shaft,
                work.casing,
                work.heat,
                work.closing,
                work.dropped,
                work.exact,
                work.turnover,
                work.moved,
            ])
            .chain(counts.map(to_real))
            .chain(more.map(to_real))
            .chain([banked]);
        head.iter_mut().zip(values).for_each(|(to, value)| *to = value);
        self.blade.trial.for_each_stored_block(kind.is_some(), arrays, |block, numbers| *numbers = block.0);
    }

    /// Clears values that do not belong to the open step, so that a saved state does not depend on earlier trials.
    fn clear_unknown(&mut self, step: SpanStep, kind: Option<ForceInterpolation>) {
        let BladeTrial { reach, free_amplitudes, moved, sigma, gaps, multipliers, forces, pushes, .. } =
            &mut self.blade.trial;
        if !self.reach_known {
            reach.iter_mut().for_each(|reach| reach.fill(Eight::ZERO));
            free_amplitudes.fill(Eight::ZERO);
        }
        if !*pushes {
            forces.iter_mut().for_each(|forces| forces.fill(Eight::ZERO));
        }
        if let Some(kind) = kind {
            let used = self.tables.level(step.level, kind).blocks;
            let lanes = [sigma, gaps, multipliers].into_iter().chain(moved).chain(forces);
            lanes.for_each(|lanes| lanes[used..].fill(Eight::ZERO));
        }
    }

    /// Reads the open step from an array. Returns false if the array contains none.
    pub fn recall(&mut self, numbers: &mut [f64]) -> bool {
        if numbers[0] == 0.0 {
            return false;
        }
        self.has_changed = false;
        let counter = |index: usize| to_count(numbers[index]);
        let is = |index: usize| numbers[index] != 0.0;
        let level = usize::try_from(counter(3)).unwrap_or(0).min(HALVINGS);
        let effort = Effort {
            steps: counter(19),
            flights: counter(20),
            trials: counter(21),
            unsolved: counter(22),
            constant: counter(23),
            missed: counter(24),
            factorisations: counter(25),
        };
        self.progress = SpanProgress { spans: counter(1), done: counter(2).min(UNITS_PER_SPAN - 1), effort };
        let kind = match counter(4) {
            0 | 3 => None,
            2 => Some(ForceInterpolation::Constant),
            _ => Some(ForceInterpolation::Polynomial),
        };
        (self.known, self.reach_known) = (is(6), is(7));
        let trial = &mut self.blade.trial;
        (trial.pushes, trial.start.pushed) = (is(8), is(9));
        (trial.forces_known, trial.unresolved, trial.cubic_errors_known) = (true, None, 0);
        let work = ContactWork {
            shaft: numbers[11],
            casing: numbers[12],
            heat: numbers[13],
            closing: numbers[14],
            dropped: numbers[15],
            exact: numbers[16],
            turnover: numbers[17],
            moved: numbers[18],
            ..ContactWork::default()
        };
        let mut step = SpanStep::new(level, self.progress.done);
        if numbers[4] == UNBOUNDED_FLIGHT {
            step.length = f64::INFINITY;
        }
        self.open = Some(OpenStep { step, kind, is_resolved: is(5), work, energy: numbers[10], banked: numbers[26] });
        let (_, arrays) = numbers.split_at_mut(HEADER_LEN);
        let (rates, arrays) = arrays.split_at_mut(8 * trial.rates.len());
        trial.rates_before.iter_mut().zip(rates.as_chunks().0).for_each(|(block, numbers)| block.0 = *numbers);
        trial.for_each_stored_block(kind.is_some(), arrays, |block, numbers| block.0 = *numbers);
        true
    }
}

/// An open step that is stored in an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StoredStep<'a>(&'a [f64]);

impl<'a> StoredStep<'a> {
    /// Reads an array. Returns `None` if it contains no step, or is empty because all steps end at internal points.
    pub fn new(numbers: &'a [f64]) -> Option<Self> {
        numbers.first().is_some_and(|first| *first != 0.0).then_some(Self(numbers))
    }

    /// Returns whether the gaps of the sector at the last communication point are known.
    pub fn is_sampled(self) -> bool {
        self.0[UNSAMPLED] == 0.0
    }

    /// Returns whether forces act in the step, or the step has no end.
    pub(super) fn is_special(self) -> bool {
        self.0[8] != 0.0 || self.0[4] == UNBOUNDED_FLIGHT
    }

    /// Returns the energy at the start of the step (J).
    pub(super) fn energy(self) -> f64 {
        self.0[10]
    }

    /// Returns the time from the start of the step to the end of an interval of the steady phase (s); `None` if the step ends
    /// within the interval.
    pub(super) fn time_until(self, interval: SteadyInterval) -> Option<f64> {
        let [spans, done, level] = [1, 2, 3].map(|index| to_count(self.0[index]));
        let step = SpanStep::new(usize::try_from(level).unwrap_or(0).min(HALVINGS), done.min(UNITS_PER_SPAN - 1));
        let time = interval.to - to_real(spans) * interval.span;
        let contains = step.from + step.length > time / interval.span;
        contains.then(|| (time - step.from * interval.span).max(0.0))
    }

    /// Returns lower bounds of the gaps (m) in blocks of nodes, and q and q̇ at the start of the step in blocks of modes.
    pub(super) fn arrays(self, nodes: usize, modes: usize) -> [&'a [[f64; 8]]; 3] {
        let blocks = &self.0[HEADER_LEN..].as_chunks().0[nodes..];
        let (least, blocks) = blocks.split_at(nodes);
        let (q, blocks) = blocks.split_at(modes);
        [least, q, &blocks[..modes]]
    }
}

/// Marks the gaps at the last communication point as unknown in an array.
pub(crate) fn mark_unsampled(numbers: &mut [f64]) {
    numbers[UNSAMPLED] = 1.0;
}

/// Returns the start of a stored step in spans of length `span` (s since the start of the steady phase); `None` for a
/// flight and for an array without a step.
pub(crate) fn stored_start(numbers: &[f64], span: f64) -> Option<f64> {
    let [spans, done] = [numbers[1], numbers[2]].map(to_count);
    let is_tried = numbers[0] != 0.0 && ![0.0, UNBOUNDED_FLIGHT].contains(&numbers[4]);
    is_tried.then(|| (to_real(spans) + SpanStep::new(0, done.min(UNITS_PER_SPAN - 1)).from) * span)
}

/// Length of an array that stores an open step of a blade with these numbers of nodes and of modes with inertia.
pub(crate) fn stored_len(nodes: usize, modes: usize) -> usize {
    HEADER_LEN + 8 * ((13 + 7 * MOST) * Eight::blocks(nodes) + (3 + MOST) * Eight::blocks(modes))
}

impl BladeTrial {
    /// Calls a function with each block of an open step and its place in an array. A flight without a trial has no values at
    /// the points of a step.
    fn for_each_stored_block(&mut self, is_tried: bool, numbers: &mut [f64], of: impl Fn(&mut Eight, &mut [f64; 8])) {
        let Self { start, moved, sigma, gaps, multipliers, forces, modal_forces, reach, .. } = self;
        let contacts = [&mut start.multipliers, &mut start.slopes, &mut start.gaps, &mut start.sigma];
        let first = once(&mut self.gap_bounds).chain(&mut start.modes).chain(once(&mut self.free_amplitudes));
        let all = first.chain(&mut start.forces).chain(&mut start.moved).chain(contacts).chain(reach);
        let lanes =
            [sigma, gaps, multipliers, &mut start.friction].into_iter().chain(moved).chain(forces).chain(modal_forces);
        let mut rest = numbers.as_chunks_mut().0;
        for blocks in all.chain(lanes.filter(|_| is_tried)) {
            let (own, others) = rest.split_at_mut(blocks.len());
            blocks.iter_mut().zip(own).for_each(|(block, numbers)| of(block, numbers));
            rest = others;
        }
    }
}
