//! ∂y(t+H)/∂u: the dependence of outputs at the end of the last communication step on inputs over it, for importers that iterate.
//!
//! Outputs of a step are piecewise smooth in its inputs: the pieces differ in the set of closed contacts and, with galerkin, in the steps
//! of every sector. Inputs are changed by so little (gaps by a millionth of the clearance) that the step stays on its piece, and the step
//! is repeated in a copy. With galerkin the steps of the copy show whether it stayed on the piece. The other schemes have no such count:
//! there the step is repeated in both directions, and impulses and gaps that do not change equally indicate a kink between them. The change
//! of inputs is then reduced. The quotient is the derivative with contacts and steps as they were in the accepted step, up to rounding.

use tiprub_cosim::variables::{Causality, Quantity};
use tiprub_cosim::{CoSimulation, shown_time};

use super::Simulation;
use super::clock::SimulationPhase;
use crate::{Error, Result};
use std::sync::Arc;

/// Change of inputs as a fraction of the change that moves gaps by a clearance: 2⁻²⁰, so that sums with usual values are exact. Rounding in
/// gaps is some 1e-7 of it, more on splines.
const SMALL: f64 = 1.0 / 1_048_576.0;
/// Factor of reductions if the step does not stay on its smooth piece.
const LESS: f64 = 0.125;
/// Largest number of repetitions with galerkin, and of pairs of repetitions with other schemes.
const TRIES: usize = 6;
/// Largest difference between the changes of impulses and gaps in both directions, as a fraction of the change.
const BENT: f64 = 1e-3;
/// Inputs that move gaps by less than this fraction of the intended change are changed more, by a factor up to [`MOST`].
const WEAK: f64 = 0.0625;
const MOST: f64 = 4096.0;
/// Part of a turn (rad) over which shapes and loads change by about a clearance.
const TURN: f64 = 0.1;
/// Change of a temperature (K) that moves a casing by about a clearance.
const HEATING: f64 = 100.0;

/// Data for repeating the last communication step.
#[derive(Debug, Clone, Default)]
pub(super) struct StepReplay {
    /// State at its start; empty if derivatives are not requested.
    start: Vec<u8>,
    /// True if `start` and its inputs determine the whole step.
    stands: bool,
    /// Copy of the simulation that repeats the step, made when first needed.
    twin: Option<Box<Simulation>>,
    /// True if the parameters of the twin are the current ones.
    follows: bool,
}

impl StepReplay {
    /// Marks that the last step cannot be repeated from its start.
    pub(super) fn forget(&mut self) {
        self.stands = false;
    }

    /// Makes the twin read its parameters from its start state again.
    pub(super) fn follow_anew(&mut self) {
        self.follows = false;
    }

    /// Discards all data after a new start or a restored state.
    pub(super) fn renew(&mut self) {
        (self.stands, self.follows) = (false, false);
    }
}

impl Simulation {
    /// Returns whether derivatives over steps can be requested: the parameter `step_derivatives`.
    pub(super) fn is_differentiated(&self) -> bool {
        self.state.values.value_of(Quantity::StepDerivatives, 0) > 1.5
    }

    /// Allocates the state at the start of steps, if derivatives will be requested.
    pub(super) fn make_room_for_tangent(&mut self) {
        let size = if self.is_differentiated() { self.state_size } else { 0 };
        self.tangent.start.resize(size, 0);
        self.tangent.renew();
    }

    /// Saves the state at the start of a communication step. Does not allocate.
    pub(super) fn set_out_tangent(&mut self) {
        let mut start = std::mem::take(&mut self.tangent.start);
        self.tangent.stands = !start.is_empty() && self.save_state(&mut start).is_ok();
        self.tangent.start = start;
    }

