//! Continuous Galerkin in time on whole scenes: against massless-boundary with ever shorter steps, within its
//! tolerance, with a closed energy balance, with all supported features.

mod bank;
mod close_nodes;
#[path = "../common/counting.rs"]
mod counting;
mod extremes;
#[path = "../../../../tests/guide.rs"]
mod guide;
mod off_centre;
mod penetration;
mod steady_phase;
mod sticking;
mod threads;
mod two_numbers;

use counting::allocations_of;
use guide::print_row;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{LoadSettings, OutputSettings, Shape, SplineSettings, TimeSettings};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::disk::TestDisk;
use tiprub_test_models::{
    bits, blade, bumps, element, flexible, go, real, rich_blade, saved, set, several, started, try_started,
};

const SECTORS: usize = 4;
const NODES: u32 = 3;
/// Communication step (s).
const H: f64 = 4e-5;
const STEPS: u32 = 150;

fn scene_time() -> TimeSettings {
    TimeSettings { scheme: Scheme::Galerkin, step: H, ..TimeSettings::default() }
}

fn scene(scheme: Scheme, step: f64, tolerance: f64) -> Scene {
    let mut scene = bumps(rich_blade(SECTORS));
    scene.settings.time = TimeSettings { scheme, step, tolerance: Some(tolerance), ..scene_time() };
    scene.settings.outputs = OutputSettings {
        watched_sectors: (1..=SECTORS).collect(),
        all_sectors: true,
        energies: true,
        instantaneous_forces: true,
        ..OutputSettings::default()
    };
    scene
}

/// Results of a run.
struct GalerkinRun {
    /// Displacements of all contact rows at communication points (m).
    displacements: Vec<f64>,
    impulse: f64,
    /// Work of the shaft as torque times angle (J).
    by_torque: f64,
    shaft: f64,
    residual: f64,
    lowest: f64,
    /// Number of steps per blade.
    steps: u64,
}

fn run(scene: &Scene, drive: impl Fn(&mut Simulation, f64)) -> GalerkinRun {
    let mut simulation = started(scene);
    let (mut impulse, mut by_torque, mut lowest) = (0.0, 0.0, f64::INFINITY);
    let mut displacements = Vec::new();
    for n in 0..STEPS {
        drive(&mut simulation, f64::from(n) * H);
        go(&mut simulation, H);
        let bank = simulation.system().bank();
        for row in 0..bank.rows() {
            displacements.extend_from_slice(&bank.displacement()[row * bank.lanes()..][..SECTORS]);
        }
        for sector in 1..=SECTORS {
            let force = |node: u32| element(&simulation, &format!("blade[{sector}].normal_force"), node);
            impulse += H * (0..NODES).map(force).sum::<f64>();
        }
        by_torque -= H * real(&simulation, "torque") * real(&simulation, "speed");
        lowest = lowest.min(real(&simulation, "clearance_minimum"));
    }
    let ledger = simulation.system().ledger();
    let (kinetic, strain) = simulation.system().energies();
    let steps = simulation.system().effort().steps / SECTORS as u64;
    let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
    GalerkinRun { displacements, impulse, by_torque, shaft: ledger.shaft_work.value(), residual, lowest, steps }
}

fn still(_: &mut Simulation, _: f64) {}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())
}

