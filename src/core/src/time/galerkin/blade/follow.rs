//! Smallest gaps within a step, from cubics through the exact gaps and their rates at two times.

use super::columns::{add_modes, displace_nodes, put, sum, values_at_points};
use super::level::BladeLevel;
use super::minima::{amplitude, fraction, relative_error};
use super::off_centre::{OffCentreGaps, directions_of};
use super::rows::BladeRows;
use super::surface::{DriveRate, FacedSurface, PointDrive};
use super::tables::BladeTables;
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::parts::{FOLLOW_FRACTION, MAX_HALVINGS, MINIMUM_FRACTION, Part, PartSearch, search_parts};
use crate::time::galerkin::response::TERMS;
use crate::time::galerkin::tables::HALVINGS;
use crate::time::galerkin::trial::ForceInterpolation;
use std::marker::PhantomData;

/// Largest number of followed nodes of a block of eight whose displacements are computed node by node.
const FEW_PER_BLOCK: u32 = 3;

/// Exact motion of the followed nodes at a time within a step.
#[derive(Debug, Clone)]
pub(super) struct PathPoint {
    /// q and q̇.
    pub modes: [Vec<Eight>; 2],
    /// Gaps (m) and their rates (m/s).
    pub gaps: Vec<Eight>,
    pub rates: Vec<Eight>,
}

impl PathPoint {
    /// Allocates for a number of blocks of nodes and of modes.
    pub fn new(nodes: usize, modes: usize) -> Self {
        let of = |blocks: usize| vec![Eight::ZERO; blocks];
        Self { modes: [of(modes), of(modes)], gaps: of(nodes), rates: of(nodes) }
    }
}

/// Finds the smallest gaps of the nodes that [`SelectFollowed`](super::minima::SelectFollowed) selects. A cubic connects the
/// gaps and their rates at the ends of a part. Parts are halved, starting with the whole step, until the cubic shows that
/// the smallest gap is not needed, or is accurate enough to record its minimum. The modal forces must be known, and the
/// modes must still be those at the start of the step.
pub(super) struct Follow<'a, D> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    /// Tables of all lengths, and number of halvings of the span for the length of the step.
    pub tables: &'a BladeTables,
    pub step_level: usize,
    pub faced: &'a FacedSurface<'a>,
    /// Returns the prescribed motion and its rates at a fraction of the step.
    pub drive_at: D,
    /// Largest errors that the shape of the surface adds to a cubic over the whole step (m): the parts that are
    /// proportional to the length of the interval, to its square, and to its cube.
    pub shape_errors: [f64; 3],
    /// Smallest gaps so far (m).
    pub lowest: &'a mut [Eight],
    /// Gaps below which the smallest gaps are needed (m).
    pub floors: &'a [Eight],
    /// If a gap at an end of a part is below this limit (m), its minimum is always evaluated.
    pub refine_below: f64,
    /// Largest displacement error of a step (m).
    pub tolerance: f64,
    /// True if forces act in the step.
    pub pushes: bool,
    /// Ends of the part of the step whose gaps are recorded, as fractions of the step.
    pub ends: [f64; 2],
}

impl<D: Fn(f64) -> (PointDrive, DriveRate)> OctetKernel for Follow<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(mut self) {
        for of in [0, 1] {
            self.trial.path[0].modes[of].copy_from_slice(&self.trial.start.modes[of]);
        }
        if self.trial.unresolved.is_none() {
            self.find_amplitudes::<L>();
        }
        self.find_gaps::<L>(0, 0.0);
        self.advance::<L>(Part::WHOLE, 0);
        self.find_gaps::<L>(1, 1.0);
        search_parts(&mut BladePartSearch { follow: self, lanes: PhantomData::<L> });
    }
}

/// The search for smallest gaps in parts of the step.
struct BladePartSearch<'a, D, L> {
    follow: Follow<'a, D>,
    lanes: PhantomData<L>,
}

