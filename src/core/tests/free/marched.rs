//! Free bodies with adaptive steps: an impact in closed form, momentum and energy, convergence, states that continue.

use crate::counting::allocations_of;
use crate::guide::{self, print_row};
use lattice::*;
use nalgebra::DMatrix;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{bits, go, lattice, node, real, saved, started, structure};

/// Communication step (s).
const H: f64 = 2e-5;
/// Mass of the body on springs (kg), their stiffness (N/m), its velocity (m/s) and its distance from the wall (m).
const MASS: f64 = 0.1;
const STIFFNESS: f64 = 1e7;
const VELOCITY: f64 = 1.0;
const DISTANCE: f64 = 3e-4;

/// Mass at the end of each of four springs (kg).
const END: f64 = 1e-9;

/// Returns a mass on four springs with almost massless ends.
fn sprung() -> Rom {
    let order = 15;
    let mass = DMatrix::from_fn(order, order, |i, j| match (i == j, i) {
        (true, 0..3) => MASS,
        (true, _) => END,
        _ => 0.0,
    });
    let mut stiffness = DMatrix::zeros(order, order);
    for (of, axis) in (1..5).flat_map(|of| (0..3).map(move |axis| (of, axis))) {
        let (core, own) = (axis, 3 * of + axis);
        for (row, column, sign) in [(core, core, 1.0), (own, own, 1.0), (core, own, -1.0), (own, core, -1.0)] {
            stiffness[(row, column)] += sign * 0.25 * STIFFNESS;
        }
    }
    let map = DMatrix::from_fn(12, order, |row, column| f64::from(u8::from(column == row + 3)));
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
    let nodes = corners.iter().enumerate();
    let nodes =
        nodes.map(|(n, (y, z))| node(format!("left_{n}"), [0.0, 0.5 * SIDE * y, 0.5 * SIDE * z], 0.0)).collect();
    structure("sprung", mass, stiffness, map, nodes)
}

/// Returns a body in front of the left wall (m, m/s). Springs of this stiffness are usually a mistake; here they are
/// intended.
fn thrown_at_wall(body: Rom, distance: f64, velocity: [f64; 3]) -> Scene {
    let mut scene = scene(body, &[(BlockSide::Left, distance)], false, velocity);
    scene.settings.accept_implausible = true;
    scene
}

fn marched(mut scene: Scene, tolerance: f64, friction: f64) -> Scene {
    scene = with(scene, friction, Solver::Lcp, Scheme::Galerkin);
    (scene.settings.time.step, scene.settings.time.tolerance) = (H, Some(tolerance));
    scene
}

/// The body touches for half a period and leaves with its approach speed, reduced along the wall by the friction
/// impulse: 2µ of it.
#[test]
fn mass_on_springs_rebounds_after_half_a_period() {
    let frequency = (STIFFNESS / MASS).sqrt();
    let along = 3.0;
    for friction in [0.0, 0.2] {
        let mut errors = Vec::new();
        for tolerance in [1e-2, 1e-3, 1e-4] {
            let thrown = thrown_at_wall(sprung(), DISTANCE, [-VELOCITY, along, 0.0]);
            let mut scene = marched(thrown, tolerance, friction);
            scene.settings.surfaces[0].rigid = true;
            let (mut simulation, mut impulse) = (started(&scene), 0.0);
            // The body is then where it would be if the wall had held it for half a period.
            let steps = 40;
            for _ in 0..steps {
                go(&mut simulation, H);
                impulse += H * vector(&simulation, "force")[0];
            }
            let [x, y, _] = vector(&simulation, "block.displacement");
            let [vx, vy, _] = vector(&simulation, "block.velocity");
            let (time, touch) = (simulation.time(), DISTANCE / VELOCITY);
            let left = time - touch - std::f64::consts::PI / frequency;
            assert!(left > 1e-4, "it has not left: {left}");
            assert!((impulse - (MASS + 4.0 * END) * (VELOCITY + vx)).abs() < 1e-12, "{impulse} N·s");
            // ∫ of the velocity along the wall: the friction impulse is µ times the normal impulse.
            let lost = friction * (x + VELOCITY * time);
            let off = [x - (VELOCITY * left - DISTANCE), y - (along * time - lost)].map(f64::abs);
            // The tolerance is a fraction of a thousandth of the extent.
            errors.push(off[0].max(off[1]) / (tolerance * 1e-3 * SIDE));
            let speeds = [vx - VELOCITY, vy - (along - friction * (vx + VELOCITY))].map(f64::abs);
            assert!(speeds[0] < 0.2 * tolerance && speeds[1] < 1e-11, "µ {friction}, {tolerance}: {speeds:?}");
            assert!(real(&simulation, "energy_residual_relative").abs() < 1e-12);
        }
        println!("µ {friction}: error over tolerance {errors:.2?}");
        assert!(errors.iter().all(|error| *error < 3.0), "µ {friction}: {errors:?}");
    }
}

