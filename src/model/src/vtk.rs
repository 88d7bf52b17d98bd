//! Export of a mesh with node sets and fields as a VTK file (`.vtu`), for ParaView, meshio and other programs.
//!
//! The format is XML `UnstructuredGrid` with arrays in base64, little-endian, not compressed. The node order of all
//! element kinds in VTK is the same as here.

use core::f64::consts::TAU;
use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Complex;

use crate::element::ElementKind;
use crate::mesh::Mesh;
use crate::{Error, Result};

/// Quantity at every node.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalField {
    /// Name as shown in ParaView.
    pub name: String,
    /// Values at the nodes.
    pub values: Values,
}

/// Values of a [`NodalField`], one per node.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Scalars.
    Scalars(Vec<f64>),
    /// Vectors (x, y, z).
    Vectors(Vec<[f64; 3]>),
}

impl NodalField {
    /// Creates a field with a vector at every node.
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
    ///
    /// let field = tiprub_model::vtk::NodalField::vectors("position", mesh.nodes.clone());
    /// assert!(tiprub_model::vtk::write(&mesh, &[field]).is_ok());
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    pub fn vectors(name: impl Into<String>, values: Vec<[f64; 3]>) -> Self {
        Self { name: name.into(), values: Values::Vectors(values) }
    }

    /// Creates a field with a scalar at every node.
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
    ///
    /// let field = tiprub_model::vtk::NodalField::scalars("z", mesh.nodes.iter().map(|node| node[2]).collect());
    /// assert!(tiprub_model::vtk::write(&mesh, &[field]).is_ok());
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    pub fn scalars(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self { name: name.into(), values: Values::Scalars(values) }
    }

    /// Creates the fields of a complex mode of one sector: `<name>_real`, `<name>_imaginary` and the length of the
    /// complex vector, `<name>_amplitude`.
    pub fn mode(name: &str, shape: &[[Complex<f64>; 3]]) -> [Self; 3] {
        let part = |pick: fn(&Complex<f64>) -> f64| shape.iter().map(|node| node.each_ref().map(pick)).collect();
        let length = |node: &[Complex<f64>; 3]| node.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
        [
            Self::vectors(format!("{name}_real"), part(|value| value.re)),
            Self::vectors(format!("{name}_imaginary"), part(|value| value.im)),
            Self::scalars(format!("{name}_amplitude"), shape.iter().map(length).collect()),
        ]
    }
}

