//! Massless boundary: no impact loss, and the step limit that closed contact sets.

#[path = "../../../tests/guide.rs"]
mod guide;
#[path = "common/rods.rs"]
mod rods;

use guide::print_row;
use nalgebra::DMatrix;
use rods::{NEARLY_NONE, StraightRod};
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::limits::massless::{CarrierUnderNodes, MasslessCheck};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::carpenter;
use tiprub_test_models::{node, single_sector, structure};

/// The bars of N. J. Carpenter, R. L. Taylor, M. G. Katona, Int. J. Numer. Methods Eng. 32 (1991): half of the
/// symmetric problem, a bar that hits a rigid wall.
const YOUNG: f64 = 206.8e9;
const DENSITY: f64 = 7844.066;
const AREA: f64 = 6.4516e-4;
const LENGTH: f64 = 0.254;
const SPEED: f64 = 5.13588;
const GAP: f64 = 0.508e-3 / 2.0;

/// Returns half of the problem; the contact node at the wall keeps the fraction `kept` of its lumped mass.
fn bar(elements: usize, kept: f64) -> StraightRod {
    StraightRod { young: YOUNG, density: DENSITY, area: AREA, length: LENGTH, elements, end: elements, kept }
}

fn system(model: &ModalModel, scheme: Scheme, step: f64) -> System {
    let law =
        GapLaw::Fixed(FixedGap { normals: vec![-Vector3::x()], gaps: vec![GAP], sliding: vec![Vector3::zeros()] });
    let settings = SystemSettings { scheme, solver: Solver::Lcp, ledger: true };
    let mut system = single_sector(model, law, 0.0, settings);
    system.set_step(step);
    system
}

#[test]
fn a_bar_bounces_off_without_impact_loss() {
    let exact = carpenter::exact();
    print_row!("exact: {:.2} to {:.2} us, {:.4} N.s, loss 0", 1e6 * exact.touch, 1e6 * exact.release, exact.impulse);
    // With 1e-4 of the mass, one mode represents the flexibility of the end node alone.
    for (scheme, end_mass, losses) in
        [(Scheme::MasslessBoundary, NEARLY_NONE, [0.0, 1e-3]), (Scheme::ModalExact, 1.0, [5e-3, 0.02])]
    {
        let model = bar(40, end_mass).model();
        let step = 1e-7;
        let mut system = system(&model, scheme, step);
        // Rigid translation at SPEED: mode 0.
        system.bank_mut().set_modal_state(0, 0, 0.0, SPEED * (DENSITY * AREA * LENGTH).sqrt());
        system.start(&[PrescribedMotion::default()]);
        let before = system.energies();
        let (mut impulse, mut touched, mut released) = (0.0, f64::NAN, 0.0);
        for index in 1..=3000 {
            Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
            let force: f64 = system.events().iter().map(|event| event.normal).sum();
            impulse += force * step;
            if force > 0.0 {
                released = f64::from(index) * step;
                if touched.is_nan() {
                    touched = released;
                }
            }
        }
        let (kinetic, strain) = system.energies();
        let loss = 1.0 - (kinetic + strain) / (before.0 + before.1);
        print_row!(
            "{scheme:?}: contact {:.2} to {:.2} us, impulse {impulse:.4} N.s, loss {loss:.2e}, booked {:.2e}, ledger {:.1e}",
            touched * 1e6,
            released * 1e6,
            system.ledger().impact_loss.value() / (before.0 + before.1),
            system.ledger().residual(kinetic + strain) / (before.0 + before.1)
        );
        // Exact: contact at 49.46, release at 148.39 us, impulse 13.203 N.s (the article's closed form).
        assert!((touched - 49.46e-6).abs() < 0.3e-6 && (released - 148.39e-6).abs() < 3e-6);
        assert!((impulse - 13.203).abs() < 0.02 * 13.203);
        assert!((losses[0]..losses[1]).contains(&loss), "{loss:e}");
        assert!((system.ledger().residual(kinetic + strain) / (before.0 + before.1)).abs() < 1e-12);
    }
    guide::hold("cargo test -p tiprub-core --test massless");
}

