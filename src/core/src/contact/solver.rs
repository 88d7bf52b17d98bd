//! The unilateral contact problem of one step on one group of coupled nodes.
//!
//! With g the predicted gaps and W = C_Nᵀ A⁻¹ C_NT the Delassus matrix (normal gap of node i per multiplier of
//! node j, friction included), the corrected gaps are g + Wλ.
//!
//! * [`ContactSolver::film`]: the paper's rule (eqs 10-11). Penetration is detected once; equality is enforced on that set, and
//!   neither a negative λ nor a penetration caused elsewhere is looked at again.
//! * [`ContactSolver::lcp`]: 0 ≤ λ ⟂ g + Wλ ≥ 0 on all nodes by block principal pivoting, started from the last step's
//!   set. When the number of infeasible nodes stops falling it continues with Murty's least-index rule, which is
//!   finite for every P-matrix (J. J. Júdice, F. M. Pires, Computers & Operations Research 21, 1994). With more than a
//!   few nodes finite can mean 2ⁿ, and the violated contacts are driven to closure one by one instead.

mod drive;

use nalgebra::DMatrix;

/// Pivots below this fraction of their node's own diagonal belong to redundant contacts (coincident nodes).
const REDUNDANT_PIVOT: f64 = 1e-12;
/// Share of its diagonal by which a node is softened when redundant contacts ask for different gaps: the deepest of
/// them then carries the force, and the gap it is left with is this share of the predicted penetration.
const SOFTENING: f64 = 1e-10;
/// Gaps and multipliers within this fraction of their scale count as zero.
const ZERO_FRACTION: f64 = 1e-13;
/// Block exchanges allowed without progress before Murty's rule takes over.
const PATIENCE: usize = 8;

/// Largest problem on which the least-index rule may try every active set.
const ENUMERABLE: usize = 14;
/// Factorisations allowed to larger ones before contacts are driven one by one; block exchanges need about ten.
const BLOCK_LIMIT: usize = 50;
/// Largest problem with an unreduced limit of factorisations for driving.
const FULL_PATIENCE: usize = 256;

/// What one solve did, and whether it succeeded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The complementarity conditions hold.
    pub solved: bool,
    /// Linear systems factorised.
    pub factorisations: usize,
    /// Gauss-Seidel sweeps (Coulomb solver only).
    pub sweeps: usize,
    /// Largest residual, relative to the terms it is made of (Coulomb solver only; 0 otherwise).
    pub residual: f64,
    /// Newton's method had to help the sweeps (Coulomb solver only).
    pub fallback: bool,
}

impl Outcome {
    /// The outcome of a direct method.
    pub(super) fn direct(solved: bool, factorisations: usize) -> Self {
        Self { solved, factorisations, sweeps: 0, residual: 0.0, fallback: false }
    }
}

/// Scratch for problems up to a largest size; allocates only when made. Arrays have the largest size, and a solve uses
/// their first `size` entries (the leading block of the matrix).
#[derive(Debug, Clone)]
pub struct ContactSolver {
    size: usize,
    /// Delassus matrix (m/N), filled by the caller.
    pub delassus: DMatrix<f64>,
    /// Predicted gaps (m), filled by the caller; corrected gaps on return.
    pub gaps: Vec<f64>,
    /// Multipliers (N), set by the solvers; 0 beyond the size.
    pub multipliers: Vec<f64>,
    /// Active set: for the complementarity solver, start and result; false beyond the size.
    pub active: Vec<bool>,
    factor: DMatrix<f64>,
    /// Diagonal of W in the order of `members`.
    diagonal: Vec<f64>,
    right: Vec<f64>,
    members: Vec<usize>,
    /// Node i is one of `members`.
    enforced: Vec<bool>,
    corrected: Vec<f64>,
    /// Multipliers and gaps while contacts are driven to closure.
    pressure: Vec<f64>,
    slack: Vec<f64>,
}

impl ContactSolver {
    /// Room for problems of up to `size` nodes, and set to that size.
    pub fn new(size: usize) -> Self {
        Self {
            size,
            delassus: DMatrix::zeros(size, size),
            gaps: vec![0.0; size],
            multipliers: vec![0.0; size],
            active: vec![false; size],
            factor: DMatrix::zeros(size, size),
            diagonal: vec![0.0; size],
            right: vec![0.0; size],
            members: Vec::with_capacity(size),
            enforced: vec![false; size],
            corrected: vec![0.0; size],
            pressure: vec![0.0; size],
            slack: vec![0.0; size],
        }
    }

