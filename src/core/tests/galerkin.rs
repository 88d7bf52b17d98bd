//! Continuous Galerkin in time on whole scenes: against massless-boundary with ever shorter steps, within its tolerance, with books that
//! close, with all it may be combined with.

#[path = "common/counting.rs"]
mod counting;
#[path = "../../../tests/guide.rs"]
mod guide;

use counting::allocations_of;
use guide::told;
use tiprub_core::settings::{OutputSettings, Scheme, Shape, SplineSettings, TimeSettings};
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::{
    bits, blade, bumps, element, flexible, go, real, rich_blade, saved, set, several, started, try_started,
};

const SECTORS: usize = 4;
const NODES: u32 = 3;
/// Communication step (s).
const H: f64 = 4e-5;
const STEPS: u32 = 150;

fn scene(scheme: Scheme, step: f64, tolerance: f64) -> Scene {
    let mut scene = bumps(rich_blade(SECTORS));
    scene.settings.time = TimeSettings { scheme, step, tolerance: Some(tolerance), ..TimeSettings::default() };
    scene.settings.outputs = OutputSettings {
        watched_sectors: (1..=SECTORS).collect(),
        all_sectors: true,
        energies: true,
        instantaneous_forces: true,
        ..OutputSettings::default()
    };
    scene
}

/// What a run shows.
struct Found {
    /// Displacements of all contact rows at communication points (m).
    displacements: Vec<f64>,
    impulse: f64,
    /// Work of the shaft as torque times angle (J).
    by_torque: f64,
    shaft: f64,
    residual: f64,
    lowest: f64,
    /// Per blade.
    steps: u64,
}

fn run(scene: &Scene, drive: impl Fn(&mut Simulation, f64)) -> Found {
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
    let steps = simulation.system().structures()[0].effort().map_or(0, |effort| effort.steps / SECTORS as u64);
    let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
    Found { displacements, impulse, by_torque, shaft: ledger.shaft_work.value(), residual, lowest, steps }
}

fn still(_: &mut Simulation, _: f64) {}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())
}

#[test]
fn it_is_what_massless_boundary_tends_to_and_errors_are_those_asked_for() {
    let exact = run(&scene(Scheme::Galerkin, H, 1e-7), still);
    assert!(exact.residual < 1e-13 && exact.lowest > -1e-9, "{:e}, {:e}", exact.residual, exact.lowest);
    // The longest step changes nothing, a shape that grows in included.
    let shorter = run(&scene(Scheme::Galerkin, 0.25 * H, 1e-7), still);
    let distance = apart(&shorter.displacements, &exact.displacements);
    assert!(distance < 1e-6, "{distance:e}");
    let other = |step: f64| run(&scene(Scheme::MasslessBoundary, step, 1e-3), still);
    let (coarse, fine) = (other(1e-7), other(5e-8));
    let (first, second) = (exact.impulse - coarse.impulse, exact.impulse - fine.impulse);
    let distance = apart(&fine.displacements, &exact.displacements);
    told!("massless-boundary, h = 0.05 us: {distance:.1e}, impulse {:.1e}", second / exact.impulse);
    assert!(distance < 1e-5);
    // Of first order in h, towards the same.
    assert!((first / second - 2.0).abs() < 0.1 && (second / exact.impulse).abs() < 1e-4, "{first:e} {second:e}");
    for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
        let found = run(&scene(Scheme::Galerkin, H, tolerance), still);
        let error = apart(&found.displacements, &exact.displacements);
        told!("tolerance {tolerance:.0e}: {error:.1e}, steps per blade {}", found.steps);
        assert!(error < 3.0 * tolerance && found.residual < 1e-13);
    }
    guide::hold("cargo test -p tiprub-core --test galerkin");
}

/// What the scheme may be combined with: a change of the scene, and what the importer sets on the way.
type Change = fn(&mut Scene);

type Feature = (&'static str, f64, Change, fn(&mut Simulation, f64));

const FEATURES: [Feature; 6] = [
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
fn every_combination_keeps_its_books_and_agrees_with_massless_boundary() {
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

#[test]
fn what_is_not_sound_is_refused_by_name() {
    let cases: [(&str, Change); 4] = [
        ("carries and deforms", flexible),
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
fn a_saved_state_goes_on_with_the_same_bits_and_no_step_asks_for_memory() {
    let mut simulation = started(&scene(Scheme::Galerkin, H, 1e-4));
    (0..60).for_each(|_| go(&mut simulation, H));
    let state = saved(&simulation);
    let lengths = [H, 0.5 * H, 3.3 * H, H, 1.7e-6, H];
    let go_on = |simulation: &mut Simulation| lengths.iter().for_each(|length| go(simulation, *length));
    let count = allocations_of(|| go_on(&mut simulation));
    assert_eq!(count, 0);
    let expected = bits(&simulation);
    assert!(simulation.system().ledger().friction_loss.value() > 1.0);
    let mut other = started(&scene(Scheme::Galerkin, H, 1e-4));
    other.restore_state(&state).unwrap();
    go_on(&mut other);
    assert_eq!(bits(&other), expected);
    simulation.restore_state(&state).unwrap();
    go_on(&mut simulation);
    assert_eq!(bits(&simulation), expected);
    // Between two spans of one communication step as well.
    simulation.begin_step(simulation.time(), 3.0 * H).unwrap();
    simulation.advance().unwrap();
    let between = saved(&simulation);
    while !simulation.advance().unwrap().finished {}
    let expected = bits(&simulation);
    other.restore_state(&between).unwrap();
    while !other.advance().unwrap().finished {}
    assert_eq!(bits(&other), expected);
}

/// A blade that nothing comes near takes one step a span, and no gap is looked at.
#[test]
fn free_flight_takes_spans_as_they_are() {
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
    let effort = simulation.system().structures()[0].effort().copied().unwrap();
    assert_eq!((effort.steps, effort.trials), (50 * SECTORS as u64, 0), "{effort:?}");
}

/// Of all watched nodes now (m).
fn least_clearance(simulation: &Simulation) -> f64 {
    let of = |sector: usize, node: u32| element(simulation, &format!("blade[{sector}].clearance"), node);
    (1..=SECTORS).flat_map(|sector| (0..NODES).map(move |node| of(sector, node))).fold(f64::INFINITY, f64::min)
}

/// From far away onto blades at rest within one span: it does not pass for free flight.
#[test]
fn a_casing_that_closes_within_a_span_is_met() {
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

/// Peaks and means over a span are those of a thousand short steps.
#[test]
fn outputs_of_a_span_are_those_of_many_steps() {
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

/// A second surface, never met: the tolerance is a share of the smallest clearance, whatever the others are.
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
        let effort = simulation.system().structures()[0].effort().copied().unwrap();
        (effort.steps, effort.trials, simulation.system().bank().displacement().to_vec())
    };
    let (near, far) = (run(1e-3), run(1e-2));
    assert!(near.1 > STEPS.into(), "{} trials", near.1);
    assert_eq!(near, far);
}
