//! Integration of a blade over a span.

use super::contact_free::SlowModeGaps;
use super::dense::ModeResponse;
use super::gaps::include;
use super::level::PartWeights;
use super::open_step::{OpenStep, SpanProgress};
use super::rows::BladeRows;
use super::surface::{FacedSurface, PointDrive};
use super::tables::{BladeTables, SpanKind};
use super::tally::{AddStep, BladeTally, Sums};
use super::trial::{BladeTrial, NodeAngles};
use crate::contact::ContactParameters;
use crate::geometry::GapLaw;
use crate::geometry::revolution::RevolutionGap;
use crate::math::octet::Eight;
use crate::scene::method::Solver;
use crate::system::EvaluatedBlocks;
use crate::system::structure::NeededMinima;
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::island::StepControl;
use crate::time::galerkin::record::{MotionCourse, TurningMotion};
use crate::time::galerkin::span::{Flight, LONGEST_NEAR_STEP, SpanStep, SpanSteps, StepGoal};
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::{HALVINGS, Tables};
use crate::time::galerkin::trial::{ForceInterpolation, TrialResult};
use std::mem::{replace, swap, take};

/// Tables of the blades of a structure, which do not change during a span.
#[derive(Debug, Clone)]
pub(crate) struct BladeModel {
    /// Tables of each kind of sector.
    kinds: Vec<BladeTables>,
    /// Angles of the nodes of each sector.
    angles: Vec<NodeAngles>,
    /// Smallest gap of each node (m), over all sectors at the start of the span and over the span in integrated sectors.
    /// `lowest` includes the sectors of earlier groups, and `lowest_of_all` all integrated sectors.
    lowest: Vec<Eight>,
    lowest_of_all: Vec<Eight>,
    /// Largest number of points of a step.
    degree: usize,
}

/// Trials of one blade, and sums over a span. Allocates only on creation. Each thread has a separate instance.
#[derive(Debug, Clone)]
pub(crate) struct Blade {
    pub(super) trial: BladeTrial,
    pub tally: BladeTally,
    /// Gaps of the sector at the start of the span (m), and gaps below which its smallest gaps are needed (m).
    pub(super) begun: Vec<Eight>,
    pub(super) floors: Vec<Eight>,
    /// Gaps below which the smallest gaps of the tried step are needed (m), and the smallest gaps found (m; infinite if none).
    pub(super) thresholds: Vec<Eight>,
    pub(super) step_minima: Vec<Eight>,
    /// Cached responses of the modes, and the index of the last one computed.
    pub(super) responses: Vec<ModeResponse>,
    pub(super) next_response: usize,
}

/// Results of the steps of a span that are recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RecordScope {
    /// All results.
    All,
    /// Results between two fractions of the span. A step that ends later stays open.
    Interval([f64; 2]),
    /// The work without gaps, forces and impulses.
    WorkOnly,
}

/// A sector, and the surface that it faces.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BladePlace<'a> {
    /// Kind of the sector among the tables.
    pub kind: usize,
    /// Lane of the sector.
    pub sector: usize,
    /// Gap function.
    pub gap: &'a RevolutionGap,
    /// Parameters of the contact.
    pub parameters: ContactParameters,
    /// Prescribed motion over the span.
    pub course: MotionCourse,
}

impl BladeModel {
    /// Allocates tables for the kinds of sectors of a structure. Returns `None` unless all of its nodes face a surface
    /// of revolution.
    pub fn new(kinds: &[Tables], gap: &GapLaw, solver: Solver) -> Option<Self> {
        let GapLaw::Revolution(gap) = gap else { return None };
        let law = solver.properties();
        // Mistuned sectors may differ in degree.
        let degrees = || kinds.iter().map(|tables| tables.levels[0].basis.degree);
        if law.sticks || !law.complementary || !law.constant_friction || degrees().any(|degree| degree == 1) {
            return None;
        }
        if gap.nodes.len() != kinds[0].nodes() {
            return None;
        }
        let degree = degrees().max()?;
        let kinds: Vec<_> = kinds.iter().map(|tables| BladeTables::new(tables, gap)).collect();
        let lowest = vec![Eight::ZERO; kinds.first()?.rows.blocks];
        let angles = (0..gap.layout.lanes).map(|sector| NodeAngles::new(&gap.layout, sector)).collect();
        Some(Self { kinds, angles, lowest_of_all: lowest.clone(), lowest, degree })
    }

