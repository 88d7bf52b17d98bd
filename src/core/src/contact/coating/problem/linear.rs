//! The linear equations of one combination of branches.

use super::CoatedProblem;
use crate::contact::active_set::REDUNDANT_PIVOT;
use crate::contact::coating::{Branch, CellContact};

impl CoatedProblem {
    /// Solves for gaps and forces of the present branches; redundant contacts are softened first.
    pub(super) fn solve_branches(&mut self) -> bool {
        if self.solve_linear() {
            return true;
        }
        if !self.yielding.softened {
            self.yielding.soften(&mut self.delassus, self.size);
            return self.solve_linear();
        }
        false
    }

    fn solve_linear(&mut self) -> bool {
        self.factorisations += 1;
        self.find_members();
        self.fill_nodes();
        for index in 0..self.contacts.len() {
            self.fill_rod(index);
        }
        let regular = self.eliminate();
        if regular {
            self.distribute();
        }
        regular
    }

    /// Finds the nodes with force; only they need an equation.
    fn find_members(&mut self) {
        self.slot[..self.size].fill(usize::MAX);
        self.members.clear();
        let (slot, members) = (&mut self.slot, &mut self.members);
        let mut add = |node: usize| {
            if slot[node] == usize::MAX {
                slot[node] = members.len();
                members.push(node);
            }
        };
        for contact in self.contacts.iter().filter(|contact| contact.branch != Branch::Free) {
            contact.nodes.into_iter().for_each(&mut add);
        }
        (0..self.size).filter(|node| self.closed[*node]).for_each(&mut add);
    }

    /// Fills in g − Wλ = g_p, with one unknown per node: the gap if it is open, λ if it is closed and g = −h₀.
    fn fill_nodes(&mut self) {
        for (row, i) in self.members.iter().enumerate() {
            self.right[row] = self.gaps[*i] + if self.closed[*i] { self.thickness } else { 0.0 };
            for (column, j) in self.members.iter().enumerate() {
                let own = if row == column { 1.0 } else { 0.0 };
                self.factor[(row, column)] = if self.closed[*j] { -self.delassus[(*i, *j)] } else { own };
            }
        }
    }

    /// Adds − W Nᵀ(f − kNg) of one rod.
    fn fill_rod(&mut self, index: usize) {
        let CellContact { nodes, weights, area, plastic, branch, .. } = self.contacts[index];
        if branch == Branch::Free {
            return;
        }
        let (offset, tangent) = self.rod.line(branch, plastic);
        let (constant, stiffness) = (area * offset, area * tangent / self.thickness);
        let delassus = self.cut.as_ref().unwrap_or(&self.delassus);
        for (row, i) in self.members.iter().enumerate() {
            let reach: f64 = (0..2).map(|end| delassus[(*i, nodes[end])] * weights[end]).sum();
            self.right[row] += reach * constant;
            for (node, weight) in nodes.into_iter().zip(weights) {
                if self.closed[node] {
                    self.right[row] += reach * stiffness * weight * self.thickness;
                } else {
                    self.factor[(row, self.slot[node])] += reach * stiffness * weight;
                }
            }
        }
    }

    /// Solves by Gaussian elimination with row exchanges; `right` contains the solution on return.
    fn eliminate(&mut self) -> bool {
        let count = self.members.len();
        for column in 0..count {
            self.column_scale[column] = (0..count).fold(0.0, |s: f64, row| s.max(self.factor[(row, column)].abs()));
        }
        for rank in 0..count {
            let size = |row: usize| self.factor[(row, rank)].abs();
            let pivot = (rank..count).fold(rank, |best, row| if size(row) > size(best) { row } else { best });
            // Also false at a node without any flexibility (0) and for NaN.
            let regular = size(pivot) > REDUNDANT_PIVOT * self.column_scale[rank];
            if !regular {
                return false;
            }
            if pivot != rank {
                self.right.swap(rank, pivot);
                (rank..count).for_each(|column| self.factor.swap((rank, column), (pivot, column)));
            }
            self.reduce(rank, count);
        }
        for row in (0..count).rev() {
            let known: f64 = (row + 1..count).map(|column| self.factor[(row, column)] * self.right[column]).sum();
            self.right[row] = (self.right[row] - known) / self.factor[(row, row)];
        }
        true
    }

    /// Subtracts row `rank` from the rows below it, column by column in storage order.
    fn reduce(&mut self, rank: usize, count: usize) {
        let stride = self.factor.nrows();
        let pivot = self.factor[(rank, rank)];
        let (done, rest) = self.factor.as_mut_slice().split_at_mut((rank + 1) * stride);
        let ratios = &mut done[rank * stride..][rank + 1..count];
        ratios.iter_mut().for_each(|ratio| *ratio /= pivot);
        for column in rest.chunks_mut(stride).take(count - rank - 1) {
            let value = column[rank];
            for (entry, ratio) in column[rank + 1..count].iter_mut().zip(&*ratios) {
                *entry -= ratio * value;
            }
        }
        let value = self.right[rank];
        for (entry, ratio) in self.right[rank + 1..count].iter_mut().zip(&*ratios) {
            *entry -= ratio * value;
        }
    }

    /// Change of a gap by all forces (m).
    fn moved(&self, node: usize) -> f64 {
        let (w, members) = (&self.delassus, self.members.iter());
        match &self.cut {
            None => members.map(|j| w[(node, *j)] * (self.coating[*j] + self.hard[*j])).sum(),
            Some(cut) => members.map(|j| cut[(node, *j)] * self.coating[*j] + w[(node, *j)] * self.hard[*j]).sum(),
        }
    }

    /// Computes gaps and forces of all nodes from the solution of the members.
    fn distribute(&mut self) {
        self.coating[..self.size].fill(0.0);
        self.hard[..self.size].fill(0.0);
        for (row, node) in self.members.iter().enumerate() {
            let solution = self.right[row];
            if self.closed[*node] {
                (self.hard[*node], self.corrected[*node]) = (solution, -self.thickness);
            } else {
                self.corrected[*node] = solution;
            }
        }
        for index in 0..self.contacts.len() {
            let contact = self.contacts[index];
            if contact.branch != Branch::Free {
                let force = self.force(&contact, &self.corrected);
                for (node, weight) in contact.nodes.into_iter().zip(contact.weights) {
                    self.coating[node] += weight * force;
                }
            }
        }
        let force = |node: &usize| self.coating[*node].abs() + self.hard[*node].abs();
        self.largest = self.members.iter().map(force).fold(0.0, f64::max);
        for node in 0..self.size {
            if self.slot[node] == usize::MAX {
                self.corrected[node] = self.gaps[node] + self.moved(node);
            }
        }
    }
}
