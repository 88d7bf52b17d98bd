//! Sectors that certainly stay open for some steps, whose gaps need no evaluation.
//!
//! As with fixed steps (`system/nearness.rs`), a gap changes by no more than the motion of its node and of its surface. Before every step,
//! bounds of this motion show which sectors stay open during the next steps, and these sectors become inactive. Contact forces also move
//! surfaces and coupled sectors. This motion is unknown before a step, so every step compares it with the limit of each inactive sector.

use super::{SceneIsland, SceneSurroundings};
use crate::geometry::spline::SplineGap;
use crate::system::{ContactPair, Structure};
use crate::time::galerkin::carrier::CarrierIntegrator;
use crate::time::galerkin::disk::{CoupledDisk, largest_gap_change};
use crate::time::galerkin::island::{BETWEEN_POINTS_FACTOR, Island, IslandSector, OpenLimits};
use crate::time::galerkin::span::SpanStep;
use crate::time::galerkin::surroundings::Surroundings;
use std::mem::take;

/// Durations for which a sector can become inactive, in lengths of the next step. A sector becomes inactive for the first of these
/// durations over which it certainly stays open.
const INACTIVE_STEPS: [f64; 2] = [4.0, 1.0];

impl SceneIsland {
    /// Activates all sectors at the start of a span, and bounds the effect of prescribed motion on their gaps.
    pub(super) fn activate_all(&mut self, structures: &[Structure], pairs: &mut [ContactPair]) {
        let Self { island, records, .. } = self;
        for one in &mut island.sectors {
            (one.limits, one.checked_at, one.last_motion, one.drift) = (None, None, 0.0, 0.0);
        }
        island.list_active();
        if island.carriers.is_empty() {
            return;
        }
        for disk in &mut island.disks {
            disk.set_normals(&structures[disk.structure].history.geometry.before.normal);
        }
        for record in records.iter_mut().filter(|record| record.sector == 0) {
            let structure = &structures[record.structure];
            record.find_lowest_of_all(structure);
            for own in &mut record.pairs {
                let pair = &mut pairs[own.pair];
                let rows =
                    pair.carrier().map_or(&[][..], |carrier| structures[carrier.structure].modes().displacement());
                let motion = own.course.largest_motion();
                own.has_bounds =
                    !structure.needed_minima.by_sector && pair.find_prescribed_changes(&motion, rows, &mut own.changes);
                let spacing = pair.gap().smooth_ring().map_or(f64::INFINITY, |ring| ring.surface.spacing());
                own.drift_factor = motion.relative_turn() * (1.0 + 2.0 / spacing);
            }
        }
    }
}

