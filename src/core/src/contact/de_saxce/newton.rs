//! Semismooth Newton method on the function of P. Alart and A. Curnier (Comput. Methods Appl. Mech. Eng. 92, 1991).
//!
//! With v = r − ρu (ρ the inverse flexibility of the contact) the law is F(r) = 0, with F_N = r_N − [v_N]₊ and F_T = r_T − P(v_T), where P
//! is the projection on the disk of radius µ[v_N]₊. Contacts with v_N ≤ 0 are open: their step leads to r = 0. The linearised rows of the
//! others, for the next reaction r⁺ = r + d, are
//!
//! * normal: W_N r⁺ = −b_N;
//! * sticking (‖v_T‖ ≤ µ v_N): W_T r⁺ = −b_T;
//! * sliding: (I − M) r⁺_T + ρ M W_T r⁺ − µ t r⁺_N = −ρ M b_T with t = v_T/‖v_T‖, M = µ v_N/‖v_T‖ (I − t tᵀ).
//!
//! A proximal term ε(r⁺ − r) in the displacement keeps redundant contacts regular and does not change the solution.

use super::linear::Eliminate;
use super::one_contact::length;
use super::problem::ScaledProblem;

/// Largest number of steps of one attempt.
const STEPS: usize = 20;
/// Largest number of halvings of a step.
const HALVINGS: usize = 12;
/// Number of full steps accepted in spite of a larger merit: ‖F‖ is not smooth, and may have local minima.
const UPHILL: usize = 6;
/// A step may exceed the last merit as long as it stays below the largest of this many merits.
const MEMORY: usize = 4;
/// Required decrease per length of step.
const DECREASE: f64 = 1e-4;

/// Scratch of Newton's method.
#[derive(Debug, Clone)]
pub(super) struct Newton {
    matrix: Vec<f64>,
    right: Vec<f64>,
    direction: Vec<f64>,
    /// W · direction.
    moved: Vec<f64>,
    start_reaction: Vec<f64>,
    start_relative: Vec<f64>,
    active: Vec<usize>,
    /// Number of systems factorised since the start of the solve.
    pub(super) factorisations: usize,
    /// Factor on the flexibilities 1/ρ, which changes the path of the iteration but not the solution.
    pub(super) stretch: f64,
}

impl Newton {
    pub(super) fn new(capacity: usize) -> Self {
        let order = 3 * capacity;
        Self {
            matrix: vec![0.0; order * order],
            right: vec![0.0; order],
            direction: vec![0.0; order],
            moved: vec![0.0; order],
            start_reaction: vec![0.0; order],
            start_relative: vec![0.0; order],
            active: Vec::with_capacity(capacity),
            factorisations: 0,
            stretch: 1.0,
        }
    }

    /// Takes Newton steps from the reactions of the problem until the residual is below the tolerance. If it fails, the reactions are those
    /// of the last step, projected on the cones.
    pub(super) fn attempt(&mut self, problem: &mut ScaledProblem, proximal: f64, tolerance: f64) -> bool {
        let mut memory = [0.0_f64; MEMORY];
        memory[0] = merit(problem, self.stretch);
        let mut uphill = 0;
        for step in 0..STEPS {
            if !self.direct(problem, proximal) {
                break;
            }
            let allowed = memory.iter().fold(0.0, |most: f64, value| most.max(*value));
            let reached = self.search(problem, allowed).unwrap_or_else(|| {
                uphill += 1;
                self.move_along(problem, 1.0)
            });
            if uphill > UPHILL {
                break;
            }
            memory[(step + 1) % MEMORY] = reached;
            if self.finished(problem, tolerance) {
                return true;
            }
        }
        self.close(problem);
        false
    }

    /// Projects a copy on the cones, and keeps it if it solves the problem.
    fn finished(&mut self, problem: &mut ScaledProblem, tolerance: f64) -> bool {
        let order = problem.order();
        self.start_reaction[..order].copy_from_slice(&problem.reaction[..order]);
        self.start_relative[..order].copy_from_slice(&problem.relative[..order]);
        self.close(problem);
        if problem.residual() <= tolerance {
            return true;
        }
        problem.reaction[..order].copy_from_slice(&self.start_reaction[..order]);
        problem.relative[..order].copy_from_slice(&self.start_relative[..order]);
        false
    }

    fn close(&self, problem: &mut ScaledProblem) {
        for contact in 0..problem.size {
            problem.project(contact);
        }
        problem.refresh();
    }

    /// Computes the Newton direction at the current reactions. Returns false if the system is singular.
    fn direct(&mut self, problem: &ScaledProblem, proximal: f64) -> bool {
        self.active.clear();
        self.active.extend((0..problem.size).filter(|contact| trial(problem, self.stretch, *contact)[0] > 0.0));
        self.assemble(problem, proximal);
        let order = 3 * self.active.len();
        let mut regular = false;
        problem.instructions.run(Eliminate {
            order,
            matrix: &mut self.matrix[..order * order],
            right: &mut self.right[..order],
            regular: &mut regular,
        });
        self.factorisations += 1;
        for k in 0..problem.order() {
            self.direction[k] = -problem.reaction[k];
        }
        for (local, contact) in self.active.iter().enumerate() {
            for i in 0..3 {
                self.direction[3 * contact + i] += self.right[3 * local + i];
            }
        }
        regular
    }

