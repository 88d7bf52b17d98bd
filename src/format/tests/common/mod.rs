//! A scene that sets every optional key.

use tiprub_core::scene::settings::*;

/// Returns a scene with one item of every kind.
pub fn complete_scene() -> SceneSettings {
    let mut settings = tiprub_test_models::round(tiprub_test_models::blade(2)).settings;
    (settings.name, settings.description) = ("complete".into(), "Every key.".into());
    let rotor = &mut settings.structures[0];
    (rotor.rom, rotor.speed, rotor.damping_ratio) = ("rotor.rom.safetensors".into(), 1800.0, Some(0.01));
    settings.surfaces[0].shape = Shape::Lobes { amplitude: 1e-4, order: 2, phase: 0.5 };
    settings.surfaces[0].ramp_time = 0.01;
    (settings.contacts[0].sector_gaps, settings.contacts[0].friction) = (vec![3.5e-4, 3.6e-4], 0.15);
    settings.outputs = OutputSettings { nodal_diameters: Some(4), ..OutputSettings::default() };
    settings.experiment = ExperimentSettings { start: 0.0, stop: 0.1, communication_step: 1e-4 };
    settings
}
