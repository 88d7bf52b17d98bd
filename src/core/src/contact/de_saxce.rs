//! Contact with full Coulomb friction, stick and slip, on a group of coupled nodes.
//!
//! With b the predicted gap and tangential slip displacements of the step and W the Delassus matrix, u = b + W r and for
//! every contact (G. De Saxcé, Z.-Q. Feng, Math. Comput. Modelling 28, 1998)
//!
//! K* ∋ u + µ‖u_T‖ n ⟂ r ∈ K, K = {‖r_T‖ ≤ µ r_N},
//!
//! which is Signorini's law on u_N and Coulomb's law on u_T. Non-smooth Gauss-Seidel sweeps solve one contact after the other exactly, from
//! the reactions of the last step; they soon find the status of the contacts, but the remaining error falls only as fast as the coupling
//! permits. When the observed rate makes further sweeps more expensive than a few factorisations, a semismooth Newton method on the
//! Alart-Curnier function finishes. If it fails, it follows proximal points to the solution, and if that fails, the sweeps continue, longer
//! and under-relaxed. V. Acary, M. Brémond and O. Huber compare these and other methods (in Advanced Topics in Nonsmooth Dynamics, Springer
//! 2018).
//!
//! For W of full rank a solution exists for every µ; it need not be unique for large µ. For singular W (coincident nodes) one exists if
//! some motion opens all contacts simultaneously with u_N > µ‖u_T‖; its reactions are not unique.

pub(crate) mod linear;
mod newton;
mod one_contact;
mod problem;

use nalgebra::DMatrix;

pub(crate) use self::linear::Eliminate;
use self::newton::Newton;
use self::problem::ScaledProblem;
use super::active_set::SolverOutcome;

/// Residual at which a problem counts as solved, relative to the terms of displacements and forces.
const TOLERANCE: f64 = 1e-12;
/// Largest number of changes between sweeps and Newton's method.
const ROUNDS: u32 = 6;
/// Sweeps of the first round before Newton's method may take over; doubled every round.
const SWEEPS: usize = 6;
/// A round ends after this multiple of its minimum number of sweeps.
const PATIENCE: usize = 40;
/// Sweeps over which the rate of convergence is measured.
const RATE_SPAN: usize = 3;
/// Factorisations a Newton attempt is expected to need.
const EXPECTED_FACTORISATIONS: f64 = 5.0;
/// Arithmetic speed of the factorisation relative to that of the sweeps.
const FACTORISATION_SPEED: f64 = 4.0;
/// Softening about the current reaction in Newton's systems, relative to the unit diagonal.
const PROXIMAL: f64 = 1e-11;
/// First softening of the proximal points, relative to the unit diagonal.
const SOFTENING: f64 = 0.1;
/// Factor by which the softening falls from one proximal point to the next.
const FALL: f64 = 0.1;
/// Factor by which that factor is moved towards 1 and beyond if Newton's method does not follow.
const GENTLER: f64 = 0.3;
/// Flexibilities 1/ρ of Newton's function, tried in turn, relative to the flexibility of each contact.
const STRETCHES: [f64; 3] = [1.0, 0.01, 10.0];
/// Largest number of successive proximal points.
const PROXIMAL_POINTS: usize = 40;
/// Residual to which each proximal point is solved.
const PROXIMAL_TOLERANCE: f64 = 1e-10;
/// Fraction of each change that the sweeps of a round apply.
const RELAXATION: [f64; 3] = [1.0, 0.7, 0.4];
/// Number of sweeps after which the displacements are summed again.
const REFRESH: usize = 10;

/// Scratch of the solver for up to a number of contacts; allocates only when created.
#[derive(Debug, Clone)]
pub struct CoulombSolver {
    capacity: usize,
    /// Delassus matrix W (m/N), filled by the caller: order 3·capacity, of which a solve uses the leading block;
    /// contact by contact (normal, tangent 1, tangent 2). Its symmetric part is positive semidefinite.
    pub delassus: DMatrix<f64>,
    /// Predicted gap and two slip displacements of each contact (m), filled by the caller.
    pub free: Vec<f64>,
    /// Friction coefficient of each contact, filled by the caller.
    pub friction: Vec<f64>,
    /// Reactions (N): warm start on entry (zeros without one), solution on return.
    pub reactions: Vec<f64>,
    /// Corrected gap and slips, free + W·reactions (m), set by the solver.
    pub relative: Vec<f64>,
    problem: ScaledProblem,
    newton: Newton,
    kept: Vec<f64>,
}

impl CoulombSolver {
    /// Allocates for problems of up to `capacity` contacts.
    pub fn new(capacity: usize) -> Self {
        let order = 3 * capacity;
        Self {
            capacity,
            delassus: DMatrix::zeros(order, order),
            free: vec![0.0; order],
            friction: vec![0.0; capacity],
            reactions: vec![0.0; order],
            relative: vec![0.0; order],
            problem: ScaledProblem::new(capacity),
            newton: Newton::new(capacity),
            kept: vec![0.0; order],
        }
    }

    /// Solves for the first `size` contacts. If all methods fail, or the input is not finite, `solved` is false and the reactions are
    /// finite and admissible, but not in equilibrium.
    ///
    /// # Panics
    /// If `size` exceeds the capacity.
    pub fn solve(&mut self, size: usize) -> SolverOutcome {
        assert!(size <= self.capacity, "{size} contacts exceed the solver capacity of {}", self.capacity);
        self.problem.size = size;
        self.newton.factorisations = 0;
        let order = 3 * size;
        let mut run = SolverOutcome { residual: f64::INFINITY, ..SolverOutcome::direct(false, 0) };
        if !self.problem.load(&self.delassus, &self.free, &self.friction, &self.reactions) {
            self.reactions[..order].fill(0.0);
            self.relative[..order].copy_from_slice(&self.free[..order]);
            return run;
        }
        self.iterate(&mut run);
        self.problem.store(&mut self.reactions, &mut self.relative);
        let factorisations = self.newton.factorisations;
        SolverOutcome { solved: run.residual <= TOLERANCE, factorisations, fallback: factorisations > 0, ..run }
    }

