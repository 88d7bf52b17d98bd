//! Casings of irregular tetrahedra, whose contact grid lies between nodes, against the same casings of regular
//! bricks.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use faer::Mat;
use nalgebra::{DMatrix, DVector};
use tiprub_core::scene::settings::StructureSettings;
use tiprub_core::{CoSimulation, Rom, Simulation};
use tiprub_model::casing::{CasingReductionOptions, ContactRings, GridNodes, RingSupport};
use tiprub_model::element::{Formulation, consistent_mass};
use tiprub_model::inner_surface::InnerSurface;
use tiprub_model::mesh::Mesh;
use tiprub_model::progress::silent;
use tiprub_model::thermal::{equal_patches, patch_loads};
use tiprub_model::{CasingOptions, Material, Reduction, reduce_casing, reduce_ring};
use tiprub_test_models as models;

use super::casing::full_at_rest;
use crate::common::casing::{at_rest, heated};
use crate::common::tetrahedra::TetrahedralRing;

/// Ring around the blade of the tests.
const RING: TetrahedralRing =
    TetrahedralRing { radius: models::RADIUS + models::GAP, thickness: 15e-3, axial: [-0.022, 0.046] };
const RINGS: ContactRings = ContactRings { around: 12, along: 3, axial: [-0.003, 0.033] };
const PATCHES: [usize; 2] = [8, 1];
const MODES: usize = 40;

fn grid(mesh: &Mesh, clamped: &[usize], rings: ContactRings) -> tiprub_model::Result<GridNodes> {
    let set = mesh.set("inner").unwrap();
    GridNodes::chosen(mesh, (set, clamped), [rings.around, rings.along], Some(rings.axial))
}

fn tetrahedra(counts: [usize; 3], support: RingSupport) -> Reduction {
    let mesh = RING.tetrahedra(counts);
    let clamped = if support == RingSupport::Free { Vec::new() } else { mesh.set("low").unwrap().to_vec() };
    let grid = grid(&mesh, &clamped, RINGS).unwrap();
    assert_eq!(grid.points.len(), 36);
    let options = CasingReductionOptions {
        name: "tetrahedra".into(),
        formulation: Formulation::Displacement,
        fixed_interface_modes: 60,
        modes: MODES,
        checked_modes: 12,
        damping_ratio: 0.01,
    };
    let patches = equal_patches(PATCHES[0], PATCHES[1], RING.axial);
    reduce_casing(mesh, &Material::steel(), &clamped, &grid, &patches, &options, &silent).unwrap()
}

fn bricks(counts: [usize; 3], support: RingSupport) -> Rom {
    let ring = RING.bricks(counts, RINGS, support);
    let options =
        CasingOptions { patches: PATCHES, fixed_interface_modes: 60, modes: MODES, checked_modes: 12, ..ring };
    reduce_ring(&options, &silent).unwrap().rom
}

/// Returns the radial displacements of the points of the grid under a radial unit force at each.
fn flexibility(rom: &Rom) -> DMatrix<f64> {
    let points = rom.contact_nodes.len();
    let of_force = |point: usize| at_rest(rom, &rom.contact_map.row(3 * point).transpose());
    let columns: Vec<DVector<f64>> = (0..points).map(of_force).collect();
    DMatrix::from_fn(points, points, |i, j| columns[j][3 * i])
}

fn worst(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
}

/// Returns the casing of bricks, reduced once for all tests of this file.
fn of_bricks() -> &'static Rom {
    static ROM: OnceLock<Rom> = OnceLock::new();
    ROM.get_or_init(|| bricks([72, 1, 10], RingSupport::Low))
}

/// Returns the casings of a coarse and a fine mesh of tetrahedra.
fn of_mesh(mesh: usize) -> &'static Rom {
    static ROMS: [OnceLock<Rom>; 2] = [const { OnceLock::new() }; 2];
    let counts = [[36, 1, 4], [72, 1, 8]];
    ROMS[mesh].get_or_init(|| tetrahedra(counts[mesh], RingSupport::Low).rom)
}

