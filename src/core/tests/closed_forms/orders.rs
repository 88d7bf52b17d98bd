//! Observed orders of convergence of the schemes, against theory: free flight, forced vibration, permanently closed
//! contact, impacts.

use crate::guide::print_row;
use crate::rods::{SCHEMES, against_plane, orders, set_samples, single};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use tiprub_core::geometry::PrescribedMotion;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::closed::oscillator::{Bilinear, DeadStop};

/// A gap that never closes.
const FAR: f64 = 1e9;

fn row(phase: &str, scheme: Scheme, solver: Solver, quantity: &str, errors: &[f64], theory: &str) -> f64 {
    let orders = orders(errors);
    let list = |values: Vec<String>| values.join(", ");
    print_row!(
        "| {phase} | {scheme:?} | {solver:?} | {quantity} | {} | {} | {theory} |",
        list(errors.iter().map(|error| format!("{error:.1e}")).collect()),
        list(orders.iter().map(|order| format!("{order:.2}")).collect())
    );
    orders.iter().sum::<f64>() / orders.len() as f64
}

/// Returns the solvers to test. With one contact node all of them solve the same problem, so the others are tested with
/// one scheme.
fn solvers(scheme: Scheme) -> Vec<Solver> {
    if scheme == Scheme::ModalExact { Solver::ALL.to_vec() } else { vec![Solver::Lcp] }
}

fn head() {
    print_row!("| phase | scheme | solver | quantity | errors, h halved | orders | theory |");
    print_row!("|---|---|---|---|---|---|---|");
}

/// Mode shapes at one node: (ω, shape).
const MODES: [(f64, f64); 4] = [(0.0, 1.0), (90.0, 0.8), (260.0, -1.1), (610.0, 0.9)];

/// Returns the modes, with a quasi-static one for massless-boundary.
fn free_model(scheme: Scheme) -> ModalModel {
    let mut modes = MODES.to_vec();
    if scheme == Scheme::MasslessBoundary {
        modes.push((1e4, 50.0));
    }
    single(&modes, 1)
}

/// Returns the exact steady-state amplitude of a mode under force·cos Ωt, started on it; a rigid mode oscillates about
/// its initial position.
fn forced(frequency: f64, force: f64, omega: f64, time: f64) -> f64 {
    force / (frequency * frequency - omega * omega) * (omega * time).cos()
}

/// Returns the largest error of the node over 0.2 s relative to its largest displacement, with `force` on every mode or
/// none.
fn smooth_error(scheme: Scheme, solver: Solver, step: f64, force: Option<(f64, f64)>) -> f64 {
    let model = free_model(scheme);
    let exact = |mode: usize, time: f64| match force {
        Some((size, omega)) => forced(MODES[mode].0, size, omega, time),
        None if mode == 0 => 0.01 - 0.3 * time,
        None => 0.01 * (MODES[mode].0 * time + mode as f64).cos(),
    };
    let mut system = against_plane(&model, (scheme, solver), 1.0, FAR, force.is_some());
    system.set_step(step);
    for mode in 0..MODES.len() {
        set_samples(&mut system, &model, mode, exact(mode, 0.0), exact(mode, -step));
    }
    system.start(&[PrescribedMotion::default()]);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    while system.steps() as f64 * step < 0.2 {
        if let Some((size, omega)) = force {
            let load = size * (omega * system.steps() as f64 * step).cos();
            system.bank_mut().loads_mut()[..MODES.len()].fill(load);
        }
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
        let time = system.steps() as f64 * step;
        let place: f64 = (0..MODES.len()).map(|mode| MODES[mode].1 * exact(mode, time)).sum();
        worst = worst.max((system.bank().row(0, 0) - place).abs());
        largest = largest.max(place.abs());
    }
    worst / largest
}

#[test]
fn free_flight_and_forced_vibration_have_expected_order() {
    head();
    for scheme in SCHEMES {
        let solver = Solver::Lcp;
        let errors = [2e-4, 1e-4, 5e-5, 2.5e-5].map(|step| smooth_error(scheme, solver, step, None));
        if scheme == Scheme::CentralDifference {
            let order = row("free flight", scheme, solver, "displacement", &errors, "2");
            assert!((1.95..2.05).contains(&order), "{errors:?}");
        } else {
            row("free flight", scheme, solver, "displacement", &errors, "exact");
            assert!(errors.iter().all(|error| *error < 1e-11), "{errors:?}");
        }
        let errors = [2e-4, 1e-4, 5e-5, 2.5e-5].map(|step| smooth_error(scheme, solver, step, Some((40.0, 150.0))));
        let order = row("forced vibration", scheme, solver, "displacement", &errors, "2");
        assert!((1.95..2.05).contains(&order), "{errors:?}");
    }
    crate::guide::hold("cargo test -p tiprub-core --test closed_forms free_flight");
}

