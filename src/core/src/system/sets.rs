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
}

impl StructureSets {
    /// Finds the sets; sets with contact nodes come first.
    pub(crate) fn new(structures: &[Structure], pairs: &[ContactPair]) -> Self {
        let links = pairs.iter().filter_map(|pair| Some((pair.structure(), pair.carrier()?.structure)));
        let number = joined(structures.len(), links);
        let all = 0..structures.len();
        let members = all.clone().map(|one| all.clone().filter(|index| number[*index] == one).collect());
        let members = members.filter(|members: &Vec<usize>| !members.is_empty());
        let touches = |members: &Vec<usize>| members.iter().any(|member| structures[*member].nodes() > 0);
        let (mut members, others): (Vec<_>, Vec<_>) = members.partition(touches);
        members.extend(others);
        let place = |structure| members.iter().position(|members| members.contains(&structure));
        Self { of: all.filter_map(place).collect(), members }
    }

    /// Returns the number of sets.
    pub fn count(&self) -> usize {
        self.members.len()
    }

    /// Structures of a set, ascending.
    pub fn members(&self, set: usize) -> &[usize] {
        &self.members[set]
    }

    /// Set of a structure.
    #[inline(always)]
    pub fn of(&self, structure: usize) -> usize {
        self.of[structure]
    }
}

/// Returns one number per item; items connected by `links`, directly or indirectly, have the same number.
pub fn joined(count: usize, links: impl Iterator<Item = (usize, usize)>) -> Vec<usize> {
    let mut number: Vec<usize> = (0..count).collect();
    for (one, other) in links {
        let (kept, lost) = (number[one], number[other]);
        number.iter_mut().filter(|number| **number == lost).for_each(|number| *number = kept);
    }
    number
}
