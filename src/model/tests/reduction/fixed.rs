//! Lanczos against dense eigenvalues; Craig-Bampton against the full model.

use crate::common::{dense, distorted_box, nodes_at, steel, straight_box, wobble};
use faer::Mat;
use nalgebra::DMatrix;
use proptest::prelude::*;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::craig_bampton::{craig_bampton, dense_modes};
use tiprub_model::eigen::lowest_modes;
use tiprub_model::element::ElementKind;
use tiprub_model::progress::{ReductionProgress, ReductionStage, silent};
use tiprub_model::reduce::{ContactPoint, Reduction, ReductionKind, ReductionOptions, full_modes, reduce};
use tiprub_model::sparse::{SparseMatrix, principal_pair};
use tiprub_model::stress::StressPlaces;
use tiprub_model::{Error, Mesh};

const SIZE: [f64; 3] = [0.3, 0.04, 0.05];

fn beam() -> Mesh {
    distorted_box(ElementKind::Hex20, [5, 2, 2], SIZE, wobble(0.1))
}

fn clamped_pencil(mesh: &Mesh) -> (SparseMatrix, SparseMatrix) {
    let assembled = assemble(mesh, &steel(), &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), &nodes_at(mesh, 0, 0.0));
    principal_pair(&assembled.stiffness, &assembled.mass, &free)
}

#[test]
fn lanczos_matches_dense_solver() {
    let (stiffness, mass) = clamped_pencil(&distorted_box(ElementKind::Hex8, [5, 2, 2], SIZE, wobble(0.1)));
    let (exact, _) = dense_modes(&dense(&stiffness), &dense(&mass)).unwrap();
    let factor = stiffness.factor("K", "").unwrap();
    for count in [1, 7, 40, stiffness.order()] {
        let modes = lowest_modes(&mass, &factor, 0.0, count, ReductionStage::FullModes, &silent).unwrap();
        for (k, (found, exact)) in modes.eigenvalues.iter().zip(&exact).enumerate() {
            assert!((found / exact - 1.0).abs() < 1e-9, "{count} modes, number {k}: {found} instead of {exact}");
        }
        let gram = modes.shapes.transpose() * mass.times(modes.shapes.as_ref());
        let worst = (0..count)
            .flat_map(|i| (0..count).map(move |j| (i, j)))
            .map(|(i, j)| (gram[(i, j)] - if i == j { 1.0 } else { 0.0 }).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1e-11, "{count} modes: the largest entry of ΦᵀMΦ - I is {worst:e}");
        assert!(modes.residuals.iter().all(|&residual| residual < 1e-8));
    }
}

#[test]
fn lanczos_finds_both_modes_of_a_double_eigenvalue() {
    // An undistorted square section bends equally in two directions.
    let (stiffness, mass) = clamped_pencil(&straight_box(ElementKind::Hex20, [6, 2, 2], [0.3, 0.04, 0.04]));
    let frequencies = full_modes(&stiffness, &mass, false, 4, &silent).unwrap().modes.frequencies();
    assert!((frequencies[1] / frequencies[0] - 1.0).abs() < 1e-8, "{frequencies:?}");
    assert!(frequencies[2] / frequencies[1] > 1.5, "{frequencies:?}");
}

#[test]
fn free_body_has_six_rigid_modes_and_correct_elastic_modes() {
    let mesh = distorted_box(ElementKind::Hex8, [4, 2, 2], SIZE, wobble(0.1));
    let assembled = assemble(&mesh, &steel(), &silent).unwrap();
    let (stiffness, mass) = (assembled.stiffness, assembled.mass);
    let modes = full_modes(&stiffness, &mass, true, 12, &silent).unwrap().modes;
    let (exact, _) = dense_modes(&dense(&stiffness), &dense(&mass)).unwrap();
    for k in 0..6 {
        assert!(modes.eigenvalues[k].abs() < 1e-7 * exact[6], "rigid mode {k}: {:e}", modes.eigenvalues[k]);
    }
    for k in 6..12 {
        assert!((modes.eigenvalues[k] / exact[k] - 1.0).abs() < 1e-8, "mode {k}");
    }
    let error = full_modes(&stiffness, &mass, false, 3, &silent).unwrap_err();
    assert!(matches!(error, Error::NotPositiveDefinite { .. }), "{error}");
    assert!(error.to_string().contains("Clamp at least three nodes"), "{error}");
}

