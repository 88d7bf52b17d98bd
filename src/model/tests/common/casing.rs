//! Casings for the tests, and static responses of their ROMs.

use nalgebra::DVector;
use tiprub_core::Rom;
use tiprub_model::CasingOptions;
use tiprub_model::casing::{RingCounts, RingSupport};

/// Returns casing37 with fewer elements and modes.
pub fn coarse(support: RingSupport) -> CasingOptions {
    CasingOptions {
        counts: RingCounts { around: 24, through: 1, along: 8, flange: 1 },
        patches: [12, 2],
        fixed_interface_modes: 48,
        modes: 36,
        checked_modes: 16,
        support,
        ..CasingOptions::default()
    }
}

/// Returns the static displacement of the contact nodes under modal forces; rigid-body modes are not loaded.
pub fn at_rest(rom: &Rom, forces: &DVector<f64>) -> DVector<f64> {
    let stiffness = rom.stiffness.diagonal();
    let answer = forces.iter().zip(stiffness.iter()).map(|(f, k)| if *k > 0.0 { f / k } else { 0.0 });
    &rom.contact_map * DVector::from_iterator(forces.len(), answer)
}

pub fn heated(rom: &Rom, temperatures: &[f64]) -> DVector<f64> {
    let thermal = rom.extras.thermal.as_ref().unwrap();
    at_rest(rom, &(&thermal.loads * DVector::from_column_slice(temperatures)))
}
