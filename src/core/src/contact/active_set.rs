//! The unilateral contact problem of one step for one group of coupled nodes.
//!
//! With g the predicted gaps and W = C_Nᵀ A⁻¹ C_NT the Delassus matrix (normal gap of node i per multiplier of
//! node j, friction included), the corrected gaps are g + Wλ.
//!
//! * [`ContactSolver::film`]: the paper's rule (eqs 10-11). Penetration is detected once; equality is enforced on that set, and
//!   neither a negative λ nor a penetration caused elsewhere is checked again.
//! * [`ContactSolver::lcp`]: 0 ≤ λ ⟂ g + Wλ ≥ 0 on all nodes by block principal pivoting, started from the set of the last
//!   step. When the number of infeasible nodes stops falling it continues with Murty's least-index rule, which is finite for
//!   every P-matrix (J. J. Júdice, F. M. Pires, Computers & Operations Research 21, 1994). With more than a few nodes finite
//!   can mean 2ⁿ, and the violated contacts are driven to closure one by one instead. All of this needs a P-matrix. Without
//!   friction W may be singular instead, for example with more contacts than modes; then the solution is approximated
//!   iteratively (`contact::proximal`) if those rules do not end.

mod drive;
mod elimination;

use nalgebra::DMatrix;

use super::proximal::{ROUNDS, Yielding};
use crate::math::simd::InstructionSet;

/// Pivots below this fraction of the diagonal entry of their node, or of their column, belong to redundant contacts
/// (coincident nodes).
pub(super) const REDUNDANT_PIVOT: f64 = 1e-12;
/// Gaps and multipliers within this fraction of their scale count as zero.
const ZERO_FRACTION: f64 = 1e-13;
/// Number of block exchanges without progress after which a method takes over that always terminates.
pub(super) const PATIENCE: usize = 8;

/// Largest problem on which the least-index rule may try every active set.
const ENUMERABLE: usize = 14;
/// Largest number of exchanges of larger problems before contacts are driven one by one; about ten are needed.
const BLOCK_LIMIT: usize = 50;
/// Factorisations allowed for the iterative approximation of a solution, as a multiple of those for driving.
const APPROACH: usize = 4;
/// Largest problem with an unreduced limit of factorisations for driving.
const FULL_PATIENCE: usize = 256;

/// Systems of at least this order are processed column by column, in storage order.
const LARGE: usize = 32;

/// Effort of one solution, and whether it succeeded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SolverOutcome {
    /// True if the complementarity conditions hold.
    pub solved: bool,
    /// Number of linear systems factorised.
    pub factorisations: usize,
    /// Number of Gauss-Seidel sweeps (Coulomb solver only).
    pub sweeps: usize,
    /// Largest residual, relative to the terms that it is computed from (Coulomb solver only; 0 otherwise).
    pub residual: f64,
    /// True if Newton's method was needed after the sweeps (Coulomb solver only).
    pub fallback: bool,
}

impl SolverOutcome {
    /// Creates the outcome of a direct method.
    pub(super) fn direct(solved: bool, factorisations: usize) -> Self {
        Self { solved, factorisations, sweeps: 0, residual: 0.0, fallback: false }
    }
}

/// Scratch for problems up to a largest size; allocates only when created. Arrays have the largest size, and a solve uses their first
/// `size` entries (the leading block of the matrix).
#[derive(Debug, Clone)]
pub struct ContactSolver {
    /// Number of nodes of the current problem.
    pub(super) size: usize,
    /// Delassus matrix (m/N), filled by the caller.
    pub delassus: DMatrix<f64>,
    /// True if the symmetric part of the matrix is positive semidefinite, as without friction: a solution is found whenever there is one.
    /// Set by the caller; false at first.
    pub monotone: bool,
    /// Predicted gaps (m), filled by the caller; corrected gaps on return.
    pub gaps: Vec<f64>,
    /// Multipliers (N), set by the solvers; 0 beyond the size.
    pub multipliers: Vec<f64>,
    /// Active set: start and result of the complementarity solver; false beyond the size.
    pub active: Vec<bool>,
    factor: DMatrix<f64>,
    /// Diagonal of W_AA in the order of `members`, without sign.
    diagonal: Vec<f64>,
    /// True if `factor` is the factor of all `members` of the current matrix.
    has_factor: bool,
    /// True if the next solution may start with this factor.
    is_factor_reusable: bool,
    /// Remaining matrix after elimination.
    remaining: Vec<f64>,
    right: Vec<f64>,
    members: Vec<usize>,
    /// True for nodes that are among `members`; filled if some active node is not.
    enforced: Vec<bool>,
    corrected: Vec<f64>,
    /// Multipliers and gaps while contacts are driven to closure.
    pressure: Vec<f64>,
    slack: Vec<f64>,
    yielding: Yielding,
    instructions: InstructionSet,
}

