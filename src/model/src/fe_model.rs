//! A finite-element model ready for reduction, from a mesh of this crate or from the matrices of another code.

use std::collections::BTreeMap;

use crate::assembly::{assemble, lumped_masses};
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
    /// The errors of [`assemble`].
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

    /// The same model with its mass on the nodes, see [`lumped_masses`].
    ///
    /// # Errors
    /// [`Error::Invalid`] for a model without a mesh of one material; those of [`lumped_masses`].
    pub fn lumped(mut self) -> Result<Self> {
        let Some((mesh, material)) = &self.mesh else {
            let problem = "the model has no mesh with a single material";
            return Err(Error::invalid("lumped mass", problem, "Use the mass matrix of the model"));
        };
        let masses = lumped_masses(mesh, material.density)?;
        self.mass.set_diagonal(|dof| masses[dof / 3]);
        Ok(self)
    }

    /// The nodes of a named set; upper and lower case may differ where only one set then fits.
    ///
    /// # Errors
    /// [`Error::Invalid`] listing the sets there are.
    pub fn set(&self, name: &str) -> Result<&[usize]> {
        if let Some(nodes) = self.sets.get(name) {
            return Ok(nodes);
        }
        let mut alike = self.sets.iter().filter(|(known, _)| known.eq_ignore_ascii_case(name));
        if let (Some((_, nodes)), None) = (alike.next(), alike.next()) {
            return Ok(nodes);
        }
        let problem = "the model has no set of this name";
        let remedy = if self.sets.is_empty() {
            "Define groups of nodes, elements or faces in the mesh generator: the model has no sets".to_owned()
        } else {
            format!("Choose one of: {}", crate::mesh::set_counts(&self.sets))
        };
        Err(Error::invalid(format!("node set `{name}`"), problem, remedy))
    }
}
