//! Sectors whose gaps no output needs, so that their states are not evaluated.
//!
//! The gaps in an open step without forces have lower bounds. While these bounds are above the smallest gaps of other
//! sectors, no output needs the gaps of the sector, and only its energies are computed.

use super::columns::displace;
use super::dense::ModeResponse;
use super::level::BladeLevel;
use super::minima::BlockGaps;
use super::rows::BladeRows;
use super::span::{Blade, BladeInSpan, BladeModel};
use super::stored::StoredStep;
use super::trial::BladeTrial;
use crate::geometry::layout::Layout;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::modes::coordinates::ContactModes;
use crate::system::small::{CURVED_SHARE, LEAST_CLEARANCE};
use crate::system::structure::UNKNOWN_GAP;
use crate::time::SteadyInterval;
use crate::time::galerkin::span::SpanStep;
use crate::time::galerkin::trial::ForceInterpolation;

/// Lower bounds of the gaps in a step in which contact is possible (m). They are finite because saved states contain finite
/// numbers only.
pub(super) const NO_BOUND: Eight = Eight([-UNKNOWN_GAP; 8]);

impl Blade {
    /// Returns whether these lower bounds of the gaps in a step (m) exceed all smallest gaps that outputs need.
    pub(super) fn exceeds_needed_minima<'a>(&self, least: impl Iterator<Item = &'a [f64; 8]>) -> bool {
        let needed = self.floors.iter().zip(&self.tally.lowest);
        let above = |(least, (floors, lowest)): (&[f64; 8], (&Eight, &Eight))| {
            least.iter().zip(floors.0).zip(lowest.0).all(|((least, floor), lowest)| *least >= floor.min(lowest))
        };
        least.zip(needed).all(above)
    }

    /// Finds the energies of a sector at the end of an interval if its state is not needed: the stored step contains the
    /// interval, no forces act in it, no output needs its gaps, and its displacements are certainly small. Otherwise returns
    /// `None`. The smallest gaps that outputs need must have been chosen.
    pub fn energies_if_skippable(
        &mut self,
        model: &BladeModel,
        kind: usize,
        step: StoredStep,
        interval: SteadyInterval,
    ) -> Option<SkippedSector> {
        let rows = model.rows(kind);
        let time = step.time_until(interval).filter(|_| !step.is_special())?;
        let [least, q, v] = step.arrays(rows.blocks, rows.mode_blocks);
        if !self.exceeds_needed_minima(least.iter()) {
            return None;
        }
        let start = &mut self.trial.start.modes;
        for (modes, stored) in start.iter_mut().zip([q, v]) {
            modes.iter_mut().zip(stored).for_each(|(block, stored)| block.0 = *stored);
        }
        let energies = self.find_energies(rows, kind, time);
        (energies.iter().sum::<f64>() <= model.plausible_energy(kind))
            .then_some(SkippedSector { energies, at_start: step.energy() })
    }

    /// Returns the kinetic and strain energy (J) at a time (s) after the start of the open step, in which no forces act.
    pub(super) fn find_energies(&mut self, rows: &BladeRows, kind: usize, time: f64) -> [f64; 2] {
        let place = self.find_response(rows, kind, time);
        let (trial, response) = (&self.trial, &self.responses[place]);
        trial.instructions.run_octets(FindEnergies { modes: &trial.start.modes, rows, response })
    }
}

impl BladeInSpan<'_> {
    /// Finds lower bounds of the gaps in the tried step, which has been accepted and stays open.
    pub(super) fn find_gap_bounds(&mut self, step: SpanStep, kind: ForceInterpolation, is_resolved: bool) {
        let (rows, level, trial) = (&self.tables.rows, self.tables.level(step.level, kind), &mut self.blade.trial);
        if trial.pushes || !is_resolved || trial.unresolved.is_none() {
            trial.gap_bounds.fill(NO_BOUND);
            return;
        }
        let instructions = trial.instructions;
        instructions.run_octets(FindGapBounds { trial, rows, level });
    }

    /// Returns whether no output needs the smallest gaps of the open step.
    pub fn gaps_are_unneeded(&self) -> bool {
        !self.pushes() && self.blade.exceeds_needed_minima(self.blade.trial.gap_bounds.iter().map(|block| &block.0))
    }

    /// Returns whether displacements with these kinetic and strain energies (J) are certainly small.
    pub fn is_plausible(&self, energies: [f64; 2]) -> bool {
        energies.iter().sum::<f64>() <= self.tables.plausible_energy
    }

    /// Returns the kinetic and strain energy (J) at the end of an interval of the steady phase. If forces act in the open step, it
    /// must have been sampled at this time.
    pub fn energies_at_end(&mut self, interval: SteadyInterval) -> [f64; 2] {
        let (rows, time) = (&self.tables.rows, self.time_in_step(interval.to, interval.span));
        if self.pushes() {
            let trial = &self.blade.trial;
            return trial.instructions.run_octets(FindSampledEnergies { trial, rows });
        }
        self.blade.find_energies(rows, self.place.kind, time)
    }
}

