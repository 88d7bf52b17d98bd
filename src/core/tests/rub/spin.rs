//! Spin in modal coordinates against closed forms, and in scenes whose speed changes.

use nalgebra::DMatrix;
use tiprub_core::modes::bank::{BankOptions, ModalBank, SectorModel};
use tiprub_core::modes::modal::{ModalModel, ModalSpin};
use tiprub_core::modes::schemes::free_increment;
use tiprub_core::scene::method::Scheme;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{self as models, real, saved, set, slope, started};

use crate::inputs::{held, spinning_rom, whirling};

const SPEED: f64 = 1800.0;
const RESTING: f64 = 5000.0;
/// Entry of G: the whirl of a point mass turns by Ωg.
const SKEW: f64 = 0.7;
/// Stiffness per Ω².
const STIFFENING: f64 = 3.0;
const AMPLITUDE: f64 = 1e-3;

/// Returns two modes of one frequency that the Coriolis force couples, with the modes of speed 0.
fn bank(scheme: Scheme, stiffening: bool, coriolis: bool) -> ModalBank {
    let model = ModalModel {
        frequencies: vec![RESTING; 2],
        damping_ratios: vec![0.0; 2],
        contact_modes: DMatrix::from_fn(3, 2, |row, mode| if row == mode { 1.0 } else { 0.0 }),
        shapes: DMatrix::identity(2, 2),
        quasi_static: 0,
    };
    let spin = ModalSpin {
        reference_speed: 0.0,
        reference_temperature: 0.0,
        softening: None,
        stiffness_speed2: DMatrix::identity(2, 2) * STIFFENING,
        stiffness_speed4: DMatrix::zeros(2, 2),
        coriolis: DMatrix::from_row_slice(2, 2, &[0.0, -SKEW, SKEW, 0.0]),
    };
    let coupling = Some((spin, stiffening, coriolis));
    let mut bank =
        ModalBank::new(SectorModel::Uncoupled(&model, 1), BankOptions { coupling, ..BankOptions::default() });
    bank.set_step(scheme, 1e-6);
    bank.set_speed(SPEED, 0.0);
    bank
}

/// Returns the rate of the whirl. With z = q₁ + iq₂: z̈ + 2iΩg ż + ω²z = 0, so that z = e^(ist), s = √(ω² + Ω²g²) − Ωg,
/// circles at constant speed.
fn whirl(stiffening: bool, coriolis: bool) -> f64 {
    let square = RESTING * RESTING + if stiffening { STIFFENING * SPEED * SPEED } else { 0.0 };
    let turned = if coriolis { SPEED * SKEW } else { 0.0 };
    (square + turned * turned).sqrt() - turned
}

/// Puts the bank on the circle, with the increment that belongs to it.
fn start(bank: &mut ModalBank, rate: f64) {
    let step = bank.step();
    let points = [[0.0_f64.cos(), 0.0], [(rate * step).cos(), -(rate * step).sin()]];
    for mode in 0..2 {
        let (now, before) = (AMPLITUDE * points[0][mode], AMPLITUDE * points[1][mode]);
        // Velocity of the free motion with this increment.
        let (at_rest, per_velocity) =
            (free_increment(RESTING, 0.0, now, 0.0, step), free_increment(RESTING, 0.0, 0.0, 1.0, step));
        bank.set_modal_state(mode, 0, now, (now - before - at_rest) / per_velocity);
    }
    bank.recover();
}

fn distance(bank: &ModalBank, angle: f64) -> f64 {
    let (x, y) = (bank.modal_state(0, 0).0, bank.modal_state(1, 0).0);
    (x - AMPLITUDE * angle.cos()).hypot(y - AMPLITUDE * angle.sin()) / AMPLITUDE
}

fn energy(bank: &ModalBank) -> f64 {
    let (kinetic, strain) = bank.energies();
    kinetic + strain
}

