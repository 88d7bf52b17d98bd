//! Checks that friction and impacts only dissipate energy.
//!
//! A law that slides in a prescribed direction also dissipates energy as long as tips slide in that direction. If a tip vibrates
//! faster than its rotor turns, the same force excites the vibration, and the balance closes although the result is meaningless.
//! Nodes that are found inside a surface, and forces that act late, return energy that an impact dissipated.
//!
//! At every communication point both losses are compared with their largest values so far.

use tiprub_cosim::persist_fields;

use super::{ContactPair, StepFailure, System};
use crate::system::ledger::Ledger;

/// A contact loss that may only dissipate energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loss {
    /// Friction of sliding contacts.
    Friction,
    /// Impacts of gaps that close.
    Impact,
    /// Cutting of a coating, whose force does not depend on the direction of motion.
    Cutting,
}

/// Rounding of the energy balance, as a fraction of all exchanged energy; every test limits the residual to the same fraction.
const ROUNDING: f64 = 1e-9;
/// Fraction of the work of contact forces that impacts may return if the method is known to do so: forces that act a step late
/// (massless-boundary), nodes that are left inside a surface for a step (film), gaps within the precision of closed contacts
/// (galerkin), and gaps of the previous step that are extrapolated to another step size and may end inside the surface.
const RETURNED: f64 = 0.02;

/// Fraction of all exchanged energy that friction of free bodies may supply when their sliding stops, and that cutting forces may
/// supply when tips reverse. It decreases with the step length.
const STOPPED: f64 = 0.01;

/// Largest losses so far (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LargestLosses {
    friction: f64,
    impact: f64,
    /// Energy that cutting forces have supplied to tips that move backwards, which does not count as cutting (J).
    pub(crate) uncut: f64,
}

persist_fields!(LargestLosses { friction, impact, uncut });

impl LargestLosses {
    /// Returns the energy that friction and impacts have returned since their largest losses (J). Adaptive steps may spend
    /// earlier impact losses, so there the impact loss is compared with zero.
    fn given(&mut self, ledger: &Ledger, pays: bool) -> [f64; 2] {
        let (friction, impact) = (ledger.friction_loss.value(), ledger.impact_loss.value());
        self.friction = self.friction.max(friction);
        self.impact = if pays { 0.0 } else { self.impact.max(impact) };
        [self.friction - friction, self.impact - impact]
    }
}

impl System {
    /// Checks for each set, at the end of a communication step, that friction and impacts have only dissipated energy, except for
    /// rounding and for the energy that the method is known to return.
    ///
    /// # Errors
    /// [`StepFailure::Gives`] if a loss has supplied energy.
    pub(crate) fn check_losses(&mut self) -> Result<(), StepFailure> {
        // Before the first step, the gap of the previous step is unknown too.
        let another_step = self.counted.witnessed > 0;
        let returns = self.settings.scheme.properties().returns_impact_energy
            || !self.settings.solver.properties().complementary
            || another_step;
        let pays = self.settings.scheme.properties().adaptive;
        for (set, (ledger, taken)) in self.counted.ledgers.iter().zip(&mut self.counted.taken).enumerate() {
            let [friction, impact] = taken.given(ledger, pays);
            let exchanged = ledger.scale();
            // A free body slides until it stops at every impact; the energy supplied there is a truncation error as long as it is small.
            let flies = |pair: &ContactPair| self.sets.of(pair.structure()) == set && pair.gap().layout().is_none();
            let stopped = if self.pairs.iter().any(flies) { STOPPED } else { ROUNDING };
            if friction > stopped * exchanged {
                return Err(StepFailure::Gives { set, loss: Loss::Friction, given: friction, exchanged });
            }
            if taken.uncut > STOPPED * exchanged {
                return Err(StepFailure::Gives { set, loss: Loss::Cutting, given: taken.uncut, exchanged });
            }
            let moved = ledger.initial.abs() + ledger.contact_work.value();
            let allowed = if returns { ROUNDING * exchanged + RETURNED * moved } else { ROUNDING * exchanged };
            if impact > allowed {
                return Err(StepFailure::Gives { set, loss: Loss::Impact, given: impact, exchanged: moved });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_compared_with_their_previous_maximum() {
        let (mut taken, mut ledger) = (LargestLosses::default(), Ledger::default());
        for (friction, impact, given, paid) in [
            (2.0, 1.0, [0.0, 0.0], 0.0),
            (-0.5, 0.5, [0.5, 0.0], 0.0),
            (-0.5, -2.0, [1.0, 2.0], 0.5),
            (4.0, 9.0, [0.0, 0.0], 0.0),
        ] {
            ledger.friction_loss.add(friction);
            ledger.impact_loss.add(impact);
            let mut paying = taken;
            assert_eq!(taken.given(&ledger, false).map(f64::to_bits), given.map(f64::to_bits));
            // Adaptive steps may spend earlier impact losses, but no more.
            assert_eq!(paying.given(&ledger, true)[1].max(0.0).to_bits(), f64::to_bits(paid));
        }
    }
}
