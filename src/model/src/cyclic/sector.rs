//! Matrices of one sector, ordered and rotated for cyclic symmetry.
//!
//! Free nodes are in the order interior, low face, high face, contact. The directions of a high node are those of its
//! low node, rotated (u' = Rᵀu with R the rotation by one pitch); the directions of a contact node are radial,
//! tangential and axial. The free dofs of nodal diameter n are then only those of low face, interior and contact:
//! with e = e^(2πin/N)
//!
//! ```text
//! u = W x,   x = (x_I, x_L, x_C),   u_I = x_I,  u_L = x_L,  u_H = e x_L,  u_C = x_C,   K_n = WᴴKW,  M_n = WᴴMW.
//! ```

use std::sync::Arc;

use nalgebra::Matrix3;
use tiprub_core::scene::rom::DisplacementFrame;

use super::{CyclicBoundary, boundary::turned};
use crate::assembly::free_dofs;
use crate::patches::PatchCoordinates;
use crate::reduce::ContactPoint;
use crate::sparse::{Pattern, SparseMatrix};
use crate::{Error, FeModel, Result};

/// Numbers of dofs of the four parts of a sector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct DofCounts {
    pub interior: usize,
    /// Number of dofs of one face.
    pub face: usize,
    pub contact: usize,
}

impl DofCounts {
    /// Returns the number of dofs of one nodal diameter.
    pub(super) fn order(self) -> usize {
        self.interior + self.face + self.contact
    }
}

/// Ordered matrices of one sector.
#[derive(Debug)]
pub(super) struct Sector {
    pub parts: DofCounts,
    /// Rotated stiffness, with both faces.
    pub stiffness: SparseMatrix,
    /// Rotated mass, with the pattern of the stiffness.
    pub mass: SparseMatrix,
    /// Mass without its zeros: a third of the entries.
    pub lean_mass: SparseMatrix,
    /// Node of the model at each position of the order.
    pub nodes: Vec<usize>,
    /// Directions of the node at each position: columns are its three unit vectors.
    pub directions: Vec<Matrix3<f64>>,
    /// Meaning of the variables of the nodes that represent patches, if there are patches.
    pub patches: Option<PatchCoordinates>,
}

impl Sector {
    /// Orders and rotates the matrices.
    ///
    /// # Errors
    /// [`Error::Invalid`] for contact on a face, for patches that depend on each other, or if no node is free.
    pub(super) fn new(
        model: &FeModel,
        clamped: &[usize],
        contact: &[ContactPoint],
        boundary: &CyclicBoundary,
    ) -> Result<Self> {
        let count = model.nodes.len();
        let held = held_nodes(count, clamped, boundary);
        let pairs: Vec<[usize; 2]> = boundary.pairs.iter().copied().filter(|&[low, _]| !held[low]).collect();
        let mut inner = vec![true; count];
        for &[low, high] in &boundary.pairs {
            inner[low] = false;
            inner[high] = false;
        }
        for point in contact {
            if point.weights().any(|(node, _)| !inner[node]) {
                return Err(Error::invalid(
                    format!("contact node `{}`", point.name),
                    "it lies on a cyclic face",
                    "Choose a node inside the sector, or cut the sector elsewhere",
                ));
            }
        }
        let free = free_dofs(count, &[]);
        let patches = PatchCoordinates::new(&free, &model.nodes, contact, DisplacementFrame::Cylindrical)?;
        let contact = patches.as_ref().map_or(contact, PatchCoordinates::points);
        contact.iter().for_each(|point| inner[point.node] = false);
        let mut nodes: Vec<usize> = (0..count).filter(|&node| inner[node] && !held[node]).collect();
        let parts = DofCounts { interior: 3 * nodes.len(), face: 3 * pairs.len(), contact: 3 * contact.len() };
        nodes.extend(pairs.iter().map(|pair| pair[0]));
        nodes.extend(pairs.iter().map(|pair| pair[1]));
        nodes.extend(contact.iter().map(|point| point.node));
        let directions = directions(model, parts, &nodes, boundary.pitch());
        let (stiffness, mass) = match &patches {
            None => turned_pair(&model.stiffness, &model.mass, &nodes, &directions),
            Some(patches) => {
                let (stiffness, mass) = patches.transformed(&model.stiffness, &model.mass)?;
                turned_pair(&stiffness, &mass, &nodes, &directions)
            }
        };
        let lean_mass = without_zeros(&mass);
        Ok(Self { parts, stiffness, mass, lean_mass, nodes, directions, patches })
    }
}

