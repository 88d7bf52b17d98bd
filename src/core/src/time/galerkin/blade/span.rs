//! Integration of a blade over a span.

use super::level::BladeLevel;
use super::minima::{MIN_HALVINGS, PARTS};
use super::reach::Clearance;
use super::rows::BladeRows;
use super::surface::{FacedSurface, PointDrive};
use super::tally::BladeTally;
use super::trial::{BladeTrial, NodeAngles};
use crate::contact::ContactParameters;
use crate::geometry::GapLaw;
use crate::geometry::revolution::RevolutionGap;
use crate::geometry::wrench::MotionIncrement;
use crate::math::octet::Eight;
use crate::scene::method::Solver;
use crate::system::structure::NeededMinima;
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::island::StepControl;
use crate::time::galerkin::record::MotionCourse;
use crate::time::galerkin::span::{SpanStep, SpanSteps, StepGoal};
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::{HALVINGS, Tables};
use crate::time::galerkin::trial::{ForceInterpolation, TrialResult};

/// Tables of one kind of sector.
#[derive(Debug, Clone)]
struct BladeTables {
    rows: BladeRows,
    levels: Vec<BladeLevel>,
    /// Steps of the shortest length with a constant force.
    constant: BladeLevel,
}

/// Tables of a blade for all kinds of its sectors, its trials, and sums over a span. Allocates only on creation.
#[derive(Debug, Clone)]
pub(crate) struct Blade {
    kinds: Vec<BladeTables>,
    /// Angles of the nodes of each sector.
    angles: Vec<NodeAngles>,
    trial: BladeTrial,
    pub tally: BladeTally,
    /// Smallest gaps of the nodes over all sectors so far (m); gaps of the current sector at the start of the span (m);
    /// and gaps below which the smallest gaps of the current sector are needed (m).
    lowest: Vec<Eight>,
    begun: Vec<Eight>,
    floors: Vec<Eight>,
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
    pub course: &'a MotionCourse,
}

impl Blade {
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
        if gap.nodes.len() != kinds[0].nodes() || gap.shaft_moves {
            return None;
        }
        let of = |tables: &Tables| {
            let rows = BladeRows::new(tables.shapes(), tables.rows.error_form(), &gap.slopes, &gap.layout);
            let level = |kind| BladeLevel::new(&rows, tables.levels[0].basis.degree, kind);
            let levels = tables.levels.iter().map(|_| level(ForceInterpolation::Polynomial)).collect();
            BladeTables { levels, constant: level(ForceInterpolation::Constant), rows }
        };
        let kinds: Vec<_> = kinds.iter().map(of).collect();
        let rows = &kinds.first()?.rows;
        let (trial, tally) = (BladeTrial::new(rows, degrees().max()?), BladeTally::new(rows));
        let of_nodes = || vec![Eight::ZERO; rows.blocks];
        let angles = (0..gap.layout.lanes).map(|sector| NodeAngles::new(&gap.layout, sector)).collect();
        Some(Self { trial, tally, lowest: of_nodes(), begun: of_nodes(), floors: of_nodes(), angles, kinds })
    }

    /// Fills the tables from the tables of all contact rows, without allocating.
    pub fn fill(&mut self, kinds: &[Tables]) {
        for (BladeTables { rows, levels, constant }, tables) in self.kinds.iter_mut().zip(kinds) {
            levels.iter_mut().zip(&tables.levels).for_each(|(level, from)| level.fill(rows, from));
            constant.fill(rows, &tables.levels[HALVINGS]);
        }
    }

    /// Starts a span of all sectors, with gaps (m) of all nodes in rows of `lanes` lanes.
    pub fn begin_span(&mut self, gaps: &[f64], lanes: usize, sectors: usize) {
        let smallest = |row: &[f64]| row[..sectors].iter().copied().fold(f64::INFINITY, f64::min);
        Eight::spread(gaps.chunks_exact(lanes).map(smallest), f64::NEG_INFINITY, &mut self.lowest);
    }

    /// Starts a span of a sector with these gaps (m) of its nodes, and finds which smallest gaps are needed.
    pub fn choose_minima(&mut self, needed: &NeededMinima, sector: usize, gap: impl Fn(usize) -> f64) {
        let Self { kinds, tally, lowest, begun, floors, .. } = self;
        let nodes = kinds[0].rows.nodes;
        Eight::spread((0..nodes).map(&gap), f64::INFINITY, begun);
        tally.begin(begun);
        let own = if needed.all_of(sector) {
            f64::INFINITY
        } else if needed.by_sector {
            (0..nodes).map(gap).fold(f64::INFINITY, f64::min)
        } else {
            f64::NEG_INFINITY
        };
        for (floor, lowest) in floors.iter_mut().zip(lowest) {
            *floor = Eight(lowest.0.map(|lowest| lowest.max(own)));
        }
    }

    /// Rows of the sectors of a kind.
    pub fn rows(&self, kind: usize) -> &BladeRows {
        &self.kinds[kind].rows
    }
}