impl<D: Fn(f64) -> (PointDrive, DriveRate), L: Octet> PartSearch for BladePartSearch<'_, D, L> {
    #[inline(always)]
    fn interpolation_error(&mut self, halvings: usize) -> f64 {
        self.follow.interpolation_error::<L>(halvings)
    }

    #[inline(always)]
    fn needs_halving(&mut self, part: Part, error: f64) -> bool {
        let [begin, end] = part.span();
        let is_recorded = end > self.follow.ends[0] && begin < self.follow.ends[1];
        is_recorded && self.follow.needs_halving::<L>(part, error)
    }

    #[inline(always)]
    fn find_middle(&mut self, part: Part, middle: usize) {
        let [begin, end] = part.span();
        self.follow.advance::<L>(Part { ends: [part.ends[0], middle], ..part }, 1);
        self.follow.find_gaps::<L>(middle, 0.5 * (begin + end));
    }
}

impl<D: Fn(f64) -> (PointDrive, DriveRate)> Follow<'_, D> {
    /// Computes the amplitude of each mode times the largest closing displacement of a node per unit amplitude.
    #[inline(always)]
    fn find_amplitudes<L: Octet>(&mut self) {
        let BladeTrial { start, modal_forces, amplitudes, .. } = &mut *self.trial;
        let forced_step = self.pushes.then_some(self.level.step);
        for (k, (target, largest)) in amplitudes.iter_mut().zip(&self.rows.largest).enumerate() {
            (L::load(largest) * amplitude::<L>(self.rows, start, modal_forces, k, forced_step)).store(target);
        }
    }

    /// Bounds the error of the cubic over a part (m).
    #[inline(always)]
    fn interpolation_error<L: Octet>(&self, halvings: usize) -> f64 {
        let share = fraction(1, 1 << halvings);
        let length = L::splat(self.level.step * share);
        let shape_error = self.shape_errors.iter().rev().fold(0.0, |sum, error| share * (sum + error));
        let mut error = L::zero();
        for (amplitude, frequency) in self.trial.amplitudes.iter().zip(&self.rows.rates[3]) {
            error = error + L::load(amplitude) * relative_error(L::load(frequency) * length);
        }
        error.total() + shape_error
    }

    /// Records the smallest gaps within a part if the cubics are accurate enough. Returns whether the part must be halved
    /// instead.
    #[inline(always)]
    fn needs_halving<L: Octet>(&mut self, part: Part, error: f64) -> bool {
        let length = self.level.step * part.length();
        let third = L::splat(length / 3.0);
        let is_last = part.halvings == MAX_HALVINGS.min(HALVINGS - self.step_level);
        let is_accurate = is_last || error <= MINIMUM_FRACTION * self.tolerance;
        let [begin, end] = part.span();
        let [from, to] = self.ends.map(|fraction| L::splat((fraction - begin) / (end - begin)));
        let Self { trial, rows, lowest, floors, tolerance, refine_below, .. } = &mut *self;
        for block in 0..rows.blocks {
            let followed = trial.followed[block];
            if followed == 0 {
                continue;
            }
            let [before, after] = both(|end| &trial.path[part.ends[end]]);
            let [first, last] = [before, after].map(|point| L::load(&point.gaps[block]));
            let inner = [first + L::load(&before.rates[block]) * third, last - L::load(&after.rates[block]) * third];
            let known = L::load(&lowest[block]);
            let threshold = (L::load(&floors[block]) - L::splat(FOLLOW_FRACTION * *tolerance)).min(known);
            let ends = first.min(last);
            let dips = find_dips(ends, inner[0].min(inner[1]), error, threshold) | ends.less(L::splat(*refine_below));
            let dips = dips & followed;
            if dips == 0 {
                continue;
            }
            if !is_accurate {
                return true;
            }
            let (theta, value) = cubic_minimum([first, inner[0], inner[1], last]);
            let within = dips & from.less(theta) & theta.less(to);
            L::select(within, known.min(value), known).store(&mut lowest[block]);
        }
        false
    }

    /// Computes the gaps of the followed nodes and their rates at a stored time. Records the gaps if the time is within the
    /// recorded part of the step.
    #[inline(always)]
    fn find_gaps<L: Octet>(&mut self, stored: usize, theta: f64) {
        self.displace_followed::<L>(stored);
        if self.pushes {
            self.add_quasi_static::<L>(theta);
        }
        let (drive, rate) = (self.drive_at)(theta);
        let Self { trial, rows, faced, ends, .. } = self;
        let is_recorded = ends[0] <= theta && theta <= ends[1];
        let BladeTrial { path, path_moved, angles, directions_of_nodes, followed, evaluated, .. } = &mut **trial;
        evaluated.count(followed.iter().filter(|followed| **followed != 0).count(), 4);
        for block in (0..rows.blocks).filter(|block| followed[*block] != 0) {
            let per_radius = L::load(&rows.per_radius[block]);
            let [closing, around] = both(|along| L::load(&path_moved[along][block]));
            let [closing_rate, around_rate] = both(|along| L::load(&path_moved[along][rows.blocks + block]));
            let (clear, sigma, rate) = if faced.is_off_centre {
                let place = (L::load(&angles[block]), directions_of(directions_of_nodes, block));
                let seen = OffCentreGaps::new(faced.surface, &drive, (rows, block), place, [closing, around]);
                let slope = L::load(&rows.slopes[block]);
                (seen.clear, seen.sigma, seen.rate(&drive, &rate, slope, [closing_rate, around_rate]))
            } else {
                let at = L::load(&angles[block]) + L::splat(drive.turned) + around * per_radius;
                let [shape, slope, _] = faced.surface.evaluate_octet::<L>(at);
                let factor = L::splat(drive.factor);
                let opening = L::splat(rate.clearance) + shape * L::splat(rate.factor) + closing_rate;
                let rate = opening + slope * factor * (L::splat(rate.turned) + around_rate * per_radius);
                (L::splat(drive.clearance) + shape * factor, slope * factor * per_radius, rate)
            };
            let steepness = L::load(&rows.steepness[block]);
            let size = (steepness * steepness + sigma * sigma).sqrt();
            let gap = (clear + closing) / size;
            let change = rate / size;
            gap.store(&mut path[stored].gaps[block]);
            change.store(&mut path[stored].rates[block]);
            if is_recorded {
                let lowest = L::load(&self.lowest[block]);
                L::select(followed[block], lowest.min(gap), lowest).store(&mut self.lowest[block]);
            }
        }
    }

    /// Computes the displacements and velocities of the followed nodes, node by node if there are few of them.
    #[inline(always)]
    fn displace_followed<L: Octet>(&mut self, stored: usize) {
        let Self { trial, rows, .. } = self;
        let BladeTrial { path, path_moved, followed, .. } = &mut **trial;
        let modes = &path[stored].modes;
        let crowded = |block: usize| followed[block].count_ones() > FEW_PER_BLOCK;
        let count = (0..rows.blocks).filter(|block| crowded(*block)).count();
        let ([closing, around], [closing_moved, around_moved]) = (&rows.shapes, &mut *path_moved);
        let (shapes, both_modes) = ([&closing[..], around], [&modes[0][..], &modes[1]]);
        let mut moved = [&mut closing_moved[..], around_moved];
        if count > 1 {
            displace_nodes::<L, 2, 2>(rows, [0, 1], rows.mode_blocks, both_modes, moved);
            return;
        }
        for block in 0..rows.blocks {
            if crowded(block) {
                put::<L, 2, 2, 1>(&add_modes(shapes, rows.blocks, block, both_modes), rows.blocks, block, &mut moved);
                continue;
            }
            let mut nodes = followed[block];
            while nodes != 0 {
                let i = nodes.trailing_zeros() as usize;
                nodes &= nodes - 1;
                let row = |along: usize| {
                    &rows.by_row[(along * rows.nodes + 8 * block + i) * rows.mode_blocks..][..rows.mode_blocks]
                };
                let shapes = [row(0), row(1)];
                let mut sums = [L::zero(); 4];
                for k in 0..rows.mode_blocks {
                    let [position, velocity] = both(|of| L::load(&modes[of][k]));
                    let [closing, around] = both(|along| L::load(&shapes[along][k]));
                    sums[0] = sums[0] + closing * position;
                    sums[1] = sums[1] + closing * velocity;
                    sums[2] = sums[2] + around * position;
                    sums[3] = sums[3] + around * velocity;
                }
                for (place, sum) in sums.into_iter().enumerate() {
                    moved[place / 2][(place % 2) * rows.blocks + block].0[i] = sum.total();
                }
            }
        }
    }

    /// Adds the quasi-static displacements under the forces at a fraction of the step, and their rates.
    #[inline(always)]
    fn add_quasi_static<L: Octet>(&mut self, theta: f64) {
        let Self { trial, rows, level, .. } = self;
        let BladeTrial { start, path_moved, forces, multipliers, followed, .. } = &mut **trial;
        let (weights, slopes) = (level.basis.weights_at(theta), level.basis.slopes_at(theta));
        let (count, blocks, per_second) = (level.points() + 1, rows.blocks, 1.0 / level.step);
        for source in 0..blocks {
            let mut acting = 0;
            for multiplier in values_at_points::<L>(&start.multipliers, multipliers, source, count) {
                acting |= L::zero().less(multiplier);
            }
            if acting == 0 {
                continue;
            }
            // Forces (N) and their rates (N/s) along both directions.
            let mut of_forces = [[[0.0; 8]; 2]; 2];
            for along in [0, 1] {
                let values = values_at_points::<L>(&start.forces[along], &forces[along], source, count);
                of_forces[along][0] = sum(&values[..count], &weights).array();
                of_forces[along][1] = (sum(&values[..count], &slopes) * L::splat(per_second)).array();
            }
            for target in (0..blocks).filter(|target| followed[*target] != 0) {
                for (seen, moved) in path_moved.iter_mut().enumerate() {
                    let [mut position, mut velocity] = both(|of| L::load(&moved[of * blocks + target]));
                    let mut nodes = acting;
                    while nodes != 0 {
                        let i = nodes.trailing_zeros() as usize;
                        nodes &= nodes - 1;
                        for along in [0, 1] {
                            let flexibility = &rows.flexibility[along][seen][(8 * source + i) * blocks + target];
                            let flexibility = L::load(flexibility);
                            position = position + flexibility * L::splat(of_forces[along][0][i]);
                            velocity = velocity + flexibility * L::splat(of_forces[along][1][i]);
                        }
                    }
                    position.store(&mut moved[target]);
                    velocity.store(&mut moved[blocks + target]);
                }
            }
        }
    }

    /// Advances the modes from the start of a part to its second stored time. They are apart by the length of the part,
    /// halved `halvings` times.
    #[inline(always)]
    fn advance<L: Octet>(&mut self, part: Part, halvings: usize) {
        match (self.pushes, self.level.basis.degree) {
            (false, _) => self.advance_terms::<L, 2>(part, halvings),
            (true, 2) => self.advance_terms::<L, { TERMS - 1 }>(part, halvings),
            _ => self.advance_terms::<L, TERMS>(part, halvings),
        }
    }

    /// Advances the modes under modal forces with `COUNT` − 2 coefficients.
    #[inline(always)]
    fn advance_terms<L: Octet, const COUNT: usize>(&mut self, part: Part, halvings: usize) {
        let level = self.step_level + part.halvings + halvings;
        let table = self.tables.level(level, ForceInterpolation::Polynomial);
        let BladeTrial { path, modal_forces, .. } = &mut *self.trial;
        let [first, last] = part.ends;
        let (from, length) = (L::splat(part.span()[0]), L::splat(fraction(1, 1 << (part.halvings + halvings))));
        for k in 0..self.rows.mode_blocks {
            let mut terms = [L::zero(); TERMS];
            (terms[0], terms[1]) = (L::load(&path[first].modes[0][k]), L::load(&path[first].modes[1][k]));
            if COUNT > 2 {
                let (a, b) = (L::load(&modal_forces[0][k]), L::load(&modal_forces[1][k]));
                let c = L::load(&modal_forces[2][k]);
                terms[2] = a + from * (b + from * c);
                terms[3] = length * (b + L::splat(2.0) * from * c);
                terms[4] = length * length * c;
            }
            for of in [0, 1] {
                let mut end = L::zero();
                for term in 0..COUNT {
                    end = end + L::load(&table.end[of][term][k]) * terms[term];
                }
                end.store(&mut path[last].modes[of][k]);
            }
        }
    }
}

