//! Contacts that may stick with adaptive steps, on whole scenes: single blades, blades in elastic casings, coupled
//! sectors.

use super::{Combination, H, apart, disk_displacements, goes_on_with_the_same_bits, run, scene, scene_time, still};
use crate::guide::{self, print_row};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{Shape, TimeSettings};
use tiprub_core::system::Effort;
use tiprub_core::{Rom, Scene};
use tiprub_test_models::disk::TestDisk;
use tiprub_test_models::{GAP, RADIUS, bumps, flexible, go, modal, node, real, started};

/// The solver with sticking, on a rub in which everything slides: it converges to the limit of massless-boundary with
/// this solver, within the requested errors.
#[test]
fn sticking_friction_meets_the_requested_tolerance() {
    for (name, change) in [("rigid", (|_: &mut Scene| {}) as Combination), ("flexible", flexible)] {
        let of = |scheme: Scheme, step: f64, tolerance: f64| {
            let mut scene = scene(scheme, step, tolerance);
            change(&mut scene);
            scene.settings.contacts[0].solver = Solver::Coulomb;
            run(&scene, still)
        };
        let exact = of(Scheme::Galerkin, 0.25 * H, 1e-6);
        if name == "rigid" {
            let far = |step: f64| apart(&of(Scheme::MasslessBoundary, step, 1e-3).displacements, &exact.displacements);
            let (coarse, fine) = (far(2e-7), far(5e-8));
            print_row!("coulomb, massless-boundary, h = 0.05 us: {fine:.1e}");
            assert!(fine < 1e-5 && coarse > 2.0 * fine, "{coarse:e} {fine:e}");
        }
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
            let found = of(Scheme::Galerkin, H, tolerance);
            let error = apart(&found.displacements, &exact.displacements);
            print_row!("coulomb, {name}, tolerance {tolerance:.0e}: {error:.1e}, steps per blade {}", found.steps);
            assert!(error < 1.5 * tolerance && found.residual < 1e-13, "{error:e} {:e}", found.residual);
        }
    }
    guide::hold("cargo test -p tiprub-core --test galerkin sticking");
}

/// Sectors that step together agree with the equivalent single structure, both in sliding and at speeds low enough to
/// stick.
#[test]
fn sticking_of_coupled_sectors_matches_one_structure() {
    let disk = TestDisk::random(6, 1, 8, 0.25, 3);
    for speed in [1300.0, 300.0] {
        let of = |rom: Rom, tolerance: f64| {
            let mut scene = bumps(rom);
            scene.settings.structures[0].speed = speed;
            scene.settings.contacts[0].friction = 0.15;
            scene.settings.contacts[0].solver = Solver::Coulomb;
            disk_displacements(scene, tolerance)
        };
        let exact = of(disk.whole(), 1e-6);
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6] {
            let [together, alone] = [disk.cyclic(), disk.whole()].map(|rom| of(rom, tolerance));
            let (parted, error) = (apart(&together, &alone), apart(&together, &exact));
            println!("{speed} rad/s, tolerance {tolerance:e}: {error:.1e}, from one structure {parted:.1e}");
            assert!(parted < 2.0 * tolerance, "{speed} rad/s, {tolerance:e}: {parted:e}");
            assert!(error < 2.0 * tolerance, "{speed} rad/s, {tolerance:e}: {error:e}");
        }
    }
}

#[test]
fn sticking_state_is_saved_without_allocation() {
    let mut alone = scene(Scheme::Galerkin, H, 1e-4);
    alone.settings.contacts[0].solver = Solver::Coulomb;
    let (mut carried, mut coupled) = (alone.clone(), alone.clone());
    flexible(&mut carried);
    coupled.roms[0] = TestDisk::random(4, 1, 9, 0.25, 3).cyclic();
    [alone, carried, coupled].iter().for_each(goes_on_with_the_same_bits);
}

/// Frequencies of [`three_springs`] (Hz).
const SPRING_FREQUENCIES: [f64; 6] = [350.0, 520.0, 800.0, 40e3, 45e3, 50e3];

/// Mode shapes of [`three_springs`].
fn spring_shape(row: usize, mode: usize) -> f64 {
    let springs = [[1.2, 0.5, 0.1], [-0.4, 1.1, 0.3], [0.2, -0.3, 1.0]];
    match mode.checked_sub(3) {
        None => springs[row][mode],
        Some(local) => f64::from(u8::from(local == row)) * 8.0,
    }
}

/// Returns a blade of three modes and one contact node, which can yield in every direction.
fn three_springs() -> Rom {
    let tip = node("tip", [RADIUS, 0.0, 0.0], 0.0);
    Rom { damping_ratio: 0.002, ..modal("blade", &SPRING_FREQUENCIES, spring_shape, vec![tip]) }
}

