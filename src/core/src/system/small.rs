//! Checks that the state is within the limits of small displacements.

use super::{ContactPair, StepFailure, System};
use crate::geometry::GapLaw;

/// Clearances below this fraction of the radius belong to a press fit, in which errors of this size do not matter.
pub(crate) const LEAST_CLEARANCE: f64 = 1e-4;
/// A warning is reported if u_θ²/2r reaches this fraction of the clearance.
pub(crate) const CURVED_SHARE: f64 = 0.05;

/// Error of linear kinematics at a node that moves far around the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curved {
    /// Structure (0-based).
    pub structure: usize,
    /// Sector (0-based).
    pub sector: usize,
    /// Contact node (0-based).
    pub node: usize,
    /// Displacement around the axis u_θ (m).
    pub moved: f64,
    /// Outward displacement that linear kinematics neglects, u_θ²/2r (m).
    pub error: f64,
    /// Initial clearance of the sector, or 1e-4 of the radius if that is larger (m).
    pub clearance: f64,
}

impl Curved {
    /// Error as a fraction of the clearance.
    pub fn share(&self) -> f64 {
        self.error / self.clearance
    }
}

impl System {
    /// Checks that the model can describe the state.
    ///
    /// # Errors
    /// Coordinates that are not finite; displacements beyond a tenth of the radius; relative displacements of nodes on open
    /// surfaces beyond a tenth of their extent; displacements around the axis for which u_θ²/2r reaches the clearance
    /// ([`System::most_curved_of`]).
    pub(crate) fn check_state(&self) -> Result<(), StepFailure> {
        if self.structures.iter().any(|structure| !structure.modes().is_finite()) {
            return Err(StepFailure::NonFinite);
        }
        for pair in &self.pairs {
            let Some(carrier) = pair.carrier() else { continue };
            let limit = pair.gap().largest_displacement();
            let moved = self.structures[carrier.structure].modes().displacement();
            if moved.iter().any(|displacement| displacement.abs() > limit) {
                return Err(StepFailure::CarrierImplausible { structure: carrier.structure });
            }
        }
        self.pairs.iter().try_for_each(|pair| self.check_small(pair))?;
        let more = |most: Curved, one: Curved| if one.share() > most.share() { one } else { most };
        match (0..self.structures.len()).filter_map(|structure| self.most_curved_of(structure)).reduce(more) {
            Some(curved) if curved.share() >= 1.0 => Err(StepFailure::Curved(curved)),
            _ => Ok(()),
        }
    }

    fn check_small(&self, pair: &ContactPair) -> Result<(), StepFailure> {
        let structure = pair.structure();
        let modes = self.structures[structure].modes();
        if let GapLaw::Open(gap) = pair.gap() {
            let distorted = gap.is_distorted(modes.displacement());
            return if distorted { Err(StepFailure::Implausible { structure, sector: 0 }) } else { Ok(()) };
        }
        let limit = pair.gap().largest_displacement();
        let displacements = modes.displacement();
        let is_beyond = |displacement: &f64| displacement.abs() > limit;
        // The compiler vectorises this loop because it has no early exit.
        if !displacements.iter().fold(false, |any, displacement| any | is_beyond(displacement)) {
            return Ok(());
        }
        displacements
            .iter()
            .position(is_beyond)
            .map_or(Ok(()), |index| Err(StepFailure::Implausible { structure, sector: index % modes.lanes() }))
    }

    /// Returns the node of one structure with the largest error of linear kinematics. A node that moves by u_θ along
    /// its tangent is u_θ²/2r further from the axis, which a gap linear in the displacements neglects. On a spline the
    /// positions are exact, but a bending blade shortens by at least this amount, which its modes, being straight
    /// lines, neglect: the measure applies there too. `None` if nothing turns around an axis.
    pub(crate) fn most_curved_of(&self, structure: usize) -> Option<Curved> {
        let mut most: Option<Curved> = None;
        for pair in self.pairs.iter().filter(|pair| pair.structure() == structure) {
            let Some(layout) = pair.gap().layout() else { continue };
            let modes = self.structures[structure].modes();
            for &node in pair.nodes() {
                let per_radius = layout.per_radius[node];
                let row = &modes.displacement()[(3 * node + 1) * modes.lanes()..][..modes.sectors()];
                for (sector, (moved, clearance)) in row.iter().zip(&layout.clearances).enumerate() {
                    let found = Curved {
                        structure,
                        sector,
                        node,
                        moved: moved.abs(),
                        error: 0.5 * moved * moved * per_radius,
                        clearance: clearance.max(LEAST_CLEARANCE / per_radius),
                    };
                    if most.is_none_or(|most| found.share() > most.share()) {
                        most = Some(found);
                    }
                }
            }
        }
        most
    }
}
