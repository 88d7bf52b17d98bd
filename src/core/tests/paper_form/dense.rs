//! The paper's equations with dense matrices against the modal form of the core: equal results.

use nalgebra::{DMatrix, DVector};
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::Rom;
use tiprub_core::system::{System, SystemSettings};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_reference::paper::DenseFilm;
use tiprub_test_models::{SeededRandom, node, single_sector, structure};

const CONTACTS: usize = 3;
const ORDER: usize = 14;
const FRICTION: f64 = 0.3;
const DAMPING: f64 = 0.02;

fn rom(numbers: &mut SeededRandom) -> Rom {
    let [a, b] = [(); 2].map(|()| numbers.matrix(ORDER, ORDER));
    let mass = &a * a.transpose() * 0.1 + DMatrix::identity(ORDER, ORDER);
    let stiffness = (&b * b.transpose() + DMatrix::identity(ORDER, ORDER) * 0.3) * 1e6;
    let nodes = vec![node("node", [0.0; 3], 0.0); CONTACTS];
    Rom {
        damping_ratio: DAMPING,
        ..structure("random", mass, stiffness, DMatrix::identity(3 * CONTACTS, ORDER), nodes)
    }
}

#[test]
fn a_thousand_contact_steps_agree_to_rounding() {
    let mut numbers = SeededRandom(2010);
    let rom = rom(&mut numbers);
    let model = ModalModel::from_rom(&rom, DAMPING).unwrap();
    let step = 0.2 / model.largest_frequency();
    let normals = vec![Vector3::new(0.6, 0.0, 0.8); CONTACTS];
    let tangent = Vector3::y();
    // Sliding so fast that vibration does not turn the slip direction by even a rounding error: the case that the paper
    // assumes.
    let sliding = vec![1e18 * tangent; CONTACTS];
    // Two nodes are pressed against the obstacle at rest, one touches intermittently.
    let gaps = [-1e-4, 0.1e-4, -0.5e-4];
    let law = GapLaw::Fixed(FixedGap { normals: normals.clone(), gaps: gaps.to_vec(), sliding });
    let settings = SystemSettings { scheme: Scheme::CentralDifference, solver: Solver::Film, ledger: true };
    let mut system = single_sector(&model, law, FRICTION, settings);
    system.set_step(step);
    let start = DVector::from_fn(ORDER, |_, _| 2e-4 * numbers.signed());
    let modal = model.shapes.transpose() * &rom.mass * &start;
    for mode in 0..ORDER {
        system.bank_mut().set_modal_state(mode, 0, modal[mode], 0.0);
    }
    system.start(&[PrescribedMotion::default()]);
    let physical = |system: &System, before: bool| {
        let coordinates = DVector::from_fn(ORDER, |mode, _| {
            let (position, increment) = system.bank().modal_state(mode, 0);
            if before { position - increment } else { position }
        });
        &model.shapes * coordinates
    };
    // Modal damping projected back to the reduced coordinates: D = M Φ 2ξω Φᵀ M.
    let rates = DVector::from_fn(ORDER, |mode, _| 2.0 * DAMPING * model.frequencies[mode]);
    let weighted = &rom.mass * &model.shapes;
    let damping = &weighted * DMatrix::from_diagonal(&rates) * weighted.transpose();
    let mut paper = DenseFilm::new(
        rom.mass.clone(),
        damping,
        rom.stiffness.clone(),
        step,
        physical(&system, false),
        physical(&system, true),
    );
    let direction = |node: usize| normals[node] - FRICTION * tangent;
    let column = |vector: &dyn Fn(usize) -> Vector3| {
        DMatrix::from_fn(ORDER, CONTACTS, |row, node| if row / 3 == node { vector(node)[row % 3] } else { 0.0 })
    };
    let normal = column(&|node| normals[node]);
    let slip = column(&direction);
    assert!(normals[0].dot(&tangent).abs() < 1e-15);
    let gaps = DVector::from_row_slice(&gaps);
    let (mut contact_steps, mut steps, mut worst, mut scale) = (0, 0, 0.0_f64, 0.0_f64);
    while contact_steps < 1000 {
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
        let multipliers = paper.step(&normal, &slip, &gaps);
        let ours = physical(&system, false);
        worst = worst.max((&ours - &paper.now).amax());
        scale = scale.max(paper.now.amax());
        for node in 0..CONTACTS {
            let touching = multipliers[node] != 0.0;
            assert_eq!(touching, system.multiplier(node, 0) != 0.0, "contact set differs at step {steps}");
        }
        contact_steps += u32::from(multipliers.iter().any(|value| *value != 0.0));
        steps += 1;
        assert!(steps < 200_000, "only {contact_steps} contact steps");
    }
    println!("{steps} steps, {contact_steps} in contact: largest difference {:.2e} relative", worst / scale);
    assert!(worst / scale < 1e-12, "{:.3e}", worst / scale);
}
