//! Energies, states of rest, instruction sets, and displacements compared with modes.

use super::*;
use crate::modes::bank::{BankOptions, SectorModel};
use crate::modes::cyclic::DiameterModes;
use crate::scene::method::Scheme;
use nalgebra::{Complex, DMatrix};

fn bank(model: &CyclicModel, loads: bool) -> ModalBank {
    ModalBank::new(SectorModel::Coupled(model), BankOptions { loads, ..BankOptions::default() })
}

pub(super) fn model(sectors: usize, nodes: usize) -> CyclicModel {
    let diameter = |n: usize| {
        // Some nodal diameters have fewer modes than others.
        let modes = 3 * nodes + 4 - n % 3;
        let real = n == 0 || 2 * n == sectors;
        let shape = |row: usize, mode: usize| {
            let x = 1.7 * row as f64 + 0.9 * mode as f64 + 0.4 * n as f64;
            Complex::new(x.sin(), if real { 0.0 } else { (1.3 * x).cos() })
        };
        DiameterModes {
            frequencies: (1..=modes).map(|mode| 700.0 * (mode * mode) as f64 + 50.0 * n as f64).collect(),
            damping_ratios: vec![0.005; modes],
            contact_modes: DMatrix::from_fn(3 * nodes, modes, shape),
            shapes: DMatrix::identity(modes, modes),
            quasi_static: 3 * nodes,
        }
    };
    CyclicModel { sectors, diameters: (0..=sectors / 2).map(diameter).collect() }
}

/// Free motion conserves ½q̇² + ½ω²q² of every nodal diameter, which differs from the energy that the scheme conserves.
#[test]
fn instantaneous_energy_matches_the_motion() {
    let mut undamped = model(11, 2);
    undamped.set_damping_ratio(0.0, &[]);
    let mut bank = bank(&undamped, false);
    bank.set_step(Scheme::ModalExact, 2e-5);
    let mut expected = 0.0;
    for (n, diameter) in undamped.diameters.iter().enumerate() {
        for (mode, frequency) in diameter.frequencies.iter().enumerate() {
            let (q, v) = (1e-4 / (1.0 + mode as f64), 0.3 - 0.1 * n as f64);
            bank.set_amplitude(mode, n, [q, -0.5 * q], [v, 0.2 * v]);
            let parts = if undamped.is_real(n) { [1.0, 0.0] } else { [1.0, 1.0] };
            let square = |a: f64, b: f64| parts[0] * a * a + parts[1] * b * b;
            expected += 0.5 * square(v, 0.2 * v) + 0.5 * frequency * frequency * square(q, 0.5 * q);
        }
    }
    let none = vec![0.0; bank.rows() * bank.lanes()];
    for _ in 0..200 {
        bank.predict();
        let (kinetic, strain) = bank.energies_now(&none);
        let off = (kinetic + strain - expected).abs() / expected;
        assert!(off < 1e-9 && kinetic >= 0.0 && strain >= 0.0, "{off:e}");
    }
}

#[test]
fn reset_to_rest_clears_previous_loads() {
    for scheme in [Scheme::ModalExact, Scheme::CentralDifference, Scheme::MasslessBoundary] {
        let mut bank = bank(&model(11, 2), true);
        bank.set_step(scheme, 1e-6);
        for step in 0..5 {
            bank.loads_mut()[1] = 1e3;
            bank.predict();
            bank.disk_mut()
                .unwrap()
                .ask([(3, 0, Vector3::new(1.0, 0.3, -0.2)), (step, 1, Vector3::new(-2.0, 0.0, 0.5))].into_iter());
            bank.act();
            assert!(bank.finish_loads() != 0.0);
        }
        bank.rest();
        let none = vec![0.0; bank.rows() * bank.lanes()];
        assert_eq!((bank.energies_now(&none), bank.collect_loss()), ((0.0, 0.0), 0.0), "{scheme:?}");
        bank.resample(scheme, 7e-7, &none);
        for _ in 0..2 {
            bank.predict();
            assert_eq!((bank.finish_loads(), bank.energies_now(&none)), (0.0, (0.0, 0.0)), "{scheme:?}");
            assert!(bank.displacement().iter().chain(bank.displacement_before()).all(|value| *value == 0.0));
        }
        assert_eq!(bank.collect_loss().to_bits(), 0.0_f64.to_bits());
    }
}

