//! Rotors in casings, and optional features for them.

use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{
    BodyMotion, CoatingSettings, ContactSettings, ExperimentSettings, Meridian, OutputSettings, Preset, SceneSettings,
    Shape, StructureSettings, SurfaceSettings, TimeSettings,
};
use tiprub_core::{Rom, Scene};

use crate::{GAP, blade, ring};

/// Returns a rotor in a round rigid casing whose radius is an input; no friction.
pub fn round(rom: Rom) -> Scene {
    let settings = SceneSettings {
        name: "written_down".into(),
        description: String::new(),
        preset: Preset::None,
        accept_implausible: false,
        silence: Vec::new(),
        structures: vec![StructureSettings {
            name: "rotor".into(),
            rom: "rotor".into(),
            motion: BodyMotion::Rotating,
            speed: 1300.0,
            ..StructureSettings::default()
        }],
        surfaces: vec![SurfaceSettings {
            name: "casing".into(),
            shape: Shape::Circular {},
            moving: true,
            ..SurfaceSettings::default()
        }],
        contacts: vec![ContactSettings {
            master: "rotor".into(),
            slave: "casing".into(),
            gap: GAP,
            meridian: Meridian::Contour,
            ..ContactSettings::default()
        }],
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6, ..TimeSettings::default() },
        outputs: OutputSettings { all_sectors: true, ..OutputSettings::default() },
        experiment: ExperimentSettings { start: 0.0, stop: 0.01, communication_step: 5e-5 },
    };
    Scene { settings, roms: vec![rom] }
}

/// Returns a rotor in a casing with two bumps that grow over a millisecond, and friction.
pub fn bumps(rom: Rom) -> Scene {
    let mut scene = round(rom);
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.0 };
    scene.settings.surfaces[0].ramp_time = 1e-3;
    scene.settings.contacts[0].friction = 0.15;
    scene
}

/// Returns a rub of [`blade`] against those bumps, with outputs of every kind.
pub fn rub(sectors: usize) -> Scene {
    let mut scene = bumps(blade(sectors));
    scene.settings.outputs = OutputSettings {
        watched_sectors: vec![1, 2],
        all_sectors: true,
        nodal_diameters: Some(1),
        energies: true,
        instantaneous_forces: true,
        ..OutputSettings::default()
    };
    scene
}

/// Makes an elastic ring carry the surface.
pub fn on_ring(scene: &mut Scene, ring: Rom, damping_ratio: f64) {
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring".into(),
        motion: BodyMotion::Still,
        damping_ratio: Some(damping_ratio),
        ..StructureSettings::default()
    });
    scene.roms.push(ring);
    scene.settings.surfaces[0].structure = Some("ring".into());
}

/// Makes the casing an elastic ring of 36 × 3 contact nodes.
pub fn flexible(scene: &mut Scene) {
    on_ring(scene, ring(36, 3), 0.01);
}

/// Adds an abradable coating to the casing.
pub fn coating(scene: &mut Scene) {
    scene.settings.contacts[0].coating = Some(coating_of(1.5e-4, [500, 7]));
}

/// Returns a soft coating of this thickness (m), with the given numbers of cells around and along.
pub fn coating_of(thickness: f64, [cells_around, cells_along]: [usize; 2]) -> CoatingSettings {
    CoatingSettings {
        thickness,
        modulus: 2e8,
        yield_stress: 1e6,
        hardening: 2e7,
        cells_around,
        cells_along,
        contact_width: Some(3e-3),
        cutting: None,
    }
}
