//! Steady phases, in which steps do not end at communication points: results do not depend on the communication step,
//! inputs act immediately, and saved states continue with equal bits.

use super::{apart, print_row, scene};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{OutputSettings, Shape};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{
    GAP, SeededRandom, bits, bumps, element, go, real, reference, rich_blade, round, saved, set, started,
};

/// A communication step whose multiples are exact binary numbers (s).
const TICK: f64 = 1.0 / 131_072.0;

/// Order of magnitude of the clearance (m).
const CLEARANCE: f64 = 4e-4;

fn rub(tolerance: f64) -> Scene {
    scene(Scheme::Galerkin, 4e-5, tolerance)
}

/// Displacements and gaps at the current time, and counters of the steps so far.
fn instant(simulation: &Simulation) -> (Vec<u64>, Vec<u64>) {
    let system = simulation.system();
    let values = system.bank().displacement().iter().chain(system.gaps());
    let others = ["rotor_angle", "strain_energy"].map(|name| real(simulation, name));
    let effort = *system.effort();
    (
        values.chain(&others).map(|value| value.to_bits()).collect(),
        vec![effort.steps, effort.flights, effort.trials, effort.constant, effort.missed, effort.factorisations],
    )
}

/// Returns the results after 64, 256 and 512 ticks, with communication steps whose lengths cycle through `ticks`.
fn run(scene: &Scene, ticks: &[u32]) -> Vec<(Vec<u64>, Vec<u64>)> {
    let mut simulation = started(scene);
    let (mut reached, mut at, mut turns) = (0, Vec::new(), ticks.iter().cycle());
    for until in [64, 256, 512] {
        while reached < until {
            let step = (*turns.next().unwrap()).min(until - reached);
            go(&mut simulation, f64::from(step) * TICK);
            reached += step;
        }
        at.push(instant(&simulation));
    }
    at
}

/// A scene with fixed steps stores no open steps. If a start value selects adaptive steps, all steps end at communication points.
#[test]
fn adaptive_steps_may_be_a_start_value() {
    let mut simulation = Simulation::new(scene(Scheme::ModalExact, 4e-5, 1e-5)).unwrap();
    simulation.set_integer(reference(&simulation, "scheme"), Scheme::Galerkin.number()).unwrap();
    simulation.initialise(0.0).unwrap();
    let mut adaptive = started(&scene(Scheme::Galerkin, 4e-5, 1e-5));
    for _ in 0..64 {
        go(&mut simulation, 8.0 * TICK);
        go(&mut adaptive, 8.0 * TICK);
    }
    let [found, expected] = [&simulation, &adaptive].map(|one| one.system().bank().displacement().to_vec());
    assert!(real(&adaptive, "friction_loss") > 0.0);
    let error = apart(&found, &expected);
    assert!(error < 1e-3, "{error:e}");
}

#[test]
fn results_do_not_depend_on_the_communication_step() {
    for tolerance in [1e-2, 1e-4] {
        let scene = rub(tolerance);
        let expected = run(&scene, &[1]);
        assert!(expected[2].1[0] > 500 && expected[2].1[2] > 300, "{:?}", expected[2].1);
        for ticks in [&[2][..], &[16], &[64], &[1, 3, 17, 5, 40]] {
            let found = run(&scene, ticks);
            for (found, expected) in found.iter().zip(&expected) {
                assert_eq!(found.1, expected.1, "{ticks:?}: counters");
                let differ = found.0.iter().zip(&expected.0).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "{ticks:?}: {differ} of {} values", found.0.len());
            }
        }
    }
}

fn force_of(simulation: &Simulation, sector: usize) -> f64 {
    (0..3).map(|node| element(simulation, &format!("blade[{sector}].normal_force"), node)).sum()
}

/// Compares the same rub in a steady phase and in spans that end at internal points. A limit on the number of internal
/// steps, which is never reached, causes the latter.
#[test]
fn steady_phases_are_as_accurate_as_bounded_spans() {
    let results = |tolerance: f64, bounded: bool| {
        let mut simulation = started(&rub(tolerance));
        if bounded {
            let reference = simulation.table().find("max_internal_steps").unwrap().reference;
            simulation.set_integer(reference, 1_000_000).unwrap();
        }
        let (mut moved, mut impulse, mut heat, mut most, mut lowest) = (Vec::new(), 0.0, 0.0, 0.0, f64::INFINITY);
        for _ in 0..600 {
            go(&mut simulation, 1e-5);
            moved.extend_from_slice(simulation.system().bank().displacement());
            impulse += 1e-5 * (1..=4).map(|sector| force_of(&simulation, sector)).sum::<f64>();
            heat += 1e-5 * real(&simulation, "friction_power");
            most = real(&simulation, "friction_power").max(most);
            lowest = lowest.min(real(&simulation, "clearance_minimum"));
        }
        let ledger = simulation.system().ledger();
        let (kinetic, strain) = simulation.system().energies();
        let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
        (moved, [impulse, heat, lowest, ledger.friction_loss.value()], residual, most)
    };
    let (exact, sums, _, most) = results(1e-7, true);
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let [steady, bounded] = [false, true].map(|bounded| results(tolerance, bounded));
        let [own, other] = [&steady, &bounded].map(|found| apart(&found.0, &exact));
        print_row!("tolerance {tolerance:.0e}: {own:.1e} in a steady phase, {other:.1e} in bounded spans");
        assert!(own < tolerance, "{own:e}, bounded {other:e}");
        assert!(steady.2 < 1e-13, "{:e}", steady.2);
        for (index, (found, expected)) in steady.1.iter().zip(sums).take(3).enumerate() {
            let error = if index == 2 { (found - expected) / CLEARANCE } else { found / expected - 1.0 };
            assert!(error.abs() < 2.0 * tolerance, "{tolerance:e}, {index}: {found} {expected}");
        }
        // The ledger belongs to the starts of open steps.
        let (heat, lost) = (steady.1[1], steady.1[3]);
        assert!((heat - lost).abs() < 4e-5 * most, "{tolerance:e}: {heat} {lost} {most}");
    }
}