/// Chain of masses between two walls; the node of the last mass presses on the contact plane and never leaves it.
struct PressedChain {
    model: ModalModel,
    /// ψ of the closed system in the reduced coordinates of `model`, and its frequencies.
    shapes: DMatrix<f64>,
    frequencies: Vec<f64>,
    stiffness: DMatrix<f64>,
    rest: DVector<f64>,
    preload: DVector<f64>,
}

const MASSES: usize = 5;

impl PressedChain {
    /// Returns the chain with mass at the contact node: K and M of the chain, with the last displacement held at 0.
    fn new() -> Self {
        let mut stiffness = DMatrix::<f64>::zeros(MASSES, MASSES);
        for i in 0..MASSES {
            stiffness[(i, i)] += 4e4 * (1.0 + 0.2 * i as f64);
            if i + 1 < MASSES {
                let spring = 9e4 / (1.0 + 0.3 * i as f64);
                stiffness[(i, i)] += spring;
                stiffness[(i + 1, i + 1)] += spring;
                stiffness[(i, i + 1)] -= spring;
                stiffness[(i + 1, i)] -= spring;
            }
        }
        let inner = SymmetricEigen::new(stiffness.view((0, 0), (MASSES - 1, MASSES - 1)).into_owned());
        let preload = DVector::from_fn(MASSES, |i, _| 30.0 + 10.0 * i as f64);
        let rest = inner.eigenvectors.clone()
            * DMatrix::from_diagonal(&inner.eigenvalues.map(|value| 1.0 / value))
            * inner.eigenvectors.transpose()
            * preload.rows(0, MASSES - 1);
        // Unit masses: the modes of the free chain are eigenvectors.
        let free = SymmetricEigen::new(stiffness.clone());
        let mut order: Vec<usize> = (0..MASSES).collect();
        order.sort_by(|a, b| free.eigenvalues[*a].total_cmp(&free.eigenvalues[*b]));
        let shapes = free.eigenvectors.select_columns(&order);
        let model = ModalModel {
            frequencies: order.iter().map(|mode| free.eigenvalues[*mode].sqrt()).collect(),
            damping_ratios: vec![0.0; MASSES],
            contact_modes: DMatrix::from_fn(
                3,
                MASSES,
                |row, mode| if row == 0 { shapes[(MASSES - 1, mode)] } else { 0.0 },
            ),
            shapes,
            quasi_static: 1,
        };
        Self {
            model,
            shapes: inner.eigenvectors,
            frequencies: inner.eigenvalues.iter().map(|value| value.sqrt()).collect(),
            stiffness,
            rest,
            preload,
        }
    }

    /// Returns the displacements of all masses.
    fn exact(&self, time: f64) -> DVector<f64> {
        let swing = DVector::from_fn(MASSES - 1, |mode, _| 1e-4 * (self.frequencies[mode] * time + mode as f64).cos());
        let inner = &self.rest + &self.shapes * swing;
        DVector::from_fn(MASSES, |i, _| if i + 1 < MASSES { inner[i] } else { 0.0 })
    }

    /// Returns the force of the plane on the last mass, which is at rest.
    fn multiplier(&self, time: f64) -> f64 {
        self.preload[MASSES - 1] - (self.stiffness.row(MASSES - 1) * self.exact(time))[0]
    }

    /// Returns the largest relative errors of displacement (of the first mass) and multiplier over 0.1 s.
    fn errors(&self, scheme: Scheme, solver: Solver, step: f64) -> [f64; 2] {
        let mut system = against_plane(&self.model, (scheme, solver), -1.0, 0.0, true);
        system.set_step(step);
        let modal = |time: f64| self.model.shapes.transpose() * self.exact(time);
        let (now, before) = (modal(0.0), modal(-step));
        for mode in 0..MASSES {
            set_samples(&mut system, &self.model, mode, now[mode], before[mode]);
        }
        system.start(&[PrescribedMotion::default()]);
        let push = self.model.shapes.transpose() * &self.preload;
        let (mut worst, mut largest) = ([0.0_f64; 2], [0.0_f64; 2]);
        while system.steps() as f64 * step < 0.1 {
            let time = system.steps() as f64 * step;
            system.bank_mut().loads_mut().copy_from_slice(push.as_slice());
            Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
            let first: f64 =
                (0..MASSES).map(|mode| self.model.shapes[(0, mode)] * system.bank().modal_state(mode, 0).0).sum();
            let (place, force) = (self.exact(time + step)[0], self.multiplier(time));
            assert!(system.multiplier(0, 0) > 0.0, "open at {time}");
            let errors = [first - place, system.multiplier(0, 0) - force];
            worst = [0, 1].map(|i| worst[i].max(errors[i].abs()));
            largest = [largest[0].max(place.abs()), largest[1].max(force.abs())];
        }
        [worst[0] / largest[0], worst[1] / largest[1]]
    }
}

