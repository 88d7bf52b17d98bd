//! Static equilibrium of an elastic body that rotates at a steady speed, and its stiffness there.

use std::sync::Arc;

use faer::Mat;
use rayon::prelude::*;

use crate::assembly::{Assembled, for_each_block};
use crate::element::{ElementTangent, tangent};
use crate::material::Material;
use crate::mesh::Mesh;
use crate::sparse::{Pattern, SparseMatrix};
use crate::{Error, Result};

/// Number of elements that are computed in parallel before they are added to the global matrix.
const CHUNK: usize = 256;
/// Newton's iteration ends when its last correction was below this fraction of the displacement. It converges
/// quadratically, so the remaining error is of the order of its square.
const CORRECTION: f64 = 1e-6;
/// Largest number of corrections.
const ITERATIONS: usize = 20;

/// Largest strain for which a linear law between Green strain and stress represents an elastic solid.
const STRAIN: f64 = 0.1;
const APART: &str = "Reduce the largest speed, or check the units and supports";

/// Forces and stiffness of the free dofs at a displacement.
struct Linearised {
    /// Tangent stiffness of the elastic force.
    tangent: SparseMatrix,
    /// Tangent stiffness with the spin softening -Ω²M_xy.
    softened: SparseMatrix,
    /// Centrifugal minus internal force.
    unbalanced: Mat<f64>,
    /// Largest centrifugal force.
    load: f64,
    largest_strain: f64,
}

/// Elastic part of [`Linearised`], all dofs.
struct Elastic {
    /// Entries of the tangent stiffness.
    values: Vec<f64>,
    forces: Vec<f64>,
    largest_strain: f64,
}

/// Supported body that can rotate about the z axis.
#[derive(Debug)]
pub struct Rotating<'a> {
    mesh: &'a Mesh,
    material: &'a Material,
    assembled: &'a Assembled,
    free: &'a [usize],
    /// Pattern of the free dofs, and the index in the whole matrix of each of its entries.
    reduced: (Arc<Pattern>, Vec<usize>),
}

/// Body in static equilibrium with the centrifugal force at one speed.
#[derive(Debug, Clone)]
pub struct SpinningState {
    /// Speed Ω (rad/s).
    pub speed: f64,
    /// Displacement of the free dofs from the resting shape (m), one column.
    pub displacement: Mat<f64>,
    /// Tangent stiffness of the free dofs: elasticity of the deformed body, its stress, and -Ω²M_xy (N/m).
    pub stiffness: SparseMatrix,
    /// Number of Newton corrections.
    pub iterations: usize,
    /// Largest unbalanced force over the largest centrifugal one.
    pub residual: f64,
    /// Largest component of the Green strain.
    pub largest_strain: f64,
}

impl<'a> Rotating<'a> {
    /// Creates a body from its assembled matrices (all dofs) and the dofs that are not clamped, ascending.
    ///
    /// `stiffness` is that of the resting structure at the free dofs; the stiffness of every [`SpinningState`] shares
    /// its pattern.
    ///
    /// # Errors
    /// [`Error::Invalid`] if nothing is clamped: a free body that rotates about the axis has no static equilibrium.
    pub fn new(
        mesh: &'a Mesh,
        material: &'a Material,
        assembled: &'a Assembled,
        free: &'a [usize],
        stiffness: &SparseMatrix,
    ) -> Result<Self> {
        if free.len() == assembled.mass.order() {
            let problem = "no node is clamped, so there is no equilibrium with the centrifugal force";
            return Err(Error::invalid("effects of spin", problem, "Clamp the nodes that rotate with the shaft"));
        }
        let (pattern, entries) = assembled.stiffness.pattern.principal(free);
        assert_eq!(pattern, *stiffness.pattern, "the free dofs must match those of the stiffness");
        Ok(Self { mesh, material, assembled, free, reduced: (Arc::clone(&stiffness.pattern), entries) })
    }

    /// Returns the displacement of the resting body: zero.
    pub fn at_rest(&self) -> Mat<f64> {
        Mat::zeros(self.free.len(), 1)
    }

    /// Computes the equilibrium at `speed` (rad/s) by Newton's iteration from `start` (free dofs, one column).
    ///
    /// Internal force (total Lagrangian, St. Venant-Kirchhoff) = Ω² ∫ρ Nᵀ(x, y, 0) at the *displaced* position (x, y).
    ///
    /// # Errors
    /// [`Error::Invalid`] if the iteration does not converge or strains exceed 0.1, [`Error::NotPositiveDefinite`] if
    /// the body is unstable.
    pub fn equilibrium(&self, speed: f64, start: Mat<f64>) -> Result<SpinningState> {
        let mut displacement = start;
        let mut correction = f64::INFINITY;
        for iterations in 0..=ITERATIONS {
            let Linearised { tangent, softened, unbalanced, load, largest_strain } =
                self.linearised(speed, &displacement)?;
            if correction <= CORRECTION {
                if largest_strain > STRAIN {
                    let problem =
                        format!("the strain of {largest_strain:.2} exceeds {STRAIN}, the limit of linear elasticity");
                    return Err(Error::invalid(format!("static equilibrium at {speed} rad/s"), problem, APART));
                }
                let residual = unbalanced.norm_max() / load.max(f64::MIN_POSITIVE);
                return Ok(SpinningState {
                    speed,
                    displacement,
                    stiffness: softened,
                    iterations,
                    residual,
                    largest_strain,
                });
            }
            let name = format!("K (stiffness at {speed} rad/s)");
            let full = softened.factor(&name, APART);
            // A slender body is stabilised by the tension that only the first step causes. Until then the spin
            // softening is omitted, so that the force stays at the old position, and the step never ends the
            // iteration.
            let lagging = full.is_err();
            let step = full.or_else(|_| tangent.factor(&name, APART))?.solve(unbalanced);
            displacement += &step;
            correction = match step.norm_max() {
                _ if lagging => f64::INFINITY,
                0.0 => 0.0,
                size => size / displacement.norm_max(),
            };
        }
        Err(Error::invalid(
            format!("static equilibrium at {speed} rad/s"),
            format!(
                "Newton's method did not converge in {ITERATIONS} steps: the last correction is {correction:.1e} of \
                 the displacement"
            ),
            APART,
        ))
    }

