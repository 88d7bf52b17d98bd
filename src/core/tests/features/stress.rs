//! Stress at chosen places, against the rows of the ROM and the definition of von Mises.

use nalgebra::DMatrix;
use tiprub_core::rom::{STRESSES, Watched};
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::{self as models, element, go, started};

/// A blade whose stresses are known functions of its contact displacements, ready to rub.
fn scene() -> Scene {
    let mut scene = models::bumps(models::blade(4));
    let rom = &mut scene.roms[0];
    let (order, nodes) = (rom.order(), rom.contact_nodes.len());
    // As many watched points as contact nodes, so that their displacements are told beside.
    rom.extras.watched = Some(Watched { map: rom.contact_map.clone(), points: rom.contact_nodes.clone() });
    let factor =
        |row: usize, column: usize| 1e11 * (1.0 + row as f64) * if column.is_multiple_of(2) { 1.0 } else { -0.3 };
    let of_moved = DMatrix::from_fn(2 * STRESSES, 3 * nodes, factor);
    let map = of_moved * &rom.contact_map;
    assert_eq!(map.shape(), (2 * STRESSES, order));
    let places = ["root", "middle"].map(|name| models::node(name, rom.contact_nodes[0].position, 0.0)).to_vec();
    rom.extras.stress = Some(Watched { map, points: places });
    scene.settings.outputs.watched_sectors = vec![2];
    scene.settings.outputs.stress = true;
    scene
}

#[test]
fn stress_is_that_of_the_displacements() {
    let scene = scene();
    let nodes = scene.roms[0].contact_nodes.len();
    let mut run = started(&scene);
    let mut largest = 0.0_f64;
    for _ in 0..400 {
        go(&mut run, 2e-5);
        let moved: Vec<f64> = (0..u32::try_from(nodes).unwrap())
            .flat_map(|node| {
                ["radial", "tangential", "axial"]
                    .map(|axis| element(&run, &format!("blade[2].{axis}_displacement"), node))
            })
            .collect();
        for place in 0..2_u32 {
            let names = ["radial", "tangential", "axial", "radial_tangential", "tangential_axial", "axial_radial"];
            let found = names.map(|name| element(&run, &format!("blade[2].{name}_stress"), place));
            for (component, found) in found.into_iter().enumerate() {
                let factor = 1e11 * (1.0 + (STRESSES * place as usize + component) as f64);
                let sum = |parity: usize| moved.iter().skip(parity).step_by(2).sum::<f64>();
                let expected = factor * (sum(0) - 0.3 * sum(1));
                largest = largest.max(expected.abs());
                let scale = factor * moved.iter().map(|one| one.abs()).sum::<f64>();
                assert!((found - expected).abs() <= 1e-12 * scale, "{found:e} {expected:e}");
            }
            // J2 of the deviator, as a matrix.
            let [xx, yy, zz, xy, yz, zx] = found;
            let tensor = nalgebra::Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
            let deviator = tensor - nalgebra::Matrix3::identity() * (tensor.trace() / 3.0);
            let expected = (1.5 * (deviator * deviator).trace()).sqrt();
            let mises = element(&run, "blade[2].von_mises_stress", place);
            assert!((mises - expected).abs() <= 1e-12 * expected, "{mises:e} {expected:e}");
        }
    }
    assert!(largest > 1e3, "nothing moved: {largest:e} Pa");
}

#[test]
fn stress_that_is_not_asked_for_costs_nothing() {
    let with = scene();
    let mut without = with.clone();
    without.settings.outputs.stress = false;
    let names = |scene: &Scene| {
        let run = Simulation::new(scene).unwrap();
        run.table().variables().iter().map(|row| row.name.clone()).collect::<Vec<_>>()
    };
    let added: Vec<String> = names(&with).into_iter().filter(|name| !names(&without).contains(name)).collect();
    assert_eq!(added.len(), 7, "{added:?}");
    assert!(added.iter().all(|name| name.starts_with("blade[2].") && name.ends_with("_stress")), "{added:?}");
}

#[test]
fn stress_without_places_is_refused() {
    let told = |change: fn(&mut Scene)| {
        let mut scene = scene();
        change(&mut scene);
        Simulation::new(&scene).map(|_| ()).unwrap_err().to_string()
    };
    let missing = told(|scene| scene.roms[0].extras.stress = None);
    assert!(missing.starts_with("outputs.stress: needs places of stress in the ROM of a rotor"), "{missing}");
    let unwatched = told(|scene| scene.settings.outputs.watched_sectors.clear());
    assert!(unwatched.starts_with("outputs.stress: needs `outputs.watched_sectors`"), "{unwatched}");
    let short = told(|scene| {
        let stress = scene.roms[0].extras.stress.as_mut().unwrap();
        stress.map = stress.map.rows(0, STRESSES).into_owned();
    });
    assert!(short.contains("`stress_map`"), "{short}");
    let broken = told(|scene| scene.roms[0].extras.stress.as_mut().unwrap().map[(1, 1)] = f64::NAN);
    assert!(broken.contains("`stress_map`: non-finite entry at (1, 1)"), "{broken}");
}