#[test]
fn massless_boundary_converges_to_galerkin_within_tolerance() {
    let exact = run(&scene(Scheme::Galerkin, H, 1e-7), still);
    assert!(exact.residual < 1e-13 && exact.lowest > -1e-9, "{:e}, {:e}", exact.residual, exact.lowest);
    // The longest step has no influence, even with a ramped shape.
    let shorter = run(&scene(Scheme::Galerkin, 0.25 * H, 1e-7), still);
    let distance = apart(&shorter.displacements, &exact.displacements);
    assert!(distance < 1e-6, "{distance:e}");
    let other = |step: f64| run(&scene(Scheme::MasslessBoundary, step, 1e-3), still);
    let (coarse, fine) = (other(1e-7), other(5e-8));
    let (first, second) = (exact.impulse - coarse.impulse, exact.impulse - fine.impulse);
    let distance = apart(&fine.displacements, &exact.displacements);
    print_row!("massless-boundary, h = 0.05 us: {distance:.1e}, impulse {:.1e}", second / exact.impulse);
    assert!(distance < 1e-5);
    // First order in h, towards the same limit.
    assert!((first / second - 2.0).abs() < 0.1 && (second / exact.impulse).abs() < 1e-4, "{first:e} {second:e}");
    for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
        let found = run(&scene(Scheme::Galerkin, H, tolerance), still);
        let error = apart(&found.displacements, &exact.displacements);
        print_row!("tolerance {tolerance:.0e}: {error:.1e}, steps per blade {}", found.steps);
        assert!(error < tolerance && found.residual < 1e-13);
    }
    guide::hold("cargo test -p tiprub-core --test galerkin");
}

/// A change of the scene for each feature that the scheme supports.
type Combination = fn(&mut Scene);

type CombinedFeature = (&'static str, f64, Combination, fn(&mut Simulation, f64));

const FEATURES: [CombinedFeature; 8] = [
    ("flexible casing", 1e-3, flexible, still),
    (
        "flexible casing under a load that turns",
        1e-3,
        |scene| {
            flexible(scene);
            scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 1e3, phase: 0.2 });
        },
        |simulation, time| {
            set(simulation, "casing_load_amplitude", 1e3 * (1.0 + (900.0 * time).sin()));
            set(simulation, "casing_load_phase", 0.2 + 200.0 * time);
        },
    ),
    ("lobes", 1e-4, |scene| scene.settings.contacts[0].friction = 0.0, still),
    ("mistuned", 1e-4, |scene| scene.settings.structures[0].frequency_factors = vec![1.0, 0.97, 1.03, 1.01], still),
    (
        "casing that moves",
        1e-4,
        |_| (),
        |simulation, time| {
            set(simulation, "casing_radius_change", 1e-4 * (900.0 * time).sin());
            set(simulation, "casing_shape_factor", 1.0 + 0.3 * (1500.0 * time).sin());
        },
    ),
    ("shape that turns", 1e-4, |_| (), |simulation, time| set(simulation, "casing_shape_rotation", 300.0 * time)),
    (
        "whirl and shift",
        1e-4,
        |scene| {
            scene.settings.structures[0].whirl = true;
            scene.settings.structures[0].axial_shift = true;
        },
        |simulation, time| {
            let (sine, cosine) = (1300.0 * time).sin_cos();
            set(simulation, "whirl_x", 8e-5 * cosine - 8e-5);
            set(simulation, "whirl_y", 8e-5 * sine);
            set(simulation, "axial_shift", 1e-4 * (500.0 * time).sin());
        },
    ),
    (
        "spline",
        1e-3,
        |scene| {
            scene.settings.surfaces[0].spline =
                Some(SplineSettings { around: 48, along: 4, ..SplineSettings::default() })
        },
        still,
    ),
];

#[test]
fn every_combination_agrees_with_massless_boundary() {
    for (name, distance_allowed, change, drive) in FEATURES {
        let of = |scheme: Scheme, step: f64, tolerance: f64| {
            let mut scene = scene(scheme, step, tolerance);
            change(&mut scene);
            run(&scene, drive)
        };
        let exact = of(Scheme::Galerkin, H, 1e-6);
        let other = of(Scheme::MasslessBoundary, 1e-7, 1e-3);
        let loose = of(Scheme::Galerkin, H, 1e-3);
        let (distance, error) =
            (apart(&other.displacements, &exact.displacements), apart(&loose.displacements, &exact.displacements));
        let torque = (exact.by_torque / exact.shaft - 1.0).abs();
        println!(
            "{name}: massless-boundary {distance:.1e}, tolerance 1e-3 {error:.1e}, residual {:.0e}, torque {torque:.0e}, lowest {:.0e}, impulse {:.2}",
            exact.residual, exact.lowest, exact.impulse
        );
        assert!(exact.impulse > 1.0 && exact.residual < 1e-12 && distance < distance_allowed && error < 3e-3, "{name}");
        assert!(torque < 1e-9 && exact.lowest > -1e-8, "{name}");
    }
}