impl SceneSurroundings<'_> {
    /// Makes sectors inactive that certainly stay open in a step and whose smallest gaps no output needs. This holds while bodies move by
    /// less than the limits of these sectors. All other sectors become active.
    pub(super) fn choose_open_sectors(&mut self, island: &mut Island, step: SpanStep) {
        if island.carriers.is_empty() {
            return;
        }
        self.shift_limits(island, step);
        let (end, mut rechecked) = (step.from + step.length, take(&mut self.ring_scratch.sectors));
        rechecked.clear();
        for index in 0..island.sectors.len() {
            let one = &island.sectors[index];
            let limits = one.limits;
            if limits.map_or(one.was_checked(step), |limits| limits.until >= end)
                || !self.may_become_inactive(index, one)
            {
                continue;
            }
            let free = limits.map_or_else(|| self.free_distance(island, index), |limits| limits.motion);
            self.update_limits(island, index, step, free);
            if limits.is_some() && island.sectors[index].limits.is_none() {
                rechecked.push(index);
            }
        }
        // The motion that remains for these sectors is too small, so their gaps are evaluated again.
        if !rechecked.is_empty() {
            self.bend_at_start(island, step);
            self.find_gaps_at_start(island, &rechecked);
            for index in &rechecked {
                let free = self.free_distance(island, *index);
                self.update_limits(island, *index, step, free);
            }
        }
        self.ring_scratch.sectors = rechecked;
        island.list_active();
    }

    /// Updates the limits of a sector whose gaps may become smaller by `free` (m). A sector without limits must be active.
    fn update_limits(&self, island: &mut Island, index: usize, step: SpanStep, free: f64) {
        let found = self.find_limits(island, index, step, free);
        let one = &mut island.sectors[index];
        (one.limits, one.checked_at) = (found, found.is_none().then_some(step.from));
    }

    /// Subtracts the motion in the last step from the limits, so that they hold for the motion since the start of this step. Stores this
    /// motion.
    fn shift_limits(&mut self, island: &mut Island, step: SpanStep) {
        if step.from > 0.0 || island.active.len() < island.sectors.len() {
            self.find_surface_motions(&island.carriers, 0..=0);
            island.disks.iter_mut().for_each(|disk| disk.find_motions(0..=0));
            for index in 0..island.sectors.len() {
                let motion = self.surface_motion(index) + island.disk_motion(index);
                let one = &mut island.sectors[index];
                // If a step is repeated, nothing has moved since its first attempt.
                one.last_motion = if motion > 0.0 { motion } else { one.last_motion };
                one.drift += motion;
                if let Some(limits) = &mut one.limits {
                    limits.motion -= motion;
                }
            }
        }
        island.disks.iter_mut().for_each(CoupledDisk::set_motion_origin);
        island.carriers.iter_mut().for_each(CarrierIntegrator::set_motion_origin);
    }

    /// Returns the rings that a sector may touch.
    fn rings(&self, index: usize) -> impl Iterator<Item = &SplineGap> {
        let first = &self.records[index - self.records[index].sector];
        first.pairs.iter().filter_map(|own| self.pairs[own.pair].gap().smooth_ring())
    }

    /// Returns whether a sector may become inactive: its gaps are known, no force acts on it, no output needs all of its gaps, and the
    /// effect of prescribed motion is bounded.
    fn may_become_inactive(&self, index: usize, one: &IslandSector) -> bool {
        let record = &self.records[index];
        one.state.gaps_known
            && !one.state.is_loaded()
            && !self.structures[record.structure].needed_minima.all_of(record.sector)
            && self.records[index - record.sector].pairs.iter().all(|own| own.has_bounds)
    }

    /// Returns the smallest amount (m) by which the gaps of a sector exceed both 0 and the smallest gap of the same node over all sectors
    /// at the start of the span.
    fn free_distance(&self, island: &Island, index: usize) -> f64 {
        let lowest = &self.records[index - self.records[index].sector].lowest_of_all;
        let gaps = &island.sectors[index].state.gaps;
        let nodes = self.rings(index).flat_map(|ring| &ring.nodes);
        let free = nodes.map(|node| gaps[*node] - lowest[*node].max(0.0));
        // `f64::min` would ignore NaN.
        free.fold(f64::INFINITY, |smallest, free| if free.is_finite() { smallest.min(free) } else { f64::NEG_INFINITY })
    }

    /// Returns the limits of a sector whose gaps may become smaller by `free` (m). Returns `None` if they may become smaller than that
    /// within the step without contact forces, or with twice the motion of the last step.
    fn find_limits(&self, island: &mut Island, index: usize, step: SpanStep, free: f64) -> Option<OpenLimits> {
        let sector = self.records[index].sector;
        let drift = island.sectors[index].drift;
        let first = &self.records[index - sector];
        let prescribed =
            first.pairs.iter().map(|own| own.changes[sector] + own.drift_factor * drift).fold(0.0, f64::max);
        let min_motion = BETWEEN_POINTS_FACTOR * island.sectors[index].last_motion;
        INACTIVE_STEPS.iter().find_map(|steps| {
            let part = (steps * step.length).min(1.0 - step.from);
            let mut motion = free - part * prescribed;
            // The travel can only reduce `motion`, so it is not needed if `motion` is too small already.
            if motion > min_motion {
                motion -= self.largest_change(island, index, part);
            }
            (motion > min_motion && motion.is_finite()).then_some(OpenLimits { until: step.from + part, motion })
        })
    }

    /// Bounds the change of the gaps of a sector (m) by its free vibration over a fraction `part` of the span; 0 for sectors of a disk,
    /// whose motion counts against the limits.
    fn largest_change(&self, island: &mut Island, index: usize, part: f64) -> f64 {
        let SceneSurroundings { structures, records, .. } = self;
        let (sector, structure) = (records[index].sector, &structures[records[index].structure]);
        let time = part * island.span();
        let Some(travel) = island.travel(index, time) else { return 0.0 };
        let normals = &structure.history.geometry.before.normal;
        let change = |node: usize| {
            let normal = normals.each_ref().map(|normals| normals[structure.index(node, sector)]);
            largest_gap_change(travel.of_node(node, time).into(), normal)
        };
        self.rings(index).flat_map(|ring| &ring.nodes).map(|node| change(*node)).fold(0.0, f64::max)
    }

    /// Deforms the surfaces as at the start of a step.
    fn bend_at_start(&mut self, island: &Island, step: SpanStep) {
        let pairs = self.records.iter_mut().filter(|record| record.sector == 0).flat_map(|record| &mut record.pairs);
        pairs.for_each(|own| own.drives[0] = own.course.at(step.from));
        self.bend(&island.carriers, 0);
    }
}
