//! Matrices and histories of the scene as files, so that other programs can use the same mesh.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tiprub_model::sparse::{Pattern, SparseMatrix};
use tiprub_model::{Error, FeModel, Result};

use super::scene::CubeBody;

/// One body: node table, elements, sets and matrices (compressed columns, both triangles; dof 3·node + component).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyFile {
    /// Coordinates (m).
    pub nodes: Vec<[f64; 3]>,
    /// Node indices (from 0) of the bricks.
    pub elements: Vec<Vec<usize>>,
    /// Node sets (indices from 0).
    pub sets: BTreeMap<String, Vec<usize>>,
    /// Start of each column, and the end of the last.
    pub starts: Vec<usize>,
    /// Row of each entry.
    pub rows: Vec<usize>,
    /// K (N/m).
    pub stiffness: Vec<f64>,
    /// M (kg).
    pub mass: Vec<f64>,
}

impl From<&CubeBody> for BodyFile {
    fn from(body: &CubeBody) -> Self {
        Self {
            nodes: body.mesh.nodes.clone(),
            elements: body.mesh.elements.iter().map(|element| element.nodes.clone()).collect(),
            sets: body.mesh.sets.clone(),
            starts: body.stiffness.pattern.starts.clone(),
            rows: body.stiffness.pattern.rows.clone(),
            stiffness: body.stiffness.values.clone(),
            mass: body.mass.values.clone(),
        }
    }
}

impl BodyFile {
    /// Converts the body to a model for reduction.
    ///
    /// # Errors
    /// [`Error::Invalid`] for inconsistent lengths.
    pub fn fe_model(self, origin: &str) -> Result<FeModel> {
        let order = 3 * self.nodes.len();
        let sound = self.starts.len() == order + 1
            && self.starts.last() == Some(&self.rows.len())
            && self.rows.len() == self.stiffness.len()
            && self.rows.len() == self.mass.len()
            && self.starts.is_sorted()
            && self.rows.iter().all(|row| *row < order);
        if !sound {
            let problem = format!("the matrices do not match {} nodes", self.nodes.len());
            return Err(Error::invalid("file of a body", problem, "Write the file again with the example `cube`"));
        }
        let pattern = Arc::new(Pattern { starts: self.starts, rows: self.rows });
        Ok(FeModel {
            nodes: self.nodes,
            sets: self.sets,
            stiffness: SparseMatrix { pattern: Arc::clone(&pattern), values: self.stiffness },
            mass: SparseMatrix { pattern, values: self.mass },
            mesh: None,
            origin: origin.into(),
        })
    }
}

/// Writes a value as JSON.
///
/// # Errors
/// [`Error::File`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string(value).map_err(|error| file_error(path, error.into()))?;
    std::fs::write(path, text).map_err(|error| file_error(path, error))
}

/// Reads a file of [`write_json`]: a [`BodyFile`] or a [`super::history::CubeHistory`].
///
/// # Errors
/// [`Error::File`], also if the contents are of another kind.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).map_err(|error| file_error(path, error))?;
    serde_json::from_str(&text).map_err(|error| file_error(path, error.into()))
}

fn file_error(path: &Path, source: std::io::Error) -> Error {
    Error::File { path: path.to_path_buf(), source }
}
