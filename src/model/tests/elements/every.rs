//! Properties of every element: interpolation, completeness, patch test, rigid-body modes, mass.

use crate::common::{distorted_box, distorted_nodes, steel, wobble};
use faer::Mat;
use nalgebra::DMatrix;
use proptest::prelude::*;
use tiprub_model::Error;
use tiprub_model::assembly::{assemble, lumped_masses};
use tiprub_model::element::{ElementKind, consistent_mass, stiffness, strain, stress};
use tiprub_model::progress::silent;
use tiprub_model::sparse::principal_pair;

#[test]
fn shape_functions_are_one_at_their_node_only() {
    for kind in ElementKind::ALL {
        for (j, &node) in kind.natural_nodes().iter().enumerate() {
            let shape = kind.shape(node);
            for i in 0..kind.node_count() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!(
                    (shape.values[i] - expected).abs() < 1e-14,
                    "{kind:?}: N_{i} at node {j} is {}",
                    shape.values[i]
                );
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn shape_functions_sum_to_one_and_reproduce_the_point(x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in -1.0..1.0_f64) {
        for kind in ElementKind::ALL {
            let shape = kind.shape([x, y, z]);
            prop_assert!((shape.values.iter().sum::<f64>() - 1.0).abs() < 1e-13);
            for d in 0..3 {
                prop_assert!(shape.gradients.iter().map(|g| g[d]).sum::<f64>().abs() < 1e-13);
                let place: f64 = kind.natural_nodes().iter().zip(shape.values).map(|(node, n)| node[d] * n).sum();
                prop_assert!((place - [x, y, z][d]).abs() < 1e-13, "{:?}", kind);
            }
        }
    }

    #[test]
    fn derivatives_agree_with_central_differences(x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in -1.0..1.0_f64) {
        let step = 1e-5;
        for kind in ElementKind::ALL {
            let shape = kind.shape([x, y, z]);
            for d in 0..3 {
                let at = |sign: f64| { let mut p = [x, y, z]; p[d] += sign * step; kind.shape(p).values };
                let (ahead, behind) = (at(1.0), at(-1.0));
                for i in 0..kind.node_count() {
                    let difference = (ahead[i] - behind[i]) / (2.0 * step);
                    prop_assert!((difference - shape.gradients[i][d]).abs() < 1e-9, "{:?} node {}", kind, i);
                }
            }
        }
    }
}

/// Returns ∫ r^a s^b t^c over the natural domain.
fn exact_monomial(kind: ElementKind, [a, b, c]: [i32; 3]) -> f64 {
    let line = |n: i32| if n % 2 == 0 { 2.0 / f64::from(n + 1) } else { 0.0 };
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    match kind.corner_count() {
        8 => line(a) * line(b) * line(c),
        6 => factorial(a) * factorial(b) / factorial(a + b + 2) * line(c),
        _ => factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 3),
    }
}

#[test]
fn mass_rules_integrate_products_of_shape_functions_exactly() {
    for kind in ElementKind::ALL {
        // Twice the degree of the shape functions: per direction for bricks and along prisms, otherwise in total.
        let degree = match kind {
            ElementKind::Hex8 | ElementKind::Penta6 | ElementKind::Tet4 => 2,
            _ => 4,
        };
        let mut tried = 0;
        for a in 0..=degree {
            for b in 0..=degree {
                for c in 0..=degree {
                    let allowed = match kind.corner_count() {
                        8 => true,
                        6 => a + b <= degree,
                        _ => a + b + c <= degree,
                    };
                    if !allowed {
                        continue;
                    }
                    let sum: f64 = kind
                        .mass_rule()
                        .iter()
                        .map(|q| q.weight * q.point[0].powi(a) * q.point[1].powi(b) * q.point[2].powi(c))
                        .sum();
                    let exact = exact_monomial(kind, [a, b, c]);
                    assert!((sum - exact).abs() < 1e-14, "{kind:?} r^{a} s^{b} t^{c}: {sum} instead of {exact}");
                    tried += 1;
                }
            }
        }
        assert!(tried >= 10, "{kind:?}");
    }
}

#[test]
fn a_distorted_element_has_exactly_six_rigid_body_modes() {
    for kind in ElementKind::ALL {
        let matrix = stiffness(kind, &distorted_nodes(kind), &steel(), 0).unwrap();
        let mut values: Vec<f64> = matrix.symmetric_eigenvalues().iter().copied().collect();
        values.sort_by(f64::total_cmp);
        let largest = values[values.len() - 1];
        for (i, value) in values.iter().enumerate() {
            let relative = value / largest;
            if i < 6 {
                assert!(relative.abs() < 1e-14, "{kind:?}: eigenvalue {i} is {relative:e} of the largest");
            } else {
                assert!(relative > 1e-6, "{kind:?}: eigenvalue {i} is {relative:e} of the largest");
            }
        }
    }
}

/// A linear displacement on the boundary of a distorted patch must cause that field, and a uniform stress,
/// everywhere.
#[test]
fn patch_test() {
    let gradient = [[1.1e-3, -0.4e-3, 0.7e-3], [0.3e-3, -0.8e-3, 0.5e-3], [-0.6e-3, 0.2e-3, 0.9e-3]];
    let field = |p: [f64; 3]| -> [f64; 3] { core::array::from_fn(|i| (0..3).map(|j| gradient[i][j] * p[j]).sum()) };
    let shear = |i: usize, j: usize| gradient[i][j] + gradient[j][i];
    let exact_strain = [gradient[0][0], gradient[1][1], gradient[2][2], shear(0, 1), shear(1, 2), shear(2, 0)];
    let exact = stress(&steel(), exact_strain);
    let scale = exact.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    for kind in ElementKind::ALL {
        let (counts, size) = ([3, 3, 3], [0.3, 0.2, 0.4]);
        let mesh = distorted_box(kind, counts, size, wobble(0.2));
        let assembled = assemble(&mesh, &steel(), &silent).unwrap();
        let on_boundary = |p: &[f64; 3]| (0..3).any(|d| p[d].abs() < 1e-12 || (p[d] - size[d]).abs() < 1e-12);
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        for (node, p) in mesh.nodes.iter().enumerate() {
            let list = if on_boundary(p) { &mut outer } else { &mut inner };
            list.extend([3 * node, 3 * node + 1, 3 * node + 2]);
        }
        assert!(!inner.is_empty());
        let prescribed = Mat::from_fn(outer.len(), 1, |i, _| field(mesh.nodes[outer[i] / 3])[outer[i] % 3]);
        let load = assembled.stiffness.block(&inner, &outer) * prescribed * faer::Scale(-1.0);
        let (inner_stiffness, _) = principal_pair(&assembled.stiffness, &assembled.mass, &inner);
        let solution = inner_stiffness.factor("patch", "").unwrap().solve(load);
        let mut displacement: Vec<[f64; 3]> = mesh.nodes.iter().map(|&p| field(p)).collect();
        for (i, dof) in inner.iter().enumerate() {
            displacement[dof / 3][dof % 3] = solution[(i, 0)];
        }
        let mut worst = 0.0_f64;
        for (number, element) in mesh.elements.iter().enumerate() {
            let local: Vec<[f64; 3]> = element.nodes.iter().map(|&node| displacement[node]).collect();
            for quadrature in element.kind.stiffness_rule() {
                let strain =
                    strain(element.kind, &mesh.coordinates(element), &local, quadrature.point, number).unwrap();
                let stress = stress(&steel(), strain);
                worst = (0..6).map(|i| (stress[i] - exact[i]).abs() / scale).fold(worst, f64::max);
            }
        }
        println!("{kind:?}: largest relative stress error of the patch {worst:.1e}");
        assert!(worst < 1e-11, "{kind:?}: {worst:e}");
    }
}

#[test]
fn mass_of_a_distorted_mesh_is_density_times_volume() {
    let size = [0.3, 0.2, 0.4];
    let exact = steel().density * size.iter().product::<f64>();
    for kind in ElementKind::ALL {
        let mesh = distorted_box(kind, [3, 3, 3], size, wobble(0.2));
        let mut consistent = 0.0;
        for (number, element) in mesh.elements.iter().enumerate() {
            let coordinates = mesh.coordinates(element);
            consistent += consistent_mass(kind, &coordinates, steel().density, number).unwrap().sum();
        }
        let lumped = lumped_masses(&mesh, steel().density).unwrap();
        let (total, smallest) = (lumped.iter().sum::<f64>(), lumped.iter().copied().fold(f64::INFINITY, f64::min));
        assert!((consistent / exact - 1.0).abs() < 1e-13, "{kind:?}: {consistent} kg instead of {exact}");
        assert!((total / exact - 1.0).abs() < 1e-13, "{kind:?}: {total} kg instead of {exact}");
        assert!(smallest > 0.0, "{kind:?}: lumped mass {smallest}");
    }
}

#[test]
fn consistent_mass_is_positive_definite() {
    for kind in ElementKind::ALL {
        let mass: DMatrix<f64> = consistent_mass(kind, &distorted_nodes(kind), 1.0, 0).unwrap();
        assert!(mass.cholesky().is_some(), "{kind:?}");
    }
}

#[test]
fn rejects_inverted_element_and_names_it() {
    for kind in ElementKind::ALL {
        let mut mesh = distorted_box(kind, [2, 1, 1], [0.2, 0.1, 0.1], |_| [0.0; 3]);
        let last = mesh.elements.len() - 1;
        // The node at each natural point is exchanged with the one at the mirrored point.
        let mirrored = |[x, y, z]: [f64; 3]| if kind.corner_count() == 4 { [y, x, z] } else { [x, y, -z] };
        let places = kind.natural_nodes();
        let nodes = mesh.elements[last].nodes.clone();
        for (i, &place) in places.iter().enumerate() {
            let partner =
                places.iter().position(|other| (0..3).all(|d| (other[d] - mirrored(place)[d]).abs() < 1e-12)).unwrap();
            mesh.elements[last].nodes[i] = nodes[partner];
        }
        let error = assemble(&mesh, &steel(), &silent).err().unwrap();
        assert!(matches!(error, Error::NegativeJacobian { element, kind: k, .. } if element == last + 1 && k == kind));
        assert!(error.to_string().contains(&format!("element {} ({})", last + 1, kind.calculix_name())), "{error}");
    }
}

#[test]
fn rejects_invalid_meshes_and_names_the_problem() {
    let sound = || distorted_box(ElementKind::Hex8, [1, 1, 1], [0.1; 3], |_| [0.0; 3]);
    let refusal = |change: fn(&mut tiprub_model::Mesh)| {
        let mut mesh = sound();
        change(&mut mesh);
        assemble(&mesh, &steel(), &silent).err().unwrap().to_string()
    };
    assert!(refusal(|mesh| mesh.nodes[3][1] = f64::NAN).starts_with("node 4: coordinates"));
    assert!(refusal(|mesh| mesh.nodes.push([0.0; 3])).starts_with("node 9: it belongs to no element"));
    assert!(refusal(|mesh| mesh.elements[0].nodes[2] = 99).starts_with("element 1 (C3D8): node 100 does not exist"));
    assert!(refusal(|mesh| mesh.elements[0].nodes.truncate(7)).starts_with("element 1 (C3D8): it has 7 nodes"));
    assert!(refusal(|mesh| drop(mesh.sets.insert("tip".into(), vec![8]))).starts_with("node set `tip`: node 9"));
    assert!(refusal(|mesh| *mesh = tiprub_model::Mesh::default()).starts_with("mesh: it has no elements"));
    let mut soft = steel();
    soft.poisson_ratio = 0.5;
    let error = assemble(&sound(), &soft, &silent).err().unwrap().to_string();
    assert!(error.starts_with("material `steel`, Poisson's ratio: 0.5"), "{error}");
}
