//! Reduce the default casing and print what came of it: counts, frequencies, checks, times.
//!
//!     cargo run --release -p tiprub-model --example casing [-- file.inp [around through along]]
//!
//! With a file name, the mesh is also written as a CalculiX input file (`*FREQUENCY`, twenty modes). Three more numbers
//! are the element counts of the mesh.

use std::path::Path;

use tiprub_model::casing::{CLAMPED, RingCounts};
use tiprub_model::{CasingOptions, Error, inp, reduce_ring};

fn main() -> tiprub_model::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let mut options = CasingOptions::default();
    if let Some(counts) = arguments.get(2..5) {
        let count =
            |text: &String| text.parse().map_err(|_| Error::invalid("element count", text, "Give whole numbers"));
        let [around, through, along] = [count(&counts[0])?, count(&counts[1])?, count(&counts[2])?];
        options.counts = RingCounts { around, through, along, flange: through };
    }
    let reduction = reduce_ring(&options, &tiprub_model::progress::silent)?;
    println!("{}", reduction.rom.origin);
    println!(
        "{} nodes, {} elements, {} free dofs, {} reduced coordinates",
        reduction.nodes,
        reduction.mesh.as_ref().map_or(0, |mesh| mesh.elements.len()),
        reduction.free_dofs,
        reduction.rom.order()
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
    println!("highest reduced angular frequency: {:.4e} rad/s", omega[omega.len() - 1]);
    let fixed = &reduction.fixed_interface_frequencies;
    println!("{} fixed-interface modes, {:.1} to {:.1} Hz", fixed.len(), fixed[0], fixed[fixed.len() - 1]);
    println!("{:?}, total {:.2} s", reduction.timings, reduction.timings.total());
    if let (Some(path), Some(mesh), Some(material)) = (arguments.get(1), &reduction.mesh, &reduction.material) {
        inp::write_calculix_input(Path::new(path), mesh, material, Some(CLAMPED), 20)?;
    }
    Ok(())
}
