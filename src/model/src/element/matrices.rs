//! Element matrices of linear isotropic elasticity.

use nalgebra::{DMatrix, Matrix3, SMatrix};

use super::{ElementKind, QuadraturePoint, ShapeFunctions};
use crate::{Error, Result, material::Material};

/// Shape functions at an integration point with gradients in physical space.
pub(super) struct Mapped {
    pub(super) shape: ShapeFunctions,
    /// Quadrature weight times Jacobian determinant (m³).
    pub(super) volume: f64,
}

/// Returns the Jacobian matrix ∂x_i/∂ξ_j.
pub(super) fn jacobian(shape: &ShapeFunctions, coordinates: &[[f64; 3]]) -> Matrix3<f64> {
    let mut matrix = Matrix3::zeros();
    for (x, gradient) in coordinates.iter().zip(&shape.gradients) {
        for i in 0..3 {
            for j in 0..3 {
                matrix[(i, j)] += x[i] * gradient[j];
            }
        }
    }
    matrix
}

pub(super) fn map_point(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    quadrature: &QuadraturePoint,
    number: (usize, usize),
) -> Result<Mapped> {
    let mut shape = kind.shape(quadrature.point);
    let jacobian = jacobian(&shape, coordinates);
    let determinant = jacobian.determinant();
    // The comparison is written so that a NaN coordinate is rejected, too.
    let inverse = if determinant > 0.0 { jacobian.try_inverse() } else { None };
    let Some(inverse) = inverse else {
        let (element, point) = (number.0 + 1, number.1 + 1);
        return Err(Error::NegativeJacobian { element, kind, point, determinant });
    };
    for gradient in &mut shape.gradients[..coordinates.len()] {
        let natural = *gradient;
        *gradient = core::array::from_fn(|i| (0..3).map(|j| natural[j] * inverse[(j, i)]).sum());
    }
    Ok(Mapped { shape, volume: quadrature.weight * determinant })
}

/// Computes the stiffness matrix, 3n × 3n in N/m, dofs ordered (node, component).
///
/// K_ab = ∫ λ ∇N_a ∇N_bᵀ + µ ∇N_b ∇N_aᵀ + µ (∇N_a·∇N_b) I dV with Lamé's constants λ, µ.
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn stiffness(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    material: &Material,
    element: usize,
) -> Result<DMatrix<f64>> {
    let nodes = kind.node_count();
    let mut matrix = DMatrix::zeros(3 * nodes, 3 * nodes);
    for (index, quadrature) in kind.stiffness_rule().iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        add_stiffness(&mut matrix, &mapped.shape.gradients[..nodes], mapped.volume, material.lame());
    }
    matrix.fill_lower_triangle_with_upper_triangle();
    Ok(matrix)
}

/// Adds the contribution of one integration point to the upper triangle of a stiffness matrix.
pub(super) fn add_stiffness(
    matrix: &mut DMatrix<f64>,
    gradients: &[[f64; 3]],
    volume: f64,
    (lambda, shear): (f64, f64),
) {
    for (b, gb) in gradients.iter().enumerate() {
        for (a, ga) in gradients[..=b].iter().enumerate() {
            let dot = shear * volume * (ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]);
            for j in 0..3 {
                for i in 0..3 {
                    matrix[(3 * a + i, 3 * b + j)] += volume * (lambda * ga[i] * gb[j] + shear * ga[j] * gb[i]);
                }
                matrix[(3 * a + j, 3 * b + j)] += dot;
            }
        }
    }
}

/// Computes the consistent mass matrix per node pair, n × n in kg; each entry applies to all three displacement
/// components.
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn consistent_mass(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    density: f64,
    element: usize,
) -> Result<DMatrix<f64>> {
    let nodes = kind.node_count();
    let mut matrix = DMatrix::zeros(nodes, nodes);
    for (index, quadrature) in kind.mass_rule().iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        for b in 0..nodes {
            let scaled = density * mapped.volume * mapped.shape.values[b];
            for a in 0..nodes {
                matrix[(a, b)] += scaled * mapped.shape.values[a];
            }
        }
    }
    Ok(matrix)
}

