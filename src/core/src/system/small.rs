//! Checks that the state is within the limits of small displacements.

use super::{ContactPair, StepFailure, System};
use crate::geometry::GapLaw;
use crate::math::scan::LargestMagnitude;
use crate::math::simd::Kernel;
use crate::modes::bank::LANES;

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
        let (displacements, mut largest) = (modes.displacement(), 0.0);
        modes.instruction_set.run(LargestMagnitude { values: displacements, largest: &mut largest });
        if largest <= limit {
            return Ok(());
        }
        displacements
            .iter()
            .position(|displacement| displacement.abs() > limit)
            .map_or(Ok(()), |index| Err(StepFailure::Implausible { structure, sector: index % modes.lanes() }))
    }

    /// Returns the node of one structure with the largest error of linear kinematics. A node that moves by u_θ along
    /// its tangent is u_θ²/2r further from the axis, which a gap linear in the displacements neglects. On a spline the
    /// positions are exact, but a bending blade shortens by at least this amount, which its modes, being straight
    /// lines, neglect: the measure applies there too. `None` if no error reaches [`CURVED_SHARE`] of the clearance.
    pub(crate) fn most_curved_of(&self, structure: usize) -> Option<Curved> {
        if self.largest_curved_share(structure) < CURVED_SHARE {
            return None;
        }
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

    /// Returns the largest [`Curved::share`] of a structure.
    fn largest_curved_share(&self, structure: usize) -> f64 {
        let (modes, mut largest) = (self.structures[structure].modes(), 0.0);
        for pair in self.pairs.iter().filter(|pair| pair.structure() == structure) {
            let Some(layout) = pair.gap().layout() else { continue };
            for &node in pair.nodes() {
                modes.instruction_set.run(CurvedShare {
                    moved: &modes.displacement()[(3 * node + 1) * modes.lanes()..][..modes.sectors()],
                    clearances: &layout.clearances[..modes.sectors()],
                    per_radius: layout.per_radius[node],
                    largest: &mut largest,
                });
            }
        }
        largest
    }
}

/// Raises `largest` to the largest [`Curved::share`] of a node in all sectors.
struct CurvedShare<'a> {
    /// Tangential displacements of the node in every sector (m).
    moved: &'a [f64],
    /// Clearances of the sectors (m).
    clearances: &'a [f64],
    /// 1/radius of the node (1/m).
    per_radius: f64,
    largest: &'a mut f64,
}

impl Kernel for CurvedShare<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { per_radius, largest, .. } = self;
        let smallest = LEAST_CLEARANCE / per_radius;
        let larger = |most: f64, moved: f64, clearance: f64| {
            let clearance = if clearance > smallest { clearance } else { smallest };
            let share = 0.5 * moved * moved * per_radius / clearance;
            if share > most { share } else { most }
        };
        let (moved, more_moved) = self.moved.as_chunks::<LANES>();
        let (clearances, more_clearances) = self.clearances.as_chunks::<LANES>();
        let mut most = [*largest; LANES];
        for (moved, clearances) in moved.iter().zip(clearances) {
            for lane in 0..LANES {
                most[lane] = larger(most[lane], moved[lane], clearances[lane]);
            }
        }
        let rest = more_moved.iter().zip(more_clearances).map(|(moved, clearance)| larger(0.0, *moved, *clearance));
        *largest = most.into_iter().chain(rest).fold(*largest, f64::max);
    }
}
