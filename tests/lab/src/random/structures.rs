//! Random reduced models: blades, coupled disks and casings with a handful of modes.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{DisplacementFrame, ReductionBasis, SUPPORT_ROWS, SupportRows, Thermal, WatchedPoints};
use tiprub_cosim::ThermalPatch;
use tiprub_test_models::disk::TestDisk;
use tiprub_test_models::{RADIUS, SeededRandom, modal, node, ring_of, spin};

/// Returns true with this probability.
pub(crate) fn chance(random: &mut SeededRandom, probability: f64) -> bool {
    random.unit() < probability
}

/// Returns the largest angular frequency (rad/s) of a structure; for coupled sectors a bound that is almost always
/// valid.
pub(crate) fn largest_frequency(rom: &Rom) -> f64 {
    frequencies(rom).fold(0.0, f64::max) * if rom.is_cyclic() { 1.3 } else { 1.0 }
}

/// Returns the lowest angular frequency of a vibrating mode (rad/s).
pub(crate) fn lowest_frequency(rom: &Rom) -> f64 {
    frequencies(rom).filter(|value| *value > 1.0).fold(f64::INFINITY, f64::min)
}

fn frequencies(rom: &Rom) -> impl Iterator<Item = f64> {
    let scaled = rom.mass.clone().cholesky().and_then(|factor| {
        let half = factor.l().solve_lower_triangular(&rom.stiffness)?;
        factor.l().solve_lower_triangular(&half.transpose())
    });
    let squares = scaled.map(|matrix| (0.5 * (&matrix + matrix.transpose())).symmetric_eigenvalues());
    let squares: Vec<f64> = squares.map_or_else(|| vec![f64::NAN], |values| values.iter().copied().collect());
    squares.into_iter().map(|square| square.max(0.0).sqrt())
}

/// Form of a rotor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RotorShape {
    /// Number of identical sectors.
    pub sectors: usize,
    /// Number of contact nodes of a sector.
    pub nodes: usize,
    /// True if neighbours are coupled.
    pub coupled: bool,
    /// Axial position of the first node (m).
    pub axial: f64,
}

/// Returns a rotor; the names of its contact nodes begin with `tip_`.
pub(crate) fn rotor(random: &mut SeededRandom, shape: RotorShape) -> Rom {
    let mut rom = if shape.coupled { disk(random, shape) } else { blade(random, shape) };
    let slope = random.of(&[0.0, -0.2, 0.3]);
    let curved = chance(random, 0.3);
    for (index, node) in rom.contact_nodes.iter_mut().enumerate() {
        node.name = format!("tip_{}", index + 1);
        node.meridional_slope = if curved { random.within(-0.4, 0.4) } else { slope };
        node.position = [RADIUS, 0.02 * index as f64, shape.axial + 0.008 * index as f64];
    }
    if chance(random, 0.4) {
        patches(random, &mut rom);
    }
    follow_slopes(&mut rom);
    rom.damping_ratio = random.of(&[0.0, 1e-3, 5e-3, 0.03]);
    rom
}

/// Sets the radii to the contour that the slopes of the contact nodes define; nodes at one axial position have the
/// radius of the mean slope.
fn follow_slopes(rom: &mut Rom) {
    let axial: Vec<f64> = rom.contact_nodes.iter().map(|node| node.position[2]).collect();
    let mut order: Vec<usize> = (0..axial.len()).collect();
    order.sort_by(|a, b| axial[*a].total_cmp(&axial[*b]));
    let mut before: Option<[f64; 3]> = None;
    for place in order.chunk_by(|a, b| axial[*b] - axial[*a] < 1e-6) {
        let slopes = place.iter().map(|node| rom.contact_nodes[*node].meridional_slope);
        let (mean, here) = (slopes.sum::<f64>() / place.len() as f64, axial[place[0]]);
        let radius = before.map_or(RADIUS, |[radius, slope, from]| radius + 0.5 * (slope + mean) * (here - from));
        before = Some([radius, mean, here]);
        for node in place {
            rom.contact_nodes[*node].position[0] = radius;
        }
    }
}

/// Turns contact nodes into patches, in two rows if their number permits it.
fn patches(random: &mut SeededRandom, rom: &mut Rom) {
    let count = rom.contact_nodes.len();
    for node in &mut rom.contact_nodes {
        (node.area, node.length) = (random.scale(1e-5, 1e-4), random.within(5e-3, 2e-2));
    }
    if count >= 4 && count.is_multiple_of(2) && chance(random, 0.6) {
        rom.extras.rows = Some(2);
        for (index, node) in rom.contact_nodes.iter_mut().enumerate() {
            let (row, along) = (index / (count / 2), index % (count / 2));
            node.position[1] = 0.02 * along as f64 + 0.004 * row as f64;
            node.position[2] += 0.008 * (along as f64 - index as f64);
        }
    }
}

