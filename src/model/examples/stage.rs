//! Mesh one sector of the parametric stage and print what came of it.
//!
//!     cargo run --release -p tiprub-model --example stage [-- coarse|elements]

use tiprub_model::assembly::lumped_masses;
use tiprub_model::inp;
use tiprub_model::quality::worst_quality;
use tiprub_model::stage::{SectorOptions, blade_mesh, sector_mesh};
use tiprub_model::{Material, Result};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let options = match arguments.get(1).map(String::as_str) {
        Some("coarse") => SectorOptions::coarse(),
        Some("elements") => SectorOptions::with_3764_elements(),
        _ => SectorOptions::default(),
    };
    let material = Material::titanium();
    for (name, sector) in [("sector", sector_mesh(&options)?), ("blade", blade_mesh(&options)?)] {
        let mesh = &sector.mesh;
        let mass: f64 = lumped_masses(mesh, material.density)?.iter().sum();
        println!(
            "{name}: {} nodes, {} elements, {mass:.6} kg, {:?}",
            mesh.nodes.len(),
            mesh.elements.len(),
            worst_quality(mesh)
        );
        for (name, set) in &mesh.sets {
            println!("  {name}: {} nodes", set.len());
        }
        if let Some(path) = arguments.get(2) {
            inp::write_calculix_input(
                std::path::Path::new(&format!("{path}-{name}.inp")),
                mesh,
                &material,
                Some("CLAMPED"),
                10,
            )?;
        }
    }
    Ok(())
}
