//! Steps of single sectors in a steady phase, which do not end at internal points.

use super::SceneIsland;
use super::blade_sectors::{SectorSpan, SpanOfSectors};
use crate::system::pair::Prescribed;
use crate::system::{StepFailure, Structure, System};
use crate::time::SteadyInterval;
use crate::time::galerkin::blade::{SpanKind, StoredStep, stored_len, stored_start};
use crate::time::galerkin::record::MotionCourse;
use crate::time::workers::Workers;

impl SceneIsland {
    /// Returns whether the steps of the sectors can pass internal points in a steady phase.
    pub(crate) fn supports_steady_phase(&self) -> bool {
        self.blade.as_ref().is_some_and(|sectors| sectors.open_step_len > 0)
    }

    /// Integrates all sectors over an interval of a steady phase. The pairs must have moved to its end.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub(crate) fn integrate_steady_interval(
        &mut self,
        system: &mut System,
        interval: SteadyInterval,
        workers: &Workers,
    ) -> Result<(), StepFailure> {
        system.sets.members(self.set).iter().for_each(|one| system.structures[*one].begin_interval());
        let index = self.first_structure();
        if let Some(sectors) = &mut self.blade {
            let structure = &mut system.structures[index];
            // Copies padding lanes, which no sector writes.
            structure.history.gap.now.copy_from_slice(&structure.history.gap.before);
            sectors.model.set_span(SpanKind::Steady, interval.span);
            let (open_steps, len) = (&structure.step_control.open_steps, sectors.open_step_len);
            let is_known =
                |sector: usize| StoredStep::new(&open_steps[sector * len..]).is_none_or(StoredStep::is_sampled);
            sectors.model.begin_span(&structure.history.gap.before, structure.lanes(), self.turns, is_known);
        }
        self.integrate_sectors(system, SectorSpan::Interval(interval), self.goal, workers)
    }

    /// Ends the open steps of all sectors at the end of an interval, one sector after the other, because each needs different tables.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub(crate) fn close_steps(&mut self, system: &mut System, interval: SteadyInterval) -> Result<(), StepFailure> {
        let Self { set, goal, island, records, turns, blade: Some(sectors), .. } = self else { return Ok(()) };
        let (structure, pair) = (records[0].structure, records[0].pairs[0].pair);
        let (span, tables) = (SectorSpan::End(interval), &island.tables[0][..]);
        let of = SpanOfSectors { span, set: *set, tables, structure, pair, goal: *goal };
        for sector in 0..*turns {
            let open_steps = &system.structures[structure].step_control.open_steps;
            let open_step = &open_steps[sector * sectors.open_step_len..][..sectors.open_step_len];
            if open_step[0] == 0.0 {
                continue;
            }
            match stored_start(open_step, interval.span) {
                Some(start) => sectors.model.set_span(SpanKind::Bounded, interval.to - start),
                None => sectors.model.set_span(SpanKind::Steady, interval.span),
            }
            sectors.integrate_one(sector, system, of);
            sectors.enter(sector, system, of)?;
        }
        Ok(())
    }
}

/// Prescribed motion over `length` (s) from a time in a steady phase (s since its start).
pub(super) fn steady_course(prescribed: &Prescribed, from: f64, length: f64) -> MotionCourse {
    let ([start, middle, end], growth) = prescribed.in_steady_phase(from, length);
    MotionCourse::new(&start, &middle, growth, &end, length)
}

/// Converts a number of spans to a real number.
#[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
pub(super) fn real_count(spans: u64) -> f64 {
    spans as f64
}

impl Structure {
    /// Length of an array that stores an open step of a sector.
    pub(super) fn open_step_len(&self) -> usize {
        stored_len(self.nodes(), self.modes().model().inertial_modes())
    }

    /// Allocates the open steps of all sectors.
    pub(crate) fn allocate_open_steps(&mut self) {
        if self.nodes() > 0 && self.bank().is_some() {
            self.step_control.open_steps = vec![0.0; self.modes().sectors() * self.open_step_len()];
            self.step_control.energies_now = vec![0.0; 2 * self.modes().sectors()];
        }
    }
}
