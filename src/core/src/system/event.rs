//! What a contact did in a step.

use super::contact_view::ContactMember;
use crate::gaps::dot;
use crate::gaps::wrench::Wrench;

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
    /// Largest λ within the step (N): a scheme may find it at several instants.
    pub peak: f64,
    /// Magnitude of the friction force (N): µλ against slip, less where the contact sticks; 0 without slip. With that of
    /// what is cut.
    pub tangential: f64,
    /// Force on the structure (N) in the coordinates of its displacements.
    pub force: [f64; 3],
    /// Data of the contact point, see [`GapLaw::contact_point`](crate::gaps::GapLaw::contact_point).
    pub point: [f64; 3],
    /// The force in fixed directions, its moment, and where it acts.
    pub wrench: Wrench,
    /// Part of λ that a coating carries (N).
    pub coating: f64,
    /// Friction heat of the step (J).
    pub friction_heat: f64,
    /// Way against the tangential force in the step (m).
    pub slid: f64,
}

impl ContactEvent {
    pub(super) fn new(
        at: ContactMember,
        normal: f64,
        force: [f64; 3],
        coating: f64,
        (point, wrench): ([f64; 3], Wrench),
    ) -> Self {
        let ContactMember { structure, pair, node, sector, .. } = at;
        let square = dot(force, force) - normal * normal;
        // What rounding leaves of a frictionless contact is no friction.
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