/// Returns uncoupled blades defined by their modes, the highest of which move single contact directions.
fn blade(random: &mut SeededRandom, shape: RotorShape) -> Rom {
    let rows = 3 * shape.nodes;
    let slow = 1 + random.below(5);
    // Sometimes too few for quasi-static modes.
    let local = if chance(random, 0.85) { rows } else { random.below(rows) };
    let lowest = random.scale(150.0, 2500.0);
    let mut frequencies: Vec<f64> = (0..slow).map(|_| lowest * random.scale(1.0, 12.0)).collect();
    frequencies[0] = lowest;
    frequencies.sort_by(f64::total_cmp);
    let spread = random.scale(1.5, 6.0);
    frequencies.extend((0..local).map(|_| lowest * 12.0 * random.scale(1.0, spread)));
    frequencies[slow..].sort_by(f64::total_cmp);
    let (size, tip) = (random.scale(1.0, 8.0), random.scale(2.0, 20.0));
    let entries = DMatrix::from_fn(rows, slow + local, |row, mode| match mode.checked_sub(slow) {
        None => size * random.signed(),
        Some(place) if place == row => tip,
        Some(_) => 0.25 * tip * random.signed(),
    });
    let nodes = (0..shape.nodes).map(|index| node(format!("tip_{index}"), [RADIUS, 0.0, 0.0], 0.0)).collect();
    let mut rom = modal("blade", &frequencies, |row, mode| entries[(row, mode)], nodes);
    rom.sectors = shape.sectors;
    if chance(random, 0.4) {
        rom.extras.basis = ReductionBasis::FreeInterface;
    }
    add_extras(random, &mut rom);
    rom
}

/// Adds data that only uncoupled blades have: spin matrices, heat, stress points, watched points.
fn add_extras(random: &mut SeededRandom, rom: &mut Rom) {
    let order = rom.order();
    rom.extras.spin = Some(spin(order));
    let squares: Vec<f64> = rom.stiffness.diagonal().iter().copied().collect();
    let loads = DMatrix::from_fn(order, 1, |mode, _| squares[mode] * 3e-8 * random.signed());
    rom.extras.thermal = Some(Thermal { loads, patches: vec![ThermalPatch { angle: [0.0, TAU], axial: [-0.1, 0.1] }] });
    let mut points = |rows: usize, size: f64, name: &str| WatchedPoints {
        map: random.matrix(2 * rows, order) * size,
        points: (0..2).map(|index| node(format!("{name}_{index}"), [0.2, 0.0, 0.01 * index as f64], 0.0)).collect(),
    };
    rom.extras.stress = Some(points(6, 1e11, "root"));
    rom.extras.watched = Some(points(3, 3.0, "gauge"));
}

/// Returns sectors coupled to their neighbours.
fn disk(random: &mut SeededRandom, shape: RotorShape) -> Rom {
    let order = 3 * shape.nodes + 1 + random.below(4);
    let seed = (random.unit() * 1e9).to_bits();
    let mut rom = TestDisk::random(shape.sectors, shape.nodes, order, random.scale(0.01, 0.15), seed).cyclic();
    let load = 2e-3 * (TAU * 900.0_f64).powi(2) * 1e-7;
    let loads = DMatrix::from_fn(order, 1, |_, _| load * random.signed());
    rom.extras.thermal = Some(Thermal { loads, patches: vec![ThermalPatch { angle: [0.0, TAU], axial: [-0.1, 0.1] }] });
    rom
}

/// Returns a casing of analytic modes with four heated quarters and a support.
pub(crate) fn casing(random: &mut SeededRandom) -> Rom {
    let (around, along) = (random.of(&[12, 16, 24]), random.of(&[2, 3, 4]));
    let mut rom = ring_of(around, along, random.of(&[3, 4, 5]));
    let stiffer = random.scale(0.3, 20.0);
    let lighter = random.scale(0.3, 3.0);
    rom.stiffness *= stiffer;
    rom.contact_map *= lighter;
    rom.damping_ratio = random.of(&[0.0, 0.01, 0.05]);
    let order = rom.order();
    let mut matrix = |rows: usize, columns: usize, size: f64| random.matrix(rows, columns) * size;
    rom.extras.support = Some(SupportRows {
        stiffness: matrix(SUPPORT_ROWS, order, 1e6),
        mass: matrix(SUPPORT_ROWS, order, 0.1),
        thermal: matrix(SUPPORT_ROWS, 4, 10.0),
    });
    debug_assert_eq!(rom.frame, DisplacementFrame::Cylindrical);
    rom
}
