//! Stress at chosen points, against the rows of the ROM and the definition of von Mises.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use tiprub_core::scene::rom::{STRESSES, Thermal, WatchedPoints};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::ThermalPatch;
use tiprub_test_models::{self as models, element, go, set, started};

/// Returns a blade whose stresses are known functions of its contact displacements, ready to rub.
fn scene() -> Scene {
    let mut scene = models::bumps(models::blade(4));
    let rom = &mut scene.roms[0];
    let (order, nodes) = (rom.order(), rom.contact_nodes.len());
    // As many watched points as contact nodes, so that their displacements are outputs too.
    rom.extras.watched = Some(WatchedPoints { map: rom.contact_map.clone(), points: rom.contact_nodes.clone() });
    let factor =
        |row: usize, column: usize| 1e11 * (1.0 + row as f64) * if column.is_multiple_of(2) { 1.0 } else { -0.3 };
    let of_moved = DMatrix::from_fn(2 * STRESSES, 3 * nodes, factor);
    let map = of_moved * &rom.contact_map;
    assert_eq!(map.shape(), (2 * STRESSES, order));
    let places = ["root", "middle"].map(|name| models::node(name, rom.contact_nodes[0].position, 0.0)).to_vec();
    rom.extras.stress = Some(WatchedPoints { map, points: places });
    scene.settings.outputs.watched_sectors = vec![2];
    scene.settings.outputs.stress = true;
    scene
}

#[test]
fn stress_follows_from_the_displacements() {
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
fn unrequested_stress_costs_nothing() {
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
fn rejects_stress_output_without_stress_points() {
    let reported = |change: fn(&mut Scene)| {
        let mut scene = scene();
        change(&mut scene);
        Simulation::new(&scene).map(|_| ()).unwrap_err().to_string()
    };
    let missing = reported(|scene| scene.roms[0].extras.stress = None);
    assert!(missing.starts_with("outputs.stress: requires stress points in the ROM of a rotor"), "{missing}");
    let unwatched = reported(|scene| scene.settings.outputs.watched_sectors.clear());
    assert!(unwatched.starts_with("outputs.stress: requires `outputs.watched_sectors`"), "{unwatched}");
    let short = reported(|scene| {
        let stress = scene.roms[0].extras.stress.as_mut().unwrap();
        stress.map = stress.map.rows(0, STRESSES).into_owned();
    });
    assert!(short.contains("`stress_map`"), "{short}");
    let broken = reported(|scene| scene.roms[0].extras.stress.as_mut().unwrap().map[(1, 1)] = f64::NAN);
    assert!(broken.contains("`stress_map`: non-finite entry at (1, 1)"), "{broken}");
}

/// Returns blades with a load per kelvin and by the speed, and with a given static thermal stress.
fn heated(thermal: fn(usize) -> f64) -> Scene {
    let mut scene = scene();
    (scene.settings.surfaces[0].shape, scene.settings.contacts[0].gap) = (Shape::Circular {}, 5e-3);
    let rom = &mut scene.roms[0];
    let loads = DMatrix::from_fn(rom.order(), 1, |row, _| 2.0 + 1.5 * (row as f64).sin());
    rom.extras.thermal = Some(Thermal { loads, patches: vec![ThermalPatch { angle: [0.0, TAU], axial: [-1.0, 1.0] }] });
    rom.extras.stress_thermal = Some(DMatrix::from_fn(2 * STRESSES, 1, |row, _| thermal(row)));
    rom.extras.spin = Some(models::spin(rom.order()));
    scene.settings.structures[0].thermal = true;
    scene
}

fn stress_of(run: &Simulation, sector: usize) -> Vec<f64> {
    let names = ["radial", "tangential", "axial", "radial_tangential", "tangential_axial", "axial_radial"];
    let reported = |place: u32, name: &str| element(run, &format!("blade[{sector}].{name}_stress"), place);
    (0..2).flat_map(|place| names.map(|name| reported(place, name))).collect()
}

fn warm(scene: &Scene, temperature: f64) -> Simulation {
    let mut run = Simulation::new(scene).unwrap();
    set(&mut run, "rotor_temperature", temperature);
    run.initialise(0.0).unwrap();
    run
}

/// At rest the stress is the static one of the full model, which is zero for free expansion; softening reduces it in
/// proportion to the stiffness, and a stiffer blade increases it in proportion.
#[test]
fn thermal_stress_of_warm_blade_matches_full_model() {
    for thermal in [(|_| 0.0) as fn(usize) -> f64, |row| 1e5 * (row as f64 - 4.5)] {
        for (softening, stiffening, factor) in
            [(0.0, false, 1.0), (3e-4, false, 1.0), (3e-4, true, 1.0), (3e-4, false, 1.1), (0.0, true, 0.9)]
        {
            let mut scene = heated(thermal);
            let structure = &mut scene.settings.structures[0];
            (structure.softening, structure.spin.stiffening, structure.damping_ratio) =
                (softening, stiffening, Some(0.3));
            structure.frequency_factors = vec![1.0, factor, 1.0, 1.0];
            let temperature = 300.0;
            let share = (1.0 - softening * temperature) * factor * factor;
            let expected: Vec<f64> = (0..2 * STRESSES).map(|row| share * temperature * thermal(row)).collect();
            let mut moving = started(&scene);
            for step in 1..=200 {
                set(&mut moving, "rotor_temperature", 0.01 * temperature * f64::from(step).min(100.0));
                go(&mut moving, 2e-4);
            }
            for (run, tolerance) in [(warm(&scene, temperature), 1e-9), (moving, 1e-5)] {
                // The modes alone give up to 4e9 Pa.
                for (found, expected) in stress_of(&run, 2).iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e9 * tolerance, "{softening} {factor}: {found:e} {expected:e}");
                }
            }
        }
    }
}

