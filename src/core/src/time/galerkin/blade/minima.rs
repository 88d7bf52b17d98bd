//! Smallest gaps between the points of a step, for nodes that stay open.
//!
//! The polynomial through F at the points shows which nodes may come closer between the points. For these nodes, all
//! modes are evaluated exactly at the ends of equal parts of the step. A parabola through three of these gaps gives the
//! smallest gap.

use super::columns::{displace, sum};
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::surface::{FacedSurface, PointDrive};
use super::tally::BladeTally;
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::response::TERMS;
use crate::time::galerkin::trial::NEAR;

/// Number of halvings of a step into the parts at whose ends the motion is evaluated.
pub(super) const FINER: usize = 4;
/// Number of parts of a step.
pub(super) const PARTS: usize = 1 << FINER;
/// Nodes are followed if they may come closer between the points by more than this fraction of the tolerance.
const FOLLOW_FRACTION: f64 = 0.1;

/// Finds the nodes that may come closer between the points than at the points, with a smallest gap that an output
/// needs. Returns whether there are such nodes.
pub(super) struct FindMinima<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    pub tally: &'a BladeTally,
    /// Gaps below which the smallest gaps are needed (m).
    pub floors: &'a [Eight],
    /// Largest displacement error of a step (m).
    pub tolerance: f64,
}

impl OctetKernel for FindMinima<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, level, tally, floors, tolerance } = self;
        let (basis, count) = (&level.basis, level.basis.count());
        let slopes = both(|end| if end == 0 { basis.slopes_at(0.0) } else { basis.slopes_at(1.0) });
        let mut found = false;
        for block in 0..rows.blocks {
            let mut gaps = [L::zero(); POINTS];
            gaps[0] = L::load(&trial.start.gaps[block]);
            let mut pushes = L::zero().less(L::load(&trial.start.multipliers[block]));
            let (mut low, mut ends) = (gaps[0], [gaps[0]; 2]);
            for point in 1..count {
                let lane = (point - 1) * rows.blocks + block;
                gaps[point] = L::load(&trial.gaps[lane]);
                pushes |= L::zero().less(L::load(&trial.multipliers[lane]));
                low = low.min(gaps[point]);
                ends[1] = gaps[point];
            }
            let left = sum(&gaps[..count], &basis.left_out).abs() * L::splat(NEAR);
            let mut within = L::splat(f64::INFINITY);
            for place in &basis.between {
                within = within.min(sum(&gaps[..count], place));
            }
            let deeper = low - within;
            let at_end = ends[1].less(ends[0]);
            let slope = L::select(at_end, sum(&gaps[..count], &slopes[1]), sum(&gaps[..count], &slopes[0])).abs();
            #[expect(clippy::cast_precision_loss, reason = "few parts")]
            let falls = !L::zero().less(deeper) & (left * L::splat(PARTS as f64)).less(slope);
            let comes = L::splat(FOLLOW_FRACTION * tolerance).less(deeper.max(L::zero()) + left);
            let size = L::load(&rows.steepness[block]);
            let bar = L::load(&floors[block]).min(L::load(&tally.lowest[block]));
            let matters = ((low.min(within) - left) / size).less(bar);
            let chosen = comes & matters & !falls & !pushes & rows.valid(block);
            trial.followed[block] = chosen;
            found |= chosen != 0;
        }
        found
    }
}

/// Follows the nodes found by [`FindMinima`]. The modal forces must be known and the modes not yet advanced.
pub(super) struct Follow<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    /// Tables for the length of a part.
    pub part: &'a BladeLevel,
    pub faced: &'a FacedSurface<'a>,
    /// Prescribed motion at the end of each part.
    pub drives: &'a [PointDrive],
    pub tally: &'a mut BladeTally,
    /// True if forces act in the step.
    pub pushes: bool,
}

impl OctetKernel for Follow<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(mut self) {
        let parts = self.drives.len() - 1;
        for of in [0, 1] {
            self.trial.path_modes[of].copy_from_slice(&self.trial.start.modes[of]);
        }
        for end in 0..=parts {
            self.find_gaps::<L>(end, parts);
            if end < parts {
                self.advance::<L>(end, parts);
            }
        }
        self.record::<L>(parts);
    }
}

/// Returns the quotient of two small integers.
#[expect(clippy::cast_precision_loss, reason = "few parts")]
fn fraction(part: usize, parts: usize) -> f64 {
    part as f64 / parts as f64
}