/// Coupled sectors step together, by nodal diameters; the equivalent single structure is one sector that steps alone.
#[test]
fn coupled_sectors_match_the_disk_as_one_structure() {
    for (sectors, nodes, friction) in [(5, 2, 0.0), (6, 1, 0.15)] {
        let disk = TestDisk::random(sectors, nodes, 3 * nodes + 5, 0.25, 3);
        let of = |rom: Rom, tolerance: f64| {
            let mut scene = bumps(rom);
            scene.settings.contacts[0].friction = friction;
            disk_displacements(scene, tolerance)
        };
        let exact = of(disk.whole(), 1e-7);
        for tolerance in [1e-3, 1e-5, 1e-7] {
            let [together, alone] = [disk.cyclic(), disk.whole()].map(|rom| apart(&of(rom, tolerance), &exact));
            println!("{sectors} sectors, tolerance {tolerance:e}: {together:.1e}, as one structure {alone:.1e}");
            assert!(together < 6.0 * tolerance.max(1e-6), "{sectors} sectors, {tolerance:e}: {together:e}");
        }
    }
}

/// Returns the displacements of all contact rows of a disk, sector by sector, at communication points (m).
fn disk_displacements(mut scene: Scene, tolerance: f64) -> Vec<f64> {
    scene.settings.time = TimeSettings { tolerance: Some(tolerance), ..scene_time() };
    scene.settings.outputs.energies = true;
    let mut simulation = started(&scene);
    let mut displacements = Vec::new();
    for _ in 0..60 {
        go(&mut simulation, H);
        let bank = simulation.system().bank();
        // Of sectors, or of a single structure with the nodes of all sectors in sequence.
        for sector in 0..bank.sectors() {
            displacements.extend((0..bank.rows()).map(|row| bank.row(row, sector)));
        }
    }
    let ledger = simulation.system().ledger();
    let (kinetic, strain) = simulation.system().energies();
    let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
    assert!(residual < 1e-12 && ledger.turnover.value() > 0.0, "{residual:e}");
    displacements
}

/// With a very loose tolerance the energy balance still closes, and the energy does not exceed the energy supplied.
#[test]
fn elastic_casing_with_blades_at_rest_gains_no_energy() {
    let mut scene = scene(Scheme::Galerkin, H, 0.1);
    flexible(&mut scene);
    scene.settings.contacts[0].friction = 0.0;
    (scene.settings.structures[0].speed, scene.settings.structures[0].damping_ratio) = (0.0, Some(0.0));
    scene.settings.structures[1].damping_ratio = Some(0.0);
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.2, width: 0.15, phase: 0.0 };
    let mut simulation = started(&scene);
    let mut most = 0.0_f64;
    for _ in 0..300 {
        go(&mut simulation, H);
        let of = |name: &str| real(&simulation, name);
        let energy = of("kinetic_energy") + of("strain_energy");
        most = most.max(energy);
        assert!(of("energy_residual_relative").abs() < 1e-12, "{:e}", of("energy_residual_relative"));
        let given = of("external_work") + of("curvature_work");
        assert!(of("impact_loss") >= -1e-12 * most && energy <= given + 1e-12 * most, "{energy:e} {given:e}");
    }
    assert!(most > 0.1, "{most}");
}

