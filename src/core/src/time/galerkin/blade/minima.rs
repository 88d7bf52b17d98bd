//! Smallest gaps between the points of a step, for nodes that stay open.
//!
//! The polynomial through F at the points shows which nodes may come closer between the points. For these nodes, all
//! modes are evaluated exactly at the ends of equal parts of the step. Polynomials through these gaps give the smallest
//! gap. The amplitudes of the modes determine the number of parts.

use super::columns::{displace, sum};
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::surface::{FacedSurface, PointDrive};
use super::tally::BladeTally;
use super::trial::{BladeTrial, StartContacts};
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::response::TERMS;
use crate::time::galerkin::trial::{FALLING, NEAR};

/// Smallest and largest number of halvings of a step into the parts at whose ends the motion is evaluated.
pub(super) const MIN_HALVINGS: usize = 2;
const MAX_HALVINGS: usize = 7;
/// Largest number of parts of a step.
pub(super) const PARTS: usize = 1 << MAX_HALVINGS;
/// If at most this number of nodes per block of eight is followed, their displacements are computed node by node.
const FEW_PER_BLOCK: usize = 4;
/// Nodes are followed if they may come closer between the points by more than this fraction of the tolerance.
const FOLLOW_FRACTION: f64 = 0.1;
/// Largest bound on the interpolation error between the ends of parts, as a fraction of the tolerance.
const PARTS_FRACTION: f64 = 0.3;

/// Largest error of the interpolated motion of a mode relative to its amplitude. Neither the motion nor its
/// interpolation exceeds the amplitude, so the error is at most twice as large.
const UNRESOLVED: f64 = 2.0;
/// Coefficients of x⁴ and x⁵ in the interpolation error near the middle one of five gaps at equal distances. The
/// neglected fourth derivative causes the x⁴ term, and the error of the third derivative the x⁵ term. Near the first and
/// the last gap, the second coefficient is at most half as large again.
const PART_ERROR: [f64; 2] = [1.0 / 384.0, 1.0 / 48.0];
/// Coefficient of x⁴ in the error of the cubic through the points of a step. It holds for the parabola as well, because
/// the points of a step follow the moments of the motion.
const STEP_ERROR: [f64; 2] = [1.0 / 384.0, 0.0];

/// First three derivatives at the first of five values at equal distances, as weights of the differences of the other four
/// from the first.
const FROM_END: [[f64; 4]; 3] =
    [[4.0, -3.0, 4.0 / 3.0, -0.25], [-26.0 / 3.0, 9.5, -14.0 / 3.0, 11.0 / 12.0], [9.0, -12.0, 7.0, -1.5]];

impl BladeTrial {
    /// Returns the largest interpolation error of the closing displacement of a node between the points of the tried
    /// step (m).
    pub(super) fn unresolved_motion(&mut self, rows: &BladeRows, level: &BladeLevel) -> f64 {
        self.find_interpolation_error(rows, level.step, STEP_ERROR)
    }

    /// Returns how often the tried step is halved into the parts in which nodes are followed. Between the ends of these
    /// parts, the bound on the interpolation error is below a fraction of `tolerance` (m).
    pub(super) fn find_halvings(&mut self, rows: &BladeRows, level: &BladeLevel, tolerance: f64) -> usize {
        let is_fine = |halvings: &usize| {
            let length = level.step * fraction(1, 1 << halvings);
            self.find_interpolation_error(rows, length, PART_ERROR) <= PARTS_FRACTION * tolerance
        };
        (MIN_HALVINGS..MAX_HALVINGS).find(is_fine).unwrap_or(MAX_HALVINGS)
    }
}

/// Finds the nodes that may come closer between the points than at the points, and whose smallest gap an output needs.
/// Returns whether there are such nodes. Records the gaps of all other nodes at the points, and the gaps of all nodes
/// at the end of the step.
pub(super) struct FindMinima<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    pub tally: &'a mut BladeTally,
    /// Gaps below which the smallest gaps are needed (m).
    pub floors: &'a [Eight],
    /// Largest displacement error of a step (m), and largest error of the motion between the points (m).
    pub tolerance: f64,
    pub unresolved: f64,
}

