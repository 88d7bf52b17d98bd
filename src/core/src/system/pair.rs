//! A contact pair: contact nodes of one structure against a surface, which another structure may carry.

use super::Structure;
use super::growth::ShapeGrowth;
use crate::gaps::frame::PolarFrame;
use crate::gaps::surface_spline::{ClosestPoint, SurfaceSpline};
use crate::gaps::wrench::MotionIncrement;
use crate::gaps::{GapLaw, PrescribedMotion};
use crate::history::Two;
use crate::persist::persist_fields;

/// Where the surface of a pair is carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceCarrier {
    /// The structure.
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
    /// Which structure deforms the surface; `None` for a rigid one.
    pub carrier: Option<SurfaceCarrier>,
    /// Coulomb coefficient µ.
    pub friction: f64,
    /// Tangential per normal force of a coating that is cut (-); 0 without one.
    pub cutting: f64,
}

/// Prescribed motion over the last steps.
#[derive(Debug, Clone, PartialEq, Default)]
struct Prescribed {
    /// At the last step, and before.
    drive: Two<PrescribedMotion>,
    /// Over the last step, and over the one before.
    motion: Two<MotionIncrement>,
}

persist_fields!(Prescribed { drive, motion });

/// A pair with the prescribed motion of what touches.
#[derive(Debug, Clone)]
pub struct ContactPair {
    /// Parts of the pair.
    pub(super) parts: PairParts,
    /// Contact nodes that belong to it.
    nodes: Vec<usize>,
    prescribed: Prescribed,
    /// Prescribed motion in the middle of the span under way, and how the shape grows, where a scheme asks for it.
    pub(super) middle: (PrescribedMotion, ShapeGrowth),
}

impl ContactPair {
    pub(super) fn new(parts: PairParts) -> Self {
        Self { nodes: parts.gap.members(), parts, prescribed: Prescribed::default(), middle: Default::default() }
    }

    /// Structure whose contact nodes touch.
    pub fn structure(&self) -> usize {
        self.parts.structure
    }

    /// Contact nodes that belong to it.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// The gap function.
    pub fn gap(&self) -> &GapLaw {
        &self.parts.gap
    }

    /// Which structure deforms the surface.
    pub fn carrier(&self) -> Option<SurfaceCarrier> {
        self.parts.carrier
    }

    /// Coulomb coefficient µ.
    pub fn friction(&self) -> f64 {
        self.parts.friction
    }

    /// Tangential per normal force of a coating that is cut (-); 0 without one.
    pub fn cutting(&self) -> f64 {
        self.parts.cutting
    }

    /// The gap function, to evaluate it.
    pub(super) fn gap_mut(&mut self) -> &mut GapLaw {
        &mut self.parts.gap
    }

    /// Prescribed motion one step before the last.
    pub fn drive_before(&self) -> &PrescribedMotion {
        self.drive(When::Before)
    }

    /// Prescribed motion at the last step.
    pub fn drive_now(&self) -> &PrescribedMotion {
        self.drive(When::Now)
    }

    /// Prescribed motion at the last step, or one earlier.
    #[inline(always)]
    pub(super) fn drive(&self, when: When) -> &PrescribedMotion {
        match when {
            When::Now => &self.prescribed.drive.now,
            When::Before => &self.prescribed.drive.before,
        }
    }

    /// Prescribed motion over the last step.
    pub(super) fn motion(&self) -> &MotionIncrement {
        &self.prescribed.motion.now
    }

    /// Over the step before.
    pub(super) fn motion_before(&self) -> &MotionIncrement {
        &self.prescribed.motion.before
    }

    /// Nothing has moved before `drive`.
    pub(super) fn start(&mut self, drive: &PrescribedMotion) {
        self.prescribed = Prescribed { drive: Two::new(*drive), motion: Two::default() };
    }

    /// A step (s) to `drive` is under way.
    pub(crate) fn move_to(&mut self, drive: &PrescribedMotion, step: f64) {
        let Prescribed { drive: drives, motion } = &mut self.prescribed;
        (drives.before, motion.before) = (drives.now, motion.now);
        drives.now = *drive;
        motion.now = MotionIncrement::between(&drives.before, drive, step);
        self.parts.gap.turn(motion.now.turn);
    }

    /// The step before was `ratio` times as long.
    pub(super) fn stretch(&mut self, ratio: f64) {
        self.prescribed.motion.now = self.prescribed.motion.now.over(ratio);
    }

    /// Prescribed motion as a part of a state.
    pub(super) fn state(&self) -> &impl crate::persist::Persist {
        &self.prescribed
    }

    /// The same, to restore it.
    pub(super) fn state_mut(&mut self) -> &mut impl crate::persist::Persist {
        &mut self.prescribed
    }

    /// Directions of a node's own frame at a rotor angle (rad); the fixed ones where nothing turns.
    #[inline(always)]
    pub(super) fn frame(&self, index: usize, rotor_angle: f64) -> PolarFrame {
        self.parts.gap.layout().map_or(PolarFrame::FIXED, |layout| PolarFrame::new(layout.angles[index] + rotor_angle))
    }

    /// The surface and what carries it; `None` for one that nothing deforms.
    #[inline(always)]
    pub(super) fn carried(&self) -> Option<(&SurfaceSpline, SurfaceCarrier)> {
        let carrier = self.parts.carrier?;
        Some((self.parts.gap.spline()?, carrier))
    }

    /// The surface is as with this factor of its shape and rows of its carrier displaced so (m).
    pub(super) fn bend(&mut self, factor: f64, rows: &[f64]) {
        let Some(carrier) = self.parts.carrier else { return };
        let points = self.parts.gap.spline().map_or(0, |surface| surface.control_points().len());
        self.parts.gap.bend(factor, &rows[carrier.first_row..][..3 * points]);
    }

    /// Gaps of its nodes at the displacements of now; `warm`: closest points are sought from those of the step before.
    pub(crate) fn find_gaps(&mut self, structures: &mut [Structure], warm: bool) {
        let Self { parts: PairParts { structure, gap, carrier, .. }, prescribed, .. } = self;
        let drive = &prescribed.drive.now;
        let Some(carrier) = carrier else { return structures[*structure].find_gaps(gap, drive, &[], warm) };
        let points = gap.spline().map_or(0, |surface| surface.control_points().len());
        let Ok([structure, under]) = structures.get_disjoint_mut([*structure, carrier.structure]) else {
            unreachable!("a structure does not carry the surface that it touches")
        };
        let moved = &under.modes().displacement()[carrier.first_row..][..3 * points];
        structure.find_gaps(gap, drive, moved, warm);
    }
}

/// Which of two instants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// The last step.
    Now,
    /// One step earlier.
    Before,
}

/// Value of a place on a surface, of values per row of its carrier, in the directions of `frame`.
pub(super) fn at_place(
    (surface, carrier): (&SurfaceSpline, SurfaceCarrier),
    place: ClosestPoint,
    frame: PolarFrame,
    value: impl Fn(usize) -> f64,
) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (index, weight) in surface.weights(place).iter() {
        for (component, sum) in sum.iter_mut().enumerate() {
            *sum += weight * value(carrier.first_row + 3 * index + component);
        }
    }
    frame.local(sum)
}
