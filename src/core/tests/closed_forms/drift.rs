//! Energy over many undamped steps: in free flight, with permanently closed contact, and over lossless contacts; and
//! the sums of the energy ledger.
//!
//! 1e5 steps here; 1e7 by `cargo test --release -p tiprub-core --test closed_forms drift -- --ignored --nocapture`.

use crate::guide::print_row;
use crate::rods::{NEARLY_NONE, SCHEMES, StraightRod, against_plane, quiet_step, set_samples, single};
use tiprub_core::Ledger;
use tiprub_core::geometry::PrescribedMotion;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::System;
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_cosim::Sum;
use tiprub_cosim::persist::{Persist, StateReader, StateWriter};

/// Returns a rod of 12 elements, whose contact node has mass or not as the scheme requires.
fn rod(scheme: Scheme) -> ModalModel {
    let kept = if scheme == Scheme::MasslessBoundary { NEARLY_NONE } else { 1.0 };
    StraightRod { young: 2e11, density: 7800.0, area: 1e-4, length: 0.1, elements: 12, end: 0, kept }.model()
}

/// Lets the elastic modes vibrate with 1 mJ each.
fn ring(system: &mut System, model: &ModalModel, amplitude: f64) {
    for mode in 1..model.dynamic_modes(system.settings().scheme).min(8) {
        let omega = model.frequencies[mode];
        let swing = |time: f64| amplitude / omega * (omega * time + mode as f64).cos();
        let step = system.bank().step();
        set_samples(system, model, mode, swing(0.0), swing(-step));
    }
}

/// Returns the largest change of the energy relative to that at the start, and its change at the end.
fn march(system: &mut System, steps: u64, load: Option<f64>) -> [f64; 2] {
    let mut swing = [f64::INFINITY, f64::NEG_INFINITY];
    let energy = |system: &System| {
        let (kinetic, strain) = system.energies();
        // Potential energy of the load, as the scheme defines it.
        let potential = load.map_or(0.0, |load| {
            let (position, increment) = system.bank().modal_state(0, 0);
            -load * (position - 0.5 * increment)
        });
        kinetic + strain + potential
    };
    let step = |system: &mut System| {
        if let Some(load) = load {
            system.bank_mut().loads_mut()[0] = load;
        }
        Recurrence.step(system, &[PrescribedMotion::default()]).unwrap();
    };
    // The first steps find the contact that is closed from the start.
    for _ in 0..4 {
        step(system);
    }
    let (before, mut most) = (energy(system), 0.0_f64);
    for _ in 0..steps {
        step(system);
        let strain = system.energies().1;
        swing = [swing[0].min(strain), swing[1].max(strain)];
        most = most.max((energy(system) / before - 1.0).abs());
    }
    // Something moves: strain energy varies.
    assert!(swing[1] > 1.5 * swing[0], "{swing:?}");
    [most, energy(system) / before - 1.0]
}

fn free(scheme: Scheme, steps: u64) -> [f64; 2] {
    let model = rod(scheme);
    let mut system = against_plane(&model, (scheme, Solver::Lcp), 1.0, 1.0, false);
    system.set_step(quiet_step(&model, 1e-6));
    ring(&mut system, &model, 0.03);
    system.start(&[PrescribedMotion::default()]);
    march(&mut system, steps, None)
}

/// Returns the energy change of a rod that is pressed onto the plane by a load on its rigid-body mode and vibrates
/// without opening.
fn closed(scheme: Scheme, steps: u64) -> [f64; 2] {
    let model = rod(scheme);
    let mut system = against_plane(&model, (scheme, Solver::Lcp), 1.0, 0.0, true);
    system.set_step(quiet_step(&model, 1e-6));
    system.start(&[PrescribedMotion::default()]);
    let load = -2e4;
    // Half of the load is applied slowly, the other half suddenly: the rod vibrates between half and one and a half
    // times its static deflection.
    for index in 0..20_000 {
        let share = f64::from(index) / 20_000.0;
        system.bank_mut().loads_mut()[0] = 0.5 * load * share * share * (3.0 - 2.0 * share);
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
    }
    let losses = system.ledger().impact_loss.value();
    let found = march(&mut system, steps, Some(load));
    // A contact that opened would have lost energy when it closed.
    let lost = system.ledger().impact_loss.value() - losses;
    assert!(scheme == Scheme::MasslessBoundary || lost.abs() < 1e-12 * system.ledger().scale(), "{lost:e}");
    found
}

