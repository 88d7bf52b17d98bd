//! Steps of single sectors in free spans, which do not end at internal points.

use super::SceneIsland;
use crate::geometry::GapLaw;
use crate::system::contact_view::ContactMember;
use crate::system::pair::Prescribed;
use crate::system::{StepFailure, Structure, System};
use crate::time::FreePart;
use crate::time::galerkin::blade::{BladeInSpan, BladePlace, SpanKind, stored_len};
use crate::time::galerkin::island::{Island, IslandSector, StepControl};
use crate::time::galerkin::record::MotionCourse;

impl SceneIsland {
    /// Returns whether the steps of the sectors need not end at internal points.
    pub fn runs_freely(&self) -> bool {
        self.stored > 0
    }

    /// Integrates all sectors over a part of free time, at whose end the pairs are.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub fn integrate_freely(&mut self, system: &mut System, part: FreePart) -> Result<(), StepFailure> {
        system.sets.members(self.set).iter().for_each(|one| system.structures[*one].begin_span());
        let index = self.first_structure();
        if let Some(blade) = &mut self.blade {
            let structure = &mut system.structures[index];
            // Padding lanes.
            structure.history.gap.now.copy_from_slice(&structure.history.gap.before);
            blade.set_span(SpanKind::Free, part.span);
            blade.begin_span(&structure.history.gap.before, structure.lanes(), self.turns);
        }
        (0..self.turns).try_for_each(|turn| self.step_blade_freely(turn, system, part))
    }

    /// Integrates one sector over a part of free time.
    fn step_blade_freely(&mut self, turn: usize, system: &mut System, part: FreePart) -> Result<(), StepFailure> {
        self.aim(turn, &system.structures);
        let System { structures, pairs, events, counted, .. } = system;
        if structures[self.records[0].structure].step_control.open_steps[turn * self.stored] == 0.0 {
            self.read(structures);
        } else {
            self.read_control(structures);
        }
        let Self { island: Island { sectors, control, .. }, records, blade: Some(blade), set, goal, stored, .. } =
            &mut *self
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
        let numbers = &mut of.step_control.open_steps[turn * *stored..][..*stored];
        let mut steps = BladeInSpan::begin(blade, place, *control, *goal, (numbers[0] == 0.0).then_some(&*state));
        steps.recall(numbers);
        let prescribed = &pairs[pair].prescribed;
        let course = |spans: u64| free_course(prescribed, real_count(spans) * part.span, part.span);
        let outcome = steps.integrate_freely(part, course, &mut counted.effort);
        let is_lost = steps.is_lost();
        if outcome.is_ok() {
            steps.write_sample(part, course, state);
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
            blade.tally.event(blade.rows(*kind), at, part.to - part.from)
        }));
        blade.tally.work.enter(&mut counted.ledgers[*set]);
        if blade.tally.implausible || is_lost {
            return Err(StepFailure::Implausible { structure, sector });
        }
        self.write(structures);
        outcome.map_err(|stopped| stopped.failure(structure, sector))
    }

    /// Ends the open steps of all sectors at the end of a part of free time.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then undefined.
    pub fn close_steps(&mut self, system: &mut System, part: FreePart) -> Result<(), StepFailure> {
        for turn in 0..self.turns {
            self.aim(turn, &system.structures);
            let System { structures, pairs, counted, .. } = &mut *system;
            self.read(structures);
            let Self {
                island: Island { sectors, control, .. }, records, blade: Some(blade), set, goal, stored, ..
            } = &mut *self
            else {
                return Ok(());
            };
            let (IslandSector { table: [_, kind], state, .. }, record) = (&mut sectors[0], &mut records[0]);
            let (structure, sector, pair) = (record.structure, record.sector, record.pairs[0].pair);
            let GapLaw::Revolution(gap) = pairs[pair].gap() else { return Ok(()) };
            blade.set_span(SpanKind::Free, part.span);
            blade.choose_minima(&structures[structure].needed_minima, sector, |node| record.tallies[node].lowest);
            let parameters = pairs[pair].parts.parameters;
            let place = BladePlace { kind: *kind, sector, gap, parameters, course: MotionCourse::default() };
            let numbers = &mut structures[structure].step_control.open_steps[turn * *stored..][..*stored];
            let mut steps = BladeInSpan::begin(blade, place, *control, *goal, Some(state));
            if !steps.recall(numbers) {
                continue;
            }
            numbers.fill(0.0);
            let prescribed = &pairs[pair].prescribed;
            let course = |[from, to]: [f64; 2]| free_course(prescribed, from, to - from);
            let outcome = steps.close(part, course, &mut counted.effort, state);
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

/// Prescribed motion over `length` (s) from a time in free spans (s since their beginning).
fn free_course(prescribed: &Prescribed, from: f64, length: f64) -> MotionCourse {
    let ([start, middle, end], growth) = prescribed.in_free_spans(from, length);
    MotionCourse::new(&start, &middle, growth, &end, length)
}

/// Converts a number of spans.
#[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
fn real_count(spans: u64) -> f64 {
    spans as f64
}

impl Structure {
    /// Number of numbers that store an open step of a sector.
    pub(super) fn open_step_len(&self) -> usize {
        stored_len(self.nodes(), self.modes().model().inertial_modes())
    }

    /// Allocates the open steps of all sectors, for adaptive steps that do not end at internal points.
    pub(crate) fn make_room_for_open_steps(&mut self) {
        if self.nodes() > 0 && self.bank().is_some() {
            self.step_control.open_steps = vec![0.0; self.modes().sectors() * self.open_step_len()];
        }
    }
}
