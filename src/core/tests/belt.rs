//! Sticking and sliding against closed forms: a block on a belt, held by a spring (den Hartog's stick-slip oscillator).
//!
//! The block sticks until the spring pulls with F_s, then slides under F_k. While it slides, x = F_k/k + a cos ωt +
//! (v/ω) sin ωt, a = (F_s − F_k)/k, until it reaches the velocity v of the belt again after (2π − 2 atan(aω/v))/ω; it
//! then sticks for 2a/v. Amplitude √(a² + v²/ω²).

#[path = "../../../tests/guide.rs"]
mod guide;

use guide::print_row;
use nalgebra::DMatrix;
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::modes::bank::BankOptions;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_core::time::{Recurrence, Stepper, TimeStepper};
use tiprub_reference::closed::belt::{StickSlipBelt, ThrownBlock};
use tiprub_test_models::{single_sector, single_sector_with};

const MASS: f64 = 2.0;
const OMEGA: f64 = 50.0;
const BELT: f64 = 0.1;
const FRICTION: f64 = 0.4;

/// Returns a block on the belt: one mode along the belt (spring), one across (free), pressed on by a load.
fn block(scheme: Scheme, step: f64) -> System {
    let model = ModalModel {
        frequencies: vec![0.0, OMEGA],
        damping_ratios: vec![0.0; 2],
        contact_modes: DMatrix::from_row_slice(3, 2, &[0.0, 1.0, 0.0, 0.0, 1.0, 0.0]) / MASS.sqrt(),
        shapes: DMatrix::identity(2, 2),
        quasi_static: 0,
    };
    let law = GapLaw::Fixed(FixedGap {
        normals: vec![Vector3::z()],
        gaps: vec![0.0],
        // The belt runs towards +x, so the block slides backwards on it.
        sliding: vec![-BELT * Vector3::x()],
    });
    let settings = SystemSettings { scheme, solver: Solver::Coulomb, ledger: true };
    let bank = BankOptions { loads: true, ..BankOptions::default() };
    let mut system = single_sector_with(&model, bank, law, FRICTION, settings);
    system.set_step(step);
    system.bank_mut().set_modal_state(1, 0, 0.0, BELT * MASS.sqrt());
    system.start(&[PrescribedMotion::default()]);
    system
}

struct BeltRecord {
    /// Position of the block (m) and whether it sticks, for each step.
    position: Vec<f64>,
    stuck: Vec<bool>,
    residual: f64,
}

/// Simulates a block whose normal force is `sticking` (N) while it sticks and `sliding` (N) while it slides.
fn run(scheme: Scheme, step: f64, sticking: f64, sliding: f64, steps: usize) -> BeltRecord {
    let mut system = block(scheme, step);
    let mut record = BeltRecord { position: Vec::new(), stuck: Vec::new(), residual: 0.0 };
    let mut stuck = true;
    for _ in 0..steps {
        system.bank_mut().loads_mut()[0] = -(if stuck { sticking } else { sliding }) / MASS.sqrt();
        let before = system.bank().row(0, 0);
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
        let now = system.bank().row(0, 0);
        let slip = now - before - BELT * step;
        stuck = slip.abs() < 1e-9 * BELT * step;
        record.position.push(now);
        record.stuck.push(stuck);
    }
    system.close_ledger();
    let (kinetic, strain) = system.energies();
    record.residual = system.ledger().residual(kinetic + strain) / system.ledger().scale();
    record
}

#[test]
fn stick_slip_matches_the_closed_form() {
    let (static_force, kinetic_force) = (FRICTION * 300.0, FRICTION * 200.0);
    let stiffness = MASS * OMEGA * OMEGA;
    let closed = StickSlipBelt { mass: MASS, stiffness, speed: BELT, sticking: static_force, sliding: kinetic_force };
    let (amplitude, slide_time, stick_time) = (closed.amplitude(), closed.slide_time(), closed.stick_time());
    let first_slip = static_force / stiffness / BELT;
    for scheme in [Scheme::ModalExact, Scheme::CentralDifference] {
        let mut errors = Vec::new();
        for (step, steps) in [(1e-4, 15_000), (5e-5, 30_000), (2.5e-5, 60_000)] {
            let record = run(scheme, step, 300.0, 200.0, steps);
            let changes: Vec<usize> = (1..steps).filter(|i| record.stuck[*i] != record.stuck[i - 1]).collect();
            let at = |index: usize| step * (changes[index] + 1) as f64;
            let largest =
                record.position[changes[0]..].iter().fold(0.0, |a: f64, x| a.max(*x)) - kinetic_force / stiffness;
            let found = [
                (at(0) - first_slip) / first_slip,
                (at(1) - at(0) - slide_time) / slide_time,
                (at(2) - at(1) - stick_time) / stick_time,
                (at(4) - at(2) - slide_time - stick_time) / (slide_time + stick_time),
                (largest - amplitude) / amplitude,
            ];
            print_row!(
                "{scheme:?} h = {} µs: first slip, slide, stick, period, amplitude off by {}; ledger {:.1e}",
                1e6 * step,
                found.map(|error| format!("{error:.1e}")).join(", "),
                record.residual
            );
            errors.push(found.iter().fold(0.0, |a: f64, e| a.max(e.abs())));
            assert!(record.residual.abs() < 1e-12);
        }
        // Times are accurate to one step: first order.
        assert!(errors[0] < 3e-3 && errors[2] < 0.3 * errors[0], "{errors:?}");
    }
    guide::hold("cargo test -p tiprub-core --test belt");
}

