//! A scene with every option on, small blades in a small flexible casing, and what each option is.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{DMatrix, DVector};
use tiprub_core::rom::{ContactGrid, ContactNode, Frame, Patch, RomChecks, RomExtras, Spin, Thermal};
use tiprub_core::settings::*;
use tiprub_core::{Rom, Scene, VariableTable};
use tiprub_model_description::{Description, Experiment};

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
        extras: RomExtras { spin: Some(spin()), ..RomExtras::default() },
    }
}

/// Spin of those masses: softening in the plane of rotation, Coriolis between radial and tangential, load outwards.
fn spin() -> Spin {
    let in_plane = |i: usize| i % 3 < 2;
    let coriolis = |i: usize, j: usize| match (i % 3, i.abs_diff(j)) {
        (0, 1) if j > i => -1e-3,
        (1, 1) if j < i => 1e-3,
        _ => 0.0,
    };
    Spin {
        stiffness_speed2: DMatrix::from_fn(9, 9, |i, j| if i == j && in_plane(i) { -1e-3 } else { 0.0 }),
        stiffness_speed4: DMatrix::zeros(9, 9),
        coriolis: DMatrix::from_fn(9, 9, coriolis),
        centrifugal_load: (0..9).map(|i| if i % 3 == 0 { 1e-6 } else { 0.0 }).collect(),
        centrifugal_load_speed4: vec![0.0; 9],
        largest_speed: 2000.0,
    }
}

/// Nodes around and along of the contact grid of the casing.
const GRID: [usize; 2] = [24, 3];

/// A ring in its five softest in-plane shapes: breathing, and two and three nodal diameters in pairs; four patches.
fn ring() -> Rom {
    let [around, along] = GRID;
    let modes = [(9e3, 0.0, 0.0), (4e2, 2.0, 0.0), (4e2, 2.0, FRAC_PI_2), (1.1e3, 3.0, 0.0), (1.1e3, 3.0, FRAC_PI_2)];
    let angle = |node: usize| TAU * (node % around) as f64 / around as f64;
    let shape = |row: usize, mode: usize| {
        let ((_, order, phase), theta) = (modes[mode], angle(row / 3));
        match row % 3 {
            0 => 0.5 * (order * theta - phase).cos(),
            1 if order > 0.0 => -0.5 * (order * theta - phase).sin() / order,
            _ => 0.0,
        }
    };
    let node = |node: usize| ContactNode {
        name: format!("c{}", node + 1),
        position: [0.25, angle(node), -0.02 + 0.04 * (node / around) as f64],
        meridional_slope: 0.0,
    };
    let quarter = |patch: u32| [FRAC_PI_2 * f64::from(patch), FRAC_PI_2 * f64::from(patch + 1)];
    let squares = modes.map(|(frequency, ..)| (TAU * frequency).powi(2));
    Rom {
        name: "ring".into(),
        origin: "in-plane shapes of a ring".into(),
        sectors: 1,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(5, 5),
        stiffness: DMatrix::from_diagonal(&DVector::from_row_slice(&squares)),
        damping_ratio: 0.01,
        contact_map: DMatrix::from_fn(3 * around * along, 5, shape),
        contact_nodes: (0..around * along).map(node).collect(),
        checks: RomChecks::default(),
        extras: RomExtras {
            spin: None,
            thermal: Some(Thermal {
                loads: DMatrix::from_fn(5, 4, |mode, patch| if mode == 0 { 200.0 } else { (mode + patch) as f64 }),
                patches: (0..4).map(|patch| Patch { angle: quarter(patch), axial: [-0.02, 0.06] }).collect(),
            }),
            grid: Some(ContactGrid { around, along, closed: true }),
            harmonics: Vec::new(),
        },
    }
}