/// Displacements are compared relative to the largest under a unit force. At the point force itself they depend on
/// the elements around it in any mesh, and grow without bounds with refinement.
#[test]
fn tetrahedral_casing_converges_to_brick_casing() {
    let reference = of_bricks();
    let temperatures: Vec<f64> = (0..PATCHES[0]).map(|patch| (patch * patch % 5) as f64).collect();
    let growth = heated(reference, &temperatures);
    let stiffest = flexibility(reference);
    let found = [0, 1].map(|mesh| {
        let rom = of_mesh(mesh);
        let (own, full) = (&rom.checks.reduced_frequencies, &reference.checks.reduced_frequencies);
        let off = (flexibility(rom) - &stiffest) / stiffest.amax();
        let at_force = off.diagonal().amax();
        let elsewhere = (&off - DMatrix::from_diagonal(&off.diagonal())).amax();
        let warm = (heated(rom, &temperatures) - &growth).amax() / growth.amax();
        [worst(own, full), at_force, elsewhere, warm]
    });
    println!("frequencies, flexibility at the force and elsewhere, growth off by {found:?}");
    let [coarse, fine] = found;
    for (quantity, most) in [0.015, 0.15, 0.015, 0.02].into_iter().enumerate() {
        assert!(fine[quantity] < most && fine[quantity] < 0.6 * coarse[quantity], "{quantity}: {coarse:?} {fine:?}");
    }
}

