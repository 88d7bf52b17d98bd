//! One internal step: prediction, gaps, correction (section 4.3 of the paper), and the terms of the energy ledger.

use crate::geometry::PrescribedMotion;
use crate::scene::method::Scheme;
use crate::system::{Bodies, GroupSolution, StepFailure, System};

/// Denormals are flushed every this many steps.
const FLUSH_EVERY: u64 = 512;

impl System {
    /// Advances the system by one internal step to the time described by `drives`, one per contact pair.
    ///
    /// # Errors
    /// A [`StepFailure`]; the state is undefined afterwards.
    pub fn step(&mut self, drives: &[PrescribedMotion]) -> Result<(), StepFailure> {
        if self.settings.scheme == Scheme::Galerkin {
            return self.march(drives);
        }
        let (acts_later, ledger) = (self.settings.scheme.acts_later(), self.settings.ledger);
        // Eq. 9: predict all structures without new contact forces.
        for structure in &mut self.structures {
            structure.predict(acts_later, ledger);
        }
        self.check_travel()?;
        // Eqs 3 and 10: gaps at the predicted positions.
        let step = self.step_size();
        for (pair, drive) in self.pairs.iter_mut().zip(drives) {
            pair.move_to(drive, step);
        }
        self.find_gaps(true);
        self.check_edges()?;
        // Eq. 11: contact forces that remove the penetration, and their effects, group by group.
        self.retire_events();
        let mut bodies = Bodies { structures: &mut self.structures, pairs: &self.pairs, acts_later, ledger };
        for (group, ledger) in self.groups.iter_mut().zip(&mut self.counted.ledgers) {
            let (events, factorisations) = (&mut self.events.now, &mut self.counted.factorisations);
            group.solve(
                &mut bodies,
                &mut GroupSolution { events, factorisations, wear_energy: &mut ledger.wear_energy },
            )?;
        }
        self.enter_work()?;
        self.remove_cut();
        self.count_pulling();
        self.counted.steps += 1;
        if self.counted.steps.is_multiple_of(FLUSH_EVERY) {
            self.structures.iter_mut().for_each(|structure| structure.modes_mut().flush());
        }
        Ok(())
    }

    /// Finds the gap of every node and the smallest gap of each lane. If `warm`, the search for closest points starts from those
    /// of the previous step.
    pub(crate) fn find_gaps(&mut self, warm: bool) {
        for index in 0..self.pairs.len() {
            self.pairs[index].find_gaps(&mut self.structures, warm);
        }
        for structure in &mut self.structures {
            structure.find_lowest();
        }
    }

    /// Makes the contacts of the last step those of the previous step.
    fn retire_events(&mut self) {
        self.events.shift();
        self.events.now.clear();
        if self.groups.iter().any(|group| group.law().starts_from_forces()) {
            self.structures.iter_mut().for_each(|structure| structure.history.keep_forces());
        }
        for event in &self.events.before {
            self.structures[event.structure].forget_force(event.node, event.sector);
        }
    }
}
