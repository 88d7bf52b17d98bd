//! Reduce the bladed disk of the parametric stage and print what came of it: frequencies against nodal diameters, eqs 12 and 13
//! against the number of component modes, times.
//!
//!     cargo run --release -p tiprub-model --example stage_reduction [-- default|coarse [MODES [FILE.vtu]]]
//!
//! With a file name, the first modes of two nodal diameters are written on the whole disk.

use std::path::Path;

use tiprub_model::cyclic::{CyclicReduction, ModeSelection};
use tiprub_model::stage::{StageOptions, reduce_stage, sector_mesh};
use tiprub_model::vtk::{self, Field};
use tiprub_model::{Error, Result, progress};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let mut options = match arguments.get(1).map_or("default", String::as_str) {
        "default" => StageOptions::default(),
        "coarse" => StageOptions::coarse(),
        other => return Err(Error::invalid("mesh", other, "Say default or coarse")),
    };
    if let Some(text) = arguments.get(2) {
        let count = text.parse().map_err(|_| Error::invalid("number of modes", text, "Give a whole number"))?;
        options.modes = ModeSelection::Families(count);
    }
    let reduction = reduce_stage(&options, &progress::silent)?;
    println!("{}", reduction.rom.origin);
    println!("{} free dofs per sector; {}", reduction.free_dofs, reduction.notes.join("; "));
    print_frequencies(&reduction);
    print_convergence(&reduction);
    println!("highest reduced angular frequency {:.4e} rad/s", reduction.largest_angular_frequency);
    println!("{:?}, total {:.2} s", reduction.timings, reduction.timings.total());
    if let Some(path) = arguments.get(3) {
        let sectors = options.sector.geometry.sectors;
        let disk = vtk::disk(&sector_mesh(&options.sector)?.mesh, sectors);
        let shapes = &reduction.nodal_diameters[2].shapes;
        let field = |k: usize| Field::vectors(format!("n2_mode{}", k + 1), vtk::on_disk(&shapes[k], 2, sectors));
        let fields: Vec<Field> = (0..shapes.len().min(4)).map(field).collect();
        vtk::write_file(Path::new(path), &disk, &fields)?;
    }
    Ok(())
}

fn print_frequencies(reduction: &CyclicReduction) {
    println!("n, fixed-interface modes, frequencies of the full model (Hz)");
    for one in &reduction.nodal_diameters {
        let list: Vec<String> = one.full_frequencies.iter().map(|f| format!("{f:.1}")).collect();
        println!("{:2} {:3}  {}", one.number, one.fixed_interface_frequencies.len(), list.join(" "));
    }
}

fn print_convergence(reduction: &CyclicReduction) {
    println!("modes per nodal diameter, of the disk; largest deviation and criterion of its first modes (%)");
    for row in &reduction.convergence {
        let largest = |list: &[f64]| list.iter().copied().fold(0.0, f64::max);
        let (deviation, criterion) = (largest(&row.frequency_deviation), largest(&row.residual_criterion));
        let count = row.frequency_deviation.len();
        println!("{:3} {:5}  {deviation:.4e} {criterion:.4e} (of {count})", row.modes, row.total_modes);
    }
}
