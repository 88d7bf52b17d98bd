//! Forces, moments and work agree: the torque is conjugate to the rotor angle, every input has its work, and what acts on
//! the master acts on the slave.

mod common;
#[path = "common/features.rs"]
mod common_features;

use common_features::{coating, flexible};
use tiprub_core::settings::{Scheme, Shape, Solver, SplineSettings};
use tiprub_core::{Scene, Simulation};

fn real(simulation: &Simulation, name: &str) -> f64 {
    let reference = simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference;
    simulation.real(reference).unwrap()
}

fn value(simulation: &Simulation, name: &str) -> f64 {
    simulation.table().find(name).map_or(0.0, |row| simulation.real(row.reference).unwrap())
}

fn set(simulation: &mut Simulation, name: &str, value: f64, slope: f64) {
    let Some(reference) = simulation.table().find(name).map(|row| row.reference) else { return };
    simulation.set_real(reference, value).unwrap();
    simulation.set_input_derivative(reference, 1, slope).unwrap();
}

type Feature = (&'static str, fn(&mut Scene));

fn whirl(scene: &mut Scene) {
    scene.settings.structures[0].whirl = true;
    scene.settings.structures[0].axial_shift = true;
}

fn spline(scene: &mut Scene) {
    scene.settings.surfaces[0].spline = Some(SplineSettings::default());
}

const FEATURES: [Feature; 8] = [
    ("revolution", |_| {}),
    ("revolution, whirl", whirl),
    ("spline", spline),
    ("spline, whirl", |scene| {
        spline(scene);
        whirl(scene);
    }),
    ("flexible", flexible),
    ("flexible, whirl", |scene| {
        flexible(scene);
        whirl(scene);
    }),
    ("coating", coating),
    ("coating, flexible, whirl", |scene| {
        flexible(scene);
        coating(scene);
        whirl(scene);
    }),
];

struct Found {
    contacts: usize,
    /// Largest torque, relative to Σλ r.
    torque: f64,
    /// Σ torque·speed·H + shaft work, relative to the turnover.
    shaft: f64,
    residual: f64,
    curvature: f64,
    curvature_sum: f64,
    turnover: f64,
    works: [f64; 5],
}

fn run(scene: &Scene, step: f64) -> Found {
    let mut scene = scene.clone();
    scene.settings.time.step = step;
    let mut simulation = Simulation::new(&scene).unwrap();
    simulation.initialise(0.0).unwrap();
    let rate = 900.0;
    let (mut contacts, mut torque, mut supplied) = (0, 0.0_f64, 0.0);
    let length = 1e-5;
    let count = 300;
    for index in 0..count {
        let time = simulation.time();
        let (x, speed) = (rate * time, 1300.0 + 4e4 * time);
        set(&mut simulation, "speed", speed, 0.0);
        let e = 5e-5 * (time / 1e-3).min(1.0);
        let de = if time < 1e-3 { 5e-2 } else { 0.0 };
        set(&mut simulation, "whirl_x", e * x.cos(), -e * rate * x.sin() + de * x.cos());
        set(&mut simulation, "whirl_y", e * x.sin(), e * rate * x.cos() + de * x.sin());
        set(&mut simulation, "axial_shift", 1e-5 * (2.0 * x).sin(), 2e-5 * rate * (2.0 * x).cos());
        let closing = if time < 1e-3 { -0.45 } else { 0.0 };
        set(&mut simulation, "casing_radius_change", -0.45 * time.min(1e-3), closing);
        set(&mut simulation, "casing_shape_rotation", 3.0 * time, 3.0);
        set(&mut simulation, "casing_shape_factor", 1.0 + 0.1 * (x).sin(), 0.1 * rate * (x).cos());
        simulation.do_step(time, length).unwrap_or_else(|e| panic!("{index}: {e}"));
        contacts += simulation.system().events().len();
        let normal = real(&simulation, "normal_impulse") / length;
        if normal > 0.0 {
            torque = torque.max(real(&simulation, "torque").abs() / (0.25 * normal));
        }
        supplied += real(&simulation, "torque") * speed * length;
    }
    let ledger = simulation.system().ledger();
    let turnover = ledger.turnover.value();
    Found {
        contacts,
        torque,
        shaft: (supplied + real(&simulation, "shaft_work")).abs() / turnover,
        residual: real(&simulation, "energy_residual_relative"),
        curvature: real(&simulation, "curvature_work"),
        curvature_sum: ledger.curvature_turnover.value(),
        turnover,
        works: ["shaft_work", "whirl_work", "shift_work", "casing_motion_work", "friction_loss"]
            .map(|name| value(&simulation, name)),
    }
}

#[test]
fn explore() {
    for round in [true, false] {
        for friction in [0.0, 0.15] {
            for feature in FEATURES {
                for (scheme, solver) in [
                    (Scheme::ModalExact, Solver::Lcp),
                    (Scheme::CentralDifference, Solver::Film),
                    (Scheme::MasslessBoundary, Solver::Lcp),
                    (Scheme::ModalExact, Solver::Coulomb),
                ] {
                    if feature.0.contains("coating") && solver != Solver::Lcp {
                        continue;
                    }
                    if friction == 0.0 && solver == Solver::Coulomb {
                        continue;
                    }
                    let mut scene = common::scene(12);
                    scene.roms[0] = common::rich_rom(12);
                    scene.settings.time.scheme = scheme;
                    scene.settings.contacts[0].solver = solver;
                    scene.settings.contacts[0].friction = friction;
                    if round {
                        scene.settings.surfaces[0].shape = Shape::Circular {};
                    }
                    feature.1(&mut scene);
                    let (one, two) = (run(&scene, 1e-6), run(&scene, 5e-7));
                    println!(
                        "{}{:26} µ={friction} {scheme:?} {solver:?} n={} torque {:.1e} shaft {:.1e} res {:.1e} curv {:.2e}/{:.2e} -> {:.2e}/{:.2e} of {:.2e}; {:.3?}",
                        if round { "O " } else { "8 " }, feature.0, one.contacts, one.torque, one.shaft, one.residual, one.curvature, one.curvature_sum, two.curvature, two.curvature_sum, one.turnover, one.works
                    );
                }
            }
        }
    }
}

#[test]
fn deep() {
    for (feature, solver) in [(FEATURES[2], Solver::Lcp), (FEATURES[0], Solver::Lcp)] {
    for round in [true, false] {
        for friction in [0.0, 0.15] {
            let mut scene = common::scene(12);
            scene.roms[0] = common::rich_rom(12);
            scene.settings.contacts[0].solver = solver;
            scene.settings.contacts[0].friction = friction;
            if round {
                scene.settings.surfaces[0].shape = Shape::Circular {};
            }
            feature.1(&mut scene);
            for step in [1e-6, 5e-7, 2.5e-7, 1.25e-7] {
                let one = run(&scene, step);
                println!("{} {round} µ={friction} h={step:e} curv {:.3e}/{:.3e} of {:.2e} {:.3?}", feature.0, one.curvature, one.curvature_sum, one.turnover, one.works);
            }
        }
    }
    }
}
