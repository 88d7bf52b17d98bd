//! Carpenter's two bars through the core: force, release, impulse and energy loss against the exact ones.

use nalgebra::DMatrix;
use tiprub_core::contact::gap::{Drive, FixedGap, GapLaw};
use tiprub_core::dynamics::modal::{ModalModel, NodePair};
use tiprub_core::rom::{ContactNode, Frame, Rom, RomChecks};
use tiprub_core::settings::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_reference::carpenter::{self, AREA, DENSITY, GAP, LENGTH, SPEED, YOUNG};

/// A free bar of `elements` linear elements with lumped mass; its contact node is `end` (0 or elements).
fn bar(elements: usize, end: usize) -> Rom {
    let size = LENGTH / elements as f64;
    let (stiffness, mass) = (YOUNG * AREA / size, DENSITY * AREA * size);
    let nodes = elements + 1;
    let mut k = DMatrix::zeros(nodes, nodes);
    let mut m = DMatrix::zeros(nodes, nodes);
    for element in 0..elements {
        for (i, j, sign) in [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)] {
            k[(element + i, element + j)] += sign * stiffness;
        }
        m[(element, element)] += mass / 2.0;
        m[(element + 1, element + 1)] += mass / 2.0;
    }
    let mut map = DMatrix::zeros(3, nodes);
    map[(0, end)] = 1.0;
    Rom {
        name: "bar".into(),
        origin: "linear rod elements, lumped mass".into(),
        sectors: 1,
        frame: Frame::Cartesian,
        mass: m,
        stiffness: k,
        damping_ratio: 0.0,
        contact_map: map,
        contact_nodes: vec![ContactNode { name: "end".into(), position: [0.0; 3], meridional_slope: 0.0 }],
        checks: RomChecks::default(),
        extras: tiprub_core::rom::RomExtras::default(),
    }
}

#[derive(Debug)]
struct Outcome {
    force: f64,
    touch: f64,
    release: f64,
    impulse: f64,
    energy_loss: f64,
    residual: f64,
}

fn collide(elements: usize, scheme: Scheme, solver: Solver, courant: f64) -> Outcome {
    let (left, right) = (bar(elements, elements), bar(elements, 0));
    let models = [ModalModel::from_rom(&left, 0.0).unwrap(), ModalModel::from_rom(&right, 0.0).unwrap()];
    let model = ModalModel::combined(&models, &[NodePair { master: (0, 0), slave: Some((1, 0)) }]).unwrap();
    let law = GapLaw::Fixed(FixedGap { normals: vec![[-1.0, 0.0, 0.0]], gaps: vec![GAP], sliding: vec![[0.0; 3]] });
    let settings = SystemSettings { scheme, solver, friction: 0.0, ledger: true };
    let mut system = System::new(&model, 1, law, settings);
    let step = courant * LENGTH / elements as f64 / carpenter::wave_speed();
    system.set_step(step);
    let nodes = elements + 1;
    for mode in 0..model.len() {
        // q̇ = φᵀ M v with v = ±SPEED on the two bars.
        let momentum = |offset: usize, rom: &Rom| -> f64 {
            (0..nodes).map(|node| model.shapes[(offset + node, mode)] * rom.mass[(node, node)]).sum()
        };
        let velocity = SPEED * (momentum(0, &left) - momentum(nodes, &right));
        system.bank_mut().set_modal_state(mode, 0, 0.0, velocity);
    }
    system.start(&Drive::default());
    let before: f64 = system.ledger().initial;
    let (mut touch, mut release, mut impulse, mut mean, mut count) = (f64::NAN, 0.0, 0.0, 0.0, 0);
    let exact = carpenter::exact();
    while system.steps() as f64 * step < 220e-6 {
        // λ enforces the gap at t_{n+1} and acts as the force at t_n.
        let time = system.steps() as f64 * step;
        system.step(&Drive::default()).unwrap();
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
    system.close_books();
    let (kinetic, strain) = system.energies();
    let energy = kinetic + strain;
    Outcome {
        force: mean / f64::from(count),
        touch,
        release,
        impulse,
        energy_loss: (before - energy) / before,
        residual: system.ledger().residual(energy) / before,
    }
}

#[test]
fn two_bars_meet_and_part_as_plane_waves_say() {
    let exact = carpenter::exact();
    println!("exact: {exact:?}");
    for solver in [Solver::Film, Solver::Lcp] {
        for elements in [20, 40, 80, 200] {
            let found = collide(elements, Scheme::CentralDifference, solver, 0.9);
            println!("{solver:?} n = {elements}: {found:?}");
            let size = 1.0 / elements as f64;
            assert!((found.force / exact.force - 1.0).abs() < 0.01, "force");
            assert!((found.impulse / exact.impulse - 1.0).abs() < 1.0 * size, "impulse");
            assert!((found.touch - exact.touch).abs() < 3.0 * size * 49.5e-6, "touch");
            assert!((found.release - exact.release).abs() < 6.0 * size * 99e-6, "release");
            // The lumped contact node stops inelastically: about 1/(2n) of the energy is lost.
            assert!((found.energy_loss / (0.5 * size) - 1.0).abs() < 0.4, "loss {}", found.energy_loss);
            assert!(found.residual.abs() < 1e-12, "ledger {}", found.residual);
        }
    }
}

#[test]
fn modal_exact_stepping_of_the_bars_agrees() {
    let exact = carpenter::exact();
    let found = collide(80, Scheme::ModalExact, Solver::Lcp, 0.9);
    println!("modal-exact n = 80: {found:?}");
    assert!((found.impulse / exact.impulse - 1.0).abs() < 0.02 && found.residual.abs() < 1e-12);
}