/// Records the smallest gaps of open nodes between two times, from cubics through the gaps and their rates at both.
/// Returns whether the error is too large for some nodes; these are followed.
pub(super) struct CubicMinima<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    /// Smallest gaps so far (m).
    pub lowest: &'a mut [Eight],
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
        let Self { trial, rows, lowest, floors, begun, length, error, tolerance } = self;
        let (mut found, third) = (0, L::splat(length / 3.0));
        for block in 0..rows.blocks {
            let (sigma, steepness) = (L::load(&trial.sample.sigma[block]), L::load(&rows.steepness[block]));
            let first = L::load(&begun[block]);
            let last = L::load(&trial.sample.gaps[block]) / (steepness * steepness + sigma * sigma).sqrt();
            let inner =
                [first + L::load(&trial.rates_before[block]) * third, last - L::load(&trial.rates[block]) * third];
            let (ends, between) = (first.min(last), inner[0].min(inner[1]));
            let threshold = L::load(&floors[block]).min(L::load(&lowest[block]));
            let dips = find_dips(ends, between, error, threshold) & rows.valid(block);
            trial.followed[block] = 0;
            if dips != 0 {
                let value = cubic_minimum([first, inner[0], inner[1], last]).1.min(ends);
                if error <= MINIMUM_FRACTION * tolerance {
                    let known = L::load(&lowest[block]);
                    L::select(dips, known.min(value), known).store(&mut lowest[block]);
                } else {
                    trial.followed[block] = dips;
                }
            }
            found |= trial.followed[block];
        }
        found != 0
    }
}

