//! Comparison of four independent methods for the cube between two rings: tables and CSV; `lab cube` draws figures 3
//! to 6 of the paper.
//!
//! `cargo run --release -p tiprub-reference --example cube -- WHAT DIRECTORY [lumped|consistent]` where WHAT is
//! `pairs` (methods a, b, c at 100 m/s), `convergence` (in h), `outside` (a CalculiX `.dat` file, given as third
//! argument, compared with our methods; the fourth argument is its contact stiffness in Pa/m, to allow for its
//! penetration), `files` (matrices and node tables) or `table` (the motion by method b as the small table that the
//! FMU is tested against, `tests/python/cube_reference.csv`).

mod outside;
mod tables;

use std::path::{Path, PathBuf};

use tiprub_reference::cube::files::{BodyFile, write_json};
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::scene::{CubeScene, CubeSetting, Mass};
use tiprub_reference::methods::{CubeMethod, MethodRun};
use tiprub_reference::surface::SurfaceKind;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [what, directory, rest @ ..] = arguments.as_slice() else {
        eprintln!("cube pairs|convergence|outside|files|table DIRECTORY [lumped|consistent, or a .dat file]");
        std::process::exit(2);
    };
    let directory = PathBuf::from(directory);
    std::fs::create_dir_all(&directory).expect("the directory can be made");
    let mass = if rest.first().is_some_and(|word| word == "consistent") { Mass::Consistent } else { Mass::Lumped };
    match what.as_str() {
        "pairs" => pairs(&directory, mass),
        "convergence" => tables::convergence(mass),
        "outside" => {
            let stiffness = rest.get(1).map_or(f64::INFINITY, |text| text.parse().expect("a stiffness in Pa/m"));
            outside::compare(&directory, rest.first().expect("the CalculiX .dat file"), stiffness);
        }
        "files" => files(&directory),
        "table" => table(&directory),
        other => panic!("`{other}` is none of pairs, convergence, outside, files, table"),
    }
}

/// Runs a method on a scene and prints a summary.
fn run(method: CubeMethod, setting: CubeSetting, step: f64, end: f64, stride: usize) -> CubeHistory {
    let scene = CubeScene::new(setting).expect("the scene can be built");
    let run = MethodRun { step, end, stride, snapshots: vec![1e-4, 2e-4, 3e-4, 5e-4, 8e-4] };
    let history = method.run(&scene, &run).expect("the run ends well");
    eprintln!(
        "{} ({:?}, {:?} mass, µ = {}, {} m/s, h = {step:e} s): {:.2} s of processor time and {:.2} s to prepare",
        history.method,
        setting.surface,
        setting.mass,
        setting.friction,
        setting.speed,
        history.processor_time,
        history.preparation_time
    );
    history
}

fn save(directory: &Path, name: &str, history: &CubeHistory) {
    std::fs::write(directory.join(format!("{name}.csv")), history.csv()).expect("a CSV file can be written");
    write_json(&directory.join(format!("{name}.json")), history).expect("a JSON file can be written");
}

/// Runs all pairs of a, b, c over 3 ms.
fn pairs(directory: &Path, mass: Mass) {
    let spline = CubeSetting { mass, ..CubeSetting::default() };
    let facets = CubeSetting { surface: SurfaceKind::Facets, ..spline };
    // A consistent mass lowers the limit of central differences and requires a solution per step: only the contact is
    // simulated.
    let (explicit, stride, end) = if mass == Mass::Lumped { (5e-7, 2, 3e-3) } else { (4e-7, 5, 1e-3) };
    let named = [
        ("a, film", run(CubeMethod::Film(Default::default()), spline, explicit, end, stride)),
        ("b, bi-potential, facets", run(CubeMethod::Bipotential, facets, 1e-6, end, 1)),
        ("b, bi-potential, spline", run(CubeMethod::Bipotential, spline, 1e-6, end, 1)),
        ("c, augmented Lagrangian, facets", run(CubeMethod::Augmented(Default::default()), facets, 1e-6, end, 1)),
        ("c, augmented Lagrangian, spline", run(CubeMethod::Augmented(Default::default()), spline, 1e-6, end, 1)),
    ];
    for ((_, history), name) in named.iter().zip(["a-film", "b-facets", "b-spline", "c-facets", "c-spline"]) {
        save(directory, name, history);
    }
    tables::pairs(&named, spline.speed);
    tables::readings(&named);
}

/// Runs method b at 100 m/s until the cube has left, with a record every 4 µs.
fn table(directory: &Path) {
    let history = run(CubeMethod::Bipotential, CubeSetting::default(), 5e-7, 1e-3, 8);
    let mut text = String::from(
        "# Cube between two rings, 100 m/s, friction 0.15, lumped mass, B-spline: method b (bi-potential, trapezoidal rule), h = 0.5 us,\n\
         # full finite-element model. Displacements of node 1 and velocity of the centre at t, mean normal force on node 1 since the\n\
         # line before; m, m/s, N, s. Made by: cargo run --release -p tiprub-reference --example cube -- table DIRECTORY\n\
         t,u1x,u1y,u1z,lambda1,vy\n",
    );
    for (i, t) in history.times.iter().enumerate() {
        let [x, y, z] = history.corners[i][0];
        let (force, velocity) = (history.corner_forces[i][0], history.velocity[i][1]);
        text.push_str(&format!("{t:.6e},{x:.9e},{y:.9e},{z:.9e},{force:.6e},{velocity:.9e}\n"));
    }
    std::fs::write(directory.join("cube_reference.csv"), text).expect("a CSV file can be written");
}

/// Writes node tables, elements, sets and matrices of the three bodies, with both masses.
fn files(directory: &Path) {
    for mass in [Mass::Lumped, Mass::Consistent] {
        let scene = CubeScene::new(CubeSetting { mass, ..CubeSetting::default() }).expect("the scene can be built");
        for (body, name) in scene.bodies.iter().zip(["cube", "left", "right"]) {
            let path = directory.join(format!("{name}-{mass:?}.json").to_lowercase());
            write_json(&path, &BodyFile::from(body)).expect("a JSON file can be written");
        }
    }
}
