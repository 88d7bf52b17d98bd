//! Energies, states of rest, and instruction sets.

use super::*;

/// Free motion conserves ½q̇² + ½ω²q² exactly, even if the energy that the scheme conserves is only half as large. A
/// state at rest has no kinetic energy, under a load as well as under a persistent contact force.
#[test]
fn instantaneous_energy_matches_the_motion() {
    let frequencies = vec![0.0, 1e3, 4e4, 1.2e5];
    let model = ModalModel {
        damping_ratios: vec![0.0; 4],
        contact_modes: DMatrix::from_fn(3, 4, |row, mode| 1.0 + row as f64 - 0.3 * mode as f64),
        shapes: DMatrix::identity(4, 4),
        quasi_static: 0,
        frequencies,
    };
    let mut bank = ModalBank::new(SectorModel::Uncoupled(&model, 3), BankOptions::default());
    bank.set_step(Scheme::ModalExact, 2e-5);
    let mut expected = 0.0;
    for sector in 0..3 {
        for (mode, frequency) in model.frequencies.iter().enumerate() {
            let (q, v) = (1e-4 * (1.0 + sector as f64), 0.3 - 0.1 * mode as f64);
            bank.set_modal_state(mode, sector, q, v);
            expected += 0.5 * v * v + 0.5 * frequency * frequency * q * q;
        }
    }
    for _ in 0..500 {
        bank.predict();
        let (kinetic, strain) = bank.energies_now(&[]);
        assert!((kinetic + strain - expected).abs() < 1e-10 * expected && kinetic >= 0.0 && strain >= 0.0);
    }
    let (kinetic, strain) = bank.energies();
    assert!(kinetic + strain < 0.6 * expected, "the energy that is conserved leaves out modes beyond the step");

    let mut bank =
        ModalBank::new(SectorModel::Uncoupled(&model, 1), BankOptions { loads: true, ..BankOptions::default() });
    bank.set_step(Scheme::ModalExact, 2e-5);
    let modal_load = [0.0, 30.0, 4e3, 1e4];
    bank.settle(&modal_load);
    bank.loads_mut().copy_from_slice(&modal_load);
    let terms =
        modal_load.iter().zip(&model.frequencies).skip(1).map(|(load, frequency)| 0.5 * (load / frequency).powi(2));
    let at_rest: f64 = terms.sum();
    bank.predict();
    let (kinetic, strain) = bank.energies_now(&[]);
    assert!(kinetic < 1e-20 * at_rest && (strain - at_rest).abs() < 1e-12 * at_rest, "{kinetic:e}, {strain:e}");

    // A contact force on the rows that holds the vibration modes in place.
    let held = ModalModel {
        frequencies: vec![1.2e5; 3],
        damping_ratios: vec![0.01; 3],
        contact_modes: model.contact_modes.columns(0, 3).into_owned(),
        shapes: DMatrix::identity(3, 3),
        quasi_static: 0,
    };
    let mut bank = ModalBank::new(SectorModel::Uncoupled(&held, 1), BankOptions::default());
    bank.set_step(Scheme::ModalExact, 2e-5);
    let force = [3.0, -2.0, 5.0];
    for mode in 0..3 {
        let load: f64 = (0..3).map(|row| held.contact_modes[(row, mode)] * force[row]).sum();
        let index = bank.index(mode, 0);
        bank.state.position[index] = load / 1.44e10;
    }
    let (kinetic, strain) = bank.energies_now(&force);
    assert!(kinetic < 1e-20 * strain && strain > 0.0, "{kinetic:e}, {strain:e}");
}

/// Three modes with inertia and one mode that is quasi-static under massless-boundary.
fn small(damping: f64) -> ModalModel {
    ModalModel {
        frequencies: vec![0.0, 1e3, 4e3, 2e4],
        damping_ratios: vec![damping; 4],
        contact_modes: DMatrix::from_fn(3, 4, |row, mode| 1.0 + row as f64 - 0.3 * mode as f64),
        shapes: DMatrix::identity(4, 4),
        quasi_static: 1,
    }
}