/// Permanently closed contact with massless-boundary: the residual flexibility is a spring, whose modes are the closed
/// form.
struct PressedMassless {
    model: ModalModel,
    shapes: DMatrix<f64>,
    frequencies: Vec<f64>,
    rest: DVector<f64>,
}

const PRELOAD: f64 = 20.0;

impl PressedMassless {
    fn new() -> Self {
        let modes = [(70.0, 0.8), (190.0, -1.0), (420.0, 1.2)];
        let (high, compliance) = (5e3, 1e-5);
        let mut all = modes.to_vec();
        all.push((high, high * f64::sqrt(compliance)));
        let model = single(&all, 1);
        let seen = DVector::from_iterator(3, modes.iter().map(|mode| mode.1));
        let stiffness = DMatrix::from_diagonal(&DVector::from_iterator(3, modes.iter().map(|mode| mode.0 * mode.0)))
            + &seen * seen.transpose() / compliance;
        let closed = SymmetricEigen::new(stiffness.clone());
        let rest = stiffness.try_inverse().unwrap() * DVector::from_element(3, PRELOAD);
        Self {
            model,
            frequencies: closed.eigenvalues.iter().map(|value| value.sqrt()).collect(),
            shapes: closed.eigenvectors,
            rest,
        }
    }

    fn exact(&self, time: f64) -> DVector<f64> {
        let swing = DVector::from_fn(3, |mode, _| 2e-5 * (self.frequencies[mode] * time + mode as f64).cos());
        &self.rest + &self.shapes * swing
    }

    fn errors(&self, solver: Solver, step: f64) -> [f64; 2] {
        let mut system = against_plane(&self.model, (Scheme::MasslessBoundary, solver), -1.0, 0.0, true);
        system.set_step(step);
        let (now, before) = (self.exact(0.0), self.exact(-step));
        for mode in 0..3 {
            set_samples(&mut system, &self.model, mode, now[mode], before[mode]);
        }
        system.start(&[PrescribedMotion::default()]);
        let seen = |place: &DVector<f64>| -> f64 {
            (0..3).map(|mode| self.model.contact_modes[(0, mode)] * place[mode]).sum()
        };
        let (mut worst, mut largest) = ([0.0_f64; 2], [0.0_f64; 2]);
        let mut acting = seen(&now) / 1e-5;
        while system.steps() as f64 * step < 0.1 {
            system.bank_mut().loads_mut()[..3].fill(PRELOAD);
            // The initial force of closed contact acts in the first step; afterwards the system computes it.
            if system.steps() == 0 {
                for mode in 0..3 {
                    let shape = self.model.contact_modes[(0, mode)];
                    system.bank_mut().loads_mut()[mode] -= shape * acting;
                }
            }
            Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
            let time = system.steps() as f64 * step;
            let place = self.exact(time);
            acting = seen(&place) / 1e-5;
            let errors = [system.bank().modal_state(0, 0).0 - place[0], system.multiplier(0, 0) - acting];
            worst = [0, 1].map(|i| worst[i].max(errors[i].abs()));
            largest = [largest[0].max(place[0].abs()), largest[1].max(acting.abs())];
        }
        [worst[0] / largest[0], worst[1] / largest[1]]
    }
}