impl ContactSolver {
    /// Allocates scratch for problems of up to `size` nodes, and sets the size to it.
    pub fn new(size: usize) -> Self {
        Self {
            size,
            delassus: DMatrix::zeros(size, size),
            monotone: false,
            gaps: vec![0.0; size],
            multipliers: vec![0.0; size],
            active: vec![false; size],
            factor: DMatrix::zeros(size, size),
            diagonal: vec![0.0; size],
            has_factor: false,
            is_factor_reusable: false,
            remaining: vec![0.0; size],
            right: vec![0.0; size],
            members: Vec::with_capacity(size),
            enforced: vec![false; size],
            corrected: vec![0.0; size],
            pressure: vec![0.0; size],
            slack: vec![0.0; size],
            yielding: Yielding::new(size),
            instructions: InstructionSet::detect(),
        }
    }

    /// Sets the number of nodes of the next problems. Does not allocate.
    ///
    /// # Panics
    /// If `size` exceeds the capacity.
    pub fn set_size(&mut self, size: usize) {
        let capacity = self.gaps.len();
        assert!(size <= capacity, "{size} contact nodes exceed the solver capacity of {capacity}");
        self.size = size;
        (self.has_factor, self.is_factor_reusable) = (false, false);
        self.multipliers[size..].fill(0.0);
        self.active[size..].fill(false);
    }

    /// Prepares a problem that differs from the last one in its gaps only. Returns false if the matrix must be filled in again: if there is
    /// no factor of all active contacts, or if the last solution changed the matrix.
    pub(super) fn begin_with_same_matrix(&mut self) -> bool {
        self.is_factor_reusable = self.has_factor;
        self.has_factor
    }

    /// Solves by the paper's correction (eqs 10-11): equality on the nodes that penetrate in the prediction.
    pub fn film(&mut self) -> SolverOutcome {
        for node in 0..self.size {
            self.active[node] = self.gaps[node] < 0.0;
        }
        self.solve_active(None);
        self.correct_gaps();
        std::mem::swap(&mut self.gaps, &mut self.corrected);
        SolverOutcome::direct(true, 1)
    }

    /// Solves the complementarity problem on all nodes; `active` is the initial guess and contains the resulting set on return.
    pub fn lcp(&mut self) -> SolverOutcome {
        let scale = self.gaps[..self.size].iter().fold(0.0, |largest: f64, gap| largest.max(gap.abs()));
        self.yielding.softened = false;
        let mut outcome = self.exchange(scale);
        if !outcome.solved {
            let driven = self.drive_all(scale, drive_limit(self.size));
            outcome = SolverOutcome::direct(driven.solved, outcome.factorisations + driven.factorisations);
        }
        self.has_factor &= !self.yielding.softened;
        if !outcome.solved && self.monotone {
            let approached = self.approach(scale);
            outcome = SolverOutcome::direct(approached.solved, outcome.factorisations + approached.factorisations);
            self.has_factor = false;
        }
        outcome
    }

