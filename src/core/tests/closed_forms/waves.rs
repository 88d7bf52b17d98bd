//! Waves around the circumference against closed forms: a cyclic chain pressed at rest, pressed by a casing with lobes
//! and by whirl that travel around it, and a flexible ring under a travelling load.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, Matrix2, Vector2};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{LoadSettings, Meridian, Shape};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_reference::closed::chain::Chain;
use tiprub_test_models::{
    self as models,
    disk::{TestDisk, with_rotor},
    started,
};

const CHAIN: Chain = Chain { sectors: 12, mass: 0.3, spring: 2e6, coupling: 7e5, damping_ratio: 0.05 };
/// Schemes that support a chain without local flexibility.
const SCHEMES: [Scheme; 2] = [Scheme::CentralDifference, Scheme::ModalExact];

fn set(simulation: &mut Simulation, name: &str, value: f64, rate: f64) {
    let reference = simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference;
    simulation.set_real(reference, value).unwrap();
    simulation.set_input_derivative(reference, 1, rate).unwrap();
}

/// Returns one radial degree of freedom per sector in a casing with radial normals; nothing turns.
fn chain(chain: Chain, scheme: Scheme, solver: Solver, step: f64) -> Scene {
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let disk = TestDisk {
        sectors: chain.sectors,
        nodes: 1,
        mass: [one(chain.mass), one(0.0)],
        stiffness: [one(chain.spring + 2.0 * chain.coupling), one(-chain.coupling)],
        contact_map: DMatrix::from_column_slice(3, 1, &[1.0, 0.0, 0.0]),
    };
    let mut scene = with_rotor(disk.cyclic());
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = step;
    scene.settings.structures[0].speed = 0.0;
    scene.settings.structures[0].damping_ratio = Some(chain.damping_ratio);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.surfaces[0].ramp_time = 0.0;
    let contact = &mut scene.settings.contacts[0];
    (contact.solver, contact.friction, contact.meridian, contact.gap) = (solver, 0.0, Meridian::Cylinder, 5e-4);
    scene
}

/// Closes the casing by `closing` (m) within `time` (s), then keeps it for `rest` (s).
fn close(simulation: &mut Simulation, closing: f64, time: f64, rest: f64) {
    set(simulation, "casing_radius_change", 0.0, -closing / time);
    simulation.do_step(simulation.time(), time).unwrap();
    set(simulation, "casing_radius_change", -closing, 0.0);
    simulation.do_step(simulation.time(), rest).unwrap();
}

fn radial(simulation: &Simulation, sector: usize) -> f64 {
    simulation.system().bank().row(0, sector)
}

/// Sectors 0 and `other` touch the casing: λ follows from two equations, all displacements from the influence function.
#[test]
fn pressed_chain_follows_its_influence_function() {
    println!("| scheme | solver | N | second sector | λ0 (N) | λ0 off by | λ off by | displacements off by |");
    println!("|---|---|---|---|---|---|---|---|");
    for scheme in SCHEMES {
        for solver in [Solver::Film, Solver::Lcp] {
            for (sectors, other) in [(2, 1), (7, 3), (12, 1), (12, 6), (56, 5)] {
                let chain_of = Chain { sectors, damping_ratio: 0.5, ..CHAIN };
                let mut scene = chain(chain_of, scheme, solver, 2e-6);
                let mut gaps = vec![6e-4; sectors];
                (gaps[0], gaps[other]) = (1e-4, 1.3e-4);
                scene.settings.contacts[0].sector_gaps = gaps;
                let mut simulation = started(&scene);
                close(&mut simulation, 2e-4, 5e-3, 3e-2);
                let influence = |a: usize, b: usize| chain_of.influence(a.abs_diff(b));
                let matrix = Matrix2::new(influence(0, 0), influence(0, other), influence(other, 0), influence(0, 0));
                let forces = matrix.try_inverse().unwrap() * Vector2::new(1e-4, 0.7e-4);
                let system = simulation.system();
                let found = [0, other].map(|sector| system.multiplier(0, sector));
                let off = (0..sectors).map(|sector| {
                    let exact = -forces[0] * influence(sector, 0) - forces[1] * influence(sector, other);
                    (radial(&simulation, sector) - exact).abs() / 1e-4
                });
                let off = off.fold(0.0, f64::max);
                let errors = [found[0] / forces[0] - 1.0, found[1] / forces[1] - 1.0];
                println!(
                    "| {scheme:?} | {solver:?} | {sectors} | {other} | {:.6} | {:.1e} | {:.1e} | {off:.1e} |",
                    forces[0], errors[0], errors[1]
                );
                assert!(errors.iter().all(|error| error.abs() < 1e-9) && off < 1e-9, "{errors:?} {off:e}");
            }
        }
    }
}

