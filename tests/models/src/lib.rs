//! Structures and scenes with analytic solutions: no finite elements, no files.
#![allow(clippy::missing_panics_doc, reason = "helpers of tests panic where a test fails")]
#![allow(missing_docs, reason = "names of what they build")]

pub mod disk;
mod drive;
pub mod lattice;
mod random;
mod relative;
mod scenes;
pub mod several;
mod single;
mod wall;

use std::cell::RefCell;
use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{DMatrix, DVector};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactGrid, ContactNode, DisplacementFrame, RomChecks, RomExtras, Spin, Thermal};
use tiprub_cosim::ThermalPatch;

pub use drive::{
    bits, element, go, move_on, real, reference, saved, set, set_element, slope, stable_blades, started, started_at,
    try_started,
};
pub use random::SeededRandom;
pub use relative::relative;
pub use scenes::{bumps, coating, coating_of, flexible, on_ring, round, rub};
pub use single::{single_sector, single_sector_with};
pub use wall::wall;

/// Radius of the contact nodes (m).
pub const RADIUS: f64 = 0.25;
/// Clearance (m).
pub const GAP: f64 = 3.56e-4;

/// Returns a contact node.
pub fn node(name: impl Into<String>, position: [f64; 3], meridional_slope: f64) -> ContactNode {
    ContactNode { name: name.into(), position, meridional_slope, ..ContactNode::default() }
}

/// Returns a structure in Cartesian coordinates, without damping.
pub fn structure(
    name: &str,
    mass: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    contact_map: DMatrix<f64>,
    contact_nodes: Vec<ContactNode>,
) -> Rom {
    Rom {
        name: name.into(),
        origin: "written down for a test".into(),
        sectors: 1,
        frame: DisplacementFrame::Cartesian,
        mass,
        stiffness,
        damping_ratio: 0.0,
        contact_map,
        contact_nodes,
        checks: RomChecks::default(),
        extras: RomExtras::default(),
    }
}

/// Returns a structure about the z axis defined by its modes (M = I): frequencies (Hz), displacements of the contact
/// nodes per unit amplitude.
pub fn modal(
    name: &str,
    frequencies: &[f64],
    shape: impl Fn(usize, usize) -> f64,
    contact_nodes: Vec<ContactNode>,
) -> Rom {
    let order = frequencies.len();
    let squares = DVector::from_iterator(order, frequencies.iter().map(|frequency| (TAU * frequency).powi(2)));
    let map = DMatrix::from_fn(3 * contact_nodes.len(), order, shape);
    let (mass, stiffness) = (DMatrix::identity(order, order), DMatrix::from_diagonal(&squares));
    Rom { frame: DisplacementFrame::Cylindrical, ..structure(name, mass, stiffness, map, contact_nodes) }
}

/// Frequencies of the complete blade (Hz).
const BLADE: [f64; 8] = [850.0, 2300.0, 3100.0, 5200.0, 9000.0, 15_000.0, 24_000.0, 40_000.0];

fn blade_shape(row: usize, mode: usize) -> f64 {
    let (node, component) = (row / 3, row % 3);
    let phase = 0.7 * node as f64 + 1.3 * mode as f64;
    let size = [0.25, 1.0, 0.4][component];
    4.0 * size * (phase + 2.1 * component as f64).cos() + if mode == node + 5 { 6.0 * size } else { 0.0 }
}

fn blade_of(sectors: usize, frequencies: &[f64], shape: impl Fn(usize, usize) -> f64) -> Rom {
    let names = ["leading_edge", "mid_chord", "trailing_edge"].into_iter().enumerate();
    let place = |index: usize| [RADIUS, 0.02 * index as f64, 0.015 * index as f64];
    let nodes = names.map(|(index, name)| node(name, place(index), -0.2)).collect();
    Rom { sectors, damping_ratio: 0.005, ..modal("blade", frequencies, shape, nodes) }
}

/// Returns a blade of analytic modes: bending (tangential with some radial), torsion and edge modes, three contact
/// nodes.
pub fn blade(sectors: usize) -> Rom {
    blade_of(sectors, &BLADE, blade_shape)
}

/// Returns [`blade`] with ten more modes, nine of which represent the local flexibility at the contact nodes.
pub fn rich_blade(sectors: usize) -> Rom {
    let local = (0..10).map(|mode| 45_000.0 + 9000.0 * f64::from(mode));
    let frequencies: Vec<f64> = BLADE.into_iter().chain(local).collect();
    blade_of(sectors, &frequencies, |row, mode| match mode.checked_sub(BLADE.len()) {
        None => blade_shape(row, mode),
        Some(0) => 1.0 + 0.3 * row as f64,
        Some(local) if local - 1 == row => 14.0,
        Some(local) => 2.0 * (local as f64 + 1.9 * row as f64).sin(),
    })
}

