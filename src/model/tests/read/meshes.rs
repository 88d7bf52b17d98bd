//! Meshes written by Gmsh, as input file and as .msh, against each other and against CalculiX on the same file.

use std::path::{Path, PathBuf};

use tiprub_model::assembly::free_dofs;
use tiprub_model::element::{ElementKind, QuadraturePoint};
use tiprub_model::progress::silent;
use tiprub_model::read::{
    ContactChoice, EngineAxis, Imported, MeshOptions, Units, choose_contact_nodes, read_mesh, total_mass,
};
use tiprub_model::reduce::full_modes;
use tiprub_model::sparse::{SparseMatrix, principal_pair};
use tiprub_model::{Error, FeModel, Material};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/models").join(name)
}

fn steel() -> Material {
    Material { name: "steel".into(), young_modulus: 210e9, poisson_ratio: 0.3, density: 7850.0, expansion: 0.0 }
}

#[track_caller]
fn imported(name: &str) -> Imported {
    let options =
        MeshOptions { units: Units::MillimetreTonneSecond, material: Some(steel()), ..MeshOptions::default() };
    read_mesh(&data(name), &options, &silent).unwrap()
}

const MESHES: [(&str, ElementKind); 6] = [
    ("tet4", ElementKind::Tet4),
    ("tet10", ElementKind::Tet10),
    ("penta6", ElementKind::Penta6),
    ("penta15", ElementKind::Penta15),
    ("hex8", ElementKind::Hex8),
    ("hex20", ElementKind::Hex20),
];

#[test]
fn inp_and_msh_files_give_the_same_model() {
    for (name, kind) in MESHES {
        let (input, gmsh) = (imported(&format!("blade_{name}.inp")), imported(&format!("blade_{name}.msh")));
        let (mesh, _) = input.model.mesh.as_ref().unwrap();
        assert!(mesh.elements.iter().all(|element| element.kind == kind), "{name}");
        let (other, _) = gmsh.model.mesh.as_ref().unwrap();
        // The formats differ in node order and printed digits, but not in the numbers.
        let at = |model: &Imported, number: u64| {
            let index = model.node_numbers.iter().position(|&node| node == number).unwrap();
            model.model.nodes[index]
        };
        assert_eq!(mesh.nodes.len(), other.nodes.len(), "{name}");
        for &number in &input.node_numbers {
            let (a, b) = (at(&input, number), at(&gmsh, number));
            assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-12), "{name}, node {number}: {a:?} {b:?}");
        }
        let numbered = |model: &Imported, set: &str| {
            let mut numbers: Vec<u64> =
                model.model.set(set).unwrap().iter().map(|&node| model.node_numbers[node]).collect();
            numbers.sort_unstable();
            numbers
        };
        for set in ["ROOT", "TIP", "BLADE"] {
            assert_eq!(numbered(&input, set), numbered(&gmsh, set), "{name}: {set}");
        }
        let names = |model: &Imported, mesh: &tiprub_model::Mesh| {
            let mut elements: Vec<Vec<u64>> = mesh
                .elements
                .iter()
                .map(|element| element.nodes.iter().map(|&node| model.node_numbers[node]).collect())
                .collect();
            elements.sort();
            elements
        };
        assert_eq!(names(&input, mesh), names(&gmsh, other), "{name}: the elements' nodes, in order");
    }
}

#[test]
fn binary_and_text_gmsh_files_give_the_same_mesh() {
    for name in ["tet10", "hex20"] {
        let (text, binary) = (imported(&format!("blade_{name}.msh")), imported(&format!("blade_{name}_binary.msh")));
        let (a, b) = (text.model.mesh.unwrap().0, binary.model.mesh.unwrap().0);
        assert_eq!((a.elements, &a.sets), (b.elements, &b.sets), "{name}");
        // Text carries 16 digits.
        assert!(a.nodes.iter().zip(&b.nodes).all(|(a, b)| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-15)), "{name}");
    }
}

fn frequencies(model: &FeModel, stiffness: &SparseMatrix, mass: &SparseMatrix) -> Vec<f64> {
    let free = free_dofs(model.nodes.len(), model.set("ROOT").unwrap());
    let (stiffness, mass) = principal_pair(stiffness, mass, &free);
    full_modes(&stiffness, &mass, false, 10, &silent).unwrap().modes.frequencies()
}

fn reference(name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(data("frequencies_calculix.csv")).unwrap();
    let line = text.lines().find(|line| line.starts_with(&format!("{name},"))).unwrap();
    line.split(',').skip(1).map(|value| value.parse().unwrap()).collect()
}

