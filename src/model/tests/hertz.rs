//! H. Hertz's contact of a rigid sphere with an elastic half-space: a quarter of a large block, reduced to the nodes of its surface
//! and met by the contact solvers of the core, at rest and in an impact.

use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::contact::gap::{Drive, FixedGap, GapLaw};
use tiprub_core::dynamics::modal::{ModalModel, NodePair};
use tiprub_core::rom::{ContactNode, Frame, RomChecks, RomExtras};
use tiprub_core::settings::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_model::assembly::assemble_with;
use tiprub_model::craig_bampton::craig_bampton;
use tiprub_model::element::{ElementKind, Formulation};
use tiprub_model::mesh::Element;
use tiprub_model::progress::silent;
use tiprub_model::sparse::principal_pair;
use tiprub_model::{Material, Mesh};
use tiprub_reference::closed::impact::Hertz;

/// Radius of the contact that is computed (m), and of the sphere.
const CONTACT: f64 = 1e-3;
const RADIUS: f64 = 0.05;
const APPROACH: f64 = CONTACT * CONTACT / RADIUS;
/// Surface nodes out to here may touch, as a multiple of the contact radius.
const REACH: f64 = 1.3;
/// Elements grow by this factor outside.
const GROWTH: f64 = 1.6;

fn material() -> Material {
    Material { name: "steel".into(), young_modulus: 210e9, poisson_ratio: 0.3, density: 7800.0, expansion: 0.0 }
}

fn hertz() -> Hertz {
    let Material { young_modulus, poisson_ratio, .. } = material();
    Hertz { radius: RADIUS, modulus: young_modulus / (1.0 - poisson_ratio * poisson_ratio) }
}

/// Equal elements of `size` up to `fine`, then growing ones up to `length` exactly.
fn graded(size: f64, fine: f64, length: f64) -> Vec<f64> {
    let mut places: Vec<f64> = (0..=(fine / size).round() as usize).map(|i| size * i as f64).collect();
    let (start, mut next, mut rest) = (places.len(), size, Vec::new());
    let mut reached = places[start - 1];
    while reached < length {
        next *= GROWTH;
        reached += next;
        rest.push(reached);
    }
    let (from, over) = (places[start - 1], rest[rest.len() - 1]);
    places.extend(rest.iter().map(|place| from + (place - from) * (length - from) / (over - from)));
    places
}

struct Block {
    rom: Rom,
    /// Distance of every contact node from the axis (m).
    distance: Vec<f64>,
    /// Surface that belongs to it (m²), in the quarter.
    area: Vec<f64>,
    elements: usize,
}

/// Quarter of a block x, y ≤ L, −L ≤ z ≤ 0 with symmetry at x = 0 and y = 0 and held outside; `per_radius` elements per radius of
/// the contact, L = `extent` radii.
fn block(per_radius: usize, extent: f64) -> Block {
    let size = CONTACT / per_radius as f64;
    let side = graded(size, REACH * CONTACT, extent * CONTACT);
    let depth = graded(size, CONTACT, extent * CONTACT);
    let (nx, nz) = (side.len(), depth.len());
    let number = |i: usize, j: usize, k: usize| i + nx * (j + nx * k);
    let mut mesh = Mesh::default();
    for k in 0..nz {
        for j in 0..nx {
            mesh.nodes.extend((0..nx).map(|i| [side[i], side[j], -depth[nz - 1 - k]]));
        }
    }
    for k in 0..nz - 1 {
        for j in 0..nx - 1 {
            for i in 0..nx - 1 {
                let corner = [(0, 0), (1, 0), (1, 1), (0, 1)];
                let nodes = (0..8).map(|c| number(i + corner[c % 4].0, j + corner[c % 4].1, k + c / 4)).collect();
                mesh.elements.push(Element { kind: ElementKind::Hex8, nodes });
            }
        }
    }
    let elements = mesh.elements.len();
    let assembled = assemble_with(&mesh, &material(), Formulation::Displacement, &silent).unwrap();
    let held = |dof: usize| {
        let (node, axis) = (dof / 3, dof % 3);
        let [i, j, k] = [node % nx, node / nx % nx, node / (nx * nx)];
        i == nx - 1 || j == nx - 1 || k == 0 || (axis == 0 && i == 0) || (axis == 1 && j == 0)
    };
    let free: Vec<usize> = (0..3 * mesh.nodes.len()).filter(|dof| !held(*dof)).collect();
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let places = || (0..nx).flat_map(|j| (0..nx).map(move |i| [i, j]));
    let touching: Vec<[usize; 2]> =
        places().filter(|[i, j]| side[*i].hypot(side[*j]) < REACH * CONTACT).collect();
    let interface: Vec<usize> =
        touching.iter().map(|[i, j]| free.partition_point(|dof| *dof < 3 * number(*i, *j, nz - 1) + 2)).collect();
    let reduced = craig_bampton(&stiffness, &mass, &interface, 4, &silent).unwrap();
    let share = |i: usize| if i == 0 { 0.5 * size } else { size };
    Block {
        distance: touching.iter().map(|[i, j]| side[*i].hypot(side[*j])).collect(),
        area: touching.iter().map(|[i, j]| share(*i) * share(*j)).collect(),
        elements,
        rom: rom("block", reduced.mass, reduced.stiffness, touching.len()),
    }
}