/// A sector of a blade during a span.
pub(crate) struct BladeInSpan<'a> {
    blade: &'a mut Blade,
    place: BladePlace<'a>,
    pub control: StepControl,
    goal: StepGoal,
    /// Prescribed motion at the points of the tried step, and the motion over which the forces there do work.
    motions: [MotionIncrement; POINTS],
    drives: [PointDrive; POINTS],
    /// True if the displacements and gaps at the start of the step are known; and true if the reach without contact is
    /// known.
    known: bool,
    reach_known: bool,
    /// Number of blocks of lanes of the last trial in this span.
    tried: usize,
}

impl<'a> BladeInSpan<'a> {
    /// Begins a span of a sector from a state.
    pub fn begin(
        blade: &'a mut Blade,
        place: BladePlace<'a>,
        control: StepControl,
        goal: StepGoal,
        state: &SectorState,
    ) -> Self {
        let rows = &blade.kinds[place.kind].rows;
        blade.trial.read(rows, state, &blade.angles[place.sector]);
        Self {
            blade,
            place,
            control,
            goal,
            motions: Default::default(),
            drives: Default::default(),
            known: false,
            reach_known: false,
            tried: 0,
        }
    }

    /// Writes the state at the end of the span.
    pub fn write(&mut self, state: &mut SectorState) {
        let Blade { kinds, trial, lowest, tally, .. } = &mut *self.blade;
        trial.write(&kinds[self.place.kind].rows, state);
        for (lowest, own) in lowest.as_mut_slice().iter_mut().zip(&tally.lowest) {
            lowest.0.iter_mut().zip(own.0).for_each(|(lowest, own)| *lowest = lowest.min(own));
        }
    }

    /// Returns whether a gap of the last trial in this span is not a number.
    pub fn is_lost(&self) -> bool {
        self.blade.trial.is_lost(self.tried)
    }

    /// Finds the prescribed motion at the points of a step.
    fn find_drives(&mut self, step: SpanStep, kind: ForceInterpolation) {
        let level = self.blade.kinds[self.place.kind].level(step.level, kind);
        let count = level.points() + 1;
        let mut moved = [MotionIncrement::default(); POINTS];
        for point in 0..count {
            let theta =
                if kind == ForceInterpolation::Constant { [0.0, 1.0][point] } else { level.basis.points[point] };
            (self.drives[point], moved[point]) = drive_at(&self.place, step.from + step.length * theta);
        }
        for (motion, weights) in self.motions.iter_mut().zip(&level.work).take(count) {
            let terms = (0..count).map(|k| moved[k].less(&moved[0]).over(weights[k]));
            *motion = terms.fold(MotionIncrement::default(), |sum, term| sum.since(&term));
        }
    }
}

impl<'a> BladePlace<'a> {
    fn faced_surface(&self, drives: &[PointDrive; POINTS]) -> FacedSurface<'a> {
        FacedSurface { surface: &self.gap.surface, drives: *drives, friction: self.parameters.friction }
    }
}

/// Prescribed motion of a sector at the fraction `theta` of a span, and the motion since the start of the span.
fn drive_at(place: &BladePlace, theta: f64) -> (PointDrive, MotionIncrement) {
    let (drive, motion) = place.course.at(theta);
    let layout = &place.gap.layout;
    let point = PointDrive {
        turned: drive.rotor_angle - drive.shape_rotation,
        factor: drive.shape_factor,
        clearance: layout.clearances[place.sector] + drive.gap_offset + drive.radius_change,
        speed: drive.speed,
        rotor_angle: drive.rotor_angle,
        rotor: (0.0, 1.0),
    };
    (point, motion)
}

impl BladeTables {
    fn level(&self, level: usize, kind: ForceInterpolation) -> &BladeLevel {
        if kind == ForceInterpolation::Constant { &self.constant } else { &self.levels[level] }
    }
}

