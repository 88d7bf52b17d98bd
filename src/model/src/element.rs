//! Six solid elements, in the node numbering of Abaqus and CalculiX.
//!
//! | kind | CalculiX | natural coordinates | stiffness rule | mass rule |
//! |---|---|---|---|---|
//! | [`Hex8`](ElementKind::Hex8) | C3D8 | ξ, η, ζ ∈ \[-1, 1\] | 2×2×2 | 2×2×2 |
//! | [`Hex20`](ElementKind::Hex20) | C3D20 | ξ, η, ζ ∈ \[-1, 1\] | 3×3×3 | 3×3×3 |
//! | [`Penta6`](ElementKind::Penta6) | C3D6 | r, s ≥ 0, r + s ≤ 1, ζ ∈ \[-1, 1\] | 3×2 | 3×2 |
//! | [`Penta15`](ElementKind::Penta15) | C3D15 | as above | 3×3 | 6×3 |
//! | [`Tet4`](ElementKind::Tet4) | C3D4 | r, s, t ≥ 0, r + s + t ≤ 1 | 1 | 4 |
//! | [`Tet10`](ElementKind::Tet10) | C3D10 | as above | 4 | 14 |
//!
//! All elements are isoparametric, without reduced or selective integration. Hex8 has incompatible modes as an
//! option, see [`Formulation`].

mod incompatible;
mod matrices;
mod nonlinear;
mod quadrature;
mod recovery;
mod shape;

pub use incompatible::{Formulation, incompatible_stiffness};
pub use matrices::thermal_load;
pub use matrices::{conduction, consistent_mass, stiffness, strain, stress};
pub(crate) use matrices::{lumped_mass, shape_integrals, thermal_load_of};
pub use nonlinear::{ElementTangent, geometric_stiffness, second_stresses, tangent};
pub use quadrature::QuadraturePoint;
pub use recovery::nodal_stress;
pub use shape::ShapeFunctions;

/// Largest number of nodes of any element.
pub(crate) const MAX_NODES: usize = 20;

/// Kind of a solid element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ElementKind {
    /// Trilinear brick.
    Hex8,
    /// Quadratic serendipity brick.
    Hex20,
    /// Linear prism.
    Penta6,
    /// Quadratic serendipity prism.
    Penta15,
    /// Linear tetrahedron.
    Tet4,
    /// Quadratic tetrahedron.
    Tet10,
}

impl ElementKind {
    /// All kinds.
    pub const ALL: [Self; 6] = [Self::Hex8, Self::Hex20, Self::Penta6, Self::Penta15, Self::Tet4, Self::Tet10];

    /// Returns the number of nodes.
    pub fn node_count(self) -> usize {
        self.natural_nodes().len()
    }

    /// Returns the name of the element type in Abaqus and CalculiX input files.
    pub fn calculix_name(self) -> &'static str {
        match self {
            Self::Hex8 => "C3D8",
            Self::Hex20 => "C3D20",
            Self::Penta6 => "C3D6",
            Self::Penta15 => "C3D15",
            Self::Tet4 => "C3D4",
            Self::Tet10 => "C3D10",
        }
    }

    /// Returns the number of corner nodes, which come first.
    pub fn corner_count(self) -> usize {
        match self {
            Self::Hex8 | Self::Hex20 => 8,
            Self::Penta6 | Self::Penta15 => 6,
            Self::Tet4 | Self::Tet10 => 4,
        }
    }

    /// Returns the quadratic element of the same topology (itself if it is quadratic).
    pub fn quadratic(self) -> Self {
        match self {
            Self::Hex8 | Self::Hex20 => Self::Hex20,
            Self::Penta6 | Self::Penta15 => Self::Penta15,
            Self::Tet4 | Self::Tet10 => Self::Tet10,
        }
    }

    /// Returns the ends of the edges of the mid-side nodes of the quadratic element, in the order of those nodes.
    pub fn edges(self) -> &'static [[usize; 2]] {
        match self {
            Self::Hex8 | Self::Hex20 => &HEX_EDGES,
            Self::Penta6 | Self::Penta15 => &PENTA_EDGES,
            Self::Tet4 | Self::Tet10 => &TET_EDGES,
        }
    }

    /// Returns the corner nodes of the faces, counter-clockwise seen from outside.
    pub fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Hex8 | Self::Hex20 => &HEX_FACES,
            Self::Penta6 | Self::Penta15 => &PENTA_FACES,
            Self::Tet4 | Self::Tet10 => &TET_FACES,
        }
    }

    /// Returns the natural coordinates of the nodes.
    pub fn natural_nodes(self) -> &'static [[f64; 3]] {
        match self {
            Self::Hex8 => &HEX_NODES[..8],
            Self::Hex20 => &HEX_NODES,
            Self::Penta6 => &PENTA_NODES[..6],
            Self::Penta15 => &PENTA_NODES,
            Self::Tet4 => &TET_NODES[..4],
            Self::Tet10 => &TET_NODES,
        }
    }
}

const HEX_NODES: [[f64; 3]; 20] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
];

const HEX_EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

const HEX_FACES: [&[usize]; 6] =
    [&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];

const PENTA_NODES: [[f64; 3]; 15] = [
    [0.0, 0.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [0.5, 0.0, -1.0],
    [0.5, 0.5, -1.0],
    [0.0, 0.5, -1.0],
    [0.5, 0.0, 1.0],
    [0.5, 0.5, 1.0],
    [0.0, 0.5, 1.0],
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
];

const PENTA_EDGES: [[usize; 2]; 9] = [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];

const PENTA_FACES: [&[usize]; 5] = [&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];

const TET_NODES: [[f64; 3]; 10] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
    [0.0, 0.0, 0.5],
    [0.5, 0.0, 0.5],
    [0.0, 0.5, 0.5],
];

const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

const TET_FACES: [&[usize]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