/// Returns a blade with many lightly damped random modes at high frequencies, which impacts excite.
pub fn ringing_blade(sectors: usize, seed: u64) -> Rom {
    let random = RefCell::new(SeededRandom(seed));
    let ringing = (0..30).map(|mode| 5e4 * 1.12_f64.powi(mode));
    let local = (0..9).map(|mode| 2e6 + 1e5 * f64::from(mode));
    let frequencies: Vec<f64> = [1.5e3, 6e3, 1.5e4].into_iter().chain(ringing).chain(local).collect();
    let rom = blade_of(sectors, &frequencies, |row, mode| match mode.checked_sub(33) {
        None if row.is_multiple_of(3) => 2.0 * random.borrow_mut().signed(),
        Some(local) if local == row => 60.0,
        _ => random.borrow_mut().signed(),
    });
    Rom { damping_ratio: 1e-4, ..rom }
}

/// Returns spin matrices for a blade: stiffening in proportion to the stiffness with some coupling, a skew matrix,
/// radial load.
pub fn spin(order: usize) -> Spin {
    let symmetric =
        |size: f64| {
            DMatrix::from_fn(order, order, |i, j| {
                if i == j { 6.0 * size } else { size * ((i + 1) as f64 * (j + 1) as f64).cos() }
            })
        };
    let skew = DMatrix::from_fn(order, order, |i, j| if i == j { 0.0 } else { 0.4 * (j as f64 - i as f64).signum() });
    Spin {
        stiffness_speed2: symmetric(0.5),
        stiffness_speed4: symmetric(1e-8),
        coriolis: skew,
        centrifugal_load: (0..order).map(|mode| 2e-4 * (1.0 + mode as f64)).collect(),
        centrifugal_load_speed4: (0..order).map(|mode| 1e-12 * (2.0 - mode as f64)).collect(),
        largest_speed: 2000.0,
    }
}

/// Returns a casing ring of analytic modes: nodal diameters 0 to 4 in pairs, each with a constant and a tilting axial
/// shape; radial w = cos nθ with the inextensional tangential motion v = −sin(nθ)/n. Thermal patches: quarters.
pub fn ring(around: usize, along: usize) -> Rom {
    ring_of(around, along, 5)
}

/// Returns the ring with the requested number of nodal diameters.
pub fn ring_of(around: usize, along: usize, diameters: usize) -> Rom {
    let z = |ring: usize| -0.02 + 0.07 * ring as f64 / (along - 1) as f64;
    let angle = |i: usize| TAU * i as f64 / around as f64;
    let lowest = [9000.0, 900.0, 400.0, 1100.0, 2100.0];
    let mut modes: Vec<(f64, f64, f64, f64)> = Vec::new();
    for n in 0..diameters {
        for tilt in [0.0, 1.0] {
            for phase in if n == 0 { vec![0.0] } else { vec![0.0, FRAC_PI_2] } {
                let frequency = lowest.get(n).copied().unwrap_or(131.25 * (n * n) as f64) * (1.0 + 0.6 * tilt);
                modes.push((frequency, n as f64, tilt, phase));
            }
        }
    }
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let frequencies: Vec<f64> = modes.iter().map(|mode| mode.0).collect();
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
    let place = |node: usize| [RADIUS, angle(node % around), z(node / around)];
    let nodes = (0..around * along).map(|index| node(format!("c{index}"), place(index), 0.0)).collect();
    let load = |mode: usize, patch: usize| 40.0 * (1.0 + mode as f64 + 3.0 * patch as f64).sin();
    let mut rom = Rom { damping_ratio: 0.03, ..modal("ring", &frequencies, shape, nodes) };
    rom.extras.grid = Some(ContactGrid { around, along, closed: true });
    rom.extras.thermal =
        Some(Thermal { loads: DMatrix::from_fn(rom.order(), 4, load), patches: quarters([-0.02, 0.05]) });
    rom
}

/// Returns four thermal patches around the circumference.
pub(crate) fn quarters(axial: [f64; 2]) -> Vec<ThermalPatch> {
    let quarter = |index: u32| [FRAC_PI_2 * f64::from(index), FRAC_PI_2 * f64::from(index + 1)];
    (0..4).map(|index| ThermalPatch { angle: quarter(index), axial }).collect()
}
