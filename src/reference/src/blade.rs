//! Full finite-element model of one blade, without any reduction, rubbing against a rigid casing with two bumps.
//!
//! M ü + K u = Σ p F over all nodes of the mesh, undamped. `tip` defines where contact is evaluated: means over
//! patches, or points of the faces of the tip. `march` integrates in time. `gauge` recovers stress. Mesh, element
//! matrices and sparse factor are those of `tiprub-model`; contact, stepping and stress share nothing with the
//! product.

pub mod calculix;
mod gauge;
mod march;
mod pushed;
mod tip;

use faer::Mat;
use tiprub_model::assembly::free_dofs;
use tiprub_model::sparse::{Factor, SparseMatrix, principal_pair};
use tiprub_model::{FeModel, Material, Mesh, Result};

pub use gauge::{COMPONENTS, Gauge, equivalent};
pub use march::{BladeHistory, BladeSteps};
pub use pushed::PushedBlade;
pub use tip::TipPart;

/// Full model of a blade.
#[derive(Debug, Clone)]
pub struct FullBlade {
    nodes: Vec<[f64; 3]>,
    /// First of the three rows of every node; `None` for clamped ones.
    rows: Vec<Option<usize>>,
    stiffness: SparseMatrix,
    mass: SparseMatrix,
    /// Masses (kg) that couple each node with other nodes: the same along x, y and z.
    masses: Vec<Vec<(usize, f64)>>,
}

impl FullBlade {
    /// Assembles the model; `clamped` nodes do not move.
    ///
    /// # Errors
    /// The errors of the assembly.
    pub fn new(mesh: &Mesh, material: &Material, clamped: &[usize]) -> Result<Self> {
        let model = FeModel::assembled(mesh.clone(), material, String::new(), &|_| ())?;
        let free = free_dofs(model.nodes.len(), clamped);
        let (stiffness, mass) = principal_pair(&model.stiffness, &model.mass, &free);
        let mut rows = vec![None; model.nodes.len()];
        free.iter().enumerate().step_by(3).for_each(|(row, dof)| rows[dof / 3] = Some(row));
        let masses = (0..free.len() / 3).map(|node| masses(&mass, node)).collect();
        Ok(Self { nodes: model.nodes, rows, stiffness, mass, masses })
    }

    /// Returns the number of free degrees of freedom.
    pub fn order(&self) -> usize {
        self.mass.order()
    }

    /// Returns the stress at the gauges under static forces, six components of each (Pa): node, force along x, y, z
    /// (N).
    ///
    /// # Errors
    /// An unsupported blade.
    pub fn at_rest(&self, forces: &[(usize, [f64; 3])], gauges: &[Gauge]) -> Result<Vec<f64>> {
        let moved = self.moved(forces)?;
        Ok(gauges.iter().flat_map(|gauge| gauge.read(|node| moved[node])).collect())
    }

    /// Returns the displacements of all nodes along x, y, z under static forces (m): node, force along x, y, z (N).
    ///
    /// # Errors
    /// An unsupported blade.
    pub fn moved(&self, forces: &[(usize, [f64; 3])]) -> Result<Vec<[f64; 3]>> {
        let factor = self.stiffness.factor("K of the blade", "Clamp the blade and check its mesh")?;
        let mut load = Mat::zeros(self.order(), 1);
        for (node, force) in forces {
            if let Some(first) = self.rows[*node] {
                (0..3).for_each(|i| load[(first + i, 0)] += force[i]);
            }
        }
        let moved = factor.solve(load);
        let node =
            |first: &Option<usize>| first.map_or([0.0; 3], |first| [0, 1, 2].map(|axis| moved[(first + axis, 0)]));
        Ok(self.rows.iter().map(node).collect())
    }

    /// Returns the stress at the gauges.
    fn stress(&self, gauges: &[Gauge], u: &[f64]) -> Vec<f64> {
        let moved = |node: usize| self.rows[node].map_or([0.0; 3], |first| [u[first], u[first + 1], u[first + 2]]);
        gauges.iter().flat_map(|gauge| gauge.read(moved)).collect()
    }

