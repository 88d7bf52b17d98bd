//! Blades on an off-centre shaft in a rigid casing: work on the shaft, symmetry, and independence of the communication step.

use super::{H, SECTORS, scene};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::{element, go, real, set, started};

/// Exact binary fraction of a second.
const TICK: f64 = 1.0 / 131_072.0;

fn rub(tolerance: f64) -> Scene {
    let mut scene = scene(Scheme::Galerkin, H, tolerance);
    whirl(&mut scene);
    scene
}

/// Adds inputs for the displacement of the shaft.
pub fn whirl(scene: &mut Scene) {
    let rotor = &mut scene.settings.structures[0];
    (rotor.whirl, rotor.axial_shift) = (true, true);
}

/// Moves the shaft centre (m).
pub fn shift(simulation: &mut Simulation, place: [f64; 3]) {
    for (name, value) in ["whirl_x", "whirl_y", "axial_shift"].into_iter().zip(place) {
        set(simulation, name, value);
    }
}

/// The works in the ledger equal the mean forces times the motion of the shaft. The energy balance closes to rounding, and its
/// curvature work vanishes with the tolerance.
#[test]
fn work_on_the_shaft_is_force_times_motion() {
    let mut curvature = Vec::new();
    for tolerance in [1e-2, 1e-4] {
        let mut simulation = started(&rub(tolerance));
        let (mut shaft, mut by_force) = ([0.0; 3], [0.0; 2]);
        for n in 1..200 {
            let angle = 0.07 * f64::from(n);
            let next = [2e-4 * angle.sin(), 2e-4 * (angle.cos() - 1.0), 6e-5 * angle.sin()];
            shift(&mut simulation, next);
            go(&mut simulation, H);
            let work = |axis: usize, name: &str| -real(&simulation, name) * (next[axis] - shaft[axis]);
            by_force[0] += work(0, "force_x") + work(1, "force_y");
            by_force[1] += work(2, "force_z");
            shaft = next;
        }
        let ledger = simulation.system().ledger();
        let (kinetic, strain) = simulation.system().energies();
        let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
        assert!(residual < 1e-12, "{tolerance:e}: {residual:e}");
        let largest = ledger.whirl_work.value().abs();
        assert!(largest > 1.0, "{largest:e} J");
        for (force, work) in by_force.into_iter().zip([&ledger.whirl_work, &ledger.shift_work]) {
            let error = (force - work.value()).abs() / largest;
            assert!(error < 1e-10, "{tolerance:e}: {force:e} {:e}", work.value());
        }
        curvature.push(ledger.curvature_work.value().abs() / ledger.scale());
    }
    println!("curvature work / energy turnover: {curvature:?}");
    assert!(curvature[0] < 1e-3 && curvature[1] < 1e-5, "{curvature:?}");
}

/// If the displacement of the shaft is rotated by the pitch of the sectors, each sector moves like the previous sector.
#[test]
fn rotated_eccentricity_permutes_the_sectors() {
    let run = |turns: i32, moves: bool| {
        let mut scene = rub(1e-3);
        scene.settings.surfaces[0].shape = Shape::Circular {};
        let mut simulation = started(&scene);
        let mut found = Vec::new();
        for n in 0..150 {
            let pitch = std::f64::consts::TAU / f64::from(u32::try_from(SECTORS).unwrap());
            let angle = pitch * f64::from(turns) + if moves { 0.05 * f64::from(n) } else { 0.3 };
            let size = 4.2e-4 * (f64::from(n) * 0.02).min(1.0);
            shift(&mut simulation, [size * angle.cos(), size * angle.sin(), 0.0]);
            go(&mut simulation, H);
            let bank = simulation.system().bank();
            let of = |sector: usize| -> Vec<f64> { (0..bank.rows()).map(|row| bank.row(row, sector)).collect() };
            found.push((0..SECTORS).map(of).collect::<Vec<_>>());
        }
        assert!(simulation.system().ledger().friction_loss.value() > 0.0);
        (found, simulation.system().effort().trials)
    };
    for moves in [false, true] {
        let (expected, trials) = run(0, moves);
        for turns in [1, 2] {
            let (found, tried) = run(turns, moves);
            assert_eq!(trials, tried, "{turns}");
            for (found, expected) in found.iter().zip(&expected) {
                for (sector, moved) in expected.iter().enumerate() {
                    let other = &found[(sector + usize::try_from(turns).unwrap()) % SECTORS];
                    let apart = moved.iter().zip(other).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
                    assert!(apart < 1e-9 * 4e-4, "{moves}, {turns} pitches, sector {sector}: {apart:e} m");
                }
            }
        }
    }
}

/// While the shaft rests, steps do not end at communication points, also if the shaft is off-centre.
#[test]
fn resting_eccentric_shaft_gives_the_same_bits_for_every_communication_step() {
    let run = |ticks: &[u32], tolerance: f64| {
        let mut simulation = started(&rub(tolerance));
        shift(&mut simulation, [1.4e-4, -1.1e-4, 3e-5]);
        // The shaft moves in the first step and rests during the second step.
        go(&mut simulation, TICK);
        go(&mut simulation, TICK);
        let (mut reached, mut lengths) = (0, ticks.iter().cycle());
        while reached < 512 {
            let step = (*lengths.next().unwrap()).min(512 - reached);
            go(&mut simulation, f64::from(step) * TICK);
            reached += step;
        }
        let system = simulation.system();
        let values = system.bank().displacement().iter().chain(system.gaps());
        let effort = *system.effort();
        (values.map(|value| value.to_bits()).collect::<Vec<_>>(), effort.trials, effort.steps)
    };
    for tolerance in [1e-2, 1e-4] {
        let expected = run(&[1], tolerance);
        assert!(expected.1 > 300, "{}", expected.1);
        for ticks in [&[64][..], &[1, 3, 17, 5, 40]] {
            assert!(run(ticks, tolerance) == expected, "{tolerance:e}, {ticks:?}");
        }
    }
}

/// Flights report the smallest clearance of an eccentric rotor in a round casing.
#[test]
fn flights_with_a_moving_shaft_find_the_smallest_clearance() {
    let mut scene = rub(1e-3);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    let mut simulation = started(&scene);
    let (clearance, size) = (scene.settings.contacts[0].gap, 2e-4);
    for n in 0..60 {
        let angle = 0.4 * f64::from(n);
        let share = (f64::from(n) * 0.1).min(1.0);
        shift(&mut simulation, [share * size * angle.cos(), share * size * angle.sin(), 0.0]);
        go(&mut simulation, 1e-3);
        // The rotor turns by more than a pitch, so a node passes the smallest clearance.
        let found = real(&simulation, "clearance_minimum");
        if n > 12 {
            let [least, most] = [clearance - size, clearance - size * 0.4_f64.cos()];
            assert!(least / 1.06 < found && found < most, "{n}: {found:e}");
        }
    }
    assert!(element(&simulation, "blade[1].normal_force", 0) <= 0.0);
    assert!(simulation.system().effort().flights > 2000);
}
