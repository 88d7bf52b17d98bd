//! A contact pair: contact nodes of one structure against a surface, which another structure may carry.

use tiprub_cosim::persist_fields;

use super::Structure;
use super::carrier::Spot;
use crate::contact::ContactParameters;
use crate::geometry::frame::PolarFrame;
use crate::geometry::surface_spline::motion::PatchMotions;
use crate::geometry::surface_spline::{ClosestPoint, SurfaceSpline};
use crate::geometry::wrench::MotionIncrement;
use crate::geometry::{GapLaw, PrescribedMotion};
use crate::system::history::{ContactHistory, Two};

/// The structure that carries the surface of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceCarrier {
    /// Index of the structure.
    pub structure: usize,
    /// First row of the carrier that moves a control point of this surface.
    pub first_row: usize,
}

/// Parts of a pair.
#[derive(Debug, Clone)]
pub struct PairParts {
    /// Structure whose contact nodes touch.
    pub structure: usize,
    /// The gap function of these nodes.
    pub gap: GapLaw,
    /// Structure that deforms the surface; `None` for a rigid surface.
    pub carrier: Option<SurfaceCarrier>,
    /// Parameters of the contact law.
    pub parameters: ContactParameters,
}

/// Prescribed motion over the last steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Prescribed {
    /// At the last step, and at the previous step.
    pub(crate) drive: Two<PrescribedMotion>,
    /// Change over the last step, and over the previous step.
    pub(crate) motion: Two<MotionIncrement>,
    /// At the start of the steady phase or of the last internal step, as if the shape were fully grown.
    pub(crate) begun: PrescribedMotion,
    /// Time since the growth of the shape began, at that start, and duration of the growth (s).
    pub(crate) growth: [f64; 2],
}

persist_fields!(Prescribed { drive, motion, begun, growth });

impl Prescribed {
    /// Motion at the start, in the middle and at the end of an interval of a steady phase, and growth of the shape over
    /// it. The interval begins at `from` (s since the start of the phase) and has a length (s).
    pub(crate) fn in_steady_phase(&self, from: f64, length: f64) -> ([PrescribedMotion; 3], ShapeGrowth) {
        let (Self { begun, growth: [elapsed, duration], .. }, from_angle) = (self, self.begun.speed * from);
        let grown = elapsed + from;
        let at = |after: f64| PrescribedMotion {
            rotor_angle: begun.rotor_angle + from_angle % std::f64::consts::TAU + begun.speed * after,
            shape_factor: begun.shape_factor * ShapeGrowth::share(grown + after, *duration),
            ..*begun
        };
        let growth =
            ShapeGrowth { factors: [begun.shape_factor; 2], elapsed: [grown, grown + length], length: *duration };
        ([0.0, 0.5 * length, length].map(at), growth)
    }
}

/// A contact pair with its prescribed motion.
#[derive(Debug, Clone)]
pub struct ContactPair {
    /// Parts of the pair.
    pub(crate) parts: PairParts,
    /// Contact nodes of the pair.
    nodes: Vec<usize>,
    pub(crate) prescribed: Prescribed,
    /// Prescribed motion in the middle of the current span, and the growth of the shape, if a scheme needs them.
    pub(crate) middle: (PrescribedMotion, ShapeGrowth),
    /// Scratch: bounds of the motion of the surface.
    motions: PatchMotions,
}

impl ContactPair {
    pub(crate) fn new(parts: PairParts) -> Self {
        let (nodes, prescribed, middle) = (parts.gap.members(), Prescribed::default(), Default::default());
        let motions = parts.gap.spline().map(SurfaceSpline::motions).unwrap_or_default();
        Self { nodes, parts, prescribed, middle, motions }
    }

    /// Structure whose contact nodes touch.
    pub fn structure(&self) -> usize {
        self.parts.structure
    }

    /// Contact nodes of the pair.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// The gap function.
    pub fn gap(&self) -> &GapLaw {
        &self.parts.gap
    }

    /// Structure that deforms the surface.
    pub fn carrier(&self) -> Option<SurfaceCarrier> {
        self.parts.carrier
    }

    /// Prescribed motion at the last step.
    #[inline(always)]
    pub fn drive_now(&self) -> &PrescribedMotion {
        &self.prescribed.drive.now
    }

    /// Starts with the prescribed motion `drive`, without earlier motion.
    pub(crate) fn start(&mut self, drive: &PrescribedMotion) {
        self.prescribed = Prescribed { drive: Two::new(*drive), begun: *drive, ..Prescribed::default() };
    }

    /// Starts a step of length `step` (s) to the prescribed motion `drive`.
    pub(crate) fn move_to(&mut self, drive: &PrescribedMotion, step: f64) {
        let Prescribed { drive: drives, motion, .. } = &mut self.prescribed;
        (drives.before, motion.before) = (drives.now, motion.now);
        drives.now = *drive;
        motion.now = MotionIncrement::between(&drives.before, drive, step);
        self.parts.gap.turn(motion.now.turn);
    }

    /// Scales the last change of prescribed motion by `ratio`, for another step size.
    pub(crate) fn stretch(&mut self, ratio: f64) {
        self.prescribed.motion.now = self.prescribed.motion.now.over(ratio);
    }