/// Returns a scene in which a blade of three modes slides over two lobes.
fn blade_under_lobes(speed: f64, friction: f64, phase: f64, tolerance: f64) -> Scene {
    let mut scene = bumps(three_springs());
    scene.settings.time = TimeSettings { tolerance: Some(tolerance), step: 2.0 * H, ..scene_time() };
    scene.settings.outputs.energies = true;
    scene.settings.structures[0].speed = speed;
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.9, width: 0.15, phase };
    (scene.settings.contacts[0].friction, scene.settings.contacts[0].solver) = (friction, Solver::Coulomb);
    scene
}

/// Returns the displacements at all communication points (m) and the effort of a run.
fn displacements_of(scene: &Scene, steps: usize) -> (Vec<f64>, Effort) {
    let mut simulation = started(scene);
    let mut displacements = Vec::new();
    for _ in 0..steps {
        go(&mut simulation, 2.0 * H);
        let bank = simulation.system().bank();
        displacements.extend((0..3).map(|row| bank.row(row, 0)));
    }
    let effort = *simulation.system().effort();
    // Rounding grows with the number of steps.
    let residual = real(&simulation, "energy_residual_relative").abs();
    assert!(residual < 1e-14 + 1e-16 * f64::from(u32::try_from(effort.trials).unwrap()), "{residual:e}");
    (displacements, effort)
}

/// Returns the largest difference between displacements, in clearances.
fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / GAP
}

/// The blades hit slowly passing lobes and bounce. In the first two rubs, the vibration is much slower than the sliding. In the
/// third one it is about as fast.
#[test]
fn errors_of_bouncing_blades_are_bounded() {
    for (speed, friction, phase, limit) in [(60.0, 0.3, 0.0, 4.0), (200.0, 0.2, 0.0, 4.0), (12.0, 0.7, -1.67, 30.0)] {
        let run = |tolerance: f64| displacements_of(&blade_under_lobes(speed, friction, phase, tolerance), 600);
        let (exact, _) = run(1e-6);
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
            let (found, effort) = run(tolerance);
            let error = largest_difference(&found, &exact) / tolerance;
            print_row!(
                "{speed} rad/s, tolerance {tolerance:.0e}: error over it {error:.2}, {} steps, {} trials, missed {}",
                effort.steps,
                effort.trials,
                effort.missed
            );
            assert!(error < limit, "{speed} rad/s, {tolerance:e}: {error}");
        }
    }
    guide::hold("cargo test -p tiprub-core --test galerkin bouncing blades");
}

/// Blades of a fast rotor hardly ever stick. With sticking, they attempt at most 10 % more steps than without, and errors are below
/// four times the tolerance.
#[test]
fn fast_blades_need_hardly_more_steps_than_without_sticking() {
    for (speed, friction) in [(800.0, 0.3), (1300.0, 0.15), (1300.0, 0.6)] {
        for tolerance in [1e-2, 1e-3, 1e-4] {
            let [sliding, sticking] = [Solver::Lcp, Solver::Coulomb].map(|solver| {
                let run = |tolerance: f64| {
                    let mut scene = blade_under_lobes(speed, friction, 0.0, tolerance);
                    scene.settings.contacts[0].solver = solver;
                    displacements_of(&scene, 150)
                };
                let ((found, effort), (exact, _)) = (run(tolerance), run(1e-7));
                (largest_difference(&found, &exact) / tolerance, effort.trials)
            });
            println!("{speed} rad/s, µ = {friction}, tolerance {tolerance:e}: {sliding:?}, {sticking:?}");
            assert!(sticking.0 < 4.0 && 10 * sticking.1 < 11 * sliding.1, "{sliding:?} {sticking:?}");
        }
    }
}

/// A mode of low frequency that does not move the tip does not change whether blades count as hardly ever sticking: a slow blade
/// needs about as many trials with the mode as without it.
#[test]
fn modes_that_do_not_move_the_tip_hardly_change_the_step_count() {
    let with_idle_mode = || {
        let rom = three_springs();
        let shape = |row: usize, mode: usize| mode.checked_sub(1).map_or(0.0, |mode| spring_shape(row, mode));
        let frequencies: Vec<f64> = std::iter::once(1.0).chain(SPRING_FREQUENCIES).collect();
        Rom { damping_ratio: rom.damping_ratio, ..modal("blade", &frequencies, shape, rom.contact_nodes) }
    };
    let run = |rom: Rom| {
        let mut scene = blade_under_lobes(12.0, 0.7, -1.67, 1e-3);
        scene.roms[0] = rom;
        displacements_of(&scene, 600)
    };
    let [(_, without), (_, with)] = [run(three_springs()), run(with_idle_mode())];
    assert!(with.trials > 2000 && with.trials.abs_diff(without.trials) < without.trials / 10, "{with:?} {without:?}");
}