/// Returns the energy change over impacts on an elastic stop without loss: massless-boundary only.
fn impacts(steps: u64, step: f64) -> [f64; 2] {
    let omega = 60.0;
    let model = single(&[(omega, 1.0), (1e5, 1e5 / (3.0 * omega))], 1);
    let mut system = against_plane(&model, (Scheme::MasslessBoundary, Solver::Lcp), -1.0, 1e-3, false);
    system.set_step(step);
    set_samples(&mut system, &model, 0, -2e-3, -2e-3 * (omega * step).cos());
    system.start(&[PrescribedMotion::default()]);
    march(&mut system, steps, None)
}

fn measure(steps: u64) {
    print_row!("| energy over {steps} steps | scheme | largest change | change at the end |");
    print_row!("|---|---|---|---|");
    for scheme in SCHEMES {
        for (name, [most, end]) in [("free flight", free(scheme, steps)), ("closed contact", closed(scheme, steps))] {
            print_row!("| {name} | {scheme:?} | {most:.1e} | {end:+.1e} |");
            // Rounding errors accumulate with the square root of the number of steps.
            let bound = 1e-13 * (steps as f64).sqrt();
            assert!(most < bound, "{name}, {scheme:?}: {most:e}");
        }
    }
    for step in [2e-4, 1e-4, 5e-5] {
        let [most, end] = impacts(steps, step);
        print_row!("| elastic impacts, h = {} µs | MasslessBoundary | {most:.1e} | {end:+.1e} |", step * 1e6);
        assert!(most < 0.05, "{most:e}");
    }
}

#[test]
fn energy_is_conserved_over_100000_undamped_steps() {
    measure(100_000);
    crate::guide::hold("cargo test -p tiprub-core --test closed_forms drift");
}

#[test]
#[ignore = "half a minute"]
fn energy_is_conserved_over_ten_million_undamped_steps() {
    measure(10_000_000);
}

/// A thousandth of a rounding error added a million times, and a term larger than the sum so far: no term is lost, not
/// even in a saved state.
#[test]
fn compensated_sums_keep_small_terms() {
    let mut sum = Sum::default();
    sum.add(1.0);
    let term = 1e-3 * f64::EPSILON;
    for index in 0..1_000_000 {
        sum.add(term);
        if index == 500_000 {
            let mut bytes = [0; 64];
            sum.save(&mut StateWriter::new(&mut bytes));
            sum = Sum::default();
            sum.restore(&mut StateReader::new(&bytes));
        }
    }
    assert!(((sum.value() - 1.0) / (1e6 * term) - 1.0).abs() < 1e-3, "{:e}", sum.value() - 1.0);
    let mut sum = Sum::default();
    for term in [1.0, 1e100, 1.0, -1e100] {
        sum.add(term);
    }
    assert_eq!(sum.value().to_bits(), 2.0_f64.to_bits());
}

/// A term of the balance and its sign.
type Term = (fn(&mut Ledger) -> &mut Sum, f64);

/// Every term has its sign, and the small difference of large work in and out is exact in the ledger.
#[test]
fn residual_is_the_balance_without_cancellation() {
    let terms: [Term; 12] = [
        (|ledger| &mut ledger.shaft_work, 1.0),
        (|ledger| &mut ledger.friction_loss, -1.0),
        (|ledger| &mut ledger.stiffening_work, 1.0),
        (|ledger| &mut ledger.whirl_work, 1.0),
        (|ledger| &mut ledger.shift_work, 1.0),
        (|ledger| &mut ledger.casing_work, 1.0),
        (|ledger| &mut ledger.curvature_work, 1.0),
        (|ledger| &mut ledger.load_work, 1.0),
        (|ledger| &mut ledger.step_change, 1.0),
        (|ledger| &mut ledger.damping_loss, -1.0),
        (|ledger| &mut ledger.impact_loss, -1.0),
        (|ledger| &mut ledger.wear_work, -1.0),
    ];
    for (index, (term, sign)) in terms.into_iter().enumerate() {
        let mut ledger = Ledger { initial: 3.0, ..Ledger::default() };
        let large = if index < 2 { 0.0 } else { 1e16 };
        ledger.shaft_work.add(large);
        ledger.friction_loss.add(large);
        term(&mut ledger).add(0.25);
        assert_eq!(ledger.residual(2.0).to_bits(), (1.0 + 0.25 * sign).to_bits(), "term {index}");
    }
}