#[test]
fn whirl_has_the_closed_form_frequency() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        for (stiffening, coriolis) in [(false, true), (true, false), (true, true)] {
            let rate = whirl(stiffening, coriolis);
            let error = |step: f64, steps: u32| {
                let mut bank = bank(scheme, stiffening, coriolis);
                bank.set_step(scheme, step);
                start(&mut bank, rate);
                (0..steps).for_each(|_| bank.predict());
                distance(&bank, rate * f64::from(steps) * step)
            };
            let (coarse, fine) = (error(4e-6, 5000), error(2e-6, 10_000));
            let order = (coarse / fine).log2();
            println!(
                "{scheme:?}, stiffening {stiffening}, Coriolis {coriolis}: error {coarse:.2e}, {fine:.2e}, order {order:.2}"
            );
            assert!(fine < 5e-3 && order > 1.9, "{fine:e}, order {order}");
            let mut bank = bank(scheme, stiffening, coriolis);
            start(&mut bank, rate);
            let before = energy(&bank);
            (0..1_000_000).for_each(|_| bank.predict());
            let drift = energy(&bank) / before - 1.0;
            assert!(drift.abs() < 1e-9, "{scheme:?}: {drift:e}");
        }
    }
}

#[test]
fn whirl_continues_across_step_size_changes() {
    for (stiffening, coriolis) in [(false, true), (true, false), (true, true)] {
        let rate = whirl(stiffening, coriolis);
        let mut bank = bank(Scheme::ModalExact, stiffening, coriolis);
        start(&mut bank, rate);
        let (mut time, mut alone) = (0.0, 0.0_f64);
        for block in 0..2000 {
            // Changes to longer steps are more frequent than changes back, so that their effects do not cancel.
            bank.resample(Scheme::ModalExact, [4e-7, 8e-7, 1.6e-6][block % 3], &[]);
            for _ in 0..5 {
                bank.predict();
                time += bank.step();
            }
            alone = alone.max(distance(&bank, rate * time));
        }
        println!(
            "stiffening {stiffening}, Coriolis {coriolis}: off by {alone:.1e} of the amplitude after 2000 changes"
        );
        assert!(alone < 8e-5, "{alone:e}");
    }
}

/// The growth of one blade under Ω²c, with a speed that jumps and with the same speed ramped.
#[test]
fn growth_and_stiffening_smooth_out_speed_jumps() {
    let mut scene = whirling();
    scene.roms[0] = spinning_rom();
    (scene.settings.structures[0].spin.growth, scene.settings.structures[0].spin.stiffening) = (true, true);
    scene.settings.contacts[0].friction = 0.0;
    let shaken = |scene: &Scene, line: bool| {
        let (mut simulation, length, mut most) = (started(scene), 4e-3, 0.0_f64);
        for index in 0..3 {
            let speed = 1300.0 + 100.0 * f64::from(index);
            set(&mut simulation, "speed", speed);
            if line {
                slope(&mut simulation, "speed", 100.0 / length);
            }
            simulation.begin_step(simulation.time(), length).unwrap();
            while !simulation.advance().unwrap().finished {
                most = most.max(simulation.system().energies().0);
            }
        }
        (most, real(&simulation, "energy_residual_relative").abs())
    };
    let [(ramp, closed), (line, _), (hold, _)] =
        [(&scene, false), (&scene, true), (&held(scene.clone()), false)].map(|(scene, line)| shaken(scene, line));
    println!("kinetic energy of the blades: ramp {ramp:.3e} J, derivatives {line:.3e} J, hold {hold:.3e} J");
    assert!(ramp < 0.1 * hold && (ramp / line - 1.0).abs() < 0.5 && closed < 1e-9, "{ramp} {line} {hold} {closed}");
}