/// Returns scenes with contact, and their numbers of steps.
fn events() -> Vec<(&'static str, Scene, usize)> {
    let thrown =
        scene(faces([0.0; 3]), &[(BlockSide::Left, 0.0203), (BlockSide::Right, 0.021)], false, [-6.0, 30.0, 4.0]);
    let distance = 0.5 * SIDE - 3e-4;
    let plates = [(BlockSide::Left, distance), (BlockSide::Right, distance)];
    let squeezed = scene(faces([0.0, 0.045, 0.0]), &plates, true, [0.0, -40.0, 0.0]);
    let mut rigid = squeezed.clone();
    rigid.settings.surfaces[1].rigid = true;
    vec![("bounces", thrown, 30), ("squeezed", squeezed, 75), ("one side rigid", rigid, 65)]
}

#[test]
fn momentum_and_energy_are_conserved_within_tolerance() {
    let total: f64 = places().map(node_mass).sum();
    let size = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    for (name, scene, steps) in events() {
        for (friction, tolerance) in [(0.0, 1e-2), (0.0, 1e-4), (0.2, 1e-2), (0.2, 1e-4)] {
            let mut simulation = started(&marched(scene.clone(), tolerance, friction));
            let (start, mut impulse, mut exchanged) = (vector(&simulation, "block.velocity"), [0.0; 3], 0.0_f64);
            let (mut off, mut residual, mut most) = (0.0_f64, 0.0_f64, 0.0_f64);
            for _ in 0..steps {
                go(&mut simulation, H);
                let force = vector(&simulation, "force");
                impulse = std::array::from_fn(|i| impulse[i] + H * force[i]);
                exchanged += H * size(force);
                let velocity = vector(&simulation, "block.velocity");
                off = off.max(size(std::array::from_fn(|i| total * (velocity[i] - start[i]) - impulse[i])));
                residual = residual.max(real(&simulation, "energy_residual_relative").abs());
                let energy = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
                most = most.max(energy / (0.5 * total * size(start).powi(2)));
            }
            let off = off / (exchanged + total * size(start));
            let curvature = real(&simulation, "curvature_work") / (0.5 * total * size(start).powi(2));
            println!(
                "{name}, µ {friction}, {tolerance:e}: momentum {off:.1e}, ledger {residual:.1e}, most energy {most:.6}, curvature \
                 {curvature:.1e}, steps {}",
                simulation.system().steps_tried()
            );
            assert!(exchanged > 0.02 * total * 10.0, "{name}: hardly anything happened, {exchanged} N·s");
            assert!(off < 1e-12 && residual < 1e-12, "{name}, {friction}, {tolerance}: {off:e}, {residual:e}");
        }
    }
}

/// Returns the displacements of all contact nodes at communication points, without the free flight (m).
fn flown(scene: &Scene, steps: usize) -> Vec<f64> {
    let mut simulation = started(scene);
    let velocity = scene.settings.structures[0].velocity;
    let mut found = Vec::new();
    for _ in 0..steps {
        go(&mut simulation, H);
        let (time, bank) = (simulation.time(), simulation.system().bank());
        found.extend(bank.displacement().iter().enumerate().map(|(row, value)| value - time * velocity[row % 3]));
    }
    found
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    (square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / square(&mut b.iter().copied())).sqrt()
}

/// Returns the errors (root mean square) over the tolerances, which are relative to a thousandth of the extent, against
/// a far smaller tolerance.
fn over_tolerance(of: impl Fn(f64) -> Scene, steps: usize, tolerances: &[f64], smallest: f64) -> Vec<f64> {
    let exact = flown(&of(smallest), steps);
    let size = (exact.iter().map(|value| value * value).sum::<f64>() / exact.len() as f64).sqrt();
    let error = |tolerance: &f64| apart(&flown(&of(*tolerance), steps), &exact) * size / (tolerance * 1e-3 * SIDE);
    tolerances.iter().map(error).collect()
}