    /// Uses tables for spans of this length (s). Does not allocate.
    pub fn set_span(&mut self, kind: SpanKind, span: f64) {
        self.kinds.iter_mut().for_each(|tables| tables.set_span(kind, span));
    }

    /// Starts a span of all sectors, with gaps (m) of all nodes in rows of `lanes` lanes. `is_known` returns whether the gaps of
    /// a sector are known. Unknown gaps are larger than the smallest known gaps.
    pub(crate) fn begin_span(&mut self, gaps: &[f64], lanes: usize, sectors: usize, is_known: impl Fn(usize) -> bool) {
        let smallest = |row: &[f64]| {
            let known = row[..sectors].iter().enumerate().filter(|(sector, _)| is_known(*sector));
            known.map(|(_, gap)| *gap).fold(f64::INFINITY, f64::min)
        };
        Eight::spread(gaps.chunks_exact(lanes).map(smallest), f64::NEG_INFINITY, &mut self.lowest);
        self.lowest_of_all.copy_from_slice(&self.lowest);
    }

    /// Includes the smallest gaps of an integrated sector.
    pub(crate) fn include_lowest(&mut self, tally: &BladeTally) {
        include(&mut self.lowest_of_all, &tally.lowest);
    }

    /// Starts a group of sectors, whose search uses the smallest gaps of all sectors integrated before.
    pub(crate) fn begin_group(&mut self) {
        self.lowest.copy_from_slice(&self.lowest_of_all);
    }

    /// Returns whether steps can pass internal points in a steady phase. All modes must have a frequency above zero.
    pub(crate) fn supports_steady_phase(&self) -> bool {
        let mut modes = self.kinds.iter().flat_map(|tables| &tables.rows.rates[1]).flat_map(|block| block.0);
        modes.all(f64::is_finite)
    }

    /// Returns the largest energy (J) of certainly small displacements; see [`plausible_energy`](super::skipped::plausible_energy).
    pub(super) fn plausible_energy(&self, kind: usize) -> f64 {
        self.kinds[kind].plausible_energy
    }

    /// Rows of the sectors of a kind.
    pub fn rows(&self, kind: usize) -> &BladeRows {
        &self.kinds[kind].rows
    }
}

impl Blade {
    /// Allocates memory for trials of a blade.
    pub fn new(model: &BladeModel) -> Self {
        let rows = model.rows(0);
        let of_nodes = || vec![Eight::ZERO; rows.blocks];
        Self {
            trial: BladeTrial::new(rows, model.degree),
            tally: BladeTally::new(rows),
            begun: of_nodes(),
            floors: of_nodes(),
            thresholds: of_nodes(),
            step_minima: of_nodes(),
            responses: ModeResponse::allocate_cache(rows),
            next_response: 0,
        }
    }

    /// Returns the blocks evaluated since the last call.
    pub(crate) fn take_evaluated(&mut self) -> EvaluatedBlocks {
        take(&mut self.trial.evaluated)
    }

    /// Starts a span of a sector with these gaps (m) of its nodes, and finds which smallest gaps are needed.
    pub(crate) fn choose_minima(&mut self, model: &BladeModel, needed: &NeededMinima, sector: usize, gaps: &[f64]) {
        let Self { tally, begun, floors, .. } = self;
        Eight::spread(gaps.iter().copied(), f64::INFINITY, begun);
        tally.begin(begun);
        let own = if needed.all_of(sector) {
            f64::INFINITY
        } else if needed.by_sector {
            gaps.iter().copied().fold(f64::INFINITY, f64::min)
        } else {
            f64::NEG_INFINITY
        };
        for (floor, lowest) in floors.iter_mut().zip(&model.lowest) {
            *floor = Eight(lowest.0.map(|lowest| lowest.max(own)));
        }
    }
}

/// The reach without contact is found again after this number of spans of a steady phase.
const REACH_SPANS: u64 = 64;

