//! What contact cannot do: friction takes energy, and so do impacts.
//!
//! A law that slides in a direction given beforehand takes too, as long as tips slide that way. Where a tip vibrates faster than its rotor
//! turns, the same force feeds the vibration, and the ledger closes over nonsense. Nodes that are found inside a surface, and forces that
//! act late, give what an impact took.
//!
//! At every communication point both are held against the most that they had taken before.

use super::{ContactPair, StepFailure, System};
use crate::ledger::Ledger;
use crate::persist::persist_fields;
use crate::settings::{Scheme, Solver};

/// Loss of energy of a vibration in contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loss {
    /// Friction along the way.
    Friction,
    /// Gaps that close.
    Impact,
    /// Cutting of a coating, whose force is the same forwards and backwards.
    Cutting,
}

/// Rounding of the ledger, as a share of all energy exchanged: its residual is held to as much by every test.
const ROUNDING: f64 = 1e-9;
/// Share of the work of contact forces on the structures that impacts may give back where the method is known for it: forces that act a step
/// late (massless-boundary), nodes that are left inside a surface for a step (film), gaps within the precision of closed contacts (galerkin),
/// gaps of the step before that are continued to another step size along their slope, and may end inside the surface.
const RETURNED: f64 = 0.02;

/// Share of all energy exchanged that friction of bodies that fly may give where their sliding stops, and that forces of cutting may give where
/// tips turn round: it falls with the step.
const STOPPED: f64 = 0.01;

/// Most that has been taken so far (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LargestLosses {
    friction: f64,
    impact: f64,
    /// Energy that cutting forces have given to tips that move backwards, which does not count as cutting (J).
    pub(super) uncut: f64,
}

persist_fields!(LargestLosses { friction, impact, uncut });

impl LargestLosses {
    /// Returns the energy that friction and impacts have given back of their largest losses (J). Adaptive steps pay impacts from earlier losses:
    /// there the comparison is with zero.
    fn given(&mut self, ledger: &Ledger, pays: bool) -> [f64; 2] {
        let (friction, impact) = (ledger.friction_loss.value(), ledger.impact_loss.value());
        self.friction = self.friction.max(friction);
        self.impact = if pays { 0.0 } else { self.impact.max(impact) };
        [self.friction - friction, self.impact - impact]
    }
}

impl System {
    /// Whether friction and impacts only took energy, set by set, up to rounding and what the method is known to return; at the end of a
    /// communication step.
    ///
    /// # Errors
    /// They did not: [`StepFailure::Gives`].
    pub(super) fn check_losses(&mut self) -> Result<(), StepFailure> {
        // Before the first step the gap of the step before is not known either.
        let another_step = self.counted.witnessed > 0;
        let returns = self.settings.scheme.is_massless() || self.settings.solver == Solver::Film || another_step;
        let pays = self.settings.scheme == Scheme::Galerkin;
        for (set, (ledger, taken)) in self.counted.ledgers.iter().zip(&mut self.counted.taken).enumerate() {
            let [friction, impact] = taken.given(ledger, pays);
            let exchanged = ledger.scale();
            // What flies slides until it stops, at every impact: what that gives is an error of the step, as long as it is small.
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
            // Steps by a tolerance may spend what impacts have left, and no more.
            assert_eq!(paying.given(&ledger, true)[1].max(0.0).to_bits(), f64::to_bits(paid));
        }
    }
}