/// Returns, for a bar permanently pressed onto a wall, its largest energy (J) over 4000 steps with the fraction `share`
/// of the computed limit, and the relative change in the last hundred steps.
fn pressed(damping_ratio: f64, share: f64) -> (f64, f64) {
    let mut model = bar(12, NEARLY_NONE).clamped_model();
    model.damping_ratios.fill(damping_ratio);
    let check = MasslessCheck { model: &model, normals: vec![-Vector3::x()], carriers: Vec::new() };
    let limit = check.limit(1.0).unwrap().closed;
    print_row!("ξ = {damping_ratio}: limit {limit:.3e} s, {:.2} of 2/ω_max", limit * model.largest_frequency() / 2.0);
    let law = FixedGap { normals: vec![-Vector3::x()], gaps: vec![-1e-4], sliding: vec![Vector3::zeros()] };
    let settings = SystemSettings { scheme: Scheme::MasslessBoundary, solver: Solver::Lcp, ledger: true };
    let mut pressed = single_sector(&model, GapLaw::Fixed(law), 0.0, settings);
    pressed.set_step(share * limit);
    pressed.start(&[PrescribedMotion::default()]);
    let (mut most, mut last) = (0.0_f64, [f64::INFINITY, f64::NEG_INFINITY]);
    for step in 0..4000 {
        if Recurrence.step(&mut pressed, &[PrescribedMotion::default()]).is_err() {
            return (f64::INFINITY, f64::INFINITY);
        }
        // Fixed obstacles have no axis, so the force is the unrotated one on the node.
        for event in pressed.events() {
            assert!(event.force[0] < 0.0 && event.wrench.force.map(f64::to_bits) == event.force.map(f64::to_bits));
        }
        let (kinetic, strain) = pressed.energies();
        most = most.max((kinetic + strain).abs());
        if step >= 3900 {
            last = [last[0].min(kinetic + strain), last[1].max(kinetic + strain)];
        }
    }
    (most, (last[1] - last[0]) / most)
}

/// Above the computed limit closed contact grows without bound, below it the energy stays bounded.
#[test]
fn closed_contact_is_stable_only_up_to_the_limit() {
    let (stable, unstable) = (pressed(0.0, 0.8).0, pressed(0.0, 1.1).0);
    print_row!("largest energy {stable:.1e} J below, {unstable:.1e} J above");
    assert!(unstable > 1e3 * stable && pressed(0.05, 0.7).1 < 1e-9 && pressed(0.05, 1.05).1 > 1e-3);
}

/// One mode with inertia on the residual flexibility of a node: q⁺ = (1 + β − S)q − βq⁻ with S = κ + c K. Damping
/// lowers β, and with it the largest S at which both roots stay within the unit circle.
#[test]
fn step_limit_accounts_for_damping() {
    let (frequency, fixed) = (2e4, 5e4);
    for damping_ratio in [0.0, 0.1, 0.3, 0.6] {
        let model = ModalModel {
            frequencies: vec![frequency, fixed, fixed, fixed],
            damping_ratios: vec![damping_ratio; 4],
            contact_modes: DMatrix::from_row_slice(3, 4, &[1., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]),
            shapes: DMatrix::identity(4, 4),
            quasi_static: 3,
        };
        let check = MasslessCheck { model: &model, normals: vec![-Vector3::x()], carriers: Vec::new() };
        let limit = check.limit(1.0).unwrap().closed;
        let radius = |step: f64| {
            let mode = model.coefficient(0, 1.0, Scheme::MasslessBoundary, step);
            let sum = 1.0 + mode.beta - mode.kappa - mode.delayed * fixed * fixed;
            let root = sum * sum - 4.0 * mode.beta;
            if root < 0.0 { mode.beta.sqrt() } else { 0.5 * (sum.abs() + root.sqrt()) }
        };
        let (below, above) = (radius(0.99 * limit), radius(1.01 * limit));
        print_row!("ξ = {damping_ratio}: limit {limit:.3e} s, largest root {below:.4} below, {above:.4} above");
        assert!(below < 1.0 + 1e-12 && above > 1.0, "ξ = {damping_ratio}");
    }
}

/// Returns the largest amplitude of two undamped oscillators of `frequencies` after 3000 steps of their exact motion. A
/// spring of stiffness K = 1 between them carries the forces, which are held for a step; `seen` are its displacements
/// per amplitude.
fn joined(frequencies: [f64; 2], seen: [f64; 2], step: f64) -> f64 {
    let (mut now, mut before) = ([1.0, 0.4], [0.9, 0.5]);
    for _ in 0..3000 {
        let force = -(seen[0] * now[0] + seen[1] * now[1]);
        let next: [f64; 2] = std::array::from_fn(|i| {
            let (cosine, sine) = ((frequencies[i] * step).cos(), (0.5 * frequencies[i] * step).sin());
            let impulse = (2.0 * sine / frequencies[i]).powi(2) * seen[i] * force;
            2.0 * cosine * now[i] - before[i] + impulse
        });
        (before, now) = (now, next);
    }
    now[0].hypot(before[0]).max(now[1].hypot(before[1]))
}

