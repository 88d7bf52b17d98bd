//! Structures and scenes whose answers can be written down, and blades and rings of analytic modes.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, Matrix3};
use tiprub_core::{
    Rom, Scene,
    rom::{Frame, Harmonic, RomExtras},
    settings::{Scheme, Solver},
};
pub(crate) use tiprub_test_models::{GAP, RADIUS, Random, bumps, rich_blade as blade, round};
use tiprub_test_models::{node, ring, structure};

/// All schemes with their names.
pub(crate) const SCHEMES: [(Scheme, &str); Scheme::RECURRENCES.len()] =
    [(Scheme::CentralDifference, "central"), (Scheme::ModalExact, "exact"), (Scheme::MasslessBoundary, "massless")];
/// Steps by a tolerance, which have rules of their own.
pub(crate) const GALERKIN: (Scheme, &str) = (Scheme::Galerkin, "galerkin");
/// All contact solvers with their names.
pub(crate) const SOLVERS: [(Solver, &str); Solver::ALL.len()] =
    [(Solver::Film, "film"), (Solver::Lcp, "lcp"), (Solver::Coulomb, "coulomb")];

/// A contact node on a spring on a mass on a spring, in each direction: six degrees of freedom per sector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tower {
    /// Number of sectors.
    pub sectors: usize,
    /// Mass of the base and of the contact node (kg).
    pub mass: [f64; 2],
    /// Stiffness of the base spring, radial, tangential and axial (N/m).
    pub base: [f64; 3],
    /// Stiffness of the spring of the contact node, each direction (N/m).
    pub tip: f64,
    /// Angle by which the principal axes of the base spring are turned from radial to tangential (rad): couples them.
    pub turned: f64,
    /// Contact nodes at the same place.
    pub copies: usize,
    /// Slope of the tip contour.
    pub slope: f64,
    /// Stiffness of springs between the bases of neighbouring sectors (N/m), each direction; 0 = uncoupled.
    pub neighbour: f64,
}

impl Default for Tower {
    fn default() -> Self {
        Self {
            sectors: 12,
            mass: [0.1, 1e-3],
            base: [4e7, 4e6, 2e7],
            tip: 2e8,
            turned: 0.0,
            copies: 1,
            slope: -0.2,
            neighbour: 0.0,
        }
    }
}

impl Tower {
    /// Stiffness of the base spring in radial, tangential and axial direction.
    fn base_stiffness(&self) -> Matrix3<f64> {
        let (sine, cosine) = self.turned.sin_cos();
        let turn = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
        turn * Matrix3::from_diagonal(&self.base.into()) * turn.transpose()
    }

    /// Stiffness matrix of one sector with `more` on the diagonal of its base: (base, tip) by directions.
    fn stiffness(&self, more: f64) -> DMatrix<f64> {
        let base = self.base_stiffness();
        DMatrix::from_fn(6, 6, |i, j| {
            let same = if i % 3 == j % 3 { self.tip } else { 0.0 };
            match (i < 3, j < 3) {
                (true, true) => base[(i, j)] + same + if i == j { more } else { 0.0 },
                (false, false) => same,
                _ => -same,
            }
        })
    }

    /// The ROM.
    pub(crate) fn rom(&self) -> Rom {
        let mass = DMatrix::from_fn(6, 6, |i, j| if i == j { self.mass[i / 3] } else { 0.0 });
        let contact_map =
            DMatrix::from_fn(3 * self.copies, 6, |row, column| f64::from(u8::from(3 + row % 3 == column)));
        let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
        let harmonic = |diameter: usize| {
            let wave = 2.0 - 2.0 * (TAU * diameter as f64 / self.sectors as f64).cos();
            Harmonic {
                mass: complex(&mass),
                stiffness: complex(&self.stiffness(self.neighbour * wave)),
                contact_map: complex(&contact_map),
            }
        };
        let harmonics = if self.neighbour > 0.0 { (1..=self.sectors / 2).map(harmonic).collect() } else { Vec::new() };
        let node = |index: usize| node(format!("node_{index}"), [RADIUS, 0.0, 0.0], self.slope);
        let nodes = (0..self.copies).map(node).collect();
        let rom = structure("tower", mass, self.stiffness(0.0), contact_map, nodes);
        let extras = RomExtras { harmonics, ..RomExtras::default() };
        Rom { sectors: self.sectors, frame: Frame::Cylindrical, damping_ratio: 0.005, extras, ..rom }
    }

    /// Largest angular frequency of one sector (rad/s), from the springs as written.
    pub(crate) fn largest_frequency(&self) -> f64 {
        let scale = |i: usize| 1.0 / self.mass[i / 3].sqrt();
        let stiffness = self.stiffness(4.0 * self.neighbour);
        DMatrix::from_fn(6, 6, |i, j| scale(i) * stiffness[(i, j)] * scale(j)).symmetric_eigenvalues().max().sqrt()
    }
}

/// Let an elastic ring carry the surface.
pub(crate) fn on_ring(scene: &mut Scene, damping_ratio: f64) {
    tiprub_test_models::on_ring(scene, ring(36, 3), damping_ratio);
}

/// Choose scheme and solver. Scenes of the families are extreme, and meant.
pub(crate) fn with_methods(mut scene: Scene, scheme: Scheme, solver: Solver) -> Scene {
    scene.settings.accept_implausible = true;
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].solver = solver;
    scene
}

/// Choose the internal step, with communication steps as long.
pub(crate) fn with_step(mut scene: Scene, step: f64) -> Scene {
    scene.settings.accept_implausible = true;
    scene.settings.time.step = step;
    scene.settings.experiment.communication_step = step;
    scene
}
