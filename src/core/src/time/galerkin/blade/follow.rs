//! Smallest gaps within a step, from the motion of all modes at the ends of equal parts of the step, or from gaps and
//! their rates at two times.

use super::columns::displace;
use super::level::BladeLevel;
use super::minima::{PARTS_FRACTION, fraction};
use super::rows::BladeRows;
use super::surface::{FacedSurface, PointDrive};
use super::tally::BladeTally;
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::response::TERMS;
use std::ops::RangeInclusive;

/// Largest number of followed nodes per block of eight whose displacements are computed node by node.
const FEW_PER_BLOCK: usize = 4;
/// First three derivatives at the first of five values at equal distances, as weights of the differences of the other four
/// from the first.
const END_DERIVATIVES: [[f64; 4]; 3] =
    [[4.0, -3.0, 4.0 / 3.0, -0.25], [-26.0 / 3.0, 9.5, -14.0 / 3.0, 11.0 / 12.0], [9.0, -12.0, 7.0, -1.5]];

/// Follows the nodes found by [`FindMinima`](super::minima::FindMinima). The modal forces must be known and the modes not yet advanced.
pub(super) struct Follow<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    /// Tables for the lengths of the step, half of it, and so on to the length of a part.
    pub halves: &'a [&'a BladeLevel],
    pub faced: &'a FacedSurface<'a>,
    /// Prescribed motion at the end of each part.
    pub drives: &'a [PointDrive],
    pub tally: &'a mut BladeTally,
    /// True if forces act in the step.
    pub pushes: bool,
    /// Ends of the part of the step whose gaps are recorded, as fractions of the step.
    pub ends: [f64; 2],
}

impl OctetKernel for Follow<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(mut self) {
        let parts = self.drives.len() - 1;
        for of in [0, 1] {
            self.trial.path_modes[of].copy_from_slice(&self.trial.start.modes[of]);
        }
        let wanted = needed_part_ends(self.ends, parts);
        self.go_to::<L>(*wanted.start(), parts);
        for end in wanted.clone() {
            self.find_gaps::<L>(end, parts);
            if end < *wanted.end() {
                self.advance::<L>(self.halves.len() - 1, end, parts);
            }
        }
        self.record::<L>(parts, wanted);
    }
}

impl Follow<'_> {
    /// Advances the modes from the start of the step to the end of a part, in as few advances as possible.
    #[inline(always)]
    fn go_to<L: Octet>(&mut self, end: usize, parts: usize) {
        let mut reached = 0;
        for halvings in 0..self.halves.len() {
            let size = parts >> halvings;
            if reached + size <= end {
                self.advance::<L>(halvings, reached, parts);
                reached += size;
            }
        }
    }
}

