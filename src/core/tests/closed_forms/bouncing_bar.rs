//! An elastic bar that bounces under gravity indefinitely, computed by the core, against its exact series.
//!
//! D. Doyen, A. Ern, S. Piperno, SIAM J. Sci. Comput. 33 (2011): period 16/3 s, contacts on [1, 5/3] and [11/3, 13/3].

use crate::guide::print_row;
use crate::rods::{NEARLY_NONE, SCHEMES, StraightRod, against_plane, orders, quiet_step, set_samples};
use tiprub_core::geometry::PrescribedMotion;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::closed::bouncing_bar::{
    CONTACTS, DENSITY, GRAVITY, HEIGHT, LENGTH, PERIOD, YOUNG, displacement, energy, pressure,
};

/// Number of periods computed.
const PERIODS: usize = 3;
/// Gaps between touches up to this length count as one contact (s).
const APART: f64 = 0.1;

#[derive(Debug, Default)]
struct BouncingRun {
    step: f64,
    /// Error at the bottom over the first period, maximum and relative L2, and relative L2 over the last.
    bottom: [f64; 3],
    /// Relative error of the force in the first contact: impulse and L2.
    force: [f64; 2],
    /// Start and end of every contact (s).
    contacts: Vec<[f64; 2]>,
    /// Fraction of the energy lost after every period.
    losses: Vec<f64>,
    /// Residual of the ledger.
    residual: f64,
}

/// Sums of squares of the error and of the value.
#[derive(Debug, Clone, Copy, Default)]
struct Squares([f64; 2]);

impl Squares {
    fn add(&mut self, found: f64, exact: f64) {
        self.0[0] += (found - exact).powi(2);
        self.0[1] += exact.powi(2);
    }

    fn relative(self) -> f64 {
        (self.0[0] / self.0[1]).sqrt()
    }
}

/// Simulates a bouncing bar with the Courant number `fraction`; massless-boundary uses less if closed contact requires
/// it.
fn bounce(elements: usize, scheme: Scheme, solver: Solver, fraction: f64) -> BouncingRun {
    let kept = if scheme == Scheme::MasslessBoundary { NEARLY_NONE } else { 1.0 };
    let rod = StraightRod { young: YOUNG, density: DENSITY, area: 1.0, length: LENGTH, elements, end: 0, kept };
    let model = rod.model();
    let mut step = fraction * rod.wave_time();
    if scheme == Scheme::MasslessBoundary {
        step = quiet_step(&model, step);
    }
    let mut system = against_plane(&model, (scheme, solver), 1.0, HEIGHT, true);
    system.set_step(step);
    // Uniform gravity acts on the rigid mode alone. Released at rest, it is at −gh²/2 one step earlier.
    let mass = DENSITY * LENGTH;
    let weight = -GRAVITY * mass.sqrt();
    set_samples(&mut system, &model, 0, 0.0, 0.5 * weight * step * step);
    system.start(&[PrescribedMotion::default()]);
    let delay = if scheme == Scheme::MasslessBoundary { step } else { 0.0 };
    let mut outcome = BouncingRun { step, ..BouncingRun::default() };
    let (mut squares, mut squares_force, mut impulses) = ([Squares::default(); PERIODS], Squares::default(), [0.0; 2]);
    while (system.steps() as f64) * step < PERIODS as f64 * PERIOD {
        let acting = system.steps() as f64 * step + delay;
        system.bank_mut().loads_mut()[0] = weight;
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
        let (time, force) = (system.steps() as f64 * step, system.multiplier(0, 0));
        // The series is expensive: every mesh uses the same number of samples.
        if system.steps().is_multiple_of((elements / 25) as u64) {
            let (period, exact) = (periods(time).min(PERIODS - 1), displacement(0.0, time));
            squares[period].add(system.gap(0, 0), exact);
            if period == 0 {
                outcome.bottom[0] = outcome.bottom[0].max((system.gap(0, 0) - exact).abs());
            }
        }
        if acting < 2.0 {
            squares_force.add(force, pressure(acting));
            impulses[0] += force * step;
            impulses[1] += pressure(acting) * step;
        }
        note_contact(&mut outcome.contacts, acting, force);
        if periods(time) > outcome.losses.len() {
            let (kinetic, strain) = system.energies();
            let (position, increment) = system.bank().modal_state(0, 0);
            // Potential energy as the scheme defines it: mean of now and before. Heights are measured from the release.
            let potential = GRAVITY * mass * HEIGHT - weight * (position - 0.5 * increment);
            outcome.losses.push(1.0 - (kinetic + strain + potential) / energy());
        }
    }
    system.close_ledger();
    let (kinetic, strain) = system.energies();
    outcome.residual = system.ledger().residual(kinetic + strain) / energy();
    outcome.bottom[1] = squares[0].relative();
    outcome.bottom[2] = squares[PERIODS - 1].relative();
    outcome.force = [impulses[0] / impulses[1] - 1.0, squares_force.relative()];
    outcome
}

