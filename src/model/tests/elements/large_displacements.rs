//! Elements under large displacements and stress against closed forms.

use crate::common::{blade_steel, distorted_box, nodes_at, straight_box, wobble};
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use tiprub_model::Mesh;
use tiprub_model::assembly::assemble;
use tiprub_model::element::{ElementKind, consistent_mass, geometric_stiffness, second_stresses, stiffness, tangent};
use tiprub_model::progress::silent;
use tiprub_model::reduce::full_modes;
use tiprub_model::sparse::{SparseMatrix, principal_pair};

/// Returns the coordinates of an irregular element of a kind, from the middle of a distorted box.
fn element(kind: ElementKind) -> Vec<[f64; 3]> {
    let mesh = distorted_box(kind, [3, 3, 3], [0.3, 0.2, 0.25], wobble(0.15));
    mesh.coordinates(&mesh.elements[mesh.elements.len() / 2])
}

fn irregular(count: usize, size: f64, seed: f64) -> Vec<[f64; 3]> {
    let value = |i: usize, d: f64| size * (12.9 * (i as f64 + seed) + 4.7 * d).sin();
    (0..count).map(|i| [value(i, 1.0), value(i, 2.0), value(i, 3.0)]).collect()
}

fn flat(values: &[[f64; 3]]) -> DVector<f64> {
    DVector::from_iterator(3 * values.len(), values.iter().flatten().copied())
}

fn volume(kind: ElementKind, coordinates: &[[f64; 3]]) -> f64 {
    consistent_mass(kind, coordinates, 1.0, 0).unwrap().sum()
}

#[test]
fn tangent_of_undeformed_element_is_the_linear_stiffness() {
    for kind in ElementKind::ALL {
        let (coordinates, steel) = (element(kind), blade_steel(0.3));
        let at_rest = tangent(kind, &coordinates, &vec![[0.0; 3]; kind.node_count()], &steel, 0).unwrap();
        let linear = stiffness(kind, &coordinates, &steel, 0).unwrap();
        assert!((&at_rest.stiffness - &linear).amax() < 1e-13 * linear.amax(), "{kind:?}");
        assert!(at_rest.force.iter().flatten().all(|force| *force == 0.0), "{kind:?}");
    }
}

/// Internal forces are cubic in the displacements, so two central differences combine to the exact derivative.
#[test]
fn the_tangent_is_the_derivative_of_the_force() {
    for kind in ElementKind::ALL {
        let (coordinates, steel) = (element(kind), blade_steel(0.3));
        let (at, along) = (irregular(kind.node_count(), 0.01, 0.3), irregular(kind.node_count(), 0.004, 7.1));
        let force = |share: f64| {
            let moved: Vec<[f64; 3]> =
                at.iter().zip(&along).map(|(u, d)| core::array::from_fn(|i| u[i] + share * d[i])).collect();
            flat(&tangent(kind, &coordinates, &moved, &steel, 0).unwrap().force)
        };
        let difference = |share: f64| (force(share) - force(-share)) / (2.0 * share);
        let exact = (difference(0.5) * 4.0 - difference(1.0)) / 3.0;
        let tangent = tangent(kind, &coordinates, &at, &steel, 0).unwrap().stiffness;
        assert!((&tangent - tangent.transpose()).amax() == 0.0);
        let found = tangent * flat(&along);
        assert!((&found - &exact).amax() < 1e-10 * exact.amax(), "{kind:?}: {:e}", (&found - &exact).amax());
    }
}

#[test]
fn rigid_rotation_is_stress_free_and_rotates_the_stiffness() {
    let rotation = Rotation3::from_euler_angles(0.7, -1.1, 2.0);
    for kind in ElementKind::ALL {
        let (coordinates, steel) = (element(kind), blade_steel(0.3));
        let turned: Vec<[f64; 3]> =
            coordinates.iter().map(|x| (rotation * Vector3::from(*x) - Vector3::from(*x)).into()).collect();
        let found = tangent(kind, &coordinates, &turned, &steel, 0).unwrap();
        let linear = stiffness(kind, &coordinates, &steel, 0).unwrap();
        let size = linear.amax() * 0.3;
        assert!(found.force.iter().flatten().all(|force| force.abs() < 1e-12 * size), "{kind:?}");
        let turn = DMatrix::<f64>::identity(kind.node_count(), kind.node_count()).kronecker(&DMatrix::from_fn(
            3,
            3,
            |i, j| rotation[(i, j)],
        ));
        let expected = &turn * &linear * turn.transpose();
        assert!((found.stiffness - &expected).amax() < 1e-12 * expected.amax(), "{kind:?}");
    }
}

