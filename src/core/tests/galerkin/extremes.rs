//! Smallest clearances and largest forces of communication steps: those within internal steps, not only at their end
//! points.

use super::off_centre::{shift, whirl};
use super::{H, SECTORS, run, scene};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{Shape, SplineSettings};
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::disk::TestDisk;
use tiprub_test_models::{GAP, element, go, real, set, started};

/// Communication step (s), equal to ten of the longest steps.
const WINDOW: f64 = 8e-4;

/// Returns the smallest clearance of every blade (m) and the largest force (N) of each communication step.
fn windows(scene: &Scene, drive: fn(&mut Simulation, u32)) -> Vec<(Vec<f64>, f64)> {
    let mut simulation = started(scene);
    let all = (0..12).map(|n| {
        drive(&mut simulation, n);
        go(&mut simulation, WINDOW);
        let of = |sector: usize| element(&simulation, "sector_clearance_minimum", u32::try_from(sector).unwrap());
        ((0..SECTORS).map(of).collect(), real(&simulation, "normal_force_peak"))
    });
    all.collect()
}

/// Returns the largest difference of the smallest clearances (m), and that of the largest forces relative to the
/// largest of all.
fn apart(found: &[(Vec<f64>, f64)], others: &[(Vec<f64>, f64)]) -> (f64, f64) {
    let largest = others.iter().fold(1.0, |largest: f64, other| largest.max(other.1));
    let pairs = found.iter().zip(others);
    pairs.fold((0.0_f64, 0.0_f64), |(gap, force), (found, other)| {
        let gaps = found.0.iter().zip(&other.0).map(|(a, b)| (a - b).abs());
        (gaps.fold(gap, f64::max), force.max((found.1 - other.1).abs() / largest))
    })
}

/// A change of the scene, and the inputs that the importer sets before a communication step.
type ExtremesCase = (&'static str, fn(&mut Scene), fn(&mut Simulation, u32));

const CASES: [ExtremesCase; 10] = [
    ("rub", |_| (), |_, _| ()),
    // Blades touch at first, then they swing freely past lobes that come close.
    (
        "flight after a rub",
        |_| (),
        |simulation, n| set(simulation, "casing_radius_change", if n < 3 { 0.0 } else { 1.2e-4 }),
    ),
    ("coupled", |scene| scene.roms[0] = TestDisk::random(SECTORS, 1, 9, 0.25, 3).cyclic(), wide),
    ("at rest past two lobes", |_| (), wide),
    (
        "at rest past a table",
        |scene| {
            let radius_change = (0..24).map(|i| -1.5e-4 * (f64::from(i) * 0.9).sin().max(0.0)).collect();
            scene.settings.surfaces[0].shape = Shape::Table { radius_change };
        },
        wide,
    ),
    // The smallest gaps are anywhere in a step, also close to its ends.
    (
        "at rest past many lobes",
        |scene| scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 3e-4, order: 9, phase: 0.05 },
        wide,
    ),
    ("rub with an eccentric shaft", whirl, |simulation, _| shift(simulation, [1.4e-4, -0.8e-4, 0.0])),
    ("rub with a moving shaft", whirl, orbit),
    ("at rest with an eccentric shaft", round, |simulation, _| shift(simulation, [2.6e-4, -1.4e-4, 0.0])),
    ("at rest with a moving shaft", round, orbit),
];

/// Uses a round casing, and adds inputs for the displacement of the shaft.
fn round(scene: &mut Scene) {
    whirl(scene);
    scene.settings.surfaces[0].shape = Shape::Circular {};
}

/// Moves the shaft centre along chords, and along the axis.
fn orbit(simulation: &mut Simulation, n: u32) {
    let (sine, cosine) = (f64::from(n) * 0.9).sin_cos();
    shift(simulation, [2.2e-4 * cosine - 0.5e-4, 2.2e-4 * sine, 1e-4 * sine]);
}

fn wide(simulation: &mut Simulation, _: u32) {
    set(simulation, "casing_radius_change", 2e-4);
}

/// The smallest clearance agrees with that of steps of half a microsecond within the tolerance, a fraction of the
/// clearance.
#[test]
fn extremes_do_not_depend_on_the_longest_step() {
    for (name, change, drive) in CASES {
        let of = |step: f64, tolerance: f64| {
            let mut scene = scene(Scheme::Galerkin, step, tolerance);
            change(&mut scene);
            windows(&scene, drive)
        };
        let fine = of(5e-7, 1e-6);
        let closest = fine.iter().flat_map(|(gaps, _)| gaps).copied().fold(f64::INFINITY, f64::min);
        assert!(closest < 1.2 * GAP, "{name}: {closest:e} m");
        for tolerance in [1e-1, 1e-2, 1e-3] {
            let (gap, force) = apart(&of(2.0 * H, tolerance), &fine);
            println!("{name}, {tolerance:e}: clearance off by {:.3} um, largest force by {force:.1e}", 1e6 * gap);
            assert!(gap < tolerance * GAP && force < 3.0 * tolerance, "{name}, {tolerance:e}: {gap:e} m, {force:e}");
        }
    }
}

