//! Displacements along the meridian of the surface, which are normal to the closing and the circumferential displacement.
//!
//! They do no work, but they shift the point of action of a contact force, which affects the moments on a moving shaft.

use super::columns::displace;
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::trial::ForceInterpolation;

/// Finds the meridional displacements at the start of a step and at its points.
pub(super) struct FindMeridional<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
}

impl OctetKernel for FindMeridional<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(mut self) {
        match self.level.points() {
            1 => self.move_freely::<L, 1>(),
            2 => self.move_freely::<L, 2>(),
            _ => self.move_freely::<L, 3>(),
        }
        let Self { trial, rows, level } = self;
        let BladeTrial { start, meridional, multipliers, forces, .. } = trial;
        let (at_start, lanes) = meridional.split_at_mut(rows.blocks);
        let lanes = &mut lanes[..level.blocks];
        for node in 0..rows.nodes {
            let (block, i) = (node / 8, node % 8);
            if start.multipliers[block].0[i] > 0.0 {
                let force = both(|along| start.forces[along][block].0[i]);
                let columns = both(|along| &rows.meridional_flexibility[along][node * rows.blocks..][..rows.blocks]);
                add::<L>(at_start, columns, force);
                if level.kind == ForceInterpolation::Polynomial {
                    add::<L>(lanes, level.meridional(0, node, rows.nodes), force);
                }
            }
            for point in 0..level.points() {
                let lane = point * rows.blocks + block;
                if multipliers[lane].0[i] > 0.0 {
                    let force = both(|along| forces[along][lane].0[i]);
                    add::<L>(lanes, level.meridional(point + 1, node, rows.nodes), force);
                }
            }
        }
    }
}

impl FindMeridional<'_> {
    /// Finds the displacements without forces in the step.
    #[inline(always)]
    fn move_freely<L: Octet, const P: usize>(&mut self) {
        let Self { trial: BladeTrial { start, modal, meridional, .. }, rows, level } = self;
        let [q, v] = &start.modes;
        for (modal, [a, b]) in modal.iter_mut().zip(&level.free).take(P) {
            for (block, modal) in modal.iter_mut().enumerate() {
                let terms = L::load(&a[block]) * L::load(&q[block]) + L::load(&b[block]) * L::load(&v[block]);
                terms.store(modal);
            }
        }
        let (at_start, lanes) = meridional.split_at_mut(rows.blocks);
        let modes: [&[Eight]; P] = std::array::from_fn(|p| &modal[p][..]);
        displace::<L, 1, 1>([&rows.meridional], rows.blocks, [q], [at_start]);
        displace::<L, 1, P>([&rows.meridional], rows.blocks, modes, [lanes]);
    }
}

/// Adds the displacements under a force along two directions.
#[inline(always)]
fn add<L: Octet>(to: &mut [Eight], columns: [&[Eight]; 2], force: [f64; 2]) {
    for ((to, first), second) in to.iter_mut().zip(columns[0]).zip(columns[1]) {
        let moved = L::load(first) * L::splat(force[0]) + L::load(second) * L::splat(force[1]);
        (L::load(to) + moved).store(to);
    }
}
