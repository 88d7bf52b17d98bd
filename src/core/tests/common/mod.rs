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
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6, ..TimeSettings::default() },
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

/// Casing ring of analytic modes (M = I): nodal diameters 0 to 4 in pairs, each with a constant and a tilting axial
/// shape; radial w = cos nθ with the inextensional tangential motion v = −sin(nθ)/n. Thermal patches: quarters.
pub fn casing(around: usize, along: usize) -> Rom {
    casing_of(around, along, 5)
}

/// The same with as many nodal diameters as asked.
pub fn casing_of(around: usize, along: usize, diameters: u32) -> Rom {
    use tiprub_core::rom::{ContactGrid, Patch, RomExtras, Thermal};
    let z = |ring: usize| -0.02 + 0.07 * ring as f64 / (along - 1) as f64;
    let angle = |i: usize| std::f64::consts::TAU * i as f64 / around as f64;
    let mut modes: Vec<(f64, f64, f64, f64)> = Vec::new();
    for n in 0..diameters as usize {
        for tilt in [0.0, 1.0] {
            for phase in if n == 0 { vec![0.0] } else { vec![0.0, std::f64::consts::FRAC_PI_2] } {
                let lowest = [9000.0, 900.0, 400.0, 1100.0, 2100.0];
                let frequency = lowest.get(n).copied().unwrap_or(131.25 * (n * n) as f64) * (1.0 + 0.6 * tilt);
                modes.push((frequency, n as f64, tilt, phase));
            }
        }
    }
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let order = modes.len();
    let shape = |row: usize, mode: usize| {
        let (node, component) = (row / 3, row % 3);
        let (_, n, tilt, phase) = modes[mode];
        let (theta, z) = (angle(node % around), z(node / around));
        let size = 0.5 * if tilt > 0.0 { (z - 0.015) / 0.035 } else { 1.0 };
        match component {
            0 => size * (n * theta - phase).cos(),
            1 if n > 0.0 => -size * (n * theta - phase).sin() / n,
            _ => 0.0,
        }
    };
    let stiffness: Vec<f64> = modes.iter().map(|mode| (std::f64::consts::TAU * mode.0).powi(2)).collect();
    let quarter = std::f64::consts::FRAC_PI_2;
    Rom {
        name: "ring".into(),
        origin: "analytic modes for tests".into(),
        sectors: 1,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_diagonal(&nalgebra::DVector::from_vec(stiffness)),
        damping_ratio: 0.03,
        contact_map: DMatrix::from_fn(3 * around * along, order, shape),
        contact_nodes: (0..around * along)
            .map(|node| ContactNode {
                name: format!("c{node}"),
                position: [0.25, angle(node % around), z(node / around)],
                meridional_slope: 0.0,
            })
            .collect(),
        checks: RomChecks::default(),
        extras: RomExtras {
            grid: Some(ContactGrid { around, along, closed: true }),
            thermal: Some(Thermal {
                loads: DMatrix::from_fn(order, 4, |mode, patch| 40.0 * (1.0 + mode as f64 + 3.0 * patch as f64).sin()),
                patches: (0..4)
                    .map(|patch| Patch {
                        angle: [quarter * f64::from(patch), quarter * f64::from(patch + 1)],
                        axial: [-0.02, 0.05],
                    })
                    .collect(),
            }),
            spin: None,
            harmonics: Vec::new(),
        },
    }
}

/// Spin matrices for [`rom`]: stiffening in proportion to the stiffness with some coupling, a skew matrix, radial load.
pub fn spin(order: usize) -> tiprub_core::rom::Spin {
    let symmetric =
        |size: f64| {
            DMatrix::from_fn(order, order, |i, j| {
                if i == j { 6.0 * size } else { size * ((i + 1) as f64 * (j + 1) as f64).cos() }
            })
        };
    let skew = DMatrix::from_fn(order, order, |i, j| if i == j { 0.0 } else { 0.4 * (j as f64 - i as f64).signum() });
    tiprub_core::rom::Spin {
        stiffness_speed2: symmetric(0.5),
        stiffness_speed4: symmetric(1e-8),
        coriolis: skew,
        centrifugal_load: (0..order).map(|mode| 2e-4 * (1.0 + mode as f64)).collect(),
        centrifugal_load_speed4: (0..order).map(|mode| 1e-12 * (2.0 - mode as f64)).collect(),
        largest_speed: 2000.0,
    }
}

/// [`rom`] with ten more modes, nine of which stand for the local flexibility at the contact nodes.
pub fn rich_rom(sectors: usize) -> Rom {
    let base = rom(sectors);
    let order = base.order() + 10;
    let stiffness = |mode: usize| {
        let frequency = if mode < base.order() { 0.0 } else { 45_000.0 + 9000.0 * (mode - base.order()) as f64 };
        if mode < base.order() { base.stiffness[(mode, mode)] } else { (std::f64::consts::TAU * frequency).powi(2) }
    };
    let shape = |row: usize, mode: usize| match mode.checked_sub(base.order()) {
        None => base.contact_map[(row, mode)],
        Some(0) => 1.0 + 0.3 * row as f64,
        Some(local) if local - 1 == row => 14.0,
        Some(local) => 2.0 * (local as f64 + 1.9 * row as f64).sin(),
    };
    Rom {
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_fn(order, order, |i, j| if i == j { stiffness(i) } else { 0.0 }),
        contact_map: DMatrix::from_fn(9, order, shape),
        ..base.clone()
    }
}
