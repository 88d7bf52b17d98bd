//! Meshes one sector of the parametric stage, prints its counts and quality and writes it for other programs.
//!
//!     cargo run --release -p tiprub-model --example stage [-- default|elements|coarse [BASE [n n ...]]]
//!
//! BASE.inp is a CalculiX input file of the sector with cyclic symmetry and a frequency step (ten modes) for each
//! nodal diameter n (default: 0, 2, 5, 28); BASE-blade.inp is the blade clamped at its root; BASE.vtu contains the
//! sector with its sets.

use tiprub_model::assembly::lumped_masses;
use tiprub_model::inp::{CyclicSymmetry, calculix_cyclic_input, calculix_input};
use tiprub_model::quality::worst_quality;
use tiprub_model::stage::{SectorOptions, blade_mesh, sector_mesh};
use tiprub_model::{Error, Material, Mesh, Result, vtk};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let options = match arguments.get(1).map_or("default", String::as_str) {
        "default" => SectorOptions::default(),
        "elements" => SectorOptions::with_3764_elements(),
        "coarse" => SectorOptions::coarse(),
        other => return Err(Error::invalid("mesh", other, "Say default, elements or coarse")),
    };
    let material = Material::titanium();
    let (sector, blade) = (sector_mesh(&options)?.mesh, blade_mesh(&options)?.mesh);
    for (name, mesh) in [("sector", &sector), ("blade", &blade)] {
        print_mesh(name, mesh, &material)?;
    }
    let (nodes, faces, sectors) = (sector.nodes.len(), sector.set("CYCLIC_LOW")?.len(), options.geometry.sectors);
    println!(
        "disk: {} dofs sector by sector, {} dofs in one piece",
        3 * sectors * nodes,
        3 * sectors * (nodes - faces)
    );
    let Some(base) = arguments.get(2) else { return Ok(()) };
    let number = |text: &String| text.parse().map_err(|_| Error::invalid("nodal diameter", text, "Give whole numbers"));
    let mut diameters: Vec<usize> = arguments[3..].iter().map(number).collect::<Result<_>>()?;
    if diameters.is_empty() {
        diameters = vec![0, 2, 5, 28];
    }
    let symmetry = CyclicSymmetry { faces: ["CYCLIC_LOW", "CYCLIC_HIGH"], sectors, nodal_diameters: &diameters };
    let text = calculix_cyclic_input(&sector, &material, Some("CLAMPED"), &symmetry, 10)?;
    let alone = calculix_input(&blade, &material, Some("CLAMPED"), 10)?;
    let files = [(".inp", text.into_bytes()), ("-blade.inp", alone.into_bytes()), (".vtu", vtk::write(&sector, &[])?)];
    files.into_iter().try_for_each(|(ending, bytes)| {
        let path = format!("{base}{ending}");
        std::fs::write(&path, bytes).map_err(|source| Error::File { path: path.into(), source })
    })
}

fn print_mesh(name: &str, mesh: &Mesh, material: &Material) -> Result<()> {
    let mass: f64 = lumped_masses(mesh, material.density)?.iter().sum();
    let (nodes, elements, quality) = (mesh.nodes.len(), mesh.elements.len(), worst_quality(mesh));
    println!("{name}: {nodes} nodes, {elements} elements, {} dofs, {mass:.6} kg", 3 * nodes);
    println!(
        "  least scaled Jacobian {:.4}, least ratio of Jacobians within an element {:.4}",
        quality.scaled_jacobian, quality.jacobian_ratio
    );
    for (name, set) in &mesh.sets {
        println!("  {name}: {} nodes", set.len());
    }
    Ok(())
}