/// Returns the largest error of the force on any sector over a turn, relative to the amplitude of its wave, with all
/// sectors pressed on a casing whose shape gives every sector the displacement −B − A cos(nθ_s + ωt).
fn wave_error(simulation: &mut Simulation, n: u32, omega: f64, amplitude: f64, mean: f64) -> f64 {
    let (force, ahead) = CHAIN.wave_force(n, omega);
    let at_rest = CHAIN.mass * CHAIN.frequency(0).powi(2) * mean;
    let mut worst = 0.0_f64;
    let begin = simulation.time();
    simulation.begin_step(begin, TAU / omega.abs()).unwrap();
    let before = simulation.system().steps();
    loop {
        let finished = simulation.advance().unwrap().finished;
        let system = simulation.system();
        let step = system.bank().step();
        // λ enforces the gap at the end of the step and acts as the force at its beginning.
        let time = begin + step * (system.steps() - before - 1) as f64;
        assert_eq!(system.events().len(), CHAIN.sectors, "open at {time}");
        for event in system.events() {
            let angle = f64::from(n) * CHAIN.pitch() * event.sector as f64 + omega * time;
            let exact = -at_rest - amplitude * force * (angle + ahead).cos();
            worst = worst.max((event.force[0] - exact).abs());
        }
        if finished {
            return worst / (amplitude * force);
        }
    }
}

/// The rotor turns in a casing with n lobes and is pressed on it all around: the lobes move every sector, and the force
/// is the dynamic stiffness of nodal diameter n, also at its resonance, where only damping remains.
#[test]
fn lobe_response_matches_chain_dynamic_stiffness() {
    println!("| scheme | n | nω/ω_n | dynamic stiffness (N/m) | error with 128, 256, 512 steps per turn | order |");
    println!("|---|---|---|---|---|---|");
    for scheme in SCHEMES {
        for n in [1, 2, 3, 5] {
            for ratio in [0.3, 1.0, 1.6] {
                let omega = ratio * CHAIN.frequency(n);
                let (amplitude, closing) = (2e-5, 4e-4);
                let turn = TAU / omega;
                let errors = [128.0, 256.0, 512.0].map(|steps| {
                    let mut scene = chain(CHAIN, scheme, Solver::Lcp, turn / steps);
                    scene.settings.structures[0].speed = omega / f64::from(n);
                    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude, order: n, phase: 0.0 };
                    scene.settings.contacts[0].gap = 1e-4;
                    let mut simulation = started(&scene);
                    close(&mut simulation, closing, 8.0 * turn, 8.0 * turn);
                    wave_error(&mut simulation, n, omega, amplitude, closing - 1e-4)
                });
                let order = 0.5 * (errors[0] / errors[2]).log2();
                println!(
                    "| {scheme:?} | {n} | {ratio} | {:.4e} | {:.1e}, {:.1e}, {:.1e} | {order:.2} |",
                    CHAIN.wave_force(n, omega).0,
                    errors[0],
                    errors[1],
                    errors[2]
                );
                assert!((1.9..2.1).contains(&order), "{scheme:?}, n = {n}: {errors:?}");
            }
        }
    }
}

