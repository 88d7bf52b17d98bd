//! Largest displacements of the nodes of a blade without contact, and the energy of the blade.

use super::columns::displace;
use super::off_centre::Directions;
use super::rows::BladeRows;
use super::surface::{FacedSurface, PointDrive};
use super::trial::BladeTrial;
use crate::math::octet::{Octet, OctetKernel, both};
use crate::time::galerkin::record::ShaftBounds;

/// See [`BladeTrial::find_reach`].
pub(super) struct FindReach<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
}

impl OctetKernel for FindReach<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { trial, rows } = self;
        let BladeTrial { start, free_amplitudes, reach, .. } = trial;
        let ([q, v], [rates, per_frequency, ..]) = (&start.modes, &rows.rates);
        for (k, amplitude) in free_amplitudes.iter_mut().enumerate() {
            let (q, v) = (L::load(&q[k]), L::load(&v[k]));
            let turned = (v + L::load(&rates[k]) * q) * L::load(&per_frequency[k]);
            (q * q + turned * turned).sqrt().store(amplitude);
        }
        let ([closing, around], [closing_reach, around_reach]) = (&rows.magnitudes, reach);
        displace::<L, 2, 1>([closing, around], rows.blocks, [free_amplitudes], [closing_reach, around_reach]);
    }
}

/// See [`BladeTrial::find_clearance`].
pub(super) struct FindClearance<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub faced: &'a FacedSurface<'a>,
    pub shaft: &'a ShaftBounds,
}

impl OctetKernel for FindClearance<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, faced, shaft } = self;
        let [start, end, ..] = &faced.drives;
        if start.factor < 0.0 {
            return false;
        }
        let bumpiness = faced.surface.bumpiness();
        for block in 0..rows.blocks {
            let mut around = L::load(&trial.reach[1][block]) * L::load(&rows.per_radius[block]);
            let mut closed = L::load(&trial.reach[0][block]);
            if faced.is_off_centre {
                let angles = both(|of| L::load(&trial.directions_of_nodes[of][block]));
                closed = closed + closed_by_shaft(rows, block, angles, [start, end], shaft, around);
                // The angle of the node about the axis of the casing differs from its angle about the shaft.
                around = around + L::splat(SAFETY * shaft.offset) * L::load(&rows.per_radius[block]);
            }
            let angles = L::load(&trial.angles[block]);
            let from = angles + L::splat(start.turned.min(end.turned)) - around;
            let to = angles + L::splat(start.turned.max(end.turned)) + around;
            let ([low, ..], [high, ..]) =
                (faced.surface.evaluate_octet::<L>(from), faced.surface.evaluate_octet::<L>(to));
            let width = to - from;
            let shape = match bumpiness {
                Some(curvature) => low.min(high) - width * width * L::splat(0.125 * curvature),
                None => L::zero(),
            };
            let left = L::splat(start.clearance) + shape * L::splat(start.factor) - closed;
            let valid = rows.valid(block);
            if L::zero().less(left) & valid != valid {
                return false;
            }
            // The gap is F/N with N ≥ M; on a flank below 45° N ≤ √2 M.
            let smallest = left / (L::load(&rows.steepness[block]) * L::splat(std::f64::consts::SQRT_2));
            L::select(valid, smallest, L::zero()).store(&mut trial.gap_bounds[block]);
        }
        true
    }
}

/// Safety factor for terms of higher order in the ratio of the shaft offset to the radius, which is at most 0.1.
const SAFETY: f64 = 1.25;

/// Bounds the reduction of the clearance (m) by an off-centre shaft between two drives, for nodes whose circumferential
/// displacement is at most `around` (rad).
#[inline(always)]
fn closed_by_shaft<L: Octet>(
    rows: &BladeRows,
    block: usize,
    angles: [L; 2],
    drives: [&PointDrive; 2],
    shaft: &ShaftBounds,
    around: L,
) -> L {
    let frame = Directions::new(angles, (0.0, 1.0), L::zero());
    let [outwards, _] = frame.local(&drives[0].shaft);
    let [outwards_later, _] = frame.local(&drives[1].shaft);
    let (slope, per_radius) = (L::load(&rows.slopes[block]), L::load(&rows.per_radius[block]));
    let along = both(|end| slope * L::splat(drives[end].shaft[2]));
    // ρ − r − u_r is at most e_r + e²/(2a).
    let bend = L::splat(SAFETY * shaft.offset * shaft.offset) * per_radius;
    // The axial displacement deviates from its chord too.
    let chord_deviation = L::splat(shaft.chord_deviation) * L::load(&rows.steepness[block]);
    let most = outwards.max(outwards_later) + chord_deviation + L::splat(shaft.offset) * around;
    most + bend - along[0].min(along[1])
}

/// See [`BladeTrial::energy`].
pub(super) struct Energy<'a> {
    pub trial: &'a BladeTrial,
    pub rows: &'a BladeRows,
}

impl OctetKernel for Energy<'_> {
    type Output = f64;
    #[inline(always)]
    fn run<L: Octet>(self) -> f64 {
        let Self { trial, rows } = self;
        let start = &trial.start;
        let [q, v] = &start.modes;
        let mut sum = L::zero();
        for (k, (q, v)) in q.iter().zip(v).enumerate() {
            let (q, v) = (L::load(q), L::load(v));
            sum = sum + v * v + q * q * L::load(&rows.rates[2][k]);
        }
        for along in [0, 1] {
            for (force, held) in start.forces[along].iter().zip(&start.held[along]) {
                sum = sum + L::load(force) * L::load(held);
            }
        }
        0.5 * sum.total()
    }
}