#[test]
fn saved_states_continue_with_equal_bits_within_an_open_step() {
    let mut simulation = started(&rub(1e-3));
    for _ in 0..100 {
        go(&mut simulation, 1.3e-5);
    }
    let state = saved(&simulation);
    let mut other = started(&rub(1e-3));
    other.restore_state(&state).unwrap();
    assert!(saved(&other) == state);
    for _ in 0..50 {
        go(&mut simulation, 1.3e-5);
        go(&mut other, 1.3e-5);
        assert_eq!(bits(&simulation), bits(&other));
    }
    assert!(saved(&other) == saved(&simulation));
}

/// Variables have the same bits if the states of sectors on which no output depends are skipped.
#[test]
fn skipped_states_do_not_affect_variables() {
    const SECTORS: usize = 12;
    let only_variables = |scene: &Scene| {
        let mut simulation = Simulation::new(scene).unwrap();
        simulation.skip_unneeded_states();
        simulation.initialise(0.0).unwrap();
        simulation
    };
    let left_out = |simulation: &Simulation| {
        let structure = &simulation.system().structures()[0];
        (0..SECTORS).map(|sector| u32::from(structure.gap(0, sector) >= 1e9)).sum::<u32>()
    };
    for (tolerance, step, count, least) in
        [(1e-2, 1e-6, 2000, 0.4), (1e-2, 1.3e-5, 500, 0.3), (1e-4, 1.3e-5, 300, 0.1), (1e-3, 1.7e-4, 40, 0.05)]
    {
        let mut scene = bumps(rich_blade(SECTORS));
        scene.settings.time = rub(tolerance).settings.time;
        scene.settings.outputs =
            OutputSettings { watched_sectors: vec![2], energies: true, ..OutputSettings::default() };
        let [mut all, mut few, mut restored] = [started(&scene), only_variables(&scene), started(&scene)];
        let mut omitted = 0;
        for n in 0..count {
            if n % 300 == 299 {
                for simulation in [&mut all, &mut few, &mut restored] {
                    set(simulation, "speed", 1200.0 + f64::from(n));
                }
            }
            if n % 7 == 3 {
                restored.restore_state(&saved(&few)).unwrap();
            }
            [&mut all, &mut few, &mut restored].into_iter().for_each(|simulation| go(simulation, step));
            assert_eq!(bits(&all), bits(&few), "tolerance {tolerance:e}, step {step:e}, {n}");
            assert!(n < 4 || bits(&all) == bits(&restored), "restored, {step:e}, {n}");
            omitted += left_out(&few);
            assert_eq!(left_out(&all), 0);
        }
        let share = f64::from(omitted) / f64::from(count * 12);
        print_row!("tolerance {tolerance:.0e}, H = {step:.1e} s: state skipped in {:.0} % of all cases", 100.0 * share);
        assert!(share > least, "{share}");
        assert_eq!(all.system().effort(), few.system().effort());
    }
}

#[test]
fn setting_the_same_value_again_changes_nothing() {
    let run = |sets: bool| {
        let mut simulation = started(&rub(1e-3));
        for _ in 0..100 {
            if sets {
                for name in ["speed", "casing_radius_change", "friction_coefficient"] {
                    let value = real(&simulation, name);
                    set(&mut simulation, name, value);
                }
                for zero in [-0.0, 0.0] {
                    set(&mut simulation, "gap_offset", zero);
                }
            }
            go(&mut simulation, 1.3e-5);
        }
        (bits(&simulation), *simulation.system().effort())
    };
    assert_eq!(run(true), run(false));
}

