//! Global stiffness and mass matrices: symbolic pattern from the mesh, numeric values from the elements.

use std::sync::Arc;

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::element::{ElementKind, Formulation, consistent_mass, incompatible_stiffness, lumped_mass, stiffness};
use crate::material::Material;
use crate::mesh::Mesh;
use crate::progress::{Listener, ReductionStage, report};
use crate::sparse::{Pattern, SparseMatrix};
use crate::{Error, Result};

/// Number of elements that are computed in parallel before their matrices are added to the global ones.
const CHUNK: usize = 256;

/// Stiffness (N/m) and consistent mass (kg) of the whole mesh; dof 3·node + component, no boundary conditions
/// applied.
#[derive(Debug, Clone)]
pub struct Assembled {
    /// K.
    pub stiffness: SparseMatrix,
    /// M, with the pattern of K.
    pub mass: SparseMatrix,
}

/// Neighbours of each node, itself included, ascending.
pub(crate) fn neighbours(mesh: &Mesh) -> Vec<Vec<usize>> {
    let mut lists = vec![Vec::new(); mesh.nodes.len()];
    for element in &mesh.elements {
        for &node in &element.nodes {
            lists[node].extend_from_slice(&element.nodes);
        }
    }
    lists.par_iter_mut().for_each(|list| {
        list.sort_unstable();
        list.dedup();
    });
    lists
}

fn pattern(neighbours: &[Vec<usize>]) -> Pattern {
    let entries = 9 * neighbours.iter().map(Vec::len).sum::<usize>();
    let mut starts = Vec::with_capacity(3 * neighbours.len() + 1);
    let mut rows = Vec::with_capacity(entries);
    starts.push(0);
    for list in neighbours {
        for _ in 0..3 {
            rows.extend(list.iter().flat_map(|node| (0..3).map(move |component| 3 * node + component)));
            starts.push(rows.len());
        }
    }
    Pattern { starts, rows }
}

/// Visits every node pair (a, b) of an element with the positions of the three columns of its 3 × 3 block among the
/// entries.
pub(crate) fn for_each_block(pattern: &Pattern, nodes: &[usize], mut visit: impl FnMut(usize, usize, [usize; 3])) {
    for (b, &column) in nodes.iter().enumerate() {
        let start = pattern.starts[3 * column];
        let rows = &pattern.rows[start..pattern.starts[3 * column + 1]];
        for (a, &row) in nodes.iter().enumerate() {
            let place = rows.binary_search(&(3 * row)).expect("the sparsity pattern contains all element pairs");
            visit(a, b, core::array::from_fn(|j| pattern.starts[3 * column + j] + place));
        }
    }
}

/// Assembles K and M.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
/// # let steel = Material::steel();
///
/// let matrices = tiprub_model::assembly::assemble(&mesh, &steel, &tiprub_model::progress::silent)?;
/// assert_eq!(matrices.mass.order(), 48);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for an invalid mesh or material, [`Error::NegativeJacobian`] with the element.
pub fn assemble(mesh: &Mesh, material: &Material, listener: Listener<'_>) -> Result<Assembled> {
    assemble_with(mesh, material, Formulation::default(), listener)
}

/// Assembles K and M as [`assemble`] does, with hex8 elements in the given formulation.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
/// # let steel = Material::steel();
///
/// # use tiprub_model::element::Formulation;
/// let matrices = tiprub_model::assembly::assemble_with(&mesh, &steel, Formulation::default(), &tiprub_model::progress::silent)?;
/// assert_eq!(matrices.stiffness.order(), 48);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// The errors of [`assemble`].
pub fn assemble_with(
    mesh: &Mesh,
    material: &Material,
    formulation: Formulation,
    listener: Listener<'_>,
) -> Result<Assembled> {
    mesh.validate()?;
    material.validate()?;
    if mesh.elements.is_empty() {
        return Err(Error::invalid("mesh", "it has no elements", "Give a mesh with solid elements"));
    }
    let neighbours = neighbours(mesh);
    let pattern = Arc::new(pattern(&neighbours));
    let mut stiffness_values = vec![0.0; pattern.rows.len()];
    let mut mass_values = vec![0.0; pattern.rows.len()];
    for (chunk_index, chunk) in mesh.elements.chunks(CHUNK).enumerate() {
        report(listener, ReductionStage::Assembly, chunk_index * CHUNK, mesh.elements.len());
        let matrices: Vec<Result<(DMatrix<f64>, DMatrix<f64>)>> = chunk
            .par_iter()
            .enumerate()
            .map(|(offset, element)| {
                let (number, coordinates) = (chunk_index * CHUNK + offset, mesh.coordinates(element));
                let stiffness = match (element.kind, formulation) {
                    (ElementKind::Hex8, Formulation::IncompatibleModes) => {
                        incompatible_stiffness(&coordinates, material, number)?
                    }
                    _ => stiffness(element.kind, &coordinates, material, number)?,
                };
                Ok((stiffness, consistent_mass(element.kind, &coordinates, material.density, number)?))
            })
            .collect();
        for (element, pair) in chunk.iter().zip(matrices) {
            let (element_stiffness, element_mass) = pair?;
            for_each_block(&pattern, &element.nodes, |a, b, starts| {
                for (j, start) in starts.into_iter().enumerate() {
                    for i in 0..3 {
                        stiffness_values[start + i] += element_stiffness[(3 * a + i, 3 * b + j)];
                    }
                    mass_values[start + j] += element_mass[(a, b)];
                }
            });
        }
    }
    report(listener, ReductionStage::Assembly, 1, 1);
    Ok(Assembled {
        stiffness: SparseMatrix { pattern: Arc::clone(&pattern), values: stiffness_values },
        mass: SparseMatrix { pattern, values: mass_values },
    })
}

/// Returns the lumped mass of every node (kg), for explicit time stepping of the full model; see `lumped_mass`.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
/// # let steel = Material::steel();
///
/// let masses = tiprub_model::assembly::lumped_masses(&mesh, steel.density)?;
/// assert!((masses.iter().sum::<f64>() - 2.4e-5 * steel.density).abs() < 1e-9);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for an invalid mesh, [`Error::NegativeJacobian`] with the element.
pub fn lumped_masses(mesh: &Mesh, density: f64) -> Result<Vec<f64>> {
    mesh.validate()?;
    let mut masses = vec![0.0; mesh.nodes.len()];
    for (number, element) in mesh.elements.iter().enumerate() {
        let parts = lumped_mass(element.kind, &mesh.coordinates(element), density, number)?;
        element.nodes.iter().zip(parts).for_each(|(&node, part)| masses[node] += part);
    }
    Ok(masses)
}

/// Returns the dofs that remain when some nodes are clamped, ascending.
///
/// # Examples
/// ```
/// assert_eq!(tiprub_model::assembly::free_dofs(2, &[0]), [3, 4, 5]);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn free_dofs(node_count: usize, clamped: &[usize]) -> Vec<usize> {
    let mut fixed = vec![false; node_count];
    for &node in clamped {
        fixed[node] = true;
    }
    (0..3 * node_count).filter(|dof| !fixed[dof / 3]).collect()
}
