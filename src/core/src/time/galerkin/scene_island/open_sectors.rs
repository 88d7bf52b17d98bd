//! Sectors that stay open over a span, whose gaps need no evaluation.
//!
//! As with fixed steps (`system/nearness.rs`), a gap changes by no more than the motion of its node and of its surface. The contact forces of
//! the span also move surfaces and coupled sectors. This motion is unknown at the start of the span, so every step compares it with the
//! allowance of each sector.

use super::SceneIsland;
use crate::geometry::spline::SplineGap;
use crate::math::vector::vector3_at;
use crate::system::{ContactPair, Structure};
use crate::time::galerkin::disk::largest_gap_change;
use std::ops::Range;

/// Factor on the prescribed motion over the span, because the motion may be larger within the span than at its end.
const PRESCRIBED_MOTION_FACTOR: f64 = 2.0;

impl SceneIsland {
    /// Selects the sectors that may touch in a span (s), or whose smallest gap an output may need. The others stay open while bodies move by
    /// less than their allowance.
    pub(super) fn choose_active(&mut self, structures: &[Structure], pairs: &mut [ContactPair], span: f64) {
        if !self.island.carriers.is_empty() {
            self.island.sectors.iter_mut().for_each(|one| one.allowance = Some(f64::INFINITY));
            for disk in &mut self.island.disks {
                disk.set_normals(&structures[disk.structure].history.geometry.before.normal);
            }
            for index in 0..self.records.len() {
                if self.records[index].sector == 0 {
                    let sectors = index..index + structures[self.records[index].structure].modes().sectors();
                    self.find_allowances(sectors, structures, pairs, span);
                }
            }
        }
        let active = self.island.sectors.iter().enumerate().filter(|(_, one)| one.allowance.is_none());
        self.island.active.clear();
        self.island.active.extend(active.map(|(index, _)| index));
    }

    /// Finds the allowances of all sectors of a structure.
    fn find_allowances(
        &mut self,
        sectors: Range<usize>,
        structures: &[Structure],
        pairs: &mut [ContactPair],
        span: f64,
    ) {
        let first = sectors.start;
        let structure = &structures[self.records[first].structure];
        for number in 0..self.records[first].pairs.len() {
            let pair = &mut pairs[self.records[first].pairs[number].pair];
            let rows = pair.carrier().map_or(&[][..], |carrier| structures[carrier.structure].modes().displacement());
            let has_bounds = !structure.needed_minima.by_sector
                && pair.find_prescribed_changes(rows, &mut self.records[first].changes);
            let ring = pair.gap().smooth_ring().filter(|_| has_bounds);
            for index in sectors.clone() {
                let change = self.records[first].changes[self.records[index].sector];
                let allowance = ring.and_then(|gap| self.allowance(index, structure, gap, span));
                let allowance =
                    allowance.map(|allowance| allowance - PRESCRIBED_MOTION_FACTOR * change).filter(|left| *left > 0.0);
                let own = &mut self.island.sectors[index].allowance;
                *own = own.zip(allowance).map(|(own, allowance)| own.min(allowance));
            }
        }
    }

    /// Returns the allowance of a sector (m): the motion of its surface, and of its nodes if it is coupled, up to which its gaps stay open and
    /// larger than those of another sector. `None` if a gap may become smaller without such motion.
    fn allowance(&mut self, index: usize, structure: &Structure, gap: &SplineGap, span: f64) -> Option<f64> {
        let (sector, lanes, gaps) = (self.records[index].sector, structure.lanes(), &structure.history.gap.before);
        if structure.needed_minima.all_of(sector) || self.island.sectors[index].state.is_loaded() {
            return None;
        }
        let travel = self.island.travel(index, span);
        let normals = &structure.history.geometry.before.normal;
        let normal = |node: usize| normals.each_ref().map(|normals| normals[node * lanes + sector]);
        let mut smallest = f64::INFINITY;
        for node in &gap.nodes {
            let row = &gaps[node * lanes..(node + 1) * lanes];
            let others = row.iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
            let own = travel.map_or(0.0, |travel| largest_gap_change(vector3_at(travel, *node).into(), normal(*node)));
            let free = row[sector] - others - own;
            if !(free > 0.0 && free.is_finite()) {
                return None;
            }
            smallest = smallest.min(free);
        }
        Some(smallest)
    }
}