#[test]
fn reset_to_rest_clears_previous_loads() {
    let model = small(0.01);
    let spin = ModalSpin {
        reference_speed: 0.0,
        reference_temperature: 0.0,
        softening: None,
        stiffness_speed2: DMatrix::identity(4, 4) * 3.0,
        stiffness_speed4: DMatrix::zeros(4, 4),
        coriolis: DMatrix::zeros(4, 4),
    };
    let coupling = Some((spin, true, false));
    for (scheme, sectors) in [
        (Scheme::ModalExact, 1),
        (Scheme::ModalExact, 3),
        (Scheme::CentralDifference, 3),
        (Scheme::MasslessBoundary, 1),
    ] {
        let options = BankOptions { loads: true, coupling: coupling.clone(), ..BankOptions::default() };
        let mut bank = ModalBank::new(SectorModel::Uncoupled(&model, sectors), options);
        bank.set_step(scheme, 2e-5);
        bank.set_speed(500.0, 0.0);
        for _ in 0..5 {
            bank.loads_mut().copy_from_slice(&[1.0, -2.0, 30.0, 4e3]);
            bank.predict();
            bank.correct(sectors - 1, &[3.0, -2.0, 5.0]);
            assert!(bank.finish_loads() != 0.0);
        }
        bank.rest();
        bank.set_step(scheme, 2e-5);
        assert_eq!((bank.energies_now(&[]), bank.energies(), bank.collect_loss()), ((0.0, 0.0), (0.0, 0.0), 0.0));
        assert!(bank.displacement().iter().chain(bank.displacement_before()).all(|value| *value == 0.0));
        // Neither another step length nor a load moves an unloaded structure.
        bank.resample(scheme, 7e-6, &[]);
        bank.predict();
        assert_eq!((bank.finish_loads(), bank.energies_now(&[])), (0.0, (0.0, 0.0)), "{scheme:?}");
        // The stiffness is again that of the reference speed: a mode of 1000 rad/s.
        bank.set_modal_state(1, 0, 1.0, 0.0);
        assert_eq!(bank.energies_now(&[]).1.to_bits(), 5e5_f64.to_bits());
    }
}

#[test]
fn quasi_static_modes_start_without_motion() {
    let model = small(0.0);
    let mut bank = ModalBank::new(SectorModel::Uncoupled(&model, 3), BankOptions::default());
    bank.set_step(Scheme::MasslessBoundary, 2e-5);
    let mut expected = 0.0;
    for (mode, frequency) in model.frequencies.iter().enumerate() {
        bank.set_modal_state(mode, 2, 1e-4, 0.3);
        expected += if mode < 3 { 0.5 * (0.09 + (1e-4 * frequency).powi(2)) } else { 0.0 };
    }
    let sum = |(kinetic, strain): (f64, f64)| kinetic + strain;
    assert!((sum(bank.energies_now(&[])) / expected - 1.0).abs() < 1e-12, "{expected} J");
    // The energy that the undamped scheme conserves is constant from the start.
    let at_first = sum(bank.energies());
    bank.predict();
    assert!((sum(bank.energies()) / at_first - 1.0).abs() < 1e-12);
}

/// Compares the widest instruction set with the baseline; without wider registers the baseline is compared with itself.
#[test]
fn every_instruction_set_gives_the_same_bits() {
    let modes = 11;
    let model = ModalModel {
        frequencies: (1..=modes).map(|mode| 700.0 * f64::from(mode).powi(2)).collect(),
        damping_ratios: vec![0.005; 11],
        contact_modes: DMatrix::from_fn(15, 11, |row, mode| (1.7 * row as f64 + 0.9 * mode as f64).sin()),
        shapes: DMatrix::identity(11, 11),
        quasi_static: 0,
    };
    let run = |instruction_set| {
        let mut bank = ModalBank::new(SectorModel::Uncoupled(&model, 13), BankOptions::default());
        bank.instruction_set = instruction_set;
        bank.set_step(Scheme::ModalExact, 1e-6);
        let force: Vec<f64> = (0..15).map(|row| f64::from(row).cos()).collect();
        for step in 0..500 {
            bank.predict();
            bank.correct(step % 13, &force);
        }
        let state = &bank.state;
        let all = [&state.position, &state.increment, &state.displacement, &state.loss];
        all.iter().flat_map(|values| values.iter().map(|value| value.to_bits())).collect::<Vec<_>>()
    };
    assert_eq!(run(InstructionSet::Baseline), run(InstructionSet::detect()));
}
