//! Choice of contacts in method a: as in the paper (all nodes that the prediction puts inside) or the whole
//! complementarity problem.

use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::scene::{CubeScene, CubeSetting, Mass};
use tiprub_reference::methods::{CubeMethod, MethodRun, film};

fn run(mass: Mass, complementary: bool) -> CubeHistory {
    let scene = CubeScene::new(CubeSetting { mass, ..CubeSetting::default() }).unwrap();
    let options = film::FilmOptions { complementary, ..film::FilmOptions::default() };
    let run = MethodRun { step: 4e-7, end: 1.6e-4, stride: 1, snapshots: vec![] };
    CubeMethod::Film(options).run(&scene, &run).unwrap()
}

fn deepest(history: &CubeHistory) -> f64 {
    history.penetration.iter().fold(0.0, |a: f64, x| a.max(*x))
}

/// With consistent mass a force on one node moves its neighbours: some that are outside in the prediction are pushed
/// in.
#[test]
fn complementarity_prevents_penetration_with_consistent_mass() {
    let [paper, all] = [false, true].map(|complementary| run(Mass::Consistent, complementary));
    println!("deepest: {:.2e} m, complementarity {:.2e} m", deepest(&paper), deepest(&all));
    assert!(deepest(&paper) > 5e-7, "{:e}", deepest(&paper));
    assert!(deepest(&all) < 1e-9, "{:e}", deepest(&all));
    assert!(all.forces.iter().flatten().all(|force| *force >= 0.0), "a contact pulls");
    assert!(all.forces.iter().any(|sides| sides[0] > 1e3), "nothing touched");
}

/// With lumped mass nodes do not push each other in, so both choices of contacts agree to rounding.
#[test]
fn lumped_masses_need_no_complementarity() {
    let [paper, all] = [false, true].map(|complementary| run(Mass::Lumped, complementary));
    let apart = paper.first(0).iter().zip(all.first(0)).fold(0.0, |a: f64, (x, y)| a.max((x - y).abs()));
    println!("u1x apart by {apart:.1e} m; deepest {:.1e} m and {:.1e} m", deepest(&paper), deepest(&all));
    assert!(apart < 1e-12, "{apart:e}");
}