#[test]
fn quasi_static_modes_start_without_motion() {
    let mut undamped = model(8, 1);
    undamped.set_damping_ratio(0.0, &[]);
    let mut bank = bank(&undamped, false);
    bank.set_step(Scheme::MasslessBoundary, 1e-6);
    let mut expected = 0.0;
    for (n, diameter) in undamped.diameters.iter().enumerate() {
        for (mode, frequency) in diameter.frequencies.iter().enumerate() {
            bank.set_amplitude(mode, n, [1e-4, 0.0], [0.3, 0.0]);
            let dynamic = mode + diameter.quasi_static < diameter.len();
            expected += if dynamic { 0.5 * (0.09 + (1e-4 * frequency).powi(2)) } else { 0.0 };
        }
    }
    let none = vec![0.0; bank.rows() * bank.lanes()];
    let (kinetic, strain) = bank.energies_now(&none);
    assert!(((kinetic + strain) / expected - 1.0).abs() < 1e-12, "{kinetic} + {strain} of {expected} J");
}

/// Compares the widest instruction set with the baseline; without wider registers the baseline is compared with itself.
#[test]
fn every_instruction_set_gives_the_same_bits() {
    for (sectors, nodes) in [(13, 1), (20, 2), (36, 5)] {
        for scheme in [Scheme::ModalExact, Scheme::MasslessBoundary] {
            let run = |instruction_set| {
                let mut bank = bank(&model(sectors, nodes), true);
                bank.instruction_set = instruction_set;
                bank.disk_mut().unwrap().instruction_set = instruction_set;
                bank.set_step(scheme, 1e-6);
                for step in 0..300 {
                    bank.loads_mut()[1] = 1e3;
                    bank.predict();
                    if step % 3 > 0 {
                        let force = Vector3::new(f64::from(step).cos(), 0.3, -0.2);
                        let index = usize::try_from(step).unwrap();
                        let forces = [(index % sectors, index % nodes, force), (index * 5 % sectors, 0, force)];
                        bank.disk_mut().unwrap().ask(forces.into_iter());
                        bank.act();
                    }
                    if step % 50 == 0 {
                        bank.collect_loss();
                    }
                }
                let loss = bank.collect_loss().to_bits();
                let state = &bank.state;
                let modes = state.position.iter().chain(&state.increment);
                let bits = modes.chain(&state.displacement).map(|value| value.to_bits());
                (bits.collect::<Vec<_>>(), loss)
            };
            assert!(run(InstructionSet::Baseline) == run(InstructionSet::detect()), "{sectors} x {nodes} {scheme:?}");
            #[cfg(target_arch = "x86_64")]
            if InstructionSet::detect() == InstructionSet::Avx512 {
                assert!(run(InstructionSet::Avx2) == run(InstructionSet::Baseline), "{sectors} x {nodes} {scheme:?}");
            }
        }
    }
}

/// Contact displacements that were corrected immediately agree with those of the modes, which are corrected later.
#[test]
fn displacements_and_modes_agree_after_contact() {
    for (scheme, step) in [(Scheme::ModalExact, 1e-4), (Scheme::MasslessBoundary, 1e-5)] {
        for load in [0.0, 1e3] {
            compare_with_modes(scheme, step, load);
        }
    }
}

/// Compares the displacements after the prediction and after contact with those of all modes. Rows of quasi-static modes without
/// loads are left out of the prediction.
#[track_caller]
fn compare_with_modes(scheme: Scheme, length: f64, load: f64) {
    let mut bank = bank(&model(11, 2), true);
    bank.set_step(scheme, length);
    let last = bank.loads_mut().len() - 1;
    for step in 0..200_usize {
        bank.loads_mut()[last] = load;
        bank.predict();
        if step % 3 > 0 {
            let moving = (step % 11, step % 2, Vector3::new(1.0, -0.4, 0.1));
            bank.disk_mut().unwrap().ask([moving, (3, 0, Vector3::new(0.2, 0.5, -1.0))].into_iter());
            bank.act();
        }
        if step % 20 == 7 || step % 20 == 9 {
            let found = bank.displacement().to_vec();
            bank.recover();
            let size = found.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            let off = found.iter().zip(bank.displacement()).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(size > 0.0 && off < 1e-13 * size, "step {step}: {off:e} of {size:e}");
        }
    }
}
