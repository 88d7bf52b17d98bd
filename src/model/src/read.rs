//! User models: meshes (CalculiX/Abaqus `.inp`, Gmsh `.msh` 4.1) and matrices with a node table.
//!
//! The result is a [`FeModel`] in SI units. Nothing is dropped silently: contents that change stiffness or mass and
//! are not supported are rejected with file, line and remedy; harmless contents are skipped and listed in
//! [`Imported::notes`].

mod assembling;
mod contact_nodes;
mod draft;
mod entries;
mod gmsh;
mod inp;
mod matrices;
mod plausibility;
mod source;

use std::path::Path;

use crate::fe_model::FeModel;
use crate::material::Material;
use crate::progress::Listener;
use crate::{Error, Result};

pub use crate::mesh::set_counts;
pub use contact_nodes::{ContactChoice, choose_contact_nodes};
pub use matrices::{MatrixFiles, read_matrices};
pub use plausibility::{Plausibility, bounding_box, plausibility, total_mass};

use draft::MeshDraft;

/// Units of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Units {
    /// m, kg, s, N, Pa.
    #[default]
    Si,
    /// mm, t, s, N, MPa.
    MillimetreTonneSecond,
}

impl Units {
    /// Returns the metres per unit of length.
    pub(crate) fn length(self) -> f64 {
        match self {
            Self::Si => 1.0,
            Self::MillimetreTonneSecond => 1e-3,
        }
    }

    /// Returns the factor of a stiffness to N/m and of a mass to kg: both are 1000 for N/mm and t.
    fn matrix(self) -> f64 {
        match self {
            Self::Si => 1.0,
            Self::MillimetreTonneSecond => 1e3,
        }
    }

    fn si(self, material: &Material) -> Material {
        let (stress, density) = match self {
            Self::Si => (1.0, 1.0),
            Self::MillimetreTonneSecond => (1e6, 1e12),
        };
        Material {
            young_modulus: stress * material.young_modulus,
            density: density * material.density,
            ..material.clone()
        }
    }
}

/// Engine axis of a file, which becomes z. The others follow cyclically: x, y, z becomes y, z, x with x as the engine
/// axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EngineAxis {
    /// x.
    X,
    /// y.
    Y,
    /// z: no rotation.
    #[default]
    Z,
}

impl EngineAxis {
    /// Returns the component here of a component of the file: 0, 1, 2 for x, y, z.
    fn place(self, component: usize) -> usize {
        match self {
            Self::X => (component + 2) % 3,
            Self::Y => (component + 1) % 3,
            Self::Z => component,
        }
    }

    /// Returns the coordinates here of a point of the file.
    fn turned(self, point: [f64; 3]) -> [f64; 3] {
        let mut turned = [0.0; 3];
        point.iter().enumerate().for_each(|(component, &value)| turned[self.place(component)] = value);
        turned
    }
}

/// Options for reading a mesh file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshOptions {
    /// Units of coordinates and material in the file.
    pub units: Units,
    /// Engine axis in the file.
    pub axis: EngineAxis,
    /// Material of all elements (SI), instead of those in the file.
    pub material: Option<Material>,
    /// Temperature at which tables of properties are evaluated, in the unit of the file.
    pub temperature: Option<f64>,
}

/// Imported model with notes and warnings for the user.
#[derive(Debug, Clone)]
pub struct Imported {
    /// Model in SI units.
    pub model: FeModel,
    /// Number of each node in the file.
    pub node_numbers: Vec<u64>,
    /// Materials of the elements, SI; empty for matrices.
    pub materials: Vec<Material>,
    /// Nodes that the matrices omit because they are clamped. Ascending indices.
    pub absent: Vec<usize>,
    /// Nodes that the file itself fixes (`*BOUNDARY`), as written: a hint, not applied.
    pub held: Vec<String>,
    /// Harmless notes: skipped or omitted contents and assumptions.
    pub notes: Vec<String>,
    /// Differences from the results of the program that the file is written for.
    pub warnings: Vec<String>,
}

/// Formats of meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MeshFormat {
    Input,
    Gmsh,
}

fn mesh_format(path: &Path, bytes: &[u8]) -> Result<MeshFormat> {
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase()).unwrap_or_default();
    match extension.to_str() {
        Some("inp" | "dat") => Ok(MeshFormat::Input),
        Some("msh") => Ok(MeshFormat::Gmsh),
        _ if bytes.starts_with(b"$MeshFormat") => Ok(MeshFormat::Gmsh),
        _ if bytes.starts_with(b"*") => Ok(MeshFormat::Input),
        _ => {
            let remedy = "Give a CalculiX or Abaqus input file (.inp) or a Gmsh mesh (.msh, version 4.1)";
            Err(source::about(path, "the file is neither an input file nor a Gmsh mesh", remedy))
        }
    }
}

/// Reads a mesh and assembles its matrices.
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
/// # use tiprub_model::{progress::silent, read::{MeshOptions, read_mesh}};
/// # let directory = tempfile::tempdir().expect("a directory");
/// # let path = directory.path().join("bar.inp");
/// # std::fs::write(&path, tiprub_model::inp::calculix_input(&mesh, &steel, Some("ROOT"), 4)?).expect("a file");
/// let imported = read_mesh(&path, &MeshOptions::default(), &silent)?;
/// assert_eq!(imported.model.set("TIP")?.len(), 4);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::File`] for a file that cannot be read, [`Error::Read`] with file and line for invalid or unsupported
/// contents, [`Error::Invalid`] for a missing material, and the errors of assembly with the numbers of the file.
pub fn read_mesh(path: &Path, options: &MeshOptions, listener: Listener<'_>) -> Result<Imported> {
    let bytes = source::open_file(path)?;
    let read = mesh_file(path, &bytes, options.temperature, &source::open_file)?;
    assembling::assembled(path, read, options, listener)
}

/// Mesh of either format before assembly.
struct MeshFile {
    draft: MeshDraft,
    materials: Vec<Material>,
    held: Vec<String>,
}

fn mesh_file(path: &Path, bytes: &[u8], temperature: Option<f64>, open: source::Open<'_>) -> Result<MeshFile> {
    match mesh_format(path, bytes)? {
        MeshFormat::Input => {
            let inp::Deck { draft, materials, held } = inp::read(path, bytes, temperature, open)?;
            Ok(MeshFile { draft, materials, held })
        }
        MeshFormat::Gmsh => Ok(MeshFile { draft: gmsh::read(path, bytes)?, materials: Vec::new(), held: Vec::new() }),
    }
}

/// Reads a mesh from memory without assembling it: nodes, elements and sets, in the unit of length of the file.
/// Included files are not opened.
///
/// # Examples
/// ```
/// let text = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*ELEMENT, TYPE=C3D4, ELSET=ALL\n1, 1, 2, 3, 4\n";
/// let mesh = tiprub_model::read::parse_mesh("tet.inp", text.as_bytes())?;
/// assert_eq!((mesh.nodes.len(), mesh.elements.len()), (4, 1));
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Read`] with file and line.
pub fn parse_mesh(name: &str, bytes: &[u8]) -> Result<crate::Mesh> {
    let path = Path::new(name);
    let none = |path: &Path| Err(Error::File { path: path.to_path_buf(), source: std::io::ErrorKind::NotFound.into() });
    let (numbered, _, _) = mesh_file(path, bytes, Some(0.0), &none)?.draft.into_mesh(1.0, EngineAxis::Z, name)?;
    Ok(numbered.mesh)
}
