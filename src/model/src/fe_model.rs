//! A finite-element model ready for reduction, from a mesh of this crate or from the matrices of another code.

use std::collections::BTreeMap;

use crate::assembly::assemble;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::progress::Listener;
use crate::sparse::SparseMatrix;
use crate::{Error, Result};

/// Matrices of all nodes with no boundary applied: dof 3·node + component, components along x, y, z.
#[derive(Debug, Clone)]
pub struct FeModel {
    /// Node coordinates (x, y, z) in m.
    pub nodes: Vec<[f64; 3]>,
    /// Named sets of node indices (from 0), ascending.
    pub sets: BTreeMap<String, Vec<usize>>,
    /// K (N/m).
    pub stiffness: SparseMatrix,
    /// M (kg), with the pattern of K.
    pub mass: SparseMatrix,
    /// The mesh and its material, where the matrices were assembled here; pictures and exports need it.
    pub mesh: Option<(Mesh, Material)>,
    /// Where the model came from, for the ROM's `origin`.
    pub origin: String,
}

impl FeModel {
    /// Assemble a mesh of one material.
    ///
    /// # Errors
    /// Those of [`assemble`].
    pub fn assembled(mesh: Mesh, material: &Material, origin: String, listener: Listener<'_>) -> Result<Self> {
        let matrices = assemble(&mesh, material, listener)?;
        Ok(Self {
            nodes: mesh.nodes.clone(),
            sets: mesh.sets.clone(),
            stiffness: matrices.stiffness,
            mass: matrices.mass,
            mesh: Some((mesh, material.clone())),
            origin,
        })
    }

    /// The nodes of a named set.
    ///
    /// # Errors
    /// [`Error::Invalid`] listing the sets there are.
    pub fn set(&self, name: &str) -> Result<&[usize]> {
        self.sets.get(name).map(Vec::as_slice).ok_or_else(|| {
            let names: Vec<_> = self.sets.keys().map(String::as_str).collect();
            let problem = "the model has no such set";
            Error::invalid(format!("node set `{name}`"), problem, format!("It has: {}", names.join(", ")))
        })
    }
}
