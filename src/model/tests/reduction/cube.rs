//! Bodies of the cube between two rings: reductions of free body and open panel preserve the required properties.

use crate::guide::print_row;
use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::cube::{
    CubeOptions, MassMatrix, RingOptions, RingSide, cube_material, cube_of, reduce_cube, reduce_cube_ring, ring_grid,
    ring_material, ring_of,
};
use tiprub_model::patches::face_patches;
use tiprub_model::progress::silent;
use tiprub_model::reduce::ReductionKind;
use tiprub_model::{FeModel, Mesh, Reduction};

const MASSES: [MassMatrix; 2] = [MassMatrix::Lumped, MassMatrix::Consistent];
/// A ring small enough for a full spectrum.
const COARSE: [usize; 3] = [2, 4, 6];

fn cube(elements: usize, mass: MassMatrix, modes: Option<usize>) -> Reduction {
    reduce_cube(&CubeOptions { elements, mass, modes, ..CubeOptions::default() }, &silent).unwrap()
}

fn ring(side: RingSide, elements: [usize; 3], mass: MassMatrix, modes: usize, static_responses: usize) -> Reduction {
    let options = RingOptions { elements, mass, modes, static_responses, ..RingOptions::new(side) };
    reduce_cube_ring(&options, &silent).unwrap()
}

/// Returns K and M of all dofs, dense.
fn dense(mesh: Mesh, material: &tiprub_model::Material, mass: MassMatrix) -> [DMatrix<f64>; 2] {
    let model = FeModel::assembled(mesh, material, String::new(), &silent).unwrap();
    let model = if mass == MassMatrix::Lumped { model.lumped().unwrap() } else { model };
    let all: Vec<usize> = (0..model.stiffness.order()).collect();
    [&model.stiffness, &model.mass].map(|matrix| {
        let block = matrix.block(&all, &all);
        DMatrix::from_fn(all.len(), all.len(), |i, j| block[(i, j)])
    })
}

/// Returns C (K + s M)⁻¹ Cᵀ of a modal ROM: the contact flexibility at the growth rate √s.
fn flexibility(rom: &Rom, shift: f64) -> DMatrix<f64> {
    let mut scaled = rom.contact_map.clone();
    for (mode, mut column) in scaled.column_iter_mut().enumerate() {
        column /= rom.stiffness[(mode, mode)] + shift;
    }
    scaled * rom.contact_map.transpose()
}

#[track_caller]
fn equal(a: &DMatrix<f64>, b: &DMatrix<f64>, bound: f64) {
    let off = (a - b).amax() / b.amax();
    assert!(off < bound, "{off:e}");
}

#[test]
fn rigid_motion_of_free_body_is_strain_free() {
    let rom = cube(3, MassMatrix::Lumped, Some(8)).rom;
    assert_eq!((rom.frame, rom.contact_nodes.len(), rom.order()), (DisplacementFrame::Cartesian, 32, 96 + 8));
    let zeros = (0..rom.order()).filter(|&mode| rom.stiffness[(mode, mode)] == 0.0).count();
    assert_eq!(zeros, 6);
    let rigid = rom.contact_map.columns(0, 6).into_owned();
    for axis in 0..3 {
        let unit = DMatrix::from_fn(rigid.nrows(), 1, |row, _| if row % 3 == axis { 1.0 } else { 0.0 });
        let motion = rigid.clone().svd(true, true).solve(&unit, 1e-12).unwrap();
        assert!((&rigid * &motion - &unit).amax() < 1e-12);
        // M = I: the mass of the whole cube, 7800 kg/m³ and 50 mm.
        let mass = motion.norm_squared();
        assert!((mass / 0.975 - 1.0).abs() < 1e-12, "{mass} kg");
    }
    assert_eq!(rom.contact_nodes[0].name, "left_1");
    assert!((rom.contact_nodes[0].position[0] + 0.025).abs() < 1e-15);
    assert!((rom.contact_nodes[16].position[0] - 0.025).abs() < 1e-15 && rom.contact_nodes[16].name == "right_1");
}

