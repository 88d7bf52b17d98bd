//! The core against closed forms for oscillators and balls at stops: exact times, losses, grazing, long sequences.

use crate::guide::print_row;
use crate::rods::{against_plane, set_samples, single};
use tiprub_core::geometry::PrescribedMotion;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::System;
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::closed::oscillator::{Ball, Bilinear, DeadStop};

const OMEGA: f64 = 60.0;
const RIGID: [Scheme; 2] = [Scheme::CentralDifference, Scheme::ModalExact];

/// Runs until `end`; `each` is called with the system after every step.
fn march(system: &mut System, end: f64, mut each: impl FnMut(&System, f64)) {
    let step = system.bank().step();
    while system.steps() as f64 * step < end {
        Recurrence.step(system, &[PrescribedMotion::default()]).unwrap();
        each(system, system.steps() as f64 * step);
    }
    system.close_ledger();
}

fn residual(system: &System) -> f64 {
    let (kinetic, strain) = system.energies();
    system.ledger().residual(kinetic + strain) / system.ledger().scale()
}

/// Returns the error of the position over `turns` turns relative to A, of the time of the impact relative to h, and the
/// loss.
fn dead_stop(case: DeadStop, methods: (Scheme, Solver), step: f64, turns: f64) -> [f64; 4] {
    let model = single(&[(case.omega, 1.0)], 0);
    let mut system = against_plane(&model, methods, 1.0, case.distance, false);
    system.set_step(step);
    set_samples(&mut system, &model, 0, case.amplitude, case.position(0.0) * (case.omega * step).cos());
    system.start(&[PrescribedMotion::default()]);
    let before = system.ledger().initial;
    let (mut worst, mut touch) = (0.0_f64, f64::NAN);
    let end = case.touch() + turns * std::f64::consts::TAU / case.omega;
    march(&mut system, end, |system, time| {
        worst = worst.max((system.bank().row(0, 0) - case.position(time)).abs());
        if touch.is_nan() && system.multiplier(0, 0) > 0.0 {
            touch = time;
        }
    });
    let loss = system.ledger().impact_loss.value() / before;
    [worst / case.amplitude, (touch - case.touch()) / step, loss, residual(&system)]
}

#[test]
fn mass_stays_at_rigid_stop_until_the_spring_returns_it() {
    print_row!("| scheme | solver | d/A | h (µs) | position | touch (steps) | loss | exact | ledger |");
    print_row!("|---|---|---|---|---|---|---|---|---|");
    for scheme in RIGID {
        for solver in Solver::ALL {
            for share in [0.2, 0.9] {
                let case = DeadStop { omega: OMEGA, amplitude: 1e-3, distance: share * 1e-3 };
                let mut last = f64::INFINITY;
                for step in [1e-5, 1e-6] {
                    let [position, touch, loss, ledger] = dead_stop(case, (scheme, solver), step, 3.4);
                    print_row!(
                        "| {scheme:?} | {solver:?} | {share} | {} | {position:.1e} | {touch:.2} | {loss:.6} | {:.6} | {ledger:.0e} |",
                        step * 1e6,
                        case.loss()
                    );
                    // Accurate to one step; the position error is at most v h.
                    assert!((0.0..1.0001).contains(&touch), "{touch} steps late");
                    assert!(position < 4.0 * OMEGA * step && position < last, "{position:e}");
                    assert!((loss - case.loss()).abs() < 5.0 * (OMEGA * step).powi(2), "{loss} of {}", case.loss());
                    assert!(ledger.abs() < 1e-12);
                    last = 0.3 * position;
                }
            }
        }
    }
}

/// Amplitudes slightly beyond the stop: after one impact the mass reaches the stop without passing it, indefinitely.
#[test]
fn after_one_impact_an_oscillator_only_grazes() {
    for scheme in RIGID {
        for excess in [1e-2, 1e-4, 1e-6] {
            let case = DeadStop { omega: OMEGA, amplitude: 1e-3 * (1.0 + excess), distance: 1e-3 };
            let [position, touch, loss, ledger] = dead_stop(case, (scheme, Solver::Lcp), 1e-5, 20.0);
            print_row!(
                "{scheme:?}, A = (1 + {excess:e})d: position {position:.1e}, touch {touch:.2} steps late, loss {loss:.3e} of {:.3e}",
                case.loss()
            );
            // The impact time is accurate to one step, which the phase retains; the loss of a graze is of second order.
            assert!(position < 2.5 * OMEGA * 1e-5, "{position:e}");
            assert!((loss - case.loss()).abs() < 5.0 * (OMEGA * 1e-5).powi(2), "loss off by {:e}", loss - case.loss());
            assert!(ledger.abs() < 1e-12);
        }
    }
}