#[test]
fn contact_that_stays_closed_has_expected_order() {
    head();
    let steps = [4e-4, 2e-4, 1e-4, 5e-5];
    let (pressed, massless) = (PressedChain::new(), PressedMassless::new());
    for scheme in SCHEMES {
        for solver in solvers(scheme) {
            let errors = steps.map(|step| match scheme {
                Scheme::MasslessBoundary => massless.errors(solver, step),
                _ => pressed.errors(scheme, solver, step),
            });
            for (i, quantity) in ["displacement", "multiplier"].into_iter().enumerate() {
                // The mass with which modal-exact satisfies constraints is M + h²K/12 + …: that of B. V. Numerov, of
                // fourth order for any constraint. Its multiplier represents (λ⁺ + 10 λ + λ⁻)/12.
                let numerov = scheme == Scheme::ModalExact && i == 0;
                let (theory, expected) = if numerov { ("4", 4.0) } else { ("2", 2.0) };
                let order = row("closed contact", scheme, solver, quantity, &errors.map(|errors| errors[i]), theory);
                assert!((order - expected).abs() < 0.1, "{errors:?}");
            }
        }
    }
    crate::guide::hold("cargo test -p tiprub-core --test closed_forms contact_that_stays");
}

/// Returns the root mean square of `error` over starts, with time shifts (s) by fractions of a step and factors on the
/// amplitude: impacts at every position within a step, and all lengths of contact.
fn over_starts(step: f64, error: impl Fn(f64, f64) -> f64) -> f64 {
    let starts = 64;
    let one = |i: i32| {
        let factor = 1.0 + 0.2 * (0.618_033_988_75 * f64::from(i)).fract();
        error(step * f64::from(i) / f64::from(starts), factor).powi(2)
    };
    ((0..starts).map(one).sum::<f64>() / f64::from(starts)).sqrt()
}

/// Returns the error of the position 0.05 s after the first impact, relative to the amplitude, with an inelastic stop.
fn dead_error(scheme: Scheme, solver: Solver, step: f64, shift: f64, factor: f64) -> f64 {
    let case = DeadStop { omega: 60.0, amplitude: factor * 1e-3, distance: 4e-4 };
    let model = single(&[(case.omega, 1.0)], 0);
    let mut system = against_plane(&model, (scheme, solver), 1.0, case.distance, false);
    system.set_step(step);
    let swing = |time: f64| case.amplitude * (case.omega * (time + shift)).cos();
    set_samples(&mut system, &model, 0, swing(0.0), swing(-step));
    system.start(&[PrescribedMotion::default()]);
    while system.steps() as f64 * step < 0.085 {
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
    }
    let time = system.steps() as f64 * step + shift;
    (system.bank().row(0, 0) - case.position(time)) / case.amplitude
}

/// Returns the error with the elastic stop of massless-boundary, after four contacts: position, and energy gained or
/// lost.
fn elastic_error(solver: Solver, step: f64, shift: f64, factor: f64) -> [f64; 2] {
    let case = Bilinear { omega: 60.0, ratio: 9.0, distance: 1e-3, amplitude: factor * 2e-3 };
    let model = single(&[(case.omega, 1.0), (1e5, 1e5 / (case.ratio.sqrt() * case.omega))], 1);
    let mut system = against_plane(&model, (Scheme::MasslessBoundary, solver), -1.0, case.distance, false);
    system.set_step(step);
    let swing = |time: f64| -case.amplitude * (case.omega * (time + shift)).cos();
    set_samples(&mut system, &model, 0, swing(0.0), swing(-step));
    system.start(&[PrescribedMotion::default()]);
    let before = system.ledger().initial;
    while system.steps() as f64 * step < 4.0 * case.period() {
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
    }
    let (time, (kinetic, strain)) = (system.steps() as f64 * step + shift, system.energies());
    let place = system.bank().modal_state(0, 0).0;
    [(place - case.position(time)) / case.amplitude, (kinetic + strain) / before - 1.0]
}

#[test]
fn order_through_impacts_is_as_expected() {
    head();
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        for solver in solvers(scheme) {
            let errors = [2e-4, 1e-4, 5e-5, 2.5e-5]
                .map(|step| over_starts(step, |shift, factor| dead_error(scheme, solver, step, shift, factor)));
            let order = row("rigid stop", scheme, solver, "displacement", &errors, "1");
            assert!((0.85..1.15).contains(&order), "{errors:?}");
        }
    }
    for solver in [Solver::Lcp] {
        let steps = [4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5];
        for (i, quantity) in ["displacement", "energy"].into_iter().enumerate() {
            let errors =
                steps.map(|step| over_starts(step, |shift, factor| elastic_error(solver, step, shift, factor)[i]));
            let order = row("elastic stop", Scheme::MasslessBoundary, solver, quantity, &errors, "2");
            assert!((1.7..2.3).contains(&order), "{errors:?}");
        }
    }
    crate::guide::hold("cargo test -p tiprub-core --test closed_forms order_through_impacts_is_as_expected");
}
