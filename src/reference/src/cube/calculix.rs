//! Scene as a CalculiX input file, for a comparison with an independent program.
//!
//! CalculiX calls the side whose nodes are checked the slave: here the cube, which is the master in the paper. Its
//! contact is a penalty between those nodes and the facets of the ring, and its kinematics are those of large
//! displacements.

use std::fmt::Write as _;

use tiprub_model::element::ElementKind;
use tiprub_model::{Material, Mesh};

use super::{CUBE_ELEMENTS, RingSide, SIDE, cube_material, cube_mesh, ring_material, ring_mesh};

/// Options of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalculixRun {
    /// Speed along −y (m/s).
    pub speed: f64,
    /// Coefficient of friction; 0 for none.
    pub friction: f64,
    /// Increment (s).
    pub increment: f64,
    /// End (s).
    pub end: f64,
    /// Pressure per overclosure (Pa/m).
    pub contact_stiffness: f64,
    /// Friction stress per sticking displacement (Pa/m).
    pub stick_stiffness: f64,
    /// True for finite strains (`NLGEOM`); contact follows the displaced bodies in either case.
    pub large: bool,
    /// True for contact between surfaces instead of nodes and surfaces.
    pub surfaces: bool,
}

/// Returns the text of the input file: full 3D, all three bodies, implicit steps of fixed size without numerical
/// damping.
pub fn input(run: &CalculixRun) -> String {
    let mut text = String::from("*HEADING\nCube between two rings; m, kg, s, N\n");
    let bodies = [
        ("CUBE", cube_mesh(), cube_material()),
        ("LEFT", ring_mesh(RingSide::Left), ring_material()),
        ("RIGHT", ring_mesh(RingSide::Right), ring_material()),
    ];
    let (mut first_node, mut first_element) = (1, 1);
    let mut cube_nodes = 0;
    for (name, mesh, material) in &bodies {
        write_body(&mut text, name, mesh, material, [first_node, first_element]);
        match *name {
            "CUBE" => {
                cube_nodes = mesh.nodes.len();
                for set in ["MASTER_LEFT", "MASTER_RIGHT"] {
                    if run.surfaces {
                        write_faces(&mut text, &format!("S_{set}"), mesh, set, first_element);
                    } else {
                        put(&mut text, format_args!("*SURFACE, NAME=S_{set}, TYPE=NODE\n{set}\n"));
                    }
                }
            }
            _ => write_faces(&mut text, &format!("F_{name}"), mesh, "SLAVE", first_element),
        }
        first_node += mesh.nodes.len();
        first_element += mesh.elements.len();
    }
    put(&mut text, format_args!("*BOUNDARY\nCLAMPED_LEFT, 1, 3\nCLAMPED_RIGHT, 1, 3\n"));
    put(&mut text, format_args!("*SURFACE INTERACTION, NAME=TOUCH\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"));
    put(&mut text, format_args!("{:e}, 0., 1e-3\n", run.contact_stiffness));
    if run.friction > 0.0 {
        put(&mut text, format_args!("*FRICTION\n{}, {:e}\n", run.friction, run.stick_stiffness));
    }
    let kind = if run.surfaces { "SURFACE TO SURFACE" } else { "NODE TO SURFACE" };
    for side in ["LEFT", "RIGHT"] {
        put(&mut text, format_args!("*CONTACT PAIR, INTERACTION=TOUCH, TYPE={kind}\nS_MASTER_{side}, F_{side}\n"));
    }
    put(&mut text, format_args!("*INITIAL CONDITIONS, TYPE=VELOCITY\n"));
    (1..=cube_nodes).for_each(|node| put(&mut text, format_args!("{node}, 2, {}\n", -run.speed)));
    put(
        &mut text,
        format_args!(
            "*STEP{}, INC=1000000\n*DYNAMIC, DIRECT, ALPHA=0.\n{:e}, {:e}\n",
            if run.large { ", NLGEOM" } else { "" },
            run.increment,
            run.end
        ),
    );
    put(&mut text, format_args!("*NODE PRINT, NSET=N_CUBE\nU\n"));
    put(&mut text, format_args!("*CONTACT PRINT\nCSTR\n"));
    put(&mut text, format_args!("*EL PRINT, ELSET=E_CUBE, TOTALS=ONLY\nELSE, ELKE\n*END STEP\n"));
    text
}

fn write_body(text: &mut String, name: &str, mesh: &Mesh, material: &Material, first: [usize; 2]) {
    put(text, format_args!("*NODE, NSET=N_{name}\n"));
    for (index, [x, y, z]) in mesh.nodes.iter().enumerate() {
        put(text, format_args!("{}, {x:.12e}, {y:.12e}, {z:.12e}\n", first[0] + index));
    }
    put(text, format_args!("*ELEMENT, TYPE=C3D8, ELSET=E_{name}\n"));
    for (index, element) in mesh.elements.iter().enumerate() {
        put(text, format_args!("{}", first[1] + index));
        element.nodes.iter().for_each(|node| put(text, format_args!(", {}", first[0] + node)));
        text.push('\n');
    }
    for (set, nodes) in &mesh.sets {
        let set = if name == "CUBE" { set.clone() } else { format!("{set}_{name}") };
        put(text, format_args!("*NSET, NSET={set}\n"));
        nodes.iter().for_each(|node| put(text, format_args!("{},\n", first[0] + node)));
    }
    let Material { young_modulus, poisson_ratio, density, .. } = material;
    put(
        text,
        format_args!("*MATERIAL, NAME=M_{name}\n*ELASTIC\n{young_modulus:e}, {poisson_ratio}\n*DENSITY\n{density}\n"),
    );
    put(text, format_args!("*SOLID SECTION, ELSET=E_{name}, MATERIAL=M_{name}\n"));
}

/// Writes the faces whose corners are all in a set as a surface.
fn write_faces(text: &mut String, name: &str, mesh: &Mesh, set: &str, first_element: usize) {
    put(text, format_args!("*SURFACE, NAME={name}, TYPE=ELEMENT\n"));
    for (index, element) in mesh.elements.iter().enumerate() {
        let inside =
            |face: &&[usize]| face.iter().all(|&corner| mesh.sets[set].binary_search(&element.nodes[corner]).is_ok());
        if let Some(face) = ElementKind::Hex8.faces().iter().position(inside) {
            put(text, format_args!("{}, S{}\n", first_element + index, face + 1));
        }
    }
}

/// Returns the area by which CalculiX multiplies the pressure of a master (m²): a quarter of every outer face at the
/// node, including those of the leading and trailing face and of the sides. The forces that its displacements require
/// confirm this to 1e-3.
pub fn area(mesh: &Mesh, node: usize) -> f64 {
    let face = (SIDE / CUBE_ELEMENTS as f64).powi(2);
    let corner = ["CORNERS_LEFT", "CORNERS_RIGHT"].iter().any(|set| mesh.sets[*set].contains(&node));
    if corner { 0.75 * face } else { face }
}

fn put(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String does not fail");
}
