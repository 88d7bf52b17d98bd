//! One step of a group of coupled nodes on a coating: rods that are free, elastic or yielding, and hard contact.
//!
//! g = g_p + W(NᵀF(−Ng) + λ), λ ⟂ g + h₀ ≥ 0. With every rod on one branch (F = f + kδ) and every node open or closed, the equations are
//! linear in the gaps of the open and the λ of the closed nodes. The branches are found by block exchanges as in
//! [`ContactSolver`](crate::contact::active_set::ContactSolver): every rod and node whose condition is violated moves on by one branch. When
//! the number of violated conditions stops falling, Katzenelson's method takes over (J. Katzenelson, Bell Syst. Tech. J. 44, 1965):
//! starting without contact, the prediction is approached on a straight line, and whenever a rod or node reaches the end of its branch only
//! this branch is exchanged. Gaps are a continuous, piecewise linear and invertible function of the prediction if the symmetric part of W
//! is positive definite, so that the line meets every combination of branches at most once.

mod linear;

use nalgebra::DMatrix;

use super::{Branch, CellContact, RodMaterial};
use crate::contact::active_set::{PATIENCE, SolverOutcome};
use crate::contact::proximal::{GOLDEN, ROUNDS, Yielding};
use crate::math::real;

/// Depths and forces within this fraction of their scale count as zero.
const ZERO_FRACTION: f64 = 1e-12;
/// Rounding of a depth relative to the depths whose difference it is.
const ROUNDING: f64 = 1e-15;

/// One step of the path.
#[derive(Debug, Clone, Copy)]
enum PathStep {
    Rod(usize, Branch),
    Node(usize),
}

/// The contact problem of one group of blades on a coating; allocates only when created.
///
/// Per group: [`clear`](Self::clear), [`Coating::locate`](super::Coating::locate) for each blade, fill `delassus`, `gaps`
/// and (as a guess) `closed` of its nodes, then [`solve`](Self::solve).
#[derive(Debug, Clone)]
pub struct CoatedProblem {
    rod: RodMaterial,
    thickness: f64,
    /// Number of nodes of the group.
    pub(super) size: usize,
    /// Normal gap of node i per multiplier of node j (m/N), friction included; capacity × capacity, the leading
    /// `size` × `size` part in use.
    pub delassus: DMatrix<f64>,
    /// Normal gap per force of a coating that is cut, whose tangential force differs from friction on the hard casing.
    pub cut: Option<DMatrix<f64>>,
    /// As in [`ContactSolver::monotone`](crate::contact::active_set::ContactSolver::monotone).
    pub monotone: bool,
    /// Predicted gaps to the unworn surface (m); corrected gaps on return.
    pub gaps: Vec<f64>,
    /// Part of each node's multiplier that the coating carries (N).
    pub coating: Vec<f64>,
    /// Part of each node's multiplier that the hard casing carries (N).
    pub hard: Vec<f64>,
    /// Nodes on the hard casing: guess and result.
    pub closed: Vec<bool>,
    pub(super) contacts: Vec<CellContact>,
    corrected: Vec<f64>,
    /// Gaps and hard forces of the point reached on the path.
    reached: [Vec<f64>; 2],
    /// Largest force on a node (N).
    largest: f64,
    yielding: Yielding,
    pub(super) factorisations: usize,
    /// Nodes with force, and the index of each among them.
    members: Vec<usize>,
    slot: Vec<usize>,
    factor: DMatrix<f64>,
    right: Vec<f64>,
    column_scale: Vec<f64>,
}

impl CoatedProblem {
    pub(super) fn new(rod: RodMaterial, thickness: f64, nodes: usize, contacts: usize) -> Self {
        Self {
            rod,
            thickness,
            size: 0,
            delassus: DMatrix::zeros(nodes, nodes),
            cut: None,
            monotone: false,
            gaps: vec![0.0; nodes],
            coating: vec![0.0; nodes],
            hard: vec![0.0; nodes],
            closed: vec![false; nodes],
            contacts: Vec::with_capacity(contacts),
            corrected: vec![0.0; nodes],
            reached: [vec![0.0; nodes], vec![0.0; nodes]],
            largest: 0.0,
            yielding: Yielding::new(nodes),
            factorisations: 0,
            members: Vec::with_capacity(nodes),
            slot: vec![0; nodes],
            factor: DMatrix::zeros(nodes, nodes),
            right: vec![0.0; nodes],
            column_scale: vec![0.0; nodes],
        }
    }

