//! Export of a mesh with material, sets and boundary conditions as a CalculiX (Abaqus) input file.

use std::fmt::Write as _;

use crate::{Error, Result, element::ElementKind, material::Material, mesh::Mesh};

/// Sector of a disk, for [`calculix_cyclic_input`].
#[derive(Debug, Clone, Copy)]
pub struct CyclicSymmetry<'a> {
    /// Node sets of the two faces, the second one rotated by +2π/sectors about z.
    pub faces: [&'a str; 2],
    /// Number of sectors of the disk.
    pub sectors: usize,
    /// Nodal diameters, with one step for each.
    pub nodal_diameters: &'a [usize],
}

/// Returns the text of an input file that computes the lowest `frequencies` natural frequencies.
///
/// Numbers have 13 significant digits, since CalculiX reads at most 20 characters each. Every node set of the mesh is
/// written; the nodes of `clamped` (a set name, if any) are fixed in all directions.
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
/// let text = tiprub_model::inp::calculix_input(&mesh, &steel, Some("ROOT"), 4)?;
/// assert!(text.contains("*FREQUENCY"));
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the set does not exist or the mesh is invalid.
pub fn calculix_input(mesh: &Mesh, material: &Material, clamped: Option<&str>, frequencies: usize) -> Result<String> {
    let mut text = model(mesh, material, clamped)?;
    put(&mut text, format_args!("*STEP\n*FREQUENCY\n{frequencies}\n*NODE FILE\nU\n*END STEP\n"));
    Ok(text)
}

/// Returns the text of an input file as [`calculix_input`] does, for a sector of a disk (`*CYCLIC SYMMETRY MODEL`),
/// with a frequency step per nodal diameter.
///
/// CalculiX lists every frequency twice, even for single modes (nodal diameter zero or half the number of sectors),
/// so twice as many are requested. Clamped nodes are omitted from the faces, since CalculiX does not tie them.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, inp::{CyclicSymmetry, calculix_cyclic_input}, stage};
/// let sector = stage::sector_mesh(&stage::SectorOptions::coarse())?;
/// let symmetry = CyclicSymmetry { faces: ["CYCLIC_LOW", "CYCLIC_HIGH"], sectors: 56, nodal_diameters: &[0, 2, 5] };
/// let text = calculix_cyclic_input(&sector.mesh, &Material::titanium(), Some("CLAMPED"), &symmetry, 4)?;
/// assert!(text.contains("*CYCLIC SYMMETRY MODEL"));
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// The errors of [`calculix_input`]; [`Error::Invalid`] for a nodal diameter above half the number of sectors.
pub fn calculix_cyclic_input(
    mesh: &Mesh,
    material: &Material,
    clamped: Option<&str>,
    symmetry: &CyclicSymmetry<'_>,
    frequencies: usize,
) -> Result<String> {
    let CyclicSymmetry { faces, sectors, nodal_diameters } = *symmetry;
    if let Some(n) = nodal_diameters.iter().find(|&&n| 2 * n > sectors) {
        let problem = format!("{n} is too large for {sectors} sectors");
        return Err(Error::invalid("nodal diameter", problem, "Give at most half the number of sectors"));
    }
    let mut text = model(mesh, material, clamped)?;
    let clamped = clamped.map_or(Ok(&[][..]), |set| mesh.set(set))?;
    for (face, name) in faces.iter().zip(["TIED_LOW", "TIED_HIGH"]) {
        let tied: Vec<usize> = mesh.set(face)?.iter().copied().filter(|node| !clamped.contains(node)).collect();
        write_set(&mut text, name, &tied);
        put(&mut text, format_args!("*SURFACE, NAME=S{name}, TYPE=NODE\n{name}\n"));
    }
    text.push_str("*TIE, NAME=CYCLIC, CYCLIC SYMMETRY\nSTIED_HIGH, STIED_LOW\n");
    // The axis is given by two points.
    put(&mut text, format_args!("*CYCLIC SYMMETRY MODEL, N={sectors}, TIE=CYCLIC, ELSET=EALL\n0, 0, 0, 0, 0, 1\n"));
    for n in nodal_diameters {
        put(&mut text, format_args!("*STEP\n*FREQUENCY\n{}\n", 2 * frequencies));
        put(&mut text, format_args!("*SELECT CYCLIC SYMMETRY MODES, NMIN={n}, NMAX={n}\n"));
        text.push_str("*NODE FILE\nU\n*END STEP\n");
    }
    Ok(text)
}

/// Nodes, elements, sets, material and boundary.
fn model(mesh: &Mesh, material: &Material, clamped: Option<&str>) -> Result<String> {
    mesh.validate()?;
    material.validate()?;
    let mut text = String::from("*HEADING\nUnits: m, kg, s, N\n*NODE, NSET=NALL\n");
    for (index, [x, y, z]) in mesh.nodes.iter().enumerate() {
        put(&mut text, format_args!("{}, {x:.12e}, {y:.12e}, {z:.12e}\n", index + 1));
    }
    for kind in ElementKind::ALL {
        write_elements(&mut text, mesh, kind);
    }
    for (name, nodes) in &mesh.sets {
        write_set(&mut text, name, nodes);
    }
    let name = material.name.to_uppercase();
    let Material { young_modulus, poisson_ratio, density, .. } = material;
    put(&mut text, format_args!("*MATERIAL, NAME={name}\n*ELASTIC\n{young_modulus:.12e}, {poisson_ratio:.12e}\n"));
    put(&mut text, format_args!("*DENSITY\n{density:.12e}\n"));
    put(&mut text, format_args!("*SOLID SECTION, ELSET=EALL, MATERIAL={name}\n"));
    if let Some(set) = clamped {
        mesh.set(set)?;
        put(&mut text, format_args!("*BOUNDARY\n{}, 1, 3\n", set.to_uppercase()));
    }
    Ok(text)
}

fn write_set(text: &mut String, name: &str, nodes: &[usize]) {
    put(text, format_args!("*NSET, NSET={}\n", name.to_uppercase()));
    write_list(text, nodes.iter().map(|node| node + 1));
}

fn write_elements(text: &mut String, mesh: &Mesh, kind: ElementKind) {
    if !mesh.elements.iter().any(|element| element.kind == kind) {
        return;
    }
    put(text, format_args!("*ELEMENT, TYPE={}, ELSET=EALL\n", kind.calculix_name()));
    for (index, element) in mesh.elements.iter().enumerate().filter(|(_, element)| element.kind == kind) {
        write_list(text, core::iter::once(index + 1).chain(element.nodes.iter().map(|node| node + 1)));
    }
}

/// Writes numbers separated by commas, at most 12 per line; a comma at the end of a line continues it.
fn write_list(text: &mut String, numbers: impl Iterator<Item = usize>) {
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    let lines: Vec<String> = numbers.chunks(12).map(|line| line.join(", ")).collect();
    text.push_str(&lines.join(",\n"));
    text.push('\n');
}

fn put(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String does not fail");
}
