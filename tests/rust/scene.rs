//! A small scene with contact: six blades with three contact nodes each, light and soft enough to be fast.

use std::path::Path;

use nalgebra::DMatrix;
use tempfile::TempDir;
use tiprub_core::scene::rom::{ContactGrid, ContactNode, DisplacementFrame, RomChecks, RomExtras, Thermal};
use tiprub_core::scene::settings::{BodyMotion, StructureSettings};
use tiprub_core::{CoSimulation, Rom, Scene};
use tiprub_cosim::ThermalPatch;

/// Radius of the blade tips (m).
pub const RADIUS: f64 = 0.25;

/// Returns three point masses of 10 g, coupled by springs: the stiffest direction of each is near 2 kHz, the softest
/// near 300 Hz; three more internal coordinates are attached to the first three.
pub fn rom() -> Rom {
    let order = 12;
    let mass = DMatrix::from_diagonal_element(order, order, 0.01);
    let mut stiffness = DMatrix::zeros(order, order);
    for coordinate in 0..order {
        // Radial stiff, tangential soft, axial in between; internal coordinates stiffest.
        let frequency = if coordinate >= 9 { 2500.0 } else { [1800.0, 310.0, 640.0][coordinate % 3] };
        let omega = std::f64::consts::TAU * frequency;
        stiffness[(coordinate, coordinate)] += 0.01 * omega * omega;
    }
    let springs =
        [(0, 3, 2e5), (3, 6, 2e5), (1, 4, 3e4), (4, 7, 3e4), (2, 5, 1e4), (5, 8, 1e4), (0, 9, 4e5), (3, 10, 4e5)];
    let springs = springs.into_iter().chain([(6, 11, 4e5), (0, 1, 1.5e4), (3, 4, 1.5e4), (6, 7, 1.5e4)]);
    for (one, other, constant) in springs {
        stiffness[(one, one)] += constant;
        stiffness[(other, other)] += constant;
        stiffness[(one, other)] -= constant;
        stiffness[(other, one)] -= constant;
    }
    let node = |name: &str, angle: f64, axial: f64| ContactNode {
        name: name.into(),
        position: [RADIUS, angle, axial],
        meridional_slope: 0.0,
        ..ContactNode::default()
    };
    Rom {
        name: "toy".into(),
        origin: "three point masses on springs".into(),
        sectors: 6,
        frame: DisplacementFrame::Cylindrical,
        mass,
        stiffness,
        damping_ratio: 0.01,
        contact_map: DMatrix::identity(9, order),
        contact_nodes: vec![
            node("leading_edge", -0.05, 0.0),
            node("mid_chord", 0.0, 0.02),
            node("trailing_edge", 0.05, 0.04),
        ],
        checks: RomChecks::default(),
        extras: tiprub_core::scene::rom::RomExtras::default(),
    }
}

/// The scene file; a two-lobe casing that intrudes by a tenth of the gap makes every blade rub twice a revolution.
pub const SCENE: &str = r#"
name = "toy_rub"
description = "Six blades on springs in a two-lobe casing."

[[structure]]
name = "rotor"
rom = "toy.rom.safetensors"
speed = 300.0

[[surface]]
name = "casing"
shape = { kind = "two-lobe", depth = 1.1 }

[[contact]]
master = "rotor"
slave = "casing"
gap = 4e-4
friction = 0.15

[time]
scheme = "modal-exact"
step = 2e-6

[outputs]
all_sectors = true

[experiment]
stop = 0.1
communication_step = 1e-4
"#;

/// Returns the scene as data.
#[track_caller]
pub fn scene() -> Scene {
    let settings = tiprub_format::parse_scene(SCENE, "toy.toml").expect("the scene of the tests is valid");
    Scene { settings, roms: vec![rom()] }
}

/// Number of patches of the ring.
pub const PATCHES: usize = 4;