/// Covers slip that is small compared with the vibration of casings and blades, and gaps that are close to rounding.
#[test]
fn converges_for_slow_rotors_and_small_tolerances() {
    for (speed, tolerance, carried) in
        [(0.0, 1e-4, true), (30.0, 1e-4, true), (1300.0, 1e-9, true), (1300.0, 1e-9, false)]
    {
        let mut scene = scene(Scheme::Galerkin, H, tolerance);
        if carried {
            flexible(&mut scene);
        } else {
            scene.settings.surfaces[0].spline = Some(SplineSettings::default());
        }
        scene.settings.structures[0].speed = speed;
        // Tips that vibrate faster than they slide end a run with sliding friction.
        if speed < 100.0 {
            scene.settings.contacts[0].friction = 0.0;
        }
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.9, width: 0.15, phase: 0.0 };
        scene.settings.surfaces[0].ramp_time = 2e-4;
        let mut simulation = started(&scene);
        (0..20).for_each(|_| go(&mut simulation, H));
        assert!(simulation.system().ledger().turnover.value() > 1e-6, "{speed} {tolerance:e} {carried}");
    }
}

#[test]
fn coupled_sectors_respect_the_step_count_limit() {
    let mut scene = scene(Scheme::Galerkin, H, 1e-4);
    flexible(&mut scene);
    for most in [1, 3, 4, 7, 90] {
        let mut simulation = started(&scene);
        bound(&mut simulation, most).unwrap();
        let mut done = 0;
        for _ in 0..40 {
            let before = simulation.system().steps_tried();
            let time = simulation.time();
            if simulation.do_step(time, H).is_err() {
                break;
            }
            done += 1;
            assert!(simulation.system().steps_tried() - before <= u64::try_from(most).unwrap());
        }
        assert_eq!(done > 0, most >= 4, "{most}");
    }
}

#[test]
fn rejects_unsupported_scenes_by_name() {
    let cases: [(&str, Combination); 3] = [
        ("coating", tiprub_test_models::coating),
        ("more than three modes", |scene| scene.roms[0] = blade(SECTORS)),
        ("clearance above 0", |scene| scene.settings.contacts[0].gap = 0.0),
    ];
    for (words, change) in cases {
        let mut scene = scene(Scheme::Galerkin, H, 1e-3);
        change(&mut scene);
        let message = try_started(&scene).unwrap_err().to_string();
        assert!(message.contains("scheme") && message.contains("galerkin") && message.contains(words), "{message}");
    }
}

#[test]
fn saved_state_continues_with_equal_bits_without_allocation() {
    let alone = scene(Scheme::Galerkin, H, 1e-4);
    let (mut carried, mut coupled) = (alone.clone(), alone.clone());
    flexible(&mut carried);
    coupled.roms[0] = TestDisk::random(SECTORS, 1, 9, 0.25, 3).cyclic();
    [alone, carried, coupled].iter().for_each(goes_on_with_the_same_bits);
}

fn goes_on_with_the_same_bits(scene: &Scene) {
    let mut simulation = started(scene);
    (0..60).for_each(|_| go(&mut simulation, H));
    let state = saved(&simulation);
    let lengths = [H, 0.5 * H, 3.3 * H, H, 1.7e-6, H];
    let go_on = |simulation: &mut Simulation| lengths.iter().for_each(|length| go(simulation, *length));
    let count = allocations_of(|| go_on(&mut simulation));
    assert_eq!(count, 0);
    let expected = bits(&simulation);
    assert!(simulation.system().ledger().friction_loss.value() > 1.0);
    let mut other = started(scene);
    other.restore_state(&state).unwrap();
    go_on(&mut other);
    assert_eq!(bits(&other), expected);
    simulation.restore_state(&state).unwrap();
    go_on(&mut simulation);
    assert_eq!(bits(&simulation), expected);
    // Also between two spans of one communication step.
    simulation.begin_partial_step(simulation.time(), 3.0 * H).unwrap();
    simulation.advance().unwrap();
    let between = saved(&simulation);
    while !simulation.advance().unwrap().finished {}
    let expected = bits(&simulation);
    other.restore_state(&between).unwrap();
    while !other.advance().unwrap().finished {}
    assert_eq!(bits(&other), expected);
}

