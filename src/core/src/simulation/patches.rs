//! Patches of the slave surface that collect friction power.

use tiprub_cosim::ThermalPatch;

use super::plan::{PairPlan, SteppingOrder};
use crate::Scene;
use crate::scene::settings::PatchSettings;

/// Patches for which heat is counted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum HeatPatches {
    /// Equal parts of the circumference and of an axial extent (m).
    Equal {
        /// Number of parts.
        parts: PatchSettings,
        /// Start and end (m).
        extent: [f64; 2],
    },
    /// Patches of the surface carrier.
    Listed(Vec<ThermalPatch>),
}

impl HeatPatches {
    /// Makes the heat patches of a pair: patches of its surface, or those of a thermal surface carrier.
    pub fn new(scene: &Scene, plan: &SteppingOrder, pair: &PairPlan) -> Option<Self> {
        if let Some(parts) = scene.settings.surfaces[pair.surface].patches {
            let nodes = &plan.structure(scene, pair.body).1.contact_nodes;
            let axial = || pair.nodes.iter().map(|node| nodes[*node].position[2]);
            let extent = [axial().fold(f64::INFINITY, f64::min), axial().fold(f64::NEG_INFINITY, f64::max)];
            return Some(Self::Equal { parts, extent });
        }
        let structure = plan.carriers[pair.carrier?];
        let thermal = scene.roms[structure].extras.thermal.as_ref();
        let thermal = thermal.filter(|_| scene.settings.structures[structure].thermal);
        thermal.map(|thermal| Self::Listed(thermal.patches.clone()))
    }

    /// Returns the number of patches.
    pub fn len(&self) -> usize {
        match self {
            Self::Equal { parts, .. } => parts.around * parts.along,
            Self::Listed(patches) => patches.len(),
        }
    }

    /// Returns the patch at an angle (rad, fixed frame) and an axial position (m); the nearest in z beyond their extent.
    pub fn find(&self, angle: f64, axial: f64) -> usize {
        let turn = |angle: f64| angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).floor();
        match self {
            Self::Equal { parts, extent } => {
                let around = part(turn(angle) / std::f64::consts::TAU, parts.around);
                let length = extent[1] - extent[0];
                let along = if length > 0.0 { part((axial - extent[0]) / length, parts.along) } else { 0 };
                along * parts.around + around
            }
            Self::Listed(patches) => {
                let within = |patch: &ThermalPatch| turn(angle - patch.angle[0]) <= patch.angle[1] - patch.angle[0];
                let beyond = |patch: &ThermalPatch| (patch.axial[0] - axial).max(axial - patch.axial[1]).max(0.0);
                let candidates = patches.iter().enumerate().filter(|(_, patch)| within(patch));
                candidates.min_by(|a, b| beyond(a.1).total_cmp(&beyond(b.1))).map_or(0, |(index, _)| index)
            }
        }
    }
}

/// Returns the index of the one of `parts` equal parts of [0, 1] that contains `share`.
fn part(share: f64, parts: usize) -> usize {
    let place = share * crate::math::real(parts);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0 … parts − 1")]
    let index = place.max(0.0) as usize;
    index.min(parts - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quarters in two rows, listed from −45° on, as in the data of a structure: every place is in the patch whose bounds contain it.
    #[test]
    fn positions_map_to_the_patch_that_contains_them() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let patch = |index: usize| {
            let (around, along) =
                (f64::from(u32::try_from(index % 4).unwrap()), f64::from(u32::try_from(index / 4).unwrap()));
            let from = (around - 0.5) * quarter;
            ThermalPatch { angle: [from, from + quarter], axial: [0.02 * along, 0.02 * (along + 1.0)] }
        };
        let listed = HeatPatches::Listed((0..8).map(patch).collect());
        let equal = HeatPatches::Equal { parts: PatchSettings { around: 4, along: 2 }, extent: [0.0, 0.04] };
        for turns in [-1.0, 0.0, 2.0] {
            for (index, quarters) in [0.1, 0.9, 2.2, 3.4].into_iter().enumerate() {
                let angle = (4.0 * turns + quarters) * quarter;
                for (row, axial) in [(0, -0.01), (0, 0.015), (1, 0.025), (1, 0.06)] {
                    assert_eq!(listed.find(angle, axial), 4 * row + index, "{angle} {axial}");
                    assert_eq!(equal.find(angle + 0.5 * quarter, axial), 4 * row + index, "{angle} {axial}");
                }
            }
        }
        assert_eq!((listed.len(), equal.len()), (8, 8));
    }
}
