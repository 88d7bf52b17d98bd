//! Free spans: while nothing but the rotors moves, steps do not end at communication points.
//!
//! The results then do not depend on the communication step. When an input changes, the open steps end at that time.

use super::Simulation;
use super::clock::Communication;
use super::inputs::Inputs;
use crate::Result;
use crate::geometry::PrescribedMotion;
use crate::system::FreeSpans;
use crate::time::FreePart;

/// Times agree if they differ by less than this fraction of the elapsed time (rounding of its sums).
const SAME_TIME: f64 = 1e-9;

impl Simulation {
    /// Returns the number of the internal point at which the next internal step ends, and the part of free time until then
    /// (`None` outside free spans). Within free spans, only the last internal step of a communication step has a start of its own, for the
    /// mean forces of the last internal step; steps that may end early have all internal points. If free spans cannot continue, this ends the open steps.
    ///
    /// # Errors
    /// If the open steps cannot be ended.
    pub(super) fn next_point(&mut self) -> Result<(u64, Option<FreePart>)> {
        let Communication { count, done, partial, .. } = self.state.clock.step;
        if !(self.stepper.runs_freely() && self.enter_free_spans()?) {
            return Ok((done + 1, None));
        }
        let next = if !partial && done == 0 && count > 1 { count - 1 } else { done + 1 };
        let (step, FreeSpans { since, span, .. }) = (self.state.clock.step, self.system.free_spans);
        let part = FreePart { from: step.reached()[1] - since, to: step.time(next) - since, span };
        Ok((next, Some(part)))
    }

    /// Begins or continues free spans at the internal point reached if nothing but the rotors moves, and ends the open steps
    /// otherwise. Returns whether the run is within free spans.
    ///
    /// # Errors
    /// If the open steps cannot be ended.
    fn enter_free_spans(&mut self) -> Result<bool> {
        let step = self.state.clock.step;
        let [offset, time] = step.reached();
        let span = self.state.values[self.compiled.references.step_max];
        let (rests, same) = (self.may_run_freely(offset), self.moves_as_before(offset));
        let FreeSpans { runs, span: own, .. } = self.system.free_spans;
        if runs && !(rests && same && own.to_bits() == span.to_bits()) {
            self.end_open_steps()?;
        }
        if !self.system.free_spans.runs {
            if rests && same {
                self.state.inputs.rotors.iter_mut().for_each(|rotor| rotor.angle.rebase(&rotor.speed, offset));
            }
            for pair in 0..self.motions.drives.len() {
                let (begun, growth) = (self.state.ungrown(&self.compiled, pair, offset), self.growth_at(pair, time));
                let prescribed = &mut self.system.pairs[pair].prescribed;
                (prescribed.begun, prescribed.growth) = (begun, growth);
            }
            if !(rests && same) {
                return Ok(false);
            }
            self.system.free_spans = FreeSpans { runs: true, since: time, span };
        }
        Ok(true)
    }

    /// Lets free spans begin with the run.
    pub(super) fn expect_free_spans(&mut self) {
        for pair in 0..self.motions.drives.len() {
            self.system.pairs[pair].prescribed.begun = self.state.ungrown(&self.compiled, pair, 0.0);
        }
    }

    /// Ends the open steps at the internal point reached.
    ///
    /// # Errors
    /// If they cannot be ended.
    pub(super) fn end_open_steps(&mut self) -> Result<()> {
        let time = if self.is_in_step() { self.state.clock.step.reached()[1] } else { self.state.clock.time };
        let elapsed = time - self.system.free_spans.since;
        self.stepper.close_steps(&mut self.system, elapsed).map_err(|failure| self.fail(failure, time))
    }

    /// Returns whether nothing but rotors with steady speed moves from an offset on, and neither a bound on the number of
    /// steps nor derivatives need steps that end at internal points.
    fn may_run_freely(&self, offset: f64) -> bool {
        self.state.clock.step.most == 0 && !self.is_differentiated() && self.state.inputs.stay(offset)
    }

    /// Returns whether the prescribed motion is the one of the free spans, or of the internal step before.
    fn moves_as_before(&self, offset: f64) -> bool {
        let bits = |motion: &PrescribedMotion| {
            let PrescribedMotion { speed, gap_offset, shape_factor, shape_rotation, radius_change, shaft, .. } =
                *motion;
            let [x, y, z] = shaft.into();
            [speed, gap_offset, shape_factor, shape_rotation, radius_change, x, y, z].map(f64::to_bits)
        };
        self.system.pairs.iter().enumerate().all(|(index, pair)| {
            bits(&self.state.ungrown(&self.compiled, index, offset)) == bits(&pair.prescribed.begun)
        })
    }

    /// Time since the growth of the shape of a pair began, and duration of the growth (s).
    fn growth_at(&self, pair: usize, time: f64) -> [f64; 2] {
        let growth = self.state.growth(&self.compiled, pair, [[0.0, time]; 2]);
        [growth.elapsed[0], growth.length]
    }

    /// Makes the time since the start of the rotor angles exact at the end of a communication step in free spans.
    pub(super) fn keep_angles(&mut self, time: f64) {
        let elapsed = time - self.system.free_spans.since;
        self.state.inputs.rotors.iter_mut().for_each(|rotor| rotor.angle.keep_elapsed(elapsed, SAME_TIME));
    }
}

impl Inputs {
    /// Returns whether all inputs keep their values from an offset on.
    fn stay(&self, offset: f64) -> bool {
        let rotors = self.rotors.iter().flat_map(|rotor| [&rotor.speed, &rotor.spin]);
        self.moving().chain(rotors).all(|input| input.stays(offset))
    }
}
