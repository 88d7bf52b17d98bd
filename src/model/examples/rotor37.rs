//! Reduce the rotor 37 blade and print what came of it: counts, frequencies, checks, times.
//!
//!     cargo run --release -p tiprub-model --example rotor37 [-- file.inp [chord thickness span]]
//!
//! With a file name, the mesh is also written as a CalculiX input file (`*FREQUENCY`, ten modes). Three more numbers are
//! the element counts of the mesh.

use std::path::Path;

use tiprub_model::rotor37::MeshCounts;
use tiprub_model::{Error, Rotor37Options, inp, reduce_rotor37};

fn main() -> tiprub_model::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let mut options = Rotor37Options::default();
    if let Some(counts) = arguments.get(2..5) {
        let count =
            |text: &String| text.parse().map_err(|_| Error::invalid("element count", text, "Give whole numbers"));
        options.mesh =
            MeshCounts { chord: count(&counts[0])?, thickness: count(&counts[1])?, span: count(&counts[2])? };
    }
    let reduction = reduce_rotor37(&options, &tiprub_model::progress::silent)?;
    println!("{}", reduction.rom.origin);
    println!(
        "{} nodes, {} elements, {} free dofs",
        reduction.nodes,
        reduction.mesh.as_ref().map_or(0, |mesh| mesh.elements.len()),
        reduction.free_dofs
    );
    println!("largest residual of the full modes {:.2e}", reduction.largest_residual);
    println!("mode  full (Hz)    reduced (Hz)  deviation (%)  RCC (%)");
    let checks = &reduction.rom.checks;
    for k in 0..checks.full_frequencies.len() {
        println!(
            "{:4}  {:12.5} {:12.5} {:12.3e} {:12.3e}",
            k + 1,
            checks.full_frequencies[k],
            checks.reduced_frequencies[k],
            checks.frequency_deviation[k],
            checks.residual_criterion[k]
        );
    }
    let omega = &reduction.reduced_angular_frequencies;
    println!("first ten reduced angular frequencies (rad/s): {:.1?}", &omega[..10.min(omega.len())]);
    println!("highest reduced angular frequency: {:.4e} rad/s", omega[omega.len() - 1]);
    for node in &reduction.rom.contact_nodes {
        let [r, theta, z] = node.position;
        println!("{}: r {r:.6} m, theta {theta:.6} rad, z {z:.6} m, dr/dz {:.4}", node.name, node.meridional_slope);
    }
    println!("{:?}, total {:.2} s", reduction.timings, reduction.timings.total());
    if let (Some(path), Some(mesh), Some(material)) = (arguments.get(1), &reduction.mesh, &reduction.material) {
        inp::write_calculix_input(Path::new(path), mesh, material, Some("hub"), 10)?;
    }
    Ok(())
}