/// Patch test of the stress stiffness: under a uniform stress S a motion with the gradient H has the energy V tr(H S
/// Hᵀ): zero for a translation, σVω² for a rotation of a bar under tension σ by ω across its axis.
#[test]
fn stress_stiffness_is_exact_for_linear_motions() {
    let stress = [3e8, -1e8, 2e8, 0.5e8, -0.7e8, 1.1e8];
    let [xx, yy, zz, xy, yz, zx] = stress;
    let tensor = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let gradients = [
        Matrix3::new(0.3, -0.2, 0.5, 0.1, 0.7, -0.4, -0.6, 0.2, 0.9),
        Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ];
    for kind in ElementKind::ALL {
        let coordinates = element(kind);
        let points = kind.stiffness_rule().len();
        let matrix = geometric_stiffness(kind, &coordinates, &vec![stress; points], 0).unwrap();
        assert!(matrix.column_sum().amax() < 1e-12 * matrix.amax(), "{kind:?}: forces of a translation");
        let energy = |matrix: &DMatrix<f64>, gradient: &Matrix3<f64>| -> f64 {
            let motion: Vec<Vector3<f64>> = coordinates.iter().map(|x| gradient * Vector3::from(*x)).collect();
            let part = |i: usize| DVector::from_iterator(motion.len(), motion.iter().map(|u| u[i]));
            (0..3).map(|i| (part(i).transpose() * matrix * part(i))[0]).sum()
        };
        for gradient in &gradients {
            let exact = volume(kind, &coordinates) * (gradient * tensor * gradient.transpose()).trace();
            let found = energy(&matrix, gradient);
            assert!((found / exact - 1.0).abs() < 1e-12, "{kind:?}: {found} instead of {exact}");
        }
        let tension = geometric_stiffness(kind, &coordinates, &vec![[2e8, 0.0, 0.0, 0.0, 0.0, 0.0]; points], 0);
        let (found, exact) = (energy(&tension.unwrap(), &gradients[1]), 2e8 * volume(kind, &coordinates));
        assert!((found / exact - 1.0).abs() < 1e-12, "{kind:?}: {found} instead of {exact}");
    }
}

#[test]
fn stress_of_stretched_bar_follows_from_green_strain() {
    let (stretch, steel) = (0.01, blade_steel(0.0));
    for kind in ElementKind::ALL {
        let coordinates = element(kind);
        let moved: Vec<[f64; 3]> = coordinates.iter().map(|x| [stretch * x[0], 0.0, 0.0]).collect();
        let expected = steel.young_modulus * (stretch + 0.5 * stretch * stretch);
        for stress in second_stresses(kind, &coordinates, &moved, &steel, 0).unwrap() {
            assert!((stress[0] / expected - 1.0).abs() < 1e-11, "{kind:?}: {stress:?}");
            assert!(stress[1..].iter().all(|other| other.abs() < 1e-11 * expected), "{kind:?}: {stress:?}");
        }
    }
}

/// A bar between two hinges under tension N: ω² = (π/L)⁴EI/ρA + (π/L)²N/ρA, so that N adds (π/L)²σ/ρ.
#[test]
fn tensioned_beam_frequency_matches_closed_form() {
    let (length, height, tension) = (1.0, 0.03, 4e8);
    for kind in [ElementKind::Hex20, ElementKind::Penta15, ElementKind::Tet10] {
        let mesh = straight_box(kind, [20, 1, 1], [length, height, height]);
        let assembled = assemble(&mesh, &blade_steel(0.0), &silent).unwrap();
        let stressed = with_stress(&mesh, &assembled.stiffness, tension);
        let mut held: Vec<usize> = [nodes_at(&mesh, 0, 0.0), nodes_at(&mesh, 0, length)]
            .concat()
            .iter()
            .flat_map(|&node| [3 * node + 1, 3 * node + 2])
            .collect();
        // One node is held against sliding along the axis, on the neutral fibre or nearest to it.
        let middle = |node: &usize| (mesh.nodes[*node][1] - 0.5 * height).hypot(mesh.nodes[*node][2] - 0.5 * height);
        let axis = nodes_at(&mesh, 0, 0.5 * length).into_iter().min_by(|a, b| middle(a).total_cmp(&middle(b))).unwrap();
        held.push(3 * axis);
        let free: Vec<usize> = (0..3 * mesh.nodes.len()).filter(|dof| !held.contains(dof)).collect();
        let lowest = |stiffness: &SparseMatrix| {
            let (stiffness, mass) = principal_pair(stiffness, &assembled.mass, &free);
            full_modes(&stiffness, &mass, false, 1, &silent).unwrap().modes.eigenvalues[0]
        };
        let (slack, tight) = (lowest(&assembled.stiffness), lowest(&stressed));
        let wave = (core::f64::consts::PI / length).powi(2);
        let bending = wave * wave * 200e9 * height * height / 12.0 / 8000.0;
        let (added, exact) = (tight - slack, wave * tension / 8000.0);
        println!(
            "{kind:?}: ω² {:.4} of the beam's, tension adds {:.5} of the string's",
            slack / bending,
            added / exact
        );
        assert!((slack / bending - 1.0).abs() < 0.02 && (added / exact - 1.0).abs() < 5e-3);
    }
}

fn with_stress(mesh: &Mesh, stiffness: &SparseMatrix, tension: f64) -> SparseMatrix {
    let mut result = stiffness.clone();
    for (number, element) in mesh.elements.iter().enumerate() {
        let stresses = vec![[tension, 0.0, 0.0, 0.0, 0.0, 0.0]; element.kind.stiffness_rule().len()];
        let matrix = geometric_stiffness(element.kind, &mesh.coordinates(element), &stresses, number).unwrap();
        for (b, &column) in element.nodes.iter().enumerate() {
            for (a, &row) in element.nodes.iter().enumerate() {
                for i in 0..3 {
                    let range = result.pattern.starts[3 * column + i]..result.pattern.starts[3 * column + i + 1];
                    let place = result.pattern.rows[range.clone()].binary_search(&(3 * row + i)).unwrap();
                    result.values[range.start + place] += matrix[(a, b)];
                }
            }
        }
    }
    result
}