/// A shape that grows within few steps, and bumps that meet in an edge, are no cubics over a step. Steps of blades that face data points or may
/// stick end at communication points, so the samples come from other steps.
#[test]
fn smallest_gaps_agree_with_samples() {
    const TICK: f64 = 1.0 / 4_194_304.0;
    let as_it_is: fn(&mut Scene) = |_| {};
    let spline: fn(&mut Scene) = |scene| {
        scene.settings.surfaces[0].spline = Some(SplineSettings { around: 24, along: 3, ..SplineSettings::default() });
    };
    let sticking: fn(&mut Scene) = |scene| scene.settings.contacts[0].solver = Solver::Coulomb;
    let lobes = Shape::Lobes { amplitude: 4.3e-4, order: 3, phase: -1.084 };
    let edge = Shape::TwoLobe { depth: -1.34, width: 0.229, phase: -0.102 };
    let round = Shape::Circular {};
    for (change, allowed, shape, speed, ramp_time, radius) in [
        (as_it_is, 1.0, lobes.clone(), 175.0, 1e-4, 0.0),
        (as_it_is, 1.0, edge.clone(), 609.0, 2e-3, 0.0),
        (as_it_is, 1.0, round, 609.0, 2e-3, 1.9e-4),
        // While a shape grows, polynomials through the points of a step are less accurate than the tolerance of this test.
        (spline, 100.0, lobes.clone(), 175.0, 1e-4, 0.0),
        (sticking, 100.0, lobes, 175.0, 1e-4, 0.0),
        (sticking, 10.0, edge, 609.0, 2e-3, 0.0),
    ] {
        let mut scene = scene(Scheme::Galerkin, 8e-5, 1e-5);
        scene.settings.surfaces[0].shape = shape;
        scene.settings.surfaces[0].ramp_time = ramp_time;
        scene.settings.structures[0].speed = speed;
        scene.settings.structures[0].whirl = radius > 0.0;
        change(&mut scene);
        let (mut simulation, mut sampled) = (started(&scene), started(&scene));
        let places = || (0..3).flat_map(|node| (0..SECTORS).map(move |sector| (node, sector)));
        let gaps = |simulation: &Simulation| -> Vec<f64> {
            places().map(|(node, sector)| simulation.system().structures()[0].gap(node, sector)).collect()
        };
        for window in 0..128 {
            let mut lowest = gaps(&sampled);
            // The shaft moves along chords.
            let place = |window: u32| {
                let (sine, cosine) = (0.05 * f64::from(window)).sin_cos();
                [radius * (1.0 - cosine), radius * sine]
            };
            let move_to = |simulation: &mut Simulation, share: f64| {
                let ([x, y], [next_x, next_y]) = (place(window), place(window + 1));
                set(simulation, "whirl_x", x + share * (next_x - x));
                set(simulation, "whirl_y", y + share * (next_y - y));
            };
            for tick in 1..=64 {
                if radius > 0.0 {
                    move_to(&mut sampled, f64::from(tick) / 64.0);
                }
                go(&mut sampled, TICK);
                lowest.iter_mut().zip(gaps(&sampled)).for_each(|(lowest, gap)| *lowest = lowest.min(gap));
            }
            if radius > 0.0 {
                move_to(&mut simulation, 1.0);
            }
            go(&mut simulation, 64.0 * TICK);
            for ((node, sector), lowest) in places().zip(lowest) {
                let name = format!("blade[{}].clearance_minimum", sector + 1);
                let found = element(&simulation, &name, u32::try_from(node).unwrap());
                let share = (found - lowest) / (1e-5 * GAP);
                assert!(
                    share < allowed,
                    "{speed} rad/s, window {window}, node {node} of {sector}: {share} above the samples"
                );
            }
        }
    }
}

/// Blades that face data points or may stick find bumps between the ends of steps without a trial.
#[test]
fn steps_without_a_trial_find_every_bump() {
    let changes: [fn(&mut Scene); 2] = [
        |scene| {
            let spline = SplineSettings { around: 144, along: 3, ..SplineSettings::default() };
            scene.settings.surfaces[0].spline = Some(spline);
        },
        |scene| scene.settings.contacts[0].solver = Solver::Coulomb,
    ];
    for (which, change) in changes.into_iter().enumerate() {
        for phase in 0..6 {
            let heat = |step: f64| {
                let mut scene = scene(Scheme::Galerkin, step, 1e-2);
                let phase = 0.6 * f64::from(phase);
                scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 1.03 * GAP, order: 8, phase };
                (scene.settings.surfaces[0].ramp_time, scene.settings.contacts[0].friction) = (2e-5, 0.05);
                scene.settings.structures[0].damping_ratio = Some(0.3);
                scene.settings.contacts[0].nodes = Some(scene.roms[0].contact_nodes[1].name.clone());
                change(&mut scene);
                let mut simulation = started(&scene);
                (0..40).for_each(|_| go(&mut simulation, 2.0 * H));
                real(&simulation, "friction_loss")
            };
            let (long, short) = (heat(2.0 * H), heat(2e-6));
            assert!(
                short > 0.0 && (long / short - 1.0).abs() < 0.05,
                "{which}, phase {phase}: {long:e} of {short:e} J"
            );
        }
    }
}

#[test]
fn runs_with_friction_close_to_zero() {
    let end = |friction: f64| {
        let mut scene = scene(Scheme::Galerkin, H, 1e-2);
        scene.settings.contacts[0].friction = friction;
        run(&scene, |_, _| {})
    };
    let without = end(0.0);
    for friction in [1e-300, 1e-12, 1e-9, 1e-8, 1e-7] {
        let found = end(friction);
        assert!((found.impulse / without.impulse - 1.0).abs() < 1e-3, "µ = {friction:e}");
    }
}