    /// Implements [`CoSimulation::step_derivative`].
    ///
    /// The step is repeated in a copy of the simulation, usually once with galerkin and twice with other schemes; the simulation itself is
    /// unchanged. An input here is the value that was requested before the step; contacts and internal steps stay as they were in it.
    pub(super) fn differentiate_step(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<()> {
        assert!(outputs.len() == sensitivity.len() && inputs.len() == seed.len(), "one value per reference");
        self.check_tangent(outputs, inputs, seed)?;
        let most = inputs.iter().zip(seed).filter(|(_, seed)| **seed != 0.0);
        let most = most.map(|(input, seed)| self.nudge(*input) / seed.abs()).fold(f64::INFINITY, f64::min);
        if !most.is_finite() {
            sensitivity.fill(0.0);
            return Ok(());
        }
        let mut twin = match self.tangent.twin.take() {
            Some(twin) => twin,
            None => {
                self.tangent.follows = false;
                Box::new(Self::new(Arc::clone(&self.compiled.scene))?)
            }
        };
        let outcome = self.differentiate(&mut twin, (outputs, sensitivity), (inputs, seed), most);
        self.tangent.twin = Some(twin);
        outcome
    }

    fn differentiate(
        &mut self,
        twin: &mut Self,
        (outputs, sensitivity): (&[u32], &mut [f64]),
        (inputs, seed): (&[u32], &[f64]),
        most: f64,
    ) -> Result<()> {
        let (mut moved, mut grown) = (most, inputs.iter().any(|input| self.is_speed(*input)));
        let mut least = f64::INFINITY;
        for _ in 0..TRIES {
            self.march_again(twin, inputs, seed, moved)?;
            let share = self.gaps_moved(twin) / (SMALL * self.clearance());
            if !grown && share < WEAK {
                let more = (1.0 / share.max(1.0 / MOST)).log2().floor().exp2();
                (moved, grown) = (more * moved, true);
                continue;
            }
            grown = true;
            if !self.is_marched() {
                let of_twin =
                    |twin: &Self| outputs.iter().map(|output| twin.state.values[*output as usize]).collect::<Vec<_>>();
                let (ahead, touched) = (of_twin(twin), twin.touched());
                self.march_again(twin, inputs, seed, -moved)?;
                let bent = bend(&twin.touched(), &self.touched(), &touched);
                if bent < least {
                    least = bent;
                    for (value, (ahead, behind)) in sensitivity.iter_mut().zip(ahead.iter().zip(of_twin(twin))) {
                        *value = (ahead - behind) / (2.0 * moved);
                    }
                }
                if bent <= BENT {
                    break;
                }
                moved *= LESS;
                continue;
            }
            for (value, output) in sensitivity.iter_mut().zip(outputs) {
                let output = *output as usize;
                *value = (twin.state.values[output] - self.state.values[output]) / moved;
            }
            // The same steps mean the same piece. The last try is accepted in any case; it is on a neighbouring piece.
            if twin.system.effort() == self.system.effort() {
                break;
            }
            moved = if moved > 0.0 { -moved } else { -LESS * moved };
        }
        Ok(())
    }

    fn is_speed(&self, reference: u32) -> bool {
        self.state.values.table().locate(reference).is_ok_and(|(variable, _)| variable.quantity == Quantity::Speed)
    }

    /// Smallest clearance of all pairs (m).
    fn clearance(&self) -> f64 {
        self.system.pairs().iter().map(|pair| pair.gap().clearance()).fold(f64::INFINITY, f64::min)
    }

    /// Returns normal impulses over the communication step (N·s) and evaluated gaps at its end (m) of all structures.
    fn touched(&self) -> [Vec<f64>; 2] {
        let impulses = self.state.window.bodies.iter().flat_map(|body| &body.normal_impulse).copied();
        let gaps = self.system.structures().iter().flat_map(|structure| structure.evaluated_gaps());
        [impulses.collect(), gaps.collect()]
    }

    /// Largest difference between the current gaps and those of a twin (m), of nodes whose gaps were evaluated in both.
    fn gaps_moved(&self, twin: &Self) -> f64 {
        let both = self.system.structures().iter().zip(twin.system.structures());
        let gaps = both.flat_map(|(own, other)| own.evaluated_gaps().zip(other.evaluated_gaps()));
        gaps.map(|(own, other)| (own - other).abs()).filter(|moved| moved.is_finite()).fold(0.0, f64::max)
    }

    /// Repeats the last communication step in `twin`, with inputs changed by `moved` times `seed`.
    fn march_again(&mut self, twin: &mut Self, inputs: &[u32], seed: &[f64], moved: f64) -> Result<()> {
        let lost = |error: Error| {
            Error::unstable(
                format!(
                    "the communication step to t = {} s cannot be repeated: {error}",
                    shown_time(self.state.clock.time)
                ),
                "Do not request derivatives over this step",
            )
        };
        if self.tangent.follows {
            twin.restore_from(&self.tangent.start);
        } else {
            twin.restore_checked(&self.tangent.start).map_err(lost)?;
            twin.tangent = StepReplay::default();
        }
        self.tangent.follows = true;
        // A step that was allowed once is allowed again.
        let bound = twin.state.values.table().with_quantity_of(Quantity::MaxInternalSteps, 0);
        if let Some(bound) = bound.map(|bound| bound.reference as usize) {
            twin.state.values[bound] = 0.0;
        }
        for (input, seed) in inputs.iter().zip(seed) {
            twin.move_input(*input, moved * seed);
        }
        twin.diagnostics.notes.clear();
        twin.do_step(self.state.clock.step.start, self.state.clock.step.length).map_err(lost)
    }

    /// Shifts the requested course of an input and keeps its slope.
    fn move_input(&mut self, reference: u32, by: f64) {
        let (hold, inputs) = (self.holds(), &mut self.state.inputs);
        let Ok((variable, element)) = self.state.values.table().locate(reference) else { return };
        let Some(input) = inputs.get_mut(variable.quantity, variable.of, element) else { return };
        input.value += by;
        if variable.quantity == Quantity::Speed || hold {
            input.act_immediately();
        }
        if variable.quantity == Quantity::Speed {
            let rotor = &mut inputs.rotors[variable.of];
            rotor.angle.rebase(&rotor.speed, 0.0);
        }
    }

    /// Returns the change of an input for a difference: a small fraction of the change that closes the clearance.
    fn nudge(&self, reference: u32) -> f64 {
        let Ok((variable, _)) = self.state.values.table().locate(reference) else { return f64::INFINITY };
        let value = self.state.values[reference as usize].abs();
        let size = match variable.quantity {
            Quantity::Speed => {
                (TURN / self.state.clock.step.length).min(if value > 0.0 { 10.0 * value } else { f64::INFINITY })
            }
            Quantity::ShapeRotation | Quantity::LoadPhase | Quantity::Excitation(1) => TURN,
            Quantity::ShapeFactor => 1.0,
            Quantity::LoadAmplitude | Quantity::Excitation(_) => value.max(1.0),
            Quantity::CasingTemperature | Quantity::RotorTemperature => HEATING,
            _ => self.clearance(),
        };
        SMALL * size
    }

    fn check_tangent(&self, outputs: &[u32], inputs: &[u32], seed: &[f64]) -> Result<()> {
        let what = "derivative over the last step";
        if !self.is_differentiated() {
            let remedy = "Set the parameter step_derivatives to on before initialisation";
            return Err(Error::invalid(what, "step derivatives are off", remedy));
        }
        if self.state.clock.phase != SimulationPhase::Ready || !self.tangent.stands {
            return Err(Error::invalid(
                what,
                "there is no communication step to repeat: none has been completed, or the last one was discarded or \
                 ended early, a state was restored after it, or a variable was set within it",
                "Request derivatives after a complete communication step, before a state is restored",
            ));
        }
        for output in outputs {
            let (variable, element) = self.table().locate(*output)?;
            variable.check_derivative(element, Causality::Output, 1)?;
        }
        inputs.iter().zip(seed).try_for_each(|(input, seed)| self.check_seed(*input, *seed).map(drop))
    }
}

/// Returns the deviation of impulses and gaps at three successive places from a line, as a fraction of their change; the larger of both.
fn bend(behind: &[Vec<f64>; 2], now: &[Vec<f64>; 2], ahead: &[Vec<f64>; 2]) -> f64 {
    let one = |which: usize| {
        let (mut off, mut change) = (0.0, 0.0);
        for ((behind, now), ahead) in behind[which].iter().zip(&now[which]).zip(&ahead[which]) {
            let (before, after) = (now - behind, ahead - now);
            // A node without gap, before or after, has no rate.
            if before.is_finite() && after.is_finite() {
                off += (after - before).abs();
                change += before.abs() + after.abs();
            }
        }
        if change > 0.0 { off / change } else { 0.0 }
    };
    f64::max(one(0), one(1))
}