    /// Directions of the frame of a node at a rotor angle (rad); fixed directions if nothing rotates.
    #[inline(always)]
    pub(crate) fn frame(&self, index: usize, rotor_angle: f64) -> PolarFrame {
        self.parts.gap.layout().map_or(PolarFrame::FIXED, |layout| PolarFrame::new(layout.angles[index] + rotor_angle))
    }

    /// Returns the location at which a contact of the node at `index` acts on the carrier of the surface, at a rotor angle (rad); `None`
    /// for a rigid surface.
    #[inline(always)]
    pub(crate) fn spot(&self, index: usize, place: ClosestPoint, rotor_angle: f64) -> Option<Spot<'_>> {
        let carrier = self.parts.carrier?;
        Some(Spot { surface: self.parts.gap.spline()?, carrier, place, frame: self.frame(index, rotor_angle) })
    }

    /// Deforms the surface by this factor on its shape and, if it has a surface carrier, by these displacements of the
    /// rows of the carrier (m).
    pub(crate) fn bend(&mut self, factor: f64, rows: &[f64]) {
        let points = self.parts.gap.spline().map_or(0, |surface| surface.control_points().len());
        let moved = self.parts.carrier.map_or(&[][..], |carrier| &rows[carrier.first_row..][..3 * points]);
        self.parts.gap.bend(factor, moved);
    }

    /// Finds upper bounds of the change of any gap of each sector (m) by the prescribed `motion` alone, from the current position. `rows` are
    /// the current displacements of all rows of the surface carrier (m). Returns false unless the surface is a smooth ring with a carrier.
    pub(crate) fn find_prescribed_changes(
        &mut self,
        motion: &MotionIncrement,
        rows: &[f64],
        changes: &mut [f64],
    ) -> bool {
        let Self { parts, prescribed, motions, .. } = self;
        let (Some(gap), Some(carrier)) = (parts.gap.smooth_ring(), parts.carrier) else { return false };
        let rows = &rows[carrier.first_row..][..3 * gap.surface.control_points().len()];
        gap.gap_changes(&prescribed.drive.now, motion, [rows, rows], motions, changes);
        true
    }

    /// Bounds the motion of a smooth ring in every patch around. `square_of` returns the largest squared motion (m²) of the control point
    /// whose first row in the carrier is its argument.
    pub(crate) fn find_surface_motions(&mut self, square_of: impl Fn(usize) -> f64) {
        let Self { parts, motions, .. } = self;
        if let (Some(gap), Some(carrier)) = (parts.gap.smooth_ring(), parts.carrier) {
            gap.surface.patch_displacements(|point| square_of(carrier.first_row + 3 * point), motions);
        }
    }

    /// Largest bound of [`ContactPair::find_surface_motions`] in the patches that a sector may face during the last step (m); 0 if the surface
    /// is not a smooth ring.
    pub(crate) fn faced_motion(&self, sector: usize) -> f64 {
        let Self { parts, prescribed, motions, .. } = self;
        parts.gap.smooth_ring().map_or(0.0, |gap| {
            let faced = gap.faced_patches(sector, &prescribed.drive.now, prescribed.motion.now.relative_turn());
            gap.largest_faced(faced, |patch| motions.bound(patch))
        })
    }

    /// Finds the gaps of the nodes that may be in contact or that outputs need, at the displacements of the next step.
    pub(crate) fn find_near_gaps(&mut self, structures: &mut [Structure]) {
        let is_skipping = structures[self.structure()].nearness.is_used();
        let (Some(carrier), true) = (self.carrier(), is_skipping) else {
            return self.find_gaps(structures, SearchStart::PreviousStep);
        };
        let Self { parts: PairParts { structure, gap: GapLaw::Spline(gap), .. }, prescribed, motions, .. } = self
        else {
            return self.find_gaps(structures, SearchStart::PreviousStep);
        };
        let rows = carrier.first_row..carrier.first_row + 3 * gap.surface.control_points().len();
        let (structure, carrier) = two(structures, [*structure, carrier.structure]);
        let (now, before) = (&carrier.modes.displacement()[rows.clone()], &carrier.modes.displacement_before()[rows]);
        let changes = &mut structure.nearness.changes;
        gap.gap_changes(&prescribed.drive.now, &prescribed.motion.now, [now, before], motions, changes);
        structure.find_near_gaps(gap, &prescribed.drive.now, now);
    }

    /// Finds the gaps of the nodes at the current displacements. The search for closest points begins at `start`.
    pub(crate) fn find_gaps(&mut self, structures: &mut [Structure], start: SearchStart) {
        let Self { parts: PairParts { structure, gap, carrier, .. }, prescribed, .. } = self;
        let points = gap.spline().map_or(0, |surface| surface.control_points().len());
        let (structure, moved) = match carrier {
            None => (&mut structures[*structure], &[][..]),
            Some(SurfaceCarrier { structure: carrier, first_row }) => {
                let (structure, carrier) = two(structures, [*structure, *carrier]);
                (structure, &carrier.modes.displacement()[*first_row..][..3 * points])
            }
        };
        let ContactHistory { gap: gaps, geometry: Two { now, before }, .. } = &mut structure.history;
        let (drive, displacement) = (&prescribed.drive.now, structure.modes.displacement());
        match gap {
            GapLaw::Spline(ring)
                if matches!(start, SearchStart::Angles | SearchStart::StartOfSpan) && ring.surface.is_smooth_ring() =>
            {
                let guess = (start == SearchStart::StartOfSpan).then_some(&before.places[..]);
                ring.evaluate_ring(drive, displacement, moved, guess, now, &mut gaps.now);
            }
            _ => {
                let before = (start != SearchStart::Positions).then_some(&*before);
                gap.evaluate(drive, displacement, moved, before, now, &mut gaps.now);
            }
        }
        if let Some(gap) = gap.spline_law().filter(|_| structure.nearness.is_used()) {
            structure.note_all_evaluated(&gap.nodes);
        }
    }
}

