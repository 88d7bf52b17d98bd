//! Forces and work of a contact in a step.

use super::contact_view::ContactMember;
use crate::geometry::Vector3;
use crate::geometry::wrench::Wrench;

/// One active contact of the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactEvent {
    /// Structure whose node touches (0-based).
    pub structure: usize,
    /// Contact pair (0-based).
    pub pair: usize,
    /// Sector (0-based).
    pub sector: usize,
    /// Contact node (0-based).
    pub node: usize,
    /// Multiplier λ: normal force (N).
    pub normal: f64,
    /// Largest λ within the step (N); a scheme may compute it at several times.
    pub peak: f64,
    /// Magnitude of the tangential force (N): friction µλ against slip, less if the contact sticks, 0 without slip; cutting force included.
    pub tangential: f64,
    /// Force on the structure (N) in the coordinates of its displacements.
    pub force: Vector3,
    /// Data of the contact point, see [`GapLaw::contact_point`](crate::geometry::GapLaw::contact_point).
    pub point: Vector3,
    /// Force in fixed directions, its moment, and its point of application.
    pub wrench: Wrench,
    /// Part of λ that a coating carries (N).
    pub coating: f64,
    /// Friction heat of the step (J).
    pub friction_heat: f64,
    /// Sliding distance against the tangential force in the step (m).
    pub slid: f64,
}

impl ContactEvent {
    pub(crate) fn new(
        at: ContactMember,
        normal: f64,
        force: Vector3,
        coating: f64,
        point: Vector3,
        wrench: Wrench,
    ) -> Self {
        let ContactMember { structure, pair, node, sector, .. } = at;
        let square = force.dot(&force) - normal * normal;
        // Rounding errors of a frictionless contact do not count as friction.
        let tangential = if square > 1e-14 * normal * normal { square.sqrt() } else { 0.0 };
        Self {
            structure,
            pair,
            sector,
            node,
            normal,
            peak: normal,
            tangential,
            force,
            point,
            wrench,
            coating,
            friction_heat: 0.0,
            slid: 0.0,
        }
    }
}