/// A body held along one edge can still rotate about it, whether or not round-off makes the factorisation succeed.
#[test]
fn rejects_hinged_body_as_a_mechanism() {
    for kind in ElementKind::ALL {
        let mesh = distorted_box(kind, [4, 2, 2], SIZE, wobble(0.1));
        let edge: Vec<usize> =
            nodes_at(&mesh, 0, 0.0).into_iter().filter(|&node| mesh.nodes[node][2].abs() < 1e-9).collect();
        let error = reduce(mesh, &steel(), &edge, &[], &options(3, DisplacementFrame::Cartesian), &silent).unwrap_err();
        assert!(matches!(error, Error::NotPositiveDefinite { .. }), "{kind:?}: {error}");
    }
}

#[test]
fn rejects_free_body_constrained_by_two_contact_nodes() {
    let mesh = beam();
    let contact = contact(&mesh);
    let error = reduce(mesh, &steel(), &[], &contact, &options(3, DisplacementFrame::Cartesian), &silent).unwrap_err();
    assert!(error.to_string().contains("choose at least three contact nodes that are not on one line"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any small pencil K = AᵀA + I, M diagonal: Lanczos must find the dense spectrum, clusters included.
    #[test]
    fn lanczos_converges_on_random_pencils(entries in prop::collection::vec(-1.0..1.0_f64, 400), masses in prop::collection::vec(0.1..10.0_f64, 20), count in 1..20_usize) {
        let root = DMatrix::from_vec(20, 20, entries);
        let stiffness_dense = root.transpose() * &root + DMatrix::identity(20, 20);
        let pattern = std::sync::Arc::new(tiprub_model::sparse::Pattern {
            starts: (0..=20).map(|j| 20 * j).collect(),
            rows: (0..400).map(|entry| entry % 20).collect(),
        });
        let sparse = |matrix: &DMatrix<f64>| SparseMatrix { pattern: pattern.clone(), values: matrix.as_slice().to_vec() };
        let mass_dense = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(masses));
        let (stiffness, mass) = (sparse(&stiffness_dense), sparse(&mass_dense));
        let modes = lowest_modes(&mass, &stiffness.factor("K", "").unwrap(), 0.0, count, ReductionStage::FullModes, &silent).unwrap();
        let (exact, _) = dense_modes(&stiffness_dense, &mass_dense).unwrap();
        for k in 0..count {
            prop_assert!((modes.eigenvalues[k] / exact[k] - 1.0).abs() < 1e-9, "mode {}", k);
        }
    }
}

#[test]
fn rejects_more_modes_than_dofs() {
    let (stiffness, mass) = clamped_pencil(&straight_box(ElementKind::Hex8, [1, 1, 1], [0.1; 3]));
    let factor = stiffness.factor("K", "").unwrap();
    let error = lowest_modes(&mass, &factor, 0.0, 13, ReductionStage::FullModes, &silent).unwrap_err().to_string();
    assert!(error.starts_with("number of modes: 13 modes requested, but there are only 12"), "{error}");
}

#[test]
fn craig_bampton_with_all_modes_is_exact() {
    let (stiffness, mass) = clamped_pencil(&distorted_box(ElementKind::Hex8, [4, 2, 2], SIZE, wobble(0.1)));
    let order = stiffness.order();
    let interface = [order - 1, order - 2, order - 3, 10, 11, 12];
    let reduced = craig_bampton(&stiffness, &mass, &interface, order - interface.len(), &silent).unwrap();
    let (exact, _) = dense_modes(&dense(&stiffness), &dense(&mass)).unwrap();
    let (found, _) = dense_modes(&reduced.stiffness, &reduced.mass).unwrap();
    let worst = exact.iter().zip(&found).map(|(e, f)| (f / e - 1.0).abs()).fold(0.0, f64::max);
    println!("all modes kept: largest relative deviation of ω² {worst:.1e}");
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn constraint_modes_keep_static_responses_exact() {
    let (stiffness, mass) = clamped_pencil(&beam());
    let order = stiffness.order();
    let interface = [order - 3, order - 2, order - 1];
    let loads = Mat::from_fn(order, 3, |i, j| if i == interface[j] { 1.0 } else { 0.0 });
    let full = stiffness.factor("K", "").unwrap().solve(loads);
    for modes in [0, 5] {
        let reduced = craig_bampton(&stiffness, &mass, &interface, modes, &silent).unwrap();
        let compliance = reduced.stiffness.clone().cholesky().unwrap().inverse();
        for i in 0..3 {
            for j in 0..3 {
                let exact = full[(interface[i], j)];
                assert!((compliance[(i, j)] - exact).abs() < 1e-9 * full[(interface[i], i)].abs(), "{modes} modes");
            }
        }
    }
}

fn options(modes: usize, frame: DisplacementFrame) -> ReductionOptions {
    ReductionOptions {
        name: "beam".into(),
        kind: ReductionKind::FixedInterface,
        modes,
        checked_modes: 8,
        sectors: 1,
        frame,
        watched: Vec::new(),
        stress: StressPlaces::default(),
        damping_ratio: 0.01,
    }
}

fn contact(mesh: &Mesh) -> Vec<ContactPoint> {
    let corner = |y: f64, z: f64| {
        let near = |p: &[f64; 3]| [p[0] - SIZE[0], p[1] - y, p[2] - z].iter().all(|d| d.abs() < 1e-9);
        mesh.nodes.iter().position(near).unwrap()
    };
    [("low", corner(0.0, 0.0)), ("high", corner(SIZE[1], SIZE[2]))]
        .map(|(name, node)| ContactPoint::at(name, node, 0.0))
        .to_vec()
}

fn reduced_beam(modes: usize, frame: DisplacementFrame) -> Reduction {
    let mesh = beam();
    let (clamped, contact) = (nodes_at(&mesh, 0, 0.0), contact(&mesh));
    reduce(mesh, &steel(), &clamped, &contact, &options(modes, frame), &silent).unwrap()
}

#[test]
fn more_component_modes_never_make_the_reduced_model_worse() {
    let mut previous: Option<Reduction> = None;
    for modes in [2, 4, 8, 16, 32, 64] {
        let reduction = reduced_beam(modes, DisplacementFrame::Cartesian);
        let checks = &reduction.rom.checks;
        println!(
            "{modes} modes: deviation {:.2?} %, RCC {:.2?} %",
            checks.frequency_deviation, checks.residual_criterion
        );
        assert!(checks.frequency_deviation.iter().all(|&d| d > -1e-8), "reduced frequencies lie above the full ones");
        assert!(checks.residual_criterion.iter().all(|&rcc| rcc >= 0.0));
        if let Some(previous) = previous {
            let before = &previous.rom.checks.frequency_deviation;
            for (now, before) in checks.frequency_deviation.iter().zip(before) {
                assert!(*now <= before + 1e-8, "{modes} modes: {now} % after {before} %");
            }
        }
        previous = Some(reduction);
    }
    let last = previous.unwrap().rom.checks;
    assert!(last.frequency_deviation[0] < 1e-3 && last.residual_criterion[0] < 1e-2);
}

/// Evaluates eq. 12 literally, with dense matrices.
#[test]
fn residual_criterion_is_equation_12() {
    let (modes, mesh) = (6, distorted_box(ElementKind::Hex8, [4, 2, 2], SIZE, wobble(0.1)));
    let (clamped, contact) = (nodes_at(&mesh, 0, 0.0), contact(&mesh));
    let (stiffness, mass) = clamped_pencil(&mesh);
    let free = free_dofs(mesh.nodes.len(), &clamped);
    let interface: Vec<usize> = contact
        .iter()
        .flat_map(|point| (0..3).map(move |c| 3 * point.node + c))
        .map(|dof| free.binary_search(&dof).unwrap())
        .collect();
    let model = craig_bampton(&stiffness, &mass, &interface, modes, &silent).unwrap();
    let (k, m) = (dense(&stiffness), dense(&mass));
    let phi = DMatrix::from_fn(k.nrows(), model.mass.nrows(), |i, j| model.transformation[(i, j)]);
    let inverse = k.clone().cholesky().unwrap();
    let (squares, vectors) = dense_modes(&model.stiffness, &model.mass).unwrap();
    let reduction =
        reduce(mesh, &steel(), &clamped, &contact, &options(modes, DisplacementFrame::Cartesian), &silent).unwrap();
    for i in 0..8 {
        let z = vectors.column(i);
        let r = inverse.solve(&((&k - squares[i] * &m) * &phi * z));
        let criterion = (r.transpose() * &k * &r)[0] / (z.transpose() * phi.transpose() * &k * &phi * z)[0] * 100.0;
        let found = reduction.rom.checks.residual_criterion[i];
        assert!((found / criterion - 1.0).abs() < 1e-6, "mode {i}: {found} % instead of {criterion} %");
    }
}

#[test]
fn frame_rotates_displacements_and_keeps_frequencies() {
    let (cartesian, cylindrical) =
        (reduced_beam(10, DisplacementFrame::Cartesian), reduced_beam(10, DisplacementFrame::Cylindrical));
    let pairs = cartesian.rom.checks.reduced_frequencies.iter().zip(&cylindrical.rom.checks.reduced_frequencies);
    pairs.for_each(|(a, b)| assert!((a / b - 1.0).abs() < 1e-9));
    // Static compliance of the second node, rotated explicitly.
    let compliance = |reduction: &Reduction| {
        let inverse = reduction.rom.stiffness.clone().cholesky().unwrap().inverse();
        inverse.view((3, 3), (3, 3)).into_owned()
    };
    let [_, theta, _] = cylindrical.rom.contact_nodes[1].position;
    let turn =
        DMatrix::from_row_slice(3, 3, &[theta.cos(), theta.sin(), 0.0, -theta.sin(), theta.cos(), 0.0, 0.0, 0.0, 1.0]);
    let expected = &turn * compliance(&cartesian) * turn.transpose();
    let found = compliance(&cylindrical);
    assert!((&found - &expected).amax() < 1e-9 * expected.amax(), "{found} {expected}");
}

#[test]
fn a_free_structure_keeps_its_rigid_modes() {
    let mesh = beam();
    let mut points = contact(&mesh);
    let far = mesh.nodes.iter().position(|p| p[0] == 0.0 && p[1] == 0.0 && p[2] == SIZE[2]).unwrap();
    points.push(ContactPoint::at("far", far, 0.0));
    let reduction = reduce(mesh, &steel(), &[], &points, &options(10, DisplacementFrame::Cartesian), &silent).unwrap();
    let omega = &reduction.reduced_angular_frequencies;
    assert!(omega[5] < 1e-3 * omega[6], "{:?}", &omega[..8]);
    let checks = &reduction.rom.checks;
    assert!((checks.reduced_frequencies[6] / checks.full_frequencies[6] - 1.0).abs() < 1e-2, "{checks:?}");
}

#[test]
fn rejects_invalid_contact_nodes_by_name() {
    let refusal = |change: fn(&Mesh, &mut Vec<ContactPoint>)| {
        let mesh = beam();
        let (clamped, mut contact) = (nodes_at(&mesh, 0, 0.0), contact(&mesh));
        change(&mesh, &mut contact);
        reduce(mesh, &steel(), &clamped, &contact, &options(3, DisplacementFrame::Cartesian), &silent)
            .unwrap_err()
            .to_string()
    };
    assert!(
        refusal(|mesh, points| points[0].node = nodes_at(mesh, 0, 0.0)[0])
            .starts_with("contact node `low`: it is clamped")
    );
    assert!(refusal(|_, points| points[1].node = points[0].node).starts_with("contact node `high`: its node or name"));
    assert!(refusal(|_, points| points[1].node = 1_000_000).contains("node 1000001 does not exist"));
    assert!(refusal(|_, points| points[0].name = "high".into()).starts_with("contact node `high`: its node or name"));
    assert!(refusal(|_, points| points.clear()).starts_with("interface: it is empty"));
}

#[test]
fn rejects_cylindrical_frame_for_contact_node_on_axis() {
    let mesh = straight_box(ElementKind::Hex8, [2, 1, 1], [0.2, 0.1, 0.1]);
    let clamped = nodes_at(&mesh, 0, 0.2);
    let contact = [ContactPoint::at("centre", 0, 0.0)];
    let error =
        reduce(mesh, &steel(), &clamped, &contact, &options(3, DisplacementFrame::Cylindrical), &silent).unwrap_err();
    assert!(error.to_string().starts_with("contact node `centre`: it lies on the z axis"), "{error}");
}

#[test]
fn every_stage_is_reported_from_start_to_end() {
    let mesh = beam();
    let (clamped, contact) = (nodes_at(&mesh, 0, 0.0), contact(&mesh));
    let seen = std::cell::RefCell::new(Vec::<ReductionProgress>::new());
    let listener = |progress: ReductionProgress| seen.borrow_mut().push(progress);
    reduce(mesh, &steel(), &clamped, &contact, &options(5, DisplacementFrame::Cartesian), &listener).unwrap();
    let seen = seen.into_inner();
    let stages = [
        ReductionStage::Assembly,
        ReductionStage::FullModes,
        ReductionStage::FixedInterfaceModes,
        ReductionStage::ConstraintModes,
        ReductionStage::Checks,
    ];
    for stage in stages {
        let fractions: Vec<f64> = seen.iter().filter(|p| p.stage == stage).map(|p| p.fraction).collect();
        assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]), "{stage}: {fractions:?}");
        assert_eq!(fractions.last(), Some(&1.0), "{stage}");
    }
}