impl OctetKernel for FindMinima<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, level, tally, floors, tolerance, unresolved } = self;
        let mut found = false;
        // The first round uses one bound for all nodes. The second uses a bound for each node, and drops most of the
        // nodes.
        let bounds = &mut trial.path_moved[0];
        bounds.fill(Eight([unresolved; 8]));
        for look in 0..2 {
            found = false;
            for block in 0..rows.blocks {
                trial.followed[block] = choose::<L>(trial, (rows, level, block), tally, floors[block], tolerance);
                found |= trial.followed[block] != 0;
            }
            if !found || look == 1 {
                break;
            }
            displace::<L, 1>(&rows.magnitudes[0], rows.blocks, [&trial.path_modes[0]], &mut trial.path_moved[0]);
        }
        for block in 0..rows.blocks {
            let (followed, last) = (trial.followed[block], level.points() - 1);
            let mut lowest = L::load(&tally.lowest[block]);
            for point in 0..level.points() {
                let lane = point * rows.blocks + block;
                let (steepness, sigma) = (L::load(&rows.steepness[block]), L::load(&trial.sigma[lane]));
                let gap = L::load(&trial.gaps[lane]) / (steepness * steepness + sigma * sigma).sqrt();
                let exact = if point == last { 0xff } else { !followed };
                lowest = L::select(exact, lowest.min(gap), lowest);
            }
            lowest.store(&mut tally.lowest[block]);
        }
        found
    }
}

/// Selects the nodes of a block that may come closer between the points of the step.
#[inline(always)]
fn choose<L: Octet>(
    trial: &BladeTrial,
    (rows, level, block): (&BladeRows, &BladeLevel, usize),
    tally: &BladeTally,
    floor: Eight,
    tolerance: f64,
) -> u8 {
    let (basis, count) = (&level.basis, level.points() + 1);
    let slopes = both(|end| if end == 0 { basis.slopes_at(0.0) } else { basis.slopes_at(1.0) });
    let mut gaps = [L::zero(); POINTS];
    gaps[0] = L::load(&trial.start.gaps[block]);
    let mut pushes = L::zero().less(L::load(&trial.start.multipliers[block]));
    let (mut low, mut ends) = (gaps[0], [gaps[0]; 2]);
    let mut steepest = L::load(&trial.start.sigma[block]).abs();
    for point in 1..count {
        let lane = (point - 1) * rows.blocks + block;
        gaps[point] = L::load(&trial.gaps[lane]);
        pushes |= L::zero().less(L::load(&trial.multipliers[lane]));
        low = low.min(gaps[point]);
        ends[1] = gaps[point];
        steepest = steepest.max(L::load(&trial.sigma[lane]).abs());
    }
    let unresolved = L::load(&trial.path_moved[0][block]);
    let left = sum(&gaps[..count], &basis.left_out).abs() * L::splat(NEAR) + unresolved;
    let mut within = L::splat(f64::INFINITY);
    for place in &basis.between {
        within = within.min(sum(&gaps[..count], place));
    }
    let deeper = low - within;
    let at_end = ends[1].less(ends[0]);
    let slope = L::select(at_end, sum(&gaps[..count], &slopes[1]), sum(&gaps[..count], &slopes[0])).abs();
    let falls = !L::zero().less(deeper) & (left * L::splat(FALLING)).less(slope);
    let comes = L::splat(FOLLOW_FRACTION * tolerance).less(deeper.max(L::zero()) + left);
    let steepness = L::load(&rows.steepness[block]);
    let size = (steepness * steepness + steepest * steepest).sqrt();
    let bar = L::load(&floor).min(L::load(&tally.lowest[block]));
    let matters = ((low.min(within) - left) / size).less(bar);
    comes & matters & !falls & !pushes & rows.valid(block)
}

/// Bounds the interpolation error of the motion of all modes between points at equal distances: returns the largest
/// bound for the closing displacement of a node (m). The modal forces must be known and the modes not yet advanced.
pub(super) struct FindInterpolationError<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    /// Distance of the points (s), and coefficients of x⁴ and x⁵ in the error of a mode relative to its amplitude. x is
    /// ω times the distance. The error of a mode is at most [`UNRESOLVED`] times its amplitude.
    pub length: f64,
    pub terms: [f64; 2],
    /// True if forces act in the step.
    pub pushes: bool,
}