    /// Exchanges blocks, and uses the least-index rule if they make no progress.
    fn exchange(&mut self, scale: f64) -> SolverOutcome {
        for node in 0..self.size {
            self.active[node] |= self.gaps[node] < 0.0;
        }
        let limit = exchange_limit(self.size, self.monotone);
        let (mut best, mut patience) = (usize::MAX, PATIENCE);
        let mut factorisations = 0;
        for _ in 0..limit {
            if !self.solve_with_factor() {
                self.solve_active(None);
                factorisations += 1;
            }
            self.correct_gaps();
            let largest =
                self.multipliers[..self.size].iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
            let (count, last) = self.count_infeasible(scale, largest);
            if count == 0 && !self.yielding.softened && self.redundant_contact_violated(scale) {
                self.yielding.soften(&mut self.delassus, self.size);
                (best, patience) = (usize::MAX, PATIENCE);
                continue;
            }
            if count == 0 {
                return SolverOutcome::direct(self.settle(scale), factorisations);
            }
            if count < best {
                (best, patience) = (count, PATIENCE);
            } else {
                patience = patience.saturating_sub(1);
            }
            if patience > 0 {
                self.exchange_all(scale, largest);
            } else {
                self.active[last] = !self.active[last];
            }
        }
        SolverOutcome::direct(false, factorisations)
    }

    /// Solves iteratively from the predicted gaps, for any rank of W. Fails if no motion opens all contacts.
    fn approach(&mut self, gap_scale: f64) -> SolverOutcome {
        let (size, limit, mut factorisations) = (self.size, APPROACH * drive_limit(self.size), 0);
        self.yielding.keep(&self.delassus, &self.gaps[..size], gap_scale);
        for _ in 0..ROUNDS {
            self.yielding.pose(&mut self.delassus, &mut self.gaps[..size]);
            let driven = self.drive_all(gap_scale, limit.saturating_sub(factorisations).min(drive_limit(size)));
            factorisations += driven.factorisations;
            if self.yielding.advance(driven.solved, gap_scale, size, |node| self.multipliers[node]) {
                for node in (0..size).filter(|node| !self.active[*node]) {
                    self.gaps[node] -= self.yielding.yielded(node, 0.0);
                }
                return SolverOutcome::direct(true, factorisations);
            }
        }
        SolverOutcome::direct(false, factorisations)
    }

    fn infeasible(&self, node: usize, gap_scale: f64, multiplier_scale: f64) -> bool {
        if self.active[node] {
            self.multipliers[node] < -ZERO_FRACTION * multiplier_scale
        } else {
            self.corrected[node] < -ZERO_FRACTION * gap_scale
        }
    }

    fn count_infeasible(&self, gap_scale: f64, multiplier_scale: f64) -> (usize, usize) {
        let infeasible = (0..self.size).filter(|node| self.infeasible(*node, gap_scale, multiplier_scale));
        infeasible.fold((0, 0), |(count, _), node| (count + 1, node))
    }

    fn exchange_all(&mut self, gap_scale: f64, multiplier_scale: f64) {
        for node in 0..self.size {
            if self.infeasible(node, gap_scale, multiplier_scale) {
                self.active[node] = !self.active[node];
            }
        }
    }

    /// Returns whether a contact that was omitted as redundant is not closed by the contacts on which it was assumed to depend.
    fn redundant_contact_violated(&mut self, gap_scale: f64) -> bool {
        let active = self.active[..self.size].iter().filter(|active| **active).count();
        if active == self.members.len() {
            return false;
        }
        self.enforced.fill(false);
        for member in &self.members {
            self.enforced[*member] = true;
        }
        let left_out = |node: &usize| self.active[*node] && !self.enforced[*node];
        (0..self.size).filter(left_out).any(|node| self.corrected[node] < -ZERO_FRACTION * gap_scale)
    }

    /// Removes rounding from a solution: λ ≥ 0 exactly, gap ≥ 0 exactly. Returns false and does nothing if there is no solution.
    fn settle(&mut self, gap_scale: f64) -> bool {
        if self.yielding.is_pinched(self.size, gap_scale, |node| self.multipliers[node]) {
            return false;
        }
        for node in 0..self.size {
            self.multipliers[node] = self.multipliers[node].max(0.0);
            self.active[node] = self.multipliers[node] > 0.0;
            // A redundant contact without force may be open.
            self.gaps[node] = if self.active[node] { 0.0 } else { self.corrected[node].max(0.0) };
        }
        true
    }

