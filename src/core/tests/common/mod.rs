//! A small synthetic bladed disk for tests that need no finite elements.

#![allow(dead_code, reason = "each test binary uses its part")]

use nalgebra::DMatrix;
use tiprub_core::Scene;
use tiprub_core::rom::{ContactNode, Frame, Rom, RomChecks};
use tiprub_core::settings::{
    ContactSettings, ExperimentSettings, Meridian, Motion, OutputSettings, SceneSettings, Scheme, Shape, Solver,
    StructureSettings, SurfaceSettings, TimeSettings,
};

/// Blade-like ROM: bending (tangential with some radial), torsion and edge modes, three contact nodes.
pub fn rom(sectors: usize) -> Rom {
    let frequencies = [850.0, 2300.0, 3100.0, 5200.0, 9000.0, 15_000.0, 24_000.0, 40_000.0];
    let order = frequencies.len();
    let stiffness = frequencies.map(|frequency: f64| (std::f64::consts::TAU * frequency).powi(2));
    let shape = |row: usize, mode: usize| {
        let (node, component) = (row / 3, row % 3);
        let phase = 0.7 * node as f64 + 1.3 * mode as f64;
        let size = [0.25, 1.0, 0.4][component];
        4.0 * size * (phase + 2.1 * component as f64).cos() + if mode == node + 5 { 6.0 * size } else { 0.0 }
    };
    Rom {
        name: "synthetic".into(),
        origin: "analytic modes for tests".into(),
        sectors,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&stiffness)),
        damping_ratio: 0.005,
        contact_map: DMatrix::from_fn(9, order, shape),
        contact_nodes: ["leading_edge", "mid_chord", "trailing_edge"]
            .into_iter()
            .enumerate()
            .map(|(index, name)| ContactNode {
                name: name.into(),
                position: [0.25, 0.02 * index as f64, 0.015 * index as f64],
                meridional_slope: -0.2,
            })
            .collect(),
        checks: RomChecks::default(),
        extras: tiprub_core::rom::RomExtras::default(),
    }
}

/// A rub of that disk against a two-lobe casing that grows in over a millisecond.
pub fn scene(sectors: usize) -> Scene {
    let settings = SceneSettings {
        name: "synthetic_rub".into(),
        description: "Test scene".into(),
        structures: vec![StructureSettings {
            name: "rotor".into(),
            rom: "rotor.safetensors".into(),
            motion: Motion::Rotating,
            speed: 1300.0,
            damping_ratio: None,
            ..StructureSettings::default()
        }],
        surfaces: vec![SurfaceSettings {
            name: "casing".into(),
            shape: Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.0 },
            ramp_time: 1e-3,
            moving: true,
            ..SurfaceSettings::default()
        }],
        contacts: vec![ContactSettings {
            master: "rotor".into(),
            slave: "casing".into(),
            gap: 3.56e-4,
            sector_gaps: vec![],
            friction: 0.15,
            solver: Solver::Lcp,
            meridian: Meridian::Contour,
            ..ContactSettings::default()
        }],
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6 },
        outputs: OutputSettings {
            watched_sectors: vec![1, 2],
            all_sectors: true,
            nodal_diameters: Some(1),
            energies: true,
            instantaneous_forces: true,
            ..OutputSettings::default()
        },
        experiment: ExperimentSettings { start: 0.0, stop: 0.01, communication_step: 5e-5 },
    };
    Scene { settings, roms: vec![rom(sectors)] }
}
