//! Time of one internal step of a whole disk, beside the same system stepped with dense matrices in the same run.
//!
//! `cargo bench -p tiprub-core` prints one table. Each row is the median of repeated batches; ratios are what counts,
//! absolute times depend on the machine. The baseline "two dense products" is the paper's prediction (eq. 9) with
//! its two matrices multiplied out beforehand, in the reduced coordinates of all blades. An argument after `--` selects
//! rows by a part of their name.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::Instant;

use nalgebra::{DMatrix, DVector};
use tiprub_core::rom::{ContactNode, Frame, Rom, RomChecks};
use tiprub_core::settings::{
    CoatingSettings, ContactSettings, ExperimentSettings, Meridian, Motion, OutputSettings, SceneSettings, Scheme,
    Shape, Solver, SplineSettings, StructureSettings, SurfaceSettings, TimeSettings,
};
use tiprub_core::{Scene, Simulation};

const SECTORS: usize = 36;
const MODES: usize = 29;

/// Frequencies (Hz) of a reduced rotor 37 blade: 20 fixed-interface modes and 3 contact nodes.
const FREQUENCIES: [f64; MODES] = [
    865.0, 2465.0, 3132.0, 4714.0, 5785.0, 6533.0, 8109.0, 8430.0, 9532.0, 9929.0, 10958.0, 12515.0, 13653.0, 14223.0,
    15444.0, 16995.0, 17626.0, 17941.0, 19450.0, 21335.0, 28238.0, 30173.0, 36090.0, 42060.0, 44025.0, 106206.0,
    137090.0, 168414.0, 184699.0,
];

fn scene(shape: Shape, energies: bool) -> Scene {
    let stiffness = FREQUENCIES.map(|frequency: f64| (std::f64::consts::TAU * frequency).powi(2));
    let rom = Rom {
        name: "blade".into(),
        origin: "frequencies of rotor 37, synthetic shapes".into(),
        sectors: SECTORS,
        frame: Frame::Cylindrical,
        mass: DMatrix::identity(MODES, MODES),
        stiffness: DMatrix::from_diagonal(&DVector::from_row_slice(&stiffness)),
        damping_ratio: 0.005,
        contact_map: DMatrix::from_fn(9, MODES, |row, mode| {
            let size = if row % 3 == 1 { 4.0 } else { 1.5 };
            size * (1.7 * mode as f64 + 2.3 * row as f64).cos() + if mode == 20 + row { 60.0 } else { 0.0 }
        }),
        contact_nodes: (0..3_u8)
            .map(|index| ContactNode {
                name: format!("node_{index}"),
                position: [0.25, 0.1 - 0.1 * f64::from(index), 0.01 * f64::from(index)],
                meridional_slope: -0.25,
            })
            .collect(),
        checks: RomChecks::default(),
        extras: tiprub_core::rom::RomExtras::default(),
    };
    let settings = SceneSettings {
        name: "bench".into(),
        description: String::new(),
        structures: vec![StructureSettings {
            name: "rotor".into(),
            rom: "blade".into(),
            motion: Motion::Rotating,
            speed: 1300.0,
            damping_ratio: None,
            ..StructureSettings::default()
        }],
        surfaces: vec![SurfaceSettings {
            name: "casing".into(),
            shape,
            ramp_time: 2e-3,
            moving: false,
            ..SurfaceSettings::default()
        }],
        contacts: vec![ContactSettings {
            master: "rotor".into(),
            slave: "casing".into(),
            gap: 3.56e-4,
            sector_gaps: vec![],
            friction: 0.15,
            solver: Solver::Lcp,
            meridian: Meridian::Contour,
            ..ContactSettings::default()
        }],
        time: TimeSettings { scheme: Scheme::ModalExact, step: 1e-6 },
        outputs: OutputSettings { energies, ..OutputSettings::default() },
        experiment: ExperimentSettings { start: 0.0, stop: 1.0, communication_step: 1e-4 },
    };
    Scene { settings, roms: vec![rom] }
}

fn coated(scene: &mut Scene) {
    scene.settings.contacts[0].coating = Some(CoatingSettings {
        thickness: 3e-4,
        modulus: 2e9,
        yield_stress: 5e6,
        hardening: 2e8,
        cells_around: 1000,
        cells_along: 20,
    });
}

fn flexible(scene: &mut Scene) {
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring".into(),
        motion: Motion::Still,
        ..StructureSettings::default()
    });
    scene.roms.push(common::casing_of(36, 3, 34));
    scene.settings.surfaces[0].structure = Some("ring".into());
}

/// Median time per call (s) of `batches` batches of `calls` calls.
fn median(batches: usize, calls: u32, mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..batches)
        .map(|_| {
            let start = Instant::now();
            (0..calls).for_each(|_| work());
            start.elapsed().as_secs_f64() / f64::from(calls)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Median time of an internal step (s) and the mean number of active contacts.
fn stepping(scene: &Scene) -> (f64, f64) {
    let mut simulation = Simulation::new(scene).expect("a valid scene");
    simulation.initialise(0.0).expect("a stable scene");
    for _ in 0..100 {
        simulation.do_step(simulation.time(), 1e-4).expect("a step");
    }
    let (mut contacts, mut samples) = (0, 0);
    let time = median(41, 20, || {
        simulation.do_step(simulation.time(), 1e-4).expect("a step");
        contacts += simulation.system().events().len();
        samples += 1;
    });
    (time / 100.0, contacts as f64 / f64::from(samples))
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
    let order = SECTORS * MODES;
    let matrices = [0.5, -0.25].map(|value| DMatrix::from_fn(order, order, |i, j| value / (1.0 + (i + j) as f64)));
    let (mut now, mut before) = (DVector::from_element(order, 1e-6), DVector::from_element(order, 1e-6));
    let mut next = now.clone();
    let dense = median(11, 20, || {
        next.gemv(1.0, &matrices[0], &now, 0.0);
        next.gemv(1.0, &matrices[1], &before, 1.0);
        std::mem::swap(&mut before, &mut now);
        std::mem::swap(&mut now, &mut next);
    });
    println!("{SECTORS} blades x {MODES} modes, {} contact nodes; times per internal step", 3 * SECTORS);
    println!("{:<40} {:>12} {:>10} {:>16}", "", "time (µs)", "contacts", "dense / this");
    println!("{:<40} {:>12.2} {:>10} {:>16.1}", "two dense products (eq. 9), no contact", dense * 1e6, "-", 1.0);
    // Part of a row's name as argument: only such rows.
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    for (name, scene) in rows.into_iter().filter(|(name, _)| name.contains(&wanted)) {
        let (time, contacts) = stepping(&scene);
        println!("{name:<40} {:>12.3} {contacts:>10.1} {:>16.0}", time * 1e6, dense / time);
    }
}