/// A blade far from any surface takes no step, without any gap evaluation.
#[test]
fn distant_blades_take_no_step() {
    let mut scene = scene(Scheme::Galerkin, H, 1e-3);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.surfaces[0].ramp_time = 0.0;
    let mut simulation = started(&scene);
    for _ in 0..50 {
        go(&mut simulation, H);
        let least = least_clearance(&simulation);
        let lowest = real(&simulation, "clearance_minimum");
        assert!(lowest <= least && lowest > 0.9 * least, "{lowest:e} m, {least:e} m at the end");
    }
    let effort = *simulation.system().effort();
    assert_eq!(effort, tiprub_core::system::Effort::default());
}

#[test]
fn damping_follows_the_parameter() {
    let of = |ratio: f64, by_importer: bool| {
        let mut scene = scene(Scheme::Galerkin, H, 1e-4);
        scene.settings.structures[0].damping_ratio = Some(if by_importer { 0.001 } else { ratio });
        let mut simulation = Simulation::new(&scene).unwrap();
        if by_importer {
            set(&mut simulation, "damping_ratio", ratio);
        }
        simulation.initialise(0.0).unwrap();
        (0..60).for_each(|_| go(&mut simulation, H));
        let loss = real(&simulation, "damping_loss");
        let state = saved(&simulation);
        // A state includes its damping.
        let mut other = Simulation::new(&scene).unwrap();
        other.restore_state(&state).unwrap();
        [&mut simulation, &mut other].into_iter().for_each(|one| (0..20).for_each(|_| go(one, H)));
        assert_eq!(bits(&simulation), bits(&other));
        loss
    };
    assert_eq!(of(0.05, true).to_bits(), of(0.05, false).to_bits());
    assert!(of(0.05, true) > 2.0 * of(0.001, true));
}

#[test]
fn missed_tolerance_is_counted_and_warned_of_once() {
    let run = |tolerance: f64| {
        let mut simulation = started(&scene(Scheme::Galerkin, 8e-5, tolerance));
        let notes: Vec<tiprub_core::Warning> = (0..40)
            .flat_map(|_| {
                go(&mut simulation, 8e-5);
                simulation.take_notes()
            })
            .collect();
        let counts = ["internal_steps", "internal_trials", "internal_steps_max", "missed_steps"];
        let of_start = simulation.warnings().iter().filter(|text| text.contains("cannot be reached")).count();
        (counts.map(|name| real(&simulation, name)), notes, (*simulation.system().effort(), of_start))
    };
    let ([steps, trials, most, missed], notes, (effort, reported)) = run(1e-3);
    assert!(missed == 0.0 && notes.is_empty() && reported == 0, "{notes:?}");
    let sectors = 4.0;
    assert!(steps >= 40.0 * sectors && trials > steps && most >= trials / 40.0 && most < trials, "{effort:?}");
    let ([_, _, _, missed], notes, (effort, reported)) = run(1e-9);
    assert!(
        reported == 1 && missed > 0.0 && (effort.missed as f64).to_bits() == missed.to_bits() && notes.len() == 1,
        "{effort:?} {notes:?}"
    );
    assert!(
        ["missed the tolerance of 1e-9", "1.953125e-8 s", "time.step", "larger tolerance"]
            .iter()
            .all(|words| notes[0].contains(words)),
        "{}",
        notes[0]
    );
}

fn bound(simulation: &mut Simulation, most: i32) -> tiprub_core::Result<()> {
    let reference = simulation.table().find("max_internal_steps").unwrap().reference;
    simulation.set_integer(reference, most)
}

/// Returns everything that can be read, and everything that is saved.
fn everything(simulation: &Simulation) -> (Vec<u64>, Vec<u8>) {
    (bits(simulation), saved(simulation))
}

