//! Steps without a trial, for which cubics through the motion of the slow modes show that no contact is possible.
//!
//! Without contact, the amplitude of each mode is constant, apart from damping. For a slow mode, it bounds the distance
//! from the cubic through the values and rates at both ends of a step. For a fast mode, it bounds the displacement.

use super::columns::{displace, displace_nodes};
use super::follow::cubic_minimum;
use super::gaps::drive_and_rate_at;
use super::level::BladeLevel;
use super::rows::BladeRows;
use super::span::{Blade, BladeInSpan};
use super::surface::{DriveRate, PointDrive};
use super::trial::BladeTrial;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::scene::shape::CompiledShape;
use crate::time::galerkin::span::SpanStep;
use crate::time::galerkin::trial::ForceInterpolation;

impl BladeInSpan<'_> {
    /// Bounds the gaps in a step that starts without contact, and returns whether all of them stay above zero. The reach
    /// must be known.
    pub(super) fn cubics_stay_open(&mut self, step: SpanStep) -> bool {
        let (tables, place) = (self.tables, &self.place);
        let ends = [step.from, step.from + step.length];
        let level = tables.level(step.level, ForceInterpolation::Polynomial);
        let span = level.step / step.length;
        let trial = &mut self.blade.trial;
        if step.from == 0.0 {
            // The prescribed motion at the end of the previous span differs by rounding.
            trial.slow_mode_gaps[0].forget();
        }
        trial.instructions.run_octets(BoundContactFreeStep {
            rows: &tables.rows,
            level,
            halvings: step.level,
            surface: &place.gap.surface,
            drives: ends.map(|end| drive_and_rate_at(place, end, span)),
            shape_error: place.shape_errors(ends).iter().sum(),
            trial,
        })
    }

    /// Selects the nodes to follow: those whose smallest gap in the current step without a trial may be needed. Returns
    /// whether there are any.
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

/// F of a blade without contact at one end of a step, caused by the slow modes of the step.
#[derive(Debug, Clone)]
pub(super) struct SlowModeGaps {
    /// Number of halvings of the span to which the slow modes belong; `None` if the gaps are unknown.
    halvings: Option<usize>,
    /// F (m), its rate (m/s), and the magnitude of the slope of the surface (m/rad).
    gaps: Vec<Eight>,
    rates: Vec<Eight>,
    slopes: Vec<Eight>,
}

impl SlowModeGaps {
    /// Allocates for a number of blocks of nodes.
    pub fn new(nodes: usize) -> Self {
        let [gaps, rates, slopes] = [0, 1, 2].map(|_| vec![Eight::ZERO; nodes]);
        Self { halvings: None, gaps, rates, slopes }
    }

    /// Marks the gaps as unknown.
    pub fn forget(&mut self) {
        self.halvings = None;
    }
}

/// Bounds the gaps of all nodes over a step without contact. Returns whether all of them stay above zero.
struct BoundContactFreeStep<'a> {
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

impl OctetKernel for BoundContactFreeStep<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<L: Octet>(mut self) -> bool {
        self.find_errors::<L>();
        if self.trial.slow_mode_gaps[0].halvings != Some(self.halvings) {
            self.find_gaps::<L>(0);
        }
        let [(first, _), (last, _)] = self.drives;
        let turn = 0.5 * (last.turned - first.turned).abs();
        let curvature = L::splat(self.surface.largest_curvature());
        let largest_factor = L::splat(first.factor.abs().max(last.factor.abs()));
        let (rows, third) = (self.rows, L::splat(self.level.step / 3.0));
        for block in 0..rows.blocks {
            let error = L::load(&self.trial.cubic_errors[self.halvings][block]);
            let valid = rows.valid(block);
            if error.less(L::load(&self.trial.slow_mode_gaps[0].gaps[block])) & valid != valid {
                return false;
            }
        }
        self.find_gaps::<L>(1);
        let Self { trial, halvings, shape_error, .. } = self;
        for block in 0..rows.blocks {
            let per_radius = L::load(&rows.per_radius[block]);
            let around = L::load(&trial.reach[1][block]) * per_radius;
            let ends = &trial.slow_mode_gaps;
            let [gaps, rates] =
                [both(|end| L::load(&ends[end].gaps[block])), both(|end| L::load(&ends[end].rates[block]))];
            let slopes = both(|end| L::load(&ends[end].slopes[block]));
            // The circumferential displacement turns a node by at most `around`.
            let steepest = slopes[0].max(slopes[1]) + curvature * (L::splat(turn) + around);
            let steepest = steepest * largest_factor;
            let error = L::load(&trial.cubic_errors[halvings][block]) + L::splat(shape_error) + steepest * around;
            let inner = [gaps[0] + rates[0] * third, gaps[1] - rates[1] * third];
            let lower = gaps[0].min(gaps[1]);
            let mut least = inner[0].min(inner[1]).min(lower);
            let valid = rows.valid(block);
            if error.less(least) & valid != valid {
                least = cubic_minimum([gaps[0], inner[0], inner[1], gaps[1]]).1.min(lower);
                if error.less(least) & valid != valid {
                    return false;
                }
            }
            let (steepness, sigma) = (L::load(&rows.steepness[block]), steepest * per_radius);
            let size = (steepness * steepness + sigma * sigma).sqrt();
            L::select(valid, (least - error) / size, L::zero()).store(&mut trial.gap_bounds[block]);
        }
        true
    }
}

impl BoundContactFreeStep<'_> {
    /// Bounds the distance of the closing displacements from their cubics, unless the bound is known from an earlier step of
    /// the same length.
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

    /// Finds F and its rate, as caused by the slow modes, at one end of the step.
    #[inline(always)]
    fn find_gaps<L: Octet>(&mut self, end: usize) {
        let Self { trial, rows, level, halvings, surface, drives, .. } = self;
        let BladeTrial { start, path, path_moved: [moved, _], slow_mode_gaps, angles, evaluated, .. } = &mut **trial;
        let modes = &mut path[0].modes;
        for k in 0..level.slow_blocks {
            let [q, v] = both(|of| L::select(level.slow[k], L::load(&start.modes[of][k]), L::zero()));
            for of in [0, 1] {
                let mut mode = [q, v][of];
                if end == 1 {
                    mode = L::load(&level.end[of][0][k]) * q + L::load(&level.end[of][1][k]) * v;
                }
                mode.store(&mut modes[of][k]);
            }
        }
        displace_nodes::<L, 1, 2>(rows, [0], level.slow_blocks, [&modes[0], &modes[1]], [&mut moved[..]]);
        evaluated.count(rows.blocks, 2);
        let ((drive, rate), target) = (&drives[end], &mut slow_mode_gaps[end]);
        for block in 0..rows.blocks {
            let angle = L::load(&angles[block]) + L::splat(drive.turned);
            let [shape, slope, _] = surface.evaluate_octet::<L>(angle);
            let [closing, closing_rate] = both(|of| L::load(&moved[of * rows.blocks + block]));
            let gap = L::splat(drive.clearance) + shape * L::splat(drive.factor) + closing;
            let opening = L::splat(rate.clearance) + shape * L::splat(rate.factor) + closing_rate;
            gap.store(&mut target.gaps[block]);
            (opening + slope * L::splat(drive.factor * rate.turned)).store(&mut target.rates[block]);
            slope.abs().store(&mut target.slopes[block]);
        }
        target.halvings = Some(*halvings);
    }
}