    /// Starts a new group.
    pub fn clear(&mut self) {
        self.size = 0;
        self.contacts.clear();
        self.closed.fill(false);
    }

    /// Adds the nodes of another blade; returns its first node.
    pub(super) fn append_nodes(&mut self, nodes: usize) -> usize {
        let first = self.size;
        self.size += nodes;
        first
    }

    pub(super) fn append_contact(&mut self, contact: CellContact) {
        debug_assert!(self.contacts.len() < self.contacts.capacity());
        self.contacts.push(contact);
    }

    /// Cells that the last solution wears, and their plastic strain after it.
    pub(super) fn worn(&self) -> impl Iterator<Item = (&CellContact, f64)> {
        let yielding = self.contacts.iter().filter(|contact| contact.faced && contact.branch == Branch::Plastic);
        yielding.map(|contact| (contact, self.rod.worn(self.strain(contact, &self.gaps))))
    }

    /// Cells that the last solution loads, with their force (N).
    #[cfg(test)]
    pub(crate) fn loaded_cells(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let loaded = self.contacts.iter().filter(|contact| contact.branch != Branch::Free);
        loaded.map(|contact| (contact.cell, self.force(contact, &self.gaps).max(0.0)))
    }

    /// Solves for gaps, coating forces and hard forces of the step.
    pub fn solve(&mut self) -> SolverOutcome {
        self.guess();
        let solved = self.exchange_blocks() || self.follow_path() || self.monotone && self.approach();
        SolverOutcome { solved, factorisations: self.factorisations, ..SolverOutcome::default() }
    }

    /// Starts from the prediction and from the nodes that the caller marked as closed.
    pub(super) fn guess(&mut self) {
        for index in 0..self.contacts.len() {
            let contact = self.contacts[index];
            self.contacts[index].branch = self.rod.branch(self.strain(&contact, &self.gaps), contact.plastic);
        }
        for node in 0..self.size {
            self.closed[node] |= self.gaps[node] < -self.thickness;
        }
        self.yielding.softened = false;
        self.factorisations = 0;
    }

    /// Solves from the predicted gaps, for any rank of W ([`crate::contact::proximal`]).
    fn approach(&mut self) -> bool {
        let size = self.size;
        self.coating[..size].fill(0.0);
        self.yielding.keep(&self.delassus, &self.gaps[..size], self.scale());
        for _ in 0..ROUNDS {
            self.yielding.pose(&mut self.delassus, &mut self.gaps[..size]);
            let solved = self.exchange_blocks() || self.follow_path();
            let scale = self.scale();
            if self.yielding.advance(solved, scale, size, |node| self.coating[node] + self.hard[node]) {
                return true;
            }
        }
        false
    }

    pub(super) fn exchange_blocks(&mut self) -> bool {
        let (mut best, mut patience) = (usize::MAX, PATIENCE);
        while patience > 0 && self.solve_branches() {
            let count = self.violated();
            if count == 0 {
                return self.settle();
            }
            (best, patience) = if count < best { (count, PATIENCE) } else { (best, patience - 1) };
            self.exchange_all();
        }
        false
    }

    /// Follows the path from no contact to the prediction, one exchange at a time.
    pub(super) fn follow_path(&mut self) -> bool {
        for index in 0..self.contacts.len() {
            self.contacts[index].branch = Branch::Free;
        }
        self.closed[..self.size].fill(false);
        self.reached[1][..self.size].fill(0.0);
        for node in 0..self.size {
            // Different for every node, so that rods do not close at the same point of the path.
            let apart = 1.0 + (GOLDEN * real(node + 1)).fract();
            self.reached[0][node] = self.gaps[node].max(0.0) + apart * self.thickness;
        }
        let limit = 100 + 20 * (self.size + 2 * self.contacts.len());
        for _ in 0..limit {
            if !self.solve_branches() {
                return false;
            }
            let Some((share, change)) = self.first_end() else {
                return self.settle();
            };
            for node in 0..self.size {
                let [gap, hard] = &mut self.reached;
                gap[node] += share * (self.corrected[node] - gap[node]);
                hard[node] += share * (self.hard[node] - hard[node]);
            }
            match change {
                PathStep::Rod(index, next) => self.contacts[index].branch = next,
                PathStep::Node(node) => self.closed[node] = !self.closed[node],
            }
        }
        false
    }