/// Returns the contents of the file: nodes, elements, every node set as a field `set_<name>` of 0 and 1, and the
/// fields.
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
///
/// # use tiprub_model::vtk::{NodalField, write};
/// let radius = mesh.nodes.iter().map(|[x, y, _]| x.hypot(*y)).collect();
/// let bytes = write(&mesh, &[NodalField::scalars("radius", radius)])?;
/// assert!(bytes.starts_with(b"<?xml"));
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for an invalid mesh, a field whose number of values differs from the number of nodes, and
/// repeated names.
pub fn write(mesh: &Mesh, fields: &[NodalField]) -> Result<Vec<u8>> {
    mesh.validate()?;
    check_fields(mesh, fields)?;
    let (points, cells) = (mesh.nodes.len(), mesh.elements.len());
    let mut text = String::from("<?xml version=\"1.0\"?>\n");
    text.push_str(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n",
    );
    put(&mut text, format_args!("<UnstructuredGrid>\n<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">\n"));
    text.push_str("<Points>\n");
    array(&mut text, "Points", "Float64", 3, &reals(mesh.nodes.iter().flatten()));
    text.push_str("</Points>\n<Cells>\n");
    let connectivity = mesh.elements.iter().flat_map(|element| &element.nodes);
    array(&mut text, "connectivity", "Int64", 1, &integers(connectivity.copied()));
    let ends = mesh.elements.iter().scan(0, |end, element| {
        *end += element.nodes.len();
        Some(*end)
    });
    array(&mut text, "offsets", "Int64", 1, &integers(ends));
    let types: Vec<u8> = mesh.elements.iter().map(|element| cell_type(element.kind)).collect();
    array(&mut text, "types", "UInt8", 1, &types);
    text.push_str("</Cells>\n<PointData>\n");
    for (name, nodes) in &mesh.sets {
        let mut members = vec![0_u8; points];
        nodes.iter().for_each(|&node| members[node] = 1);
        array(&mut text, &set_name(name), "UInt8", 1, &members);
    }
    for field in fields {
        match &field.values {
            Values::Scalars(values) => array(&mut text, &field.name, "Float64", 1, &reals(values)),
            Values::Vectors(values) => array(&mut text, &field.name, "Float64", 3, &reals(values.iter().flatten())),
        }
    }
    text.push_str("</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    Ok(text.into_bytes())
}

/// Returns the mesh of a whole disk: copies of a sector rotated about z, sector by sector; nodes on the faces are
/// duplicated.
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
///
/// let disk = tiprub_model::vtk::disk(&mesh, 36);
/// assert_eq!(disk.elements.len(), 36 * mesh.elements.len());
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn disk(sector: &Mesh, sectors: usize) -> Mesh {
    let count = sector.nodes.len();
    let mut disk = Mesh::default();
    for copy in 0..sectors {
        disk.nodes.extend(sector.nodes.iter().map(|node| turned(*node, copy, sectors)));
        for element in &sector.elements {
            let mut element = element.clone();
            element.nodes.iter_mut().for_each(|node| *node += copy * count);
            disk.elements.push(element);
        }
        for (name, nodes) in &sector.sets {
            disk.sets.entry(name.clone()).or_default().extend(nodes.iter().map(|node| node + copy * count));
        }
    }
    disk
}

/// Returns a mode of n nodal diameters on [`disk`]: Re(u e^(2πi n s/N)) on sector s, rotated with it.
#[expect(clippy::cast_precision_loss, reason = "numbers of sectors are small")]
pub fn on_disk(shape: &[[Complex<f64>; 3]], nodal_diameters: usize, sectors: usize) -> Vec<[f64; 3]> {
    let copy = |sector: usize| {
        // The remainder keeps the angle small, and its cosine exact where possible.
        let phase = TAU * ((nodal_diameters * sector) % sectors) as f64 / sectors as f64;
        let (sin, cos) = phase.sin_cos();
        shape.iter().map(move |node| turned(node.map(|u| u.re * cos - u.im * sin), sector, sectors))
    };
    (0..sectors).flat_map(copy).collect()
}

#[expect(clippy::cast_precision_loss, reason = "numbers of sectors are small")]
fn turned([x, y, z]: [f64; 3], copy: usize, sectors: usize) -> [f64; 3] {
    let (sin, cos) = (TAU * copy as f64 / sectors as f64).sin_cos();
    [cos * x - sin * y, sin * x + cos * y, z]
}

fn set_name(name: &str) -> String {
    format!("set_{name}")
}

fn check_fields(mesh: &Mesh, fields: &[NodalField]) -> Result<()> {
    let mut names: Vec<String> = mesh.sets.keys().map(|name| set_name(name)).collect();
    for field in fields {
        let what = || format!("field `{}`", field.name);
        let count = match &field.values {
            Values::Scalars(values) => values.len(),
            Values::Vectors(values) => values.len(),
        };
        if count != mesh.nodes.len() {
            let problem = format!("{count} values for {} nodes", mesh.nodes.len());
            return Err(Error::invalid(what(), problem, "Give one value per node of the mesh"));
        }
        if names.contains(&field.name) {
            return Err(Error::invalid(what(), "its name appears twice", "Give every field a unique name"));
        }
        names.push(field.name.clone());
    }
    Ok(())
}

/// Returns the cell types of VTK (vtkCellType.h).
fn cell_type(kind: ElementKind) -> u8 {
    match kind {
        ElementKind::Tet4 => 10,
        ElementKind::Hex8 => 12,
        ElementKind::Penta6 => 13,
        ElementKind::Tet10 => 24,
        ElementKind::Hex20 => 25,
        ElementKind::Penta15 => 26,
    }
}

fn reals<'a>(values: impl IntoIterator<Item = &'a f64>) -> Vec<u8> {
    values.into_iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn integers(values: impl Iterator<Item = usize>) -> Vec<u8> {
    values.flat_map(|value| (value as u64).to_le_bytes()).collect()
}

/// Writes one `DataArray`: number of bytes (UInt64) and bytes, together in base64.
fn array(text: &mut String, name: &str, kind: &str, components: usize, bytes: &[u8]) {
    let name = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
    put(
        text,
        format_args!(
            "<DataArray Name=\"{name}\" type=\"{kind}\" NumberOfComponents=\"{components}\" format=\"binary\">\n"
        ),
    );
    let block = [&(bytes.len() as u64).to_le_bytes(), bytes].concat();
    STANDARD.encode_string(block, text);
    text.push_str("\n</DataArray>\n");
}

fn put(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String does not fail");
}