/// Returns the ends of parts whose gaps determine the smallest gaps between two fractions of the step.
fn needed_part_ends(ends: [f64; 2], parts: usize) -> RangeInclusive<usize> {
    let [from, to] = ends.map(|end| end * fraction(parts, 1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the few parts")]
    let (first, last) = (from.floor() as usize, to.ceil() as usize);
    let first = if last == parts { first.min(parts - 2) } else { first };
    let last = if first == 0 { last.max(2) } else { last };
    first.saturating_sub(2)..=(last + 2).min(parts)
}

impl Follow<'_> {
    /// Finds the gaps of the followed nodes after `end` of the `parts` parts, without the instantaneous displacements
    /// that forces on other nodes cause.
    #[inline(always)]
    fn find_gaps<L: Octet>(&mut self, end: usize, parts: usize) {
        self.displace_followed::<L>();
        let Self { trial, rows, level, faced, drives, pushes, .. } = self;
        let BladeTrial { start, path_moved, path_gaps, forces, multipliers, angles, followed, .. } = &mut **trial;
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
        for block in (0..rows.blocks).filter(|block| followed[*block] != 0) {
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

    /// Finds the displacements of the followed nodes, node by node if there are few of them.
    #[inline(always)]
    fn displace_followed<L: Octet>(&mut self) {
        let Self { trial, rows, .. } = self;
        let BladeTrial { path_modes, path_moved, followed, .. } = &mut **trial;
        let count: u32 = followed.iter().map(|nodes| nodes.count_ones()).sum();
        for (along, moved) in path_moved.iter_mut().enumerate() {
            if count as usize > FEW_PER_BLOCK * rows.blocks {
                displace::<L, 1>(&rows.shapes[along], rows.blocks, [&path_modes[0]], moved);
                continue;
            }
            for (block, moved) in moved.iter_mut().enumerate() {
                let mut nodes = followed[block];
                while nodes != 0 {
                    let i = nodes.trailing_zeros() as usize;
                    nodes &= nodes - 1;
                    let first = (along * rows.nodes + 8 * block + i) * rows.mode_blocks;
                    let shapes = &rows.by_row[first..][..rows.mode_blocks];
                    let mut sum = L::zero();
                    for (shape, mode) in shapes.iter().zip(&path_modes[0]) {
                        sum = sum + L::load(shape) * L::load(mode);
                    }
                    moved.0[i] = sum.total();
                }
            }
        }
    }

    /// Advances the modes from the end of a part, over the step length halved `halvings` times.
    #[inline(always)]
    fn advance<L: Octet>(&mut self, halvings: usize, end: usize, parts: usize) {
        let Self { trial, halves, pushes, .. } = self;
        let table = halves[halvings];
        let BladeTrial { path_modes: [position, velocity], modal_forces, .. } = &mut **trial;
        let (from, length) = (L::splat(fraction(end, parts)), L::splat(fraction(1, 1 << halvings)));
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

    /// Records the smallest gaps, each at the end of a part or at the vertex of a polynomial near the end of a part.
    #[inline(always)]
    fn record<L: Octet>(&mut self, parts: usize, known: RangeInclusive<usize>) {
        let Self { trial, rows, tally, ends, .. } = self;
        let [from, to] = ends.map(|end| end * fraction(parts, 1));
        let within = |place: L| !place.less(L::splat(from)) & !L::splat(to).less(place);
        for block in 0..rows.blocks {
            let followed = trial.followed[block];
            if followed == 0 {
                continue;
            }
            let gap = |end: usize| L::load(&trial.path_gaps[end * rows.blocks + block]);
            let mut lowest = L::load(&tally.lowest[block]);
            for end in known.start() + 1..*known.end() {
                let near @ [before, here, after] = [gap(end - 1), gap(end), gap(end + 1)];
                let is_lowest = followed & !before.less(here) & !after.less(here);
                if is_lowest == 0 {
                    continue;
                }
                let far =
                    (known.contains(&(end + 2)) && end >= known.start() + 2).then(|| [gap(end - 2), gap(end + 2)]);
                for (at, value) in [(L::zero(), here), vertex(near, far)] {
                    let counts = is_lowest & within(L::splat(fraction(end, 1)) + at);
                    lowest = L::select(counts, lowest.min(value), lowest);
                }
            }
            for backwards in [false, true] {
                if !known.contains(&if backwards { parts } else { 0 }) {
                    continue;
                }
                let from_end = |place: usize| gap(if backwards { parts - place } else { place });
                let near @ [here, next, ..] = [0, 1, 2, 3, 4].map(from_end);
                let is_lowest = followed & !next.less(here);
                if is_lowest != 0 {
                    for (at, value) in [(L::zero(), here), vertex_from_end(near)] {
                        let place = if backwards { L::splat(fraction(parts, 1)) - at } else { at };
                        let counts = is_lowest & within(place);
                        lowest = L::select(counts, lowest.min(value), lowest);
                    }
                }
            }
            lowest.store(&mut tally.lowest[block]);
        }
    }
}

/// Returns the place (relative to the middle) and value of the minimum near the middle one of three values at equal
/// distances. The middle value must be the lowest. The minimum is that of the parabola through the three values. If the
/// two values beyond them are known, it is that of a cubic with the derivatives of the polynomial through all five.
#[inline(always)]
fn vertex<L: Octet>([before, here, after]: [L; 3], far: Option<[L; 2]>) -> (L, L) {
    let (bend, tilt) = (before - here * L::splat(2.0) + after, after - before);
    let (slope, bend, third) = match far {
        None => (tilt * L::splat(0.5), bend, L::zero()),
        Some([first, last]) => {
            let wide = first - here * L::splat(2.0) + last;
            (
                tilt * L::splat(2.0 / 3.0) - (last - first) * L::splat(1.0 / 12.0),
                bend * L::splat(4.0 / 3.0) - wide * L::splat(1.0 / 12.0),
                (last - first) * L::splat(0.5) - tilt,
            )
        }
    };
    let at = L::zero() - slope / bend;
    let is_near = at.abs().less(L::splat(1.0));
    let value = L::select(is_near, cubic_vertex(here, [slope, bend, third]), here);
    (L::select(is_near, at, L::zero()), value)
}

/// Returns the place and value of the minimum within the first interval of five values at equal distances. The minimum is
/// that of a cubic with the derivatives of the polynomial through the five values.
#[inline(always)]
fn vertex_from_end<L: Octet>(values: [L; 5]) -> (L, L) {
    let here = values[0];
    let derivatives = END_DERIVATIVES.map(|weights| {
        // Differences of similar values have the smallest rounding errors.
        let terms = values[1..].iter().zip(weights);
        terms.fold(L::zero(), |sum, (value, weight)| sum + (*value - here) * L::splat(weight))
    });
    let [slope, bend, _] = derivatives;
    let at = L::zero() - slope / bend;
    let is_inside = L::zero().less(at) & at.less(L::splat(1.0));
    let value = L::select(is_inside, cubic_vertex(here, derivatives), here);
    (L::select(is_inside, at, L::zero()), value)
}

/// Returns the value of a cubic with the value `here` and these derivatives at its origin, at the vertex of its parabola.
/// Returns `here` if the parabola has no minimum.
#[inline(always)]
fn cubic_vertex<L: Octet>(here: L, [slope, bend, third]: [L; 3]) -> L {
    let at = L::zero() - slope / bend;
    let value = here + at * (slope + at * (bend * L::splat(0.5) + at * third * L::splat(1.0 / 6.0)));
    L::select(L::zero().less(bend), value, here)
}

/// Records the smallest gaps of open nodes between two times, from cubics through the gaps and their rates at both.
/// Returns whether the error is too large for some nodes; these are followed.
pub(super) struct CubicMinima<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub tally: &'a mut BladeTally,
    /// Gaps below which the smallest gaps are needed, and gaps at the first time (m).
    pub floors: &'a [Eight],
    pub begun: &'a [Eight],
    /// Time between both (s).
    pub length: f64,
    /// Largest error of the closing displacement, and largest displacement error of a step (m).
    pub error: f64,
    pub tolerance: f64,
}

impl OctetKernel for CubicMinima<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, tally, floors, begun, length, error, tolerance } = self;
        let (mut found, third) = (0, L::splat(length / 3.0));
        for block in 0..rows.blocks {
            let (sigma, steepness) = (L::load(&trial.sample.sigma[block]), L::load(&rows.steepness[block]));
            let first = L::load(&begun[block]);
            let last = L::load(&trial.sample.gaps[block]) / (steepness * steepness + sigma * sigma).sqrt();
            let inner =
                [first + L::load(&trial.rates_before[block]) * third, last - L::load(&trial.rates[block]) * third];
            // The cubic lies above the smallest of its four Bézier coefficients.
            let (ends, between) = (first.min(last), inner[0].min(inner[1]));
            let bar = L::load(&floors[block]).min(L::load(&tally.lowest[block]));
            let dips = between.less(ends + L::splat(error))
                & (between.min(ends) - L::splat(error)).less(bar)
                & rows.valid(block);
            trial.followed[block] = 0;
            if dips != 0 {
                let [slope, change] = [(inner[0] - first), (inner[1] - inner[0])].map(|part| part * L::splat(3.0));
                let terms = [first, slope, change - slope, (last - first) - change];
                let value = cubic_minimum(terms).min(ends);
                if error <= PARTS_FRACTION * tolerance {
                    let lowest = L::load(&tally.lowest[block]);
                    L::select(dips, lowest.min(value), lowest).store(&mut tally.lowest[block]);
                } else {
                    trial.followed[block] = dips;
                }
            }
            found |= trial.followed[block];
        }
        found != 0
    }
}

/// Smallest value of a cubic within 0 ≤ θ ≤ 1 at which its slope is zero; infinite if there is none.
#[inline(always)]
fn cubic_minimum<L: Octet>([a, b, c, d]: [L; 4]) -> L {
    // The slope b + 2cθ + 3dθ² rises through zero at θ = −b/(√(c² − 3bd) + c).
    let square = c * c - L::splat(3.0) * b * d;
    let theta = L::zero() - b / (square.max(L::zero()).sqrt() + c);
    let is_inside = !square.less(L::zero()) & L::zero().less(theta) & theta.less(L::splat(1.0));
    L::select(is_inside, a + theta * (b + theta * (c + theta * d)), L::splat(f64::INFINITY))
}