/// For slaves that are soft or stiff compared with the master, and with small or large participation, no step below the
/// limit is unstable, and one slightly above is.
#[test]
fn step_limit_accounts_for_slave_flexibility() {
    for (own, slave) in [(0.3, 0.05), (0.5, 1e-3), (0.5, 0.5), (0.7, 1.5), (0.3, 4.0), (0.3, 20.0)] {
        for seen in [0.03, 0.3, 1.0, 3.0] {
            let model = |frequencies: Vec<f64>, shapes: [f64; 4], quasi_static: usize| ModalModel {
                damping_ratios: vec![0.0; frequencies.len()],
                contact_modes: DMatrix::from_fn(3, frequencies.len(), |row, mode| {
                    if mode == 0 { shapes[row] } else { f64::from(u8::from(mode == row + 1)) * 1e3 }
                }),
                shapes: DMatrix::identity(frequencies.len(), frequencies.len()),
                quasi_static,
                frequencies,
            };
            // Residual flexibility along the normal: (1000/1000)² = 1.
            let master = model(vec![own, 1e3, 1e3, 1e3], [1.0, 0.0, 0.0, 0.0], 3);
            let other = model(vec![slave], [seen, 0.0, 0.0, 0.0], 0);
            let check = |carriers| MasslessCheck { model: &master, normals: vec![-Vector3::x()], carriers };
            let under = |seen: f64| CarrierUnderNodes { normals: DMatrix::from_element(1, 1, seen), model: &other };
            let flexible = check(vec![under(seen)]);
            let (limit, alone) =
                (flexible.limit(100.0).unwrap().closed, check(Vec::new()).limit(100.0).unwrap().closed);
            // Two slaves with 1/√2 of the participation are equivalent to one.
            let half = || under(seen * std::f64::consts::FRAC_1_SQRT_2);
            let halves = check(vec![half(), half()]).limit(100.0).unwrap().closed;
            assert!((halves / limit - 1.0).abs() < 1e-9, "{halves} and {limit}");
            let first = (1..).map(|i| 1e-3 * f64::from(i)).find(|step| joined([own, slave], [1.0, seen], *step) > 1e3);
            let first = first.unwrap();
            print_row!(
                "ω = {own} against {slave}, seen {seen}: limit {limit:.3} s, unstable from {first:.3} s, {alone:.3} s alone"
            );
            assert!(limit < alone && limit < first + 1e-3 && limit > 0.95 * first, "{limit} of {first}");
        }
    }
}

/// Returns two bodies behind a light end node, stiff along x and along y, which is pressed against a wall at x and
/// dragged along +y at 1 m/s.
fn dragged(step: f64, solver: Solver) -> (System, f64) {
    let (outer, inner, light) = (1e6, 1e4, 1e-6);
    // A force along x also deflects along y.
    let between = [[outer, 0.6 * outer], [0.6 * outer, outer]];
    let stiffness = DMatrix::from_fn(4, 4, |i, j| {
        let ground = if i == j && i > 1 { inner } else { 0.0 };
        ground + if (i > 1) == (j > 1) { between[i % 2][j % 2] } else { -between[i % 2][j % 2] }
    });
    let mut map = DMatrix::zeros(3, 4);
    (map[(0, 0)], map[(1, 1)]) = (1.0, 1.0);
    let mass = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![light, light, 1.0, 1.0]));
    let rom = structure("dragged", mass, stiffness, map, vec![node("end", [0.0; 3], 0.0)]);
    let model = ModalModel { quasi_static: 2, ..ModalModel::from_rom(&rom, 0.0).unwrap() };
    let sliding = vec![Vector3::y()];
    let law = FixedGap { normals: vec![-Vector3::x()], gaps: vec![-1e-4], sliding };
    let settings = SystemSettings { scheme: Scheme::MasslessBoundary, solver, ledger: true };
    let mut system = single_sector(&model, GapLaw::Fixed(law), 0.3, settings);
    system.set_step(step);
    system.start(&[PrescribedMotion::default()]);
    (system, step)
}

#[test]
fn friction_opposes_sliding_for_any_step_length() {
    for solver in [Solver::Lcp, Solver::Film] {
        // The contact forces displace the node by 1e-5 m and more: 10 m/s in the first of these steps.
        let ends = [1e-6, 1e-7, 1e-8].map(|step| {
            let (mut system, step) = dragged(step, solver);
            let mut time = 0.0;
            while time < 1e-4 {
                Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
                time += step;
                let event = system.events()[0];
                assert!((event.force[1] + 0.3 * event.normal).abs() < 1e-12 * event.normal, "h = {step:e}: {event:?}");
            }
            system.bank().row(1, 0)
        });
        print_row!("{solver:?}: {ends:?}");
        assert!(ends[0].abs() > 1e-6 && (ends[1] - ends[2]).abs() < 0.2 * (ends[0] - ends[2]).abs(), "{ends:?}");
    }
}