#[test]
fn block_swings_about_the_friction_force() {
    let (step, load) = (2.5e-5, 250.0);
    let steps = 40_000;
    let record = run(Scheme::ModalExact, step, load, load, steps);
    let rest = FRICTION * load / (MASS * OMEGA * OMEGA);
    let first = record.stuck.iter().position(|stuck| !stuck).unwrap() as f64 * step;
    assert!((first - rest / BELT).abs() < 2.0 * step, "slips at {first} s");
    let (low, high) =
        record.position[steps / 2..].iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    let (middle, swing) = (0.5 * (low + high), 0.5 * (high - low));
    print_row!("middle off by {:.1e}, swing by {:.1e}", middle / rest - 1.0, swing / (BELT / OMEGA) - 1.0);
    assert!((middle / rest - 1.0).abs() < 1e-3);
    assert!((swing / (BELT / OMEGA) - 1.0).abs() < 5e-3);
}

/// Flexibility of the contact (m/N), the friction force (N), and the initial velocity of the block (m/s).
const FLEXIBILITY: f64 = 4e-6;
const FORCE: f64 = 2.0;
const THROWN: f64 = 0.5;

/// Returns a block whose contact node has no mass, and a node without contact, whose gap defines the scale of the
/// tolerance.
fn by_tolerance(tolerance: f64, longest: f64) -> (System, TimeStepper) {
    let fast = 1e5;
    let mut contact_modes = DMatrix::zeros(6, 7);
    contact_modes[(0, 0)] = 1.0 / MASS.sqrt();
    for row in 0..6 {
        contact_modes[(row, row + 1)] = FLEXIBILITY.sqrt() * fast;
    }
    let model = ModalModel {
        frequencies: [vec![OMEGA], vec![fast; 6]].concat(),
        damping_ratios: vec![0.0; 7],
        contact_modes,
        shapes: DMatrix::identity(7, 7),
        quasi_static: 6,
    };
    let law = GapLaw::Fixed(FixedGap {
        normals: vec![Vector3::z(); 2],
        gaps: vec![-FLEXIBILITY * FORCE / FRICTION, 1e-3],
        sliding: vec![Vector3::zeros(); 2],
    });
    let settings = SystemSettings { scheme: Scheme::Galerkin, solver: Solver::Coulomb, ledger: true };
    let mut system = single_sector(&model, law, FRICTION, settings);
    let mut stepper = TimeStepper::new(&mut system, longest, tolerance);
    stepper.set_step(&mut system, longest);
    system.bank_mut().set_modal_state(0, 0, 0.0, THROWN * MASS.sqrt());
    system.start(&[PrescribedMotion::default()]);
    (system, stepper)
}

#[test]
fn adaptive_tolerance_matches_stick_slip_closed_form() {
    let (longest, count) = (2e-3, 500);
    let block = ThrownBlock { mass: MASS, omega: OMEGA, flexibility: FLEXIBILITY, friction: FORCE, velocity: THROWN };
    let exact = block.motion(longest, count);
    print_row!("it stops {} times", exact.stops);
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let (mut system, mut stepper) = by_tolerance(tolerance, longest);
        let mut worst = 0.0_f64;
        for exact in &exact.positions {
            stepper.step(&mut system, &[PrescribedMotion::default()]).unwrap();
            worst = worst.max((system.bank().row(0, 0) - exact).abs());
        }
        let (error, effort) = (worst / 1e-3, *system.effort());
        system.close_ledger();
        let (kinetic, strain) = system.energies();
        let residual = system.ledger().residual(kinetic + strain).abs() / system.ledger().scale();
        let (steps, trials) = (effort.steps, effort.trials);
        print_row!(
            "tolerance {tolerance:.0e}: error {:.2} of it after {count} longest steps, {steps} steps, {trials} trials",
            error / tolerance
        );
        // The contact begins with a jump, which the shortest steps cannot resolve at the smallest tolerance.
        assert!(error < 3.0 * tolerance && residual < 1e-12 && effort.missed < 20, "{effort:?}, {residual:e}");
    }
    guide::hold("cargo test -p tiprub-core --test belt tolerance");
}