/// Blades stretched by a speed rest at the solution of K(Ω)u = Ω²c₂ + Ω⁴c₄ in the coordinates of the ROM.
#[test]
fn centrifugal_growth_uses_the_stiffness_at_speed() {
    let mut scene = whirling();
    scene.roms[0] = spinning_rom();
    scene.settings.contacts[0].gap = 5e-3;
    for (speed, stiffening) in [(300.0, true), (1300.0, true), (1300.0, false), (-1900.0, true)] {
        let structure = &mut scene.settings.structures[0];
        (structure.speed, structure.spin.growth, structure.spin.stiffening) = (speed, true, stiffening);
        // Both powers count: they are equal at 1000 rad/s.
        let mut spin = models::spin(scene.roms[0].order());
        let loads = spin.centrifugal_load.iter().enumerate();
        spin.centrifugal_load_speed4 = loads.map(|(i, load)| load * (1e-6 - 1e-7 * i as f64)).collect();
        scene.roms[0].extras.spin = Some(spin.clone());
        let rom = &scene.roms[0];
        let square = speed * speed;
        // The stiffness of a resting blade goes with the force of a resting blade.
        let (fourth, share) = (square * square, if stiffening { 1.0 } else { 0.0 });
        let stiffness = &rom.stiffness + (&spin.stiffness_speed2 * square + &spin.stiffness_speed4 * fourth) * share;
        let force = |i: usize| square * spin.centrifugal_load[i] + share * fourth * spin.centrifugal_load_speed4[i];
        let load = nalgebra::DVector::from_fn(rom.order(), |i, _| force(i));
        let expected = &rom.contact_map * stiffness.lu().solve(&load).unwrap();
        let mut simulation = started(&scene);
        let error = |simulation: &Simulation| {
            let bank = simulation.system().bank();
            let off = |row: usize, sector: usize| (bank.row(row, sector) - expected[row]).abs();
            (0..9)
                .flat_map(|row| (0..6).map(move |sector| (row, sector)))
                .map(|(row, sector)| off(row, sector))
                .fold(0.0, f64::max)
        };
        let at_start = error(&simulation);
        (0..100).for_each(|_| simulation.do_step(simulation.time(), 1e-5).unwrap());
        let (later, size) = (error(&simulation), expected.amax());
        println!(
            "{speed} rad/s: grown by {size:.2e} m, off by {at_start:.1e} m, and {later:.1e} m a millisecond later"
        );
        assert!(size > 1e-7 && at_start < 1e-9 * size && later < 1e-8 * size, "{at_start:e}, {later:e} of {size:e}");
    }
}

/// A blade keeps vibrating while its rotor accelerates, with the stiffness of the middle of each step: second order in
/// H.
#[test]
fn held_speed_input_acts_by_its_mean_over_the_step() {
    let mut scene = held(models::rub(1));
    let order = scene.roms[0].order();
    let mut spin = models::spin(order);
    spin.stiffness_speed2 = nalgebra::DMatrix::identity(order, order) * 3.0;
    spin.stiffness_speed4.fill(0.0);
    scene.roms[0].extras.spin = Some(spin);
    scene.settings.structures[0].spin.stiffening = true;
    (scene.settings.outputs.watched_sectors, scene.settings.outputs.nodal_diameters) = (vec![1], None);
    let mut rubbed = started(&scene);
    while rubbed.time() < 2e-3 {
        rubbed.do_step(rubbed.time(), 5e-5).unwrap();
    }
    // Without the casing from here on.
    set(&mut rubbed, "casing_shape_factor", 0.0);
    set(&mut rubbed, "casing_radius_change", 5e-3);
    let left = saved(&rubbed);
    let end = |steps: u32| {
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.restore_state(&left).unwrap();
        let (start, length, rate) = (simulation.time(), 8e-4 / f64::from(steps), 5e5);
        for index in 0..steps {
            set(&mut simulation, "speed", 1300.0 + rate * length * f64::from(index));
            slope(&mut simulation, "speed", rate);
            simulation.do_step(start + f64::from(index) * length, length).unwrap();
        }
        assert!(simulation.system().events().is_empty());
        (0..order).map(|mode| simulation.system().bank().modal_state(mode, 0).0).collect::<Vec<_>>()
    };
    let exact = end(800);
    let error = |steps| {
        let found = end(steps);
        let off = found.iter().zip(&exact).map(|(found, exact)| (found - exact).powi(2)).sum::<f64>();
        (off / exact.iter().map(|value| value * value).sum::<f64>()).sqrt()
    };
    let [coarse, middle, fine] = [8, 16, 32].map(error);
    let orders = [coarse / middle, middle / fine].map(f64::log2);
    println!("errors {coarse:.1e}, {middle:.1e}, {fine:.1e}: orders {orders:.2?}");
    assert!(orders.iter().all(|order| *order > 1.7) && fine < 1e-3, "{orders:?}");
}
