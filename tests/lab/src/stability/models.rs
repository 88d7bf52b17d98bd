//! Structures and scenes whose answers can be written down, and blades and rings of analytic modes.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix, Matrix3};
use tiprub_core::{
    Rom, Scene,
    rom::{ContactGrid, ContactNode, Frame, Harmonic, Patch, RomChecks, RomExtras, Thermal},
    settings::{
        ContactSettings, ExperimentSettings, Meridian, Motion, OutputSettings, SceneSettings, Scheme, Shape, Solver,
        StructureSettings, SurfaceSettings, TimeSettings,
    },
};

/// Radius of the contact nodes (m).
pub const RADIUS: f64 = 0.25;
/// Clearance (m).
pub const GAP: f64 = 3.56e-4;
/// All schemes with their names.
pub const SCHEMES: [(Scheme, &str); 3] =
    [(Scheme::CentralDifference, "central"), (Scheme::ModalExact, "exact"), (Scheme::MasslessBoundary, "massless")];
/// All contact solvers with their names.
pub const SOLVERS: [(Solver, &str); 3] = [(Solver::Film, "film"), (Solver::Lcp, "lcp"), (Solver::Coulomb, "coulomb")];

/// A contact node on a spring on a mass on a spring, in each direction: six degrees of freedom per sector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tower {
    /// Number of sectors.
    pub sectors: usize,
    /// Mass of the base and of the contact node (kg).
    pub mass: [f64; 2],
    /// Stiffness of the base spring, radial, tangential and axial (N/m).
    pub base: [f64; 3],
    /// Stiffness of the spring of the contact node, each direction (N/m).
    pub tip: f64,
    /// Angle by which the principal axes of the base spring are turned from radial to tangential (rad): couples them.
    pub turned: f64,
    /// Contact nodes at the same place.
    pub copies: usize,
    /// Slope of the tip contour.
    pub slope: f64,
    /// Stiffness of springs between the bases of neighbouring sectors (N/m), each direction; 0 = uncoupled.
    pub neighbour: f64,
}

impl Default for Tower {
    fn default() -> Self {
        Self {
            sectors: 12,
            mass: [0.1, 1e-3],
            base: [4e7, 4e6, 2e7],
            tip: 2e8,
            turned: 0.0,
            copies: 1,
            slope: -0.2,
            neighbour: 0.0,
        }
    }
}

impl Tower {
    /// Stiffness of the base spring in radial, tangential and axial direction.
    fn base_stiffness(&self) -> Matrix3<f64> {
        let (sine, cosine) = self.turned.sin_cos();
        let turn = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
        turn * Matrix3::from_diagonal(&self.base.into()) * turn.transpose()
    }

    /// Stiffness matrix of one sector with `more` on the diagonal of its base: (base, tip) by directions.
    fn stiffness(&self, more: f64) -> DMatrix<f64> {
        let base = self.base_stiffness();
        DMatrix::from_fn(6, 6, |i, j| {
            let same = if i % 3 == j % 3 { self.tip } else { 0.0 };
            match (i < 3, j < 3) {
                (true, true) => base[(i, j)] + same + if i == j { more } else { 0.0 },
                (false, false) => same,
                _ => -same,
            }
        })
    }

    /// The ROM.
    pub fn rom(&self) -> Rom {
        let mass = DMatrix::from_fn(6, 6, |i, j| if i == j { self.mass[i / 3] } else { 0.0 });
        let contact_map =
            DMatrix::from_fn(3 * self.copies, 6, |row, column| f64::from(u8::from(3 + row % 3 == column)));
        let node = |index: usize| ContactNode {
            name: format!("node_{index}"),
            position: [RADIUS, 0.0, 0.0],
            meridional_slope: self.slope,
        };
        let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
        let harmonic = |diameter: usize| {
            let wave = 2.0 - 2.0 * (TAU * diameter as f64 / self.sectors as f64).cos();
            Harmonic {
                mass: complex(&mass),
                stiffness: complex(&self.stiffness(self.neighbour * wave)),
                contact_map: complex(&contact_map),
            }
        };
        let harmonics = if self.neighbour > 0.0 { (1..=self.sectors / 2).map(harmonic).collect() } else { Vec::new() };
        Rom {
            name: "tower".into(),
            origin: "masses and springs".into(),
            sectors: self.sectors,
            frame: Frame::Cylindrical,
            stiffness: self.stiffness(0.0),
            damping_ratio: 0.005,
            contact_nodes: (0..self.copies).map(node).collect(),
            checks: RomChecks::default(),
            extras: RomExtras { harmonics, ..RomExtras::default() },
            contact_map,
            mass,
        }
    }

    /// Largest angular frequency of one sector (rad/s), from the springs as written.
    pub fn largest_frequency(&self) -> f64 {
        let scale = |i: usize| 1.0 / self.mass[i / 3].sqrt();
        let stiffness = self.stiffness(4.0 * self.neighbour);
        DMatrix::from_fn(6, 6, |i, j| scale(i) * stiffness[(i, j)] * scale(j)).symmetric_eigenvalues().max().sqrt()
    }
}

