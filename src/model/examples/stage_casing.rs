//! Reduces the casing of the stage and prints counts, frequencies and checks.
//!
//!     cargo run --release -p tiprub-model --example stage_casing -- [fixed-interface modes] [modes] [around] [hex8|hex8i|hex20]

use tiprub_model::element::{ElementKind, Formulation};
use tiprub_model::stage::casing::{StageCasingOptions, reduce_stage_casing};

fn main() -> tiprub_model::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let mut options = StageCasingOptions::default();
    let count =
        |index: usize, default: usize| arguments.get(index).and_then(|text| text.parse().ok()).unwrap_or(default);
    options.fixed_interface_modes = count(1, options.fixed_interface_modes);
    options.modes = count(2, options.modes);
    options.around = count(3, options.around);
    (options.kind, options.formulation) = match arguments.get(4).map(String::as_str) {
        Some("hex20") => (ElementKind::Hex20, Formulation::Displacement),
        Some("hex8") => (ElementKind::Hex8, Formulation::Displacement),
        _ => (ElementKind::Hex8, Formulation::IncompatibleModes),
    };
    let reduction = reduce_stage_casing(&options, &tiprub_model::progress::silent)?;
    println!("{}", reduction.rom.origin);
    println!(
        "{} nodes, {} elements, {} dofs, {} free, {} reduced coordinates",
        reduction.nodes,
        reduction.mesh.as_ref().map_or(0, |mesh| mesh.elements.len()),
        3 * reduction.nodes,
        reduction.free_dofs,
        reduction.rom.order()
    );
    println!("largest residual of the full modes {:.2e}", reduction.largest_residual);
    println!("mode  full (Hz)    deviation (%)  RCC (%)");
    let checks = &reduction.rom.checks;
    for k in 0..checks.full_frequencies.len() {
        let [deviation, residual] = [checks.frequency_deviation[k], checks.residual_criterion[k]];
        println!("{:4}  {:12.5} {deviation:12.3e} {residual:12.3e}", k + 1, checks.full_frequencies[k]);
    }
    let fixed = &reduction.fixed_interface_frequencies;
    println!("{} fixed-interface modes, {:.1} to {:.1} Hz", fixed.len(), fixed[0], fixed[fixed.len() - 1]);
    Ok(())
}