/// Returns a ring around the blades with breathing and ovalising modes, a contact grid of 12 by 2 nodes and four heated
/// quarters.
pub fn ring() -> Rom {
    let quarter = std::f64::consts::FRAC_PI_2;
    let (around, along) = (12, 2);
    let angle = |node: usize| std::f64::consts::TAU * (node % around) as f64 / around as f64;
    let shape = |row: usize, mode: usize| {
        let phase = [0.0, 0.0, quarter][mode];
        match (row % 3, mode) {
            (0, 0) => 1.0,
            (0, _) => (2.0 * angle(row / 3) - phase).cos(),
            (1, 1 | 2) => -0.5 * (2.0 * angle(row / 3) - phase).sin(),
            _ => 0.0,
        }
    };
    let stiffness = [3000.0, 400.0, 400.0].map(|frequency: f64| 0.5 * (std::f64::consts::TAU * frequency).powi(2));
    let node = |node: usize| ContactNode {
        name: format!("c{}", node + 1),
        position: [RADIUS, angle(node), -0.01 + 0.06 * (node / around) as f64],
        meridional_slope: 0.0,
        ..ContactNode::default()
    };
    Rom {
        name: "ring".into(),
        origin: "breathing and two nodal diameters".into(),
        sectors: 1,
        frame: DisplacementFrame::Cylindrical,
        mass: DMatrix::from_diagonal_element(3, 3, 0.5),
        stiffness: DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&stiffness)),
        damping_ratio: 0.02,
        contact_map: DMatrix::from_fn(3 * around * along, 3, shape),
        contact_nodes: (0..around * along).map(node).collect(),
        checks: RomChecks::default(),
        extras: RomExtras {
            thermal: Some(Thermal {
                loads: DMatrix::from_fn(3, PATCHES, |mode, patch| [130.0, 40.0, -30.0][mode] * (1.0 + patch as f64)),
                patches: (0..PATCHES)
                    .map(|patch| ThermalPatch {
                        angle: [quarter * patch as f64, quarter * (patch + 1) as f64],
                        axial: [-0.01, 0.05],
                    })
                    .collect(),
            }),
            grid: Some(ContactGrid { around, along, closed: true }),
            ..RomExtras::default()
        },
    }
}

/// Returns the scene with the casing on a ring whose temperatures are inputs.
#[track_caller]
pub fn warm_scene() -> Scene {
    let mut scene = scene();
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring.rom.safetensors".into(),
        motion: BodyMotion::Still,
        thermal: true,
        ..StructureSettings::default()
    });
    scene.settings.surfaces[0].structure = Some("ring".into());
    scene.settings.surfaces[0].ramp_time = 1e-3;
    scene.roms.push(ring());
    scene
}

/// Returns the first value reference of a variable of the scene.
#[track_caller]
pub fn reference(name: &str) -> u32 {
    let simulation = tiprub_core::Simulation::new(scene()).expect("the scene of the tests is valid");
    simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference
}

/// Unpacked resources of an FMU.
#[derive(Debug)]
pub struct UnpackedResources {
    directory: TempDir,
    /// Token that belongs to the resources.
    pub token: String,
}

impl UnpackedResources {
    /// Writes the scene of the tests.
    #[track_caller]
    pub fn new(arrays: bool) -> Self {
        Self::of(&scene(), arrays)
    }

    /// Writes a scene.
    #[track_caller]
    pub fn of(scene: &Scene, arrays: bool) -> Self {
        Self::of_files(&tiprub_format::resource_files(scene, arrays))
    }

    /// Writes a model of heat conduction.
    #[track_caller]
    pub fn of_thermal(model: &tiprub_thermal::ConductionModel, arrays: bool) -> Self {
        Self::of_files(&tiprub_format::thermal_resource_files(model, arrays))
    }

    fn of_files(files: &[(String, Vec<u8>)]) -> Self {
        let directory = tempfile::tempdir().expect("a temporary directory");
        for (name, content) in files {
            std::fs::write(directory.path().join(name), content).expect("the temporary directory can be written");
        }
        Self { directory, token: tiprub_format::instantiation_token(files) }
    }

    /// Returns the path of the resources.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }
}
