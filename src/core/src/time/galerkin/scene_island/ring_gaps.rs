//! Gaps of several sectors to smooth rings. Nodes of different sectors are searched together, because one sector rarely fills registers.

use super::SceneSurroundings;
use crate::geometry::spline::near::{NearNode, NearSearch};
use crate::geometry::{Gap, Vector3};
use crate::math::octet::Eight;
use crate::time::galerkin::island::{Island, IslandSector};
use std::mem::take;

/// Scratch memory: nodes that are searched together, and sectors in ascending order.
#[derive(Debug, Clone, Default)]
pub(super) struct RingSearch {
    nodes: Vec<NearNode>,
    pub sectors: Vec<usize>,
}

impl RingSearch {
    /// Allocates memory for this many sectors and nodes per sector.
    pub fn new(sectors: usize, nodes: usize) -> Self {
        Self { nodes: Vec::with_capacity(sectors * nodes), sectors: Vec::with_capacity(sectors) }
    }
}

impl SceneSurroundings<'_> {
    /// Finds gaps, normals and closest points of the active sectors at a point of the tried step, from their last closest points there; either of
    /// the far sectors or of the near sectors.
    pub(super) fn find_gaps_of_active_sectors(&mut self, island: &mut Island, point: usize, far: bool) {
        let mut sectors = take(&mut self.search.sectors);
        sectors.clear();
        sectors.extend(island.active.iter().filter(|index| island.sectors[**index].far == far));
        let moved = |one: &IslandSector, node| one.trial.displacement(point, node);
        self.find_ring_gaps(island, &sectors, point, true, moved, |one, node, gap| one.trial.set_gap(point, node, gap));
        self.search.sectors = sectors;
    }

    /// Finds gaps and closest points of inactive sectors at the start of a step. The surfaces must be deformed as at this time.
    pub(super) fn find_gaps_at_start(&mut self, island: &mut Island, sectors: &[usize]) {
        sectors.iter().for_each(|index| island.find_start_of_inactive(*index));
        let moved = |one: &IslandSector, node| one.trial.displacement(0, node);
        self.find_ring_gaps(island, sectors, 0, false, moved, |one, node, gap| one.state.gaps[node] = gap.distance);
    }

    /// Finds gaps and closest points of some sectors at a point of the step, for the displacements `moved`. If `is_located` is true, the search
    /// starts at the last closest points.
    fn find_ring_gaps(
        &mut self,
        island: &mut Island,
        sectors: &[usize],
        point: usize,
        is_located: bool,
        moved: impl Fn(&IslandSector, usize) -> Vector3,
        mut store: impl FnMut(&mut IslandSector, usize, &Gap),
    ) {
        let Self { pairs, records, search, .. } = self;
        let mut sectors = sectors;
        while let Some(index) = sectors.first() {
            let first = index - records[*index].sector;
            let count = sectors.iter().take_while(|index| **index - records[**index].sector == first).count();
            let (own, others) = sectors.split_at(count);
            sectors = others;
            for number in 0..records[first].pairs.len() {
                let pair = &pairs[records[first].pairs[number].pair];
                let Some(ring) = pair.gap().smooth_ring() else { continue };
                search.nodes.clear();
                for index in own {
                    let (record, one) = (&records[*index], &island.sectors[*index]);
                    search.nodes.extend(ring.nodes.iter().map(|node| NearNode {
                        node: *node,
                        index: node * record.lanes + record.sector,
                        local: moved(one, *node),
                        guess: is_located.then_some(record.places[point][*node]),
                    }));
                }
                let record = &mut records[first];
                record.evaluated_gaps += Eight::blocks(search.nodes.len()) as u64;
                let (drive, lanes) = (record.pairs[number].drives[point].0, record.lanes);
                NearSearch::new(ring, &drive).find_gaps(search.nodes.iter().copied(), |near, gap| {
                    let index = first + near.index % lanes;
                    records[index].places[point][near.node] = gap.foot;
                    store(&mut island.sectors[index], near.node, &gap);
                });
            }
        }
    }
}
