//! Spin in modal coordinates against closed forms.

use nalgebra::DMatrix;
use tiprub_core::dynamics::bank::{BankOptions, ModalBank};
use tiprub_core::dynamics::modal::{ModalModel, ModalSpin};
use tiprub_core::schemes::free_increment;
use tiprub_core::settings::Scheme;

const SPEED: f64 = 1800.0;
const RESTING: f64 = 5000.0;
/// Entry of G: the whirl of a point mass is turned by Ωg.
const SKEW: f64 = 0.7;
/// Stiffness per Ω².
const STIFFENING: f64 = 3.0;
const AMPLITUDE: f64 = 1e-3;

/// Two modes of one frequency that Coriolis force couples, with the modes of speed 0.
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
        stiffness_speed2: DMatrix::identity(2, 2) * STIFFENING,
        stiffness_speed4: DMatrix::zeros(2, 2),
        coriolis: DMatrix::from_row_slice(2, 2, &[0.0, -SKEW, SKEW, 0.0]),
    };
    let coupling = Some((spin, stiffening, coriolis));
    let mut bank = ModalBank::with_options(&model, 1, BankOptions { coupling, ..BankOptions::default() });
    bank.set_step(scheme, 1e-6);
    bank.set_speed(SPEED);
    bank
}

/// With z = q₁ + iq₂: z̈ + 2iΩg ż + ω²z = 0, so that z = e^(ist), s = √(ω² + Ω²g²) − Ωg, circles at constant speed.
fn whirl(stiffening: bool, coriolis: bool) -> f64 {
    let square = RESTING * RESTING + if stiffening { STIFFENING * SPEED * SPEED } else { 0.0 };
    let turned = if coriolis { SPEED * SKEW } else { 0.0 };
    (square + turned * turned).sqrt() - turned
}

/// Put the bank on the circle with the increment that it has there.
fn start(bank: &mut ModalBank, rate: f64) {
    let step = bank.step();
    let points = [[0.0_f64.cos(), 0.0], [(rate * step).cos(), -(rate * step).sin()]];
    for mode in 0..2 {
        let (now, before) = (AMPLITUDE * points[0][mode], AMPLITUDE * points[1][mode]);
        // The velocity of the free motion that has this increment.
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
fn whirl_has_the_frequency_of_the_closed_form_and_keeps_its_energy() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        for (stiffening, coriolis) in [(false, true), (true, false), (true, true)] {
            let rate = whirl(stiffening, coriolis);
            let error = |step: f64, steps: u32| {
                let mut bank = bank(scheme, stiffening, coriolis);
                bank.set_step(scheme, step);
                start(&mut bank, rate);
                (0..steps).for_each(|_| bank.predict(true));
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
            (0..1_000_000).for_each(|_| bank.predict(true));
            let drift = energy(&bank) / before - 1.0;
            assert!(drift.abs() < 1e-9, "{scheme:?}: {drift:e}");
        }
    }
}

#[test]
fn whirl_goes_on_over_changes_of_step() {
    for (stiffening, coriolis) in [(false, true), (true, false), (true, true)] {
        let rate = whirl(stiffening, coriolis);
        let mut bank = bank(Scheme::ModalExact, stiffening, coriolis);
        start(&mut bank, rate);
        let (mut time, mut alone) = (0.0, 0.0_f64);
        for block in 0..2000 {
            // Long steps after short ones more often than back: what a change adds does not cancel.
            bank.resample(Scheme::ModalExact, [4e-7, 8e-7, 1.6e-6][block % 3], &[]);
            for _ in 0..5 {
                bank.predict(true);
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