/// With all modes both reductions are changes of coordinates: the contact flexibility is that of the full model at
/// any rate.
#[test]
fn reduction_with_all_modes_is_exact() {
    let shift = 1e9;
    for mass in MASSES {
        let [stiffness, inertia] = dense(cube_of(3), &cube_material(), mass);
        let rom = cube(3, mass, None).rom;
        assert_eq!(rom.order(), stiffness.nrows());
        let mesh = cube_of(3);
        let nodes = [mesh.set("MASTER_LEFT").unwrap(), mesh.set("MASTER_RIGHT").unwrap()].concat();
        let rows: Vec<usize> = nodes.iter().flat_map(|node| 3 * node..3 * node + 3).collect();
        let full = (&stiffness + shift * &inertia).cholesky().unwrap().inverse();
        equal(&flexibility(&rom, shift), &full.select_rows(&rows).select_columns(&rows), 1e-9);
        // With fewer modes it is not, so that the test can fail.
        let truncated = cube(3, mass, Some(10)).rom;
        assert!(
            (flexibility(&truncated, shift) - full.select_rows(&rows).select_columns(&rows)).amax()
                > 1e-4 * full.amax()
        );
    }
    for side in RingSide::BOTH {
        let [stiffness, inertia] = dense(ring_of(side, COARSE), &ring_material(), MassMatrix::Lumped);
        let (free, rows) = ring_rows(side);
        let full = (&stiffness + 1e3 * shift * &inertia).select_rows(&free).select_columns(&free);
        let full = full.cholesky().unwrap().inverse();
        let full = DMatrix::from_fn(rows.len(), rows.len(), |i, j| match (rows[i], rows[j]) {
            (Some(i), Some(j)) => full[(i, j)],
            _ => 0.0,
        });
        let rom = ring(side, COARSE, MassMatrix::Lumped, free.len(), 0).rom;
        equal(&flexibility(&rom, 1e3 * shift), &full, 1e-9);
    }
}

/// Returns the free dofs of the coarse ring, and the rows of its grid among them.
fn ring_rows(side: RingSide) -> (Vec<usize>, Vec<Option<usize>>) {
    let mesh = ring_of(side, COARSE);
    let clamped = mesh.set("CLAMPED").unwrap();
    let free: Vec<usize> = (0..3 * mesh.nodes.len()).filter(|dof| !clamped.contains(&(dof / 3))).collect();
    let grid = ring_grid(side, COARSE);
    let dofs = grid.nodes.iter().flat_map(|node| 3 * node..3 * node + 3);
    let rows = dofs.map(|dof| free.binary_search(&dof).ok()).collect();
    (free, rows)
}

#[test]
fn static_responses_make_static_panel_compliance_exact() {
    let (side, mass) = (RingSide::Left, MassMatrix::Lumped);
    let [stiffness, _] = dense(ring_of(side, COARSE), &ring_material(), mass);
    let (free, rows) = ring_rows(side);
    let full = stiffness.select_rows(&free).select_columns(&free).cholesky().unwrap().inverse();
    let full = DMatrix::from_fn(rows.len(), rows.len(), |i, j| match (rows[i], rows[j]) {
        (Some(i), Some(j)) => full[(i, j)],
        _ => 0.0,
    });
    let all = rows.iter().flatten().count();
    assert_eq!(all, 3 * 5 * 5);
    let off = |responses: usize| {
        let found = flexibility(&ring(side, COARSE, mass, 10, responses).rom, 0.0);
        (found - &full).norm() / full.norm()
    };
    let errors = [0, 10, 40, all].map(off);
    println!("flexibility off by {errors:?}");
    assert!(errors[3] < 1e-9, "{errors:?}");
    assert!(errors[1] < 0.7 * errors[0] && errors[2] < 0.5 * errors[1] && errors[2] > 1e-4, "{errors:?}");
}

fn patched(kind: ReductionKind, modes: Option<usize>) -> Reduction {
    let options = CubeOptions { elements: 4, patches: Some([3, 2]), kind, modes, ..CubeOptions::default() };
    reduce_cube(&options, &silent).unwrap()
}

