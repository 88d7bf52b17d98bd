//! Hex8 with incompatible modes, which bends without locking.
//!
//! A trilinear brick responds to bending with shear and is too stiff by a factor that grows with the square of its
//! length over its thickness. Three more shape functions 1 - ξ², 1 - η², 1 - ζ² per displacement component, whose
//! amplitudes are internal to the element and eliminated there, allow its edges to curve (Wilson, Taylor, Doherty,
//! Ghaboussi 1973). Their gradients are evaluated with the Jacobian of the centre and scaled by det J₀/det J, so that
//! they do no work on constant stress in a distorted element, which passes the patch test (Taylor, Beresford, Wilson,
//! Int. J. Numer. Methods Eng. 10, 1976). For the same reason the load of a uniform temperature is that of plain
//! hex8.

use nalgebra::{DMatrix, Matrix3};

use super::matrices::{add_stiffness, jacobian, map_point};
use super::{ElementKind, QuadraturePoint};
use crate::{Error, Result, material::Material};

/// Number of nodes of the brick.
const NODES: usize = 8;
/// Number of incompatible modes, which follow the nodes.
const MODES: usize = 3;

/// Formulation of the stiffness of hex8; other elements have one formulation only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Formulation {
    /// Displacement interpolation alone, full integration (C3D8).
    #[default]
    Displacement,
    /// With incompatible modes (C3D8I).
    IncompatibleModes,
}

/// Computes the stiffness matrix of hex8 with incompatible modes, 24 × 24 in N/m, dofs ordered (node, component).
///
/// # Errors
/// [`Error::NegativeJacobian`] with `element + 1` as the element number.
pub fn incompatible_stiffness(coordinates: &[[f64; 3]], material: &Material, element: usize) -> Result<DMatrix<f64>> {
    let kind = ElementKind::Hex8;
    let centre = jacobian(&kind.shape([0.0; 3]), coordinates);
    let central = centre.determinant();
    let broken = || Error::NegativeJacobian { element: element + 1, kind, point: 1, determinant: central };
    // Written so that NaN is rejected, too.
    let inverse = if central > 0.0 { centre.try_inverse() } else { None }.ok_or_else(broken)?;
    let mut whole = DMatrix::zeros(3 * (NODES + MODES), 3 * (NODES + MODES));
    for (index, quadrature) in kind.stiffness_rule().iter().enumerate() {
        let mapped = map_point(kind, coordinates, quadrature, (element, index))?;
        let mut gradients = [[0.0; 3]; NODES + MODES];
        gradients[..NODES].copy_from_slice(&mapped.shape.gradients[..NODES]);
        // det J of this point without the weight.
        let scale = central * quadrature.weight / mapped.volume;
        gradients[NODES..].copy_from_slice(&mode_gradients(quadrature, &inverse, scale));
        add_stiffness(&mut whole, &gradients, mapped.volume, material.lame());
    }
    whole.fill_lower_triangle_with_upper_triangle();
    let (nodes, modes) = (3 * NODES, 3 * MODES);
    let coupling = whole.view((nodes, 0), (modes, nodes)).into_owned();
    let inner = whole.view((nodes, nodes), (modes, modes)).into_owned().cholesky().ok_or_else(broken)?;
    let condensed = whole.view((0, 0), (nodes, nodes)) - coupling.transpose() * inner.solve(&coupling);
    Ok(0.5 * (&condensed + condensed.transpose()))
}

/// Returns the gradients of 1 - ξ², 1 - η², 1 - ζ².
fn mode_gradients(quadrature: &QuadraturePoint, inverse: &Matrix3<f64>, scale: f64) -> [[f64; 3]; MODES] {
    core::array::from_fn(|mode| {
        let slope = -2.0 * quadrature.point[mode] * scale;
        core::array::from_fn(|i| slope * inverse[(mode, i)])
    })
}
