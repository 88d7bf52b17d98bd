//! Time of one internal step of a whole disk, compared with the same system stepped with dense matrices in the same run.
//!
//! `cargo bench -p tiprub-core` prints two tables. Each row is the fastest tenth of repeated batches; only ratios matter, since absolute
//! times depend on the machine. The baseline "two dense products" is the paper's prediction (eq. 9) with its two matrices multiplied out
//! beforehand, in the reduced coordinates of all blades. An argument after `--` selects rows by a part of their name.

use std::time::Instant;

use nalgebra::{Complex, DMatrix, DVector};
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::rom::{Harmonic, Rom};
use tiprub_core::scene::settings::{CoatingSettings, ExperimentSettings, OutputSettings, Shape, SplineSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{self as models};

const SECTORS: usize = 36;
const WHEEL_SECTORS: usize = 56;
const WHEEL_MODES: usize = 34;
/// Depths of the two lobes for 7 to 12 and for 32 contacts of coupled sectors.
const LIGHT: f64 = 0.55;
const HEAVY: f64 = 1.0;
const MODES: usize = 29;

/// Frequencies (Hz) of a reduced rotor 37 blade: 20 fixed-interface modes and 3 contact nodes.
const FREQUENCIES: [f64; MODES] = [
    865.0, 2465.0, 3132.0, 4714.0, 5785.0, 6533.0, 8109.0, 8430.0, 9532.0, 9929.0, 10958.0, 12515.0, 13653.0, 14223.0,
    15444.0, 16995.0, 17626.0, 17941.0, 19450.0, 21335.0, 28238.0, 30173.0, 36090.0, 42060.0, 44025.0, 106206.0,
    137090.0, 168414.0, 184699.0,
];

fn scene(shape: Shape, energies: bool) -> Scene {
    let shape_of = |row: usize, mode: usize| {
        let size = if row % 3 == 1 { 4.0 } else { 1.5 };
        size * (1.7 * mode as f64 + 2.3 * row as f64).cos() + if mode == 20 + row { 60.0 } else { 0.0 }
    };
    let place = |index: u8| [0.25, 0.1 - 0.1 * f64::from(index), 0.01 * f64::from(index)];
    let nodes = (0..3_u8).map(|index| models::node(format!("node_{index}"), place(index), -0.25)).collect();
    let blade = models::modal("blade", &FREQUENCIES, shape_of, nodes);
    let mut scene = models::bumps(Rom { sectors: SECTORS, damping_ratio: 0.005, ..blade });
    let surface = &mut scene.settings.surfaces[0];
    (surface.shape, surface.ramp_time, surface.moving) = (shape, 2e-3, false);
    scene.settings.outputs = OutputSettings { energies, ..OutputSettings::default() };
    scene.settings.experiment = ExperimentSettings { start: 0.0, stop: 1.0, communication_step: 1e-4 };
    scene
}

fn coated(scene: &mut Scene) {
    scene.settings.contacts[0].coating = Some(CoatingSettings {
        thickness: 3e-4,
        modulus: 2e9,
        yield_stress: 5e6,
        hardening: 2e8,
        cells_around: 1000,
        cells_along: 20,
        contact_width: Some(3e-3),
        cutting: None,
    });
}

fn flexible(scene: &mut Scene) {
    models::on_ring(scene, models::ring_of(36, 3, 34), 0.03);
}

/// Time per call (s) of the fastest tenth of `batches` batches of `calls` calls, since other work on the machine only adds time.
fn fastest(batches: usize, calls: u32, mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..batches)
        .map(|_| {
            let start = Instant::now();
            (0..calls).for_each(|_| work());
            start.elapsed().as_secs_f64() / f64::from(calls)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 10]
}

/// Measures the time of an internal step (s) and the mean number of active contacts.
fn stepping(scene: &Scene) -> (f64, f64) {
    let mut simulation = Simulation::new(scene).expect("a valid scene");
    simulation.initialise(0.0).expect("a stable scene");
    for _ in 0..100 {
        simulation.do_step(simulation.time(), 1e-4).expect("a step");
    }
    let (mut contacts, mut samples) = (0, 0);
    let time = fastest(1001, 1, || {
        simulation.do_step(simulation.time(), 1e-4).expect("a step");
        contacts += simulation.system().events().len();
        samples += 1;
    });
    (time / 100.0, contacts as f64 / f64::from(samples))
}

/// A disk of coupled sectors of the reference size: 56 sectors, 34 modes per nodal diameter, 3 contact nodes. Frequencies of the disk modes
/// rise with the nodal diameter, and their shapes turn with it.
fn disk(depth: f64) -> Scene {
    let mut scene = scene(Shape::TwoLobe { depth, width: 0.15, phase: 0.0 }, true);
    let rom = &mut scene.roms[0];
    rom.sectors = WHEEL_SECTORS;
    let modes = WHEEL_MODES;
    let square = |mode: usize, n: usize| {
        let frequency = FREQUENCIES.get(mode).copied().unwrap_or(190_000.0 + 9000.0 * (mode - MODES) as f64);
        (std::f64::consts::TAU * frequency * (1.0 + 0.3 / (1.0 + mode as f64) * (n as f64 / 28.0))).powi(2)
    };
    let shape = |row: usize, mode: usize| {
        let size = if row % 3 == 1 { 4.0 } else { 1.5 };
        size * (1.7 * mode as f64 + 2.3 * row as f64).cos() + if mode == 20 + row { 60.0 } else { 0.0 }
    };
    let diagonal = |n: usize| DMatrix::from_fn(modes, modes, |i, j| if i == j { square(i, n) } else { 0.0 });
    rom.mass = DMatrix::identity(modes, modes);
    rom.stiffness = diagonal(0);
    rom.contact_map = DMatrix::from_fn(9, modes, shape);
    rom.extras.harmonics = (1..=WHEEL_SECTORS / 2)
        .map(|n| Harmonic {
            mass: DMatrix::identity(modes, modes),
            stiffness: diagonal(n).map(|value| Complex::new(value, 0.0)),
            contact_map: DMatrix::from_fn(9, modes, |row, mode| {
                let turn = if 2 * n == WHEEL_SECTORS { 0.0 } else { 0.02 * (n * (1 + mode % 3)) as f64 };
                Complex::new(shape(row, mode) * turn.cos(), shape(row, mode) * turn.sin())
            }),
        })
        .collect();
    scene
}

/// Time of the paper's prediction with its two matrices multiplied out beforehand (s).
fn dense(order: usize) -> f64 {
    let matrices = [0.5, -0.25].map(|value| DMatrix::from_fn(order, order, |i, j| value / (1.0 + (i + j) as f64)));
    let (mut now, mut before) = (DVector::from_element(order, 1e-6), DVector::from_element(order, 1e-6));
    let mut next = now.clone();
    fastest(101, 1, || {
        next.gemv(1.0, &matrices[0], &now, 0.0);
        next.gemv(1.0, &matrices[1], &before, 1.0);
        std::mem::swap(&mut before, &mut now);
        std::mem::swap(&mut now, &mut next);
    })
}

fn table(title: &str, order: usize, rows: Vec<(&str, Scene)>) {
    let dense = dense(order);
    println!("{title}; times per internal step");
    println!("{:<40} {:>12} {:>10} {:>16}", "", "time (µs)", "contacts", "dense / this");
    println!("{:<40} {:>12.2} {:>10} {:>16.1}", "two dense products (eq. 9), no contact", dense * 1e6, "-", 1.0);
    // `cargo bench --bench step -- heavy` selects the rows with this word.
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    for (name, scene) in rows.into_iter().filter(|(name, _)| words.iter().all(|word| name.contains(word.as_str()))) {
        let (time, contacts) = stepping(&scene);
        println!("{name:<40} {:>12.3} {contacts:>10.1} {:>16.0}", time * 1e6, dense / time);
    }
}

fn main() {
    let bump = |depth| Shape::TwoLobe { depth, width: 0.15, phase: 0.0 };
    let with = |change: fn(&mut Scene)| {
        let mut scene = scene(bump(0.6), true);
        change(&mut scene);
        scene
    };
    let rows = [
        ("round casing, no contact, no ledger", scene(Shape::Circular {}, false)),
        ("round casing, no contact", scene(Shape::Circular {}, true)),
        ("two lobes, no contact", scene(bump(0.3), true)),
        ("two lobes, light rub", scene(bump(0.6), true)),
        ("two lobes, heavy rub", scene(bump(1.0), true)),
        ("light rub, coulomb", with(|scene| scene.settings.contacts[0].solver = Solver::Coulomb)),
        ("light rub, mistuned", with(|scene| scene.settings.structures[0].frequency_factors = vec![1.0; SECTORS])),
        ("light rub, whirl", with(|scene| scene.settings.structures[0].whirl = true)),
        (
            "light rub, surface spline",
            with(|scene| scene.settings.surfaces[0].spline = Some(SplineSettings::default())),
        ),
        ("light rub, coating", with(coated)),
        ("light rub, casing of 135 modes, 36 x 3 grid", with(flexible)),
    ];
    // An argument selects rows whose names contain it.
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    let chosen = |rows: Vec<(&'static str, Scene)>| -> Vec<(&str, Scene)> {
        rows.into_iter().filter(|(name, _)| name.contains(&wanted)).collect()
    };
    let title = format!("{SECTORS} blades x {MODES} modes, {} contact nodes", 3 * SECTORS);
    table(&title, SECTORS * MODES, chosen(rows.into()));
    let disks = vec![
        ("coupled sectors, no contact", disk(0.3)),
        ("coupled sectors, light rub", disk(LIGHT)),
        ("coupled sectors, heavy rub", disk(HEAVY)),
    ];
    let title = format!(
        "{WHEEL_SECTORS} coupled sectors x {WHEEL_MODES} modes per nodal diameter, {} contact nodes",
        3 * WHEEL_SECTORS
    );
    table(&title, WHEEL_SECTORS * WHEEL_MODES, chosen(disks));
}