/// Returns the weights of the patches of [`patched`] over all dofs, row by row like the contact map.
fn patch_rows() -> DMatrix<f64> {
    let mesh = cube_of(4);
    let side = |set: &str| {
        let directions = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
        face_patches(&mesh, mesh.set(set).unwrap(), [2, 3], directions, |index| format!("{index}")).unwrap()
    };
    let patches = [side("MASTER_LEFT"), side("MASTER_RIGHT")].concat();
    let mut rows = DMatrix::zeros(3 * patches.len(), 3 * mesh.nodes.len());
    for (index, patch) in patches.iter().enumerate() {
        let total: f64 = patch.weights().map(|(_, weight)| weight).sum();
        assert!((total - 1.0).abs() < 1e-13, "{total}");
        for (node, weight) in patch.weights() {
            (0..3).for_each(|axis| rows[(3 * index + axis, 3 * node + axis)] = weight);
        }
    }
    rows
}

/// Duals are at the peaks of the hat functions, also on the edges of the face; on a grid of linear elements with as
/// many nodes they coincide with the nodes.
#[test]
fn face_patches_include_positions_on_the_edges() {
    let rom = patched(ReductionKind::FreeInterface, Some(4)).rom;
    assert_eq!(rom.contact_nodes.len(), 12);
    let (start, side) = (cube_of(4).nodes[0][1], 0.05);
    for (index, node) in rom.contact_nodes.iter().enumerate() {
        let sign = if index < 6 { -1.0 } else { 1.0 };
        let y = start + side * [0.0, 0.5, 1.0][index % 6 / 2];
        let z = side * [-0.5, 0.5][index % 2];
        let off = node.position.iter().zip([0.5 * sign * side, y, z]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-14, "{node:?}: {off:e}");
    }
    assert_eq!((rom.contact_nodes[0].name.as_str(), rom.contact_nodes[11].name.as_str()), ("left_1", "right_6"));
    let all = CubeOptions { elements: 4, patches: Some([5, 5]), ..CubeOptions::default() };
    let nodes = reduce_cube(&CubeOptions { patches: None, ..all.clone() }, &silent).unwrap().rom;
    let patches = reduce_cube(&all, &silent).unwrap().rom;
    for (node, patch) in nodes.contact_nodes.iter().zip(&patches.contact_nodes) {
        let apart = node.position.iter().zip(patch.position).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-13 && patch.area > 0.0, "{node:?} {patch:?}");
    }
    // Contact flexibility well above the rigid-body motions: C (K + s M)⁻¹ Cᵀ.
    let [nodes, patches] = [nodes, patches].map(|rom| {
        let shift = rom.stiffness.trace() / rom.mass.trace();
        let whole = (&rom.stiffness + shift * &rom.mass).cholesky().unwrap();
        &rom.contact_map * whole.solve(&rom.contact_map.transpose())
    });
    equal(&patches, &nodes, 1e-9);
}

/// The elastic response of the cube to contact forces, in the frame that moves with it, is that of the full model
/// with any number of modes.
#[test]
fn inertia_relief_is_exact_with_any_number_of_modes() {
    let [stiffness, inertia] = dense(cube_of(4), &cube_material(), MassMatrix::Lumped);
    let (rows, nodes) = (patch_rows(), cube_of(4).nodes);
    let rigid = DMatrix::from_fn(stiffness.nrows(), 6, |dof, k| {
        let (axis, x) = (dof % 3, nodes[dof / 3]);
        match k {
            0..3 => f64::from(u8::from(axis == k)),
            // e_(k-3) × x.
            _ if axis == (k - 2) % 3 => -x[(k - 1) % 3],
            _ if axis == (k - 1) % 3 => x[(k - 2) % 3],
            _ => 0.0,
        }
    });
    let carried = &inertia * &rigid;
    let weight = (rigid.transpose() * &carried).try_inverse().unwrap();
    let shift = stiffness.trace() / inertia.trace();
    let factor = (&stiffness + shift * &carried * &weight * carried.transpose()).cholesky().unwrap();
    let moved = &rows * &rigid;
    let exact = &rows * factor.solve(&rows.transpose()) - &moved * &weight * moved.transpose() / shift;
    let elastic = |rom: &Rom| {
        let mut scaled = rom.contact_map.clone();
        for (mode, mut column) in scaled.column_iter_mut().enumerate() {
            column *= if mode < 6 { 0.0 } else { 1.0 / rom.stiffness[(mode, mode)] };
        }
        scaled * rom.contact_map.transpose()
    };
    for modes in [0, 5, 30] {
        let found = patched(ReductionKind::FreeInterface, Some(modes));
        assert_eq!(found.rom.order(), 36 + 6 + modes);
        equal(&elastic(&found.rom), &exact, 1e-9);
        let kept = &found.rom.checks.frequency_deviation[..(6 + modes).min(16)];
        assert!(kept.iter().all(|deviation| deviation.abs() < 1e-6), "{kept:?}");
    }
    equal(&elastic(&patched(ReductionKind::FixedInterface, None).rom), &exact, 1e-9);
    // Without inertia relief it is different, which the test would detect.
    let held = elastic(&patched(ReductionKind::FixedInterface, Some(5)).rom);
    assert!((&held - &exact).amax() > 1e-4 * exact.amax());
}