    /// Returns the branch that ends first between the point reached and the solution of the present branches, and the fraction of the path
    /// up to there; `None` if all hold at that solution.
    fn first_end(&self) -> Option<(f64, PathStep)> {
        let share = |from: f64, to: f64, end: f64| ((end - from) / (to - from)).clamp(0.0, 1.0);
        let rods = (0..self.contacts.len()).filter_map(|index| {
            let (contact, next) = (&self.contacts[index], self.next_branch(index)?);
            let end = self.rod.border(contact.branch, next, contact.plastic);
            let way = share(self.strain(contact, &self.reached[0]), self.strain(contact, &self.corrected), end);
            Some((way, PathStep::Rod(index, next)))
        });
        let nodes = (0..self.size).filter(|node| self.node_violated(*node)).map(|node| {
            let way = if self.closed[node] {
                share(self.reached[1][node], self.hard[node], 0.0)
            } else {
                share(self.reached[0][node], self.corrected[node], -self.thickness)
            };
            (way, PathStep::Node(node))
        });
        rods.chain(nodes).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    pub(super) fn strain(&self, contact: &CellContact, gaps: &[f64]) -> f64 {
        let ([a, b], [share_a, share_b]) = (contact.nodes, contact.weights);
        -(share_a * gaps[a] + share_b * gaps[b]) / self.thickness
    }

    /// Force on the straight line of its branch, negative where that branch does not hold.
    pub(super) fn force(&self, contact: &CellContact, gaps: &[f64]) -> f64 {
        let (offset, tangent) = self.rod.line(contact.branch, contact.plastic);
        let strain = self.strain(contact, gaps);
        // Computed as a difference, the elastic force is accurate close to zero.
        let stress = if contact.branch == Branch::Elastic {
            tangent * (strain - contact.plastic)
        } else {
            offset + tangent * strain
        };
        contact.area * stress
    }

    /// Strain by which a condition may be violated: rounding of the terms it is computed from, or a force that is negligible compared with
    /// the largest.
    fn slack(&self, contact: &CellContact) -> f64 {
        let depth = contact
            .nodes
            .iter()
            .fold(0.0_f64, |depth, node| depth.max(self.gaps[*node].abs()).max(self.corrected[*node].abs()));
        let scale = depth / self.thickness + contact.plastic;
        let (_, modulus) = self.rod.line(Branch::Elastic, 0.0);
        let idle = self.largest / (contact.area * modulus);
        (ROUNDING * scale).max(ZERO_FRACTION * scale.min(idle))
    }

    fn next_branch(&self, index: usize) -> Option<Branch> {
        let contact = &self.contacts[index];
        let strain = self.strain(contact, &self.corrected);
        self.rod.next(contact.branch, strain, contact.plastic, self.slack(contact))
    }

    fn node_violated(&self, node: usize) -> bool {
        if self.closed[node] {
            self.hard[node] < -ZERO_FRACTION * self.largest
        } else {
            let scale = self.gaps[node].abs().max(self.thickness);
            self.corrected[node] + self.thickness < -ZERO_FRACTION * scale
        }
    }

    fn violated(&self) -> usize {
        let rods = (0..self.contacts.len()).filter(|index| self.next_branch(*index).is_some()).count();
        rods + (0..self.size).filter(|node| self.node_violated(*node)).count()
    }

    fn exchange_all(&mut self) {
        for index in 0..self.contacts.len() {
            if let Some(next) = self.next_branch(index) {
                self.contacts[index].branch = next;
            }
        }
        for node in 0..self.size {
            self.closed[node] ^= self.node_violated(node);
        }
    }

    /// Removes rounding from a solution. Returns false and does nothing if there is no solution.
    fn settle(&mut self) -> bool {
        if self.yielding.is_pinched(self.size, self.scale(), |node| self.hard[node]) {
            return false;
        }
        for node in 0..self.size {
            self.coating[node] = self.coating[node].max(0.0);
            self.hard[node] = self.hard[node].max(0.0);
            self.gaps[node] = self.corrected[node].max(-self.thickness);
            self.closed[node] = self.hard[node] > 0.0;
        }
        true
    }

    /// Largest gap, the thickness, or the largest displacement of a node by the coating (m), since rods may be stiff compared with the
    /// blade.
    fn scale(&self) -> f64 {
        let of = |node: usize| self.gaps[node].abs().max(self.delassus[(node, node)] * self.coating[node].abs());
        (0..self.size).map(of).fold(self.thickness, f64::max)
    }
}
