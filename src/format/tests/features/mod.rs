//! A scene with features that most scenes do not use.

use tiprub_core::scene::settings::*;

use crate::common::complete_scene;

/// Returns a scene with the features that `complete_scene` leaves at their default: a coated flexible casing around a
/// spinning, mistuned rotor.
pub fn scene_with_every_feature() -> SceneSettings {
    let mut scene = complete_scene();
    let rotor = &mut scene.structures[0];
    rotor.spin = SpinSettings { stiffening: true, growth: true, coriolis: true };
    (rotor.whirl, rotor.axial_shift, rotor.frequency_factors) = (true, true, vec![0.99, 1.01]);
    (rotor.thermal, rotor.softening, rotor.damping_ratios) = (true, 3e-4, vec![0.002, 0.004]);
    rotor.excitation = Some(ExcitationSettings {
        order: 7,
        mode: Some(2),
        node: Some("tip".into()),
        direction: Some(ForceDirection::Tangential),
        amplitude: 1.5,
        phase: 0.3,
    });
    let (mode, displacement, velocity, phase) = (1, 1e-5, -0.2, 0.6);
    let nodal_diameter = Some(1);
    let pattern = InitialSettings { mode, sector: None, nodal_diameter, phase, displacement, velocity };
    rotor.initial = vec![pattern, InitialSettings { sector: Some(2), nodal_diameter: None, ..pattern }];
    scene.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring.rom.safetensors".into(),
        motion: BodyMotion::Still,
        thermal: true,
        load: Some(LoadSettings { order: 2, amplitude: 100.0, phase: -0.0 }),
        ..StructureSettings::default()
    });
    let surface = &mut scene.surfaces[0];
    surface.structure = Some("ring".into());
    surface.spline =
        Some(SplineSettings { around: 90, along: 6, closure: Closure::FreeEnds, interpolation: Interpolation::Facets });
    surface.patches = Some(PatchSettings { around: 8, along: 2 });
    scene.contacts[0].coating = Some(coating());
    scene.contacts[0].slave_heat_fraction = Some(0.4);
    (scene.outputs.wear, scene.outputs.slave_displacement) = (true, true);
    scene.outputs.stress = true;
    (scene.outputs.modal_amplitudes, scene.outputs.tip_displacements) = (Some(5), true);
    (scene.outputs.casing_forces, scene.outputs.support_reaction, scene.outputs.wear_profile) = (true, true, true);
    scene.time.input_interpolation = InputInterpolation::Hold;
    scene.time.tolerance = Some(2e-3);
    scene.time.max_internal_steps = Some(5000);
    scene
}

/// Returns a coating without default values.
fn coating() -> CoatingSettings {
    CoatingSettings {
        thickness: 5e-3,
        modulus: 1e9,
        yield_stress: 1e7,
        hardening: 1e8,
        cells_around: 1000,
        cells_along: 20,
        contact_width: Some(4e-3),
        cutting: None,
    }
}

/// Returns a scene with the keys that require a free master: two pairs against open surfaces.
pub fn scene_with_a_free_master() -> SceneSettings {
    let still = |name: &str| StructureSettings {
        name: name.into(),
        rom: format!("{name}.rom.safetensors"),
        motion: BodyMotion::Still,
        ..StructureSettings::default()
    };
    let surface = |name: &str, structure: &str, rigid| SurfaceSettings {
        name: name.into(),
        structure: Some(structure.into()),
        rigid,
        ..SurfaceSettings::default()
    };
    let contact = |slave: &str, nodes: &str| ContactSettings {
        master: "cube".into(),
        slave: slave.into(),
        nodes: Some(nodes.into()),
        friction: 0.15,
        ..ContactSettings::default()
    };
    let cube = StructureSettings { motion: BodyMotion::Free, velocity: [0.0, -100.0, 0.5], ..still("cube") };
    SceneSettings {
        structures: vec![cube, still("left"), still("right")],
        surfaces: vec![surface("left_side", "left", false), surface("right_side", "right", true)],
        contacts: vec![contact("left_side", "left_"), contact("right_side", "right_")],
        outputs: OutputSettings::default(),
        ..complete_scene()
    }
}