/// A sector of a blade during a span.
pub(crate) struct BladeInSpan<'a> {
    pub(super) tables: &'a BladeTables,
    pub(super) blade: &'a mut Blade,
    pub(super) place: BladePlace<'a>,
    pub control: StepControl,
    pub(super) goal: StepGoal,
    /// Prescribed motion at the points of the tried step, and the motion over which the forces there do work.
    motions: [TurningMotion; POINTS],
    pub(super) drives: [PointDrive; POINTS],
    /// True if the displacements and gaps at the start of the step are known; and true if the reach without contact is
    /// known.
    pub(super) known: bool,
    pub(super) reach_known: bool,
    /// Number of blocks of lanes of the last trial in this span.
    tried: usize,
    pub(super) recorded: RecordScope,
    pub(super) open: Option<OpenStep>,
    pub(super) progress: SpanProgress,
    /// True if the open step differs from the stored one.
    pub(super) has_changed: bool,
    /// True if the current interval of the steady phase lies within a stored open step without contact.
    pub(super) is_in_recalled_flight: bool,
}

impl<'a> BladeInSpan<'a> {
    /// Begins a span of a sector from a state. Without a state, the caller must recall an open step.
    pub fn begin(
        model: &'a BladeModel,
        blade: &'a mut Blade,
        place: BladePlace<'a>,
        control: StepControl,
        goal: StepGoal,
        state: Option<&SectorState>,
    ) -> Self {
        let tables = &model.kinds[place.kind];
        blade.trial.turn_to(&model.angles[place.sector]);
        blade.trial.slow_mode_gaps.iter_mut().for_each(SlowModeGaps::forget);
        if let Some(state) = state {
            blade.trial.read(&tables.rows, state);
        }
        Self {
            tables,
            blade,
            place,
            control,
            goal,
            motions: Default::default(),
            drives: Default::default(),
            known: false,
            reach_known: false,
            tried: 0,
            recorded: RecordScope::All,
            open: None,
            progress: SpanProgress::default(),
            has_changed: true,
            is_in_recalled_flight: false,
        }
    }

    /// Returns the lane of the sector.
    pub fn sector(&self) -> usize {
        self.place.sector
    }

    /// Writes the state at the end of the span.
    pub fn write(&self, state: &mut SectorState) {
        BladeTrial::write(&self.tables.rows, &self.blade.trial.start, state);
    }

    /// Returns whether a gap of the last trial in this span is not a number.
    pub(crate) fn is_lost(&self) -> bool {
        self.blade.trial.is_lost(self.tried)
    }

    /// Prescribed motion at a fraction of the span, and the motion since the start of the span.
    pub(super) fn drive_at(&self, theta: f64) -> (PointDrive, TurningMotion) {
        drive_at(&self.place, theta)
    }

    /// Finds the prescribed motion at the points of a step, and the motion over which the forces there do work.
    pub(super) fn find_drives(&mut self, step: SpanStep, kind: ForceInterpolation, weights: &PartWeights) {
        let level = self.tables.level(step.level, kind);
        let count = level.points() + 1;
        let mut moved = [TurningMotion::default(); POINTS];
        for point in 0..count {
            let theta =
                if kind == ForceInterpolation::Constant { [0.0, 1.0][point] } else { level.basis.points[point] };
            (self.drives[point], moved[point]) = drive_at(&self.place, step.from + step.length * theta);
        }
        for (motion, weights) in self.motions.iter_mut().zip(&weights.work).take(count) {
            *motion = TurningMotion::default();
            moved[..count].iter().zip(weights).for_each(|(to, weight)| motion.add(*weight, &moved[0], to));
            if self.place.course.is_off_centre() {
                motion.shaft = moved[..count].iter().zip(weights).map(|(to, weight)| *weight * to.shaft).sum();
            }
        }
    }

