//! Stress at nodes for displacement fields with known stress.

use nalgebra::DVector;
use tiprub_model::element::{ElementKind, nodal_stress, stress};

use crate::common::{distorted_box, steel, straight_box, wobble};

/// Displacements and their strains (εxx, εyy, εzz, γxy, γyz, γzx).
type DisplacementField = fn([f64; 3]) -> ([f64; 3], [f64; 6]);

/// Returns the largest deviation of the stress at every node of every element from that of the known strain, relative
/// to the largest stress.
fn deviation(kind: ElementKind, distorted: bool, field: DisplacementField) -> f64 {
    let (counts, size) = ([2, 2, 2], [0.3, 0.2, 0.1]);
    let mesh =
        if distorted { distorted_box(kind, counts, size, wobble(0.15)) } else { straight_box(kind, counts, size) };
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (number, element) in mesh.elements.iter().enumerate() {
        let coordinates = mesh.coordinates(element);
        let moved: Vec<f64> = coordinates.iter().flat_map(|place| field(*place).0).collect();
        let moved = DVector::from_vec(moved);
        for node in 0..coordinates.len() {
            let rows = nodal_stress(kind, &coordinates, &steel(), node, number).unwrap();
            let found = rows * &moved;
            let expected = stress(&steel(), field(coordinates[node]).1);
            for (found, expected) in found.iter().zip(expected) {
                worst = worst.max((found - expected).abs());
                largest = largest.max(expected.abs());
            }
        }
    }
    worst / largest
}

#[test]
fn constant_stress_is_exact_in_distorted_elements() {
    let field: DisplacementField = |[x, y, z]| {
        let u = [1e-4 * x + 2e-4 * y, -3e-4 * y + 5e-5 * z, 4e-4 * z - 1e-4 * x];
        (u, [1e-4, -3e-4, 4e-4, 2e-4, 5e-5, -1e-4])
    };
    for kind in ElementKind::ALL {
        let found = deviation(kind, true, field);
        assert!(found < 1e-12, "{kind:?}: {found:e}");
    }
}

/// Quadratic elements represent bending exactly, with a stress that is linear over the thickness.
#[test]
fn stress_of_bending_is_exact_in_quadratic_elements() {
    let field: DisplacementField = |[x, y, z]| {
        // εxx = κ y with free cross contraction (Poisson's ratio of steel, 0.3).
        let (kappa, nu) = (1e-3, 0.3);
        let u = [kappa * x * y, -0.5 * kappa * (x * x + nu * (y * y - z * z)), -kappa * nu * y * z];
        (u, [kappa * y, -nu * kappa * y, -nu * kappa * y, 0.0, 0.0, 0.0])
    };
    for kind in [ElementKind::Hex20, ElementKind::Penta15, ElementKind::Tet10] {
        let found = deviation(kind, false, field);
        assert!(found < 1e-11, "{kind:?}: {found:e}");
    }
}
