//! Finite-element model ready for reduction, from a mesh of this crate or from the matrices of another program.

use std::collections::BTreeMap;

use crate::assembly::{assemble, lumped_masses};
use crate::material::Material;
use crate::mesh::Mesh;
use crate::progress::Listener;
use crate::sparse::SparseMatrix;
use crate::{Error, Result};

/// Matrices of all nodes without boundary conditions: dof 3·node + component, components along x, y, z.
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
    /// Mesh and material if the matrices were assembled here; figures and exports need them.
    pub mesh: Option<(Mesh, Material)>,
    /// Source of the model, for the `origin` of the ROM.
    pub origin: String,
}

impl FeModel {
    /// Assembles a mesh of one material.
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
    /// # use tiprub_model::{FeModel, progress::silent};
    /// let model = FeModel::assembled(mesh, &steel, "three cubes".into(), &silent)?;
    /// assert_eq!(model.stiffness.order(), 48);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
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

    /// Returns the same model with lumped mass, see [`lumped_masses`].
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
    /// # use tiprub_model::{FeModel, progress::silent};
    /// let model = FeModel::assembled(mesh, &steel, "three cubes".into(), &silent)?.lumped()?;
    /// // The mass of 3 cubes, three times on the diagonal.
    /// let mass = 3.0 * 0.02_f64.powi(3) * steel.density;
    /// assert!((model.mass.trace() - 3.0 * mass).abs() < 1e-12);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] for a model without a mesh of one material; the errors of [`lumped_masses`].
    pub fn lumped(mut self) -> Result<Self> {
        let Some((mesh, material)) = &self.mesh else {
            let problem = "the model has no mesh with a single material";
            return Err(Error::invalid("lumped mass", problem, "Use the mass matrix of the model"));
        };
        let masses = lumped_masses(mesh, material.density)?;
        self.mass.set_diagonal(|dof| masses[dof / 3]);
        Ok(self)
    }

    /// Returns the nodes of a named set; the case of the name may differ if only one set then matches.
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
    /// # use tiprub_model::{FeModel, progress::silent};
    /// let model = FeModel::assembled(mesh, &steel, String::new(), &silent)?;
    /// assert_eq!(model.set("root")?.len(), 4);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] with a list of the existing sets.
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
