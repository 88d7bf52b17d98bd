//! Largest displacements of the nodes of a blade without contact, and the energy of the blade.

use super::columns::displace;
use super::rows::BladeRows;
use super::surface::FacedSurface;
use super::trial::BladeTrial;
use crate::math::octet::{Octet, OctetKernel};

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
}

impl OctetKernel for FindClearance<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(self) -> bool {
        let Self { trial, rows, faced } = self;
        let [start, end, ..] = &faced.drives;
        if start.factor < 0.0 {
            return false;
        }
        let bumpiness = faced.surface.bumpiness();
        for block in 0..rows.blocks {
            let around = L::load(&trial.reach[1][block]) * L::load(&rows.per_radius[block]);
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
            let left = L::splat(start.clearance) + shape * L::splat(start.factor) - L::load(&trial.reach[0][block]);
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