/// Compares forced responses of a patch between two frequencies of the cube with the reduction with all modes.
#[test]
fn free_cube_converges_faster_with_free_interface_modes() {
    let exact = patched(ReductionKind::FixedInterface, None).rom;
    let frequencies = &exact.checks.reduced_frequencies;
    let angular = std::f64::consts::PI * (frequencies[9] + frequencies[12]);
    let truth = flexibility(&exact, -angular * angular);
    let error = |kind, modes| {
        let found = flexibility(&patched(kind, Some(modes)).rom, -angular * angular);
        (&found - &truth).amax() / truth.amax()
    };
    let mut last = f64::INFINITY;
    for modes in [8, 16, 32, 64] {
        let fixed = error(ReductionKind::FixedInterface, modes);
        let free = error(ReductionKind::FreeInterface, modes);
        print_row!("| {modes} | {fixed} | {free} |");
        assert!(free < 0.5 * fixed && free < 0.55 * last, "{modes}: {fixed:e} {free:e}");
        last = free;
    }
    crate::guide::hold("cargo test -p tiprub-model --test reduction cube");
}

/// The order of the grids makes S_t × S_s point to the cube, and the rings are mirror images.
#[test]
fn normals_point_to_the_cube() {
    let roms = RingSide::BOTH.map(|side| ring(side, COARSE, MassMatrix::Lumped, 12, 6).rom);
    for (rom, side) in roms.iter().zip(RingSide::BOTH) {
        let grid = rom.extras.grid.unwrap();
        assert_eq!((grid.around, grid.along, grid.closed), (COARSE[2] + 1, COARSE[1] + 1, false));
        let place = |i: usize, j: usize| nalgebra::Vector3::from(rom.contact_nodes[j * grid.around + i].position);
        let (i, j) = (COARSE[2] / 2, COARSE[1] / 2);
        let along_s = place(i + 1, j) - place(i - 1, j);
        let along_t = place(i, j + 1) - place(i, j - 1);
        let normal = along_t.cross(&along_s).normalize();
        assert!((normal.x + side.sign()).abs() < 1e-12, "{side:?}: {normal}");
        let crest = place(i, j).x;
        assert!((crest - side.sign() * 0.024).abs() < 1e-12, "2 mm closer together than the cube is wide: {crest}");
        assert!(rom.contact_map.row(0).amax() < 1e-300, "the ends are clamped");
    }
    let diagonal = |rom: &Rom| rom.stiffness.diagonal();
    let off = (diagonal(&roms[0]) - diagonal(&roms[1])).component_div(&diagonal(&roms[0])).amax();
    assert!(off < 1e-9, "{off:e}");
}

#[test]
fn rejects_invalid_reduction_options() {
    let options = RingOptions { elements: COARSE, static_responses: 76, modes: 4, ..RingOptions::new(RingSide::Left) };
    let error = reduce_cube_ring(&options, &silent).unwrap_err().to_string();
    assert!(error.contains("only 75 displacements"), "{error}");
    let options = CubeOptions { elements: 2, modes: Some(28), ..CubeOptions::default() };
    let error = reduce_cube(&options, &silent).unwrap_err().to_string();
    assert!(error.contains("28 requested, but there are only 27"), "{error}");
    let options = CubeOptions { elements: 2, patches: Some([4, 2]), ..CubeOptions::default() };
    let error = reduce_cube(&options, &silent).unwrap_err().to_string();
    assert!(error.contains("4 in a direction in which the face has 3 node positions"), "{error}");
}
