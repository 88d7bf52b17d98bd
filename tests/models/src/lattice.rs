//! A free block of masses and springs between two plates, without reduction: every node is a contact node.

use nalgebra::{DMatrix, Vector3};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{ContactGrid, Rom};
use tiprub_core::scene::settings::*;
use tiprub_core::{Scene, Simulation};

use crate::{node, real, structure};

/// Side of the block (m).
pub const SIDE: f64 = 0.04;
/// Number of nodes per side of the block.
pub const PER_SIDE: usize = 3;
/// Radius of curved plates (m).
pub const RADIUS: f64 = 0.18;

fn rom(name: &str, mass: DMatrix<f64>, stiffness: DMatrix<f64>, nodes: Vec<(String, [f64; 3])>) -> Rom {
    let map = DMatrix::identity(mass.nrows(), mass.nrows());
    structure(name, mass, stiffness, map, nodes.into_iter().map(|(name, place)| node(name, place, 0.0)).collect())
}

/// Adds a spring of stiffness `k` (N/m) between two nodes along their connecting line.
fn spring(matrix: &mut DMatrix<f64>, positions: &[[f64; 3]], [a, b]: [usize; 2], k: f64) {
    let along = (Vector3::from(positions[a]) - Vector3::from(positions[b])).normalize();
    for i in 0..3 {
        for j in 0..3 {
            let value = k * along[i] * along[j];
            matrix[(3 * a + i, 3 * a + j)] += value;
            matrix[(3 * b + i, 3 * b + j)] += value;
            matrix[(3 * a + i, 3 * b + j)] -= value;
            matrix[(3 * b + i, 3 * a + j)] -= value;
        }
    }
}

/// Returns the mass of a node of the block (kg), which differs between corners but is symmetric in x and −x.
pub fn node_mass(place: [usize; 3]) -> f64 {
    0.01 * (1.0 + 0.2 * place[1] as f64 + 0.1 * place[2] as f64)
}

/// Returns the lattice positions of the nodes of the block.
pub fn places() -> impl Iterator<Item = [usize; 3]> {
    (0..PER_SIDE).flat_map(|x| (0..PER_SIDE).flat_map(move |y| (0..PER_SIDE).map(move |z| [x, y, z])))
}

/// Returns the block with its middle at `centre` (m) and springs to all neighbours; nodes `left_…` at low x, `right_…`
/// at high x and `core_…`.
pub fn block(centre: [f64; 3], k: f64) -> Rom {
    let step = SIDE / (PER_SIDE - 1) as f64;
    let places: Vec<[usize; 3]> = places().collect();
    // Exactly antisymmetric about the middle.
    let at = |place: usize| 0.5 * step * (2.0 * place as f64 - (PER_SIDE - 1) as f64);
    let positions: Vec<[f64; 3]> =
        places.iter().map(|place| std::array::from_fn(|i| centre[i] + at(place[i]))).collect();
    let order = 3 * places.len();
    let mut stiffness = DMatrix::zeros(order, order);
    for a in 0..places.len() {
        for b in a + 1..places.len() {
            let apart = (0..3).map(|i| places[a][i].abs_diff(places[b][i])).max();
            if apart == Some(1) {
                spring(&mut stiffness, &positions, [a, b], k);
            }
        }
    }
    let mass = DMatrix::from_fn(order, order, |i, j| if i == j { node_mass(places[i / 3]) } else { 0.0 });
    let name = |place: &[usize; 3]| {
        let side = ["left", "core", "right"][if place[0] == 0 { 0 } else { 1 + usize::from(place[0] == PER_SIDE - 1) }];
        format!("{side}_{}{}{}", place[0], place[1], place[2])
    };
    let nodes = places.iter().map(name).zip(positions).collect();
    rom("block", mass, stiffness, nodes)
}

/// Returns the block with contact nodes on its faces only: the nodes in between keep their inertia.
pub fn faces(centre: [f64; 3]) -> Rom {
    let mut rom = block(centre, 3e6);
    let kept: Vec<usize> =
        (0..rom.contact_nodes.len()).filter(|node| !rom.contact_nodes[*node].name.starts_with("core")).collect();
    rom.contact_map = DMatrix::from_fn(3 * kept.len(), rom.order(), |row, column| {
        rom.contact_map[(3 * kept[row / 3] + row % 3, column)]
    });
    rom.contact_nodes = kept.iter().map(|node| rom.contact_nodes[*node].clone()).collect();
    rom
}

/// Side of the block on which a plate is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlockSide {
    Left,
    Right,
}

impl BlockSide {
    pub fn sign(self) -> f64 {
        if self == Self::Left { -1.0 } else { 1.0 }
    }
}

