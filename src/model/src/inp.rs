//! Export of a mesh with material, sets and boundary as a CalculiX (Abaqus) input file.

use std::fmt::Write as _;
use std::path::Path;

use crate::{Error, Result, element::ElementKind, material::Material, mesh::Mesh};

/// Text of an input file that computes the lowest `frequencies` natural frequencies.
///
/// Numbers carry 13 significant digits: CalculiX reads at most 20 characters each. Every node set of the mesh is written; the nodes of `clamped` (a set name, if any) are fixed in all directions.
///
/// # Errors
/// [`Error::Invalid`] when the set does not exist or the mesh is not sound.
pub fn calculix_input(mesh: &Mesh, material: &Material, clamped: Option<&str>, frequencies: usize) -> Result<String> {
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
        put(&mut text, format_args!("*NSET, NSET={}\n", name.to_uppercase()));
        write_list(&mut text, nodes.iter().map(|node| node + 1));
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
    put(&mut text, format_args!("*STEP\n*FREQUENCY\n{frequencies}\n*NODE FILE\nU\n*END STEP\n"));
    Ok(text)
}

/// Write [`calculix_input`] to a file: to a temporary one beside it first, then renamed.
///
/// # Errors
/// As [`calculix_input`]; [`Error::File`] when the file cannot be written, and then nothing is left behind.
pub fn write_calculix_input(
    path: &Path,
    mesh: &Mesh,
    material: &Material,
    clamped: Option<&str>,
    frequencies: usize,
) -> Result<()> {
    let text = calculix_input(mesh, material, clamped, frequencies)?;
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let temporary = path.with_file_name(name);
    std::fs::write(&temporary, text).and_then(|()| std::fs::rename(&temporary, path)).map_err(|source| {
        // Best effort: the error that counts is the one reported.
        let _ = std::fs::remove_file(&temporary);
        Error::File { path: path.to_path_buf(), source }
    })
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

/// Numbers separated by commas, at most 12 a line; a comma at the end of a line continues it.
fn write_list(text: &mut String, numbers: impl Iterator<Item = usize>) {
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    let lines: Vec<String> = numbers.chunks(12).map(|line| line.join(", ")).collect();
    text.push_str(&lines.join(",\n"));
    text.push('\n');
}

fn put(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String does not fail");
}
