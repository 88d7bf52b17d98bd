//! A contact before its force is known, together with its structure and its pair.

use super::carrier::Spot;
use super::{ContactPair, StepFailure, Structure};
use crate::contact::{ContactParameters, ContactPrediction};
use crate::geometry::wrench::At;
use crate::geometry::{Sliding, Vector3, Vibration};

/// A contact node of one sector of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ContactMember {
    /// Structure.
    pub structure: usize,
    /// Pair that the node belongs to.
    pub pair: usize,
    /// Contact node.
    pub node: usize,
    /// Sector.
    pub sector: usize,
    /// `node · lanes + sector`.
    pub index: usize,
}

/// Structures and pairs that groups work on.
pub struct Bodies<'a> {
    /// All structures.
    pub structures: &'a mut [Structure],
    /// All pairs.
    pub pairs: &'a [ContactPair],
    /// True if contact forces act one step after they are found.
    pub delays_contact: bool,
}

/// A contact member with its structure and pair, as its law sees it.
pub(crate) struct ContactView<'a> {
    bodies: &'a Bodies<'a>,
    structure: &'a Structure,
    pair: &'a ContactPair,
    member: ContactMember,
}

impl Bodies<'_> {
    /// Returns a member with its structure and pair.
    #[inline(always)]
    pub(crate) fn pose(&self, member: ContactMember) -> ContactView<'_> {
        ContactView {
            bodies: self,
            structure: &self.structures[member.structure],
            pair: &self.pairs[member.pair],
            member,
        }
    }
}

impl ContactView<'_> {
    /// Predicted displacement of the node (m), in its own directions.
    #[inline(always)]
    fn displacement(&self) -> Vector3 {
        self.structure.vector3(self.structure.modes().displacement(), self.member.node, self.member.sector)
    }

    /// Displacement relative to the surface over the step including the prediction (m), without rigid motion.
    #[inline(always)]
    pub(crate) fn slip_of_deformation(&self) -> Vector3 {
        let modes = self.structure.modes();
        self.slip_between(modes.displacement(), modes.displacement_before())
    }

    /// Relative displacement by the modes with inertia only. If contact forces act later, a prediction lacks the forces that
    /// deform quasi-static modes, however short the step is; its slip divided by h would grow without bounds.
    fn slip_of_inertia(&self) -> Vector3 {
        let predicted = &self.structure.history.predicted;
        self.slip_between(&predicted.now, &predicted.before)
    }

    #[inline(always)]
    fn slip_between(&self, now: &[f64], before: &[f64]) -> Vector3 {
        let ContactMember { node, sector, .. } = self.member;
        let moved = self.structure.vector3(now, node, sector) - self.structure.vector3(before, node, sector);
        if self.pair.carrier().is_none() { moved } else { self.less_of_carrier(moved) }
    }

    /// Not inlined, because contacts on rigid surfaces never call it.
    #[inline(never)]
    fn less_of_carrier(&self, moved: Vector3) -> Vector3 {
        let Some(spot) = self.spot() else { return moved };
        let modes = self.bodies.structures[spot.carrier.structure].modes();
        let (now, before) = (modes.displacement(), modes.displacement_before());
        moved - spot.interpolate(|row| now[row] - before[row])
    }

    /// Location at which the contact acts on the structure that carries its surface, if any.
    #[inline(always)]
    pub(crate) fn spot(&self) -> Option<Spot<'_>> {
        self.pair.carrier()?;
        let (index, rotor_angle) = (self.member.index, self.pair.drive_now().rotor_angle);
        self.pair.spot(index, self.structure.history.geometry.now.places[index], rotor_angle)
    }

    #[inline(always)]
    fn at(&self) -> At<'_> {
        At { node: self.member.node, index: self.member.index, drive: self.pair.drive_now() }
    }

    /// Checks that small displacements can describe the contact.
    #[inline(always)]
    pub fn check(&self) -> Result<(), StepFailure> {
        let ContactMember { structure, node, sector, .. } = self.member;
        let gap = self.gap();
        if !gap.is_finite() {
            return Err(StepFailure::NonFinite);
        }
        if gap < 0.0 && !self.pair.gap().is_plausible(node, gap, self.normal()) {
            return Err(StepFailure::Implausible { structure, sector });
        }
        Ok(())
    }
}

impl ContactPrediction for ContactView<'_> {
    #[inline(always)]
    fn gap(&self) -> f64 {
        self.structure.history.gap.now[self.member.index]
    }
    #[inline(always)]
    fn was_closed(&self, depth: f64) -> bool {
        self.structure.history.gap.before[self.member.index] <= -depth
    }
    #[inline(always)]
    fn normal(&self) -> Vector3 {
        self.structure.history.geometry.now.normal_at(self.member.index)
    }
    fn parameters(&self) -> &ContactParameters {
        &self.pair.parts.parameters
    }
    fn slip(&self) -> Vector3 {
        let rigid = self.pair.gap().rigid_velocity(self.at(), self.displacement());
        rigid * self.structure.modes().step() + self.slip_of_deformation()
    }
    fn last_force(&self) -> Vector3 {
        self.structure.vector3(&self.structure.history.force.before, self.member.node, self.member.sector)
    }
    #[inline(always)]
    fn sliding(&self) -> Sliding {
        let moved = if self.bodies.delays_contact { self.slip_of_inertia() } else { self.slip_of_deformation() };
        let vibration = Vibration { node: moved / self.structure.modes().step(), ..Vibration::default() };
        self.pair.gap().sliding(self.at(), self.displacement(), vibration, self.normal())
    }
    fn sector(&self) -> usize {
        self.member.sector
    }
    fn angle(&self) -> f64 {
        self.pair.gap().angle_on_casing(self.at(), self.displacement())
    }
}
