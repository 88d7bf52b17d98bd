//! Open steps as arrays of numbers, which are part of a saved state.

use super::open_step::{OpenStep, SpanProgress, to_count, to_real};
use super::span::BladeInSpan;
use super::trial::BladeTrial;
use crate::math::octet::Eight;
use crate::system::Effort;
use crate::system::work::ContactWork;
use crate::time::galerkin::basis::MOST;
use crate::time::galerkin::span::{SpanStep, UNITS_PER_SPAN};
use crate::time::galerkin::tables::HALVINGS;
use crate::time::galerkin::trial::ForceInterpolation;

/// Length of the header of a stored step, before its arrays.
const HEADER_LEN: usize = 28;
/// Code of a flight without an end.
const UNBOUNDED_FLIGHT: f64 = 3.0;

impl BladeInSpan<'_> {
    /// Stores the rates of the gaps and, if it has changed, the open step in an array with a length of [`stored_len`].
    pub fn store(&mut self, numbers: &mut [f64]) {
        let (head, arrays) = numbers.split_at_mut(HEADER_LEN);
        let (rates, arrays) = arrays.split_at_mut(8 * self.blade.trial.rates.len());
        let blocks = self.blade.trial.rates.iter().zip(rates.as_chunks_mut().0);
        blocks.for_each(|(block, numbers)| *numbers = block.0);
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
        let BladeTrial { reach, free_amplitudes, gap_bounds, moved, sigma, gaps, multipliers, forces, pushes, .. } =
            &mut self.blade.trial;
        if !self.reach_known {
            reach.iter_mut().for_each(|reach| reach.fill(Eight::ZERO));
            free_amplitudes.fill(Eight::ZERO);
        }
        if kind.is_some() {
            gap_bounds.fill(Eight::ZERO);
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
        let bounds = [&mut self.free_amplitudes, &mut self.gap_bounds];
        let contacts = [&mut start.multipliers, &mut start.slopes, &mut start.gaps, &mut start.sigma];
        let all = start
            .modes
            .iter_mut()
            .chain(&mut start.forces)
            .chain(&mut start.moved)
            .chain(contacts)
            .chain(reach)
            .chain(bounds);
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
