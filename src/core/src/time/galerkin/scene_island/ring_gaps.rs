//! Gaps of several sectors to smooth rings on elastic casings. The closest points of several sectors are found together, because the nodes
//! of one sector rarely fill the registers.

use super::SceneSurroundings;
use crate::geometry::spline::near::{NearNode, NearSearch};
use crate::geometry::{Gap, Vector3};
use crate::math::octet::Eight;
use crate::time::galerkin::island::{Island, IslandSector};
use std::mem::take;

/// Scratch memory of the search for closest points on smooth rings.
#[derive(Debug, Clone, Default)]
pub(super) struct RingScratch {
    /// Nodes that are searched together.
    nodes: Vec<NearNode>,
    /// Indices of sectors, in ascending order.
    pub sectors: Vec<usize>,
}

impl RingScratch {
    /// Allocates memory for this many sectors and nodes per sector.
    pub fn new(sectors: usize, nodes: usize) -> Self {
        Self { nodes: Vec::with_capacity(sectors * nodes), sectors: Vec::with_capacity(sectors) }
    }
}

impl SceneSurroundings<'_> {
    /// Finds gaps (m), normals and closest points of the far or of the near active sectors on smooth rings at a point of the tried step.
    /// The search starts at their last closest points at this point.
    pub(super) fn find_gaps_of_active_sectors(&mut self, island: &mut Island, point: usize, is_far: bool) {
        let mut sectors = take(&mut self.ring_scratch.sectors);
        sectors.clear();
        sectors.extend(island.active.iter().filter(|index| island.sectors[**index].is_far == is_far));
        let moved = |one: &IslandSector, node| one.trial.displacement(point, node);
        self.search_rings(island, &sectors, point, true, moved, |one, node, gap| one.trial.set_gap(point, node, gap));
        self.ring_scratch.sectors = sectors;
    }

    /// Resets the trials of inactive sectors, and finds their gaps (m) to smooth rings and closest points at the start of a step. The
    /// surfaces must be deformed as at this time, and `drives[0]` of the first sector of each structure must be the prescribed motion then.
    pub(super) fn find_gaps_at_start(&mut self, island: &mut Island, sectors: &[usize]) {
        sectors.iter().for_each(|index| island.find_start_of_inactive(*index));
        let moved = |one: &IslandSector, node| one.trial.displacement(0, node);
        self.search_rings(island, sectors, 0, false, moved, |one, node, gap| one.state.gaps[node] = gap.distance);
    }

    /// Finds gaps (m), normals and closest points of `sectors`, in ascending order, on smooth rings at a point of the step. `moved` returns
    /// the displacement of a node (m), and `store` receives each gap. If `is_located` is true, the search starts at the last closest
    /// points.
    fn search_rings(
        &mut self,
        island: &mut Island,
        sectors: &[usize],
        point: usize,
        is_located: bool,
        moved: impl Fn(&IslandSector, usize) -> Vector3,
        mut store: impl FnMut(&mut IslandSector, usize, &Gap),
    ) {
        let Self { pairs, records, ring_scratch: scratch, .. } = self;
        let mut sectors = sectors;
        while let Some(index) = sectors.first() {
            let first = index - records[*index].sector;
            let count = sectors.iter().take_while(|index| **index - records[**index].sector == first).count();
            let (own, others) = sectors.split_at(count);
            sectors = others;
            for number in 0..records[first].pairs.len() {
                let pair = &pairs[records[first].pairs[number].pair];
                let Some(ring) = pair.gap().smooth_ring() else { continue };
                scratch.nodes.clear();
                for index in own {
                    let (record, one) = (&records[*index], &island.sectors[*index]);
                    scratch.nodes.extend(ring.nodes.iter().map(|node| NearNode {
                        node: *node,
                        index: node * record.lanes + record.sector,
                        local: moved(one, *node),
                        guess: is_located.then_some(record.places[point][*node]),
                    }));
                }
                let record = &mut records[first];
                record.evaluated_gaps += Eight::blocks(scratch.nodes.len()) as u64;
                let (drive, lanes) = (record.pairs[number].drives[point].0, record.lanes);
                NearSearch::new(ring, &drive).find_gaps(scratch.nodes.iter().copied(), |near, gap| {
                    let index = first + near.index % lanes;
                    records[index].places[point][near.node] = gap.foot;
                    store(&mut island.sectors[index], near.node, &gap);
                });
            }
        }
    }
}