/// The shaft moves on a circle in a round casing that presses the turning rotor all around: nodal diameter 1 travels at
/// the speed of the shaft minus that of the rotor.
#[test]
fn whirl_response_matches_chain_dynamic_stiffness() {
    println!("| scheme | whirl/ω_1 | rotor/ω_1 | error at h = 20, 10, 5 µs | order |");
    println!("|---|---|---|---|---|");
    for scheme in SCHEMES {
        for (whirl, rotor) in [(0.4, 0.0), (0.9, -0.3), (-0.8, 0.8)] {
            let (whirl_speed, speed) = (whirl * CHAIN.frequency(1), rotor * CHAIN.frequency(1));
            let errors = [2e-5, 1e-5, 5e-6].map(|step| {
                let mut scene = chain(CHAIN, scheme, Solver::Lcp, step);
                scene.settings.structures[0].speed = speed;
                scene.settings.structures[0].whirl = true;
                scene.settings.contacts[0].gap = 1e-4;
                let mut simulation = started(&scene);
                close(&mut simulation, 4e-4, 5e-3, 1.5e-2);
                whirl_error(&mut simulation, whirl_speed, speed, step)
            });
            let order = 0.5 * (errors[0] / errors[2]).log2();
            println!(
                "| {scheme:?} | {whirl} | {rotor} | {:.1e}, {:.1e}, {:.1e} | {order:.2} |",
                errors[0], errors[1], errors[2]
            );
            assert!((1.9..2.1).contains(&order), "{errors:?}");
        }
    }
}

/// Returns the error as [`wave_error`] does, over two turns of a whirl that grows over the first 20 ms.
fn whirl_error(simulation: &mut Simulation, whirl: f64, rotor: f64, step: f64) -> f64 {
    let (begin, circle) = (simulation.time(), 2e-5);
    // In the frame of the rotor, where an outward displacement of the shaft at angle θ closes the gap there.
    let omega = rotor - whirl;
    let (force, ahead) = CHAIN.wave_force(1, omega);
    let at_rest = CHAIN.mass * CHAIN.frequency(0).powi(2) * 3e-4;
    let shaft = |time: f64| {
        let grown = (0.5 - 0.5 * (0.5 * TAU * (time / 0.02).min(1.0)).cos()) * circle;
        [grown * (whirl * time).cos(), grown * (whirl * time).sin()]
    };
    // The circle is curved: a shaft displaced by e_t along it closes the gap by another e_t²/2R, half of which is equal
    // on all sectors and half a wave with two diameters.
    let curved = circle * circle / (4.0 * (0.25 - 3e-4));
    let ((second, second_ahead), uniform) = (CHAIN.wave_force(2, 2.0 * omega), CHAIN.mass * CHAIN.frequency(0).powi(2));
    let mut worst = 0.0_f64;
    for index in 0.. {
        let (time, next) = (step * f64::from(index), step * f64::from(index + 1));
        if time > 0.02 + 2.0 * TAU / omega.abs() {
            break;
        }
        let (now, then) = (shaft(time), shaft(next));
        for (name, axis) in [("whirl_x", 0), ("whirl_y", 1)] {
            set(simulation, name, now[axis], (then[axis] - now[axis]) / step);
        }
        simulation.do_step(simulation.time(), step).unwrap();
        assert_eq!(simulation.system().events().len(), CHAIN.sectors, "open at {time}");
        if time < 0.02 + 2.0 * step {
            continue;
        }
        for event in simulation.system().events() {
            let turned = CHAIN.pitch() * event.sector as f64 + rotor * (begin + time) - whirl * time;
            let bent = curved * (second * (2.0 * turned + second_ahead).cos() - uniform);
            let exact = -at_rest - circle * force * (turned + ahead).cos() + bent;
            worst = worst.max((event.force[0] - exact).abs());
        }
    }
    worst / (circle * force)
}