/// Returns the number of whole periods in a time (s).
fn periods(time: f64) -> usize {
    (1..=PERIODS).take_while(|count| time >= *count as f64 * PERIOD).count()
}

fn note_contact(contacts: &mut Vec<[f64; 2]>, time: f64, force: f64) {
    if force <= 0.0 {
        return;
    }
    match contacts.last_mut() {
        Some(last) if time - last[1] < APART => last[1] = time,
        _ => contacts.push([time, time]),
    }
}

fn print(scheme: Scheme, solver: Solver, elements: usize, outcome: &BouncingRun) {
    let BouncingRun { step, bottom, force, contacts, losses, residual } = outcome;
    let times = contacts[..2].iter().flatten().map(|time| format!("{time:.4}")).collect::<Vec<_>>().join(", ");
    let losses = losses.iter().map(|loss| format!("{:.3}", 100.0 * loss)).collect::<Vec<_>>().join(", ");
    print_row!(
        "| {scheme:?} | {solver:?} | {elements} | {:.2} | {:.3} | {:.2e} | {:.2e} | {:+.1e} | {:.2e} | {times} | {losses} | {residual:.0e} |",
        step * 1e3,
        bottom[0],
        bottom[1],
        bottom[2],
        force[0],
        force[1],
    );
}

#[test]
fn bouncing_bar_matches_series_solution() {
    print_row!("exact: contacts {CONTACTS:.4?}, period {PERIOD:.4}, loss 0");
    print_row!(
        "| scheme | solver | elements | h (ms) | bottom, largest error (m) | L2, period 1 | L2, period 3 | impulse | force L2 | contacts (s) | loss after each period (%) | ledger |"
    );
    print_row!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for scheme in SCHEMES {
        let mut errors = Vec::new();
        for elements in [25, 50, 100, 200] {
            let found = bounce(elements, scheme, Solver::Lcp, 0.9);
            print(scheme, Solver::Lcp, elements, &found);
            check(scheme, elements, &found);
            errors.push(found.bottom[1]);
            // With one contact node all solvers solve the same problem.
            for solver in Solver::ALL.into_iter().filter(|solver| *solver != Solver::Lcp && elements == 25) {
                let other = bounce(elements, scheme, solver, 0.9);
                print(scheme, solver, elements, &other);
                assert!((other.bottom[1] / found.bottom[1] - 1.0).abs() < 1e-6, "{solver:?}");
                assert!(other.residual.abs() < 1e-12, "ledger {:e}", other.residual);
            }
        }
        let orders = orders(&errors);
        print_row!("{scheme:?}: orders of L2 {orders:.2?}");
        // Methods of second order converge with order 2/3 · 3/2 = 1 to a displacement whose velocity jumps; the loss is
        // of order 1.
        let mean = orders.iter().sum::<f64>() / 3.0;
        assert!((0.65..1.15).contains(&mean), "order {mean}");
    }
    crate::guide::hold("cargo test -p tiprub-core --test closed_forms bouncing_bar");
}

fn check(scheme: Scheme, elements: usize, found: &BouncingRun) {
    let size = 1.0 / elements as f64;
    assert!(found.residual.abs() < 1e-12, "ledger {:e}", found.residual);
    // 25 elements lose so much energy that the third period no longer repeats.
    assert!(elements < 50 || found.contacts.len() == 2 * PERIODS, "{:?}", found.contacts);
    for (found, exact) in found.contacts.iter().zip(CONTACTS) {
        assert!((0..2).all(|i| (found[i] - exact[i]).abs() < 1.5 * size), "{found:?} of {exact:?}");
    }
    assert!(found.bottom[1] < 2.5 * size && found.force[0].abs() < 0.3 * size, "{found:?}");
    // Each of two contacts absorbs the kinetic energy of the lumped contact node, E/2n; a massless node has none.
    let lost = found.losses[0] / size;
    let range = if scheme == Scheme::MasslessBoundary { 0.0..0.15 } else { 0.8..1.2 };
    assert!(range.contains(&lost), "{lost} of E/n lost");
}