/// Blade of analytic modes: eight of the whole blade, ten local to its three contact nodes.
pub fn blade(sectors: usize) -> Rom {
    let global = [850.0, 2300.0, 3100.0, 5200.0, 9000.0, 15_000.0, 24_000.0, 40_000.0];
    let order = global.len() + 10;
    let frequency =
        |mode: usize| global.get(mode).copied().unwrap_or(45_000.0 + 9000.0 * (mode as f64 - global.len() as f64));
    let shape = |row: usize, mode: usize| {
        let (node, component) = (row / 3, row % 3);
        match mode.checked_sub(global.len()) {
            None => {
                let size = [0.25, 1.0, 0.4][component];
                let phase = 0.7 * node as f64 + 1.3 * mode as f64 + 2.1 * component as f64;
                4.0 * size * phase.cos() + if mode == node + 5 { 6.0 * size } else { 0.0 }
            }
            Some(0) => 1.0 + 0.3 * row as f64,
            Some(local) if local - 1 == row => 14.0,
            Some(local) => 2.0 * (local as f64 + 1.9 * row as f64).sin(),
        }
    };
    let node = |index: usize, name: &str| ContactNode {
        name: name.into(),
        position: [RADIUS, 0.02 * index as f64, 0.015 * index as f64],
        meridional_slope: -0.2,
    };
    Rom {
        name: "blade".into(),
        origin: "analytic modes".into(),
        sectors,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_fn(order, order, |i, j| if i == j { (TAU * frequency(i)).powi(2) } else { 0.0 }),
        damping_ratio: 0.005,
        contact_map: DMatrix::from_fn(9, order, shape),
        contact_nodes: ["leading_edge", "mid_chord", "trailing_edge"]
            .iter()
            .enumerate()
            .map(|(i, n)| node(i, n))
            .collect(),
        checks: RomChecks::default(),
        extras: RomExtras::default(),
    }
}

/// Casing ring of analytic modes (M = I): nodal diameters 0 to 4, radial cos nθ with the tangential motion −sin(nθ)/n, constant
/// along the axis or tilting; four heated quarters.
pub fn ring() -> Rom {
    let (around, along) = (36_usize, 3_usize);
    let frequencies = [9000.0, 900.0, 400.0, 1100.0, 2100.0];
    let mut modes: Vec<(f64, f64, f64, f64)> = Vec::new();
    for (n, frequency) in frequencies.iter().enumerate() {
        for tilt in [0.0, 1.0] {
            for phase in if n == 0 { vec![0.0] } else { vec![0.0, 0.5 * PI] } {
                modes.push((frequency * (1.0 + 0.6 * tilt), n as f64, tilt, phase));
            }
        }
    }
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let order = modes.len();
    let angle = |i: usize| TAU * i as f64 / around as f64;
    let z = |ring: usize| -0.02 + 0.07 * ring as f64 / (along - 1) as f64;
    let shape = |row: usize, mode: usize| {
        let (node, component) = (row / 3, row % 3);
        let (_, n, tilt, phase) = modes[mode];
        let size = 0.5 * if tilt > 0.0 { (z(node / around) - 0.015) / 0.035 } else { 1.0 };
        match component {
            0 => size * (n * angle(node % around) - phase).cos(),
            1 if n > 0.0 => -size * (n * angle(node % around) - phase).sin() / n,
            _ => 0.0,
        }
    };
    let quarter = 0.5 * PI;
    let patch =
        |index: usize| Patch { angle: [quarter * index as f64, quarter * (index + 1) as f64], axial: [-0.02, 0.05] };
    Rom {
        name: "ring".into(),
        origin: "analytic modes".into(),
        sectors: 1,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(order, order),
        stiffness: DMatrix::from_fn(order, order, |i, j| if i == j { (TAU * modes[i].0).powi(2) } else { 0.0 }),
        damping_ratio: 0.03,
        contact_map: DMatrix::from_fn(3 * around * along, order, shape),
        contact_nodes: (0..around * along)
            .map(|node| ContactNode {
                name: format!("c{node}"),
                position: [RADIUS, angle(node % around), z(node / around)],
                meridional_slope: 0.0,
            })
            .collect(),
        checks: RomChecks::default(),
        extras: RomExtras {
            grid: Some(ContactGrid { around, along, closed: true }),
            thermal: Some(Thermal {
                loads: DMatrix::from_fn(order, 4, |mode, patch| 40.0 * (1.0 + mode as f64 + 3.0 * patch as f64).sin()),
                patches: (0..4).map(patch).collect(),
            }),
            ..RomExtras::default()
        },
    }
}

/// A rotor in a round rigid casing whose radius is an input; no friction.
pub fn round(rom: Rom) -> Scene {
    let settings = SceneSettings {
        name: "extreme".into(),
        description: String::new(),
        structures: vec![StructureSettings {
            name: "rotor".into(),
            rom: "rotor".into(),
            motion: Motion::Rotating,
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

/// The same with two bumps that grow in over a millisecond, and friction.
pub fn bumps(rom: Rom) -> Scene {
    let mut scene = round(rom);
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.0 };
    scene.settings.surfaces[0].ramp_time = 1e-3;
    scene.settings.contacts[0].friction = 0.15;
    scene
}

/// Let an elastic ring carry the surface.
pub(crate) fn on_ring(scene: &mut Scene, damping_ratio: f64) {
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring".into(),
        motion: Motion::Still,
        damping_ratio: Some(damping_ratio),
        ..StructureSettings::default()
    });
    scene.roms.push(ring());
    scene.settings.surfaces[0].structure = Some("ring".into());
}

/// Choose scheme and solver.
pub(crate) fn with_methods(mut scene: Scene, scheme: Scheme, solver: Solver) -> Scene {
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].solver = solver;
    scene
}

/// Choose the internal step, with communication steps as long.
pub fn with_step(mut scene: Scene, step: f64) -> Scene {
    scene.settings.time.step = step;
    scene.settings.experiment.communication_step = step;
    scene
}

/// Numbers that are the same everywhere.
#[derive(Debug, Clone)]
pub struct Random(pub u64);

impl Random {
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// In [low, high), evenly in the logarithm.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// One of these.
    pub fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        let count = choices.len();
        let index = (0..count).filter(|index| self.unit() < 1.0 / (index + 1) as f64).max().unwrap_or(0);
        choices[index.min(count - 1)]
    }
}
