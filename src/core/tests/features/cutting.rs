//! Blades that cut a coating, against closed forms: kinematics alone gives the depth of cut, and with it force, torque, volume.

use std::f64::consts::TAU;

use tiprub_core::settings::{CoatingSettings, CuttingSettings};
use tiprub_core::{Rom, Scene};
use tiprub_test_models::{self as models, element, go, move_on, real, started};

/// Specific cutting energy (J/m³), normal per tangential force.
const ENERGY: f64 = 5e7;
const RATIO: f64 = 0.8;
/// Along the axis (m).
const LENGTH: f64 = 0.03;
const SPEED: f64 = 1000.0;
const GAP: f64 = 2e-5;
const BLADES: usize = 2;
/// Largest flexibility: of radial modes (m/N).
const STIFFNESS: f64 = 4e8;

/// Two contact nodes, each with a radial and a tangential mode of its own.
fn blade() -> Rom {
    let frequencies = [20_000.0, 20_000.0, 31_000.0, 31_000.0];
    let size = TAU * 20_000.0 / STIFFNESS.sqrt();
    let shape = move |row: usize, mode: usize| {
        let (node, component) = (row / 3, row % 3);
        if mode % 2 == node && mode / 2 == component { size } else { 0.0 }
    };
    let nodes = ["low", "high"].into_iter().zip([0.0, LENGTH]);
    let nodes = nodes.map(|(name, z)| models::node(name, [models::RADIUS, 0.0, z], 0.0)).collect();
    Rom { sectors: BLADES, damping_ratio: 0.05, ..models::modal("cutter", &frequencies, shape, nodes) }
}

fn scene([cells_around, cells_along]: [usize; 2], step: f64) -> Scene {
    let mut scene = models::round(blade());
    let settings = &mut scene.settings;
    settings.structures[0].speed = SPEED;
    settings.contacts[0].gap = GAP;
    settings.contacts[0].coating = Some(CoatingSettings {
        thickness: 1e-3,
        modulus: 0.0,
        yield_stress: 0.0,
        hardening: 0.0,
        cells_around,
        cells_along,
        cutting: Some(CuttingSettings { specific_energy: ENERGY, normal_ratio: RATIO }),
    });
    settings.time.step = step;
    settings.outputs.wear = true;
    scene
}

/// The casing closes in at a steady rate: every blade takes the same depth of cut.
#[test]
fn a_steady_incursion_has_the_force_torque_and_volume_of_its_kinematics() {
    println!("| cells | step (s) | torque | volume | work/(u V) | shaft work | residual |");
    let rate = 5e-3;
    let turn = TAU / SPEED;
    for (cells, step) in [([200, 1], 2e-6), ([400, 3], 2e-6), ([400, 3], 1e-6), ([800, 7], 5e-7)] {
        let mut run = started(&scene(cells, step));
        move_on(&mut run, "casing_radius_change", 0.0, -rate);
        let (length, mut torque_work, mut torque, mut count) = (turn / 20.0, 0.0, 0.0, 0);
        let steps = 20 * 12;
        for index in 0..steps {
            go(&mut run, length);
            let mean = real(&run, "torque");
            torque_work -= mean * SPEED * length;
            if index >= steps / 2 {
                (torque, count) = (torque + mean, count + 1);
            }
        }
        let depth = rate * turn / BLADES as f64;
        let expected = -ENERGY * LENGTH * depth * models::RADIUS * BLADES as f64;
        let torque = torque / f64::from(count) / expected;
        let incursion = rate * run.time() - GAP;
        // What the blades yield under the force of the cut lags behind.
        let volume = real(&run, "worn_volume") / (TAU * models::RADIUS * LENGTH * incursion);
        let work = real(&run, "cutting_work");
        let ratio = work / (ENERGY * real(&run, "worn_volume"));
        let shaft = real(&run, "shaft_work");
        let residual = real(&run, "energy_residual_relative");
        println!(
            "| {cells:?} | {step:.1e} | {torque:.6} | {volume:.6} | {:.1e} | {:.1e} {:.1e} | {residual:.1e} | {:e} {:e}",
            ratio - 1.0,
            torque_work / shaft - 1.0,
            work / shaft - 1.0,
            real(&run, "wear_depth_maximum") / incursion,
            element(&run, "wear_depth", 3) / incursion,
        );
    }
}