/// The first `nodes` coordinates are the displacements of the contact nodes along z.
fn rom(name: &str, mass: DMatrix<f64>, stiffness: DMatrix<f64>, nodes: usize) -> Rom {
    let order = mass.nrows();
    let node = |i: usize| ContactNode { name: format!("{name}_{i}"), position: [0.0; 3], meridional_slope: 0.0 };
    Rom {
        name: name.into(),
        origin: "Hertz's problem".into(),
        sectors: 1,
        frame: Frame::Cartesian,
        mass,
        stiffness,
        damping_ratio: 0.0,
        contact_map: DMatrix::from_fn(3 * nodes, order, |row, column| {
            if row % 3 == 2 && row / 3 == column { 1.0 } else { 0.0 }
        }),
        contact_nodes: (0..nodes).map(node).collect(),
        checks: RomChecks::default(),
        extras: RomExtras::default(),
    }
}

/// A paraboloid r²/2R, as in Hertz's theory, closer by `approach` than touching; the sphere is above the block.
fn law(block: &Block, approach: f64) -> GapLaw {
    GapLaw::Fixed(FixedGap {
        normals: vec![[0.0, 0.0, -1.0]; block.distance.len()],
        gaps: block.distance.iter().map(|r| r * r / (2.0 * RADIUS) - approach).collect(),
        sliding: vec![[0.0; 3]; block.distance.len()],
    })
}

struct AtRest {
    force: f64,
    /// From the second moment of the pressure, ∫pr²dA = 2Fa²/5, and the farthest node that touches (m).
    radius: [f64; 2],
    /// Largest pressure over Hertz's, and L2 error of the profile within 0.9 a of the force found, relative.
    pressure: [f64; 2],
    /// Largest penetration and negative force.
    violation: [f64; 2],
}

/// Settle under strong damping with the sphere held at `approach` (m).
fn at_rest(block: &Block, model: &ModalModel, solver: Solver, approach: f64) -> AtRest {
    let settings = SystemSettings { scheme: Scheme::ModalExact, solver, friction: 0.0, ledger: true };
    let mut system = System::new(model, 1, law(block, approach), settings);
    system.set_step(0.5 / model.frequencies[0]);
    system.start(&Drive::default());
    for _ in 0..200 {
        system.step(&Drive::default()).unwrap();
    }
    let nodes = block.distance.len();
    let forces: Vec<f64> = (0..nodes).map(|node| system.multiplier(node, 0)).collect();
    let force = 4.0 * forces.iter().sum::<f64>();
    let moment: f64 = 4.0 * forces.iter().zip(&block.distance).map(|(f, r)| f * r * r).sum::<f64>();
    let touching = (0..nodes).filter(|node| forces[*node] > 0.0);
    let farthest = touching.map(|node| block.distance[node]).fold(0.0, f64::max);
    let theory = hertz();
    let (mut error, mut size) = (0.0, 0.0);
    for node in (0..nodes).filter(|node| block.distance[*node] < 0.9 * theory.contact_radius(force)) {
        let exact = theory.pressure_at(force, block.distance[node]);
        error += block.area[node] * (forces[node] / block.area[node] - exact).powi(2);
        size += block.area[node] * exact * exact;
    }
    let least = forces.iter().fold(0.0, |least: f64, force| least.min(*force));
    let deepest = (0..nodes).map(|node| system.gap(node, 0)).fold(0.0, f64::min);
    AtRest {
        force,
        radius: [(2.5 * moment / force).sqrt(), farthest],
        pressure: [forces[0] / block.area[0] / theory.pressure(force), (error / size).sqrt()],
        violation: [-deepest / approach, -least / force],
    }
}

#[test]
fn a_sphere_pressed_on_a_block_meets_hertz() {
    let theory = hertz();
    println!("| elements per radius, extent | elements | solver | δ (µm) | F off by | a off by | farthest (elements off) | p0 | profile L2 |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut errors = Vec::new();
    for (per_radius, extent) in [(3, 100.0), (6, 100.0), (6, 25.0)] {
        let block = block(per_radius, extent);
        let model = ModalModel::from_rom(&block.rom, 0.8).unwrap();
        for (solver, share) in [(Solver::Lcp, 0.25), (Solver::Lcp, 1.0), (Solver::Coulomb, 1.0), (Solver::Film, 1.0)] {
            let approach = share * APPROACH;
            let found = at_rest(&block, &model, solver, approach);
            let radius = (RADIUS * approach).sqrt();
            let off = [found.force / theory.force(approach) - 1.0, found.radius[0] / radius - 1.0];
            let farthest = (found.radius[1] - radius) * per_radius as f64 / CONTACT;
            println!(
                "| {per_radius}, {extent} | {} | {solver:?} | {:.0} | {:+.2e} | {:+.2e} | {farthest:+.2} | {:.4} | {:.2e} | penetration {:.0e}, adhesion {:.0e}",
                block.elements,
                approach * 1e6,
                off[0],
                off[1],
                found.pressure[0],
                found.pressure[1],
                found.violation[0],
                found.violation[1]
            );
            errors.push(off);
        }
    }
}
