//! Element matrices of a deformed body: large displacements, St. Venant-Kirchhoff material (total Lagrangian form).
//!
//! F = I + ∂u/∂X, E = (FᵀF - I)/2, S = λ tr(E) I + 2µE; all integrals are over the undeformed body with the rule of
//! the linear stiffness (Wriggers, Nonlinear Finite Element Methods, 2008, section 4.2).

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::matrices::{Mapped, map_point};
use super::{ElementKind, MAX_NODES};
use crate::{Result, material::Material};

/// Forces and stiffness of a deformed element.
#[derive(Debug, Clone)]
pub struct ElementTangent {
    /// ∂(internal force)/∂u, 3n × 3n in N/m, dofs ordered (node, component), symmetric.
    pub stiffness: DMatrix<f64>,
    /// Internal force on every node (N).
    pub force: Vec<[f64; 3]>,
    /// Largest component of the Green strain E at any integration point.
    pub largest_strain: f64,
}

/// Returns the deformation gradient F at a mapped point.
fn deformation(mapped: &Mapped, displacements: &[[f64; 3]]) -> Matrix3<f64> {
    let mut gradient = Matrix3::identity();
    for (u, slope) in displacements.iter().zip(&mapped.shape.gradients) {
        gradient += Vector3::from(*u) * Vector3::from(*slope).transpose();
    }
    gradient
}

/// Returns the Green strain E of a deformation gradient.
fn green_strain(deformation: &Matrix3<f64>) -> Matrix3<f64> {
    0.5 * (deformation.transpose() * deformation - Matrix3::identity())
}

/// Returns the second Piola-Kirchhoff stress S of a Green strain (Pa).
fn second_stress(material: &Material, strain: &Matrix3<f64>) -> Matrix3<f64> {
    let (lambda, shear) = material.lame();
    Matrix3::identity() * (lambda * strain.trace()) + strain * (2.0 * shear)
}

/// Computes the second Piola-Kirchhoff stresses (Sxx, Syy, Szz, Sxy, Syz, Szx) in Pa at the points of the stiffness
/// rule.
///
/// # Errors
/// [`Error::NegativeJacobian`](crate::Error::NegativeJacobian) with `element + 1` as the element number.
pub fn second_stresses(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    displacements: &[[f64; 3]],
    material: &Material,
    element: usize,
) -> Result<Vec<[f64; 6]>> {
    let point = |(index, quadrature)| {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        let s = second_stress(material, &green_strain(&deformation(&mapped, displacements)));
        Ok([s[(0, 0)], s[(1, 1)], s[(2, 2)], s[(0, 1)], s[(1, 2)], s[(2, 0)]])
    };
    kind.stiffness_rule().iter().enumerate().map(point).collect()
}

/// Computes the geometric (stress) stiffness per node pair, n × n in N/m; each entry applies to all three
/// displacement components.
///
/// g_ab = ∫ ∇N_aᵀ S ∇N_b dV with `stresses` (xx, yy, zz, xy, yz, zx) in Pa at the points of the stiffness rule.
///
/// # Errors
/// [`Error::NegativeJacobian`](crate::Error::NegativeJacobian) with `element + 1` as the element number.
///
/// # Panics
/// If the numbers of stresses and integration points differ.
pub fn geometric_stiffness(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    stresses: &[[f64; 6]],
    element: usize,
) -> Result<DMatrix<f64>> {
    let (nodes, rule) = (kind.node_count(), kind.stiffness_rule());
    assert_eq!(stresses.len(), rule.len(), "one stress per integration point");
    let mut matrix = DMatrix::zeros(nodes, nodes);
    for (index, (quadrature, &[xx, yy, zz, xy, yz, zx])) in rule.iter().zip(stresses).enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        add_geometric(&mut matrix, &mapped, &Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz));
    }
    matrix.fill_lower_triangle_with_upper_triangle();
    Ok(matrix)
}

/// Adds the contribution of a point to the upper triangle of the geometric stiffness.
fn add_geometric(matrix: &mut DMatrix<f64>, mapped: &Mapped, stress: &Matrix3<f64>) {
    for b in 0..matrix.nrows() {
        let traction = stress * Vector3::from(mapped.shape.gradients[b]) * mapped.volume;
        for a in 0..=b {
            matrix[(a, b)] += Vector3::from(mapped.shape.gradients[a]).dot(&traction);
        }
    }
}

/// Computes the internal force and tangent stiffness of a deformed element.
///
/// f_a = ∫ F S ∇N_a dV, and, with p_a = F∇N_a, K_ab = ∫ λ p_a p_bᵀ + µ p_b p_aᵀ + µ (∇N_a·∇N_b) FFᵀ + (∇N_aᵀ S ∇N_b)
/// I dV: the linear stiffness rotated and stretched by F, and the geometric stiffness.
///
/// # Errors
/// [`Error::NegativeJacobian`](crate::Error::NegativeJacobian) with `element + 1` as the element number.
pub fn tangent(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    displacements: &[[f64; 3]],
    material: &Material,
    element: usize,
) -> Result<ElementTangent> {
    let nodes = kind.node_count();
    let mut stiffness = DMatrix::zeros(3 * nodes, 3 * nodes);
    let mut geometric = DMatrix::zeros(nodes, nodes);
    let mut force = vec![[0.0; 3]; nodes];
    let mut largest_strain = 0.0_f64;
    for (index, quadrature) in kind.stiffness_rule().iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        let deformation = deformation(&mapped, displacements);
        let strain = green_strain(&deformation);
        largest_strain = largest_strain.max(strain.amax());
        let stress = second_stress(material, &strain);
        let first_stress = deformation * stress * mapped.volume;
        for (part, gradient) in force.iter_mut().zip(&mapped.shape.gradients) {
            let traction = first_stress * Vector3::from(*gradient);
            (0..3).for_each(|i| part[i] += traction[i]);
        }
        add_geometric(&mut geometric, &mapped, &stress);
        add_material(&mut stiffness, &mapped, &deformation, material);
    }
    for b in 0..nodes {
        for a in 0..=b {
            (0..3).for_each(|i| stiffness[(3 * a + i, 3 * b + i)] += geometric[(a, b)]);
        }
    }
    stiffness.fill_lower_triangle_with_upper_triangle();
    Ok(ElementTangent { stiffness, force, largest_strain })
}

/// Adds the contribution of a point to the blocks of the material stiffness on and above the diagonal.
fn add_material(stiffness: &mut DMatrix<f64>, mapped: &Mapped, deformation: &Matrix3<f64>, material: &Material) {
    let nodes = stiffness.nrows() / 3;
    let (lambda, shear) = material.lame();
    let stretch = deformation * deformation.transpose();
    let gradients = &mapped.shape.gradients;
    let mut pushed = [Vector3::zeros(); MAX_NODES];
    for (p, gradient) in pushed.iter_mut().zip(gradients) {
        *p = deformation * Vector3::from(*gradient);
    }
    let (lambda, shear) = (lambda * mapped.volume, shear * mapped.volume);
    for b in 0..nodes {
        for a in 0..=b {
            let (pa, pb) = (pushed[a], pushed[b]);
            let dot = shear * Vector3::from(gradients[a]).dot(&Vector3::from(gradients[b]));
            for j in 0..3 {
                for i in 0..3 {
                    stiffness[(3 * a + i, 3 * b + j)] +=
                        lambda * pa[i] * pb[j] + shear * pb[i] * pa[j] + dot * stretch[(i, j)];
                }
            }
        }
    }
}