const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// The error decreases with the tolerance, on flexible plates with friction.
#[test]
fn error_stays_below_the_tolerance() {
    for (name, scene, steps) in events().drain(..2) {
        for friction in [0.0, 0.2] {
            let of = |tolerance: f64| marched(scene.clone(), tolerance, friction);
            let errors = over_tolerance(of, steps, &TOLERANCES, 1e-7);
            print_row!("{name}, µ {friction}: error over tolerance {errors:?}");
            assert!(errors.iter().all(|error| *error < 1.0), "{name}, µ {friction}: {errors:?}");
        }
    }
    print_row!("tolerances {TOLERANCES:?}");
    guide::hold("cargo test -p tiprub-core --test free marched");
}

/// The same body with massive contact nodes: both models converge to the same flight, except for the effect of that
/// mass.
#[test]
fn light_contact_nodes_converge_to_massless_ones() {
    let mut thrown = thrown_at_wall(sprung(), DISTANCE, [-VELOCITY, 3.0, 0.0]);
    thrown.settings.structures[1].damping_ratio = Some(0.0);
    let by_steps = |h: f64| {
        let mut scene = with(thrown.clone(), 0.2, Solver::Lcp, Scheme::ModalExact);
        scene.settings.time.step = h;
        flown(&scene, 40)
    };
    let marched = flown(&marched(thrown.clone(), 1e-5, 0.2), 40);
    let errors = [4e-8, 1e-8].map(|h| apart(&by_steps(h), &marched));
    println!("modal-exact from galerkin {errors:?}");
    assert!(errors[1] < 0.6 * errors[0] && errors[1] < 1e-4, "{errors:?}");
}

#[test]
fn saved_flight_continues_with_equal_bits() {
    let (_, scene, steps) = events().swap_remove(1);
    let sliding = marched(scene, 1e-3, 0.2);
    let mut sticking = sliding.clone();
    sticking.settings.contacts.iter_mut().for_each(|contact| contact.solver = Solver::Coulomb);
    [sliding, sticking].iter().for_each(|scene| goes_on(scene, steps));
}

fn goes_on(scene: &Scene, steps: usize) {
    let mut simulation = started(scene);
    (0..steps / 3).for_each(|_| go(&mut simulation, H));
    let state = saved(&simulation);
    let mut other = Simulation::new(scene).unwrap();
    other.restore_state(&state).unwrap();
    let count = allocations_of(|| {
        (0..steps / 2).for_each(|_| simulation.do_step(simulation.time(), H).unwrap());
    });
    (0..steps / 2).for_each(|_| go(&mut other, H));
    assert_eq!(bits(&simulation), bits(&other));
    assert_eq!(count, 0);
    assert!(simulation.system().factorisations() > 100, "nothing touched");
}

/// Over a free edge and already behind the surface.
#[test]
fn node_passing_behind_the_surface_ends_the_run() {
    let distance = 0.5 * SIDE - 3e-3;
    let plates = [(BlockSide::Left, distance), (BlockSide::Right, distance)];
    let scene = marched(scene(faces([0.0, 0.12, 0.0]), &plates, false, [0.0, -40.0, 0.0]), 1e-3, 0.0);
    let mut simulation = started(&scene);
    let error = (0..200).find_map(|_| simulation.do_step(simulation.time(), H).err()).unwrap().to_string();
    assert!(error.contains("edge"), "{error}");
}

/// Some of its nodes leave the plate along z while they touch.
#[test]
fn body_sliding_off_an_edge_continues() {
    for friction in [0.0, 0.2] {
        let thrown = scene(faces([0.0, 0.0, 0.0295]), &[(BlockSide::Left, 0.0201)], false, [-4.0, 0.0, 20.0]);
        let mut simulation = started(&marched(thrown, 1e-3, friction));
        let (mut touched, mut both) = (0, 0);
        for step in 0..60 {
            if let Err(error) = simulation.do_step(simulation.time(), H) {
                panic!("µ {friction}, step {step}: {error}");
            }
            let touches = vector(&simulation, "force").into_iter().any(|force| force != 0.0);
            let [_, _, z] = vector(&simulation, "block.displacement");
            (touched, both) = (touched + u32::from(touches), both + u32::from(touches && z > 6e-4));
        }
        let [_, _, z] = vector(&simulation, "block.displacement");
        println!("µ {friction}: {touched} steps with contact, {both} of them beyond the edge");
        assert!(both > 2 && z > 0.02, "{touched} {both} {z}");
        assert!(real(&simulation, "energy_residual_relative").abs() < 1e-12);
    }
}