/// Returns the clamped nodes; a face node whose partner is clamped is clamped, too, since both are one node of the
/// disk.
fn held_nodes(count: usize, clamped: &[usize], boundary: &CyclicBoundary) -> Vec<bool> {
    let mut held = vec![false; count];
    for &node in clamped {
        held[node] = true;
    }
    for &[low, high] in &boundary.pairs {
        let either = held[low] || held[high];
        held[low] = either;
        held[high] = either;
    }
    held
}

fn directions(model: &FeModel, parts: DofCounts, nodes: &[usize], pitch: f64) -> Vec<Matrix3<f64>> {
    let about_z = |x: f64, y: f64| Matrix3::new(x, -y, 0.0, y, x, 0.0, 0.0, 0.0, 1.0);
    let (interior, face) = (parts.interior / 3, parts.face / 3);
    let place = |(place, &node): (usize, &usize)| {
        if place < interior + face {
            Matrix3::identity()
        } else if place < interior + 2 * face {
            let [x, y, _] = turned([1.0, 0.0, 0.0], pitch);
            about_z(x, y)
        } else {
            let [x, y, _] = model.nodes[node];
            let radius = x.hypot(y);
            about_z(x / radius, y / radius)
        }
    };
    nodes.iter().enumerate().map(place).collect()
}

/// Returns both matrices for the given nodes in the given directions, with all nine entries of every pair of nodes.
fn turned_pair(
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    nodes: &[usize],
    directions: &[Matrix3<f64>],
) -> (SparseMatrix, SparseMatrix) {
    let old = &stiffness.pattern;
    let mut place = vec![usize::MAX; old.order() / 3];
    for (new, &node) in nodes.iter().enumerate() {
        place[node] = new;
    }
    let mut pattern = Pattern { starts: vec![0], rows: Vec::with_capacity(old.rows.len()) };
    let (mut stiffness_values, mut mass_values) = (Vec::new(), Vec::new());
    let mut slot = vec![usize::MAX; nodes.len()];
    for (b, &column_node) in nodes.iter().enumerate() {
        let mut neighbours: Vec<usize> = (3 * column_node..3 * column_node + 3)
            .flat_map(|column| &old.rows[old.starts[column]..old.starts[column + 1]])
            .map(|row| place[row / 3])
            .filter(|&a| a != usize::MAX)
            .collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        for (index, &a) in neighbours.iter().enumerate() {
            slot[a] = index;
        }
        let mut blocks = vec![[Matrix3::<f64>::zeros(); 2]; neighbours.len()];
        for j in 0..3 {
            let column = 3 * column_node + j;
            for entry in old.starts[column]..old.starts[column + 1] {
                let (row, a) = (old.rows[entry], place[old.rows[entry] / 3]);
                if a != usize::MAX {
                    blocks[slot[a]][0][(row % 3, j)] = stiffness.values[entry];
                    blocks[slot[a]][1][(row % 3, j)] = mass.values[entry];
                }
            }
        }
        for (&a, block) in neighbours.iter().zip(&mut blocks) {
            *block = block.map(|matrix| directions[a].transpose() * matrix * directions[b]);
        }
        for j in 0..3 {
            for (&a, block) in neighbours.iter().zip(&blocks) {
                for i in 0..3 {
                    pattern.rows.push(3 * a + i);
                    stiffness_values.push(block[0][(i, j)]);
                    mass_values.push(block[1][(i, j)]);
                }
            }
            pattern.starts.push(pattern.rows.len());
        }
    }
    let pattern = Arc::new(pattern);
    (
        SparseMatrix { pattern: Arc::clone(&pattern), values: stiffness_values },
        SparseMatrix { pattern, values: mass_values },
    )
}

fn without_zeros(matrix: &SparseMatrix) -> SparseMatrix {
    let mut pattern = Pattern { starts: vec![0], rows: Vec::new() };
    let mut values = Vec::new();
    for column in 0..matrix.order() {
        for entry in matrix.pattern.starts[column]..matrix.pattern.starts[column + 1] {
            if matrix.values[entry] != 0.0 {
                pattern.rows.push(matrix.pattern.rows[entry]);
                values.push(matrix.values[entry]);
            }
        }
        pattern.starts.push(pattern.rows.len());
    }
    SparseMatrix { pattern: Arc::new(pattern), values }
}