    fn assemble(&mut self, problem: &ScaledProblem, proximal: f64) {
        let order = 3 * self.active.len();
        for (local, contact) in self.active.iter().enumerate() {
            for i in 0..3 {
                self.right[3 * local + i] =
                    proximal * problem.reaction[3 * contact + i] - problem.free[3 * contact + i];
            }
        }
        for (column, source) in self.active.iter().enumerate() {
            for j in 0..3 {
                let start = (3 * column + j) * order;
                for (row, target) in self.active.iter().enumerate() {
                    for i in 0..3 {
                        self.matrix[start + 3 * row + i] = problem.entry(3 * target + i, 3 * source + j);
                    }
                }
                self.matrix[start + 3 * column + j] += proximal;
            }
        }
        for local in 0..self.active.len() {
            let v = trial(problem, self.stretch, self.active[local]);
            let limit = problem.friction[self.active[local]] * v[0];
            if length([v[1], v[2]]) > limit || limit == 0.0 {
                let (_, tangent) = problem.flexibility(self.active[local]);
                self.slide(local, v, limit, problem.friction[self.active[local]], tangent * self.stretch);
            }
        }
    }

    /// Converts the sticking rows of a contact to sliding ones.
    fn slide(&mut self, local: usize, v: [f64; 3], limit: f64, friction: f64, flexibility: f64) {
        let order = 3 * self.active.len();
        let size = length([v[1], v[2]]);
        let t = if size > 0.0 { [v[1] / size, v[2] / size] } else { [0.0; 2] };
        let weight = if size > 0.0 { limit / size } else { 0.0 };
        let m = [
            [weight * (1.0 - t[0] * t[0]), -weight * t[0] * t[1]],
            [-weight * t[1] * t[0], weight * (1.0 - t[1] * t[1])],
        ];
        let row = 3 * local + 1;
        let project = |pair: [f64; 2]| {
            let p = [pair[0] / flexibility, pair[1] / flexibility];
            [m[0][0] * p[0] + m[0][1] * p[1], m[1][0] * p[0] + m[1][1] * p[1]]
        };
        for column in self.matrix[..order * order].chunks_exact_mut(order) {
            [column[row], column[row + 1]] = project([column[row], column[row + 1]]);
        }
        [self.right[row], self.right[row + 1]] = project([self.right[row], self.right[row + 1]]);
        for i in 0..2 {
            self.matrix[3 * local * order + row + i] -= friction * t[i];
            for j in 0..2 {
                let identity = if i == j { 1.0 } else { 0.0 };
                self.matrix[(row + j) * order + row + i] += identity - m[i][j];
            }
        }
    }

    /// Searches along the direction as far as the merit permits; returns the merit reached.
    fn search(&mut self, problem: &mut ScaledProblem, allowed: f64) -> Option<f64> {
        let order = problem.order();
        self.moved[..order].fill(0.0);
        problem.add_product(&self.direction[..order], &mut self.moved[..order]);
        self.start_reaction[..order].copy_from_slice(&problem.reaction[..order]);
        self.start_relative[..order].copy_from_slice(&problem.relative[..order]);
        let mut step = 1.0;
        for _ in 0..=HALVINGS {
            let reached = self.move_along(problem, step);
            if reached <= (1.0 - DECREASE * step) * allowed {
                return Some(reached);
            }
            step *= 0.5;
        }
        None
    }

    /// Moves a fraction of the direction from the start of the step; returns the merit there.
    fn move_along(&self, problem: &mut ScaledProblem, step: f64) -> f64 {
        for k in 0..problem.order() {
            problem.reaction[k] = self.start_reaction[k] + step * self.direction[k];
            problem.relative[k] = self.start_relative[k] + step * self.moved[k];
        }
        merit(problem, self.stretch)
    }
}

/// v = r − ρu of one contact.
fn trial(problem: &ScaledProblem, stretch: f64, contact: usize) -> [f64; 3] {
    let k = 3 * contact;
    let (normal, tangent) = problem.flexibility(contact);
    let (normal, tangent) = (stretch * normal, stretch * tangent);
    [
        problem.reaction[k] - problem.relative[k] / normal,
        problem.reaction[k + 1] - problem.relative[k + 1] / tangent,
        problem.reaction[k + 2] - problem.relative[k + 2] / tangent,
    ]
}

/// ‖F‖².
fn merit(problem: &ScaledProblem, stretch: f64) -> f64 {
    let mut sum = 0.0;
    for contact in 0..problem.size {
        let v = trial(problem, stretch, contact);
        let limit = problem.friction[contact] * v[0].max(0.0);
        let size = length([v[1], v[2]]);
        let factor = if size <= limit { 1.0 } else { limit / size };
        let r = &problem.reaction[3 * contact..3 * contact + 3];
        let f = [r[0] - v[0].max(0.0), r[1] - factor * v[1], r[2] - factor * v[2]];
        sum += f[0] * f[0] + f[1] * f[1] + f[2] * f[2];
    }
    sum
}