/// The static response to forces on the grid and to heat is that of the whole finite-element model with the same
/// weights.
#[test]
fn static_response_between_nodes_matches_full_model() {
    let counts = [24, 1, 4];
    let (rom, mesh) = (tetrahedra(counts, RingSupport::Low).rom, RING.tetrahedra(counts));
    let clamped = mesh.set("low").unwrap();
    let points = grid(&mesh, clamped, RINGS).unwrap().points;
    let axes = |point: usize| {
        let [x, y, _] = points[point].position;
        let (cos, sin) = (x / x.hypot(y), y / x.hypot(y));
        [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]
    };
    let patches = equal_patches(PATCHES[0], PATCHES[1], RING.axial);
    let heat = patch_loads(&mesh, &Material::steel(), &patches).unwrap();
    let rows = [0, 13, 40, 107];
    let mut loads = Mat::zeros(3 * mesh.nodes.len(), rows.len() + 1);
    for (column, row) in rows.into_iter().enumerate() {
        for &(node, weight) in &points[row / 3].weights {
            (0..3).for_each(|axis| loads[(3 * node + axis, column)] += weight * axes(row / 3)[row % 3][axis]);
        }
    }
    (0..loads.nrows()).for_each(|dof| loads[(dof, rows.len())] = heat[(dof, 2)]);
    let moved = full_at_rest(&mesh, &Material::steel(), clamped, &loads);
    for column in 0..=rows.len() {
        let expected = DVector::from_fn(rom.contact_map.nrows(), |row, _| {
            let axis = axes(row / 3)[row % 3];
            let of_node = |node: usize| (0..3).map(|i| axis[i] * moved[(3 * node + i, column)]).sum::<f64>();
            points[row / 3].weights.iter().map(|&(node, weight)| weight * of_node(node)).sum()
        });
        let found = match rows.get(column) {
            Some(&row) => at_rest(&rom, &rom.contact_map.row(row).transpose()),
            None => heated(&rom, &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        };
        let off = (&found - &expected).amax() / expected.amax();
        println!("load {column}: {off:.1e}");
        assert!(off < 1e-8, "{column}: {off:e}");
    }
}

#[test]
fn interpolation_preserves_rigid_motion_force_and_moment() {
    let mesh = RING.tetrahedra([24, 1, 4]);
    let surface = InnerSurface::find(&mesh, mesh.set("inner").ok(), None).unwrap();
    let (mut inside, mut largest) = (0, [0.0_f64; 4]);
    for place in 0..500 {
        let (angle, axial) = (0.37 * f64::from(place), -0.022 + 0.068 * f64::from(place * 7 % 500) / 499.0);
        let point = surface.point(angle, axial, 1e-9).unwrap();
        let [x, y, z] = point.position;
        let sum: f64 = point.weights.iter().map(|(_, weight)| weight).sum();
        let mean: [f64; 3] =
            core::array::from_fn(|i| point.weights.iter().map(|&(node, weight)| weight * mesh.nodes[node][i]).sum());
        let turned = (angle.cos() * y - angle.sin() * x).abs().max((z - axial).abs());
        let force = [0.3, -1.1, 0.7 * angle.sin()];
        let moment = |p: [f64; 3], scale: f64| -> [f64; 3] {
            core::array::from_fn(|i| {
                scale * (p[(i + 1) % 3] * force[(i + 2) % 3] - p[(i + 2) % 3] * force[(i + 1) % 3])
            })
        };
        let mut left = moment(point.position, 1.0);
        for &(node, weight) in &point.weights {
            let part = moment(mesh.nodes[node], weight);
            (0..3).for_each(|i| left[i] -= part[i]);
        }
        let off = |values: [f64; 3]| values.iter().fold(0.0, |worst: f64, value| worst.max(value.abs()));
        largest[0] = largest[0].max((sum - 1.0).abs());
        largest[1] = largest[1].max(off(core::array::from_fn(|i| mean[i] - point.position[i])));
        largest[2] = largest[2].max(turned).max(off(left));
        largest[3] = largest[3].max((x.hypot(y) - RING.radius).abs());
        inside += usize::from(point.weights.len() > 1);
    }
    println!("{inside} of 500 points between nodes; {largest:?}");
    assert!(inside > 450);
    assert!(largest[..3].iter().all(|value| *value < 2e-13), "{largest:?}");
    // Six nodes approximate an arc of 15 degrees to fourth order.
    assert!(largest[3] < 2e-5, "{largest:?}");
    // A point at a node coincides with it.
    let node = mesh.set("inner").unwrap()[17];
    let [x, y, z] = mesh.nodes[node];
    assert_eq!(surface.point(y.atan2(x), z, 1e-9).unwrap().weights, [(node, 1.0)]);
}

/// Modes of a free casing at 0 Hz move the grid as a rigid body, with the mass of the mesh.
#[test]
fn free_tetrahedral_casing_has_correct_mass_and_rigid_modes() {
    let Reduction { rom, mesh, .. } = tetrahedra([24, 1, 4], RingSupport::Free);
    let mesh = mesh.unwrap();
    let mass: f64 = mesh
        .elements
        .iter()
        .enumerate()
        .map(|(number, element)| {
            consistent_mass(element.kind, &mesh.coordinates(element), 7850.0, number).unwrap().sum()
        })
        .sum();
    let rigid = rom.contact_map.columns(0, 6).into_owned();
    for axis in 0..3 {
        let expected = DVector::from_fn(rigid.nrows(), |row, _| {
            let [_, angle, _] = rom.contact_nodes[row / 3].position;
            [[angle.cos(), -angle.sin(), 0.0], [angle.sin(), angle.cos(), 0.0], [0.0, 0.0, 1.0]][axis][row % 3]
        });
        let amplitudes = rigid.clone().svd(true, true).solve(&expected, 1e-12).unwrap();
        let (off, found) = ((&rigid * &amplitudes - &expected).amax(), amplitudes.norm_squared());
        println!("axis {axis}: off by {off:.1e}, {found} kg of {mass} kg");
        assert!(off < 1e-9 && (found / mass - 1.0).abs() < 1e-8, "{axis}: {off:e} {found} {mass}");
    }
    let elastic = &rom.checks.reduced_frequencies[6..];
    assert!(
        rom.stiffness.diagonal().rows(0, 6).iter().all(|square| *square == 0.0) && elastic[0] > 50.0,
        "{elastic:?}"
    );
}

/// Returns the normal impulse (N s) and the friction heat (J), which is the sum of the heat of the patches.
fn rub(casing: Rom) -> [f64; 2] {
    let mut scene = models::bumps(models::blade(6));
    models::on_ring(&mut scene, casing, 0.01);
    let ring = &mut scene.settings.structures[1];
    *ring = StructureSettings { thermal: true, ..ring.clone() };
    scene.settings.surfaces[0].moving = false;
    let mut run = Simulation::new(&scene).unwrap();
    run.initialise(0.0).unwrap();
    let (mut impulse, mut heat, mut patches) = (0.0, 0.0, [0.0; PATCHES[0]]);
    for _step in 0..240 {
        models::go(&mut run, 5e-5);
        impulse += models::real(&run, "normal_impulse");
        heat += 5e-5 * models::real(&run, "friction_power");
        for (patch, total) in (0_u32..).zip(&mut patches) {
            *total += 5e-5 * models::element(&run, "casing_friction_power", patch);
        }
    }
    assert!((patches.iter().sum::<f64>() / heat - 1.0).abs() < 1e-12, "{patches:?} {heat}");
    [impulse, heat]
}

#[test]
fn rub_on_tetrahedral_casing_matches_brick_casing() {
    let expected = rub(of_bricks().clone());
    let found = [0, 1].map(|mesh| rub(of_mesh(mesh).clone()));
    println!("impulse and heat: {expected:?} in bricks, {found:?}");
    assert!(expected[0] > 0.1 && expected[1] > 1.0, "{expected:?}");
    assert!(worst(&found[1], &expected) < 0.03, "{found:?} {expected:?}");
}

/// A mesh without a single, full inner surface about the axis is rejected with the position of the problem, and so
/// are grids off it or too fine for it.
#[test]
fn rejects_incomplete_or_multiple_inner_surfaces() {
    let counts = [24, 1, 6];
    let good = RING.tetrahedra(counts);
    let refused = |mesh: &Mesh, set: &str, axial: [f64; 2], parts: &[&str]| {
        let set = mesh.set(set).unwrap();
        let error = GridNodes::chosen(mesh, (set, &[]), [12, 3], Some(axial)).unwrap_err().to_string();
        println!("{error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{parts:?} is not in {error:?}");
    };
    let without = |angles: [f64; 2], axial: [f64; 2]| {
        let mut mesh = good.clone();
        let nodes = mesh.nodes.clone();
        mesh.elements.retain(|element| {
            let [x, y, z]: [f64; 3] =
                core::array::from_fn(|i| element.nodes[..4].iter().map(|&node| nodes[node][i]).sum::<f64>() / 4.0);
            let angle = y.atan2(x).rem_euclid(TAU);
            !(angle > angles[0] && angle < angles[1] && z > axial[0] && z < axial[1])
        });
        mesh
    };
    let axial = RINGS.axial;
    let part = without([1.0, 1.6], [-1.0, 1.0]);
    refused(&part, "inner", axial, &["not a full ring", "of 360°, with no face at 6", "Mesh the full ring"]);
    let hole = without([1.0, 1.6], [0.0, 0.02]);
    refused(&hole, "inner", axial, &["a hole at 7", "z = -0.001", "nodes on its edge", "Close the hole"]);
    // A gap outside the rings of the grid has no effect.
    let set = hole.set("inner").unwrap();
    GridNodes::chosen(&hole, (set, &[]), [12, 2], Some([0.036, 0.044])).unwrap();
    let seam = RING.tetrahedra_with(counts, false);
    refused(&seam, "inner", axial, &["not a full ring", "not connected at 5.6", "merge coincident nodes"]);
    let mut twice = good.clone();
    let outside = TetrahedralRing { radius: 0.3, ..RING }.tetrahedra(counts);
    let first = twice.nodes.len();
    twice.nodes.extend(&outside.nodes);
    for element in &outside.elements {
        let mut element = element.clone();
        element.nodes.iter_mut().for_each(|node| *node += first);
        twice.elements.push(element);
    }
    twice.sets.insert("all".into(), (0..twice.nodes.len()).collect());
    refused(&twice, "all", axial, &["there are 2 separate surfaces", "at radius 0.250", "--contact-set"]);
    let mut aside = good.clone();
    aside.nodes.iter_mut().for_each(|node| node[0] += 0.01);
    refused(&aside, "inner", axial, &["its centre is at x = 0.0", "not centred on the z axis", "--axis"]);
    let mut lying = good.clone();
    lying.nodes.iter_mut().for_each(|node| *node = [node[2], node[0], node[1]]);
    refused(&lying, "inner", axial, &["not a full ring about the z axis", "--axis"]);
    refused(
        &good,
        "inner",
        [0.0, 0.05],
        &["from the grid point at 0.000° and z = 0.050000 m", "more than the tolerance", "to 0.046"],
    );
    refused(&good, "low", axial, &["none of", "points towards the z axis", "--contact-set"]);
    refused(&good, "inner", [0.2, 0.3], &["lies between z = 0.200000 m and 0.300000 m"]);
    let low = good.set("low").unwrap();
    let set = good.set("inner").unwrap();
    let held = GridNodes::chosen(&good, (set, low), [12, 3], Some([-0.022, 0.033])).unwrap_err().to_string();
    assert!(held.contains("0.000° and z = -0.022000 m lies on clamped nodes"), "{held}");
    // More points than nodes.
    let fine = GridNodes::chosen(&good, (set, low), [96, 8], Some(axial)).unwrap();
    let options = CasingReductionOptions {
        name: "fine".into(),
        formulation: Formulation::Displacement,
        fixed_interface_modes: 4,
        modes: 4,
        checked_modes: 4,
        damping_ratio: 0.01,
    };
    let error =
        reduce_casing(good.clone(), &Material::steel(), low, &fine, &[], &options, &silent).unwrap_err().to_string();
    assert!(error.contains("too coarse to move 96 x 8 points"), "{error}");
}