    /// Alternates sweeps and Newton attempts; ends with the best reactions found.
    fn iterate(&mut self, run: &mut SolverOutcome) {
        self.problem.refresh();
        run.residual = self.problem.residual();
        if run.residual <= TOLERANCE {
            return;
        }
        for round in 0..ROUNDS {
            self.sweep_round(round, run);
            if run.residual <= TOLERANCE {
                return;
            }
            self.keep();
            self.newton.stretch = 1.0;
            let solved = self.newton.attempt(&mut self.problem, PROXIMAL, TOLERANCE) || {
                self.restore();
                self.proximal_points()
            };
            if solved {
                run.residual = self.problem.residual();
                return;
            }
            self.restore();
        }
        self.problem.refresh();
        run.residual = self.problem.residual();
    }

    /// Solves by proximal points: each problem is softened by α about the reactions of the previous one, which makes it well conditioned; α
    /// falls while Newton's method follows, and otherwise α rises and the method uses another ρ. Returns whether the original problem is
    /// solved.
    fn proximal_points(&mut self) -> bool {
        let (mut softening, mut ratio, mut failures) = (SOFTENING, FALL, 0);
        for _ in 0..PROXIMAL_POINTS {
            let next = (ratio * softening).max(PROXIMAL);
            self.keep();
            self.problem.soften(next);
            self.newton.stretch = STRETCHES[failures % STRETCHES.len()];
            let followed = self.newton.attempt(&mut self.problem, PROXIMAL, PROXIMAL_TOLERANCE);
            self.problem.harden();
            if followed {
                (softening, ratio, failures) = (next, (GENTLER * ratio).max(FALL), 0);
                self.problem.refresh();
                if self.problem.residual() <= TOLERANCE {
                    return true;
                }
            } else {
                self.restore();
                failures += 1;
                ratio = if ratio < GENTLER { ratio.sqrt() } else { ratio / GENTLER };
            }
        }
        false
    }

    fn keep(&mut self) {
        let order = self.problem.order();
        self.kept[..order].copy_from_slice(&self.problem.reaction[..order]);
    }

    fn restore(&mut self) {
        let order = self.problem.order();
        self.problem.reaction[..order].copy_from_slice(&self.kept[..order]);
        self.problem.refresh();
    }

    /// Sweeps until the problem is solved, or until Newton's method is likely to be cheaper.
    fn sweep_round(&mut self, round: u32, run: &mut SolverOutcome) {
        let least = SWEEPS << round;
        let relaxation = RELAXATION[round as usize % RELAXATION.len()];
        let mut history = [f64::INFINITY; RATE_SPAN];
        for count in 1..=PATIENCE * least {
            self.problem.sweep(count % 2 == 0, relaxation);
            run.sweeps += 1;
            if count % REFRESH == 0 || count <= 2 {
                self.problem.refresh();
            }
            run.residual = self.problem.residual();
            if run.residual <= TOLERANCE {
                self.problem.refresh();
                run.residual = self.problem.residual();
                if run.residual <= TOLERANCE {
                    return;
                }
            }
            let before = std::mem::replace(&mut history[count % RATE_SPAN], run.residual);
            if count >= least && self.remaining_sweeps(before, run.residual) > self.newton_in_sweeps() {
                return;
            }
        }
    }

    /// Estimates the number of remaining sweeps at the rate of the last `RATE_SPAN`.
    fn remaining_sweeps(&self, before: f64, now: f64) -> f64 {
        let rate = libm::log(before / now) / RATE_SPAN as f64;
        if rate > 0.0 { libm::log(now / TOLERANCE) / rate } else { f64::INFINITY }
    }

    /// Cost of a Newton attempt as a number of sweeps.
    fn newton_in_sweeps(&self) -> f64 {
        let active = 3.0 * self.problem.count_carrying() as f64;
        let factorisation = active * active * active / 3.0 / FACTORISATION_SPEED + 3.0 * active * active;
        let sweep = active * self.problem.order() as f64 + 60.0 * active;
        EXPECTED_FACTORISATIONS * factorisation / sweep.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::InstructionSet;

    /// Twenty contacts on forty modes, for all instruction sets.
    #[test]
    fn instruction_sets_give_the_same_bits() {
        let phase =
            |row: usize, mode: usize| libm::sin(1.7 * (row * row) as f64 + 0.9 * (mode * row) as f64 + mode as f64);
        let shapes = DMatrix::from_fn(60, 70, phase);
        let mut wide = CoulombSolver::new(20);
        wide.delassus = &shapes * shapes.transpose() * 1e-9;
        for k in 0..60 {
            wide.free[k] = 1e-6 * (libm::sin(3.1 * (k * k) as f64) - if k % 3 == 0 { 0.5 } else { 0.0 });
        }
        wide.friction.fill(0.6);
        let mut baseline = wide.clone();
        baseline.problem.instructions = InstructionSet::Baseline;
        let outcome = wide.solve(20);
        assert!(outcome.solved && outcome.fallback, "{outcome:?}");
        assert_eq!(baseline.solve(20), outcome);
        for k in 0..60 {
            assert_eq!(baseline.reactions[k].to_bits(), wide.reactions[k].to_bits());
        }
    }
}