/// A spring that pulls towards the stop holds the mass there: λ equals the spring force to rounding.
#[test]
fn a_preloaded_mass_stays_on_its_stop() {
    for scheme in RIGID {
        for solver in Solver::ALL {
            let model = single(&[(OMEGA, 1.0)], 0);
            let mut system = against_plane(&model, (scheme, solver), 1.0, -2e-4, false);
            system.set_step(1e-4);
            // Released above the stop at x = 2e-4, moving towards x = 0.
            set_samples(&mut system, &model, 0, 1e-3, 1e-3 * (OMEGA * 1e-4).cos());
            system.start(&[PrescribedMotion::default()]);
            let mut force = 0.0;
            march(&mut system, 10.0, |system, _| force = system.multiplier(0, 0));
            let (expected, place) = (OMEGA * OMEGA * 2e-4, system.bank().row(0, 0));
            assert!((force / expected - 1.0).abs() < 1e-9, "{scheme:?} {solver:?}: {force} N of {expected}");
            assert!((place / 2e-4 - 1.0).abs() < 1e-12, "{place}");
            let (kinetic, _) = system.energies();
            assert!(kinetic.abs() < 1e-20, "{kinetic:e}");
        }
    }
}

/// A unit mass hits a stop in the first step of another length: the stop absorbs ½v², and nothing turns or curves.
#[test]
fn impact_after_step_change_is_recorded_as_impact_loss() {
    let (step, speed) = (1e-5, 2.0);
    for methods in RIGID.into_iter().flat_map(|scheme| Solver::ALL.map(|solver| (scheme, solver))) {
        for ratio in [0.1, 0.9, 1.7, 12.0] {
            let model = single(&[(0.0, 1.0)], 0);
            // Five steps of flight, the stop in the middle of the sixth.
            let mut system = against_plane(&model, methods, 1.0, speed * step * (5.0 + 0.5 * ratio), false);
            system.set_step(step);
            system.bank_mut().set_modal_state(0, 0, 0.0, -speed);
            system.start(&[PrescribedMotion::default()]);
            (0..5).for_each(|_| Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap());
            assert!(system.events().is_empty());
            system.set_step(ratio * step);
            assert!(
                (system.structures()[0].gap_rate(0, 0) / -speed - 1.0).abs() < 1e-9,
                "{} m/s",
                system.structures()[0].gap_rate(0, 0)
            );
            Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
            assert_eq!(system.events().len(), 1);
            (0..20).for_each(|_| Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap());
            let ledger = system.ledger();
            let (lost, curved) = (ledger.impact_loss.value(), ledger.curvature_work.value());
            let exact = 0.5 * speed * speed;
            assert!((lost / exact - 1.0).abs() < 1e-9, "{methods:?}, {ratio}: {lost} J of {exact} J");
            assert!(curved.abs() < 1e-9 * exact && ledger.step_change.value().abs() < 1e-9 * exact, "{curved:e} J");
            assert!(residual(&system).abs() < 1e-12);
        }
    }
}

/// Returns a mode of `omega` with unit mass and a quasi-static mode with the flexibility `compliance` (m/N) of the
/// contact node.
fn on_a_spring(omega: f64, compliance: f64) -> ModalModel {
    let high = 1e5;
    single(&[(omega, 1.0), (high, high * compliance.sqrt())], 1)
}

