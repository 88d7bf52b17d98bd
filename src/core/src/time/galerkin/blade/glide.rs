//! Steps without contact, from cubics through the motion of the slow modes.
//!
//! Without contact, the amplitude of each mode is constant, apart from the damping. It bounds the distance of a slow mode
//! from the cubic through its values and rates at both ends of a step. A fast mode is bounded by its amplitude alone.

use super::columns::displace;
use super::follow::cubic_minimum;
use super::gaps::drive_and_rate_at;
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::span::{Blade, BladeInSpan};
use super::surface::{DriveRate, PointDrive};
use super::trial::BladeTrial;
use crate::math::octet::{Octet, OctetKernel, both};
use crate::scene::shape::CompiledShape;
use crate::time::galerkin::span::SpanStep;
use crate::time::galerkin::trial::ForceInterpolation;

impl BladeInSpan<'_> {
    /// Returns whether no node can touch in a step that starts without contact, and bounds the gaps. The reach must be
    /// known.
    pub(super) fn glides(&mut self, step: SpanStep) -> bool {
        let (tables, place) = (self.tables, &self.place);
        let ends = [step.from, step.from + step.length];
        let level = tables.level(step.level, ForceInterpolation::Polynomial);
        let span = level.step / step.length;
        let trial = &mut self.blade.trial;
        trial.instructions.run_octets(Glide {
            rows: &tables.rows,
            level,
            halvings: step.level,
            surface: &place.gap.surface,
            drives: ends.map(|end| drive_and_rate_at(place, end, span)),
            shape_error: place.shape_errors(ends).iter().sum(),
            trial,
        })
    }

    /// Returns whether the smallest gap of a node in the current step without a trial may be needed. Such nodes are
    /// followed.
    pub(super) fn needs_gaps(&mut self) -> bool {
        let Blade { trial, floors, tally, .. } = &mut *self.blade;
        let mut any = 0;
        for (block, followed) in trial.followed.iter_mut().enumerate() {
            *followed = (0..8).fold(0, |mask, i| {
                let needed = floors[block].0[i].min(tally.lowest[block].0[i]);
                mask | u8::from(trial.gap_bounds[block].0[i] < needed) << i
            });
            *followed &= self.tables.rows.valid(block);
            any |= *followed;
        }
        any != 0
    }
}

/// Bounds the gaps of all nodes over a step without contact. Returns whether they stay above zero.
struct Glide<'a> {
    trial: &'a mut BladeTrial,
    rows: &'a BladeRows,
    level: &'a BladeLevel,
    /// Number of halvings of the span.
    halvings: usize,
    surface: &'a CompiledShape,
    /// Prescribed motion at both ends of the step, and its rates.
    drives: [(PointDrive, DriveRate); 2],
    /// Largest distance of the shape of the surface from its cubic (m).
    shape_error: f64,
}

impl OctetKernel for Glide<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(mut self) -> bool {
        self.find_errors::<L>();
        self.advance_slow_modes::<L>();
        let Self { trial, rows, level, halvings, surface, drives, shape_error } = self;
        let third = L::splat(level.step / 3.0);
        let [(first, first_rate), (last, last_rate)] = drives;
        let turn = 0.5 * (last.turned - first.turned).abs();
        let curvature = L::splat(surface.largest_curvature());
        let largest_factor = L::splat(first.factor.abs().max(last.factor.abs()));
        for block in 0..rows.blocks {
            let per_radius = L::load(&rows.per_radius[block]);
            let around = L::load(&trial.reach[1][block]) * per_radius;
            let [mut slopes, mut gaps, mut rates] = [[L::zero(); 2]; 3];
            for (end, (drive, rate)) in [(first, first_rate), (last, last_rate)].into_iter().enumerate() {
                let [shape, slope, _] =
                    surface.evaluate_octet::<L>(L::load(&trial.angles[block]) + L::splat(drive.turned));
                let of = |place: usize| L::load(&trial.path_moved[end][place * rows.blocks + block]);
                gaps[end] = L::splat(drive.clearance) + shape * L::splat(drive.factor) + of(0);
                let opening = L::splat(rate.clearance) + shape * L::splat(rate.factor) + of(1);
                rates[end] = opening + slope * L::splat(drive.factor * rate.turned);
                slopes[end] = slope.abs();
            }
            // The circumferential displacement turns a node by at most `around`.
            let steepest = slopes[0].max(slopes[1]) + curvature * (L::splat(turn) + around);
            let steepest = steepest * largest_factor;
            let error = L::load(&trial.cubic_errors[halvings][block]) + L::splat(shape_error) + steepest * around;
            let inner = [gaps[0] + rates[0] * third, gaps[1] - rates[1] * third];
            let ends = gaps[0].min(gaps[1]);
            let mut least = inner[0].min(inner[1]).min(ends);
            let valid = rows.valid(block);
            if error.less(least) & valid != valid {
                least = cubic_minimum([gaps[0], inner[0], inner[1], gaps[1]]).1.min(ends);
                if error.less(least) & valid != valid {
                    return false;
                }
            }
            let (steepness, sigma) = (L::load(&rows.steepness[block]), steepest * per_radius);
            let size = (steepness * steepness + sigma * sigma).sqrt();
            ((least - error) / size).store(&mut trial.gap_bounds[block]);
        }
        true
    }
}

impl Glide<'_> {
    /// Bounds the distance of the closing displacements from their cubics, unless it is known from an earlier step of the
    /// same length.
    #[inline(always)]
    fn find_errors<L: Octet>(&mut self) {
        let Self { trial, rows, level, halvings, .. } = self;
        let known = 1 << *halvings;
        if trial.cubic_errors_known & known != 0 {
            return;
        }
        trial.cubic_errors_known |= known;
        let BladeTrial { free_amplitudes, mode_bounds, cubic_errors, .. } = &mut **trial;
        for ((bound, amplitude), relative) in mode_bounds.iter_mut().zip(free_amplitudes).zip(&level.relative_errors) {
            (L::load(amplitude) * L::load(relative)).store(bound);
        }
        displace::<L, 1, 1>([&rows.magnitudes[0]], rows.blocks, [mode_bounds], [&mut cubic_errors[*halvings]]);
    }

    /// Finds the closing displacements that the slow modes cause at both ends of the step, and their rates.
    #[inline(always)]
    fn advance_slow_modes<L: Octet>(&mut self) {
        let Self { trial, rows, level, .. } = self;
        let BladeTrial { start, path, path_moved, .. } = &mut **trial;
        let [first, last, ..] = &mut path[..] else { return };
        for k in 0..level.slow_blocks {
            let [q, v] = both(|of| L::select(level.slow[k], L::load(&start.modes[of][k]), L::zero()));
            for of in [0, 1] {
                let [a, b] = both(|term| L::load(&level.end[of][term][k]));
                [q, v][of].store(&mut first.modes[of][k]);
                (a * q + b * v).store(&mut last.modes[of][k]);
            }
        }
        let shapes = &rows.shapes[0];
        let shapes = &shapes[..shapes.len().min(8 * level.slow_blocks * rows.blocks)];
        for (point, moved) in [first, last].into_iter().zip(path_moved) {
            displace::<L, 1, 2>([shapes], rows.blocks, [&point.modes[0], &point.modes[1]], [moved]);
        }
    }
}