    fn correct_gaps(&mut self) {
        let size = self.size;
        // The sum of an iterator also starts from −0.
        self.corrected[..size].fill(-0.0);
        for member in &self.members {
            let (multiplier, column) = (self.multipliers[*member], self.delassus.column(*member));
            for (moved, flexibility) in self.corrected[..size].iter_mut().zip(column.iter()) {
                *moved += flexibility * multiplier;
            }
        }
        for (corrected, gap) in self.corrected[..size].iter_mut().zip(&self.gaps) {
            *corrected += gap;
        }
    }

    /// Solves W_AA λ_A = −g_A on the active set by elimination with diagonal pivoting; λ = 0 elsewhere. A P-matrix needs no other pivots; a
    /// vanishing pivot marks a contact that the others already enforce, whose λ stays 0. With a driven node the right-hand side is −W_Ad
    /// instead: the derivative of λ_A with respect to the multiplier of that node.
    fn solve_active(&mut self, driven: Option<usize>) {
        self.members.clear();
        self.members.extend((0..self.size).filter(|node| self.active[*node]));
        self.multipliers.fill(0.0);
        let count = self.members.len();
        for (row, i) in self.members.iter().enumerate() {
            self.right[row] = -driven.map_or(self.gaps[*i], |driven| self.delassus[(*i, driven)]);
        }
        let order = self.delassus.nrows();
        let columns = self.factor.as_mut_slice().chunks_exact_mut(order);
        for (column, j) in columns.zip(&self.members) {
            let flexibility = &self.delassus.as_slice()[j * order..][..order];
            for (entry, i) in column.iter_mut().zip(&self.members) {
                *entry = flexibility[*i];
            }
        }
        let rank = self.eliminate(count);
        self.has_factor = rank == count;
        self.substitute(rank);
        self.members.truncate(rank);
    }

    /// Solves with the factor of the last solution, with the same bits as [`ContactSolver::solve_active`] without a driven node. Returns
    /// false and solves nothing if this factor is not reusable or belongs to another active set.
    fn solve_with_factor(&mut self) -> bool {
        let count = self.members.len();
        if !std::mem::take(&mut self.is_factor_reusable)
            || self.active[..self.size].iter().filter(|active| **active).count() != count
            || self.members.iter().any(|node| !self.active[*node])
        {
            return false;
        }
        self.multipliers.fill(0.0);
        for (right, node) in self.right.iter_mut().zip(&self.members) {
            *right = -self.gaps[*node];
        }
        self.reduce_right(count);
        self.substitute(count);
        true
    }

    /// Finds the multipliers of the first `rank` members from the reduced right-hand side.
    fn substitute(&mut self, rank: usize) {
        let order = self.factor.nrows();
        for row in (0..rank).rev() {
            let factors = self.factor.as_slice()[row..].iter().step_by(order);
            let known: f64 = factors.zip(&self.right[..rank]).skip(row + 1).map(|(f, known)| f * known).sum();
            self.right[row] = (self.right[row] - known) / self.factor[(row, row)];
            self.multipliers[self.members[row]] = self.right[row];
        }
    }
}

/// Largest number of exchanges. All sets are tried only if there is no other method: with friction.
fn exchange_limit(size: usize, monotone: bool) -> usize {
    match size {
        0..=ENUMERABLE if monotone => 100 + 20 * size,
        0..=ENUMERABLE => 100 + 20 * size + (1 << size),
        _ => BLOCK_LIMIT,
    }
}

/// Largest number of factorisations of the drives: twenty per contact. Beyond `FULL_PATIENCE` contacts it falls with the square of the
/// size, so that the total effort, size³ each, grows no faster than the square of the size.
fn drive_limit(size: usize) -> usize {
    let limit = 100 + 20 * size;
    if size <= FULL_PATIENCE { limit } else { limit * FULL_PATIENCE * FULL_PATIENCE / (size * size) }
}

#[cfg(test)]
mod tests;