#[test]
fn ball_on_a_spring_bounces_without_loss() {
    print_row!("| solver | h (µs) | height, 20 bounces | time of touch 20 (s) | largest force | energy | ledger |");
    print_row!("|---|---|---|---|---|---|---|");
    let ball = Ball { omega: 200.0, gravity: 9.81, height: 0.05 };
    for solver in Solver::ALL {
        let mut errors = Vec::new();
        for step in [8e-5, 4e-5, 2e-5] {
            let model = on_a_spring(0.0, 1.0 / (ball.omega * ball.omega));
            let mut system = against_plane(&model, (Scheme::MasslessBoundary, solver), 1.0, ball.height, true);
            system.set_step(step);
            set_samples(&mut system, &model, 0, 0.0, -0.5 * ball.gravity * step * step);
            system.start(&[PrescribedMotion::default()]);
            let (mut worst, mut touches, mut open, mut force) = (0.0_f64, Vec::new(), true, 0.0_f64);
            while system.steps() as f64 * step < 20.0 * ball.period() {
                system.bank_mut().loads_mut()[0] = -ball.gravity;
                Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
                let time = system.steps() as f64 * step;
                let height = ball.height + system.bank().modal_state(0, 0).0;
                worst = worst.max((height - ball.position(time)).abs());
                let now = system.multiplier(0, 0);
                if now > 0.0 && open {
                    touches.push(time);
                }
                (open, force) = (now <= 0.0, force.max(now));
            }
            system.close_ledger();
            let expected = ball.fall() + 19.0 * ball.period();
            assert_eq!(touches.len(), 20);
            let energy = {
                let (kinetic, strain) = system.energies();
                let (position, increment) = system.bank().modal_state(0, 0);
                kinetic + strain + ball.gravity * (position - 0.5 * increment)
            };
            let (touch, force) = (touches[19] - expected, force / ball.gravity / ball.force_over_weight() - 1.0);
            let energy = energy / (ball.gravity * ball.height);
            print_row!(
                "| {solver:?} | {} | {:.1e} | {touch:+.1e} | {force:+.1e} | {energy:+.1e} | {:.0e} |",
                step * 1e6,
                worst / ball.height,
                residual(&system)
            );
            assert!(force.abs() < 2.0 * (ball.omega * step).powi(2) && residual(&system).abs() < 1e-12);
            errors.push(worst / ball.height);
        }
        let order = 0.5 * (errors[0] / errors[2]).log2();
        print_row!("{solver:?}: order {order:.2}");
        assert!(order > 1.3 && errors[2] < 1e-3, "{errors:?}");
    }
}

/// Returns the period (s) over `turns` turns and the largest force of a mass at an elastic stop.
fn bilinear(case: Bilinear, solver: Solver, step: f64, turns: u32) -> [f64; 3] {
    let model = on_a_spring(case.omega, 1.0 / (case.ratio * case.omega * case.omega));
    let mut system = against_plane(&model, (Scheme::MasslessBoundary, solver), -1.0, case.distance, false);
    system.set_step(step);
    set_samples(&mut system, &model, 0, -case.amplitude, -case.amplitude * (case.omega * step).cos());
    system.start(&[PrescribedMotion::default()]);
    let before = system.ledger().initial;
    let (mut crossings, mut force) = (Vec::new(), 0.0_f64);
    march(&mut system, case.period() * (f64::from(turns) + 0.9), |system, time| {
        let (now, increment) = system.bank().modal_state(0, 0);
        if now >= 0.0 && now - increment < 0.0 {
            // Upwards through 0, where only the spring determines the motion.
            crossings.push(time - step * now / increment);
        }
        force = force.max(system.multiplier(0, 0));
    });
    let (kinetic, strain) = system.energies();
    let period = (crossings[turns as usize] - crossings[0]) / f64::from(turns);
    [
        period / case.period() - 1.0,
        force / (case.omega * case.omega * case.force_per_stiffness()) - 1.0,
        (kinetic + strain) / before - 1.0,
    ]
}

#[test]
fn impact_oscillator_period_matches_the_closed_form() {
    print_row!("| solver | A/d | period (s) | period, h = 200, 100, 50 µs | order | force at 50 µs | energy |");
    print_row!("|---|---|---|---|---|---|---|");
    for solver in Solver::ALL {
        for share in [1.000_1, 1.01, 1.5, 10.0] {
            let case = Bilinear { omega: OMEGA, ratio: 25.0, distance: 1e-3, amplitude: share * 1e-3 };
            let found = [2e-4, 1e-4, 5e-5].map(|step| bilinear(case, solver, step, 40));
            let errors = found.map(|found| found[0].abs());
            let order = 0.5 * (errors[0] / errors[2]).log2();
            print_row!(
                "| {solver:?} | {share} | {:.6} | {:.1e}, {:.1e}, {:.1e} | {order:.2} | {:+.1e} | {:+.1e} |",
                case.period(),
                errors[0],
                errors[1],
                errors[2],
                found[2][1],
                found[2][2]
            );
            assert!(errors[0] < 5e-4 && errors[2] < 1e-5, "{errors:?}");
            assert!(found.iter().all(|found| found[2].abs() < 1e-3), "{found:?}");
        }
    }
    crate::guide::hold("cargo test -p tiprub-core --test closed_forms impact_oscillator");
}
