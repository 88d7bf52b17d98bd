//! Displacements, gaps and sliding at the start of a step.

use super::columns::{displace, displace_nodes};
use super::off_centre::{Directions, OffCentreGaps, directions_of};
use super::rows::BladeRows;
use super::surface::FacedSurface;
use super::trial::BladeTrial;
use crate::math::octet::{Octet, OctetKernel, both};
use crate::math::vector::length;

/// Safety factor of the shaft speed, because displacements of the nodes change their sliding speed.
const SAFETY: f64 = 1.25;

/// Finds displacements, F and σ at the start of a step, and the direction of sliding.
pub(super) struct FindStart<'a> {
    /// True if displacements, F and σ are known.
    pub known: bool,
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub faced: &'a FacedSurface<'a>,
}

impl OctetKernel for FindStart<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { known, trial, rows, faced } = self;
        let BladeTrial { start, angles, directions_of_nodes, evaluated, .. } = trial;
        let [q, v] = &start.modes;
        for target in 0..rows.blocks {
            let mut held = both(|_| L::zero());
            for (block, multipliers) in start.multipliers.iter().enumerate() {
                let mut nodes = if start.pushed { L::zero().less(L::load(multipliers)) } else { 0 };
                while nodes != 0 {
                    let i = nodes.trailing_zeros() as usize;
                    nodes &= nodes - 1;
                    let force = both(|along| L::splat(start.forces[along][block].0[i]));
                    for seen in [0, 1] {
                        let place = (8 * block + i) * rows.blocks + target;
                        let [a, b] = both(|along| L::load(&rows.flexibility[along][seen][place]) * force[along]);
                        held[seen] = held[seen] + (a + b);
                    }
                }
            }
            held[0].store(&mut start.held[0][target]);
            held[1].store(&mut start.held[1][target]);
        }
        let drive = &faced.drives[0];
        // Nodes that vibrate more slowly than the rotor turns cannot reverse.
        let mut square = L::zero();
        for v in v {
            square = square + L::load(v) * L::load(v);
        }
        let square = square.total();
        let spin = drive.speed;
        let mut fastest = rows.largest_around * square.sqrt();
        if faced.is_off_centre {
            fastest += SAFETY * length(drive.shaft_velocity);
        }
        let reverses = fastest >= spin.abs() * rows.smallest_radius;
        if reverses {
            displace::<L, 1, 1>([&rows.shapes[1]], rows.blocks, [v], [&mut start.friction]);
        }
        if !known {
            let [closings, arounds] = &mut start.moved;
            displace_nodes::<L, 2, 1>(rows, [0, 1], rows.mode_blocks, [q], [closings, arounds]);
            evaluated.count(rows.blocks, 2);
        }
        for block in 0..rows.blocks {
            let per_radius = L::load(&rows.per_radius[block]);
            let mut speed =
                L::splat(spin) / per_radius + if reverses { L::load(&start.friction[block]) } else { L::zero() };
            if faced.is_off_centre && reverses {
                let frame = Directions::new(directions_of(directions_of_nodes, block), (0.0, 1.0), L::zero());
                speed = speed + frame.local(&drive.shaft_velocity)[1];
            }
            let (forwards, backwards) = (L::zero().less(speed), speed.less(L::zero()));
            let friction = L::select(forwards, L::splat(faced.friction), L::zero());
            L::select(backwards, L::splat(-faced.friction), friction).store(&mut start.friction[block]);
            if known {
                continue;
            }
            let [closing, around] =
                both(|along| L::load(&start.moved[along][block]) + L::load(&start.held[along][block]));
            closing.store(&mut start.moved[0][block]);
            around.store(&mut start.moved[1][block]);
            let (clear, sigma) = if faced.is_off_centre {
                let place = (L::load(&angles[block]), directions_of(directions_of_nodes, block));
                let seen = OffCentreGaps::new(faced.surface, drive, (rows, block), place, [closing, around]);
                (seen.clear, seen.sigma)
            } else {
                let at = L::load(&angles[block]) + L::splat(drive.turned) + around * per_radius;
                let [shape, slope, _] = faced.surface.evaluate_octet::<L>(at);
                let factor = L::splat(drive.factor);
                (L::splat(drive.clearance) + shape * factor, slope * factor * per_radius)
            };
            (clear + closing).store(&mut start.gaps[block]);
            // A node in contact keeps the σ with which its force was computed.
            let pushes = L::zero().less(L::load(&start.multipliers[block]));
            L::select(pushes, L::load(&start.sigma[block]), sigma).store(&mut start.sigma[block]);
        }
    }
}