/// Returns a structure and the structure that carries the surface it touches.
fn two(structures: &mut [Structure], indices: [usize; 2]) -> (&mut Structure, &Structure) {
    let Ok([structure, carrier]) = structures.get_disjoint_mut(indices) else {
        unreachable!("a structure does not carry the surface that it touches")
    };
    (structure, carrier)
}

/// Start of the search for closest points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SearchStart {
    /// The closest points of the previous step.
    PreviousStep,
    /// The positions of the nodes.
    Positions,
    /// The closest points of the previous communication step, improved by Newton steps on smooth rings. Other surfaces use the general search,
    /// as with `PreviousStep`.
    StartOfSpan,
    /// The angles of the nodes on smooth rings, and the closest points of the previous step on other surfaces.
    Angles,
}

/// Growth of the shape of a surface over a span: a factor that is linear in time, times ½(1 − cos(πt/T)) until T.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ShapeGrowth {
    /// Factor at the start and the end.
    pub factors: [f64; 2],
    /// Time since the growth began (s), at the start and the end.
    pub elapsed: [f64; 2],
    /// Duration T of the growth (s); 0 for a shape that is complete from the start.
    pub length: f64,
}

impl ShapeGrowth {
    /// Fraction of the shape that has grown after the time `elapsed` (s) of a growth that takes `length` (s). Negative
    /// times count as zero; rounding may cause them in the first step.
    pub fn share(elapsed: f64, length: f64) -> f64 {
        let elapsed = elapsed.max(0.0);
        if elapsed >= length { 1.0 } else { 0.5 * (1.0 - libm::cos(std::f64::consts::PI * elapsed / length)) }
    }

    /// Returns the factor at the fraction `theta` of the span.
    pub fn at(&self, theta: f64) -> f64 {
        let between = |ends: [f64; 2]| ends[0] + theta * (ends[1] - ends[0]);
        between(self.factors) * Self::share(between(self.elapsed), self.length)
    }

    /// Returns the rate of the factor at the fraction `theta` of the span, per span.
    pub fn rate_at(&self, theta: f64) -> f64 {
        let Self { factors, elapsed: [from, to], length } = *self;
        let (elapsed, change) = (from + theta * (to - from), factors[1] - factors[0]);
        let phase = std::f64::consts::PI * elapsed / length;
        let grows = 0.0 < elapsed && elapsed < length;
        let share_rate = if grows { 0.5 * std::f64::consts::PI / length * libm::sin(phase) * (to - from) } else { 0.0 };
        change * Self::share(elapsed, length) + (factors[0] + theta * change) * share_rate
    }

    /// Bounds the first three derivatives of the factor between two fractions of the span, per interval.
    pub fn largest_derivatives(&self, ends: [f64; 2]) -> [f64; 3] {
        let Self { factors, elapsed, length } = *self;
        let part = ends[1] - ends[0];
        let change = ((factors[1] - factors[0]) * part).abs();
        if elapsed[0] + ends[0] * (elapsed[1] - elapsed[0]) >= length {
            return [change, 0.0, 0.0];
        }
        let turn = std::f64::consts::PI * (part * (elapsed[1] - elapsed[0]) / length).abs();
        let half = 0.5 * factors[0].abs().max(factors[1].abs());
        [change + half * turn, (change + half * turn) * turn, (1.5 * change + half * turn) * turn * turn]
    }

    /// Bounds the error of the cubic through the factor and its rate at two fractions of the span: the part that is
    /// proportional to the squared length of the interval, and the part that is proportional to its fourth power.
    pub fn cubic_errors(&self, ends: [f64; 2]) -> [f64; 2] {
        let Self { factors, elapsed, length } = *self;
        let [from, to] = ends.map(|end| elapsed[0] + end * (elapsed[1] - elapsed[0]));
        if from.max(0.0) >= length {
            return [0.0; 2];
        }
        let turn = std::f64::consts::PI * (to - from) / length;
        let size = 0.5 * factors[0].abs().max(factors[1].abs()) * turn * turn;
        // The growth begins and ends with a jump of its second derivative.
        [if from < 0.0 || to > length { size / 32.0 } else { 0.0 }, size * turn * turn / 384.0]
    }
}