/// Energies of a sector whose state is skipped.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SkippedSector {
    /// Kinetic and strain energy at the end of the interval (J).
    pub energies: [f64; 2],
    /// Energy at the start of the open step (J).
    pub at_start: f64,
}

/// Returns the largest sum of kinetic and strain energy (J) for which displacements are certainly small: below the
/// [limit](Layout::largest_displacement) in every direction, and too small around the axis to cause a warning.
pub(super) fn plausible_energy(modes: &ContactModes, layout: &Layout) -> f64 {
    let gap = layout.clearances.iter().fold(f64::INFINITY, |low: f64, clearance| low.min(*clearance));
    let most = |row: usize| {
        // A displacement u of a row with flexibility g needs at least the energy ½u²/g.
        let shapes = modes.shapes.row(row);
        let of_modes: f64 = shapes.iter().zip(&modes.frequencies).map(|(shape, w)| (shape / w) * (shape / w)).sum();
        let flexibility = of_modes + modes.residual[(row, row)];
        let per_radius = layout.per_radius[row / 3];
        let curved = (2.0 * CURVED_SHARE * gap.max(LEAST_CLEARANCE / per_radius) / per_radius).sqrt();
        let limit = layout.largest_displacement().min(if row % 3 == 1 { curved } else { f64::INFINITY });
        0.5 * limit * limit / flexibility
    };
    // The margin covers rounding.
    0.99 * (0..modes.rows()).map(most).fold(f64::INFINITY, f64::min)
}

/// See [`Blade::find_energies`].
struct FindEnergies<'a> {
    /// q and q̇ at the start of the step.
    modes: &'a [Vec<Eight>; 2],
    rows: &'a BladeRows,
    response: &'a ModeResponse,
}

impl OctetKernel for FindEnergies<'_> {
    type Output = [f64; 2];
    #[inline(always)]
    fn run<L: Octet>(self) -> [f64; 2] {
        let Self { modes, rows, response } = self;
        let mut sums = [L::zero(); 2];
        for k in 0..rows.mode_blocks {
            let [q, v] = both(|of| L::load(&modes[of][k]));
            let square = L::load(&rows.rates[2][k]);
            let [position, velocity] = response.free::<L>(k, [q, v], square);
            sums = [sums[0] + velocity * velocity, sums[1] + position * position * square];
        }
        sums.map(|sum| 0.5 * sum.total())
    }
}

/// Finds the kinetic and strain energy (J) of the sampled modes, including those without inertia.
struct FindSampledEnergies<'a> {
    trial: &'a BladeTrial,
    rows: &'a BladeRows,
}

impl OctetKernel for FindSampledEnergies<'_> {
    type Output = [f64; 2];
    #[inline(always)]
    fn run<L: Octet>(self) -> [f64; 2] {
        let Self { trial: BladeTrial { sample, path_moved, .. }, rows } = self;
        let mut sums = [L::zero(); 2];
        for k in 0..rows.mode_blocks {
            let [q, v] = both(|of| L::load(&sample.modes[of][k]));
            sums = [sums[0] + v * v, sums[1] + q * q * L::load(&rows.rates[2][k])];
        }
        for along in [0, 1] {
            for block in 0..rows.blocks {
                // Displacements under the forces that modes with inertia do not contain.
                let held = L::load(&sample.moved[along][block]) - L::load(&path_moved[along][block]);
                sums[1] = sums[1] + L::load(&sample.forces[along][block]) * held;
            }
        }
        sums.map(|sum| 0.5 * sum.total())
    }
}

/// Finds lower bounds of the gaps (m) of all nodes in the tried step, in which no forces act. The interpolation errors of
/// the modes must be known.
pub(super) struct FindGapBounds<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
}

impl OctetKernel for FindGapBounds<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { trial, rows, level } = self;
        displace::<L, 1, 1>([&rows.magnitudes[0]], rows.blocks, [&trial.mode_bounds], [&mut trial.path_moved[0]]);
        for block in 0..rows.blocks {
            let bound = BlockGaps::<L>::new(trial, rows, level, block).lower_bound();
            L::select(rows.valid(block), bound, L::zero()).store(&mut trial.gap_bounds[block]);
        }
    }
}