/// Within steps with contact, the reported gap is never smaller than the gap from the displacements. It is larger, by less than the tolerance,
/// only where fast modes, which the steps represent only on average, carry a node into the casing.
#[test]
fn gaps_within_steps_agree_with_displacements() {
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let mut scene = round(rich_blade(4));
        (scene.settings.structures[0].damping_ratio, scene.settings.time.tolerance) = (Some(0.05), Some(tolerance));
        (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, 8e-5);
        let slopes: Vec<f64> = scene.roms[0].contact_nodes.iter().map(|node| node.meridional_slope).collect();
        let mut simulation = started(&scene);
        let (mut contact_count, mut max_shortfall) = (0, 0.0_f64);
        for step in 0..3000 {
            let radius_change = -1.05 * GAP * (f64::from(step) * 1e-3).min(1.0);
            set(&mut simulation, "casing_radius_change", radius_change);
            go(&mut simulation, 1e-6);
            let system = simulation.system();
            for (node, slope) in slopes.iter().enumerate() {
                let moved = |component: usize| system.bank().row(3 * node + component, 0);
                let clearance = GAP + radius_change - moved(0) + slope * moved(2);
                let (recomputed_gap, gap) = (clearance / (1.0 + slope * slope).sqrt() / GAP, system.gap(node, 0) / GAP);
                assert!(
                    recomputed_gap - gap < 1e-9,
                    "tolerance {tolerance:e}: the gap is {gap:e}, below {recomputed_gap:e} from the displacements"
                );
                contact_count += usize::from(system.multiplier(node, 0) > 0.0);
                max_shortfall = max_shortfall.max(gap - recomputed_gap);
            }
        }
        print_row!(
            "tolerance {tolerance:.0e}: gaps from the displacements are smaller by at most {max_shortfall:.1e} clearances"
        );
        assert!(
            contact_count > 500 && max_shortfall < tolerance,
            "{contact_count} nodes in contact, shortfall {max_shortfall:e}"
        );
    }
}

/// Inputs that change at some communication points end the open steps at these points.
#[test]
fn changes_of_inputs_keep_the_tolerance() {
    let run = |tolerance: f64, every: u32| {
        let mut simulation = started(&rub(tolerance));
        let speed = real(&simulation, "speed");
        let mut moved = Vec::new();
        for n in 0..300 {
            if n % every == every - 1 {
                set(&mut simulation, "speed", speed * (1.0 + 1e-3 * f64::from(n / every % 3)));
                set(&mut simulation, "casing_radius_change", -1e-6 * f64::from(n / every % 2));
            }
            go(&mut simulation, 2e-5);
            moved.extend_from_slice(simulation.system().bank().displacement());
        }
        let ledger = simulation.system().ledger();
        let (kinetic, strain) = simulation.system().energies();
        (moved, ledger.residual(kinetic + strain).abs() / ledger.scale())
    };
    for every in [1, 2, 3, 10, 41] {
        let (exact, _) = run(1e-6, every);
        let (moved, residual) = run(1e-3, every);
        let error = apart(&moved, &exact);
        print_row!("inputs change every {every} steps: {error:.1e}");
        assert!(error < 1e-3 && residual < 1e-13, "{every}: {error:e} {residual:e}");
    }
}

/// A casing with many bumps.
fn bumpy(tolerance: f64) -> Scene {
    let mut scene = rub(tolerance);
    let radius_change = (0..24).map(|i| -4.5e-4 * (f64::from(i) * 0.9).sin().max(0.0)).collect();
    scene.settings.surfaces[0].shape = Shape::Table { radius_change };
    scene
}

/// A step that an input ends early has not lost the energy that it added to the bank.
#[test]
fn discarded_open_steps_supply_no_energy() {
    for seed in [80, 81, 82] {
        let mut random = SeededRandom(seed);
        let mut simulation = started(&bumpy(1e-1));
        let speed = real(&simulation, "speed");
        for _ in 0..300 {
            let length = random.scale(2e-6, 6e-5);
            match random.below(9) {
                0 => set(&mut simulation, "casing_radius_change", random.within(-3e-5, 3e-5)),
                1 => set(&mut simulation, "speed", speed * random.within(0.9, 1.1)),
                2 => set(&mut simulation, "casing_shape_factor", random.within(0.8, 1.2)),
                3 => {
                    let angle = real(&simulation, "casing_shape_rotation") + random.within(-0.01, 0.01);
                    set(&mut simulation, "casing_shape_rotation", angle);
                }
                4 => set(&mut simulation, "friction_coefficient", random.within(0.05, 0.2)),
                _ => {}
            }
            go(&mut simulation, length);
            let loss = real(&simulation, "impact_loss") / simulation.system().ledger().scale().max(1e-9);
            assert!(loss > -1e-9, "{seed}: {loss:e}");
        }
    }
}

/// Flights of the shortest steps have no parts in which gaps could be followed.
#[test]
fn shortest_flights_record_their_gaps() {
    let mut simulation = Simulation::new(bumpy(1e-6)).unwrap();
    set(&mut simulation, "casing_radius_change", 1e-4);
    simulation.initialise(0.0).unwrap();
    let mut lowest = f64::INFINITY;
    for _ in 0..8192 {
        go(&mut simulation, 1.0 / 1_048_576.0);
        lowest = lowest.min(real(&simulation, "clearance_minimum"));
    }
    assert!(lowest.abs() < CLEARANCE, "{lowest:e}");
}
