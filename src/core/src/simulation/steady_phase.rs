//! Steady phases: parts of a run in which all inputs rest and the rotors turn at constant speed.
//!
//! In a steady phase, adaptive steps do not end at communication points, so the results do not depend on the
//! communication step. A step that is accepted but has not ended is an open step. If an input changes, all open steps end
//! at that time.

use super::Simulation;
use super::clock::Communication;
use super::inputs::Inputs;
use crate::Result;
use crate::geometry::PrescribedMotion;
use crate::system::SteadyPhase;
use crate::time::SteadyInterval;

/// Times agree if they differ by at most this fraction of the elapsed time (rounding of sums).
const TIME_ROUNDING: f64 = 1e-9;

impl Simulation {
    /// Returns the number of the next internal point to compute, and the interval of the steady phase until then (`None`
    /// outside steady phases). In a steady phase, a communication step has one internal point, at which its last internal
    /// step starts, unless it may end early.
    /// Begins a steady phase, or ends it with its open steps, if required.
    ///
    /// # Errors
    /// If the open steps cannot be ended.
    pub(super) fn next_point(&mut self) -> Result<(u64, Option<SteadyInterval>)> {
        let Communication { count, done, partial, .. } = self.state.clock.step;
        if !(self.stepper.supports_steady_phase() && self.enter_steady_phase()?) {
            return Ok((done + 1, None));
        }
        let next = if !partial && done == 0 && count > 1 { count - 1 } else { done + 1 };
        let (step, SteadyPhase { since, span, .. }) = (self.state.clock.step, self.system.steady_phase);
        let interval = SteadyInterval { from: step.reached()[1] - since, to: step.time(next) - since, span };
        Ok((next, Some(interval)))
    }

    /// Begins or continues a steady phase at the internal point reached if all inputs rest, and ends the open steps
    /// otherwise. Returns whether the run is in a steady phase.
    ///
    /// # Errors
    /// If the open steps cannot be ended.
    fn enter_steady_phase(&mut self) -> Result<bool> {
        let step = self.state.clock.step;
        let [offset, time] = step.reached();
        let span = self.state.values[self.compiled.references.step_max];
        let (rests, unchanged) = (self.is_steady(offset), self.motion_is_unchanged(offset));
        let SteadyPhase { active, span: previous_span, .. } = self.system.steady_phase;
        if active && !(rests && unchanged && previous_span.to_bits() == span.to_bits()) {
            self.end_open_steps()?;
        }
        if !self.system.steady_phase.active {
            if rests && unchanged {
                self.state.inputs.rotors.iter_mut().for_each(|rotor| rotor.angle.rebase(&rotor.speed, offset));
            }
            for pair in 0..self.motions.drives.len() {
                let (begun, growth) =
                    (self.state.motion_without_growth(&self.compiled, pair, offset), self.growth_at(pair, time));
                let prescribed = &mut self.system.pairs[pair].prescribed;
                (prescribed.begun, prescribed.growth) = (begun, growth);
            }
            if !(rests && unchanged) {
                return Ok(false);
            }
            self.system.steady_phase = SteadyPhase { active: true, since: time, span };
        }
        Ok(true)
    }

    /// Stores the prescribed motion at the start of the run, so that a steady phase can begin there.
    pub(super) fn prepare_steady_phase(&mut self) {
        for pair in 0..self.motions.drives.len() {
            self.system.pairs[pair].prescribed.begun = self.state.motion_without_growth(&self.compiled, pair, 0.0);
        }
    }

    /// Ends the open steps at the internal point reached.
    ///
    /// # Errors
    /// If they cannot be ended.
    pub(super) fn end_open_steps(&mut self) -> Result<()> {
        let time = if self.is_in_step() { self.state.clock.step.reached()[1] } else { self.state.clock.time };
        let elapsed = time - self.system.steady_phase.since;
        self.stepper.close_steps(&mut self.system, elapsed).map_err(|failure| self.fail(failure, time))
    }

    /// Returns whether all inputs keep their values from an offset (s) on, and neither a limit on the number of internal
    /// steps nor derivatives require steps that end at internal points.
    fn is_steady(&self, offset: f64) -> bool {
        self.state.clock.step.most == 0 && !self.is_differentiated() && self.state.inputs.rest_from(offset)
    }

    /// Returns whether the prescribed motion is the same as at the start of the steady phase, or at the start of the
    /// previous internal step.
    fn motion_is_unchanged(&self, offset: f64) -> bool {
        let bits = |motion: &PrescribedMotion| {
            let PrescribedMotion { speed, gap_offset, shape_factor, shape_rotation, radius_change, shaft, .. } =
                *motion;
            let [x, y, z] = shaft.into();
            [speed, gap_offset, shape_factor, shape_rotation, radius_change, x, y, z].map(f64::to_bits)
        };
        self.system.pairs.iter().enumerate().all(|(index, pair)| {
            bits(&self.state.motion_without_growth(&self.compiled, index, offset)) == bits(&pair.prescribed.begun)
        })
    }

    /// Time since the growth of the shape of a pair began, and duration of the growth (s).
    fn growth_at(&self, pair: usize, time: f64) -> [f64; 2] {
        let growth = self.state.growth(&self.compiled, pair, [[0.0, time]; 2]);
        [growth.elapsed[0], growth.length]
    }

    /// Corrects the elapsed time of the rotor angles at the end of a communication step in a steady phase: sums of
    /// communication steps round differently.
    pub(super) fn correct_angle_times(&mut self, time: f64) {
        let elapsed = time - self.system.steady_phase.since;
        self.state.inputs.rotors.iter_mut().for_each(|rotor| rotor.angle.correct_elapsed(elapsed, TIME_ROUNDING));
    }
}

impl Inputs {
    /// Returns whether all inputs keep their values from an offset (s) on.
    fn rest_from(&self, offset: f64) -> bool {
        let rotors = self.rotors.iter().flat_map(|rotor| [&rotor.speed, &rotor.spin]);
        self.moving().chain(rotors).all(|input| input.rests_from(offset))
    }
}
