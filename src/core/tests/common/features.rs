//! Features that scenes of uncoupled and of coupled sectors are tested with.

#![allow(dead_code, reason = "each test binary uses its part")]

use tiprub_core::Scene;
use tiprub_core::settings::{CoatingSettings, Motion, StructureSettings};

/// The casing an elastic ring.
pub fn flexible(scene: &mut Scene) {
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring.safetensors".into(),
        motion: Motion::Still,
        damping_ratio: Some(0.01),
        ..StructureSettings::default()
    });
    scene.roms.push(super::common::casing(36, 3));
    scene.settings.surfaces[0].structure = Some("ring".into());
}

/// An abradable coating on it.
pub fn coating(scene: &mut Scene) {
    scene.settings.contacts[0].coating = Some(CoatingSettings {
        thickness: 1.5e-4,
        modulus: 2e8,
        yield_stress: 1e6,
        hardening: 2e7,
        cells_around: 500,
        cells_along: 7,
    });
}