fn worst(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn brick_frequencies_match_calculix() {
    for name in ["hex8", "hex20"] {
        let model = imported(&format!("blade_{name}.msh")).model;
        let off = worst(&frequencies(&model, &model.stiffness, &model.mass), &reference(name));
        assert!(off < 1e-6, "{name}: off by {off:.2e}");
    }
}

/// Integration points of CalculiX for elements where it uses fewer than this project: CalculiX 2.20, user's manual,
/// 6.2.
fn calculix_rules(kind: ElementKind) -> [Vec<QuadraturePoint>; 2] {
    let own = kind.stiffness_rule();
    let axial = 1.0 / 3.0_f64.sqrt();
    let wedge = |z: f64| QuadraturePoint { point: [1.0 / 3.0, 1.0 / 3.0, z], weight: 0.5 };
    match kind {
        ElementKind::Penta6 => [vec![wedge(-axial), wedge(axial)], vec![wedge(-axial), wedge(axial)]],
        _ => [own.clone(), own],
    }
}

/// Computes K and M of a model with other integration rules, by the formulas ∫ BᵀDB dV and ∫ ρNᵀN dV.
fn integrated(model: &FeModel, rules: &[Vec<QuadraturePoint>; 2]) -> (SparseMatrix, SparseMatrix) {
    let (mesh, material) = model.mesh.as_ref().unwrap();
    let (lambda, mu) = material.lame();
    let (mut stiffness, mut mass) = (model.stiffness.clone(), model.mass.clone());
    stiffness.values.fill(0.0);
    mass.values.fill(0.0);
    let add = |matrix: &mut SparseMatrix, row: usize, column: usize, value: f64| {
        let range = matrix.pattern.starts[column]..matrix.pattern.starts[column + 1];
        let offset = matrix.pattern.rows[range.clone()].binary_search(&row).unwrap();
        matrix.values[range.start + offset] += value;
    };
    for element in &mesh.elements {
        let coordinates = mesh.coordinates(element);
        for (which, rule) in rules.iter().enumerate() {
            for QuadraturePoint { point, weight } in rule {
                let shape = element.kind.shape(*point);
                let mut jacobian = nalgebra::Matrix3::<f64>::zeros();
                for (position, gradient) in coordinates.iter().zip(&shape.gradients) {
                    for i in 0..3 {
                        for j in 0..3 {
                            jacobian[(i, j)] += gradient[i] * position[j];
                        }
                    }
                }
                let volume = weight * jacobian.determinant();
                let inverse = jacobian.try_inverse().unwrap();
                let gradients: Vec<_> =
                    shape.gradients.iter().map(|gradient| inverse * nalgebra::Vector3::from(*gradient)).collect();
                for (a, &row) in element.nodes.iter().enumerate() {
                    for (b, &column) in element.nodes.iter().enumerate() {
                        for i in 0..3 {
                            if which == 1 {
                                let value = material.density * volume * shape.values[a] * shape.values[b];
                                add(&mut mass, 3 * row + i, 3 * column + i, value);
                                continue;
                            }
                            for j in 0..3 {
                                let (ga, gb) = (&gradients[a], &gradients[b]);
                                let mut value = lambda * ga[i] * gb[j] + mu * ga[j] * gb[i];
                                if i == j {
                                    value += mu * ga.dot(gb);
                                }
                                add(&mut stiffness, 3 * row + i, 3 * column + j, volume * value);
                            }
                        }
                    }
                }
            }
        }
    }
    (stiffness, mass)
}

#[test]
fn tetrahedra_and_prisms_match_calculix_frequencies() {
    for name in ["tet4", "tet10", "penta6", "penta15"] {
        let model = imported(&format!("blade_{name}.inp")).model;
        let kind = model.mesh.as_ref().unwrap().0.elements[0].kind;
        let (stiffness, mass) = integrated(&model, &calculix_rules(kind));
        let off = worst(&frequencies(&model, &stiffness, &mass), &reference(name));
        println!("{name}: off by {off:.2e}");
        assert!(off < 1e-4, "{name}: off by {off:.2e}");
    }
}

#[test]
fn consistent_mass_of_quadratic_elements_is_close_to_calculix() {
    for name in ["tet10", "penta15"] {
        let model = imported(&format!("blade_{name}.inp")).model;
        let off = worst(&frequencies(&model, &model.stiffness, &model.mass), &reference(name));
        assert!(off < 1e-3, "{name}: off by {off:.2e}");
    }
}

#[test]
fn units_are_converted() {
    let model = imported("blade_hex20.inp").model;
    assert!((total_mass(&model) - 0.0771).abs() < 1e-4, "{}", total_mass(&model));
    assert!(model.nodes.iter().all(|[x, y, _]| (0.199..0.261).contains(&x.hypot(*y))));
}

#[test]
fn engine_axis_option_rotates_the_mesh_without_mirroring() {
    let z = imported("blade_hex8.inp").model;
    for (axis, from) in [(EngineAxis::X, [1, 2, 0]), (EngineAxis::Y, [2, 0, 1])] {
        let units = Units::MillimetreTonneSecond;
        let options = MeshOptions { units, axis, material: Some(steel()), ..MeshOptions::default() };
        // A mirrored mesh would have inverted elements and be rejected.
        let turned = read_mesh(&data("blade_hex8.inp"), &options, &silent).unwrap().model;
        for (turned, node) in turned.nodes.iter().zip(&z.nodes) {
            assert_eq!(turned.map(f64::to_bits), from.map(|component| node[component].to_bits()), "{axis:?}");
        }
    }
}

#[test]
fn rejects_mesh_without_material() {
    let error = read_mesh(&data("blade_hex8.inp"), &MeshOptions::default(), &silent).unwrap_err();
    assert!(matches!(&error, Error::Read(read) if read.remedy.contains("--material")), "{error}");
}

#[test]
fn contact_nodes_of_single_layer_tip_are_at_mid_thickness() {
    let model = imported("sector.inp").model;
    for count in [1, 2, 3] {
        let choice = ContactChoice { count: Some(count), ..ContactChoice::default() };
        let chosen = choose_contact_nodes(&model.nodes, model.set("TIP").unwrap(), &choice).unwrap();
        for point in chosen {
            let [x, y, z] = model.nodes[point.node];
            assert!(y.abs() < 1e-9, "{count}: {} at {x} {y} {z}", point.name);
        }
    }
}
