//! Free bodies with closed-form flights and impacts: masses in a row, springs between them, plates next to them.

use nalgebra::DMatrix;
use tiprub_core::scene::rom::ContactGrid;
use tiprub_core::scene::settings::{
    BodyMotion, ContactSettings, ExperimentSettings, OutputSettings, Preset, SceneSettings, StructureSettings,
    SurfaceSettings, TimeSettings,
};
use tiprub_core::{Rom, Scene, Simulation};
use tiprub_test_models::{node, structure};

use super::{models::StabilityMethod, observe::real};

/// Half the side of the body (m), and half its width.
pub(crate) const HALF: f64 = 0.02;
/// Half the extent of a plate along y (m).
pub(crate) const PLATE: f64 = 0.09;
/// Nodes that move by more than this in one step could pass a surface undetected (m): a tenth of the body.
pub(crate) const FURTHEST: f64 = 0.1 * 2.0 * HALF;

/// Masses in a row along x, the first at the left face and the last at the right one; four contact nodes on each of
/// these faces. A single mass is a rigid body without rotation: it has both faces.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LumpChain {
    /// Masses of the chain (kg).
    pub masses: Vec<f64>,
    /// Stiffness of the springs between neighbours, each direction (N/m).
    pub spring: f64,
    /// Position of the middle (m).
    pub centre: [f64; 3],
    /// Stiffness of a spring from each mass to the ground (N/m): 0 for a free body.
    pub ground: f64,
    /// Number of contact nodes of each face: four in its corners, or one in its middle.
    pub corners: usize,
}

impl LumpChain {
    /// Returns one mass at the origin.
    pub(crate) fn rigid(mass: f64) -> Self {
        Self { masses: vec![mass], spring: 0.0, centre: [0.0; 3], ground: 0.0, corners: 4 }
    }

    /// Returns several masses at the origin.
    pub(crate) fn elastic(masses: &[f64], spring: f64) -> Self {
        Self { masses: masses.to_vec(), spring, ..Self::rigid(1.0) }
    }

    /// Uses one contact node in the middle of each face: few enough that modes with inertia remain.
    pub(crate) fn with_middles(self) -> Self {
        Self { corners: 1, ..self }
    }

    /// Moves the middle.
    pub(crate) fn at(self, centre: [f64; 3]) -> Self {
        Self { centre, ..self }
    }

    /// Returns the total mass (kg).
    pub(crate) fn mass(&self) -> f64 {
        self.masses.iter().sum()
    }

    pub(crate) fn rom(&self) -> Rom {
        let (lumps, order) = (self.masses.len(), 3 * self.masses.len());
        let mut stiffness = DMatrix::from_diagonal_element(order, order, self.ground);
        for row in 0..order.saturating_sub(3) {
            let next = row + 3;
            stiffness[(row, row)] += self.spring;
            stiffness[(next, next)] += self.spring;
            stiffness[(row, next)] -= self.spring;
            stiffness[(next, row)] -= self.spring;
        }
        let faces = [("left", -1.0, 0), ("right", 1.0, lumps - 1)];
        let nodes: Vec<(String, [f64; 3], usize)> = faces
            .iter()
            .flat_map(|(name, side, lump)| {
                (0..self.corners).map(move |corner| {
                    let corner_at = |bit: usize| if corner >> bit & 1 == 0 { -HALF } else { HALF };
                    let sign = |bit: usize| if self.corners > 1 { corner_at(bit) } else { 0.0 };
                    (format!("{name}_{corner}"), [side * HALF, sign(0), sign(1)], *lump)
                })
            })
            .collect();
        let map = DMatrix::from_fn(3 * nodes.len(), order, |row, column| {
            f64::from(u8::from(3 * nodes[row / 3].2 + row % 3 == column))
        });
        let place = |place: [f64; 3]| std::array::from_fn(|i| self.centre[i] + place[i]);
        rom(
            "body",
            DMatrix::from_fn(order, order, |i, j| if i == j { self.masses[i / 3] } else { 0.0 }),
            stiffness,
            map,
            nodes.iter().map(|(name, at, _)| (name.clone(), place(*at))).collect(),
        )
    }
}

fn rom(
    name: &str,
    mass: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    contact_map: DMatrix<f64>,
    nodes: Vec<(String, [f64; 3])>,
) -> Rom {
    let nodes = nodes.into_iter().map(|(name, position)| node(name, position, 0.0)).collect();
    structure(name, mass, stiffness, contact_map, nodes)
}