/// Forces determine the stress of a statically determinate blade: under its centrifugal force it has the static stress
/// of the full model regardless of the effect of heat and mistuning on the stiffness, although it stretches by 13.6 %
/// more.
#[test]
fn statically_determinate_stress_ignores_stiffness() {
    let mut scene = heated(|_| 0.0);
    let growth = |row: usize| 3.0 * (row as f64 - 4.5);
    scene.roms[0].extras.stress_centrifugal = Some(DMatrix::from_fn(2 * STRESSES, 1, |row, _| growth(row)));
    scene.roms[0].extras.thermal.as_mut().unwrap().loads.fill(0.0);
    scene.settings.structures[0].spin.growth = true;
    let stretch = |run: &Simulation| element(run, "blade[2].radial_displacement", 0);
    let longer = stretch(&started(&scene)) / 0.88;
    scene.settings.structures[0].softening = 3e-4;
    scene.settings.structures[0].frequency_factors = vec![1.0, 1.2, 0.8, 1.0];
    for (sector, factor) in [(1, 1.0), (2, 1.2), (3, 0.8)] {
        scene.settings.outputs.watched_sectors = vec![sector];
        for temperature in [0.0, 400.0] {
            let run = warm(&scene, temperature);
            let moved = element(&run, &format!("blade[{sector}].radial_displacement"), 0) * factor * factor;
            let expected = if temperature > 0.0 { longer } else { 0.88 * longer };
            assert!((moved / expected - 1.0).abs() < 1e-12, "{moved} {expected}");
            for (row, found) in stress_of(&run, sector).into_iter().enumerate() {
                // The modes alone give up to 1e9 Pa.
                let expected = 1300.0 * 1300.0 * growth(row);
                assert!((found - expected).abs() < 1e-2, "blade {sector}: {found:e} {expected:e}");
            }
        }
    }
    scene.roms[0].extras.stress_centrifugal = None;
    let refused = Simulation::new(&scene).map(|_| ()).unwrap_err().to_string();
    assert!(
        refused.starts_with(
            "outputs.stress: stress of a rotor with `structure.spin.growth` requires static centrifugal stress"
        ),
        "{refused}"
    );
    assert!(refused.contains("`stress_centrifugal`"), "{refused}");
}

/// Displacements alone do not determine the stress of a structure that expands: the scene is rejected by name, and no
/// wrong stress is reported.
#[test]
fn heated_blade_stress_requires_static_thermal_stress() {
    let mut scene = heated(|_| 0.0);
    scene.roms[0].extras.stress_thermal = None;
    let reported = |scene: &Scene| Simulation::new(scene).map(|_| ()).unwrap_err().to_string();
    let refused = reported(&scene);
    assert!(
        refused
            .starts_with("outputs.stress: stress of a rotor with `structure.thermal` requires static thermal stress"),
        "{refused}"
    );
    assert!(refused.contains("`stress_thermal`"), "{refused}");
    scene.settings.structures[0].thermal = false;
    started(&scene);
    let changed = |change: fn(&mut Scene)| {
        let mut scene = heated(|_| 0.0);
        change(&mut scene);
        reported(&scene)
    };
    let shape = changed(|scene| scene.roms[0].extras.stress_thermal = Some(DMatrix::zeros(6, 1)));
    assert!(shape.contains("`stress_thermal`: shape (6, 1) found, (12, 1) expected"), "{shape}");
    let broken = changed(|scene| scene.roms[0].extras.stress_thermal.as_mut().unwrap()[(3, 0)] = f64::NAN);
    assert!(broken.contains("`stress_thermal`: non-finite entry at (3, 0)"), "{broken}");
    let alone = changed(|scene| {
        (scene.roms[0].extras.thermal, scene.settings.structures[0].thermal) = (None, false);
    });
    assert!(alone.contains("`stress_thermal`: requires `stress_map` and `thermal_loads`"), "{alone}");
}