    /// Number of nodes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Largest number of nodes.
    pub fn capacity(&self) -> usize {
        self.gaps.len()
    }

    /// Set the number of nodes of the next problems. Does not allocate.
    ///
    /// # Panics
    /// When `size` exceeds the capacity.
    pub fn set_size(&mut self, size: usize) {
        assert!(size <= self.capacity(), "{size} contact nodes in a solver made for {}", self.capacity());
        self.size = size;
        self.multipliers[size..].fill(0.0);
        self.active[size..].fill(false);
    }

    /// The paper's correction (eqs 10-11): equality on the nodes that penetrate in the prediction.
    pub fn film(&mut self) -> Outcome {
        for node in 0..self.size {
            self.active[node] = self.gaps[node] < 0.0;
        }
        self.solve_active(None);
        self.correct_gaps();
        std::mem::swap(&mut self.gaps, &mut self.corrected);
        Outcome::direct(true, 1)
    }

    /// Complementarity on all nodes; `active` is the starting guess and returns the set found.
    pub fn lcp(&mut self) -> Outcome {
        let scale = self.gaps[..self.size].iter().fold(0.0, |largest: f64, gap| largest.max(gap.abs()));
        for node in 0..self.size {
            self.active[node] |= self.gaps[node] < 0.0;
        }
        let limit = exchange_limit(self.size);
        let (mut best, mut patience, mut softened) = (usize::MAX, PATIENCE, false);
        for factorisations in 1..=limit {
            self.solve_active(None);
            self.correct_gaps();
            let largest =
                self.multipliers[..self.size].iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
            let (count, last) = self.count_infeasible(scale, largest);
            if count == 0 && !softened && self.redundant_contact_violated(scale) {
                self.soften();
                (best, patience, softened) = (usize::MAX, PATIENCE, true);
                continue;
            }
            if count == 0 {
                self.settle();
                return Outcome::direct(true, factorisations);
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
        let driven = self.drive_all(scale, drive_limit(self.size));
        Outcome::direct(driven.solved, limit + driven.factorisations)
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

    /// True when a contact left out as redundant is not closed by the contacts it was taken to depend on.
    fn redundant_contact_violated(&self, gap_scale: f64) -> bool {
        let left_out = |node: &usize| self.active[*node] && !self.enforced[*node];
        (0..self.size).filter(left_out).any(|node| self.corrected[node] < -ZERO_FRACTION * gap_scale)
    }

    /// Make the contact problem regular: every node yields a little by itself.
    fn soften(&mut self) {
        for node in 0..self.size {
            self.delassus[(node, node)] *= 1.0 + SOFTENING;
        }
    }

    /// Remove rounding from the accepted solution: λ ≥ 0 exactly, gap ≥ 0 exactly.
    fn settle(&mut self) {
        for node in 0..self.size {
            self.multipliers[node] = self.multipliers[node].max(0.0);
            self.active[node] = self.multipliers[node] > 0.0;
            // A redundant contact that carries nothing may stand open.
            self.gaps[node] = if self.active[node] { 0.0 } else { self.corrected[node].max(0.0) };
        }
    }

    fn correct_gaps(&mut self) {
        let size = self.size;
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

    /// W_AA λ_A = −g_A on the active set by elimination with diagonal pivoting, λ = 0 elsewhere. A P-matrix needs no
    /// other pivots; a vanishing pivot marks a contact that the others already enforce, and its λ stays 0.
    /// With a driven node the right-hand side is −W_Ad instead: how λ_A follows that node's multiplier.
    fn solve_active(&mut self, driven: Option<usize>) {
        self.members.clear();
        self.members.extend((0..self.size).filter(|node| self.active[*node]));
        self.multipliers.fill(0.0);
        let count = self.members.len();
        for (row, i) in self.members.iter().enumerate() {
            self.right[row] = -driven.map_or(self.gaps[*i], |driven| self.delassus[(*i, driven)]);
        }
        for (column, j) in self.members.iter().enumerate() {
            for (row, i) in self.members.iter().enumerate() {
                self.factor[(row, column)] = self.delassus[(*i, *j)];
            }
        }
        for row in 0..count {
            self.diagonal[row] = self.factor[(row, row)].abs();
        }
        let mut rank = 0;
        while rank < count {
            // What is left of a node's own flexibility decides: nodes may differ by many orders of magnitude.
            let left = |row: usize| self.factor[(row, row)].abs() / self.diagonal[row];
            let pivot = (rank..count).fold(rank, |best, row| if left(row) > left(best) { row } else { best });
            // Also ends at a node without any flexibility (0/0).
            if left(pivot).is_nan() || left(pivot) <= REDUNDANT_PIVOT {
                break;
            }
            self.exchange_members(rank, pivot, count);
            self.eliminate(rank, count);
            rank += 1;
        }
        for row in (0..rank).rev() {
            let known: f64 = (row + 1..rank).map(|column| self.factor[(row, column)] * self.right[column]).sum();
            self.right[row] = (self.right[row] - known) / self.factor[(row, row)];
            self.multipliers[self.members[row]] = self.right[row];
        }
        self.members.truncate(rank);
        self.enforced.fill(false);
        for member in &self.members {
            self.enforced[*member] = true;
        }
    }

    fn exchange_members(&mut self, a: usize, b: usize, count: usize) {
        if a == b {
            return;
        }
        self.members.swap(a, b);
        self.right.swap(a, b);
        self.diagonal.swap(a, b);
        for other in 0..count {
            self.factor.swap((a, other), (b, other));
        }
        for other in 0..count {
            self.factor.swap((other, a), (other, b));
        }
    }

    /// Column by column, as the matrix is stored. Zero multipliers are left out: infinite entries stay where they are.
    fn eliminate(&mut self, rank: usize, count: usize) {
        let order = self.factor.nrows();
        let (left, trailing) = self.factor.as_mut_slice().split_at_mut((rank + 1) * order);
        let pivot_column = &mut left[rank * order..];
        let pivot = pivot_column[rank];
        let known = self.right[rank];
        for (ratio, right) in pivot_column[rank + 1..count].iter_mut().zip(&mut self.right[rank + 1..count]) {
            *ratio /= pivot;
            *right = if *ratio == 0.0 { *right } else { *right - *ratio * known };
        }
        let ratios = &pivot_column[rank + 1..count];
        for column in trailing.chunks_exact_mut(order).take(count - rank - 1) {
            let value = column[rank];
            for (entry, ratio) in column[rank + 1..count].iter_mut().zip(ratios) {
                *entry = if *ratio == 0.0 { *entry } else { *entry - ratio * value };
            }
        }
    }
}

/// Factorisations of the exchange rules.
fn exchange_limit(size: usize) -> usize {
    if size <= ENUMERABLE { 100 + 20 * size + (1 << size) } else { BLOCK_LIMIT }
}

/// Factorisations of the drives: twenty per contact. Beyond `FULL_PATIENCE` contacts the number falls with the square of
/// the size, so that the whole effort, size³ each, grows no faster than the square of the size.
fn drive_limit(size: usize) -> usize {
    let limit = 100 + 20 * size;
    if size <= FULL_PATIENCE { limit } else { limit * FULL_PATIENCE * FULL_PATIENCE / (size * size) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The solution by trying every active set: independent of pivoting rules.
    fn brute_force(w: &DMatrix<f64>, g: &[f64]) -> Vec<f64> {
        let n = g.len();
        for set in 0..1_usize << n {
            let members: Vec<usize> = (0..n).filter(|i| set >> i & 1 == 1).collect();
            let sub = DMatrix::from_fn(members.len(), members.len(), |i, j| w[(members[i], members[j])]);
            let right = nalgebra::DVector::from_fn(members.len(), |i, _| -g[members[i]]);
            let solution = if members.is_empty() { Some(right) } else { sub.lu().solve(&right) };
            let Some(solution) = solution else { continue };
            let mut lambda = vec![0.0; n];
            for (index, member) in members.iter().enumerate() {
                lambda[*member] = solution[index];
            }
            let feasible = (0..n).all(|i| {
                let gap = g[i] + (0..n).map(|j| w[(i, j)] * lambda[j]).sum::<f64>();
                lambda[i] >= -1e-12 && (gap >= -1e-12)
            });
            if feasible {
                return lambda;
            }
        }
        panic!("no solution: not a P-matrix");
    }

    /// A random matrix with positive definite symmetric part, hence a P-matrix.
    fn p_matrix(entries: &[f64], n: usize) -> DMatrix<f64> {
        let a = DMatrix::from_fn(n, n, |i, j| entries[i * n + j]);
        let skew = DMatrix::from_fn(n, n, |i, j| 0.3 * (entries[i * n + j] - entries[j * n + i]));
        &a * a.transpose() + DMatrix::identity(n, n) * 0.05 + skew
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]
        #[test]
        fn complementarity_solution_equals_brute_force(
            n in 1_usize..7,
            entries in prop::collection::vec(-1.0..1.0_f64, 49),
            gaps in prop::collection::vec(-1.0..1.0_f64, 7),
            warm in prop::collection::vec(any::<bool>(), 7),
        ) {
            let w = p_matrix(&entries, n);
            let mut solver = ContactSolver::new(n);
            solver.delassus.copy_from(&w);
            solver.gaps.copy_from_slice(&gaps[..n]);
            solver.active.copy_from_slice(&warm[..n]);
            let outcome = solver.lcp();
            prop_assert!(outcome.solved);
            let expected = brute_force(&w, &gaps[..n]);
            let scale = expected.iter().fold(1.0_f64, |a, b| a.max(b.abs()));
            for (found, expected) in solver.multipliers.iter().zip(&expected) {
                prop_assert!((found - expected).abs() < 1e-9 * scale, "{found} vs {expected}");
            }
        }
    }

    #[test]
    fn coincident_nodes_share_one_constraint() {
        let mut solver = ContactSolver::new(3);
        solver.delassus.copy_from_slice(&[2.0, 2.0, 0.1, 2.0, 2.0, 0.1, 0.1, 0.1, 1.0]);
        solver.gaps.copy_from_slice(&[-1.0, -1.0, 0.5]);
        let outcome = solver.lcp();
        assert!(outcome.solved);
        assert!((solver.multipliers[0] + solver.multipliers[1] - 0.5).abs() < 1e-12);
        assert!(solver.gaps.iter().all(|gap| *gap >= 0.0));
    }

    #[test]
    fn of_coincident_nodes_the_deepest_decides() {
        for (first, second) in [(-1.0, -2.0), (-2.0, -1.0), (-1.0, -1.0 - 1e-6)] {
            for warm in [[false; 2], [true; 2], [true, false], [false, true]] {
                let mut solver = ContactSolver::new(2);
                solver.delassus.fill(2.0);
                solver.gaps.copy_from_slice(&[first, second]);
                solver.active.copy_from_slice(&warm);
                assert!(solver.lcp().solved);
                let force = solver.multipliers[0] + solver.multipliers[1];
                let (deepest, shallow) = (first.min(second), first.max(second));
                assert!((force + 0.5 * deepest).abs() < 1e-9, "{first}, {second}: force {force}");
                let open = solver.gaps[0].max(solver.gaps[1]);
                assert!((open - (shallow - deepest)).abs() < 1e-9, "{first}, {second}: gaps {:?}", solver.gaps);
            }
        }
    }

    #[test]
    fn stiff_nodes_beside_soft_ones_are_not_redundant() {
        let mut solver = ContactSolver::new(2);
        solver.delassus.copy_from_slice(&[1.0, 0.0, 0.0, 1e-14]);
        solver.gaps.copy_from_slice(&[-1.0, -1.0]);
        assert!(solver.lcp().solved);
        assert!((solver.multipliers[1] * 1e-14 - 1.0).abs() < 1e-12, "{:?}", solver.multipliers);
    }

    #[test]
    fn film_leaves_what_it_does_not_look_at() {
        // Pushing node 1 out pulls node 2 in: FILM does not notice, complementarity does.
        let mut solver = ContactSolver::new(2);
        solver.delassus.copy_from_slice(&[1.0, -0.9, -0.9, 1.0]);
        solver.gaps.copy_from_slice(&[-1.0, 0.1]);
        let mut exact = solver.clone();
        solver.film();
        assert!(solver.gaps[1] < -0.7 && solver.gaps[0].abs() < 1e-15);
        exact.lcp();
        assert!(exact.gaps.iter().all(|gap| *gap >= 0.0) && exact.multipliers.iter().all(|value| *value > 0.0));
    }

    /// Random P-matrices of the sizes of whole casings, some of them far from symmetric.
    #[test]
    fn large_problems_fulfil_complementarity() {
        let mut seed = 1_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / 9_007_199_254_740_992.0 * 2.0 - 1.0
        };
        for (size, skew) in [(48, 0.0), (48, 0.5), (48, 5.0), (168, 0.0), (168, 0.5), (168, 5.0)] {
            for modes in [size / 2, size, 2 * size] {
                let shapes = DMatrix::from_fn(size, modes, |_, _| uniform());
                let mut w = &shapes * shapes.transpose() + DMatrix::identity(size, size) * 1e-3;
                for (row, column) in (0..size).flat_map(|row| (0..row).map(move |column| (row, column))) {
                    let value = skew * uniform();
                    w[(row, column)] += value;
                    w[(column, row)] -= value;
                }
                let g: Vec<f64> = (0..size).map(|_| uniform() - 0.3).collect();
                let mut solver = ContactSolver::new(size);
                solver.delassus.copy_from(&w);
                solver.gaps.copy_from_slice(&g);
                let outcome = solver.lcp();
                assert!(outcome.solved && outcome.factorisations <= 400, "{size} {skew} {modes}: {outcome:?}");
                for row in 0..size {
                    let terms = || (0..size).map(|column| w[(row, column)] * solver.multipliers[column]);
                    let gap = g[row] + terms().sum::<f64>();
                    let scale = g[row].abs() + terms().map(f64::abs).sum::<f64>();
                    let (multiplier, limit) = (solver.multipliers[row], 1e-10 * scale);
                    assert!(multiplier >= 0.0 && gap >= -limit, "{size} {skew} {modes}: {multiplier}, {gap}");
                    assert!(gap <= limit || multiplier == 0.0, "{size} {skew} {modes}: {multiplier}, {gap}");
                }
            }
        }
    }

    #[test]
    fn a_smaller_problem_in_a_larger_solver_has_the_same_bits() {
        let entries: Vec<f64> = (0..49).map(|k| libm::sin(1.3 * f64::from(k * k))).collect();
        let w = p_matrix(&entries, 7);
        let g: Vec<f64> = (0..7).map(|k| libm::sin(f64::from(3 * k)) - 0.4).collect();
        let mut exact = ContactSolver::new(7);
        let mut roomy = ContactSolver::new(20);
        roomy.delassus.fill(f64::NAN);
        roomy.gaps.fill(f64::NAN);
        roomy.active.fill(true);
        roomy.multipliers.fill(1.0);
        roomy.set_size(7);
        roomy.active[..7].fill(false);
        for film in [false, true] {
            for solver in [&mut exact, &mut roomy] {
                solver.delassus.view_mut((0, 0), (7, 7)).copy_from(&w);
                solver.gaps[..7].copy_from_slice(&g);
            }
            let outcomes = [&mut exact, &mut roomy].map(|solver| if film { solver.film() } else { solver.lcp() });
            assert_eq!(outcomes[0], outcomes[1]);
            for node in 0..7 {
                assert_eq!(exact.multipliers[node].to_bits(), roomy.multipliers[node].to_bits());
                assert_eq!(exact.gaps[node].to_bits(), roomy.gaps[node].to_bits());
            }
            assert!(roomy.multipliers[7..].iter().all(|value| *value == 0.0));
        }
    }

    #[test]
    fn effort_is_bounded_for_every_size() {
        assert_eq!(exchange_limit(14), 100 + 280 + 16_384);
        assert!(exchange_limit(15) == BLOCK_LIMIT && exchange_limit(2000) == BLOCK_LIMIT);
        assert_eq!([14, 168, 256, 2000].map(drive_limit), [380, 3460, 5220, 656]);
    }

    #[test]
    fn driving_contacts_one_by_one_finds_the_same_solution() {
        for case in 0..200 {
            let n = 1 + case % 7;
            let entries: Vec<f64> = (0..49).map(|k| libm::sin(1.3 * f64::from(k * k) + case as f64)).collect();
            let gaps: Vec<f64> = (0..n).map(|k| libm::sin((3 * k + 2 * case) as f64)).collect();
            let mut block = ContactSolver::new(n);
            block.delassus.copy_from(&p_matrix(&entries, n));
            block.gaps.copy_from_slice(&gaps);
            let mut driven = block.clone();
            for node in 0..n {
                driven.active[node] = (case >> node) % 2 == 1;
            }
            assert!(block.lcp().solved && driven.drive_all(1.0, 1000).solved);
            let largest = block.multipliers.iter().fold(0.0_f64, |most, value| most.max(*value));
            for node in 0..n {
                assert!((block.multipliers[node] - driven.multipliers[node]).abs() <= 1e-11 * largest);
                assert!((block.gaps[node] - driven.gaps[node]).abs() <= 1e-11);
            }
        }
    }
}