/// Computes the conduction matrix ∫ k ∇N_a·∇N_b dV, n × n in W/K, with the conductivity k in W/(m K).
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn conduction(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    conductivity: f64,
    element: usize,
) -> Result<DMatrix<f64>> {
    let nodes = kind.node_count();
    let mut matrix = DMatrix::zeros(nodes, nodes);
    for (index, quadrature) in kind.stiffness_rule().iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        let gradients = &mapped.shape.gradients[..nodes];
        for (b, gb) in gradients.iter().enumerate() {
            for (a, ga) in gradients.iter().enumerate() {
                matrix[(a, b)] += conductivity * mapped.volume * (ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]);
            }
        }
    }
    Ok(matrix)
}

/// Computes the nodal forces per kelvin of a uniform temperature of the element above the reference, 3n values in
/// N/K.
///
/// f_a = ∫ B_aᵀ D α (1, 1, 1, 0, 0, 0)ᵀ dV = (3λ + 2µ) α ∫ ∇N_a dV, with the integration rule of the stiffness, so
/// that K αx = f holds to rounding: a freely expanding element has no stress.
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn thermal_load(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    material: &Material,
    element: usize,
) -> Result<Vec<f64>> {
    thermal_load_of(kind, coordinates, material, &kind.stiffness_rule(), element)
}

/// Computes the contribution of some integration points to [`thermal_load`].
///
/// # Errors
/// The errors of [`thermal_load`].
pub(crate) fn thermal_load_of(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    material: &Material,
    rule: &[QuadraturePoint],
    element: usize,
) -> Result<Vec<f64>> {
    let (lambda, shear) = material.lame();
    let pressure = (3.0 * lambda + 2.0 * shear) * material.expansion;
    let mut load = vec![0.0; 3 * kind.node_count()];
    for (index, quadrature) in rule.iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        for (a, gradient) in mapped.shape.gradients[..kind.node_count()].iter().enumerate() {
            for i in 0..3 {
                load[3 * a + i] += pressure * mapped.volume * gradient[i];
            }
        }
    }
    Ok(load)
}

/// Computes ∫ N_a dV over some integration points (m³), per node.
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub(crate) fn shape_integrals(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    rule: &[QuadraturePoint],
    element: usize,
) -> Result<Vec<f64>> {
    let mut integrals = vec![0.0; kind.node_count()];
    for (index, quadrature) in rule.iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        integrals.iter_mut().zip(mapped.shape.values).for_each(|(sum, value)| *sum += mapped.volume * value);
    }
    Ok(integrals)
}

/// Computes the lumped mass per node (kg): the consistent diagonal scaled to the mass of the element (Hinton, Rock,
/// Zienkiewicz 1976).
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub(crate) fn lumped_mass(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    density: f64,
    element: usize,
) -> Result<Vec<f64>> {
    let consistent = consistent_mass(kind, coordinates, density, element)?;
    let scale = consistent.sum() / consistent.trace();
    Ok(consistent.diagonal().iter().map(|mass| mass * scale).collect())
}

/// Computes the small strains (εxx, εyy, εzz, γxy, γyz, γzx) at a natural point, from nodal displacements in m.
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn strain(
    kind: ElementKind,
    coordinates: &[[f64; 3]],
    displacements: &[[f64; 3]],
    point: [f64; 3],
    element: usize,
) -> Result<[f64; 6]> {
    let mapped = map_point(kind, coordinates, &QuadraturePoint { point, weight: 1.0 }, (element, 0))?;
    let mut slope = SMatrix::<f64, 3, 3>::zeros();
    for (u, gradient) in displacements.iter().zip(&mapped.shape.gradients) {
        for i in 0..3 {
            for j in 0..3 {
                slope[(i, j)] += u[i] * gradient[j];
            }
        }
    }
    let shear = |i, j| slope[(i, j)] + slope[(j, i)];
    Ok([slope[(0, 0)], slope[(1, 1)], slope[(2, 2)], shear(0, 1), shear(1, 2), shear(2, 0)])
}

/// Returns the stresses (σxx, σyy, σzz, τxy, τyz, τzx) in Pa for strains as returned by [`strain`].
pub fn stress(material: &Material, strain: [f64; 6]) -> [f64; 6] {
    let (lambda, shear) = material.lame();
    let pressure = lambda * (strain[0] + strain[1] + strain[2]);
    core::array::from_fn(|i| if i < 3 { pressure + 2.0 * shear * strain[i] } else { shear * strain[i] })
}