#[test]
fn discarded_step_changes_nothing() {
    let scene = scene(Scheme::Galerkin, H, 1e-4);
    let [mut free, mut bounded] = [2_000_000, 1_000_000].map(|most| {
        let mut simulation = started(&scene);
        bound(&mut simulation, most).unwrap();
        simulation
    });
    let mut most = 0;
    for _ in 0..60 {
        let before = free.system().steps_tried();
        go(&mut free, H);
        go(&mut bounded, H);
        most = most.max(free.system().steps_tried() - before);
        assert_eq!(real(&free, "internal_steps_max").to_bits(), (most as f64).to_bits());
    }
    assert!(most > 20, "{most}");
    // The next three spans in one communication step, with changing inputs.
    let length = 3.0 * H;
    for simulation in [&mut free, &mut bounded] {
        set(simulation, "speed", 1.01 * real(simulation, "speed"));
    }
    let before = free.system().steps_tried();
    let here = saved(&free);
    go(&mut free, length);
    let (expected, needed) = (bits(&free), free.system().steps_tried() - before);
    for allowed in [1, needed / 2, needed - 1] {
        bound(&mut bounded, i32::try_from(allowed).unwrap()).unwrap();
        let state = everything(&bounded);
        let mut message = String::new();
        let count = allocations_of(|| {
            let error = bounded.do_step(bounded.time(), length).unwrap_err();
            assert!(matches!(error, tiprub_core::Error::Exhausted(_)));
            message = error.to_string();
        });
        assert!(count < 30, "only the message: {count}");
        assert!(
            message.contains(&format!("max_internal_steps = {allowed}"))
                && message.contains("was discarded")
                && message.contains("shorter communication step"),
            "{message}"
        );
        assert_eq!(everything(&bounded), state, "{allowed}");
    }
    // A shorter step, withdrawn by restoring a state, and the same step with enough internal steps give the same bits.
    bound(&mut bounded, i32::try_from(needed).unwrap()).unwrap();
    let state = saved(&bounded);
    go(&mut bounded, 0.25 * H);
    bounded.restore_state(&state).unwrap();
    assert_eq!(allocations_of(|| go(&mut bounded, length)), 0);
    assert_eq!(bits(&bounded), expected);
    free.restore_state(&here).unwrap();
    // A step that may end early ends at the end of the last span.
    bound(&mut free, i32::try_from(needed - 1).unwrap()).unwrap();
    free.begin_partial_step(free.time(), length).unwrap();
    let mut done = 0;
    let error = loop {
        match free.advance() {
            Ok(_) => done += 1,
            Err(error) => break error,
        }
    };
    assert!(
        matches!(error, tiprub_core::Error::Exhausted(_)) && free.is_stepping() && (1..3).contains(&done),
        "{done}"
    );
    let start = free.time();
    free.end_step_early().unwrap();
    assert!((free.time() - start - f64::from(done) * H).abs() < 1e-12);
    bound(&mut free, 0).unwrap();
    go(&mut free, length);
}

#[test]
fn schemes_respect_the_step_limit_and_reject_invalid_ones() {
    for scheme in [Scheme::ModalExact, Scheme::MasslessBoundary, Scheme::CentralDifference] {
        let mut scene = scene(scheme, 1e-7, 1e-3);
        scene.settings.time.max_internal_steps = Some(400);
        let (mut simulation, mut other) = (started(&scene), started(&scene));
        let state = everything(&simulation);
        let error = simulation.do_step(0.0, 401e-7).unwrap_err();
        assert!(
            matches!(error, tiprub_core::Error::Exhausted(_)) && error.to_string().contains("internal_step_max"),
            "{error}"
        );
        assert_eq!(everything(&simulation), state);
        for one in [&mut simulation, &mut other] {
            go(one, 400e-7);
        }
        assert_eq!(bits(&simulation), bits(&other));
        assert_eq!(real(&simulation, "internal_steps_max").to_bits(), 400.0_f64.to_bits());
        // A step that may end early takes as many internal steps as are allowed.
        simulation.begin_partial_step(simulation.time(), 1000e-7).unwrap();
        while simulation.advance().is_ok() {}
        simulation.end_step_early().unwrap();
        assert!((simulation.time() - 800e-7).abs() < 1e-15, "{}", simulation.time());
        // A limit set during a step applies from the next step on.
        bound(&mut other, 0).unwrap();
        other.begin_step(other.time(), 1000e-7).unwrap();
        bound(&mut other, 1).unwrap();
        while !other.advance().unwrap().finished {}
        assert!(other.do_step(other.time(), 2e-7).is_err());
        go(&mut other, 1e-7);
        for (value, words) in
            [(-1, "outside the range 0"), (i32::MIN, "outside the range 0"), (i32::MAX, "outside the range 0")]
        {
            let message = bound(&mut other, value).unwrap_err().to_string();
            assert!(message.contains("max_internal_steps") && message.contains(words), "{message}");
        }
        bound(&mut other, 1_000_000_000).unwrap();
        go(&mut other, 1000e-7);
    }
    let mut wrong = scene(Scheme::Galerkin, H, 1e-3);
    wrong.settings.time.max_internal_steps = Some(u32::MAX);
    assert!(try_started(&wrong).unwrap_err().to_string().contains("time.max_internal_steps"));
}

