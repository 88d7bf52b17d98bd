//! The cube between two rings of the paper's section 5: geometry, meshes and reductions.
//!
//! A cube moves along −y through two arcs that are convex towards it and clamped at both ends. The clearance between
//! the arcs is 2 mm less than the width of the cube. The paper does not state the initial position of the cube; here
//! its leading face starts at y = +20 mm, 0.01 ms before the first contact at 100 m/s.

mod mesh;
mod reduction;

pub use mesh::{cube_mesh, cube_of, ring_mesh, ring_of};
pub use reduction::{CubeOptions, MassMatrix, RingOptions, reduce_cube, reduce_cube_ring, ring_grid};

use crate::Material;

/// Side of the cube (m).
pub const SIDE: f64 = 0.05;
/// Elements per side of the cube.
pub const CUBE_ELEMENTS: usize = 5;
/// Inner radius of the rings (m).
pub const INNER_RADIUS: f64 = 0.15;
/// Thickness of the rings (m).
pub const THICKNESS: f64 = 0.03;
/// Outer radius of the rings (m): the contact surface.
pub const OUTER_RADIUS: f64 = INNER_RADIUS + THICKNESS;
/// Width of the rings along z (m).
pub const WIDTH: f64 = 0.08;
/// Half the arc of the rings (rad).
pub const HALF_ARC: f64 = std::f64::consts::FRAC_PI_3;
/// Distance of the rings' centres from x = 0 (m).
pub const CENTRE: f64 = 0.204;
/// Elements of a ring along radius, width and arc.
pub const RING_ELEMENTS: [usize; 3] = [5, 8, 40];
/// Height of the cube's leading face at the start (m).
pub const START: f64 = 0.02;
/// Coefficient of friction of the paper's first case.
pub const FRICTION: f64 = 0.15;

/// Side of a ring: left (x < 0) or right (x > 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RingSide {
    /// x < 0.
    Left,
    /// x > 0.
    Right,
}

impl RingSide {
    /// Both sides, left first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Returns −1 on the left, +1 on the right.
    pub fn sign(self) -> f64 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }
}

/// Returns the material of the cube: E = 2.1 GPa, a hundredth of that of the rings.
pub fn cube_material() -> Material {
    Material { name: "cube".into(), young_modulus: 2.1e9, ..ring_material() }
}

/// Returns the material of the rings: E = 210 GPa, ν = 0.3, ρ = 7800 kg/m³.
pub fn ring_material() -> Material {
    Material { name: "ring".into(), young_modulus: 210e9, poisson_ratio: 0.3, density: 7800.0, expansion: 0.0 }
}
