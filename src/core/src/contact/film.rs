//! Forward-increment Lagrange multipliers (eqs 10-11 of the paper): equality on the nodes that penetrate in the prediction.

use super::sliding::SlidingRule;
use crate::contact::active_set::{ContactSolver, SolverOutcome};

/// Penetration is detected once; neither a negative λ nor a penetration caused elsewhere is checked again.
#[derive(Debug, Clone)]
pub(crate) struct Film;

impl SlidingRule for Film {
    const IS_ITERATIVE: bool = false;

    fn solve(solver: &mut ContactSolver) -> SolverOutcome {
        solver.film()
    }
}