    fn linearised(&self, speed: f64, displacement: &Mat<f64>) -> Result<Linearised> {
        let moved = self.node_displacements(displacement);
        let Elastic { values, forces: internal, largest_strain } = self.elastic(&moved)?;
        let square = speed * speed;
        let centrifugal = self.centrifugal_force(&moved);
        let load = self.free.iter().map(|&dof| (square * centrifugal[dof]).abs()).fold(0.0, f64::max);
        let unbalanced =
            Mat::from_fn(self.free.len(), 1, |i, _| square * centrifugal[self.free[i]] - internal[self.free[i]]);
        let whole = SparseMatrix { pattern: Arc::clone(&self.assembled.mass.pattern), values };
        let softened = whole.plus_scaled(-square, &without_axial(&self.assembled.mass));
        let (pattern, entries) = &self.reduced;
        let of_free = |matrix: &SparseMatrix| SparseMatrix {
            pattern: Arc::clone(pattern),
            values: entries.iter().map(|&entry| matrix.values[entry]).collect(),
        };
        Ok(Linearised { tangent: of_free(&whole), softened: of_free(&softened), unbalanced, load, largest_strain })
    }

    /// Returns ∫ρ Nᵀ(x, y, 0) at the displaced positions, all dofs (kg·m). Positions are interpolated by the same
    /// functions as displacements, so the integral is the consistent mass times the positions of the nodes.
    fn centrifugal_force(&self, moved: &[[f64; 3]]) -> Vec<f64> {
        let radial = Mat::from_fn(3 * moved.len(), 1, |dof, _| match dof % 3 {
            2 => 0.0,
            component => self.mesh.nodes[dof / 3][component] + moved[dof / 3][component],
        });
        self.assembled.mass.times(radial.as_ref()).col(0).iter().copied().collect()
    }

    fn node_displacements(&self, displacement: &Mat<f64>) -> Vec<[f64; 3]> {
        let mut moved = vec![[0.0; 3]; self.mesh.nodes.len()];
        for (row, dof) in self.free.iter().enumerate() {
            moved[dof / 3][dof % 3] = displacement[(row, 0)];
        }
        moved
    }

    fn elastic(&self, moved: &[[f64; 3]]) -> Result<Elastic> {
        let pattern = &self.assembled.stiffness.pattern;
        let (mut values, mut forces) = (vec![0.0; pattern.rows.len()], vec![0.0; 3 * moved.len()]);
        let mut largest_strain = 0.0_f64;
        for (chunk_index, chunk) in self.mesh.elements.chunks(CHUNK).enumerate() {
            let tangents: Vec<Result<ElementTangent>> = chunk
                .par_iter()
                .enumerate()
                .map(|(offset, element)| {
                    let displacements: Vec<[f64; 3]> = element.nodes.iter().map(|&node| moved[node]).collect();
                    let (number, coordinates) = (chunk_index * CHUNK + offset, self.mesh.coordinates(element));
                    tangent(element.kind, &coordinates, &displacements, self.material, number)
                })
                .collect();
            for (element, tangent) in chunk.iter().zip(tangents) {
                let ElementTangent { stiffness, force, largest_strain: strain } = tangent?;
                largest_strain = largest_strain.max(strain);
                for_each_block(pattern, &element.nodes, |a, b, starts| {
                    for (j, start) in starts.into_iter().enumerate() {
                        for i in 0..3 {
                            values[start + i] += stiffness[(3 * a + i, 3 * b + j)];
                        }
                    }
                });
                for (&node, part) in element.nodes.iter().zip(force) {
                    (0..3).for_each(|i| forces[3 * node + i] += part[i]);
                }
            }
        }
        Ok(Elastic { values, forces, largest_strain })
    }
}

/// Returns M_xy: the mass matrix (all dofs) without its axial rows and columns.
pub fn without_axial(mass: &SparseMatrix) -> SparseMatrix {
    let pattern = &mass.pattern;
    let mut values = mass.values.clone();
    for column in 0..pattern.order() {
        for entry in pattern.starts[column]..pattern.starts[column + 1] {
            if column % 3 == 2 || pattern.rows[entry] % 3 == 2 {
                values[entry] = 0.0;
            }
        }
    }
    SparseMatrix { pattern: Arc::clone(pattern), values }
}

/// Returns the product ẑ × v for every node vector v: the rows (x, y, z) of each node of `free` become (-y, x, 0).
/// `free` are the dofs of the rows (3·node + component); a component that is not among them is zero.
pub fn turned_about_axis(free: &[usize], columns: &Mat<f64>) -> Mat<f64> {
    Mat::from_fn(free.len(), columns.ncols(), |i, k| {
        let (other, sign) = match free[i] % 3 {
            0 => (free[i] + 1, -1.0),
            1 => (free[i] - 1, 1.0),
            _ => return 0.0,
        };
        free.binary_search(&other).map_or(0.0, |row| sign * columns[(row, k)])
    })
}
