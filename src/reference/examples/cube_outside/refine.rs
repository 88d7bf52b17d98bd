//! Scene on finer meshes: cube of n³ bricks, rings of n × 8n/5 × 8n.

use std::path::{Path, PathBuf};

use tiprub_reference::compare::{agreement, exit_speed, windowed};
use tiprub_reference::cube::files::{read_json, write_json};
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::scene::{CubeScene, CubeSetting};
use tiprub_reference::cube::{OUTER_RADIUS, RingSide, SIDE};
use tiprub_reference::cube::{cube_of, ring_of};
use tiprub_reference::methods::CubeMethod;

use super::run_scene;

/// End of the contact of node 1, approximately (s).
const TOUCHING: f64 = 3.6e-4;
/// End of the contact of the cube at 100 m/s, approximately (s).
const CONTACT: f64 = 9.5e-4;

fn file(directory: &Path, n: usize, case: &str) -> PathBuf {
    directory.join(format!("mesh-{n}-{case}.json"))
}

/// Runs film on the spline with lumped mass and writes a file: `fast` is 100 m/s with µ = 0.15, `slow` 50 m/s without
/// friction. `courant` is the step (s) that n = 5 would have; every record is about 4 µs long.
pub fn level(directory: &Path, n: usize, case: &str, courant: f64, end: f64) {
    let setting = match case {
        "fast" => CubeSetting::default(),
        _ => CubeSetting { speed: 50.0, friction: 0.0, ..CubeSetting::default() },
    };
    // Eight to five as in the mesh of the paper, and even.
    let (wide, arc) = (2 * ((4 * n + 2) / 5), 8 * n);
    let rings = RingSide::BOTH.map(|side| ring_of(side, [n, wide, arc]));
    let scene = CubeScene::of(setting, cube_of(n), rings, [arc, wide]).expect("the scene can be built");
    let step = courant * 5.0 / n as f64;
    let stride = (1_usize..).find(|k| *k as f64 * step > 3.999e-6).expect("a number of steps");
    let history = run_scene(&scene, CubeMethod::Film(Default::default()), step, end, stride);
    write_json(&file(directory, n, case), &history).expect("the history can be written");
}

/// Tabulates the results of every mesh, and their distances from the next and from the finest.
pub fn table(directory: &Path, counts: &[usize]) {
    let read = |n: usize, case: &str| read_json::<CubeHistory>(&file(directory, n, case)).ok();
    let fast: Vec<(usize, CubeHistory)> = counts.iter().filter_map(|&n| Some((n, read(n, "fast")?))).collect();
    println!(
        "| n | h (µs) | largest u1x (mm) | largest slowing (mm) | largest u1z (mm) | corner: peak (MPa) | impulse (Pa·s) | face: impulse (N·s) | node 1 leaves (ms) | cube leaves (ms) | exit (m/s) | CPU (s) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    fast.iter().for_each(|(n, history)| print_fast(*n, history));
    println!(
        "\n| meshes | u1x | slowing | u1z | corner windows | corner impulse | face impulse | exit speed |\n|---|---|---|---|---|---|---|---|"
    );
    for (index, (n, history)) in fast.iter().enumerate() {
        fast[index + 1..].iter().for_each(|(other, finer)| print_pair([*n, *other], history, finer));
    }
    println!(
        "\n| n | h (µs) | total at 2.1 ms (J) | lowest (J) | impulse (N·s) | v² h I/R (J) | total less that (J) | exit (m/s) |\n|---|---|---|---|---|---|---|---|"
    );
    counts.iter().filter_map(|&n| Some((n, read(n, "slow")?))).for_each(|(n, history)| print_slow(n, &history));
}

fn print_fast(n: usize, history: &CubeHistory) {
    // A corner of the face has a quarter of the face area of an element.
    let area = (SIDE / n as f64).powi(2) / 4.0;
    let windows = windowed(&history.times, &history.first_force(), 2e-5, TOUCHING + 4e-5);
    let sides: Vec<f64> = history.forces.iter().map(|sides| sides[0]).collect();
    let left = windowed(&history.times, &sides, 1e-3, 1.001e-3)[0] * 1e-3;
    let largest = |values: &[f64]| values.iter().fold(0.0, |a: f64, x| a.max(*x));
    let inside = |component: usize, lag: f64, sign: f64| -> Vec<f64> {
        let moved = history.first(component);
        history.times.iter().zip(moved).filter(|(t, _)| **t <= TOUCHING).map(|(t, u)| sign * (u + lag * t)).collect()
    };
    println!(
        "| {n} | {:.3} | {:.5} | {:.5} | {:.5} | {:.2} | {:.1} | {left:.4} | {:.4} | {:.4} | {:.4} | {:.0} |",
        history.step * 1e6,
        largest(&inside(0, 0.0, 1.0)) * 1e3,
        largest(&inside(1, 100.0, 1.0)) * 1e3,
        largest(&inside(2, 0.0, -1.0)) * 1e3,
        largest(&windows) / area * 1e-6,
        windows.iter().sum::<f64>() * 2e-5 / area,
        history.first_force().iter().rposition(|force| *force > 0.0).map_or(0.0, |i| history.times[i]) * 1e3,
        history.last_contact().unwrap_or(0.0) * 1e3,
        exit_speed(history),
        history.processor_time
    );
}

fn print_pair([n, other]: [usize; 2], history: &CubeHistory, finer: &CubeHistory) {
    // A run may be shorter than the contact; impulse and speed are then those until its end.
    let last = |history: &CubeHistory| history.times.last().copied().unwrap_or(0.0);
    let [ours, theirs] = [history, finer].map(last);
    let end = CONTACT.min(ours).min(theirs);
    let mut shorter = history.clone();
    shorter.velocity.truncate(history.times.partition_point(|t| *t < theirs + 1e-7));
    let found = agreement(&shorter, finer, 100.0, TOUCHING, end);
    // Forces of nodes with different areas: compare pressures.
    let mut scaled = finer.clone();
    let areas = (other as f64 / n as f64).powi(2);
    scaled.corner_forces.iter_mut().for_each(|forces| forces[0] *= areas);
    let pressure = agreement(history, &scaled, 100.0, TOUCHING, end);
    println!(
        "| {n} / {other} | {:.2} % | {:.2} % | {:.2} % | {:.1} % | {:+.2} % | {:+.3} % | {:+.3} % |",
        100.0 * found.touching[0],
        100.0 * found.touching[1],
        100.0 * found.touching[2],
        100.0 * pressure.windows,
        100.0 * pressure.impulse,
        100.0 * found.left_impulse,
        100.0 * found.exit
    );
}

fn print_slow(n: usize, history: &CubeHistory) {
    let total = history.total();
    let interval = history.times[1] - history.times[0];
    let impulse: f64 = history.forces.iter().map(|sides| sides[0] + sides[1]).sum::<f64>() * interval;
    let gain = 2500.0 * history.step * impulse / OUTER_RADIUS;
    let last = total[total.len() - 1];
    println!(
        "| {n} | {:.3} | {last:.3} | {:.3} | {impulse:.3} | {gain:.3} | {:.3} | {:.4} |",
        history.step * 1e6,
        total.iter().fold(f64::MAX, |a, b| a.min(*b)),
        last - gain,
        exit_speed(history)
    );
}