/// Thrown at a plate more normally than tangentially: vibration reverses the sliding, and sliding friction would add
/// energy.
#[test]
fn friction_that_adds_energy_ends_the_run() {
    for (rigid, tolerance) in [(false, 1e-1), (false, 1e-3), (true, 1e-1), (true, 1e-3)] {
        let mut thrown = scene(faces([0.0; 3]), &[(BlockSide::Left, 0.0201)], false, [-20.0, 3.0, 1.0]);
        thrown.settings.surfaces[0].rigid = rigid;
        let mut simulation = started(&marched(thrown, tolerance, 0.2));
        let start = real(&simulation, "kinetic_energy");
        let ended = (0..60).find_map(|_| {
            let energy = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
            assert!(energy < 1.01 * start, "{energy} J of {start} J");
            simulation.do_step(simulation.time(), H).err()
        });
        let reported = ended.map(|error| error.to_string()).unwrap_or_default();
        assert!(
            reported.contains("friction has added") && reported.contains("not model sticking"),
            "{rigid} {tolerance}: {reported}"
        );
    }
}

/// The same throws with sticking friction: friction only dissipates, and the error decreases with the tolerance.
#[test]
fn sticking_friction_only_dissipates_energy() {
    for rigid in [true, false] {
        let of = |tolerance: f64| {
            let mut thrown = scene(faces([0.0; 3]), &[(BlockSide::Left, 0.0201)], false, [-20.0, 3.0, 1.0]);
            thrown.settings.surfaces[0].rigid = rigid;
            let mut scene = marched(thrown, tolerance, 0.2);
            scene.settings.contacts[0].solver = Solver::Coulomb;
            scene
        };
        for tolerance in [1e-1, 1e-3] {
            let mut simulation = started(&of(tolerance));
            let start = real(&simulation, "kinetic_energy");
            for step in 0..60 {
                if let Err(error) = simulation.do_step(simulation.time(), H) {
                    panic!("{rigid} {tolerance}, step {step}: {error}");
                }
                let energy = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
                assert!(energy < (1.0 + 1e-9) * start, "{energy} J of {start} J");
                // Rounding of the ledger, which grows with the number of steps.
                let rounding = 1e-13 + 2.5e-16 * simulation.system().effort().steps as f64;
                assert!(real(&simulation, "energy_residual_relative").abs() < rounding);
            }
            let heat = simulation.system().ledger().friction_loss.value();
            assert!(heat > 1e-3 * start, "{heat} J");
        }
        let tolerances = [1e-1, 1e-2, 1e-3];
        let errors = over_tolerance(of, 60, &tolerances, 1e-5);
        print_row!("tolerances {tolerances:?}");
        print_row!("sticking, rigid {rigid}: error over tolerance {errors:.1?}");
        assert!(errors.iter().all(|error| *error < 6.0), "{errors:?}");
    }
    guide::hold("cargo test -p tiprub-core --test free sticking");
}

/// The tangential velocity is so small that friction stops the body: the model with massive contact nodes sticks as
/// well.
#[test]
fn rebound_after_stick_matches_light_contact_nodes() {
    let mut thrown = thrown_at_wall(sprung(), DISTANCE, [-VELOCITY, 0.05, 0.0]);
    thrown.settings.structures[1].damping_ratio = Some(0.0);
    let by_steps = |h: f64| {
        let mut scene = with(thrown.clone(), 0.2, Solver::Coulomb, Scheme::ModalExact);
        scene.settings.time.step = h;
        flown(&scene, 40)
    };
    let mut scene = marched(thrown.clone(), 1e-4, 0.2);
    scene.settings.contacts[0].solver = Solver::Coulomb;
    let stuck = flown(&scene, 40);
    let errors = [4e-8, 1e-8].map(|h| apart(&by_steps(h), &stuck));
    println!("modal-exact from galerkin {errors:?}");
    assert!(errors[1] < 0.6 * errors[0] && errors[1] < 1e-3, "{errors:?}");
}

/// Quasi-static modes may leave some directions rigid. For a body whose contact nodes are at the ends of all springs
/// there is no such direction.
#[test]
fn warns_of_contact_without_independent_flexibility() {
    let reported = |rom: Rom| {
        let scene = thrown_at_wall(rom, 0.0203, [-6.0, 30.0, 4.0]);
        let simulation = started(&marched(scene, 1e-3, 0.0));
        simulation.warnings().iter().filter(|text| text.contains("no independent flexibility")).count()
    };
    assert_eq!([reported(faces([0.0; 3])), reported(sprung())], [1, 0]);
}