/// A casing that closes and opens in the middle of long communication steps, against spans of the longest step.
#[test]
fn distant_bodies_take_no_steps() {
    let mut scene = scene(Scheme::Galerkin, 8e-5, 1e-3);
    scene.settings.structures[0].damping_ratio = Some(0.05);
    scene.settings.surfaces[0].ramp_time = 0.0;
    let long = 0.05;
    let lengths = |count: usize| std::iter::repeat_n(long / count as f64, count);
    let run = |parts: usize| {
        // Wide at first; later the lobes rub.
        let mut simulation = Simulation::new(&scene).unwrap();
        set(&mut simulation, "casing_radius_change", 5e-4);
        simulation.initialise(0.0).unwrap();
        let (mut outputs, mut flown) = (Vec::new(), Vec::new());
        for step in 0..8 {
            let radius = if step == 3 { 0.0 } else { 5e-4 };
            let before = *simulation.system().effort();
            let mut lowest = f64::INFINITY;
            let start = real(&simulation, "casing_radius_change");
            for (part, length) in lengths(parts).enumerate() {
                let share = (part + 1) as f64 / parts as f64;
                set(&mut simulation, "casing_radius_change", start + share * (radius - start));
                go(&mut simulation, length);
                lowest = lowest.min(real(&simulation, "clearance_minimum"));
            }
            let effort = *simulation.system().effort();
            flown.push((effort.steps - before.steps, effort.trials - before.trials));
            outputs.push([lowest, real(&simulation, "friction_loss"), real(&simulation, "blade[1].clearance")]);
        }
        let ledger = simulation.system().ledger();
        let (kinetic, strain) = simulation.system().energies();
        (outputs, flown, ledger.residual(kinetic + strain).abs() / ledger.scale())
    };
    let (long, flown, residual) = run(1);
    let (short, marched, _) = run(625);
    println!("{long:?}\n{short:?}\n{flown:?}\n{marched:?} {residual:e}");
    assert!(flown[0] == (0, 0) && marched[0] == (0, 0) && flown[1] == (0, 0), "{flown:?}");
    assert!(flown[3].0 > 2000 && flown[3].1 > 300 && residual < 1e-12, "{flown:?} {residual:e}");
    assert!(flown[7] == (0, 0) && marched[7] == (0, 0), "at rest again: {flown:?}");
    for (long, short) in long.iter().zip(&short) {
        // The smallest clearance, where spans end every 80 µs, within the tolerance of either.
        assert!(long[0] <= short[0] + 4e-7 && long[0] > short[0] - 3e-6, "{long:?} {short:?}");
        assert!(
            (long[1] - short[1]).abs() <= 5e-2 * short[1].abs() && (long[2] - short[2]).abs() < 4e-6,
            "{long:?} {short:?}"
        );
    }
}

/// Returns the smallest current clearance of all watched nodes (m).
fn least_clearance(simulation: &Simulation) -> f64 {
    let of = |sector: usize, node: u32| element(simulation, &format!("blade[{sector}].clearance"), node);
    (1..=SECTORS).flat_map(|sector| (0..NODES).map(move |node| of(sector, node))).fold(f64::INFINITY, f64::min)
}

