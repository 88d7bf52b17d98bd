//! Other programs on the cube between two rings compared with methods b and c. Their meshes are the same; element
//! matrices, contact search, normals, friction and tangents are independent. Tables: `tests/data`, with the commands
//! that generate them.

use tiprub_reference::compare::{HistoryDifference, agreement};
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::outside;
use tiprub_reference::cube::scene::{CubeScene, CubeSetting, Mass};
use tiprub_reference::methods::{CubeMethod, MethodRun, augmented};
use tiprub_reference::surface::SurfaceKind;

fn facets(friction: f64) -> CubeSetting {
    CubeSetting { surface: SurfaceKind::Facets, mass: Mass::Consistent, friction, ..CubeSetting::default() }
}

fn table(text: &str) -> CubeHistory {
    outside::read(text, CubeSetting::default().speed).unwrap()
}

/// Runs a method as long as a table, with the same recording interval.
fn run(method: CubeMethod, friction: f64, step: f64, theirs: &CubeHistory) -> CubeHistory {
    let stride = (1..).find(|k| (*k as f64 + 0.5) * step > theirs.step).unwrap();
    let scene = CubeScene::new(facets(friction)).unwrap();
    let end = theirs.times[theirs.times.len() - 1] + step;
    method.run(&scene, &MethodRun { step, end, stride, snapshots: vec![] }).unwrap()
}

fn spring(penalty: f64, corners: f64) -> CubeMethod {
    CubeMethod::Augmented(augmented::AugmentedOptions { penalty, corners, tolerance: 1.0 })
}

/// Compares up to two windows of force before the end of a table.
fn compare(name: &str, a: &CubeHistory, b: &CubeHistory, end: f64) -> HistoryDifference {
    let found = agreement(a, b, CubeSetting::default().speed, end - 4e-5, end);
    println!("{name}: {found:?}");
    found
}

fn assert_within(found: &HistoryDifference, bounds: [f64; 3], name: &str) {
    for (part, (apart, bound)) in ["u1x", "slowing", "u1z"].iter().zip(found.touching.iter().zip(bounds)) {
        assert!(*apart < bound, "{name}: {part} {apart}");
    }
}

/// End of the contact of node 1 (s).
const TOUCHING: f64 = 3.58e-4;

/// Rays, normals and tangents of GetFEM with Newmark's method without friction against c with the same contact
/// stiffness.
#[test]
fn agrees_with_getfem_without_friction() {
    let theirs = table(include_str!("../data/cube_getfem_newmark.csv"));
    let found = compare("c and GetFEM, µ = 0", &theirs, &run(spring(9.42e7, 1.0), 0.0, 2e-6, &theirs), TOUCHING);
    assert_within(&found, [2e-5; 3], "GetFEM");
    assert!(found.windows < 1e-4 && found.impulse.abs() < 1e-5 && found.left_impulse.abs() < 1e-5, "{found:?}");
}

/// GetFEM with its Coulomb law and 5e8 N/m per node, µ = 0.15: nodes rebound from the springs, one by one.
#[test]
fn agrees_with_getfem_with_penalty_and_friction() {
    let theirs = table(include_str!("../data/cube_getfem_penalty.csv"));
    let found = compare("c and GetFEM", &theirs, &run(spring(5e8, 1.0), 0.15, 1e-6, &theirs), TOUCHING);
    assert_within(&found, [2e-3, 1e-3, 1e-3], "GetFEM");
    assert!(found.windows < 0.015 && found.impulse.abs() < 2e-3, "{found:?}");
    assert!(found.left_impulse.abs() < 1e-3 && found.exit.abs() < 2e-5, "{found:?}");
}

/// GetFEM with 1e11 N/m per node, so that gaps close to 20 nm, in the time stepping of b, against b.
#[test]
fn bipotential_agrees_with_stiff_getfem_penalty() {
    let theirs = table(include_str!("../data/cube_getfem_held.csv"));
    let end = theirs.times[theirs.times.len() - 1];
    let found = compare("b and GetFEM", &theirs, &run(CubeMethod::Bipotential, 0.15, 1e-6, &theirs), end);
    assert!(found.contact.iter().all(|apart| *apart < 4e-4), "{found:?}");
    assert!(found.windows < 1e-3 && found.left_impulse.abs() < 5e-4, "{found:?}");
}

/// CalculiX with small strains against c with the stiffness of CalculiX: 1e12 Pa/m over its areas.
#[test]
fn agrees_with_calculix_for_small_strains() {
    let theirs = table(include_str!("../data/cube_calculix_small.csv"));
    let found = compare("c and CalculiX", &theirs, &run(spring(1e8, 0.75), 0.0, 2e-6, &theirs), 3.6e-4);
    assert_within(&found, [2.5e-3, 2e-3, 1.5e-3], "CalculiX");
    assert!(found.windows < 0.02 && found.impulse.abs() < 0.015, "{found:?}");
}

/// Finite strains with one contact stiffness: CalculiX and GetFEM agree with each other, small strains differ.
#[test]
fn finite_strains_explain_the_difference_from_calculix() {
    let calculix = table(include_str!("../data/cube_calculix.csv"));
    let getfem = table(include_str!("../data/cube_getfem_stvk.csv"));
    let together = compare("CalculiX and GetFEM", &calculix, &getfem, 3.6e-4);
    assert_within(&together, [2.5e-3, 2e-3, 1.5e-3], "CalculiX and GetFEM");
    let small = run(spring(1e8, 0.75), 0.0, 2e-6, &calculix);
    let apart = compare("CalculiX and small strains", &calculix, &small, 3.6e-4);
    assert!((0.03..0.045).contains(&apart.touching[1]), "{apart:?}");
    assert!((0.03..0.045).contains(&apart.touching[2]), "{apart:?}");
}