/// Every option on.
pub fn complete() -> Scene {
    let mut scene = rigid();
    let rotor = &mut scene.settings.structures[0];
    rotor.spin = SpinSettings { stiffening: true, growth: true, coriolis: true };
    (rotor.whirl, rotor.axial_shift) = (true, true);
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring.rom.safetensors".into(),
        motion: Motion::Still,
        thermal: true,
        load: Some(LoadSettings { order: 2, amplitude: 0.0, phase: 0.0 }),
        ..StructureSettings::default()
    });
    scene.roms.push(ring());
    scene.settings.surfaces[0].structure = Some("ring".into());
    scene.settings.surfaces[0].patches = Some(PatchSettings { around: 8, along: 1 });
    let contact = &mut scene.settings.contacts[0];
    contact.heat_to_slave = Some(0.4);
    contact.coating = Some(CoatingSettings {
        thickness: 1e-3,
        modulus: 1e9,
        yield_stress: 1e7,
        hardening: 1e8,
        cells_around: 360,
        cells_along: 5,
    });
    (scene.settings.outputs.wear, scene.settings.outputs.slave_displacement) = (true, true);
    scene
}

/// A rigid casing, and every option on that this leaves.
pub fn rigid() -> Scene {
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
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6, ..TimeSettings::default() },
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
pub type Switch = (&'static str, fn(&mut Scene));

/// Every option that adds variables, in a scene with a flexible casing.
pub const OPTIONS: [Switch; 18] = [
    ("`motion = \"rotating\"`", |scene| {
        let rotor = &mut scene.settings.structures[0];
        (rotor.motion, rotor.speed, rotor.spin) = (Motion::Still, 0.0, SpinSettings::default());
        (rotor.whirl, rotor.axial_shift) = (false, false);
    }),
    ("`whirl = true`", |scene| scene.settings.structures[0].whirl = false),
    ("`axial_shift = true`", |scene| scene.settings.structures[0].axial_shift = false),
    ("`structure` of the surface", |scene| {
        scene.settings.structures.truncate(1);
        scene.roms.truncate(1);
        scene.settings.surfaces[0].structure = None;
        scene.settings.outputs.slave_displacement = false;
    }),
    ("`thermal = true`", |scene| scene.settings.structures[1].thermal = false),
    ("`load` of the casing", |scene| scene.settings.structures[1].load = None),
    ("`moving = true`", |scene| scene.settings.surfaces[0].moving = false),
    ("a shape other than `circular`", |scene| scene.settings.surfaces[0].shape = Shape::Circular {}),
    ("`friction` > 0", |scene| {
        // Without friction there is no heat to share.
        (scene.settings.contacts[0].friction, scene.settings.contacts[0].heat_to_slave) = (0.0, None);
    }),
    ("`heat_to_slave`", |scene| scene.settings.contacts[0].heat_to_slave = None),
    ("`coating`", |scene| {
        scene.settings.contacts[0].coating = None;
        scene.settings.outputs.wear = false;
    }),
    ("`watched_sectors`", |scene| scene.settings.outputs.watched_sectors.clear()),
    ("`all_sectors = true`", |scene| scene.settings.outputs.all_sectors = false),
    ("`nodal_diameters`", |scene| scene.settings.outputs.nodal_diameters = None),
    ("`energies = true`", |scene| scene.settings.outputs.energies = false),
    ("`instantaneous_forces = true`", |scene| scene.settings.outputs.instantaneous_forces = false),
    ("`wear = true`", |scene| scene.settings.outputs.wear = false),
    ("`slave_displacement = true`", |scene| scene.settings.outputs.slave_displacement = false),
];

/// Options of which any one will do: the last word on variables that no single option switches off.
pub const ALTERNATIVES: [Switch; 2] = [
    ("`patches` of the surface or `thermal = true`", |scene| {
        scene.settings.surfaces[0].patches = None;
        scene.settings.structures[1].thermal = false;
    }),
    ("`spin.growth`, `thermal` or `load`", |scene| {
        scene.settings.structures[0].spin.growth = false;
        scene.settings.structures[1].thermal = false;
        scene.settings.structures[1].load = None;
    }),
];

/// A description of the scene; what says nothing about variables is short.
pub fn description<'a>(table: &'a VariableTable, roms: &'a [Rom], fmi3_arrays: bool) -> Description<'a> {
    Description {
        model_name: "rotor_rub",
        identifier: "tiprub",
        token: "{}",
        description: "",
        generated: "",
        generation_tool: "tiprub",
        version: "1",
        author: "-",
        copyright: "-",
        license: "-",
        experiment: Experiment { start: 0.0, stop: 0.1, step: 1e-5 },
        table,
        fmi3_arrays,
        structures: ["rotor", "ring"].into_iter().zip(roms).collect(),
        features: Vec::new(),
        limits: Vec::new(),
        warnings: Vec::new(),
    }
}
