//! Natural frequencies against closed forms, with their rate of convergence.

use crate::common::{nodes_at, straight_box};
use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::element::ElementKind;
use tiprub_model::material::Material;
use tiprub_model::progress::silent;
use tiprub_model::reduce::full_modes;
use tiprub_model::sparse::principal_pair;

/// Without Poisson's effect, bar and beam theory are valid for the solid.
fn material() -> Material {
    Material { name: "no_poisson".into(), young_modulus: 200e9, poisson_ratio: 0.0, density: 8000.0, expansion: 0.0 }
}

const LENGTH: f64 = 1.0;

/// Returns the first frequency of longitudinal vibration of a clamped-free bar that can only move axially, `count`
/// bricks long.
fn axial_frequency(kind: ElementKind, count: usize) -> f64 {
    let side = LENGTH / count as f64;
    let mesh = straight_box(kind, [count, 1, 1], [LENGTH, side, side]);
    let assembled = assemble(&mesh, &material(), &silent).unwrap();
    let free: Vec<usize> =
        free_dofs(mesh.nodes.len(), &nodes_at(&mesh, 0, 0.0)).into_iter().filter(|dof| dof.is_multiple_of(3)).collect();
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    full_modes(&stiffness, &mass, false, 1, &silent).unwrap().modes.frequencies()[0]
}

/// Second order for the linear elements, fourth for the quadratic ones (error in frequency, consistent mass). The
/// test case is axial vibration of a clamped-free bar, ν = 0, transverse motion held, f = √(E/ρ)/4L.
#[test]
fn axial_frequencies_converge_at_the_order_of_the_element() {
    let exact = (material().young_modulus / material().density).sqrt() / (4.0 * LENGTH);
    for kind in ElementKind::ALL {
        let expected = if kind == kind.quadratic() { 4.0 } else { 2.0 };
        // Finer meshes of quadratic elements would reach round-off.
        let counts = if kind == kind.quadratic() { [2, 4, 8] } else { [4, 8, 16] };
        let errors = counts.map(|count| axial_frequency(kind, count) / exact - 1.0);
        let rates = [0, 1].map(|i| (errors[i] / errors[i + 1]).log2());
        println!("{kind:?}: errors {errors:.3?}, rates {rates:.3?}");
        assert!(
            errors.iter().all(|&error| error > 0.0),
            "{kind:?}: a conforming element with consistent mass is stiff"
        );
        assert!(rates.iter().all(|rate| (rate - expected).abs() < 0.15), "{kind:?}: rates {rates:?}");
    }
}

/// Returns the frequencies of a cantilever of square section; bending modes come in pairs, one per direction.
fn cantilever(kind: ElementKind, counts: [usize; 3], side: f64, modes: usize) -> Vec<f64> {
    let mesh = straight_box(kind, counts, [LENGTH, side, side]);
    let assembled = assemble(&mesh, &material(), &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), &nodes_at(&mesh, 0, 0.0));
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    full_modes(&stiffness, &mass, false, modes, &silent).unwrap().modes.frequencies()
}

#[test]
fn slender_cantilever_matches_euler_bernoulli() {
    let side = 0.01;
    let frequencies = cantilever(ElementKind::Hex20, [40, 1, 1], side, 6);
    let inertia_over_area = side * side / 12.0;
    let speed = (material().young_modulus * inertia_over_area / material().density).sqrt();
    for (mode, beta_length) in [1.875_104_068_7, 4.694_091_133, 7.854_757_438].into_iter().enumerate() {
        let exact = beta_length * beta_length / (core::f64::consts::TAU * LENGTH * LENGTH) * speed;
        let pair = [frequencies[2 * mode], frequencies[2 * mode + 1]];
        println!("mode {}: {pair:.4?} Hz, Euler-Bernoulli {exact:.4} Hz", mode + 1);
        // Shear and rotary inertia, which beam theory omits, lower the third mode by 0.2 % at L/h = 100.
        let allowed = [1e-4, 1e-3, 2.5e-3][mode];
        assert!(pair.iter().all(|frequency| (frequency / exact - 1.0).abs() < allowed), "{pair:?} {exact}");
        // Round-off of the solution: machine epsilon times the condition of the stiffness matrix, about 1e10 here.
        let split = pair[1] / pair[0] - 1.0;
        assert!(split.abs() < 1e-7, "the two directions must agree, they differ by {split:e}");
    }
}

/// Returns the first bending frequency of the symmetric half of a stubby simply supported beam: axial motion held in
/// the plane of symmetry, transverse motion at the support.
fn half_beam(kind: ElementKind, count: usize) -> f64 {
    let mesh = straight_box(kind, [count, count / 4, count / 4], [LENGTH, LENGTH / 4.0, LENGTH / 4.0]);
    let assembled = assemble(&mesh, &material(), &silent).unwrap();
    let (symmetry, support) = (nodes_at(&mesh, 0, 0.0), nodes_at(&mesh, 0, LENGTH));
    let held =
        |dof: usize| if dof.is_multiple_of(3) { symmetry.contains(&(dof / 3)) } else { support.contains(&(dof / 3)) };
    let free: Vec<usize> = (0..3 * mesh.nodes.len()).filter(|&dof| !held(dof)).collect();
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    full_modes(&stiffness, &mass, false, 1, &silent).unwrap().modes.frequencies()[0]
}

/// Uniform refinement in bending: differences of successive frequencies decrease with order 2 and 4. The supports
/// permit the sections to warp, so that no corner is singular (a clamped face in bending is singular and would limit
/// the order).
#[test]
fn bending_frequencies_converge_at_the_order_of_the_element() {
    for (kind, expected) in [(ElementKind::Hex8, 2.0), (ElementKind::Hex20, 4.0)] {
        let frequencies = [4, 8, 16].map(|count| half_beam(kind, count));
        let steps = [0, 1].map(|i| frequencies[i] - frequencies[i + 1]);
        let rate = (steps[0] / steps[1]).log2();
        println!("{kind:?}: {frequencies:.5?} Hz, rate {rate:.3}");
        assert!(steps.iter().all(|&step| step > 0.0), "{kind:?}: must come from above");
        assert!((rate - expected).abs() < 0.2, "{kind:?}: rate {rate}");
    }
}
