//! Two-step recurrences: prediction, gaps, correction (section 4.3 of the paper), and the terms of the energy ledger.

use super::Stepper;
use crate::geometry::PrescribedMotion;
use crate::system::{Bodies, GroupSolution, StepFailure, System};

/// Denormals are flushed every this many steps.
const FLUSH_EVERY: u64 = 512;

/// All recurrences: central differences, modal-exact and massless-boundary. Their coefficients are part of the modes.
#[derive(Debug, Clone)]
pub struct Recurrence;

impl Stepper for Recurrence {
    fn step(&mut self, system: &mut System, drives: &[PrescribedMotion]) -> Result<(), StepFailure> {
        let scheme = system.settings.scheme;
        // Eq. 9: predict all structures without new contact forces.
        for structure in &mut system.structures {
            structure.predict(scheme);
        }
        system.check_travel()?;
        // Eqs 3 and 10: gaps at the predicted positions.
        let step = system.step_size();
        for (pair, drive) in system.pairs.iter_mut().zip(drives) {
            pair.move_to(drive, step);
        }
        system.find_near_gaps();
        system.check_edges()?;
        // Eq. 11: contact forces that remove the penetration, and their effects, group by group.
        system.retire_events();
        let (structures, pairs, delays_contact) =
            (&mut system.structures[..], &system.pairs[..], scheme.properties().delays_contact);
        let mut bodies = Bodies { structures, pairs, delays_contact };
        for (group, ledger) in system.groups.iter_mut().zip(&mut system.counted.ledgers) {
            let (events, factorisations) = (&mut system.events.now, &mut system.counted.factorisations);
            group.solve(
                &mut bodies,
                &mut GroupSolution { events, factorisations, wear_energy: &mut ledger.wear_energy },
            )?;
        }
        system.enter_work()?;
        system.remove_cut();
        system.count_pulling();
        system.counted.steps += 1;
        system.counted.effort.steps += 1;
        system.counted.effort.trials += 1;
        if system.counted.steps.is_multiple_of(FLUSH_EVERY) {
            system.structures.iter_mut().for_each(|structure| structure.modes_mut().flush());
        }
        Ok(())
    }
}
