//! A scene that gives every optional key.

use tiprub_core::settings::*;

/// One of everything.
pub fn complete_scene() -> SceneSettings {
    SceneSettings {
        name: "complete".into(),
        description: "Every key.".into(),
        structures: vec![StructureSettings {
            name: "rotor".into(),
            rom: "rotor.rom.safetensors".into(),
            motion: Motion::Rotating,
            speed: 1800.0,
            damping_ratio: Some(0.01),
            ..StructureSettings::default()
        }],
        surfaces: vec![SurfaceSettings {
            name: "casing".into(),
            shape: Shape::Lobes { amplitude: 1e-4, order: 2, phase: 0.5 },
            ramp_time: 0.01,
            moving: true,
            ..SurfaceSettings::default()
        }],
        contacts: vec![ContactSettings {
            master: "rotor".into(),
            slave: "casing".into(),
            gap: 3.56e-4,
            sector_gaps: vec![3.5e-4, 3.6e-4],
            friction: 0.15,
            solver: Solver::Lcp,
            meridian: Meridian::Contour,
            ..ContactSettings::default()
        }],
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6, ..TimeSettings::default() },
        outputs: OutputSettings { nodal_diameters: Some(4), ..OutputSettings::default() },
        experiment: ExperimentSettings { start: 0.0, stop: 0.1, communication_step: 1e-4 },
    }
}