/// Returns the nodes whose gap may be smaller between two times than at both times, and smaller than `threshold`. `ends` contains
/// the smaller of the gaps at both times, and `between` the smaller of the two inner Bézier coefficients of each cubic.
#[inline(always)]
fn find_dips<L: Octet>(ends: L, between: L, error: f64, threshold: L) -> u8 {
    // At θ, the error is at most 16θ²(1 − θ)² times the largest error, and the inner coefficients have the weight 3θ(1 − θ).
    let near_ends = ends + L::splat(error * (4.0 / 3.0));
    between.less(near_ends) & (between.min(ends) - L::splat(error)).less(threshold)
}

/// Returns the place and value of the minimum of a cubic with these Bézier coefficients. The value is infinite if there is no
/// minimum within 0 < θ < 1.
#[inline(always)]
pub(super) fn cubic_minimum<L: Octet>([first, second, third, last]: [L; 4]) -> (L, L) {
    let (slope, change) = ((second - first) * L::splat(3.0), (third - second) * L::splat(3.0));
    let (square, cube) = (change - slope, (last - first) - change);
    // The slope b + 2cθ + 3dθ² rises through zero at θ = −b/(√(c² − 3bd) + c).
    let root = square * square - L::splat(3.0) * slope * cube;
    let theta = L::zero() - slope / (root.max(L::zero()).sqrt() + square);
    let is_inside = !root.less(L::zero()) & L::zero().less(theta) & theta.less(L::splat(1.0));
    let value = first + theta * (slope + theta * (square + theta * cube));
    (theta, L::select(is_inside, value, L::splat(f64::INFINITY)))
}
