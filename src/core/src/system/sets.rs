//! Sets of structures that influence each other.

use super::pair::ContactPair;
use super::structure::Structure;

/// Structures that influence each other through the surfaces they touch and carry, directly or indirectly. No energy passes
/// between two sets: each has its own ledger, so that the energy exchange of one set cannot hide a spurious gain of another.
#[derive(Debug, Clone)]
pub struct StructureSets {
    /// Structures of each set, ascending.
    members: Vec<Vec<usize>>,
    /// Set of each structure.
    of: Vec<usize>,
    /// Contact pairs of each set, ascending.
    pairs: Vec<Vec<usize>>,
}

impl StructureSets {
    /// Finds the sets; sets with contact nodes come first.
    pub(crate) fn new(structures: &[Structure], pairs: &[ContactPair]) -> Self {
        let links = pairs.iter().filter_map(|pair| Some((pair.structure(), pair.carrier()?.structure)));
        let numbers = joined(structures.len(), links);
        let mut members = vec![Vec::new(); structures.len()];
        numbers.iter().enumerate().for_each(|(structure, number)| members[*number].push(structure));
        members.retain(|members| !members.is_empty());
        // Sets with contact nodes keep their order, and so do the others.
        let has_contact_nodes = |members: &Vec<usize>| members.iter().any(|member| structures[*member].nodes() > 0);
        let (mut members, others): (Vec<_>, Vec<_>) = members.into_iter().partition(has_contact_nodes);
        members.extend(others);
        let mut of = vec![0; structures.len()];
        for (set, members) in members.iter().enumerate() {
            members.iter().for_each(|member| of[*member] = set);
        }
        let mut of_sets = vec![Vec::new(); members.len()];
        pairs.iter().enumerate().for_each(|(index, pair)| of_sets[of[pair.structure()]].push(index));
        Self { members, of, pairs: of_sets }
    }

    /// Returns the number of sets.
    pub fn count(&self) -> usize {
        self.members.len()
    }

    /// Structures of a set, ascending.
    pub fn members(&self, set: usize) -> &[usize] {
        &self.members[set]
    }

    /// Contact pairs of a set, ascending.
    pub fn pairs(&self, set: usize) -> &[usize] {
        &self.pairs[set]
    }

    /// Set of a structure.
    #[inline(always)]
    pub fn of(&self, structure: usize) -> usize {
        self.of[structure]
    }
}

/// Returns one number per item; items connected by `links`, directly or indirectly, have the same number.
pub fn joined(count: usize, links: impl Iterator<Item = (usize, usize)>) -> Vec<usize> {
    // The number of an item is the end of its chain.
    let mut next: Vec<usize> = (0..count).collect();
    for (one, other) in links {
        let (kept, lost) = (end_of(&mut next, one), end_of(&mut next, other));
        next[lost] = kept;
    }
    (0..count).map(|item| end_of(&mut next, item)).collect()
}

/// Returns the end of the chain of an item, and shortens the chain.
fn end_of(next: &mut [usize], mut item: usize) -> usize {
    while next[item] != item {
        next[item] = next[next[item]];
        item = next[item];
    }
    item
}
