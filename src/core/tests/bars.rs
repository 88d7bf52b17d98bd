//! Carpenter's two bars through the core: force, release, impulse and energy loss against the exact values.

#[path = "../../../tests/guide.rs"]
mod guide;
#[path = "common/rods.rs"]
mod rods;

use guide::print_row;
use rods::{NEARLY_NONE, SCHEMES, StraightRod, ascending, quiet_step};
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::carpenter::{self, AREA, DENSITY, GAP, LENGTH, SPEED, YOUNG};
use tiprub_test_models::single_sector;

const COURANT: f64 = 0.9;

#[derive(Debug)]
struct BarRun {
    force: f64,
    touch: f64,
    release: f64,
    impulse: f64,
    energy_loss: f64,
    residual: f64,
    /// Largest difference between the impulse and the change of momentum of the left bar (N·s).
    momentum: f64,
}

fn bars(elements: usize, scheme: Scheme) -> [StraightRod; 2] {
    let kept = if scheme == Scheme::MasslessBoundary { NEARLY_NONE } else { 1.0 };
    [elements, 0].map(|end| StraightRod {
        young: YOUNG,
        density: DENSITY,
        area: AREA,
        length: LENGTH,
        elements,
        end,
        kept,
    })
}

fn collide(elements: usize, scheme: Scheme, solver: Solver) -> BarRun {
    let bars = bars(elements, scheme);
    let roms = bars.map(|bar| bar.rom());
    let models = [&roms[0], &roms[1]].map(|rom| ModalModel::from_rom(rom, 0.0).unwrap());
    let model = ascending(&tiprub_test_models::relative(&models[0], &models[1], &[[0, 0]]), 2);
    let law =
        GapLaw::Fixed(FixedGap { normals: vec![-Vector3::x()], gaps: vec![GAP], sliding: vec![Vector3::zeros()] });
    let mut system = single_sector(&model, law, 0.0, SystemSettings { scheme, solver, ledger: true });
    let courant = COURANT * bars[0].wave_time();
    let step = if scheme == Scheme::MasslessBoundary { quiet_step(&model, courant) } else { courant };
    system.set_step(step);
    let nodes = elements + 1;
    // φᵀ M 1 of either bar; q̇ = φᵀ M v with v = ±SPEED.
    let rigid = |mode: usize, bar: usize| -> f64 {
        (0..nodes).map(|node| model.shapes[(bar * nodes + node, mode)] * roms[bar].mass[(node, node)]).sum()
    };
    for mode in 0..model.len() {
        system.bank_mut().set_modal_state(mode, 0, 0.0, SPEED * (rigid(mode, 0) - rigid(mode, 1)));
    }
    let momentum = |system: &System| -> f64 {
        (0..model.len()).map(|mode| rigid(mode, 0) * system.bank().modal_state(mode, 0).1 / step).sum()
    };
    system.start(&[PrescribedMotion::default()]);
    let (before, moving) = (system.ledger().initial, momentum(&system));
    let (mut touch, mut release, mut impulse, mut mean, mut count) = (f64::NAN, 0.0, 0.0, 0.0, 0);
    let exact = carpenter::exact();
    while system.steps() as f64 * step < 220e-6 {
        // λ enforces the gap at t_{n+1} and acts as the force at t_n.
        let time = system.steps() as f64 * step;
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
        let force = system.multiplier(0, 0);
        if force > 0.0 {
            touch = if touch.is_nan() { time } else { touch };
            release = time;
        }
        impulse += force * step;
        if time > exact.touch + 10e-6 && time < exact.release - 10e-6 {
            mean += force;
            count += 1;
        }
    }
    system.close_ledger();
    let (kinetic, strain) = system.energies();
    let energy = kinetic + strain;
    BarRun {
        force: mean / f64::from(count),
        touch,
        release,
        impulse,
        energy_loss: (before - energy) / before,
        residual: system.ledger().residual(energy) / before,
        momentum: moving - momentum(&system) - impulse,
    }
}

#[test]
fn impact_of_two_bars_matches_plane_wave_solution() {
    let exact = carpenter::exact();
    let [touch, release] = [exact.touch, exact.release].map(|time| 1e6 * time);
    print_row!("| exact | | {:.1} | {touch:.2} | {release:.2} | {:.4} | 0 |", exact.force, exact.impulse);
    print_row!(
        "| scheme | solver | elements | force | touch (µs) | release (µs) | impulse (N·s) | loss (%) | loss · 2n | ledger |"
    );
    print_row!("|---|---|---|---|---|---|---|---|---|---|");
    for scheme in SCHEMES {
        // With one contact node all solvers solve the same problem, so the other solvers run only on the coarsest mesh.
        for (solver, meshes) in Solver::ALL.map(|solver| (solver, if solver == Solver::Lcp { 4 } else { 1 })) {
            for elements in [20, 40, 80, 200].into_iter().take(meshes) {
                let found = collide(elements, scheme, solver);
                let BarRun { force, touch, release, impulse, energy_loss, residual, momentum } = found;
                print_row!(
                    "| {scheme:?} | {solver:?} | {elements} | {force:.1} | {:.2} | {:.2} | {impulse:.4} | {:.4} | {:.2} | {residual:.1e} |",
                    touch * 1e6,
                    release * 1e6,
                    100.0 * energy_loss,
                    2.0 * elements as f64 * energy_loss
                );
                let size = 1.0 / elements as f64;
                assert!((force / exact.force - 1.0).abs() < 0.01, "force");
                assert!((impulse / exact.impulse - 1.0).abs() < size, "impulse");
                assert!((touch - exact.touch).abs() < 3.0 * size * 49.5e-6, "touch");
                assert!((release - exact.release).abs() < 6.0 * size * 99e-6, "release");
                assert!(residual.abs() < 1e-12, "ledger {residual:e}");
                assert!(momentum.abs() < 1e-10 * exact.impulse, "momentum {momentum:e}");
                if scheme == Scheme::MasslessBoundary {
                    // A node without mass loses no energy; 1e-4 of its mass remains.
                    assert!(energy_loss.abs() < 1e-1 * size, "loss {energy_loss:e}");
                } else {
                    // The lumped contact node stops inelastically and loses about 1/(2n) of the energy. In modal-exact,
                    // whose response to a force of one step is smaller at high frequencies, the node acts up to a
                    // quarter heavier.
                    let most = if scheme == Scheme::ModalExact { 1.6 } else { 1.4 };
                    assert!((0.6..most).contains(&(energy_loss / (0.5 * size))), "loss {energy_loss:e}");
                }
            }
        }
    }
    guide::hold("cargo test -p tiprub-core --test bars");
}
