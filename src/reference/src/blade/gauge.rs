//! Stress at a node of quadratic bricks from the displacement gradient: evaluated at the 2 × 2 × 2 points,
//! extrapolated trilinearly to the node, and averaged over the elements around it.

use nalgebra::Matrix3;
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Element;
use tiprub_model::{Error, Material, Mesh, Result};

/// Number of stress components at a gauge: along radius, circumference, axis; shear between the first two, the last
/// two, the last and the first.
pub const COMPONENTS: usize = 6;

/// Stress at a node, linear in the displacements of the nodes around it.
#[derive(Debug, Clone, PartialEq)]
pub struct Gauge {
    /// Node, and stress (Pa) per displacement of it along x, y and z (m).
    pub(super) shares: Vec<(usize, [[f64; 3]; COMPONENTS])>,
}

impl Gauge {
    /// Creates a gauge at a node of the mesh.
    ///
    /// # Errors
    /// An element around the node that is not a quadratic brick, or no element.
    pub fn at(mesh: &Mesh, material: &Material, node: usize) -> Result<Self> {
        let around: Vec<&Element> = mesh.elements.iter().filter(|element| element.nodes.contains(&node)).collect();
        if around.is_empty() || around.iter().any(|element| element.kind != ElementKind::Hex20) {
            let problem = format!("node {} is not surrounded by quadratic bricks only", node + 1);
            return Err(Error::invalid("gauge of the full blade", problem, "Mesh the blade with quadratic bricks"));
        }
        let [x, y, _] = mesh.nodes[node];
        let (sine, cosine) = y.atan2(x).sin_cos();
        // Columns are radius, circumference, axis.
        let axes = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
        let mut shares = Vec::new();
        for element in &around {
            let local = element.nodes.iter().position(|own| *own == node).unwrap_or_default();
            let gradients = gradients(mesh, element, element.kind.natural_nodes()[local])?;
            for (other, gradient) in element.nodes.iter().zip(gradients) {
                let mut rows = [[0.0; 3]; COMPONENTS];
                for axis in 0..3 {
                    let stress = axes.transpose() * unit(material, gradient, axis) * axes / around.len() as f64;
                    for (row, (a, b)) in rows.iter_mut().zip([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)]) {
                        row[axis] = stress[(a, b)];
                    }
                }
                shares.push((*other, rows));
            }
        }
        Ok(Self { shares })
    }

    /// Returns the stress (Pa) if node `n` is displaced by `moved(n)` (m, along x, y, z).
    pub fn read(&self, moved: impl Fn(usize) -> [f64; 3]) -> [f64; COMPONENTS] {
        let mut found = [0.0; COMPONENTS];
        for (node, rows) in &self.shares {
            let moved = moved(*node);
            for (found, row) in found.iter_mut().zip(rows) {
                *found += row.iter().zip(moved).map(|(row, moved)| row * moved).sum::<f64>();
            }
        }
        found
    }
}

/// Returns the equivalent stress of von Mises, √(3/2) times the norm of the deviator.
pub fn equivalent([rr, tt, zz, rt, tz, zr]: [f64; COMPONENTS]) -> f64 {
    let stress = Matrix3::new(rr, rt, zr, rt, tt, tz, zr, tz, zz);
    let deviator = stress - Matrix3::identity() * (stress.trace() / 3.0);
    1.5_f64.sqrt() * deviator.norm()
}

/// Returns the gradients of the nodes' shape functions at a natural place, extrapolated from the eight points.
fn gradients(mesh: &Mesh, element: &Element, place: [f64; 3]) -> Result<Vec<[f64; 3]>> {
    let coordinates = mesh.coordinates(element);
    let root = 3.0_f64.sqrt();
    let mut found = vec![[0.0; 3]; element.nodes.len()];
    for corner in 0..8 {
        let sign: [f64; 3] = std::array::from_fn(|i| if corner >> i & 1 == 1 { 1.0 } else { -1.0 });
        let weight: f64 = (0..3).map(|i| 0.5 * (1.0 + root * sign[i] * place[i])).product();
        let shape = element.kind.shape(sign.map(|one| one / root));
        let jacobian = Matrix3::from_fn(|i, j| {
            coordinates.iter().enumerate().map(|(node, at)| shape.gradients[node][i] * at[j]).sum()
        });
        let inverse = jacobian.try_inverse().ok_or_else(|| {
            Error::invalid("gauge of the full blade", "an element around it is degenerate", "Check the mesh")
        })?;
        for (found, gradient) in found.iter_mut().zip(&shape.gradients) {
            let own = inverse * nalgebra::Vector3::from(*gradient);
            found.iter_mut().zip(own.iter()).for_each(|(sum, one)| *sum += weight * one);
        }
    }
    Ok(found)
}

/// Returns the stress due to a displacement of one node by 1 along an axis, for this gradient of its shape function.
fn unit(material: &Material, gradient: [f64; 3], axis: usize) -> Matrix3<f64> {
    let (young, poisson) = (material.young_modulus, material.poisson_ratio);
    let strain = Matrix3::from_fn(|i, j| {
        let of = |i: usize, j: usize| if i == axis { gradient[j] } else { 0.0 };
        0.5 * (of(i, j) + of(j, i))
    });
    let volume = poisson / (1.0 - 2.0 * poisson) * strain.trace();
    (strain + Matrix3::identity() * volume) * (young / (1.0 + poisson))
}
