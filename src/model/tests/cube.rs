//! The bodies of the cube between two rings: free body and open panel reduced without loss of what they must keep.

use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::rom::Frame;
use tiprub_model::cube::{
    CubeOptions, MassMatrix, RingOptions, Side, cube_material, cube_of, reduce_cube, reduce_cube_ring, ring_grid,
    ring_material, ring_of,
};
use tiprub_model::progress::silent;
use tiprub_model::{FeModel, Mesh, Reduction};

const MASSES: [MassMatrix; 2] = [MassMatrix::Lumped, MassMatrix::Consistent];
/// A ring small enough for its whole spectrum.
const COARSE: [usize; 3] = [2, 4, 6];

fn cube(elements: usize, mass: MassMatrix, modes: Option<usize>) -> Reduction {
    reduce_cube(&CubeOptions { elements, mass, modes, ..CubeOptions::default() }, &silent).unwrap()
}

fn ring(side: Side, elements: [usize; 3], mass: MassMatrix, modes: usize, static_responses: usize) -> Reduction {
    let options = RingOptions { elements, mass, modes, static_responses, ..RingOptions::new(side) };
    reduce_cube_ring(&options, &silent).unwrap()
}

/// K and M of all dofs, dense.
fn dense(mesh: Mesh, material: &tiprub_model::Material, mass: MassMatrix) -> [DMatrix<f64>; 2] {
    let model = FeModel::assembled(mesh, material, String::new(), &silent).unwrap();
    let model = if mass == MassMatrix::Lumped { model.lumped().unwrap() } else { model };
    let all: Vec<usize> = (0..model.stiffness.order()).collect();
    [&model.stiffness, &model.mass].map(|matrix| {
        let block = matrix.block(&all, &all);
        DMatrix::from_fn(all.len(), all.len(), |i, j| block[(i, j)])
    })
}

/// C (K + s M)⁻¹ Cᵀ of a modal ROM: what contact meets at the growth rate √s.
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
fn a_free_body_moves_as_a_whole_without_strain() {
    let rom = cube(3, MassMatrix::Lumped, Some(8)).rom;
    assert_eq!((rom.frame, rom.contact_nodes.len(), rom.order()), (Frame::Cartesian, 32, 96 + 8));
    let zeros = (0..rom.order()).filter(|&mode| rom.stiffness[(mode, mode)] == 0.0).count();
    assert_eq!(zeros, 6);
    let rigid = rom.contact_map.columns(0, 6).into_owned();
    for axis in 0..3 {
        let unit = DMatrix::from_fn(rigid.nrows(), 1, |row, _| if row % 3 == axis { 1.0 } else { 0.0 });
        let motion = rigid.clone().svd(true, true).solve(&unit, 1e-12).unwrap();
        assert!((&rigid * &motion - &unit).amax() < 1e-12);
        // M = I: the mass of the whole cube moves, 7800 kg/m³ and 50 mm.
        let mass = motion.norm_squared();
        assert!((mass / 0.975 - 1.0).abs() < 1e-12, "{mass} kg");
    }
    assert_eq!(rom.contact_nodes[0].name, "left_1");
    assert!((rom.contact_nodes[0].position[0] + 0.025).abs() < 1e-15);
    assert!((rom.contact_nodes[16].position[0] - 0.025).abs() < 1e-15 && rom.contact_nodes[16].name == "right_1");
}

/// With all modes both reductions are changes of coordinates: contact meets the full model at any rate.
#[test]
fn with_all_modes_nothing_is_lost() {
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
        // And some of it is lost with fewer, so that the test can fail.
        let truncated = cube(3, mass, Some(10)).rom;
        assert!(
            (flexibility(&truncated, shift) - full.select_rows(&rows).select_columns(&rows)).amax()
                > 1e-4 * full.amax()
        );
    }
    for side in Side::BOTH {
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

/// Free dofs of the coarse ring, and where the rows of its grid are among them.
fn ring_rows(side: Side) -> (Vec<usize>, Vec<Option<usize>>) {
    let mesh = ring_of(side, COARSE);
    let clamped = mesh.set("CLAMPED").unwrap();
    let free: Vec<usize> = (0..3 * mesh.nodes.len()).filter(|dof| !clamped.contains(&(dof / 3))).collect();
    let grid = ring_grid(side, COARSE);
    let dofs = grid.nodes.iter().flat_map(|node| 3 * node..3 * node + 3);
    let rows = dofs.map(|dof| free.binary_search(&dof).ok()).collect();
    (free, rows)
}

#[test]
fn static_responses_to_all_forces_make_the_panel_exact_at_rest_and_fewer_come_near() {
    let (side, mass) = (Side::Left, MassMatrix::Lumped);
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

/// Grids run so that S_t × S_s points to the cube, and the rings mirror each other.
#[test]
fn normals_point_to_the_cube() {
    let roms = Side::BOTH.map(|side| ring(side, COARSE, MassMatrix::Lumped, 12, 6).rom);
    for (rom, side) in roms.iter().zip(Side::BOTH) {
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
fn what_cannot_be_reduced_is_refused() {
    let options = RingOptions { elements: COARSE, static_responses: 76, modes: 4, ..RingOptions::new(Side::Left) };
    let error = reduce_cube_ring(&options, &silent).unwrap_err().to_string();
    assert!(error.contains("only 75 components"), "{error}");
    let options = CubeOptions { elements: 2, modes: Some(28), ..CubeOptions::default() };
    let error = reduce_cube(&options, &silent).unwrap_err().to_string();
    assert!(error.contains("28 asked, but only 27"), "{error}");
}
