//! The three bodies with their matrices, and the contact surfaces between them.

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_model::assembly::{assemble, free_dofs, lumped_masses};
use tiprub_model::progress::silent;
use tiprub_model::sparse::{Factor, SparseMatrix, principal_pair};
use tiprub_model::{Material, Mesh, Result};

use super::{
    CENTRE, FRICTION, HALF_ARC, RING_ELEMENTS, RingSide, WIDTH, cube_material, cube_mesh, ring_material, ring_mesh,
};
use crate::surface::{SplineSurface, SurfaceKind};

/// Mass matrix of the finite elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mass {
    /// Diagonal.
    Lumped,
    /// ∫ ρ NᵀN dV.
    Consistent,
}

/// Options of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CubeSetting {
    /// Speed of the cube along −y (m/s).
    pub speed: f64,
    /// Coefficient of friction.
    pub friction: f64,
    /// Surface of the rings.
    pub surface: SurfaceKind,
    /// Mass matrix of all bodies.
    pub mass: Mass,
}

impl Default for CubeSetting {
    /// Returns the case of the paper with the spline: 100 m/s, µ = 0.15; lumped mass.
    fn default() -> Self {
        Self { speed: 100.0, friction: FRICTION, surface: SurfaceKind::Spline, mass: Mass::Lumped }
    }
}

/// Body with the matrices of all its nodes; dof 3·node + component.
#[derive(Debug, Clone)]
pub struct CubeBody {
    /// Mesh and node sets.
    pub mesh: Mesh,
    /// Material.
    pub material: Material,
    /// K (N/m).
    pub stiffness: SparseMatrix,
    /// M (kg), with the pattern of K.
    pub mass: SparseMatrix,
    /// Dofs that are not clamped, ascending.
    pub free: Vec<usize>,
    /// Nodes of the contact surface: masters of the cube (left face, then right), slaves of a ring (grid order).
    pub contact: Vec<usize>,
}

impl CubeBody {
    /// Assembles a mesh.
    ///
    /// # Errors
    /// The errors of assembly; a missing set.
    pub(crate) fn new(mesh: Mesh, material: Material, mass: Mass, contact: Vec<usize>) -> Result<Self> {
        let matrices = assemble(&mesh, &material, &silent)?;
        let mut body =
            Self { stiffness: matrices.stiffness, mass: matrices.mass, free: Vec::new(), contact, mesh, material };
        if mass == Mass::Lumped {
            let masses = lumped_masses(&body.mesh, body.material.density)?;
            body.mass.set_diagonal(|dof| masses[dof / 3]);
        }
        let clamped = body.mesh.sets.get("CLAMPED").map_or(&[][..], Vec::as_slice);
        body.free = free_dofs(body.mesh.nodes.len(), clamped);
        Ok(body)
    }

    /// Returns the number of dofs.
    pub fn dofs(&self) -> usize {
        self.mass.order()
    }

    /// Factors M + c K without the clamped dofs.
    pub(crate) fn factor(&self, c: f64) -> Result<Factor> {
        let (mass, stiffness) = principal_pair(&self.mass, &self.stiffness, &self.free);
        mass.plus_scaled(c, &stiffness).factor("M + cK", "Check the mesh of the scene")
    }

    /// Solves with a factor for a load on all dofs; zero for clamped ones.
    pub(crate) fn solve(&self, factor: &Factor, load: &[f64]) -> Vec<f64> {
        let right = Mat::from_fn(self.free.len(), 1, |i, _| load[self.free[i]]);
        let solution = factor.solve(right);
        let mut all = vec![0.0; self.dofs()];
        self.free.iter().enumerate().for_each(|(i, &dof)| all[dof] = solution[(i, 0)]);
        all
    }

    /// Returns the rows and columns of the contact dofs of the inverse of a factored matrix.
    pub(crate) fn contact_inverse(&self, factor: &Factor) -> DMatrix<f64> {
        let mut position = vec![usize::MAX; self.dofs()];
        self.free.iter().enumerate().for_each(|(i, &dof)| position[dof] = i);
        let places: Vec<usize> =
            self.contact.iter().flat_map(|&node| (0..3).map(move |i| 3 * node + i)).map(|dof| position[dof]).collect();
        let mut unit = Mat::zeros(self.free.len(), places.len());
        for (column, &place) in places.iter().enumerate().filter(|(_, place)| **place != usize::MAX) {
            unit[(place, column)] = 1.0;
        }
        let solution = factor.solve(unit);
        DMatrix::from_fn(places.len(), places.len(), |i, j| {
            if places[i] == usize::MAX { 0.0 } else { solution[(places[i], j)] }
        })
    }
}

/// Cube, left ring, right ring.
#[derive(Debug, Clone)]
pub struct CubeScene {
    /// Options of the scene.
    pub setting: CubeSetting,
    /// Cube, left ring, right ring.
    pub bodies: [CubeBody; 3],
    /// Surfaces of the left and the right ring.
    pub surfaces: [SplineSurface; 2],
    /// Number of masters per side.
    pub masters: usize,
    /// Divisions of the surface of a ring along arc and width.
    divisions: [usize; 2],
}

impl CubeScene {
    /// Creates the scene with the meshes of the paper.
    ///
    /// # Errors
    /// The errors of assembly.
    pub fn new(setting: CubeSetting) -> Result<Self> {
        Self::of(setting, cube_mesh(), RingSide::BOTH.map(ring_mesh), [RING_ELEMENTS[2], RING_ELEMENTS[1]])
    }

    /// Creates the scene with other meshes; `divisions` are those of the surface of a ring along arc and width.
    ///
    /// # Errors
    /// The errors of assembly; a missing set of a mesh.
    pub fn of(setting: CubeSetting, cube: Mesh, [left, right]: [Mesh; 2], divisions: [usize; 2]) -> Result<Self> {
        let masters = [cube.set("MASTER_LEFT")?, cube.set("MASTER_RIGHT")?].concat();
        let ring = |mesh: Mesh| {
            let slaves = mesh.set("SLAVE")?.to_vec();
            CubeBody::new(mesh, ring_material(), setting.mass, slaves)
        };
        let surface =
            |side: RingSide| SplineSurface::new(setting.surface, divisions[0] + 1, divisions[1] + 1, -side.sign());
        Ok(Self {
            setting,
            masters: masters.len() / 2,
            bodies: [CubeBody::new(cube, cube_material(), setting.mass, masters)?, ring(left)?, ring(right)?],
            surfaces: RingSide::BOTH.map(surface),
            divisions,
        })
    }

    /// Returns the initial displacements of the three bodies: zero.
    pub(crate) fn rest(&self) -> [Vec<f64>; 3] {
        core::array::from_fn(|body| vec![0.0; self.bodies[body].dofs()])
    }

    /// Returns the initial velocities: the cube moves along −y.
    pub(crate) fn launch(&self) -> [Vec<f64>; 3] {
        let mut velocities = self.rest();
        velocities[0].iter_mut().skip(1).step_by(3).for_each(|v| *v = -self.setting.speed);
        velocities
    }

    /// Returns the surface parameters of the point of the undeformed ring nearest to a position.
    pub(crate) fn guess(&self, side: usize, place: [f64; 3]) -> [f64; 2] {
        let angle = place[1].atan2(CENTRE - RingSide::BOTH[side].sign() * place[0]);
        let [arc, wide] = self.divisions;
        [(angle + HALF_ARC) / (2.0 * HALF_ARC) * arc as f64, (place[2] / WIDTH + 0.5) * wide as f64]
    }
}