/// A plate next to the body: at x = −distance on the left, +distance on the right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plate {
    /// Side: −1 left, 1 right.
    pub side: f64,
    /// Distance from x = 0 (m), at the line nearest to the body.
    pub distance: f64,
    /// Radius of a cylinder about z (m); 0 for a flat plate.
    pub radius: f64,
    /// Stiffness of each node to the ground (N/m); 0 for a rigid plate.
    pub stiffness: f64,
}

impl Plate {
    /// Returns a flat, rigid plate on the left.
    pub(crate) fn left(distance: f64) -> Self {
        Self { side: -1.0, distance, radius: 0.0, stiffness: 0.0 }
    }

    /// Returns a flat, rigid plate on the right.
    pub(crate) fn right(distance: f64) -> Self {
        Self { side: 1.0, ..Self::left(distance) }
    }

    fn rom(self) -> Rom {
        let [rows, columns] = [9, 5];
        let centred = |index: usize, count: usize| (2.0 * index as f64 - (count - 1) as f64) / (count - 1) as f64;
        let point = |row: usize, column: usize| {
            // z runs so that S_t × S_s points to the body.
            let (y, z) = (PLATE * centred(row, rows), -0.05 * self.side * centred(column, columns));
            if self.radius == 0.0 {
                return [self.side * self.distance, y, z];
            }
            let (sine, cosine) = (y / self.radius).sin_cos();
            [self.side * (self.distance + self.radius * (1.0 - cosine)), self.radius * sine, z]
        };
        let nodes = (0..rows * columns).map(|node| (format!("p{node}"), point(node / columns, node % columns)));
        let order = 3 * rows * columns;
        let stiffness = if self.stiffness > 0.0 { self.stiffness } else { 1e7 };
        let diagonal = |value: f64| DMatrix::from_diagonal_element(order, order, value);
        let mut rom = rom("plate", diagonal(0.02), diagonal(stiffness), diagonal(1.0), nodes.collect());
        rom.extras.grid = Some(ContactGrid { around: columns, along: rows, closed: false });
        rom
    }
}

/// A body thrown among plates.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Throw {
    /// The body.
    pub body: LumpChain,
    /// Velocity (m/s).
    pub velocity: [f64; 3],
    /// Plates, at most one on each side.
    pub plates: Vec<Plate>,
    /// Coefficient µ of all pairs.
    pub friction: f64,
    /// Method.
    pub method: StabilityMethod,
    /// Internal step and communication step (s).
    pub step: f64,
}

impl Throw {
    /// Returns the scene.
    pub(crate) fn scene(&self) -> Scene {
        let name = |plate: &Plate| if plate.side < 0.0 { "left" } else { "right" };
        let mut structures = vec![StructureSettings {
            name: "body".into(),
            rom: "body".into(),
            motion: BodyMotion::Free,
            velocity: self.velocity,
            ..StructureSettings::default()
        }];
        structures.extend(self.plates.iter().map(|plate| StructureSettings {
            name: format!("{}_plate", name(plate)),
            rom: "plate".into(),
            motion: BodyMotion::Still,
            ..StructureSettings::default()
        }));
        let surface = |plate: &Plate| SurfaceSettings {
            name: format!("{}_face", name(plate)),
            structure: Some(format!("{}_plate", name(plate))),
            rigid: plate.stiffness == 0.0,
            ..SurfaceSettings::default()
        };
        let contact = |plate: &Plate| ContactSettings {
            master: "body".into(),
            slave: format!("{}_face", name(plate)),
            nodes: Some(name(plate).into()),
            friction: self.friction,
            solver: self.method.solver,
            ..ContactSettings::default()
        };
        let settings = SceneSettings {
            name: "thrown".into(),
            description: String::new(),
            preset: Preset::None,
            accept_implausible: true,
            silence: Vec::new(),
            structures,
            surfaces: self.plates.iter().map(surface).collect(),
            contacts: self.plates.iter().map(contact).collect(),
            time: TimeSettings::default(),
            outputs: OutputSettings::default(),
            experiment: ExperimentSettings { start: 0.0, stop: 1.0, communication_step: self.step },
        };
        let plates = self.plates.iter().map(|plate| plate.rom());
        let scene = Scene { settings, roms: std::iter::once(self.body.rom()).chain(plates).collect() };
        self.method.stepping(scene, self.step)
    }
}

/// Returns the three components of an output.
pub(crate) fn vector(simulation: &Simulation, name: &str) -> [f64; 3] {
    ["x", "y", "z"].map(|axis| real(simulation, &format!("{name}_{axis}")))
}