impl Follow<'_> {
    /// Finds the gaps of the followed nodes after `end` of the `parts` parts, without the instantaneous displacements
    /// that forces on other nodes cause.
    #[inline(always)]
    fn find_gaps<L: Octet>(&mut self, end: usize, parts: usize) {
        let Self { trial, rows, level, faced, drives, pushes, .. } = self;
        let BladeTrial { start, path_modes, path_moved, path_gaps, forces, multipliers, angles, .. } = &mut **trial;
        for along in [0, 1] {
            displace::<L, 1>(&rows.shapes[along], rows.blocks, [&path_modes[0]], &mut path_moved[along]);
        }
        if *pushes {
            let weights = level.basis.weights_at(fraction(end, parts));
            for (along, node) in (0..2).flat_map(|along| (0..rows.nodes).map(move |node| (along, node))) {
                let (block, i) = (node / 8, node % 8);
                let mut force = weights[0] * start.forces[along][block].0[i];
                let mut acts = start.multipliers[block].0[i] > 0.0;
                for point in 1..=level.points() {
                    let lane = (point - 1) * rows.blocks + block;
                    force += weights[point] * forces[along][lane].0[i];
                    acts |= multipliers[lane].0[i] > 0.0;
                }
                if acts {
                    for (seen, moved) in path_moved.iter_mut().enumerate() {
                        let column = &rows.flexibility[along][seen][node * rows.blocks..][..rows.blocks];
                        for (moved, flexibility) in moved.iter_mut().zip(column) {
                            (L::load(moved) + L::load(flexibility) * L::splat(force)).store(moved);
                        }
                    }
                }
            }
        }
        let drive = &drives[end];
        for block in 0..rows.blocks {
            let per_radius = L::load(&rows.per_radius[block]);
            let [closing, around] = both(|along| L::load(&path_moved[along][block]));
            let [shape, slope, _] = faced
                .surface
                .evaluate_octet::<L>(L::load(&angles[block]) + L::splat(drive.turned) + around * per_radius);
            let factor = L::splat(drive.factor);
            let (sigma, steepness) = (slope * factor * per_radius, L::load(&rows.steepness[block]));
            let open = L::splat(drive.clearance) + shape * factor + closing;
            let gap = open / (steepness * steepness + sigma * sigma).sqrt();
            gap.store(&mut path_gaps[end * rows.blocks + block]);
        }
    }

    /// Advances the modes over a part.
    #[inline(always)]
    fn advance<L: Octet>(&mut self, part: usize, parts: usize) {
        let Self { trial, part: table, pushes, .. } = self;
        let BladeTrial { path_modes: [position, velocity], modal_forces, .. } = &mut **trial;
        let (from, length) = (L::splat(fraction(part, parts)), L::splat(fraction(1, parts)));
        for k in 0..position.len() {
            let mut terms = [L::zero(); TERMS];
            (terms[0], terms[1]) = (L::load(&position[k]), L::load(&velocity[k]));
            let mut count = 2;
            if *pushes {
                let (a, b) = (L::load(&modal_forces[0][k]), L::load(&modal_forces[1][k]));
                let c = L::load(&modal_forces[2][k]);
                terms[2] = a + from * (b + from * c);
                terms[3] = length * (b + L::splat(2.0) * from * c);
                terms[4] = length * length * c;
                count = TERMS;
            }
            let mut ends = [L::zero(); 2];
            for (end, table) in ends.iter_mut().zip(&table.end) {
                for (term, row) in terms[..count].iter().zip(table) {
                    *end = *end + L::load(&row[k]) * *term;
                }
            }
            ends[0].store(&mut position[k]);
            ends[1].store(&mut velocity[k]);
        }
    }

    /// Records the smallest gaps, each at the end of a part or at the vertex of a parabola through three such gaps.
    #[inline(always)]
    fn record<L: Octet>(&mut self, parts: usize) {
        let Self { trial, rows, tally, .. } = self;
        for block in 0..rows.blocks {
            if trial.followed[block] == 0 {
                continue;
            }
            let gap = |end: usize| L::load(&trial.path_gaps[end * rows.blocks + block]);
            let mut lowest = L::load(&tally.lowest[block]);
            for end in 1..parts {
                let [before, here, after] = [gap(end - 1), gap(end), gap(end + 1)];
                let (bend, tilt) = (before - here * L::splat(2.0) + after, before - after);
                let is_vertex = !before.less(here) & !after.less(here) & L::zero().less(bend);
                let vertex = here - tilt * tilt / (bend * L::splat(8.0));
                let least = L::select(is_vertex, vertex, here);
                lowest = L::select(trial.followed[block], lowest.min(least), lowest);
            }
            lowest.store(&mut tally.lowest[block]);
        }
    }
}