/// A casing that closes on resting blades from far away within one span must not be mistaken for free flight.
#[test]
fn detects_casing_that_closes_within_one_span() {
    let mut scene = scene(Scheme::Galerkin, H, 1e-3);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.surfaces[0].ramp_time = 0.0;
    let (mut simulation, mut impulse) = (started(&scene), 0.0);
    for n in 0..10 {
        set(&mut simulation, "casing_radius_change", if n < 5 { 0.0 } else { -4.2e-4 });
        go(&mut simulation, H);
        let least = least_clearance(&simulation);
        assert!(least > -1e-8, "span {n}: {least:e} m");
        impulse += real(&simulation, "normal_impulse");
    }
    assert!(impulse > 0.0);
}

/// Peaks and means over a span agree with those of a thousand short steps.
#[test]
fn span_outputs_match_many_short_steps() {
    let of = |scheme: Scheme, step: f64| {
        let mut simulation = started(&scene(scheme, step, 1e-5));
        let (mut peaks, mut sliding) = (0.0, 0.0);
        for _ in 0..STEPS {
            go(&mut simulation, H);
            peaks += real(&simulation, "normal_force_peak");
            for sector in 1..=SECTORS {
                for node in 0..NODES {
                    let force = |name: &str| element(&simulation, &format!("blade[{sector}].{name}"), node);
                    let (normal, tangential) = (force("normal_force"), force("tangential_force"));
                    assert!((tangential - 0.15 * normal).abs() <= 1e-6 * normal, "{tangential} of {normal} N");
                    sliding += tangential;
                }
            }
            let (least, lowest) = (least_clearance(&simulation), real(&simulation, "clearance_minimum"));
            assert!(lowest <= least, "{lowest:e} m, {least:e} m at the end");
        }
        [peaks, sliding]
    };
    let (long, short) = (of(Scheme::Galerkin, H), of(Scheme::MasslessBoundary, 1e-7));
    for (name, (long, short)) in ["peaks", "friction"].into_iter().zip(long.into_iter().zip(short)) {
        println!("{name}: {long:.4e}, {short:.4e} N");
        assert!((long / short - 1.0).abs() < 0.01 && short > 100.0, "{name}: {long} and {short} N");
    }
}

#[test]
fn without_friction_there_is_no_heat() {
    let mut simulation = Simulation::new(scene(Scheme::Galerkin, H, 1e-3)).unwrap();
    set(&mut simulation, "friction_coefficient", 0.0);
    simulation.initialise(0.0).unwrap();
    (0..STEPS).for_each(|_| go(&mut simulation, H));
    let ledger = simulation.system().ledger();
    let (kinetic, strain) = simulation.system().energies();
    assert_eq!(real(&simulation, "friction_loss").to_bits(), 0.0_f64.to_bits());
    assert!(kinetic + strain > 0.0 && ledger.residual(kinetic + strain).abs() < 1e-12 * ledger.scale());
}

/// A second surface is never touched: the tolerance is a fraction of the smallest clearance, regardless of the others.
#[test]
fn a_wide_clearance_does_not_loosen_the_tolerance() {
    let run = |gap: f64| {
        let scene = scene(Scheme::Galerkin, H, 1e-3);
        let solver = scene.settings.contacts[0].solver;
        let mut scene = several::tip_and_seal(scene, solver);
        scene.settings.surfaces[1].shape = Shape::Circular {};
        scene.settings.contacts[1].gap = gap;
        let mut simulation = started(&scene);
        (0..STEPS).for_each(|_| go(&mut simulation, H));
        let effort = *simulation.system().effort();
        (effort.steps, effort.trials, simulation.system().bank().displacement().to_vec())
    };
    let (near, far) = (run(1e-3), run(1e-2));
    assert!(near.1 > STEPS.into(), "{} trials", near.1);
    assert_eq!(near, far);
}
