//! Counters of the work of time integration.

use tiprub_cosim::persist_fields;

/// Counters of the work of time integration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Effort {
    /// Number of accepted steps.
    pub steps: u64,
    /// Number of steps without a trial, because no contact was possible.
    pub flights: u64,
    /// Number of trials, including accepted ones.
    pub trials: u64,
    /// Number of contact problems for which no solution was found.
    pub unsolved: u64,
    /// Number of trials with a constant force.
    pub constant: u64,
    /// Number of shortest steps that miss the tolerance.
    pub missed: u64,
    /// Number of factorised linear systems.
    pub factorisations: u64,
}

/// Work of adaptive steps since the start, in blocks of eight nodes: for blades on surfaces of revolution, and gaps to smooth rings within
/// steps. It depends on the communication step and on the outputs, so it is not part of a saved state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EvaluatedBlocks {
    /// Number of blocks of eight gaps that were evaluated.
    pub gaps: u64,
    /// Number of blocks of eight displacements or velocities, along one direction, that were computed from the modes.
    pub displacements: u64,
}

impl EvaluatedBlocks {
    /// Counts an evaluation: of `gaps` blocks of gaps, and `displacements` blocks of displacements for each of them.
    #[inline(always)]
    pub(crate) fn count(&mut self, gaps: usize, displacements: usize) {
        self.gaps += gaps as u64;
        self.displacements += (gaps * displacements) as u64;
    }

    /// Adds the work of further steps.
    pub(crate) fn add(&mut self, other: &Self) {
        self.gaps += other.gaps;
        self.displacements += other.displacements;
    }
}

persist_fields!(Effort { steps, flights, trials, unsolved, constant, missed, factorisations });

impl Effort {
    /// Number of attempted steps, with and without contact.
    pub fn tried(&self) -> u64 {
        self.trials + self.flights
    }

    /// Adds the counters of further steps.
    pub(crate) fn add(&mut self, other: &Self) {
        self.steps += other.steps;
        self.flights += other.flights;
        self.trials += other.trials;
        self.unsolved += other.unsolved;
        self.constant += other.constant;
        self.missed += other.missed;
        self.factorisations += other.factorisations;
    }
}
