//! Surfaces that the sectors of an island may touch, and a record of its steps.

use super::carrier::CarrierIntegrator;
use super::compliance::Lanes;
use super::island::Island;
use super::level::StepTables;
use super::span::SpanStep;
use super::trial::{ForceInterpolation, Obstacle, Trial};
use crate::math::vector::Vector3;
use crate::modes::bank::Disk;
use std::ops::RangeInclusive;

/// A step that is accepted.
#[derive(Debug)]
pub struct AcceptedStep<'a> {
    /// Tables for the length of the step.
    pub level: &'a StepTables,
    /// Interpolation of the contact force.
    pub kind: ForceInterpolation,
    /// Forces, gaps and displacements at the points of the step.
    pub trial: &'a Trial,
    /// ½ΔfᵀGΔf, the energy lost by the change to a constant force (J).
    pub dropped: f64,
}

/// Records the steps of a span while it is integrated.
pub trait Witness: Obstacle {
    /// Called before a step of `length` from `from` (fractions of the span) is tried, with forces at the points of `level`.
    fn begin_step(&mut self, from: f64, length: f64, level: &StepTables, kind: ForceInterpolation);

    /// Returns whether nodes that stay within `reach` of their rest positions (m, three per node) cannot touch during a step of
    /// `length` from `from` (fractions of the span).
    fn is_clear(&self, from: f64, length: f64, reach: &[f64]) -> bool;

    /// Returns whether a node that stays within `reach` may come closer during the step than at its ends, by more than the tolerance.
    fn may_come_closer(&self, _from: f64, _length: f64, _reach: &[f64]) -> bool {
        false
    }

    /// Returns the largest distance (m) of the gaps of fixed nodes from straight lines in time during a step of `length` from `from` (fractions
    /// of the span): the parts that are proportional to the length and to its square. Returns `None` if anything but a rotor moves, or if this is
    /// unknown.
    fn largest_bends(&self, _from: f64, _length: f64) -> Option<[f64; 2]> {
        None
    }

    /// Returns the gap (m) below which the smallest gap of a node within the step is needed.
    fn needed_below(&self, _node: usize) -> f64 {
        f64::INFINITY
    }

    /// Called before the tried step is accepted, with gaps and displacements at its points.
    fn record_gaps(&mut self, _level: &StepTables, _trial: &Trial) {}

    /// Starts the search for closest points at those of point 1 of the accepted step.
    fn keep_places(&mut self) {}

    /// Records the damping loss of a step (J).
    fn record_damping(&mut self, damping_loss: f64);

    /// Records an accepted step.
    fn record_step(&mut self, step: &AcceptedStep);

    /// Energy lost by gaps that closed in the recorded steps (J).
    fn closing_loss(&self) -> f64 {
        0.0
    }

    /// Starts the search for closest points at those of the start of the step.
    fn guess_start_places(&mut self) {}

    /// Adds the reaction to a force (N) on a node at a point of the step to the surface carrier.
    fn react(&mut self, _node: usize, _point: usize, _force: Vector3) {}

    /// Adds an impulse error (N·s) on a node at a point of the step to that of the surface carrier.
    fn add_impulse(&mut self, _node: usize, _point: usize, _impulse: Vector3) {}
}

/// Surface carriers of an island, in a step of a level.
pub struct CarriersInStep<'a> {
    /// The carriers; empty if all surfaces are rigid.
    pub carriers: &'a mut [CarrierIntegrator],
    /// Tried step.
    pub step: LaneStep,
}

/// A tried step, and the lanes of its contact problem.
#[derive(Debug, Clone, Copy)]
pub struct LaneStep {
    /// Level of the step.
    pub level: usize,
    /// Interpolation of the contact force.
    pub kind: ForceInterpolation,
    /// Lanes of the current contact problem.
    pub lanes: Lanes,
    /// Block of lanes of the sector on surface carriers.
    pub block: usize,
}

/// Surfaces that the sectors of an island may touch.
pub trait Surroundings {
    /// Surfaces of one sector.
    type Surfaces<'a>: Witness
    where
        Self: 'a;

    /// Returns the surfaces of a sector of the island in a step.
    fn surfaces<'a>(&'a mut self, sector: usize, carriers: CarriersInStep<'a>) -> Self::Surfaces<'a>;

    /// Deforms the surfaces as at a point of the step.
    fn bend(&mut self, _carriers: &[CarrierIntegrator], _point: usize) {}

    /// Selects the sectors of an island that are evaluated in a step; the others certainly stay open.
    fn choose_active(&mut self, _island: &mut Island, _step: SpanStep) {}

    /// Finds gaps (m) to smooth rings, normals and closest points at a point of the step: of the far active sectors if `is_far` is true,
    /// otherwise of the near ones. The surfaces must be deformed as at this point. Called only if the island has surface carriers.
    fn find_ring_gaps(&mut self, _island: &mut Island, _point: usize, _is_far: bool) {}

    /// Prepares the active sectors from position `first` of the list on, which join the contact problem of a step: resets their trials, and
    /// finds their gaps to smooth rings (m) and closest points at the start of the step. The surfaces must be deformed as at this time.
    /// Needed only if [`Surroundings::choose_active`] deactivates sectors.
    fn prepare_activated_sectors(&mut self, _island: &mut Island, _first: usize) {}

    /// Finds bounds on the motion of the surfaces (m) since `CarrierIntegrator::set_motion_origin`, at the given points of the step.
    fn find_surface_motions(&mut self, _carriers: &[CarrierIntegrator], _points: RangeInclusive<usize>) {}

    /// Largest bound of [`Surroundings::find_surface_motions`] where a sector may touch a surface (m); 0 if all surfaces are rigid.
    fn surface_motion(&self, _sector: usize) -> f64 {
        0.0
    }

    /// Returns the modes of the structure of a disk.
    fn disk(&mut self, _structure: usize) -> Option<&mut Disk> {
        None
    }
}