impl SpanSteps for BladeInSpan<'_> {
    fn goal(&self) -> StepGoal {
        self.goal
    }

    fn control(&mut self) -> &mut StepControl {
        &mut self.control
    }

    fn largest_energy(&mut self) -> f64 {
        let energy = self.blade.trial.energy(&self.blade.kinds[self.place.kind].rows);
        self.control.largest = self.control.largest.max(energy);
        self.control.largest
    }

    fn length(&self, level: usize) -> f64 {
        self.blade.kinds[self.place.kind].levels[level].step
    }

    fn count(&self) -> u64 {
        1
    }

    fn fly(&mut self, step: SpanStep) -> bool {
        let Blade { trial, kinds, floors, tally, .. } = &mut *self.blade;
        let rows = &kinds[self.place.kind].rows;
        if trial.is_pushed() || !self.place.course.only_turns() {
            return false;
        }
        if !self.reach_known {
            trial.find_reach(rows);
            self.reach_known = true;
        }
        let mut drives = [PointDrive::default(); POINTS];
        for (drive, theta) in drives.iter_mut().zip([step.from, step.from + step.length]) {
            *drive = drive_at(&self.place, theta).0;
        }
        match trial.find_clearance(rows, &self.place.faced_surface(&drives), floors, &tally.lowest) {
            Clearance::Unknown => return false,
            Clearance::Needed => {
                let result = self.attempt(step, ForceInterpolation::Polynomial);
                self.accept(step, ForceInterpolation::Polynomial, &result);
            }
            Clearance::Wide => {
                tally.damping += trial.advance(&kinds[self.place.kind].levels[step.level], false);
                self.known = false;
            }
        }
        true
    }

    fn attempt(&mut self, step: SpanStep, kind: ForceInterpolation) -> TrialResult {
        self.find_drives(step, kind);
        let faced = self.place.faced_surface(&self.drives);
        let tables = &self.blade.kinds[self.place.kind];
        let trial = &mut self.blade.trial;
        trial.begin(&tables.rows, self.known, &faced);
        self.known = true;
        let level = tables.level(step.level, kind);
        self.tried = level.blocks;
        trial.attempt(&tables.rows, level, &faced, self.goal.precision)
    }

    fn accept(&mut self, step: SpanStep, kind: ForceInterpolation, result: &TrialResult) -> f64 {
        if self.blade.trial.pushes() {
            self.drives.iter_mut().for_each(|drive| drive.rotor = libm::sincos(drive.rotor_angle));
        }
        let faced = self.place.faced_surface(&self.drives);
        let Blade { trial, kinds, tally, floors, .. } = &mut *self.blade;
        let BladeTables { rows, .. } = &kinds[self.place.kind];
        let level = kinds[self.place.kind].level(step.level, kind);
        let before = tally.work.closing;
        trial.add(rows, level, (&faced, &self.motions), tally);
        let banked = match kind {
            ForceInterpolation::Constant => {
                let dropped = trial.dropped(rows);
                tally.work.dropped += dropped;
                dropped + tally.work.closing - before
            }
            ForceInterpolation::Polynomial if result.switches => -result.switched,
            ForceInterpolation::Polynomial => 0.0,
        };
        let pushes = trial.pushes();
        if pushes {
            trial.find_modal_forces(rows, level);
        }
        // If a step misses the tolerance, its polynomials do not describe the motion between its points. There are no
        // tables for parts of the shortest steps, whose points are close together.
        let has_parts = step.level + MIN_HALVINGS <= HALVINGS;
        let tolerance = if has_parts && result.resolves_motion(kind, self.goal.tolerance) {
            self.goal.tolerance
        } else {
            f64::INFINITY
        };
        if trial.find_minima((rows, level), tally, floors, tolerance) {
            let finer = trial.find_halvings(rows, level, self.goal.tolerance).min(HALVINGS - step.level);
            let parts = 1_usize << finer;
            let mut drives = [PointDrive::default(); PARTS + 1];
            for (end, drive) in drives[..=parts].iter_mut().enumerate() {
                #[expect(clippy::cast_precision_loss, reason = "few parts")]
                let theta = end as f64 / parts as f64;
                *drive = drive_at(&self.place, step.from + step.length * theta).0;
            }
            let part = &kinds[self.place.kind].levels[step.level + finer];
            trial.follow((rows, level, part), (&faced, &drives[..=parts]), tally);
        }
        tally.damping += trial.advance(level, pushes);
        trial.begin_next_step(rows, level);
        self.reach_known &= !pushes;
        banked
    }
}