/// Returns the points of a plate over y and z, `rows` along y and `columns` along z, whose nearest line to the block is
/// x = ±`distance`; flat, or a cylinder about z. Row after row along y; z runs so that the normal points to the block.
pub fn plate_points(side: BlockSide, distance: f64, curved: bool, [rows, columns]: [usize; 2]) -> Vec<[f64; 3]> {
    let centred = |index: usize, count: usize| (2.0 * index as f64 - (count - 1) as f64) / (count - 1) as f64;
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .map(|(row, column)| {
            let (y, z) = (centred(row, rows), 0.05 * centred(column, columns) * -side.sign());
            let angle = 0.5 * y;
            if curved {
                let x = distance + RADIUS * (1.0 - angle.cos());
                [side.sign() * x, RADIUS * angle.sin(), z]
            } else {
                [side.sign() * distance, 0.09 * y, z]
            }
        })
        .collect()
}

/// Returns a plate of masses on springs to the ground and to their neighbours.
pub fn plate(side: BlockSide, distance: f64, curved: bool, k: f64) -> Rom {
    let [rows, columns] = [9, 5];
    let points = plate_points(side, distance, curved, [rows, columns]);
    let order = 3 * points.len();
    let mut stiffness = DMatrix::identity(order, order) * (0.05 * k);
    for node in 0..points.len() {
        let right = ((node + 1) % columns != 0).then_some(node + 1);
        let above = (node + columns < points.len()).then_some(node + columns);
        for other in [right, above].into_iter().flatten() {
            for i in 0..3 {
                let (a, b) = (3 * node + i, 3 * other + i);
                stiffness[(a, a)] += k;
                stiffness[(b, b)] += k;
                stiffness[(a, b)] -= k;
                stiffness[(b, a)] -= k;
            }
        }
    }
    let nodes = points.iter().enumerate().map(|(node, point)| (format!("p{node}"), *point)).collect();
    let mut rom = rom("plate", DMatrix::identity(order, order) * 0.02, stiffness, nodes);
    rom.damping_ratio = 0.01;
    rom.extras.grid = Some(ContactGrid { around: columns, along: rows, closed: false });
    rom
}

/// Returns the block between plates: `left` and `right` each at a distance (m) from x = 0.
pub fn scene(block: Rom, plates: &[(BlockSide, f64)], curved: bool, velocity: [f64; 3]) -> Scene {
    let names = |side: BlockSide| {
        if side == BlockSide::Left {
            ("left_plate", "left_face", "left")
        } else {
            ("right_plate", "right_face", "right")
        }
    };
    let mut structures = vec![StructureSettings {
        name: "block".into(),
        rom: "block".into(),
        motion: BodyMotion::Free,
        velocity,
        ..StructureSettings::default()
    }];
    let mut roms = vec![block];
    for (side, distance) in plates {
        let (name, ..) = names(*side);
        structures.push(StructureSettings {
            name: name.into(),
            rom: name.into(),
            motion: BodyMotion::Still,
            ..StructureSettings::default()
        });
        roms.push(plate(*side, *distance, curved, 2e8));
    }
    let surface = |(side, _): &(BlockSide, f64)| SurfaceSettings {
        name: names(*side).1.into(),
        structure: Some(names(*side).0.into()),
        ..SurfaceSettings::default()
    };
    let contact = |(side, _): &(BlockSide, f64)| ContactSettings {
        master: "block".into(),
        slave: names(*side).1.into(),
        nodes: Some(names(*side).2.into()),
        ..ContactSettings::default()
    };
    let settings = SceneSettings {
        name: "free_block".into(),
        description: String::new(),
        preset: Preset::None,
        accept_implausible: false,
        silence: Vec::new(),
        structures,
        surfaces: plates.iter().map(surface).collect(),
        contacts: plates.iter().map(contact).collect(),
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6, ..TimeSettings::default() },
        outputs: OutputSettings::default(),
        experiment: ExperimentSettings { start: 0.0, stop: 0.01, communication_step: 1e-5 },
    };
    Scene { settings, roms }
}

/// Sets friction, solver and scheme of all pairs.
pub fn with(mut scene: Scene, friction: f64, solver: Solver, scheme: Scheme) -> Scene {
    for contact in &mut scene.settings.contacts {
        (contact.friction, contact.solver) = (friction, solver);
    }
    scene.settings.time.scheme = scheme;
    scene
}

/// Returns the block, 0.3 mm too wide on each side, thrown between two cylinders.
pub fn squeezed() -> Scene {
    squeezed_by(3e-4, [0.0, -40.0, 0.0])
}

/// Returns the squeezed block with this interference (m) and velocity (m/s).
pub fn squeezed_by(interference: f64, velocity: [f64; 3]) -> Scene {
    let distance = 0.5 * SIDE - interference;
    scene(block([0.0, 0.045, 0.0], 3e6), &[(BlockSide::Left, distance), (BlockSide::Right, distance)], true, velocity)
}

pub fn vector(simulation: &Simulation, name: &str) -> [f64; 3] {
    ["x", "y", "z"].map(|axis| real(simulation, &format!("{name}_{axis}")))
}