    /// Adds the tried step, or a part of it, to sums.
    pub(super) fn add(&mut self, step: SpanStep, kind: ForceInterpolation, part: &PartWeights, sums: Sums) {
        if self.blade.trial.pushes() && (sums != Sums::WorkOnly || self.place.course.is_off_centre()) {
            let count = self.tables.level(step.level, kind).points() + 1;
            self.drives[..count].iter_mut().for_each(|drive| drive.rotor = libm::sincos(drive.rotor_angle));
            self.blade.trial.find_meridional(&self.tables.rows, self.tables.level(step.level, kind));
        }
        let faced = &self.place.faced_surface(&self.drives);
        let Blade { trial, tally, .. } = &mut *self.blade;
        let (rows, level, motions) = (&self.tables.rows, self.tables.level(step.level, kind), &self.motions);
        AddStep { tally, trial, rows, level, faced, motions, part, sums }.add();
    }

    /// Bounds the gaps in a step by the reach, and returns whether all of them stay above zero.
    fn is_clear(&mut self, step: SpanStep) -> bool {
        if !self.place.course.is_casing_at_rest() {
            return false;
        }
        let ends = [step.from, step.from + step.length];
        let mut drives = [PointDrive::default(); POINTS];
        drives.iter_mut().zip(ends).for_each(|(drive, theta)| *drive = self.drive_at(theta).0);
        let (faced, shaft) = (self.place.faced_surface(&drives), self.place.course.shaft_bounds(ends));
        let trial = &mut self.blade.trial;
        let is_clear = trial.find_clearance(&self.tables.rows, &faced, &shaft);
        if is_clear {
            trial.slow_mode_gaps.iter_mut().for_each(SlowModeGaps::forget);
        }
        is_clear
    }

    /// Advances the modes to the end of a step. `kind` is `None` for a flight.
    pub(super) fn advance(&mut self, step: SpanStep, kind: Option<ForceInterpolation>) {
        let Blade { trial, tally, .. } = &mut *self.blade;
        let level = self.tables.level(step.level, kind.unwrap_or(ForceInterpolation::Polynomial));
        let pushes = kind.is_some() && trial.pushes();
        tally.damping += trial.advance(level, pushes);
        if kind.is_some() {
            trial.begin_next_step(&self.tables.rows, level);
        }
        let [start, end] = &mut trial.slow_mode_gaps;
        swap(start, end);
        end.forget();
        if kind.is_some() {
            start.forget();
        }
        self.known = kind.is_some();
        self.reach_known &= !pushes;
    }

    /// Returns whether a step ends within the recorded part of the span.
    pub(super) fn ends_within(&self, step: SpanStep) -> bool {
        !matches!(self.recorded, RecordScope::Interval(ends) if step.from + step.length > ends[1])
    }

    /// Energy of the sector at the start of the step (J).
    pub(super) fn energy_at_start(&self) -> f64 {
        self.blade.trial.energy(&self.tables.rows)
    }
}

impl<'a> BladePlace<'a> {
    pub(super) fn faced_surface(&self, drives: &[PointDrive; POINTS]) -> FacedSurface<'a> {
        let is_off_centre = self.course.is_off_centre();
        FacedSurface { surface: &self.gap.surface, drives: *drives, friction: self.parameters.friction, is_off_centre }
    }
}

/// Prescribed motion of a sector at the fraction `theta` of a span, and the motion since the start of the span.
pub(super) fn drive_at(place: &BladePlace, theta: f64) -> (PointDrive, TurningMotion) {
    let (point, motion) = centred_drive_at(place, theta);
    if !place.course.is_off_centre() {
        return (point, motion);
    }
    let [shaft, velocity, moved] = place.course.shaft_at(theta);
    (point.with_shaft(shaft, velocity), TurningMotion { shaft: moved, ..motion })
}

/// Returns the prescribed motion without the displacement of the shaft.
pub(super) fn centred_drive_at(place: &BladePlace, theta: f64) -> (PointDrive, TurningMotion) {
    let (drive, motion) = place.course.turning_at(theta);
    let point = PointDrive {
        turned: drive.rotor_angle - drive.shape_rotation,
        factor: drive.shape_factor,
        clearance: place.gap.layout.clearances[place.sector] + drive.opening,
        speed: drive.speed,
        rotor_angle: drive.rotor_angle,
        rotor: (0.0, 1.0),
        ..PointDrive::default()
    };
    (point, motion)
}

