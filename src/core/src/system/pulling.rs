//! Pulling forces and penetration at contact nodes, which occur if a law checks for penetration only once and nodes push each other.

use tiprub_cosim::persist_fields;

use super::System;

/// Impulses on the contact nodes of one structure since the start, summed over all its sectors.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Pulling {
    /// Number of internal steps with contact.
    touched: u64,
    /// Impulses of pushing and of pulling forces on each node (N s).
    pushed: Vec<f64>,
    pulled: Vec<f64>,
    /// Largest depth of each node inside a surface at the end of a step, as a fraction of its clearance.
    inside: Vec<f64>,
}

persist_fields!(Pulling { touched, pushed, pulled, inside });

impl Pulling {
    /// Allocates data for `nodes` nodes.
    pub(crate) fn new(nodes: usize) -> Self {
        Self { touched: 0, pushed: vec![0.0; nodes], pulled: vec![0.0; nodes], inside: vec![0.0; nodes] }
    }

    /// Resets the record.
    pub(crate) fn clear(&mut self) {
        self.touched = 0;
        self.pushed.fill(0.0);
        self.pulled.fill(0.0);
        self.inside.fill(0.0);
    }

    fn add(&mut self, node: usize, impulse: f64) {
        let side = if impulse < 0.0 { &mut self.pulled } else { &mut self.pushed };
        side[node] += impulse.abs();
    }

    /// Returns the node with the largest pulling impulse, as a fraction of the largest pushing impulse, once contact has lasted
    /// for `steps` internal steps; a single contact of two nodes is not representative.
    fn most(&self, steps: u64) -> Option<(usize, f64)> {
        let pushed = self.pushed.iter().copied().fold(0.0, f64::max);
        let (node, pulled) = self.pulled.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (self.touched >= steps && pulled > 0.0).then(|| (node, pulled / pushed))
    }
}

impl System {
    /// Records the forces of the last step, if a law allows pulling forces.
    pub(crate) fn count_pulling(&mut self) {
        if self.groups.iter().all(|group| group.law.is_iterative()) {
            return;
        }
        let (step, mut last) = (self.step_size(), usize::MAX);
        for event in &self.events.now {
            let pulling = &mut self.structures[event.structure].pulling;
            pulling.touched += u64::from(event.structure != last);
            last = event.structure;
            pulling.add(event.node, event.normal * step);
        }
        for pair in &self.pairs {
            let structure = &mut self.structures[pair.structure()];
            let (clearance, lanes) = (pair.gap().clearance(), structure.lanes());
            for &node in pair.nodes() {
                let gaps = &structure.history.gap.now[node * lanes..(node + 1) * lanes];
                let lowest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
                let inside = &mut structure.pulling.inside[node];
                *inside = inside.max(-lowest / clearance);
            }
        }
    }

    /// Returns the node of a touching structure that was deepest inside at the end of a step, and the depth as a fraction of its clearance
    /// ([`GapLaw::clearance`](crate::geometry::GapLaw::clearance)).
    pub(crate) fn left_inside(&self, structure: usize) -> Option<(usize, f64)> {
        self.structures[structure].pulling.inside.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Clearance of a contact node (m); 0 if it has nothing to touch.
    pub(crate) fn clearance_of(&self, structure: usize, node: usize) -> f64 {
        let pair = self.structures[structure].pair_of[node];
        pair.map_or(0.0, |pair| self.pairs[pair].gap().clearance())
    }

    /// Returns the node of a touching structure with the largest pulling impulse, as a fraction of the largest pushing impulse of a node, once
    /// contact has lasted for `steps` internal steps.
    pub fn pulling(&self, structure: usize, steps: u64) -> Option<(usize, f64)> {
        self.structures[structure].pulling.most(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratio_compares_largest_tension_with_largest_compression() {
        let mut pulling = Pulling::new(3);
        assert_eq!(pulling.most(0), None);
        for (node, impulse) in [(0, 3.0), (1, -0.5), (2, -0.25), (0, 1.0), (1, 2.0), (2, -0.5)] {
            pulling.add(node, impulse);
        }
        pulling.touched = 4;
        assert_eq!(pulling.most(4), Some((2, 0.75 / 4.0)));
        assert_eq!(pulling.most(5), None);
        pulling.clear();
        assert_eq!((pulling.most(0), pulling), (None, Pulling::new(3)));
    }
}