    /// Returns M x.
    fn momentum(&self, x: &[f64]) -> Vec<f64> {
        let mut found = vec![0.0; x.len()];
        for (node, row) in self.masses.iter().enumerate() {
            for (other, mass) in row {
                (0..3).for_each(|i| found[3 * node + i] += mass * x[3 * other + i]);
            }
        }
        found
    }

    /// Factors M + c K.
    fn factor(&self, c: f64) -> Result<Factor> {
        self.mass.plus_scaled(c, &self.stiffness).factor("M + c K of the blade", "Clamp the blade and check its mesh")
    }
}

/// Returns the row of a node in the mass matrix, node by node.
fn masses(mass: &SparseMatrix, node: usize) -> Vec<(usize, f64)> {
    let range = mass.pattern.starts[3 * node]..mass.pattern.starts[3 * node + 1];
    let entries = mass.pattern.rows[range.clone()].iter().zip(&mass.values[range]);
    entries.filter(|(row, _)| **row % 3 == 0).map(|(row, value)| (row / 3, *value)).collect()
}

/// Returns A x for a symmetric matrix.
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

#[cfg(test)]
mod tests {
    use tiprub_model::rotor37::{MeshCounts, blade_mesh};

    use super::*;
    use crate::reduced::rub::BumpedCasing;

    /// Points of faces follow an axial displacement of the whole tip, and have the slope of the tip; nothing touches
    /// a casing that is far away, and parts in contact are pushed inwards.
    #[test]
    fn tip_points_follow_the_displacement_of_the_tip() {
        let blade = blade_mesh(MeshCounts { chord: 3, thickness: 1, span: 2 }).unwrap();
        let tip = blade.mesh.set("tip").unwrap();
        let [low, high] = blade
            .tip_slopes
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], slope| [low.min(*slope), high.max(*slope)]);
        for each in 1..=3 {
            let parts = TipPart::points(&blade.mesh, tip, each);
            assert_eq!(parts.len(), 3 * each * each);
            for part in &parts {
                let total: f64 = part.seen().map(|(_, rows)| rows[2][2]).sum();
                assert!((total - 1.0).abs() < 1e-12, "{total}");
                assert!((low - 0.02..high + 0.02).contains(&part.tip.slope), "{part:?}, {low} to {high}");
            }
        }
        // For three faces in a row: all nodes except the mid-side nodes of the two edges between them.
        let outline = TipPart::outline(&blade.mesh, tip);
        assert_eq!(outline.len(), tip.len() - 2, "{outline:?}");
        assert!(outline.iter().all(|part| (low - 0.02..high + 0.02).contains(&part.tip.slope)), "{outline:?}");
        let full = FullBlade::new(&blade.mesh, &Material::steel(), blade.mesh.set("hub").unwrap()).unwrap();
        let parts = TipPart::points(&blade.mesh, tip, 1);
        let steps = BladeSteps { interval: 1e-5, division: 4, samples: 40 };
        let run = |clearance: f64| {
            let obstacle = BumpedCasing { clearance, speed: 1800.0, friction: 0.0, bumps: [4e-4, 0.15, 1e-4] };
            full.march(&parts, &obstacle, steps, (&tip[..1], &[])).unwrap()
        };
        let far = run(1e-3);
        assert!(far.displacements.iter().flatten().all(|u| *u == 0.0) && far.pushed == 0);
        let near = run(3.5e-4);
        let turned = TipPart::points(&blade.mesh, tip, 1).into_iter().map(|part| part.turned(1.0)).collect::<Vec<_>>();
        let obstacle = BumpedCasing { clearance: 3.5e-4, speed: 1800.0, friction: 0.15, bumps: [4e-4, 0.15, 1e-4] };
        let rubbed = full.march(&turned, &obstacle, steps, (&tip[..1], &[])).unwrap();
        assert!(rubbed.pushed > 0 && rubbed.residual < 1e-8 && near.residual < 1e-8, "{near:?} {rubbed:?}");
        assert!(rubbed.displacements.iter().any(|u| u[0] < -1e-6) && rubbed.friction_work[39] > 0.01);
        assert!(rubbed.impulses.iter().all(|impulse| *impulse >= 0.0));
    }
}
