//! A scene with every option on, around a small blade, and what each option is.

use nalgebra::DMatrix;
use tiprub_core::rom::{ContactNode, Frame, RomChecks};
use tiprub_core::settings::*;
use tiprub_core::{Rom, Scene};

/// Blades whose three contact nodes are masses on springs: 1 g, about 1 kHz.
fn rom() -> Rom {
    let node = |name: &str, z: f64| ContactNode { name: name.into(), position: [0.25, 0.0, z], meridional_slope: 0.0 };
    Rom {
        name: "blade".into(),
        origin: "three masses on springs".into(),
        sectors: 36,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(9, 9) * 1e-3,
        stiffness: DMatrix::identity(9, 9) * 4e4,
        damping_ratio: 0.001,
        contact_map: DMatrix::identity(9, 9),
        contact_nodes: vec![node("leading_edge", 0.0), node("mid_chord", 0.02), node("trailing_edge", 0.04)],
        checks: RomChecks::default(),
        extras: tiprub_core::rom::RomExtras::default(),
    }
}

/// Every option on.
pub fn complete() -> Scene {
    let settings = SceneSettings {
        name: "rotor_rub".into(),
        description: "Tip rub of 36 blades".into(),
        structures: vec![StructureSettings {
            name: "rotor".into(),
            rom: "blade.rom.safetensors".into(),
            motion: Motion::Rotating,
            speed: 1800.0,
            damping_ratio: None,
            ..StructureSettings::default()
        }],
        surfaces: vec![SurfaceSettings {
            name: "casing".into(),
            shape: Shape::TwoLobe { depth: 1.2, width: 0.15, phase: 0.0 },
            ramp_time: 1e-4,
            moving: true,
            ..SurfaceSettings::default()
        }],
        contacts: vec![ContactSettings {
            master: "rotor".into(),
            slave: "casing".into(),
            gap: 3.56e-4,
            sector_gaps: Vec::new(),
            friction: 0.15,
            solver: Solver::Lcp,
            meridian: Meridian::Contour,
            ..ContactSettings::default()
        }],
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6 },
        outputs: OutputSettings {
            watched_sectors: vec![1],
            all_sectors: true,
            nodal_diameters: Some(18),
            energies: true,
            instantaneous_forces: true,
            ..OutputSettings::default()
        },
        experiment: ExperimentSettings { start: 0.0, stop: 0.01, communication_step: 1e-5 },
    };
    Scene { settings, roms: vec![rom()] }
}

/// An option as the user guide writes it, and a function that switches it off.
pub type Switch = (&'static str, fn(&mut SceneSettings));

/// Every option that adds variables.
pub const OPTIONS: [Switch; 9] = [
    ("`motion = \"rotating\"`", |scene| {
        scene.structures[0].motion = Motion::Still;
        scene.structures[0].speed = 0.0;
    }),
    ("`moving = true`", |scene| scene.surfaces[0].moving = false),
    ("a shape other than `circular`", |scene| scene.surfaces[0].shape = Shape::Circular {}),
    ("`friction` > 0", |scene| scene.contacts[0].friction = 0.0),
    ("`watched_sectors`", |scene| scene.outputs.watched_sectors.clear()),
    ("`all_sectors = true`", |scene| scene.outputs.all_sectors = false),
    ("`nodal_diameters`", |scene| scene.outputs.nodal_diameters = None),
    ("`energies = true`", |scene| scene.outputs.energies = false),
    ("`instantaneous_forces = true`", |scene| scene.outputs.instantaneous_forces = false),
];