impl OctetKernel for FindInterpolationError<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<L: Octet>(self) -> f64 {
        let Self { trial, rows, length, terms, pushes } = self;
        let BladeTrial { start: StartContacts { modes: [q, v], .. }, modal_forces, path_modes, .. } = trial;
        let [rates, per_frequency, squares] = &rows.rates;
        let mut error = L::zero();
        for (k, largest) in rows.largest.iter().enumerate() {
            let (q, v, per_frequency) = (L::load(&q[k]), L::load(&v[k]), L::load(&per_frequency[k]));
            let turned = (v + L::load(&rates[k]) * q) * per_frequency;
            let mut amplitude = (q * q + turned * turned).sqrt();
            if pushes {
                let [a, b, c] = modal_forces.each_ref().map(|force| L::load(&force[k]).abs());
                amplitude = amplitude + (a + b + c) * per_frequency * per_frequency * L::splat(2.0);
            }
            let square = L::load(&squares[k]) * L::splat(length * length);
            let share = square * square * (L::splat(terms[0]) + square.sqrt() * L::splat(terms[1]));
            let mode_error = amplitude * share.min(L::splat(UNRESOLVED));
            mode_error.store(&mut path_modes[0][k]);
            error = error + L::load(largest) * mode_error;
        }
        error.total()
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

    /// Records the smallest gaps, each at the end of a part or at the vertex of a polynomial near the end of a part.
    #[inline(always)]
    fn record<L: Octet>(&mut self, parts: usize) {
        let Self { trial, rows, tally, .. } = self;
        for block in 0..rows.blocks {
            let followed = trial.followed[block];
            if followed == 0 {
                continue;
            }
            let gap = |end: usize| L::load(&trial.path_gaps[end * rows.blocks + block]);
            let mut lowest = L::load(&tally.lowest[block]);
            for end in 1..parts {
                let near @ [before, here, after] = [gap(end - 1), gap(end), gap(end + 1)];
                let is_lowest = followed & !before.less(here) & !after.less(here);
                if is_lowest == 0 {
                    continue;
                }
                let far = (end > 1 && end + 1 < parts).then(|| [gap(end - 2), gap(end + 2)]);
                lowest = L::select(is_lowest, lowest.min(vertex(near, far)), lowest);
            }
            for backwards in [false, true] {
                let from_end = |place: usize| gap(if backwards { parts - place } else { place });
                let near @ [here, next, ..] = [0, 1, 2, 3, 4].map(from_end);
                let is_lowest = followed & !next.less(here);
                if is_lowest != 0 {
                    lowest = L::select(is_lowest, lowest.min(vertex_from_end(near)), lowest);
                }
            }
            lowest.store(&mut tally.lowest[block]);
        }
    }
}

/// Returns the smallest value near the middle one of three values at equal distances; the middle value is the lowest.
/// It belongs to the parabola through the three values. With the two values beyond them, it belongs to a cubic that has
/// the derivatives of the polynomial through all five.
#[inline(always)]
fn vertex<L: Octet>([before, here, after]: [L; 3], far: Option<[L; 2]>) -> L {
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
    L::select(at.abs().less(L::splat(1.0)), here.min(cubic_vertex(here, [slope, bend, third])), here)
}

/// Smallest value within the first interval of five values at equal distances: that of a cubic with the derivatives of the
/// polynomial through the five.
#[inline(always)]
fn vertex_from_end<L: Octet>(values: [L; 5]) -> L {
    let here = values[0];
    let derivatives = FROM_END.map(|weights| {
        // Differences of close values round least.
        let terms = values[1..].iter().zip(weights);
        terms.fold(L::zero(), |sum, (value, weight)| sum + (*value - here) * L::splat(weight))
    });
    let [slope, bend, _] = derivatives;
    let at = L::zero() - slope / bend;
    let is_inside = L::zero().less(at) & at.less(L::splat(1.0));
    L::select(is_inside, here.min(cubic_vertex(here, derivatives)), here)
}

/// Value of a cubic with these derivatives near its origin, `here`, at the vertex of its parabola; `here` if it has none.
#[inline(always)]
fn cubic_vertex<L: Octet>(here: L, [slope, bend, third]: [L; 3]) -> L {
    let at = L::zero() - slope / bend;
    let value = here + at * (slope + at * (bend * L::splat(0.5) + at * third * L::splat(1.0 / 6.0)));
    L::select(L::zero().less(bend), value, here)
}
