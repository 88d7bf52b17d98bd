//! Hex8 with incompatible modes: patch test, rigid bodies, heat, bending without the locking of plain hex8.

use crate::common::{distorted_box, distorted_nodes, nodes_at, straight_box, wobble};
use faer::Mat;
use tiprub_model::assembly::{assemble_with, free_dofs};
use tiprub_model::element::{ElementKind, Formulation, incompatible_stiffness, stiffness, thermal_load};
use tiprub_model::material::Material;
use tiprub_model::progress::silent;
use tiprub_model::reduce::full_modes;
use tiprub_model::sparse::principal_pair;

const KIND: ElementKind = ElementKind::Hex8;

#[test]
fn distorted_element_has_six_rigid_body_modes() {
    let nodes = distorted_nodes(KIND);
    let incompatible = incompatible_stiffness(&nodes, &Material::steel(), 0).unwrap();
    let mut values: Vec<f64> = incompatible.symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let largest = values[23];
    assert!(values[..6].iter().all(|value| value.abs() < 1e-14 * largest), "{values:?}");
    assert!(values[6..].iter().all(|value| *value > 1e-6 * largest), "{values:?}");
    // Additional freedom makes it softer in every motion.
    let softer = stiffness(KIND, &nodes, &Material::steel(), 0).unwrap() - incompatible;
    let softest = softer.symmetric_eigenvalues().min();
    assert!(softest > -1e-14 * largest, "{softest}");
    assert!(softer.norm() > 1e-3 * largest);
}

/// A linear displacement of a distorted patch causes no forces on inner nodes.
#[test]
fn patch_test() {
    let gradient = [[1.1e-3, -0.4e-3, 0.7e-3], [0.3e-3, -0.8e-3, 0.5e-3], [-0.6e-3, 0.2e-3, 0.9e-3]];
    let size = [0.3, 0.2, 0.4];
    let mesh = distorted_box(KIND, [3, 3, 3], size, wobble(0.2));
    let forces = |formulation| {
        let assembled = assemble_with(&mesh, &Material::steel(), formulation, &silent).unwrap();
        let field = Mat::from_fn(3 * mesh.nodes.len(), 1, |dof, _| {
            (0..3).map(|j| gradient[dof % 3][j] * mesh.nodes[dof / 3][j]).sum()
        });
        assembled.stiffness.times(field.as_ref())
    };
    // The exact field does not excite the modes: all nodal forces are those of plain hex8, on the boundary, too.
    let [plain, incompatible] = [Formulation::Displacement, Formulation::IncompatibleModes].map(forces);
    let difference = (&plain - &incompatible).norm_max() / plain.norm_max();
    assert!(difference < 1e-12, "{difference:e}");
    let inner = |p: &[f64; 3]| (0..3).all(|d| p[d] > 1e-12 && p[d] < size[d] - 1e-12);
    let mut tried = 0;
    for (node, _) in mesh.nodes.iter().enumerate().filter(|(_, p)| inner(p)) {
        for component in 0..3 {
            let force = incompatible[(3 * node + component, 0)].abs() / incompatible.norm_max();
            assert!(force < 1e-12, "node {node}: {force:e}");
            tried += 1;
        }
    }
    assert_eq!(tried, 24);
}

#[test]
fn free_expansion_at_uniform_temperature_is_stress_free() {
    let (nodes, material) = (distorted_nodes(KIND), Material::steel());
    let matrix = incompatible_stiffness(&nodes, &material, 0).unwrap();
    let load = thermal_load(KIND, &nodes, &material, 0).unwrap();
    let growth = nalgebra::DVector::from_iterator(24, nodes.iter().flatten().map(|x| material.expansion * x));
    let forces = matrix * growth;
    let scale = load.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
    for (force, load) in forces.iter().zip(&load) {
        assert!((force - load).abs() < 1e-12 * scale, "{force} N/K instead of {load}");
    }
}

/// First bending frequency of a slender cantilever, one layer of bricks four times as long as they are thick:
/// f = 1.8751²/2π √(EI/ρAL⁴).
#[test]
fn incompatible_modes_avoid_shear_locking_of_long_bricks() {
    let material =
        Material { name: "plain".into(), young_modulus: 200e9, poisson_ratio: 0.0, density: 8000.0, expansion: 0.0 };
    let (length, side) = (1.0, 0.01);
    let theory = 1.875_104_f64.powi(2) / std::f64::consts::TAU
        * (material.young_modulus * side * side / (12.0 * material.density)).sqrt();
    let mesh = straight_box(KIND, [25, 1, 1], [length, side, side]);
    let [locked, free] = [Formulation::Displacement, Formulation::IncompatibleModes].map(|formulation| {
        let assembled = assemble_with(&mesh, &material, formulation, &silent).unwrap();
        let dofs = free_dofs(mesh.nodes.len(), &nodes_at(&mesh, 0, 0.0));
        let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &dofs);
        full_modes(&stiffness, &mass, false, 1, &silent).unwrap().modes.frequencies()[0] / theory - 1.0
    });
    println!(
        "deviation from beam theory: {:.2} % plain, {:.4} % with incompatible modes",
        100.0 * locked,
        100.0 * free
    );
    // Shear stiffens plain bricks by √(1 + (a/h)²/2) with a/h = 4 and ν = 0.
    assert!((locked - (f64::sqrt(9.0) - 1.0)).abs() < 0.05, "{locked}");
    assert!(free.abs() < 2e-3, "{free}");
}
