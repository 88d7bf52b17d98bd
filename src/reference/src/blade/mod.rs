//! One blade by full finite elements, without a reduction of any kind, rubbing against a rigid casing with two bumps.
//!
//! M ü + K u = Σ p F over all nodes of the mesh, undamped. [`tip`] says where contact is asked for: means over patches, or points of
//! the tip's faces. [`march`] goes on in time. Mesh, element matrices and sparse factor are those of `tiprub-model`; contact and stepping
//! share nothing with the product.

mod march;
mod tip;

use tiprub_model::assembly::free_dofs;
use tiprub_model::sparse::{Factor, SparseMatrix, principal_pair};
use tiprub_model::{FeModel, Material, Mesh, Result};

pub use march::{History, Steps};
pub use tip::Part;

/// The full model of a blade.
#[derive(Debug, Clone)]
pub struct Blade {
    nodes: Vec<[f64; 3]>,
    /// First of the three rows of every node; none of clamped ones.
    rows: Vec<Option<usize>>,
    stiffness: SparseMatrix,
    mass: SparseMatrix,
    /// Of every node that moves the others with their masses (kg): the same along x, y and z.
    masses: Vec<Vec<(usize, f64)>>,
}

impl Blade {
    /// Assemble; `clamped` nodes stand still.
    ///
    /// # Errors
    /// Those of the assembly.
    pub fn new(mesh: &Mesh, material: &Material, clamped: &[usize]) -> Result<Self> {
        let model = FeModel::assembled(mesh.clone(), material, String::new(), &|_| ())?;
        let free = free_dofs(model.nodes.len(), clamped);
        let (stiffness, mass) = principal_pair(&model.stiffness, &model.mass, &free);
        let mut rows = vec![None; model.nodes.len()];
        free.iter().enumerate().step_by(3).for_each(|(row, dof)| rows[dof / 3] = Some(row));
        let masses = (0..free.len() / 3).map(|node| masses(&mass, node)).collect();
        Ok(Self { nodes: model.nodes, rows, stiffness, mass, masses })
    }

    /// Degrees of freedom that move.
    pub fn order(&self) -> usize {
        self.mass.order()
    }

    /// M x.
    fn momentum(&self, x: &[f64]) -> Vec<f64> {
        let mut found = vec![0.0; x.len()];
        for (node, row) in self.masses.iter().enumerate() {
            for (other, mass) in row {
                (0..3).for_each(|i| found[3 * node + i] += mass * x[3 * other + i]);
            }
        }
        found
    }

    /// M + c K.
    fn factor(&self, c: f64) -> Result<Factor> {
        self.mass.plus_scaled(c, &self.stiffness).factor("M + c K of the blade", "Clamp it, and mesh it soundly")
    }
}

/// Row of a node in the mass matrix, node by node.
fn masses(mass: &SparseMatrix, node: usize) -> Vec<(usize, f64)> {
    let range = mass.pattern.starts[3 * node]..mass.pattern.starts[3 * node + 1];
    let entries = mass.pattern.rows[range.clone()].iter().zip(&mass.values[range]);
    entries.filter(|(row, _)| **row % 3 == 0).map(|(row, value)| (row / 3, *value)).collect()
}

/// A x of a symmetric matrix.
fn product(matrix: &SparseMatrix, x: &[f64]) -> Vec<f64> {
    let pattern = &matrix.pattern;
    let row = |row: usize| {
        let range = pattern.starts[row]..pattern.starts[row + 1];
        pattern.rows[range.clone()].iter().zip(&matrix.values[range]).map(|(column, value)| value * x[*column]).sum()
    };
    (0..matrix.order()).map(row).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
