//! Assembly of the matrices of an imported mesh with one or several materials.

use std::path::Path;

use super::draft::Numbered;
use super::entries::{Entries, symmetric_pair};
use super::{Imported, MeshFile, MeshOptions};
use crate::fe_model::FeModel;
use crate::material::Material;
use crate::mesh::{Element, Mesh};
use crate::progress::Listener;
use crate::reduce::element_names;
use crate::{Error, Result};

pub(super) fn assembled(
    path: &Path,
    file: MeshFile,
    options: &MeshOptions,
    listener: Listener<'_>,
) -> Result<Imported> {
    let name = path.display().to_string();
    let file_name = path.file_name().map_or(name.clone(), |file| file.to_string_lossy().into_owned());
    let MeshFile { draft, materials, held } = file;
    let (numbered, mut notes, mut warnings) = draft.into_mesh(options.units.length(), options.axis, &name)?;
    let (materials, of_element) = match &options.material {
        Some(material) => {
            if !materials.is_empty() {
                notes.push("the material in the file is ignored because another one is given".into());
            }
            (vec![material.clone()], vec![0; numbered.elements.len()])
        }
        None => {
            let of_element = file_materials(&name, &numbered, materials.is_empty())?;
            // Only the materials that are used, in the order of the file.
            let (mut used, mut position) = (Vec::new(), vec![usize::MAX; materials.len()]);
            for (index, material) in materials.iter().enumerate().filter(|(index, _)| of_element.contains(index)) {
                position[index] = used.len();
                used.push(options.units.si(material));
            }
            (used, of_element.into_iter().map(|index| position[index]).collect())
        }
    };
    warnings.extend(linear_element_warning(&numbered.mesh));
    let origin = format!("Model of {file_name}");
    let model = build(&numbered, &materials, &of_element, origin, listener)
        .map_err(|error| with_file_number(error, &numbered.elements, &name))?;
    Ok(Imported { model, node_numbers: numbered.nodes, materials, absent: Vec::new(), held, notes, warnings })
}

/// Warns of elements without mid-side nodes, which are too stiff in bending by tens of percent on meshes of usual
/// size.
fn linear_element_warning(mesh: &Mesh) -> Option<String> {
    let linear = mesh.elements.iter().filter(|element| element.kind != element.kind.quadratic()).count();
    (linear > 0).then(|| {
        format!(
            "{linear} of {} elements have no mid-side nodes: bending is far too stiff (frequencies of thin blades are \
             tens of percent too high). Use second-order elements",
            mesh.elements.len()
        )
    })
}

/// Returns the material index of every element, from the file.
fn file_materials(name: &str, numbered: &Numbered, none: bool) -> Result<Vec<usize>> {
    let remedy = "Give a material on the command line: --material steel, or --young, --poisson and --density";
    let refuse = |problem: String| Err(Error::read(name, problem, remedy));
    if none {
        return refuse("the file has no material".into());
    }
    let without = numbered.materials.iter().position(Option::is_none);
    if let Some(index) = without {
        return refuse(format!("element {} belongs to no *SOLID SECTION", numbered.elements[index]));
    }
    Ok(numbered.materials.iter().flatten().copied().collect())
}

fn build(
    numbered: &Numbered,
    materials: &[Material],
    of_element: &[usize],
    origin: String,
    listener: Listener<'_>,
) -> Result<FeModel> {
    if let [material] = materials {
        return FeModel::assembled(numbered.mesh.clone(), material, origin, listener);
    }
    let mesh = &numbered.mesh;
    let order = 3 * mesh.nodes.len();
    let (mut stiffness, mut mass) = (Entries::default(), Entries::default());
    for (index, material) in materials.iter().enumerate() {
        let mine: Vec<usize> = (0..mesh.elements.len()).filter(|&element| of_element[element] == index).collect();
        let (part, nodes) = part_of(mesh, &mine);
        let model = FeModel::assembled(part, material, String::new(), listener)
            .map_err(|error| renumbered(error, |number| mine[number - 1] + 1))?;
        let dof = |dof: usize| 3 * nodes[dof / 3] + dof % 3;
        stiffness.add_matrix(&model.stiffness, dof);
        mass.add_matrix(&model.mass, dof);
    }
    let (stiffness, mass) = symmetric_pair(order, stiffness, mass);
    let names: Vec<String> = materials
        .iter()
        .map(|m| {
            format!("{}: E = {:e} Pa, nu = {}, rho = {} kg/m3", m.name, m.young_modulus, m.poisson_ratio, m.density)
        })
        .collect();
    let kinds = element_names(mesh);
    let origin =
        format!("{origin}, {} elements ({kinds}) of several materials ({})", mesh.elements.len(), names.join("; "));
    Ok(FeModel { nodes: mesh.nodes.clone(), sets: mesh.sets.clone(), stiffness, mass, mesh: None, origin })
}

/// Returns some elements with their nodes, and the indices of the nodes in the whole mesh.
fn part_of(mesh: &Mesh, elements: &[usize]) -> (Mesh, Vec<usize>) {
    let mut nodes: Vec<usize> = elements.iter().flat_map(|&element| mesh.elements[element].nodes.clone()).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let mut position = vec![usize::MAX; mesh.nodes.len()];
    nodes.iter().enumerate().for_each(|(new, &old)| position[old] = new);
    let element = |&element: &usize| {
        let Element { kind, nodes } = &mesh.elements[element];
        Element { kind: *kind, nodes: nodes.iter().map(|&node| position[node]).collect() }
    };
    let part = Mesh {
        nodes: nodes.iter().map(|&node| mesh.nodes[node]).collect(),
        elements: elements.iter().map(element).collect(),
        ..Mesh::default()
    };
    (part, nodes)
}

fn renumbered(error: Error, number: impl Fn(usize) -> usize) -> Error {
    match error {
        Error::NegativeJacobian { element, kind, point, determinant } => {
            Error::NegativeJacobian { element: number(element), kind, point, determinant }
        }
        other => other,
    }
}

/// Replaces the index of the element in an error by its number in the file, and adds the file name.
fn with_file_number(error: Error, numbers: &[u64], file: &str) -> Error {
    match error {
        Error::NegativeJacobian { element, kind, point, determinant } => {
            let problem = format!(
                "element {} ({}) is inverted or degenerate: its Jacobian determinant at integration point {point} is \
                 {determinant:.3e}",
                numbers[element - 1],
                kind.calculix_name()
            );
            let remedy = "Remesh this region; quadratic elements fold where the mesh is too coarse for the curvature";
            Error::read(file, problem, remedy)
        }
        other => other,
    }
}
