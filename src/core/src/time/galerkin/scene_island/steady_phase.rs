//! Steps of single sectors in a steady phase, which do not end at internal points.

use super::SceneIsland;
use crate::geometry::GapLaw;
use crate::system::contact_view::ContactMember;
use crate::system::pair::Prescribed;
use crate::system::{StepFailure, Structure, System};
use crate::time::SteadyInterval;
use crate::time::galerkin::blade::{BladeInSpan, BladePlace, SpanKind, stored_len};
use crate::time::galerkin::island::{Island, IslandSector, StepControl};
use crate::time::galerkin::record::MotionCourse;

impl SceneIsland {
    /// Returns whether the steps of the sectors can pass internal points in a steady phase.
    pub(crate) fn supports_steady_phase(&self) -> bool {
        self.open_step_len > 0
    }

    /// Integrates all sectors over an interval of a steady phase. The pairs must have moved to its end.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub(crate) fn integrate_steady_interval(
        &mut self,
        system: &mut System,
        interval: SteadyInterval,
    ) -> Result<(), StepFailure> {
        system.sets.members(self.set).iter().for_each(|one| system.structures[*one].begin_interval());
        let index = self.first_structure();
        if let Some(blade) = &mut self.blade {
            let structure = &mut system.structures[index];
            // Copies padding lanes, which no sector writes.
            structure.history.gap.now.copy_from_slice(&structure.history.gap.before);
            blade.set_span(SpanKind::Steady, interval.span);
            blade.begin_span(&structure.history.gap.before, structure.lanes(), self.turns);
        }
        (0..self.turns).try_for_each(|turn| self.step_blade_in_steady_phase(turn, system, interval))
    }

    /// Integrates one sector over an interval of a steady phase.
    fn step_blade_in_steady_phase(
        &mut self,
        turn: usize,
        system: &mut System,
        interval: SteadyInterval,
    ) -> Result<(), StepFailure> {
        self.aim(turn, &system.structures);
        let System { structures, pairs, events, counted, .. } = system;
        if structures[self.records[0].structure].step_control.open_steps[turn * self.open_step_len] == 0.0 {
            self.read(structures);
        } else {
            self.read_control(structures);
        }
        let Self {
            island: Island { sectors, control, .. }, records, blade: Some(blade), set, goal, open_step_len, ..
        } = &mut *self
        else {
            return Ok(());
        };
        let (IslandSector { table: [_, kind], state, .. }, record) = (&mut sectors[0], &mut records[0]);
        let (structure, sector, pair) = (record.structure, record.sector, record.pairs[0].pair);
        let GapLaw::Revolution(gap) = pairs[pair].gap() else { return Ok(()) };
        let of = &mut structures[structure];
        blade.choose_minima(&of.needed_minima, sector, |node| of.history.gap.before[of.index(node, sector)]);
        let parameters = pairs[pair].parts.parameters;
        let place = BladePlace { kind: *kind, sector, gap, parameters, course: MotionCourse::default() };
        let numbers = &mut of.step_control.open_steps[turn * *open_step_len..][..*open_step_len];
        let mut steps = BladeInSpan::begin(blade, place, *control, *goal, (numbers[0] == 0.0).then_some(&*state));
        steps.recall(numbers);
        let prescribed = &pairs[pair].prescribed;
        let course = |spans: u64| steady_course(prescribed, real_count(spans) * interval.span, interval.span);
        let outcome = steps.integrate_steady_interval(interval, course, &mut counted.effort);
        let is_lost = steps.is_lost();
        if outcome.is_ok() {
            steps.write_sample(interval, course, state);
            steps.store(numbers);
            let step = of.modes().step();
            for node in 0..of.nodes() {
                let (index, gap) = (of.index(node, sector), state.gaps[node]);
                (of.history.gap.now[index], of.history.gap.before[index]) = (gap, gap - step * steps.gap_rate(node));
            }
        }
        *control = steps.control;
        of.step_control.energies[sector] = steps.energy();
        record.damping = blade.tally.damping;
        (0..record.tallies.len()).for_each(|node| record.tallies[node].lowest = blade.tally.lowest(node));
        events.now.extend((0..of.nodes()).filter_map(|node| {
            let at = ContactMember { structure, pair, node, sector, index: of.index(node, sector) };
            blade.tally.event(blade.rows(*kind), at, interval.to - interval.from)
        }));
        blade.tally.work.enter(&mut counted.ledgers[*set]);
        if blade.tally.implausible || is_lost {
            return Err(StepFailure::Implausible { structure, sector });
        }
        self.write(structures);
        outcome.map_err(|stopped| stopped.failure(structure, sector))
    }

    /// Ends the open steps of all sectors at the end of an interval.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub(crate) fn close_steps(&mut self, system: &mut System, interval: SteadyInterval) -> Result<(), StepFailure> {
        for turn in 0..self.turns {
            self.aim(turn, &system.structures);
            let System { structures, pairs, counted, .. } = &mut *system;
            self.read(structures);
            let Self {
                island: Island { sectors, control, .. },
                records,
                blade: Some(blade),
                set,
                goal,
                open_step_len,
                ..
            } = &mut *self
            else {
                return Ok(());
            };
            let (IslandSector { table: [_, kind], state, .. }, record) = (&mut sectors[0], &mut records[0]);
            let (structure, sector, pair) = (record.structure, record.sector, record.pairs[0].pair);
            let GapLaw::Revolution(gap) = pairs[pair].gap() else { return Ok(()) };
            blade.set_span(SpanKind::Steady, interval.span);
            blade.choose_minima(&structures[structure].needed_minima, sector, |node| record.tallies[node].lowest);
            let parameters = pairs[pair].parts.parameters;
            let place = BladePlace { kind: *kind, sector, gap, parameters, course: MotionCourse::default() };
            let numbers = &mut structures[structure].step_control.open_steps[turn * *open_step_len..][..*open_step_len];
            let mut steps = BladeInSpan::begin(blade, place, *control, *goal, Some(state));
            if !steps.recall(numbers) {
                continue;
            }
            numbers.fill(0.0);
            let prescribed = &pairs[pair].prescribed;
            let course = |[from, to]: [f64; 2]| steady_course(prescribed, from, to - from);
            let outcome = steps.close(interval, course, &mut counted.effort, state);
            let (is_lost, level) = (steps.is_lost(), control.level);
            *control = StepControl { level, ..steps.control };
            record.damping = blade.tally.damping;
            blade.tally.work.enter(&mut counted.ledgers[*set]);
            if is_lost {
                return Err(StepFailure::Implausible { structure, sector });
            }
            self.write(structures);
            outcome.map_err(|stopped| stopped.failure(structure, sector))?;
        }
        Ok(())
    }
}

/// Prescribed motion over `length` (s) from a time in a steady phase (s since its start).
fn steady_course(prescribed: &Prescribed, from: f64, length: f64) -> MotionCourse {
    let ([start, middle, end], growth) = prescribed.in_steady_phase(from, length);
    MotionCourse::new(&start, &middle, growth, &end, length)
}

/// Converts a number of spans to a real number.
#[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
fn real_count(spans: u64) -> f64 {
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
        }
    }
}