/// A load of n nodal diameters that travels around the flexible casing causes a wave with the amplitude and phase lag
/// of its pair of modes.
#[test]
fn travelling_load_acts_as_a_harmonic_force() {
    println!("| scheme | n | ω/ω_n | amplitude (m) | error at h = 5, 2.5, 1.25 µs | order |");
    println!("|---|---|---|---|---|---|");
    for scheme in SCHEMES {
        for (n, hertz) in [(2, 400.0), (3, 1100.0)] {
            for ratio in [0.5, 1.0, -1.3] {
                let mut amplitude = 0.0;
                let errors = [5e-6, 2.5e-6, 1.25e-6].map(|step| {
                    let (error, exact) = travelling(scheme, n, TAU * hertz, ratio, step);
                    amplitude = exact;
                    error
                });
                let order = 0.5 * (errors[0] / errors[2]).log2();
                println!(
                    "| {scheme:?} | {n} | {ratio} | {amplitude:.4e} | {:.1e}, {:.1e}, {:.1e} | {order:.2} |",
                    errors[0], errors[1], errors[2]
                );
                assert!((1.9..2.1).contains(&order) && errors[2] < 1e-4, "{errors:?}");
            }
        }
    }
}

/// Returns the largest error of the casing's radial displacement over the last turn, relative to the amplitude, and the
/// amplitude (m).
fn travelling(scheme: Scheme, n: u32, own: f64, ratio: f64, step: f64) -> (f64, f64) {
    let (load, damping, omega) = (1e3, 0.05, ratio * own);
    let turn = TAU / omega.abs();
    // One step size for everything below.
    let step = turn / 24.0 / (turn / 24.0 / step).round();
    let mut scene = models::rub(1);
    models::flexible(&mut scene);
    scene.settings.outputs.watched_sectors = vec![1];
    scene.settings.outputs.nodal_diameters = None;
    (scene.settings.time.scheme, scene.settings.time.step) = (scheme, step);
    scene.settings.structures[0].speed = 0.0;
    scene.settings.structures[1].damping_ratio = Some(damping);
    scene.settings.structures[1].load = Some(LoadSettings { order: n, amplitude: load, phase: 0.0 });
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.contacts[0].gap = 2e-2;
    scene.settings.outputs.slave_displacement = true;
    // Under a constant load it starts in equilibrium.
    let mut simulation = started(&scene);
    set(&mut simulation, "casing_load_phase", 0.0, omega);
    let first = simulation.table().find("casing_displacement").unwrap().reference;
    // 26 time constants: e⁻²⁶ of the transient remains.
    simulation.do_step(0.0, (26.0 / (damping * own) / turn).ceil() * turn).unwrap();
    let phase = omega * simulation.time();
    set(&mut simulation, "casing_load_phase", phase, omega);
    // Modes of displacement 0.5 cos nθ and modal mass 1: the work of the line load per unit is π R/2.
    let force = load * std::f64::consts::PI * 0.25 * 0.5;
    let (real, imaginary) = (own * own - omega * omega, 2.0 * damping * own * omega);
    let (amplitude, lag) = (0.5 * force / real.hypot(imaginary), imaginary.atan2(real));
    let mut worst = 0.0_f64;
    for _ in 0..24 {
        simulation.do_step(simulation.time(), turn / 24.0).unwrap();
        let phase = omega * simulation.time();
        set(&mut simulation, "casing_load_phase", phase, omega);
        for node in 0..36 {
            let angle = f64::from(n) * TAU * f64::from(node) / 36.0 - phase + lag;
            let found = simulation.real(first + node).unwrap();
            worst = worst.max((found - amplitude * angle.cos()).abs());
        }
    }
    (worst / amplitude, amplitude)
}