impl SpanSteps for BladeInSpan<'_> {
    fn goal(&self) -> StepGoal {
        self.goal
    }

    fn control(&mut self) -> &mut StepControl {
        &mut self.control
    }

    fn largest_energy(&mut self) -> f64 {
        self.control.largest = self.control.largest.max(self.energy_at_start());
        self.control.largest
    }

    fn length(&self, level: usize) -> f64 {
        self.tables.length(level)
    }

    fn count(&self) -> u64 {
        1
    }

    fn fly(&mut self, step: SpanStep) -> Flight {
        if self.blade.trial.is_pushed() || !self.tables.rows.all_vibrate {
            return Flight::NeedsTrial;
        }
        // Vibration decays in long flights.
        let is_due = self.progress.done == 0 && self.progress.spans.is_multiple_of(REACH_SPANS);
        if !self.reach_known || is_due && matches!(self.recorded, RecordScope::Interval(_)) {
            self.blade.trial.find_reach(&self.tables.rows);
            self.reach_known = true;
        }
        if matches!(self.recorded, RecordScope::Interval(_)) && self.place.course.only_turns() && self.stays_clear() {
            self.open_flight(SpanStep { length: f64::INFINITY, ..step });
            return Flight::Accepted;
        }
        // Near a surface, the bounds by the reach are too coarse. The cubics of the slow modes require a centred shaft.
        let is_off_centre = self.place.course.is_off_centre();
        let is_clear = (step.level == 0 || is_off_centre) && self.is_clear(step);
        if !is_clear && (is_off_centre || !self.cubics_stay_open(step)) {
            let is_shortest = step.level == HALVINGS || self.length(step.level) <= LONGEST_NEAR_STEP;
            return if is_off_centre || is_shortest { Flight::NeedsTrial } else { Flight::TooLong };
        }
        // Results of a rejected trial do not belong to this step.
        (self.blade.trial.pushes, self.blade.trial.unresolved) = (false, None);
        if !self.ends_within(step) {
            self.open_flight(step);
            return Flight::Accepted;
        }
        if self.recorded != RecordScope::WorkOnly && self.needs_gaps() {
            self.follow(step, ForceInterpolation::Polynomial, [0.0, 1.0]);
        }
        self.advance(step, None);
        Flight::Accepted
    }

    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        let BladeTables { rows, .. } = self.tables;
        let level = self.tables.level(step.level, kind);
        self.find_drives(step, kind, &level.whole);
        let faced = self.place.faced_surface(&self.drives);
        let trial = &mut self.blade.trial;
        trial.begin(rows, self.known, &faced);
        self.known = true;
        self.tried = level.blocks;
        let mut result = trial.attempt(rows, level, &faced, self.goal.precision);
        self.find_step_minima(step, kind, &mut result);
        result
    }

    fn accept(&mut self, step: SpanStep, kind: ForceInterpolation, result: &TrialResult) -> f64 {
        let (is_open, level) = (!self.ends_within(step), self.tables.level(step.level, kind));
        let records = !is_open && self.recorded != RecordScope::WorkOnly;
        let before = take(&mut self.blade.tally.work);
        self.add(step, kind, &level.whole, if records { Sums::All } else { Sums::WorkOnly });
        let Blade { trial, tally, .. } = &mut *self.blade;
        let rows = &self.tables.rows;
        let banked = match kind {
            ForceInterpolation::Constant => {
                tally.work.dropped += trial.dropped(rows);
                tally.work.dropped + tally.work.closing
            }
            ForceInterpolation::Polynomial if result.switches => -result.switched,
            ForceInterpolation::Polynomial => 0.0,
        };
        if trial.pushes() {
            trial.find_modal_forces(rows, level);
        } else if is_open {
            trial.modal_forces.iter_mut().for_each(|modal| modal.fill(Eight::ZERO));
        }
        let is_resolved = result.resolves_motion(kind, self.goal.tolerance);
        let work = replace(&mut tally.work, before);
        if is_open {
            self.find_gap_bounds(step, kind, is_resolved);
            let energy = self.energy_at_start();
            self.open = Some(OpenStep { step, kind: Some(kind), is_resolved, work, energy, banked });
            return banked;
        }
        tally.work.add(&work);
        if records {
            self.record_step_minima(step, kind);
        }
        self.advance(step, Some(kind));
        banked
    }
}
