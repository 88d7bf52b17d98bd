//! Integration rules over the natural domains.
//!
//! Gauss-Legendre for bricks and along prisms; on triangles the 3-point rule of degree 2 and the 6-point rule of degree
//! 4 (Dunavant 1985); on tetrahedra the rules of degree 1, 2 (1 and 4 points) and the 14-point rule of degree 5
//! (Walkington 2000), all with positive weights.

use super::ElementKind;

/// Point of an integration rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadraturePoint {
    /// Natural coordinates.
    pub point: [f64; 3],
    /// Weight; the weights sum to the volume of the natural domain.
    pub weight: f64,
}

const GAUSS_2: [(f64, f64); 2] = [(-0.577_350_269_189_625_8, 1.0), (0.577_350_269_189_625_8, 1.0)];
const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

const TRIANGLE_3: [([f64; 2], f64); 3] =
    [([1.0 / 6.0, 1.0 / 6.0], 1.0 / 6.0), ([2.0 / 3.0, 1.0 / 6.0], 1.0 / 6.0), ([1.0 / 6.0, 2.0 / 3.0], 1.0 / 6.0)];

impl ElementKind {
    /// Returns the rule of the stiffness matrix.
    pub fn stiffness_rule(self) -> Vec<QuadraturePoint> {
        match self {
            Self::Hex8 => brick(&GAUSS_2),
            Self::Hex20 => brick(&GAUSS_3),
            Self::Penta6 => prism(&TRIANGLE_3, &GAUSS_2),
            Self::Penta15 => prism(&TRIANGLE_3, &GAUSS_3),
            Self::Tet4 => vec![QuadraturePoint { point: [0.25; 3], weight: 1.0 / 6.0 }],
            Self::Tet10 => tetrahedron_4(),
        }
    }

    /// Returns the rule of the mass matrix, which is exact for products of shape functions over an element with
    /// constant Jacobian.
    pub fn mass_rule(self) -> Vec<QuadraturePoint> {
        match self {
            Self::Hex8 | Self::Hex20 | Self::Penta6 => self.stiffness_rule(),
            Self::Penta15 => prism(&triangle_6(), &GAUSS_3),
            Self::Tet4 => tetrahedron_4(),
            Self::Tet10 => tetrahedron_14(),
        }
    }
}

fn brick(line: &[(f64, f64)]) -> Vec<QuadraturePoint> {
    let mut rule = Vec::with_capacity(line.len().pow(3));
    for &(z, wz) in line {
        for &(y, wy) in line {
            rule.extend(line.iter().map(|&(x, wx)| QuadraturePoint { point: [x, y, z], weight: wx * wy * wz }));
        }
    }
    rule
}

fn prism(triangle: &[([f64; 2], f64)], line: &[(f64, f64)]) -> Vec<QuadraturePoint> {
    let mut rule = Vec::with_capacity(triangle.len() * line.len());
    for &(z, wz) in line {
        rule.extend(triangle.iter().map(|&([r, s], w)| QuadraturePoint { point: [r, s, z], weight: w * wz }));
    }
    rule
}

fn triangle_6() -> Vec<([f64; 2], f64)> {
    let mut rule = Vec::with_capacity(6);
    let orbits = [(0.445_948_490_915_965, 0.111_690_794_839_005_7), (0.091_576_213_509_770_7, 0.054_975_871_827_661)];
    for (a, weight) in orbits {
        let b = 1.0 - 2.0 * a;
        rule.extend([([a, a], weight), ([a, b], weight), ([b, a], weight)]);
    }
    rule
}

/// Returns the four points with barycentric coordinates (a, a, a, 1 - 3a) in every order.
fn corner_orbit(a: f64, weight: f64) -> [QuadraturePoint; 4] {
    let b = 1.0 - 3.0 * a;
    [[a, a, a], [b, a, a], [a, b, a], [a, a, b]].map(|point| QuadraturePoint { point, weight })
}

fn tetrahedron_4() -> Vec<QuadraturePoint> {
    corner_orbit(0.138_196_601_125_010_5, 1.0 / 24.0).to_vec()
}

fn tetrahedron_14() -> Vec<QuadraturePoint> {
    let mut rule = corner_orbit(0.310_885_919_263_300_6, 0.112_687_925_718_015_85 / 6.0).to_vec();
    rule.extend(corner_orbit(0.092_735_250_310_891_23, 0.073_493_043_116_361_95 / 6.0));
    let (a, weight) = (0.045_503_704_125_649_65, 0.042_546_020_777_081_47 / 6.0);
    let b = 0.5 - a;
    let edge_orbit = [[a, a, b], [a, b, a], [b, a, a], [a, b, b], [b, a, b], [b, b, a]];
    rule.extend(edge_orbit.map(|point| QuadraturePoint { point, weight }));
    rule
}
